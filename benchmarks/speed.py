"""Speed: tautline and a peer do the same work on the same core, in turns.

A round measures tautline and then the peer. The least time of the rounds counts on both sides. A peer of the
complete graph flies the same law from the same start with the same step. If its last positions differ by more than
`SAME_M`, its row is "not comparable" and has no ratio.
"""

import math
import random
from collections.abc import Iterator
from typing import Any

from peers import PLAIN, Peers, Skipped
from program import Point, Program, points, scenario

Row = dict[str, Any]

# Largest distance between the last positions of both sides of the complete graph [m].
SAME_M = 1e-6
DT_S = 1 / 240


def rows(program: Program, peers: Peers, quick: bool) -> Iterator[Row]:
    """Yields all rows of this group, each when it is measured."""
    rounds = 1 if quick else 3
    yield complete_graph(program, peers, PLAIN, 5, 2400, 1)
    for count, steps in ((5, 240), (100, 24)) if quick else ((5, 24_000), (100, 1200), (1000, 120)):
        for engine in ("mujoco", "pybullet"):
            yield complete_graph(program, peers, engine, count, steps, rounds)
    for count, hz, control_hz, peer in ((100, 500, 100, "crazyflow"), *gym_table()):
        yield quadrotors(program, peers, peer, count, hz, control_hz, 0.2 if quick else 5.0, rounds)
    for count, instants in ((20, 50),) if quick else ((100, 5000), (1000, 1000)):
        yield sweep(program, peers, count, instants, rounds)
    for library in ("pandas", "polars"):
        yield csv(program, peers, library, 200 if quick else 50_000, rounds)


def gym_table() -> tuple[tuple[int, int, int, str], ...]:
    """Returns drones and rates [Hz] of the paper of gym-pybullet-drones. A scenario has at least two vehicles."""
    return tuple((count, 240, 48, "gym-pybullet-drones") for count in (2, 10, 80))


def row(name: str, work: str, unit: str) -> Row:
    return {"group": "speed", "name": name, "work": work, "unit": unit, "status": "measured", "why": None}


def finish(entry: Row, ours: list[float], theirs: list[float]) -> None:
    """Adds the least time of each side and their ratio, above 1 where tautline is faster."""
    entry["ours"]["time"] = min(ours)
    if theirs:
        entry["peer"]["time"] = min(theirs)
        entry["ratio"] = min(theirs) / min(ours)


