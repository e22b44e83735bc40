"""The bound against what it did not make: Riccati, a twin with whole states, a posterior on a grid,
complete simulations, halved steps.
"""

import re

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from gripbench.bench.bounds.bound import bounds, channels_of
from gripbench.bench.bounds.instruments import read
from gripbench.bench.bounds.model import Model, linearise
from gripbench.bench.bounds.recursion import (
    DIRECT,
    NONE,
    Motion,
    Readings,
    discretise,
    least_variance,
)
from gripbench.bench.papers.anderson2004.riccati import steady_state
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.plants.planar.world import PlanarSimulation
from gripbench.envs.populations.draws import draw
from gripbench.envs.populations.drives import friction_of
from gripbench.envs.populations.population import load_population, population_path
from gripbench.envs.vehicles import load_vehicle, require
from gripbench.envs.worlds import at_level, load_scenario
from gripbench.errors import InputError
from gripbench.methods.model_based_kalman_filter import SINGLE_TRACK, single_track


def twin(start, transition, noise, rows, variance, target):
    """The covariance of a plain Kalman filter, Joseph's form."""
    p, found = start.copy(), []
    for k in range(len(rows)):
        if k:
            p = transition[k - 1] @ p @ transition[k - 1].T + noise[k - 1]
        for row, own in zip(rows[k], variance, strict=True):
            if not np.isfinite(row).all():
                continue
            gain = p @ row / (row @ p @ row + own)
            kept = np.eye(len(p)) - np.outer(gain, row)
            p = kept @ p @ kept.T + np.outer(gain, gain) * own
        found.append(target @ p @ target)
    return np.array(found)


def system(seed, n, states=3, rest=2):
    """A random stable system whose rest is noise with a memory."""
    draws = np.random.default_rng(seed)
    size = states + rest
    f = draws.normal(size=(states, size))
    f[:, :states] *= 0.9 / np.abs(np.linalg.eigvals(f[:, :states])).max()
    q = draws.normal(size=(states, states))
    q = q @ q.T
    decay = np.r_[np.ones(states), draws.uniform(0.3, 0.95, rest)]
    spread = np.r_[np.zeros(states), draws.uniform(0.1, 1.0, rest)]
    whole = np.zeros((size, size))
    whole[:states], whole[states:, states:] = f, np.diag(decay[states:])
    noise = np.zeros((size, size))
    noise[:states, :states] = q
    noise[states:, states:] = np.diag(spread[states:])
    motion = Motion(
        np.repeat(f[None], n - 1, 0), np.repeat(q[None], n - 1, 0),
        np.repeat(decay[None], n - 1, 0), np.repeat(spread[None], n - 1, 0),
        np.zeros((n - 1, 0, 0)),
    )  # fmt: skip
    return motion, whole, noise, draws


@pytest.mark.slow
def test_it_settles_at_the_solution_of_the_riccati_equation():
    n = 400
    motion, whole, noise, draws = system(1, n)
    c = draws.normal(size=(2, 5))
    r = np.array([0.3, 0.05])
    target = draws.normal(size=5)
    before = solve_discrete_are(whole.T, c.T, noise, np.diag(r))
    gain = before @ c.T @ np.linalg.inv(c @ before @ c.T + np.diag(r))
    after = before - gain @ c @ before
    none = np.full((n, 2), NONE)
    read = Readings(np.repeat(c[None], n, 0), r, none, np.full((n, 2), DIRECT))
    found, gained = least_variance(np.eye(5), motion, read, np.repeat(target[None, None], n, 0))
    assert found[-1, 0] == pytest.approx(target @ after @ target, rel=1e-6)
    told = 1.0 / (target @ after @ target) - 1.0 / (target @ before @ target)
    assert gained[-1, 0] == pytest.approx(told, rel=1e-6)


