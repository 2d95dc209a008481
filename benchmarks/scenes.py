"""Scenes of published benchmarks, rebuilt from their parameters as text of scenarios.

Starts and goals that a project draws at random are drawn here from its parameters with a seed of Python. They are
other instances of the same distribution.
"""

import dataclasses
import functools
import math
import random
from collections.abc import Callable

from program import Point, points, scenario


@dataclasses.dataclass(frozen=True)
class Scene:
    """A mission: starts, slots and limits. All numbers are of the source unless `changes` names a difference.

    `sampled_hz` is the rate at which the source checks. A period of it is an integral number of steps. Boxes and
    columns have a name, a position and a size; the size of a column is its radius. Columns stand on the ground.
    `radio_m` is the range of messages, which are sent at 20 Hz. With `goals_m`, vehicles
    arrive within `reached_m` of their goals; slots only steer them.
    """

    name: str
    start_m: list[Point]
    slots_m: list[Point]
    delta_m: float
    max_speed_m_s: float
    preferred_speed_m_s: float
    max_accel_m_s2: float
    reached_m: float
    duration_s: float
    sampled_hz: float
    dimensions: int = 3
    dt_s: float = 1 / 240
    half_axes_m: tuple[float, float, float] | None = None
    boxes: tuple[tuple[str, Point, Point], ...] = ()
    columns: tuple[tuple[str, Point, float], ...] = ()
    radio_m: float | None = None
    relay_hops: int = 1
    goals_m: list[Point] | None = None

    def as_balls(self) -> "Scene":
        """Returns the scene with heights in units in which the ellipsoids are balls.

        A law for balls flies it. Speeds, accelerations and the radius of arrival are divided too, so that the true
        ones stay within the limits in every direction. Columns keep their heights, which the flights stay between.
        """
        if not self.half_axes_m:
            return self
        squash = self.half_axes_m[0] / self.half_axes_m[2]
        return dataclasses.replace(
            self,
            start_m=[(x, y, z * squash) for x, y, z in self.start_m],
            slots_m=[(x, y, z * squash) for x, y, z in self.slots_m],
            half_axes_m=None,
            max_speed_m_s=self.max_speed_m_s * squash,
            preferred_speed_m_s=self.preferred_speed_m_s * squash,
            max_accel_m_s2=self.max_accel_m_s2 * squash,
            reached_m=self.reached_m * squash,
        )

    def text(self, law: str, shield: bool) -> str:
        """Returns the scenario under a law, with or without the shield. Slots are absolute positions.

        The displacement law has no limit on speed. Its gains are such that a vehicle alone, at rest at the largest
        distance from its slot, is critically damped and stays below the largest speed. The other laws have the limits
        of the scene. `orca` and `cbf-qp` have their default gains. Those of `bvc` and `cbf-qp braking` arrived soonest
        of five choices each, over seeds 100 to 102 of GCBF+ with 32 agents and of the forest of LSC.
        """
        farthest_m = max(math.dist(a, b) for a, b in zip(self.start_m, self.slots_m, strict=True))
        rate_per_s = 2 * self.max_speed_m_s / farthest_m
        laws: dict[str, dict[str, object]] = {
            "displacement": {"k_per_s2": rate_per_s**2, "zeta_per_s": 2 * rate_per_s},
            "orca": {
                "max_speed_m_s": self.max_speed_m_s,
                "speed_m_s": self.preferred_speed_m_s,
                "max_accel_m_s2": self.max_accel_m_s2,
            },
            "bvc": {
                "speed_m_s": self.preferred_speed_m_s,
                "max_accel_m_s2": self.max_accel_m_s2,
                "k_per_s": 2.0,
                "tracking_per_s": 10.0,
            },
            "cbf-qp": {"max_speed_m_s": self.max_speed_m_s, "max_accel_m_s2": self.max_accel_m_s2},
        }
        laws["cbf-qp braking"] = {"variant": "braking", "k_per_s2": 4.0, "c_per_s": 4.0} | laws["cbf-qp"]
        hull_m = 0.2 * self.delta_m
        tables: dict[str, dict[str, object]] = {
            "swarm": {"dimensions": self.dimensions, "hull_radius_m": hull_m},
            "start": {"positions_m": points(self.start_m)},
            "formation": {"shape": "points", "points_m": points(self.slots_m)},
            "law": {"kind": law.split()[0], "delta_m": self.delta_m} | laws[law],
            "reference": {"kind": "rest"},
            "arrival": {"edge_error_m": self.reached_m, "disagreement_m_s": 10.0, "hold_s": 0.0},
            "actuation": {"max_accel_m_s2": self.max_accel_m_s2},
            "time": {"duration_s": self.duration_s, "dt_s": self.dt_s, "record_hz": self.sampled_hz},
        }
        if self.half_axes_m:
            tables["safety"] = {"shape": "ellipsoid", "half_axes_m": str(list(self.half_axes_m))}
        if self.radio_m:
            tables["network"] = {"range_m": self.radio_m, "rate_hz": 20.0, "relay_hops": self.relay_hops}
        if shield:
            tables["shield"] = {"max_speed_m_s": self.max_speed_m_s}
        rest = ""
        for name, at, size in self.boxes:
            rest += f'\n[[obstacle]]\nname = "{name}"\nat_m = {list(at)}\nclearance_m = {self.delta_m / 2}\n'
            rest += f"box = {{ size_m = {list(size)} }}\n"
        for name, at, radius_m in self.columns:
            rest += f'\n[[obstacle]]\nname = "{name}"\nat_m = {list(at)}\nclearance_m = {self.delta_m / 2}\n'
            rest += f"capsule = {{ from_m = [0.0, 0.0, -2.0], to_m = [0.0, 0.0, 3.0], radius_m = {radius_m} }}\n"
        return scenario(self.name, tables, rest)


