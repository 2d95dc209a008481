"""Tests of the environments for Gymnasium and PettingZoo, with the API tests of these packages."""

import subprocess
import sys
import unittest
import warnings

import gymnasium
import numpy as np
import tautline as tl
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from pettingzoo.test import parallel_api_test, parallel_seed_test
from shared import ROOT, Case
from tautline.gymnasium import FormationEnv, FormationVectorEnv
from tautline.pettingzoo import FormationEnv as ParallelFormationEnv

SHORT = {"start.jitter_m": 0.1, "time.duration_s": 2.0}
LONG = {"start.jitter_m": 0.1, "time.duration_s": 20.0}


def crash(env: FormationVectorEnv, world: int) -> np.ndarray:
    """Returns actions that bring the vehicles of a world together."""
    actions = np.zeros(env.action_space.shape, dtype=np.float32)
    p = env.sim.positions[world, :, :2]
    actions[world] = np.clip(p.mean(0) - p, -1, 1)
    return actions


class Gymnasium(Case):
    def test_one_world_passes_the_check_of_gymnasium(self) -> None:
        for scenario, more in ("pentagon", {}), ("crazyflies", {}), ("swap", {"deadlock.mode": "off"}):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # The spaces of velocities and distances have no limit.
                warnings.filterwarnings("ignore", message=".*observation space (minimum|maximum) value is.*infinity")
                warnings.filterwarnings("ignore", message=".*not within the.*|.*render.*|.*the reward.*")
                env = gymnasium.make("tautline/Formation-v0", scenario=scenario, set={"time.duration_s": 2.0, **more})
                check_env(env.unwrapped, skip_render_check=True)

    def test_the_vector_environment_has_the_spaces_and_types_that_it_declares(self) -> None:
        env = gymnasium.make_vec(
            "tautline/Formation-v0", num_envs=3, vectorization_mode="vector_entry_point", set=SHORT
        )
        self.assertEqual(env.metadata["autoreset_mode"], AutoresetMode.NEXT_STEP)
        self.assertEqual(env.action_space.shape, (3, 5, 2))
        self.assertEqual(env.observation_space.shape, (3, 5, 12))
        observations, info = env.reset(seed=7)
        env.action_space.seed(0)
        for _ in range(100):
            self.assertIn(observations, env.observation_space)
            self.assertEqual(info["clearance_m"].shape, (3,))
            observations, rewards, terminated, truncated, info = env.step(env.action_space.sample())
            self.assertEqual((rewards.shape, rewards.dtype), ((3,), np.float64))
            self.assertEqual((terminated.dtype, truncated.dtype), (bool, bool))
            self.assertFalse((terminated & truncated).any())

    def test_worlds_of_the_vector_environment_have_the_seeds_of_gymnasium(self) -> None:
        env = FormationVectorEnv("pentagon", 3, set=SHORT)
        first, _ = env.reset(seed=7)
        self.assertEqual(env.sim.seeds.tolist(), [7, 8, 9])
        again, _ = env.reset(seed=[7, 8, 9])
        np.testing.assert_array_equal(first, again)
        other, _ = env.reset()
        self.assertEqual(env.sim.seeds.tolist(), [10, 11, 12])
        self.assertFalse((first == other).all())
        unseeded = [FormationVectorEnv("pentagon", 1, set=SHORT).reset()[0] for _ in range(2)]
        self.assertFalse((unseeded[0] == unseeded[1]).all())

    def test_episodes_of_the_next_step_mode_restart_one_step_later(self) -> None:
        env = FormationVectorEnv("pentagon", 2, set=LONG)
        env.reset(seed=0)
        for _ in range(200):
            observations, rewards, terminated, truncated, info = env.step(crash(env, 0))
            if terminated.any():
                break
        self.assertEqual((terminated.tolist(), truncated.tolist()), ([True, False], [False, False]))
        self.assertEqual(info["verdict"].tolist(), ["violation", None])
        self.assertEqual(info["_verdict"].tolist(), [True, False])
        self.assertLess(info["clearance_m"][0], 0)
        self.assertLess(rewards[0], -99)
        steps = env.sim.steps[1]
        actions = np.full((2, 5, 2), np.nan, dtype=np.float32)
        actions[1] = 0.0
        observations, rewards, terminated, truncated, _ = env.step(actions)
        self.assertEqual((terminated.any(), truncated.any(), rewards[0]), (False, False, 0.0))
        self.assertEqual(env.sim.steps.tolist(), [0, steps + 12])
        self.assertEqual(env.sim.seeds.tolist(), [2, 1])
        np.testing.assert_array_equal(observations[0, :, :2], np.zeros((5, 2)))

    def test_the_same_step_mode_returns_the_last_observation_in_the_info(self) -> None:
        env = FormationVectorEnv("pentagon", 2, autoreset_mode="SameStep", set=LONG)
        env.reset(seed=0)
        while True:
            observations, _, terminated, _, info = env.step(crash(env, 1))
            if terminated.any():
                break
        self.assertEqual(info["_final_obs"].tolist(), [False, True])
        self.assertIsNone(info["final_obs"][0])
        self.assertEqual(info["final_info"]["verdict"].tolist(), [None, "violation"])
        self.assertGreater(info["clearance_m"][1], 0)
        self.assertFalse((info["final_obs"][1] == observations[1]).all())
        self.assertEqual(int(env.sim.steps[1]), 0)

    def test_without_autoreset_a_mask_restarts_episodes(self) -> None:
        env = FormationVectorEnv("pentagon", 3, autoreset_mode=AutoresetMode.DISABLED, set=SHORT)
        env.reset(seed=0)
        still = np.zeros(env.action_space.shape, dtype=np.float32)
        while not (ends := env.step(still))[3].any():
            pass
        self.assertEqual(ends[3].tolist(), [True] * 3)
        self.assertEqual(ends[4]["verdict"].tolist(), ["clear"] * 3)
        self.refuses(tl.Error, "the episodes of the worlds [0, 1, 2] are over", lambda: env.step(still))
        env.reset(options={"reset_mask": np.array([True, True, False])})
        self.refuses(tl.Error, "the episodes of the worlds [2] are over", lambda: env.step(still))

    def test_wrong_actions_are_refused(self) -> None:
        env = FormationVectorEnv("pentagon", 2)
        self.refuses(tl.Error, "call reset first", lambda: env.step(np.zeros((2, 5, 2))))
        env.reset(seed=0)
        self.refuses(tl.Error, "actions: an array of shape (2, 5, 2)", lambda: env.step(np.zeros((2, 5, 3))))
        bad = np.zeros((2, 5, 2))
        bad[1, 2, 0] = np.nan
        self.refuses(tl.Error, "u[1, 2, 0]", lambda: env.step(bad))
        self.refuses(tl.Error, "hz: must be", lambda: FormationEnv(hz=0))
        self.refuses(TypeError, "max_accel_m_s2: a number", lambda: FormationEnv(max_accel_m_s2="5"))

    def test_an_action_is_held_for_a_whole_number_of_steps(self) -> None:
        for make in (FormationEnv, FormationVectorEnv, ParallelFormationEnv):
            self.refuses(tl.Error, "got 100.0; give 80 or 120", lambda make=make: make("pentagon", hz=100))
        self.refuses(tl.Error, "got 1000.0; give 240", lambda: FormationEnv("pentagon", hz=1000))
        for hz in (1e-300, 5e-324, 0.001):
            message = f"hz: an action must not be longer than the scenario, got {hz}; give 0.00833333333333 or more"
            self.refuses(tl.Error, message, lambda hz=hz: FormationEnv("pentagon", hz=hz))
        for hz in (240, 120, 80, 20, 240 / 7, 1 / 120):
            env = FormationEnv("pentagon", hz=hz)
            env.reset(seed=0)
            env.step(np.zeros((5, 2)))
            self.assertAlmostEqual(env.sim.t[0] * hz, 1.0, places=9)

    def test_seeds_without_a_valid_start_are_passed_over(self) -> None:
        sets = {"start.jitter_m": 0.6, "time.duration_s": 1.0}
        with self.assertRaisesRegex(tl.Error, r"seeds\[0\]: seed 75 gives no valid scenario: set:1:16"):
            tl.VectorSimulation("pentagon", 1, seeds=[75], set=sets)
        still = np.zeros((2, 5, 2))
        for mode in AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP:
            env = FormationVectorEnv("pentagon", 2, autoreset_mode=mode, set=sets)
            env.reset(seed=73)
            while not (ends := env.step(still))[3].any():
                pass
            self.assertEqual(ends[3].tolist(), [True, True])
            env.step(still)
            self.assertEqual(env.sim.seeds.tolist(), [77, 76])
            env.reset(seed=[None, 80])
            self.assertEqual(env.sim.seeds.tolist(), [79, 80])
            self.refuses(tl.Error, "seed 75", lambda env=env: env.reset(seed=75))
        # Of many random first seeds some have no valid start.
        FormationVectorEnv("pentagon", 300, set=sets).reset()
        for make in (FormationEnv, ParallelFormationEnv):
            env, refused = make("pentagon", set=sets), 0
            for seed in range(60):
                try:
                    env.reset(seed=seed)
                except tl.Error:
                    refused += 1
                env.reset()
            self.assertGreater(refused, 0)

    def test_scenarios_with_parts_that_an_environment_ignores_are_refused(self) -> None:
        accepted = []
        for name in tl.scenarios():
            try:
                env = FormationVectorEnv(name, 1, hz=tl.Scenario(name).dt_s ** -1)
            except tl.Error as error:
                self.assertIn(f"scenario: an environment ignores parts of {name}: ", str(error))
                for make in (FormationEnv, ParallelFormationEnv):
                    self.refuses(tl.Error, str(error), lambda make=make, name=name: make(name))
                continue
            # The slots that the environment pays for are those to which the scenario flies.
            accepted.append(name)
            np.testing.assert_array_equal(env.task._slots_m, tl.Scenario(name).slots_m[:, : env.task.axes])
        static = ["circle", "crazyflies", "hexagon", "pentagon", "pentagon-collinear", "pentagon-laplacian"]
        self.assertEqual(sorted(accepted), static)

    def test_a_refusal_names_each_part_and_a_remedy(self) -> None:
        message = (
            "scenario: an environment ignores parts of shielded-crazyflies: network (observations are the true states),"
            " shield (it replaces actions); give set={'network': {}, 'shield.enabled': False}"
        )
        self.refuses(tl.Error, message, lambda: FormationEnv("shielded-crazyflies"))
        FormationVectorEnv("shielded-crazyflies", 2, set={"network": {}, "shield.enabled": False})
        message = (
            "scenario: an environment ignores parts of leader-lossy: reference (it moves the slots), reference.leader"
            " (the other vehicles follow the leader), deadlock (it spreads the slots), network (observations are the"
            " true states); give a scenario without [reference], and give set={'deadlock.mode': 'off', 'network': {}}"
        )
        self.refuses(tl.Error, message, lambda: FormationEnv("leader-lossy"))


