"""Tests of saved and pickled worlds and environments: another process continues with the same bits."""

import concurrent.futures
import copy
import multiprocessing
import pickle
import unittest
import unittest.mock

import numpy as np
import tautline as tl
from shared import Case
from tautline.gymnasium import FormationEnv, FormationVectorEnv
from tautline.learning import Reward
from tautline.pettingzoo import FormationEnv as ParallelFormationEnv

NOISY = {"sensing.position_noise_m": 0.01, "sensing.rate_hz": 50.0, "network.rate_hz": 20.0, "network.loss": 0.1}
SHORT = {"time.duration_s": 3.0}


def bits(sim: tl.VectorSimulation) -> list[bytes]:
    """Returns everything that worlds show."""
    arrays = sim.positions, sim.velocities, sim.least_clearance_m, sim.is_over, sim.seeds, sim.t, sim.steps
    return [*(array.tobytes() for array in arrays), repr((sim.endings, sim.statuses())).encode()]


def commands(sim: tl.VectorSimulation, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(sim.num_envs, len(sim.scenario), 3)) * [1, 1, 0]


def continued(sim: tl.VectorSimulation) -> list[bytes]:
    """Flies worlds on, in another process."""
    for seed in range(3):
        sim.step(commands(sim, seed), steps=30)
    return bits(sim)


def episode(env: FormationVectorEnv) -> list[object]:
    """Flies an environment on, in another process."""
    found = []
    for seed in range(40):
        action = np.random.default_rng(seed).uniform(-1, 1, env.action_space.shape)
        found += [np.asarray(part).tolist() for part in env.step(action)[:4]]
    return found


def in_another_process(work, *arguments):
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *arguments).result(timeout=120)


class Effort(Reward):
    """A reward of a user."""

    def __call__(self, worlds):
        return super().__call__(worlds) - 0.1 * np.linalg.norm(worlds.velocities, axis=-1)


