"""Task of the learning environments: vehicles command accelerations to reach their slots without a violation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._arguments import number
from ._native import Error
from ._scenario import Scenario

#: Penalty of a violation.
VIOLATION = 100.0


class FormationTask:
    """Observations, commands and rewards of a scenario's vehicles.

    A vehicle observes its velocity [m/s] and the vectors to its slot of the first leg and to all other vehicles [m]. An
    action from -1 to 1 along each axis is a share of the largest acceleration. The reward is the distance to the slot
    [m], negative, less a penalty for a violation.
    """

    def __init__(self, scenario: Scenario, hz: float, max_accel_m_s2: float) -> None:
        self.hz, self.max_accel_m_s2 = number(hz, "hz"), number(max_accel_m_s2, "max_accel_m_s2")
        for name, value in (("hz", self.hz), ("max_accel_m_s2", self.max_accel_m_s2)):
            if not 0 < value < np.inf:
                raise Error(f"{name}: must be a finite number above 0, got {value}")
        #: Steps of the scenario for one action.
        self.steps = max(1, round(1 / (self.hz * scenario.dt_s)))
        self.count = len(scenario)
        in_plane = not (scenario.positions_m[:, 2].any() or scenario.slots_m[:, 2].any())
        #: Axes of actions and observations.
        self.axes = 2 if in_plane else 3
        #: Numbers that a vehicle observes.
        self.observed = self.axes * (self.count + 1)
        self._slots_m = scenario.slots_m[:, : self.axes]
        every = np.arange(self.count)
        self._others = np.array([np.delete(every, k) for k in every], dtype=np.intp).reshape(self.count, -1)

    def observe(self, positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> NDArray[np.float32]:
        """Returns observations (E, N, ``observed``) of positions and velocities (E, N, 3)."""
        p, v = positions[..., : self.axes], velocities[..., : self.axes]
        others = p[:, self._others] - p[:, :, None]
        parts = v, self._slots_m - p, others.reshape(*p.shape[:2], -1)
        return np.concatenate(parts, axis=-1, dtype=np.float32)

    def commands(self, actions: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Returns accelerations [m/s^2] of actions, which must have this shape."""
        given = np.asarray(actions, dtype=np.float64)
        if given.shape != shape:
            raise Error(f"actions: an array of shape {shape} is needed, not of shape {given.shape}")
        return np.asarray(self.max_accel_m_s2 * np.clip(given, -1.0, 1.0))

    def rewards(self, positions: NDArray[np.float64], violated: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Returns the reward of each vehicle (E, N)."""
        errors_m = np.linalg.norm(self._slots_m - positions[..., : self.axes], axis=-1)
        return np.asarray(-errors_m - VIOLATION * violated[:, None])
