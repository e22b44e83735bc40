"""Tables of text as loggers and tools write them give the same columns as the plain one."""

import gzip
import re
import tomllib

import numpy as np
import pytest

from gripbench.errors import InputError
from gripbench.logs.importing import import_log
from gripbench.logs.mapping.inspection import inspect_log
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.reading import read_log

ROWS = [(k * 0.01, 0.2 * np.sin(0.3 * k), 3.0 * np.cos(0.2 * k)) for k in range(40)]


def _lines(separator=",", pattern="{:.6f}", end=""):
    return [separator.join(pattern.format(v) for v in row) + end for row in ROWS]


def _table(head, rows, foot=()):
    return "\n".join([*head, *rows, *foot]) + "\n"


HEAD = "time,yaw_rate,accel_y"
MOTEC = ['"Format","MoTeC CSV File",,,"Workbook",""', '"Venue","Track"', '"Vehicle","Car"', "", "",
         '"time","yaw_rate","accel_y"', '"s","rad/s","m/s^2"', "", ""]  # fmt: skip
DIALECTS = {
    "plain": _table([HEAD], _lines()),
    "preamble": _table(["Logger 3.1", "Car, my car", "", "Note:", HEAD], _lines()),
    "motec": _table(MOTEC, ['"' + line.replace(",", '","') + '"' for line in _lines()]),
    "units and sources": _table([HEAD, "s,rad/s,m/s^2", ",100: imu,100: imu"], _lines()),
    "bracketed units": _table([HEAD, "[s],[rad/s],[m/s²]"], _lines()),
    "comments": _table(["# logger", "# more", HEAD], [*_lines()[:9], "# mark", *_lines()[9:]]),
    "comment as header": _table(["#" + HEAD], _lines()),
    "percent as header": _table(["%" + HEAD], _lines()),
    "trailing comma": _table([HEAD + ","], _lines(end=",")),
    "rows end in a comma": _table([HEAD], _lines(end=",")),
    "padded": _table(["time, yaw_rate,   accel_y"], _lines(", ", "{:>12.6f}")),
    "spaces": _table(["time  yaw_rate   accel_y"], _lines("   ")),
    "leading spaces": _table(["  time yaw_rate accel_y"], ["  " + x for x in _lines("  ")]),
    "tabs": _table(["time\tyaw_rate\taccel_y"], _lines("\t")),
    "semicolons": _table(["time;yaw_rate;accel_y"], _lines(";")),
    "pipes": _table(["time|yaw_rate|accel_y"], _lines("|")),
    "footer": _table([HEAD], _lines(), ["END OF FILE"]),
    "blank lines": _table(["", HEAD, ""], _lines(), ["", ""]),
    "windows ends": _table([HEAD], _lines()).replace("\n", "\r\n"),
    "old ends": _table([HEAD], _lines()).replace("\n", "\r"),
    "header again": _table([HEAD], [*_lines()[:20], HEAD, *_lines()[20:]]),
    "names in quotes": _table(['"time","yaw_rate","accel_y"'], _lines()),
}


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("suffix", [".csv", ".TXT", ".csv.gz"])
def test_every_dialect_gives_the_columns(tmp_path, name, suffix):
    path = tmp_path / f"log{suffix}"
    data = DIALECTS[name].encode()
    path.write_bytes(gzip.compress(data) if suffix.endswith("gz") else data)
    log = read_log(path)
    assert log.names == ("time", "yaw_rate", "accel_y")
    for index, column in enumerate(log.names):
        values = log.numbers(column, "x")
        expected = np.round([row[index] for row in ROWS], 6)
        np.testing.assert_allclose(values[np.isfinite(values)], expected, atol=1e-12)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16"])
def test_german_exports(tmp_path, encoding):
    path = tmp_path / "messung.csv"
    rows = [line.replace(".", ",") for line in _lines(";")]
    head = ["Zeit [s];Gierrate [°/s];Querbeschl [m/s²]"]
    path.write_bytes(_table(head, rows).encode(encoding))
    proposal = inspect_log(path).proposal
    (tmp_path / "map.toml").write_text(proposal)
    seen = import_log(path, tmp_path / "map.toml").recordings[0].observations
    np.testing.assert_allclose(seen["yaw_rate"], np.deg2rad([r[1] for r in ROWS]), atol=1e-7)
    np.testing.assert_allclose(seen["accel_y"], [r[2] for r in ROWS], atol=1e-6)


