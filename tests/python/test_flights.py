"""Tests of flights and laws: the same bits as the program, exceptions of laws, threads."""

import os
import signal
import sys
import threading
import time
import traceback
import unittest

import numpy as np
import tautline as tl
from shared import Case, Springs, printed_json, short


class Flights(Case):
    def test_a_flight_has_the_bits_of_the_program(self) -> None:
        ours = tl.fly(short(), record=self.folder / "ours.mcap").to_dict()
        out = f"--out={self.folder / 'theirs'}"
        theirs = printed_json(["run", "pentagon", "--set=time.duration_s=2.0", "--json", "--no-figures", out])
        for report in (ours, theirs):
            del report["performance"]
        self.assertEqual(ours, theirs)
        read = tl.read(self.folder / "ours.mcap").to_numpy()
        again = tl.read(self.folder / "theirs" / "run.mcap").to_numpy()
        np.testing.assert_array_equal(read[1], again[1])

    def test_arrays_equal_the_recording(self) -> None:
        f = tl.fly(short(), record=self.folder / "run.mcap")
        t, p = tl.read(self.folder / "run.mcap").to_numpy()
        np.testing.assert_array_equal(f.t, t)
        np.testing.assert_array_equal(f.positions, p)
        # The engine computes positions relative to the centre of the start.
        np.testing.assert_allclose(f.positions[0], f.scenario.positions_m, atol=1e-12)
        self.assertEqual(f.velocities.shape, f.positions.shape)
        self.assertEqual(f.separations_m.min(), f.separation_m)
        self.assertEqual(f.to_pandas().shape, (len(t) * 5, 12))
        self.assertEqual(tl.fly(short(), keep=False).positions.shape, (0, 5, 3))

    def test_a_violation_is_reported_and_shown(self) -> None:
        f = tl.fly("pentagon-laplacian", html=self.folder / "f.html")
        self.assertEqual((f.status, f.passed), ("violation", False))
        self.assertIn("VIOLATION", f._repr_html_())
        self.assertNotIn("<script", f._repr_html_())
        self.assertIn("VIOLATION", (self.folder / "f.html").read_text())
        self.assertEqual(len(f.plot().axes), 2)
        self.assertEqual(f.audit().status, "violation")
        self.assertEqual(f.audit(delta=0.5).status, "clear")


