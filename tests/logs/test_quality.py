"""Faults put into a sound log are found, and the mend that the report suggests mends them."""

import re
import tomllib

import numpy as np
import pytest

from gripbench.logs.importing import import_frame
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.logs.mapping.inspection import inspect_log


def _content(folder):
    content = tomllib.loads((folder / "map.toml").read_text())
    content["vehicle"] = str(folder / "car.toml")
    return content


def _found(report, check):
    return [finding for finding in report.findings if finding.check == check]


def test_sound_log_has_nothing_wrong(folder, frame):
    report = import_frame(frame, _content(folder)).report
    assert not report.of("wrong")
    assert not _found(report, "jumps")
    assert not _found(report, "stuck")
    assert not _found(report, "saturation")
    assert not _found(report, "gaps")


_WRONG = [
    ("yaw_rate", "sign", 1), ("yaw_rate", "unit", "rad/s"), ("accel_x", "sign", -1),
    ("accel_x", "unit", "g"), ("accel_y", "sign", 1), ("accel_y", "unit", "m/s^2"),
    ("accel_z", "sign", 1), ("accel_z", "unit", "m/s^2"), ("steer_angle", "sign", -1),
    ("steer_angle", "unit", "rad"), ("steer_angle", "scale", 1.0), ("course", "sign", 1),
    ("speed_gps", "unit", "mph"), ("speed_gps", "unit", "m/s"), ("wheel_speed_rear", "unit", "m/s"),
]  # fmt: skip


@pytest.mark.parametrize(("channel", "key", "value"), _WRONG)
def test_wrong_sign_or_unit_is_found_and_the_mend_mends(folder, frame, channel, key, value):
    content = _content(folder)
    right = content["channels"][channel].get(key, 1)
    content["channels"][channel][key] = value
    findings = import_frame(frame, content).report.of("wrong")
    assert len(findings) == 1
    assert findings[0].channel == f"channels.{channel}"
    suggested = re.match(rf'channels\.{channel}: {key} = "?([^"; ]+)"?', findings[0].suggestion)
    assert suggested, findings[0].suggestion
    if key == "scale":
        assert float(suggested.group(1)) == pytest.approx(right, rel=0.5)
    else:
        assert suggested.group(1) == str(right)


def test_two_wrong_signs_are_found_together(folder, frame):
    content = _content(folder)
    content["channels"]["yaw_rate"]["sign"] = 1
    content["channels"]["accel_x"]["sign"] = -1
    (finding,) = import_frame(frame, content).report.of("wrong")
    assert "channels.accel_x: sign = 1" in finding.suggestion
    assert "channels.yaw_rate: sign = -1" in finding.suggestion


def test_wrong_sign_of_the_sideslip_reference(folder, frame):
    content = _content(folder)
    v, beta = frame["wheel"] / 3.6, np.deg2rad(frame["beta"])
    frame["vx"], frame["vy"] = v * np.cos(beta), v * np.sin(beta)
    content["reference"] |= {
        "speed_x": {"column": "vx", "unit": "m/s"},
        "speed_y": {"column": "vy", "unit": "m/s"},
    }
    assert not import_frame(frame, content).report.of("wrong")
    content["reference"]["sideslip"]["sign"] = -1
    (finding,) = import_frame(frame, content).report.of("wrong")
    assert "reference.sideslip: sign = 1" in finding.suggestion


@pytest.mark.parametrize(
    ("check", "fault"),
    [
        ("gaps", lambda f: f.drop(index=range(1000, 1100))),
        ("stuck", lambda f: f.assign(acc_fwd=f["acc_fwd"].where(abs(f.index - 1600) > 99, 0.3))),
        ("jumps", lambda f: f.assign(gyro_down=f["gyro_down"].where(f.index != 1700, 200.0))),
        ("saturation", lambda f: f.assign(acc_right=f["acc_right"].clip(-0.2, 0.2))),
        ("times", lambda f: f.assign(t=f["t"].where(f.index != 1200, f["t"].shift(1)))),
        ("times", lambda f: f.assign(acc_fwd=f["acc_fwd"].where(f.index != 900, np.inf))),
    ],
)  # fmt: skip
def test_fault_is_found_and_nothing_is_repaired(folder, frame, check, fault):
    faulty = fault(frame).reset_index(drop=True)
    imported = import_frame(faulty, _content(folder))
    assert _found(imported.report, check), imported.report.text()
    if check in ("jumps", "saturation", "stuck"):
        seen = imported.recordings[0].observations
        np.testing.assert_allclose(seen["accel_x"], faulty["acc_fwd"], rtol=1e-12)
        np.testing.assert_allclose(seen["yaw_rate"], -np.deg2rad(faulty["gyro_down"]), rtol=1e-12)


def test_report_puts_the_worst_first(folder, frame):
    content = _content(folder)
    content["channels"]["yaw_rate"]["sign"] = 1
    lines = import_frame(frame, content).report.text().splitlines()
    assert lines[0].startswith("wrong")
    assert "-> channels.yaw_rate: sign = -1" in lines[0]


def test_inspection_proposes_a_map_that_reads_the_log(folder, frame):
    names = {
        "t": "time_ms", "gyro_down": "gyro_down_deg", "acc_right": "acc_right_g",
        "acc_fwd": "acc_fwd", "wheel": "wheel_rl_kmh", "gps_course": "gnss_course_deg",
        "beta": "beta_deg",
    }  # fmt: skip
    path = folder / "seen.csv"
    frame.rename(columns=names)[list(names.values())].to_csv(path, index=False)
    inspection = inspect_log(path)
    assert inspection.time == "time_ms"
    assert {column.name for column in inspection.columns} == set(names.values())
    content = tomllib.loads(inspection.proposal)
    assert content["time"] == {"column": "time_ms", "unit": "ms"}
    assert content["channels"]["accel_y"] == {"column": "acc_right_g", "unit": "g", "sign": -1}
    assert content["channels"]["course"]["sign"] == -1
    assert content["reference"]["sideslip"]["unit"] == "deg"
    assert content["channels"]["wheel_speed_rear_left"]["per"] == "wheel_radius"
    ChannelMap.model_validate(content)
