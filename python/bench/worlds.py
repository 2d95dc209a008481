"""Measures many worlds at once: ``python python/bench/worlds.py``.

Use a release build (``pip install ./python``) for absolute rates; a development build is enough for the ratios. Every
world has five vehicles under given accelerations, and every step is audited. The unit is a million steps of single
vehicles. Each rate is the best of several runs, measured in turn in one process. Another process on the same cores
lowers the rates of real time, and hardly those of processor time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np
import tautline as tl
from tautline.learning import Worlds

ROUNDS = 5
WORLDS = 1000
SETS = {"time.duration_s": 1000.0}


def rates(works: dict[str, tuple[Callable[[], object], int]]) -> dict[str, tuple[float, float]]:
    """Returns the highest rates of each call, in millions a second of processor time and of real time."""
    best = dict.fromkeys(works, (0.0, 0.0))
    for _ in range(ROUNDS):
        for name, (work, count) in works.items():
            began, used = time.perf_counter(), time.process_time()
            work()
            seconds = time.process_time() - used, time.perf_counter() - began
            best[name] = tuple(max(so_far, count / s / 1e6) for so_far, s in zip(best[name], seconds, strict=True))
    return best


def vector(scenario: tl.Scenario, threads: int, calls: int, steps: int) -> tuple[Callable[[], object], int]:
    """Returns work in many worlds: some calls of some steps each."""
    sim = tl.VectorSimulation(scenario, WORLDS, threads=threads)
    u = np.random.default_rng(0).normal(0.0, 1e-3, (WORLDS, len(scenario), 3))

    def work() -> None:
        for _ in range(calls):
            sim.step(u, steps=steps)

    return work, calls * steps * WORLDS * len(scenario)


def near(scenario: tl.Scenario, calls: int, steps: int) -> tuple[Callable[[], object], int]:
    """Returns work as of ``vector`` on one thread. In every second world, two vehicles are within delta: they move
    towards each other for two seconds, and stop 1 m apart."""
    sim = tl.VectorSimulation(scenario, WORLDS, threads=1)
    closing = np.zeros((WORLDS, len(scenario), 3))
    closing[::2, 0, 0], closing[::2, 2, 0] = 1.0, -1.0
    for u in (closing, -closing):
        sim.step(u, steps=240)
    assert ((sim.least_clearance_m < 0) == (np.arange(WORLDS) % 2 == 0)).all()
    u = np.random.default_rng(0).normal(0.0, 1e-3, (WORLDS, len(scenario), 3))

    def work() -> None:
        for _ in range(calls):
            sim.step(u, steps=steps)

    return work, calls * steps * WORLDS * len(scenario)


def filtered(name: str, shield: bool, worlds: int = 200, periods: int = 20) -> tuple[Callable[[], object], int]:
    """Returns work in worlds of a learning environment under random actions, 20 a second, and its number of commands of
    single vehicles. A shield filters each of them."""
    sim = Worlds(name, worlds, threads=1, shield=shield, set={"time.duration_s": 1000.0})
    sim.begin(np.ones(worlds, dtype=np.bool_), None, 0)
    steps = round(0.05 / sim.scenario.dt_s)
    # Actions turn round and round, so that the vehicles stay near each other.
    u = np.random.default_rng(0).uniform(-2.0, 2.0, (worlds, len(sim.scenario), 3))

    def work() -> None:
        for k in range(periods):
            sim.step(u if k % 2 else -u, steps=steps)

    return work, periods * worlds * len(sim.scenario)


def starts(scenario: tl.Scenario, kept: list[tl.VectorSimulation]) -> str:
    """Returns the processor time of a reset of a world, and the memory of a world, as text. Keeps the worlds."""
    before = resident_kb()
    sim = tl.VectorSimulation(scenario, WORLDS, threads=1)
    sim.step(np.zeros((WORLDS, len(scenario), 3)))
    memory_kb = (resident_kb() - before) / WORLDS
    kept.append(sim)
    times = []
    for _ in range(ROUNDS):
        used = time.process_time()
        sim.reset()
        times.append(time.process_time() - used)
    return f"{1e6 * min(times) / WORLDS:.0f} us for a reset, {memory_kb:.0f} kB"


def resident_kb() -> float:
    """Returns the resident memory of this process, where the system has /proc; else NaN."""
    try:
        with open("/proc/self/statm") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e3
    except OSError:
        return float("nan")


def loop(scenario: tl.Scenario, calls: int, worlds: int = 20) -> tuple[Callable[[], object], int]:
    """Returns work in a Python loop over single simulations."""
    sims = [tl.Simulation(scenario) for _ in range(worlds)]
    u = np.zeros((len(scenario), 3))

    def work() -> None:
        for _ in range(calls):
            for sim in sims:
                sim.step(u)

    return work, calls * worlds * len(scenario)


def main() -> None:
    """Prints a table of rates."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    print(f"million vehicle steps; {WORLDS} worlds of five vehicles, {cores} cores, load {os.getloadavg()[0]:.1f}")
    # Memory that other worlds have freed would count for nothing: these come first, and stay.
    kept: list[tl.VectorSimulation] = []
    for jitter_m in (0.0, 0.1):
        scenario = tl.Scenario("pentagon", set={**SETS, "start.jitter_m": jitter_m})
        print(f"a world of points with start.jitter_m = {jitter_m}: {starts(scenario, kept)}")
    for title, scenario in (
        ("points at 240 Hz", tl.Scenario("pentagon", set=SETS)),
        ("Crazyflies at 500 Hz", tl.Scenario("crazyflies", set={**SETS, "time.dt_s": 0.002})),
    ):
        found = rates(
            {
                "1 thread, 1 step a call": vector(scenario, 1, 40, 1),
                "1 thread, 10 steps a call": vector(scenario, 1, 10, 10),
                "2 threads, 1 step a call": vector(scenario, 2, 40, 1),
                "2 threads, 10 steps a call": vector(scenario, 2, 10, 10),
                "Python loop over single simulations": loop(scenario, 100),
            }
        )
        print(title)
        for name, (of_processor, of_clock) in found.items():
            print(f"  {name:36s} {of_processor:6.2f} a second of processor time, {of_clock:6.2f} a second")
        for steps in ("1 step", "10 steps"):
            ratio = found[f"2 threads, {steps} a call"][1] / found[f"1 thread, {steps} a call"][1]
            print(f"  two threads, {steps} a call: {ratio:.2f} times as fast as one")

    still = tl.Scenario("pentagon", set={**SETS, "swarm.a22_per_s": 0.0})
    found = rates({"far apart": vector(still, 1, 10, 10), "near": near(still, 10, 10)})
    print("points at 240 Hz, 1 thread, 10 steps a call")
    print(f"  all pairs far apart                   {found['far apart'][0]:6.2f} a second of processor time")
    print(f"  half of the worlds with a violation   {found['near'][0]:6.2f} a second of processor time")
    print(f"  ratio                                 {found['near'][0] / found['far apart'][0]:6.2f}")
    for name in ("pentagon", "swap"):
        found = rates({"bare": filtered(name, False), "shield": filtered(name, True)})
        bare, shielded = (1e6 * found[kind][0] for kind in ("bare", "shield"))
        print(f"{name} with 20 random actions a second, 1 thread")
        print(f"  actions of single vehicles without shield   {bare:9.0f} a second of processor time")
        print(f"  filtered by the shield                      {shielded:9.0f} a second of processor time")
        print(f"  filter alone                                {1 / (1 / shielded - 1 / bare):9.0f} a second")


if __name__ == "__main__":
    main()
