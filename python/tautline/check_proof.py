"""Checks a proof of `tautline audit DATA --proof proof.json` by exact arithmetic.

Usage: `python3 check_proof.py proof.json DATA... [--offset NAME=SECONDS ...] [--effort COMPARISONS]`.

Exits with 0 if the claim is confirmed, 1 if it is denied, and 2 if a file cannot be read. The program shares no code
with tautline and needs the standard library alone.

The claim is about vehicles that fly straight from sample to sample, or on polynomials. DATA is a CSV table, or the
`run.mcap` of `tautline run`, or the CSV files of curves, one for each vehicle in any order. Decimals and doubles are
taken without rounding.

The program computes the verdict and the extreme of each limit from the data alone, and compares them with the claim.
Every fact that the data do not contain is printed below the verdict.

Files are read by the rules of docs/proved.md. A file that could be read in a second way is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import struct
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime, timedelta, timezone
from fractions import Fraction
from itertools import pairwise, zip_longest
from reprlib import repr as short
from typing import Any

FORMAT, VERSION = "tautline proof", 3
# Columns of a table, and the unit of time that the name of a column gives.
TIMES = {"t_s": "s", "time_s": "s", "t": None, "time": None}
AXES, VELOCITIES = ("x", "y", "z"), ("vx", "vy", "vz")
# Columns that do not change the reading.
UNUSED = re.compile(r"v[xyz]|q[wxyz]|thrust_[1-4]_n|heading_rad|speed_m_s|wind_[xyz]_m_s|oldest_s|mean_s")
PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}

CELL = re.compile(r'(?:"([^"]*)"|([^",]*))(,|$)')
DECIMAL = re.compile(r"([+-]?)(\d+\.?\d*|\.\d+)(?:[eE]([+-]?\d+))?", re.ASCII)
DATE = re.compile(r"(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?([Zz]|[+-]\d\d:?[0-5]\d)", re.ASCII)
EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
# Longest text and largest exponent of a number, and its largest size. tautline has the same largest size.
LONGEST, LARGEST = 400, 10**70
# Difference of a claimed from a computed length that rounding explains, as a part of the largest coordinate. That of a
# speed, as a part of the speed.
ROUNDING, SPEED_ROUNDING = Fraction(1, 10**9), Fraction(1, 10**6)
# Number of segments of a vehicle in a window.
SEGMENTS = 8
# Number of comparisons after which a check ends without `--effort`, and bits of a coordinate up to which a comparison
# counts once.
EFFORT, USUAL_BITS = 20_000_000, 512
# Comparisons as which the exact distance of a line from an obstacle or from a wall counts.
EXACT_DISTANCE = 20
# Width of the interval in which tautline encloses the smallest separation of curves [m]. Highest degree of a curve.
# Number of times that a part of a curve is halved. Largest length of a number of a curve.
WIDTH_M, DEGREE, HALVINGS, CURVE_BITS = Fraction(1, 10**9), 15, 64, 256
# Largest number of limits of a claim.
LIMITS = 16

Vector = tuple[int, int, int]
# Digits and number of decimals.
Decimal = tuple[int, int]
# Time, position, and velocity if known.
Row = tuple[Decimal, list[Decimal], "list[Decimal] | None"]


class Denied(Exception):
    """The claim is not proved."""


class Unreadable(Exception):
    """A file is malformed, or is a table that could be read in a second way."""


class Effort:
    """Comparisons that are left. They bound the time for which a file of another author can keep the program busy."""

    def __init__(self) -> None:
        self.begin(EFFORT)

    def begin(self, most: int) -> None:
        self.most = self.left = most
        self.weight = 1

    def weigh(self, bits: int) -> None:
        """Sets the weight of a comparison of numbers of this length."""
        self.weight = 1 + bits // USUAL_BITS

    def spend(self, count: int = 1) -> None:
        self.left -= count * self.weight
        if self.left < 0:
            raise Denied(f"not decided by {self.most} comparisons; allow more with --effort COMPARISONS")


effort = Effort()


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

    def at(self, time: int | Fraction) -> tuple[Vector, int]:
        """Numerators and denominator of the position at a time within the segment."""
        above, below = time.numerator, time.denominator
        length = (self.to_t - self.from_t) * below
        if length == 0:
            return self.start, 1
        before, after = above - self.from_t * below, self.to_t * below - above
        (a, b, c), (d, e, f) = self.start, self.end
        return (a * after + d * before, b * after + e * before, c * after + f * before), length


class Approach:
    """Smallest distance of a pair: its square as a fraction, and the time."""

    __slots__ = ("above", "below", "time", "pair")

    def __init__(self, above: int, below: int, time: Fraction, pair: tuple[int, int]) -> None:
        self.above, self.below, self.time, self.pair = above, below, time, pair

    def square(self, unit: int) -> Fraction:
        """Squared distance, with `unit` units of length in 1."""
        return Fraction(self.above, self.below * unit * unit)

    def is_closer(self, other: Approach | None) -> bool:
        return other is None or self.above * other.below < other.above * self.below

    def is_below(self, limit: Fraction) -> bool:
        """Whether the distance is below a limit in units."""
        return self.above * limit.denominator**2 < limit.numerator**2 * self.below


class Motion:
    """Segments of each vehicle as integers: lengths in 1/metre m, times in 10^-decimals of the unit of time."""

    def __init__(self, names: list[str], tracks: list[list[Segment]], decimals: int, metre: int) -> None:
        self.names, self.tracks, self.decimals = names, tracks, decimals
        self.unit, self.is_dated, self.second = "s", False, 10**decimals
        # Units of length in 1 m, and in 1 m of height: they differ if lengths are scaled.
        self.metre, self.height = metre, metre
        self.begins = sorted(track[0].from_t for track in tracks if track)
        self.ends = sorted(track[-1].to_t for track in tracks if track)
        self.begin, self.end = (self.begins[0], self.ends[-1]) if self.begins else (0, 0)
        corners = (corner for track in tracks for segment in track for corner in (segment.start, segment.end))
        self.largest = max((abs(x) for corner in corners for x in corner), default=0)
        # Recorded velocities of each vehicle [m/s].
        self.velocities: list[list[list[Fraction]]] = [[] for _ in names]
        self.gaps = [(a.to_t, b.from_t) for track in tracks for a, b in pairwise(track) if a.to_t < b.from_t]

    def rounding(self) -> Fraction:
        """Difference of two lengths that rounding explains."""
        return ROUNDING * max(Fraction(self.largest, self.metre), Fraction(1, 1000))

    def is_hidden(self) -> bool:
        """Whether a gap may hide a violation of a pair: a second vehicle is present meanwhile."""
        return any(
            bisect_left(self.begins, to_t) - bisect_right(self.ends, from_t) > 1 for from_t, to_t in self.gaps
        )

    def is_alone(self, track: list[Segment]) -> bool:
        """Whether a vehicle is never present together with another."""
        if not track:
            return True
        return bisect_right(self.begins, track[-1].to_t) - bisect_left(self.ends, track[0].from_t) < 2

    def time(self, time: Fraction) -> str:
        """A time of the data, rounded down to a millionth of its unit, or a nanosecond for dates."""
        time /= 10**self.decimals
        if not self.is_dated:
            return f"t = {rounded(time)} {self.unit}"
        seconds, rest = divmod(math.floor(time), 10**9)
        return f"{(EPOCH + timedelta(seconds=seconds)).isoformat()[:19]}.{rest:09}Z"

    def stretched(self, axes: list[Exact]) -> Motion:
        """The motion with lengths divided by these numbers."""
        common = math.lcm(*(axis.numerator for axis in axes))
        a, b, c = (common * axis.denominator // axis.numerator for axis in axes)

        def scaled(place: Vector) -> Vector:
            return place[0] * a, place[1] * b, place[2] * c

        tracks = [[Segment(s.from_t, scaled(s.start), s.to_t, scaled(s.end)) for s in track] for track in self.tracks]
        other = Motion(self.names, tracks, self.decimals, self.metre * common)
        other.height, other.unit, other.is_dated = self.metre * c, self.unit, self.is_dated
        return other


def decimal(text: str) -> Decimal:
    """Digits and number of decimals of a decimal number."""
    match = DECIMAL.fullmatch(text) if len(text) <= LONGEST else None
    exponent = int(match[3] or 0) if match else LONGEST + 1
    if match is None or abs(exponent) > LONGEST:
        raise ValueError(f"must be a finite decimal number, or a time that is a date with a zone, got {short(text)}")
    whole, _, fraction = match[2].partition(".")
    digits, decimals = int(whole + fraction), len(fraction) - exponent
    if digits * 10 ** max(-decimals, 0) > LARGEST * 10 ** max(decimals, 0):
        raise ValueError(f"must be at most 1e70, got {short(text)}")
    return (-digits if match[1] == "-" else digits), decimals


def decimal_of(double: float) -> Decimal:
    """Digits and number of decimals of a double, which has finitely many."""
    if not abs(double) <= LARGEST:
        raise ValueError(f"must be a finite number of at most 1e70, got {double}")
    above, below = double.as_integer_ratio()
    decimals = below.bit_length() - 1
    return above * 5**decimals, decimals


def scaled(number: Decimal, decimals: int) -> int:
    return int(number[0] * 10 ** (decimals - number[1]))


def shown(name: str) -> str:
    """A name, quoted and escaped unless it is a plain word."""
    return name if re.fullmatch(r"[\w.:/#+-]+", name, re.ASCII) else ascii(name)


def rounded(number: Fraction) -> str:
    """A number, rounded down to six decimals."""
    millionths = math.floor(number * 10**6)
    whole, rest = divmod(abs(millionths), 10**6)
    return f"{'-' * (millionths < 0)}{whole}.{rest:06}".rstrip("0").rstrip(".")


def about(number: Fraction) -> str:
    """A positive number, rounded up to one digit."""
    exponent = math.floor(math.log10(number))
    digit = math.ceil(number / Fraction(10) ** exponent)
    return f"{digit}e{exponent}" if digit < 10 else f"1e{exponent + 1}"


def listed(numbers: Iterable[Exact]) -> str:
    return ", ".join(number.text for number in numbers)


def floor_of(number: Fraction) -> float:
    """A double that is not above a number, one of the two nearest."""
    nearest = float(number)
    return math.nextafter(nearest, -math.inf) if nearest > number else nearest


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


def above_0(value: Any, place: str) -> Exact:
    found = number(value, place, 0)
    if found == 0:
        raise Unreadable(f"proof: {place} must be above 0")
    return found


def numbers(value: Any, place: str, count: int, parse: Callable[[Any, str], Exact] = number) -> list[Exact]:
    if type(value) is not list or len(value) != count:
        raise Unreadable(f"proof: {place} must be a list of {count} numbers")
    return [parse(item, place) for item in value]


def text(value: Any, place: str) -> str:
    if type(value) is not str:
        raise Unreadable(f"proof: {place} must be a text")
    return value


def bits_of(value: Any) -> int:
    """Length of the longest number of a value of JSON."""
    if type(value) is Exact:
        return max(value.numerator.bit_length(), value.denominator.bit_length())
    more = value.values() if type(value) is dict else value if type(value) is list else ()
    return max(map(bits_of, more), default=0)


class Claim:
    """Content of a proof."""

    def __init__(self, proof: Any) -> None:
        self.bits = bits_of(proof)
        if type(proof) is not dict or proof.get("format") != FORMAT:
            raise Unreadable(f"proof: must be an object with format {FORMAT!r}")
        if type(proof.get("version")) is not Exact or proof["version"] != VERSION:
            old = "write the proof again with `tautline audit --proof`"
            raise Unreadable(f"proof: version {short(proof.get('version'))} is not supported, {VERSION} is; {old}")
        _, _, data, claim, assumed = keys(proof, "it", "format", "version", "data", "claim", "assumed")
        self.data_format, recording, self.sha256 = keys(data, "data", "format", "recording", "sha256")
        # Curves have a file for each vehicle.
        is_curved = self.data_format in ("crazyflie", "bezier")
        self.hashes = self.sha256 if is_curved else {"": self.sha256}
        if type(self.hashes) is not dict or not all(type(sha256) is str for sha256 in self.hashes.values()):
            raise Unreadable("proof: data.sha256 is malformed or not supported")
        self.status, motion, limits = keys(claim, "claim", "status", "motion", "limits")
        self.unit, max_gaps_s, offsets_s = keys(assumed, "assumed", "time_unit", "max_gaps_s", "offsets_s")
        for place, is_met in (
            ("data.format (csv, run, crazyflie, bezier)", is_curved or self.data_format in ("csv", "run")),
            ("data.recording", type(recording) is str),
            ("claim.motion (linear, polynomial)", motion == ("polynomial" if is_curved else "linear")),
            ("claim.status (clear, violation)", self.status in ("clear", "violation")),
            (f"claim.limits (1 to {LIMITS})", type(limits) is list and 1 <= len(limits) <= LIMITS),
            ("assumed.time_unit (s, ms, us, ns)", type(self.unit) is str and self.unit in PER_SECOND),
            ("assumed.max_gaps_s", type(max_gaps_s) is dict),
            ("assumed.offsets_s", type(offsets_s) is dict),
        ):
            if not is_met:
                raise Unreadable(f"proof: {place} is malformed or not supported")
        self.limits = [limit_of(limit, f"claim.limits[{k}]") for k, limit in enumerate(limits)]
        if is_curved and not all(limit.judges_curves() for limit in self.limits):
            raise Unreadable("proof: claim.limits of curves must be distance or ellipsoid, without above_m")
        self.offsets_s = {name: number(by_s, "assumed.offsets_s") for name, by_s in offsets_s.items()}
        # Null joins all samples of a vehicle.
        self.max_gaps_s = {
            name: None if gap_s is None else number(gap_s, "assumed.max_gaps_s", 0)
            for name, gap_s in max_gaps_s.items()
        }


def limit_of(value: Any, place: str) -> Limit:
    kind = value.get("kind") if type(value) is dict else None
    if type(kind) is not str or kind not in KINDS:
        raise Unreadable(f"proof: {place}.kind ({', '.join(KINDS)}) is malformed or not supported")
    return KINDS[kind](value, place)


# The data.


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

    def __init__(self, line: str, needs_velocities: bool) -> None:
        names = split(line)
        times, needed = [name for name in names if name in TIMES], ("id", *AXES)
        used = VELOCITIES if needs_velocities else ()
        self.unused = [name for name in names if UNUSED.fullmatch(name) and name not in used]
        others = [name for name in names if name not in (*times, *needed, *used, *self.unused)]
        if others:
            remedy = "audit a table without it, as `tautline export` writes"
            raise Unreadable(f"data: column {shown(others[0])} could change the reading; {remedy}")
        if len(times) != 1 or len({*names}) < len(names) or not {*needed} <= {*names}:
            one_of = "one of t_s, time_s, t and time"
            raise Unreadable(f"data: must have the columns id, x, y, z and {one_of}, and no column twice")
        known = [name for name in used if name in names]
        if known and len(known) < len(VELOCITIES):
            raise Unreadable("data: must have each of the columns vx, vy and vz, or none")
        self.count, self.time_name = len(names), times[0]
        self.time, self.id = names.index(times[0]), names.index("id")
        self.axes, self.velocity = [names.index(axis) for axis in AXES], [names.index(name) for name in known]


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
    """Rows of a table, by vehicle, in the order of the file."""

    def __init__(self, data: bytes, needs_velocities: bool) -> None:
        lines = lines_of(data)
        header = Header(next(lines, (0, ""))[1], needs_velocities)
        self.rows: dict[str, list[Row]] = {}
        self.time_name, self.is_dated, self.facts = f"the column {header.time_name}", False, []
        without_position, dated = 0, set()
        for place, line in lines:
            try:
                cells = split(line)
                if len(cells) != header.count or not cells[header.id]:
                    raise ValueError(f"must have {header.count} cells, and the name of a vehicle")
                time, position = cells[header.time], [cells[axis] for axis in header.axes]
                velocity = [cells[axis] for axis in header.velocity]
                date = DATE.fullmatch(time)
                dated.add(date is not None)
                if len(dated) > 1:
                    raise ValueError("must have a date as time if other rows have, and a number otherwise")
                at = (nanoseconds(date), 0) if date else decimal(time)
                here = [decimal(cell) for cell in position] if any(position) else None
                row_velocity = [decimal(cell) for cell in velocity] if any(velocity) else None
            except (ValueError, ArithmeticError) as error:
                raise Unreadable(f"data, line {place}: {error}") from error
            rows = self.rows.setdefault(cells[header.id], [])
            # Without a position the vehicle is not seen.
            if here:
                rows.append((at, here, row_velocity))
            else:
                without_position += 1
        self.is_dated = dated == {True}
        self.unit = "ns" if self.is_dated else TIMES[header.time_name]
        spellings: dict[str, str] = {}
        for name in self.rows:
            other = spellings.setdefault(spelling(name), name)
            if other != name:
                raise Unreadable(f"data: the names {shown(other)} and {shown(name)} could mean one vehicle")
        if header.unused:
            self.facts.append(f"columns that are not used: {', '.join(header.unused)}")
        if without_position:
            self.facts.append(f"rows without a position, in which the vehicle is not seen: {without_position}")


def spelling(name: str) -> str:
    """A name without case, zeros before a number, and marks that are not between two digits; the value of a number."""
    if DECIMAL.fullmatch(name):
        try:
            return f"number {Exact(name)}"
        except ValueError:
            return name
    return re.sub(r"(?<!\d)0+(?=\d)|(?<!\d)[\W_]|[\W_](?!\d)", "", name.casefold())


class Fields:
    """Numbers and texts of MCAP and CDR, one after the other."""

    def __init__(self, data: bytes, begin: int = 0) -> None:
        self.data, self.place, self.begin = data, begin, begin

    def take(self, count: int) -> bytes:
        if count > len(self.data) - self.place:
            raise Unreadable(f"data: a record is longer than its place, which has {len(self.data)} bytes")
        self.place += count
        return self.data[self.place - count : self.place]

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        return self.take(self.number(4)).decode()

    def double(self) -> float:
        (found,) = struct.unpack("<d", self.take(8))
        return float(found)

    def align(self, size: int) -> None:
        self.take(-(self.place - self.begin) % size)

    def doubles(self) -> tuple[float, ...]:
        """A sequence of CDR."""
        self.align(4)
        count = self.number(4)
        if count:
            self.align(8)
        return struct.unpack(f"<{count}d", self.take(8 * count))

    def records(self) -> Iterator[tuple[int, Fields]]:
        """Type and content of each record of MCAP up to the end."""
        while self.place < len(self.data):
            kind, size = self.number(1), self.number(8)
            yield kind, Fields(self.take(size))


class Run:
    """Samples of the `run.mcap` of `tautline run`: the messages on /swarm, whose layout is in
    crates/recordings/src/mcap/swarm.msg. The file has no compression."""

    MAGIC = b"\x89MCAP0\r\n"
    FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06

    def __init__(self, data: bytes, needs_velocities: bool) -> None:
        # A footer has 29 bytes.
        if not (data.startswith(self.MAGIC) and data.endswith(self.MAGIC) and data[-37:-36] == b"\x02"):
            raise Unreadable("data: must be a run.mcap that was closed")
        self.schemas: dict[int, str] = {}
        self.channels: dict[int, str] = {}
        self.rows: dict[str, list[Row]] = {}
        self.steps: list[int] = []
        self.needs_velocities = needs_velocities
        self.take(Fields(data[: -len(self.MAGIC)], len(self.MAGIC)))
        self.time_name, self.unit, self.is_dated = "the time of a sample", "s", False
        if not self.rows:
            raise Unreadable("data: must have samples on /swarm")
        is_whole = self.steps == [*range(self.steps[0], self.steps[0] + len(self.steps))]
        count = f"{len(self.steps)} samples"
        self.facts = [f"samples: {count}, {'of successive steps of the run' if is_whole else 'not of each step'}"]

    def take(self, fields: Fields, is_chunk: bool = False) -> None:
        has_ended = False
        for kind, record in fields.records():
            if has_ended or (is_chunk and kind in (self.CHUNK, self.FOOTER)):
                raise Unreadable("data: must have one footer, at the end, and no chunk in a chunk")
            if kind == self.CHUNK:
                record.take(8 + 8 + 8 + 4)
                if record.text():
                    raise Unreadable("data: must have no compressed chunk")
                self.take(Fields(record.take(record.number(8))), is_chunk=True)
            elif kind == self.SCHEMA:
                schema = record.number(2)
                self.schemas[schema] = f"{record.text()} {record.text()}"
            elif kind == self.CHANNEL:
                channel, schema, topic = record.number(2), record.number(2), record.text()
                if topic == "/swarm":
                    self.channels[channel] = f"{self.schemas.get(schema, '')} {record.text()}"
            elif kind == self.MESSAGE and record.number(2) in self.channels:
                record.take(4 + 8 + 8)
                self.sample(record)
            elif kind == self.FOOTER:
                has_ended = True
        if [*self.channels.values()] not in ([], ["tautline_msgs/msg/Swarm ros2msg cdr"]):
            raise Unreadable("data: must have one channel /swarm with messages tautline_msgs/msg/Swarm in CDR")

    def sample(self, record: Fields) -> None:
        if record.take(4)[:2] != b"\x00\x01":
            raise Unreadable("data: a sample must be in little-endian CDR")
        fields = Fields(record.data, record.place)
        time_s, step = fields.double(), fields.number(8)
        positions, velocities = fields.doubles(), fields.doubles()
        count = len(positions) if not self.rows else 3 * len(self.rows)
        if not len(positions) == len(velocities) == count or count % 3:
            raise Unreadable("data: must have three coordinates of each vehicle in each sample")
        try:
            at = decimal_of(time_s)
            self.steps.append(step)
            for vehicle in range(len(positions) // 3):
                here, velocity = (
                    [decimal_of(x) for x in of[3 * vehicle : 3 * vehicle + 3]] if needed else None
                    for of, needed in ((positions, True), (velocities, self.needs_velocities))
                )
                self.rows.setdefault(str(vehicle + 1), []).append((at, here or [], velocity))
        except ValueError as error:
            raise Unreadable(f"data, sample {len(self.steps)}: {error}") from error


def motion_of(data: Table | Run, claim: Claim) -> Motion:
    """Segments of the vehicles, in the order of the rows."""
    per_second = PER_SECOND[claim.unit]

    def units(seconds: Exact) -> Decimal:
        digits, amount = decimal(seconds.text)
        return digits * per_second, amount

    shifts = {name: units(by_s) for name, by_s in claim.offsets_s.items()}
    max_gaps = {name: None if gap_s is None else units(gap_s) for name, gap_s in claim.max_gaps_s.items()}
    given = [*shifts.values(), *(gap for gap in max_gaps.values() if gap is not None)]
    rows = [row for rows in data.rows.values() for row in rows]
    decimals = max(0, *(amount for _, amount in given), *(time[1] for time, _, _ in rows), 0)
    places = max(0, *(x[1] for _, place, _ in rows for x in place), 0)
    tracks = []
    for name, rows in data.rows.items():
        shift, gap = scaled(shifts.get(name, (0, 0)), decimals), max_gaps[name]
        max_gap = None if gap is None else scaled(gap, decimals)
        tracks.append(segments_of(name, rows, (decimals, places), shift, max_gap))
    motion = Motion([*data.rows], tracks, decimals, 10**places)
    motion.unit, motion.is_dated, motion.second = claim.unit, data.is_dated, per_second * 10**decimals
    for velocities, rows in zip(motion.velocities, data.rows.values()):
        velocities += [[Fraction(x[0]) / Fraction(10) ** x[1] for x in v] for _, _, v in rows if v is not None]
    return motion


def segments_of(
    name: str, rows: list[Row], scale: tuple[int, int], shift: int, max_gap: int | None
) -> list[Segment]:
    """Segments of a vehicle in order of time. A sample behind a gap is a segment without a length."""
    found: list[Segment] = []
    for time, place, _ in rows:
        x, y, z = (scaled(number, scale[1]) for number in place)
        now, here = scaled(time, scale[0]) + shift, (x, y, z)
        last = found[-1] if found else None
        # Identical rows count once.
        if last is not None and (now, here) == (last.to_t, last.end):
            continue
        if last is not None and now <= last.to_t:
            at = rounded(Fraction(time[0]) / Fraction(10) ** time[1])
            raise Unreadable(f"data: vehicle {shown(name)} is at two places at t = {at}, or goes back in time")
        is_joined = last is not None and (max_gap is None or now - last.to_t <= max_gap)
        begin = (last.to_t, last.end) if last is not None and is_joined else (now, here)
        found.append(Segment(*begin, now, here))
    return found


class Piece:
    """A part of a curve: interval of time [s], and a polynomial of each axis, the constant first, in the time since the
    start. A jump lasts no time, and is a straight line over the shares from 0 to 1."""

    def __init__(self, from_s: Fraction, to_s: Fraction, axes: list[list[Fraction]]) -> None:
        self.from_s, self.to_s, self.axes = from_s, to_s, axes
        self.corners = [*zip(*map(bernstein, self.over(from_s, to_s)))]
        self.low, self.high = ([least(axis) for axis in zip(*self.corners)] for least in (min, max))

    def is_jump(self) -> bool:
        return self.from_s == self.to_s

    def over(self, from_s: Fraction, to_s: Fraction) -> list[list[Fraction]]:
        """Polynomials in the share of an interval within the piece."""
        if self.is_jump():
            return self.axes
        return [substituted(axis, from_s - self.from_s, to_s - from_s) for axis in self.axes]


def substituted(coefficients: list[Fraction], start: Fraction, length: Fraction) -> list[Fraction]:
    """Coefficients of a polynomial of start + length u, in u."""
    found = [*coefficients]
    for lowest in range(len(found) - 1):
        for k in range(len(found) - 2, lowest - 1, -1):
            found[k] += found[k + 1] * start
    return [coefficient * length**k for k, coefficient in enumerate(found)]


def bernstein(coefficients: list[Fraction]) -> list[Fraction]:
    """Coefficients in the basis of Bernstein on the shares from 0 to 1, between which the polynomial is."""
    n = len(coefficients) - 1
    return [
        sum((Fraction(math.comb(j, k), math.comb(n, k)) * coefficients[k] for k in range(j + 1)), Fraction(0))
        for j in range(n + 1)
    ]


def least_share(coefficients: list[Fraction]) -> Fraction | None:
    """A share from 0 to 1 at which a polynomial is negative; None if it is negative nowhere.

    The first and the last coefficient of a part in the basis of Bernstein are values, and the least is a lower bound. A
    part that they do not decide is halved."""
    values = bernstein(coefficients)
    common = math.lcm(*(value.denominator for value in values))
    parts = [([int(value * common) for value in values], Fraction(0), Fraction(1))]
    while parts:
        controls, begin, length = parts.pop()
        effort.spend(EXACT_DISTANCE)
        for value, share in ((controls[0], begin), (controls[-1], begin + length)):
            if value < 0:
                return share
        if min(controls) >= 0:
            continue
        if length.denominator >> HALVINGS:
            raise Denied("the distance of two curves is so near to a limit that it is not decided")
        # Each row has the sums of neighbours in the row before: twice their mean.
        rows = [controls]
        while len(rows[-1]) > 1:
            rows.append([a + b for a, b in pairwise(rows[-1])])
        n = len(controls) - 1
        first = [row[0] << (n - k) for k, row in enumerate(rows)]
        second = [row[-1] << (n - k) for k, row in enumerate(rows)][::-1]
        parts += [(second, begin + length / 2, length / 2), (first, begin, length / 2)]
    return None


class Curves:
    """Curves of vehicles in the files of the trajectories of Crazyflies, or of Bezier curves: a row for each piece."""

    POWER, POINT = re.compile(r"(x|y|z|yaw)\^(\d{1,2})"), re.compile(r"p(\d{1,2})([xyz])")

    def __init__(self, contents: dict[str, bytes], is_bezier: bool) -> None:
        self.names = [*contents]
        self.longest = 0
        self.tracks = [self.pieces(name, content, is_bezier) for name, content in contents.items()]
        ends_m = (abs(x) for track in self.tracks for piece in track for corner in piece.corners for x in corner)
        self.largest_m = max(ends_m)

    def pieces(self, name: str, content: bytes, is_bezier: bool) -> list[Piece]:
        lines = lines_of(content)
        header = [column.lower() for column in split(next(lines, (0, ""))[1])]
        pattern = self.POINT if is_bezier else self.POWER
        places = {}
        for place, column in enumerate(header):
            if match := pattern.fullmatch(column):
                axis, number = reversed(match.groups()) if is_bezier else match.groups()
                places[axis, int(number)] = place
        count = max((number for _, number in places), default=-1) + 1
        needed = {(axis, number) for axis in AXES for number in range(count)}
        more = {("yaw", number) for number in range(count)} & places.keys()
        is_whole = header[:1] == ["duration"] and len(places) == len(header) - 1 and places.keys() == needed | more
        if not is_whole or not 0 < count <= DEGREE + 1:
            kind = "p0x,p0y,p0z,p1x,..." if is_bezier else "x^0,...,y^0,...,z^0,..., with yaw^0,... or without"
            raise Unreadable(f"data of {shown(name)}: must have the header duration,{kind}, up to the degree {DEGREE}")
        track: list[Piece] = []
        now = Fraction(0)
        for place, line in lines:
            try:
                cells = split(line)
                if len(cells) != len(header):
                    raise ValueError(f"must have {len(header)} cells")
                values = [Exact(cell) for cell in cells]
                if max(map(bits_of, values)) > CURVE_BITS:
                    raise ValueError("must have numbers with at most 70 digits")
            except (ValueError, ArithmeticError) as error:
                raise Unreadable(f"data of {shown(name)}, line {place}: {error}") from error
            if values[0] <= 0:
                raise Unreadable(f"data of {shown(name)}, line {place}: the duration must be above 0")
            axes = [[Fraction(values[places[axis, number]]) for number in range(count)] for axis in AXES]
            if is_bezier:
                axes = [powers(axis, values[0]) for axis in axes]
            # The numbers of a polynomial grow with its degree, and the time of an operation with the square of both.
            self.longest = max(self.longest, count * max(map(bits_of, values)))
            effort.weigh(self.longest)
            effort.weight **= 2
            effort.spend(EXACT_DISTANCE)
            piece = Piece(now, now + values[0], axes)
            if track and track[-1].corners[-1] != piece.corners[0]:
                ends = zip(track[-1].corners[-1], piece.corners[0])
                track.append(Piece(now, now, [[before, after - before] for before, after in ends]))
            track.append(piece)
            now = piece.to_s
        if not track:
            raise Unreadable(f"data of {shown(name)}: must have a row for each piece")
        return track

    def facts(self) -> list[str]:
        jumps = [math.dist(*piece.corners) for track in self.tracks for piece in track if piece.is_jump()]
        return [
            "clocks: all curves begin at the time 0 of one clock",
            "positions: lengths are in metres, in one frame, and times in seconds",
            "motion: each vehicle follows the polynomials of its file exactly",
            f"jumps: {len(jumps)} between pieces, up to {max(jumps, default=0.0)!r} m, taken as straight and instant",
            "presence: no vehicle is present after the end of its curve",
        ]


def powers(points: list[Fraction], duration_s: Fraction) -> list[Fraction]:
    """Coefficients of the powers of time of a Bezier curve.

    The k-th is C(n, k) times the k-th forward difference of the points, over the k-th power of the duration."""
    found, n = [], len(points) - 1
    for k in range(n + 1):
        found.append(math.comb(n, k) * points[0] / duration_s**k)
        points = [after - before for before, after in pairwise(points)]
    return found


# The smallest separation.


def within(track: list[Segment], from_t: int, to_t: int) -> list[Segment]:
    """Segments of a vehicle that share a time with an interval."""
    begin = bisect_left(track, from_t, key=lambda segment: segment.to_t)
    return track[begin : bisect_right(track, to_t, key=lambda segment: segment.from_t)]


def meetings(
    first: list[Segment], second: list[Segment], span: tuple[int, int], above: Fraction | None
) -> Iterator[tuple[Segment, Segment, Fraction | int, Fraction | int]]:
    """Segments of two vehicles and their common times, which share a time with an interval. `above` is the height at or
    below which both vehicles must not be."""
    for a in within(first, *span):
        for b in within(second, max(span[0], a.from_t), min(span[1], a.to_t)):
            effort.spend()
            from_t, to_t = max(a.from_t, b.from_t), min(a.to_t, b.to_t)
            lows = [low(segment, from_t, to_t, above) for segment in (a, b)] if above is not None else []
            ends = [low for low in lows if low is not None]
            if len(ends) < 2 or max(ends)[0] > min(end for _, end in ends):
                yield a, b, from_t, to_t
                continue
            for begin, end in ((from_t, max(ends)[0]), (min(end for _, end in ends), to_t)):
                if begin < end:
                    yield a, b, begin, end


def low(segment: Segment, from_t: int, to_t: int, height: Fraction) -> tuple[Fraction | int, Fraction | int] | None:
    """Part of an interval in which a vehicle is at or below a height."""
    (before, after) = (Fraction(place[2], scale) - height for place, scale in map(segment.at, (from_t, to_t)))
    if before <= 0 and after <= 0:
        return from_t, to_t
    if before > 0 and after > 0:
        return None
    crossing = from_t + (to_t - from_t) * before / (before - after)
    return (from_t, crossing) if before <= 0 else (crossing, to_t)


def closest_on_lines(
    a: Segment, b: Segment, from_t: Fraction | int, to_t: Fraction | int, pair: tuple[int, int]
) -> Approach:
    """Smallest distance of two segments in an interval: the minimum of a quadratic on an interval."""
    start, end, scale = relative(a, b, from_t, to_t)
    by = [after - before for before, after in zip(start, end)]
    rate = sum(x * y for x, y in zip(start, by))
    if rate >= 0:
        return Approach(sum(x * x for x in start), scale * scale, Fraction(from_t), pair)
    if sum(x * y for x, y in zip(end, by)) <= 0:
        return Approach(sum(x * x for x in end), scale * scale, Fraction(to_t), pair)
    speed = sum(x * x for x in by)
    above = sum(x * x for x in start) * speed - rate * rate
    return Approach(above, speed * scale * scale, from_t + Fraction((to_t - from_t) * -rate, speed), pair)


def relative(
    a: Segment, b: Segment, from_t: Fraction | int, to_t: Fraction | int
) -> tuple[list[int], list[int], int]:
    """Numerators of the position of one vehicle relative to another at two times, and their denominator."""
    ends, scales = [], []
    for time in (from_t, to_t):
        (first, scale), (second, other) = a.at(time), b.at(time)
        ends.append([y * scale - x * other for x, y in zip(first, second)])
        scales.append(scale * other)
    if scales[0] != scales[1]:
        ends = [[x * other for x in end] for end, other in zip(ends, reversed(scales))]
        scales[0] *= scales[1]
    return ends[0], ends[1], scales[0]


def candidates(
    motion: Motion, reach: Callable[[], tuple[int, int, int] | None]
) -> Iterator[tuple[int, int, tuple[int, int]]]:
    """Pairs of vehicles and windows of time in which they may be closer along each axis than a reach. It may fall."""
    tracks = motion.tracks
    times = sorted(segment.to_t for track in tracks for segment in track)
    edges = [motion.begin, *times[SEGMENTS * len(tracks) :: SEGMENTS * len(tracks)], motion.end]
    for span in pairwise(edges):
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
                effort.spend()
                most = reach()
                if most is not None and other_low[axis] - high[axis] >= most[axis]:
                    break
                gaps = [max(c - b, a - d) for a, b, c, d in zip(low, high, other_low, other_high)]
                if most is None or all(gap < x for gap, x in zip(gaps, most)):
                    yield vehicle, other, span


# The limits.


class Limit:
    """Limit of a claim: `judge` returns the verdict and what was found, or raises `Denied`."""

    KEYS: tuple[str, ...] = ()
    # Whether recorded velocities count.
    has_speed = False

    def __init__(self, value: Any, place: str) -> None:
        self.kind, self.status, *self.values = keys(value, place, "kind", "status", *self.KEYS)
        if self.status not in ("clear", "violation"):
            raise Unreadable(f"proof: {place}.status (clear, violation) is malformed or not supported")

    def judge(self, motion: Any) -> tuple[str, str]:
        raise NotImplementedError

    def judges_curves(self) -> bool:
        return False

    def facts(self) -> list[str]:
        return []

    def compare(self, expected: str, found: str) -> None:
        if self.status != expected:
            raise Denied(f"the data give {expected}, not {self.status}: {found}")


def vehicle_of(motion: Motion, name: str) -> int:
    if name not in motion.names:
        raise Denied(f"vehicle {shown(name)} of the claim is not in the data")
    return motion.names.index(name)


class PairLimit(Limit):
    """Limit of the separation of any two vehicles, with the smallest separation and its pair."""

    MORE = ("smallest", "pair", "above_m")

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        smallest, pair, above_m = self.values[-3:]
        if type(pair) is not list or [*map(type, pair)] != [str, str]:
            raise Unreadable(f"proof: {place}.pair is malformed or not supported")
        self.smallest, self.pair = number(smallest, f"{place}.smallest", 0), pair
        self.above_m = None if above_m is None else number(above_m, f"{place}.above_m")

    def members(self, motion: Motion | Curves) -> tuple[int, int]:
        if len({*self.pair} & {*motion.names}) != 2:
            raise Denied("the pair of the claim is not in the data")
        return motion.names.index(self.pair[0]), motion.names.index(self.pair[1])

    def called(self, motion: Motion | Curves, pair: tuple[int, int]) -> str:
        return " and ".join(shown(motion.names[vehicle]) for vehicle in pair)

    def facts(self) -> list[str]:
        exempt = "pairs are not judged while both vehicles are at or below the height of"
        return [] if self.above_m is None else [f"ground: {exempt} {self.above_m.text} m"]


class Distance(PairLimit):
    """Limit of the distance in metres, or of the distance in half axes of an ellipsoid."""

    KEYS = ("delta_m", "radii_m", *PairLimit.MORE)
    unit = "m"

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        delta_m, radii_m = self.values[:2]
        if type(radii_m) is not dict:
            raise Unreadable(f"proof: {place}.radii_m is malformed or not supported")
        self.radii_m = {name: number(radius_m, f"{place}.radii_m", 0) for name, radius_m in radii_m.items()}
        self.delta = None if delta_m is None and radii_m else above_0(delta_m, f"{place}.delta_m")

    def lengths(self, motion: Motion) -> Motion:
        """The motion in lengths of the limit."""
        return motion

    def limit(self, names: list[str]) -> Fraction:
        """Limit of two vehicles."""
        return max(self.delta or Fraction(0), sum((self.radii_m.get(name, Fraction(0)) for name in names), Fraction(0)))

    def limit_text(self) -> str:
        texts = [] if self.delta is None else [f"limit {self.delta.text} {self.unit}"]
        return " or ".join([*texts, *["sum of the radii"] * bool(self.radii_m)])

    def facts(self) -> list[str]:
        radii = [f"radius of {shown(name)}: {radius_m.text} m" for name, radius_m in self.radii_m.items()]
        return [*super().facts(), *radii]

    def judges_curves(self) -> bool:
        return self.above_m is None

    def scales(self) -> list[Fraction]:
        """Factors of the lengths along each axis."""
        return [Fraction(1)] * 3

    def judge(self, motion: Motion | Curves) -> tuple[str, str]:
        for name in sorted(self.radii_m.keys() ^ {*motion.names} if self.radii_m else ()):
            raise Denied(f"vehicle {shown(name)} has no radius, or is not in the data")
        return self.judge_curves(motion) if isinstance(motion, Curves) else self.judge_lines(motion)

    def judge_curves(self, curves: Curves) -> tuple[str, str]:
        pair, scales = self.members(curves), self.scales()
        rounding = (2 * WIDTH_M + ROUNDING * curves.largest_m) * max(scales)
        lower, upper = self.smallest - rounding, self.smallest + rounding

        def cases(pairs: Iterable[tuple[int, int]]) -> Iterator[Case]:
            for first, second in pairs:
                limit = self.limit([curves.names[first], curves.names[second]])
                for meeting in curve_meetings(curves.tracks[first], curves.tracks[second]):
                    yield limit, lambda distance: time_below(*meeting, scales, distance) is not None

        count = len(curves.names)
        own = (time_below(*meeting, scales, upper) for meeting in curve_meetings(*(curves.tracks[k] for k in pair)))
        time = next((time for time in own if time is not None), None)
        called = self.called(curves, pair)
        if time is None:
            raise Denied(f"the pair of the claim does not come as close: {called}, {self.smallest.text} {self.unit}")
        every = ((first, second) for first in range(count) for second in range(first + 1, count))
        is_violated, is_lower = decide_both(cases(every), max(lower, Fraction(0)))
        found = f"never closer than {floor_of(max(lower, Fraction(0)))!r} {self.unit}, {called} within "
        found += f"{about(2 * rounding)} {self.unit} of this at t = {rounded(time)} s ({self.limit_text()})"
        self.compare("violation" if is_violated else "clear", found)
        if is_lower:
            raise Denied(f"another pair comes closer: {found}")
        return self.status, found

    def judge_lines(self, motion: Motion) -> tuple[str, str]:
        motion, pair = self.lengths(motion), self.members(motion)
        names, metre = motion.names, motion.metre
        above = None if self.above_m is None else self.above_m * motion.height
        radii = sorted((self.radii_m.get(name, Fraction(0)) for name in names), reverse=True)
        largest = math.ceil(max(self.delta or Fraction(0), sum(radii[:2], Fraction(0))) * metre)
        is_violated = False

        def closest(first: int, second: int, span: tuple[int, int]) -> Approach | None:
            nonlocal is_violated
            least = None
            for meeting in meetings(motion.tracks[first], motion.tracks[second], span, above):
                approach = closest_on_lines(*meeting, (first, second))
                least = approach if approach.is_closer(least) else least
            if least is not None:
                is_violated = is_violated or least.is_below(self.limit([names[first], names[second]]) * metre)
            return least

        own = closest(*pair, (motion.begin, motion.end))
        best = own

        def reach() -> tuple[int, int, int] | None:
            # A pair that is not closer along an axis neither is the closest nor violates the limit.
            least = math.isqrt(best.above // best.below) + 1 if best is not None else 0
            most = least if is_violated else max(least, largest)
            return None if best is None else (most, most, most)

        for first, second, span in candidates(motion, reach):
            approach = closest(first, second, span)
            best = approach if approach is not None and approach.is_closer(best) else best
        if best is None:
            raise Denied("no two vehicles are present at one time" + " above the ground" * (above is not None))
        square = best.square(metre)
        time = motion.time(best.time)
        found = f"never closer than {root(square)!r} {self.unit}, {self.called(motion, best.pair)} at {time} "
        found += f"({self.limit_text()})"
        self.compare("violation" if is_violated else "undecided" if motion.is_hidden() else "clear", found)
        low, high = max(self.smallest - motion.rounding(), Fraction(0)), self.smallest + motion.rounding()
        if not low**2 <= square <= high**2:
            raise Denied(f"the separation is not {self.smallest.text} {self.unit}: {found}")
        if own is None or own.square(metre) > high**2:
            raise Denied(f"the pair of the claim does not come as close: {found}")
        return self.status, found


class Ellipsoid(Distance):
    """Limit of the distance of vehicles in half axes: two ellipsoids touch at 2."""

    KEYS = ("half_axes_m", "scaled", *PairLimit.MORE)
    unit = "half axes"

    def __init__(self, value: Any, place: str) -> None:
        PairLimit.__init__(self, value, place)
        half_axes_m, scaled = self.values[:2]
        self.axes_m = numbers(half_axes_m, f"{place}.half_axes_m", 3, above_0)
        self.radii_m, self.scaled = {}, above_0(scaled, f"{place}.scaled")
        self.delta = self.scaled

    def lengths(self, motion: Motion) -> Motion:
        return motion.stretched(self.axes_m)

    def scales(self) -> list[Fraction]:
        return [1 / axis_m for axis_m in self.axes_m]

    def limit_text(self) -> str:
        return f"limit {self.scaled.text}, ellipsoids of {listed(self.axes_m)} m"


class Cylinder(PairLimit):
    """Limit of the larger of horizontal distance over R and vertical distance over H: no vehicle enters the cylinder
    around another."""

    KEYS = ("horizontal_m", "vertical_m", *PairLimit.MORE)

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        self.horizontal_m, self.vertical_m = (above_0(value, f"{place}, a length") for value in self.values[:2])

    def judge(self, motion: Motion) -> tuple[str, str]:
        pair = self.members(motion)
        above = None if self.above_m is None else self.above_m * motion.height
        reach_m = self.horizontal_m, self.horizontal_m, self.vertical_m
        rounding = motion.rounding() / min(reach_m) + ROUNDING
        lower, upper = self.smallest - rounding, self.smallest + rounding

        def cases(pairs: Iterable[tuple[int, int, tuple[int, int]]]) -> Iterator[Case]:
            for first, second, span in pairs:
                for meeting in meetings(motion.tracks[first], motion.tracks[second], span, above):
                    is_seen.add(True)
                    yield Fraction(1), lambda distance: self.is_below(motion, meeting, distance)

        is_seen: set[bool] = set()
        most = math.ceil(max(lower, Fraction(1)) * motion.metre)
        own = [(*pair, (motion.begin, motion.end))]
        is_violated, is_lower = decide(cases(own), Fraction(1)), decide(cases(own), upper)
        if not is_seen:
            raise Denied("the pair of the claim is never present together")
        found = f"scaled distance at least {self.smallest.text} within {about(rounding)}, {self.called(motion, pair)} "
        found += f"(cylinder of {self.horizontal_m.text} m and {self.vertical_m.text} m)"
        if not is_lower:
            raise Denied(f"the pair of the claim does not come as close: {found}")
        across, along = (math.ceil(m * most) for m in (self.horizontal_m, self.vertical_m))
        every = candidates(motion, lambda: (across, across, along))
        is_violated, is_lower = decide_both(cases(every), lower, is_violated)
        self.compare("violation" if is_violated else "undecided" if motion.is_hidden() else "clear", found)
        if is_lower:
            raise Denied(f"another pair comes closer: {found}")
        return self.status, found

    def is_below(self, motion: Motion, meeting: Any, distance: Fraction) -> bool:
        """Whether the scaled distance falls below a value: whether the horizontal distance falls below its part, while
        the vertical distance is below its part."""
        if distance <= 0:
            return False
        start, end, scale = relative(*meeting)
        across, along = (m * distance * motion.metre * scale for m in (self.horizontal_m, self.vertical_m))
        begin, stop = part_within(start[2], end[2], along)
        if begin is None or stop is None:
            return False
        flat = [[x + (y - x) * share for x, y in zip(start[:2], end[:2])] for share in (begin, stop)]
        return least_square(*flat) < across**2


def curve_meetings(first: list[Piece], second: list[Piece]) -> Iterator[tuple[Piece, Piece]]:
    """Pieces of two vehicles that have a common time. Where both jump at once, only the two jumps have it."""
    both_jump = {a.from_s for a in first if a.is_jump()} & {b.from_s for b in second if b.is_jump()}
    begin = 0
    for a in first:
        while begin < len(second) and second[begin].to_s < a.from_s:
            begin += 1
        for number in range(begin, len(second)):
            b = second[number]
            effort.spend()
            if b.from_s > a.to_s:
                break
            from_s, to_s = max(a.from_s, b.from_s), min(a.to_s, b.to_s)
            is_before_and_after = from_s == to_s and from_s in both_jump and not (a.is_jump() and b.is_jump())
            if from_s <= to_s and not is_before_and_after:
                yield a, b


def time_below(a: Piece, b: Piece, scales: list[Fraction], distance: Fraction) -> Fraction | None:
    """A time at which the distance of two pieces is below a value; None without such a time."""
    gaps = (max(low - high, other - most) for low, high, most, other in zip(b.low, a.high, b.high, a.low))
    if distance <= 0 or any(gap * scale >= distance for gap, scale in zip(gaps, scales)):
        return None
    from_s, to_s = max(a.from_s, b.from_s), min(a.to_s, b.to_s)
    square = [-(distance**2)]
    for first, second, scale in zip(a.over(from_s, to_s), b.over(from_s, to_s), scales):
        by = [(y - x) * scale for x, y in zip_longest(first, second, fillvalue=Fraction(0))]
        square += [Fraction(0)] * (2 * len(by) - 1 - len(square))
        for k, x in enumerate(by):
            for m, y in enumerate(by):
                square[k + m] += x * y
    effort.spend(len(square) ** 2)
    share = least_share(square)
    return None if share is None else from_s + (to_s - from_s) * share


# Limit, and whether a value is below a number.
Case = tuple[Fraction, Callable[[Fraction], bool]]


def decide(cases: Iterable[Case], value: Fraction) -> bool:
    """Whether any case is below a value."""
    return any(is_below(value) for _, is_below in cases)


def decide_both(cases: Iterable[Case], value: Fraction, is_violated: bool = False) -> tuple[bool, bool]:
    """Whether any case is below its limit, and whether any is below a value."""
    for limit, is_below in cases:
        if not is_below(value if is_violated else max(limit, value)):
            continue
        is_violated = is_violated or is_below(limit)
        if is_below(value):
            return is_violated, True
    return is_violated, False


def part_within(start: int, end: int, reach: Fraction) -> tuple[Fraction | None, Fraction | None]:
    """Ends of the part of a line, as shares of it, on which a coordinate is between -reach and reach."""
    if start == end:
        return (Fraction(0), Fraction(1)) if abs(start) < reach else (None, None)
    shares = sorted(Fraction(side * reach - start) / (end - start) for side in (-1, 1))
    begin, stop = max(shares[0], Fraction(0)), min(shares[1], Fraction(1))
    # At an end that it only touches, the coordinate is not within.
    return (begin, stop) if begin < stop else (None, None)


def least_square(start: Iterable[Fraction], end: Iterable[Fraction]) -> Fraction:
    """Smallest squared length of a vector that moves straight from start to end."""
    start = [*start]
    by = [after - before for before, after in zip(start, end)]
    rate, speed = sum(x * y for x, y in zip(start, by)), sum(x * x for x in by)
    share = min(max(Fraction(-rate) / speed, Fraction(0)), Fraction(1)) if speed else Fraction(0)
    return sum(((x + y * share) ** 2 for x, y in zip(start, by)), Fraction(0))


class Shape:
    """Obstacle at rest in units of length: a core, and all points closer to it than a radius."""

    def __init__(self, value: Any, place: str) -> None:
        self.name, at_m, self.clearance_m, shape = keys(value, place, "name", "at_m", "clearance_m", "shape")
        text(self.name, f"{place}.name")
        self.at_m = numbers(at_m, f"{place}.at_m", 3)
        number(self.clearance_m, f"{place}.clearance_m", 0)
        kind = shape.get("kind") if type(shape) is dict else None
        self.kind, self.radius_m = kind, Fraction(0)
        self.low_m: Sequence[Fraction] = [Fraction(0)] * 3
        self.high_m: Sequence[Fraction] = self.low_m
        self.normal: Sequence[Fraction] = self.low_m
        if kind == "ball":
            _, radius_m = keys(shape, place, "kind", "radius_m")
            self.radius_m = radius = above_0(radius_m, place)
            self.words = f"ball of radius {radius.text} m"
        elif kind == "capsule":
            _, from_m, to_m, radius_m = keys(shape, place, "kind", "from_m", "to_m", "radius_m")
            self.from_m, self.to_m = numbers(from_m, place, 3), numbers(to_m, place, 3)
            self.radius_m = radius = above_0(radius_m, place)
            self.low_m, self.high_m = ([least(x) for x in zip(self.from_m, self.to_m)] for least in (min, max))
            self.words = f"capsule from {listed(self.from_m)} to {listed(self.to_m)}, radius {radius.text} m"
        elif kind == "box":
            _, half_m = keys(shape, place, "kind", "half_m")
            self.high_m = half = numbers(half_m, place, 3, above_0)
            self.low_m = [-x for x in half]
            self.words = f"box of half lengths {listed(half)} m"
        elif kind == "half-space":
            _, normal = keys(shape, place, "kind", "normal")
            self.normal = outward = numbers(normal, place, 3)
            if not any(outward):
                raise Unreadable(f"proof: {place}.normal must not be zero")
            self.words = f"half-space with normal {listed(outward)}"
        else:
            raise Unreadable(f"proof: {place}.shape (ball, box, capsule, half-space) is malformed or not supported")
        self.words += f" at {listed(self.at_m)}, clearance {self.clearance_m.text} m"

    def largest_m(self) -> Fraction:
        return max(abs(x) for x in (*self.at_m, *self.low_m, *self.high_m, self.radius_m))

    def is_below(self, begin: Vector, end: Vector, metre: int, limit_m: Fraction) -> bool:
        """Whether the distance of a straight path from the surface falls below a limit. It is negative inside."""
        at = [x * metre for x in self.at_m]
        if self.kind == "half-space":
            least = min(sum(n * (x - c) for n, x, c in zip(self.normal, place, at)) for place in (begin, end))
            bound = (limit_m * metre) ** 2 * sum(n * n for n in self.normal)
            return least < 0 or least**2 < bound if limit_m > 0 else least < 0 and least**2 > bound
        reach = (limit_m + self.radius_m) * metre
        for a, b, c, low_m, high_m in zip(begin, end, at, self.low_m, self.high_m):
            if max(a, b) - c - low_m * metre <= -reach or min(a, b) - c - high_m * metre >= reach:
                return False
        effort.spend(EXACT_DISTANCE)
        start = [x - c for x, c in zip(begin, at)]
        by = [Fraction(y - x) for x, y in zip(begin, end)]
        shares = [Fraction(0), *sorted(share for share in self.changes(start, by, metre) if 0 < share < 1), Fraction(1)]
        offsets = [self.offset([x + y * share for x, y in zip(start, by)], metre) for share in shares]
        square = min(least_square(*ends) for ends in pairwise(offsets))
        if self.kind == "box" and square == 0:
            return limit_m > 0 or self.depth(start, by, metre) < limit_m * metre
        return reach > 0 and square < reach**2

    def changes(self, start: list[Any], by: list[Any], metre: int) -> Iterator[Fraction]:
        """Shares of a path at which the nearest point of the core changes between a corner, an edge and a face."""
        if self.kind == "box":
            for x, y, half_m in zip(start, by, self.high_m):
                if y:
                    yield from (Fraction(side * half_m * metre - x) / y for side in (-1, 1))
        elif self.kind == "capsule":
            along = [(b - a) * metre for a, b in zip(self.from_m, self.to_m)]
            rate, length = sum(x * y for x, y in zip(by, along)), sum(x * x for x in along)
            aside = sum((x - a * metre) * y for x, a, y in zip(start, self.from_m, along))
            if rate:
                yield from (Fraction(end - aside) / rate for end in (0, length))

    def offset(self, place: list[Any], metre: int) -> list[Any]:
        """Vector from the nearest point of the core."""
        if self.kind == "box":
            return [x - min(max(x, -half_m * metre), half_m * metre) for x, half_m in zip(place, self.high_m)]
        if self.kind == "capsule":
            along = [(b - a) * metre for a, b in zip(self.from_m, self.to_m)]
            aside, length = [x - a * metre for x, a in zip(place, self.from_m)], sum(x * x for x in along)
            share = Fraction(sum(x * y for x, y in zip(aside, along))) / length if length else Fraction(0)
            return [x - y * min(max(share, Fraction(0)), Fraction(1)) for x, y in zip(aside, along)]
        return place

    def depth(self, start: list[Any], by: list[Any], metre: int) -> Fraction:
        """Largest depth of a path in a box, as a negative number. The distance from each face is linear, so the largest
        of them is least at an end of the path or where two of them are equal."""
        axes = [*zip(start, by, self.high_m)]
        faces = [(side * x - half_m * metre, side * y) for x, y, half_m in axes for side in (-1, 1)]
        equal = (Fraction(c - a) / (b - d) for a, b in faces for c, d in faces if b != d)
        shares = [Fraction(0), Fraction(1), *(share for share in equal if 0 < share < 1)]
        return Fraction(min(max(a + b * share for a, b in faces) for share in shares))


class Obstacles(Limit):
    """Limit of the distance of each vehicle from obstacles at rest."""

    KEYS = ("smallest", "vehicle", "obstacle", "obstacles")

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        smallest, vehicle, obstacle, shapes = self.values
        if type(shapes) is not list or not shapes:
            raise Unreadable(f"proof: {place}.obstacles is malformed or not supported")
        self.smallest = number(smallest, f"{place}.smallest")
        self.vehicle, self.obstacle = text(vehicle, f"{place}.vehicle"), text(obstacle, f"{place}.obstacle")
        self.shapes = [Shape(shape, f"{place}.obstacles[{k}]") for k, shape in enumerate(shapes)]

    def facts(self) -> list[str]:
        return [f"obstacle {shown(shape.name)}: {shape.words}" for shape in self.shapes]

    def judge(self, motion: Motion) -> tuple[str, str]:
        rounding_m = max(motion.rounding(), ROUNDING * max(shape.largest_m() for shape in self.shapes))

        def cases(tracks: Iterable[list[Segment]], shapes: list[Shape]) -> Iterator[Case]:
            for track in tracks:
                for segment in track:
                    for shape in shapes:
                        effort.spend()
                        ends = segment.start, segment.end
                        yield shape.clearance_m, lambda limit_m: shape.is_below(*ends, motion.metre, limit_m)

        called = f"{shown(self.vehicle)} and {shown(self.obstacle)}"
        found = f"smallest distance of an obstacle {self.smallest.text} m within {about(rounding_m)} m, {called}"
        named = [shape for shape in self.shapes if shape.name == self.obstacle]
        own = motion.tracks[vehicle_of(motion, self.vehicle)]
        if not decide(cases([own], named), self.smallest + rounding_m):
            raise Denied(f"the pair of the claim does not come as close: {found}")
        is_violated, is_lower = decide_both(cases(motion.tracks, self.shapes), self.smallest - rounding_m)
        self.compare("violation" if is_violated else "undecided" if motion.gaps else "clear", found)
        if is_lower:
            raise Denied(f"another pair comes closer: {found}")
        return self.status, found


class VehicleLimit(Limit):
    """Limit of a quantity of each vehicle, with its extreme."""

    KEYS = ("limit", "extreme", "vehicle")

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        limit, extreme, vehicle = self.values
        self.limit, self.extreme = number(limit, f"{place}.limit"), number(extreme, f"{place}.extreme")
        self.vehicle = text(vehicle, f"{place}.vehicle")

    def judge(self, motion: Motion) -> tuple[str, str]:
        worst = [self.worst(motion, vehicle) for vehicle in range(len(motion.names))]
        named = worst[vehicle_of(motion, self.vehicle)]
        known = [value for value in worst if value is not None]
        most = max(known, default=None)
        if named is None or most is None:
            raise Denied(f"the {self.kind} of vehicle {shown(self.vehicle)} is not known")
        is_undecided = bool(motion.gaps) or len(known) < len(motion.begins)
        found = f"{self.kind} {self.said(most)}, {shown(motion.names[worst.index(most)])} (limit {self.limit.text})"
        self.compare("violation" if self.exceeds(most, self.limit) else "undecided" if is_undecided else "clear", found)
        rounding = motion.rounding() + SPEED_ROUNDING * self.has_speed * abs(self.extreme)
        if self.exceeds(most, self.extreme + self.sign() * rounding):
            raise Denied(f"the extreme is not {self.extreme.text}: {found}")
        if not self.exceeds(named, self.extreme - self.sign() * rounding):
            raise Denied(f"vehicle {shown(self.vehicle)} does not reach the extreme {self.extreme.text}: {found}")
        return self.status, found

    def sign(self) -> int:
        """-1 for the least allowed value."""
        return 1

    def worst(self, motion: Motion, vehicle: int) -> Fraction | None:
        """Worst value of a vehicle, or its square; None if no value is known."""
        raise NotImplementedError

    def exceeds(self, worst: Fraction, limit: Fraction) -> bool:
        return worst > limit

    def said(self, worst: Fraction) -> str:
        return f"at most {-floor_of(-worst)!r}"


class Height(VehicleLimit):
    """Limit of the height z, which is largest at a sample."""

    def worst(self, motion: Motion, vehicle: int) -> Fraction | None:
        heights = [place[2] for segment in motion.tracks[vehicle] for place in (segment.start, segment.end)]
        return Fraction(max(heights), motion.height) if heights else None


class Floor(VehicleLimit):
    """Limit of the negative height."""

    def sign(self) -> int:
        return -1

    def worst(self, motion: Motion, vehicle: int) -> Fraction | None:
        heights = [place[2] for segment in motion.tracks[vehicle] for place in (segment.start, segment.end)]
        return Fraction(-min(heights), motion.height) if heights else None

    def exceeds(self, worst: Fraction, limit: Fraction) -> bool:
        return -worst < limit

    def said(self, worst: Fraction) -> str:
        return f"at least {floor_of(-worst)!r}"


class Rate(VehicleLimit):
    """Limit of a velocity along z."""

    has_speed = True
    side = 1

    def value(self, velocity: list[Fraction]) -> Fraction:
        return self.side * velocity[2]

    def worst(self, motion: Motion, vehicle: int) -> Fraction | None:
        values = [self.value(velocity) for velocity in motion.velocities[vehicle]]
        for segment in motion.tracks[vehicle]:
            effort.spend()
            if segment.from_t < segment.to_t:
                by, length = [y - x for x, y in zip(segment.start, segment.end)], segment.to_t - segment.from_t
                values.append(self.value([Fraction(x * motion.second, motion.metre * length) for x in by]))
        return max(values, default=None)


class Climb(Rate):
    pass


class Descent(Rate):
    side = -1


class Speed(Rate):
    """Limit of the length of a velocity: squares are compared."""

    axes = 3

    def value(self, velocity: list[Fraction]) -> Fraction:
        return sum((x * x for x in velocity[: self.axes]), Fraction(0))

    def exceeds(self, worst: Fraction, limit: Fraction) -> bool:
        return limit < 0 or worst > limit**2

    def said(self, worst: Fraction) -> str:
        least = root(worst)
        return f"at most {least if Fraction(least) ** 2 == worst else math.nextafter(least, math.inf)!r}"


class Horizontal(Speed):
    axes = 2


class Fence(Limit):
    """Limit of the distance of each vehicle from the walls, the floor and the ceiling of a fence, inside of it."""

    KEYS = ("smallest", "vehicle", "corners_m", "height_m", "margin_m")

    def __init__(self, value: Any, place: str) -> None:
        super().__init__(value, place)
        smallest, vehicle, corners_m, height_m, margin_m = self.values
        # Outside of the fence there is no smallest distance.
        self.smallest = None if smallest is None else number(smallest, f"{place}.smallest", 0)
        if self.smallest is None and self.status == "clear":
            raise Unreadable(f"proof: {place}.smallest must be a number, because the status is clear")
        if type(corners_m) is not list or len(corners_m) < 3:
            raise Unreadable(f"proof: {place}.corners_m is malformed or not supported")
        self.corners_m = [numbers(corner, f"{place}.corners_m", 2) for corner in corners_m]
        self.height_m = None if height_m is None else numbers(height_m, f"{place}.height_m", 2)
        self.vehicle, self.margin_m = text(vehicle, f"{place}.vehicle"), number(margin_m, f"{place}.margin_m", 0)

    def facts(self) -> list[str]:
        corners = "; ".join(listed(corner) for corner in self.corners_m)
        heights = f", heights from {self.height_m[0].text} to {self.height_m[1].text} m" if self.height_m else ""
        return [f"fence: polygon of {corners}{heights}"]

    def judge(self, motion: Motion) -> tuple[str, str]:
        metre = motion.metre
        corners = [tuple(x * metre for x in corner) for corner in self.corners_m]
        edges = [*zip(corners, [*corners[1:], corners[0]])]

        def cases(tracks: Iterable[list[Segment]]) -> Iterator[Case]:
            for track in tracks:
                for segment in track:
                    yield self.margin_m, lambda limit_m: self.is_below(edges, segment, metre, limit_m)

        rounding_m = max(motion.rounding(), ROUNDING * max(abs(x) for corner in self.corners_m for x in corner))
        own = motion.tracks[vehicle_of(motion, self.vehicle)]
        if self.smallest is None:
            found = f"{shown(self.vehicle)} is beyond the margin of the fence (margin {self.margin_m.text} m)"
            if not decide(cases([own]), self.margin_m):
                raise Denied(f"not true: {found}")
            return self.status, found
        found = f"distance inside the fence {self.smallest.text} m within {about(rounding_m)} m, {shown(self.vehicle)} "
        found += f"(margin {self.margin_m.text} m)"
        if not decide(cases([own]), self.smallest + rounding_m):
            raise Denied(f"the vehicle of the claim does not come as close: {found}")
        lower = max(self.smallest - rounding_m, Fraction(0))
        is_violated, is_lower = decide_both(cases(motion.tracks), lower)
        self.compare("violation" if is_violated else "undecided" if motion.gaps else "clear", found)
        if is_lower:
            raise Denied(f"a vehicle comes closer: {found}")
        return self.status, found

    def is_below(self, edges: list[Any], segment: Segment, metre: int, limit_m: Fraction) -> bool:
        """Whether the distance of a straight path from the fence falls below a limit of 0 or more, inside of it."""
        ends, limit = (segment.start, segment.end), limit_m * metre
        if self.height_m:
            floor, ceiling = (x * metre for x in self.height_m)
            if any(z - floor < limit or ceiling - z < limit for _, _, z in ends):
                return True
        a, b = (place[:2] for place in ends)
        crossings = [Fraction(0), Fraction(1)]
        for edge in edges:
            effort.spend()
            if any(min(p) - max(q) > limit or min(q) - max(p) > limit for p, q in zip(zip(a, b), zip(*edge))):
                continue
            effort.spend(EXACT_DISTANCE)
            shares = common_shares(a, b, *edge)
            if limit > 0 and (shares or any(point_square(p, *line) < limit**2 for p, line in sides(a, b, *edge))):
                return True
            crossings += shares
        effort.spend(len(edges))
        if limit > 0:
            return not surrounds(edges, a)
        # Between two walls a path is inside or outside as a whole; along a wall it is inside.
        for begin, end in pairwise(sorted(crossings)):
            effort.spend(2 * len(edges))
            place = [x + (y - x) * (begin + end) / 2 for x, y in zip(a, b)]
            if not surrounds(edges, place) and all(point_square(place, *edge) > 0 for edge in edges):
                return True
        return False


def sides(a: Any, b: Any, c: Any, d: Any) -> list[Any]:
    """Each end of two lines, with the other line. The distance of lines without a common point is that of an end."""
    return [(a, (c, d)), (b, (c, d)), (c, (a, b)), (d, (a, b))]


def point_square(point: Any, start: Any, end: Any) -> Fraction:
    """Squared distance of a point and a line in the plane."""
    by, aside = [y - x for x, y in zip(start, end)], [y - x for x, y in zip(start, point)]
    length, along = sum(x * x for x in by), sum(x * y for x, y in zip(aside, by))
    share = min(max(Fraction(along) / length, Fraction(0)), Fraction(1)) if length else Fraction(0)
    return sum(((x - y * share) ** 2 for x, y in zip(aside, by)), Fraction(0))


def cross(a: Any, b: Any) -> Any:
    return a[0] * b[1] - a[1] * b[0]


def common_shares(a: Any, b: Any, c: Any, d: Any) -> list[Fraction]:
    """Shares of the line from a to b at its common points with the line from c to d; the ends of a common part."""
    by, edge, aside = ([y - x for x, y in zip(*ends)] for ends in ((a, b), (c, d), (a, c)))
    turn = cross(by, edge)
    if turn:
        share, along = Fraction(cross(aside, edge)) / turn, Fraction(cross(aside, by)) / turn
        return [share] if 0 <= share <= 1 and 0 <= along <= 1 else []
    length = sum(x * x for x in by)
    if not length:
        return [Fraction(0)] if point_square(a, c, d) == 0 else []
    if cross(aside, by):
        return []
    shares = [Fraction(sum(x * (y - z) for x, y, z in zip(by, corner, a))) / length for corner in (c, d)]
    begin, end = max(min(shares), Fraction(0)), min(max(shares), Fraction(1))
    return [begin, end] if begin <= end else []


def surrounds(edges: list[Any], place: Any) -> bool:
    """Whether a polygon surrounds a place: a ray along x crosses an odd number of edges."""
    is_inside = False
    for a, b in edges:
        if (a[1] > place[1]) != (b[1] > place[1]):
            side = cross([y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, place)])
            is_inside ^= side > 0 if b[1] > a[1] else side < 0
    return is_inside


KINDS: dict[str, type[Limit]] = {
    "distance": Distance,
    "ellipsoid": Ellipsoid,
    "cylinder": Cylinder,
    "obstacles": Obstacles,
    "speed": Speed,
    "horizontal": Horizontal,
    "climb": Climb,
    "descent": Descent,
    "height": Height,
    "floor": Floor,
    "fence": Fence,
}


# The verdict.


def check(claim: Claim, contents: list[bytes], accepted_s: dict[str, Exact]) -> list[str]:
    """Returns a claim and its limits in words, and the facts that the data do not contain. Raises `Denied` unless the
    claim is true."""
    by_hash = {hashlib.sha256(content).hexdigest(): content for content in contents}
    for name, sha256 in claim.hashes.items():
        if sha256 not in by_hash:
            of = f" of vehicle {shown(name)}" if name else ""
            raise Denied(f"the data{of} is not that of the proof: its SHA-256 differs")
    if len(contents) != len(claim.hashes) or by_hash.keys() != {*claim.hashes.values()}:
        raise Denied(f"the proof is about {len(claim.hashes)} files, and not about all of these")
    if claim.data_format in ("crazyflie", "bezier"):
        return check_curves(claim, {name: by_hash[sha256] for name, sha256 in claim.hashes.items()}, accepted_s)
    (content,) = contents
    needs_velocities = any(limit.has_speed for limit in claim.limits)
    data = (Table if claim.data_format == "csv" else Run)(content, needs_velocities)
    names = [*data.rows]
    for name in sorted(data.rows.keys() ^ claim.max_gaps_s.keys()):
        raise Denied(f"vehicle {shown(name)} is missing in the claim or in the data")
    if data.unit not in (None, claim.unit):
        raise Denied(f"the times are in {data.unit} by the data, not in {claim.unit}")
    moved_s = {name: by_s for name, by_s in claim.offsets_s.items() if by_s != 0}
    for name in sorted(moved_s.keys() | accepted_s.keys()):
        if name not in data.rows or moved_s.get(name, 0) != accepted_s.get(name, 0):
            moved = moved_s[name].text if name in moved_s else "0"
            remedy = "accept it with --offset NAME=SECONDS"
            raise Denied(f"the clock of vehicle {shown(name)} is moved by {moved} s, which no data show; {remedy}")
    motion = motion_of(data, claim)
    effort.weigh(max(motion.largest.bit_length(), claim.bits))
    alone = [name for name, track in zip(names, motion.tracks) if motion.is_alone(track)]
    return [*verdicts(claim, motion), *(f"assumes  {fact}" for fact in assumptions(claim, data, motion, alone))]


def check_curves(claim: Claim, contents: dict[str, bytes], accepted_s: dict[str, Exact]) -> list[str]:
    """Returns a claim on curves in words, as `check` does."""
    if claim.unit != "s" or claim.max_gaps_s or claim.offsets_s or accepted_s:
        raise Denied("curves have no gaps, no moved clocks, and times in seconds")
    curves = Curves(contents, claim.data_format == "bezier")
    files = [f"vehicle {shown(name)}: the file with the SHA-256 {sha256}" for name, sha256 in claim.hashes.items()]
    facts = [*curves.facts(), *files, *(fact for limit in claim.limits for fact in limit.facts())]
    return [*verdicts(claim, curves), *(f"assumes  {fact}" for fact in facts)]


def verdicts(claim: Claim, motion: Motion | Curves) -> list[str]:
    """The verdict, and those of the limits if there are several."""
    verdicts = [limit.judge(motion) for limit in claim.limits]
    violated = sum(status == "violation" for status, _ in verdicts)
    if (claim.status == "violation") != (violated > 0):
        raise Denied(f"the limits of the claim give {'violation' if violated else 'clear'}, not {claim.status}")
    if len(verdicts) == 1:
        return [f"CONFIRMED: {claim.status}, {verdicts[0][1]}"]
    of = f"{violated} of {len(verdicts)} limits violated" if violated else f"all {len(verdicts)} limits kept"
    return [f"CONFIRMED: {claim.status}, {of}", *(f"limit    {status}, {found}" for status, found in verdicts)]


def assumptions(claim: Claim, data: Table | Run, motion: Motion, alone: list[str]) -> list[str]:
    """Every fact that the data do not contain, and every vehicle and time that is not judged."""
    lengths = (segment.to_t - segment.from_t for track in motion.tracks for segment in track)
    longest_s = Fraction(max(lengths), motion.second)
    unit = f"{data.time_name} is {'in' if data.unit else 'taken as'} {claim.unit}"
    limits_s = sorted({gap_s for gap_s in claim.max_gaps_s.values() if gap_s is not None})
    joined = "all samples of a vehicle are joined"
    if limits_s:
        most = "" if limits_s[0] == limits_s[-1] else f", by vehicle, and up to {limits_s[-1].text} s"
        joined = f"samples of a vehicle are joined up to {limits_s[0].text} s apart{most}"
        joined += ", or always for some" * (None in claim.max_gaps_s.values())
    facts = [
        f"time: {'the column of time holds dates' if data.is_dated else unit}",
        "clocks: the times of all vehicles are of one clock",
        "vehicles: each name is one vehicle",
        "positions: x, y and z are in metres, in one frame and without errors",
        f"motion: straight at constant speed between joined samples, which are up to {rounded(longest_s)} s apart",
        f"gaps: {joined}; longer gaps, not judged: {len(motion.gaps)}",
        "presence: no vehicle is present before its first or after its last sample",
        *data.facts,
        *(fact for limit in claim.limits for fact in limit.facts()),
    ]
    facts += [f"clock of {shown(name)}, moved by {by_s.text} s" for name, by_s in claim.offsets_s.items() if by_s != 0]
    if any(isinstance(limit, PairLimit) for limit in claim.limits):
        facts += [f"not judged, never present with another vehicle: {shown(name)}" for name in alone]
    return facts


USAGE = "usage: python3 check_proof.py proof.json DATA... [--offset NAME=SECONDS ...] [--effort COMPARISONS]"


def main(arguments: list[str]) -> int:
    paths, offsets_s = [], {}
    effort.begin(EFFORT)
    try:
        words = iter(arguments)
        for word in words:
            if word == "--offset":
                name, _, by_s = next(words, "").rpartition("=")
                offsets_s[name] = Exact(by_s)
            elif word == "--effort":
                effort.begin(int(next(words, "")))
            else:
                paths.append(word)
        proof_path, data_path, *more_paths = paths
    except ValueError:
        print(USAGE, file=sys.stderr)
        return 2
    try:
        contents = []
        for path in (proof_path, data_path, *more_paths):
            with open(path, "rb") as file:
                contents.append(file.read())
        lines = check(Claim(read_proof(contents[0])), contents[1:], offsets_s)
        for line in lines:
            print(line)
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
