"""Sensors: statistics of their errors, closed forms of their dynamics, and their streams."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gripbench.configuration import parse
from gripbench.envs.instruments.sensors import Sensor, load_sensor_suite
from gripbench.envs.instruments.suite import SensorSuite
from gripbench.envs.signals import record_type
from gripbench.errors import InputError

TRUTH = record_type(("time", "speed_x", "accel_x", "wheel_speed_front"))
DT = 1e-3


def _truth(n=5000, dt=DT, **channels):
    truth = np.zeros(n, TRUTH)
    truth["time"] = np.arange(n) * dt
    for name, values in channels.items():
        truth[name] = values
    return truth


def _observe(sensors, truth, seed=0, sample_time=DT):
    suite = SensorSuite(sensors, TRUTH, sample_time, seed)
    return suite.observe(truth)


def _ramp(n=5000):
    return np.arange(n) * DT


def test_a_perfect_sensor_gives_the_truth():
    truth = _truth(speed_x=_ramp())
    seen = _observe({"speed_x": Sensor(), "speed_gps": Sensor(source="speed_x")}, truth)
    assert seen.dtype.names == ("time", "speed_x", "speed_gps")
    assert np.array_equal(seen["speed_x"], truth["speed_x"])
    assert np.array_equal(seen["speed_gps"], truth["speed_x"])
    assert np.array_equal(seen["time"], truth["time"])


def test_noise_is_white_with_its_deviation():
    seen = _observe({"accel_x": Sensor(noise_std=0.3)}, _truth(40_000))["accel_x"]
    assert seen.std() == pytest.approx(0.3, rel=0.02)
    assert abs(seen.mean()) < 5 * 0.3 / 200
    assert abs(np.corrcoef(seen[1:], seen[:-1])[0, 1]) < 0.03


def test_drawn_bias_and_scale_over_seeds():
    truth = _truth(2, speed_x=[1.0, 1.0])
    sensor = {"speed_x": Sensor(bias=0.5, bias_std=0.2)}
    biases = [_observe(sensor, truth, seed)["speed_x"][1] - 1.0 for seed in range(1500)]
    assert np.mean(biases) == pytest.approx(0.5, abs=0.025)
    assert np.std(biases) == pytest.approx(0.2, rel=0.08)
    sensor = {"speed_x": Sensor(scale=1.1, scale_std=0.02)}
    scales = [_observe(sensor, truth, seed)["speed_x"][1] for seed in range(1500)]
    assert np.mean(scales) == pytest.approx(1.1, abs=0.003)
    assert np.std(scales) == pytest.approx(0.02, rel=0.08)
    own = np.corrcoef(biases, scales)[0, 1]  # of the same seeds: the draws are independent
    assert abs(own) < 4.0 / np.sqrt(1500)


def test_bias_walk_grows_with_the_root_of_time():
    truth = _truth(1001)
    sensor = {"accel_x": Sensor(bias_walk=0.4)}
    paths = np.array([_observe(sensor, truth, seed)["accel_x"] for seed in range(600)])
    assert np.all(paths[:, 0] == 0.0)
    assert paths[:, 1000].std() == pytest.approx(0.4, rel=0.1)
    assert paths[:, 250].std() == pytest.approx(0.2, rel=0.1)


def test_bias_walk_does_not_depend_on_the_sampling():
    fine = [_observe({"accel_x": Sensor(bias_walk=0.4)}, _truth(401), s) for s in range(400)]
    coarse = [
        _observe({"accel_x": Sensor(bias_walk=0.4)}, _truth(41, 1e-2), s, 1e-2) for s in range(400)
    ]
    for paths in (fine, coarse):
        final = [path["accel_x"][-1] for path in paths]
        assert np.std(final) == pytest.approx(0.4 * np.sqrt(0.4), rel=0.15)


def test_noise_hold_keeps_a_draw():
    seen = _observe({"accel_x": Sensor(noise_std=1.0, noise_hold=0.005)}, _truth(1000))["accel_x"]
    blocks = seen.reshape(-1, 5)
    assert np.all(blocks == blocks[:, :1])
    assert len(np.unique(blocks[:, 0])) == 200


def test_lowpass_is_that_of_the_closed_form():
    step = np.zeros(400)
    step[1:] = 2.0
    seen = _observe({"accel_x": Sensor(lowpass=0.03)}, _truth(400, accel_x=step))["accel_x"]
    time = np.arange(400) * DT
    np.testing.assert_allclose(seen, 2.0 * -np.expm1(-time / 0.03), atol=1e-12)


def test_lowpass_does_not_depend_on_unequal_spacing():
    rng = np.random.default_rng(1)
    truth = np.zeros(300, TRUTH)
    truth["time"] = np.concatenate([[0.0], np.cumsum(rng.uniform(1e-4, 3e-3, 299))])
    truth["accel_x"][1:] = 1.0
    seen = _observe({"accel_x": Sensor(lowpass=0.02)}, truth, sample_time=None)["accel_x"]
    np.testing.assert_allclose(seen, -np.expm1(-truth["time"] / 0.02), atol=1e-12)


def test_rate_holds_and_flags():
    truth = _truth(1000, speed_x=_ramp(1000))
    seen = _observe({"speed_x": Sensor(rate=50.0)}, truth)
    new = seen["speed_x_new"] == 1.0
    assert np.array_equal(np.flatnonzero(new), np.arange(0, 1000, 20))
    assert set(seen["speed_x_new"]) == {0.0, 1.0}
    assert np.array_equal(seen["speed_x"], np.repeat(truth["speed_x"][::20], 20))


def test_delay_gives_the_truth_of_then():
    truth = _truth(500, speed_x=_ramp(500))
    seen = _observe({"speed_x": Sensor(delay=0.025)}, truth)["speed_x"]
    assert np.array_equal(seen[25:], truth["speed_x"][:-25])
    assert np.all(seen[:25] == truth["speed_x"][0])


def test_delays_of_several_channels_are_their_own():
    truth = _truth(500, speed_x=_ramp(500), accel_x=-_ramp(500))
    seen = _observe({"speed_x": Sensor(delay=0.1), "accel_x": Sensor(delay=0.003)}, truth)
    assert np.array_equal(seen["speed_x"][100:], truth["speed_x"][:-100])
    assert np.array_equal(seen["accel_x"][3:], truth["accel_x"][:-3])


def test_delay_needs_equal_samples():
    with pytest.raises(InputError, match=r"speed_x\.delay needs equally spaced"):
        SensorSuite({"speed_x": Sensor(delay=0.1)}, TRUTH, None, 0)


@given(st.floats(0.01, 2.0))
def test_quantisation(step):
    truth = _truth(200, speed_x=np.linspace(-5.0, 5.0, 200))
    seen = _observe({"speed_x": Sensor(quantisation=step)}, truth)["speed_x"]
    assert np.abs(seen - truth["speed_x"]).max() <= step / 2 * (1 + 1e-9)
    multiples = seen / step
    np.testing.assert_allclose(multiples, np.round(multiples), atol=1e-9)


EVERYTHING = {
    "speed_x": Sensor(
        bias_std=0.1, bias_walk=0.1, noise_std=0.2, rate=90.0, delay=0.04, quantisation=0.01
    ),
    "accel_x": Sensor(noise_std=1.0, noise_hold=0.005, lowpass=0.015, scale_std=0.1),
    "wheel_speed_front": Sensor(noise_std=0.01),
}


def _busy_truth(n=2500):
    rng = np.random.default_rng(3)
    return _truth(n, speed_x=_ramp(n), accel_x=rng.normal(size=n), wheel_speed_front=3.0 * _ramp(n))


def test_one_by_one_gives_the_bytes_of_the_whole():
    truth = _busy_truth()
    whole = _observe(EVERYTHING, truth, seed=4)
    suite = SensorSuite(EVERYTHING, TRUTH, DT, 4)
    single = np.concatenate([suite.observe(truth[k : k + 1]) for k in range(len(truth))])
    assert whole.tobytes() == single.tobytes()
    suite = SensorSuite(EVERYTHING, TRUTH, DT, 4)
    parts = [suite.observe(truth[a:b]) for a, b in ((0, 7), (7, 1024), (1024, 1500), (1500, 2500))]
    assert whole.tobytes() == np.concatenate(parts).tobytes()


def test_streams_do_not_depend_on_other_sensors():
    truth = _busy_truth()
    whole = _observe(EVERYTHING, truth, seed=4)
    reverse = _observe(dict(reversed(EVERYTHING.items())), truth, seed=4)
    for channel, sensor in EVERYTHING.items():
        alone = _observe({channel: sensor}, truth, seed=4)
        assert np.array_equal(alone[channel], whole[channel])
        assert np.array_equal(alone[channel], reverse[channel])


def test_seeds_and_channels_draw_differently():
    sensors = {"speed_x": Sensor(noise_std=1.0), "accel_x": Sensor(noise_std=1.0)}
    first, again, other = (_observe(sensors, _truth(500), seed) for seed in (0, 0, 1))
    assert first.tobytes() == again.tobytes()
    assert not np.any(first["accel_x"] == other["accel_x"])
    assert abs(np.corrcoef(first["accel_x"], first["speed_x"])[0, 1]) < 0.2
    assert abs(np.corrcoef(first["accel_x"], other["accel_x"])[0, 1]) < 0.2


def test_unknown_channels_are_named():
    with pytest.raises(InputError, match="unknown signal 'sped_x': did you mean 'speed_x'"):
        SensorSuite({"sped_x": Sensor()}, TRUTH, DT, 0)
    with pytest.raises(InputError, match="gives no 'yaw_rate' to measure"):
        SensorSuite({"yaw_rate": Sensor()}, TRUTH, DT, 0)
    with pytest.raises(InputError, match="unknown sensor suite 'li201': did you mean 'li2014'"):
        load_sensor_suite("li201")


@pytest.mark.parametrize("key", ["noise_std", "lowpass", "rate", "quantisation", "delay"])
def test_negative_settings_are_refused(key):
    with pytest.raises(InputError, match=rf"file\.toml: key '{key}'.*greater than or equal to 0"):
        parse(Sensor, {key: -1.0}, "file.toml")


def test_a_rate_above_that_of_the_samples_is_refused():
    with pytest.raises(InputError, match=r"sensors\.accel_x\.rate is 1500 Hz: faster than .* 1000"):
        SensorSuite({"accel_x": Sensor(rate=1500.0)}, TRUTH, 1e-3, 0)
    SensorSuite({"accel_x": Sensor(rate=1000.0)}, TRUTH, 1e-3, 0)


PLANAR = record_type(("time", "speed_x", "speed_y", "accel_x", "accel_y", "accel_z", "yaw_rate"))


def _observe_planar(sensors, n=400, **channels):
    truth = np.zeros(n, PLANAR)
    truth["time"] = np.arange(n) * DT
    for name, values in channels.items():
        truth[name] = values
    return SensorSuite(sensors, PLANAR, DT, 0).observe(truth)


@pytest.mark.parametrize("speed", [0.7, 3.3, 40.0])
def test_wheel_pulses_of_a_steady_wheel_give_its_speed(speed):
    sensor = {"wheel_speed_front": Sensor(pulses=48, rate=100.0)}
    seen = _observe(sensor, _truth(4000, wheel_speed_front=speed))["wheel_speed_front"]
    np.testing.assert_allclose(seen[1000:], speed, rtol=1e-9)


def test_wheel_pulses_give_the_mean_between_two_teeth():
    rate = 100.0
    truth = _truth(5000, wheel_speed_front=5.0 + 3.0 * np.arange(5000) * DT)
    seen = _observe({"wheel_speed_front": Sensor(pulses=48, rate=rate)}, truth)
    reading = seen["wheel_speed_front"][1000:]
    # the mean over at most a reading and two teeth lags by half of that
    most = 3.0 * (1.0 / rate + 2.0 * 2.0 * np.pi / 48 / 8.0)
    lag = truth["wheel_speed_front"][1000:] - reading
    assert (lag > 0.0).all()
    assert lag.max() < most


def test_a_wheel_that_stops_has_no_teeth_and_its_reading_decays():
    speed = np.where(np.arange(5000) < 2500, 10.0, 0.0)
    sensor = {"wheel_speed_front": Sensor(pulses=48, rate=100.0)}
    seen = _observe(sensor, _truth(wheel_speed_front=speed))["wheel_speed_front"]
    assert seen[2400] == pytest.approx(10.0)
    tooth = 2.0 * np.pi / 48
    for k in (3000, 4000, 4990):
        assert seen[k] == pytest.approx(tooth / ((k - 2500) * DT), rel=0.05)


def test_a_lever_arm_feels_the_turn_of_the_vehicle():
    time = np.arange(400) * DT
    yaw_rate = 0.4 + 2.0 * time
    arm = {"lever_x": 1.2, "lever_y": -0.3}
    seen = _observe_planar(
        {"accel_x": Sensor(**arm), "accel_y": Sensor(**arm), "speed_y": Sensor(lever_x=1.2)},
        yaw_rate=yaw_rate, accel_x=1.0, accel_y=2.0, speed_y=0.1,
    )  # fmt: skip
    after = slice(1, None)  # the first sample knows no change yet
    expected_x = 1.0 - 1.2 * yaw_rate**2 + 0.3 * 2.0
    expected_y = 2.0 + 0.3 * yaw_rate**2 + 1.2 * 2.0
    np.testing.assert_allclose(seen["accel_x"][after], expected_x[after], rtol=1e-9)
    np.testing.assert_allclose(seen["accel_y"][after], expected_y[after], rtol=1e-9)
    np.testing.assert_allclose(seen["speed_y"], 0.1 + 1.2 * yaw_rate, rtol=1e-12)


def test_a_misaligned_axis_mixes_two():
    seen = _observe_planar(
        {"accel_y": Sensor(cross="accel_z", misalignment=0.02)}, accel_y=1.0, accel_z=9.81
    )
    expected = np.cos(0.02) * 1.0 + np.sin(0.02) * 9.81
    np.testing.assert_allclose(seen["accel_y"], expected, rtol=1e-12)


def test_a_gain_of_its_own_below_zero():
    truth = _truth(accel_x=np.where(np.arange(5000) < 2000, 2.0, -2.0))
    seen = _observe({"accel_x": Sensor(scale=1.1, negative_scale=0.9)}, truth)["accel_x"]
    assert seen[0] == pytest.approx(2.2)
    assert seen[-1] == pytest.approx(-1.98)


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"accel_x": Sensor(cross="accel_y", misalignment=0.1)}, "accel_x.cross.*'accel_y'"),
        ({"accel_x": Sensor(lever_x=1.0)}, "accel_x.lever_x.*'yaw_rate'"),
    ],
)
def test_what_a_plant_does_not_have_is_named(sensor, message):
    with pytest.raises(InputError, match=message):
        SensorSuite(sensor, TRUTH, DT, 0)
