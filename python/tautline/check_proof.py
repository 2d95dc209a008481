"""Checks a proof of `tautline audit DATA --delta D --proof proof.json` by exact arithmetic.

Usage: `python3 check_proof.py proof.json data.csv [--offset NAME=SECONDS ...]`.

Exits with 0 if the claim is confirmed, 1 if it is denied, and 2 if a file cannot be read. The program shares no code
with tautline and needs the standard library alone.

The claim is about vehicles that fly straight from sample to sample. The program takes times and positions as the
decimals of the table, without rounding. It computes the smallest separation, its pair and the verdict from the table
alone, and compares them with the claim. Every fact that the table does not contain is printed below the verdict.

The table is read by the rules of docs/proved.md. A table that could be read in a second way is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from fractions import Fraction
from reprlib import repr as short
from typing import Any

FORMAT, VERSION = "tautline proof", 2
# Columns of a table, and the unit of time that the name of a column gives.
TIMES = {"t_s": "s", "time_s": "s", "t": None, "time": None}
AXES = ("x", "y", "z")
# Columns that do not change the reading.
UNUSED = re.compile(r"v[xyz]|q[wxyz]|thrust_[1-4]_n|heading_rad|speed_m_s|wind_[xyz]_m_s|oldest_s|mean_s")
PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}

CELL = re.compile(r'(?:"([^"]*)"|([^",]*))(,|$)')
DECIMAL = re.compile(r"([+-]?)(\d+\.?\d*|\.\d+)(?:[eE]([+-]?\d+))?", re.ASCII)
DATE = re.compile(r"(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?([Zz]|[+-]\d\d:?[0-5]\d)", re.ASCII)
EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
# Longest text and largest exponent of a number, and its largest size. tautline has the same largest size.
LONGEST, LARGEST = 400, 10**70
# Difference of the claimed from the computed separation that rounding explains, as a part of the largest coordinate.
ROUNDING = Fraction(1, 10**9)
# Number of segments of a vehicle in a window.
SEGMENTS = 8

Vector = tuple[int, int, int]


class Denied(Exception):
    """The claim is not proved."""


class Unreadable(Exception):
    """A file is malformed, or is a table that could be read in a second way."""


class Exact(Fraction):
    """A number with the text that it was read from."""

    text: str

    def __new__(cls, text: str) -> Exact:
        digits, decimals = decimal(text)
        self = super().__new__(cls, digits * 10 ** max(-decimals, 0), 10 ** max(decimals, 0))
        self.text = text
        return self

    def __repr__(self) -> str:
        return self.text


class Segment:
    """A straight line between two samples: times and positions in the units of a `Motion`."""

    __slots__ = ("from_t", "to_t", "start", "end")

    def __init__(self, from_t: int, start: Vector, to_t: int, end: Vector) -> None:
        self.from_t, self.start, self.to_t, self.end = from_t, start, to_t, end

    def at(self, time: int) -> tuple[Vector, int]:
        """Numerators and denominator of the position at a time within the segment."""
        length = self.to_t - self.from_t
        if length == 0:
            return self.start, 1
        before, after = time - self.from_t, self.to_t - time
        (a, b, c), (d, e, f) = self.start, self.end
        return (a * after + d * before, b * after + e * before, c * after + f * before), length


class Approach:
    """Smallest distance of a pair: its square as a fraction, and the time."""

    __slots__ = ("above", "below", "time", "pair")

    def __init__(self, above: int, below: int, time: Fraction, pair: tuple[int, int]) -> None:
        self.above, self.below, self.time, self.pair = above, below, time, pair

    def square(self, places: int) -> Fraction:
        """Squared distance [m^2]."""
        return Fraction(self.above, self.below * 10 ** (2 * places))

    def is_closer(self, other: Approach | None) -> bool:
        return other is None or self.above * other.below < other.above * self.below


class Motion:
    """Segments of each vehicle as integers: lengths in 10^-places m, times in 10^-decimals of the unit."""

    def __init__(self, tracks: list[list[Segment]], decimals: int, places: int) -> None:
        self.tracks, self.decimals, self.places = tracks, decimals, places
        self.spans = [(track[0].from_t, track[-1].to_t) for track in tracks if track]
        self.begin, self.end = min((b for b, _ in self.spans), default=0), max((e for _, e in self.spans), default=0)
        corners = (corner for track in tracks for segment in track for corner in (segment.start, segment.end))
        self.largest = max((abs(x) for corner in corners for x in corner), default=0)


def decimal(text: str) -> tuple[int, int]:
    """Digits and number of decimals of a decimal number."""
    match = DECIMAL.fullmatch(text) if len(text) <= LONGEST else None
    exponent = int(match[3] or 0) if match else LONGEST + 1
    if match is None or abs(exponent) > LONGEST:
        raise ValueError(f"must be a finite decimal number, or a time that is a date with a zone, got {short(text)}")
    whole, _, fraction = match[2].partition(".")
    digits, decimals = int(whole + fraction), len(fraction) - exponent
    if digits > LARGEST * 10 ** max(decimals, 0) or digits * 10 ** max(-decimals, 0) > LARGEST:
        raise ValueError(f"must be at most 1e70, got {short(text)}")
    return (-digits if match[1] == "-" else digits), decimals


def scaled(number: tuple[int, int], decimals: int) -> int:
    return int(number[0] * 10 ** (decimals - number[1]))


def shown(name: str) -> str:
    """A name, quoted and escaped unless it is a plain word."""
    return name if re.fullmatch(r"[\w.:/#+-]+", name, re.ASCII) else ascii(name)


def rounded(number: Fraction) -> str:
    """A number, rounded down to six decimals."""
    millionths = math.floor(number * 10**6)
    whole, rest = divmod(abs(millionths), 10**6)
    return f"{'-' * (millionths < 0)}{whole}.{rest:06}".rstrip("0").rstrip(".")


def root(square: Fraction) -> float:
    """The largest double that is not above a square root."""
    above, below = square.numerator, square.denominator
    shift = max(0, 128 - (above.bit_length() - below.bit_length()) // 2)
    size = float(Fraction(math.isqrt((above << 2 * shift) // below), 1 << shift))
    while Fraction(size) ** 2 > square:
        size = math.nextafter(size, 0.0)
    while Fraction(math.nextafter(size, math.inf)) ** 2 <= square:
        size = math.nextafter(size, math.inf)
    return size


# The proof.


def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise Unreadable("proof: an object has a key twice")
    return found


def read_proof(text: bytes) -> Any:
    """The value of a JSON text, with exact numbers."""

    def refuse(constant: str) -> None:
        raise ValueError(f"must have finite numbers, got {constant}")

    try:
        return json.loads(
            text.decode(), parse_int=Exact, parse_float=Exact, parse_constant=refuse, object_pairs_hook=members
        )
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"proof: {error}") from error


def keys(value: Any, place: str, *names: str) -> list[Any]:
    """The values of an object that has these keys and no other."""
    if type(value) is not dict or value.keys() != {*names}:
        raise Unreadable(f"proof: {place} must be an object with the keys {', '.join(names)} alone")
    return [value[name] for name in names]


def number(value: Any, place: str, least: int | None = None) -> Exact:
    if type(value) is not Exact or (least is not None and value < least):
        needed = "a number" if least is None else f"a number of {least} or more"
        raise Unreadable(f"proof: {place} must be {needed}, got {short(value)}")
    return value


class Claim:
    """Content of a proof."""

    def __init__(self, proof: Any) -> None:
        if type(proof) is not dict or proof.get("format") != FORMAT:
            raise Unreadable(f"proof: must be an object with format {FORMAT!r}")
        if type(proof.get("version")) is not Exact or proof["version"] != VERSION:
            old = "write the proof again with `tautline audit --proof`"
            raise Unreadable(f"proof: version {short(proof.get('version'))} is not supported, {VERSION} is; {old}")
        _, _, data, claim, assumed = keys(proof, "it", "format", "version", "data", "claim", "assumed")
        data_format, recording, self.sha256 = keys(data, "data", "format", "recording", "sha256")
        self.status, motion, limit, separation_m, self.pair = keys(
            claim, "claim", "status", "motion", "limit", "separation_m", "pair"
        )
        limit_kind, limit_m = keys(limit, "claim.limit", "kind", "distance_m")
        self.unit, max_gaps_s, offsets_s = keys(assumed, "assumed", "time_unit", "max_gaps_s", "offsets_s")
        for place, is_met in (
            ("data.format (csv)", data_format == "csv"),
            ("data.recording", type(recording) is str),
            ("claim.motion (linear)", motion == "linear"),
            ("claim.limit.kind (distance)", limit_kind == "distance"),
            ("claim.status (clear, violation)", self.status in ("clear", "violation")),
            ("claim.pair", type(self.pair) is list and [*map(type, self.pair)] == [str, str]),
            ("assumed.time_unit (s, ms, us, ns)", type(self.unit) is str and self.unit in PER_SECOND),
            ("assumed.max_gaps_s", type(max_gaps_s) is dict),
            ("assumed.offsets_s", type(offsets_s) is dict),
        ):
            if not is_met:
                raise Unreadable(f"proof: {place} is malformed or not supported")
        self.limit_m = number(limit_m, "claim.limit.distance_m", 0)
        if self.limit_m == 0:
            raise Unreadable("proof: claim.limit.distance_m must be above 0")
        self.separation_m = number(separation_m, "claim.separation_m", 0)
        self.offsets_s = {name: number(by_s, "assumed.offsets_s") for name, by_s in offsets_s.items()}
        # Null joins all samples of a vehicle.
        self.max_gaps_s = {
            name: None if gap_s is None else number(gap_s, "assumed.max_gaps_s", 0)
            for name, gap_s in max_gaps_s.items()
        }


# The table.


def split(line: str) -> list[str]:
    """Cells of a line. A cell is quoted as a whole or not at all, and has no quotes inside."""
    cells, place = [], 0
    while match := CELL.match(line, place):
        cells.append((match[1] if match[2] is None else match[2]).strip(" "))
        place = match.end()
        if not match[3]:
            return cells
    raise ValueError("has quotes within a cell, or quotes that are not closed")


class Header:
    """Places of the columns of a table. A table with an unknown column is refused: it could change the reading."""

    def __init__(self, line: str) -> None:
        names = split(line)
        times, needed = [name for name in names if name in TIMES], ("id", *AXES)
        self.unused = [name for name in names if UNUSED.fullmatch(name)]
        others = [name for name in names if name not in (*times, *needed, *self.unused)]
        if others:
            remedy = "audit a table without it, as `tautline export` writes"
            raise Unreadable(f"data: column {shown(others[0])} could change the reading; {remedy}")
        if len(times) != 1 or len({*names}) < len(names) or not {*needed} <= {*names}:
            one_of = "one of t_s, time_s, t and time"
            raise Unreadable(f"data: must have the columns id, x, y, z and {one_of}, and no column twice")
        self.count, self.time_name = len(names), times[0]
        self.time, self.id = names.index(times[0]), names.index("id")
        self.axes = [names.index(axis) for axis in AXES]


def nanoseconds(match: re.Match[str]) -> int:
    """Time of a date since 1970 [ns]."""
    day, time, decimals, zone = match.groups("")
    instant = datetime.fromisoformat(f"{day}T{time}" + (f"{zone[:3]}:{zone[-2:]}" if zone[1:] else "+00:00"))
    return (instant - EPOCH) // timedelta(seconds=1) * 10**9 + int(decimals.ljust(9, "0"))


def lines_of(data: bytes) -> Iterator[tuple[int, str]]:
    """Lines that are not blank, with their numbers. Comments stand above the header."""
    is_header = True
    for place, line in enumerate(data.decode("utf-8-sig").split("\n"), 1):
        line = line.removesuffix("\r")
        if any(c != " " and (c.isspace() or ord(c) < 0x20 or 0x7F <= ord(c) < 0xA0) for c in line):
            raise Unreadable(f"data, line {place}: has a control character, or a blank that is no space")
        if line.strip(" ") and not (is_header and line.startswith("#")):
            is_header = False
            yield place, line


class Table:
    """Rows of a table: time and position of each vehicle in the order of the file, as texts."""

    def __init__(self, data: bytes) -> None:
        lines = lines_of(data)
        self.header = Header(next(lines, (0, ""))[1])
        self.rows: dict[str, list[list[str]]] = {}
        self.without_position = 0
        dated: set[bool] = set()
        for place, line in lines:
            try:
                cells = split(line)
                if len(cells) != self.header.count or not cells[self.header.id]:
                    raise ValueError(f"must have {self.header.count} cells, and the name of a vehicle")
                time, position = cells[self.header.time], [cells[axis] for axis in self.header.axes]
                date = DATE.fullmatch(time)
                dated.add(date is not None)
                if len(dated) > 1:
                    raise ValueError("must have a date as time if other rows have, and a number otherwise")
                row = [str(nanoseconds(date)) if date else time, *(position if any(position) else ())]
                for text in row:
                    decimal(text)
            except (ValueError, ArithmeticError) as error:
                raise Unreadable(f"data, line {place}: {error}") from error
            rows = self.rows.setdefault(cells[self.header.id], [])
            # Without a position the vehicle is not seen.
            if any(position):
                rows.append(row)
            else:
                self.without_position += 1
        self.is_dated = dated == {True}
        spellings: dict[str, str] = {}
        for name in self.rows:
            other = spellings.setdefault(spelling(name), name)
            if other != name:
                raise Unreadable(f"data: the names {shown(other)} and {shown(name)} could mean one vehicle")

    def motion(self, claim: Claim) -> Motion:
        """Segments of the vehicles, in the order of `rows`."""
        per_second = PER_SECOND[claim.unit]
        shifts = {name: self.units(by_s, per_second) for name, by_s in claim.offsets_s.items()}
        gaps = {n: None if gap_s is None else self.units(gap_s, per_second) for n, gap_s in claim.max_gaps_s.items()}
        decimals, places = 0, 0
        for _, amount in (*shifts.values(), *(gap for gap in gaps.values() if gap is not None)):
            decimals = max(decimals, amount)
        for rows in self.rows.values():
            for time, x, y, z in rows:
                decimals = max(decimals, decimal(time)[1])
                places = max(places, decimal(x)[1], decimal(y)[1], decimal(z)[1])
        tracks = []
        for name, rows in self.rows.items():
            shift, gap = scaled(shifts.get(name, (0, 0)), decimals), gaps[name]
            max_gap = None if gap is None else scaled(gap, decimals)
            tracks.append(self.segments(name, (decimals, places), shift, max_gap))
        return Motion(tracks, decimals, places)

    @staticmethod
    def units(seconds: Exact, per_second: int) -> tuple[int, int]:
        digits, decimals = decimal(seconds.text)
        return digits * per_second, decimals

    def segments(self, name: str, scale: tuple[int, int], shift: int, max_gap: int | None) -> list[Segment]:
        """Segments of a vehicle in order of time. A sample behind a gap is a segment without a length."""
        found: list[Segment] = []
        for time, *position in self.rows[name]:
            x, y, z = (scaled(decimal(text), scale[1]) for text in position)
            now, here = scaled(decimal(time), scale[0]) + shift, (x, y, z)
            last = found[-1] if found else None
            # Identical rows count once.
            if last is not None and (now, here) == (last.to_t, last.end):
                continue
            if last is not None and now <= last.to_t:
                raise Unreadable(f"data: vehicle {shown(name)} is at two places at t = {time}, or goes back in time")
            is_joined = last is not None and (max_gap is None or now - last.to_t <= max_gap)
            begin = (last.to_t, last.end) if last is not None and is_joined else (now, here)
            found.append(Segment(*begin, now, here))
        return found


def spelling(name: str) -> str:
    """A name without case, zeros before a number, and marks that are not between two digits; the value of a number."""
    if DECIMAL.fullmatch(name):
        try:
            return f"number {Exact(name)}"
        except ValueError:
            return name
    return re.sub(r"(?<!\d)0+(?=\d)|(?<!\d)[\W_]|[\W_](?!\d)", "", name.casefold())


# The smallest separation.


def within(track: list[Segment], from_t: int, to_t: int) -> list[Segment]:
    """Segments of a vehicle that share a time with an interval."""
    begin = bisect_left(track, from_t, key=lambda segment: segment.to_t)
    return track[begin : bisect_right(track, to_t, key=lambda segment: segment.from_t)]


def closest(
    first: list[Segment], second: list[Segment], span: tuple[int, int], pair: tuple[int, int]
) -> Approach | None:
    """Smallest distance of two vehicles over all segments that share a time with an interval and with each other."""
    least: Approach | None = None
    for a in within(first, *span):
        for b in within(second, max(span[0], a.from_t), min(span[1], a.to_t)):
            approach = closest_on_lines(a, b, pair)
            least = approach if approach.is_closer(least) else least
    return least


def closest_on_lines(a: Segment, b: Segment, pair: tuple[int, int]) -> Approach:
    """Smallest distance of two segments at a common time: the minimum of a quadratic on an interval."""
    from_t, to_t = max(a.from_t, b.from_t), min(a.to_t, b.to_t)
    (start, scale), (end, _) = (relative(a, b, time) for time in (from_t, to_t))
    by = [after - before for before, after in zip(start, end)]
    rate = sum(x * y for x, y in zip(start, by))
    if rate >= 0:
        return Approach(sum(x * x for x in start), scale * scale, Fraction(from_t), pair)
    if sum(x * y for x, y in zip(end, by)) <= 0:
        return Approach(sum(x * x for x in end), scale * scale, Fraction(to_t), pair)
    speed = sum(x * x for x in by)
    above = sum(x * x for x in start) * speed - rate * rate
    return Approach(above, speed * scale * scale, from_t + Fraction((to_t - from_t) * -rate, speed), pair)


def relative(a: Segment, b: Segment, time: int) -> tuple[list[int], int]:
    """Numerators and denominator of the position of one vehicle relative to another."""
    (first, scale), (second, other) = a.at(time), b.at(time)
    return [y * scale - x * other for x, y in zip(first, second)], scale * other


def smallest(motion: Motion, best: Approach | None) -> Approach | None:
    """Smallest separation of all pairs at all times. The approach of one pair excludes distant pairs from the start."""
    tracks = motion.tracks
    times = sorted(segment.to_t for track in tracks for segment in track)
    edges = [motion.begin, *times[SEGMENTS * len(tracks) :: SEGMENTS * len(tracks)], motion.end]
    for span in zip(edges, edges[1:]):
        boxes: list[tuple[Vector, Vector, int]] = []
        for vehicle, track in enumerate(tracks):
            if segments := within(track, *span):
                ends = [*(segment.start for segment in segments), *(segment.end for segment in segments)]
                xs, ys, zs = zip(*ends)
                boxes.append(((min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs)), vehicle))
        if not boxes:
            continue
        axis = max(range(3), key=lambda k: max(low[k] for low, _, _ in boxes) - min(low[k] for low, _, _ in boxes))
        boxes.sort(key=lambda box: box[0][axis])
        for k, (low, high, vehicle) in enumerate(boxes):
            for other_low, other_high, other in boxes[k + 1 :]:
                # At least the best distance: its square is not below that of the best one.
                reach = None if best is None else math.isqrt(best.above // best.below) + 1
                if reach is not None and other_low[axis] - high[axis] >= reach:
                    break
                gaps = [max(c - b, a - d) for a, b, c, d in zip(low, high, other_low, other_high)]
                if reach is None or max(gaps) < reach:
                    approach = closest(tracks[vehicle], tracks[other], span, (vehicle, other))
                    best = approach if approach is not None and approach.is_closer(best) else best
    return best


def check(claim: Claim, data: bytes, accepted_s: dict[str, Exact]) -> list[str]:
    """Returns a claim in words, and the facts that the table does not contain. Raises `Denied` unless it is true."""
    if hashlib.sha256(data).hexdigest() != claim.sha256:
        raise Denied("the data is not that of the proof: its SHA-256 differs")
    table = Table(data)
    names = list(table.rows)
    for name in sorted(table.rows.keys() ^ claim.max_gaps_s.keys()):
        raise Denied(f"vehicle {shown(name)} is missing in the claim or in the data")
    unit = "ns" if table.is_dated else TIMES[table.header.time_name]
    if unit not in (None, claim.unit):
        raise Denied(f"the times are in {unit} by the table, not in {claim.unit}")
    moved_s = {name: by_s for name, by_s in claim.offsets_s.items() if by_s != 0}
    for name in sorted(moved_s.keys() | accepted_s.keys()):
        if name not in table.rows or moved_s.get(name, 0) != accepted_s.get(name, 0):
            text = moved_s[name].text if name in moved_s else "0"
            remedy = "accept it with --offset NAME=SECONDS"
            raise Denied(f"the clock of vehicle {shown(name)} is moved by {text} s, which no data show; {remedy}")
    if len({*claim.pair} & {*names}) != 2:
        raise Denied("the pair of the claim is not in the data")

    motion = table.motion(claim)
    pair = (names.index(claim.pair[0]), names.index(claim.pair[1]))
    own = closest(motion.tracks[pair[0]], motion.tracks[pair[1]], (motion.begin, motion.end), pair)
    best = smallest(motion, own)
    if best is None:
        raise Denied("no two vehicles are present at one time")

    # A gap may hide a violation if a second vehicle is present meanwhile.
    gaps = [(a.to_t, b.from_t) for track in motion.tracks for a, b in zip(track, track[1:]) if a.to_t < b.from_t]
    is_hidden = any(sum(begin < to_t and from_t < end for begin, end in motion.spans) > 1 for from_t, to_t in gaps)
    square = best.square(motion.places)
    expected = "violation" if square < claim.limit_m**2 else "undecided" if is_hidden else "clear"
    called = " and ".join(shown(names[vehicle]) for vehicle in best.pair)
    time = time_of(best.time / 10**motion.decimals, claim.unit, table.is_dated)
    found = f"never closer than {root(square)!r} m, {called} at {time} (limit {claim.limit_m.text} m)"
    if claim.status != expected:
        raise Denied(f"the table gives {expected}, not {claim.status}: {found}")
    margin_m = ROUNDING * Fraction(motion.largest, 10**motion.places)
    low_m, high_m = max(claim.separation_m - margin_m, Fraction(0)), claim.separation_m + margin_m
    if not low_m**2 <= square <= high_m**2:
        raise Denied(f"the separation is not {claim.separation_m.text} m: {found}")
    if own is None or own.square(motion.places) > high_m**2:
        raise Denied(f"the pair of the claim does not come as close: {found}")
    alone = [name for name, track in zip(names, motion.tracks) if is_alone(track, motion.spans)]
    return [f"{expected}, {found}", *assumptions(claim, table, motion, len(gaps), alone)]


def is_alone(track: list[Segment], spans: list[tuple[int, int]]) -> bool:
    """Whether a vehicle is never present together with another."""
    return not track or sum(b <= track[-1].to_t and track[0].from_t <= e for b, e in spans) < 2


def time_of(time: Fraction, unit: str, is_dated: bool) -> str:
    """A time of the table, rounded down to a millionth of its unit, or a nanosecond for dates."""
    if not is_dated:
        return f"t = {rounded(time)} {unit}"
    seconds, rest = divmod(math.floor(time), 10**9)
    return f"{(EPOCH + timedelta(seconds=seconds)).isoformat()[:19]}.{rest:09}Z"


def assumptions(claim: Claim, table: Table, motion: Motion, gaps: int, alone: list[str]) -> list[str]:
    """Every fact that the table does not contain, and every vehicle and time that is not judged."""
    per_second = PER_SECOND[claim.unit] * 10**motion.decimals
    longest_s = Fraction(max(segment.to_t - segment.from_t for track in motion.tracks for segment in track), per_second)
    column = f"the column {table.header.time_name}"
    unit = f"{column} is in {claim.unit}" if TIMES[table.header.time_name] else f"{column} is taken as {claim.unit}"
    limits_s = sorted({gap_s for gap_s in claim.max_gaps_s.values() if gap_s is not None})
    joined = "all samples of a vehicle are joined"
    if limits_s:
        most = "" if limits_s[0] == limits_s[-1] else f", by vehicle, and up to {limits_s[-1].text} s"
        joined = f"samples of a vehicle are joined up to {limits_s[0].text} s apart{most}"
        joined += ", or always for some" * (None in claim.max_gaps_s.values())
    facts = [
        f"time: {'the column of time holds dates' if table.is_dated else unit}",
        "clocks: the times of all vehicles are of one clock",
        "vehicles: each name in `id` is one vehicle",
        "positions: x, y and z are in metres, in one frame and without errors",
        f"motion: straight at constant speed between joined samples, which are up to {rounded(longest_s)} s apart",
        f"gaps: {joined}; longer gaps, not judged: {gaps}",
        "presence: no vehicle is present before its first or after its last sample",
    ]
    if table.header.unused:
        facts.append(f"columns that are not used: {', '.join(table.header.unused)}")
    if table.without_position:
        facts.append(f"rows without a position, in which the vehicle is not seen: {table.without_position}")
    facts += [f"clock of {shown(name)}, moved by {by_s.text} s" for name, by_s in claim.offsets_s.items() if by_s != 0]
    facts += [f"not judged, never present with another vehicle: {shown(name)}" for name in alone]
    return facts


def main(arguments: list[str]) -> int:
    paths, offsets_s = [], {}
    try:
        words = iter(arguments)
        for word in words:
            if word == "--offset":
                name, _, by_s = next(words, "").rpartition("=")
                offsets_s[name] = Exact(by_s)
            else:
                paths.append(word)
        proof_path, data_path = paths
    except ValueError:
        print("usage: python3 check_proof.py proof.json data.csv [--offset NAME=SECONDS ...]", file=sys.stderr)
        return 2
    try:
        with open(proof_path, "rb") as proof, open(data_path, "rb") as data:
            verdict, *facts = check(Claim(read_proof(proof.read())), data.read(), offsets_s)
        print(f"CONFIRMED: {verdict}")
        for fact in facts:
            print(f"assumes  {fact}")
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
