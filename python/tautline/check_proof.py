"""Checks a proof of `tautline audit DATA --delta D --proof proof.json` by exact arithmetic.

Usage: `python3 check_proof.py proof.json data.csv`.

Exits with 0 if the claim is confirmed, 1 if it is denied, and 2 if a file cannot be read. The program shares no code
with tautline and needs the standard library alone. Distances are compared as fractions of the doubles in the files.

The claim is about vehicles that fly straight from sample to sample. It names the pair that comes closest, and the time.
`separation_m` is the largest double that is not above that distance. Each window of the proof holds a box around every
vehicle. Two boxes that are `separation_m` apart along an axis need no further check; all other pairs are computed.

The table is read by the rules of docs/recordings.md. A table that could be read in a second way is refused.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import sys
from bisect import bisect_left, bisect_right
from datetime import datetime
from fractions import Fraction
from reprlib import repr as short
from typing import Any

# Position [m]; time [s] with the position at that time.
Position = tuple[float, ...]
Sample = tuple[float, Position]

FORMAT, TIMES, COLUMNS = ("tautline proof", 1, "linear"), ("t_s", "t", "time", "time_s"), ("id", "x", "y", "z")
PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}

# White space of Unicode. `str.isspace` counts four control characters as well.
BLANKS = "".join(c for c in map(chr, range(0x3001)) if c.isspace() and c not in "\x1c\x1d\x1e\x1f")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
# Times that tautline reads digit by digit. It rounds all others to a double first.
EXACT_TIME = re.compile(r"[+-]?\d+|\d{7,}\.\d{1,18}", re.ASCII)
DATE = re.compile(r"(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?([Zz]|[+-]\d\d:?[0-5]\d)", re.ASCII)
# Further columns that change the reading: a part of the time, a radius, an origin, a number that begins plain text.
FURTHER = re.compile(
    r"(t|time|timestamp|stamp|date_?time|utc)(_utc|_time)?(\s*[\[(].*|_\w+)?|.*radius.*|ref_lat|ref_lon"
    r"|((.*[./_ ])?(t|time|timestamp|stamp|header|tv|unix)?[./_ ])?(milli|micro|nano|[mnu\u00b5\u03bc])?s(ec(ond)?)?s?"
    r"|[+-]?([\d.]\S*|inf|infinity|nan)\s.*"
)


class Denied(Exception):
    """The claim is not proved."""


class Unreadable(Exception):
    """A file is malformed, or is a table that could be read in a second way."""


class Segment:
    """A straight line between two samples: times [s] and positions [m]."""

    def __init__(self, from_s: float, start: Position, to_s: float, end: Position) -> None:
        self.from_s, self.to_s, self.start, self.end = from_s, to_s, start, end
        self.low, self.high = tuple(map(min, start, end)), tuple(map(max, start, end))

    def at(self, time_s: float) -> list[Fraction]:
        """Position at a time within the segment, as fractions."""
        if time_s <= self.from_s or time_s >= self.to_s:
            return [Fraction(x) for x in (self.start if time_s <= self.from_s else self.end)]
        share = (Fraction(time_s) - Fraction(self.from_s)) / (Fraction(self.to_s) - Fraction(self.from_s))
        return [Fraction(a) + (Fraction(b) - Fraction(a)) * share for a, b in zip(self.start, self.end)]


def within(track: list[Segment], from_s: float, to_s: float) -> list[Segment]:
    """Segments of a vehicle that share a time with an interval."""
    begin = bisect_left(track, from_s, key=lambda segment: segment.to_s)
    return track[begin : bisect_right(track, to_s, key=lambda segment: segment.from_s)]


def overlaps(first: list[Segment], second: list[Segment], from_s: float, to_s: float) -> list[tuple[Segment, Segment]]:
    """Pairs of segments that share a time within an interval."""
    both = ((a, within(second, max(from_s, a.from_s), min(to_s, a.to_s))) for a in within(first, from_s, to_s))
    return [(a, b) for a, others in both for b in others]


def dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def closest(first: Segment, second: Segment) -> tuple[Fraction, Fraction]:
    """Smallest squared distance of two segments at a common time, and the first time at which it is reached."""
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
    gaps = [*zip(high, other_low), *zip(other_high, low)]
    return any(end > start and Fraction(end) - Fraction(start) >= distance for start, end in gaps)


def shown(name: str) -> str:
    """A name, quoted and escaped unless it is a plain word."""
    return name if re.fullmatch(r"[\w.:/#+-]+", name, re.ASCII) else ascii(name)


def number(value: Any, what: str, least: float = -sys.float_info.max) -> float:
    if type(value) not in (int, float) or not least <= value <= sys.float_info.max:
        raise Unreadable(f"proof: {what} must be a finite number of {least!r} or more, got {short(value)}")
    return float(value)


def decimal(text: str) -> float:
    if not NUMBER.fullmatch(text) or math.isinf(float(text)):
        raise ValueError(f"must be a finite number, or a time that is a date with a zone, got {short(text)}")
    return float(text)


def split(line: str) -> list[str]:
    """Cells of a line. A quoted cell ends on its line."""
    cells = next(csv.reader([line], strict=True)) if '"' in line else line.split(",")
    return [cell.strip(BLANKS) for cell in cells]


def read_header(line: str) -> list[str]:
    """Names of the columns."""
    header = split(line)
    counts = [sum(map(header.count, TIMES)), *map(header.count, COLUMNS)]
    if counts != [1] * 5 or ";" in line or "\t" in line:
        raise Unreadable("data: must have the columns t_s (or t, time, time_s), id, x, y, z, once each, between commas")
    for name in header:
        if name not in TIMES and FURTHER.fullmatch(name.lower()):
            raise Unreadable(f"data: column {shown(name)} may change the times or the limit; audit a table without it")
    return header if header[-1] else header[:-1]


def read_time(text: str, clock: dict[str, Any]) -> float:
    """Seconds since the epoch. Both the difference and the quotient are rounded, as tautline rounds them."""
    per_second = PER_SECOND[clock["unit"]]
    epoch = Fraction(clock["epoch_ns"], 1_000_000_000) * per_second
    if date := DATE.fullmatch(text):
        if clock["unit"] != "ns":
            raise ValueError("the unit of dates is ns")
        day, time, decimals, zone = date.groups("")
        instant = datetime.fromisoformat(f"{day}T{time}" + (f"{zone[:3]}:{zone[-2:]}" if zone[1:] else "+00:00"))
        return float(int(instant.timestamp()) * per_second + int(decimals.ljust(9, "0")) - epoch) / per_second
    return (float(Fraction(text) - epoch) if EXACT_TIME.fullmatch(text) else decimal(text) - float(epoch)) / per_second


def read_samples(data: bytes, claim: dict[str, Any]) -> list[list[Sample]]:
    """Samples of each vehicle in the order of the table."""
    numbered = enumerate(data.decode("utf-8-sig").split("\n"), 1)
    lines = ((place, line) for place, line in numbered if line.strip(" \t\r\f"))
    header = read_header(next((line for _, line in lines if not line.startswith("#")), ""))
    time_column = next(column for column, name in enumerate(header) if name in TIMES)
    id_column, *axes = map(header.index, COLUMNS)
    tracks: dict[str, list[Sample]] = {}
    for place, line in lines:
        try:
            cells = split(line)
            if len(cells) != len(header) + (len(cells) > len(header) and not cells[-1]) or not cells[id_column]:
                raise ValueError("must have a cell for each column, and the name of a vehicle")
            time, name, position = cells[time_column], cells[id_column], [cells[axis] for axis in axes]
            time_s = read_time(time, claim["clock"]) + claim["offsets_s"].get(name, 0.0)
            samples = tracks.setdefault(name, [])
            # Without a position the vehicle is not seen. Identical rows count once.
            if any(position) and samples[-1:] != [sample := (time_s, tuple(map(decimal, position)))]:
                samples.append(sample)
        except (ValueError, ArithmeticError, csv.Error) as error:
            raise Unreadable(f"data, line {place}: {error}") from error
    for name in sorted(tracks.keys() ^ set(claim["vehicles"])):
        for other in header[:id_column]:
            if other not in TIMES and not re.fullmatch("v?[xyz]", other):
                raise Unreadable(f"data: column {shown(other)} may name the vehicles; audit a table without it")
        raise Denied(f"vehicle {shown(name)} is missing in the claim or in the data")
    return [tracks[name] for name in claim["vehicles"]]


def read_segments(samples: list[Sample], name: str, max_gap_s: float) -> list[Segment]:
    """Segments of a vehicle in order of time. A sample behind a gap is a segment without a length."""
    segments: list[Segment] = []
    for k, (time_s, position) in enumerate(samples):
        before_s, before = samples[k - 1] if k else (-math.inf, position)
        if time_s <= before_s:
            raise Unreadable(f"data: vehicle {shown(name)} is at two places at {time_s!r} s, or goes back in time")
        is_joined = k > 0 and time_s - before_s <= max_gap_s
        segments.append(Segment(before_s if is_joined else time_s, before if is_joined else position, time_s, position))
    return segments


def check_window(window: dict[str, Any], tracks: list[list[Segment]], least: Fraction) -> None:
    """Raises `Denied` unless all pairs keep the smallest separation in a window."""
    from_s, to_s = number(window["from_s"], "from_s"), number(window["to_s"], "to_s")
    boxes: dict[int, tuple[Position, Position]] = {}
    for vehicle, *ends in window["boxes"]:
        if type(vehicle) is not int or not 0 <= vehicle < len(tracks) or len(ends) != 6:
            raise Unreadable(f"proof: a box must have a vehicle below {len(tracks)} and 6 numbers, got {short(ends)}")
        corners = tuple(number(end, "the corner of a box") for end in ends)
        boxes[vehicle] = (corners[:3], corners[3:])
    for vehicle, track in enumerate(tracks):
        for segment in within(track, from_s, to_s):
            low, high = boxes.get(vehicle, (segment.high, segment.low))
            if vehicle not in boxes or any(segment.low[k] < low[k] or segment.high[k] > high[k] for k in range(3)):
                raise Denied(f"vehicle {vehicle} leaves its box, or has none, in the window from {from_s!r} s")
    lows = [low for low, _ in boxes.values()] or [(0.0, 0.0, 0.0)]
    axis = max(range(3), key=lambda k: max(low[k] for low in lows) - min(low[k] for low in lows))
    order = sorted(boxes.items(), key=lambda box: box[1][0][axis])
    for k, (first, (low, high)) in enumerate(order):
        for second, (other_low, other_high) in order[k + 1 :]:
            if other_low[axis] > high[axis] and Fraction(other_low[axis]) - Fraction(high[axis]) >= least:
                break
            is_near = not are_apart(low, high, other_low, other_high, least)
            for a, b in overlaps(tracks[first], tracks[second], from_s, to_s) if is_near else []:
                if not are_apart(a.low, a.high, b.low, b.high, least) and closest(a, b)[0] < least * least:
                    raise Denied(f"a pair is closer than the smallest separation near {a.from_s!r} s")


def check_witness(first: list[Segment], second: list[Segment], time_s: float, separation_m: float) -> None:
    """Raises `Denied` unless two vehicles reach the smallest separation at a time, both to the next double."""
    after_s, above_m = math.nextafter(time_s, math.inf), Fraction(math.nextafter(separation_m, math.inf))
    for a, b in overlaps(first, second, time_s, after_s):
        squared, at_s = closest(a, b)
        if Fraction(time_s) <= at_s < Fraction(after_s) and squared < above_m * above_m:
            return
    raise Denied(f"the pair is not as close as {separation_m!r} m at {time_s!r} s")


def check(proof: dict[str, Any], data: bytes) -> str:
    """Returns a claim in words. Raises `Denied` unless the claim is true of the bytes of a recording."""
    claim, clock, windows = proof["claim"], proof["claim"]["clock"], proof["windows"]
    vehicles, pair, offsets_s = claim["vehicles"], claim["pair"], claim["offsets_s"]
    for key, is_met in (
        ("format, version or motion", (proof["format"], proof["version"], claim["motion"]) == FORMAT),
        ("status", claim["status"] in ("clear", "violation")),
        ("vehicles", type(vehicles) is list and len(set(vehicles)) == len(vehicles)),
        ("pair", type(pair) is list and len(pair) == 2 and len({*pair} & {*vehicles}) == 2),
        ("offsets_s", type(offsets_s) is dict and offsets_s.keys() <= {*vehicles}),
        ("clock", type(clock["epoch_ns"]) is int and type(clock["inferred"]) is bool),
        ("clock.unit (s, ms, us or ns)", clock["unit"] in PER_SECOND),
        ("windows", type(windows) is list and all(type(window["boxes"]) is list for window in windows)),
    ):
        if not is_met:
            raise Unreadable(f"proof: {key} is malformed or not supported")
    limit_m, time_s = number(claim["limit_m"], "limit_m", math.ulp(0.0)), number(claim["time_s"], "time_s")
    separation_m = number(claim["separation_m"], "separation_m", 0.0)
    max_gaps_s = [math.inf if gap_s is None else number(gap_s, "max_gaps_s", 0.0) for gap_s in claim["max_gaps_s"]]
    moved = [f"{shown(name)} by {by_s!r} s" for name, by_s in offsets_s.items() if number(by_s, "offsets_s") != 0]
    if hashlib.sha256(data).hexdigest() != proof["data"]["sha256"]:
        raise Denied("the data is not that of the proof: its SHA-256 differs")

    tracks = [read_segments(*of) for of in zip(read_samples(data, claim), vehicles, max_gaps_s, strict=True)]
    for window in windows:
        check_window(window, tracks, Fraction(separation_m))
    edges_s = [edge_s for window in windows for edge_s in (window["from_s"], window["to_s"])] or [math.inf, -math.inf]
    spans = [(track[0].from_s, track[-1].to_s) for track in tracks if track]
    if edges_s[1:-1:2] != edges_s[2::2] or any(from_s < edges_s[0] or edges_s[-1] < to_s for from_s, to_s in spans):
        raise Denied("the windows do not cover the recording without a gap")
    check_witness(tracks[vehicles.index(pair[0])], tracks[vehicles.index(pair[1])], time_s, separation_m)

    # A gap may hide a violation if a second vehicle is seen meanwhile.
    gaps = [(a.to_s, b.from_s) for track in tracks for a, b in zip(track, track[1:]) if a.to_s < b.from_s]
    is_hidden = any(sum(begin_s < to_s and from_s < end_s for begin_s, end_s in spans) > 1 for from_s, to_s in gaps)
    expected = "violation" if separation_m < limit_m else "undecided" if is_hidden else "clear"
    if claim["status"] != expected:
        raise Denied(f"the status is {expected}, not {claim['status']}")

    text = f"{expected}, never closer than {separation_m!r} m, {' and '.join(map(shown, pair))} (limit {limit_m!r} m)"
    text += f", with clocks moved: {', '.join(moved)}" if moved else ""
    longest_s = max(segment.to_s - segment.from_s for track in tracks for segment in track)
    text += f"; straight between samples up to {longest_s:g} s apart" + f", gaps not judged: {len(gaps)}" * bool(gaps)
    return f"{text}; times in {clock['unit']}{' (inferred)' if clock['inferred'] else ''}"


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python3 check_proof.py proof.json data.csv", file=sys.stderr)
        return 2
    try:
        with open(arguments[0], "rb") as proof, open(arguments[1], "rb") as data:
            print(f"CONFIRMED: {check(json.load(proof), data.read())}")
    except Denied as denied:
        print(f"DENIED: {denied}")
        return 1
    # An uncaught exception exits with 1, which means that the claim is denied.
    except Exception as error:
        problem = f"{error}" if isinstance(error, Unreadable) else f"{type(error).__name__}: {error}"
        print(f"UNREADABLE: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
