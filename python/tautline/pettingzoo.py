"""PettingZoo environment: every vehicle of a world is an agent. It needs the packages pettingzoo and gymnasium."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import PathLike
from ._native import Error
from ._picture import RENDER_MODES, Rendered, checked_mode
from ._scenario import Scenario
from .learning import VIOLATION, Actions, Observes, Reward, Rewards, Worlds, checked, first_of, observations_of

try:
    from gymnasium.spaces import Box
    from pettingzoo import ParallelEnv
except ModuleNotFoundError as missing:
    package = str(missing.name).partition(".")[0]
    raise ModuleNotFoundError(
        f"tautline.pettingzoo: the package {package} is missing; pip install pettingzoo 'gymnasium>=1.1'",
        name=package,
    ) from None

__all__ = ["VIOLATION", "FormationEnv"]

Arrays = dict[str, NDArray[np.float32]]


class FormationEnv(Rendered, ParallelEnv):  # type: ignore[misc]
    """A world of a scenario in which each vehicle flies to its slot.

    The action of an agent (D,), from -1 to 1 along each axis, is a share of ``max_accel_m_s2``, held for ``1 / hz``
    seconds. It passes through the shield and the actuators of the scenario; ``shield`` adds or removes its shield. D is
    2 in the plane z = 0, else 3. Observations are by default :class:`tautline.learning.Observation`, rewards
    :class:`tautline.learning.Reward`; ``observe`` and ``reward`` replace them. :meth:`state` is for central critics.

    A violation, at or between steps, and a failed motion terminate the episode of all agents. The end of the scenario
    truncates it. The info has ``clearance_m``, the smallest clearance so far [m]. At the end it has the ``verdict``
    and, with a shield, ``shielded``, the share of commands that the shield changed.
    """

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        *,
        hz: float = 20.0,
        max_accel_m_s2: float = 5.0,
        observe: Observes | None = None,
        reward: Rewards | None = None,
        shield: bool | None = None,
        keep_history: bool = False,
        set: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.sim = Worlds(scenario, 1, threads=1, shield=shield, keep_history=keep_history, set=set)
        self._actions = Actions(self.sim, hz, max_accel_m_s2)
        self.observe, observed = observations_of(observe, self.sim)
        self.reward: Rewards = Reward() if reward is None else reward
        self.metadata: dict[str, Any] = {
            "name": "tautline_formation_v2",
            "render_modes": RENDER_MODES,
            "render_fps": max(1, round(self._actions.hz)),
        }
        self.render_mode = checked_mode(render_mode)
        self._shape = (len(self.sim.scenario), self.sim.axes)
        self.possible_agents = [f"vehicle_{number}" for number in range(1, self._shape[0] + 1)]
        self.agents: list[str] = []
        space = Box(-np.inf, np.inf, shape=(observed,), dtype=np.float32)
        self.observation_spaces = {agent: space for agent in self.possible_agents}
        # Samples of each agent come from a generator of its own.
        self.action_spaces = {agent: Box(-1.0, 1.0, self._shape[1:], np.float32) for agent in self.possible_agents}
        #: Space of :meth:`state`.
        self.state_space = Box(-np.inf, np.inf, shape=(self._shape[0], 3 * self._shape[1]), dtype=np.float32)
        self._observed = observed

    def observation_space(self, agent: str) -> Box:
        """Returns the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Returns the space of an agent's actions."""
        return self.action_spaces[agent]

    def state(self) -> NDArray[np.float32]:
        """Returns the true positions [m], velocities [m/s] and present slots [m] of all vehicles (N, 3 D)."""
        sim = self.sim
        parts = [rows[0, :, : sim.axes] for rows in (sim.positions, sim.velocities, sim.slots_m)]
        return np.concatenate(parts, axis=-1, dtype=np.float32)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, dict[str, Any]]]:
        """Begins the episodes of ``seed`` anew or, without a seed, the next episode; the first seed is random.

        ``options["positions_m"]`` and ``options["velocities_m_s"]`` are a start (N, 3).
        """
        self.sim.begin(np.ones(1, dtype=np.bool_), options, None if seed is None else [seed])
        self.agents = list(self.possible_agents)
        self._show()
        return self._observe(), self._infos(False)

    def step(
        self, actions: Mapping[str, NDArray[np.float32]]
    ) -> tuple[Arrays, dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Flies ``1 / hz`` seconds with an action of every agent."""
        if not self.agents:
            raise Error("step: no episode is in progress; call reset first")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise Error(f"actions: that of {missing[0]} is missing; give one for each of {len(self.agents)} agents")
        given, each = [np.asarray(actions[agent]) for agent in self.possible_agents], self._shape[1:]
        if wrong := [a for a, x in zip(self.possible_agents, given, strict=True) if x.shape != each]:
            raise Error(f"actions: that of {wrong[0]} must have the shape {each}")
        self.sim.step(self._actions.commands(given, self._shape)[None], steps=self._actions.steps)
        is_terminated, is_truncated = (bool(end[0]) for end in self.sim.ends())
        rewards = checked(self.reward(self.sim), (1, self._shape[0]), "reward", np.float64)[0]
        self._show()
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
        shape = (1, self._shape[0], self._observed)
        observations = checked(self.observe(self.sim), shape, "observe", np.float32)[0]
        return dict(zip(self.possible_agents, observations, strict=True))

    def _infos(self, is_over: bool) -> dict[str, dict[str, Any]]:
        info = first_of(self.sim.info(np.array([is_over])))
        return {agent: dict(info) for agent in self.possible_agents}
