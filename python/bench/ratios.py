"""Measures the overhead of the package over the library: ``python python/bench/ratios.py``.

Needs a release build (``pip install ./python``). Prints ratios of times, each the best of many, measured in turn in one
process. On a shared machine times vary upwards only.
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
    """Returns the duration of a call [s]."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def best_s(*works: Callable[[], object]) -> list[float]:
    """Returns the shortest duration of each call [s], measured in turn."""
    return [min(times) for times in zip(*([took_s(work) for work in works] for _ in range(ROUNDS)))]


def show(instants: int, vehicles: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns times (T,) and positions (T, N, 3) of a grid with 2.5 m spacing that waves."""
    t = np.arange(instants) * 0.1
    k = np.arange(vehicles)
    p = np.empty((instants, vehicles, 3))
    p[:, :, 0], p[:, :, 1] = 2.5 * (k % 40), 2.5 * (k // 40)
    p[:, :, 2] = 10 + 3 * np.sin(0.3 * t[:, None] + 0.1 * (k % 40))
    return t, p


def audits() -> None:
    """Compares an audit of (2000, 1000, 3) with the same audit in Rust."""
    t, p = show(2000, 1000)
    python_s, rust_s, with_items_s = [], [], []
    for _ in range(ROUNDS):
        python_s.append(took_s(lambda: tl.audit(t, p, delta=1.5)))
        rust = _native.audit_in_rust(t, p, 1.5)
        rust_s.append(rust[0])
        with_items_s.append(rust[1])
    best = min(python_s)
    print(f"tl.audit (2000, 1000, 3)       {best * 1e3:8.1f} ms")
    print(f"  audit in Rust                {min(rust_s) * 1e3:8.1f} ms, ratio {best / min(rust_s):.2f}")
    print(f"  with conversion of arrays    {min(with_items_s) * 1e3:8.1f} ms, ratio {best / min(with_items_s):.2f}")


class Springs(tl.Law):
    """A cheap law: damped springs."""

    def control(self, obs, out):  # type: ignore[no-untyped-def]
        out[:] = obs.slots_m - obs.positions - 2 * obs.velocities


def laws() -> None:
    """Compares a law in Python with one in Rust, in steps per second at N = 100."""
    scenario = tl.Scenario("show", set={"time.duration_s": 20})
    steps = scenario.steps
    rust_s, python_s = best_s(
        lambda: tl.fly(scenario, keep=False), lambda: tl.fly(scenario, law=Springs(), keep=False)
    )
    print(f"N = {len(scenario)}: a law in Python      {steps / python_s:8.0f} steps/s")
    print(f"  {scenario.law} in Rust       {steps / rust_s:8.0f} steps/s")


def threads() -> None:
    """Compares two flights in two threads with two flights in one."""
    scenario = tl.Scenario("pentagon", set={"time.duration_s": 300})

    def fly() -> None:
        tl.fly(scenario, keep=False)

    def side_by_side() -> None:
        both = [threading.Thread(target=fly) for _ in range(2)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()

    serial_s, parallel_s = best_s(lambda: (fly(), fly()), side_by_side)
    print(f"two threads fly                {serial_s / parallel_s:8.2f} times as fast as one")


if __name__ == "__main__":
    audits()
    laws()
    threads()
