"""Tests of pickles and saved simulations: another process continues with the same bits."""

import copy
import hashlib
import multiprocessing
import pickle
import unittest
import unittest.mock

import joblib
import numpy as np
import tautline as tl
from shared import Case, Springs, passing, short

NOISY = {"sensing.position_noise_m": 0.01, "sensing.rate_hz": 50.0, "network.rate_hz": 20.0, "network.loss": 0.1}


class Integral(tl.Law):
    """A law with a memory that is never cleared."""

    def __init__(self) -> None:
        self.calls, self.sum = 0, 0.0

    def control(self, obs, out):
        self.calls += 1
        self.sum = self.sum + 0.001 * (obs.slots_m - obs.positions)
        out[:] = obs.slots_m - obs.positions - 2 * obs.velocities + self.sum


class Failing(Springs):
    """Raises at its tenth call."""

    calls = 0

    def control(self, obs, out):
        self.calls += 1
        if self.calls == 10:
            raise LookupError("no policy")
        super().control(obs, out)


def bits(sim: tl.Simulation) -> tuple:
    """Returns everything that a simulation shows."""
    return sim.t, sim.steps, sim.positions.tobytes(), sim.velocities.tobytes(), sim.commands.tobytes(), sim.closest, \
        sim.status, sim.least_clearance_m, list(sim.violations), sim.ending  # fmt: skip


def continued(sim: tl.Simulation) -> tuple:
    """Flies a simulation on, in another process."""
    sim.step(steps=100)
    return bits(sim)


def smallest(flight: tl.Flight) -> tuple:
    """Audits a flight, in another process."""
    return flight.separation_m, flight.audit().to_dict(), flight.positions.tobytes()