@dataclasses.dataclass(frozen=True)
class Mission:
    """A published benchmark: its source, its success, what differs here, and the scene of each seed.

    `published` is a rate of the source and `why` the reason for another rate here. `compared` is the count of flights
    that corresponds to the published rate.
    """

    name: str
    source: str
    success: str
    changes: str
    scene: Callable[[int], Scene]
    seeds: int
    quick: bool = False
    published: str | None = None
    why: str | None = None
    compared: str = "succeeded"


def apart(rng: random.Random, count: int, low: Point, high: Point, least: float, downwash: float = 1.0) -> list[Point]:
    """Draws points uniformly in a box with a smallest distance. Vertical distances count divided by `downwash`.

    A draw with no room left starts again.
    """
    scale = (1.0, 1.0, downwash)
    while True:
        drawn: list[Point] = []
        for _ in range(2000 * count):
            point = tuple(rng.uniform(a, b) for a, b in zip(low, high, strict=True))
            scaled = [x / s for x, s in zip(point, scale, strict=True)]
            if all(math.dist(scaled, [x / s for x, s in zip(other, scale, strict=True)]) > least for other in drawn):
                drawn.append((point[0], point[1], point[2]))
                if len(drawn) == count:
                    return drawn


def lsc(count: int) -> Callable[[int], Scene]:
    """Random missions of LSC: a box of 3 m x 3 m x 2 m, starts and goals at least 0.5 m apart in scaled lengths."""

    def scene(seed: int) -> Scene:
        rng = random.Random(1000 * count + seed)
        low, high = (-1.5, -1.5, 0.2), (1.5, 1.5, 2.2)
        return Scene(
            name=f"lsc-{count}",
            start_m=apart(rng, count, low, high, 0.5, 2.0),
            slots_m=apart(rng, count, low, high, 0.5, 2.0),
            delta_m=0.3,
            half_axes_m=(0.15, 0.15, 0.3),
            max_speed_m_s=1.0,
            preferred_speed_m_s=1.0,
            max_accel_m_s2=2.0,
            reached_m=0.1,
            duration_s=60.0,
            sampled_hz=10.0,
        )

    return scene


