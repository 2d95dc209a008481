"""Audits: did any two vehicles come closer than they may, between samples too?"""

from __future__ import annotations

import functools
import inspect
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._native import Error
from ._tables import Findings
from ._words import (
    PathLike,
    by_vehicle,
    flag,
    listed,
    maybe,
    maybe_count,
    maybe_path,
    of_vehicles,
    one_recording,
    path,
    paths,
    reading,
    text,
    three,
    with_files,
)

Judged = tuple[str, str, str, str]

#: Arguments of a question, in the order in which a page repeats them.
SHOWN = (
    "delta", "motion", "max_accel", "radius", "ellipsoid", "obstacles", "limit", "fence", "accel_window", "config", "from_s",
    "to_s", "above", "ids", "offset", "expect_vehicles", "max_gap", "require_presence", "independent",
)  # fmt: skip


class ViolationError(Error):
    """A judgement that is not clear, where clear was asked for; ``audit`` is the judgement."""

    def __init__(self, judgement: Audit) -> None:
        super().__init__(judgement.headline)
        self.audit = judgement

    def __reduce__(self) -> tuple[type[ViolationError], tuple[Audit]]:
        return ViolationError, (self.audit,)


class Audit:
    """What the judge says of a recording."""

    #: ``PROVED CLEAR``, ``PROVED CLEAR by the run's audit of every step``, ``CLEAR if straight between samples`` (or as was asked),
    #: ``VIOLATION`` or ``UNDECIDED``.
    verdict: str
    #: The verdict and what it rests on, in a line.
    headline: str
    #: The summary that the command line prints.
    text: str

    def __init__(self, judged: Judged, again: Callable[..., Judged]) -> None:
        self.verdict, self.headline, self.text, self._json = judged
        self._again = again

    @functools.cached_property
    def _report(self) -> dict[str, Any]:
        report: dict[str, Any] = json.loads(self._json)
        return report

    @property
    def status(self) -> str:
        """``clear``, ``violation`` or ``undecided``, as in the JSON."""
        return str(self._report["status"])

    @property
    def is_clear(self) -> bool:
        """Whether nothing came too close: proved, or as assumed between samples."""
        return self.status == "clear"

    @property
    def is_proved(self) -> bool:
        """Whether it is clear and nothing was assumed of the time between samples."""
        return bool(self._report["audit"]["proved"])

    @property
    def assumes(self) -> str | None:
        """What was assumed of the motion between samples; None where the recording says it itself."""
        assumed: str | None = self._report["audit"]["assumes"]
        return assumed

    @property
    def is_planar(self) -> bool:
        """Whether the height of some vehicle is not known: distances and speeds are those in the plane of x and y then."""
        return bool(self._report["planar"])

    @property
    def delta_m(self) -> float | None:
        """The safety distance asked about [m] (a scaled distance with an ellipsoid); None where radii alone were."""
        delta: float | None = self._report["separation"]["delta_m"]
        return delta

    @property
    def separation_m(self) -> float | None:
        """The smallest distance of two vehicles [m] (scaled with an ellipsoid), of curves and bounds a lower bound of it; None
        where there never were two."""
        smallest: float | None = self._report["separation"]["min_m"]
        return smallest

    @property
    def closest(self) -> Findings:
        """The ten closest pairs: ``pair``, ``lower_m``, ``upper_m``, ``time_s``, ``limit_m``."""
        return Findings(self._report["closest"])

    @property
    def violations(self) -> Findings:
        """Violations in order of time, of many the worst and the first of each pair: ``pair``, ``from_s``, ``to_s``, ``min_m``, ``min_at_s``, ``limit_m``."""
        return Findings(self._report["violations"])

    @property
    def undecided(self) -> Findings:
        """When it cannot be told: ``pair``, ``from_s``, ``to_s``, ``lower_m``, ``upper_m``, ``limit_m``, ``rate_hz``."""
        return Findings(self._report["undecided"])

    @property
    def gaps(self) -> Findings:
        """When vehicles were not seen: ``vehicle``, ``from_s``, ``to_s``."""
        return Findings(self._report["gaps"])

    @property
    def ended_early(self) -> dict[str, Any] | None:
        """Where a flight ended before its time: ``at_s``, ``duration_s`` of the scenario and ``reason``. None where what was asked about
        was flown."""
        end: dict[str, Any] | None = self._report["ended_early"]
        return end

    @property
    def obstacles(self) -> Findings:
        """The closest approaches to obstacles: as :attr:`closest`."""
        return Findings(self._report["obstacles"]["closest"])

    @property
    def limits(self) -> Findings:
        """What vehicles did by themselves, where ``limit`` or ``fence`` asked: each limit with its verdict, as in the JSON."""
        return Findings(self._report["limits"])

    @property
    def vehicles(self) -> list[str]:
        """Names of the vehicles."""
        return list(self._report["vehicles"])

    @property
    def notes(self) -> list[str]:
        """What should be known of how it was read, a sentence each."""
        return list(self._report["notes"])

    def to_dict(self) -> dict[str, Any]:
        """Everything that ``tautline audit --json`` prints."""
        report: dict[str, Any] = json.loads(self._json)
        return report

    def to_html(self, file: PathLike) -> None:
        """Writes the report for people, with figures. The recording is judged again for them.

        Raises :class:`Error` where it has changed since, and leaves the file as it is; ``OSError`` where it cannot be written.
        """
        changed = "the recording is not what it was when it was judged: audit it again"
        page = path(file, "file")
        # At first without a page: that of another verdict must not take the place of this one's.
        if self._again()[3] != self._json:
            raise Error(changed)
        if self._again(page)[3] != self._json:
            raise Error(f"{changed}; {page} is of what it has become")

    def raise_for_violation(self, allow_undecided: bool = False) -> None:
        """Raises :class:`ViolationError` unless it is clear: of a violation, and of what cannot be told unless that is allowed."""
        if not (self.is_clear or (allow_undecided and self.status == "undecided")):
            raise ViolationError(self)

    def __bool__(self) -> bool:
        raise TypeError("an audit is neither true nor false: ask is_clear, or call raise_for_violation()")

    def __reduce__(self) -> tuple[Callable[..., Audit], tuple[Judged]]:
        return elsewhere, ((self.verdict, self.headline, self.text, self._json),)

    def __repr__(self) -> str:
        return f"<Audit {self.headline}>"

    def __str__(self) -> str:
        return f"{self.headline}\n{self.text}"

    def _repr_html_(self) -> str:
        tone = {"clear": "good", "violation": "bad"}.get(self.status, "open")
        closest = self._report["closest"]
        rows = [
            ("finding", self.headline.partition(": ")[2]),
            ("vehicles judged", str(self._report["judged"])),
            *((kind, str(self._report["findings"][kind]["count"])) for kind in ("violations", "undecided", "gaps")),
        ]
        drawing = _display.bars(
            [" ".join(near["who"]) for near in closest],
            [near["lower_m"] for near in closest],
            [near["limit_m"] for near in closest],
            "Smallest distances of the closest pairs, and their limits",
        )
        return _display.card(tone, self.verdict, rows, drawing)


