"""Audits of arrays and recordings: is every pair far enough apart, also between samples?"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _display, _native
from ._arguments import (
    PathLike,
    ReadOptions,
    boolean,
    exact_array,
    name_list,
    name_or_numbers,
    number_or_by_name,
    numbers_by_name,
    optional_count,
    optional_names,
    optional_number,
    optional_path,
    optional_text,
    path,
    paths,
    read_options,
    single_recording,
    with_files,
)
from ._frames import ArrowTable, ParquetFrame, is_frame, to_seconds
from ._judgement import Fact, Finding, Judgement
from ._native import Error
from ._pickles import sealed, unsealed
from ._tables import Column, OpenRow, Row, Rows, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

    from ._words import Motion, Rules

#: Times (K,) and positions (K, 3) of vehicles, by name.
Tracks = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
#: Verdict, headline, summary, the report as JSON, and whether each of its facts is an assumption.
Outcome = tuple[str, str, str, str, list[bool]]

#: Check of each option of an audit, in the order of the call that a page shows.
CHECKS: dict[str, Callable[[object, str], object]] = {
    "delta": optional_number,
    "motion": optional_text,
    "max_accel": number_or_by_name,
    "radius": number_or_by_name,
    "ellipsoid": name_or_numbers,
    "cylinder": name_or_numbers,
    "well_clear": name_or_numbers,
    "rules": optional_text,
    "obstacles": optional_path,
    "limit": numbers_by_name,
    "fence": optional_path,
    "plan": optional_path,
    "plan_delay": optional_number,
    "tube": optional_number,
    "accel_window": optional_number,
    "config": lambda value, what: False if value is False else optional_path(value, what),
    "from_s": optional_number,
    "until_s": optional_number,
    "above": optional_number,
    "land_on": optional_names,
    "ids": optional_names,
    "offset": numbers_by_name,
    "expect_vehicles": optional_count,
    "max_gap": optional_number,
    "require_presence": boolean,
    "independent": boolean,
}
#: Problem of arguments that belong to arrays.
NO_ARRAYS = "velocities, names: only for arrays, but a recording is given"
#: Options that are files.
FILES = ("obstacles", "fence", "plan", "config")


class ViolationError(Error):
    """Raised by :meth:`Audit.raise_for_violation` for an audit that is not clear; ``audit`` is that audit."""

    def __init__(self, audit: Audit) -> None:
        super().__init__(audit.headline)
        self.audit = audit

    def __reduce__(self) -> tuple[type[ViolationError], tuple[Audit]]:
        return ViolationError, (self.audit,)


class Gap(Row):
    """A time in which a vehicle is not seen. ``joined_by_s`` is the smallest ``max_gap`` that closes it."""

    vehicle: str
    from_s: float
    to_s: float
    joined_by_s: float


class EarlyEnd(Row):
    """Early end of a recorded flight whose scenario asks for ``duration_s``."""

    at_s: float
    duration_s: float
    reason: str | None


class Audit(Judgement, Table):
    """Result of an audit. :func:`audit` returns it. It can be pickled.

    As a table it has the findings of all parts of the question. ``part`` is the part, such as ``separation`` or
    ``speed_m_s``, and ``finding`` is ``closest``, ``violation`` or ``undecided``. The other columns are those of
    ``closest`` and ``violations``.
    """

    _truth = "is_clear or raise_for_violation()"
    #: Verdict in words: ``PROVED CLEAR``, ``CLEAR if straight between samples``, ``VIOLATION``, ``UNDECIDED``, ...
    verdict: str
    #: Early end of a flight; None where the whole window was flown.
    ended_early: EarlyEnd | None
    #: Findings against the plan: ``status``, ``delay_s``, ``tube_m``, ``vehicles``, ``unknown``, ``certificate``. None
    #: without a plan.
    plan: OpenRow | None
    #: Notes on how the recording was read, a sentence each.
    notes: list[str]

    def __init__(self) -> None:
        raise TypeError("an audit is the result of tautline.audit(...)")

    def _restore(
        self, outcome: Outcome, repeat: Callable[..., Outcome], tracks: Callable[[], Tracks | None] = lambda: None
    ) -> Audit:
        """Sets the attributes; ``repeat`` repeats the audit, and ``tracks`` returns the samples."""
        self.verdict, *found, self._assumed = outcome
        super().__init__(*found)
        self._repeat, self._tracks = repeat, tracks
        return self

    @property
    def is_clear(self) -> bool:
        """Whether the recording is clear: proved, or under assumptions."""
        return self.status == "clear"

    @property
    def assumptions(self) -> Rows[Fact]:
        """Those of :attr:`facts` that are assumptions, such as straight motion between samples: the data leave another
        case open. A clear audit without assumptions is proved."""
        return Rows(Fact, [fact for fact, assumed in zip(self.facts, self._assumed, strict=True) if assumed])

    @property
    def is_planar(self) -> bool:
        """Whether the height of a vehicle is unknown; distances and speeds are then those in the plane of x and y."""
        return bool(self["planar"])

    @property
    def gaps(self) -> Rows[Gap]:
        """Gaps, in which a vehicle is not seen."""
        return Rows(Gap, self["gaps"]["listed"], self.vehicles)

    def _columns(self) -> dict[str, Column]:
        listed = [
            (answer["part"], finding, row)
            for answer in self["answers"]
            for finding, rows in (
                ("closest", answer["closest"]),
                ("violation", answer["violations"]["listed"]),
                ("undecided", answer["undecided"]["listed"]),
            )
            for row in rows
        ]
        parts, findings = [part for part, _, _ in listed], [finding for _, finding, _ in listed]
        rows = Rows(Finding, [row for _, _, row in listed], self.vehicles)
        return {"part": (parts, str), "finding": (findings, str), **rows._columns()}

    def to_html(self, file: PathLike) -> None:
        """Writes a page with figures. Repeats the audit for them.

        Raises :class:`Error` where the recording has changed, and keeps the file then; ``OSError`` where the file
        cannot be written.
        """
        changed = "the recording has changed since its audit; audit it again"
        page = path(file, "file")
        # The first repetition writes no page: a page of another verdict must not replace this one's.
        if self._repeat()[3] != self._json:
            raise Error(changed)
        if self._repeat(page)[3] != self._json:
            raise Error(f"{changed}; {page} shows the changed recording")

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the separations of the closest pairs over time with their limits. Returns the figure.

        Where lines between samples do not show the findings, such as for curves or scaled separations, it draws the
        smallest separations as bars. It reads a recording again. ``ax`` are axes of matplotlib, which it imports.
        """
        figure: Figure = _display.import_plots().audit(self, self._tracks(), ax)
        return figure

    def raise_for_violation(self, allow_undecided: bool = False) -> None:
        """Raises :class:`ViolationError` for a violation, and for an undecided audit unless ``allow_undecided`` is
        True."""
        if not (self.is_clear or (allow_undecided and self.status == "undecided")):
            raise ViolationError(self)

    def __reduce__(self) -> tuple[Callable[..., Audit], tuple[Any, ...]]:
        return unpickle, sealed(self.verdict, self.headline, self.text, self._json, self._assumed)

    def _repr_html_(self) -> str:
        tone = {"clear": "good", "violation": "bad"}.get(self.status, "open")
        closest = self._findings("closest", self.vehicles)
        rows = [
            ("finding", self.headline.partition(": ")[2]),
            ("vehicles", str(self["judged"])),
            ("violations", str(sum(part.violations for part in self.answers))),
            ("undecided", str(sum(part.undecided for part in self.answers))),
            ("gaps", str(self["gaps"]["count"])),
        ]
        drawing = _display.draw_bars(
            [" ".join(near.subjects) for near in closest],
            [near.lower or 0.0 for near in closest],
            [near.limit or 0.0 for near in closest],
            "Separations of the closest pairs, with their limits",
        )
        return _display.make_card(tone, self.verdict, rows, drawing)


