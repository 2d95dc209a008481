"""Gymnasium environments: all vehicles of a world are one agent.

``import tautline.gymnasium`` registers ``tautline/Formation-v0``. It needs the package gymnasium, 1.1 or later.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import PathLike
from ._native import Error
from ._picture import RENDER_MODES, Picture, Rendered, checked_mode
from ._scenario import Scenario
from .learning import VIOLATION, Actions, Observes, Reward, Rewards, Worlds, checked, first_of, observations_of

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
    They pass through the shield and the actuators of the scenario; ``shield`` adds or removes its shield. D is 2 in the
    plane z = 0, else 3.

    Observations are (E, N, ...), by default :class:`tautline.learning.Observation`; the reward of a world is the mean
    over its vehicles, by default of :class:`tautline.learning.Reward`. ``observe`` and ``reward`` replace them.

    A violation, at or between steps, and a failed motion terminate an episode. The end of the scenario truncates it.
    ``info["clearance_m"]`` has the smallest clearance of each episode so far [m]. For each episode that is over,
    ``info["verdict"]`` has the verdict and, with a shield, ``info["shielded"]`` the share of commands that it changed.
    All modes of autoreset are supported.

    ``render_mode`` is ``rgb_array`` or ``human``, which shows the first world in a window; both need matplotlib.
    """

    sim: Worlds

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        num_envs: int = 1,
        *,
        hz: float = 20.0,
        max_accel_m_s2: float = 5.0,
        observe: Observes | None = None,
        reward: Rewards | None = None,
        shield: bool | None = None,
        keep_history: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        set: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.sim = Worlds(scenario, num_envs, threads=threads, shield=shield, keep_history=keep_history, set=set)
        self.actions = Actions(self.sim, hz, max_accel_m_s2)
        self.observe, observed = observations_of(observe, self.sim)
        self.reward: Rewards = Reward() if reward is None else reward
        self.num_envs = self.sim.num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            "render_modes": RENDER_MODES,
            "render_fps": max(1, round(self.actions.hz)),
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = checked_mode(render_mode)
        count, axes = len(self.sim.scenario), self.sim.axes
        self._shape = (self.num_envs, count, axes)
        self.single_observation_space = Box(-np.inf, np.inf, shape=(count, observed), dtype=np.float32)
        self.single_action_space = Box(-1.0, 1.0, shape=(count, axes), dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._done = np.zeros(self.num_envs, dtype=np.bool_)
        self._is_begun = False
        self._pictures: list[Picture] = []

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Resets all episodes, or those with ``options["reset_mask"]`` (E,).

        With ``seed``, world e begins the episodes of ``(seed, e)`` anew, with ``seed[e]`` those of ``(seed[e], 0)``.
        Without a seed, or with None in the list, a world begins its next episode; the first seed is random. Worlds
        outside of the mask keep their seeds.
        ``options["positions_m"]`` and ``options["velocities_m_s"]`` are starts (E, N, 3), or of one world.
        """
        mask = np.ones(self.num_envs, dtype=np.bool_)
        if options is not None and options.get("reset_mask") is not None:
            # The mask may be an array of the worlds, which the reset changes.
            mask = np.array(options["reset_mask"])
        self.sim.begin(mask, options, seed)
        if isinstance(seed, (int, np.integer)):
            super().reset(seed=int(seed))
        self._is_begun = True
        self._done[mask] = False
        self._show()
        return self._observe(), self._info(np.zeros_like(self._done))

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Info]:
        """Flies ``1 / hz`` seconds in every world. In the mode ``NEXT_STEP``, worlds whose episode was over are reset
        instead."""
        u = self.actions.commands(actions, self._shape)
        if not self._is_begun:
            raise Error("step: the environment has no episode; call reset first")
        before = self._done.copy()
        if before.any():
            if self.autoreset_mode == AutoresetMode.DISABLED:
                places = np.flatnonzero(before).tolist()
                raise Error(f"step: the episodes of the worlds {places} are over; reset them with reset_mask")
            u[before] = 0.0
        self.sim.step(u, steps=self.actions.steps)
        if before.any():
            self.sim.begin(before)
        terminated, truncated = self.sim.ends()
        rewards = checked(self.reward(self.sim), self._shape[:2], "reward", np.float64).mean(axis=1)
        rewards[before] = 0.0
        self._done = terminated | truncated
        observations, info = self._observe(), self._info(self._done)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._done.any():
            observations, info = self._restart(observations, info)
        self._show()
        return observations, rewards, terminated, truncated, info

    def _restart(self, final: Observations, final_info: Info) -> tuple[Observations, Info]:
        """Resets the episodes that are over. The info gets their last observations and info."""
        done = self._done
        last = np.full(self.num_envs, None, dtype=object)
        for place in np.flatnonzero(done):
            last[place] = final[place]
        self.sim.begin(done)
        self._done = np.zeros_like(done)
        info = self._info(self._done)
        ended = {"final_obs": last, "_final_obs": done, "final_info": final_info, "_final_info": done.copy()}
        return self._observe(), {**info, **ended}

    def _observe(self) -> Observations:
        return checked(self.observe(self.sim), self.observation_space.shape or (), "observe", np.float32)

    def _info(self, done: NDArray[np.bool_]) -> Info:
        found = self.sim.info(done)
        masks = {f"_{name}": np.ones_like(done) if name == "clearance_m" else done.copy() for name in found}
        return {**found, **masks}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Returns a picture (height, width, 3) of each world, or shows the first world in a window."""
        if self.render_mode is None:
            return None
        if not self._pictures:
            shown = self.render_mode == "human"
            self._pictures = [Picture(shown) for _ in range(1 if shown else self.num_envs)]
        drawn = [picture.draw(self.sim, world) for world, picture in enumerate(self._pictures)]
        return None if self.render_mode == "human" else tuple(picture for picture in drawn if picture is not None)

    def _show(self) -> None:
        """Shows the present state, if there is a window."""
        if self.render_mode == "human":
            self.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Closes the window."""
        for picture in self._pictures:
            picture.close()
        self._pictures = []


class FormationEnv(Rendered, gymnasium.Env[Observations, NDArray[np.float32]]):
    """One world of :class:`FormationVectorEnv`, for programs that take a single environment. Actions are (N, D)."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 20}

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
        self.actions = Actions(self.sim, hz, max_accel_m_s2)
        self.observe, observed = observations_of(observe, self.sim)
        self.reward: Rewards = Reward() if reward is None else reward
        self.metadata = {**self.metadata, "render_fps": max(1, round(self.actions.hz))}
        self.render_mode = checked_mode(render_mode)
        self._shape = (len(self.sim.scenario), self.sim.axes)
        self.observation_space = Box(-np.inf, np.inf, shape=(self._shape[0], observed), dtype=np.float32)
        self.action_space = Box(-1.0, 1.0, shape=self._shape, dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Begins the episodes of ``seed`` anew or, without a seed, the next episode; the first seed is random.

        ``options["positions_m"]`` and ``options["velocities_m_s"]`` are a start (N, 3).
        """
        self.sim.begin(np.ones(1, dtype=np.bool_), options, None if seed is None else [seed])
        super().reset(seed=seed)
        self._show()
        return self._observe(), self._info(False)

    def step(self, action: NDArray[np.float32]) -> tuple[Observations, float, bool, bool, Info]:
        """Flies ``1 / hz`` seconds."""
        u = self.actions.commands(action, self._shape)
        self.sim.step(u[None], steps=self.actions.steps)
        terminated, truncated = (bool(end[0]) for end in self.sim.ends())
        reward = float(checked(self.reward(self.sim), (1, self._shape[0]), "reward", np.float64).mean())
        self._show()
        return self._observe(), reward, terminated, truncated, self._info(terminated or truncated)

    def _observe(self) -> Observations:
        shape = (1, *(self.observation_space.shape or ()))
        return np.asarray(checked(self.observe(self.sim), shape, "observe", np.float32)[0])

    def _info(self, is_over: bool) -> Info:
        return first_of(self.sim.info(np.array([is_over])))


if "tautline/Formation-v0" not in gymnasium.registry:
    gymnasium.register(
        "tautline/Formation-v0",
        entry_point="tautline.gymnasium:FormationEnv",
        vector_entry_point="tautline.gymnasium:FormationVectorEnv",
        # Without other starts, a policy learns one flight.
        kwargs={"set": {"start.jitter_m": 0.1}},
    )
