"""PettingZoo ``ParallelEnv`` on :class:`tautline.Simulation`: agents command accelerations to reach their slots.

Use: `env = FormationEnv("pentagon")`, `env.reset(seed=0)`, then `env.step(actions)` until `env.agents` is empty.

A violation, at or between steps, terminates the episode of all agents. The end of the flight truncates it.
"""

from __future__ import annotations

import functools
from typing import Any

import gymnasium
import numpy as np
import tautline as tl
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

#: Penalty of a violation.
VIOLATION = 100.0
#: Largest random offset of start positions along each axis of the plane [m].
JITTER_M = 0.1


class FormationEnv(ParallelEnv):
    """An agent observes its velocity and the vectors to its slot and to all others. It commands x and y [m/s^2]."""

    metadata = {"name": "tautline_formation_v0"}

    def __init__(
        self, scenario: str = "pentagon", hz: float = 20.0, max_accel_m_s2: float = 5.0, duration_s: float = 20.0
    ) -> None:
        self.name, self.hz, self.max_accel_m_s2, self.duration_s = scenario, hz, max_accel_m_s2, duration_s
        self.possible_agents = [f"vehicle_{number}" for number in range(1, len(tl.Scenario(scenario)) + 1)]
        self.agents: list[str] = []
        self.render_mode = None
        self.np_random, _ = gymnasium.utils.seeding.np_random(None)

    @functools.lru_cache(maxsize=None)
    def observation_space(self, agent: str) -> Box:
        return Box(-np.inf, np.inf, shape=(3 + 3 * len(self.possible_agents),), dtype=np.float64)

    @functools.lru_cache(maxsize=None)
    def action_space(self, agent: str) -> Box:
        return Box(-1.0, 1.0, shape=(2,), dtype=np.float32)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        if seed is not None:
            self.np_random, _ = gymnasium.utils.seeding.np_random(seed)
        start = {"start.jitter_m": JITTER_M, "start.seed": int(self.np_random.integers(2**31))}
        self.sim = tl.Simulation(self.name, set={**start, "time.duration_s": self.duration_s})
        self.steps = max(1, round(1 / (self.hz * self.sim.scenario.dt_s)))
        self.agents = list(self.possible_agents)
        return self._observe(), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        u = np.zeros((len(self.possible_agents), 3))
        for number, agent in enumerate(self.possible_agents):
            u[number, :2] = self.max_accel_m_s2 * np.clip(actions[agent], -1, 1)
        self.sim.step(u, steps=self.steps)
        clearance = self.sim.least_clearance_m
        violated = clearance is not None and clearance < 0
        errors_m = np.linalg.norm(self.sim.scenario.slots_m - self.sim.positions, axis=1)
        rewards = {agent: -float(errors_m[k]) - VIOLATION * violated for k, agent in enumerate(self.agents)}
        over = self.sim.is_over
        agents = list(self.agents)
        observations = self._observe()
        if violated or over:
            self.agents = []
        info = {"separation_m": self.sim.separation_m}
        return (
            observations,
            rewards,
            {agent: violated for agent in agents},
            {agent: over and not violated for agent in agents},
            {agent: dict(info) for agent in agents},
        )

    def _observe(self) -> dict[str, Any]:
        positions, velocities, slots = self.sim.positions, self.sim.velocities, self.sim.scenario.slots_m
        observations = {}
        for k, agent in enumerate(self.possible_agents):
            others = np.delete(positions - positions[k], k, axis=0)
            observations[agent] = np.concatenate([velocities[k], slots[k] - positions[k], others.ravel()])
        return observations