class Laws(Case):
    def test_a_flight_under_another_law_is_noted(self) -> None:
        f = tl.fly("pentagon", law=Springs(), record=self.folder / "run.mcap")
        self.assertIsNone(f.certificate.separation_m)
        self.assertTrue(f.certificate.void[0].text)
        last, slots = f.positions[-1], f.scenario.slots_m
        np.testing.assert_allclose(last - last.mean(0), slots - slots.mean(0), atol=1e-3)
        self.assertTrue(any("Springs" in note for note in tl.audit(self.folder / "run.mcap").notes))

    def test_an_observation_is_exact_without_a_network(self) -> None:
        seen = []

        class Observes(tl.Law):
            sensing_range_m = 4.0

            def control(self, obs, out):
                seen.append(obs)
                out[:] = 0

        f = tl.fly(short(), law=Observes())
        first, last = seen[0], seen[-1]
        np.testing.assert_array_equal(first.positions, f.positions[0])
        np.testing.assert_array_equal(first.slots_m, f.scenario.slots_m)
        self.assertEqual((first.t, last.t, first.leg, first.shared), (0.0, 2.0, 0, True))
        near = {(i, j) for i, j in first.near.tolist()}
        apart = np.linalg.norm(first.positions[:, None] - first.positions[None], axis=2)
        self.assertLessEqual({(i, j) for i in range(5) for j in range(i + 1, 5) if apart[i, j] <= 4.0}, near)
        self.assertEqual(len(seen), 2 * 240 + 1)

    def test_an_observation_over_a_network_has_the_received_states(self) -> None:
        seen = []

        class Observes(tl.Law):
            def control(self, obs, out):
                seen.append(obs)
                out[:] = 1.0

        tl.fly(short(**{"network.latency_s": 0.1, "network.rate_hz": 20}), law=Observes())
        obs = seen[-1]
        self.assertFalse(obs.shared)
        self.assertEqual((obs.received_positions.shape, obs.received_ages_s.shape), ((5, 5, 3), (5, 5)))
        self.assertTrue((obs.received_ages_s[~np.eye(5, dtype=bool)] >= 0.1 - 1e-9).all())
        np.testing.assert_array_equal(obs.received_positions[2, 2], obs.positions[2])
        self.assertTrue((obs.received_positions[0, 1] != obs.positions[1]).any())
        self.assertIsNone(obs.sensed_positions)

    def test_an_exception_of_a_law_keeps_its_traceback(self) -> None:
        class Fails(tl.Law):
            def control(self, obs, out):
                out[:] = 0
                if obs.t >= 1.0:
                    self.deep({})

            def deep(self, empty):
                return empty["lost"]

        try:
            tl.fly(short(), law=Fails(), record=self.folder / "run.mcap")
            self.fail("nothing was raised")
        except KeyError as raised:
            names = [frame.name for frame in traceback.extract_tb(raised.__traceback__)]
        self.assertEqual(names[-2:], ["control", "deep"])
        t, _ = tl.read(self.folder / "run.mcap").to_numpy()
        self.assertAlmostEqual(t[-1], 1.0, delta=0.01)
        sim = tl.Simulation(short(), law=Fails())
        with self.assertRaises(KeyError):
            sim.step(steps=480)
        self.assertEqual(sim.ending, "the law is undefined: it failed")

    def test_system_exit_of_a_law_is_raised(self) -> None:
        class Leaves(tl.Law):
            def control(self, obs, out):
                raise SystemExit(3)

        with self.assertRaises(SystemExit) as caught:
            tl.fly(short(), law=Leaves())
        self.assertEqual(caught.exception.code, 3)

    def test_a_command_that_is_not_finite_is_an_error(self) -> None:
        class Forgets(tl.Law):
            def __init__(self, value):
                self.value = value

            def control(self, obs, out):
                out[:4] = 0
                if obs.t < 1.0:
                    out[4] = 0
                elif self.value is not None:
                    out[4, 1] = self.value

        message = "step 240: the law's command for vehicle 5 is not a finite number"
        for value in (None, np.nan, np.inf):
            self.refuses(tl.Error, message, lambda value=value: tl.fly(short(), law=Forgets(value)))
        sim = tl.Simulation(short(), law=Forgets(None))
        self.refuses(tl.Error, message, lambda: sim.step(steps=480))

    def test_a_law_that_returns_or_reshapes_is_refused(self) -> None:
        class Returns(tl.Law):
            def control(self, obs, out):
                return obs.positions

        class Reshapes(tl.Law):
            def control(self, obs, out):
                out[:] = 0
                out.shape = (3, 5)

        self.refuses(TypeError, "writes into `out`", lambda: tl.fly(short(), law=Returns()))
        self.refuses(tl.Error, "must keep its shape (5, 3), got (3, 5)", lambda: tl.fly(short(), law=Reshapes()))
        self.refuses(NotImplementedError, "write control", lambda: tl.fly(short(), law=tl.Law()))

    def test_a_law_of_a_large_swarm_runs_in_the_calling_thread(self) -> None:
        threads = set()

        class Where(Springs):
            def control(self, obs, out):
                threads.add(threading.get_ident())
                super().control(obs, out)

        scenario = tl.Scenario("thousand", set={"time.duration_s": 1.0, "arrival.hold_s": 0.5})
        sim = tl.Simulation(scenario, law=Where())
        sim.step(steps=5)
        self.assertEqual(threads, {threading.get_ident()})


class Huge(tl.Law):
    """Commands an acceleration from ``from_s`` on after which states are not finite."""

    def __init__(self, from_s: float = 0.0, value: float = 1e300) -> None:
        self.from_s, self.value = from_s, value

    def control(self, obs, out):
        out[:] = 0.0
        if obs.t >= self.from_s:
            out[0, 0] = self.value


class Pulls(tl.Law):
    """Pulls all vehicles to one point, and commands 1e300 m/s^2 from 10 s on."""

    def control(self, obs, out):
        out[:] = obs.positions.mean(0) - obs.positions if obs.t < 10.0 else 1e300


