"""Marginalised particle filter of the cornering stiffness: after Berntorp & Di Cairano (2018).

K. Berntorp, S. Di Cairano, Tire-stiffness and vehicle-state estimation based on noise-adaptive
particle filtering, IEEE Transactions on Control Systems Technology 27 (2019), MERL TR2018-025. The
forces of linear tyres, C_i alpha_i, are linear in the stiffness once the motion is given, so only
the motion (v_y, r) is sampled; every particle carries the mean and covariance of its stiffnesses
c = (C_f, C_r) over those on paper, given its path. A particle's own next motion tells of c, and so
does a_y, in which the same c stands: the noise of the process and of the measurement depend on
each other, as in the paper.

Departure: the paper takes the stiffness as noise with an unknown mean and covariance that a
normal-inverse-Wishart distribution learns with a forgetting factor; here it is a random walk of
known size, so that the conditional distribution is the Kalman filter of Schon, Gustafsson &
Nordlund (2005), Marginalized particle filters for mixed linear/nonlinear state-space models, IEEE
Transactions on Signal Processing 53, algorithm 1. No scale of the noise has to be learned then, and
an excitation that ends leaves the stiffness known with a variance that grows.

500 particles; systematic resampling (Kitagawa 1996) where fewer than half of them count. The same
seed gives the same numbers.
"""

from __future__ import annotations

from math import cos, exp, log, sqrt

import numpy as np

from gripbench.methods.blocks.random_numbers import RANDOM_STATE, advance, two_normals, uniform
from gripbench.methods.blocks.single_track_filter import (
    FUSED_PARAMETERS,
    INPUT_STATE,
    LATERAL_ESTIMATES,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    read_inputs,
    write_lateral,
)
from gripbench.methods.contract import Parameter, compiled

PARTICLES = 500

_STATE = np.dtype(
    [
        ("inputs", INPUT_STATE),
        ("random", RANDOM_STATE),
        ("particles", np.float64, (PARTICLES, 7)),  # v_y, r, c_f, c_r, P_ff, P_fr, P_rr
        ("kept", np.float64, (PARTICLES, 7)),
        ("weight", np.float64, (PARTICLES,)),
        ("score", np.float64, (PARTICLES,)),
    ]
)
_LEAST, _LARGEST = 0.02, 2.0


@compiled
def _start(state, params):
    """Draw the first motion of every particle; the yaw rate is moved to the first reading."""
    bits = np.uint64(int(params.seed) * 2 + 1)
    for _ in range(20):  # a small number has few bits
        bits = advance(bits)
    for i in range(PARTICLES):
        bits, first, second = two_normals(bits)
        particle = state.particles[i]
        particle[0], particle[1] = params.speed_y_std * first, 0.02 * second
        particle[2] = particle[3] = 1.0
        particle[4] = particle[6] = params.stiffness_std**2
        state.weight[i] = 1.0 / PARTICLES
    state.random = bits


@compiled
def _move(particle, span, speed, steer, first, second, params):
    """Sample a particle's next motion and learn its stiffnesses from it.

    `first` and `second` are standard normal numbers.
    """
    m, inertia = params.mass, params.yaw_inertia
    a, b = params.cg_to_front, params.cg_to_rear
    v, r, front, rear, P_ff, P_fr, P_rr = particle
    force_f = params.cornering_stiffness_front * (steer - (v + a * r) / speed)
    force_r = -params.cornering_stiffness_rear * (v - b * r) / speed
    turned = cos(steer)
    y_f, y_r = span * turned * force_f / m, span * force_r / m
    z_f, z_r = span * a * turned * force_f / inertia, -span * b * force_r / inertia
    # covariance of stiffnesses and motion, and of the motion, N = L L'
    fy, fz = P_ff * y_f + P_fr * y_r, P_ff * z_f + P_fr * z_r
    ry, rz = P_fr * y_f + P_rr * y_r, P_fr * z_f + P_rr * z_r
    L_yy = sqrt(y_f * fy + y_r * ry + params.speed_y_walk**2 * span)
    L_zy = (z_f * fy + z_r * ry) / L_yy
    L_zz = sqrt(z_f * fz + z_r * rz + params.yaw_rate_walk**2 * span - L_zy * L_zy)
    particle[0] = v + y_f * front + y_r * rear - span * speed * r + L_yy * first
    particle[1] = r + z_f * front + z_r * rear + L_zy * first + L_zz * second
    # the sampled step is a measurement of the stiffnesses with the innovation L n
    gain_fy, gain_ry = fy / L_yy, ry / L_yy
    gain_fz, gain_rz = (fz - gain_fy * L_zy) / L_zz, (rz - gain_ry * L_zy) / L_zz
    particle[2] = front + gain_fy * first + gain_fz * second
    particle[3] = rear + gain_ry * first + gain_rz * second
    walk = params.stiffness_walk**2 * span
    particle[4] = P_ff - gain_fy * gain_fy - gain_fz * gain_fz + walk
    particle[5] = P_fr - gain_fy * gain_ry - gain_fz * gain_rz
    particle[6] = P_rr - gain_ry * gain_ry - gain_rz * gain_rz + walk


