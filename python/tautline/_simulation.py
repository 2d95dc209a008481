"""Simulations that the caller steps, for learning and for control from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _display, _native
from ._arguments import PathLike, exact_array
from ._judgement import Finding
from ._law import ControlLaw, check_law
from ._native import Error
from ._scenario import Scenario, to_scenario
from ._tables import Rows


class Simulation:
    """A flight in progress, with an audit of every step.

    Example::

        sim = tl.Simulation("pentagon")
        while not sim.is_over:
            sim.step(u)                     # u (N, 3) accelerations [m/s^2]; without u the law commands.

    Raises :class:`Error` for a wrong scenario.
    """

    def __init__(
        self,
        scenario: Scenario | PathLike = "pentagon",
        *,
        law: ControlLaw | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        self.scenario = to_scenario(scenario, set)
        check_law(law)
        self._law = law
        self._native = _native.Simulation(self.scenario._native, law)

    def step(self, u: ArrayLike | None = None, steps: int = 1) -> None:
        """Flies steps of ``scenario.dt_s``, fewer where the flight ends.

        ``u`` (N, 3) or (N, 2) are accelerations [m/s^2] that replace those of the law. They pass through the shield and
        the actuators of the scenario. Without ``u`` a step that is too long for the law is flown in parts.

        Raises :class:`Error` where the flight has already ended, or where ``u`` has a wrong shape or is not finite;
        ``TypeError`` for numbers that are no float64. An exception of the law ends the flight and is raised again.
        """
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)):
            raise TypeError(f"steps: a whole number is needed, not {type(steps).__name__}")
        if steps < 1:
            raise Error(f"steps: must be at least 1, got {steps}")
        if (ending := self.ending) is not None:
            raise Error(f"the flight has ended ({ending}); create a new simulation, or step an earlier copy")
        commands = None if u is None else exact_array(u, "u")
        self._native.step(commands, min(int(steps), 2**63))

    @property
    def _names(self) -> list[str]:
        return [str(number) for number in range(1, len(self.scenario) + 1)]

    def _finding(
        self, pair: tuple[int, int], from_s: float | None, to_s: float | None, separation_m: float, at_s: float
    ) -> Finding:
        subjects, unit = [str(number) for number in pair], self.scenario._native.unit
        found = subjects, from_s, to_s, at_s, separation_m, separation_m, unit, self.scenario.delta_m, None
        return Finding(dict(zip(Finding._kinds, found, strict=True)), self._names)

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
        """(N, 3) current commands [m/s^2]; (0, 3) where the law failed, and 0 under a shield before the first step."""
        return self._native.commands

    @property
    def separation_m(self) -> float | None:
        """Smallest separation [m] over the last step, or over the last part of a step in parts. None for one vehicle.
        Lengths are scaled where the scenario has ellipsoids."""
        return self._native.separation_m

    @property
    def closest(self) -> Finding | None:
        """Closest approach of two vehicles so far."""
        found = self._native.closest
        return None if found is None else self._finding(found[0], None, None, *found[1:])

    @property
    def least_clearance_m(self) -> float | None:
        """Smallest clearance so far [m]: separation less delta, or distance to an obstacle less its clearance. It is
        below 0 exactly where there is a violation."""
        return self._native.least_clearance_m

    @property
    def status(self) -> str:
        """Verdict so far: ``clear``, ``violation`` or ``undecided``. After the end it is the verdict of the whole
        flight, which is never ``clear`` where it ended early."""
        return self._native.judged()[0]

    @property
    def violations(self) -> Rows[Finding]:
        """Violations of pairs so far."""
        return Rows(Finding, [self._finding(*found) for found in self._native.judged()[1]], self._names)

    @property
    def ending(self) -> str | None:
        """``completed``, or the reason of an early end; None before the end."""
        return self._native.ending

    @property
    def ended_early(self) -> str | None:
        """Reason why the flight ended before the scenario's duration; None otherwise."""
        return None if self.ending == "completed" else self.ending

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended."""
        return self.ending is not None

    def copy(self, noise_seed: int | None = None) -> Simulation:
        """Returns an independent simulation that continues from here, bit-identical without ``noise_seed``.

        With a seed, all further random numbers come from that seed. Both simulations share the object of a law in
        Python.
        """
        if noise_seed is not None and not (isinstance(noise_seed, (int, np.integer)) and 0 <= noise_seed < 2**64):
            raise Error(f"noise_seed: must be a whole number from 0 to 2^64 - 1, got {noise_seed!r}")
        return Simulation._of(self.scenario, self._law, self._native.copy(noise_seed))

    def save(self) -> bytes:
        """Returns the simulation as bytes: the scenario, the accelerations from outside, and the commands of a law in
        Python. Their size grows with the steps that were flown with such accelerations or commands.

        Raises :class:`Error` if these exceed 256 MiB.
        """
        return self._native.save(self.scenario._native)

    @classmethod
    def load(cls, data: bytes, law: ControlLaw | None = None) -> Simulation:
        """Returns a saved simulation, which continues with the same bits.

        The flight so far is flown again, without calls of ``law``. ``law`` is the law in Python of the saved
        simulation, with the memory that it had.

        Raises :class:`Error` for damaged bytes, for those of another program, and for another law.
        """
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise TypeError(f"data: bytes are needed, not {type(data).__name__}")
        check_law(law)
        toml, _ = _native.Simulation.saved(bytes(data))
        scenario = Scenario.from_toml(toml)
        return cls._of(scenario, law, _native.Simulation.load(scenario._native, law, bytes(data)))

    @classmethod
    def _of(cls, scenario: Scenario, law: ControlLaw | None, native: _native.Simulation) -> Simulation:
        simulation = cls.__new__(cls)
        simulation.scenario, simulation._law, simulation._native = scenario, law, native
        return simulation

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle stores the law by its own class.
        return Simulation.load, (self.save(), self._law)

    def __copy__(self) -> Simulation:
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> Simulation:
        return self.copy()

    def __len__(self) -> int:
        return len(self.scenario)

    def _repr_html_(self) -> str:
        status, closest = self.status, self._native.closest
        rows = [
            ("time", f"{self.t:g} s of {self.scenario.duration_s:g} s"),
            ("ending", self.ending or "in progress"),
            (
                "smallest separation so far",
                "-" if closest is None else f"{_native.separation_text(closest[1])} m at {closest[2]:.4g} s",
            ),
        ]
        tone = {"clear": "open", "violation": "bad"}.get(status, "open")
        return _display.make_card(tone, f"{self.scenario.name}: {status} so far", rows)

    def __repr__(self) -> str:
        return f"<Simulation {self.scenario.name} at {self.t:g} s: {self.ending or 'in progress'}>"