class EarlyEnds(Case):
    def test_a_flight_that_ended_early_is_never_clear(self) -> None:
        for from_s in (0.0, 1.0):
            file = self.folder / f"from-{from_s}.mcap"
            f = tl.fly(short(), law=Huge(from_s), record=file)
            self.assertLess(f.report["run"]["duration_s"], 2.0)
            self.assertIsNotNone(f.ended_early)
            self.assertEqual((f.status, f.passed, f.reached), ("undecided", False, False))
            self.assertTrue(f.headline.startswith("UNDECIDED"), f.headline)
            self.assertIn("ended early", f._repr_html_())
            for a in (f.audit(), tl.audit(file)):
                self.assertEqual((a.status, a.is_clear, a.is_proved), ("undecided", False, False))
                self.assertIn("the flight ended early, at ", a.headline)
                self.assertEqual(a.ended_early["reason"], f.ended_early.partition("; shorten")[0])
                self.assertEqual(a.ended_early["duration_s"], 2.0)
                with self.assertRaises(tl.ViolationError):
                    a.raise_for_violation()
            t, p = tl.read(file).to_numpy()
            np.testing.assert_array_equal(t, f.t)
            np.testing.assert_array_equal(p, f.positions)
        self.assertEqual(f.audit(until_s=0.5).status, "clear")

    def test_a_complete_flight_has_no_early_end(self) -> None:
        f = tl.fly(short())
        self.assertEqual((f.ended_early, f.status, f.audit().ended_early), (None, "clear", None))
        sim = tl.Simulation(short())
        self.assertEqual((sim.status, sim.ended_early), ("clear", None))
        sim.step(steps=480)
        self.assertEqual((sim.status, sim.ending, sim.ended_early), ("clear", "completed", None))

    def test_a_violation_before_an_early_end_counts(self) -> None:
        f = tl.fly("pentagon-laplacian", law=Pulls(), set={"time.duration_s": 30})
        self.assertIsNotNone(f.ended_early)
        self.assertEqual((f.status, f.audit().status), ("violation", "violation"))

    def test_a_simulation_that_ended_early_is_never_clear(self) -> None:
        sim = tl.Simulation(short(), law=Huge(1.0))
        sim.step(steps=200)
        self.assertEqual((sim.status, sim.ended_early), ("clear", None), "so far")
        sim.step(steps=280)
        self.assertTrue(sim.is_over)
        self.assertEqual((sim.status, sim.ended_early), ("undecided", sim.ending))

        class Fails(tl.Law):
            def control(self, obs, out):
                out[:] = 0.0
                if obs.t > 0.5:
                    raise KeyError("lost")

        failing = tl.Simulation(short(), law=Fails())
        with self.assertRaises(KeyError):
            failing.step(steps=480)
        self.assertEqual((failing.status, failing.ended_early), ("undecided", "the law is undefined: it failed"))


class Threads(Case):
    def test_other_threads_run_during_flights_and_audits(self) -> None:
        count, is_over = 0, threading.Event()

        def counts() -> None:
            nonlocal count
            while not is_over.is_set():
                count += 1

        counter = threading.Thread(target=counts)
        counter.start()
        try:
            scenario = tl.Scenario("pentagon", set={"time.duration_s": 60})
            t = np.arange(3000) * 0.1
            p = np.random.default_rng(0).normal(scale=20, size=(3000, 20, 3))
            for work in (lambda: tl.fly(scenario), lambda: tl.audit(t, p, delta=0.1)):
                before = count
                work()
                self.assertGreater(count - before, 100)
        finally:
            is_over.set()
            counter.join()

    def test_ctrl_c_ends_a_flight_and_keeps_its_recording(self) -> None:
        def presses_once(path) -> None:
            while not path.exists() or path.stat().st_size == 0:
                pass
            os.kill(os.getpid(), signal.SIGINT)

        for law in (None, Springs()):
            file = self.folder / f"run-{law is None}.mcap"
            presser = threading.Thread(target=presses_once, args=(file,))
            presser.start()
            with self.assertRaises(KeyboardInterrupt):
                tl.fly("pentagon", law=law, record=file, set={"time.duration_s": 5000}, keep=False)
            presser.join()
            t, _ = tl.read(file).to_numpy()
            self.assertLess(t[-1], 5000)

    def test_copies_in_two_threads_raise_their_own_exceptions(self) -> None:
        # Two copies share a law and are in `control` at once. While the first waits for the interpreter's lock to raise
        # its exception in Python, the second raises another one.
        second_is_in, first_is_in = threading.Event(), threading.Event()
        names, raised = threading.local(), {}

        class Fails(tl.Law):
            fails = False

            def control(self, obs, out):
                out[:] = 0.0
                if not self.fails:
                    return
                if names.own == "first":
                    second_is_in.wait(10)
                    first_is_in.set()
                    raise KeyError("first")
                second_is_in.set()
                first_is_in.wait(10)
                until = time.perf_counter() + 0.1
                while time.perf_counter() < until:
                    pass
                raise IndexError("second")

        def steps(name: str, sim: tl.Simulation) -> None:
            names.own = name
            try:
                sim.step()
            except LookupError as error:
                raised[name] = error

        law = Fails()
        sim = tl.Simulation(short(), law=law)
        sims = {"first": sim, "second": sim.copy()}
        law.fails = True
        interval = sys.getswitchinterval()
        sys.setswitchinterval(10.0)
        try:
            threads = [threading.Thread(target=steps, args=pair) for pair in sims.items()]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        finally:
            sys.setswitchinterval(interval)
        kinds = {name: type(error) for name, error in raised.items()}
        self.assertEqual(kinds, {"first": KeyError, "second": IndexError})

    def test_an_exception_in_a_copy_does_not_end_another(self) -> None:
        class Fails(tl.Law):
            failing = None

            def control(self, obs, out):
                out[:] = 0.0
                if self.failing == threading.get_ident():
                    raise KeyError("mine")

        law, errors = Fails(), []
        sim = tl.Simulation(short(), law=law)

        def steps(other: tl.Simulation) -> None:
            try:
                while not other.is_over:
                    other.step()
            except Exception as error:
                errors.append(error)

        other = sim.copy()
        thread = threading.Thread(target=steps, args=(other,))
        thread.start()
        law.failing = threading.get_ident()
        caught = 0
        while thread.is_alive():
            with self.assertRaises(KeyError):
                sim.copy().step()
            caught += 1
        thread.join()
        self.assertEqual((errors, other.ending), ([], "completed"))
        self.assertGreater(caught, 0)

    def test_a_law_may_step_another_simulation_whose_law_fails(self) -> None:
        class Inner(tl.Law):
            fails = False

            def control(self, obs, out):
                out[:] = 0.0
                if self.fails:
                    raise KeyError("inner")

        inner = Inner()
        within = tl.Simulation(short(), law=inner)
        inner.fails = True

        class Outer(tl.Law):
            def control(self, obs, out):
                out[:] = 0.0
                if obs.t == 0.0:
                    return
                try:
                    within.copy().step()
                except KeyError as error:
                    raise IndexError("outer") from error

        sim = tl.Simulation(short(), law=Outer())
        with self.assertRaises(IndexError):
            sim.step()

    def test_a_simulation_cannot_be_stepped_twice_at_once(self) -> None:
        class Steps(tl.Law):
            sim = None

            def control(self, obs, out):
                out[:] = 0
                if self.sim is not None:
                    self.sim.step()

        law = Steps()
        law.sim = tl.Simulation(short(), law=law)
        self.refuses(tl.Error, "is being stepped", lambda: law.sim.step())


