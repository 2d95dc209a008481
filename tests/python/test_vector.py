"""Tests of many worlds at once: the bits of single simulations, arrays without copies, resets, wrong input."""

import itertools
import os
import signal
import threading
import time
import unittest
from copy import copy as shallow_copy
from copy import deepcopy

import numpy as np
import tautline as tl
from shared import Case, interrupted

JITTER = {"start.jitter_m": 0.1, "time.duration_s": 3.0}


def commands(worlds: int, step: int, axes: int = 3) -> np.ndarray:
    """Returns accelerations (E, 5, axes) that differ between worlds and steps."""
    return np.sin(0.7 * np.arange(worlds * 5 * axes).reshape(worlds, 5, axes) + 0.9 * step)


class Bits(Case):
    def test_a_copy_of_a_world_flies_on_but_cannot_be_saved(self) -> None:
        worlds = tl.VectorSimulation("pentagon", 2)
        copy = worlds.world(1)
        copy.step(steps=3)
        with self.assertRaisesRegex(tl.Error, "save: a copy of a world of a VectorSimulation has no history"):
            copy.save()
        self.assertEqual(deepcopy(copy).copy().steps, 3)
        for do in (shallow_copy, deepcopy):
            twin = do(worlds)
            for one in worlds, twin:
                one.step(steps=5)
            np.testing.assert_array_equal(worlds.positions, twin.positions)
            twin.step(steps=5)
            self.assertFalse((worlds.positions == twin.positions).all())

    def test_worlds_have_the_bits_of_single_simulations_for_any_threads(self) -> None:
        for name, law in itertools.product(("pentagon", "crazyflies"), (False, True)):
            sets = {**JITTER, "start.jitter_m": 0.01 if name == "crazyflies" else 0.1}
            seeds = [5, 6, 70]
            singles = [tl.Simulation(name, set={**sets, "start.seed": seed}) for seed in seeds]
            for step, (k, single) in itertools.product(range(3), enumerate(singles)):
                single.step(None if law else commands(3, step)[k], steps=200)
            for threads in (1, 2, 3, None):
                sim = tl.VectorSimulation(name, 3, seeds=seeds, threads=threads, set=sets)
                for step in range(3):
                    sim.step(None if law else commands(3, step), steps=200)
                for k, single in enumerate(singles):
                    np.testing.assert_array_equal(sim.positions[k], single.positions)
                    np.testing.assert_array_equal(sim.velocities[k], single.velocities)
                    self.assertEqual(sim.least_clearance_m[k], single.least_clearance_m)
                    self.assertEqual(sim.statuses()[k], single.status)
                    self.assertEqual(sim.world(k).closest, single.closest)
                self.assertFalse((sim.positions[0] == sim.positions[1]).all())

    def test_single_precision_planes_and_any_memory_order_are_exact(self) -> None:
        exact = np.round(commands(4, 0) * 64) / 64
        planar = exact.copy()
        planar[:, :, 2] = 0.0
        ended = []
        for u in (planar, planar.astype(np.float32), np.asfortranarray(planar), planar[:, :, :2], planar[::-1][::-1]):
            sim = tl.VectorSimulation("pentagon", 4, set=JITTER)
            sim.step(u, steps=20)
            ended.append(sim.positions.copy())
        for other in ended[1:]:
            np.testing.assert_array_equal(ended[0], other)

    def test_lists_integers_and_half_precision_are_exact(self) -> None:
        exact = np.round(3 * commands(4, 0))
        ended = []
        for u in (exact, exact.tolist(), exact.astype(np.int8), exact.astype(np.float16), exact.astype(">f8")):
            sim = tl.VectorSimulation("pentagon", 4, set=JITTER)
            sim.step(u, steps=20)
            ended.append(sim.positions.copy())
        for other in ended[1:]:
            np.testing.assert_array_equal(ended[0], other)

    def test_a_world_continues_alone_with_the_same_bits(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, set=JITTER)
        sim.step(commands(2, 0), steps=5)
        alone = sim.world(1)
        sim.step(commands(2, 1), steps=5)
        self.assertEqual(alone.steps, 5)
        alone.step(commands(2, 1)[1], steps=5)
        np.testing.assert_array_equal(alone.positions, sim.positions[1])