class Simulations(Case):
    def flown(self, scenario: tl.Scenario, law=None) -> tl.Simulation:
        """Returns a simulation with steps of the law, steps from outside, and another seed."""
        sim = tl.Simulation(scenario, law=law)
        sim.step(steps=30)
        rng = np.random.default_rng(1)
        for _ in range(5):
            sim.step(rng.normal(size=(len(scenario), 3)) * [1, 1, 0])
        sim.step(np.ones((len(scenario), 3)) * [1, 0, 0], steps=7)
        sim = sim.copy(noise_seed=17)
        sim.step(steps=11)
        return sim

    def test_a_loaded_simulation_continues_bit_for_bit(self) -> None:
        scenarios = [short(), short("obstacles"), short("pentagon-laplacian"), short(**NOISY)]
        for scenario in scenarios:
            with self.subTest(scenario=repr(scenario)):
                sim = self.flown(scenario)
                saved = sim.save()
                again = tl.Simulation.load(saved)
                self.assertEqual(bits(again), bits(sim))
                self.assertEqual(again.save(), saved)
                self.assertEqual(again.scenario, sim.scenario)
                other = sim.copy(noise_seed=18)
                for one in (sim, again, other):
                    one.step(steps=100)
                self.assertEqual(bits(again), bits(sim))
        self.assertNotEqual(bits(other), bits(sim), "another seed is another flight")

    def test_all_built_in_scenarios_can_be_saved(self) -> None:
        for name in tl.scenarios():
            with self.subTest(name=name):
                sim = tl.Simulation(name)
                if len(sim) > 40:
                    continue
                sim.step(steps=5)
                again = tl.Simulation.load(sim.save())
                for one in (sim, again):
                    one.step(steps=5)
                self.assertEqual(bits(again), bits(sim))

    def test_a_law_in_python_continues_with_its_memory(self) -> None:
        sim = self.flown(short(), Integral())
        calls = sim._law.calls
        again = pickle.loads(pickle.dumps(sim))
        self.assertEqual(again._law.calls, calls, "loading calls no law")
        self.assertEqual(bits(again), bits(sim))
        sim.step(steps=50)
        again.step(steps=50)
        self.assertEqual(bits(again), bits(sim))
        # A law without this memory continues differently.
        forgetful = tl.Simulation.load(self.flown(short(), Integral()).save(), law=Integral())
        forgetful.step(steps=50)
        self.assertNotEqual(bits(forgetful), bits(sim))

    def test_a_failed_flight_stays_failed(self) -> None:
        sim = tl.Simulation(short(), law=Failing())
        with self.assertRaises(LookupError):
            sim.step(steps=100)
        again = pickle.loads(pickle.dumps(sim))
        self.assertEqual(bits(again), bits(sim))
        self.assertTrue(again.is_over and again.ended_early)

    def test_a_finished_flight_and_a_fresh_one(self) -> None:
        sim = tl.Simulation(short())
        self.assertEqual(bits(tl.Simulation.load(sim.save())), bits(sim))
        sim.step(steps=10**6)
        again = tl.Simulation.load(sim.save())
        self.assertEqual((bits(again), again.ending), (bits(sim), "completed"))

    def test_copies_have_a_history_of_their_own(self) -> None:
        sim = tl.Simulation(short(), law=Springs())
        sim.step(steps=5)
        other = copy.deepcopy(sim)
        other.step(np.zeros((5, 3)), steps=3)
        self.assertEqual(bits(pickle.loads(pickle.dumps(sim))), bits(sim))
        self.assertEqual(bits(pickle.loads(pickle.dumps(other))), bits(other))

    def test_wrong_bytes_are_refused(self) -> None:
        sim = tl.Simulation(short(), law=Springs())
        sim.step(np.zeros((5, 3)), steps=3)
        sim.step(steps=3)
        saved = sim.save()
        load = tl.Simulation.load
        for cut in range(0, len(saved), 97):
            with self.assertRaises(tl.Error, msg=cut):
                load(saved[:cut], law=Springs())
        self.refuses(tl.Error, "data: this is no saved simulation (3 bytes); give the bytes", lambda: load(b"abc"))
        self.refuses(tl.Error, "it is truncated or damaged", lambda: load(saved + b"x", law=Springs()))
        self.refuses(TypeError, "bytes are needed, not str", lambda: load("abc"))
        self.refuses(tl.Error, "the law in Python of the saved simulation is needed, `Springs`", lambda: load(saved))
        self.refuses(tl.Error, "needed, `Springs`, got `Integral`", lambda: load(saved, law=Integral()))
        plain = tl.Simulation(short()).save()
        self.refuses(tl.Error, "needed, none, got `Springs`", lambda: load(plain, law=Springs()))
        header = saved.index(b'"program":"') + len(b'"program":"')
        other = saved[:header] + b"0" * 64 + saved[header + 64 :]
        self.refuses(tl.Error, "saved by another program", lambda: load(other, law=Springs()))
        # Every flipped bit is found, also in the scenario.
        places = [saved.index(b"delta_m") + 12, *range(0, len(saved), 31), len(saved) - 1]
        for place in places:
            changed = bytearray(saved)
            changed[place] ^= 0x01
            with self.assertRaises(tl.Error, msg=place):
                load(changed, law=Springs())
        changed = saved.replace(b"delta_m = 2.0", b"delta_m = 1.8")
        self.assertNotEqual(changed, saved)
        self.refuses(tl.Error, "it is truncated or damaged", lambda: load(changed, law=Springs()))
        # A claimed number of vehicles allocates nothing.
        huge = plain.replace(b'"vehicles":5', b'"vehicles":9999999999999999')
        self.refuses(tl.Error, "truncated or damaged", lambda: load(huge))

    def test_bytes_with_a_new_hash_are_refused_without_a_crash(self) -> None:
        plain = tl.Simulation(short()).save()[:-32]
        state = plain[-241:]

        def hashed(records: bytes) -> bytes:
            data = plain[:-241] + records + state
            return data + hashlib.sha256(data).digest()

        step = b"\x01" + (3).to_bytes(8, "little")
        again = tl.Simulation.load(hashed(b""))
        self.assertEqual(again.steps, 0)
        self.refuses(tl.Error, "ends in another state", lambda: tl.Simulation.load(hashed(step)))
        most = b"\x01" + (2**64 - 1).to_bytes(8, "little")
        self.refuses(tl.Error, "truncated or damaged", lambda: tl.Simulation.load(hashed(most + step)))

    def test_other_processes_continue(self) -> None:
        sims = [self.flown(short(), law) for law in (None, Integral())]
        expected = [continued(copy.copy(sims[0])), continued(pickle.loads(pickle.dumps(sims[1])))]
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            self.assertEqual(pool.map(continued, sims), expected)
        self.assertEqual(joblib.Parallel(n_jobs=2)(joblib.delayed(continued)(sim) for sim in sims), expected)


