"""Recordings of any format as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._arguments import PathLike, paths, read_options, single_recording, with_files
from ._audit import Audit, audit
from ._native import Error
from ._tables import to_frame

if TYPE_CHECKING:
    import pandas

#: An interval longer than this many usual intervals is a gap, as in an audit.
GAP_FACTOR = 1.5
#: Largest array of positions: 2 GiB.
MAX_NUMBERS = 2**28


class Recording:
    """A recording in memory: samples and curves of vehicles."""

    def __init__(self, files: list[str], read_as: dict[str, Any]) -> None:
        self._files, self._read_as = single_recording(files, read_as), read_as
        options = read_options(**read_as)
        self._columns = with_files(files, lambda: _native.read(files, options))

    @property
    def vehicles(self) -> list[str]:
        """Names of the vehicles."""
        return self._columns.vehicles

    @property
    def notes(self) -> list[str]:
        """Notes on how the recording was read, a sentence each."""
        return self._columns.notes

    @property
    def is_planar(self) -> bool:
        """Whether the height of a vehicle is unknown; z is then 0 everywhere and has no meaning."""
        return self._columns.planar

    @property
    def epoch_ns(self) -> int:
        """Epoch that was subtracted from all times, so that clocks in nanoseconds keep their digits [ns]."""
        return self._columns.epoch_ns

    @property
    def has_curves(self) -> bool:
        """Whether the motion of a vehicle is given by curves."""
        return len(self._columns.piece_vehicle) > 0

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
        if isinstance(hz, bool) or not isinstance(hz, (int, float, np.integer, np.floating)):
            raise TypeError(f"hz: a number is needed, not {type(hz).__name__}")
        if not (np.isfinite(hz) and hz > 0):
            raise Error(f"hz: must be positive and finite, got {hz}")
        columns = self._columns
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
        columns = self._columns
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
        own = self._columns.vehicle == vehicle
        seen_s, position = self._columns.t[own], self._columns.position[own]
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
        columns = self._columns
        for piece in np.flatnonzero(columns.piece_vehicle == vehicle):
            from_s, to_s = columns.piece_span[piece]
            within = (t >= from_s) & (t <= to_s)
            since = (t[within] - from_s)[:, None]
            at = np.zeros((int(within.sum()), 3))
            for coefficient in columns.piece_coefficients[piece][::-1]:
                at = at * since + coefficient
            out[within] = at

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table with a row for each sample in order of time. Imports pandas.

        Its columns are ``t``, ``id`` and the axes of positions: ``x``, ``y``, ``z`` (unless planar). Those of
        velocities and ``radius`` follow where known. Raises :class:`Error` for curves.
        """
        if self.has_curves:
            raise Error("the recording has curves, which have no rows; use to_numpy(hz=...)")
        columns = self._columns
        rows: dict[str, Any] = {"t": columns.t, "id": np.array(self.vehicles, dtype=object)[columns.vehicle]}
        letters = "xy" if self.is_planar else "xyz"
        for axis, letter in enumerate(letters):
            rows[letter] = columns.position[:, axis]
        if not np.isnan(columns.velocity).all():
            rows |= {f"v{letter}": columns.velocity[:, axis] for axis, letter in enumerate(letters)}
        if not np.isnan(columns.radius).all():
            rows["radius"] = columns.radius
        return to_frame(rows)

    def audit(self, **options: Any) -> Audit:
        """Audits the recording's files with :func:`tautline.audit`, with the same options of reading."""
        return audit(self._files, **{**self._read_as, **options})

    def __len__(self) -> int:
        return len(self.vehicles)

    def __bool__(self) -> bool:
        return True

    def _repr_html_(self) -> str:
        t = [*self._columns.t[:1], *self._columns.t[-1:], *self._columns.piece_span.ravel()]
        rows = [
            ("vehicles", str(len(self))),
            ("samples", str(len(self._columns.t))),
            ("pieces of curves", str(len(self._columns.piece_vehicle))),
            ("time", f"{min(t):.6g} s to {max(t):.6g} s" if t else "-"),
            *(("note", note) for note in self.notes),
        ]
        return _display.make_card("open", ", ".join(self._files), rows)

    def __repr__(self) -> str:
        columns = self._columns
        size = f"{len(columns.piece_vehicle)} pieces of curves" if self.has_curves else f"{len(columns.t)} samples"
        return f"<Recording {', '.join(self._files)}: {len(self)} vehicles, {size}>"


def read(recording: PathLike | Sequence[PathLike], **read_as: Any) -> Recording:
    """Reads a recording of any format into memory.

    It is a file or folder, or with ``join=True`` a list of files with one vehicle each.
    The options of reading are those of :func:`tautline.audit`. Raises ``FileNotFoundError`` for a missing file and
    :class:`Error`, with file, place, value and remedy, for a file that cannot be read.
    """
    return Recording(paths(recording, "recording"), read_as)