class Memory(Case):
    def test_arrays_are_views_that_every_step_updates(self) -> None:
        sim = tl.VectorSimulation("pentagon", 3)
        positions, over = sim.positions, sim.is_over
        address = positions.ctypes.data
        before = positions.copy()
        sim.step(commands(3, 0), steps=10)
        self.assertEqual(sim.positions.ctypes.data, address)
        self.assertTrue((positions != before).any(axis=(1, 2)).all())
        self.assertIs(sim.is_over, over)
        self.assertEqual(np.from_dlpack(positions).ctypes.data, address)
        self.assertEqual(memoryview(positions).shape, (3, 5, 3))
        # Writing to the array changes no world.
        positions[:] = 0.0
        sim.step(commands(3, 0))
        self.assertGreater(np.abs(sim.positions).max(), 8.0)

    def test_out_receives_positions_and_velocities(self) -> None:
        for kind in (np.float32, np.float64):
            sim, out = tl.VectorSimulation("pentagon", 3), np.zeros((3, 5, 6), dtype=kind)
            sim.step(commands(3, 0), steps=10, out=out)
            np.testing.assert_array_equal(out, np.concatenate([sim.positions, sim.velocities], -1).astype(kind))

    def test_arrays_outlive_their_simulation(self) -> None:
        positions = tl.VectorSimulation("pentagon", 2).positions
        self.assertEqual(positions[1, 4, 0], 12.0)


class Resets(Case):
    def test_an_ended_world_stops_no_other(self) -> None:
        sim = tl.VectorSimulation("pentagon", 3, set=JITTER)
        sim.step(steps=500)
        sim.reset([False, True, False], seeds=[0, 40, 0])
        self.assertEqual(sim.seeds.tolist(), [0, 40, 2])
        u = commands(3, 0)
        sim.step(u, steps=400)
        self.assertEqual(sim.is_over.tolist(), [True, False, True])
        self.assertEqual(sim.endings, ["completed", None, "completed"])
        self.assertEqual(sim.steps.tolist(), [720, 400, 720])
        self.assertEqual(sim.t.tolist(), [3.0, 400 / 240, 3.0])
        # Commands of ended worlds are ignored, also those that are not finite.
        u[0] = np.nan
        sim.step(u)
        self.assertEqual(sim.steps.tolist(), [720, 401, 720])
        self.assertEqual(sim.statuses([True, False, False])[1:], [None, None])

    def test_a_step_returns_when_all_worlds_have_ended(self) -> None:
        sim = tl.VectorSimulation("pentagon", 3, set=JITTER)
        sim.step(steps=10**12)
        self.assertEqual(sim.steps.tolist(), [720] * 3)
        sim.step(np.zeros((3, 5, 3)), steps=10**18)

    def test_own_arrays_are_masks(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, set=JITTER)
        sim.reset([False, True])
        sim.step(steps=10)
        sim.reset(np.array([True, False]))
        sim.step(steps=710)
        self.assertEqual(sim.is_over.tolist(), [False, True])
        self.assertEqual(sim.statuses(sim.is_over)[0], None)
        sim.reset(sim.is_over)
        self.assertEqual((sim.steps.tolist(), sim.is_over.any()), ([710, 0], False))

    def test_seeds_outside_of_the_mask_are_ignored_and_none_is_the_next(self) -> None:
        sim = tl.VectorSimulation("pentagon", 3, set=JITTER)
        for outside in (-1, 2**70, "x", None, 1.5):
            sim.reset([False, True, False], seeds=[outside, 40, outside])
            self.assertEqual(sim.seeds.tolist(), [0, 40, 2])
        sim.reset(seeds=[7, None, np.uint64(9)])
        self.assertEqual(sim.seeds.tolist(), [7, 43, 9])
        sim.reset(seeds=np.array([1, 2, 3], dtype=np.int8))
        self.assertEqual(sim.seeds.tolist(), [1, 2, 3])
        sim.reset(seeds=range(3))
        self.assertEqual(sim.seeds.tolist(), [0, 1, 2])

    def test_autoreset_takes_the_next_seed_and_does_not_fly(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, seeds=[3, 8], autoreset=True, set=JITTER)
        sim.step(steps=10**6)
        self.assertEqual(sim.is_over.tolist(), [True, True])
        sim.step(steps=10**5)
        self.assertEqual(sim.seeds.tolist(), [5, 10])
        self.assertEqual(sim.steps.tolist(), [0, 0])
        expected = tl.Simulation("pentagon", set={**JITTER, "start.seed": 5})
        np.testing.assert_array_equal(sim.positions[0], expected.positions)

    def test_a_law_that_fails_ends_its_world_with_the_reason(self) -> None:
        sets = {"sensing.position_noise_m": 0.35, "sensing.rate_hz": 100, "time.duration_s": 2.0}
        sim = tl.VectorSimulation("pentagon", 12, set=sets)
        sim.step(steps=480)
        reasons = set(sim.endings)
        self.assertIn("completed", reasons)
        failed = [k for k, reason in enumerate(sim.endings) if reason.startswith("the law is undefined")]
        self.assertTrue(failed)
        self.assertNotEqual(sim.statuses()[failed[0]], "clear")

    def test_a_violation_ends_no_world(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2, set={"time.duration_s": 20.0})
        u = np.zeros((2, 5, 3))
        for _ in range(100):
            u[0] = np.clip(sim.positions[0].mean(0) - sim.positions[0], -1, 1)
            sim.step(u, steps=12)
        self.assertLess(sim.least_clearance_m[0], 0)
        self.assertGreater(sim.least_clearance_m[1], 0)
        self.assertEqual(sim.statuses(), ["violation", "clear"])
        self.assertEqual(sim.world(0).status, "violation")
        self.assertTrue(len(sim.world(0).violations))


