"""Task of the learning environments: vehicles command accelerations to reach their slots without a violation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import PathLike, number
from ._native import Error
from ._scenario import Scenario, to_scenario
from ._vector import VectorSimulation

#: Penalty of a violation.
VIOLATION = 100.0


class Worlds(VectorSimulation):
    """Worlds of an environment. A new world skips seeds without a valid start.

    Raises :class:`Error` for a scenario with parts that an environment ignores.
    """

    _searches = True

    def __init__(
        self,
        scenario: Scenario | PathLike,
        num_envs: int,
        *,
        threads: int | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        wanted = to_scenario(scenario, set)
        if parts := wanted._native.parts_ignored_by_environments():
            raise Error(refusal(wanted.name, parts))
        super().__init__(wanted, num_envs, threads=threads)

    def start(self, seed: int, is_given: bool) -> None:
        """Resets the only world to a seed, or to the next one with a valid start if no seed was given."""
        if is_given:
            self.reset(seeds=[seed])
        else:
            self._reset(first=seed)


def refusal(name: str, parts: list[tuple[str, str, tuple[str, str] | None]]) -> str:
    """Returns the message on parts of a scenario that an environment ignores."""
    problem = ", ".join(f"{key} ({what})" for key, what, _ in parts)
    remedies = [f"without [{key.partition('.')[0]}]" for key, _, off in parts if off is None]
    values = {"false": "False"}
    sets = {f"'{off[0]}': {values.get(off[1], off[1])}".replace('"', "'") for _, _, off in parts if off is not None}
    remedies = [f"give a scenario {' and '.join(sorted(set(remedies)))}"] if remedies else []
    remedies += [f"give set={{{', '.join(sorted(sets))}}}"] if sets else []
    return f"scenario: an environment ignores parts of {name}: {problem}; {', and '.join(remedies)}"


def steps_of_action(hz: float, scenario: Scenario) -> int:
    """Returns the number of steps for which an action is held.

    Raises :class:`Error` where ``1 / hz`` is not a whole number of steps, or longer than the scenario.
    """
    actions_per_step = hz * scenario.dt_s
    if actions_per_step * scenario.steps < 1 - 1e-9:
        least_hz = 1 / (scenario.dt_s * scenario.steps)
        raise Error(f"hz: an action must not be longer than the scenario, got {hz}; give {least_hz:.12g} or more")
    steps = round(1 / actions_per_step)
    if abs(steps * actions_per_step - 1) <= 1e-9:
        return steps
    fewer = int(1 / actions_per_step)
    rates_hz = " or ".join(f"{1 / (count * scenario.dt_s):.12g}" for count in (fewer + 1, fewer) if count > 0)
    problem = f"an action must be held for a whole number of steps of {scenario.dt_s} s"
    raise Error(f"hz: {problem}, got {hz}; give {rates_hz}")


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
        self.steps = steps_of_action(self.hz, scenario)
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
