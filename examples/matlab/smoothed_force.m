% Estimates for every exported drive: half of mass times the accelerometer's reading behind a
% low-pass, as the force of the front axle. For MATLAB and for GNU Octave:
%
%   gripbench export longitudinal --seeds 20 --to drives
%   octave-cli smoothed_force.m drives        (MATLAB: folder = 'drives'; smoothed_force)
%   gripbench submit drives --name smoothed_force_m --reads accel_x
if ~exist('folder', 'var')
    given = argv();
    folder = given{1};
end
time_constant = 0.05;  % [s]

found = dir(folder);
for i = 1:numel(found)
    drive = fullfile(folder, found(i).name);
    file = fullfile(drive, 'observations.csv');
    if found(i).name(1) == '.' || ~exist(file, 'file')
        continue
    end

    input = fopen(file);
    names = strsplit(strtrim(fgetl(input)), ',');
    % one row a sample; a value that is missing is NaN
    values = fscanf(input, [repmat('%f,', 1, numel(names) - 1), '%f'], [numel(names), Inf])';
    fclose(input);
    time = values(:, strcmp(names, 'time'));
    accel_x = values(:, strcmp(names, 'accel_x'));

    input = fopen(fullfile(drive, 'vehicle.csv'));
    paper = textscan(input, '%s %f', 'Delimiter', ',', 'HeaderLines', 1);
    fclose(input);
    mass = paper{2}(strcmp(paper{1}, 'mass'));

    output = fopen(fullfile(drive, 'estimates.csv'), 'w');
    fprintf(output, 'time,force_x_front\n');
    smooth = 0.0;
    before = 0.0;
    for k = 1:numel(time)
        elapsed = time(k) - before;
        before = time(k);
        smooth = smooth + elapsed / (time_constant + elapsed) * (accel_x(k) - smooth);
        fprintf(output, '%.17g,%.17g\n', time(k), 0.5 * mass * smooth);
    end
    fclose(output);
end
