"""Tests of `benchmarks/run.py`: a quick run without peers, wrong laws, wrong samples, and wrong arguments.

Usage: `python -m unittest discover --start-directory tests/ci`. TAUTLINE is the program [target/debug/tautline].
"""

import dataclasses
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("TAUTLINE", ROOT / "target/debug/tautline")).resolve()
sys.path.insert(0, str(ROOT / "benchmarks"))

import missions  # noqa: E402
import page  # noqa: E402
import run  # noqa: E402
import sampling  # noqa: E402
import scenes  # noqa: E402
import speed  # noqa: E402
from peers import PLAIN, Peers  # noqa: E402
from program import Program  # noqa: E402


def command(*words):
    words = [sys.executable, str(ROOT / "benchmarks/run.py"), *map(str, words)]
    environment = os.environ | {"TAUTLINE": str(PROGRAM)}
    return subprocess.run(words, env=environment, capture_output=True, text=True, timeout=300)


class InFolder(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        self.program = Program(PROGRAM, self.folder)
        self.peers = Peers(self.folder / "none", install=False)


class Quick(InFolder):
    def test_a_quick_run_without_peers_fills_all_groups_and_the_page(self):
        target = self.folder / "page.md"
        target.write_text(f"before\n{page.BEGIN}\nSTALE\n{page.END}\nafter\n")
        rows = self.folder / "rows.json"
        done = command("--quick", "--environments", self.folder / "none", "--json", rows, "--markdown", target)
        self.assertEqual(done.returncode, 0, done.stderr)
        report = json.loads(rows.read_text())
        self.assertEqual(report["schema_version"], run.SCHEMA)
        self.assertTrue(report["quick"])
        self.assertFalse((self.folder / "none").exists())
        for peer in report["peers"]:
            self.assertEqual(peer["status"], "skipped")
            self.assertTrue(peer["why"], peer)
        measured = [row for row in report["rows"] if row["status"] == "measured"]
        self.assertEqual({row["group"] for row in measured}, {"speed", "missions", "sampling"})
        for row in report["rows"]:
            self.assertIn(row["status"], ("measured", "skipped"), row)
            self.assertEqual(row["status"] == "skipped", bool(row["why"]), row)
            self.assertIn(row["name"], done.stdout)
        check = next(row for row in measured if row["name"] == "complete-graph/5/plain-Python")
        self.assertLessEqual(check["difference_m"], speed.SAME_M)
        self.assertGreater(check["ratio"], 0)
        for side in ("ours", "peer"):
            self.assertAlmostEqual(sum(check[side]["parts"].values()), check[side]["time"])
            self.assertGreater(min(check[side]["parts"].values()), 0)
        quadrotors = [row for row in report["rows"] if row["name"].startswith("quadrotors/")]
        self.assertEqual(len(quadrotors), 4)
        for row in quadrotors:
            self.assertLessEqual(row["ours"]["end_m"], speed.SLOT_M, row)
        for row in measured:
            if row["group"] == "missions":
                self.assertEqual(row["collided"] + row["safe"] + row["undecided"], row["flights"], row)
                self.assertLessEqual(row["hidden"] + row["ended_between"], row["collided"], row)
                if row["shield"]:
                    self.assertEqual(row["collided"], 0, row)
        laplacian = [row for row in measured if row["name"].startswith("swap, laplacian")]
        self.assertTrue(all(row["violated"] and row["hidden_m"] > 0 for row in laplacian), laplacian)
        text = target.read_text()
        self.assertTrue(text.startswith("before\n") and text.endswith("after\n") and "STALE" not in text)
        for part in ("quick run", "## Speed", "## Missions", "## What sampling hides", "## Rows without a figure"):
            self.assertIn(part, text)
        for row in report["rows"]:
            self.assertTrue(row["status"] == "measured" or row["why"] in text.replace("\n  ", " "), row)

        again = self.folder / "again.md"
        again.write_text(f"before\n{page.BEGIN}\n{page.END}\nafter\n")
        self.assertEqual(command("--from", rows, "--markdown", again).returncode, 0)
        self.assertEqual(again.read_text(), text)


class Twins(InFolder):
    def test_a_peer_with_a_wrong_law_is_not_comparable(self):
        row = speed.complete_graph(self.program, self.peers, PLAIN, 5, 240, 1, peer_alpha=1.01)
        self.assertEqual(row["status"], "not comparable", row)
        self.assertIn("last positions differ", row["why"])
        self.assertNotIn("ratio", row)
        report = {"schema_version": run.SCHEMA, "rows": [row]}
        (self.folder / "rows.json").write_text(json.dumps(report))
        self.assertEqual(command("--from", self.folder / "rows.json").returncode, 1)

    def test_quadrotors_of_either_side_must_end_at_their_slots(self):
        for side in ("ours", "peer"):
            entry = {"ours": {}, "peer": {}, "status": "measured", "why": None}
            self.assertTrue(speed.arrived(entry, side, "engine", 0.3))
            self.assertEqual((entry["status"], entry[side]["end_m"]), ("measured", 0.3))
            for far_m, stored in ((0.31, 0.31), (float("inf"), None)):
                self.assertFalse(speed.arrived(entry, side, "engine", far_m))
                self.assertEqual((entry["status"], entry[side]["end_m"]), ("not comparable", stored))
                self.assertIn("more than 0.3 m", entry["why"])

    def test_a_contraction_keeps_the_mean_position(self):
        found = speed.contracted([(0.0, 0.0, 1.0), (4.0, 2.0, 1.0)], 0.5)
        self.assertEqual(found, [(1.0, 0.5, 1.0), (3.0, 1.5, 1.0)])

    def test_the_spread_of_ratios_is_that_of_paired_rounds(self):
        entry = {"ours": {}, "peer": {}}
        speed.finish(entry, [2.0, 1.0], [3.0, 4.0])
        self.assertEqual((entry["ours"]["time"], entry["peer"]["time"], entry["ratio"]), (1.0, 3.0, 3.0))
        self.assertEqual((entry["rounds"], entry["smallest_ratio"], entry["largest_ratio"]), (2, 1.5, 4.0))

    def test_positions_that_are_not_numbers_are_infinitely_far(self):
        self.assertEqual(speed.farthest([[0.0, 0.0, float("nan")]], [(0.0, 0.0, 0.0)]), float("inf"))
        self.assertEqual(speed.farthest([], [(0.0, 0.0, 0.0)]), float("inf"))

    def test_samples_below_the_whole_motion_are_not_comparable(self):
        entry = {"delta_m": 1.0, "true_m": 0.9, "status": "measured", "why": None}
        hidden = sampling.judged(entry | {"samples_m": 1.1})
        self.assertTrue(hidden["violated"] and not hidden["seen_at_samples"])
        self.assertEqual(hidden["status"], "measured")
        self.assertEqual(sampling.judged(entry | {"samples_m": 0.8})["status"], "not comparable")

    def test_a_sample_shows_a_collision_in_the_metric_of_the_scene(self):
        scene = scenes.swap(0)  # 0.25 m across, 0.75 m high
        self.assertTrue(missions.seen(scene, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.7)]))
        self.assertFalse(missions.seen(scene, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.8)]))
        self.assertFalse(missions.seen(scene, [(0.0, 0.0, 0.0), (0.26, 0.0, 0.0)]))
        blocks = scenes.blocks(0)
        self.assertTrue(missions.seen(blocks, [(8.5, 25.0, 0.0)]))
        self.assertFalse(missions.seen(blocks, [(7.5, 25.0, 0.0)]))

    def test_a_sample_near_a_column_shows_a_collision(self):
        forest = scenes.forest(0)
        _, (x, y, _), radius_m = forest.columns[0]
        self.assertTrue(missions.seen(forest, [(x + radius_m + 0.14, y, 1.0)]))
        self.assertFalse(missions.seen(forest, [(x + radius_m + 0.16, y, 1.0)]))
        self.assertFalse(missions.seen(forest, [(x, y, 3.0 + radius_m + 0.16)]))

    def test_a_scene_for_balls_has_the_separations_and_keeps_the_limits_of_its_ellipsoids(self):
        for scene in (scenes.lsc(10)(0), scenes.swap(0)):
            balls = scene.as_balls()
            squash = scene.half_axes_m[0] / scene.half_axes_m[2]
            for height_m, expected in ((1.98, True), (2.02, False)):
                sample = [(0.0, 0.0, 0.0), (0.0, 0.0, height_m * scene.half_axes_m[2])]
                self.assertEqual(missions.seen(scene, sample), expected)
                self.assertEqual(missions.seen(balls, [(x, y, z * squash) for x, y, z in sample]), expected)
            self.assertAlmostEqual(balls.max_speed_m_s / squash, scene.max_speed_m_s)
            self.assertAlmostEqual(balls.max_accel_m_s2 / squash, scene.max_accel_m_s2)
            self.assertNotIn("[safety]", balls.text("orca", False))
        circle = scenes.circle(0)
        self.assertIs(circle.as_balls(), circle)

    def test_indoor_starts_and_goals_keep_the_distance_of_the_source_from_blocks(self):
        for scene in (scenes.r3r_indoor(32)(0), scenes.r3r_indoor(128)(1)):
            for point in (*scene.start_m, *scene.slots_m):
                nearest_m = min(scenes.distance_to_box(point, at, size) for _, at, size in scene.boxes)
                self.assertGreaterEqual(nearest_m, 3.0)
            self.assertTrue(missions.seen(scene, [scene.boxes[1][1]]))

    def test_each_flight_on_the_circle_of_r3r_has_its_range(self):
        ranges = [f"range_m = {scenes.r3r_circle(4)(seed).radio_m}" for seed in range(5)]
        self.assertEqual(ranges, [f"range_m = {x}" for x in (1.0, 1.5, 2.0, 2.5, 3.0)])
        for seed, line in enumerate(ranges):
            self.assertIn(line, scenes.r3r_circle(4)(seed).text("bvc", True))
        self.assertNotIn("[network]", scenes.lsc(10)(0).text("bvc", True))

    def test_only_samples_on_the_grid_show_a_collision(self):
        scene = scenes.circle(0)  # checks at 4 Hz, limit 3 m
        near, far = [(0.0, 0.0, 0.0), (2.9, 0.0, 0.0)], [(0.0, 0.0, 0.0), (3.1, 0.0, 0.0)]
        for samples, ended_early, expected in (
            ([(0.0, far), (0.25, near), (0.5, far)], False, None),
            ([(0.0, far), (0.25, far), (0.3, near)], False, "hidden"),
            ([(0.0, far), (0.25, far), (0.3, near)], True, "ended_between"),
            ([(0.0, far), (0.25, near), (0.3, near)], True, None),
            ([(0.0, far), (0.25 + 1e-9, near)], True, None),
        ):
            self.assertEqual(missions.how_unseen(scene, samples, ended_early), expected, samples)

    def test_a_flight_that_ends_at_the_limit_between_samples_is_not_hidden(self):
        mission = next(mission for mission in scenes.missions(quick=True, seeds=1) if mission.name == "LSC, 10 agents")
        ending = dataclasses.replace(mission, scene=lambda _: mission.scene(26))
        row = missions.fly(self.program, ending, "displacement", shield=False)
        self.assertEqual((row["collided"], row["ended_between"], row["hidden"]), (1, 1, 0), row)

    def test_the_samples_of_all_missions_are_on_the_grid_of_the_source(self):
        for mission in scenes.missions(quick=False, seeds=1):
            scene = mission.scene(0)
            steps = 1 / (scene.sampled_hz * scene.dt_s)
            self.assertAlmostEqual(steps, round(steps), 9, mission.name)
            # The shield holds commands for 0.05 s.
            self.assertAlmostEqual(0.05 / scene.dt_s, round(0.05 / scene.dt_s), 9, mission.name)

    def test_a_folder_of_trajectories_is_known_by_its_contents(self):
        (self.folder / "swap6v_pps").mkdir()
        (self.folder / "swap6v_pps/pp1.csv").write_text("0,1\n")
        self.assertEqual(sampling.source(self.folder / "swap6v_pps"), "unknown source")

    def test_random_scenes_keep_the_published_distances(self):
        for mission in scenes.missions(quick=False, seeds=1):
            scene = mission.scene(0)
            for rows in (scene.start_m, scene.slots_m):
                self.assertFalse(missions.seen(scene, rows), mission.name)
            self.assertEqual(len(scene.start_m), len(scene.slots_m), mission.name)


