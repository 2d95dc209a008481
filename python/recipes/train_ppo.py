"""Trains policies for three tasks with PPO, audits them, and flies them again under the shield.

Usage: ``python train_ppo.py [TASK...] [--steps STEPS] [--seeds SEED...]``, for all tasks by default. It needs PyTorch
and Stable-Baselines3 (``pip install stable-baselines3``, MIT). All vehicles share one policy: each of them is an
environment of Stable-Baselines3. A trained policy flies 200 episodes whose seeds the training has not used, without and
with the shield. docs/learning.md has the results.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np
import tautline as tl
from numpy.typing import NDArray
from tautline.gymnasium import FormationVectorEnv
from tautline.learning import Observation, Reward, Worlds

Array = NDArray[np.float64]
#: Returns actions (E, N, D) of observations (E, N, M).
Policy = Callable[[NDArray[np.float32]], NDArray[np.float32]]

#: Rate of actions [Hz] and largest acceleration along an axis [m/s^2].
HZ, ACCEL_M_S2 = 20.0, 2.0
#: Number of nearest vehicles and obstacles that a vehicle observes.
NEAREST = 4
#: Vehicles of the training in all worlds, steps of single vehicles, and episodes of an evaluation.
VEHICLES, STEPS, EPISODES = 192, 2_500_000, 200
#: Seed of the evaluation.
UNSEEN = 10**9

#: Four vehicles fly between three pillars.
PILLARS = """
name = "pillars"
[swarm]
count = 4
dimensions = 2
[start]
shape = "grid"
spacing_m = 2.0
jitter_m = 0.3
seed = 1
[formation]
shape = "circle"
radius_m = 2.0
move_m = [14.0, 1.0, 0.0]
[reference]
kind = "rest"
[law]
kind = "displacement"
delta_m = 1.0
[[obstacle]]
name = "left pillar"
capsule = { from_m = [0.0, 0.0, -3.0], to_m = [0.0, 0.0, 3.0], radius_m = 0.8 }
at_m = [6.0, 3.5, 0.0]
[[obstacle]]
name = "right pillar"
capsule = { from_m = [0.0, 0.0, -3.0], to_m = [0.0, 0.0, 3.0], radius_m = 0.8 }
at_m = [6.0, -1.5, 0.0]
[[obstacle]]
name = "middle pillar"
capsule = { from_m = [0.0, 0.0, -3.0], to_m = [0.0, 0.0, 3.0], radius_m = 0.8 }
at_m = [9.0, 1.0, 0.0]
[time]
dt_s = 0.025
duration_s = 15.0
"""
SHORT = {"time.dt_s": 0.025, "time.duration_s": 15.0}
#: Twelve vehicles change places on a circle, five form a pentagon while messages are lost, four pass pillars.
TASKS: dict[str, Callable[[], tl.Scenario]] = {
    "swap": lambda: tl.Scenario("swap", set={**SHORT, "start.shuffle": True}),
    "formation": lambda: tl.Scenario(
        "pentagon",
        set={**SHORT, "start.jitter_m": 0.4, "network": {"rate_hz": 20.0, "latency_s": 0.05, "loss": 0.3}},
    ),
    "obstacles": lambda: tl.Scenario.from_toml(PILLARS),
}


class Nearest(Observation):
    """The velocity, and the vectors to the slot and to the nearest vehicles and obstacles, as the vehicle knows them.

    A vector r is observed as r / (1 m + |r|), so that near vehicles count and all numbers are within 1.
    """

    def size(self, worlds: Worlds) -> int:
        return worlds.axes * (2 + NEAREST)

    def __call__(self, worlds: Worlds) -> NDArray[np.float32]:
        seen = super().__call__(worlds)
        vectors = seen.reshape(*seen.shape[:2], -1, worlds.axes)
        own, around = vectors[:, :, :2], vectors[:, :, 2:]
        distance = np.linalg.norm(around, axis=-1)
        # A vehicle from which nothing was received is at 0, and is left out.
        order = np.argsort(np.where(distance > 0, distance, np.inf), axis=-1)[..., :NEAREST]
        near = np.take_along_axis(around, order[..., None], axis=2)
        missing = NEAREST - near.shape[2]
        near = np.pad(near, ((0, 0), (0, 0), (0, missing), (0, 0)))
        found = np.concatenate([own, near], axis=2)
        found[:, :, 1:] /= 1.0 + np.linalg.norm(found[:, :, 1:], axis=-1, keepdims=True)
        return found.reshape(*seen.shape[:2], -1)


class Arrive(Reward):
    """1 / (1 + d / 2 m) for the distance d to the slot, so that a whole flight is worth more than a part.

    A violation costs a vehicle 50 if it is within 0.5 m of a limit, else 5. ``of_vehicles`` keeps the rewards.
    """

    of_vehicles: Array

    def __call__(self, worlds: Worlds) -> Array:
        distance = np.linalg.norm(worlds.slots_m - worlds.positions, axis=-1)
        blame = np.where(clearances(worlds) < 0.5, 50.0, 5.0)
        self.of_vehicles = 1.0 / (1.0 + distance / 2.0) - blame * worlds.violated[:, None]
        return self.of_vehicles


def clearances(worlds: Worlds) -> Array:
    """Returns the present distance of each vehicle to others and obstacles less their limits (E, N) [m]."""
    p = worlds.positions
    apart = np.linalg.norm(p[:, :, None] - p[:, None], axis=-1) + 1e6 * np.eye(p.shape[1])
    clearance = apart.min(axis=-1) - worlds.scenario.delta_m
    to_obstacles = worlds.to_obstacles()
    if to_obstacles.shape[2]:
        radius = worlds.scenario.delta_m / 2
        clearance = np.minimum(clearance, np.linalg.norm(to_obstacles, axis=-1).min(axis=-1) - radius)
    return np.asarray(clearance)


def environment(task: str, worlds: int, mode: str, shield: bool = False) -> FormationVectorEnv:
    """Returns the environment of a task."""
    # A command of the largest action along both axes must not exceed the limit of the shield.
    sets = {"shield.accel_m_s2": 2**0.5 * ACCEL_M_S2} if shield else None
    return FormationVectorEnv(
        TASKS[task](), worlds, hz=HZ, max_accel_m_s2=ACCEL_M_S2, observe=Nearest(), reward=Arrive(),
        shield=shield, autoreset_mode=mode, set=sets,
    )  # fmt: skip


@dataclass
class Evaluation:
    """Episodes with unseen seeds. A violation ends the return of an episode, not its flight."""

    #: Mean return of an episode: the sum of the mean rewards of its vehicles.
    returned: float
    #: Mean distance to the slots at the end of the flights [m].
    error_m: float
    #: Share of flights with a violation.
    violated: tl.Proportion
    #: Number of them.
    violations: int
    #: Number of them in which every vehicle is clear at the end of every action.
    missed: int
    #: Mean share of commands that the shield changed.
    shielded: float

    def __str__(self) -> str:
        low, high = 100 * self.violated.low, 100 * self.violated.high
        return (
            f"return {self.returned:6.1f}, {self.error_m:5.2f} m from the slots, {self.violations} violated "
            f"({low:.1f} % to {high:.1f} %), {self.missed} of them missed at the ends of actions, "
            f"{100 * self.shielded:.1f} % of commands changed"
        )


def evaluate(
    task: str, policy: Policy, shield: bool = False, episodes: int = EPISODES, seed: int = UNSEEN
) -> Evaluation:
    """Flies episodes of a task to their ends, one in each world."""
    env = environment(task, episodes, "NextStep", shield)
    sim, shape = env.sim, env.action_space.shape
    sim.begin(np.ones(episodes, bool), None, seed)
    alive, seen, returned = np.ones(episodes, bool), np.zeros(episodes, bool), np.zeros(episodes)
    while not sim.is_over.all():
        sim.step(env.actions.commands(policy(env.observe(sim)), shape), steps=env.actions.steps)
        returned[alive] += env.reward(sim).mean(axis=1)[alive]
        seen |= clearances(sim).min(axis=1) < 0
        alive &= ~sim.ends()[0]
    info = sim.info(np.ones(episodes, bool))
    violated = sim.violated
    errors_m = np.linalg.norm(sim.slots_m - sim.positions, axis=-1)
    shielded = float(np.mean(info["shielded"])) if shield else 0.0
    share, missed = tl.proportion(int(violated.sum()), episodes), int((violated & ~seen).sum())
    return Evaluation(float(returned.mean()), float(errors_m.mean()), share, int(violated.sum()), missed, shielded)


def spring(observations: NDArray[np.float32]) -> NDArray[np.float32]:
    """Pulls each vehicle to its slot: an untrained policy. The vector to the slot is saturated."""
    axes = observations.shape[-1] // (2 + NEAREST)
    return np.clip(observations[..., axes : 2 * axes] - 0.6 * observations[..., :axes], -1, 1)


def added(observations: NDArray[np.float32], learned: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the action of the spring plus the output of a network, which can reverse it."""
    return np.clip(spring(observations) + 2.0 * learned, -1, 1)


