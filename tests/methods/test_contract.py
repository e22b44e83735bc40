"""The contract: what is declared is all that there is, and every driver gives the same."""

import numpy as np
import pytest
from longitudinal_samples import (
    CAR,
    EACH_VARIANT,
    METHODS,
    online,
    plain_python,
    recording,
    unequal,
)

from gripbench.envs.signals import signal
from gripbench.errors import GripbenchError, InputError, UndeclaredChannelError
from gripbench.methods.contract import CompiledMethod, Estimator, Parameter, Variant, compiled
from gripbench.methods.slip_slope import SlipSlope

STATE = np.dtype([("last", np.float64)])


@compiled
def _good(state, obs, params, est):
    state.last = params.share * obs.accel_x + params.mass
    est.force_x_front = state.last


@compiled
def _reads_channel(state, obs, params, est):
    est.force_x_front = obs.speed_gps


@compiled
def _reads_truth(state, obs, params, est):
    est.force_x_front = obs.force_x_front


@compiled
def _reads_parameter(state, obs, params, est):
    est.force_x_front = params.wheel_radius


@compiled
def _writes_estimate(state, obs, params, est):
    est.mu_front = 1.0


@compiled
def _uses_state(state, obs, params, est):
    est.force_x_front = state.memory


def _method(step):
    class Toy(CompiledMethod):
        name = "toy"
        title = "Toy"
        reference = "none"
        sensors = ("accel_x",)
        estimates = ("force_x_front",)
        vehicle_parameters = ("mass",)
        parameters = (
            Parameter("share", 0.5, "-", "Share", 0.0, 1.0),
            Parameter("switch", False, "-", "Switch"),
            Parameter("count", 3, "-", "Whole number", 1, 9),
            Parameter("form", "long", "-", "Choice", choices=("short", "long")),
        )
        variants = {"whole": {"share": 1.0}}
        state = STATE

    Toy.step = staticmethod(step)
    return Toy


OBSERVATIONS = recording(horizon=0.1).observations


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (_reads_channel, "toy reads the channel 'speed_gps', which is not among its sensors"),
        (_reads_truth, "toy reads the channel 'force_x_front', which is not among its sensors"),
        (_reads_parameter, "toy reads the parameter 'wheel_radius', which it does not declare"),
        (_writes_estimate, "toy writes the estimate 'mu_front', which is not among its estimates"),
        (_uses_state, "toy uses 'memory', which is not a field of its state"),
    ],
)
def test_whatever_is_not_declared_is_named(step, message):
    method = _method(step)()
    with pytest.raises(UndeclaredChannelError, match=message):
        method.run(CAR, OBSERVATIONS)
    method.reset(CAR, 1e-3)
    with pytest.raises(UndeclaredChannelError, match=message):
        method.update({"time": 0.0, "accel_x": 1.0})


def test_a_declared_method_runs_both_ways():
    method = _method(_good)("whole")
    expected = OBSERVATIONS["accel_x"] + CAR["mass"]
    np.testing.assert_allclose(method.run(CAR, OBSERVATIONS)["force_x_front"], expected)
    np.testing.assert_allclose(online(method, OBSERVATIONS)["force_x_front"], expected)
    assert isinstance(method, Estimator)


def test_update_needs_reset_and_its_channels():
    method = _method(_good)()
    with pytest.raises(InputError, match=r"toy: call reset\(vehicle, dt\) before update"):
        method.update({"time": 0.0, "accel_x": 1.0})
    method.reset(CAR, 1e-3)
    with pytest.raises(UndeclaredChannelError, match="lacks the declared channel 'accel_x'"):
        method.update({"time": 0.0})
    with pytest.raises(UndeclaredChannelError, match="no channel 'accel_x'"):
        method.run(CAR, OBSERVATIONS[["time", "speed_gps"]])


def test_missing_vehicle_parameter_is_named():
    with pytest.raises(InputError, match="toy needs the vehicle parameter 'mass'"):
        _method(_good)().reset({"wheel_radius": 0.35}, 1e-3)


@pytest.mark.parametrize(
    ("variant", "overrides", "message"),
    [
        ("hole", {}, "unknown variant of toy 'hole': did you mean 'whole'"),
        ("corrected", {"shar": 0.1}, "toy: unknown parameter 'shar': did you mean 'share'"),
        ("corrected", {"share": 1.5}, "'share' is 1.5; allowed is 0 to 1 -"),
        ("corrected", {"share": float("nan")}, "'share' is nan"),
        ("corrected", {"share": "half"}, "'share' is 'half'"),
        ("corrected", {"share": True}, "'share' is True"),
        ("corrected", {"switch": 0.5}, "'switch' is 0.5; it is a switch"),
        ("corrected", {"count": 2.5}, "'count' is 2.5; it is a whole number"),
        ("corrected", {"count": 10}, "'count' is 10; allowed is 1 to 9"),
        ("corrected", {"form": "longer"}, "'form' is 'longer'; allowed is one of short, long"),
        ("corrected", {"form": 2.0}, "'form' is 2.0; allowed is one of short, long"),
    ],
)
def test_settings_are_checked(variant, overrides, message):
    with pytest.raises(InputError, match=message):
        _method(_good)(variant, **overrides)