class Arguments(InFolder):
    def script(self, text):
        file = self.folder / "program"
        file.write_text(text)
        file.chmod(0o755)
        return file

    def test_wrong_arguments_end_with_a_sentence_and_code_2(self):
        bare = self.folder / "bare.md"
        bare.write_text("no block\n")
        twice = self.folder / "twice.md"
        twice.write_text(f"{page.BEGIN}\n{page.END}\n" * 2)
        words = self.folder / "words.json"
        words.write_text("[1, 2")
        for arguments, problem in (
            (("--only", "speeds"), "--only: unknown group (speeds); use"),
            (("--seeds", "0"), "--seeds: must be at least 1 (0)"),
            (("--markdown", bare), "no block to replace"),
            (("--markdown", twice), "no block to replace"),
            (("--markdown", self.folder / "none.md"), "--markdown: no page at this path"),
            (("--json", self.folder / "none/rows.json"), "--json: its folder does not exist"),
            (("--trajectories", self.folder / "none"), "--trajectories: no folder at this path"),
            (("--program", self.folder / "none"), "--program: no program at this path"),
            (("--from", words), "cannot be read"),
            (("--program", self.script("not a program")), "cannot be started"),
        ):
            done = command(*arguments)
            self.assertEqual(done.returncode, 2, (arguments, done.stderr))
            self.assertIn(problem, done.stderr)
            self.assertNotIn("Traceback", done.stderr)


