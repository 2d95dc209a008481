"""Measures a swarm of point masses under the edge-tension law in another engine. Started by `peers.py`.

The law is written here a second time, from its equations in docs/laws.md. Numba compiles it where it is installed.
Engines: `mujoco`, `pybullet`, or `plain`, which integrates in this Python and needs no package.

The command of a step uses the velocity at the middle of the kick, so that all engines are second order in the step.
"""

import importlib.metadata
import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any

try:
    import numba
    import numpy as np
except ImportError:
    numba = np = None  # type: ignore[assignment]

REST = math.asinh(1.0)


def command(p: Any, v: Any, inverse_k: Any, alpha: float, delta: float, n: int, u: Any) -> None:
    """Writes accelerations [m/s^2] to `u`. `p`, `v` and `u` are flat: x, y, z of each vehicle."""
    mean_x, mean_y, mean_z = 0.0, 0.0, 0.0
    for i in range(n):
        mean_x += v[3 * i]
        mean_y += v[3 * i + 1]
        mean_z += v[3 * i + 2]
    for i in range(n):
        u[3 * i] = mean_x / n - v[3 * i]
        u[3 * i + 1] = mean_y / n - v[3 * i + 1]
        u[3 * i + 2] = mean_z / n - v[3 * i + 2]
    for i in range(n):
        x, y, z = p[3 * i], p[3 * i + 1], p[3 * i + 2]
        pull_x, pull_y, pull_z = 0.0, 0.0, 0.0
        for j in range(i + 1, n):
            dx, dy, dz = x - p[3 * j], y - p[3 * j + 1], z - p[3 * j + 2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            stiffness = inverse_k[i * n + j]
            decay = math.exp(-2.0 * (length - delta) * stiffness)
            w = alpha * stiffness * (1.0 - 4.0 * decay / ((1.0 - decay) * (1.0 - decay))) / (length * n)
            pull_x += w * dx
            pull_y += w * dy
            pull_z += w * dz
            u[3 * j] += w * dx
            u[3 * j + 1] += w * dy
            u[3 * j + 2] += w * dz
        u[3 * i] -= pull_x
        u[3 * i + 1] -= pull_y
        u[3 * i + 2] -= pull_z


def inverse_stiffness(slots: list[list[float]], delta: float) -> list[float]:
    """Returns 1/K = asinh(1)/(d - delta) of each pair, with d the distance of its slots, as a flat N x N list."""
    n = len(slots)
    table = [0.0] * (n * n)
    for i in range(n):
        for j in range(n):
            if i != j:
                table[i * n + j] = REST / (math.dist(slots[i], slots[j]) - delta)
    return table


class Plain:
    """Point masses in this Python: a kick, then a drift."""

    version = sys.version.split()[0]
    settings = "kick and drift in lists"

    def __init__(self, task: dict[str, Any]) -> None:
        self.dt = task["dt_s"]
        self.p = [x for row in task["positions_m"] for x in row]
        self.v = [0.0] * len(self.p)

    def read(self) -> tuple[Any, Any]:
        return self.p, self.v

    def kick(self, u: Any, seconds: float) -> None:
        self.v = [v + seconds * a for v, a in zip(self.v, u, strict=True)]

    def step(self, u: Any) -> None:
        self.kick(u, self.dt)
        self.p = [p + self.dt * v for p, v in zip(self.p, self.v, strict=True)]


class MuJoCo:
    """A body with three slide joints for each vehicle, without contacts and gravity."""

    settings = "three slide joints a body, Euler integrator, no contacts, no gravity, forces in one array"

    def __init__(self, task: dict[str, Any]) -> None:
        import mujoco

        joints = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
        body = f'<body>{joints}<geom type="sphere" size="0.25" mass="1"/></body>'
        flags = '<flag contact="disable" gravity="disable" constraint="disable"/>'
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{task["dt_s"]!r}" integrator="Euler">{flags}</option>'
            f"<worldbody>{body * len(task['positions_m'])}</worldbody></mujoco>"
        )
        self.version = mujoco.__version__
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = np.array(task["positions_m"]).ravel()
        self.mj_step = mujoco.mj_step
        mujoco.mj_forward(self.model, self.data)

    def read(self) -> tuple[Any, Any]:
        return self.data.qpos, self.data.qvel

    def kick(self, u: Any, seconds: float) -> None:
        self.data.qvel[:] += seconds * u

    def step(self, u: Any) -> None:
        self.data.qfrc_applied[:] = u
        self.mj_step(self.model, self.data)