def forest(seed: int) -> Scene:
    """The random forest of LSC: 20 agents change places across a circle of 4 m, through ten columns.

    The columns of the source's 30 maps have radii of 0.1 to 0.3 m. Their centres are in a square of 5 m, at least
    1.2 m apart. Their tops are between 0.9 m and 3 m; here all are at 3 m. Each coordinate of a start and a goal is
    moved by up to 5 cm, as in the source.
    """
    rng = random.Random(31_000 + seed)
    ends = []
    for turn in (0.0, math.pi):
        angles = [2 * math.pi * i / 20 + turn for i in range(20)]
        exact = [(4 * math.cos(a), 4 * math.sin(a), 1.0) for a in angles]
        ends.append([(x + moved(rng, 0.05), y + moved(rng, 0.05), z + moved(rng, 0.05)) for x, y, z in exact])
    centres = apart(rng, 10, (-2.5, -2.5, 0.0), (2.5, 2.5, 0.0), 1.2)
    return dataclasses.replace(
        lsc(20)(seed),
        name="lsc-forest",
        start_m=ends[0],
        slots_m=ends[1],
        columns=tuple((f"column {k + 1}", at, rng.uniform(0.1, 0.3)) for k, at in enumerate(centres)),
    )


def moved(rng: random.Random, most_m: float) -> float:
    return rng.uniform(-most_m, most_m)


# Ranges of the radio in the trials of R3R on a circle [m].
R3R_RANGES_M = (1.0, 1.5, 2.0, 2.5, 3.0)


def r3r_circle(count: int, limited: bool = True, relay_hops: int = 1) -> Callable[[int], Scene]:
    """The trial of R3R's baseline: agents change places across a circle of 2.5 m. The seed selects the range.

    Without `limited` the range has no limit. Messages take at most `relay_hops` hops.
    """

    def scene(seed: int) -> Scene:
        rng = random.Random(9000 * count + seed)
        angles = [2 * math.pi * i / count for i in range(count)]
        return Scene(
            name=f"r3r-circle-{count}",
            start_m=[(2.5 * math.cos(a) + moved(rng, 0.01), 2.5 * math.sin(a), 0.0) for a in angles],
            slots_m=[(-2.5 * math.cos(a), -2.5 * math.sin(a), 0.0) for a in angles],
            delta_m=0.5,
            max_speed_m_s=1.0,
            preferred_speed_m_s=1.0,
            max_accel_m_s2=4.0,
            reached_m=0.5,
            duration_s=60.0,
            sampled_hz=20.0,
            dimensions=2,
            radio_m=R3R_RANGES_M[seed] if limited else None,
            relay_hops=relay_hops,
        )

    return scene


# Boxes of the map simple_indoor_1 in its image: left, right, top and bottom [pixels].
INDOOR_PIXELS = (
    (1116, 1217, 204, 304),
    (275, 963, 346, 796),
    (1116, 1817, 471, 796),
    (1041, 1300, 929, 1221),
    (1525, 1792, 962, 1192),
    (462, 717, 1012, 1484),
    (1216, 1838, 1404, 1809),
    (250, 963, 1650, 1829),
    (0, 2084, 0, 109),
    (0, 2084, 1975, 2084),
    (0, 109, 109, 1975),
    (1975, 2084, 109, 1975),
)


def r3r_indoor(count: int) -> Callable[[int], Scene]:
    """The indoor map of R3R: a square of 104.2 m with eight blocks and four walls, starts and goals 3 m from them.

    The image of the map has 2084 pixels a side of 0.05 m each. The radius of planning in the source's pictures, 10.5 m
    at a range of 32 m, has this scale too.
    """
    boxes = []
    for k, (left, right, top, bottom) in enumerate(INDOOR_PIXELS):
        at = (0.05 * (left + right) / 2, 0.05 * (2084 - (top + bottom) / 2), 0.0)
        boxes.append((f"block {k + 1}", at, (0.05 * (right - left), 0.05 * (bottom - top), 10.0)))

    def draw(rng: random.Random) -> list[Point]:
        drawn: list[Point] = []
        while len(drawn) < count:
            point = (rng.uniform(1.0, 103.2), rng.uniform(1.0, 103.2), 0.0)
            free = all(distance_to_box(point, at, size) >= 3 for _, at, size in boxes)
            if free and all(math.dist(point, other) >= 1 for other in drawn):
                drawn.append(point)
        return drawn

    def scene(seed: int) -> Scene:
        rng = random.Random(11_000 * count + seed)
        return Scene(
            name=f"r3r-indoor-{count}",
            start_m=draw(rng),
            slots_m=draw(rng),
            delta_m=0.5,
            max_speed_m_s=1.0,
            preferred_speed_m_s=1.0,
            max_accel_m_s2=2.0,
            reached_m=0.51,
            duration_s=370.0,
            sampled_hz=5.0,
            dimensions=2,
            dt_s=0.05,
            boxes=tuple(boxes),
            radio_m=32.0,
        )

    return scene


