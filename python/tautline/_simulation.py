"""Simulations that the caller steps: for learning, live loops, and control from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._law import Law, check_law
from ._native import Error
from ._scenario import Scenario, scenario_of
from ._tables import Finding, Findings
from ._words import PathLike


class Simulation:
    """A flight under way, which the judge follows step by step.

        sim = tl.Simulation("pentagon")
        while not sim.is_over:
            sim.step(u)                     # u (N, 3) accelerations [m/s^2]; without u the law is asked

    Raises :class:`Error` for a scenario that is wrong.
    """

    def __init__(
        self, scenario: Scenario | PathLike = "pentagon", *, law: Law | None = None, set: Mapping[str, Any] | None = None
    ) -> None:
        self.scenario = scenario_of(scenario, set)
        check_law(law)
        self._native = _native.Simulation(self.scenario._native, law)

    def step(self, u: NDArray[np.float64] | None = None, steps: int = 1) -> None:
        """Flies steps of ``scenario.dt_s``, fewer where the flight ends; ``u`` (N, 3) or (N, 2) float64 are accelerations [m/s^2] in
        the place of the law's. What is a step too long for the law is flown in parts.

        Raises :class:`Error` where the flight has ended before, or ``u`` has a wrong shape or holds what is no number; ``TypeError`` for a
        wrong dtype. What a law raises ends the flight and is raised.
        """
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)):
            raise TypeError(f"steps: a whole number is needed, not {type(steps).__name__}")
        if steps < 1:
            raise Error(f"steps: {steps} were asked for; fly at least one")
        if (ending := self.ending) is not None:
            raise Error(f"the flight has ended ({ending}); make a new simulation, or go on from an earlier copy")
        self._native.step(u, min(int(steps), 2**63))

    @property
    def t(self) -> float:
        """Time flown [s]."""
        return self._native.t

    @property
    def steps(self) -> int:
        """Whole steps flown."""
        return self._native.steps

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 3) true positions [m], a copy."""
        return self._native.positions

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 3) true velocities [m/s], a copy."""
        return self._native.velocities

    @property
    def commands(self) -> NDArray[np.float64]:
        """(N, 3) accelerations [m/s^2] that are held now; (0, 3) where the law had no answer."""
        return self._native.commands

    @property
    def separation_m(self) -> float | None:
        """The smallest distance of two vehicles [m] over the last stretch that was judged: the last step, or the last part of one
        that was flown in parts; between its ends too. None of one vehicle. Lengths are scaled where the scenario has ellipsoids."""
        return self._native.separation_m

    @property
    def closest(self) -> Finding | None:
        """The closest two so far: ``pair`` (names, from 1), ``separation_m``, ``time_s``."""
        found = self._native.closest
        if found is None:
            return None
        (first, second), separation_m, time_s = found
        return Finding({"who": [str(first), str(second)], "separation_m": separation_m, "time_s": time_s})

    @property
    def least_clearance_m(self) -> float | None:
        """The smallest clearance so far [m], of vehicles above delta and past obstacles; below 0 exactly where there is a violation."""
        return self._native.least_clearance_m

    @property
    def status(self) -> str:
        """What the judge has found so far: ``clear``, ``violation`` or ``undecided``. Once the flight has ended, the verdict on all of it:
        never ``clear`` where it ended early."""
        return self._native.judged()[0]

    @property
    def violations(self) -> Findings:
        """Violations of two vehicles so far: ``pair``, ``from_s``, ``to_s``, ``min_m``."""
        found = self._native.judged()[1]
        return Findings(
            [{"who": [str(i), str(j)], "from_s": a, "to_s": b, "min_m": least} for (i, j), a, b, least in found]
        )

    @property
    def ending(self) -> str | None:
        """How the flight ended, once it has: ``completed``, or why before its time."""
        return self._native.ending

    @property
    def ended_early(self) -> str | None:
        """Why the flight ended before the scenario's duration; None where it did not, and while it is under way."""
        return None if self.ending == "completed" else self.ending

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended."""
        return self.ending is not None

    def copy(self, noise_seed: int | None = None) -> Simulation:
        """A simulation that goes on from here by itself with the same bits; with a seed, all that is drawn from now on is drawn from
        it. A law in Python is the same object in both."""
        if noise_seed is not None and not (isinstance(noise_seed, (int, np.integer)) and 0 <= noise_seed < 2**64):
            raise Error(f"noise_seed is {noise_seed!r}; give a whole number from 0 on, below 2^64")
        other = Simulation.__new__(Simulation)
        other.scenario, other._native = self.scenario, self._native.copy(noise_seed)
        return other

    def __copy__(self) -> Simulation:
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> Simulation:
        return self.copy()

    def __len__(self) -> int:
        return len(self.scenario)

    def _repr_html_(self) -> str:
        status, closest = self.status, self.closest
        rows = [
            ("time", f"{self.t:g} s of {self.scenario.duration_s:g} s"),
            ("ending", self.ending or "under way"),
            ("smallest distance so far", "-" if closest is None else f"{closest.separation_m:.6g} m at {closest.time_s:.4g} s"),
        ]
        tone = {"clear": "open", "violation": "bad"}.get(status, "open")
        return _display.card(tone, f"{self.scenario.name}: {status} so far", rows)

    def __repr__(self) -> str:
        return f"<Simulation {self.scenario.name} at {self.t:g} s: {self.ending or 'under way'}>"
