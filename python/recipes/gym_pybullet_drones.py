"""Judges a rollout of gym-pybullet-drones by the file that its ``Logger.save()`` leaves: ``save-flight-*.npy``.

    python gym_pybullet_drones.py results/save-flight-....npy 0.12

The file is an archive of arrays, whatever its name says: ``timestamps`` (N, K) [s] and ``states`` (N, 16, K), whose first six rows are
position [m] and velocity [m/s]. Columns that were reserved and never written are zero. Nothing of that package is imported.
"""

from __future__ import annotations

import sys

import numpy as np
import tautline as tl
from numpy.typing import NDArray

Arrays = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def load(file: str) -> Arrays:
    """Times (T,) [s], positions (T, N, 3) [m] and velocities (T, N, 3) [m/s] of a log."""
    with np.load(file) as log:
        times, states = log["timestamps"], log["states"]
    if (times != times[:1]).any():
        raise tl.Error(f"{file}: the drones were logged at different times; log all of them in every step")
    t = times[0]
    before = np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]])
    written = t > before
    motion = np.ascontiguousarray(states[:, :6, written].transpose(2, 0, 1), dtype=float)
    return t[written].astype(float), motion[:, :, :3], motion[:, :, 3:]


def main() -> int:
    """Judges the log of the first argument with the safety distance of the second [m]."""
    file, delta = sys.argv[1], float(sys.argv[2])
    t, positions, velocities = load(file)
    judged = tl.audit(t, positions, velocities=velocities, delta=delta)
    print(judged)
    return 0 if judged.is_clear else 1


if __name__ == "__main__":
    sys.exit(main())