def audit(
    t: NDArray[np.float64] | PathLike | Sequence[PathLike],
    positions: NDArray[np.float64] | None = None,
    *,
    delta: float | None = None,
    velocities: NDArray[np.float64] | None = None,
    names: Sequence[str] | None = None,
    motion: str | None = None,
    max_accel: float | Mapping[str, float] | None = None,
    radius: float | Mapping[str, float] | None = None,
    ellipsoid: Sequence[float] | None = None,
    obstacles: PathLike | None = None,
    limit: Mapping[str, float] | None = None,
    fence: PathLike | None = None,
    accel_window: float | None = None,
    config: PathLike | Literal[False] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    above: float | None = None,
    ids: Iterable[str] | None = None,
    offset: Mapping[str, float] | None = None,
    expect_vehicles: int | None = None,
    max_gap: float | None = None,
    require_presence: bool = False,
    independent: bool = False,
    _seen: _native.Seen | None = None,
    **read_as: Any,
) -> Audit:
    """Judges positions over time, of arrays or of a recording of any format.

    ``tl.audit(t, positions, delta=1.5)``: ``t`` (T,) times [s], ``positions`` (T, N, 3) or (T, N, 2) [m], both float64 in any
    order of memory, or laid out as ``layout`` says (``"time,axis,vehicle"``); they are borrowed, not copied, and must not be written to until this returns. NaN in every axis: the
    vehicle was not seen; ``notes`` names whoever was not seen from the first instant to the last. ``velocities`` (T, N, 3) [m/s] sharpen ``motion="bounded"``; ``names`` are N names, else numbers from 1.

    ``tl.audit("flight.mcap")``: a file or folder, or with ``join=True`` a list of files with a vehicle each. ``read_as`` says how
    it is read: ``format``, ``time_unit``, ``fps``, ``time_scale``, ``sort``, ``duplicates``, ``one_vehicle``, ``scale``, ``axes``, ``dimensions``, ``column``, ``start``, ``layout``,
    ``frame``, ``topic``, ``origin``, ``allow_unfinished``.

    ``delta`` [m] is the safety distance between two centres; ``radius`` [m] of all vehicles, or by name: two must keep
    max(delta, r1 + r2). ``ellipsoid`` (3,) [m] are half axes of what must stay empty, with delta scaled by them. ``motion`` says what
    happens between samples: ``linear``, ``hold``, ``polynomial``, ``bounded`` (with ``max_accel`` [m/s^2]). ``obstacles`` is a TOML
    file. ``limit`` asks what each may do by itself: ``{"speed": 5, "climb": 2}`` [m/s], ``accel`` [m/s^2] (with ``accel_window`` [s] its mean over windows of that
    length), ``height`` [m]; ``fence`` is a TOML file of
    what each must stay within. Of a file, ``config`` is a ``tautline.toml`` that fills what is not asked here; the one beside the
    recording unless given, and none where it is False. ``from_s``, ``to_s`` [s] are the window that is judged, ``above`` [m] leaves out pairs on the ground, ``ids`` names who is
    judged, ``offset`` [s] corrects clocks by name, ``max_gap`` [s] is the longest time between samples that is no gap. With ``require_presence`` it is undecided where a vehicle is not seen over the
    whole window; with ``independent`` a recording of a flight is judged by its samples alone.

    Raises ``TypeError`` for a wrong dtype, ``FileNotFoundError`` for a missing file and :class:`Error` for anything else that is
    wrong with the input. docs/audit.md says what each verdict means.
    """
    ids = None if ids is None else listed(ids, "ids")
    asked = shown(locals()) | read_as
    if unknown := [word for word in read_as if word not in inspect.signature(reading).parameters]:
        raise TypeError(f"audit() got an unexpected keyword argument '{unknown[0]}'")
    if ids is not None and not ids:
        raise Error("ids: no vehicle is named; leave it out to judge all")
    # Beside arrays there is no folder to find a file of settings in.
    looks_for_config = config is None and positions is None
    question = _native.Question(
        delta=maybe(delta, "delta"),
        motion=text(motion, "motion"),
        max_accel=of_vehicles(max_accel, "max_accel"),
        radius=of_vehicles(radius, "radius"),
        ellipsoid=three(ellipsoid, "ellipsoid"),
        obstacles=maybe_path(obstacles, "obstacles"),
        limit=by_vehicle(limit, "limit"),
        fence=maybe_path(fence, "fence"),
        accel_window=maybe(accel_window, "accel_window"),
        config=None if config is False else maybe_path(config, "config"),
        has_config=looks_for_config,
        from_s=maybe(from_s, "from_s"),
        to_s=maybe(to_s, "to_s"),
        above=maybe(above, "above"),
        ids=ids,
        offset=by_vehicle(offset, "offset"),
        expect_vehicles=maybe_count(expect_vehicles, "expect_vehicles"),
        max_gap=maybe(max_gap, "max_gap"),
        require_presence=flag(require_presence, "require_presence"),
        independent=flag(independent, "independent"),
    )
    given = [os.fspath(file) for file in (obstacles, fence, None if config is False else config) if file is not None]
    if positions is None:
        return of_files(question, call(repr(t), asked), t, read_as, given, velocities is not None or names is not None)
    layout = read_as.pop("layout", None)
    if layout is not None:
        positions, velocities = (of if of is None else laid_out(of, layout) for of in (positions, velocities))
    if read_as:
        raise TypeError(f"{', '.join(read_as)}: says how a file is read, and arrays are given")
    command = call("t, positions", asked)
    return with_files(given, lambda: of_arrays(question, command, t, positions, velocities, names, _seen))