class AuditOptions(TypedDict, total=False):
    """Checks of :func:`audit`, as keyword arguments."""

    delta: float | None
    velocities: ArrayLike | None
    names: Sequence[str] | None
    motion: Motion | None
    max_accel: float | Mapping[str, float] | None
    radius: float | Mapping[str, float] | None
    ellipsoid: Sequence[float] | str | None
    cylinder: Sequence[float] | None
    well_clear: Sequence[float] | str | None
    rules: Rules | None
    obstacles: PathLike | None
    limit: Mapping[str, float] | None
    fence: PathLike | None
    plan: PathLike | None
    plan_delay: float | None
    tube: float | None
    accel_window: float | None
    config: PathLike | Literal[False] | None
    from_s: float | None
    until_s: float | None
    above: float | None
    land_on: Iterable[str] | None
    ids: Iterable[str] | None
    offset: Mapping[str, float] | None
    expect_vehicles: int | None
    max_gap: float | None
    require_presence: bool
    independent: bool


class AuditArguments(AuditOptions, ReadOptions, total=False):
    """Keyword arguments of :func:`audit`: its checks, and the options of reading."""


def audit(
    t: ArrayLike | ArrowTable | PathLike | Sequence[PathLike],
    positions: ArrayLike | None = None,
    **options: Unpack[AuditArguments],
) -> Audit:
    """Audits positions over time, in arrays or in a recording of any format.

    ``tl.audit(t, positions, delta=1.5)`` audits arrays.

    * ``t``: (T,) times [s], or ``datetime64`` or ``timedelta64``; dates count from the first instant.
    * ``positions``: (T, N, 3) or (T, N, 2) [m]. NaN in every axis means that the vehicle was not seen. ``notes`` names
      vehicles that were not seen from the first instant to the last.
    * Arrays of float64 are borrowed in any memory order, not copied: do not write to them during the call. Lists,
      tensors, integers and float32 are copied without rounding.
    * ``layout``: order of the axes of ``positions`` and ``velocities``, such as ``"time,axis,vehicle"``.
    * ``velocities``: (T, N, 3) [m/s], which make ``motion="bounded"`` tighter.
    * ``names``: N names; numbers from 1 unless given.

    ``tl.audit(frame, delta=1.5)`` audits a table of pandas, polars, pyarrow or DuckDB, long or wide, with the columns
    and the options of reading of a file (docs/recordings.md). It imports pyarrow.

    ``tl.audit("flight.mcap")`` audits a file or folder, or with ``join=True`` a list of files with one vehicle each.
    These options control reading: `format, time_unit, fps, time_scale, sort, duplicates, one_vehicle, skip_incomplete,
    distinct, clock, scale, axes, dimensions, column, start, layout, frame, topic, origin,
    plan_end, allow_unfinished`.

    * ``delta``: safety distance of two centres [m].
    * ``radius``: radius of all vehicles, or by name [m]; the limit of a pair is max(delta, r1 + r2).
    * ``ellipsoid``: (3,) half axes [m] of an ellipsoid around each vehicle, or ``crazyswarm`` or
      ``crazyflie-firmware``; they scale separations and delta.
    * ``cylinder``: (2,) horizontal and vertical distance [m]; a pair is too near only if it is below both at once.
    * ``well_clear``: ``do-365``, ``f3442``, or (3,) horizontal distance [m], vertical distance [m], modified tau [s].
    * ``rules``: origin of limits that no argument sets: ``recording``, ``skybrush`` or ``none``.
    * ``motion``: motion between samples: ``linear``, ``hold``, ``polynomial``, or ``bounded`` by ``max_accel`` [m/s^2].
    * ``obstacles``: TOML file of obstacles.
    * ``limit``: limits on single vehicles, such as ``{"speed": 5, "climb": 2}`` [m/s], ``accel`` [m/s^2], ``height``
      [m].
    * ``accel_window``: ``accel`` then limits means over windows of this length [s].
    * ``fence``: TOML file of a region that no vehicle may leave.
    * ``plan``: file of the plan, whose curves are compared with the flight, vehicle by vehicle.
    * ``plan_delay``: time of the flight at which the plan has time 0 [s], estimated unless given.
    * ``tube``: largest allowed distance from the plan [m].
    * ``config``: ``tautline.toml`` with defaults for arguments that are not given. For a recording the default is the
      ``tautline.toml`` beside it. False reads no file.
    * ``from_s``, ``until_s``: window of the audit [s].
    * ``above``: leaves out pairs of vehicles while both are at or below this height [m].
    * ``land_on``: names of obstacles on which vehicles land: left out for a vehicle at or below ``above``.
    * ``ids``: names of the vehicles to audit.
    * ``offset``: clock corrections by name [s].
    * ``expect_vehicles``: number of vehicles; another number is an error.
    * ``max_gap``: longest interval between two samples that is not a gap [s].
    * ``require_presence``: the audit is undecided where a vehicle is not seen over the whole window.
    * ``independent``: audits a recording of a flight from its samples, without the run's own audit.

    Raises ``TypeError`` for numbers that are no float64, ``FileNotFoundError`` for a missing file and :class:`Error`
    for other wrong input. docs/audit.md explains the verdicts.
    """
    return perform(t, positions, options)


