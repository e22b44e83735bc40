"""Signs, units and clocks of every channel are noticed, and following the report makes it clean."""

import copy

import numpy as np
import pytest
from single_track import MAP, drive

from gripbench.errors import InputError
from gripbench.logs.importing import import_frame

CHECKS = ("physics", "clock", "limits")


def _report(frame, content):
    return [f for f in import_frame(frame, content).report.findings if f.check in CHECKS]


def _followed(content, findings):
    """Return the map with every suggestion of the findings in it."""
    changed = copy.deepcopy(content)
    for finding in findings:
        for key, keys in finding.changes.items():
            place = changed
            for part in key.split("."):
                place = place[part]
            place |= keys
    return changed


@pytest.fixture(scope="module")
def frame():
    return drive()


def test_a_sound_log_is_clean(frame):
    assert not _report(frame, MAP)


@pytest.mark.parametrize("late", [0.1, 0.3, 1.0, -0.2])
@pytest.mark.parametrize("name", ["beta", "yaw", "vy"])
def test_a_late_reference_is_noticed_and_moved_back(frame, late, name):
    signal, unit = {"beta": ("sideslip", "rad"), "yaw": ("yaw", "rad"), "vy": ("speed_y", "m/s")}[
        name
    ]
    content = MAP | {"reference": {signal: {"column": name, "unit": unit}}}
    moved = frame.assign(**{name: np.interp(frame["t"] - late, frame["t"], frame[name])})
    (finding,) = _report(moved, content)
    assert finding.check == "clock"
    (keys,) = finding.changes.values()
    assert keys.get("delay", -keys.get("shift", 0.0)) == pytest.approx(late, abs=0.015)
    followed = _followed(content, [finding])
    assert not _report(moved, followed)
    truth = import_frame(moved, followed).recordings[0]
    clean = import_frame(frame, content).recordings[0].truth[signal]
    middle = slice(200, -200)
    again = np.interp(frame["t"], truth.truth["time"] + truth.notes["time_origin"],
                      truth.truth[signal])  # fmt: skip
    assert np.sqrt(np.mean((again - clean)[middle] ** 2)) < 0.2 * np.std(clean)


@pytest.mark.parametrize("name", ["v", "ax", "ay", "r", "d", "beta"])
def test_a_wrong_sign_is_noticed_in_every_channel(frame, name):
    turned = frame.assign(**{name: -frame[name]})
    findings = _report(turned, MAP)
    assert findings
    followed = _followed(MAP, findings)
    assert not _report(turned, followed)
    entry = {**followed["channels"], **followed["reference"]}
    assert [c["column"] for c in entry.values() if c.get("sign") == -1] == [name]


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [
        ("v", 3.6, "km/h"), ("ax", 1.0 / 9.80665, "g"), ("ay", 1.0 / 9.80665, "g"),
        ("r", 57.29578, "deg/s"), ("d", 57.29578, "deg"), ("beta", 57.29578, "deg"),
    ],
)  # fmt: skip
def test_a_wrong_unit_is_noticed_in_every_channel(frame, name, factor, unit):
    scaled = frame.assign(**{name: factor * frame[name]})
    findings = _report(scaled, MAP)
    followed = _followed(MAP, findings)
    assert not _report(scaled, followed)
    entry = {c["column"]: c for c in [*followed["channels"].values(),
                                      *followed["reference"].values()]}  # fmt: skip
    assert entry[name]["unit"] == unit


def test_what_no_vehicle_does_is_noticed_without_any_other_channel(frame):
    content = {
        "name": "x", "time": {"column": "t", "unit": "s"},
        "channels": {"yaw_rate": {"column": "r", "unit": "rad/s"}},
        "reference": {"sideslip": {"column": "beta", "unit": "rad"}},
    }  # fmt: skip
    wild = frame.assign(r=170.0 * frame["r"], beta=600.0 * frame["beta"])
    keys = {finding.channel for finding in _report(wild, content)}
    assert "channels.yaw_rate" in " ".join(keys)
    assert "reference.sideslip" in " ".join(keys)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_epochs_in_another_unit_are_refused(frame, unit, factor):
    epoch = frame.assign(t=(1_710_000_000 + frame["t"]) * factor)
    with pytest.raises(InputError, match=rf'say unit = "{unit}"'):
        import_frame(epoch, MAP)
    content = MAP | {"time": {"column": "t", "unit": unit}}
    assert import_frame(epoch, content).recordings[0].observations["time"][-1] == pytest.approx(
        39.99, abs=1e-3
    )


def test_milliseconds_from_zero_taken_for_seconds_are_noticed(frame):
    (finding,) = _report(frame.assign(t=1000.0 * frame["t"]), MAP)
    assert finding.suggestion == 'time: unit = "ms"'


def test_a_gap_of_the_log_is_not_taken_for_a_clock(frame):
    holed = frame[~frame["t"].between(10.0, 20.0)]
    assert not _report(holed, MAP)
