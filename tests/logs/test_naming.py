"""What engineers call their columns, and what only looks like one of the signals."""

import tomllib

import numpy as np
import pandas as pd
import pytest
from single_track import drive

from gripbench.logs.importing import import_log
from gripbench.logs.mapping.inspection import inspect_log
from gripbench.logs.mapping.naming import guesses, is_time

KNOWN = {
    "LatAcc": ("accel_y", 1), "LongAcc": ("accel_x", 1), "VelForward": ("speed_x", 1),
    "Ground Speed": ("speed_gps", 1), "AVz": ("yaw_rate", 1), "vEgo": ("speed_x", 1),
    "aEgo": ("accel_x", 1), "yawRate": ("yaw_rate", 1), "steeringAngleDeg": ("steer_angle", 1),
    "G Force Lat": ("accel_y", 1), "Gyro Yaw Velocity": ("yaw_rate", 1),
    "Steered Angle": ("steer_angle", 1), "Gierrate": ("yaw_rate", 1),
    "Querbeschl": ("accel_y", 1), "Lenkradwinkel": ("steer_angle", 1),
    "Schwimmwinkel": ("sideslip", 1), "v_Fzg": ("speed_x", 1), "VehSpd": ("speed_x", 1),
    "ESP1.AccelY": ("accel_y", 1), "field.angular_velocity.z": ("yaw_rate", 1),
    "w_RS_S_z [rad s^-1]": ("yaw_rate", 1), "a_RS_S_y [m s^-2]": ("accel_y", 1),
    "bearing": ("course", -1), "compass_heading": ("yaw", -1), "AngleTrack": ("course", -1),
    "WheelSpeed_FL": ("wheel_speed_front_left", 1), "whlspd_rr": ("wheel_speed_rear_right", 1),
    "lateral_acc": ("accel_y", 1), "z_rate_of_rotation": ("yaw_rate", 1), "beta": ("sideslip", 1),
    "GPS_Speed": ("speed_gps", 1), "Lateral g": ("accel_y", 1), "gyro_down": ("yaw_rate", -1),
}  # fmt: skip
UNKNOWN = (
    "susp_travel_fl", "damper_pos_rr", "delta_t", "SteerTorque", "steering_wheel_speed", "lap",
    "brake_pressure_fl", "tyre_temp_fl", "SteerValid", "gear", "throttle", "accel_pedal",
    "device_update_rate", "slip_ratio_measured_fl", "yaw_rate_error", "v_max",
)  # fmt: skip


@pytest.mark.parametrize("name", KNOWN)
def test_names_that_are_known(name):
    guess = guesses([name])[name]
    assert (guess.signal, guess.sign) == KNOWN[name]


@pytest.mark.parametrize("name", UNKNOWN)
def test_names_that_only_look_like_a_signal(name):
    assert name not in guesses([name])


def test_motion_capture_is_a_reference_and_no_gyroscope():
    found = guesses(["mocap_yaw_rate", "gyro_z"])
    assert found["mocap_yaw_rate"].reference
    assert not found["gyro_z"].reference


@pytest.mark.parametrize("name", ["t", "Time [s]", "timestamp_ns", "Zeit", "elapsed_time", "Time"])
def test_names_of_a_time(name):
    assert is_time(name)


def test_a_proposal_imports_without_edits_and_says_what_it_guessed(tmp_path):
    """Units that nobody wrote and a sign that no name tells follow from the physics."""
    frame = drive(30.0)
    path = tmp_path / "drive.csv"
    pd.DataFrame(
        {
            "timestamp": (1_710_000_000 + frame["t"]) * 1e3, "vEgo": 3.6 * frame["v"],
            "LatAcc": frame["ay"] / 9.80665, "LongAcc": frame["ax"] / 9.80665,
            "YawRate": -np.rad2deg(frame["r"]), "beta": np.rad2deg(frame["beta"]),
            "SteeringWheelAngle": np.rad2deg(frame["d"]) * 16.0, "susp_travel_fl": 0.1,
        }
    ).to_csv(path, index=False)  # fmt: skip
    proposal = inspect_log(path).proposal
    (tmp_path / "map.toml").write_text(proposal)
    content = tomllib.loads(proposal)
    assert content["time"]["unit"] == "ms"
    assert "wheel_speed_front_left" not in content["channels"]
    recording = import_log(path, tmp_path / "map.toml").recordings[0]
    seen = recording.observations
    for name, column in (("speed_x", "v"), ("accel_y", "ay"), ("accel_x", "ax"),
                         ("yaw_rate", "r"), ("steer_angle", "d")):  # fmt: skip
        np.testing.assert_allclose(seen[name], frame[column], atol=1e-6, err_msg=name)
    np.testing.assert_allclose(recording.truth["sideslip"], frame["beta"], atol=1e-6)
    assert proposal.count("# GUESS") >= 4