def signature() -> inspect.Signature:
    """Returns the signature of :func:`audit` with all keyword arguments of an audit and of arrays."""
    keyword, no = inspect.Parameter.KEYWORD_ONLY, ("require_presence", "independent")
    named = [
        inspect.Parameter(name, keyword, default=False if name in no else None, annotation=kind.__forward_arg__)
        for name, kind in AuditOptions.__annotations__.items()
    ]
    given = inspect.signature(audit).parameters
    read_as = given["options"].replace(name="read_as", annotation="Unpack[ReadOptions]")
    return inspect.Signature([given["t"], given["positions"], *named, read_as], return_annotation="Audit")


audit.__signature__ = signature()  # type: ignore[attr-defined]


def perform(
    t: object,
    positions: object,
    arguments: Mapping[str, Any],
    findings: _native.FlightFindings | None = None,
) -> Audit:
    """Audits with the arguments of :func:`audit`, those of a flight with the findings of its run."""
    found = performed(t, positions, arguments, findings)
    if arguments.get("offset"):
        # The samples have other times than the findings.
        found._tracks = lambda: None
    return found


def performed(
    t: object, positions: object, arguments: Mapping[str, Any], findings: _native.FlightFindings | None
) -> Audit:
    """Audits with the arguments of :func:`perform`."""
    options = {name: check(arguments[name], name) for name, check in CHECKS.items() if name in arguments}
    names, velocities = arguments.get("names"), arguments.get("velocities")
    read_as = {name: arguments[name] for name in arguments if name not in AuditOptions.__annotations__}
    if unknown := [word for word in read_as if word not in ReadOptions.__annotations__]:
        raise TypeError(f"audit() got an unexpected keyword argument '{unknown[0]}'")
    given = {name: value for name, value in options.items() if value is not None}
    given = {name: value for name, value in given.items() if value is not False or name == "config"}
    if "plan" not in given and ("plan_delay" in given or "tube" in given):
        raise TypeError("plan_delay, tube: only with a plan")
    if given.get("ids") == []:
        raise Error("ids: no vehicle is named; leave it out to audit all")
    has_no_config = given.get("config") is False
    question = _native.AuditOptions(
        **{name: value for name, value in given.items() if value is not False}, no_config=has_no_config
    )
    files = [str(given[name]) for name in FILES if given.get(name)]
    # An iterator of names is exhausted.
    shown = {name: value if isinstance(value, list) else arguments[name] for name, value in given.items()} | read_as
    if positions is None:
        has_arrays = velocities is not None or names is not None
        if not isinstance(t, np.ndarray) and is_frame(t):
            return audit_frame(question, call_text("table", shown), t, read_as, files, has_arrays)
        return audit_files(question, call_text(repr(t), shown), t, read_as, files, has_arrays)
    if isinstance(t, (str, os.PathLike)):
        raise TypeError("t: times are needed beside positions, or a path alone")
    seconds = to_seconds(t)
    times, places = exact_array(t, "t") if seconds is None else seconds, exact_array(positions, "positions")
    speeds = None if velocities is None else exact_array(velocities, "velocities")
    layout = read_as.pop("layout", None)
    if layout is not None:
        places = transposed(places, layout)
        speeds = None if speeds is None else transposed(speeds, layout)
    if read_as:
        raise TypeError(f"{', '.join(read_as)}: only for files, but arrays are given")
    command = call_text("t, positions", shown)
    return with_files(files, lambda: audit_arrays(question, command, times, places, speeds, names, findings))