def test_a_linear_gaussian_drive_settles_at_its_riccati_solution():
    """The single-track model at 30 m/s with gyroscope, its drifting bias, and GPS course."""
    rate, steps = 20.0, 6000
    noise = {"gyro": 2e-3, "course": 3e-4, "steer": 0.02, "walk": 1e-4}
    expected = steady_state(
        load_vehicle("anderson2004_blazer").values(), speed=30.0, rate=rate,
        gyro_std=noise["gyro"], course_std=noise["course"], steer_noise=noise["steer"],
        bias_walk=noise["walk"],
    )  # fmt: skip
    continuous = np.zeros((5, 5))
    values = require(
        load_vehicle("anderson2004_blazer").values(), SINGLE_TRACK, "the single-track model"
    )
    single_track(continuous, *values.values(), 30.0)
    slopes = np.repeat(continuous[None, :3, :4], steps, 0)
    transition, none = discretise(slopes, 1.0 / rate, 1, np.zeros((steps, 3)))
    decay, spread = np.ones((steps - 1, 4)), np.zeros((steps - 1, 4))
    decay[:, 3], spread[:, 3] = 0.0, noise["steer"] ** 2 * rate
    still, rows = np.zeros(steps), np.zeros((2, steps, 4))
    rows[0, :, 1] = 1.0  # yaw rate
    rows[1, :, [0, 2]] = 1.0  # course: sideslip and yaw
    model = Model(
        time=np.arange(steps) / rate,
        names=("sideslip", "yaw_rate", "yaw", "steer"),
        start=np.diag([0.01, 0.01, 1.0, spread[0, 3]]),
        motion=Motion(transition, none, decay, spread, np.zeros((steps - 1, 0, 0))),
        truth={"yaw_rate": still, "course": still},
        slopes={"yaw_rate": rows[0], "course": rows[1]},
        yaw_acceleration=None,
        sensors={
            "yaw_rate": Sensor(noise_std=noise["gyro"], bias_walk=noise["walk"]),
            "course": Sensor(noise_std=noise["course"]),
        },
        deviations={},
        sample_time=1.0 / rate,
    )
    given = read(model, ("yaw_rate", "course"))
    targets = np.zeros((steps, 3, given.size))
    targets[:, [0, 1, 2], [0, 1, 2]] = 1.0
    found, _ = least_variance(given.start, given.motion, given.readings, targets)
    assert np.sqrt(found[-1]) == pytest.approx(
        [expected.sideslip, expected.yaw_rate, expected.yaw], rel=1e-6
    )


