"""Every mistake in a map or a log is one line that names file and key."""

import copy

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gripbench.errors import GripbenchError, InputError
from gripbench.logs.importing import import_frame, import_log


def _csv(folder, text, unit="s", extra=""):
    path = folder / "log.csv"
    path.write_text(text)
    (folder / "map.toml").write_text(
        f'name = "x"\n{extra}\n[time]\ncolumn = "t"\nunit = "{unit}"\n'
        '[channels.yaw_rate]\ncolumn = "r"\nunit = "rad/s"\n'
    )
    return path, folder / "map.toml"


@pytest.mark.parametrize(
    ("text", "unit", "extra", "message"),
    [
        ("t;r\n0,1;1,5\n0,2;1,6\n", "s", "", r"log\.csv.*column 'r' has decimal commas.*decimal"),
        ("t,r\n0,1,1,5\n", "s", "", r"log\.csv.*row has 4 values, the header names 2"),
        ("t,r\n0,1\n1,abc\n", "s", "", r"log\.csv.*yaw_rate\.column'.*holds text \('abc'\)"),
        ("t,q\n0,1\n1,2\n", "s", "", r"log\.csv.*'channels\.yaw_rate\.column'.*no column 'r'"),
        ("s,r\n0,1\n1,2\n", "s", "", r"log\.csv.*'time\.column'.*no column 't'"),
        ("t,r\n0,1\n", "s", "", r"log\.csv.*only 1 sample"),
        ("t,r\n", "s", "", r"log\.csv.*no rows"),
        ("t,r\n3,1\n2,2\n1,3\n", "s", "", r"log\.csv.*'channels\.yaw_rate'.*backwards at sample 2"),
        ("t,r\n1,1\n1,2\n1,3\n", "s", "", r"log\.csv.*only 1 sample"),
        ("t,r\n0,\n1,\n", "s", "", r"log\.csv.*'r' has no sample"),
        ("t,r,r\n0,1,1\n", "s", "", r"log\.csv.*two columns are called 'r'"),
        ("0,1\n1,2\n", "s", "", r"log\.csv.*must name the columns"),
        (
            "t,r\n2024-03-01T10:00:00Z,1\n2024-03-01T12:00:01+02:00,2\n", "datetime", "",
            r"log\.csv.*'time\.column'.*mix time zones",
        ),
        ("t,r\n2024-03-01 10:00,1\n", "s", "", r"log\.csv.*unit = \"datetime\""),
        ("t,r\n0,1\n1,2\n", "datetime", "", r"log\.csv.*numbers, not dates"),
        ("t,r\nmonday,1\ntuesday,2\n", "datetime", "", r"log\.csv.*not all dates are ISO 8601"),
        ("t,r\n0,1\n1,2\n", "s", f'sha256 = "{"0" * 64}"', r"log\.csv.*'sha256'.*another file"),
        ("t,r\n0,1\n1,2\n", "s", "score_from = 5.0", r"'score_from'.*not before the end"),
        ("t,r\n0,1\n1,2\n", "s", "[derived]\ninstruments = ['speed_x']", "has no 'speed_x'"),
        ("t,r\n0,1\n1,2\n", "s", "[derived]\nvelocity_window = 0.1", "has no 'position_x'"),
    ],
)  # fmt: skip
def test_bad_csv(tmp_path, text, unit, extra, message):
    path, channel_map = _csv(tmp_path, text, unit, extra)
    with pytest.raises(InputError, match=message) as caught:
        import_log(path, channel_map)
    assert "\n" not in str(caught.value)


def test_decimal_commas_are_read_when_declared(tmp_path):
    path, channel_map = _csv(tmp_path, "t;r\n0,5;1,5\n0,75;1,6\n", extra='decimal = ","')
    seen = import_log(path, channel_map).recordings[0].observations
    np.testing.assert_allclose(seen["time"], [0.0, 0.25])
    np.testing.assert_allclose(seen["yaw_rate"], [1.5, 1.6])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": "deg/hour"}, r"map\.toml.*channels.*unknown unit 'deg/hour'"),
        ({"unit": "m/s"}, r"map\.toml.*unit 'm/s' is no unit of a signal in rad/s"),
        ({"sign": 2}, r"map\.toml.*channels\.yaw_rate\.sign"),
        ({"scale": 0.0}, r"map\.toml.*channels\.yaw_rate\.scale"),
        ({"per": "wheel"}, r"map\.toml.*channels\.yaw_rate\.per.*unknown vehicle parameter"),
        ({"colum": "r"}, r"map\.toml.*unknown key 'channels\.yaw_rate\.colum'.*'column'"),
        ({"delay": -1.0}, r"map\.toml.*channels\.yaw_rate\.delay"),
    ],
)
def test_bad_map(tmp_path, change, message):
    path, channel_map = _csv(tmp_path, "t,r\n0,1\n1,2\n")
    lines = "".join(f"{k} = {v!r}\n" for k, v in change.items())
    text = channel_map.read_text()
    for key in change:
        text = "\n".join(line for line in text.split("\n") if not line.startswith(f"{key} ="))
        if key == "unit":
            text = text.replace('column = "t"', 'column = "t"\nunit = "s"')
    channel_map.write_text(text + lines)
    with pytest.raises(InputError, match=message):
        import_log(path, channel_map)


