"""What the package costs beside the library: ``python python/bench/ratios.py``. Build it for release first (``pip install ./python``).

Prints ratios of times that are taken in turn in one process, the best of many each: a machine that others share is slower at
times, never faster.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import tautline as tl
from tautline import _native


ROUNDS = 15


def took_s(work: Callable[[], object]) -> float:
    """How long a call takes [s]."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def best_s(*works: Callable[[], object]) -> list[float]:
    """The shortest time of each [s], taken in turn."""
    return [min(times) for times in zip(*([took_s(work) for work in works] for _ in range(ROUNDS)))]


def show(instants: int, vehicles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vehicles on a grid 2.5 m apart that waves: t (T,), p (T, N, 3)."""
    t = np.arange(instants) * 0.1
    k = np.arange(vehicles)
    p = np.empty((instants, vehicles, 3))
    p[:, :, 0], p[:, :, 1] = 2.5 * (k % 40), 2.5 * (k // 40)
    p[:, :, 2] = 10 + 3 * np.sin(0.3 * t[:, None] + 0.1 * (k % 40))
    return t, p


def audits() -> None:
    """An audit of (2000, 1000, 3) against the same call in Rust."""
    t, p = show(2000, 1000)
    ours, judged, with_items = [], [], []
    for _ in range(ROUNDS):
        ours.append(took_s(lambda: tl.audit(t, p, delta=1.5)))
        rust = _native.audit_in_rust(t, p, 1.5)
        judged.append(rust[0])
        with_items.append(rust[1])
    print(f"tl.audit (2000, 1000, 3)       {min(ours) * 1e3:8.1f} ms")
    print(f"  of the Rust call on items    {min(judged) * 1e3:8.1f} ms, ratio {min(ours) / min(judged):.2f}")
    print(f"  and the making of the items  {min(with_items) * 1e3:8.1f} ms, ratio {min(ours) / min(with_items):.2f}")


class Springs(tl.Law):
    """The cheapest law that does something."""

    def control(self, obs, out):  # type: ignore[no-untyped-def]
        out[:] = obs.slots_m - obs.positions - 2 * obs.velocities


def laws() -> None:
    """Steps a second of a law in Python at N = 100."""
    scenario = tl.Scenario("show", set={"time.duration_s": 20})
    steps = scenario.steps
    own, ours = best_s(lambda: tl.fly(scenario, keep=False), lambda: tl.fly(scenario, law=Springs(), keep=False))
    print(f"N = {len(scenario)}: a law in Python      {steps / ours:8.0f} steps/s; {scenario.law} in Rust {steps / own:.0f} steps/s")


def threads() -> None:
    """Two threads fly two flights, against one that flies both."""
    scenario = tl.Scenario("pentagon", set={"time.duration_s": 300})

    def fly() -> None:
        tl.fly(scenario, keep=False)

    def side_by_side() -> None:
        both = [threading.Thread(target=fly) for _ in range(2)]
        for one in both:
            one.start()
        for one in both:
            one.join()

    after, beside = best_s(lambda: (fly(), fly()), side_by_side)
    print(f"two threads fly                {after / beside:8.2f} times as fast as one")


if __name__ == "__main__":
    audits()
    laws()
    threads()
