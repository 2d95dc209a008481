"""Gymnasium environments: all vehicles of a world are one agent.

``import tautline.gymnasium`` registers ``tautline/Formation-v0``. It needs the package gymnasium, 1.1 or later.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import PathLike
from ._formation import VIOLATION, FormationTask, Worlds
from ._native import Error
from ._scenario import Scenario

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as missing:
    package = str(missing.name).partition(".")[0]
    raise ModuleNotFoundError(
        f"tautline.gymnasium: the package {package} is missing; pip install 'gymnasium>=1.1'", name=package
    ) from None

__all__ = ["VIOLATION", "FormationEnv", "FormationVectorEnv"]

Observations = NDArray[np.float32]
Info = dict[str, Any]


class FormationVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Worlds of a scenario in which vehicles fly to their slots, stepped together.

    Actions are (E, N, D), from -1 to 1 along each axis, a share of ``max_accel_m_s2``, held for ``1 / hz`` seconds.
    Observations are (E, N, D (N + 1)): of each vehicle its velocity [m/s] and the vectors to its slot and to all others
    [m]. D is 2 in the plane z = 0, else 3. The reward is the mean distance to the slots [m], negative, less
    ``VIOLATION`` for a violation.

    A violation, at or between steps, and a failed motion terminate an episode. The end of the scenario truncates it.
    ``info["clearance_m"]`` has the smallest clearance of each episode so far [m], and ``info["verdict"]`` the verdict
    of each episode that is over. All modes of autoreset are supported.
    """

    sim: Worlds

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        num_envs: int = 1,
        *,
        hz: float = 20.0,
        max_accel_m_s2: float = 5.0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        self.sim = Worlds(scenario, num_envs, threads=threads, set=set)
        self.task = FormationTask(self.sim.scenario, hz, max_accel_m_s2)
        self.num_envs = self.sim.num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = _spaces(self.task)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._done = np.zeros(self.num_envs, dtype=np.bool_)
        self._is_seeded = False

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Resets all episodes, or those with ``options["reset_mask"]`` (E,).

        World e takes ``seed + e`` or ``seed[e]`` as the seed of its start and flight. Without a seed, or with None in
        the list, a world takes its next seed; the first ones are random. Seeds without a valid start are passed over
        then, and are an error where they are given.
        """
        mask = np.ones(self.num_envs, dtype=np.bool_)
        if options is not None and options.get("reset_mask") is not None:
            mask = options["reset_mask"]
        first = None
        if isinstance(seed, (int, np.integer)):
            super().reset(seed=int(seed))
            seed = [int(seed) + e for e in range(self.num_envs)]
        elif not self._is_seeded:
            first = int(self.np_random.integers(2**31))
        self.sim._reset(mask, seed, first)
        self._is_seeded = True
        self._done[mask] = False
        return self._observe(), self._info(np.zeros_like(self._done))

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Info]:
        """Flies ``1 / hz`` seconds in every world. In the mode ``NEXT_STEP``, worlds whose episode was over are reset
        instead."""
        u = self.task.commands(actions, (self.num_envs, self.task.count, self.task.axes))
        if not self._is_seeded:
            raise Error("step: the environment has no episode; call reset first")
        before = self._done.copy()
        if before.any():
            if self.autoreset_mode == AutoresetMode.DISABLED:
                places = np.flatnonzero(before).tolist()
                raise Error(f"step: the episodes of the worlds {places} are over; reset them with reset_mask")
            u[before] = 0.0
        self.sim.step(u, steps=self.task.steps)
        if before.any():
            self.sim.reset(before)
        terminated, truncated = _ends(self.sim)
        rewards = self.task.rewards(self.sim.positions, self.sim.least_clearance_m < 0).mean(axis=1)
        rewards[before] = 0.0
        self._done = terminated | truncated
        observations, info = self._observe(), self._info(self._done)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._done.any():
            observations, info = self._restart(observations, info)
        return observations, rewards, terminated, truncated, info

    def _restart(self, final: Observations, final_info: Info) -> tuple[Observations, Info]:
        """Resets the episodes that are over. The info gets their last observations and info."""
        done = self._done
        last = np.full(self.num_envs, None, dtype=object)
        for place in np.flatnonzero(done):
            last[place] = final[place]
        self.sim.reset(done)
        self._done = np.zeros_like(done)
        info = self._info(self._done)
        ended = {"final_obs": last, "_final_obs": done, "final_info": final_info, "_final_info": done.copy()}
        return self._observe(), {**info, **ended}

    def _observe(self) -> Observations:
        return self.task.observe(self.sim.positions, self.sim.velocities)

    def _info(self, done: NDArray[np.bool_]) -> Info:
        everywhere = np.ones(self.num_envs, dtype=np.bool_)
        info: Info = {"clearance_m": self.sim.least_clearance_m.copy(), "_clearance_m": everywhere}
        if done.any():
            info["verdict"] = np.array(self.sim.statuses(done), dtype=object)
            info["_verdict"] = done.copy()
        return info


class FormationEnv(gymnasium.Env[Observations, NDArray[np.float32]]):
    """One world of :class:`FormationVectorEnv`, for programs that take a single environment. Actions are (N, D)."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        *,
        hz: float = 20.0,
        max_accel_m_s2: float = 5.0,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        self.sim = Worlds(scenario, 1, threads=1, set=set)
        self.task = FormationTask(self.sim.scenario, hz, max_accel_m_s2)
        self.observation_space, self.action_space = _spaces(self.task)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Starts an episode. ``seed`` determines it and, without further seeds, those after it. A seed without a valid
        start is an error where it is given, and is passed over without ``seed``."""
        super().reset(seed=seed)
        self.sim.start(int(self.np_random.integers(2**31)), is_given=seed is not None)
        return self._observe(), self._info(False)

    def step(self, action: NDArray[np.float32]) -> tuple[Observations, float, bool, bool, Info]:
        """Flies ``1 / hz`` seconds."""
        u = self.task.commands(action, (self.task.count, self.task.axes))
        self.sim.step(u[None], steps=self.task.steps)
        terminated, truncated = (bool(end[0]) for end in _ends(self.sim))
        reward = float(self.task.rewards(self.sim.positions, self.sim.least_clearance_m < 0).mean())
        return self._observe(), reward, terminated, truncated, self._info(terminated or truncated)

    def _observe(self) -> Observations:
        return np.asarray(self.task.observe(self.sim.positions, self.sim.velocities)[0])

    def _info(self, is_over: bool) -> Info:
        info: Info = {"clearance_m": float(self.sim.least_clearance_m[0])}
        return {**info, "verdict": self.sim.statuses()[0]} if is_over else info


def _spaces(task: FormationTask) -> tuple[Any, Any]:
    """Returns the spaces of observations and actions of one world."""
    observations = Box(-np.inf, np.inf, shape=(task.count, task.observed), dtype=np.float32)
    return observations, Box(-1.0, 1.0, shape=(task.count, task.axes), dtype=np.float32)


def _ends(sim: Worlds) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Returns whether each episode is terminated, and whether it is truncated."""
    terminated, over = sim.least_clearance_m < 0, sim.is_over
    if over.any():
        terminated |= np.array([ending not in (None, "completed") for ending in sim.endings])
    return terminated, over & ~terminated


if "tautline/Formation-v0" not in gymnasium.registry:
    gymnasium.register(
        "tautline/Formation-v0",
        entry_point="tautline.gymnasium:FormationEnv",
        vector_entry_point="tautline.gymnasium:FormationVectorEnv",
    )
