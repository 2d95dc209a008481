"""Flies an episode of :mod:`tautline.pettingzoo`: agents command accelerations to reach their slots.

Usage: ``python pettingzoo_formation.py [SEED]``. The policy of each agent flies straight to its slot.
"""

from __future__ import annotations

import sys

import numpy as np
from tautline.pettingzoo import FormationEnv


def straight(observation: np.ndarray, axes: int = 2) -> np.ndarray:
    """Returns the action towards the slot, with damping."""
    velocity, to_slot = observation[:axes], observation[axes : 2 * axes]
    return np.clip(0.2 * to_slot - 0.4 * velocity, -1, 1).astype(np.float32)


def episode(seed: int = 0, duration_s: float = 20.0) -> tuple[float, str, float]:
    """Returns sum of rewards, verdict and smallest clearance [m] of an episode."""
    env = FormationEnv("pentagon", set={"start.jitter_m": 0.1, "time.duration_s": duration_s})
    observations, infos = env.reset(seed=seed)
    total = 0.0
    while env.agents:
        observations, rewards, _, _, infos = env.step({agent: straight(observations[agent]) for agent in env.agents})
        total += sum(rewards.values())
    info = infos["vehicle_1"]
    return total, info["verdict"], info["clearance_m"]


if __name__ == "__main__":
    reward, verdict, clearance_m = episode(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    print(f"{verdict}: smallest clearance {clearance_m:.3f} m, sum of rewards {reward:.0f}")
