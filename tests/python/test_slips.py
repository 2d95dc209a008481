"""Tests of mistakes: none gives a clear verdict, and none loses a written file."""

import copy
import multiprocessing
import os
import pickle
import sys
import threading
import unittest
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import tautline as tl
from shared import Case, Springs, passing, short


class Ahead(tl.Law):
    """Flies straight on."""

    def control(self, obs, out):
        out[:] = [1.0, 0.0, 0.0]


class Together(tl.Law):
    """Pulls all vehicles to the origin."""

    def control(self, obs, out):
        out[:] = -obs.positions - 2 * obs.velocities


class OwnFlights(Case):
    def agrees(self, flight: tl.Flight, file: object) -> None:
        """Asserts that audits of a flight and of its recording are equal."""
        ours, recorded = flight.audit().to_dict(), tl.audit(file).to_dict()
        for key in ("status", "proved", "question", "answers"):
            self.assertEqual(ours[key], recorded[key], key)

    def test_obstacles_are_audited(self) -> None:
        file = self.folder / "o.mcap"
        flight = tl.fly("obstacles", law=Ahead(), record=file, set={"time.duration_s": 12.0})
        self.assertEqual(flight.status, "violation")
        self.assertEqual(flight.audit().verdict, "VIOLATION")
        self.agrees(flight, file)

    def test_ellipsoids_are_audited(self) -> None:
        file = self.folder / "e.mcap"
        ellipsoid = {"shape": "ellipsoid", "half_axes_m": [1.0, 1.0, 1.5]}
        sets = {"law.kind": "displacement", "law.delta_m": 2.0, "safety": ellipsoid, "time.duration_s": 5.0}
        flight = tl.fly("pentagon", law=Together(), record=file, set=sets)
        self.assertEqual(flight.status, "violation")
        self.assertEqual(flight.audit().verdict, "VIOLATION")
        self.agrees(flight, file)

    def test_an_approach_between_instants_counts(self) -> None:
        file = self.folder / "r.mcap"
        coarse = {"time.record_hz": 1, "law.f1_per_s2": 30, "law.f2_per_s": 1}
        flight = tl.fly("pentagon-laplacian", record=file, set=coarse)
        self.assertEqual(flight.status, "violation")
        self.assertEqual(flight.audit().verdict, "VIOLATION")
        self.agrees(flight, file)
        # The arrays alone do not contain it.
        self.assertGreater(tl.audit(flight.t, flight.positions, delta=2.0).separation_m, flight.separation_m)

    def test_a_clear_flight_stays_clear(self) -> None:
        flight = tl.fly(short())
        self.assertTrue(flight.audit().is_clear)
        self.assertEqual(flight.audit(delta=3.0).verdict, "VIOLATION")