class Worlds(Case):
    def flown(self, name: str, sets: dict[str, object], **more: object) -> tl.VectorSimulation:
        """Returns worlds with steps from outside and of the law, resets of some, and a start of their own."""
        sim = tl.VectorSimulation(name, 3, keep_history=True, set={**SHORT, **sets}, **more)
        sim.step(commands(sim, 1), steps=7)
        sim.step(commands(sim, 2).astype(np.float32))
        sim.step(commands(sim, 3)[..., :2], steps=5)
        sim.step(steps=11)
        sim.reset([False, True, True], [None, 71, None])
        sim.step(commands(sim, 4), steps=3)
        if sim.scenario.name == "pentagon":
            sim.reset([True, False, False], positions=sim.scenario.positions_m + [0.5, 0, 0])
        sim.step(steps=20)
        return sim

    def test_loaded_worlds_continue_bit_for_bit(self) -> None:
        for name, sets, more in (
            ("pentagon", {"start.jitter_m": 0.1}, {}),
            ("pentagon", NOISY, {"threads": 1}),
            ("swap", {"start.shuffle": True}, {"seeds": [5, 6, 9]}),
            ("shielded-crazyflies", {}, {}),
            ("obstacles", {"start.jitter_m": 0.02, "time.duration_s": 1.1}, {"autoreset": True}),
        ):
            with self.subTest(scenario=name, sets=sets):
                sim = self.flown(name, sets, **more)
                saved = sim.save()
                again = tl.VectorSimulation.load(saved)
                self.assertEqual(bits(again), bits(sim))
                self.assertEqual((again.save(), again.autoreset), (saved, sim.autoreset))
                copied = copy.copy(sim)
                expected = in_another_process(continued, sim)
                self.assertEqual(continued(again), expected)
                self.assertEqual(continued(sim), expected)
                self.assertEqual(bits(tl.VectorSimulation.load(sim.save())), expected)
                self.assertEqual(bits(tl.VectorSimulation.load(copied.save())), bits(copied))
                self.assertNotEqual(bits(copied), expected)

    def test_worlds_without_a_history_are_saved_at_their_starts_only(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, set={"start.jitter_m": 0.1})
        self.assertEqual(bits(tl.VectorSimulation.load(sim.save())), bits(sim))
        sim.step(steps=2)
        self.refuses(tl.Error, "give keep_history=True, or save after a reset of all worlds", sim.save)
        self.refuses(tl.Error, "give keep_history=True", lambda: pickle.dumps(sim))
        sim.reset([True, False])
        self.refuses(tl.Error, "give keep_history=True", sim.save)
        sim.reset(seeds=[8, 3])
        again = pickle.loads(pickle.dumps(sim))
        self.assertEqual(bits(again), bits(sim))
        self.assertEqual(continued(again), continued(sim))

    def test_a_wrong_call_leaves_the_history_and_a_lost_one_is_named(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, keep_history=True)
        sim.step(commands(sim, 1))
        self.refuses(tl.Error, "u[0, 0, 0]", lambda: sim.step(np.full((2, 5, 3), np.nan)))
        self.assertEqual(bits(tl.VectorSimulation.load(sim.save())), bits(sim))
        with unittest.mock.patch("tautline._worlds_history.MAX_BYTES", 1000):
            for _ in range(9):
                sim.step(commands(sim, 1))
            self.refuses(tl.Error, "exceed 256 MiB", sim.save)
        sim.step(commands(sim, 1))
        self.refuses(tl.Error, "exceed 256 MiB", sim.save)
        sim.reset()
        sim.step(commands(sim, 1))
        self.assertEqual(bits(tl.VectorSimulation.load(sim.save())), bits(sim))

    def test_arrays_of_the_simulation_itself_are_kept_as_they_were(self) -> None:
        sets = {"time.duration_s": 1.1, "start.jitter_m": 0.1}
        sim = tl.VectorSimulation("pentagon", 3, keep_history=True, set=sets)
        sim.step(commands(sim, 1), steps=5)
        for _ in range(4):
            sim.step(sim.velocities, steps=3)
        # Resets would hide wrong accelerations.
        self.assertEqual(bits(tl.VectorSimulation.load(sim.save())), bits(sim))
        sim.reset([True, False, True])
        sim.step(commands(sim, 2), steps=264 - 17)
        self.assertEqual(sim.is_over.tolist(), [False, True, False])
        sim.reset(sim.is_over)
        sim.step(commands(sim, 3), steps=10)
        again = tl.VectorSimulation.load(sim.save())
        self.assertEqual(bits(again), bits(sim))
        self.assertEqual(continued(again), continued(sim))
        env = FormationVectorEnv("pentagon", 2, autoreset_mode="Disabled", set=sets)
        env.reset(seed=1)
        first = env.sim.seeds.tolist()
        for _ in range(22):
            *_, truncated, _ = env.step(np.zeros(env.action_space.shape))
        self.assertTrue(truncated.all())
        env.reset(options={"reset_mask": env.sim.is_over})
        self.assertFalse(set(first) & set(env.sim.seeds.tolist()))
        env.step(np.zeros(env.action_space.shape))

    def test_damaged_bytes_are_refused(self) -> None:
        saved = self.flown("pentagon", {}).save()
        for cut in range(0, len(saved), 997):
            part = saved[:cut]
            self.refuses(tl.Error, "data: not the bytes of save()", lambda part=part: tl.VectorSimulation.load(part))
        for place in range(0, len(saved), 997):
            changed = bytearray(saved)
            changed[place] ^= 4
            self.refuses(tl.Error, "not the bytes of save()", lambda changed=changed: tl.VectorSimulation.load(changed))
        self.refuses(TypeError, "bytes are needed", lambda: tl.VectorSimulation.load("worlds"))


class Environments(Case):
    def test_a_pickled_environment_continues_bit_for_bit(self) -> None:
        sets = {"start.jitter_m": 0.1, **SHORT}
        for mode in ("NextStep", "SameStep"):
            env = FormationVectorEnv(
                "pentagon", 3, reward=Effort(), keep_history=True, shield=True, autoreset_mode=mode,
                set=sets, render_mode="rgb_array",
            )  # fmt: skip
            env.reset(seed=4)
            episode(env)
            env.render()
            again = pickle.loads(pickle.dumps(env))
            expected = in_another_process(episode, env)
            self.assertEqual(episode(again), expected)
            self.assertEqual(episode(env), expected)
            np.testing.assert_array_equal(again.render()[0], env.render()[0])

    def test_single_environments_are_pickled_too(self) -> None:
        env = FormationEnv("pentagon", keep_history=True, set={"start.jitter_m": 0.1})
        env.reset(seed=1)
        action = np.full(env.action_space.shape, 0.3)
        env.step(action)
        again = pickle.loads(pickle.dumps(env))
        np.testing.assert_array_equal(again.step(action)[0], env.step(action)[0])
        np.testing.assert_array_equal(again.reset()[0], env.reset()[0])
        agents = ParallelFormationEnv("pentagon", keep_history=True)
        agents.reset(seed=1)
        actions = {agent: np.full(2, 0.3) for agent in agents.agents}
        agents.step(actions)
        copied = pickle.loads(pickle.dumps(agents))
        self.assertEqual(repr(copied.step(actions)), repr(agents.step(actions)))
        self.refuses(tl.Error, "an environment", lambda: tl.VectorSimulation.load(env.sim.save()))


if __name__ == "__main__":
    unittest.main()