def call_text(first: str, options: Mapping[str, Any]) -> str:
    """Returns the call that repeats an audit, for a page."""
    return f"tautline.audit({first}{''.join(f', {name}={value!r}' for name, value in options.items())})"


def transposed(array: NDArray[np.float64], layout: str) -> NDArray[np.float64]:
    """Returns a view (T, N, 3) of an array with the axes of a layout, such as ``time,axis,vehicle``."""
    usual = ("time", "vehicle", "axis")
    axes = layout.split(",")
    if sorted(axes) != sorted(usual):
        raise Error(f"layout: must list time, vehicle and axis, such as 'time,axis,vehicle', got '{layout}'")
    if array.ndim != len(usual):
        raise TypeError("layout: needs an array with three axes")
    return array.transpose([axes.index(axis) for axis in usual])


def audit_files(
    question: _native.AuditOptions,
    command: str,
    t: object,
    read_as: Mapping[str, Any],
    more_files: list[str],
    has_arrays: bool,
) -> Audit:
    if isinstance(t, np.ndarray):
        raise TypeError("positions: an array (T, N, 3) is needed beside the times, or a path in their place")
    if has_arrays:
        raise TypeError(NO_ARRAYS)
    if not isinstance(t, (str, os.PathLike, list, tuple)):
        raise TypeError(f"t: a path, a table, or times beside positions are needed, not {type(t).__name__}")
    files, options = single_recording(paths(t, "t"), read_as), read_options(**read_as)

    def repeat(html: str | None = None) -> Outcome:
        return with_files(files + more_files, lambda: _native.audit_files(question, command, files, options, html))

    return Audit.__new__(Audit)._restore(repeat(), repeat, lambda: recorded_tracks(files, options))