@pytest.mark.parametrize("word", ["-", "ERR", "NA", "#N/A", "NaN", "", "n/a", "Invalid", "***"])
def test_words_for_no_value_are_blanks(tmp_path, word):
    path = tmp_path / "log.csv"
    rows = _lines()
    for k in range(5, 25):
        rows[k] = rows[k].rpartition(",")[0] + "," + word
    path.write_text(_table([HEAD], rows))
    values = read_log(path).numbers("accel_y", "x")
    assert np.isnan(values).sum() == 20
    assert np.isnan(values[5:25]).all()


def test_other_words_among_numbers_are_blanks_and_told(tmp_path):
    path = tmp_path / "log.csv"
    rows = _lines()
    rows[7] = rows[7].rpartition(",")[0] + ",sensor off"
    path.write_text(_table([HEAD], rows))
    log = read_log(path)
    assert np.isnan(log.numbers("accel_y", "x")[7])
    assert any("'sensor off'" in note for note in log.notes)


def test_repeated_names_are_told_apart_and_never_taken_for_one(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,speed,speed\n0,1,2\n1,3,4\n")
    log = read_log(path)
    assert log.names == ("time", "speed#1", "speed#2")
    with pytest.raises(InputError, match=r"two columns are called 'speed'.*'speed#1', 'speed#2'"):
        log.column("speed", "x")
    path.write_text("time,speed,speed\ns,m/s,m/s\n,gps,calc\n0,1,2\n1,3,4\n2,3,4\n")
    assert read_log(path).names == ("time", "speed (gps)", "speed (calc)")


def test_columns_without_name_are_called_by_number(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(_table([], _lines()))
    assert read_log(path).names == ("1", "2", "3")
    path.write_text(_table([",yaw_rate,accel_y"], _lines()))
    assert read_log(path).names == ("1", "yaw_rate", "accel_y")
    assert 'column = "1"' in inspect_log(path).proposal


@pytest.mark.parametrize(
    ("stamps", "lines"),
    [
        (["05/13/2025 10:00:00.000", "05/13/2025 10:00:00.010", "05/13/2025 10:00:01.000"], 1.0),
        (["13.05.2025 23:59:59,5", "14.05.2025 00:00:00,0", "14.05.2025 00:00:01,5"], 2.0),
        (["23:59:59.5", "00:00:00.0", "00:00:01.5"], 2.0),
        (["5/3/2025 11:59:59 AM", "5/3/2025 12:00:00 PM", "5/3/2025 1:00:00 PM"], 3601.0),
        (["2025-05-13T10:00:00Z", "2025-05-13T10:00:00.5Z", "2025-05-13T10:00:02Z"], 2.0),
    ],
)
def test_dates_as_tools_write_them(tmp_path, stamps, lines):
    path = tmp_path / "log.csv"
    rows = [f'"{stamp}",{k}.5' for k, stamp in enumerate(stamps)]
    path.write_text(_table(["time,yaw_rate"], rows))
    (tmp_path / "map.toml").write_text(
        'name = "x"\n[time]\ncolumn = "time"\nunit = "datetime"\n'
        '[channels.yaw_rate]\ncolumn = "yaw_rate"\nunit = "deg/s"\n'
    )
    seen = import_log(path, tmp_path / "map.toml").recordings[0].observations
    assert seen["time"][-1] == pytest.approx(lines, abs=1e-6)


def test_rows_of_another_length_are_refused_by_their_line(tmp_path):
    path = tmp_path / "log.csv"
    rows = _lines()
    rows[10] += ",5"
    path.write_text(_table([HEAD], rows))
    with pytest.raises(InputError, match=r"line 12: the row has 4 values, the header names 3"):
        read_log(path)
    rows = _lines()
    rows[10] = "0.1,3"
    path.write_text(_table([HEAD], rows))
    with pytest.raises(InputError, match=r"line 12: the row has 2 values, the header names 3"):
        read_log(path)


def test_a_header_may_be_named_by_its_line(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(_table(["a,b,c", "d,e,f"], _lines()))
    assert read_log(path, LogFile(path="log.csv", header=2)).names == ("d", "e", "f")


@pytest.mark.parametrize("data", [b"\x00\x01\x02" * 50, b"nothing here\nat all\n", b"a,b,c\n"])
def test_no_table_is_one_line(tmp_path, data):
    path = tmp_path / "log.csv"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"log\.csv") as caught:
        read_log(path)
    assert "\n" not in str(caught.value)


def test_a_folder_of_one_column_files_is_one_log(tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    for index, name in enumerate(("Time", "YawRate", "AccelY")):
        text = "\n".join(f"{row[index]:.6f}" for row in ROWS)
        (folder / f"{name}.txt").write_text(text + "\n")
    log = read_log(folder)
    assert set(log.names) == {"Time", "YawRate", "AccelY"}
    (tmp_path / "map.toml").write_text(inspect_log(folder).proposal)
    seen = import_log(folder, tmp_path / "map.toml").recordings[0].observations
    np.testing.assert_allclose(seen["yaw_rate"], np.round([r[1] for r in ROWS], 6), atol=1e-12)


def test_tables_in_a_folder_are_joined_on_time(tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "imu.csv").write_text(_table([HEAD], _lines()))
    gps = [f"{0.1 * k:.1f},{20 + k}" for k in range(4)]
    (folder / "gps.csv").write_text(_table(["time,gps_speed"], gps))
    (tmp_path / "map.toml").write_text(inspect_log(folder).proposal)
    seen = import_log(folder, tmp_path / "map.toml").recordings[0].observations
    assert set(seen["speed_gps"]) == {20.0, 21.0, 22.0, 23.0}
    assert len(seen) == len(ROWS)


VBO = """File created on 05/05/2025

[header]
satellites
time
latitude
longitude
velocity kmh
heading
Yaw_Rate

[channel units]
Deg/s

[column names]
sats time lat long velocity heading Yaw_Rate

[data]
012 235959.500 +2880.600 -0659.400 072.000 090.000 +1.0E+00
012 000000.500 +2880.000 +0660.000 036.000 180.000 -2.0E+00
"""


def test_vbox(tmp_path):
    path = tmp_path / "drive.vbo"
    path.write_text(VBO)
    log = read_log(path)
    np.testing.assert_allclose(np.diff(log.numbers("time", "x")), 1.0)
    np.testing.assert_allclose(log.numbers("lat", "x"), [48.01, 48.0])
    np.testing.assert_allclose(log.numbers("long", "x"), [10.99, -11.0])
    (tmp_path / "map.toml").write_text(inspect_log(path).proposal)
    seen = import_log(path, tmp_path / "map.toml").recordings[0].observations
    np.testing.assert_allclose(seen["speed_gps"], [20.0, 10.0])
    np.testing.assert_allclose(seen["course"], np.deg2rad([-90.0, -180.0]))
    np.testing.assert_allclose(seen["yaw_rate"], np.deg2rad([1.0, -2.0]))


def _handling(tmp_path, change=lambda text: text, time="time_s"):
    """Return a file of speed, lateral acceleration and yaw rate, as text that was changed."""
    t = np.arange(0.0, 20.0, 0.01)
    rate = 0.3 * np.sin(1.3 * t)
    days = 45_000.0 + t / 86_400.0 if time == "Time" else t
    lines = [f"{time},speed_kmh,yawrate_degs,latacc_g"]
    lines += [
        f"{a:.12g},{72.0:.3f},{np.rad2deg(b):.6e},{20.0 * b / 9.81:.6e}"
        for a, b in zip(days, rate, strict=True)
    ]
    path = tmp_path / "drive.csv"
    path.write_text(change("\n".join(lines) + "\n"), encoding="utf-8")
    return path, rate


@pytest.mark.parametrize(
    "change",
    [lambda text: text.replace("-", "\u2212"), lambda text: re.sub(r"e(?=[-+]\d)", "D", text)],
)
def test_typographic_minus_and_exponents_of_fortran_are_numbers(tmp_path, change):
    path, rate = _handling(tmp_path, change)
    log = read_log(path, LogFile(path=path.name))
    np.testing.assert_allclose(log.columns["yawrate_degs"].values, np.rad2deg(rate), atol=1e-4)
    assert tomllib.loads(inspect_log(path).proposal)["channels"].keys() >= {"yaw_rate", "accel_y"}


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path):
    path, _ = _handling(tmp_path, time="Time")
    assert tomllib.loads(inspect_log(path).proposal)["time"]["unit"] == "d"


def test_a_signal_whose_column_holds_text_is_named_with_the_reason(tmp_path):
    path, _ = _handling(tmp_path, lambda text: re.sub(r"(?m)^([^t][^,]*,[^,]*),", r"\1,~", text))
    proposal = inspect_log(path).proposal
    assert '"yawrate_degs": yaw_rate by its name, but it holds text such as "~' in proposal
