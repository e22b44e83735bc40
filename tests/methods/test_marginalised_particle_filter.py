"""The particle filter against a plain one that is vectorised over particles; its random numbers."""

import numpy as np
import pytest
from scipy import stats
from track_twin import drive

from gripbench.methods.blocks.random_numbers import two_normals
from gripbench.methods.marginalised_particle_filter import PARTICLES, MarginalisedParticleFilter

MASK = (1 << 64) - 1


class Numbers:
    """Marsaglia's generator in Python integers."""

    def __init__(self, bits):
        self.bits = bits

    def uniform(self):
        self.bits ^= (self.bits << 13) & MASK
        self.bits ^= self.bits >> 7
        self.bits ^= (self.bits << 17) & MASK
        return ((self.bits >> 11) + 0.5) / 2.0**53

    def normals(self, pairs):
        draws = np.array([self.uniform() for _ in range(2 * pairs)]).reshape(pairs, 2)
        radius = np.sqrt(-2.0 * np.log(draws[:, 0]))
        return (radius * np.exp(2j * np.pi * draws[:, 1])).view(float).reshape(pairs, 2)


def test_random_numbers_are_normal_and_those_of_the_twin():
    bits, found = np.uint64(12345), []
    for _ in range(20000):
        bits, *pair = two_normals(np.uint64(bits))
        found.append(pair)
    np.testing.assert_allclose(found[:500], Numbers(12345).normals(500), rtol=1e-12, atol=1e-12)
    assert stats.kstest(np.ravel(found), "norm").pvalue > 0.01
    assert abs(np.corrcoef(np.transpose(found))[0, 1]) < 0.02


def forces(v, r, speed, steer, car):
    """Return a_y and yaw acceleration of either axle at stiffness 1 over paper, (N, 2, 2)."""
    a, b = car["cg_to_front"], car["cg_to_rear"]
    front = car["cornering_stiffness_front"] * (steer - (v + a * r) / speed)
    rear = -car["cornering_stiffness_rear"] * (v - b * r) / speed
    turned = np.cos(steer)
    rows = [
        [turned * front / car["mass"], rear / car["mass"]],
        [a * turned * front / car["yaw_inertia"], -b * rear / car["yaw_inertia"]],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def test_it_is_its_plain_twin():
    run = drive("two_turns@1", horizon=20.0)
    car, seen = run.vehicle, run.observations[1200:1500]
    method = MarginalisedParticleFilter("measured_speed")
    found, s = method.run(car, seen), method.settings
    numbers = Numbers(2 * s["seed"] + 1)
    for _ in range(20):
        numbers.uniform()
    draws = numbers.normals(PARTICLES)
    motion = draws * [s["speed_y_std"], 0.02] + [0.0, seen["yaw_rate"][0]]
    mean, P = (
        np.ones((PARTICLES, 2)),
        np.tile(s["stiffness_std"] ** 2 * np.eye(2), (PARTICLES, 1, 1)),
    )
    weight, resampled = np.full(PARTICLES, 1.0 / PARTICLES), 0
    for k in range(1, len(seen)):
        span, speed = seen["time"][k] - seen["time"][k - 1], seen["speed_x"][k]
        noise = np.diag([s["speed_y_walk"] ** 2, s["yaw_rate_walk"] ** 2]) * span
        G = span * forces(*motion.T, speed, seen["steer_angle"][k - 1], car)
        N = G @ P @ G.transpose(0, 2, 1) + noise
        innovation = np.einsum("nij,nj->ni", np.linalg.cholesky(N), numbers.normals(PARTICLES))
        drift = np.column_stack((-span * speed * motion[:, 1], np.zeros(PARTICLES)))
        motion = motion + drift + np.einsum("nij,nj->ni", G, mean) + innovation
        gain = P @ G.transpose(0, 2, 1) @ np.linalg.inv(N)
        mean = mean + np.einsum("nij,nj->ni", gain, innovation)
        P = P - gain @ N @ gain.transpose(0, 2, 1) + s["stiffness_walk"] ** 2 * span * np.eye(2)
        h = forces(*motion.T, speed, seen["steer_angle"][k], car)[:, 0]
        S = np.einsum("ni,nij,nj->n", h, P, h) + s["accel_y_noise"] ** 2 / span
        away = seen["accel_y"][k] - np.sum(h * mean, axis=1)
        chance = stats.norm.pdf(away, scale=np.sqrt(S))
        chance = chance * stats.norm.pdf(
            seen["yaw_rate"][k] - motion[:, 1], scale=s["gyro_noise"] / np.sqrt(span)
        )
        column = np.einsum("nij,nj->ni", P, h)
        mean = np.clip(mean + column * (away / S)[:, None], 0.02, 2.0)
        P = P - column[:, :, None] * column[:, None, :] / S[:, None, None]
        weight = weight * chance
        weight = weight / weight.sum()
        if 1.0 / np.sum(weight**2) < PARTICLES / 2:
            places = (np.arange(PARTICLES) + numbers.uniform()) / PARTICLES
            chosen = np.minimum(np.searchsorted(np.cumsum(weight), places), PARTICLES - 1)
            motion, mean, P = motion[chosen], mean[chosen], P[chosen]
            weight, resampled = np.full(PARTICLES, 1.0 / PARTICLES), resampled + 1
        assert found["speed_y"][k] == pytest.approx(weight @ motion[:, 0], abs=1e-7)
        front = car["cornering_stiffness_front"] * (weight @ mean[:, 0])
        assert found["cornering_stiffness_front"][k] == pytest.approx(front, rel=1e-6)
        variance = weight @ (P[:, 0, 0] + (mean[:, 0] - weight @ mean[:, 0]) ** 2)
        variance = variance * car["cornering_stiffness_front"] ** 2
        assert found["cornering_stiffness_front_variance"][k] == pytest.approx(variance, rel=1e-5)
    assert resampled > 3


def test_the_same_seed_gives_the_same_and_another_another():
    run = drive("two_turns@1", horizon=20.0)
    part = run.observations[1200:1300]
    one, same = (MarginalisedParticleFilter().run(run.vehicle, part) for _ in range(2))
    assert one.tobytes() == same.tobytes()
    other = MarginalisedParticleFilter(seed=2).run(run.vehicle, part)
    assert other["speed_y"][-1] != one["speed_y"][-1]