class WrongInput(Case):
    def test_wrong_commands_are_refused_and_nothing_moves(self) -> None:
        sim = tl.VectorSimulation("pentagon", 2)
        for message, u in (
            ("not complex128", np.zeros((2, 5, 3), dtype=complex)),
            ("not bool", np.zeros((2, 5, 3), dtype=bool)),
            ("not float", 0.0),
            ("masked", np.ma.masked_array(np.zeros((2, 5, 3)))),
            ("masked", np.ma.masked_array(np.zeros((2, 5, 3), dtype=np.int8))),
        ):
            self.refuses(TypeError, message, lambda u=u: sim.step(u))
        for shape in ((5, 3), (2, 5), (2, 5, 1), (3, 5, 3), (2, 4, 3), (2, 5, 3, 1)):
            self.refuses(tl.Error, "u: accelerations of shape (2, 5, 3)", lambda s=shape: sim.step(np.zeros(s)))
        for value, kind in itertools.product((np.nan, np.inf, -np.inf, 2e30), (np.float32, np.float64)):
            u = np.zeros((2, 5, 3), dtype=kind)
            u[1, 3, 2] = value
            self.refuses(tl.Error, "u[1, 3, 2]: must be a finite number", lambda u=u: sim.step(u))
        self.refuses(tl.Error, "m/s^2, got 1e300", lambda: sim.step(np.full((2, 5, 3), 1e300)))
        self.refuses(tl.Error, "is larger than 2^53", lambda: sim.step([[[2**53 + 1, 0.5, 0.0]] * 5] * 2))
        sim.positions.setflags(write=False)
        self.refuses(tl.Error, "positions: the array is read-only; call positions.setflags", lambda: sim.step())
        sim.positions.setflags(write=True)
        for steps, kind in ((0, tl.Error), (-1, tl.Error), (1.0, TypeError), (True, TypeError), ("1", TypeError)):
            self.refuses(kind, "steps: ", lambda steps=steps: sim.step(steps=steps))
        for out, kind in (
            (np.zeros((2, 5, 3)), tl.Error),
            (np.zeros((2, 5, 6), dtype=int), TypeError),
            ([], TypeError),
            (np.broadcast_to(0.0, (2, 5, 6)), tl.Error),
        ):
            self.refuses(kind, "out: ", lambda out=out: sim.step(out=out))
        self.assertEqual(sim.steps.tolist(), [0, 0])

    def test_wrong_arguments_of_worlds_are_refused(self) -> None:
        make = tl.VectorSimulation
        for kind, message, do in (
            (tl.Error, "num_envs: must be at least 1, got 0", lambda: make("pentagon", 0)),
            (tl.Error, "num_envs: must be", lambda: make("pentagon", -3)),
            (tl.Error, "num_envs: must be at most", lambda: make("pentagon", 10**12)),
            (TypeError, "num_envs: a whole number", lambda: make("pentagon", 2.0)),
            (tl.Error, "threads: must be from 1 to 1024, got 0", lambda: make("pentagon", 2, threads=0)),
            (TypeError, "threads: a whole number", lambda: make("pentagon", 2, threads="2")),
            (tl.Error, "shape (2,) is needed, not of shape (3,)", lambda: make("pentagon", 2, seeds=[1, 2, 3])),
            (tl.Error, "seeds[1]: must be a whole number from 0", lambda: make("pentagon", 2, seeds=[1, -2])),
            (tl.Error, "seeds[0]: must be a whole number from 0", lambda: make("pentagon", 1, seeds=[2**63])),
            (TypeError, "seeds[0]: a whole number is needed", lambda: make("pentagon", 2, seeds=[1.0, 2.0])),
            (TypeError, "seeds: whole numbers are needed", lambda: make("pentagon", 2, seeds=np.ones(2))),
            (TypeError, "seeds: a list of whole numbers", lambda: make("pentagon", 2, seeds=3)),
            (TypeError, "seeds[1]: a whole number is needed", lambda: make("pentagon", 2, seeds=[3, None])),
            (TypeError, "seeds[0]: a whole number is needed", lambda: make("pentagon", 2).reset(seeds=[True, 1])),
            (tl.Error, "shape (2,) is needed, not of shape (0,)", lambda: make("pentagon", 2, seeds=[])),
            (tl.Error, "seeds[0]: must be a whole number from 0", lambda: make("pentagon", 2, seeds=[2**63, 0])),
            (TypeError, "autoreset: True or False", lambda: make("pentagon", 2, autoreset=1)),
            (TypeError, "mask: an array of bool", lambda: make("pentagon", 2).reset([1, 0])),
            (tl.Error, "mask: an array of shape (2,)", lambda: make("pentagon", 2).reset([True])),
            (tl.Error, "world: must be below 2", lambda: make("pentagon", 2).world(2)),
            (tl.Error, "unknown key", lambda: make("pentagon", 2, set={"law.nope": 1})),
        ):
            with self.subTest(message):
                self.refuses(kind, message, do)

    def test_a_seed_without_a_valid_start_is_named(self) -> None:
        seeds, sets = range(60), {"start.jitter_m": 0.9}
        for seed in seeds:
            try:
                tl.Scenario("pentagon", set={**sets, "start.seed": seed})
            except tl.Error as error:
                code = error.code
                break
        with self.assertRaises(tl.Error) as caught:
            tl.VectorSimulation("pentagon", 60, set=sets)
        self.assertIn(f"seeds[{seed}]: seed {seed} gives no valid scenario", str(caught.exception))
        self.assertEqual(caught.exception.code, code)

    def test_given_commands_pass_through_the_shield(self) -> None:
        sets = {"time.duration_s": 15.0}
        many = tl.VectorSimulation("shielded-crazyflies", 2, seeds=[0, 1], set=sets)
        one = tl.Simulation("shielded-crazyflies", set={**sets, "start.seed": 1, "noise.seed": 1})
        while not many.is_over.all():
            u = -many.positions - 0.5 * many.velocities
            one.step(u[1], steps=24)
            many.step(u, steps=24)
            np.testing.assert_array_equal(many.positions[1], one.positions)
        self.assertEqual((many.statuses(), one.status), (["clear"] * 2, "clear"))

    def test_a_changed_file_is_refused(self) -> None:
        file = self.folder / "own.toml"
        file.write_text(tl.Scenario("pentagon").to_toml())
        scenario = tl.Scenario(file)
        file.write_text(tl.Scenario("pentagon", set={"time.duration_s": 50}).to_toml())
        for use in (
            lambda: tl.VectorSimulation(scenario, 2),
            lambda: tl.Simulation(scenario),
            lambda: tl.fly(scenario),
            lambda: tl.fly(scenario, set={"time.duration_s": 1}),
            lambda: tl.check(scenario),
            lambda: tl.compare(scenario, ["laplacian"], runs=1),
            lambda: tl.attack(scenario, start=0.1, flights=1),
        ):
            self.refuses(tl.Error, "a file has changed since it was read; create a new Scenario", use)
        file.unlink()
        self.refuses(FileNotFoundError, "own.toml", lambda: tl.fly(scenario))


