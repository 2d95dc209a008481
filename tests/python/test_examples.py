"""Tests of notebooks and recipes."""

import os
import sys
import unittest
import unittest.mock

import nbformat
import numpy as np
import tautline as tl
from nbclient import NotebookClient
from shared import ROOT, Case

RECIPES = ROOT / "python" / "recipes"
sys.path.insert(0, str(RECIPES))

import gym_pybullet_drones  # noqa: E402
import pettingzoo_formation  # noqa: E402
import train_ppo  # noqa: E402
import trained_policy  # noqa: E402


@unittest.skipUnless(os.environ.get("TAUTLINE_NOTEBOOKS"), "a minute: sh tests/run.sh --long runs them")
class Notebooks(Case):
    def test_every_notebook_runs_and_has_no_stored_output(self) -> None:
        books = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))
        self.assertEqual(len(books), 3)
        for file in books:
            with self.subTest(notebook=file.name):
                book = nbformat.read(file, as_version=4)
                cells = [cell for cell in book.cells if cell.cell_type == "code"]
                self.assertTrue(all(not cell.outputs and cell.execution_count is None for cell in cells))
                NotebookClient(book, timeout=300, resources={"metadata": {"path": str(self.folder)}}).execute()
                self.assertTrue(any("text/html" in output.get("data", {}) for cell in cells for output in cell.outputs))


class Recipes(unittest.TestCase):
    def test_an_episode_of_pettingzoo_has_a_verdict(self) -> None:
        reward, verdict, clearance_m = pettingzoo_formation.episode(seed=1, duration_s=5.0)
        self.assertEqual(verdict, "violation" if clearance_m < 0 else "clear")
        self.assertLess(reward, 0.0)

    def test_a_policy_is_trained_audited_and_shielded(self) -> None:
        sets = {**trained_policy.SETS, "time.duration_s": 5.0}
        bare, shielded = trained_policy.main(generations=2, flights=6, sets=sets)
        self.assertEqual(shielded.share, 0.0)
        self.assertGreaterEqual(bare.high, shielded.high)
        # Without training, vehicles collide on the way to their slots.
        untrained, sets = trained_policy.damped_spring(), trained_policy.SETS
        self.assertEqual(trained_policy.fly(untrained, False, 6, sets)[0], 6)
        self.assertEqual(trained_policy.fly(untrained, True, 6, sets)[0], 0)

    def test_the_reference_tasks_are_flown_without_and_with_the_shield(self) -> None:
        for task, least in (("swap", 6), ("formation", 0), ("obstacles", 6)):
            with self.subTest(task=task):
                bare, shielded = (train_ppo.evaluate(task, train_ppo.spring, shield, 6) for shield in (False, True))
                self.assertGreaterEqual(bare.violations, least)
                self.assertLessEqual(bare.missed, bare.violations)
                self.assertEqual((shielded.violations, bare.shielded, shielded.shielded > 0), (0, 0.0, True))
                self.assertGreater(shielded.returned, bare.returned)
                self.assertLess(shielded.error_m, 1.0)
        self.assertEqual(train_ppo.evaluate("swap", train_ppo.spring, True, 6, 3).returned,
                         train_ppo.evaluate("swap", train_ppo.spring, True, 6, 3).returned)  # fmt: skip
        self.assertIn("0 violated", str(shielded))
        # A check that sees nothing misses every violation.
        with unittest.mock.patch.object(train_ppo, "clearances", lambda worlds: np.ones(worlds.positions.shape[:2])):
            blind = train_ppo.evaluate("swap", train_ppo.spring, False, 6)
        self.assertEqual((blind.violations, blind.missed), (6, 6))

    def test_an_observation_has_the_nearest_vehicles_first(self) -> None:
        env = train_ppo.environment("formation", 3, "NextStep")
        observations, _ = env.reset(seed=1)
        self.assertEqual(observations.shape, (3, 5, 2 * (2 + train_ppo.NEAREST)))
        vectors = observations.reshape(3, 5, -1, 2)[:, :, 2:]
        distances = np.linalg.norm(vectors, axis=-1)
        self.assertTrue((np.diff(distances, axis=-1) >= 0).all() and (distances > 0).all() and (distances < 1).all())

    def test_the_cost_of_a_candidate_that_collides_is_high(self) -> None:
        sets = {**trained_policy.SETS, "time.duration_s": 8.0}
        sim = tl.VectorSimulation(trained_policy.SCENARIO, 2 * trained_policy.STARTS, set=sets)
        still = np.zeros(trained_policy.PARAMETERS)
        pulled = still.copy()
        # A gain to the slot without damping or distance to others.
        pulled[-4] = 2.0
        costs = trained_policy.costs(sim, np.stack([still, pulled]), sim.scenario.slots_m)
        self.assertGreater(costs[1], trained_policy.VIOLATION_M)
        self.assertLess(costs[0], trained_policy.VIOLATION_M)

    def test_the_policy_as_a_law_has_the_bits_of_the_training(self) -> None:
        parameters = np.random.default_rng(0).normal(size=trained_policy.PARAMETERS)
        sets = {**trained_policy.SETS, "time.duration_s": 2.0, "start.seed": 4}
        law = trained_policy.Policy(parameters)
        flown = tl.fly(trained_policy.SCENARIO, law=law, set={**sets, "time.control_hz": trained_policy.HZ})
        sim = tl.VectorSimulation(trained_policy.SCENARIO, 1, seeds=[4], set=sets)
        for _ in range(40):
            u = trained_policy.act(parameters[None], sim.positions, sim.velocities, sim.scenario.slots_m)
            sim.step(u, steps=2)
        np.testing.assert_array_equal(sim.positions[0], flown.positions[-1])


class GymPybulletDrones(Case):
    """Tests with a log in the format of the package's documentation, because no registry has the package."""

    def log(self, late: float = 0.0) -> str:
        t = np.arange(50) / 48
        times, states = np.zeros((2, 96)), np.zeros((2, 16, 96))
        times[:, :50] = t
        times[1, 1:50] += late
        states[0, 0, :50], states[0, 3, :50] = t, 1.0
        states[1, 0, :50], states[1, 3, :50] = 1.5 - t, -1.0
        states[1, 1, :] = 0.1
        file = self.folder / "save-flight.npy"
        with file.open("wb") as out:
            np.savez(out, timestamps=times, states=states, controls=np.zeros((2, 12, 96)))
        return str(file)

    def test_columns_that_were_never_written_are_ignored(self) -> None:
        t, positions, velocities = gym_pybullet_drones.load(self.log())
        self.assertEqual((t.shape, positions.shape), ((50,), (50, 2, 3)))
        audit = tl.audit(t, positions, velocities=velocities, delta=0.12)
        self.assertEqual(audit.verdict, "VIOLATION")
        self.assertAlmostEqual(audit.separation_m, 0.1, places=6)

    def test_drones_with_different_times_are_refused(self) -> None:
        self.refuses(tl.Error, "different times", lambda: gym_pybullet_drones.load(self.log(late=0.001)))


if __name__ == "__main__":
    unittest.main()
