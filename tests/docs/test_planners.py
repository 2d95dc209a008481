"""Tests of the recordings of planners: their script writes them, the audit finds each conflict, and each planner's own
check misses it."""

import json
import math
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from commands import TAUTLINE
from pages import ROOT

EXAMPLES = ROOT / "examples"
sys.path.insert(0, str(EXAMPLES))
import planners  # noqa: E402

#: Limit by scene [m].
DELTA_M = {"unchecked": 0.2}
#: Options that leave out what the check of a planner leaves out.
LEFT_OUT = {
    "present-positions": ["--until", "0.1"],
    "last-third": ["--until", "3.0"],
    "last-quarter": ["--until", "3.4"],
    "expired-stop": ["--plan-end", "unknown"],
    "idle": ["--plan-end", "unknown"],
}


def audited(name: str, *options: str) -> tuple[int, dict]:
    """Returns the exit code and the report of an audit of an example."""
    delta_m = DELTA_M.get(name.removesuffix("-mended"), 0.5)
    command = [TAUTLINE, "audit", EXAMPLES / "planners" / f"{name}.mcap", "--delta", str(delta_m), "--json", *options]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    return ran.returncode, json.loads(ran.stdout)


def published(report: dict) -> dict:
    """Returns the answer on published plans."""
    return next(answer for answer in report["answers"] if answer["part"] == "published_plans")


def on_spline(points: list[planners.Point], interval_s: float, time_s: float) -> planners.Point:
    """Returns the position on a uniform cubic B-spline at a time since its start."""
    first = min(int(time_s / interval_s), len(points) - 4)
    u = time_s / interval_s - first
    weights = ((1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3)
    near = points[first : first + 4]
    return tuple(sum(weight * point[axis] / 6 for weight, point in zip(weights, near)) for axis in range(3))


def pose(topic: str, time_s: float, position: planners.Point) -> planners.Message:
    """Returns a stamped pose."""
    cdr = planners.Cdr()
    cdr.time(planners.nanoseconds(time_s))
    cdr.add("I", 4)
    cdr.bytes += b"map\0"
    cdr.add("d", *position, 0.0, 0.0, 0.0, 1.0)
    schema = "geometry_msgs/msg/PoseStamped"
    return planners.Message(topic, schema, "", planners.nanoseconds(time_s), cdr.message())


class Planners(unittest.TestCase):
    def test_the_script_writes_the_recordings(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, EXAMPLES / "planners.py", folder], check=True)
            made = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
        kept = {path.name: path.read_bytes() for path in (EXAMPLES / "planners").iterdir()}
        self.assertEqual(made, kept)
        self.assertEqual(len(kept), 2 * len(planners.SCENES))

    def test_each_conflict_is_found_and_its_twin_is_clear(self) -> None:
        page = (ROOT / "docs" / "planners.md").read_text(encoding="utf-8")
        for name in planners.SCENES:
            code, report = audited(name)
            answer = published(report)
            self.assertEqual((code, report["status"], answer["status"]), (1, "violation", "violation"), name)
            finding = min(answer["violations"]["listed"], key=lambda finding: finding["value"]["upper"])
            self.assertEqual(finding["subjects"], ["1", "0"], name)
            self.assertEqual([plan["number"] for plan in finding["plans"]], [1, 1], name)
            distance = re.search(rf"^\| `{name}` .* \| ([0-9.]+) \|$", page, re.M)
            self.assertEqual(distance[1], f"{math.floor(100 * finding['value']['upper']) / 100:.2f}", name)
            code, report = audited(f"{name}-mended")
            self.assertEqual((code, report["status"], published(report)["status"]), (0, "clear", "clear"), name)

    def test_the_checks_of_the_planners_miss_the_conflicts(self) -> None:
        for name, options in LEFT_OUT.items():
            _, report = audited(name, *options)
            self.assertNotEqual(report["status"], "violation", name)
        # Positions at 33 Hz are farther apart than the limit.
        first = [(-6.04 + 2.7 * k, 0.0, 1.0) for k in range(8)]
        second = [(0.0, -6.175 + 2.7 * k, 1.0) for k in range(8)]
        curves = [planners.spline(drone, 0.0, 0.3, points) for drone, points in enumerate((first, second))]
        self.assertEqual(planners.unchecked(0.0), curves)
        places = ([on_spline(points, 0.3, k / 33) for points in (first, second)] for k in range(int(1.5 * 33)))
        self.assertGreater(min(math.dist(*pair) for pair in places), DELTA_M["unchecked"])

    def test_plans_are_judged_against_flights_too(self) -> None:
        plan = planners.spline(0, 0.0, 0.5, [(k * 0.5, 0.0, 1.0) for k in range(20)], "/drone_0_planning/bspline")
        for aside_m, expected in ((0.2, "violation"), (1.0, "clear")):
            flights = {0: lambda time_s: (0.5 + time_s, 0.1, 1.0), 1: lambda _: (4.0, 0.1 + aside_m, 1.0)}
            messages = [plan] + [
                pose(f"/drone_{drone}/pose", k / 10, position(k / 10))
                for k in range(85)
                for drone, position in flights.items()
            ]
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "flight.mcap"
                path.write_bytes(planners.mcap(messages))
                command = [TAUTLINE, "audit", path, "--delta", "0.5"]
                ran = subprocess.run([*command, "--json"], capture_output=True, text=True, check=False)
                text = subprocess.run(command, capture_output=True, text=True, check=False).stdout
            # The separation of the flights does not rest on it.
            self.assertEqual(text.count("plans have the frame and the clock of the positions"), 1, text)
            report = json.loads(ran.stdout)
            answers = {answer["part"]: answer for answer in report["answers"]}
            self.assertEqual(set(answers), {"separation", "flown_plans"})
            self.assertEqual((answers["flown_plans"]["status"], report["status"]), (expected, expected))
            closest = answers["flown_plans"]["closest"][0]
            self.assertEqual((closest["subjects"], len(closest["plans"])), (["/drone_0/pose", "/drone_1/pose"], 1))
            self.assertAlmostEqual(closest["value"]["lower"], 0.1 + aside_m, places=6)
            facts = {fact["fact"]: fact for fact in report["facts"]}
            self.assertAlmostEqual(facts["tracking-error"]["value"], 0.1, places=6)
            self.assertEqual((facts["flown-plans"]["source"], report["proved"]), ("inferred", False))

    def test_a_declared_end_proves_and_a_default_does_not(self) -> None:
        _, by_default = audited("last-third-mended")
        _, declared = audited("last-third-mended", "--plan-end", "hold")
        self.assertEqual((by_default["proved"], declared["proved"]), (False, True))
        sources = [next(fact for fact in one["facts"] if fact["fact"] == "plan-end") for one in (by_default, declared)]
        self.assertEqual([fact["source"] for fact in sources], ["default", "declared"])


if __name__ == "__main__":
    unittest.main()
