"""Tests of the Slurm script: its arithmetic with stubs of commands, and campaigns on a real node."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
import unittest
from pathlib import Path

from campaigns import ROOT, TAUTLINE, Campaign, ran, short_folder, until, words
from slurm_node import Slurm

SCRIPT = ROOT / "python" / "campaign.sbatch"

# Stubs that record their arguments, or print the files of the test.
STUBS = {
    "sbatch": 'echo "$*" > "$NOTES/submitted"',
    "scontrol": 'echo "MaxArraySize            = $MOST"',
    "tautline": """
        case $2 in
        missing) cat "$NOTES/missing"; [ ! -s "$NOTES/missing" ] ;;
        shard) echo "$5" >> "$NOTES/flown" ;;
        esac""",
}


def numbers(listed: str) -> list[int]:
    """Returns the numbers of a list such as 13,500-502, with repetitions."""
    spans = [[int(end) for end in span.split("-")] for span in listed.split(",")]
    assert all(span == sorted(span) for span in spans), listed
    return [number for span in spans for number in range(span[0], span[-1] + 1)]


class Arithmetic(unittest.TestCase):
    """Tests that each missing shard is flown once, for any block."""

    def setUp(self) -> None:
        place = short_folder()
        self.addCleanup(place.cleanup)
        self.notes = Path(place.name)
        for name, does in STUBS.items():
            (self.notes / name).write_text(f"#!/bin/sh\n{does}\n")
            (self.notes / name).chmod(0o755)
        (self.notes / "camp").mkdir()

    def script(self, *options: str, **variables: object):
        path = f"{self.notes}:{os.environ['PATH']}"
        settings = {name: str(value) for name, value in variables.items()}
        environment = {"PATH": path, "NOTES": str(self.notes), **settings}
        return ran("sh", SCRIPT, self.notes / "camp", *options, env=environment)

    def submitted(self, shards: int, missing: str, **variables: object) -> tuple[int, list[int], list[str]]:
        """Returns the block, the tasks and the other options of a submission."""
        text = f'{{\n  "scenario": "\\n  \\"shards\\": 9,",\n  "shards": {shards},\n  "folder": "/"\n}}\n'
        (self.notes / "camp" / "manifest.json").write_text(text)
        (self.notes / "missing").write_text(missing + "\n" if missing else "")
        ran_script = self.script("--partition=night", **variables)
        self.assertEqual(ran_script.returncode, 0, ran_script.stderr)
        array, *options, mark, block, program = (self.notes / "submitted").read_text().split()
        self.assertEqual((mark, program), ("--task", "tautline"))
        return int(block), numbers(array.removeprefix("--array=")), options

    def flown(self, block: int, tasks: list[int]) -> list[int]:
        """Returns the shards that these tasks fly."""
        (self.notes / "flown").write_text("")
        for task in tasks:
            # A task has no variable of its submission.
            ran_task = self.script("--task", str(block), "tautline", SLURM_ARRAY_TASK_ID=task)
            self.assertEqual(ran_task.returncode, 0, ran_task.stderr)
        return [shard for span in (self.notes / "flown").read_text().split() for shard in numbers(span)]

    def test_every_shard_is_flown_once(self) -> None:
        sizes = [(1, 8), (7, 8), (8, 8), (9, 8), (63, 8), (64, 8), (65, 8), (97, 10), (200, 1001), (2003, 1001)]
        for shards, most in sizes:
            block, tasks, options = self.submitted(shards, f"0-{shards - 1}" if shards > 1 else "0", MOST=most)
            self.assertLess(max(tasks), most)
            self.assertEqual(block, -(-shards // most))
            self.assertEqual(options, ["--partition=night", str(SCRIPT), str(self.notes / "camp")])
            if shards <= 200:
                self.assertEqual(self.flown(block, tasks), list(range(shards)), (shards, most))

    def test_missing_shards_are_flown_once(self) -> None:
        for missing in ["0", "13,500-502", "0-3,5,7-19,21,29-31,599", "599", "9-10,19-20,29-30", "0-599"]:
            for block in (1, 2, 10, 7, 600, 1000):
                of, tasks, _ = self.submitted(600, missing, BLOCK=block)
                expected = sorted({shard // block for shard in numbers(missing)})
                self.assertEqual((of, tasks), (block, expected), (missing, block))
        flown = self.flown(7, self.submitted(600, "13,500-502,598", BLOCK=7)[1])
        self.assertEqual(flown, [*range(7, 14), *range(497, 504), *range(595, 600)])

    def test_without_scontrol_an_array_has_the_default_size(self) -> None:
        (self.notes / "scontrol").unlink()
        (self.notes / "scontrol").write_text("#!/bin/sh\nexit 127\n")
        (self.notes / "scontrol").chmod(0o755)
        block, tasks, _ = self.submitted(2002, "0-2001")
        self.assertEqual((block, max(tasks)), (2, 1000))
        (self.notes / "scontrol").write_text("#!/bin/sh\necho 'MaxArraySize = 11'\n")
        self.assertEqual(self.submitted(22, "0-21")[0], 2)

    def test_inside_an_array_the_script_still_submits(self) -> None:
        _, tasks, _ = self.submitted(3, "0-2", MOST=8, SLURM_ARRAY_TASK_ID=1)
        self.assertEqual(tasks, [0, 1, 2])
        self.assertFalse((self.notes / "flown").exists())

    def test_a_complete_or_a_wrong_campaign_submits_nothing(self) -> None:
        (self.notes / "missing").write_text("")
        done = self.script()
        self.assertEqual(done.returncode, 0)
        self.assertIn("campaign merge", done.stdout)
        (self.notes / "tautline").write_text("#!/bin/sh\necho no campaign >&2\nexit 2\n")
        wrong = self.script()
        self.assertEqual((wrong.returncode, wrong.stderr), (2, "no campaign\n"))
        self.assertFalse((self.notes / "submitted").exists())


class RealNode(unittest.TestCase):
    """Tests of campaigns on a node whose arrays have at most eight tasks."""

    folder: Path
    slurm: Slurm

    @classmethod
    def setUpClass(cls) -> None:
        place = short_folder()
        cls.addClassCleanup(place.cleanup)
        cls.folder = Path(place.name)
        cls.slurm = Slurm(cls.folder, most=8)
        cls.addClassCleanup(cls.slurm.end)
        cls.slurm.start()

    def campaign(self, name: str, runs: int, duration_s: float, shards: int) -> Campaign:
        folder = self.folder / name
        folder.mkdir()
        return Campaign(folder, runs, duration_s, shards)

    def submitted(self, *command: str | Path) -> str:
        # Some clusters export no variables to jobs.
        variables = {"TAUTLINE": str(TAUTLINE), "SBATCH_EXPORT": "NONE"}
        submitted = ran(*command, env={**self.slurm.environment, **variables}, cwd=self.folder)
        self.assertEqual(submitted.returncode, 0, submitted.stderr)
        return submitted.stdout

    def in_flight(self, camp: Campaign) -> int:
        """Waits for a process that flies the campaign, and returns it."""
        flying = f" campaign shard {camp.path} "

        def processes() -> list[int]:
            numbers = (int(process.name) for process in Path("/proc").glob("[0-9]*"))
            return [number for number in numbers if flying in words(number)]

        until(lambda: bool(processes()), 60, "no task began")
        return processes()[0]

    def test_a_killed_task_is_submitted_again_and_the_bytes_are_the_same(self) -> None:
        camp, began = self.campaign("killed", runs=30, duration_s=4.0, shards=30), time.monotonic()
        self.assertIn("Submitted batch job", self.submitted("sh", SCRIPT, camp.path))
        os.kill(self.in_flight(camp), signal.SIGKILL)
        until(self.slurm.is_empty, 120, "the array does not end")
        missing = camp.missing()
        self.assertNotEqual(missing, "", "the killed task had flown all its shards")
        self.assertIn("Submitted batch job", self.submitted("sh", SCRIPT, camp.path))
        until(self.slurm.is_empty, 60, "the second array does not end")
        print(f"{camp.runs} shards by 8 tasks, {missing} again: {time.monotonic() - began:.1f} s", file=sys.stderr)
        self.assertIn("nothing is missing", self.submitted("sh", SCRIPT, camp.path))
        self.assertEqual(camp.merged(), camp.alone())

    def test_sigterm_before_the_time_limit_keeps_the_flown_shards(self) -> None:
        camp = self.campaign("ended", runs=20, duration_s=20.0, shards=1)
        job = self.submitted("sh", SCRIPT, camp.path, "--output=ended.out").split()[-1]
        journals = camp.path.glob
        until(lambda: any(path.stat().st_size for path in journals("parts/*.journal")), 60, "no flight began")
        # The signal of --signal=B:TERM@60 in the script.
        self.submitted("scancel", "--signal=TERM", "--batch", job)
        until(self.slurm.is_empty, 60, "the task does not end")
        self.assertIn("interrupted in shard 0", (self.folder / "ended.out").read_text())
        again = ran(TAUTLINE, "campaign", "shard", camp.path, "--shard", "0")
        flown = re.search(r"shard 0: (\d+) flights flown", again.stderr + again.stdout)
        assert flown, again
        self.assertLess(int(flown[1]), camp.runs)
        self.assertEqual(camp.missing(), "")

    def test_an_array_runs_without_the_script(self) -> None:
        camp = self.campaign("wrapped", runs=4, duration_s=1.0, shards=4)
        task = f"{TAUTLINE} campaign shard {camp.path} --shard env:SLURM_ARRAY_TASK_ID"
        self.submitted("sbatch", f"--array={camp.missing()}", "--wrap", task)
        until(self.slurm.is_empty, 60, "the array does not end")
        self.assertEqual(camp.missing(), "")


class Kubernetes(unittest.TestCase):
    """Tests of the command of a pod of an indexed job, without a cluster of Kubernetes."""

    def test_a_pod_flies_the_shard_of_its_index(self) -> None:
        place = short_folder()
        self.addCleanup(place.cleanup)
        camp = Campaign(Path(place.name), runs=4, duration_s=1.0)
        pod: list[str | Path] = [TAUTLINE, "campaign", "shard", camp.path, "--shard", "env:JOB_COMPLETION_INDEX"]
        self.assertEqual(ran(*pod, env={**os.environ, "JOB_COMPLETION_INDEX": "2"}).returncode, 0)
        self.assertEqual(camp.missing(), "0-1,3")
        self.assertEqual(ran(*pod, env={**os.environ, "JOB_COMPLETION_INDEX": "4"}).returncode, 2)


if __name__ == "__main__":
    unittest.main()
