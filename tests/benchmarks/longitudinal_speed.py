"""What the benchmarks of the longitudinal world time: our form and the reference's of one job."""

import sys
import time
from math import atan, sin
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from gripbench.envs.drivers.profiles import breakpoints, profile_value, segment_records
from gripbench.envs.plants.longitudinal.plant import (
    INPUT_TYPE,
    TYRE_TYPE,
    derivatives,
    evaluate_tyres,
    jacobian,
    plant_record,
)
from gripbench.envs.plants.longitudinal.sampling import TRUTH_TYPE
from gripbench.envs.vehicles import GRAVITY, load_vehicle
from gripbench.envs.worlds import load_scenario, record, simulation_of
from gripbench.methods.extended_kalman_filter import ExtendedKalmanFilter

sys.path.insert(0, str(Path(__file__).parents[1] / "methods"))
from longitudinal_twins import FilterpyTwin

CAR = load_vehicle("li2014").values()
PLANT = plant_record(CAR)
CLEAN = (
    "constant_mu",
    "friction_step",
    "large_torque",
    "gradient",
    "combined_traction_braking",
)


def seconds(function, repeats):
    """Return the shortest processor time of a call [s] after one to warm up.

    Processor time, so that what else runs on the machine counts for neither side.
    """
    function()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def observations(samples):
    """Return observations of the simple scenario."""
    return record(load_scenario("constant_mu"), 0).observations[:samples]


def as_dicts(rows):
    """Return observations as a plain class takes them."""
    names = rows.dtype.names
    return [dict(zip(names, row.item(), strict=True)) for row in rows]


def batch(rows):
    """Return a call that runs the compiled filter over a recording."""
    method = ExtendedKalmanFilter()
    return lambda: method.run(CAR, rows)


def online(samples):
    """Return a call that runs the compiled filter one sample at a time."""
    return _one_by_one(ExtendedKalmanFilter(), samples)


def filterpy(samples):
    """Return a call that runs the twin around filterpy one sample at a time."""
    return _one_by_one(FilterpyTwin(), samples)


def _one_by_one(method, samples):
    def run():
        method.reset(CAR, 1e-3)
        for sample in samples:
            method.update(sample)

    return run


def scenario(name, noise, horizon):
    """Return a scenario with this process noise and length."""
    return load_scenario(name).model_copy(update={"wheel_speed_noise": noise, "horizon": horizon})


def rollout(chosen):
    """Return a call that simulates a scenario in one compiled loop."""
    simulation = simulation_of(chosen)
    return lambda: simulation.run(0)


def _compiled_slope(profiles, grade, end):
    """Return derivative and Jacobian over time: gripbench's own compiled functions."""
    inputs = np.zeros(1, INPUT_TYPE)
    tyres = np.zeros(1, TYRE_TYPE)
    dx, jac = np.zeros(3), np.zeros((3, 3))

    def set_inputs(t):
        at = min(t, end - 1e-12)
        front, rear, friction = (profile_value(at, profile) for profile in profiles)
        inputs[0] = (front, rear, friction, friction, grade, 0.0)

    def slope(t, x):
        set_inputs(t)
        derivatives(x, inputs[0], PLANT[0], dx)
        return dx.copy()

    def slopes(t, x):
        set_inputs(t)
        evaluate_tyres(x, PLANT[0], tyres[0])
        (
            jac[0, 0], jac[0, 1], jac[0, 2], jac[1, 0], jac[1, 1], jac[2, 0], jac[2, 2],
        ) = jacobian(*x, inputs[0], PLANT[0], tyres[0])  # fmt: skip
        return jac.copy()

    return slope, slopes


