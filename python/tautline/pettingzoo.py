"""PettingZoo environment: every vehicle of a world is an agent. It needs the packages pettingzoo and gymnasium."""

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
    from gymnasium.spaces import Box
    from gymnasium.utils import seeding
    from pettingzoo import ParallelEnv
except ModuleNotFoundError as missing:
    package = str(missing.name).partition(".")[0]
    raise ModuleNotFoundError(
        f"tautline.pettingzoo: the package {package} is missing; pip install pettingzoo 'gymnasium>=1.1'",
        name=package,
    ) from None

__all__ = ["VIOLATION", "FormationEnv"]

Arrays = dict[str, NDArray[np.float32]]


class FormationEnv(ParallelEnv):  # type: ignore[misc]
    """A world of a scenario in which each vehicle flies to its slot.

    An agent observes its velocity [m/s] and the vectors to its slot and to all others [m], D (N + 1) numbers. D is 2 in
    the plane z = 0, else 3. Its action (D,), from -1 to 1 along each axis, is a share of ``max_accel_m_s2``, held for
    ``1 / hz`` seconds. Its reward is its distance to the slot [m], negative, less ``VIOLATION`` for a violation.

    A violation, at or between steps, and a failed motion terminate the episode of all agents. The end of the scenario
    truncates it. The info has ``clearance_m``, the smallest clearance so far [m], and at the end the ``verdict``.
    """

    metadata: dict[str, Any] = {"name": "tautline_formation_v1", "render_modes": []}
    render_mode = None

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
        self.possible_agents = [f"vehicle_{number}" for number in range(1, self.task.count + 1)]
        self.agents: list[str] = []
        self.np_random, _ = seeding.np_random(None)
        space = Box(-np.inf, np.inf, shape=(self.task.observed,), dtype=np.float32)
        self.observation_spaces = {agent: space for agent in self.possible_agents}
        # Samples of each agent come from a generator of its own.
        self.action_spaces = {agent: Box(-1.0, 1.0, (self.task.axes,), np.float32) for agent in self.possible_agents}

    def observation_space(self, agent: str) -> Box:
        """Returns the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Returns the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, dict[str, Any]]]:
        """Starts an episode. ``seed`` determines it and, without further seeds, those after it. A seed without a valid
        start is an error where it is given, and is passed over without ``seed``."""
        if seed is not None:
            self.np_random, _ = seeding.np_random(seed)
        self.sim.start(int(self.np_random.integers(2**31)), is_given=seed is not None)
        self.agents = list(self.possible_agents)
        return self._observe(), self._infos(False)

    def step(
        self, actions: Mapping[str, NDArray[np.float32]]
    ) -> tuple[Arrays, dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Flies ``1 / hz`` seconds with an action of every agent."""
        if not self.agents:
            raise Error("step: no episode is in progress; call reset first")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise Error(f"actions: that of {missing[0]} is missing; give one for each of {len(self.agents)} agents")
        given = [np.asarray(actions[agent]) for agent in self.possible_agents]
        if wrong := [a for a, x in zip(self.possible_agents, given, strict=True) if x.shape != (self.task.axes,)]:
            raise Error(f"actions: that of {wrong[0]} must have the shape ({self.task.axes},)")
        u = self.task.commands(given, (self.task.count, self.task.axes))
        self.sim.step(u[None], steps=self.task.steps)
        violated = self.sim.least_clearance_m < 0
        ending = self.sim.endings[0]
        is_terminated = bool(violated[0]) or ending not in (None, "completed")
        is_truncated = ending == "completed" and not is_terminated
        rewards = self.task.rewards(self.sim.positions, violated)[0]
        result = (
            self._observe(),
            {agent: float(reward) for agent, reward in zip(self.possible_agents, rewards, strict=True)},
            dict.fromkeys(self.possible_agents, is_terminated),
            dict.fromkeys(self.possible_agents, is_truncated),
            self._infos(is_terminated or is_truncated),
        )
        if is_terminated or is_truncated:
            self.agents = []
        return result

    def _observe(self) -> Arrays:
        observations = self.task.observe(self.sim.positions, self.sim.velocities)[0]
        return dict(zip(self.possible_agents, observations, strict=True))

    def _infos(self, is_over: bool) -> dict[str, dict[str, Any]]:
        info: dict[str, Any] = {"clearance_m": float(self.sim.least_clearance_m[0])}
        if is_over:
            info["verdict"] = self.sim.statuses()[0]
        return {agent: dict(info) for agent in self.possible_agents}