class Flights(Case):
    def test_a_flight_survives_a_pickle(self) -> None:
        scenario = short()
        for flight in (tl.fly(scenario), tl.fly(scenario, law=Springs()), tl.fly(short("obstacles"))):
            again = pickle.loads(pickle.dumps(flight))
            self.assertEqual(again.report, flight.report)
            self.assertEqual((again.headline, again.text, again.passed), (flight.headline, flight.text, flight.passed))
            for name in ("t", "positions", "velocities", "commands", "separations_m"):
                np.testing.assert_array_equal(getattr(again, name), getattr(flight, name))
            self.assertEqual(again.audit().to_dict(), flight.audit().to_dict())
            self.assertEqual(again.scenario, flight.scenario)
            with self.assertRaises(ValueError):
                again.positions[0] = 0.0

    def test_violations_between_samples_and_early_ends_survive(self) -> None:
        coarse = {"time.record_hz": 1, "law.f1_per_s2": 30, "law.f2_per_s": 1}
        flight = tl.fly("pentagon-laplacian", set=coarse)
        again = pickle.loads(pickle.dumps(flight))
        self.assertEqual((again.status, again.audit().verdict), ("violation", "VIOLATION"))
        self.assertGreater(tl.audit(again.t, again.positions, delta=2.0).separation_m, again.separation_m)

    def test_a_flipped_bit_of_a_pickle_is_found(self) -> None:
        file, (t, p) = self.folder / "run.mcap", passing()
        flight = tl.fly(short(), record=file)
        recording, audit = tl.read(file), tl.audit(t, p, delta=1.5)
        answer = tl.compare(short(), ["laplacian"], runs=1)
        for result, part in (
            (flight, flight.positions.tobytes()[-800:]),
            (flight, flight.velocities.tobytes()[-800:]),
            (flight, b'"status":"clear"'),
            (flight, flight.headline.encode()),
            (recording, recording._data.position.tobytes()[-800:]),
            (recording, recording._data.t.tobytes()[-80:]),
            (audit, audit.headline.encode()),
            (answer, b"state_hash"),
        ):
            data = bytearray(pickle.dumps(result))
            pickle.loads(data)
            data[data.rindex(part) + 5] ^= 0x01
            self.refuses(tl.Error, "the bytes of the pickle are damaged", lambda data=data: pickle.loads(data))

    def test_a_pickle_of_another_version_is_refused(self) -> None:
        results = tl.fly(short()), tl.audit(*passing(), delta=1.5), tl.compare(short(), ["laplacian"], runs=1)
        with unittest.mock.patch("tautline._pickles.VERSION", "another"):
            pickles = [pickle.dumps(result) for result in results]
        for data in pickles:
            self.refuses(tl.Error, "of another version of tautline; make", lambda data=data: pickle.loads(data))

    def test_without_its_file_a_flight_keeps_its_scenario(self) -> None:
        file = self.folder / "s.toml"
        file.write_text(short().to_toml())
        flight = tl.fly(file)
        data = pickle.dumps(flight)
        file.unlink()
        again = pickle.loads(data)
        self.assertEqual(again.scenario.positions_m.tobytes(), flight.scenario.positions_m.tobytes())
        self.assertEqual(again.audit().to_dict(), flight.audit().to_dict())
        self.refuses(FileNotFoundError, "s.toml", lambda: pickle.loads(pickle.dumps(flight.scenario)))

    def test_other_processes_audit(self) -> None:
        flight = tl.fly(short())
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            self.assertEqual(pool.map(smallest, [flight]), [smallest(flight)])

    def test_results_cannot_be_made_by_hand(self) -> None:
        self.refuses(TypeError, "tautline.fly(...)", tl.Flight)
        self.refuses(TypeError, "tautline.audit(...)", tl.Audit)


class Others(Case):
    def test_a_recording_survives_a_pickle(self) -> None:
        file = self.folder / "run.mcap"
        tl.fly(short(), record=file)
        recording = tl.read(file)
        data = pickle.dumps(recording)
        again = pickle.loads(data)
        for one, two in zip(again.to_numpy(), recording.to_numpy(), strict=True):
            np.testing.assert_array_equal(one, two)
        self.assertEqual((again.vehicles, again.notes, again.epoch_ns), (recording.vehicles, recording.notes, 0))
        self.assertEqual(again.audit().to_dict(), recording.audit().to_dict())
        file.unlink()
        self.assertEqual(len(pickle.loads(data)), 5)
        self.refuses(FileNotFoundError, "run.mcap", lambda: pickle.loads(data).audit())

    def test_answers_and_audits_survive_a_pickle(self) -> None:
        t, p = passing()
        audit = tl.audit(t, p, delta=1.5)
        self.assertEqual(pickle.loads(pickle.dumps(audit)).violations, audit.violations)
        answer = tl.compare(short(), ["laplacian"], runs=1)
        again = pickle.loads(pickle.dumps(answer))
        self.assertEqual((again, again.is_good), (answer, answer.is_good))
        self.assertEqual(again.laws[0].clear.of, 1)

    def test_scenarios_are_equal_by_what_they_fly(self) -> None:
        one, other = short(), tl.Scenario("pentagon", set={"time.duration_s": 2})
        self.assertEqual(one, other)
        self.assertEqual(len({one, other, pickle.loads(pickle.dumps(one))}), 1)
        self.assertEqual(one, tl.Scenario.from_toml(one.to_toml()))
        self.assertNotEqual(one, tl.Scenario("pentagon", set={"time.duration_s": 3}))
        self.assertNotEqual(one, "pentagon")


if __name__ == "__main__":
    unittest.main()
