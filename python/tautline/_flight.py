"""Flights: scenarios flown to their end, every step judged."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._audit import Audit, audit
from ._law import Law, check_law
from ._native import Error
from ._scenario import Scenario, scenario_of
from ._tables import frame
from ._words import PathLike, path

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Flight:
    """A flight: T recorded instants of N vehicles, and the report on every step of it."""

    #: (T,) recorded instants [s].
    t: NDArray[np.float64]
    #: (T, N, 3) positions [m], read-only.
    positions: NDArray[np.float64]
    #: (T, N, 3) velocities [m/s].
    velocities: NDArray[np.float64]
    #: (T, N, 3) commanded accelerations [m/s^2]; NaN at an instant at which the law had no answer.
    commands: NDArray[np.float64]
    #: (T,) smallest distance of two vehicles over the steps since the instant before [m].
    separations_m: NDArray[np.float64]

    def __init__(self, scenario: Scenario, flown: _native.Flown) -> None:
        self.scenario = scenario
        #: The verdict in a line, and the summary that the command line prints.
        self.headline, self.text = flown.headline, flown.text
        #: Whether it passes: clear, and its formation reached as far as asked.
        self.passed = flown.passed
        self._json = flown.report
        #: Everything that ``report.json`` holds.
        self.report: dict[str, Any] = json.loads(flown.report)
        self.t, self.positions, self.velocities = flown.t, flown.positions, flown.velocities
        self.commands, self.separations_m = flown.commands, flown.separations_m
        self._seen = flown.seen
        # What the run judged: another motion would not be.
        for judged in (self.t, self.positions):
            judged.flags.writeable = False

    @property
    def status(self) -> str:
        """What the judge found: ``clear``, ``violation`` or ``undecided``. A flight that ended early is never ``clear``."""
        return str(self.report["audit"]["status"])

    @property
    def ended_early(self) -> str | None:
        """Why the flight ended before the scenario's duration; None where it did not."""
        reason: str | None = self.report["run"]["ended_early"]
        return reason

    @property
    def reached(self) -> bool:
        """Whether the formation was reached and kept to the end of the scenario's duration; never of a flight that ended early."""
        return bool(self.report["formation"]["reached"])

    @property
    def separation_m(self) -> float | None:
        """The smallest distance of two vehicles over all steps [m]; None of one vehicle."""
        smallest: float | None = self.report["separation"]["min_m"]
        return smallest

    def to_dict(self) -> dict[str, Any]:
        """Everything that ``report.json`` holds."""
        report: dict[str, Any] = json.loads(self._json)
        return report

    def to_pandas(self) -> pandas.DataFrame:
        """A row a vehicle and instant: ``t``, ``id`` (from 1), ``x``, ``y``, ``z``, ``vx``, ``vy``, ``vz``, ``ax``, ``ay``, ``az``. Imports
        pandas."""
        instants, vehicles = self.positions.shape[:2]
        columns: dict[str, Any] = {"t": np.repeat(self.t, vehicles), "id": np.tile(np.arange(1, vehicles + 1), instants)}
        for prefix, vectors in (("", self.positions), ("v", self.velocities), ("a", self.commands)):
            for axis, letter in enumerate("xyz"):
                columns[prefix + letter] = vectors[:, :, axis].ravel()
        return frame(columns)

    def audit(self, **asked: Any) -> Audit:
        """Judges the flight as :func:`tautline.audit` judges its recording: delta, ellipsoids and obstacles are the scenario's unless
        others are given. The flight's own audit answers that question; any other is judged from the recorded instants. Of a flight that
        ended early the verdict is ``UNDECIDED`` unless a violation was seen, or ``to_s`` ends the window before."""
        return audit(self.t, self.positions, _seen=self._seen, **asked)

    def plot(self) -> Figure:
        """Ways from above and the smallest distance over time, with delta. Imports matplotlib."""
        try:
            from matplotlib.figure import Figure
        except ImportError:
            raise ImportError("plots need matplotlib: pip install matplotlib") from None
        figure = Figure(figsize=(10, 4.5), layout="constrained")
        above, beside = figure.subplots(1, 2)
        above.plot(self.positions[:, :, 0], self.positions[:, :, 1], linewidth=1)
        above.scatter(self.positions[-1:, :, 0], self.positions[-1:, :, 1], s=16, color="black", zorder=3)
        above.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=self.scenario.name)
        beside.plot(self.t, self.separations_m, label="smallest distance")
        beside.axhline(self.scenario.delta_m, color="tab:red", label="delta")
        beside.set(xlabel="t [s]", ylabel="distance [m]", title=self.headline.partition(":")[0])
        beside.legend()
        return figure

    def __bool__(self) -> bool:
        raise TypeError("a flight is neither true nor false: ask passed, or status")

    def __repr__(self) -> str:
        return f"<Flight {self.headline}>"

    def __str__(self) -> str:
        return f"{self.headline}\n{self.text}"

    def _repr_html_(self) -> str:
        reached = self.report["formation"]["reached_at_s"]
        nearest = self.separation_m
        rows = [
            ("scenario", self.scenario.name),
            ("vehicles", str(len(self.scenario))),
            ("smallest distance", "-" if nearest is None else f"{nearest:.6g} m (delta {self.scenario.delta_m:g} m)"),
            ("violations", str(len(self.report["audit"]["violations"]))),
            ("formation reached", "no" if reached is None else f"at {reached:.4g} s"),
        ]
        rows += [] if self.ended_early is None else [("ended early", self.ended_early)]
        tone = "good" if self.passed else "bad" if self.status == "violation" else "open"
        return _display.card(tone, self.headline, rows, _display.paths(self.positions, "Ways seen from above"))


def fly(
    scenario: Scenario | PathLike,
    *,
    law: Law | None = None,
    record: PathLike | None = None,
    html: PathLike | None = None,
    set: Mapping[str, Any] | None = None,
    keep: bool = True,
) -> Flight:
    """Flies a scenario to its end, under a law of your own where one is given.

    ``record`` is a file ``*.mcap`` to write, which :func:`tautline.read`, ``tautline audit`` and Foxglove open; ``html`` a page for
    people; both are overwritten. ``keep=False`` leaves the arrays empty, for flights that do not fit into memory. Other Python
    threads run meanwhile; Ctrl-C ends the flight, and what was recorded stays.

    Raises :class:`Error` for a scenario that is wrong and for a law that writes what is no number; what a law raises is raised again.
    """
    what = scenario_of(scenario, set)
    check_law(law)
    check_outputs(what, {"record": record, "html": html})
    record_to = None if record is None else path(record, "record")
    page = None if html is None else path(html, "html")
    command = f"tautline.fly({what!r})" if law is None else f"tautline.fly({what!r}, law={type(law).__name__}(...))"
    return Flight(what, _native.fly(what._native, law, record_to, page, command, keep))


def check_outputs(scenario: Scenario, outputs: Mapping[str, PathLike | None]) -> None:
    """Refuses files that would replace the scenario or each other, and those that have no folder to be in, before an hour of flight."""
    taken = {os.path.realpath(file): "the scenario" for file in scenario.files}
    for what, file in outputs.items():
        if file is None:
            continue
        place = os.path.realpath(path(file, what))
        if place in taken:
            raise Error(f"{what}: {os.fspath(file)} would overwrite {taken[place]}; write another file")
        taken[place] = what
        folder = os.path.dirname(place)
        if not os.path.isdir(folder):
            raise OSError(f"{what}: cannot write {os.fspath(file)}: there is no folder {folder}")