class PettingZoo(Case):
    def test_the_environment_passes_the_tests_of_pettingzoo(self) -> None:
        parallel_api_test(ParallelFormationEnv(set=SHORT), num_cycles=300)
        parallel_seed_test(lambda: ParallelFormationEnv(set=SHORT), num_cycles=100)

    def test_seed_and_actions_determine_the_episode(self) -> None:
        def episode(seed: int) -> np.ndarray:
            env = ParallelFormationEnv(set=SHORT)
            env.reset(seed=seed)
            action = {agent: np.array([0.1, -0.1], dtype=np.float32) for agent in env.agents}
            return np.stack([env.step(action)[0]["vehicle_1"] for _ in range(10)])

        np.testing.assert_array_equal(episode(3), episode(3))
        self.assertTrue((episode(3) != episode(4)).any())

    def test_a_violation_terminates_all_agents(self) -> None:
        env = ParallelFormationEnv(set=LONG)
        env.reset(seed=0)
        while env.agents:
            p = env.sim.positions[0]
            pull = np.clip(p.mean(0) - p, -1, 1)[:, :2]
            _, rewards, terminated, truncated, infos = env.step(dict(zip(env.possible_agents, pull, strict=True)))
        self.assertTrue(all(terminated.values()))
        self.assertFalse(any(truncated.values()))
        self.assertLess(max(rewards.values()), -99.0)
        self.assertEqual(infos["vehicle_3"]["verdict"], "violation")
        self.assertLess(infos["vehicle_3"]["clearance_m"], 0)
        self.refuses(tl.Error, "call reset first", lambda: env.step({}))

    def test_agents_observe_what_the_joint_agent_observes(self) -> None:
        env, joint = ParallelFormationEnv(set=SHORT), FormationEnv(set=SHORT)
        observations, _ = env.reset(seed=3)
        np.testing.assert_array_equal(np.stack(list(observations.values())), joint.reset(seed=3)[0])
        self.refuses(tl.Error, "that of vehicle_1 is missing", lambda: env.step({}))


class Imports(unittest.TestCase):
    def test_the_package_does_not_import_the_libraries_and_names_a_missing_one(self) -> None:
        code = (
            "import sys, tautline; assert not {'gymnasium', 'pettingzoo'} & set(sys.modules)\n"
            "sys.modules['gymnasium'] = None\n"
            "for name in ('gymnasium', 'pettingzoo'):\n"
            "    try: __import__('tautline.' + name)\n"
            "    except ModuleNotFoundError as error: print(error)\n"
        )
        line = [sys.executable, "-c", code]
        ran = subprocess.run(line, cwd=ROOT / "tests", capture_output=True, text=True, check=True)
        lines = ran.stdout.splitlines()
        self.assertIn("tautline.gymnasium: the package gymnasium is missing; pip install", lines[0])
        self.assertIn("tautline.pettingzoo: the package gymnasium is missing; pip install", lines[1])


if __name__ == "__main__":
    unittest.main()
