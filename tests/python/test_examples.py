"""Tests of notebooks and recipes."""

import os
import sys
import unittest

import nbformat
import numpy as np
import tautline as tl
from nbclient import NotebookClient
from pettingzoo.test import parallel_api_test
from shared import ROOT, Case

RECIPES = ROOT / "python" / "recipes"
sys.path.insert(0, str(RECIPES))

import gym_pybullet_drones  # noqa: E402
import pettingzoo_formation  # noqa: E402


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


class PettingZoo(unittest.TestCase):
    def test_the_environment_passes_the_test_of_pettingzoo(self) -> None:
        parallel_api_test(pettingzoo_formation.FormationEnv(duration_s=5.0), num_cycles=300)

    def test_seed_and_actions_determine_the_episode(self) -> None:
        def episode(seed: int) -> np.ndarray:
            env = pettingzoo_formation.FormationEnv(duration_s=5.0)
            env.reset(seed=seed)
            action = {agent: np.array([0.1, -0.1], dtype=np.float32) for agent in env.agents}
            return np.stack([env.step(action)[0]["vehicle_1"] for _ in range(10)])

        np.testing.assert_array_equal(episode(3), episode(3))
        self.assertTrue((episode(3) != episode(4)).any())

    def test_a_violation_terminates_all_agents(self) -> None:
        env = pettingzoo_formation.FormationEnv()
        env.reset(seed=0)
        for _ in range(100):
            middle = env.sim.positions.mean(0)
            pull = np.clip(middle - env.sim.positions, -1, 1)[:, :2]
            _, rewards, terminated, truncated, _ = env.step(dict(zip(env.possible_agents, pull, strict=True)))
            if not env.agents:
                break
        self.assertTrue(all(terminated.values()))
        self.assertFalse(any(truncated.values()))
        self.assertLess(max(rewards.values()), -99.0)
        self.assertEqual(env.sim.status, "violation")


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