def train(task: str, steps: int = STEPS, seed: int = 0) -> Policy:
    """Trains a policy for a number of steps of single vehicles."""
    import gymnasium
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnv

    class Vehicles(VecEnv):
        """Every vehicle of every world as an environment."""

        def __init__(self) -> None:
            worlds = VEHICLES // len(TASKS[task]())
            self.env = environment(task, worlds, "SameStep")
            self.vehicles, size = self.env.single_observation_space.shape
            axes = self.env.single_action_space.shape[1]
            space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
            super().__init__(worlds * self.vehicles, space, gymnasium.spaces.Box(-1.0, 1.0, (axes,), np.float32))

        def reset(self) -> Any:
            self.seen, _ = self.env.reset(seed=seed)
            return self.seen.reshape(self.num_envs, -1)

        def step_async(self, actions: Any) -> None:
            self.actions = added(self.seen, actions.reshape(self.env.action_space.shape))

        def step_wait(self) -> Any:
            self.seen, _, terminated, truncated, info = self.env.step(self.actions)
            infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
            done = terminated | truncated
            for world in np.flatnonzero(done):
                for vehicle in range(self.vehicles):
                    infos[world * self.vehicles + vehicle] = {
                        "terminal_observation": info["final_obs"][world][vehicle],
                        "TimeLimit.truncated": bool(truncated[world]),
                    }
            rewards = self.env.reward.of_vehicles.reshape(-1)
            return self.seen.reshape(self.num_envs, -1), rewards, np.repeat(done, self.vehicles), infos

        def close(self) -> None:
            self.env.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            return [None] * self.num_envs

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            raise NotImplementedError

        def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
            raise NotImplementedError

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * self.num_envs

    # A second thread gains nothing for a network of this size.
    torch.set_num_threads(1)
    vehicles = Vehicles()
    model = PPO(
        "MlpPolicy", vehicles, n_steps=64, batch_size=vehicles.num_envs * 16, n_epochs=6, gamma=0.995, gae_lambda=0.95,
        learning_rate=lambda left: 5e-4 * left, policy_kwargs={"log_std_init": -0.5}, seed=seed, device="cpu",
    )  # fmt: skip
    model.learn(steps)

    def policy(observations: NDArray[np.float32]) -> NDArray[np.float32]:
        flat = observations.reshape(-1, observations.shape[-1])
        learned = np.asarray(model.predict(flat, deterministic=True)[0]).reshape(*observations.shape[:2], -1)
        return added(observations, learned)

    return policy


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=", ".join(TASKS))
    parser.add_argument("--steps", type=int, default=STEPS, help="steps of single vehicles in the training")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1], help="seeds of the training")
    given = parser.parse_args(arguments)
    if unknown := [task for task in given.tasks if task not in TASKS]:
        parser.error(f"{unknown[0]}: no such task; give some of: {', '.join(TASKS)}")
    tasks = given.tasks or list(TASKS)
    for task in tasks:
        print("\n".join(evaluations(task, "spring", spring)), flush=True)
    # A process for each core: the training of so small a network uses one thread.
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        runs = [pool.submit(trained, task, given.steps, seed) for task in tasks for seed in given.seeds]
        for run in runs:
            print("\n".join(run.result()), flush=True)


def trained(task: str, steps: int, seed: int) -> list[str]:
    """Trains a policy, and returns its time and its evaluations as text."""
    began = time.monotonic()
    policy = train(task, steps, seed)
    took_s = time.monotonic() - began
    return [f"{task}, seed {seed}: trained in {took_s:.0f} s", *evaluations(task, f"seed {seed}", policy)]


def evaluations(task: str, name: str, policy: Policy) -> list[str]:
    """Returns the evaluations of a policy without and with the shield as text."""
    shields = {"": False, ", shield": True}
    return [f"{task}, {name}{word}: {evaluate(task, policy, shield)}" for word, shield in shields.items()]


if __name__ == "__main__":
    main()