def distance_to_box(point: Point, at: Point, size: Point) -> float:
    """Returns the distance of a point from an upright box [m], 0 inside."""
    return math.hypot(*(max(0.0, abs(x - c) - s / 2) for x, c, s in zip(point, at, size, strict=True)))


def gcbf(count: int) -> Callable[[int], Scene]:
    """The double integrator of GCBF+: a square of 4 m, radius 0.05 m, at most 0.5 m/s and 10 m/s^2."""

    def scene(seed: int) -> Scene:
        rng = random.Random(7000 * count + seed)
        low, high = (0.0, 0.0, 0.0), (4.0, 4.0, 0.0)
        return Scene(
            name=f"gcbf-{count}",
            start_m=apart(rng, count, low, high, 0.2),
            slots_m=apart(rng, count, low, high, 0.2),
            delta_m=0.1,
            max_speed_m_s=0.5,
            preferred_speed_m_s=0.5,
            max_accel_m_s2=10.0,
            reached_m=0.1,
            duration_s=60.0,
            sampled_hz=1 / 0.03,
            dimensions=2,
            dt_s=0.005,
        )

    return scene


def circle(seed: int) -> Scene:
    """RVO2's Circle: 250 agents change places across a circle of 200 m. `seed` moves each start by up to 1 cm."""
    rng = random.Random(seed)
    angles = [2 * math.pi * i / 250 for i in range(250)]
    return Scene(
        name="rvo2-circle",
        start_m=[(200 * math.cos(a) + rng.uniform(-0.01, 0.01), 200 * math.sin(a), 0.0) for a in angles],
        slots_m=[(-200 * math.cos(a), -200 * math.sin(a), 0.0) for a in angles],
        delta_m=3.0,
        max_speed_m_s=2.0,
        preferred_speed_m_s=1.0,
        max_accel_m_s2=5.0,
        reached_m=1.5,
        duration_s=1000.0,
        sampled_hz=4.0,
        dimensions=2,
        dt_s=0.05,
    )


def blocks(seed: int) -> Scene:
    """RVO2's Blocks: four groups of 25 agents change corners between four blocks of 30 m."""
    rng = random.Random(seed)
    start: list[Point] = []
    slots: list[Point] = []
    goals: list[Point] = []
    for sx, sy in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        for i in range(5):
            for j in range(5):
                wiggle = rng.uniform(-0.01, 0.01)
                start.append((sx * (55.0 + 10 * i) + wiggle, sy * (55.0 + 10 * j), 0.0))
                goals.append((-sx * 75.0, -sy * 75.0, 0.0))
                slots.append((-sx * (75.0 + 5 * (2 - i)), -sy * (75.0 + 5 * (2 - j)), 0.0))
    boxes = tuple(
        (f"block {k + 1}", (25.0 * sx, 25.0 * sy, 0.0), (30.0, 30.0, 30.0))
        for k, (sx, sy) in enumerate(((-1, 1), (1, 1), (1, -1), (-1, -1)))
    )
    return Scene(
        name="rvo2-blocks",
        start_m=start,
        slots_m=slots,
        goals_m=goals,
        delta_m=4.0,
        max_speed_m_s=2.0,
        preferred_speed_m_s=1.0,
        max_accel_m_s2=5.0,
        reached_m=20.0,
        duration_s=1000.0,
        sampled_hz=4.0,
        dimensions=2,
        dt_s=0.05,
        boxes=boxes,
    )


