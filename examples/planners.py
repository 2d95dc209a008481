"""Writes recordings of planners' messages: six conflicts that a planner's own check misses, and a mended twin of each.

Usage: ``python examples/planners.py FOLDER``. The files are those of ``examples/planners``.

Each scene rebuilds a public report on a planner (docs/planners.md) with messages of the planner's kind. Each file is
an MCAP with messages in CDR. It needs no other package.
"""

import struct
import sys
from pathlib import Path
from typing import NamedTuple

#: Start of the first plans, on the clock of the log [s].
EPOCH_S = 1_700_000_000
NS_PER_S = 1_000_000_000

#: Types of the fields, as a definition has them after its own fields.
TYPES = {
    "builtin_interfaces/Time": ["int32 sec", "uint32 nanosec"],
    "geometry_msgs/Point": ["float64 x", "float64 y", "float64 z"],
}

BSPLINE = [
    "int32 drone_id",
    "int32 order",
    "int64 traj_id",
    "builtin_interfaces/Time start_time",
    "float64[] knots",
    "geometry_msgs/Point[] pos_pts",
    "float64[] yaw_pts",
    "float64 yaw_dt",
]

MINCO = [
    "int16 drone_id",
    "int32 traj_id",
    "builtin_interfaces/Time start_time",
    "float32 des_clearance",
    "uint8 order",
    "float32[3] start_p",
    "float32[3] start_v",
    "float32[3] start_a",
    "float32[3] end_p",
    "float32[3] end_v",
    "float32[3] end_a",
    "float32[] inner_x",
    "float32[] inner_y",
    "float32[] inner_z",
    "float32[] duration",
]

POLYNOMIALS = [
    "int16 drone_id",
    "int32 traj_id",
    "builtin_interfaces/Time start_time",
    "uint8 order",
    "float32[] coef_x",
    "float32[] coef_y",
    "float32[] coef_z",
    "float32[] duration",
]

Point = tuple[float, float, float]


def definition(fields: list[str]) -> str:
    """Returns the definition of a message with the types of its fields."""
    text = "".join(field + "\n" for field in fields)
    for name, own in TYPES.items():
        if any(field.startswith(name) for field in fields):
            text += "=" * 80 + f"\nMSG: {name}\n" + "".join(field + "\n" for field in own)
    return text


class Message(NamedTuple):
    """A message with its topic, schema and time of publication."""

    topic: str
    schema: str
    definition: str
    published_ns: int
    content: bytes