def lattice(count: int, spacing_m: float, z_m: float = 0.0) -> list[Point]:
    side = math.ceil(math.sqrt(count))
    return [(spacing_m * (i % side), spacing_m * (i // side), z_m) for i in range(count)]


def complete_graph(
    program: Program, peers: Peers, engine: str, count: int, steps: int, rounds: int, peer_alpha: float = 1.0
) -> Row:
    """Compares whole steps of a lattice that contracts under the edge-tension law on the complete graph.

    `peer_alpha` is the scale of the peer's tension [m^2/s^2]. Another value than 1 is a wrong law, for tests.
    """
    start, slots, delta_m = lattice(count, 4.0), lattice(count, 3.0), 2.0
    tables: dict[str, dict[str, Any]] = {
        "swarm": {"dimensions": 3},
        "start": {"positions_m": points(start)},
        "formation": {"shape": "points", "points_m": points(slots)},
        "law": {"kind": "edge-tension", "alpha": 1.0, "delta_m": delta_m},
        "arrival": {"hold_s": 0.0},
        "time": {"duration_s": steps * DT_S, "dt_s": DT_S, "record_hz": 1.0},
    }
    task = {
        "script": "peer_swarm.py",
        "engine": "plain" if engine == PLAIN else engine,
        "positions_m": start,
        "slots_m": slots,
        "delta_m": delta_m,
        "alpha": peer_alpha,
        "dt_s": DT_S,
        "steps": steps,
    }
    entry = row(f"complete-graph/{count}/{engine.replace(' ', '-')}", f"a step of {count} points, complete graph", "us")
    entry["ours"] = {"settings": "Rapier, law, energy check, audit of each step; one thread"}
    entry["peer"] = {"name": engine, "settings": "the same law in Numba; no audit"}
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        report = program.fly(scenario("lattice", tables))
        spent = report["performance"]
        ours.append(1e6 * spent["wall_s"] / report["run"]["steps"])
        if ours[-1] == min(ours):
            parts = {key: 1e6 * spent[f"{key}_s"] / report["run"]["steps"] for key in ("law", "physics", "audit")}
            entry["ours"]["parts"] = parts
        try:
            answer = peers.measure(engine, task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["step_us"])
        entry["peer"] |= {"version": answer["version"], "settings": f"{answer['settings']}; the same law in Numba"}
        if engine == PLAIN:
            entry["peer"]["settings"] = "the same law in lists; a check of the law, no rival"
        difference_m = farthest(answer["positions_m"], program.samples()[-1][1])
        entry["difference_m"] = difference_m if math.isfinite(difference_m) else None
        if not difference_m <= SAME_M:
            why = f"last positions differ by {difference_m:.2g} m, more than {SAME_M:g} m"
            entry |= {"status": "not comparable", "why": why}
            break
    finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry


def farthest(first: list[list[float]], second: list[Point]) -> float:
    """Returns the largest distance between positions of the same vehicle [m]; infinite if numbers differ or are NaN."""
    if len(first) != len(second) or not all(math.isfinite(x) for point in first for x in point):
        return math.inf
    return max(math.dist(a, b) for a, b in zip(first, second, strict=True))


def quadrotors(
    program: Program, peers: Peers, peer: str, count: int, hz: int, control_hz: int, seconds: float, rounds: int
) -> Row:
    """Compares the time of a second of flight of quadrotors. Models and controllers of both sides differ."""
    start, slots = lattice(count, 0.8, 1.0), lattice(count, 0.7, 1.0)
    tables: dict[str, dict[str, Any]] = {
        "swarm": {"dimensions": 3},
        "vehicle": {"model": "crazyflie", "attitude_hz": float(hz)},
        "start": {"positions_m": points(start)},
        "formation": {"shape": "points", "points_m": points(slots)},
        "law": {"kind": "edge-tension", "alpha": 1e-4, "delta_m": 0.4},
        "arrival": {"hold_s": 0.0},
        "time": {"duration_s": seconds, "dt_s": 1 / hz, "control_hz": float(control_hz), "record_hz": 1.0},
    }
    work = f"a second of {count} Crazyflies, physics at {hz} Hz, commands at {control_hz} Hz"
    entry = row(f"quadrotors/{count}/{peer}", work, "s")
    entry["ours"] = {"settings": "Rapier, rotors, attitude loop, edge-tension law, audit of each step; one thread"}
    entry["peer"] = {"name": peer, "settings": "no audit"}
    task = {
        "script": "peer_crazyflow.py",
        "positions_m": start,
        "slots_m": slots,
        "physics_hz": hz,
        "control_hz": control_hz,
        "seconds": seconds,
    }
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        report = program.fly(scenario("quadrotors", tables))
        if report["run"]["ended_early"]:
            entry |= {"status": "not comparable", "why": f"tautline: {report['run']['ended_early']}"}
            break
        ours.append(report["performance"]["wall_s"] / seconds)
        try:
            answer = peers.measure(peer, task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["wall_s"] / seconds)
        entry["peer"] |= {"version": answer["version"], "settings": f"{answer['settings']}; no audit"}
        difference_m = farthest(answer["positions_m"], slots)
        entry["difference_m"] = difference_m if math.isfinite(difference_m) else None
        if not difference_m <= 0.3:
            why = f"its drones end {difference_m:.2g} m from their points"
            entry |= {"status": "not comparable", "why": why}
            break
    if ours:
        finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry


def table(program: Program, count: int, instants: int, name: str) -> int:
    """Writes a CSV of vehicles that oscillate about a lattice, with all digits. Returns its size [bytes]."""
    rng = random.Random(1)
    phases = [(rng.uniform(0.0, 6.0), rng.uniform(0.5, 1.5)) for _ in range(count)]
    home = lattice(count, 2.0)
    with (program.folder / name).open("w", encoding="utf-8") as file:
        file.write("t,id,x,y,z\n")
        for k in range(instants):
            t = 0.02 * k
            for i, ((x, y, z), (phase, rate)) in enumerate(zip(home, phases, strict=True)):
                swing = 0.9 * math.sin(phase + rate * t)
                file.write(f"{t!r},{i + 1},{x + swing!r},{y + 0.1 * swing!r},{z!r}\n")
        return file.tell()


def sweep(program: Program, peers: Peers, count: int, instants: int, rounds: int) -> Row:
    """Compares the audit of a recording with the smallest distance at its samples in NumPy."""
    entry = row(f"sweep/{count}", f"judge {count} vehicles at {instants} samples from NPZ", "s")
    settings = "tautline audit: straight lines between samples, process included; one core"
    entry["ours"] = {"settings": settings}
    entry["peer"] = {"name": "NumPy", "settings": "samples only, all pairs, imports excluded; one core"}
    table(program, count, instants, "table.csv")
    program.call("export", "table.csv", "--output", "table.npz", "--force", "--quiet")
    task = {"script": "peer_tables.py", "work": "sweep", "path": str(program.folder / "table.npz"), "rounds": 1}
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        report, wall_s = program.audit("table.npz", "--delta", "0.1")
        ours.append(wall_s)
        try:
            answer = peers.measure("tables", task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["wall_s"])
        entry["peer"]["version"] = answer["version"]
        least_m = report["separation"]["min_m"]
        entry |= {"ours_min_m": least_m, "peer_min_m": answer["min_m"]}
        # A vehicle moves at most 1.4 m/s: the true minimum of a pair is at most 0.03 m below that of the samples.
        if not least_m - 1e-9 <= answer["min_m"] <= least_m + 0.03:
            entry |= {"status": "not comparable", "why": f"smallest distances {least_m:.6g} m, {answer['min_m']:.6g} m"}
            break
    finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry


def csv(program: Program, peers: Peers, library: str, instants: int, rounds: int) -> Row:
    """Compares reading and judging of a long CSV with reading it into a table."""
    count = 20
    size = table(program, count, instants, "long.csv")
    entry = row(f"csv/{library}", f"read a CSV of {size / 1e6:.1f} MB, {count * instants} rows", "s")
    entry["ours"] = {"settings": "tautline audit: reads and judges, process included; one core"}
    entry["peer"] = {"name": library, "settings": "reads only, imports excluded; one core"}
    task = {"script": "peer_tables.py", "work": library, "path": str(program.folder / "long.csv"), "rounds": 1}
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        ours.append(program.audit("long.csv", "--delta", "0.1")[1])
        try:
            answer = peers.measure("tables", task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["wall_s"])
        entry["peer"] |= {"version": answer["version"], "settings": f"{answer['settings']}, reads only"}
        if answer["rows"] != count * instants:
            entry |= {"status": "not comparable", "why": f"it read {answer['rows']} rows of {count * instants}"}
            break
    finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry

