"""The plant against physics written down a second time, scipy, closed forms and symmetry."""

import math

import numpy as np
import pytest
from planar_cases import OPEN_LOOP, SCENARIOS, held, scenario_of, simulation_of, vehicle_with
from scipy.integrate import solve_ivp

from gripbench.envs.plants.bicycle import steady_state
from gripbench.envs.plants.planar import plant
from gripbench.envs.plants.planar.world import PlanarSimulation
from gripbench.envs.roads.road import feel_road
from gripbench.envs.vehicles import load_vehicle

# --- the right-hand side, written a second time with vectors and matrices


def _shape(name, s):
    if name == "brush":
        return np.where(s < 3.0, s - s**2 / 3.0 + s**3 / 27.0, 1.0)
    if name == "dugoff":
        return np.where(s < 0.5, s, 1.0 - 0.25 / np.maximum(s, 0.5))
    return np.sin(1.3 * np.arctan(s / 1.3))


def _loads(x, v, normal):
    base = v["cg_to_front"] + v["cg_to_rear"]
    shift = v["mass"] * v["cg_height"] * x[9] / base
    front = v["mass"] * normal * v["cg_to_rear"] / base - shift
    rear = v["mass"] * normal * v["cg_to_front"] / base + shift
    roll = v["mass"] * v["cg_height"] * x[10]
    over_front = roll * v["roll_share_front"] / v["track_front"]
    over_rear = roll * (1.0 - v["roll_share_front"]) / v["track_rear"]
    return np.array(
        [
            front / 2 - over_front,
            front / 2 + over_front,
            rear / 2 - over_rear,
            rear / 2 + over_rear,
        ]
    ).clip(0.0, np.array([front, front, rear, rear]))


def reference_rhs(x, v, tyre, steer_rate, torque, mu, bank, grade, slopes, normal, stiff_loads):
    """Newton and Euler for the car: x as in the plant, `slopes` of bank and grade in time."""
    base = v["cg_to_front"] + v["cg_to_rear"]
    at = np.array(
        [
            [v["cg_to_front"], v["track_front"] / 2],
            [v["cg_to_front"], -v["track_front"] / 2],
            [-v["cg_to_rear"], v["track_rear"] / 2],
            [-v["cg_to_rear"], -v["track_rear"] / 2],
        ]
    )
    velocity = np.array([x[0], x[1]]) + x[2] * np.column_stack([-at[:, 1], at[:, 0]])
    angle = np.array([x[15], x[15], 0.0, 0.0])
    c, s = np.cos(angle), np.sin(angle)
    along = c * velocity[:, 0] + s * velocity[:, 1]
    across = -s * velocity[:, 0] + c * velocity[:, 1]
    rolling = v["wheel_radius"] * x[3:7]
    size = np.abs(rolling)
    denominator = np.where(size >= 1.0, size, 0.5 + 0.5 * size**2)
    load = _loads(x, v, normal)
    static = v["mass"] * 9.81 / base / 2 * np.repeat([v["cg_to_rear"], v["cg_to_front"]], 2)
    growth = (stiff_loads / static) ** v["stiffness_load_exponent"]
    lateral = np.repeat([v["cornering_stiffness_front"], v["cornering_stiffness_rear"]], 2) / 2
    pull = np.column_stack(
        [
            v["longitudinal_stiffness"] / 2 * growth * (rolling - along) / denominator,
            -lateral * growth * across / denominator,
        ]
    )
    length = np.hypot(pull[:, 0], pull[:, 1])
    capacity = mu * load
    with np.errstate(invalid="ignore", divide="ignore"):
        force = capacity[:, None] * _shape(tyre, length / capacity)[:, None] * pull
        force = np.where(length[:, None] > 0.0, force / length[:, None], 0.0)
    force[capacity == 0.0] = 0.0
    body = np.column_stack([c * force[:, 0] - s * force[:, 1], s * force[:, 0] + c * force[:, 1]])
    total = body.sum(axis=0) - [v["drag"] * x[0] * abs(x[0]), 0.0]
    moment = (at[:, 0] * body[:, 1] - at[:, 1] * body[:, 0]).sum()
    specific = total / v["mass"]
    sense = x[3:7] / np.sqrt(x[3:7] ** 2 + plant.SLOW_SPIN**2)
    applied = np.where(torque < 0.0, torque * sense, torque)
    drag_moment = v["wheel_radius"] * (force[:, 0] + v["rolling_resistance"] * load * sense)
    road = _rotation(x[11], grade, bank)
    out = np.zeros(16)
    out[0] = specific[0] + 9.81 * math.sin(grade) + x[2] * x[1]
    out[1] = specific[1] - 9.81 * math.cos(grade) * math.sin(bank) - x[2] * x[0]
    out[2] = moment / v["yaw_inertia"]
    out[3:7] = (applied - drag_moment) / (v["wheel_inertia"] / 2)
    out[7] = x[8]
    w, z = v["roll_frequency"], v["roll_damping"]
    out[8] = w**2 * (v["roll_gradient"] * specific[1] - x[7]) - 2 * z * w * x[8]
    out[9:11] = (specific - x[9:11]) / v["load_lag"]
    out[11] = (x[2] + slopes[1] * math.sin(bank)) / (math.cos(grade) * math.cos(bank))
    out[12:14] = (road @ [x[0], x[1], 0.0])[:2]
    out[14] = x[0]
    out[15] = steer_rate
    return out