def shown(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of a question that are given."""
    given = {name: arguments[name] for name in SHOWN if arguments[name] is not None}
    return {name: value for name, value in given.items() if value is not False or name == "config"}


def call(first: str, asked: Mapping[str, Any]) -> str:
    """The call that judges again, for a page."""
    return f"tautline.audit({first}{''.join(f', {name}={value!r}' for name, value in asked.items())})"


def laid_out(array: NDArray[np.float64], layout: str) -> NDArray[np.float64]:
    """A view (T, N, 3) of an array whose axes count these, such as ``time,axis,vehicle``."""
    usual = ("time", "vehicle", "axis")
    axes = layout.split(",")
    if sorted(axes) != sorted(usual):
        raise Error(f"layout: '{layout}' is not time, vehicle and axis between commas, such as 'time,axis,vehicle'")
    if not isinstance(array, np.ndarray) or array.ndim != len(usual):
        raise TypeError("layout: it says what the three axes of an array count")
    return array.transpose([axes.index(axis) for axis in usual])


def of_files(
    question: _native.Question, command: str, t: object, read_as: Mapping[str, Any], beside: list[str], has_more: bool
) -> Audit:
    if isinstance(t, np.ndarray):
        raise TypeError("positions: an array (T, N, 3) is needed beside the times, or a path in their place")
    if has_more:
        raise TypeError("velocities and names belong to arrays, and a recording is given")
    files, options = one_recording(paths(t, "t"), read_as), reading(**read_as)

    def judged(html: str | None = None) -> Judged:
        return with_files(files + beside, lambda: _native.audit_files(question, command, files, options, html))

    return Audit(judged(), judged)


def of_arrays(
    question: _native.Question,
    command: str,
    t: Any,
    positions: Any,
    velocities: Any,
    names: Sequence[str] | None,
    seen: _native.Seen | None = None,
) -> Audit:
    if isinstance(t, (str, os.PathLike)):
        raise TypeError("t: times are needed beside positions, or a path alone")
    count = positions.shape[1] if isinstance(positions, np.ndarray) and positions.ndim == 3 else 0
    called = [str(number) for number in range(1, count + 1)] if names is None else listed(names, "names")
    if len(set(called)) < len(called):
        raise Error("names: two vehicles have the same name")

    def judged(html: str | None = None) -> Judged:
        return _native.audit_arrays(question, command, t, positions, velocities, called, seen, html)

    return Audit(judged(), judged)


def elsewhere(judged: Judged) -> Audit:
    """A judgement that was made in another process, or before."""

    def again(html: str | None = None) -> Judged:
        raise Error("what was judged is not at hand here: write the page where it was judged")

    return Audit(judged, again)
