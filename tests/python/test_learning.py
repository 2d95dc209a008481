"""Tests of the environments for Gymnasium and PettingZoo, with the API tests of these packages."""

import copy
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
from tautline.learning import Observation, Reward, Worlds, episode_seed
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
        for scenario in "pentagon", "crazyflies", "swap", "obstacles", "shielded-crazyflies":
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # The spaces of velocities and distances have no limit.
                warnings.filterwarnings("ignore", message=".*observation space (minimum|maximum) value is.*infinity")
                warnings.filterwarnings("ignore", message=".*not within the.*|.*render.*|.*the reward.*")
                sets = {"time.duration_s": 2.0, "leg": []}
                env = gymnasium.make("tautline/Formation-v0", scenario=scenario, hz=10, set=sets)
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

    def test_seeds_worlds_and_episodes_determine_the_starts_in_all_environments(self) -> None:
        env = FormationVectorEnv("pentagon", 3, set=SHORT)
        first, _ = env.reset(seed=7)
        self.assertEqual(env.sim.seeds.tolist(), [episode_seed(7, world, 0) for world in range(3)])
        again, _ = env.reset(seed=7)
        np.testing.assert_array_equal(first, again)
        later, _ = env.reset()
        self.assertEqual(env.sim.seeds.tolist(), [episode_seed(7, world, 1) for world in range(3)])
        self.assertFalse((first == later).all())
        env.reset(seed=[None, 9, 9])
        self.assertEqual(env.sim.seeds.tolist(), [episode_seed(*of) for of in ((7, 0, 2), (9, 0, 0), (9, 0, 0))])
        # Worlds outside of the mask, and all worlds after a refused reset, keep their seeds.
        env.reset(seed=5, options={"reset_mask": np.array([True, False, False])})
        self.refuses(tl.Error, "positions[0]", lambda: env.reset(seed=6, options={"positions_m": np.zeros((5, 2))}))
        twin = copy.copy(env.sim)
        twin.begin(np.ones(3, dtype=bool))
        env.reset()
        self.assertEqual(env.sim.seeds.tolist(), [episode_seed(*of) for of in ((5, 0, 1), (9, 0, 1), (9, 0, 1))])
        self.assertEqual(twin.seeds.tolist(), env.sim.seeds.tolist())
        for make in FormationEnv, ParallelFormationEnv:
            one = make("pentagon", set=SHORT)
            one.reset(seed=9)
            self.assertEqual(one.sim.seeds.tolist(), [episode_seed(9, 0, 0)])
            one.reset()
            self.assertEqual(one.sim.seeds.tolist(), [episode_seed(9, 0, 1)])
        unseeded = [FormationVectorEnv("pentagon", 1, set=SHORT).reset()[0] for _ in range(2)]
        self.assertFalse((unseeded[0] == unseeded[1]).all())

    def test_episodes_of_other_seeds_do_not_overlap(self) -> None:
        def flown(seed: int) -> set[int]:
            return {episode_seed(seed, world, episode) for world in range(16) for episode in range(70)}

        training, evaluation = flown(0), flown(1)
        self.assertEqual((len(training), len(training & evaluation)), (16 * 70, 0))
        self.assertTrue(all(0 <= seed < 2**63 for seed in training))

    def test_options_give_starts(self) -> None:
        positions = np.array([[3.0 * i, 1.0] for i in range(5)])
        velocities = np.full((5, 2), 0.25)
        options = {"positions_m": positions, "velocities_m_s": velocities}
        for make in FormationEnv, FormationVectorEnv, ParallelFormationEnv:
            env = make("pentagon", set=SHORT)
            env.reset(seed=1, options=options)
            np.testing.assert_array_equal(env.sim.positions[0, :, :2], positions)
            np.testing.assert_array_equal(env.sim.velocities[0, :, :2], velocities)
            env.reset(options={"positions_m": positions})
            np.testing.assert_array_equal(env.sim.velocities, np.zeros((1, 5, 3)))
            crossed = {"positions_m": np.zeros((5, 2))}
            short, unknown = {"positions_m": np.zeros((4, 2))}, {"position": 1}
            for wrong, message in (
                (crossed, "positions[0]: "),
                (short, "positions: an array of shape"),
                (unknown, "unknown option position"),
            ):
                self.refuses(tl.Error, message, lambda env=env, wrong=wrong: env.reset(options=wrong))

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
        self.assertEqual(env.sim.seeds.tolist(), [episode_seed(0, 0, 1), episode_seed(0, 1, 0)])
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
            again = FormationVectorEnv("pentagon", 1, set=sets)
            again.reset(seed=73)
            again.reset()
            self.assertEqual(env.sim.seeds[0], again.sim.seeds[0], "the number of worlds does not count")
        # Of many random first seeds some have no valid start.
        FormationVectorEnv("pentagon", 300, set=sets).reset()
        for make in (FormationEnv, ParallelFormationEnv):
            env, passed = make("pentagon", set=sets), 0
            for seed in range(60):
                env.reset(seed=seed)
                passed += int(env.sim.seeds[0]) != episode_seed(seed, 0, 0)
            self.assertGreater(passed, 0)

    def test_all_scenarios_but_those_of_a_leader_are_flown(self) -> None:
        for name in tl.scenarios():
            hz = tl.Scenario(name).dt_s ** -1
            if name in ("leader-lossy", "pentagon-leader"):
                message = f"scenario: an environment does not support reference.leader of {name}"
                for make in (FormationEnv, FormationVectorEnv, ParallelFormationEnv):
                    self.refuses(tl.Error, message, lambda make=make, name=name: make(name))
                continue
            env = FormationVectorEnv(name, 1, hz=hz)
            observations, _ = env.reset(seed=0)
            axes, slots = env.sim.axes, env.sim.slots_m
            to_slot = observations[:, :, axes : 2 * axes]
            known = env.sim.measured()[0] if name != "thousand" else env.sim.positions
            np.testing.assert_allclose(to_slot, (slots - known)[..., :axes], atol=1e-5)

    def test_slots_of_later_legs_and_of_a_reference_are_observed(self) -> None:
        sets = {
            "time.duration_s": 5.0,
            "leg": [{"shape": "circle", "radius_m": 6.0, "start_s": 1.0}],
            "reference": {"kind": "velocity", "velocity_m_s": [1.0, 0.0]},
        }
        env = FormationVectorEnv("swap", 1, set=sets)
        observations, _ = env.reset(seed=0)
        before = env.sim.slots_m
        for _ in range(30):
            observations, rewards, *_ = env.step(np.zeros((1, 12, 2)))
        after = env.sim.slots_m
        self.assertGreater(np.linalg.norm(after - before, axis=-1).min(), 0.5)
        np.testing.assert_allclose(after[0, :, :2].mean(0), [1.5, 0.0], atol=1e-9)
        expected = -np.linalg.norm(after - env.sim.positions, axis=-1).mean()
        self.assertAlmostEqual(rewards[0], expected)
        np.testing.assert_allclose(observations[0, :, 2:4], (after - env.sim.positions)[0, :, :2], atol=1e-5)

    def test_vehicles_observe_what_they_know_or_the_truth(self) -> None:
        noisy = {**SHORT, "sensing": {"position_noise_m": 0.1, "rate_hz": 100.0}}
        known, true = FormationVectorEnv("pentagon", 1, set=noisy), FormationVectorEnv(
            "pentagon", 1, observe=Observation(true_states=True), set=noisy
        )
        for env, is_true in (known, False), (true, True):
            observations, _ = env.reset(seed=0)
            to_slot = (env.sim.slots_m - env.sim.positions)[..., :2]
            off_m = np.abs(observations[..., 2:4] - to_slot).max()
            self.assertEqual(off_m < 1e-5, is_true, off_m)
            self.assertLess(off_m, 1.0)
        late = FormationVectorEnv("pentagon", 1, set={**LONG, "network": {"rate_hz": 20.0, "latency_s": 0.5}})
        late.reset(seed=0)
        push = np.zeros((1, 5, 2), dtype=np.float32)
        push[..., 0] = 0.2
        for _ in range(40):
            observations, *_ = late.step(push)
        received, p = late.sim.received(), late.sim.positions
        lag_m = p[:, None] - received
        behind_m = lag_m[0, 0, 1:, 0]
        self.assertTrue((behind_m > 0.1).all(), behind_m)
        np.testing.assert_allclose(observations[0, 0, 4:6], (received[0, 0, 1] - p[0, 0])[:2], atol=1e-5)

    def test_obstacles_are_observed(self) -> None:
        env = FormationVectorEnv("obstacles", 1, set={"leg": []})
        observations, _ = env.reset(seed=0)
        nearest = env.sim.to_obstacles()
        axes = env.sim.axes
        self.assertEqual(observations.shape[2], axes * (len(env.sim.scenario) + 1 + nearest.shape[2]))
        np.testing.assert_allclose(observations[0, :, -axes:], nearest[0, :, -1, :axes], atol=1e-5)
        least_m = np.linalg.norm(nearest, axis=-1).min()
        self.assertGreater(least_m, env.sim.least_clearance_m[0] - 1e-9)

    def test_observations_and_rewards_are_replaced(self) -> None:
        class Slow(Reward):
            def __call__(self, worlds: Worlds) -> np.ndarray:
                return super().__call__(worlds) - np.linalg.norm(worlds.velocities, axis=-1)

        class Own(Observation):
            def size(self, worlds: Worlds) -> int:
                return 2

            def __call__(self, worlds: Worlds) -> np.ndarray:
                return worlds.velocities[..., :2].astype(np.float32)

        for make in FormationEnv, ParallelFormationEnv:
            env = make("pentagon", observe=Own(), reward=Slow(violation=7.0), set=SHORT)
            env.reset(seed=0)
        vector = FormationVectorEnv("pentagon", 2, observe=Own(), reward=Slow(violation=7.0), set=LONG)
        self.assertEqual(vector.observation_space.shape, (2, 5, 2))
        vector.reset(seed=0)
        while True:
            _, rewards, terminated, *_ = vector.step(crash(vector, 0))
            if terminated.any():
                break
        # The distances to the slots count once for this action and once for each action that is left.
        sim = vector.sim
        errors_m = np.linalg.norm(sim.slots_m - sim.positions, axis=-1)[0].mean()
        left = (sim.scenario.steps - sim.steps[0]) / sim.steps_of_action
        self.assertEqual(sim.actions_left[0], left)
        expected = -7.0 - errors_m * (1 + left) - np.linalg.norm(sim.velocities[0], axis=-1).mean()
        self.assertAlmostEqual(rewards[0], expected)

        class Wrong(Own):
            def size(self, worlds: Worlds) -> int:
                return 3

        self.refuses(
            tl.Error, "observe: must return an array of shape (1, 5, 3)",
            lambda: FormationEnv("pentagon", observe=Wrong()).reset(seed=0),
        )

    def test_a_shield_keeps_every_policy_clear(self) -> None:
        for shield, verdict in (True, "clear"), (False, "violation"):
            sets = {"start.jitter_m": 0.1, "time.duration_s": 10.0}
            env = FormationVectorEnv("hexagon", 4, shield=shield, autoreset_mode="Disabled", set=sets)
            env.reset(seed=0)
            ended: dict[int, dict[str, object]] = {}
            while len(ended) < 4:
                p = env.sim.positions[..., : env.sim.axes]
                actions = np.clip(p.mean(axis=1, keepdims=True) - p, -1, 1)
                env._done[:] = False
                _, _, terminated, truncated, info = env.step(actions)
                for e in np.flatnonzero(terminated | truncated):
                    ended.setdefault(int(e), {name: values[e] for name, values in info.items()})
            self.assertEqual({info["verdict"] for info in ended.values()}, {verdict})
            for info in ended.values():
                self.assertEqual("shielded" in info, shield)
                self.assertGreater(info.get("shielded", 1.0), 0.0)

    def test_actuators_limit_actions(self) -> None:
        envs = [FormationVectorEnv("pentagon", 1, set={**SHORT, **more})
                for more in ({}, {"actuation": {"max_accel_m_s2": 0.5}})]
        for env in envs:
            env.reset(seed=0)
            env.step(np.ones((1, 5, 2)))
        speeds = [float(np.abs(env.sim.velocities).max()) for env in envs]
        self.assertGreater(speeds[0], 5 * speeds[1])

    def test_copies_continue_with_the_same_bits(self) -> None:
        env = FormationVectorEnv("pentagon", 2, set=LONG)
        env.reset(seed=0)
        env.step(np.full((2, 5, 2), 0.2))
        twin = copy.deepcopy(env)
        for _ in range(5):
            for one in env, twin:
                one.step(np.full((2, 5, 2), -0.1))
        np.testing.assert_array_equal(env.sim.positions, twin.sim.positions)
        twin.step(np.full((2, 5, 2), 0.3))
        self.assertTrue((env.sim.positions != twin.sim.positions).any())
        np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])

    def test_pictures_show_the_vehicles(self) -> None:
        for make in FormationEnv, ParallelFormationEnv:
            env = make("obstacles", render_mode="rgb_array", set={"leg": []})
            env.reset(seed=0)
            first = env.render()
            self.assertEqual((first.shape, first.dtype), ((480, 480, 3), np.uint8))
            self.assertGreater((first != 255).any(axis=-1).sum(), 1000)
            env.sim.step(np.ones((1, len(env.sim.scenario), 3)), steps=400)
            self.assertTrue((env.render() != first).any())
            self.assertEqual(copy.deepcopy(env).render().shape, first.shape)
            env.close()
            self.refuses(tl.Error, "render_mode: must be rgb_array or human", lambda make=make: make(render_mode="x"))
        vector = FormationVectorEnv("pentagon", 2, render_mode="rgb_array")
        vector.reset(seed=0)
        self.assertEqual([picture.shape for picture in vector.render()], [(480, 480, 3)] * 2)
        self.assertIsNone(FormationEnv("pentagon").render())
        frames = gymnasium.wrappers.RenderCollection(FormationEnv("pentagon", render_mode="rgb_array"))
        frames.reset(seed=0)
        frames.step(np.zeros((5, 2)))
        self.assertEqual(len(frames.render()), 2)


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
        expected = [rows[0, :, :2] for rows in (env.sim.positions, env.sim.velocities, env.sim.slots_m)]
        np.testing.assert_allclose(env.state(), np.concatenate(expected, axis=-1), atol=1e-5)
        self.assertEqual(env.state().shape, env.state_space.shape)
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
