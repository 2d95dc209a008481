"""The program `tautline` as a process: flights, audits and exports in a temporary folder.

All text of scenarios is made here from numbers, so that a benchmark needs no file of another project.
"""

import json
import os
import pathlib
import re
import subprocess
import time
from collections.abc import Mapping, Sequence
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parents[1]

Point = tuple[float, float, float]


class Unusable(Exception):
    """The program is missing, or a benchmark cannot be flown. The message names the remedy."""


def find(given: str | None) -> pathlib.Path:
    """Returns the program: `given`, the variable TAUTLINE, a release build, or a debug build."""
    named = given or os.environ.get("TAUTLINE")
    if named:
        if not os.access(named, os.X_OK) or os.path.isdir(named):
            raise Unusable(f"--program: no program at this path ({named}); build it, or name another one")
        return pathlib.Path(named).resolve()
    for build in ("release", "debug"):
        path = ROOT / "target" / build / "tautline"
        if os.access(path, os.X_OK):
            return path
    raise Unusable("program: not built (target/release/tautline); run `cargo build --release --no-default-features`")


def core() -> int:
    """Returns the processor core on which both sides of a comparison run."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 0


def pin() -> None:
    """Restricts this process to one core. Runs in a child process before its program starts."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core()})


class Program:
    """The program at a path. Each call starts a process on one core and waits for it."""

    def __init__(self, path: pathlib.Path, folder: pathlib.Path) -> None:
        self.path = path
        self.folder = folder

    def call(self, *words: str, limit_s: float = 1800.0) -> tuple[subprocess.CompletedProcess[str], float]:
        """Runs the program and returns its result with its wall-clock time [s]."""
        began = time.perf_counter()
        try:
            done = subprocess.run(
                [str(self.path), *words],
                cwd=self.folder,
                env=os.environ | {"NO_COLOR": "1"},
                capture_output=True,
                text=True,
                timeout=limit_s,
                preexec_fn=pin,
            )
        except subprocess.TimeoutExpired:
            raise Unusable(f"tautline {words[0]} took longer than {limit_s:.0f} s") from None
        except OSError as problem:
            raise Unusable(f"{self.path}: cannot be started ({problem.strerror}); build it, or name another") from None
        return done, time.perf_counter() - began

    def version(self) -> str:
        return self.call("--version")[0].stdout.strip()

    def fly(self, scenario: str, *sets: str, out: str = "flight") -> dict[str, Any]:
        """Flies a scenario, given as TOML text or as the name of a built-in one, and returns `report.json`.

        Exit code 1 is a flight that does not pass. Any other failure raises `Unusable` with the program's message.
        """
        source = scenario
        if "\n" in scenario:
            source = "scenario.toml"
            (self.folder / source).write_text(scenario, encoding="utf-8")
        words = ["run", source, "--json", "--quiet", "--no-figures", "--no-snapshots", "--force", "--threads", "1"]
        for key in sets:
            words += ["--set", key]
        done, _ = self.call(*words, "--out", out)
        if done.returncode not in (0, 1):
            raise Unusable(message(done.stderr))
        report: dict[str, Any] = json.loads(done.stdout)
        return report

    def audit(self, path: str, *words: str) -> tuple[dict[str, Any], float]:
        """Judges a recording and returns the keys of `audit --json` with the time of the process [s]."""
        done, wall_s = self.call("audit", path, "--json", *words)
        if not done.stdout.startswith("{"):
            raise Unusable(message(done.stderr))
        return json.loads(done.stdout), wall_s

    def samples(self, out: str = "flight") -> list[tuple[float, list[Point]]]:
        """Returns the recorded samples of a flight: time [s] and the position of each vehicle [m]."""
        done, _ = self.call("export", f"{out}/run.mcap", "--out", f"{out}/run.csv", "--force", "--quiet")
        if done.returncode != 0:
            raise Unusable(message(done.stderr))
        rows: list[tuple[float, list[Point]]] = []
        with (self.folder / out / "run.csv").open(encoding="utf-8") as lines:
            next(lines)
            for line in lines:
                t, _, x, y, z, *_ = line.split(",")
                if not rows or rows[-1][0] != float(t):
                    rows.append((float(t), []))
                rows[-1][1].append((float(x), float(y), float(z)))
        return rows


def separation_m(report: Mapping[str, Any]) -> float:
    """Returns the smallest separation of two vehicles [m], of the report on a flight or a recording."""
    smallest: float = report["answers"][0]["closest"][0]["value"]["lower"]
    return smallest


def message(text: str) -> str:
    """Returns the sentence of an error message, without its marker and its place in the file."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    sentence = next((line for line in lines if line.startswith("x ")), lines[0] if lines else "no message")
    return re.sub(r"^x |scenario\.toml:\d+:\d+: ", "", sentence)


def points(rows: Sequence[Sequence[float]]) -> str:
    """Returns positions as a TOML list."""
    return "[" + ", ".join("[" + ", ".join(repr(float(x)) for x in row) + "]" for row in rows) + "]"


def scenario(name: str, tables: Mapping[str, Mapping[str, Any]], rest: str = "") -> str:
    """Returns the TOML text of a scenario from its tables. Text values that start with `[` are TOML already."""
    lines = [f'name = "{name}"']
    for table, keys in tables.items():
        lines += ["", f"[{table}]"]
        for key, value in keys.items():
            lines.append(f"{key} = {toml(value)}")
    return "\n".join(lines) + "\n" + rest


def toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value if value.startswith("[") else json.dumps(value)
    return repr(value)
