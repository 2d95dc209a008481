"""Observations and rewards of the learning environments, which a program can replace.

Both are called with the worlds of an environment::

    class Speed(Reward):
        def __call__(self, worlds):
            return super().__call__(worlds) - 0.1 * np.linalg.norm(worlds.velocities, axis=-1)

    env = FormationVectorEnv("swap", 16, reward=Speed())
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import PathLike, boolean, mapping, number
from ._arguments import count as whole_number
from ._native import Error
from ._scenario import Scenario, to_scenario
from ._vector import VectorSimulation

__all__ = ["VIOLATION", "Observation", "Observes", "Reward", "Rewards", "Worlds", "episode_seed"]

#: Penalty of a violation, in the unit of the reward [m].
VIOLATION = 100.0


class Worlds(VectorSimulation):
    """Worlds of an environment: a :class:`~tautline.VectorSimulation` whose law is the policy of the caller.

    World e flies its episode k with the seed ``episode_seed(seed, e, k)``, or with the next seed that has a valid
    start.
    """

    _is_environment = True

    def __init__(
        self,
        scenario: Scenario | PathLike,
        num_envs: int,
        *,
        threads: int | None = None,
        shield: bool | None = None,
        keep_history: bool = False,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        sets = dict(mapping(set, "set"))
        if shield is not None:
            sets["shield.enabled"] = boolean(shield, "shield")
        wanted = to_scenario(scenario, sets)
        if (part := wanted._native.part_ignored_by_environments) is not None:
            key, what = part
            remedy = "give a scenario whose reference all vehicles know"
            raise Error(f"scenario: an environment does not support {key} of {wanted.name} ({what}); {remedy}")
        super().__init__(wanted, num_envs, threads=threads, keep_history=keep_history)
        #: Steps of the scenario for one action.
        self.steps_of_action = 1
        #: Axes of actions and observations: 2 in the plane z = 0, else 3.
        self.axes = 2 if wanted._native.is_plane else 3
        #: Seed of each world and its number among the worlds of this seed; None before the first episode.
        self._bases: list[tuple[int, int]] | None = None
        self._episodes = np.zeros(self.num_envs, dtype=np.int64)

    @property
    def violated(self) -> NDArray[np.bool_]:
        """(E,) whether each world has a violation so far."""
        return self.least_clearance_m < 0

    @property
    def actions_left(self) -> NDArray[np.int64]:
        """(E,) number of actions up to the end of the scenario."""
        left = self.scenario.steps - self.steps.astype(np.int64)
        return np.asarray(-(-left // self.steps_of_action))

    def begin(
        self,
        mask: NDArray[np.bool_],
        options: Mapping[str, Any] | None = None,
        seed: int | Sequence[int | None] | None = None,
    ) -> None:
        """Begins the next episode of the worlds with ``mask`` (E,).

        With a seed, these worlds begin the episodes of ``(seed, e)`` anew, with a list those of ``(seed[e], 0)``. Other
        worlds keep their seeds, and all do if the reset is refused.
        """
        chosen = self._mask(mask)
        first = secrets.randbits(63)
        bases = self._bases or [(first, e) for e in range(self.num_envs)]
        given: list[tuple[int, int] | None] = [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            base = whole_number(seed, "seed")
            given = [(base, e) for e in range(self.num_envs)]
        elif seed is not None:
            given = [None if base is None else (base, 0) for base in self._seeds_or_none(seed, chosen)]
        new = np.array([base is not None for base in given]) & chosen
        bases = [given[e] or bases[e] if new[e] else bases[e] for e in range(self.num_envs)]
        episodes = np.where(new, 0, self._episodes)
        of_worlds = zip(bases, episodes.tolist(), chosen.tolist(), strict=True)
        seeds = [episode_seed(base, world, k) if is_chosen else None for (base, world), k, is_chosen in of_worlds]
        self.reset(chosen, seeds, **starts_of(options))
        self._bases, self._episodes = bases, episodes + chosen

    def ends(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Returns whether each episode is terminated, and whether it is truncated."""
        terminated, over = self.violated, self.is_over
        if over.any():
            terminated |= np.array([ending not in (None, "completed") for ending in self.endings])
        return terminated, over & ~terminated

    def info(self, done: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
        """Returns the numbers of each world, and the verdicts of the episodes that are over."""
        info: dict[str, NDArray[Any]] = {"clearance_m": self.least_clearance_m.copy()}
        if done.any():
            info["verdict"] = np.array(self.statuses(done), dtype=object)
            counts = self._native.shield_counts()
            if any(commands for commands, _ in counts):
                info["shielded"] = np.array([changed / max(commands, 1) for commands, changed in counts])
        return info


def episode_seed(seed: int, world: int, episode: int) -> int:
    """Returns the seed of an episode of a world: a hash, so that other seeds have other starts."""
    text = f"{seed} {world} {episode}".encode()
    return int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "little") >> 1


