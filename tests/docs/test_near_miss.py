"""Tests of the recording of a near miss: its script writes it, and only the motion between samples is too close."""

from __future__ import annotations

import csv
import itertools
import math
import subprocess
import sys
import unittest

from pages import ROOT

EXAMPLES = ROOT / "examples"
DELTA_M = 0.5


class NearMiss(unittest.TestCase):
    def test_the_script_writes_the_file(self) -> None:
        made = subprocess.run([sys.executable, EXAMPLES / "near_miss.py"], capture_output=True, text=True, check=True)
        self.assertEqual(made.stdout, (EXAMPLES / "near-miss.csv").read_text(encoding="utf-8"))

    def test_all_samples_are_farther_apart_than_delta(self) -> None:
        with (EXAMPLES / "near-miss.csv").open(encoding="utf-8") as file:
            rows = sorted(csv.DictReader(file), key=lambda row: row["time_s"])
        nearest = math.inf
        for _, instant in itertools.groupby(rows, key=lambda row: row["time_s"]):
            places = [tuple(float(row[axis]) for axis in "xyz") for row in instant]
            self.assertEqual(len(places), 4)
            nearest = min(nearest, *(math.dist(one, other) for one, other in itertools.combinations(places, 2)))
        self.assertGreater(nearest, DELTA_M)
        self.assertIn(f"closer than {nearest:.2f} m", (ROOT / "README.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    unittest.main()