def test_signals_are_checked(tmp_path):
    path, channel_map = _csv(tmp_path, "t,r\n0,1\n1,2\n")
    channel_map.write_text(channel_map.read_text().replace("channels.yaw_rate", "channels.yawrate"))
    with pytest.raises(InputError, match=r"map\.toml.*unknown signal 'yawrate'.*'yaw_rate'"):
        import_log(path, channel_map)


def test_vehicle_without_the_parameter_is_named(tmp_path):
    path, channel_map = _csv(tmp_path, "t,r\n0,1\n1,2\n")
    text = channel_map.read_text().replace("channels.yaw_rate", "channels.wheel_speed_rear")
    channel_map.write_text(text.replace('unit = "rad/s"', 'unit = "m/s"\nper = "wheel_radius"'))
    with pytest.raises(InputError, match=r"channels\.wheel_speed_rear\.per.*no 'wheel_radius'"):
        import_log(path, channel_map)


def test_files_on_two_clocks_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text("t,r\n0,1\n1,2\n")
    (tmp_path / "b.csv").write_text("t,a\n100,1\n101,2\n")
    channel_map = tmp_path / "map.toml"
    channel_map.write_text(
        'name = "x"\n[files.a]\npath = "a.csv"\ntime = {column = "t"}\n'
        '[files.b]\npath = "b.csv"\ntime = {column = "t"}\n'
        '[channels.yaw_rate]\nfile = "a"\ncolumn = "r"\nunit = "rad/s"\n'
        '[channels.accel_x]\nfile = "b"\ncolumn = "a"\nunit = "m/s^2"\n'
    )
    with pytest.raises(InputError, match="their clocks differ"):
        import_log(tmp_path, channel_map)
    text = channel_map.read_text().replace('"b.csv"\ntime = {', '"b.csv"\ntime = {shift = -100.0, ')
    channel_map.write_text(text)
    assert len(import_log(tmp_path, channel_map).recordings[0].observations) == 2


def test_backwards_rows_are_dropped_when_the_map_says_so_and_reported(tmp_path):
    path, channel_map = _csv(tmp_path, "t,r\n0,1\n2,2\n1,3\n3,4\n")
    text = channel_map.read_text().replace('unit = "s"', 'unit = "s"\nbackwards = "drop"', 1)
    channel_map.write_text(text)
    imported = import_log(path, channel_map)
    assert list(imported.recordings[0].observations["yaw_rate"]) == [1.0, 2.0, 4.0]
    assert any("1 rows go back" in finding.message for finding in imported.report.findings)


def test_file_that_ends_within_a_line_is_reported(tmp_path):
    path, channel_map = _csv(tmp_path, "t,r\n0,1\n1,2\n2,3.4")
    found = import_log(path, channel_map).report.of("warning")
    assert any("may be cut off" in finding.message for finding in found)


_FRAME = pd.DataFrame({"t": np.arange(5.0), "r": np.arange(5.0) * 0.1, "text": list("abcde")})
_MAP = {
    "name": "x",
    "time": {"column": "t", "unit": "s"},
    "channels": {"yaw_rate": {"column": "r", "unit": "rad/s", "sign": 1}},
    "reference": {"yaw": {"column": "r", "unit": "rad"}},
    "windows": {"test": [[0.0, 4.0]]},
}
_PATHS = [
    ("name",), ("time",), ("time", "column"), ("time", "unit"), ("channels",), ("windows",),
    ("channels", "yaw_rate"), ("channels", "yaw_rate", "unit"), ("channels", "yaw_rate", "sign"),
    ("channels", "yaw_rate", "column"), ("reference", "yaw", "column"), ("reference",),
    ("windows", "test"), ("rows",), ("runs",), ("derived",), ("bounds",), ("score_from",),
    ("channels", "yaw_rate", "offset"), ("channels", "yaw_rate", "rate"), ("training_runs",),
    ("channels", "yaw_rate", "time"), ("channels", "yaw_rate", "zero"), ("files",), ("vehicle",),
]  # fmt: skip
_ANYTHING = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 10**20), st.floats(), st.text(max_size=8),
    st.sampled_from(["r", "t", "text", "deg/s", "rad", "m/s", "datetime", "li2014", "yaw_rate"]),
    st.lists(st.integers(-2, 2), max_size=2),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(_PATHS), _ANYTHING), min_size=1, max_size=3))
def test_no_map_brings_a_traceback_or_samples_that_are_not_in_the_log(changes):
    content = copy.deepcopy(_MAP)
    for path, value in changes:
        place = content
        for part in path[:-1]:
            place = place.get(part) if isinstance(place, dict) else None
        if isinstance(place, dict):
            place[path[-1]] = value
    message = ""
    try:
        found = import_frame(_FRAME, content)
    except GripbenchError as error:
        message = str(error)
        found = None
    assert (found is None) == bool(message)
    if found is None:
        assert "\n" not in message
        return
    entry = found.provenance.channel_map["channels"]["yaw_rate"]
    unit = {"rad/s": 1.0, "deg/s": np.pi / 180.0}[entry["unit"]]
    raw = _FRAME[entry["column"]].to_numpy() - entry.get("offset", 0.0)
    expected = entry.get("sign", 1) * unit * raw
    for recording in found.recordings:
        assert np.isfinite(recording.observations["yaw_rate"]).all()
        assert np.isin(np.round(recording.observations["yaw_rate"], 9), np.round(expected, 9)).all()