def sphere(seed: int) -> Scene:
    """RVO2-3D's Sphere: agents on circles of latitude, 0.1 rad apart, change places through a sphere of 100 m.

    The source has 812 agents. Some start closer than two radii, 3 m, to the first agent of their circle; agents within
    3.3 m of an earlier one are left out.
    """
    rng = random.Random(seed)
    start: list[Point] = []
    for i in range(32):
        z, r = 100 * math.cos(i / 10), 100 * math.sin(i / 10)
        for j in range(math.ceil(r / 2.5)):
            a = j * 2 * math.pi / (r / 2.5)
            point = (r * math.cos(a), r * math.sin(a), z)
            if all(math.dist(point, other) > 3.3 for other in start):
                start.append(point)
    shown = [(x + rng.uniform(-0.01, 0.01), y, z) for x, y, z in start]
    return Scene(
        name="rvo2-sphere",
        start_m=shown,
        slots_m=[(-x, -y, -z) for x, y, z in start],
        delta_m=3.0,
        max_speed_m_s=2.0,
        preferred_speed_m_s=1.0,
        max_accel_m_s2=5.0,
        reached_m=3.0,
        duration_s=400.0,
        sampled_hz=8.0,
        dt_s=0.025,
    )


def swap(seed: int) -> Scene:
    """The swap of six Crazyflies of crazyswarm: opposite corners of an upright hexagon, ellipsoids of 0.125 m."""
    del seed
    corners = [(0.0, 1.0, 1.5), (0.25, 0.5, 2.37), (0.25, -0.5, 2.37)]
    start: list[Point] = [*corners, (-0.25, 0.5, 0.63), (-0.25, -0.5, 0.63), (0.0, -1.0, 1.5)]
    return Scene(
        name="crazyswarm-swap6v",
        start_m=start,
        slots_m=[(-x, -y, 3.0 - z) for x, y, z in start],
        delta_m=0.25,
        half_axes_m=(0.125, 0.125, 0.375),
        max_speed_m_s=2.0,
        preferred_speed_m_s=1.0,
        max_accel_m_s2=5.0,
        reached_m=0.1,
        duration_s=40.0,
        sampled_hz=20.0,
    )


