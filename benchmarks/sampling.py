"""What sampling hides: the separation at samples beside the separation of the whole motion."""

import hashlib
import math
import pathlib
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

from program import Point, Program, Unusable, separation_m

Row = dict[str, Any]

RATES_HZ = (1.0, 2.0, 5.0, 10.0)

# Flights of built-in scenarios, with the keys that change them.
FLIGHTS = (
    ("swap, displacement", "swap", ()),
    ("swap, laplacian", "swap", ("law.kind=laplacian",)),
    ("swap, orca", "swap", ("law.kind=orca",)),
    ("pentagon-laplacian", "pentagon-laplacian", ()),
)

# Tools whose own check of collisions sees positions at samples only: tool, check, rate, source with its commit.
TOOLS = (
    (
        "LSC planner",
        "smallest distance over radii of each pair, from one recorded instant to the next",
        "10 Hz",
        "qwerty35/lsc_planner f4d4caf, src/multi_sync_simulator.cpp, launch/testall_empty.launch",
    ),
    (
        "GCBF+",
        "distance of each pair below two radii, at the states of a rollout",
        "33 Hz (steps of 0.03 s)",
        "MIT-REALM/gcbfplus 5e7d5cd, gcbfplus/env/double_integrator.py (collision_mask), test.py",
    ),
    (
        "crazyswarm",
        "ellipsoids overlap at the positions after each sleep of a test",
        "20 Hz in tests (--dt 0.05)",
        "USC-ACTLab/crazyswarm beb0549, scripts/pycrazyswarm/util.py, scripts/test_collisionAvoidance.py",
    ),
    (
        "crazyflow",
        "contacts of MuJoCo at the current state",
        "as often as the caller asks",
        "learnsyslab/crazyflow 29a3211, crazyflow/sim/sim.py (contacts)",
    ),
    (
        "EGO-Planner, swarm",
        "distance of two B-splines at steps of a plan",
        "33 Hz (steps of 0.03 s)",
        "ZJU-FAST-Lab/ego-planner-swarm 92fe9f7, src/planner/plan_manage/src/planner_manager.cpp (checkCollision)",
    ),
    (
        "VMAS, navigation",
        "distance of each pair at the states after a step",
        "10 Hz by default",
        "proroklab/VectorizedMultiAgentSimulator 7fd3a77, vmas/scenarios/navigation.py, vmas/simulator/core.py",
    ),
    (
        "Skybrush Studio for Blender",
        "nearest neighbours in the current frame",
        "the frame rate of the scene",
        "skybrush-io/studio-blender 97992b3, src/modules/sbstudio/plugin/tasks/safety_check.py",
    ),
)


# Folders of published trajectories: source with its commit, by the digest of their files.
FOLDERS = {
    "5bbcd263e65f7eb3": "USC-ACTLab/crazyswarm beb0549, ros_ws/src/crazyswarm/scripts/swap6v_pps",
    "afb84ae60b2f0ffc": "USC-ACTLab/crazyswarm beb0549, ros_ws/src/crazyswarm/scripts/crossing2_pps",
    "fe2679a5db384332": "USC-ACTLab/crazyswarm beb0549, ros_ws/src/crazyswarm/scripts/crossing4_pps",
}


def rows(program: Program, quick: bool, folders: Sequence[pathlib.Path]) -> Iterator[Row]:
    """Yields a row for each flight and rate, and for each folder of Crazyflie polynomials."""
    for name, scenario, sets in FLIGHTS[: 2 if quick else None]:
        yield from flight(program, name, scenario, sets)
    if not folders:
        why = "no folder given (--trajectories), for example swap6v_pps of a checkout of USC-ACTLab/crazyswarm"
        yield {"group": "sampling", "name": "published trajectories", "status": "skipped", "why": why}
    for folder in folders:
        yield from curves(program, folder)


def flight(program: Program, name: str, scenario: str, sets: Sequence[str]) -> Iterator[Row]:
    """Flies a scenario, recorded at each rate. The flight is the same; the audit covers each step of it."""
    for rate in RATES_HZ:
        entry = row(name, rate)
        try:
            report = program.fly(scenario, *sets, f"time.record_hz={rate}")
            delta_m = report["question"]["delta"]
            samples = [sample for _, sample in program.samples()]
            straight, _ = program.audit("flight/run.csv", "--delta", repr(delta_m))
        except Unusable as refusal:
            yield entry | {"status": "skipped", "why": str(refusal)}
            continue
        entry |= {"delta_m": delta_m, "true_m": separation_m(report), "samples_m": least(samples)}
        yield judged(entry | {"straight_m": separation_m(straight)})


def source(folder: pathlib.Path) -> str:
    """Returns repository, commit and path of a folder of trajectories, found by the contents of its CSV files."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.csv")):
        digest.update(file.read_bytes())
    return FOLDERS.get(digest.hexdigest()[:16], "unknown source")


def curves(program: Program, folder: pathlib.Path) -> Iterator[Row]:
    """Judges a folder of Crazyflie polynomials on its curves and at samples of them."""
    delta_m = 0.25  # two radii of 0.125 m
    for rate in RATES_HZ:
        entry = row(folder.name, rate) | {"source": source(folder)}
        try:
            report, _ = program.audit(str(folder.resolve()), "--delta", repr(delta_m))
            words = ["export", str(folder.resolve()), "--out", "curves.csv", "--force", "--quiet"]
            done, _ = program.call(*words, "--sample-hz", repr(rate))
            if done.returncode != 0:
                raise Unusable(done.stderr.strip().splitlines()[0] if done.stderr.strip() else "export failed")
            straight, _ = program.audit("curves.csv", "--delta", repr(delta_m))
            samples = by_time(program.folder / "curves.csv")
        except Unusable as refusal:
            yield entry | {"status": "skipped", "why": str(refusal)}
            continue
        entry |= {"delta_m": delta_m, "true_m": separation_m(report), "samples_m": least(samples)}
        yield judged(entry | {"straight_m": separation_m(straight)})


def row(name: str, rate_hz: float) -> Row:
    entry = {"group": "sampling", "name": f"{name}/{rate_hz:g} Hz", "motion": name, "rate_hz": rate_hz}
    return entry | {"status": "measured", "why": None}


def judged(entry: Row) -> Row:
    """Adds the hidden distance and whether samples show a violation. A sample below the true minimum is an error."""
    entry["hidden_m"] = entry["samples_m"] - entry["true_m"]
    entry["violated"] = entry["true_m"] < entry["delta_m"]
    entry["seen_at_samples"] = entry["samples_m"] < entry["delta_m"]
    if entry["hidden_m"] < -1e-6:
        why = f"samples at {entry['samples_m']:.6g} m are below the whole motion at {entry['true_m']:.6g} m"
        entry |= {"status": "not comparable", "why": why}
    return entry


def least(samples: Sequence[Sequence[Point]]) -> float:
    """Returns the smallest distance of any pair at the samples [m]."""
    return min(math.dist(a, b) for sample in samples for a, b in combinations(sample, 2))


def by_time(path: pathlib.Path) -> list[list[Point]]:
    """Reads the positions of a long CSV by their time. Times without two vehicles are left out."""
    at: dict[str, list[Point]] = {}
    with path.open(encoding="utf-8") as lines:
        next(lines)
        for line in lines:
            t, _, x, y, z, *_ = line.split(",")
            at.setdefault(t, []).append((float(x), float(y), float(z)))
    return [sample for sample in at.values() if len(sample) > 1]
