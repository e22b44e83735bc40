// Estimates for every exported drive: half of mass times the accelerometer's reading behind a
// low-pass, as the force of the front axle.
//
//   g++ -std=c++17 -O2 smoothed_force.cpp -o smoothed_force
//   gripbench export longitudinal --seeds 20 --to drives
//   ./smoothed_force drives
//   gripbench submit drives --name smoothed_force_cpp --reads accel_x
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace fs = std::filesystem;

static std::vector<std::string> split(const std::string &line) {
    std::vector<std::string> parts;
    std::stringstream stream(line);
    for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
    return parts;
}

static std::map<std::string, double> read_vehicle(const fs::path &path) {
    std::map<std::string, double> vehicle;
    std::ifstream input(path);
    std::string line;
    std::getline(input, line);  // parameter,value
    while (std::getline(input, line)) {
        const auto parts = split(line);
        vehicle[parts.at(0)] = std::strtod(parts.at(1).c_str(), nullptr);
    }
    return vehicle;
}

static void estimate(const fs::path &drive) {
    const double time_constant = 0.05;  // [s]
    const double mass = read_vehicle(drive / "vehicle.csv").at("mass");
    std::ifstream input(drive / "observations.csv");
    std::ofstream output(drive / "estimates.csv");
    output << "time,force_x_front\n" << std::setprecision(17);
    std::string line;
    std::getline(input, line);
    std::map<std::string, size_t> column;
    const auto names = split(line);
    for (size_t i = 0; i < names.size(); ++i) column[names[i]] = i;
    double smooth = 0.0, before = 0.0;
    while (std::getline(input, line)) {
        const auto values = split(line);  // a value that is missing is NaN
        const double time = std::strtod(values.at(column.at("time")).c_str(), nullptr);
        const double accel_x = std::strtod(values.at(column.at("accel_x")).c_str(), nullptr);
        const double elapsed = time - before;
        before = time;
        smooth += elapsed / (time_constant + elapsed) * (accel_x - smooth);
        output << time << ',' << 0.5 * mass * smooth << '\n';
    }
}

int main(int count, char **arguments) {
    if (count != 2) {
        std::cerr << "give the exported folder\n";
        return 2;
    }
    for (const auto &entry : fs::directory_iterator(arguments[1]))
        if (fs::exists(entry.path() / "observations.csv")) estimate(entry.path());
    return 0;
}
