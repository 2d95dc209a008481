"""Flights: scenarios flown to their end, with an audit of every step."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._arguments import PathLike, boolean, path
from ._audit import Audit, AuditOptions, perform
from ._judgement import Judgement, Statement
from ._law import ControlLaw, check_law
from ._native import Error
from ._pickles import sealed, unsealed
from ._scenario import Scenario, restore, to_scenario
from ._tables import Column, Row, Rows, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

#: Arrays of a flight.
ARRAYS = ("t", "positions", "velocities", "commands", "separations_m")


class Reason(Statement):
    """A reason against a pass of a flight, with its numbers."""

    data: Mapping[str, object]


class Certificate(Row):
    """Certificate of a flight: certified separation, and distance beyond the clearance of every obstacle. Without an
    end ``until_s`` is None. ``void`` has the reasons why nothing is certified."""

    separation_m: float | None
    clearance_margin_m: float | None
    until_s: float | None
    void: Rows[Statement]


class Flight(Judgement, Table):
    """A flight: T recorded instants of N vehicles, and the report of all steps. :func:`fly` returns it.

    As a table it has a row for each instant and vehicle. Its columns are the time ``t``, the number ``id`` of the
    vehicle from 1 and its ``index`` from 0. The axes of positions, velocities and commands follow: `x, y, z, vx, vy,
    vz, ax, ay, az`.

    A flight can be pickled. Where the file of its scenario is missing, :attr:`scenario` is then the flown one.
    """

    #: (T,) recorded instants [s].
    t: NDArray[np.float64]
    #: (T, N, 3) positions [m], read-only.
    positions: NDArray[np.float64]
    #: (T, N, 3) velocities [m/s].
    velocities: NDArray[np.float64]
    #: (T, N, 3) commanded accelerations [m/s^2]; NaN where the law failed.
    commands: NDArray[np.float64]
    #: (T,) smallest separation over the steps since the previous instant [m].
    separations_m: NDArray[np.float64]

    _truth = "passed or status"
    #: The scenario.
    scenario: Scenario
    #: Reasons against a pass.
    reasons: Rows[Reason]
    #: Certificate of the flight.
    certificate: Certificate

    def __init__(self) -> None:
        raise TypeError("a flight is the result of tautline.fly(...)")

    def _restore(self, scenario: Scenario, state: dict[str, Any]) -> Flight:
        """Sets the attributes."""
        super().__init__(state["headline"], state["text"], state["report"])
        self.scenario, self._audited = scenario, state["findings"]
        for name in ARRAYS:
            setattr(self, name, state[name])
        # The run's audit holds for this motion only.
        for array in (self.t, self.positions):
            array.flags.writeable = False
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        state = {name: getattr(self, name) for name in (*ARRAYS, "headline", "text")}
        state |= {"report": self._json, "findings": self._audited.json}
        return unpickle_flight, sealed(self.scenario._source_state(), self.scenario.to_toml(), state)

    @property
    def report(self) -> dict[str, Any]:
        """Contents of ``report.json``."""
        return self._values

    @property
    def passed(self) -> bool:
        """Whether the flight passes: it is clear and reaches its formation."""
        return bool(self["pass"])

    @property
    def ended_early(self) -> str | None:
        """Reason why the flight ended before the scenario's duration; None where it did not."""
        end = self["run"]["ended_early"]
        return None if end is None else str(end["text"])

    @property
    def reached(self) -> bool:
        """Whether the formation was reached and kept to the scenario's end; False for a flight that ended early."""
        return bool(self["formation"]["reached"])

    def _columns(self) -> dict[str, Column]:
        instants, vehicles = self.positions.shape[:2]
        indices = np.tile(np.arange(vehicles), instants)
        columns = {"t": (np.repeat(self.t, vehicles), float), "id": (indices + 1, int), "index": (indices, int)}
        for prefix, vectors in (("", self.positions), ("v", self.velocities), ("a", self.commands)):
            for axis, letter in enumerate("xyz"):
                columns[prefix + letter] = vectors[:, :, axis].ravel(), float
        return columns

    def audit(self, **options: Unpack[AuditOptions]) -> Audit:
        """Audits the flight as :func:`tautline.audit` audits its recording.

        By default delta, ellipsoids and obstacles are those of the scenario, and the result is that of the run's own
        audit. Other options are evaluated on the recorded instants. A flight that ended early is ``UNDECIDED`` unless
        a violation was found, or ``until_s`` ends the window earlier.
        """
        return perform(self.t, self.positions, options, self._audited)

    def plot(self, ax: Axes | Sequence[Axes] | None = None) -> Figure:
        """Draws the paths from above, and the smallest separation over time with delta. Returns the figure.

        ``ax`` are axes of matplotlib for the paths, or two axes for both. Imports matplotlib.
        """
        figure: Figure = _display.import_plots().flight(self, ax)
        return figure

    def _repr_html_(self) -> str:
        reached = self["formation"]["reached_at_s"]
        nearest, delta = self.separation_m, f"delta {self.scenario.delta_m:g} m"
        rows = [
            ("scenario", self.scenario.name),
            ("vehicles", str(len(self.scenario))),
            ("smallest separation", "-" if nearest is None else f"{_native.separation_text(nearest)} m ({delta})"),
            ("violations", str(sum(part.violations for part in self.answers))),
            ("formation reached", "no" if reached is None else f"at {reached:.4g} s"),
        ]
        rows += [] if self.ended_early is None else [("ended early", self.ended_early)]
        tone = "good" if self.passed else "bad" if self.status == "violation" else "open"
        return _display.make_card(tone, self.headline, rows, _display.draw_paths(self.positions, "Paths from above"))