def _normal(x, bank, grade, slopes):
    """Specific force normal to the road: gravity's, and that of following its shape."""
    road = _rotation(0.0, grade, bank)
    yawing = (x[2] + slopes[1] * math.sin(bank)) / (math.cos(grade) * math.cos(bank))
    spin = road.T @ [0.0, 0.0, yawing] + _rotation(0.0, 0.0, bank).T @ [0.0, slopes[1], 0.0]
    spin[0] += slopes[0]
    assert abs(spin[2] - x[2]) < 1e-12
    return (road.T @ [0.0, 0.0, 9.81])[2] + np.cross(spin, [x[0], x[1], 0.0])[2]


def _rotation(yaw, pitch, roll):
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return about_z @ about_y @ about_x


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_agrees_with_scipy_on_a_second_right_hand_side(name):
    """From the moment of most sideslip on, 60 ms: DOP853 against the plant's Runge-Kutta."""
    whole = scenario_of(name)
    peak = _most_dynamic(PlanarSimulation(whole, load_vehicle(whole.vehicle)).run(1))
    simulation = simulation_of(name, horizon=peak, score_from=0.0)
    simulation.run(1)
    run = simulation._run
    vehicle = load_vehicle(whole.vehicle).values()
    p, friction = run.plant[0], run.friction[0]
    reference, inputs = run.state.copy(), run.inputs.copy()
    start = run.state.copy()
    for _ in range(round(0.06 / whole.sample_time)):
        action = simulation.drive()
        steer = np.clip(action[0], -vehicle["steer_limit"], vehicle["steer_limit"])
        limit = vehicle["steer_rate_limit"]
        rate = np.clip((steer - reference[plant.STEER]) / whole.sample_time, -limit, limit)
        simulation.advance(action)
        for _ in range(round(whole.sample_time / plant.STEP)):
            feel_road(reference, p, friction, run.profile, inputs)
            bank, grade = inputs[plant.BANK], inputs[plant.GRADE]
            slopes = (inputs[plant.BANK_RATE], inputs[plant.GRADE_RATE])
            normal = _normal(reference, bank, grade, slopes)
            arguments = (
                vehicle,
                whole.tyre,
                rate,
                action[1:],
                inputs[plant.MU : plant.MU + 4].copy(),
                bank,
                grade,
                slopes,
                normal,
                _loads(reference, vehicle, normal),
            )
            solution = solve_ivp(
                lambda _, x, given: reference_rhs(x, *given),
                (0.0, plant.STEP),
                reference,
                method="DOP853",
                rtol=1e-10,
                atol=1e-10,
                args=(arguments,),
            )
            reference = solution.y[:, -1]
    moved = np.abs(run.state - start).max()
    assert moved > 0.1
    error = np.abs(run.state - reference)
    assert error[[0, 1, 2, 11]].max() < 1e-7  # speeds, yaw rate, heading
    assert error.max() < 1e-4  # wheel speeds settle within milliseconds


def _most_dynamic(truth):
    sideslip = np.abs(truth["sideslip"])
    return float(truth["time"][np.argmax(np.where(truth["time"] > 0.5, sideslip, 0.0))]) - 0.03


# --- steady cornering