def starts_of(options: Mapping[str, Any] | None) -> dict[str, ArrayLike]:
    """Returns the starts among the options of a reset. Ignores other options, which Gymnasium allows for wrappers."""
    names = {"positions_m": "positions", "velocities_m_s": "velocities"}
    given = {key: value for key, value in (options or {}).items() if value is not None}
    if misspelt := [key for key in given if key not in names and str(key).startswith(("position", "velocit"))]:
        raise Error(f"options: unknown option {misspelt[0]}; give {' and '.join(names)}")
    return {names[key]: value for key, value in given.items() if key in names}


class Observes(Protocol):
    """What vehicles observe."""

    def size(self, worlds: Worlds) -> int:
        """Returns the number D of numbers that a vehicle observes."""

    def __call__(self, worlds: Worlds) -> NDArray[np.float32]:
        """Returns the present observations (E, N, D)."""


class Rewards(Protocol):
    """What vehicles are rewarded for."""

    def __call__(self, worlds: Worlds) -> NDArray[np.float64]:
        """Returns the rewards (E, N) of the last action."""


class Observation:
    """The velocity [m/s] of a vehicle and the vectors to its slot, to all other vehicles, and to the nearest point of
    each obstacle [m].

    By default a vehicle observes what it knows: its own measured state, and the last positions that it received from
    the others. A vector to a vehicle from which nothing can be received is 0. With ``true_states`` the states are the
    true ones. The vectors to obstacles start at the true position.
    """

    def __init__(self, *, true_states: bool = False) -> None:
        self.true_states = boolean(true_states, "true_states")

    def size(self, worlds: Worlds) -> int:
        """Returns the number of numbers that a vehicle observes."""
        return worlds.axes * (len(worlds.scenario) + 1 + worlds.scenario._native.obstacles)

    def __call__(self, worlds: Worlds) -> NDArray[np.float32]:
        """Returns the present observations (E, N, D)."""
        axes, count = worlds.axes, len(worlds.scenario)
        are_true = self.true_states or worlds.scenario._native.is_exact
        p, v = (worlds.positions, worlds.velocities) if are_true else worlds.measured()
        to_others = (p[:, None] if are_true else worlds.received()) - p[:, :, None]
        pairs = ~np.eye(count, dtype=np.bool_)
        others = np.nan_to_num(to_others[..., :axes])[:, pairs].reshape(*p.shape[:2], -1)
        parts = [v[..., :axes], (worlds.slots_m - p)[..., :axes], others]
        if worlds.scenario._native.obstacles:
            parts.append(worlds.to_obstacles()[..., :axes].reshape(*p.shape[:2], -1))
        return np.concatenate(parts, axis=-1, dtype=np.float32)


class Reward:
    """The distance of a vehicle to its present slot [m], negative.

    An episode that is terminated, as by a violation, costs ``violation`` more, and the distance once more for each
    action that is left. Without this, a violation could be worth more than a flight to the end.
    """

    def __init__(self, *, violation: float = VIOLATION) -> None:
        self.violation = number(violation, "violation")

    def __call__(self, worlds: Worlds) -> NDArray[np.float64]:
        """Returns the rewards (E, N)."""
        errors_m = np.linalg.norm(worlds.slots_m - worlds.positions, axis=-1)
        terminated, _ = worlds.ends()
        return np.asarray(-errors_m - terminated[:, None] * (self.violation + errors_m * worlds.actions_left[:, None]))


class Actions:
    """Actions of an environment: shares of a largest acceleration along each axis, held for ``1 / hz`` seconds."""

    def __init__(self, worlds: Worlds, hz: float, max_accel_m_s2: float) -> None:
        self.hz, self.max_accel_m_s2 = number(hz, "hz"), number(max_accel_m_s2, "max_accel_m_s2")
        for name, value in (("hz", self.hz), ("max_accel_m_s2", self.max_accel_m_s2)):
            if not 0 < value < np.inf:
                raise Error(f"{name}: must be a finite number above 0, got {value}")
        #: Steps of the scenario for one action.
        self.steps = worlds.steps_of_action = steps_of_action(self.hz, worlds.scenario)

    def commands(self, actions: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Returns accelerations [m/s^2] of actions, which must have this shape."""
        given = np.asarray(actions, dtype=np.float64)
        if given.shape != shape:
            raise Error(f"actions: an array of shape {shape} is needed, not of shape {given.shape}")
        return np.asarray(self.max_accel_m_s2 * np.clip(given, -1.0, 1.0))


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


def observations_of(observe: Observes | None, worlds: Worlds) -> tuple[Observes, int]:
    """Returns what vehicles observe, and its size."""
    chosen: Observes = Observation() if observe is None else observe
    return chosen, whole_number(chosen.size(worlds), "observe.size")


def first_of(info: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Returns the numbers of the first world."""
    firsts = {name: values[0] for name, values in info.items()}
    return {name: first.item() if isinstance(first, np.generic) else first for name, first in firsts.items()}


def checked(values: object, shape: tuple[int, ...], name: str, dtype: type[Any]) -> NDArray[Any]:
    """Returns the result of an observation or reward, which must have this shape."""
    found = np.asarray(values, dtype=dtype)
    if found.shape != shape:
        raise Error(f"{name}: must return an array of shape {shape}, not of shape {found.shape}")
    return found
