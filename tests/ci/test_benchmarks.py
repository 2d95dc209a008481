"""Tests of `benchmarks/run.py`: a quick run without peers, wrong laws, wrong samples, and wrong arguments.

Usage: `python -m unittest discover --start-directory tests/ci`. TAUTLINE is the program [target/debug/tautline].
"""

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
        self.assertEqual(report["schema_version"], 1)
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
        for row in measured:
            if row["group"] == "missions":
                self.assertEqual(row["collided"] + row["safe"] + row["undecided"], row["flights"], row)
                self.assertLessEqual(row["hidden"], row["collided"], row)
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
        report = {"schema_version": 1, "rows": [row]}
        (self.folder / "rows.json").write_text(json.dumps(report))
        self.assertEqual(command("--from", self.folder / "rows.json").returncode, 1)

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


class Page(unittest.TestCase):
    def test_the_page_of_the_docs_has_a_block_of_a_full_run(self):
        text = (ROOT / "docs/benchmarks.md").read_text()
        block = text.split(page.BEGIN)[1].split(page.END)[0]
        self.assertEqual((text.count(page.BEGIN), text.count(page.END)), (1, 1))
        self.assertNotIn("quick run", block)
        for part in ("## Speed", "## Missions", "## What sampling hides"):
            self.assertIn(part, block)


if __name__ == "__main__":
    unittest.main()