def speed_row(name, ours, peer, **more):
    row = {"group": "speed", "name": name, "work": f"work of {name}", "unit": "us", "status": "measured", "why": None}
    return row | {"ours": {"settings": "one thread"} | ours, "peer": {"settings": "no audit"} | peer} | more


class Page(unittest.TestCase):
    def test_a_spread_that_contains_1_has_no_ratio(self):
        for rounds, smallest, ratio, largest, text in (
            (5, 1.2, 1.3, 1.456, "1.3 (1.2 to 1.46)"),
            (5, 0.5, 0.6, 0.9, "**0.6** (0.5 to 0.9)"),
            (5, 0.95, 1.2, 1.3, "~ within the spread (0.95 to 1.3)"),
            (5, 1.0, 1.2, 1.3, "~ within the spread (1 to 1.3)"),
            (1, 2.0, 2.0, 2.0, "2 (one round)"),
        ):
            row = {"rounds": rounds, "smallest_ratio": smallest, "ratio": ratio, "largest_ratio": largest}
            self.assertEqual(page.ratio(row), text)

    def test_collisions_of_flights_that_end_between_samples_are_counted_apart(self):
        row = {"status": "measured", "shield": False, "collided": 3, "hidden": 1, "ended_between": 0}
        counts = " Flights that collided: 3 without the shield, 0 under it. Flights with hidden collisions: 1."
        self.assertEqual(page.totals([row]), counts)
        between = page.totals([row | {"ended_between": 2}])
        self.assertTrue(between.startswith(counts + " 2 flights ended at the limit between two samples."), between)

    def test_a_cell_names_other_numbers_of_flights_and_collisions(self):
        row = {"flights": 30, "succeeded": 29, "collided": 0, "hidden": 0}
        few, ball = row | {"flights": 5, "succeeded": 5}, row | {"as_balls": True}
        hit = row | {"collided": 3, "hidden": 1}
        for bare, shielded, text in (
            (row, row, "29/29"),
            (None, row, "-/29"),
            (ball, row, "29*/29"),
            (few, few, "5/5 of 5"),
            (few, row, "5/29 of 5/30"),
            (hit, row, "29/29 (3/0, 1 hidden)"),
            (None, hit | {"hidden": 0}, "-/29 (-/3)"),
            (None, None, "-/-"),
        ):
            self.assertEqual(page.cell(bare, shielded, 30), text)

    def test_the_best_laws_are_those_with_the_largest_share(self):
        rows = [
            {"law": law, "compared": "succeeded", "succeeded": count, "safe": 0, "flights": flights}
            for law, count, flights in (("orca", 5, 10), ("bvc", 2, 3), ("bvc", 2, 3), ("cbf-qp", 4, 6))
        ]
        self.assertEqual(page.best(rows), "4 of 6 succeeded (bvc, cbf-qp)")
        self.assertEqual(page.best(rows[:2]), "2 of 3 succeeded (bvc)")
        tied = [rows[1], rows[3]]
        self.assertEqual(page.best(tied), "2 of 3 succeeded (bvc); 4 of 6 succeeded (cbf-qp)")
        clear = [row | {"compared": "safe", "safe": row["flights"]} for row in rows[:1]]
        self.assertEqual(page.best(clear), "10 of 10 clear (orca)")
        self.assertEqual(page.best([]), "-")

    def test_a_report_gives_the_text_of_a_page(self):
        spread = {"rounds": 5, "smallest_ratio": 1.5, "ratio": 2.0, "largest_ratio": 2.5}
        graph = speed_row(
            "complete-graph/5/mujoco",
            {"time": 2.0, "parts": {"law": 0.5, "rest": 1.5}},
            {"name": "mujoco", "version": "1.0", "time": 4.0, "parts": {"law": 1.0, "rest": 3.0}},
            difference_m=2e-13,
            **spread,
        )
        flown = speed_row(
            "quadrotors/2/crazyflow",
            {"time": 1500.0, "end_m": 0.02},
            {"name": "crazyflow", "version": "1.0", "time": 3000.0, "end_m": 0.1},
            **spread,
        )
        motion = {"group": "sampling", "name": "show/1 Hz", "motion": "show", "rate_hz": 1.0, "status": "measured"}
        motion |= {"true_m": 0.9, "samples_m": 1.1, "straight_m": 1.0, "hidden_m": 0.2, "delta_m": 1.0, "why": None}
        motion |= {"violated": True, "seen_at_samples": False, "source": "owner/name abcdef0, a/show"}
        flight = {"group": "missions", "name": "Ring, 3/orca/bare", "mission": "Ring, 3", "law": "orca"}
        flight |= {"shield": False}
        flight |= {"source": "owner/name abcdef0", "success": "each within 1 m", "changes": "none", "why": None}
        flight |= {"status": "measured", "flights": 4, "succeeded": 1, "reached": 2, "collided": 3, "hidden": 1}
        flight |= {"ended_between": 1, "least_m": 0.9, "delta_m": 1.0, "median_s": 2.0, "wall_s": 0.1}
        flight |= {"as_balls": True, "published": "100 %", "why_other_rate": "no planner", "compared": "succeeded"}
        shielded = flight | {"shield": True, "as_balls": False, "flights": 2, "succeeded": 2, "collided": 0}
        shielded |= {"hidden": 0, "ended_between": 0}
        skipped = {"group": "missions", "name": "Ring, 3/laplacian", "status": "skipped", "why": "no slots"}
        report = run.EMPTY | {"program": "tautline 1.0", "rows": [graph, flown, motion, flight, shielded, skipped]}
        found = page.replace(f"before\n{page.BEGIN}\nSTALE\n{page.END}\nafter\n", report)
        expected = (ROOT / "tests/ci/benchmarks_page.md").read_text()
        self.assertEqual(found, expected)

    def test_the_page_of_the_docs_has_a_block_of_a_full_run(self):
        text = (ROOT / "docs/benchmarks.md").read_text()
        block = text.split(page.BEGIN)[1].split(page.END)[0]
        self.assertEqual((text.count(page.BEGIN), text.count(page.END)), (1, 1))
        self.assertNotIn("quick run", block)
        for part in ("## Speed", "## Missions", "## What sampling hides"):
            self.assertIn(part, block)


if __name__ == "__main__":
    unittest.main()