def fly(
    scenario: Scenario | PathLike,
    *,
    law: ControlLaw | None = None,
    record: PathLike | None = None,
    html: PathLike | None = None,
    set: Mapping[str, Any] | None = None,
    shield: bool | None = None,
    keep: bool = True,
) -> Flight:
    """Flies a scenario to its end, under its own law or under ``law``.

    * ``record``: file ``*.mcap`` to write, also over an existing one. `tautline audit` and Foxglove open it.
    * ``html``: page to write, also over an existing one.
    * ``set``: overrides of scenario keys, such as ``{"time.duration_s": 60}``.
    * ``shield``: True certifies separations under any law, with the keys of ``[shield]`` or their defaults; False
      flies without a shield. By default the scenario decides.
    * ``keep``: False leaves the arrays empty, for flights that do not fit into memory.

    Other Python threads run during the flight. Ctrl-C ends it and keeps the recording.

    Raises :class:`Error` for a wrong scenario and for commands that are not finite. An exception of the law ends the
    flight and is raised again.
    """
    if shield is not None:
        set = {**(set or {}), "shield.enabled": boolean(shield, "shield")}
    flown = to_scenario(scenario, set)
    check_law(law)
    check_outputs(flown, {"record": record, "html": html})
    record_to = None if record is None else path(record, "record")
    page = None if html is None else path(html, "html")
    call = f"tautline.fly({flown!r})" if law is None else f"tautline.fly({flown!r}, law={type(law).__name__}(...))"
    found = _native.fly(flown._native, law, record_to, page, call, boolean(keep, "keep"))
    state = {name: getattr(found, name) for name in (*ARRAYS, "headline", "text", "report", "findings")}
    return Flight.__new__(Flight)._restore(flown, state)


def unpickle_flight(*pickled: Any) -> Flight:
    """Returns the flight of another process. Raises :class:`Error` for damaged bytes."""
    source, toml, state = unsealed("Flight", *pickled)
    try:
        scenario = restore(*source)
    except (Error, FileNotFoundError):
        # The file is missing here, or has changed since the flight.
        scenario = Scenario.from_toml(toml)
    findings = _native.FlightFindings(scenario._native, state["findings"])
    return Flight.__new__(Flight)._restore(scenario, state | {"findings": findings})


def check_outputs(scenario: Scenario, outputs: Mapping[str, PathLike | None]) -> None:
    """Raises before the flight for files that would replace the scenario or each other, or whose folder is missing."""
    taken = {os.path.realpath(file): "the scenario" for file in scenario.files}
    for argument, file in outputs.items():
        if file is None:
            continue
        place = os.path.realpath(path(file, argument))
        if place in taken:
            raise Error(f"{argument}: {os.fspath(file)} would overwrite {taken[place]}; write another file")
        taken[place] = argument
        folder = os.path.dirname(place)
        if not os.path.isdir(folder):
            raise OSError(f"{argument}: cannot write {os.fspath(file)}: there is no folder {folder}")
