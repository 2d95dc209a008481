"""Measures quadrotors that fly to points in crazyflow. Started by `peers.py`."""

import importlib.metadata
import json
import sys
import time
from typing import Any


def fly(task: dict[str, Any]) -> dict[str, Any]:
    """Flies `seconds`, half of them on straight lines to the slots. Returns the time [s] and the last positions [m].

    One world on the processor: first-principles physics, its own position controller at `control_hz`. The functions
    are compiled before the measurement.
    """
    import jax
    import numpy as np
    from crazyflow.sim import Sim

    start = np.array(task["positions_m"], dtype=np.float32)
    count, control_hz, physics_hz = len(start), task["control_hz"], task["physics_hz"]
    sim = Sim(
        n_worlds=1,
        n_drones=count,
        dynamics="first_principles",
        control="state",
        freq=physics_hz,
        state_freq=control_hz,
        attitude_freq=physics_hz,
        body_rate_freq=physics_hz,
        force_torque_freq=physics_hz,
        device="cpu",
    )
    wanted = np.zeros((1, count, 16), dtype=np.float32)
    wanted[0, :, 12] = 1.0  # attitude (x, y, z, w)
    wanted[0, :, :3] = start

    def place() -> None:
        sim.reset()
        states = sim.data.states
        sim.data = sim.data.replace(states=states.replace(pos=jax.numpy.asarray(start[None])))

    def period() -> None:
        sim.state_control(wanted)
        sim.step(physics_hz // control_hz)
        jax.block_until_ready(sim.data)

    place()
    period()
    place()
    slots = np.array(task["slots_m"], dtype=np.float32)
    periods = round(task["seconds"] * control_hz)
    began = time.perf_counter()
    for k in range(periods):
        share = min(1.0, 2 * k / periods)
        wanted[0, :, :3] = start + share * (slots - start)
        wanted[0, :, 3:6] = (slots - start) * (2 / task["seconds"] if share < 1.0 else 0.0)
        period()
    wall_s = time.perf_counter() - began
    last = np.asarray(sim.data.states.pos)[0]
    return {
        "wall_s": wall_s,
        "positions_m": last.astype(float).tolist(),
        "version": importlib.metadata.version("crazyflow"),
        "settings": "one world on one core, first-principles dynamics, Euler, own position controller, float32, jax on "
        "the CPU",
    }


if __name__ == "__main__":
    print(json.dumps(fly(json.load(sys.stdin))))