@pytest.mark.parametrize("vehicle", ["dakhlallah2008", "yoon2015_pickup", "anderson2004_blazer"])
@pytest.mark.parametrize("tyre", ["brush", "dugoff", "magic_formula"])
def test_slow_cornering_is_that_of_the_bicycle(vehicle, tyre):
    # Without resistance and load transfer nothing but the axles' stiffness is left.
    car = vehicle_with(vehicle, drag=0.0, rolling_resistance=0.0)
    steer = 1e-4
    angle, lateral = [], []
    for speed in (12.0, 24.0):
        simulation = simulation_of(
            OPEN_LOOP | {"vehicle": vehicle, "tyre": tyre},
            vehicle=car,
            speed=speed,
            horizon=8.0,
            sample_time=0.01,
            steering={"kind": "step_steer", "amplitude": steer, "start": 0.5},
        )
        last = simulation.run(0)[-1]
        expected = steady_state(car.values(), float(last["speed_x"]))
        assert last["yaw_rate"] / steer == pytest.approx(expected.yaw_rate_gain, rel=1e-3)
        # The gain of sideslip changes its sign with speed: compare on the scale of the angles.
        assert last["sideslip"] / steer == pytest.approx(expected.sideslip_gain, abs=2e-3)
        base = car.values()["cg_to_front"] + car.values()["cg_to_rear"]
        angle.append(steer - base * last["yaw_rate"] / last["speed_x"])
        lateral.append(last["yaw_rate"] * last["speed_x"])
    gradient = (angle[1] - angle[0]) / (lateral[1] - lateral[0])
    assert gradient == pytest.approx(expected.understeer_gradient, abs=1e-5)


def test_blazer_understeers_by_the_4_degrees_per_g_of_anderson():
    blazer = load_vehicle("anderson2004_blazer").values()
    gradient = math.degrees(steady_state(blazer, 20.0).understeer_gradient * 9.81)
    assert gradient == pytest.approx(4.0, abs=0.1)


# --- symmetry and energy


def test_a_mirrored_run_mirrors():
    rng = np.random.default_rng(4)
    left, right = (simulation_of(OPEN_LOOP, tyre="brush") for _ in range(2))
    left.reset(0), right.reset(0)
    largest = 0.0
    for k in range(1500):
        steer = 0.1 * math.sin(0.005 * k) + 0.002 * rng.standard_normal()
        torque = rng.uniform(-900.0, 500.0, 4)
        a = left.advance(np.array([steer, *torque]))[0]
        b = right.advance(np.array([-steer, *torque[[1, 0, 3, 2]]]))[0]
        largest = max(largest, abs(a["sideslip"]))
    assert largest > 0.02
    for even in ("speed_x", "accel_x", "accel_z", "utilisation"):
        assert b[even] == pytest.approx(a[even], abs=1e-9)
    for odd in ("speed_y", "yaw_rate", "accel_y", "suspension_roll", "steer_angle", "sideslip"):
        assert b[odd] == pytest.approx(-a[odd], abs=1e-9)
    for place in ("front", "rear"):
        for even in ("wheel_speed", "force_x", "force_z", "mu_used"):
            assert b[f"{even}_{place}_left"] == pytest.approx(a[f"{even}_{place}_right"], abs=1e-6)
        assert b[f"force_y_{place}_left"] == pytest.approx(-a[f"force_y_{place}_right"], abs=1e-6)


def test_work_of_torques_and_gravity_goes_into_motion_heat_and_wind():
    grade = -0.03
    simulation = simulation_of(OPEN_LOOP, road={"mu": 0.6, "grade": grade}, tyre="brush")
    simulation.reset(0)
    run, v = simulation._run, load_vehicle("dakhlallah2008").values()
    energy, power = [], []
    for k in range(3001):
        x, w = run.state, run.wheels
        spin = x[3:7]
        energy.append(
            0.5 * v["mass"] * (x[0] ** 2 + x[1] ** 2)
            + 0.5 * v["yaw_inertia"] * x[2] ** 2
            + 0.5 * v["wheel_inertia"] / 2 * (spin**2).sum()
        )
        sliding = w[:, plant.LON_SPEED] - v["wheel_radius"] * spin
        heat = -(w[:, plant.FORCE_X] * sliding + w[:, plant.FORCE_Y] * w[:, plant.LAT_SPEED])
        assert (heat >= -1e-9).all()
        resistance = v["wheel_radius"] * w[:, plant.RESISTANCE]
        power.append(
            ((w[:, plant.APPLIED_TORQUE] - resistance) * spin).sum()
            - heat.sum()
            - v["drag"] * x[0] ** 2 * abs(x[0])
            + v["mass"] * 9.81 * math.sin(grade) * x[0]
        )
        steer = 0.06 * math.sin(0.004 * k)
        front = 300.0 if k < 1500 else -700.0
        simulation.advance(np.array([steer, front, front, 0.0, 0.0]))
    power = np.array(power)
    # Torque jumps at sample 1500: the trapezium rule needs the value on its other side there.
    work = 1e-3 * (0.5 * (power[1:] + power[:-1])).sum()
    jump = 0.5e-3 * abs(power[1501] - power[1500])
    assert abs(energy[-1] - energy[0]) > 5e4
    assert energy[-1] - energy[0] == pytest.approx(work, abs=2.0 * jump + 5.0)