def _plain_slope(profiles, grade, end):
    """Return the derivative over time as a user of scipy writes it: plain Python, eq. 2-6."""
    mass, radius, inertia = CAR["mass"], CAR["wheel_radius"], CAR["wheel_inertia"]
    b, c, e = CAR["magic_b"], CAR["magic_c"], CAR["magic_e"]
    loads = float(PLANT["load_front"][0]), float(PLANT["load_rear"][0])

    def force(wheel_speed, v, peak):
        rolling = radius * wheel_speed
        stretched = b * (rolling - v) / max(rolling, v)
        return peak * sin(c * atan(stretched - e * (stretched - atan(stretched))))

    def slope(t, x):
        at = min(t, end - 1e-12)
        front, rear, mu = (profile_value(at, profile) for profile in profiles)
        v, w_front, w_rear = x.tolist()
        force_front = force(w_front, v, mu * loads[0])
        force_rear = force(w_rear, v, mu * loads[1])
        resistance = CAR["rolling_resistance"] * mass * GRAVITY + CAR["drag"] * v * v
        return (
            (force_front + force_rear - resistance) / mass + GRAVITY * sin(grade),
            (front - radius * force_front) / inertia,
            (rear - radius * force_rear) / inertia,
        )

    return slope, None


def lsoda(chosen, rtol, atol, restart=False, compiled=True):
    """Return a call that simulates a scenario with scipy's LSODA; it returns the states.

    With `compiled`, right-hand side and Jacobian are gripbench's own, so that the solvers are
    compared and not the languages; else they are plain Python. With `restart` the wheel speeds
    jump at each sample as process noise makes them, and the solver starts again there.
    """
    make = _compiled_slope if compiled else _plain_slope
    driver = chosen.driver
    parts = (driver.front, driver.rear or driver.front, chosen.friction)
    profiles = [segment_records(part) for part in parts]
    times = np.arange(chosen.steps + 1) * chosen.sample_time
    jumps = {0.0, chosen.horizon}.union(*(breakpoints(part) for part in parts))
    edges = times if restart else np.array(sorted(t for t in jumps if t <= chosen.horizon))
    start = np.array([chosen.initial_speed, *[chosen.initial_speed / CAR["wheel_radius"]] * 2])
    noise = np.random.default_rng(0).standard_normal((len(edges), 2)) * chosen.wheel_speed_noise

    def run():
        states = np.empty((len(times), 3))
        states[0] = x = start
        for i in range(len(edges) - 1):
            begin, end = edges[i], edges[i + 1]
            first, last = np.searchsorted(times, [begin + 1e-9, end + 1e-9])
            slope, jacobian = make(profiles, chosen.road_grade, end)
            solution = solve_ivp(
                slope, (begin, end), x, method="LSODA", t_eval=np.minimum(times[first:last], end),
                rtol=rtol, atol=atol, jac=jacobian,
            )  # fmt: skip
            states[first:last] = solution.y.T
            x = states[last - 1].copy()
            if restart:
                x[1:] *= 1.0 + noise[i + 1]
        return states

    return run


def lsoda_recording(chosen, tolerance, compiled):
    """Return a call that makes with LSODA what a rollout makes: every channel of the truth."""
    solve = lsoda(chosen, tolerance, tolerance / 10.0, compiled=compiled)
    driver = chosen.driver
    parts = (driver.front, driver.rear or driver.front, chosen.friction)
    mass, radius, inertia = CAR["mass"], CAR["wheel_radius"], CAR["wheel_inertia"]
    times = np.arange(chosen.steps + 1) * chosen.sample_time
    within = np.minimum(times, chosen.horizon - 1e-12)

    def values(part):
        total = np.zeros(len(times))
        for piece in part:
            inside = (within >= piece.start) & (within < piece.end)
            age = within[inside] - piece.start
            share = age / (piece.end - piece.start)
            total[inside] += piece.first + (piece.last - piece.first) * share
            total[inside] += piece.amplitude * np.sin(2.0 * np.pi * age / piece.period)
        return total

    def run():
        states = solve()
        front, rear, mu = (values(part) for part in parts)
        truth = np.empty(len(times), TRUTH_TYPE)
        truth["time"], truth["speed_x"] = times, states[:, 0]
        truth["mu_front"] = truth["mu_rear"] = mu
        truth["torque_front"], truth["torque_rear"] = front, rear
        total = 0.0
        for i, (axle, torque) in enumerate((("front", front), ("rear", rear)), start=1):
            rolling = radius * states[:, i]
            slip = (rolling - states[:, 0]) / np.maximum(rolling, states[:, 0])
            inner = CAR["magic_b"] * slip
            inner = inner - CAR["magic_e"] * (inner - np.arctan(inner))
            peak = mu * PLANT[f"load_{axle}"][0]
            force = peak * np.sin(CAR["magic_c"] * np.arctan(inner))
            truth[f"wheel_speed_{axle}"] = states[:, i]
            truth[f"slip_ratio_{axle}"], truth[f"force_x_{axle}"] = slip, force
            truth[f"wheel_acceleration_{axle}"] = (torque - radius * force) / inertia
            total = total + force
        gravity = GRAVITY * np.sin(chosen.road_grade)
        resistance = CAR["rolling_resistance"] * GRAVITY + CAR["drag"] / mass * states[:, 0] ** 2
        truth["accel_x"] = total / mass - resistance
        truth["speed_x_rate"] = truth["accel_x"] + gravity
        truth["utilisation"] = np.abs(total) / (mu * mass * GRAVITY)
        truth["road_grade"] = chosen.road_grade
        return truth

    return run