class Simulations(Case):
    def test_a_simulation_equals_the_flight(self) -> None:
        f, sim = tl.fly(short()), tl.Simulation(short())
        while not sim.is_over:
            sim.step(steps=7)
        np.testing.assert_array_equal(sim.positions, f.positions[-1])
        np.testing.assert_array_equal(sim.velocities, f.velocities[-1])
        self.assertEqual(sim.closest, f.closest[0])
        self.assertEqual((sim.status, len(sim.violations)), ("clear", 0))

    def test_commands_from_outside_are_flown(self) -> None:
        sim = tl.Simulation(short(**{"swarm.a22_per_s": 0.0}))
        u = np.zeros((5, 3))
        u[0, 1] = 2.0
        sim.step(u, steps=240)
        np.testing.assert_allclose(sim.positions[0, 1] - sim.scenario.positions_m[0, 1], 1.0, rtol=1e-5)
        np.testing.assert_allclose(sim.velocities[0, 1], 2.0, rtol=1e-5)
        np.testing.assert_array_equal(sim.commands, u)
        self.assertEqual(sim.t, 1.0)

    def test_the_audit_covers_the_time_between_steps(self) -> None:
        sim = tl.Simulation(short(**{"time.dt_s": 0.5, "time.max_halvings": 0}))
        u = np.zeros((5, 3))
        where = sim.positions
        first, second = np.argsort(where[:, 0])[:2]
        u[first] = 20 * (where[second] - where[first])
        sim.step(u, steps=2)
        self.assertLess(sim.separation_m, sim.scenario.delta_m)
        self.assertLess(sim.least_clearance_m, 0)
        self.assertEqual(sim.status, "violation")
        self.assertEqual(set(sim.violations[0].subjects), {str(first + 1), str(second + 1)})

    def test_a_copy_continues_with_the_same_bits(self) -> None:
        sim = tl.Simulation(short())
        sim.step(steps=100)
        copy = sim.copy()
        sim.step(steps=100)
        self.assertEqual(copy.steps, 100)
        copy.step(steps=100)
        np.testing.assert_array_equal(copy.positions, sim.positions)
        noisy = tl.Simulation(short(**{"sensing.position_noise_m": 0.05, "sensing.rate_hz": 100}))
        noisy.step(steps=10)
        same, other = noisy.copy(), noisy.copy(noise_seed=9)
        for simulation in (noisy, same, other):
            simulation.step(steps=200)
        np.testing.assert_array_equal(same.positions, noisy.positions)
        self.assertTrue((other.positions != noisy.positions).any())


if __name__ == "__main__":
    unittest.main()
