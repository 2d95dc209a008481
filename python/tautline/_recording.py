"""Recordings of any format as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._arguments import PathLike, ReadOptions, number, paths, read_options, single_recording, with_files
from ._audit import Audit, AuditOptions, audit
from ._native import Error
from ._pickles import sealed, unsealed
from ._tables import Column, Table

if TYPE_CHECKING:
    from typing_extensions import Unpack

#: An interval longer than this many usual intervals is a gap, as in an audit.
GAP_FACTOR = 1.5
#: Names of the columns of a recording in memory, which pickles hold.
COLUMNS = (
    "vehicles", "notes", "planar", "unit", "epoch_ns", "vehicle", "t", "position", "velocity", "radius",
    "piece_vehicle", "piece_span", "piece_coefficients",
)  # fmt: skip
#: Largest array of positions: 2 GiB.
MAX_NUMBERS = 2**28


class Recording(Table):
    """A recording in memory: samples and curves of vehicles. :func:`read` returns it. It can be pickled.

    As a table it has a row for each sample in order of time. Its columns are the time ``t``, the name ``id`` of the
    vehicle, its ``index`` from 0, and the axes of positions, `x, y, z` (z unless planar). Velocities, `vx, vy, vz`, and
    ``radius`` follow where they are known. Curves have no rows.
    """

    def __init__(self, files: list[str], read_as: ReadOptions) -> None:
        self._files, self._read_as = single_recording(files, read_as), read_as
        options = read_options(**read_as)
        columns = with_files(files, lambda: _native.read(files, options))
        self._data = SimpleNamespace(**{name: getattr(columns, name) for name in COLUMNS})

    @property
    def vehicles(self) -> list[str]:
        """Names of the vehicles."""
        return list(self._data.vehicles)

    @property
    def notes(self) -> list[str]:
        """Notes on how the recording was read, a sentence each."""
        return list(self._data.notes)

    @property
    def is_planar(self) -> bool:
        """Whether the height of a vehicle is unknown; z is then 0 everywhere and has no meaning."""
        return bool(self._data.planar)

    @property
    def epoch_ns(self) -> int:
        """Epoch that was subtracted from all times, so that clocks in nanoseconds keep their digits [ns]."""
        return int(self._data.epoch_ns)

    @property
    def has_curves(self) -> bool:
        """Whether the motion of a vehicle is given by curves."""
        return len(self._data.piece_vehicle) > 0

    def to_numpy(
        self, hz: float | None = None, *, max_gap_s: float | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns times (T,) [s] and positions (T, N, 3) [m] in the order of ``vehicles``. NaN means not seen.

        Without ``hz`` the instants are those of the recording, without rounding. With ``hz`` they are regular from
        the first instant on. Positions then lie on straight lines between samples, or on curves. They are NaN within
        intervals longer than ``max_gap_s``, by default 1.5 times the vehicle's usual interval.

        Raises :class:`Error` for curves without ``hz``, for a rate that is not positive, and for arrays that are too
        large.
        """
        if max_gap_s is not None and not max_gap_s >= 0:
            raise Error(f"max_gap_s: must be 0 s or more, got {max_gap_s}")
        if hz is None:
            return self._as_recorded()
        hz = number(hz, "hz")
        if not (np.isfinite(hz) and hz > 0):
            raise Error(f"hz: must be positive and finite, got {hz}")
        columns = self._data
        starts = [*columns.t[:1], *columns.piece_span[:, 0]]
        ends = [*columns.t[-1:], *columns.piece_span[:, 1]]
        if not starts:
            return np.empty(0), np.empty((0, len(self.vehicles), 3))
        span_s = max(ends) - min(starts)
        if span_s * hz * max(1, 3 * len(self.vehicles)) > MAX_NUMBERS:
            raise Error(f"hz: {hz} gives {span_s * hz:.3g} instants; give a lower rate")
        t = min(starts) + np.arange(int(np.floor(span_s * hz + 1e-9)) + 1) / hz
        positions = np.full((len(t), len(self.vehicles), 3), np.nan)
        for vehicle in range(len(self.vehicles)):
            self._interpolate(vehicle, t, positions[:, vehicle], max_gap_s)
            self._evaluate(vehicle, t, positions[:, vehicle])
        return t, positions

    def _as_recorded(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.has_curves:
            raise Error("the recording has curves; give a sampling rate, hz=")
        columns = self._data
        t, instant = np.unique(columns.t, return_inverse=True)
        if len(t) * 3 * len(self.vehicles) > MAX_NUMBERS:
            size = f"{len(t)} instants of {len(self.vehicles)} vehicles, mostly without a position"
            raise Error(f"the samples of vehicles have different times: {size}; give hz=")
        positions = np.full((len(t), len(self.vehicles), 3), np.nan)
        positions[instant, columns.vehicle] = columns.position
        return t, positions

    def _interpolate(
        self, vehicle: int, t: NDArray[np.float64], out: NDArray[np.float64], max_gap_s: float | None
    ) -> None:
        own = self._data.vehicle == vehicle
        seen_s, position = self._data.t[own], self._data.position[own]
        if len(seen_s) == 0:
            return
        interval_s = np.diff(seen_s)
        if max_gap_s is None:
            usual = np.sort(interval_s)[(len(interval_s) - 1) // 2] if len(interval_s) else 0.0
            max_gap_s = GAP_FACTOR * usual
        after = np.searchsorted(seen_s, t, side="left").clip(0, len(seen_s) - 1)
        is_seen = (t >= seen_s[0]) & (t <= seen_s[-1])
        exact = seen_s[after] == t
        if len(interval_s):
            is_seen &= exact | (interval_s[np.maximum(after, 1) - 1] <= max_gap_s)
        for axis in range(3):
            out[is_seen, axis] = np.interp(t[is_seen], seen_s, position[:, axis])

    def _evaluate(self, vehicle: int, t: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        columns = self._data
        for piece in np.flatnonzero(columns.piece_vehicle == vehicle):
            from_s, to_s = columns.piece_span[piece]
            within = (t >= from_s) & (t <= to_s)
            since = (t[within] - from_s)[:, None]
            at = np.zeros((int(within.sum()), 3))
            for coefficient in columns.piece_coefficients[piece][::-1]:
                at = at * since + coefficient
            out[within] = at

    def _columns(self) -> dict[str, Column]:
        if self.has_curves:
            raise Error("the recording has curves, which have no rows; use to_numpy(hz=...)")
        columns = self._data
        names = np.array(self.vehicles, dtype=object)[columns.vehicle]
        rows: dict[str, Column] = {"t": (columns.t, float), "id": (names, str), "index": (columns.vehicle, int)}
        letters = "xy" if self.is_planar else "xyz"
        for axis, letter in enumerate(letters):
            rows[letter] = columns.position[:, axis], float
        if not np.isnan(columns.velocity).all():
            rows |= {f"v{letter}": (columns.velocity[:, axis], float) for axis, letter in enumerate(letters)}
        if not np.isnan(columns.radius).all():
            rows["radius"] = columns.radius, float
        return rows

    def audit(self, **options: Unpack[AuditOptions]) -> Audit:
        """Audits the recording's files with :func:`tautline.audit`, with the same options of reading."""
        return audit(self._files, **self._read_as, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return unpickle_recording, sealed(self._files, self._read_as, vars(self._data))

    def __len__(self) -> int:
        return len(self.vehicles)

    def __bool__(self) -> bool:
        return True

    def _repr_html_(self) -> str:
        t = [*self._data.t[:1], *self._data.t[-1:], *self._data.piece_span.ravel()]
        rows = [
            ("vehicles", str(len(self))),
            ("samples", str(len(self._data.t))),
            ("pieces of curves", str(len(self._data.piece_vehicle))),
            ("time", f"{min(t):.6g} s to {max(t):.6g} s" if t else "-"),
            *(("note", note) for note in self.notes),
        ]
        return _display.make_card("open", ", ".join(self._files), rows)

    def __repr__(self) -> str:
        columns = self._data
        size = f"{len(columns.piece_vehicle)} pieces of curves" if self.has_curves else f"{len(columns.t)} samples"
        return f"<Recording {', '.join(self._files)}: {len(self)} vehicles, {size}>"


def read(recording: PathLike | Sequence[PathLike], **read_as: Unpack[ReadOptions]) -> Recording:
    """Reads a recording of any format into memory.

    It is a file or folder, or with ``join=True`` a list of files with one vehicle each.
    The options of reading are those of :func:`tautline.audit`. Raises ``FileNotFoundError`` for a missing file and
    :class:`Error`, with file, place, value and remedy, for a file that cannot be read.
    """
    return Recording(paths(recording, "recording"), read_as)


def unpickle_recording(*pickled: Any) -> Recording:
    """Returns the recording of another process. Raises :class:`Error` for damaged bytes."""
    files, read_as, columns = unsealed("Recording", *pickled)
    recording = Recording.__new__(Recording)
    recording._files, recording._read_as, recording._data = files, read_as, SimpleNamespace(**columns)
    return recording