def front_force(states, mu):
    """Return the front tyre force [N] of states, shape (n, 3)."""
    rolling = CAR["wheel_radius"] * states[:, 1]
    slip = (rolling - states[:, 0]) / np.maximum(rolling, states[:, 0])
    inner = CAR["magic_b"] * slip
    inner = inner - CAR["magic_e"] * (inner - np.arctan(inner))
    return mu * PLANT["load_front"][0] * np.sin(CAR["magic_c"] * np.arctan(inner))


def states_of(truth):
    """Return the states of a recording's truth."""
    return np.column_stack([truth[c] for c in ("speed_x", "wheel_speed_front", "wheel_speed_rear")])


TOLERANCES = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8)


def equal_accuracy(name, horizon):
    """Return (tolerance, our error, LSODA's): the loosest tolerance that is no worse than ours.

    Errors are RMS front forces [N] against LSODA at rtol 1e-11.
    """
    chosen = scenario(name, 0.0, horizon)
    truth = rollout(chosen)()
    mu = truth["mu_front"]
    exact = front_force(lsoda(chosen, 1e-11, 1e-12)(), mu)

    def error(states):
        return float(np.sqrt(np.mean((front_force(states, mu) - exact) ** 2)))

    ours = error(states_of(truth))
    for tolerance in TOLERANCES:
        theirs = error(lsoda(chosen, tolerance, tolerance / 10.0)())
        if theirs <= ours:
            break
    return tolerance, ours, theirs


def summary():
    """Print the ratios of one run: reference's time over ours."""
    rows = observations(10_001)
    samples = as_dicts(rows)
    twin = seconds(filterpy(samples[:2000]), 5) / 2000
    whole, single = seconds(batch(rows), 15) / len(rows), seconds(online(samples), 5) / len(rows)
    print(f"Kalman filter, filterpy twin: {1e6 * twin:.1f} us a step")
    print(f"  compiled batch: {1e9 * whole:.0f} ns a step, {twin / whole:.0f} times faster")
    print(f"  compiled online: {1e6 * single:.2f} us a step, {twin / single:.1f} times faster")
    for name in CLEAN:
        tolerance, ours, theirs = equal_accuracy(name, 30.0)
        chosen = scenario(name, 0.0, 30.0)
        mine = seconds(rollout(chosen), 11)
        print(f"plant, {name}, 30 s: {1e3 * mine:.1f} ms ({ours:.3f} N)")
        for kind, compiled in (("plain Python", False), ("compiled", True)):
            states = seconds(lsoda(chosen, tolerance, tolerance / 10.0, compiled=compiled), 5)
            whole = seconds(lsoda_recording(chosen, tolerance, compiled), 5)
            print(
                f"  LSODA, {kind} right-hand side ({theirs:.3f} N): states {1e3 * states:.1f} ms, "
                f"ratio {states / mine:.2f}; every channel {1e3 * whole:.1f} ms, "
                f"ratio {whole / mine:.2f}"
            )
    noisy = scenario("constant_mu", 3.6e-4, 5.0)
    mine = seconds(rollout(noisy), 7)
    other = seconds(lsoda(noisy, 1e-6, 1e-7, restart=True), 3)
    print(
        f"plant with process noise, 5 s: ours {1e3 * mine:.1f} ms, LSODA restarted each sample "
        f"{1e3 * other:.0f} ms: {other / mine:.0f} times faster"
    )


if __name__ == "__main__":
    summary()