@compiled
def _judge(particle, span, speed, steer, yaw_rate, accel_y, params):
    """Take both readings; return the logarithm of a particle's likelihood."""
    noise = params.gyro_noise**2 / span
    away = yaw_rate - particle[1]
    score = -0.5 * away * away / noise
    v, r = particle[0], particle[1]
    force_f = params.cornering_stiffness_front * (steer - (v + params.cg_to_front * r) / speed)
    force_r = -params.cornering_stiffness_rear * (v - params.cg_to_rear * r) / speed
    h_f, h_r = cos(steer) * force_f / params.mass, force_r / params.mass
    f, g = particle[4] * h_f + particle[5] * h_r, particle[5] * h_f + particle[6] * h_r
    spread = h_f * f + h_r * g + params.accel_y_noise**2 / span
    away = accel_y - h_f * particle[2] - h_r * particle[3]
    particle[2] = min(max(particle[2] + f / spread * away, _LEAST), _LARGEST)
    particle[3] = min(max(particle[3] + g / spread * away, _LEAST), _LARGEST)
    particle[4] -= f * f / spread
    particle[5] -= f * g / spread
    particle[6] -= g * g / spread
    return score - 0.5 * (away * away / spread + log(spread))


@compiled
def _resample(state):
    """Replace the particles by equal ones, each as often as it counts."""
    state.random = advance(state.random)
    place, total, source = uniform(state.random), state.weight[0], 0
    state.kept[:] = state.particles
    for i in range(PARTICLES):
        while total * PARTICLES < i + place and source < PARTICLES - 1:
            source += 1
            total += state.weight[source]
        for k in range(7):
            state.particles[i, k] = state.kept[source, k]
    state.weight[:] = 1.0 / PARTICLES


@compiled
def _advance(state, span, yaw_rate, accel_y, params):
    inputs, bits = state.inputs, state.random
    best = -np.inf
    for i in range(PARTICLES):
        particle = state.particles[i]
        bits, first, second = two_normals(bits)
        _move(particle, span, inputs.speed, inputs.last_steer, first, second, params)
        score = _judge(particle, span, inputs.speed, inputs.steer, yaw_rate, accel_y, params)
        state.score[i] = score
        best = max(best, score)
    state.random = bits
    total = 0.0
    for i in range(PARTICLES):
        state.weight[i] *= exp(state.score[i] - best)
        total += state.weight[i]
    squares = 0.0
    for i in range(PARTICLES):
        state.weight[i] /= total
        squares += state.weight[i] ** 2
    if squares * PARTICLES > 2.0:
        _resample(state)


@compiled
def _mean(state, k):
    total = 0.0
    for i in range(PARTICLES):
        total += state.weight[i] * state.particles[i, k]
    return total


@compiled
def _spread(state, k, mean):
    total = 0.0
    for i in range(PARTICLES):
        total += state.weight[i] * (state.particles[i, k] - mean) ** 2
    return total


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    if obs.first:
        for i in range(PARTICLES):
            state.particles[i, 1] += obs.yaw_rate
    elif obs.elapsed > 0.0:
        _advance(state, obs.elapsed, obs.yaw_rate, obs.accel_y, params)
    speed_y = _mean(state, 0)
    write_lateral(state.inputs, speed_y, _mean(state, 1), _spread(state, 0, speed_y), est)
    front, rear = _mean(state, 2), _mean(state, 3)
    paper_front = params.cornering_stiffness_front
    paper_rear = params.cornering_stiffness_rear
    est.cornering_stiffness_front = paper_front * front
    est.cornering_stiffness_rear = paper_rear * rear
    est.cornering_stiffness_front_variance = paper_front**2 * (
        _mean(state, 4) + _spread(state, 2, front)
    )
    est.cornering_stiffness_rear_variance = paper_rear**2 * (
        _mean(state, 6) + _spread(state, 3, rear)
    )


_STIFFNESSES = ("cornering_stiffness_front", "cornering_stiffness_rear")


class MarginalisedParticleFilter(SingleTrackFilter):
    """Sampled lateral motion; the stiffnesses of each sample by a Kalman filter."""

    name = "marginalised_particle_filter"
    title = "Marginalised particle filter"
    reference = "Berntorp & Di Cairano (2018), MERL TR2018-025"
    estimates = (*LATERAL_ESTIMATES, *_STIFFNESSES)
    variances = (*LATERAL_VARIANCES, *_STIFFNESSES)
    parameters = (
        *FUSED_PARAMETERS,
        Parameter("stiffness_std", 0.15, "-", "Relative error of the stiffness", 1e-3, 1.0),
        Parameter("stiffness_walk", 0.3, "1/sqrt(s)", "Walk of the relative stiffness", 0.0, 3.0),
        Parameter("seed", 1, "-", "Of the particles", 0, 2**31),
    )
    state = _STATE
    start = staticmethod(_start)
    step = staticmethod(_step)
