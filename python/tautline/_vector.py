"""Many worlds of a scenario that the caller steps together, for learning and for statistics."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arguments import PathLike, boolean, exact_array
from ._arguments import count as whole_number
from ._native import Error
from ._scenario import Scenario, restore, to_scenario
from ._simulation import Simulation
from ._worlds_history import STOPPED, History, Saved


class VectorSimulation:
    """Worlds of one scenario that advance together, on all cores and without the interpreter's lock.

    Example::

        sim = tl.VectorSimulation("pentagon", 1000, set={"start.jitter_m": 0.1})
        for _ in range(400):
            sim.step(policy(sim.positions, sim.velocities), steps=12)    # (E, N, 3) accelerations [m/s^2].

    World e flies the scenario with ``seeds[e]`` (by default e) as ``start.seed`` and, where the flight is random, as
    ``noise.seed``. It has the bits of a single :class:`Simulation` with the same commands, for any number of
    ``threads`` (by default one for each core). Every step is audited.

    A world ends at the scenario's duration, or where its motion or law cannot go on. It stops no other world: it keeps
    its last state, ``is_over`` is True and ``endings`` has the reason. A violation ends no world: ``least_clearance_m``
    is below 0. With ``autoreset=True``, a step first resets the worlds that have ended, to the next seed of each. They
    do not fly in that call. The next seed of a world is its seed plus ``num_envs``; seeds without a valid start are
    passed over, at most 1000 of them.

    ``keep_history=True`` keeps the accelerations, so that worlds in flight can be saved and pickled.

    Raises :class:`Error` for a wrong scenario or a seed without a valid start.
    """

    #: Whether the worlds fly a policy, and a new world passes over seeds without a valid start.
    _is_environment: ClassVar[bool] = False

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        num_envs: int = 1,
        *,
        seeds: Sequence[int] | NDArray[np.integer[Any]] | None = None,
        threads: int | None = None,
        autoreset: bool = False,
        keep_history: bool = False,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        self.scenario = to_scenario(scenario, set)
        #: Number of worlds E.
        self.num_envs = whole_number(num_envs, "num_envs")
        if self.num_envs < 1:
            raise Error(f"num_envs: must be at least 1, got {num_envs}")
        most = _native.VectorSimulation.most_worlds(self.scenario._native)
        if self.num_envs > most:
            raise Error(f"num_envs: must be at most {most} worlds of {len(self.scenario)} vehicles, got {num_envs}")
        workers = 0 if threads is None else whole_number(threads, "threads")
        if threads is not None and not 1 <= workers <= 1024:
            raise Error(f"threads: must be from 1 to 1024, got {threads}; None uses one for each core")
        numbered = list(range(self.num_envs)) if seeds is None else self._seeds(seeds)
        self._native = _native.VectorSimulation(
            self.scenario._native, numbered, workers, boolean(autoreset, "autoreset"), self._is_environment
        )
        self._autoreset = bool(autoreset)
        self._threads = None if threads is None else workers
        self._history = History(boolean(keep_history, "keep_history"), self.seeds.tolist())

    def step(
        self,
        u: ArrayLike | None = None,
        steps: int = 1,
        out: NDArray[np.floating[Any]] | None = None,
    ) -> None:
        """Flies steps of ``scenario.dt_s`` in every world, fewer where a world ends.

        ``u`` (E, N, 3) or (E, N, 2) are accelerations [m/s^2] that replace those of the law and are held over all of
        these steps. They pass through the shield and the actuators of the scenario. Arrays of float32 and float64 are
        fastest. No step is divided for the law then. Those of ended worlds are ignored. Without ``u`` the law of the
        scenario flies. ``out`` (E, N, 6) of float32 or float64 receives positions and velocities.

        Raises :class:`Error` for a wrong shape, or with the place of a number that is not finite; ``TypeError`` for
        numbers that are no float64. No world moves then. Where ``autoreset`` finds no valid start for a world, the
        others fly, and :class:`Error` names the world.
        """
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)):
            raise TypeError(f"steps: a whole number is needed, not {type(steps).__name__}")
        if steps < 1:
            raise Error(f"steps: must be at least 1, got {steps}")
        if out is not None:
            self._check_out(out)
        commands: NDArray[np.floating[Any]] | None = None
        if isinstance(u, np.ndarray) and u.dtype in (np.float32, np.float64):
            commands = u
        elif u is not None:
            commands = exact_array(u, "u")
        if commands is not None and self._history.keeps_steps:
            # The accelerations may be an array of this simulation, which the step changes.
            commands = commands.copy()
        try:
            self._native.step(commands, min(int(steps), 2**63))
        except BaseException as problem:
            # Wrong input moves no world. Otherwise some may have moved.
            if self.autoreset or not isinstance(problem, (Error, TypeError)):
                self._history.lose(STOPPED)
            raise
        self._history.add_step(commands, int(steps))
        if out is not None:
            out[..., :3], out[..., 3:] = self.positions, self.velocities

    def reset(
        self,
        mask: NDArray[np.bool_] | Sequence[bool] | None = None,
        seeds: Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        *,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
    ) -> None:
        """Resets the worlds with ``mask`` (E,), by default all, to their starts.

        ``seeds`` (E,) are the new seeds; those outside of the mask are ignored. Without seeds, or with None in their
        list, a world takes its next seed.

        ``positions`` [m] and ``velocities`` [m/s], (E, N, 3), (E, N, 2) or those of one world, replace the starts; the
        vehicles are at rest without ``velocities``. Slots and random numbers are still those of the seed.

        Raises :class:`Error` for a wrong shape or no valid start. No world is reset then.
        """
        chosen = self._mask(mask)
        given = None if seeds is None else self._seeds_or_none(seeds, chosen)
        if positions is None and velocities is not None:
            raise Error("velocities: need positions beside them")
        starts = None
        if positions is not None:
            p = self._rows(positions, "positions")
            starts = p, np.zeros_like(p) if velocities is None else self._rows(velocities, "velocities")
        self._native.reset(chosen, given, starts, self._is_environment)
        self._history.add_reset(chosen, self.seeds.tolist(), starts)

    def _rows(self, given: ArrayLike, name: str) -> NDArray[np.float64]:
        """Returns a vector of three numbers for each vehicle of each world, with z = 0 where two are given."""
        rows, vehicles = exact_array(given, name), len(self.scenario)
        if rows.shape[-2:] not in ((vehicles, 2), (vehicles, 3)) or rows.shape[:-2] not in ((), (self.num_envs,)):
            wanted = f"({self.num_envs}, {vehicles}, 3)"
            raise Error(f"{name}: an array of shape {wanted} is needed, not of shape {rows.shape}")
        rows = np.concatenate([rows, np.zeros((*rows.shape[:-1], 3 - rows.shape[-1]))], axis=-1)
        return np.ascontiguousarray(np.broadcast_to(rows, (self.num_envs, vehicles, 3)))

    @property
    def autoreset(self) -> bool:
        """Whether a step resets the worlds that have ended."""
        return self._autoreset

    @property
    def positions(self) -> NDArray[np.float64]:
        """(E, N, 3) true positions [m]. This is one array, which every call updates without a copy. Writing to it
        changes no world."""
        return self._native.positions

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(E, N, 3) true velocities [m/s], one array like ``positions``."""
        return self._native.velocities

    @property
    def least_clearance_m(self) -> NDArray[np.float64]:
        """(E,) smallest clearance of each world so far [m], one array like ``positions``: separation less delta, or
        distance to an obstacle less its clearance. It is below 0 exactly where there is a violation, and NaN for one
        vehicle without obstacles."""
        return self._native.least_clearance_m

    @property
    def slots_m(self) -> NDArray[np.float64]:
        """(E, N, 3) present slots [m], a copy: those of the leg, moved by the reference."""
        return self._native.slots()

    def measured(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the positions [m] and velocities [m/s] (E, N, 3) that the vehicles measure of themselves."""
        positions, velocities = self._native.measured()
        return positions, velocities

    def received(self) -> NDArray[np.float64]:
        """Returns positions [m] (E, N, N, 3): ``[e, i, j]`` is the position of vehicle j as vehicle i knows it from
        messages, held or extrapolated as ``network`` says, and its own measured one for i = j. It is NaN without a
        link."""
        return self._native.received()

    def to_obstacles(self) -> NDArray[np.float64]:
        """Returns the vectors (E, N, K, 3) from each vehicle to the nearest point of each of K obstacles [m]."""
        return self._native.obstacles(self.scenario._native.obstacles)

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """(E,) whether each world has ended, one array like ``positions``."""
        return self._native.is_over

    @property
    def endings(self) -> list[str | None]:
        """``completed`` or the reason of an early end of each world; None before its end."""
        return self._native.endings

    @property
    def seeds(self) -> NDArray[np.uint64]:
        """(E,) present seeds, a copy."""
        return self._native.seeds

    @property
    def t(self) -> NDArray[np.float64]:
        """(E,) times flown [s], a copy."""
        return self._native.t

    @property
    def steps(self) -> NDArray[np.uint64]:
        """(E,) whole steps flown, a copy."""
        return self._native.steps

    def statuses(self, mask: NDArray[np.bool_] | Sequence[bool] | None = None) -> list[str | None]:
        """Returns the verdict of each world with ``mask`` (E,), by default of all, and None for the others.

        It is ``clear``, ``violation`` or ``undecided`` so far, and after the end that of the whole flight, which is
        never ``clear`` where it ended early.
        """
        return self._native.statuses(self._mask(mask))

    def world(self, index: int) -> Simulation:
        """Returns an independent copy of a world, which has its violations and its closest approach.

        ``scenario`` of the copy is that of all worlds: it has the start of its own seed only.
        """
        return Simulation._of(self.scenario, None, self._native.world(whole_number(index, "world")))

    def _mask(self, mask: NDArray[np.bool_] | Sequence[bool] | None) -> NDArray[np.bool_]:
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        chosen = np.asarray(mask)
        if chosen.dtype != np.bool_:
            raise TypeError(f"mask: an array of bool is needed, not of {chosen.dtype}")
        if chosen.shape != (self.num_envs,):
            raise Error(f"mask: an array of shape ({self.num_envs},) is needed, not of shape {chosen.shape}")
        # The mask may be an array of this simulation, which a reset changes.
        return np.array(chosen)

    def _seeds(self, seeds: Sequence[int] | NDArray[np.integer[Any]]) -> list[int]:
        """Returns a seed for each world."""
        found = self._seeds_or_none(seeds, np.ones(self.num_envs, dtype=np.bool_))
        if None in found:
            raise TypeError(f"seeds[{found.index(None)}]: a whole number is needed, not NoneType")
        return [seed for seed in found if seed is not None]

    def _seeds_or_none(
        self, seeds: Sequence[int | None] | NDArray[np.integer[Any]], chosen: NDArray[np.bool_]
    ) -> list[int | None]:
        """Returns the given seed of each chosen world, and None for the others."""
        given = np.asarray(seeds) if hasattr(seeds, "__array__") else seeds
        if isinstance(given, np.ndarray):
            if given.dtype.kind not in "iuO":
                raise TypeError(f"seeds: whole numbers are needed, not {given.dtype}")
            shape, given = given.shape, given.tolist()
        elif isinstance(given, (str, bytes)) or not isinstance(given, Sequence):
            raise TypeError(f"seeds: a list of whole numbers is needed, not {type(given).__name__}")
        else:
            shape = (len(given),)
        if shape != (self.num_envs,):
            raise Error(f"seeds: an array of shape ({self.num_envs},) is needed, not of shape {shape}")
        found: list[int | None] = [None] * self.num_envs
        for place in np.flatnonzero(chosen).tolist():
            seed = given[place]
            if seed is None:
                continue
            if isinstance(seed, (bool, np.bool_)) or not isinstance(seed, (int, np.integer)):
                raise TypeError(f"seeds[{place}]: a whole number is needed, not {type(seed).__name__}")
            if not 0 <= seed < 2**63:
                raise Error(f"seeds[{place}]: must be a whole number from 0 to 2^63 - 1, got {seed}")
            found[place] = int(seed)
        return found

    def _check_out(self, out: object) -> None:
        shape = (self.num_envs, len(self.scenario), 6)
        if not isinstance(out, np.ndarray) or out.dtype not in (np.float32, np.float64):
            kind = out.dtype if isinstance(out, np.ndarray) else type(out).__name__
            raise TypeError(f"out: an array of float32 or float64 is needed, not {kind}")
        if out.shape != shape:
            raise Error(f"out: an array of shape {shape} is needed, not of shape {out.shape}")
        if not out.flags.writeable:
            raise Error("out: the array is read-only; give a copy")

    def __copy__(self) -> VectorSimulation:
        """Returns an independent copy, which continues with the same bits."""
        copied = object.__new__(type(self))
        copied.__dict__.update(self.__dict__)
        copied._native, copied._history = self._native.copy(), self._history.copy()
        return copied

    def __deepcopy__(self, memo: dict[int, Any]) -> VectorSimulation:
        copied = copy.copy(self)
        copied.__dict__.update(copy.deepcopy(self._more(), memo))
        return copied

    def _more(self) -> dict[str, Any]:
        """Returns the attributes of a subclass and of its users."""
        own = ("_native", "_history", "_threads", "_autoreset", "scenario", "num_envs")
        return {name: value for name, value in self.__dict__.items() if name not in own}

    def save(self) -> bytes:
        """Returns the worlds as bytes: the source of the scenario, and all accelerations and resets since the last
        reset of all worlds. A file of the scenario must be there, unchanged, when they are loaded.

        Raises :class:`Error` where worlds have flown since then, unless they were created with ``keep_history=True``,
        and where the accelerations exceed 256 MiB.
        """
        about = {
            "scenario": self.scenario._source_state(),
            "num_envs": self.num_envs,
            "threads": self._threads,
            "autoreset": self.autoreset,
            "is_environment": self._is_environment,
        }
        return self._history.saved(about, self._state())

    @classmethod
    def load(cls, data: bytes) -> VectorSimulation:
        """Returns saved worlds, which continue with the same bits. The flight so far is flown again.

        Raises :class:`Error` for damaged bytes, and for those of another program whose flight differs.
        """
        if cls._is_environment:
            raise TypeError(f"{cls.__name__}: the worlds of an environment are loaded with it; pickle the environment")
        return VectorSimulation._loaded(cls, data, {})

    @staticmethod
    def _loaded(kind: type[VectorSimulation], data: bytes, more: dict[str, Any]) -> VectorSimulation:
        saved = Saved(data)
        about = saved.about
        if about["is_environment"] != kind._is_environment:
            raise Error("data: the worlds are those of an environment, whose policy is no part of them; pickle it")
        loaded = object.__new__(kind)
        loaded.__dict__.update(more)
        loaded.scenario, loaded.num_envs = restore(*about["scenario"]), about["num_envs"]
        loaded._threads, loaded._autoreset = about["threads"], about["autoreset"]
        everyone = np.ones(loaded.num_envs, dtype=np.bool_)
        for call, arrays in saved.calls():
            if "steps" in call:
                loaded.step(arrays[0] if arrays else None, steps=call["steps"])
                continue
            if not hasattr(loaded, "_native"):
                workers = loaded._threads or 0
                loaded._native = _native.VectorSimulation(
                    loaded.scenario._native, call["seeds"], workers, loaded._autoreset, kind._is_environment
                )
                loaded._history = History(about["keeps_steps"], call["seeds"])
                mask, starts = everyone, tuple(arrays)
            else:
                mask, starts = arrays[0], tuple(arrays[1:])
            if starts or mask is not everyone:
                given = {"positions": starts[0], "velocities": starts[1]} if starts else {}
                loaded.reset(mask, call["seeds"], **given)
        saved.check(loaded._state)
        return loaded

    def _state(self) -> NDArray[np.float64]:
        """Returns the state that a loaded copy must have."""
        # A seed of 63 bits is no float64, its halves are.
        halves = self.seeds.view(np.uint32)
        floats = self.positions.ravel(), self.velocities.ravel(), self.least_clearance_m
        return np.concatenate([*floats, self.is_over, self.steps, halves], dtype=np.float64)

    def __reduce__(self) -> tuple[Any, ...]:
        return VectorSimulation._loaded, (type(self), self.save(), self._more())

    def __len__(self) -> int:
        return self.num_envs

    def __repr__(self) -> str:
        over = int(self.is_over.sum())
        return f"<VectorSimulation {self.scenario.name}: {self.num_envs} worlds, {over} ended>"
