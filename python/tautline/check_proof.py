"""Checks a proof of `tautline audit DATA --delta D --proof proof.json` by exact arithmetic.

    python3 check_proof.py proof.json data.csv

Exits with 0 where the claim is confirmed, with 1 where it is denied, and with 2 where a file cannot be read. The program shares no
code with tautline and needs the standard library alone. Distances are compared as fractions of the doubles that the file holds;
nothing is rounded.

The claim is about vehicles that fly straight from sample to sample. It says which pair comes closest, and in which second;
`separation_m` is the largest double that is not above that distance. Each window of the proof holds a box around every vehicle. Two
boxes that are `separation_m` apart along an axis need no further look; all other pairs of the window are computed.
"""

from __future__ import annotations

import bisect
import csv
import hashlib
import json
import math
import sys
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

# A position [m], and when a vehicle was seen there [s].
Position = tuple[float, ...]
Sample = tuple[float, Position]

TIMES = ("t_s", "t", "time", "time_s")
PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}


class Denied(Exception):
    """The claim is not proved."""


class Unreadable(Exception):
    """A file is not what it should be."""


class Segment:
    """A straight line between two samples: times [s] and positions [m]."""

    __slots__ = ("from_s", "to_s", "start", "end", "low", "high")

    def __init__(self, from_s: float, start: Position, to_s: float, end: Position) -> None:
        self.from_s, self.to_s, self.start, self.end = from_s, to_s, start, end
        self.low = tuple(map(min, start, end))
        self.high = tuple(map(max, start, end))

    def at(self, time_s: float) -> list[Fraction]:
        """Position at a time within the segment, as fractions."""
        if time_s <= self.from_s:
            return [Fraction(x) for x in self.start]
        if time_s >= self.to_s:
            return [Fraction(x) for x in self.end]
        share = (Fraction(time_s) - Fraction(self.from_s)) / (Fraction(self.to_s) - Fraction(self.from_s))
        return [Fraction(a) + (Fraction(b) - Fraction(a)) * share for a, b in zip(self.start, self.end)]


class Track:
    """Segments of a vehicle in order of time."""

    def __init__(self, segments: list[Segment]) -> None:
        self.segments = segments
        self.starts = [segment.from_s for segment in segments]
        self.ends = [segment.to_s for segment in segments]

    def within(self, from_s: float, to_s: float) -> list[Segment]:
        """Segments that share a time with a window."""
        return self.segments[bisect.bisect_left(self.ends, from_s) : bisect.bisect_right(self.starts, to_s)]


def dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def closest(first: Segment, second: Segment) -> tuple[Fraction, Fraction]:
    """Smallest squared distance of two segments over the time that they share, and the first time at which it is reached."""
    from_s, to_s = max(first.from_s, second.from_s), min(first.to_s, second.to_s)
    start, end = ([b - a for a, b in zip(first.at(t), second.at(t))] for t in (from_s, to_s))
    by = [b - a for a, b in zip(start, end)]
    rate = dot(start, by)
    if rate >= 0:
        return dot(start, start), Fraction(from_s)
    if dot(end, by) <= 0:
        return dot(end, end), Fraction(to_s)
    share = -rate / dot(by, by)
    return dot(start, start) + rate * share, Fraction(from_s) + share * (Fraction(to_s) - Fraction(from_s))


def are_apart(low: Position, high: Position, other_low: Position, other_high: Position, distance: Fraction) -> bool:
    """Whether two boxes are a distance apart along an axis."""
    for axis in range(3):
        for gap_from, gap_to in ((high[axis], other_low[axis]), (other_high[axis], low[axis])):
            if gap_to > gap_from and Fraction(gap_to) - Fraction(gap_from) >= distance:
                return True
    return False


def overlaps(first: Track, second: Track, from_s: float, to_s: float) -> Iterator[tuple[Segment, Segment]]:
    """Pairs of segments that share a time within a window."""
    others = second.within(from_s, to_s)
    begin = 0
    for a in first.within(from_s, to_s):
        while begin < len(others) and others[begin].to_s < a.from_s:
            begin += 1
        for b in others[begin:]:
            if b.from_s > a.to_s:
                break
            yield a, b


def number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise Unreadable(f"{what}: not a finite number ({value!r})")
    return float(value)


