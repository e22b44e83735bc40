"""Trains an anti-lock brake in the environment of braking on split friction.

The scenario's own driver steers; the policy gives each wheel its brake torque from the slip that
the sensors show. Its two numbers, the slip from which torque is released and how fast, are found
by the cross-entropy method: every lane of the vector environment tries one pair.
"""

import gymnasium
import numpy as np

import gripbench  # registers the environments

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
REQUEST = -1500.0  # brake torque that the pedal asks of each wheel [N m]
LANES, GENERATIONS, KEPT, STEPS = 12, 3, 3, 900


def brake(environment, radius, observation, policies):
    """Return the actions of all lanes: the driver's steering, the policies' torques."""
    actions = environment.driver_actions()
    threshold, rate = policies.T[:, :, None]
    speed = np.maximum(observation["speed_x"], 1.0)[:, None]
    rolling = radius * np.stack([observation[f"wheel_speed_{w}"] for w in WHEELS], axis=1)
    slip = 1.0 - rolling / speed
    share = np.clip(1.0 - rate * (slip - threshold), 0.0, 1.0)
    actions[:, 1:] = REQUEST * share / environment.action_map.scale[1:]
    return actions


def stopping_distances(environment, radius, policies, seed):
    """Return the distance [m] of each lane to its stop; one that spins pays its speed squared."""
    observation, info = environment.reset(seed=[seed] * LANES, options={"speed": 20.0})
    distance, running = np.zeros(LANES), np.ones(LANES, bool)
    for _ in range(STEPS):
        actions = brake(environment, radius, observation, policies)
        observation, _, terminated, truncated, info = environment.step(actions)
        speed = info["truth"]["speed_x"]
        distance += np.where(running, speed * environment.scenario.sample_time, 0.0)
        ended = running & (terminated | truncated)
        distance += np.where(ended & (info["termination"] != "stop"), speed**2, 0.0)
        running &= ~ended
        if not running.any():
            break
    return distance


def main():
    """Train, then compare with brakes that are never released, on a seed not trained on."""
    environment = gymnasium.make_vec("gripbench/SplitMuBraking-v0", num_envs=LANES)
    radius = gripbench.record(environment.scenario, 0).vehicle["wheel_radius"]
    draws = np.random.default_rng(0)
    mean, deviation = np.array([0.2, 10.0]), np.array([0.1, 6.0])
    for generation in range(GENERATIONS):
        policies = np.abs(draws.normal(mean, deviation, (LANES, 2)))
        distances = stopping_distances(environment, radius, policies, generation)
        best = policies[np.argsort(distances)[:KEPT]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 1e-3
        print(f"generation {generation}: best {distances.min():.1f} m, slip {mean[0]:.3f}")
    never = np.zeros((LANES, 2))
    never[0] = mean
    trained, locked = stopping_distances(environment, radius, never, 100)[:2]
    print(f"trained {trained:.1f} m, brakes never released {locked:.1f} m")


if __name__ == "__main__":
    main()