def missions(quick: bool, seeds: int) -> list[Mission]:
    """Returns the missions with the number of seeds of each. `quick` is one of the two smallest."""
    lsc_source = "qwerty35/lsc_planner f4d4caf, missions/empty, launch/testall_empty.launch; rate: arXiv:2109.09041"
    forest_source = "qwerty35/lsc_planner f4d4caf, missions/forest, world/forest; rate: arXiv:2109.09041"
    gcbf_source = "MIT-REALM/gcbfplus 5e7d5cd, gcbfplus/env/double_integrator.py, README.md (test command)"
    r3r = "MarshallVielmetti/r3r_decentralized_gatekeeper 08e5dbd"
    r3r_circle_source = f"{r3r}, examples/nmpc_performance_graphs.jl, examples/ipopt_baseline_utils.jl"
    r3r_indoor_source = (
        f"{r3r}, examples/r3r_evolution_simple_indoor.jl; dev10110/OccupancyGrids.jl 092452e, maps/simple_indoor_1; "
        "rate: abstract of arXiv:2510.06436v1"
    )
    lsc_changes = (
        "acceleration: norm at most 2 m/s^2 (files: 2, 2, 1 by axis); speed: norm; 60 s; no bounds of the space"
    )
    forest_changes = lsc_changes + "; all columns 3 m high"
    gcbf_changes = "norms in place of limits by axis; no obstacles; 60 s in place of 7.68 s"
    rvo_changes = "commands up to 5 m/s^2 in place of velocities taken at once; starts moved by up to 1 cm"
    dubins = "points that may stop in place of Dubins vehicles, with commands up to speed^2 / turning radius. "
    stay = "Vehicles stay at their goals. 60 s in place of 10 s; starts moved by up to 1 cm. "
    r3r_circle_changes = (
        dubins + stay + "One flight for each range of the radio: 1, 1.5, 2, 2.5 and 3 m. The radio carries the "
        "messages of the shield and of the displacement law; the other laws sense neighbours"
    )
    r3r_indoor_changes = (
        dubins + "All vehicles are there from start to end; in the source, a vehicle joins when it has a plan, and "
        "leaves at its goal. Starts at least 1 m apart, goals too; no planner of paths; 370 s"
    )
    lsc_published = "no collision; most successes of four planners (values in a figure only)"
    lsc_why = "Here the space has no bounds, and commands change at 20 Hz or more (source: plans at 5 Hz)"
    nmpc = "NMPC, the baseline of R3R: no collision at {} of 5 ranges"
    nmpc_why = (
        "NMPC has no guarantee. The figure of its rate is beside this trial and names no method. Arrivals under the "
        "shield need the range: pairs beyond it keep their last plane, and vehicles wait behind it"
    )
    r3r_published = "R3R: 100 % safety, up to 128 agents; we found no public text with its arrivals"
    r3r_why = (
        "The rate of safety comes back under the shield, but no flight arrives: laws fly straight to their slots and "
        "stop at walls, where R3R plans paths"
    )
    listed = [
        Mission(
            f"LSC, {n} agents",
            lsc_source,
            "never unsafe, each within 0.1 m",
            lsc_changes,
            lsc(n),
            seeds,
            n == 10,
            published=f"LSC: {lsc_published}",
            why=lsc_why,
        )
        for n in (10, 20, 30, 40, 50, 60)
    ]
    listed.append(
        Mission(
            "LSC forest, 20 agents",
            forest_source,
            "never unsafe, each within 0.1 m",
            forest_changes,
            forest,
            seeds,
            published="LSC: 100 %; EGO-Swarm: 50 % (30 flights each)",
            why="The rate comes back under the shield. Without it, no law here avoids columns and arrives",
        )
    )
    r3r_circle_mission = functools.partial(
        Mission, source=r3r_circle_source, success="never unsafe, each within 0.5 m", seeds=len(R3R_RANGES_M)
    )
    listed += [
        r3r_circle_mission(
            f"R3R circle, {n} agents",
            changes=r3r_circle_changes,
            scene=r3r_circle(n),
            published=nmpc.format(rate),
            why=nmpc_why,
            compared="safe",
        )
        for n, rate in ((2, 5), (4, 5), (8, 4), (16, 0))
    ]
    listed += [
        r3r_circle_mission(f"R3R circle {name}, {n} agents", changes=changes, scene=scene(n))
        for name, changes, scene in (
            ("without a limit of the range", dubins + stay + "No radio", functools.partial(r3r_circle, limited=False)),
            (
                "with relays",
                r3r_circle_changes + ". Vehicles pass on messages, up to 8 hops",
                functools.partial(r3r_circle, relay_hops=8),
            ),
        )
        for n in (8, 16)
    ]
    listed += [
        Mission(
            f"R3R indoor, {n} agents",
            r3r_indoor_source,
            "never unsafe, each within 0.51 m",
            r3r_indoor_changes,
            r3r_indoor(n),
            min(seeds, 5),
            published=r3r_published,
            why=r3r_why,
            compared="safe",
        )
        for n in (32, 64, 128)
    ]
    listed += [
        Mission(f"GCBF+, {n} agents", gcbf_source, "never unsafe, each within 0.1 m", gcbf_changes, gcbf(n), seeds)
        for n in (8, 16, 32, 64)
    ]
    circle_source, blocks_source = "snape/RVO2 1c25b27, examples/Circle.cc", "snape/RVO2 1c25b27, examples/Blocks.cc"
    sphere_source = "snape/RVO2-3D c8e6044, examples/Sphere.cc"
    goals = rvo_changes + ". Slots on a lattice of 5 m about the goal of a group; 1000 s"
    crowded = rvo_changes + ". Without the agents that start within 3.3 m of another one (source: 812 agents)"
    listed += [
        Mission("RVO2 Circle, 250", circle_source, "each within 1.5 m", rvo_changes, circle, 1),
        Mission("RVO2 Blocks, 100", blocks_source, "each within 20 m of the goal of its group", goals, blocks, 1),
        Mission(f"RVO2-3D Sphere, {len(sphere(0).start_m)}", sphere_source, "each within 3 m", crowded, sphere, 1),
        Mission(
            "crazyswarm swap, 6",
            "USC-ACTLab/crazyswarm beb0549, scripts/swap6v.py, scripts/test_collisionAvoidance.py (radii)",
            "each within 0.1 m",
            "points with at most 5 m/s^2; the source flies planned polynomials of 4.25 s",
            swap,
            1,
            True,
        ),
    ]
    return [dataclasses.replace(mission, seeds=1) for mission in listed if mission.quick] if quick else listed
