"""Trains a policy, audits it, and flies it again under the shield.

Usage: ``python trained_policy.py [GENERATIONS]``. It needs numpy and cma (``pip install cma``, BSD). CMA-ES trains a
small network in ``tautline.VectorSimulation``, for at most two minutes on two cores. Then the policy flies from 200
starts that the training has not seen, without and with the shield, and every flight is audited.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import cma
import numpy as np
import tautline as tl
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Scenario: twelve vehicles start on a circle in random order and fly to fixed slots on it.
SCENARIO = "swap"
SETS = {"start.shuffle": True, "time.dt_s": 0.025, "time.duration_s": 15.0}
#: Rate of commands [Hz] and largest acceleration [m/s^2].
HZ, ACCEL_M_S2 = 20.0, 2.0
#: Hidden units of the network. It maps three numbers of a vehicle to four gains.
HIDDEN = 6
PARAMETERS = 4 * HIDDEN + 4 * (HIDDEN + 1)
#: Cost of a violation in training, and of each metre of its depth, in metres of mean distance to the slots.
VIOLATION_M, DEPTH = 10.0, 20.0
#: Starts of each candidate in training, and generations.
STARTS, GENERATIONS = 6, 120


def act(parameters: Array, positions: Array, velocities: Array, slots_m: Array) -> Array:
    """Returns accelerations (E, N, 3) [m/s^2] of states (E, N, 3), with parameters (E, P).

    The network reads of each vehicle the distance to its slot, its speed and the distance to the nearest vehicle. Its
    outputs are gains of four vectors: to the slot, against the velocity, away from near vehicles, and across that.
    """
    first = parameters[:, : 4 * HIDDEN].reshape(-1, 1, 4, HIDDEN)
    second = parameters[:, 4 * HIDDEN :].reshape(-1, 1, HIDDEN + 1, 4)
    to_slot = slots_m - positions
    apart = positions[:, :, None] - positions[:, None]
    distance = np.linalg.norm(apart, axis=-1) + 1e6 * np.eye(positions.shape[1])
    away = (apart * np.exp(1.0 - distance)[..., None] / distance[..., None]).sum(axis=2)
    across = np.stack([-away[..., 1], away[..., 0], 0.0 * away[..., 2]], axis=-1)
    seen = [np.linalg.norm(to_slot, axis=-1), np.linalg.norm(velocities, axis=-1), distance.min(axis=-1)]
    inputs = np.stack([*seen, np.ones_like(seen[0])], axis=-1)
    hidden = np.tanh((inputs[..., None] * first).sum(axis=-2))
    hidden = np.concatenate([hidden, np.ones((*hidden.shape[:-1], 1))], axis=-1)
    gains = (hidden[..., None] * second).sum(axis=-2)
    vectors = np.stack([to_slot, -velocities, away, across], axis=-1)
    u = (vectors * gains[..., None, :]).sum(axis=-1)
    norm = np.linalg.norm(u, axis=-1, keepdims=True)
    return np.asarray(u / np.maximum(1.0, norm / ACCEL_M_S2))


def damped_spring() -> Array:
    """Returns the parameters of a damped spring to the slot, from which the training starts."""
    parameters = np.zeros(PARAMETERS)
    parameters[-4:] = [0.3, 0.8, 0.0, 0.0]
    return parameters


def costs(sim: tl.VectorSimulation, candidates: Array, slots_m: Array) -> Array:
    """Returns the mean cost of each candidate over its starts: distance to the slots [m], and violations."""
    parameters = np.repeat(candidates, STARTS, axis=0)
    total, steps = np.zeros(sim.num_envs), round(1 / (HZ * sim.scenario.dt_s))
    decisions = sim.scenario.steps // steps
    for _ in range(decisions):
        sim.step(act(parameters, sim.positions, sim.velocities, slots_m), steps=steps)
        total += np.linalg.norm(slots_m - sim.positions, axis=-1).mean(axis=1) / decisions
    clearance_m = sim.least_clearance_m
    total += VIOLATION_M * (clearance_m < 0) - DEPTH * np.minimum(clearance_m, 0.0)
    return np.asarray(total.reshape(-1, STARTS).mean(axis=1))


def train(generations: int = GENERATIONS, seed: int = 1, sets: dict[str, Any] = SETS) -> tuple[Array, int]:
    """Returns the trained parameters and the number of flights."""
    scenario = tl.Scenario(SCENARIO, set=sets)
    search = cma.CMAEvolutionStrategy(damped_spring(), 0.3, {"seed": seed, "verbose": -9})
    sim = tl.VectorSimulation(scenario, search.popsize * STARTS)
    for generation in range(generations):
        # All candidates of a generation fly from the same starts.
        sim.reset(seeds=np.tile(np.arange(STARTS) + STARTS * generation, search.popsize))
        candidates = search.ask()
        search.tell(candidates, costs(sim, np.stack(candidates), scenario.slots_m).tolist())
    return np.asarray(search.result.xfavorite), generations * sim.num_envs


class Policy(tl.Law):
    """The trained policy as a law."""

    def __init__(self, parameters: Array) -> None:
        self.parameters = parameters[None]

    def control(self, obs: tl.Observation, out: Array) -> None:
        out[:] = act(self.parameters, obs.positions[None], obs.velocities[None], obs.slots_m)[0]


def fly(parameters: Array, shield: bool, flights: int, sets: dict[str, Any] = SETS) -> tuple[int, float]:
    """Returns the number of flights with a violation, and the mean distance to the slots at the end [m]."""
    violated, errors_m = 0, []
    for run in range(flights):
        # Starts of the training have seeds far below.
        own = {**sets, "start.seed": 10**9 + run, "time.control_hz": HZ}
        if shield:
            own["shield.accel_m_s2"] = ACCEL_M_S2
        flight = tl.fly(SCENARIO, law=Policy(parameters), set=own, shield=shield)
        violated += flight.status == "violation"
        errors_m.append(np.linalg.norm(flight.scenario.slots_m - flight.positions[-1], axis=-1).mean())
    return violated, float(np.mean(errors_m))


def main(generations: int = GENERATIONS, flights: int = 200, sets: dict[str, Any] = SETS) -> list[tl.Proportion]:
    """Trains, audits and shields. Returns the shares of flights with a violation, without and with the shield."""
    began = time.monotonic()
    parameters, flown = train(generations, sets=sets)
    print(f"trained on {flown} flights in {time.monotonic() - began:.0f} s")
    shares = []
    for shield in (False, True):
        violated, error_m = fly(parameters, shield, flights, sets)
        share = tl.proportion(violated, flights)
        shares.append(share)
        print(
            f"{'shielded' if shield else 'bare':8s} {violated} of {flights} flights violated: {share.low:.1%} to"
            f" {share.high:.1%} with 95 % confidence; {error_m:.2f} m from the slots at the end"
        )
    return shares


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else GENERATIONS)
