"""Tests of exported Crazyflie trajectories with cflib, the library that uploads them.

Usage: `python -m unittest discover --start-directory tests/readers`, with the Python of target/readers.

cflib is under the GPL and runs as a process of its own. Its memory of trajectories writes to a recorder instead of a
radio. TAUTLINE is the program [target/debug/tautline].
"""

import csv
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("TAUTLINE", ROOT / "target/debug/tautline")).resolve()

# Uploads elements by cflib and prints the bytes that arrive.
UPLOAD = """
import json
import sys

from cflib.crazyflie.mem.memory_element import MemoryElement
from cflib.crazyflie.mem.trajectory_memory import CompressedSegment, CompressedStart, Poly4D, TrajectoryMemory


class Packed:
    def __init__(self, text):
        self.text = text

    def pack(self):
        return bytes.fromhex(self.text)


class Recorder:
    def write(self, memory, address, data, flush_queue):
        print(bytes(data).hex())


def polynomial(row):
    axes = [Poly4D.Poly(row[1 + 8 * axis : 9 + 8 * axis]) for axis in range(4)]
    return Poly4D(row[0], *axes)


MAKE = {
    "packed": Packed,
    "polynomial": polynomial,
    "start": lambda numbers: CompressedStart(*numbers),
    "segment": lambda numbers: CompressedSegment(*numbers),
}
memory = TrajectoryMemory(id=0, type=MemoryElement.TYPE_TRAJ, size=4096, mem_handler=Recorder())
memory.trajectory = [MAKE[kind](content) for kind, content in json.load(sys.stdin)]
memory.write_data(None)
"""


def uploaded(elements):
    done = subprocess.run(
        [sys.executable, "-c", UPLOAD], input=json.dumps(elements), capture_output=True, text=True, timeout=120
    )
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return bytes.fromhex(done.stdout)


def decoded(data):
    """Returns the numbers of the start, and of each segment its duration [ms] and four lists."""
    start = struct.unpack_from("<4h", data)
    segments, at = [], 8
    while True:
        kinds, duration_ms = struct.unpack_from("<BH", data, at)
        at += 3
        if duration_ms == 0:
            return start, segments, at
        axes = []
        for axis in range(4):
            count = (0, 1, 3, 7)[kinds >> (2 * axis) & 3]
            axes.append(list(struct.unpack_from(f"<{count}h", data, at)))
            at += 2 * count
        segments.append((duration_ms, axes))


class Crazyflie(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        with open(self.folder / "flight.csv", "w") as file:
            print("t,id,x,y,z", file=file)
            for k in range(501):
                for name, phase in (("a", 0.0), ("b", 0.5)):
                    turn = 2.0 * math.pi * (k / 250 + phase)
                    print(f"{k / 25},{name},{math.cos(turn)},{math.sin(turn)},{1 + 0.002 * k}", file=file)

    def export(self, output, *more):
        words = [PROGRAM, "export", "flight.csv", "--format", "crazyflie", "-o", output, "--delta", "1.5", *more]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        return self.folder / output

    def test_polynomials_are_uploaded_without_rounding(self):
        for name in ("a", "b"):
            with open(self.export("cf_" + name) / f"{name}.csv") as file:
                rows = [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]
            data = uploaded([["polynomial", row] for row in rows])
            self.assertEqual(len(data), 132 * len(rows))
            for row, numbers in zip(rows, struct.iter_unpack("<33f", data), strict=True):
                self.assertEqual([*row[1:], row[0]], list(numbers))
            # Negative twin: a number that single precision does not hold is rounded.
            changed = uploaded([["polynomial", [rows[0][0], 0.1, *rows[0][2:]]]])
            self.assertNotEqual(struct.unpack("<33f", changed)[0], 0.1)

    def test_compressed_files_are_uploaded_as_they_are(self):
        data = (self.export("cf", "--compressed") / "a.traj").read_bytes()
        self.assertEqual(uploaded([["packed", data.hex()]]), data)

    def test_cflib_encodes_the_same_segments(self):
        data = (self.export("cf", "--compressed", "--tolerance", "0.005") / "a.traj").read_bytes()
        start, segments, length = decoded(data)
        self.assertEqual((length, data[-3:]), (len(data), bytes(3)))
        self.assertGreater(len(segments), 1)

        def encoded(metres, seconds):
            """Encodes the numbers as metres and seconds; yaw is 0."""
            elements = [["start", [*map(metres, start[:3]), 0.0]]]
            for duration_ms, axes in segments:
                axes = [[metres(number) for number in axis] for axis in axes]
                elements.append(["segment", [seconds(duration_ms), *axes]])
            return uploaded(elements) + bytes(3)

        # cflib rounds towards zero, so that half a unit more away from zero keeps each number.
        half = lambda number: math.copysign(abs(number) + 0.5, number) / 1000
        self.assertEqual(encoded(half, half), data)
        # Negative twin: exact metres lose a millimetre.
        self.assertEqual(uploaded([["start", [1.001, -1.001, 0.5, 0.0]]]), struct.pack("<4h", 1000, -1000, 500, 0))


if __name__ == "__main__":
    unittest.main()
