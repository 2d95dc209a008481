"""Shields a random policy in a simulator of its own, and audits the flight.

Usage: ``python shielded_policy.py [--bare]``. The simulator is a loop over point masses; the policy commands random
accelerations and, half of the time, flies at the nearest vehicle. ``--bare`` leaves the shield out.
"""

from __future__ import annotations

import sys

import numpy as np
import tautline as tl
from numpy.typing import NDArray

#: Safety distance [m], period of commands [s] and largest acceleration [m/s^2].
DELTA_M, PERIOD_S, ACCEL_M_S2 = 1.0, 0.05, 5.0


def policy(p: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Returns accelerations (N, 3): random ones, or towards the nearest vehicle."""
    away = np.linalg.norm(p[:, None] - p[None], axis=2) + 1e9 * np.eye(len(p))
    dive = 10.0 * (p[away.argmin(axis=1)] - p)
    wanted = np.where(random.random((len(p), 1)) < 0.5, dive, random.normal(0.0, ACCEL_M_S2, p.shape))
    return wanted / np.maximum(1.0, np.linalg.norm(wanted, axis=1, keepdims=True) / ACCEL_M_S2)


def fly(shielded: bool, steps: int = 600, seed: int = 0) -> tuple[tl.Audit, str | None]:
    """Returns the audit of a flight, and the bound that it exceeded, if any."""
    random = np.random.default_rng(seed)
    p = 4.0 * np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3).astype(float)
    v = np.zeros_like(p)
    shield = tl.Shield(p, delta_m=DELTA_M, period_s=PERIOD_S, accel_m_s2=ACCEL_M_S2)
    positions, velocities = [p], [v]
    for _ in range(steps):
        u = policy(p, random)
        if shielded:
            # A third of all messages is lost.
            u = shield.filter(p, v, u, lost=random.random((len(p), len(p))) < 1 / 3)
        p = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2
        v = v + u * PERIOD_S
        positions.append(p)
        velocities.append(v)
    t = np.arange(steps + 1) * PERIOD_S
    # Accelerations are bounded, so the audit needs no assumption on the motion between samples.
    bounded = {"motion": "bounded", "max_accel": ACCEL_M_S2 + 1e-9}
    audit = tl.audit(t, np.stack(positions), velocities=np.stack(velocities), delta=DELTA_M, **bounded)
    return audit, shield.report()["exceeded"] if shielded else None


if __name__ == "__main__":
    shielded = "--bare" not in sys.argv[1:]
    judged, exceeded = fly(shielded)
    print(judged)
    if shielded:
        print("every bound of the shield was kept" if exceeded is None else exceeded)