def audit_frame(
    question: _native.AuditOptions,
    command: str,
    frame: object,
    read_as: Mapping[str, Any],
    files: list[str],
    has_arrays: bool,
) -> Audit:
    if has_arrays:
        raise TypeError(NO_ARRAYS)
    if boolean(read_as.get("join", False), "join"):
        raise TypeError("join: only for files, but a table is given")
    options, table = read_options(**read_as), ParquetFrame(frame)

    def repeat(html: str | None = None) -> Outcome:
        path = str(table.path)
        try:
            return with_files(files, lambda: _native.audit_table(question, command, path, options, html))
        except Error as error:
            # The temporary file is no file of the caller.
            error.args = (str(error).replace(path, "table"),)
            raise

    return Audit.__new__(Audit)._restore(repeat(), repeat, lambda: recorded_tracks([str(table.path)], options))


def audit_arrays(
    question: _native.AuditOptions,
    command: str,
    t: NDArray[np.float64],
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64] | None,
    names: Sequence[str] | None,
    findings: _native.FlightFindings | None,
) -> Audit:
    count = positions.shape[1] if positions.ndim == 3 else 0
    vehicles = [str(number) for number in range(1, count + 1)] if names is None else name_list(names, "names")
    if len(set(vehicles)) < len(vehicles):
        raise Error("names: two vehicles have the same name")

    def repeat(html: str | None = None) -> Outcome:
        return _native.audit_arrays(question, command, t, positions, velocities, vehicles, findings, html)

    def tracks() -> Tracks:
        seen: NDArray[np.bool_] = np.all(np.isfinite(positions), axis=2)
        return {name: (t[seen[:, k]], positions[seen[:, k], k]) for k, name in enumerate(vehicles)}

    return Audit.__new__(Audit)._restore(repeat(), repeat, tracks)


def recorded_tracks(files: list[str], options: _native.ReadOptions) -> Tracks | None:
    """Returns the samples of a recording; None for curves, and where it cannot be read again."""
    try:
        columns = _native.read(files, options)
    except Error:
        return None
    if len(columns.piece_vehicle):
        return None
    of_vehicle = [columns.vehicle == number for number in range(len(columns.vehicles))]
    samples = [(columns.t[rows], columns.position[rows]) for rows in of_vehicle]
    return dict(zip(columns.vehicles, samples, strict=True))


def unpickle(*pickled: Any) -> Audit:
    """Returns an audit of another process, which cannot be repeated. Raises :class:`Error` for damaged bytes."""
    outcome = unsealed("Audit", *pickled)

    def repeat(html: str | None = None) -> Outcome:
        raise Error("to_html: a pickled or copied audit has no recording; write the page with the audit itself")

    return Audit.__new__(Audit)._restore((*outcome,), repeat)