class PyBullet:
    """A sphere for each vehicle, without collisions, damping and gravity. Its interface moves one body a call."""

    settings = "a sphere a body, one solver iteration, no collisions, no damping, a call for each body and step"

    def __init__(self, task: dict[str, Any]) -> None:
        import pybullet

        self.version = importlib.metadata.version("pybullet")
        self.bullet = pybullet
        pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=task["dt_s"], numSubSteps=1, numSolverIterations=1)
        pybullet.setGravity(0, 0, 0)
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.25)
        self.bodies = [
            pybullet.createMultiBody(1.0, shape, basePosition=position, useMaximalCoordinates=0)
            for position in task["positions_m"]
        ]
        for body in self.bodies:
            pybullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, activationState=2)
            pybullet.setCollisionFilterGroupMask(body, -1, 0, 0)
        self.p = np.array(task["positions_m"]).ravel()
        self.v = np.zeros_like(self.p)

    def read(self) -> tuple[Any, Any]:
        for i, body in enumerate(self.bodies):
            self.p[3 * i : 3 * i + 3] = self.bullet.getBasePositionAndOrientation(body)[0]
            self.v[3 * i : 3 * i + 3] = self.bullet.getBaseVelocity(body)[0]
        return self.p, self.v

    def kick(self, u: Any, seconds: float) -> None:
        _, v = self.read()
        for i, body in enumerate(self.bodies):
            self.bullet.resetBaseVelocity(body, (v + seconds * u)[3 * i : 3 * i + 3].tolist())

    def step(self, u: Any) -> None:
        for i, body in enumerate(self.bodies):
            force = u[3 * i : 3 * i + 3].tolist()
            place = self.p[3 * i : 3 * i + 3].tolist()
            self.bullet.applyExternalForce(body, -1, force, place, self.bullet.WORLD_FRAME)
        self.bullet.stepSimulation()


def fly(task: dict[str, Any]) -> dict[str, Any]:
    """Flies `steps` steps and returns the time of a step and of the law in it [us], and the last positions [m]."""
    compiled = task["engine"] != "plain"
    law: Callable[..., None] = numba.njit(cache=True, fastmath=True)(command) if compiled else command
    engines: dict[str, type[Any]] = {"plain": Plain, "mujoco": MuJoCo, "pybullet": PyBullet}
    engine = engines[task["engine"]](task)
    n, dt, alpha, delta = len(task["positions_m"]), task["dt_s"], task["alpha"], task["delta_m"]
    table: Any = inverse_stiffness(task["slots_m"], delta)
    u: Any = [0.0] * (3 * n)
    if compiled:
        table, u = np.array(table), np.array(u)
    p, v = engine.read()
    law(p, v, table, alpha, delta, n, u)  # also compiles
    engine.kick(u, -dt / 2)
    law_s = 0.0
    began = time.perf_counter()
    for _ in range(task["steps"]):
        p, v = engine.read()
        middle = v + 0.5 * dt * u if compiled else [a + 0.5 * dt * b for a, b in zip(v, u, strict=True)]
        before = time.perf_counter()
        law(p, middle, table, alpha, delta, n, u)
        law_s += time.perf_counter() - before
        engine.step(u)
    wall_s = time.perf_counter() - began
    p = [float(x) for x in engine.read()[0]]
    return {
        "step_us": 1e6 * wall_s / task["steps"],
        "law_us": 1e6 * law_s / task["steps"],
        "positions_m": [p[3 * i : 3 * i + 3] for i in range(n)],
        "version": engine.version,
        "settings": engine.settings,
    }


if __name__ == "__main__":
    print(json.dumps(fly(json.load(sys.stdin))))