@pytest.mark.parametrize(("late", "every"), [(1, 1), (3, 5), (4, 2)])
def test_a_late_reading_is_one_of_a_state_that_was_kept(late, every):
    n = 30
    motion, whole, noise, draws = system(2, n, rest=1)
    row, target = draws.normal(size=4), draws.normal(size=4)
    flight = -(-late // every)
    size = 4 + flight
    decay = np.hstack([motion.decay, np.ones((n - 1, flight))])
    spread = np.hstack([motion.spread, np.zeros((n - 1, flight))])
    take, read = np.full((n, 1), NONE), np.full((n, 1), NONE)
    for number, k in enumerate(range(0, n, every)):
        take[k, 0] = 4 + number % flight
        if k + late < n:
            read[k + late, 0] = 4 + number % flight
    wide = np.zeros((n, 1, size))
    wide[:, 0, :4] = row
    start = np.zeros((size, size))
    start[:4, :4] = np.eye(4)
    aim = np.zeros((n, 1, size))
    aim[:, 0, :4] = target
    given = Motion(motion.transition, motion.noise, decay, spread, motion.driven)
    found, _ = least_variance(start, given, Readings(wide, np.array([0.2]), take, read), aim)

    # the twin carries every state since `late` samples
    copies = late + 1
    big, q = np.zeros((4 * copies, 4 * copies)), np.zeros((4 * copies, 4 * copies))
    big[:4, :4], q[:4, :4] = whole, noise
    big[4:, :-4] = np.eye(4 * late)
    first = np.zeros_like(big)
    first[:4, :4] = np.eye(4)
    seen = np.full((n, 1, 4 * copies), np.nan)
    for k in range(late, n, 1):
        if (k - late) % every == 0:
            seen[k, 0] = 0.0
            seen[k, 0, -4:] = row
    expected = twin(
        first, [big] * n, [q] * n, seen, [0.2], np.r_[target, np.zeros(4 * late)]
    )  # fmt: skip
    assert found[:, 0] == pytest.approx(expected, rel=1e-9)


def test_a_stiff_plant_moves_by_its_matrix_exponential():
    draws = np.random.default_rng(3)
    turn = np.linalg.qr(draws.normal(size=(4, 4)))[0]
    a = turn @ np.diag([-2e4, -300.0, -1.0, 0.0]) @ turn.T
    b = draws.normal(size=(4, 2))
    jumps = np.array([0.1, 0.0, 0.3, 0.0])
    slopes = np.repeat(np.hstack([a, b])[None], 2, 0)
    moves, noise = discretise(slopes, 0.01, 10, np.repeat(jumps[None], 2, 0))
    whole = expm(np.block([[a, b], [np.zeros((2, 6))]]) * 0.01)
    assert moves[0] == pytest.approx(whole[:4], abs=1e-11)
    hold, spread = expm(a * 0.001), np.zeros((4, 4))
    for _ in range(10):
        spread = hold @ spread @ hold.T + np.diag(jumps**2)
    assert noise[0] == pytest.approx(spread, abs=1e-12)


POPULATION = """
name = "one_friction"
description = "Only the friction level is drawn"
[friction_prior]
mean = 0.8
std = 0.1
source = "test"
[road]
friction = { std = 0.4, source = "test" }
[effects]
radius_per_pressure = { value = 0.0, source = "test" }
stiffness_per_wear = { value = 0.0, source = "test" }
stiffness_per_pressure = { value = 0.0, source = "test" }
stiffness_per_kelvin = { value = 0.0, source = "test" }
peak_per_wear = { value = 0.0, source = "test" }
peak_per_kelvin = { value = 0.0, source = "test" }
[instruments]
level_1 = "INSTRUMENTS"
"""
INSTRUMENTS = """
name = "few"
description = "Wheel speeds and torque"
[sensors]
wheel_speed_front = { noise_std = 0.3, rate = 100.0 }
wheel_speed_rear = { noise_std = 0.3, rate = 100.0 }
speed_x = { noise_std = 0.1, rate = 100.0 }
torque_front = { noise_std = 1e-4 }
torque_rear = { noise_std = 1e-4 }
"""


@pytest.fixture
def one_unknown(tmp_path):
    """A scenario of which only the friction is unknown."""
    tools = tmp_path / "few.toml"
    tools.write_text(INSTRUMENTS)
    people = tmp_path / "one_friction.toml"
    people.write_text(POPULATION.replace("INSTRUMENTS", tools.as_posix()))
    scenario = load_scenario("large_torque").model_copy(
        update={
            "population": str(people),
            "horizon": 4.0,
            "wheel_speed_noise": 0.0,
            "sensors": {},
            "integrator": "rk4",
        }
    )
    return at_level(scenario, 1)


@pytest.mark.slow
def test_it_is_the_spread_of_the_posterior_on_a_grid(one_unknown):
    """Nonlinear plant, one unknown: every friction of a fine grid is simulated, none linearised."""
    spread = load_population(one_unknown.population).spreads["road.friction"]
    grid = 121
    deviations = [spread.deviation((i + 0.5) / grid) for i in range(grid)]  # equally likely
    seen, friction = [], []
    for each in deviations:
        drawn = draw(one_unknown, 0, changes={"road.friction": each})
        truth = LongitudinalSimulation(drawn.scenario, drawn.road).run(0)[::10]
        seen.append(np.stack([truth[name] for name in ("wheel_speed_front", "wheel_speed_rear",
                                                       "speed_x")]))  # fmt: skip
        friction.append(truth["mu_front"][-1])
    seen, friction = np.array(seen), np.array(friction)
    weight = 1.0 / np.array([0.3, 0.3, 0.1])[None, :, None] ** 2
    noise = np.random.default_rng(5)
    at = np.array([20, 60, 120, 200, 300, 400])
    least, spreads = [], []
    for seed in range(20):
        drawn = draw(one_unknown, seed)
        run = LongitudinalSimulation(drawn.scenario, drawn.road).run(seed)[::10]
        true = np.stack([run[name] for name in ("wheel_speed_front", "wheel_speed_rear",
                                                "speed_x")])  # fmt: skip
        channels = channels_of(one_unknown)
        least.append(bounds(one_unknown, seed, [channels], ["mu_front"])[0].deviation[at] ** 2)
        for _ in range(10):
            read = true + noise.normal(size=true.shape) / np.sqrt(weight[0])
            misfit = np.cumsum((weight * (read - seen) ** 2).sum(axis=1), axis=1)[:, at]
            likely = np.exp(-0.5 * (misfit - misfit.min(axis=0)))
            likely /= likely.sum(axis=0)
            mean = likely.T @ friction
            spreads.append(likely.T @ friction**2 - mean**2)
    assert np.mean(least, axis=0) == pytest.approx(np.mean(spreads, axis=0), rel=0.15)
    assert np.mean(least, axis=0)[-1] < 0.3 * np.mean(least, axis=0)[0]  # and it learns


def on_even_roads(name, folder, **changes):
    """A scenario whose road does not vary along the way, so that it is met alike in time."""
    scenario = load_scenario(name)
    text = population_path(scenario.population).read_text(encoding="utf-8")
    for key in ("friction_along", "grade_along", "bank_along"):
        text = re.sub(rf"^{key} = {{ std = [0-9.]+", f"{key} = {{ std = 0.0", text, flags=re.M)
    even = folder / f"{scenario.population}.toml"
    even.write_text(text, encoding="utf-8")
    return scenario.model_copy(update={"population": str(even), **changes})


def test_its_sensitivities_are_those_of_complete_simulations(tmp_path):
    scenario = on_even_roads("constant_mu@1", tmp_path, horizon=12.0)
    causes = ("tyre.radius", "car.payload", "tyre.longitudinal_stiffness", "road.friction")
    model = linearise(scenario, 4, ("speed_x", "wheel_speed_front"))
    drawn = draw(scenario, 4)
    states = model.motion.transition.shape[1]
    along = np.zeros(len(model.names))
    for cause in causes:
        place = model.names.index(cause)
        along[:] = 0.0
        along[place] = 1.0
        # at the start the wheels roll
        along[:states] = model.start[:states, place] / model.start[place, place]
        for k in range(len(model.motion.transition)):
            along[:states] = model.motion.transition[k] @ along
        deviation = load_population(scenario.population).spreads[cause].moments[1]
        size = 0.01 * deviation
        ends = []
        for side in (1.0, -1.0):
            moved = drawn.deviations[cause] + side * size
            other = draw(scenario, 4, changes={cause: moved})
            ends.append(LongitudinalSimulation(other.scenario, other.road).run(4)[-1])
        for name in ("speed_x", "wheel_speed_front"):
            complete = (ends[0][name] - ends[1][name]) / (2.0 * 0.01)
            assert model.slopes[name][-1] @ along == pytest.approx(complete, rel=0.02, abs=2e-4)


@pytest.mark.slow
def test_those_of_the_planar_plant_too_with_the_inputs_held(tmp_path):
    scenario = on_even_roads("dakhlallah_mild@1", tmp_path, horizon=5.0)
    model = linearise(scenario, 0, ("sideslip", "yaw_rate", "speed_x"))
    drawn = draw(scenario, 0)
    nominal = PlanarSimulation(drawn.scenario, drawn.road)
    nominal.reset(0)
    actions = []
    for _ in range(scenario.steps):
        actions.append(nominal.drive())
        nominal.advance(actions[-1])
    states = model.motion.transition.shape[1]
    for cause in ("tyre.cornering_stiffness_rear", "car.payload", "road.friction"):
        place = model.names.index(cause)
        along = np.zeros(len(model.names))
        along[place] = 1.0
        along[:states] = model.start[:states, place] / model.start[place, place]
        for move in model.motion.transition:
            along[:states] = move @ along
        spread = load_population(scenario.population).spreads[cause].moments[1]
        ends = []
        for side in (0.01, -0.01):
            car, road = drawn.road, drawn.scenario.road
            if cause == "road.friction":
                road = road.model_copy(update={"mu": friction_of(road.mu, side * spread)})
            else:
                moved = {cause: drawn.deviations[cause] + side * spread}
                car = draw(scenario, 0, changes=moved).road
            other = PlanarSimulation(drawn.scenario.model_copy(update={"road": road}), car)
            other.reset(0)
            for action in actions:
                last = other.advance(action)
            ends.append(last[0])
        for name in ("sideslip", "yaw_rate", "speed_x"):
            complete = (ends[0][name] - ends[1][name]) / 0.02
            assert model.slopes[name][-1] @ along == pytest.approx(complete, rel=0.03, abs=2e-5)


@pytest.mark.parametrize(
    ("name", "targets"),
    [
        ("friction_step@1", ["mu_front"]),
        pytest.param("split_mu_braking@1", ["sideslip", "mu"], marks=pytest.mark.slow),
    ],
)
def test_halved_steps_change_little(name, targets):
    scenario = load_scenario(name)
    if name.startswith("split"):
        scenario = scenario.model_copy(update={"horizon": 6.0})
    channels = [channels_of(scenario)]
    whole = bounds(scenario, 2, channels, targets)
    finer = bounds(scenario, 2, channels, targets, share=5e-6)
    sooner = bounds(scenario, 2, channels, targets, step=0.02)
    for one, other, third in zip(whole, finer, sooner, strict=True):
        assert other.rms == pytest.approx(one.rms, rel=1e-3)
        assert third.rms == pytest.approx(one.rms, rel=0.08)


def test_more_sensors_never_make_it_worse():
    scenario = load_scenario("constant_mu@1")
    few = channels_of(scenario, ["wheel speed sensor"])
    more = channels_of(scenario, ["wheel speed sensor", "accelerometer"])
    every = channels_of(scenario)
    found = bounds(scenario, 0, [few, more, every], ["mu_front", "speed_x"])
    for target in range(2):
        least = [found[2 * place + target].deviation for place in range(3)]
        assert np.all(least[1] <= least[0] * (1.0 + 1e-9))
        assert np.all(least[2] <= least[1] * (1.0 + 1e-9))


def test_without_a_draw_the_friction_is_known():
    scenario = load_scenario("constant_mu")
    found = bounds(scenario, 0, [channels_of(scenario)], ["mu_front"])[0]
    assert found.rms == 0.0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("li2014_friction_step", "paper's solver"),
        ("two_turns_bicycle@1", "bicycle"),
        ("friction_step@1+dropout:3", "faults"),
    ],
)
def test_where_there_is_none_it_says_why(name, words):
    with pytest.raises(InputError, match=words):
        bounds(load_scenario(name), 0, [()], ["speed_x"])