class Arguments(Case):
    def test_arguments_of_wrong_types_are_refused(self) -> None:
        t, p = passing()
        for message, options in (
            ("ids: a list of names is needed, not str", {"ids": "12"}),
            ("names: a list of names is needed, not str", {"names": "abcd"}),
            ("limit: a dictionary is needed, not int", {"limit": 5}),
            ("offset: a dictionary is needed, not int", {"offset": 5}),
            ("expect_vehicles: a whole number is needed, not bool", {"expect_vehicles": True}),
            ("motion: a string is needed, not bool", {"motion": False}),
            ("unexpected keyword argument 'detla'", {"detla": 1.0}),
        ):
            self.refuses(TypeError, message, lambda options=options: tl.audit(t, p, **{"delta": 0.1, **options}))
        self.refuses(tl.Error, "no vehicle is named", lambda: tl.audit(t, p, delta=0.1, ids=iter([])))
        self.refuses(tl.Error, "too large", lambda: tl.audit(t, p, delta=10**400))
        self.assertEqual(tl.audit(t, p, delta=0.1, expect_vehicles=np.int64(4)).vehicles, ["1", "2", "3", "4"])
        self.refuses(TypeError, "laws: a list of names", lambda: tl.compare("pentagon", laws="laplacian"))
        self.refuses(TypeError, "csv: a path is needed", lambda: tl.compare("pentagon", csv=3))
        self.refuses(TypeError, "overwrite: True or False is needed", lambda: tl.compare("pentagon", overwrite="yes"))
        self.refuses(TypeError, "a lower and an upper bound", lambda: tl.attack("pentagon", vary={"law.alpha": (0,)}))
        self.refuses(TypeError, "needs a list of numbers", lambda: tl.sweep("pentagon", {"law.alpha": 1.0}))
        self.refuses(tl.Error, "a sweep has one key or two", lambda: tl.sweep("pentagon", {}))
        self.refuses(tl.Error, "is not finite", lambda: tl.sweep("pentagon", {"law.alpha": [1.0, float("nan")]}))
        self.refuses(TypeError, "not the class Springs", lambda: tl.fly("pentagon", law=Springs))

    def test_series_of_pandas_are_read(self) -> None:
        import pandas

        t, p = passing()
        self.assertEqual(tl.audit(pandas.Series(t), p, delta=1.0).separation_m, tl.audit(t, p, delta=1.0).separation_m)
        missing = pandas.Series([*t[:-1], None], dtype="Float64")
        self.refuses(tl.Error, "t[99]: it is NaN", lambda: tl.audit(missing.to_numpy(na_value=np.nan), p, delta=1.0))

    def test_config_applies_to_arrays(self) -> None:
        t, p = passing()
        config = self.folder / "c.toml"
        config.write_text("[audit]\ndelta_m = 1.5\n")
        self.assertEqual(tl.audit(t, p, config=config).verdict, "VIOLATION")
        config.write_text("[audit.limits]\nspeed_m_s = 0.1\n")
        self.assertEqual(tl.audit(t, p, delta=0.1, config=config).verdict, "VIOLATION")
        missing = self.folder / "none.toml"
        self.refuses(FileNotFoundError, "none.toml", lambda: tl.audit(t, p, delta=0.1, config=missing))

    def test_absent_vehicles_are_named(self) -> None:
        t, p = passing()
        p[:, 3], p[1:, 2] = np.nan, np.nan
        notes = " ".join(tl.audit(t, p, delta=0.1).notes)
        self.assertIn("`4` are NaN at every instant and are not audited", notes)
        self.assertIn("`3` are not seen from the first instant to the last", notes)
        self.assertEqual(tl.audit(*passing(), delta=0.1).notes, [])

    def test_results_have_no_truth_value(self) -> None:
        for found in (tl.audit(*passing(), delta=1.5), tl.fly(short()), tl.check("pentagon")):
            self.refuses(TypeError, "neither true nor false", lambda found=found: bool(found))