def test_settings_keep_their_types_and_steps_see_numbers():
    method = _method(_good)(switch=1.0, count=4.0, form=0.0)
    assert method.settings == {"share": 0.5, "switch": True, "count": 4, "form": "short"}
    params = method._fresh(CAR, 1).params[0]
    assert (params["switch"], params["count"], params["form"]) == (1.0, 4.0, 0.0)
    assert method.variants["whole"] == Variant({"share": 1.0})


@compiled
def _clock(state, obs, params, est):
    state.last += obs.elapsed
    est.force_x_front = state.last + 1000.0 * obs.first


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ([1.0, 1.5, 1.75], [1000.0, 0.5, 0.75]),
        ([1.0, 1.5, 1.25, 1.5], [1000.0, 0.5, 0.5, 0.5]),  # the clock steps back
        ([1.0, np.nan, 1.5, 1.5], [1000.0, 1000.0, 0.5, 0.5]),  # a time is missing
        ([np.nan, 2.0, np.inf, 2.5], [0.0, 1000.0, 1000.0, 0.5]),
    ],
)
def test_the_driver_gives_the_elapsed_time(times, expected):
    method = _method(_clock)()
    observations = np.zeros(len(times), [("time", float), ("accel_x", float)])
    observations["time"] = times
    batch = method.run(CAR, observations)
    np.testing.assert_allclose(batch["force_x_front"], expected)
    assert online(method, observations).tobytes() == batch.tobytes()


def test_parameter_that_the_vehicle_has_too():
    kind = _method(_good)
    kind.parameters = (Parameter("mass", 1.0, "kg", "Clash"),)
    with pytest.raises(InputError, match="parameter 'mass' is also a vehicle parameter"):
        kind()


def test_unknown_signal_in_a_declaration():
    kind = _method(_good)
    kind.sensors = ("acel_x",)
    with pytest.raises(InputError, match="did you mean 'accel_x'"):
        kind()


@pytest.mark.parametrize(("kind", "variant"), EACH_VARIANT)
def test_online_gives_the_bytes_of_the_batch(kind, variant):
    observations = unequal(recording("noisy_acceleration", 0.8).observations)
    method = kind(variant)
    batch = method.run(CAR, observations)
    assert online(method, observations).tobytes() == batch.tobytes()
    assert method.run(CAR, observations).tobytes() == batch.tobytes()  # nothing is left behind
    for name in method.outputs:
        assert np.isfinite(batch[name]).all()


@pytest.mark.parametrize(("kind", "variant"), EACH_VARIANT)
def test_plain_python_gives_the_same(kind, variant):
    observations = recording("noisy_acceleration", 0.8).observations[:300]
    method = kind(variant)
    batch, plain = method.run(CAR, observations), plain_python(method, observations)
    for name in method.outputs:
        np.testing.assert_allclose(plain[name], batch[name], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("kind", "variant"), EACH_VARIANT)
def test_a_prefix_gives_the_same_estimates(kind, variant):
    observations = recording("noisy_acceleration", 0.8).observations
    method = kind(variant)
    whole, prefix = method.run(CAR, observations), method.run(CAR, observations[:400])
    assert whole[:400].tobytes() == prefix.tobytes()


@pytest.mark.parametrize("kind", METHODS)
def test_declarations(kind):
    method = kind()
    for name in (*method.sensors, *method.outputs):
        signal(name)
    assert method.title
    assert "Li, Du & Li (2014)" in method.reference
    assert not any(signal(name).idealised for name in method.sensors)  # only variants need those
    for parameter in method.parameters:
        assert parameter.low <= parameter.default <= parameter.high
        assert parameter.description
    assert set(kind.variants) >= {"paper"}


@pytest.mark.parametrize("kind", METHODS)
def test_only_declared_channels_matter(kind):
    """Whatever else the recording holds may be garbage."""
    observations = recording("noisy_acceleration", 0.8).observations
    method = kind()
    spoilt = observations.copy()
    for name in spoilt.dtype.names:
        if name not in (*method.sensors, "time"):
            spoilt[name] = np.nan
    assert method.run(CAR, spoilt).tobytes() == method.run(CAR, observations).tobytes()


def test_a_step_that_cannot_be_compiled_is_one_line():
    @compiled
    def broken(state, obs, params, est):
        est.force_x_front = obs.accel_x + "text"

    with pytest.raises(GripbenchError, match="toy: step cannot be compiled") as caught:
        _method(broken)().run(CAR, OBSERVATIONS)
    assert "\n" not in str(caught.value)


def test_settings_show_what_a_variant_changes():
    assert SlipSlope("paper").settings["forgetting"] == 0.9
    assert SlipSlope("paper", forgetting=0.95).settings["forgetting"] == 0.95
