"""Tests of laws in Python in studies: the same flights as alone, one thread, whole exceptions, honest certificates."""

import json
import os
import subprocess
import sys
import threading
import traceback
import unittest

import tautline as tl
from shared import Case, Springs, interrupted, printed_json, short

SPEC = """\
scenario = "pentagon"
runs = 4
[set]
time.duration_s = 1.0
[vary]
"start.jitter_m" = { uniform = [0.0, 0.3] }
"""


class Displacement:
    """The law `displacement` without its barrier: the sum of springs and dampers over all pairs. No base class."""

    def control(self, obs, out):
        error, v = obs.positions - obs.slots_m, obs.velocities
        out[:] = -(error - error.mean(axis=0)) - 2 * (v - v.mean(axis=0))


class Approach(tl.Law):
    """Pulls all vehicles to the origin, so that they violate."""

    def control(self, obs, out):
        out[:] = -obs.positions - 2 * obs.velocities


class Failing(tl.Law):
    """Raises after some calls."""

    def __init__(self, calls: int = 50) -> None:
        self.left = calls

    def control(self, obs, out):
        self.left -= 1
        if self.left < 0:
            raise LookupError("no policy")
        out[:] = 0.0


class Silent(tl.Law):
    """Writes no command."""

    def control(self, obs, out):
        pass


class Threads(tl.Law):
    """Keeps the threads that call it."""

    def __init__(self) -> None:
        self.threads = set()

    def control(self, obs, out):
        self.threads.add(threading.get_ident())
        out[:] = 0.0


class Studies(Case):
    def test_flights_of_a_study_are_those_of_fly(self) -> None:
        answer = tl.compare(short(), ["edge-tension", Springs()], runs=2, seed=3)
        self.assertEqual([law.name for law in answer.laws], ["edge-tension", "Springs"])
        self.assertEqual([law.kind for law in answer.laws], ["edge-tension", "external"])
        for flown in answer.laws[1].flights:
            sets = {"start.seed": flown.seed, "start.jitter_m": answer.jitter_m}
            alone = tl.fly(short(**sets), law=Springs())
            self.assertEqual(flown.state_hash, alone.report["run"]["state_hash"])
            self.assertEqual(flown.min_m, alone.separation_m)
        hashes = [[flight.state_hash for flight in law.flights] for law in answer.laws]
        self.assertNotEqual(*hashes)
        # The built-in law beside it flies as without it, and as the command line flies it.
        line = ["compare", "pentagon", "--laws", "edge-tension", "--runs", "2", "--seed", "3", "--json", "--quiet"]
        printed = printed_json([*line, "--set", "time.duration_s=2.0"])
        self.assertEqual([flight["state_hash"] for flight in printed["laws"][0]["flights"]], hashes[0])

    def test_an_equivalent_of_a_built_in_law_has_its_results(self) -> None:
        class Mean(tl.Law):
            """The law `laplacian` on the complete graph."""

            def control(self, obs, out):
                error, v = obs.positions - obs.slots_m, obs.velocities
                out[:] = -f1 * (error - error.mean(axis=0)) - f2 * (v - v.mean(axis=0))

        f1, f2 = 2.0, 3.0
        gains = {"law.f1_per_s2": f1, "law.f2_per_s": f2, "time.duration_s": 2.0}
        scenario = tl.Scenario("pentagon-laplacian", set=gains)
        answer = tl.compare(scenario, ["laplacian", Mean()], runs=3)
        own, other = answer.laws
        for one, two in zip(own.flights, other.flights, strict=True):
            self.assertAlmostEqual(one.min_m, two.min_m, places=9)
            self.assertAlmostEqual(one.path_length_m, two.path_length_m, places=9)
            self.assertEqual(one.outcome, two.outcome)
        f1 = 2.1
        [law] = tl.compare(scenario, [Mean()], runs=1).laws
        self.assertNotAlmostEqual(law.flights[0].path_length_m, own.flights[0].path_length_m, places=6)

    def test_nothing_is_proved_about_a_law_in_python(self) -> None:
        answer = tl.compare(short(), ["edge-tension", Springs()], runs=2)
        self.assertTrue(all(flight.certified_m is not None for flight in answer.laws[0].flights))
        self.assertTrue(all(flight.certified_m is None for flight in answer.laws[1].flights))
        both = tl.compare(short(), [Approach()], shield=True, runs=1)
        self.assertEqual([law.name for law in both.laws], ["Approach+bare", "Approach+shield"])
        bare, shielded = (law.flights[0] for law in both.laws)
        self.assertLess(bare.min_m, 2.0)
        self.assertIsNone(bare.certified_m)
        self.assertGreaterEqual(shielded.min_m, 2.0)
        self.assertIsNotNone(shielded.certified_m)

    def test_margins_sweeps_and_attacks_fly_it(self) -> None:
        law, s = Springs(), short()
        answer = tl.margin(s, "time.duration_s", 1.0, 2.0, law=law, scan=2, halvings=0, html=self.folder / "m.html")
        self.assertEqual(answer.external_law, "Springs")
        self.assertIsNone(tl.margin(s, "time.duration_s", 1.0, 2.0, scan=2, halvings=0).external_law)
        page = (self.folder / "m.html").read_text()
        self.assertIn("external law Springs", page)
        self.assertNotIn("tautline margin", page, "the command line cannot repeat it")
        probe = answer.probes[1].flights[0]
        self.assertEqual(probe.state_hash, tl.fly(s, law=law).report["run"]["state_hash"])
        swept = tl.sweep(s, {"time.duration_s": [1.0, 2.0]}, law=law)
        self.assertEqual((swept.external_law, swept.points[1].held.count), ("Springs", int(probe["pass"])))
        out = self.folder / "worst"
        found = tl.attack(s, start=0.1, flights=6, law=law, out=out)
        worst = found.progress[-1].flown
        report = json.loads((out / "report.json").read_text())
        self.assertEqual(report["run"]["state_hash"], worst.state_hash)
        self.assertEqual(tl.audit(out / "run.mcap").status, tl.audit(out / "run.mcap", independent=True).status)
        self.assertEqual(found.certified, 0)
        self.assertGreater(tl.attack(s, start=0.1, flights=6).certified, 0)

    def test_keys_of_the_replaced_law_are_refused(self) -> None:
        s = short()
        for do in (
            lambda: tl.margin(s, "law.alpha", 1, 2, law=Springs()),
            lambda: tl.sweep(s, {"law.alpha": [1, 2]}, law=Springs()),
            lambda: tl.attack(s, vary={"law.alpha": (1, 2)}, law=Springs(), flights=2),
        ):
            self.refuses(tl.Error, "law.alpha: changes no flight, because the law `Springs` replaces that", do)
        tl.sweep(s, {"law.delta_m": [1, 2]}, law=Springs())

    def test_an_exception_is_raised_again_and_writes_nothing(self) -> None:
        s, file = short(), self.folder / "a.csv"
        for do in (
            lambda: tl.compare(s, ["edge-tension", Failing()], runs=2, csv=file),
            lambda: tl.margin(s, "time.duration_s", 1, 2, law=Failing(), csv=file),
            lambda: tl.sweep(s, {"time.duration_s": [1, 2]}, law=Failing(), csv=file),
            lambda: tl.attack(s, start=0.1, flights=5, law=Failing(), csv=file),
        ):
            try:
                do()
            except LookupError as error:
                self.assertEqual(str(error), "no policy")
                self.assertEqual(traceback.extract_tb(error.__traceback__)[-1].name, "control")
            else:
                self.fail("no exception")
            self.assertFalse(file.exists())
        self.refuses(tl.Error, "the law Silent: step 0", lambda: tl.compare(s, [Silent()], runs=1))

    def test_it_runs_on_the_calling_thread(self) -> None:
        law = Threads()
        tl.compare(short(), [law, "laplacian"], runs=3)
        self.assertEqual(law.threads, {threading.get_ident()})
        message = "threads=4: must be 1 for the law `Threads`"
        self.refuses(tl.Error, message, lambda: tl.compare(short(), [law], runs=1, threads=4))
        tl.compare(short(), ["laplacian"], runs=2, threads=2)
        tl.compare(short(), [law], runs=1, threads=1)

    def test_wrong_laws_are_refused(self) -> None:
        s = short()

        class Named(Springs):
            name = "orca"

        class Plus(Springs):
            name = "a+shield"

        for kind, message, do in (
            (TypeError, "a law is needed, not the class Springs; give Springs(...)", lambda: tl.compare(s, [Springs])),
            (TypeError, "object has no method control", lambda: tl.compare(s, [object()])),
            (TypeError, "a list of names and laws is needed, not Springs", lambda: tl.compare(s, Springs())),
            (TypeError, "a list of names and laws is needed, not str", lambda: tl.compare(s, "orca")),
            (TypeError, "int has no method control", lambda: tl.margin(s, "time.duration_s", 1, 2, law=3)),
            (tl.Error, "`Springs` is named twice", lambda: tl.compare(s, [Springs(), Springs()])),
            (tl.Error, "`orca` is the name of a built-in law", lambda: tl.compare(s, [Named()])),
            (tl.Error, "`orca` is the name of a built-in law", lambda: tl.attack(s, start=0.1, law=Named())),
            (tl.Error, "must not be empty or contain `+` or `,`", lambda: tl.compare(s, [Plus()])),
        ):
            self.refuses(kind, message, do)

    def test_a_law_needs_no_base_class(self) -> None:
        law: tl.ControlLaw = Displacement()
        self.assertTrue(tl.fly(short(), law=law).status)

    def test_a_signal_ends_a_study(self) -> None:
        code = """
import os, signal, threading, time
import tautline as tl
class Slow(tl.Law):
    def control(self, obs, out):
        out[:] = 0.0
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    tl.compare("pentagon", [Slow(), "edge-tension"], runs=100000)
except KeyboardInterrupt:
    print("interrupted")
"""
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual((ran.stdout, ran.returncode), ("interrupted\n", 0), ran.stderr)


    @unittest.skipUnless(os.name == "posix", "only systems with signals")
    def test_ctrl_c_ends_a_validation_without_files(self) -> None:
        # The whole validation takes minutes.
        out = self.folder / "validation"
        code = f"interruptible(lambda: tl.validate({str(out)!r}))"
        self.assertEqual(interrupted(code), ["interrupted"])
        self.assertFalse((out / "validate.json").exists())


class Campaigns(Case):
    def setUp(self) -> None:
        super().setUp()
        self.spec, self.out = self.folder / "spec.toml", self.folder / "camp"
        self.spec.write_text(SPEC)

    def test_a_campaign_flies_it_and_continues_after_an_exception(self) -> None:
        class Springs2(Springs):
            name = "mine"
            left = 700

            def control(self, obs, out):
                type(self).left -= 1
                if type(self).left == 0:
                    raise LookupError("no policy")
                super().control(obs, out)

        with self.assertRaises(LookupError):
            tl.campaign(self.spec, self.out, law=Springs2(), worst=0)
        self.assertFalse((self.out / "campaign.json").exists())
        answer = tl.campaign(self.spec, self.out, law=Springs2(), worst=1)
        self.assertEqual([law.name for law in answer.laws], ["mine"])
        whole = tl.campaign(self.spec, self.folder / "whole", law=Springs2(), worst=0)
        self.assertEqual(answer.to_pandas()["state_hash"].tolist(), whole.to_pandas()["state_hash"].tolist())
        self.assertTrue(answer.to_pandas()["certified_m"].isna().all())
        [worst] = answer.laws[0].worst[:1]
        report = json.loads((self.out / "worst" / f"mine-run-{worst.run}" / "report.json").read_text())
        self.assertEqual(report["run"]["state_hash"], worst.state_hash)
        self.assertNotIn("tautline campaign run", (self.out / "campaign.html").read_text())

    def test_only_the_same_law_continues(self) -> None:
        tl.campaign(self.spec, self.out, law=Springs(), worst=0)
        self.refuses(tl.Error, "the folder holds campaign", lambda: tl.campaign(self.spec, self.out, worst=0))
        self.refuses(
            tl.Error, "the folder holds campaign", lambda: tl.campaign(self.spec, self.out, law=Approach(), worst=0)
        )
        line = [sys.executable, "-m", "tautline", "campaign", "merge", str(self.out)]
        ran = subprocess.run(line, capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 2)
        self.assertIn(f"{self.out}: the campaign flies `Springs`", ran.stderr)

    def test_splitting_laws_and_keys_of_the_law_are_refused(self) -> None:
        for message, more in (
            ("laws: must not be given with an external law", 'laws = ["orca"]\n'),
            ("splitting copies flights under way", 'method = "splitting"\n'),
        ):
            self.spec.write_text(more + SPEC)
            self.refuses(tl.Error, message, lambda: tl.campaign(self.spec, self.out, law=Springs(), worst=0))
        self.spec.write_text(SPEC + '"law.alpha" = { uniform = [1.0, 2.0] }\n')
        self.refuses(
            tl.Error, "law.alpha: changes no flight", lambda: tl.campaign(self.spec, self.out, law=Springs(), worst=0)
        )
        self.assertFalse(self.out.exists())


if __name__ == "__main__":
    unittest.main()
