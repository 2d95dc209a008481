"""Speed: tautline and a peer do the same work on the same core, in turns.

A round measures tautline and then the peer. The least time of the rounds counts on both sides. The ratios of single
rounds give the spread.

A peer of the complete graph flies the same law from the same start with the same step. If its last positions differ by
more than `SAME_M`, its row is "not comparable" and has no ratio. The same holds for quadrotors of either side that end
farther than `SLOT_M` from their slots.
"""

import math
import random
from collections.abc import Iterator, Sequence
from typing import Any

from peers import PLAIN, Peers, Skipped
from program import Point, Program, points, scenario, separation_m

Row = dict[str, Any]

# Largest distance between the last positions of both sides of the complete graph [m].
SAME_M = 1e-6
# Largest distance between a quadrotor and its slot at the end of a flight [m].
SLOT_M = 0.3
# Gains of the displacement law of quadrotors: critically damped with a rate of 1.5/s.
QUADROTOR_GAINS = {"k_per_s2": 2.25, "zeta_per_s": 3.0}
DT_S = 1 / 240


def rows(program: Program, peers: Peers, quick: bool) -> Iterator[Row]:
    """Yields all rows of this group, each when it is measured."""
    rounds = 1 if quick else 5
    yield complete_graph(program, peers, PLAIN, 5, 240 if quick else 24_000, rounds)
    for count, steps in ((5, 240), (100, 24)) if quick else ((5, 24_000), (100, 1200), (1000, 120)):
        for engine in ("mujoco", "pybullet"):
            yield complete_graph(program, peers, engine, count, steps, rounds)
    for count, hz, control_hz, peer in ((100, 500, 100, "crazyflow"), *gym_table()):
        yield quadrotors(program, peers, peer, count, hz, control_hz, 5.0, rounds)
    for count, instants in ((20, 50),) if quick else ((100, 5000), (1000, 1000)):
        for method in SWEEPS:
            # All pairs of 1000 vehicles take 20 s.
            slow = method == "NumPy" and count == 1000
            yield sweep(program, peers, method, count, instants, 3 if slow else rounds)
    for library in ("pandas", "polars"):
        yield csv(program, peers, library, 200 if quick else 50_000, rounds)


def gym_table() -> tuple[tuple[int, int, int, str], ...]:
    """Returns drones and rates [Hz] of the paper of gym-pybullet-drones. A scenario has at least two vehicles."""
    return tuple((count, 240, 48, "gym-pybullet-drones") for count in (2, 10, 80))


def row(name: str, work: str, unit: str) -> Row:
    return {"group": "speed", "name": name, "work": work, "unit": unit, "status": "measured", "why": None}


def finish(entry: Row, ours: list[float], theirs: list[float]) -> None:
    """Adds the least time of each side and their ratio, above 1 where tautline is faster.

    Also adds the smallest and largest ratio of a round. The ratio of the least times lies between the two.
    """
    entry["ours"]["time"] = min(ours)
    if theirs:
        ratios = [their / our for our, their in zip(ours, theirs, strict=True)]
        entry["peer"]["time"] = min(theirs)
        entry["ratio"] = min(theirs) / min(ours)
        entry |= {"rounds": len(ratios), "smallest_ratio": min(ratios), "largest_ratio": max(ratios)}


def parts(step_us: float, law_us: float) -> dict[str, float]:
    """Returns the time of the law and of the rest of a step [us]."""
    return {"law": law_us, "rest": step_us - law_us}


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
    entry["peer"] = {"name": engine}
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(rounds):
        report = program.fly(scenario("lattice", tables))
        spent = report["performance"]
        ours.append(1e6 * spent["wall_s"] / report["run"]["steps"])
        if ours[-1] == min(ours):
            entry["ours"]["parts"] = parts(ours[-1], 1e6 * spent["law_s"] / report["run"]["steps"])
        try:
            answer = peers.measure(engine, task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["step_us"])
        if theirs[-1] == min(theirs):
            entry["peer"]["parts"] = parts(theirs[-1], answer["law_us"])
        entry["peer"] |= {"version": answer["version"], "settings": f"{answer['settings']}; the same law in Numba"}
        if engine == PLAIN:
            entry["peer"]["settings"] = "the same law in lists; verifies the law; not a speed comparison"
        difference_m = farthest(answer["positions_m"], program.samples()[-1][1])
        entry["difference_m"] = difference_m if math.isfinite(difference_m) else None
        if not difference_m <= SAME_M:
            why = f"last positions differ by {difference_m:.2g} m, more than {SAME_M:g} m"
            entry |= {"status": "not comparable", "why": why}
            break
    finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry


def farthest(first: Sequence[Sequence[float]], second: Sequence[Point]) -> float:
    """Returns the largest distance between positions of the same vehicle [m]; infinite if numbers differ or are NaN."""
    if len(first) != len(second) or not all(math.isfinite(x) for point in first for x in point):
        return math.inf
    return max(math.dist(a, b) for a, b in zip(first, second, strict=True))


def quadrotors(
    program: Program, peers: Peers, peer: str, count: int, hz: int, control_hz: int, seconds: float, rounds: int
) -> Row:
    """Compares the time of a second of flight of quadrotors. Models and controllers of both sides differ.

    A lattice contracts about its centre, so that the law needs no reference.
    """
    start = lattice(count, 0.8, 1.0)
    slots = contracted(start, 0.875)
    tables: dict[str, dict[str, Any]] = {
        "swarm": {"dimensions": 3},
        "vehicle": {"model": "crazyflie", "attitude_hz": float(hz)},
        "start": {"positions_m": points(start)},
        "formation": {"shape": "points", "points_m": points(slots)},
        "law": {"kind": "displacement", "delta_m": 0.4} | QUADROTOR_GAINS,
        "arrival": {"hold_s": 0.0},
        "time": {"duration_s": seconds, "dt_s": 1 / hz, "control_hz": float(control_hz), "record_hz": 1.0},
    }
    work = f"a second of {count} Crazyflies, physics at {hz} Hz, commands at {control_hz} Hz"
    entry = row(f"quadrotors/{count}/{peer}", work, "s")
    gains = f"k {QUADROTOR_GAINS['k_per_s2']:g}/s^2, zeta {QUADROTOR_GAINS['zeta_per_s']:g}/s"
    settings = f"Rapier, rotors, attitude loop, displacement law ({gains}), audit of each step; one thread"
    entry["ours"] = {"settings": settings}
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
            entry |= {"status": "not comparable", "why": f"tautline: {report['run']['ended_early']['text']}"}
            break
        if not arrived(entry, "ours", "tautline", farthest(program.samples()[-1][1], slots)):
            break
        ours.append(report["performance"]["wall_s"] / seconds)
        try:
            answer = peers.measure(peer, task)
        except Skipped as reason:
            entry |= {"status": "skipped", "why": str(reason)}
            break
        theirs.append(answer["wall_s"] / seconds)
        entry["peer"] |= {"version": answer["version"], "settings": f"{answer['settings']}; no audit"}
        if not arrived(entry, "peer", peer, farthest(answer["positions_m"], slots)):
            break
    if ours:
        finish(entry, ours, theirs if entry["status"] == "measured" else [])
    return entry


def contracted(start: list[Point], factor: float) -> list[Point]:
    """Returns positions with their distances from the mean position multiplied by a factor."""
    mean_x, mean_y, mean_z = (sum(axis) / len(start) for axis in zip(*start, strict=True))
    return [
        (mean_x + factor * (x - mean_x), mean_y + factor * (y - mean_y), mean_z + factor * (z - mean_z))
        for x, y, z in start
    ]


def arrived(entry: Row, side: str, name: str, end_m: float) -> bool:
    """Adds the largest distance of a side from its slots. More than `SLOT_M` makes the row "not comparable"."""
    entry[side]["end_m"] = end_m if math.isfinite(end_m) else None
    if end_m <= SLOT_M:
        return True
    why = f"{name}: its vehicles end {end_m:.2g} m from their slots, more than {SLOT_M:g} m"
    entry |= {"status": "not comparable", "why": why}
    return False


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


# Peers of the sweep: name, work of `peer_tables.py`, settings.
SWEEPS = {
    "NumPy": ("all pairs", "samples only, all pairs, imports excluded; one core"),
    "SciPy cKDTree": ("tree", "samples only, nearest neighbour of each vehicle, imports excluded; one core"),
}


def sweep(program: Program, peers: Peers, method: str, count: int, instants: int, rounds: int) -> Row:
    """Compares the audit of a recording with the smallest distance at its samples in a peer of `SWEEPS`."""
    work, peer_settings = SWEEPS[method]
    name = f"sweep/{count}/{method.replace(' ', '-')}"
    entry = row(name, f"judge {count} vehicles at {instants} samples from NPZ", "s")
    settings = "tautline audit: straight lines between samples, process included; one core"
    entry["ours"] = {"settings": settings}
    entry["peer"] = {"name": method, "settings": peer_settings}
    table(program, count, instants, "table.csv")
    program.call("export", "table.csv", "--out", "table.npz", "--force", "--quiet")
    task = {"script": "peer_tables.py", "work": work, "path": str(program.folder / "table.npz"), "rounds": 1}
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
        least_m = separation_m(report)
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