def read_samples(data: bytes, claim: dict[str, Any]) -> list[list[Sample]]:
    """Samples of each vehicle in order of time: (time, position)."""
    try:
        lines = data.decode("utf-8-sig").splitlines()
        rows = csv.reader((line for line in lines if not line.startswith("#")), strict=True)
        header = [name.strip() for name in next(rows)]
        time_column = next(header.index(name) for name in TIMES if name in header)
        id_column, *axes = (header.index(name) for name in ("id", "x", "y", "z"))
    except (UnicodeDecodeError, StopIteration, ValueError, csv.Error) as error:
        raise Unreadable(f"data: not a CSV table with the columns t_s (or t, time, time_s), id, x, y, z ({error})") from error
    unit = PER_SECOND[claim["clock"]["unit"]]
    epoch = Fraction(claim["clock"]["epoch_ns"], 1_000_000_000) * unit
    offsets = claim["offsets_s"]
    tracks: dict[str, list[Sample]] = {name: [] for name in claim["vehicles"]}
    try:
        for row in rows:
            if not row:
                continue
            name = row[id_column].strip()
            if name not in tracks:
                raise Denied(f"the claim leaves vehicle {name} out")
            time_s = float(Fraction(row[time_column].strip()) - epoch) / unit + offsets.get(name, 0.0)
            position = tuple(number(float(row[axis]), "data") for axis in axes)
            tracks[name].append((time_s, position))
    except (ValueError, IndexError, OverflowError, ZeroDivisionError, csv.Error) as error:
        raise Unreadable(f"data, line {rows.line_num}: not a row of numbers ({error})") from error
    return [sorted(tracks[name], key=lambda sample: sample[0]) for name in claim["vehicles"]]


def read_segments(samples: list[Sample], name: str, max_gap_s: float) -> tuple[list[Segment], list[tuple[float, float]]]:
    """Segments of a vehicle in order of time, and the gaps between them."""
    segments: list[Segment] = []
    gaps: list[tuple[float, float]] = []
    for k, (time_s, position) in enumerate(samples):
        before_s, before = samples[k - 1] if k else (-math.inf, position)
        if k and time_s <= before_s:
            raise Denied(f"vehicle {name} is at two places at {time_s!r} s")
        if k and time_s - before_s <= max_gap_s:
            segments.append(Segment(before_s, before, time_s, position))
            continue
        if k:
            gaps.append((before_s, time_s))
        segments.append(Segment(time_s, position, time_s, position))
    return segments, gaps


def check_windows(windows: list[dict[str, Any]], begin_s: float, end_s: float) -> None:
    """The windows cover the recording without a gap."""
    if not windows:
        raise Denied("there is no window")
    if number(windows[0]["from_s"], "window") > begin_s or number(windows[-1]["to_s"], "window") < end_s:
        raise Denied("the windows do not cover the recording")
    for window, following in zip(windows, windows[1:]):
        if window["to_s"] != following["from_s"] or not window["from_s"] <= window["to_s"]:
            raise Denied(f"a window is missing at {window['to_s']!r} s")


def check_window(window: dict[str, Any], tracks: list[Track], least: Fraction) -> None:
    """No pair comes closer than the smallest separation in a window."""
    from_s, to_s = number(window["from_s"], "window"), number(window["to_s"], "window")
    boxes: dict[int, tuple[Position, Position]] = {}
    for vehicle, *ends in window["boxes"]:
        corners = tuple(number(end, "box") for end in ends)
        boxes[vehicle] = (corners[:3], corners[3:])
    for vehicle, track in enumerate(tracks):
        for segment in track.within(from_s, to_s):
            if vehicle not in boxes:
                raise Denied(f"vehicle {vehicle} has no box in the window from {from_s!r} s")
            low, high = boxes[vehicle]
            if any(segment.low[k] < low[k] or segment.high[k] > high[k] for k in range(3)):
                raise Denied(f"vehicle {vehicle} leaves its box in the window from {from_s!r} s")
    lows = [low for low, _ in boxes.values()]
    axis = max(range(3), key=lambda k: max(low[k] for low in lows) - min(low[k] for low in lows)) if lows else 0
    order = sorted(boxes.items(), key=lambda box: box[1][0][axis])
    for k, (first, (low, high)) in enumerate(order):
        for second, (other_low, other_high) in order[k + 1 :]:
            if other_low[axis] > high[axis] and Fraction(other_low[axis]) - Fraction(high[axis]) >= least:
                break
            if not are_apart(low, high, other_low, other_high, least):
                check_pair(tracks[first], tracks[second], from_s, to_s, least)


def check_pair(first: Track, second: Track, from_s: float, to_s: float, least: Fraction) -> None:
    for a, b in overlaps(first, second, from_s, to_s):
        if not are_apart(a.low, a.high, b.low, b.high, least) and closest(a, b)[0] < least * least:
            raise Denied(f"a pair is closer than the smallest separation near {a.from_s!r} s")


def check_witness(claim: dict[str, Any], tracks: list[Track], separation_m: float) -> None:
    """The pair comes as close as that at the time that is named."""
    above = Fraction(math.nextafter(separation_m, math.inf))
    first, second = (tracks[claim["vehicles"].index(name)] for name in claim["pair"])
    if first is second:
        raise Denied("the closest pair is one vehicle")
    time_s = number(claim["time_s"], "time_s")
    for a, b in overlaps(first, second, time_s, math.nextafter(time_s, math.inf)):
        squared, at_s = closest(a, b)
        is_then = Fraction(time_s) <= at_s < Fraction(math.nextafter(time_s, math.inf))
        if is_then and squared < above * above:
            return
    raise Denied(f"{' and '.join(claim['pair'])} are not as close as {separation_m!r} m at {time_s!r} s")


def check_status(
    claim: dict[str, Any], tracks: list[Track], gaps: list[list[tuple[float, float]]], separation_m: float
) -> None:
    """The verdict follows from the smallest separation, and from what was not seen."""
    limit_m = number(claim["limit_m"], "limit_m")
    expected = "violation" if separation_m < limit_m else "clear"
    for vehicle, own in enumerate(gaps):
        others = [track for k, track in enumerate(tracks) if k != vehicle and track.segments]
        for from_s, to_s in own:
            if any(track.starts[0] < to_s and from_s < track.ends[-1] for track in others) and expected == "clear":
                expected = "undecided"
    if claim["status"] != expected:
        raise Denied(f"the status is {expected}, not {claim['status']}")


def check(proof: dict[str, Any], data: bytes) -> dict[str, Any]:
    """Raises `Denied` unless the claim of a proof is true of the bytes of a recording."""
    claim: dict[str, Any] = proof["claim"]
    if proof["format"] != "tautline proof" or proof["version"] != 1:
        raise Unreadable("proof: of another format or version")
    if hashlib.sha256(data).hexdigest() != proof["data"]["sha256"]:
        raise Denied("the data is not that of the proof: its SHA-256 differs")
    if claim["motion"] != "linear":
        raise Unreadable(f"proof: motion {claim['motion']!r} is not straight between samples")
    separation_m = number(claim["separation_m"], "separation_m")
    tracks: list[Track] = []
    gaps: list[list[tuple[float, float]]] = []
    for name, samples, max_gap_s in zip(claim["vehicles"], read_samples(data, claim), claim["max_gaps_s"], strict=True):
        segments, own = read_segments(samples, name, math.inf if max_gap_s is None else max_gap_s)
        tracks.append(Track(segments))
        gaps.append(own)
    seen = [track for track in tracks if track.segments]
    if len(seen) < 2:
        raise Denied("fewer than two vehicles are seen")
    check_windows(proof["windows"], min(track.starts[0] for track in seen), max(track.ends[-1] for track in seen))
    check_status(claim, tracks, gaps, separation_m)
    check_witness(claim, tracks, separation_m)
    for window in proof["windows"]:
        check_window(window, tracks, Fraction(separation_m))
    return claim


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python3 check_proof.py proof.json data.csv", file=sys.stderr)
        return 2
    try:
        with open(arguments[0], "rb") as file:
            proof = json.load(file)
        with open(arguments[1], "rb") as file:
            data = file.read()
        claim = check(proof, data)
    except Denied as denied:
        print(f"DENIED: {denied}")
        return 1
    except (OSError, ValueError, KeyError, TypeError, AttributeError, Unreadable) as error:
        print(f"UNREADABLE: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    pair = " and ".join(claim["pair"])
    print(f"CONFIRMED: {claim['status']}, never closer than {claim['separation_m']!r} m, {pair} (limit {claim['limit_m']!r} m)")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