# --- low speed


@pytest.mark.parametrize("tyre", ["brush", "dugoff", "magic_formula"])
@pytest.mark.parametrize("torque", [-400.0, -4000.0])
def test_braking_to_a_stop_ends_at_rest_without_chatter(tyre, torque):
    simulation = simulation_of(OPEN_LOOP, speed=8.0, tyre=tyre, stop_speed=0.0)
    simulation.reset(0)
    truth = held(simulation, [0.05, *[torque] * 4], 9000)
    assert simulation.termination == ""
    assert np.isfinite(truth.view(np.float64)).all()
    speed = truth["speed_x"]
    assert speed.min() > -1e-3
    assert abs(speed[-1]) < 1e-3
    assert np.abs(np.diff(speed)).max() < 0.011  # no step is harder than mu g in 1 ms
    rest = truth[np.argmax(speed < 0.02) :]
    assert len(rest) > 2000
    turns = np.abs(np.diff(np.sign(np.diff(rest["speed_x"])))).sum() / 2
    assert turns < 10
    assert np.abs(rest["accel_x"][1000:]).max() < 0.02
    assert np.abs(rest["yaw_rate"]).max() < 0.02


def test_locked_wheels_stop_in_the_distance_of_sliding_friction():
    car = vehicle_with("dakhlallah2008", drag=0.0, rolling_resistance=0.0)
    simulation = simulation_of(OPEN_LOOP, vehicle=car, speed=15.0, tyre="brush", road={"mu": 0.3})
    simulation.reset(0)
    samples = []
    while not simulation.termination:
        samples.append(simulation.advance(np.array([0.0, *[-3000.0] * 4]))[0])
    last = samples[-1]
    assert simulation.termination == "stop"
    travelled = math.hypot(last["position_x"], last["position_y"])
    assert travelled == pytest.approx(15.0**2 / (2.0 * 0.3 * 9.81), rel=0.01)


def test_a_parked_vehicle_stays_on_level_ground_and_hardly_creeps_on_a_slope():
    level = simulation_of(OPEN_LOOP, speed=0.0, stop_speed=0.0)
    level.reset(0)
    truth = held(level, [0.2, 0.0, 0.0, 0.0, 0.0], 500)
    for name in ("speed_x", "speed_y", "yaw_rate", "accel_x", "accel_y", "sideslip"):
        assert np.abs(truth[name]).max() < 1e-12
    slope = simulation_of(
        OPEN_LOOP, speed=0.0, stop_speed=0.0, road={"mu": 0.8, "grade": 0.1, "bank": 0.05}
    )
    slope.reset(0)
    truth = held(slope, [0.0, *[-1500.0] * 4], 3000)
    assert np.abs(truth["speed_x"][-1]) < 0.02
    assert np.abs(truth["speed_y"][-1]) < 0.01
    assert np.abs(np.diff(truth["speed_x"][2000:])).max() < 1e-6


def test_a_vehicle_moves_off_from_rest():
    simulation = simulation_of(OPEN_LOOP, speed=0.0, stop_speed=0.0)
    simulation.reset(0)
    truth = held(simulation, [0.0, 200.0, 200.0, 0.0, 0.0], 4000)
    assert (np.diff(truth["speed_x"]) > 0.0).all()
    expected = 400.0 / 0.306 / 1550.0 * 4.0  # less the wheels' inertia and resistances
    assert 0.8 * expected < truth["speed_x"][-1] < expected
    assert truth["slip_ratio_front_left"].max() < 0.05
