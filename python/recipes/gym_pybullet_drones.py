"""Audits a rollout of gym-pybullet-drones: the file ``save-flight-*.npy`` of its ``Logger.save()``.

Usage: ``python gym_pybullet_drones.py results/save-flight-....npy 0.12``.

In spite of its name the file is an archive: ``timestamps`` (N, K) [s] and ``states`` (N, 16, K). The first six rows of
``states`` are position [m] and velocity [m/s]. Columns that the logger reserved and never wrote are zero.
"""

from __future__ import annotations

import sys

import numpy as np
import tautline as tl
from numpy.typing import NDArray

Arrays = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def load(file: str) -> Arrays:
    """Returns times (T,) [s], positions (T, N, 3) [m] and velocities (T, N, 3) [m/s] of a log."""
    with np.load(file) as log:
        times, states = log["timestamps"], log["states"]
    if (times != times[:1]).any():
        raise tl.Error(f"{file}: the drones were logged at different times; log all drones in every step")
    t = times[0]
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]])
    written = t > before
    motion = np.ascontiguousarray(states[:, :6, written].transpose(2, 0, 1), dtype=float)
    return t[written].astype(float), motion[:, :, :3], motion[:, :, 3:]


def main() -> int:
    """Audits the log of the first argument with the safety distance of the second [m]."""
    file, delta = sys.argv[1], float(sys.argv[2])
    t, positions, velocities = load(file)
    audit = tl.audit(t, positions, velocities=velocities, delta=delta)
    print(audit)
    return 0 if audit.is_clear else 1


if __name__ == "__main__":
    sys.exit(main())