class Kept(Case):
    def test_a_page_of_another_verdict_does_not_replace_a_page(self) -> None:
        t, p = passing()
        a, page = tl.audit(t, p, delta=1.5), self.folder / "a.html"
        a.to_html(page)
        before = page.read_bytes()
        p[:, 0] = [0.0, 9.0, 0.0]
        self.refuses(tl.Error, "has changed", lambda: a.to_html(page))
        self.assertEqual(page.read_bytes(), before)

    def test_a_flight_overwrites_neither_its_scenario_nor_itself(self) -> None:
        file = self.folder / "s.toml"
        file.write_text(short().to_toml())
        before = file.read_bytes()
        self.refuses(tl.Error, "would overwrite the scenario", lambda: tl.fly(file, record=file))
        self.assertEqual(file.read_bytes(), before)
        same = self.folder / "x"
        self.refuses(tl.Error, "would overwrite record", lambda: tl.fly(short(), record=same, html=same))
        nowhere = self.folder / "none" / "x.html"
        self.refuses(OSError, "there is no folder", lambda: tl.fly(short(), html=nowhere))

    def test_threads_may_write_the_same_page(self) -> None:
        page, failed = self.folder / "same.html", []
        t, p = passing(10)

        def write() -> None:
            try:
                for _ in range(5):
                    tl.audit(t, p, delta=1.5).to_html(page)
            except Exception as error:
                failed.append(error)

        threads = [threading.Thread(target=write) for _ in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        self.assertEqual(failed, [])
        self.assertTrue(page.read_text().rstrip().endswith("</html>"))
        self.assertEqual(os.listdir(self.folder), ["same.html"])

    def test_a_changed_scenario_is_refused(self) -> None:
        file = self.folder / "s.toml"
        file.write_text(short().to_toml())
        s = tl.Scenario(file)
        file.write_text(short(**{"law.alpha": 2.0}).to_toml())
        self.refuses(tl.Error, "has changed", lambda: tl.compare(s, runs=1))
        self.refuses(tl.Error, "has changed", lambda: tl.fly(s, set={"time.duration_s": 1.0}))
        self.refuses(tl.Error, "has changed", lambda: pickle.loads(pickle.dumps(s)))
        file.unlink()
        self.refuses(FileNotFoundError, "s.toml", lambda: tl.compare(s, runs=1))

    def test_paths_in_a_text_are_relative_to_the_working_folder(self) -> None:
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        (self.folder / "slots.csv").write_text("x,y\n0,0\n3,0\n6,0\n")
        text = '[swarm]\ncount = 3\n[start]\nshape = "line"\nspacing_m = 4.0\n'
        text += '[formation]\nshape = "file"\nfile = "slots.csv"\n[law]\ndelta_m = 1.0\n[time]\nduration_s = 1.0\n'
        s = tl.Scenario.from_toml(text)
        self.assertEqual(tl.compare(s, ["edge-tension"], runs=1).runs, 1)
        self.assertEqual(os.listdir(self.folder), ["slots.csv"])

    @unittest.skipUnless(sys.platform == "linux", "/proc is read-only there")
    def test_a_text_needs_no_writable_folder(self) -> None:
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir("/proc")
        s = tl.Scenario.from_toml(short().to_toml())
        self.assertTrue(tl.check(s).is_good)
        self.assertEqual(tl.compare(s, ["edge-tension"], runs=1).runs, 1)

    def test_results_can_be_pickled(self) -> None:
        a = tl.audit(*passing(), delta=1.5)
        sent = pickle.loads(pickle.dumps(a))
        self.assertEqual((sent.headline, sent.to_dict()), (a.headline, a.to_dict()))
        self.refuses(tl.Error, "has no recording", lambda: sent.to_html(self.folder / "a.html"))
        with self.assertRaises(tl.ViolationError) as caught:
            a.raise_for_violation()
        self.assertEqual(str(pickle.loads(pickle.dumps(caught.exception))), str(caught.exception))
        self.assertEqual(pickle.loads(pickle.dumps(short())).sha256, short().sha256)
        sim = tl.Simulation(short())
        other = copy.copy(sim)
        other.step()
        self.assertEqual((sim.steps, other.steps), (0, 1))

    @unittest.skipUnless(sys.platform == "linux", "processes are forked there")
    def test_a_forked_process_flies_a_large_swarm(self) -> None:
        large = tl.Scenario("thousand", set={"time.duration_s": 0.02, "arrival.hold_s": 0.0})
        steps = len(tl.fly(large).t)
        with multiprocessing.get_context("fork").Pool(1) as pool:
            self.assertEqual(pool.apply_async(instants, (large,)).get(timeout=120), steps)

    @unittest.skipUnless(sys.platform == "linux", "processes are forked there")
    def test_a_forked_process_compares_a_large_swarm_in_several_threads(self) -> None:
        shared = {"law.kind": "edge-tension", "graph.kind": "complete", "formation.assignment": "given"}
        large = tl.Scenario("thousand", set={"time.duration_s": 0.02, "arrival.hold_s": 0.0, **shared})
        tl.check(large)
        with multiprocessing.get_context("fork").Pool(1) as pool:
            self.assertEqual(pool.apply_async(answers, (large,)).get(timeout=120), [1, 1, 1])


def instants(scenario: tl.Scenario) -> int:
    return len(tl.fly(scenario).t)


def answers(scenario: tl.Scenario) -> list[int]:
    tl.check(scenario)
    with ThreadPoolExecutor() as threads:
        return list(threads.map(lambda _: tl.compare(scenario, ["edge-tension"], runs=1).runs, range(3)))


if __name__ == "__main__":
    unittest.main()
