"""Helpers of the tests of clusters: the program, a campaign in a folder, and processes."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILT = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug" / "tautline"
TAUTLINE = Path(os.environ.get("TAUTLINE", BUILT)).resolve()

SPEC = """\
scenario = "pentagon"
runs = {runs}
seed = 5
[set]
time.duration_s = {duration_s}
[vary]
"start.jitter_m" = {{ uniform = [0.0, 0.3] }}
"""


def ran(*command: str | Path, **options) -> subprocess.CompletedProcess[str]:
    """Runs a command to its end and captures its output."""
    line = [str(word) for word in command]
    return subprocess.run(line, capture_output=True, text=True, check=False, timeout=300, **options)


def until(what: Callable[[], bool], seconds: float, why: str) -> None:
    """Waits until ``what`` is true; fails with ``why`` after ``seconds``."""
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            raise AssertionError(f"after {seconds} s: {why}")
        time.sleep(0.05)


def short_folder() -> tempfile.TemporaryDirectory[str]:
    """Returns a folder with a path short enough for sockets."""
    return tempfile.TemporaryDirectory(prefix="tautline-", dir="/tmp", ignore_cleanup_errors=True)


class Campaign:
    """A campaign in a folder, by default with one run per shard."""

    def __init__(self, folder: Path, runs: int, duration_s: float, shards: int | None = None) -> None:
        self.spec, self.path, self.runs = folder / "spec.toml", folder / "camp", runs
        self.spec.write_text(SPEC.format(runs=runs, duration_s=duration_s), encoding="utf-8")
        planned = ran(TAUTLINE, "campaign", "plan", self.spec, "--shards", str(shards or runs), "--out", self.path)
        assert planned.returncode == 0, planned.stderr

    def flown(self) -> int:
        """Returns the number of parts."""
        return len(list((self.path / "parts").glob("shard-?????????.jsonl")))

    def missing(self) -> str:
        """Returns the output of ``tautline campaign missing``."""
        return ran(TAUTLINE, "campaign", "missing", self.path).stdout.strip()

    def merged(self) -> str:
        """Merges all parts and returns the SHA-256 of the results."""
        merged = ran(TAUTLINE, "campaign", "merge", self.path, "--worst", "0", "--quiet")
        assert merged.returncode in (0, 1), merged.stderr
        return self.sha256(self.path)

    def alone(self) -> str:
        """Returns the SHA-256 of the results of the same campaign by ``tautline campaign run``."""
        out = self.path.with_name("alone")
        ran_alone = ran(TAUTLINE, "campaign", "run", self.spec, "--out", out, "--worst", "0", "--quiet")
        assert ran_alone.returncode in (0, 1), ran_alone.stderr
        return self.sha256(out)

    @staticmethod
    def sha256(folder: Path) -> str:
        """Returns the SHA-256 of the results in a folder."""
        return hashlib.sha256((folder / "results.parquet").read_bytes()).hexdigest()


def children(of: int) -> list[int]:
    """Returns the ids of a process and all its descendants, parents first."""
    started: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            started.setdefault(int(stat.read_text().rpartition(")")[2].split()[1]), []).append(int(stat.parent.name))
        except OSError:
            continue
    tree = [of]
    for process in tree:
        tree.extend(started.get(process, []))
    return tree


def words(process: int) -> str:
    """Returns the command line of a process; empty if the process has ended."""
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    except OSError:
        return ""


def end(processes: list[int]) -> None:
    """Kills processes, also stopped ones."""
    for process in processes:
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            continue
