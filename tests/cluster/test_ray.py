"""Tests of the Ray driver on a real cluster with two or three nodes."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

from campaigns import ROOT, TAUTLINE, Campaign, ran, short_folder, until
from ray_node import ENVIRONMENT, Node

DRIVER = ROOT / "python" / "tautline_ray.py"

# Runs the driver as a module that only its own process can import.
IMPORTED = f"import sys; sys.path.insert(0, {str(DRIVER.parent)!r}); import tautline_ray; sys.exit(tautline_ray.main())"

# Stub of the program.
STUB = Path(__file__).with_name("stub.sh")


class RayCluster(unittest.TestCase):
    """A cluster with two nodes, each with one slot."""

    folder: Path
    head: Node
    second: Node

    @classmethod
    def setUpClass(cls) -> None:
        place = short_folder()
        cls.addClassCleanup(place.cleanup)
        cls.folder = Path(place.name)
        cls.head = cls.node("head")
        cls.head.ready()
        cls.second = cls.node("second", cls.head).ready()

    @classmethod
    def node(cls, name: str, head: Node | None = None) -> Node:
        node = Node(cls.folder, name, head)
        cls.addClassCleanup(node.end)
        return node

    def driver(self, camp: Path, *more: str, by: tuple[str, ...] = (str(DRIVER),)) -> list[str]:
        return [sys.executable, *by, str(camp), "--address", self.head.address, *more]

    def stubbed(
        self, name: str, code: int, times: int, by: tuple[str, ...] = (str(DRIVER),)
    ) -> tuple[subprocess.CompletedProcess[str], int]:
        """Flies four shards of the stub, one with ``times`` failures. Returns the result and the number of failures."""
        camp = self.folder / name
        camp.mkdir()
        (camp / "code").write_text(str(code))
        (camp / "times").write_bytes(bytes(times))
        program = camp / "tautline"
        shutil.copyfile(STUB, program)
        program.chmod(0o755)
        flown = ran(*self.driver(camp, "--tautline", str(program), by=by), env=ENVIRONMENT)
        return flown, len((camp / "begun").read_bytes())

    def test_wrong_input_ends_the_driver_at_once(self) -> None:
        flown, begun = self.stubbed("wrong", 2, 100)
        self.assertEqual((flown.returncode, begun), (2, 1), flown.stderr)
        self.assertIn("shard 1 is wrong", flown.stderr)

    def test_a_failure_is_retried_five_times(self) -> None:
        flown, begun = self.stubbed("healed", 3, 5, by=("-c", IMPORTED))
        self.assertEqual((flown.returncode, begun), (0, 5), flown.stderr)
        flown, begun = self.stubbed("ill", 3, 100)
        self.assertEqual((flown.returncode, begun), (3, 6), flown.stderr)
        self.assertIn("shard 1 is wrong", flown.stderr)

    def test_another_program_is_refused(self) -> None:
        folder = self.folder / "another"
        folder.mkdir()
        camp = Campaign(folder, runs=2, duration_s=1.0)
        program = folder / "tautline"
        # The hash of the sources identifies a program.
        sources = json.loads((camp.path / "manifest.json").read_text())["tool"]["sha256"].encode()
        bytes_of_program = TAUTLINE.read_bytes()
        self.assertIn(sources, bytes_of_program)
        program.write_bytes(bytes_of_program.replace(sources, sources[::-1]))
        program.chmod(0o755)
        flown = ran(*self.driver(camp.path, "--tautline", str(program)), env=ENVIRONMENT)
        self.assertEqual(flown.returncode, 2, flown.stderr)
        self.assertIn("SHA-256", flown.stderr)

    def test_killed_stopped_and_added_nodes_give_the_same_bytes(self) -> None:
        camp = Campaign(self.folder, runs=120, duration_s=240.0)
        hasty = ["--tautline", str(TAUTLINE), "--hedge-after", "4"]
        log = self.folder / "driver.log"

        def begun() -> subprocess.Popen[bytes]:
            command = self.driver(camp.path, *hasty)
            with log.open("wb") as out:
                driver = subprocess.Popen(command, stdout=out, stderr=out, env=ENVIRONMENT, cwd="/")
            self.addClassCleanup(driver.kill)
            return driver

        first = begun()
        until(lambda: camp.flown() >= 5, 90, "the campaign did not begin")
        first.kill()
        first.wait()
        driver, third = begun(), self.node("third", self.head)

        until(lambda: bool(self.second.workers()), 30, "the second node flies nothing")
        for worker in self.second.workers():
            os.kill(worker, signal.SIGKILL)

        third.ready()
        until(lambda: bool(third.flights()), 60, "the third node flies nothing")
        self.assertLess(camp.flown(), camp.runs)
        frozen = self.second.freeze()
        at, began = camp.flown(), time.monotonic()
        self.assertLess(at, camp.runs - 10, "the node stopped too late")

        self.assertEqual(driver.wait(timeout=200), 0, log.read_text())
        took_s = time.monotonic() - began
        print(f"node frozen at {at} of {camp.runs} shards; all flown {took_s:.1f} s later", file=sys.stderr)
        hedged = re.findall(r"(\d+) submitted again$", log.read_text(), re.MULTILINE)
        self.assertGreaterEqual(int(hedged[-1]), 1, log.read_text())
        self.assertEqual(camp.missing(), "")
        whole = camp.alone()
        self.assertEqual(camp.merged(), whole)

        # The stopped processes continue, find their shards flown, and write no different results.
        for process in frozen:
            self.assertIn("T", Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0])
            os.kill(process, signal.SIGCONT)
        until(lambda: not self.second.flights(), 60, "the stopped processes do not end")
        self.assertEqual(list((camp.path / "parts").glob("*.differs.jsonl")), [])
        self.assertEqual(camp.merged(), whole)
        again = ran(*self.driver(camp.path, *hasty), env=ENVIRONMENT)
        self.assertEqual(again.returncode, 0, again.stderr)


if __name__ == "__main__":
    unittest.main()
