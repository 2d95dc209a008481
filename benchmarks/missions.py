"""Missions: published benchmarks under each law, without and under the shield.

A flight is safe if the audit is clear over the whole flight. It succeeds if it is safe and each vehicle is at its goal
and stays there. A flight whose collisions show at no sample of the source's grid counts as hidden. A law that is
undefined at the limit ends its flight there. If no sample before shows a collision, the flight counts as "ended
between", because later samples are unknown.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from program import Point, Program, Unusable, separation_m
from scenes import Mission, Scene, distance_to_box, missions

Row = dict[str, Any]

# Counts of flights whose collisions show at no sample.
UNSEEN = ("hidden", "ended_between")

# Laws with absolute slots. The others reach a formation up to translation, and flocking has no slots.
LAWS = ("displacement", "orca", "bvc", "cbf-qp", "cbf-qp braking")

# Laws that keep balls apart, but no ellipsoids. Without the shield they fly `Scene.as_balls`.
BALLS_ONLY = ("orca", "bvc", "cbf-qp", "cbf-qp braking")
OTHER_LAWS = {
    "edge-tension": "controls distances: its formation may be rotated and moved",
    "laplacian": "controls displacements and follows no reference: its formation may be moved",
    "potential": "controls displacements and follows no reference: its formation may be moved",
    "flocking": "forms a lattice: slots are not assigned",
}


def rows(program: Program, quick: bool, seeds: int) -> Iterator[Row]:
    """Yields a row for each mission, law and use of the shield, and a skipped row for each law without goals."""
    for mission in missions(quick, seeds):
        for law in LAWS:
            for shield in (False, True):
                yield fly(program, mission, law, shield)
    for law, why in OTHER_LAWS.items():
        entry = {"group": "missions", "name": f"every mission/{law}", "mission": "every mission", "law": law}
        yield entry | {"status": "skipped", "why": why}


def fly(program: Program, mission: Mission, law: str, shield: bool) -> Row:
    """Flies all seeds of a mission and returns its counts."""
    use = "shield" if shield else "bare"
    entry: Row = {
        "group": "missions",
        "name": f"{mission.name}/{law}/{use}",
        "mission": mission.name,
        "law": law,
        "shield": shield,
        "source": mission.source,
        "success": mission.success,
        "changes": mission.changes,
        "published": mission.published,
        "why_other_rate": mission.why,
        "compared": mission.compared,
        "as_balls": False,
        "status": "measured",
        "why": None,
    }
    counts = dict.fromkeys(("flights", "safe", "undecided", "reached", "succeeded", "collided", *UNSEEN), 0)
    times: list[float] = []
    wall_s = 0.0
    least_m = math.inf
    for seed in range(mission.seeds):
        scene = mission.scene(seed)
        if scene.half_axes_m and law in BALLS_ONLY and not shield:
            scene = scene.as_balls()
            entry["as_balls"] = True
        try:
            report = program.fly(scene.text(law, shield))
        except Unusable as refusal:
            return entry | {"status": "skipped", "why": str(refusal)}
        status = report["status"]
        reached = bool(report["formation"]["reached"])
        if scene.goals_m:
            _, last = program.samples()[-1]
            reached = all(math.dist(a, b) <= scene.reached_m for a, b in zip(last, scene.goals_m, strict=True))
        counts["flights"] += 1
        counts["safe"] += status == "clear"
        counts["undecided"] += status == "undecided"
        counts["reached"] += reached
        counts["succeeded"] += status == "clear" and reached
        at_s = report["formation"]["reached_at_s"]
        if status == "clear" and reached and at_s is not None:
            times.append(at_s)
        if status == "violation":
            counts["collided"] += 1
            unseen = how_unseen(scene, program.samples(), report["run"]["ended_early"] is not None)
            if unseen:
                counts[unseen] += 1
        least_m = min(least_m, separation_m(report))
        wall_s += report["performance"]["wall_s"]
    times.sort()
    entry |= counts
    entry["delta_m"] = scene.delta_m
    entry["duration_s"] = scene.duration_s
    entry["sampled_hz"] = scene.sampled_hz
    entry["least_m"] = least_m
    entry["median_s"] = times[len(times) // 2] if times else None
    entry["wall_s"] = wall_s / counts["flights"]
    return entry


def how_unseen(scene: Scene, samples: Sequence[tuple[float, Sequence[Point]]], ended_early: bool) -> str | None:
    """Returns the count of a flight that collided and shows it at no sample of the source's grid, else `None`.

    A recording also has the instant at which a flight ends. This instant counts only if it is on the grid.
    """
    if any(seen(scene, sample) for t, sample in samples if on_grid(t, scene.sampled_hz)):
        return None
    return "ended_between" if ended_early else "hidden"


def on_grid(t: float, rate_hz: float) -> bool:
    """Returns whether a time [s] is an integral number of periods, up to rounding."""
    return abs(t * rate_hz - round(t * rate_hz)) < 1e-6


def seen(scene: Scene, sample: Sequence[Point]) -> bool:
    """Returns whether two vehicles are closer than delta at a sample, or one is within a clearance of an obstacle.

    Lengths are scaled for an ellipsoid, as in the audit.
    """
    squash = scene.half_axes_m[0] / scene.half_axes_m[2] if scene.half_axes_m else 1.0
    scaled = sorted((x, y, z * squash) for x, y, z in sample)
    for i, first in enumerate(scaled):
        for second in scaled[i + 1 :]:
            if second[0] - first[0] >= scene.delta_m:
                break
            if math.dist(first, second) < scene.delta_m:
                return True
    for point in sample:
        if any(distance_to_box(point, at, size) < scene.delta_m / 2 for _, at, size in scene.boxes):
            return True
        for _, (x, y, z), radius_m in scene.columns:
            nearest_z = min(max(point[2], z - 2.0), z + 3.0)
            if math.dist(point, (x, y, nearest_z)) < radius_m + scene.delta_m / 2:
                return True
    return False
