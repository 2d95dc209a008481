"""Benchmarks of tautline beside other projects: speed, missions, and what sampling hides.

Usage:

    python benchmarks/run.py [--quick] [--only GROUP...] [--trajectories FOLDER...] [--json FILE] [--markdown FILE]

Peers come from PyPI, each in a virtual environment of its own under target/benchmarks. A peer that cannot be installed
is skipped, with the reason in the output and on the page. `--quick` has small sizes and installs nothing.

Exit codes: 0 complete; 1 a row is not comparable; 2 wrong arguments or no program.
"""

import argparse
import json
import os
import pathlib
import platform
import sys
import tempfile
from collections.abc import Iterator
from typing import Any, NoReturn

import missions
import page
import sampling
import speed
from peers import ENVIRONMENTS, Peers
from program import ROOT, Program, Unusable, find

Row = dict[str, Any]

# Version of the keys of `--json`.
SCHEMA = 2
GROUPS = ("speed", "missions", "sampling")


def main() -> int:
    given = arguments()
    if given.source:
        report = read(given.source)
    else:
        report = measure(given)
    text = json.dumps(report, indent=1, allow_nan=False) + "\n"
    if given.json:
        page.write(given.json, text)
    if given.markdown:
        try:
            page.write(given.markdown, page.replace(given.markdown.read_text(encoding="utf-8"), report))
        except (KeyError, TypeError, AttributeError) as problem:
            refuse(f"{given.source}: not a report of this command ({problem!r}); measure again")
    return int(any(row["status"] == "not comparable" for row in report["rows"]))


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes, installs nothing: about a minute")
    parser.add_argument("--only", nargs="+", metavar="GROUP", help=f"groups to measure: {', '.join(GROUPS)}")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="write all rows as JSON")
    parser.add_argument("--markdown", type=pathlib.Path, metavar="FILE", help="replace the block of this page")
    parser.add_argument("--from", dest="source", type=pathlib.Path, metavar="FILE", help="rows of a former --json")
    parser.add_argument("--program", metavar="PATH", help="the program [default: target/release, else target/debug]")
    parser.add_argument("--environments", type=pathlib.Path, default=ROOT / "target/benchmarks", metavar="FOLDER",
                        help="virtual environments of the peers [default: target/benchmarks]")
    parser.add_argument("--seeds", type=int, default=30, metavar="N", help="random scenes of a mission [default: 30]")
    parser.add_argument("--trajectories", type=pathlib.Path, nargs="+", default=[], metavar="FOLDER",
                        help="folders of Crazyflie polynomials; docs/benchmarks.md names three of crazyswarm")
    given = parser.parse_args()
    unknown = [name for name in given.only or [] if name not in GROUPS]
    if unknown:
        parser.error(f"--only: unknown group ({unknown[0]}); use {', '.join(GROUPS)}")
    if given.seeds < 1:
        parser.error(f"--seeds: must be at least 1 ({given.seeds}); leave it out for 30")
    for folder in given.trajectories:
        if not folder.is_dir():
            parser.error(f"--trajectories: no folder at this path ({folder}); name a folder of CSV files")
    for option, path in (("--json", given.json), ("--markdown", given.markdown)):
        if path and not path.resolve().parent.is_dir():
            parser.error(f"{option}: its folder does not exist ({path}); create the folder")
    if given.markdown:
        if not given.markdown.is_file():
            parser.error(f"--markdown: no page at this path ({given.markdown}); name a page with a block")
        try:
            page.replace(given.markdown.read_text(encoding="utf-8"), EMPTY)
        except (page.NoBlock, UnicodeDecodeError) as problem:
            parser.error(f"--markdown: {given.markdown}: {problem}")
    return given


EMPTY: dict[str, Any] = {
    "program": "tautline",
    "build": "none",
    "quick": False,
    "machine": {"processor": "none", "cores": 0, "load_before": 0.0, "load_after": 0.0},
    "peers": [],
    "rows": [],
}


def read(path: pathlib.Path) -> dict[str, Any]:
    """Returns the report in a file of `--json`."""
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        refuse(f"--from: {path}: cannot be read ({problem}); name a file of --json")
    if not isinstance(report, dict) or not isinstance(report.get("rows"), list):
        refuse(f"--from: {path}: not a report of this command; name a file of --json")
    if report.get("schema_version") != SCHEMA:
        refuse(f"--from: {path}: schema_version must be {SCHEMA} ({report.get('schema_version')}); measure again")
    return report


def measure(given: argparse.Namespace) -> dict[str, Any]:
    """Measures the groups and prints each row when it is known."""
    try:
        path = find(given.program)
    except Unusable as problem:
        refuse(str(problem))
    peers = Peers(given.environments, install=not given.quick)
    machine: dict[str, Any] = {"processor": processor(), "cores": os.cpu_count(), "load_before": os.getloadavg()[0]}
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        program = Program(path, pathlib.Path(folder))
        try:
            version = program.version()
            for row in all_rows(program, peers, given):
                rows.append(row)
                print(line(row), flush=True)
        except Unusable as problem:
            refuse(f"program: {problem}")
    machine["load_after"] = os.getloadavg()[0]
    return {
        "schema_version": SCHEMA,
        "program": version,
        "build": path.parent.name if path.parent.name in ("release", "debug") else "unknown",
        "quick": given.quick,
        "machine": machine,
        "peers": [peer(peers, name) for name in ENVIRONMENTS],
        "rows": rows,
    }


def all_rows(program: Program, peers: Peers, given: argparse.Namespace) -> Iterator[Row]:
    for group in given.only or GROUPS:
        if group == "speed":
            yield from speed.rows(program, peers, given.quick)
        elif group == "missions":
            yield from missions.rows(program, given.quick, given.seeds)
        else:
            yield from sampling.rows(program, given.quick, given.trajectories)


def peer(peers: Peers, name: str) -> Row:
    """Returns whether a peer was there, with its versions, or the reason why not."""
    entry: Row = {"name": name, "licence": ENVIRONMENTS[name].licence, "versions": peers.versions.get(name)}
    if entry["versions"]:
        return entry | {"status": "installed", "why": None}
    return entry | {"status": "skipped", "why": peers.reasons.get(name, "not needed by the measured groups")}


def line(row: Row) -> str:
    """Returns a row as a line of text."""
    if row["status"] != "measured":
        return f"{row['name']}: {row['status']}: {row['why']}"
    if row["group"] == "speed":
        ours, theirs = page.time(row["ours"]["time"], row["unit"]), page.time(row["peer"]["time"], row["unit"])
        return f"{row['name']}: tautline {ours}, peer {theirs}, ratio {page.ratio(row)}"
    if row["group"] == "missions":
        return f"{row['name']}: {row['succeeded']} of {row['flights']} succeeded, {row['collided']} collided"
    return f"{row['name']}: whole motion {row['true_m']:.3f} m, at samples {row['samples_m']:.3f} m"


def processor() -> str:
    """Returns the model of the processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def refuse(text: str) -> NoReturn:
    print(f"run.py: error: {text}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    sys.exit(main())