class Cdr:
    """Little-endian CDR: each number is aligned to its size."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def add(self, kind: str, *numbers: float) -> None:
        size = struct.calcsize(kind)
        for number in numbers:
            self.bytes += bytes(-len(self.bytes) % size)
            self.bytes += struct.pack(f"<{kind}", number)

    def sequence(self, kind: str, numbers: list[float]) -> None:
        self.add("I", len(numbers))
        self.add(kind, *numbers)

    def time(self, time_ns: int) -> None:
        self.add("i", time_ns // NS_PER_S)
        self.add("I", time_ns % NS_PER_S)

    def message(self) -> bytes:
        return b"\x00\x01\x00\x00" + bytes(self.bytes)


def nanoseconds(time_s: float) -> int:
    return EPOCH_S * NS_PER_S + round(time_s * NS_PER_S)


def spline(drone: int, start_s: float, interval_s: float, points: list[Point], topic: str = "/swarm_traj") -> Message:
    """Returns a uniform cubic B-spline, published at its start."""
    cdr = Cdr()
    cdr.add("i", drone, 3)
    cdr.add("q", 1)
    cdr.time(nanoseconds(start_s))
    cdr.sequence("d", [(k - 3) * interval_s for k in range(len(points) + 4)])
    cdr.add("I", len(points))
    cdr.add("d", *(number for point in points for number in point))
    cdr.sequence("d", [])
    cdr.add("d", 0.0)
    return Message(topic, "traj_utils/msg/Bspline", definition(BSPLINE), nanoseconds(start_s), cdr.message())


def minco(
    drone: int,
    start_s: float,
    points: list[Point],
    durations_s: list[float],
    velocities: tuple[Point, Point] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
) -> Message:
    """Returns the trajectory of least jerk through points, published at its start."""
    cdr = Cdr()
    cdr.add("h", drone)
    cdr.add("i", 1)
    cdr.time(nanoseconds(start_s))
    cdr.add("f", 0.5)
    cdr.add("B", 5)
    for end, velocity in zip((points[0], points[-1]), velocities):
        cdr.add("f", *end, *velocity, 0.0, 0.0, 0.0)
    for axis in range(3):
        cdr.sequence("f", [point[axis] for point in points[1:-1]])
    cdr.sequence("f", durations_s)
    schema = "traj_utils/msg/MINCOTraj"
    return Message("/broadcast_traj", schema, definition(MINCO), nanoseconds(start_s), cdr.message())


def line(drone: int, start_s: float, start: Point, velocity: Point, durations_s: list[float]) -> Message:
    """Returns a line in pieces, as polynomials of degree 5, published at its start."""
    cdr = Cdr()
    cdr.add("h", drone)
    cdr.add("i", 1)
    cdr.time(nanoseconds(start_s))
    cdr.add("B", 5)
    for axis in range(3):
        at, coefficients = start[axis], []
        for duration_s in durations_s:
            coefficients += [0.0, 0.0, 0.0, 0.0, velocity[axis], at]
            at += velocity[axis] * duration_s
        cdr.sequence("f", coefficients)
    cdr.sequence("f", durations_s)
    schema = "traj_utils/msg/PolyTraj"
    return Message("/trajectory", schema, definition(POLYNOMIALS), nanoseconds(start_s), cdr.message())


def present_positions(aside_m: float) -> list[Message]:
    """Two plans cross in 4 s. At the publication of the second the two are 11 m apart."""
    return [
        line(0, 0.0, (-4.0, 0.0, 1.0), (1.0, 0.0, 0.0), [2.0] * 4),
        line(1, 0.1, (0.0, 8.2 + 2 * aside_m, 1.0), (0.0, -2.0, 0.0), [2.0] * 4),
    ]


def last_third(aside_m: float) -> list[Message]:
    """Two plans are parallel for two thirds of their time. In the last third one turns onto the other."""
    along = [(k * 2.0, 0.0, 1.0) for k in range(4)]
    turns = [(0.0, 2.0, 1.0), (2.0, 2.0, 1.0), (4.0, 2.0, 1.0), (6.0, 0.2 + aside_m, 1.0)]
    return [minco(0, 0.0, along, [1.5] * 3), minco(1, 0.05, turns, [1.5] * 3)]


def last_quarter(aside_m: float) -> list[Message]:
    """The last quarter of a plan, which does not end at the goal, crosses the plan of another vehicle."""
    fast = ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    across = [(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (4.0, 0.0, 1.0), (6.0, 0.0, 1.0), (8.0, 0.0, 1.0)]
    down = [(7.0, 5.0, 1.0), (7.0, 2.5, 1.0), (7.0 + 3 * aside_m, 0.0, 1.0), (7.0, -2.0, 1.0)]
    return [minco(0, 0.0, down, [2.0, 2.0, 2.0]), minco(1, 0.1, across, [1.1] * 4, fast)]


def expired_stop(aside_m: float) -> list[Message]:
    """A vehicle stops and hovers where its plan ended. The plan of another one passes there 3 s later."""
    stop = [(3.0, 0.0, 1.0), (3.0, 0.0, 1.0)]
    passes = [(0.0, -4.0, 1.0), (3.0, 0.2 + aside_m, 1.0), (6.0, 4.0, 1.0)]
    return [minco(0, 0.0, stop, [1.0]), minco(1, 2.0, passes, [3.0, 3.0])]


def idle(aside_m: float) -> list[Message]:
    """A vehicle that has finished publishes nothing and hovers. The curve of another one passes through its place."""
    arrives = [(0.0, 0.0, 1.0)] * 2 + [(k * 0.5, 0.0, 1.0) for k in range(1, 6)] + [(3.0, 0.0, 1.0)] * 3
    passes = [(3.0 + aside_m, -4.0 + k, 1.0) for k in range(10)]
    return [spline(0, 0.0, 0.5, arrives), spline(1, 6.0, 0.6, passes)]


def unchecked(aside_m: float) -> list[Message]:
    """Curves are published without a check. Two cross between two samples at 33 Hz, at 9 m/s each."""
    first = [(-6.04 + 2.7 * k, 0.0, 1.0) for k in range(8)]
    second = [(0.0, -6.175 + 2.7 * k + aside_m, 1.0) for k in range(8)]
    return [spline(0, 0.0, 0.3, first), spline(1, 0.0, 0.3, second)]


#: Scene by the name of its file: messages, and the distance by which the twin passes aside [m].
SCENES = {
    "present-positions": (present_positions, 1.0),
    "last-third": (last_third, 1.0),
    "last-quarter": (last_quarter, 1.0),
    "expired-stop": (expired_stop, 1.0),
    "idle": (idle, 1.0),
    "unchecked": (unchecked, 1.5),
}


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def mcap(messages: list[Message]) -> bytes:
    """Returns an MCAP without chunks, index and checksums."""
    out = bytearray(b"\x89MCAP0\r\n" + record(1, text("ros2") + text("tautline")))
    channels: dict[str, int] = {}
    for message in messages:
        if message.topic not in channels:
            number = channels[message.topic] = len(channels) + 1
            definition = struct.pack("<I", len(message.definition)) + message.definition.encode()
            out += record(3, struct.pack("<H", number) + text(message.schema) + text("ros2msg") + definition)
            out += record(4, struct.pack("<HH", number, number) + text(message.topic) + text("cdr") + bytes(4))
    for sequence, message in enumerate(messages):
        times = struct.pack("<QQ", message.published_ns, message.published_ns)
        out += record(5, struct.pack("<HI", channels[message.topic], sequence) + times + message.content)
    out += record(15, bytes(4)) + record(2, bytes(20)) + b"\x89MCAP0\r\n"
    return bytes(out)


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, (scene, aside_m) in SCENES.items():
        (folder / f"{name}.mcap").write_bytes(mcap(scene(0.0)))
        (folder / f"{name}-mended.mcap").write_bytes(mcap(scene(aside_m)))


if __name__ == "__main__":
    main()
