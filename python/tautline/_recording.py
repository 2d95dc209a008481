"""Recordings of any format as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._audit import Audit, audit
from ._native import Error
from ._tables import frame
from ._words import PathLike, one_recording, paths, reading, with_files

if TYPE_CHECKING:
    import pandas

#: An interval longer than so many usual ones is a gap, as the judge has it.
GAP_OVER_USUAL = 1.5
#: Most numbers that are made of a recording: 2 GiB.
MOST_NUMBERS = 2**28


class Recording:
    """A recording in memory: who was seen where and when."""

    def __init__(self, files: list[str], read_as: dict[str, Any]) -> None:
        self._files, self._read_as = one_recording(files, read_as), read_as
        options = reading(**read_as)
        self._columns = with_files(files, lambda: _native.read(files, options))

    @property
    def vehicles(self) -> list[str]:
        """Names of the vehicles."""
        return self._columns.vehicles

    @property
    def notes(self) -> list[str]:
        """What should be known of how it was read, a sentence each."""
        return self._columns.notes

    @property
    def is_planar(self) -> bool:
        """Whether the height of some vehicle is not known: z is 0 everywhere then and has no meaning."""
        return self._columns.planar

    @property
    def epoch_ns(self) -> int:
        """What was taken from every time, so that no digit of a clock in nanoseconds is lost [ns]."""
        return self._columns.epoch_ns

    @property
    def has_curves(self) -> bool:
        """Whether some of the motion is curves and not samples."""
        return len(self._columns.piece_vehicle) > 0

    def to_numpy(
        self, hz: float | None = None, *, max_gap_s: float | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (T,) [s] and positions (T, N, 3) [m], in the order of ``vehicles``; NaN where a vehicle was not seen.

        Without ``hz`` the instants are those of the recording, bit for bit. With it they are regular, from the first instant on;
        positions are on straight lines between samples and on the recording's curves, and NaN where two samples are
        farther apart than ``max_gap_s`` (by default one and a half of the vehicle's usual interval).

        Raises :class:`Error` for curves without ``hz``, and for a rate that is not positive or gives too many numbers.
        """
        if max_gap_s is not None and not max_gap_s >= 0:
            raise Error(f"max_gap_s is {max_gap_s}; give a time of 0 s or more")
        if hz is None:
            return self._as_recorded()
        if isinstance(hz, bool) or not isinstance(hz, (int, float, np.integer, np.floating)):
            raise TypeError(f"hz: a number is needed, not {type(hz).__name__}")
        if not (np.isfinite(hz) and hz > 0):
            raise Error(f"hz is {hz}; give a positive number of instants a second")
        columns = self._columns
        starts = [*columns.t[:1], *columns.piece_span[:, 0]]
        ends = [*columns.t[-1:], *columns.piece_span[:, 1]]
        if not starts:
            return np.empty(0), np.empty((0, len(self.vehicles), 3))
        span_s = max(ends) - min(starts)
        if span_s * hz * max(1, 3 * len(self.vehicles)) > MOST_NUMBERS:
            raise Error(f"hz is {hz}: that would be {span_s * hz:.3g} instants; give a lower rate")
        t = min(starts) + np.arange(int(np.floor(span_s * hz + 1e-9)) + 1) / hz
        positions = np.full((len(t), len(self.vehicles), 3), np.nan)
        for vehicle in range(len(self.vehicles)):
            self._interpolate(vehicle, t, positions[:, vehicle], max_gap_s)
            self._evaluate(vehicle, t, positions[:, vehicle])
        return t, positions

    def _as_recorded(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.has_curves:
            raise Error("the recording has curves: say how often they are sampled with hz=")
        columns = self._columns
        t, instant = np.unique(columns.t, return_inverse=True)
        if len(t) * 3 * len(self.vehicles) > MOST_NUMBERS:
            count = f"{len(t)} instants of {len(self.vehicles)} vehicles, most of which were not seen then"
            raise Error(f"vehicles have clocks of their own: that would be {count}; give hz=")
        positions = np.full((len(t), len(self.vehicles), 3), np.nan)
        positions[instant, columns.vehicle] = columns.position
        return t, positions

    def _interpolate(self, vehicle: int, t: NDArray[np.float64], out: NDArray[np.float64], max_gap_s: float | None) -> None:
        own = self._columns.vehicle == vehicle
        seen_s, position = self._columns.t[own], self._columns.position[own]
        if len(seen_s) == 0:
            return
        interval_s = np.diff(seen_s)
        if max_gap_s is None:
            usual = np.sort(interval_s)[(len(interval_s) - 1) // 2] if len(interval_s) else 0.0
            max_gap_s = GAP_OVER_USUAL * usual
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
        """A row a sample in order of time: ``t``, ``id``, ``x``, ``y``, ``z`` (not in a plane), and ``vx``, ``vy``, ``vz``, ``radius`` where there are. Imports
        pandas. Raises :class:`Error` where the recording has curves."""
        if self.has_curves:
            raise Error("the recording has curves, which are no rows: take to_numpy(hz=...)")
        columns = self._columns
        rows: dict[str, Any] = {"t": columns.t, "id": np.array(self.vehicles, dtype=object)[columns.vehicle]}
        letters = "xy" if self.is_planar else "xyz"
        for axis, letter in enumerate(letters):
            rows[letter] = columns.position[:, axis]
        if not np.isnan(columns.velocity).all():
            rows |= {f"v{letter}": columns.velocity[:, axis] for axis, letter in enumerate(letters)}
        if not np.isnan(columns.radius).all():
            rows["radius"] = columns.radius
        return frame(rows)

    def audit(self, **asked: Any) -> Audit:
        """Judges the recording as :func:`tautline.audit` judges its file: between samples too, by its own curves and notes."""
        return audit(self._files, **{**self._read_as, **asked})

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
        return _display.card("open", ", ".join(self._files), rows)

    def __repr__(self) -> str:
        kind = f"{len(self._columns.piece_vehicle)} pieces of curves" if self.has_curves else f"{len(self._columns.t)} samples"
        return f"<Recording {', '.join(self._files)}: {len(self)} vehicles, {kind}>"


def read(recording: PathLike | Sequence[PathLike], **read_as: Any) -> Recording:
    """Reads a recording of any format into memory: a file or folder, or with ``join=True`` a list of files with a vehicle each.

    ``read_as`` is as in :func:`tautline.audit`. Raises ``FileNotFoundError`` for a missing file and :class:`Error`, with file, place, value and
    remedy, for what cannot be read.
    """
    return Recording(paths(recording, "recording"), read_as)