class Threads(Case):
    def test_other_threads_run_during_a_step_and_may_not_step(self) -> None:
        sim = tl.VectorSimulation("pentagon", 50, set={"time.duration_s": 10**4})
        refused, ticks = [], 0
        worker = threading.Thread(target=lambda: sim.step(steps=40_000))
        worker.start()
        until = time.monotonic() + 300
        while worker.is_alive():
            self.assertLess(time.monotonic(), until, "the worker has not made its steps")
            ticks += 1
            try:
                sim.reset(np.zeros(50, dtype=bool))
            except tl.Error as error:
                refused.append(str(error))
            time.sleep(0.001)
        self.assertGreater(ticks, 10)
        self.assertIn("the worlds are being stepped by another thread", refused)

    def test_ctrl_c_stops_all_worlds_at_the_same_step(self) -> None:
        sim = tl.VectorSimulation("pentagon", 50, set={"time.duration_s": 10**5})
        begin_s = time.process_time()

        def interrupt() -> None:
            # Only steps take this much processor time.
            until = time.monotonic() + 60
            while time.process_time() - begin_s < 0.3 and time.monotonic() < until:
                time.sleep(0.001)
            os.kill(os.getpid(), signal.SIGINT)

        interrupter = threading.Thread(target=interrupt)
        interrupter.start()
        with self.assertRaises(KeyboardInterrupt):
            sim.step(np.zeros((50, 5, 3)), steps=10**7)
        interrupter.join()
        self.assertGreater(sim.steps.max(), 0, "the worlds were stepped before the signal")
        self.assertEqual(len(set(sim.steps.tolist())), 1)
        sim.step(np.zeros((50, 5, 3)))

    @unittest.skipUnless(os.name == "posix", "only systems with signals")
    def test_ctrl_c_ends_the_construction_of_worlds(self) -> None:
        code = """
sets = {"swarm.count": 1000, "start": {"shape": "grid", "spacing_m": 4, "jitter_m": 0.3}, "formation":
        {"shape": "grid", "spacing_m": 4}}
scenario = tl.Scenario(SOURCE, set=sets)
begin_s = time.process_time()
tl.VectorSimulation(scenario, 20, threads=THREADS)
few_s = time.process_time() - begin_s
interruptible(lambda: tl.VectorSimulation(scenario, 600, threads=THREADS))
print(time.process_time() - begin_s - few_s < 15 * few_s)
"""
        source = self.folder / "grid.toml"
        source.write_text("[law]\nkind = 'displacement'\ndelta_m = 2\n[time]\nduration_s = 10\n")
        for threads in (1, 2):
            ran = code.replace("SOURCE", repr(str(source))).replace("THREADS", str(threads))
            self.assertEqual(interrupted(ran), ["interrupted", "True"])

    @unittest.skipUnless(os.name == "posix", "only systems with signals")
    def test_ctrl_c_ends_a_reset_before_any_world_is_reset(self) -> None:
        code = """
worlds = tl.VectorSimulation("pentagon", 10_000, set={"start.jitter_m": 0.1})
before = worlds.seeds
interruptible(worlds.reset)
print((worlds.seeds == before).all())
worlds.reset(np.arange(10_000) < 5)
print(worlds.seeds[:6].tolist())
"""
        after = [10_000, 10_001, 10_002, 10_003, 10_004, 5]
        self.assertEqual(interrupted(code), ["interrupted", "True", str(after)])

    @unittest.skipUnless(hasattr(os, "fork"), "only systems with fork")
    def test_a_fork_steps_with_threads_of_its_own(self) -> None:
        sim = tl.VectorSimulation("pentagon", 20, threads=2, set=JITTER)
        sim.step(commands(20, 0), steps=10)
        child = os.fork()
        if child == 0:
            status = 1
            try:
                sim.step(commands(20, 1), steps=10)
                status = int(sim.steps.tolist() != [20] * 20)
            finally:
                os._exit(status)
        until = time.monotonic() + 60
        while (ended := os.waitpid(child, os.WNOHANG)) == (0, 0) and time.monotonic() < until:
            time.sleep(0.01)
        if ended == (0, 0):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        self.assertEqual(ended, (child, 0))
        sim.step(commands(20, 1), steps=10)


class Proportions(Case):
    def test_a_proportion_has_the_interval_of_clopper_and_pearson(self) -> None:
        self.assertEqual(tl.proportion(0, 0).share, None)
        share, low, high = tl.proportion(0, 200)
        self.assertEqual((share, low), (0.0, 0.0))
        # Without a violation, 1 - 0.025^(1/n).
        self.assertAlmostEqual(high, 1 - 0.025 ** (1 / 200), places=9)
        found = tl.proportion(13, 200)
        self.assertAlmostEqual(found.low, 0.0350, places=3)
        self.assertAlmostEqual(found.high, 0.1086, places=3)
        self.refuses(tl.Error, "successes: must be at most of = 2, got 3", lambda: tl.proportion(3, 2))
        self.refuses(tl.Error, "of: must be a whole number from 0 on", lambda: tl.proportion(0, -1))
        self.refuses(TypeError, "successes: a whole number", lambda: tl.proportion(0.5, 2))


if __name__ == "__main__":
    unittest.main()
