"""Campaigns from Python: laws that processes import, folders with shards, dictionaries, and progress."""

import concurrent.futures
import multiprocessing
import os
import signal
import subprocess
import sys
import time
import unittest
from collections.abc import Callable

from shared import ROOT, Case, Springs

import tautline as tl

#: A law whose commands depend on its memory, and one that fails.
LAWS = """\
import tautline as tl

class Counting(tl.Law):
    def __init__(self):
        self.calls = 0

    def control(self, obs, out):
        self.calls += 1
        out[:] = obs.slots_m - obs.positions - 2 * obs.velocities + 1e-3 * self.calls

class Failing(tl.Law):
    def control(self, obs, out):
        if obs.t > 0.5:
            raise RuntimeError("no idea")
        out[:] = 0

class Bare(tl.Law):
    def __init__(self, gain):
        pass

def make():
    return Counting()

two = 2
"""


def spec(runs: int = 12, **more: object) -> dict[str, object]:
    """Returns the specification of a short campaign."""
    vary = {"start.jitter_m": {"uniform": [0.0, 0.3]}}
    return {"scenario": "pentagon", "runs": runs, "set": {"time.duration_s": 1.0}, "vary": vary, **more}


class Processes(Case):
    def setUp(self) -> None:
        super().setUp()
        self.laws = self.folder / "processes_laws.py"
        self.laws.write_text(LAWS, encoding="utf-8")
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        self.addCleanup(sys.path.__setitem__, slice(None), list(sys.path))
        self.addCleanup(sys.modules.pop, "processes_laws", None)

    def files(self, name: str) -> list[bytes]:
        return [(self.folder / name / file).read_bytes() for file in ("results.parquet", "campaign.json")]

    def run_program(self, *words: object, **more: str) -> "subprocess.CompletedProcess[str]":
        line = [sys.executable, "-m", "tautline", *map(str, words)]
        return subprocess.run(line, capture_output=True, text=True, check=False, env={**os.environ, **more})

    def test_the_answer_is_the_same_for_any_number_of_processes_and_shards(self) -> None:
        law, seen = "processes_laws:Counting", []
        one = tl.campaign(spec(), "a/camp", law=law, threads=1, worst=1, progress=lambda *now: seen.append(now))
        tl.campaign(spec(), "b/camp", law=law, threads=2, shards=5, worst=0)
        self.assertEqual(self.files("a/camp"), self.files("b/camp"))
        self.assertEqual((one.laws[0].name, one.runs, seen), (law, 12, [(12, 12)]))
        # By the command line, with the number of a task of Slurm.
        text = 'scenario = "pentagon"\nruns = 12\nset = {"time.duration_s" = 1.0}\n'
        text += 'vary = {"start.jitter_m" = {uniform = [0.0, 0.3]}}\n'
        (self.folder / "camp.toml").write_text(text)
        planned = self.run_program("campaign", "plan", "camp.toml", "--python-law", law, "--shards", 2, "-o", "c/camp")
        self.assertEqual(planned.returncode, 0, planned.stderr)
        for task in "01":
            words = "campaign", "shard", "c/camp", "--shard", "env:SLURM_ARRAY_TASK_ID"
            flown = self.run_program(*words, SLURM_ARRAY_TASK_ID=task)
            self.assertEqual(flown.returncode, 0, flown.stderr)
        self.assertEqual(tl.CampaignFolder("c/camp").missing(), [])
        self.assertEqual(self.run_program("campaign", "merge", "c/camp", "--worst", 0).returncode, 0)
        self.assertEqual(self.files("c/camp")[0], self.files("a/camp")[0])

    def test_a_function_makes_the_law_of_each_flight(self) -> None:
        tl.campaign(spec(3), "a/camp", law="processes_laws:make", shards=1, worst=0)
        tl.campaign(spec(3), "b/camp", law="processes_laws:make", shards=3, worst=0)
        self.assertEqual(self.files("a/camp"), self.files("b/camp"))

    def test_another_file_of_the_law_is_refused(self) -> None:
        plan = tl.CampaignFolder.plan(spec(), "camp", law="processes_laws:Counting")
        plan.fly(0)
        self.laws.write_text(LAWS + "# changed\n", encoding="utf-8")
        changed = "the source of the law `processes_laws:Counting` has the SHA-256"
        self.refuses(tl.Error, changed, lambda: tl.CampaignFolder("camp"))
        self.assertEqual(self.run_program("campaign", "merge", "camp").returncode, 2)

    def test_a_module_that_changes_in_a_session_flies_as_it_is_in_its_file(self) -> None:
        sys.path.insert(0, str(self.folder))
        import processes_laws

        self.assertEqual(processes_laws.two, 2)
        changed = LAWS.replace("1e-3 * self.calls", "2e-3 * self.calls")
        tl.campaign(spec(3), "a/camp", law="processes_laws:Counting", shards=1, worst=0)
        self.laws.write_text(changed, encoding="utf-8")
        plan = tl.CampaignFolder.plan(spec(3), "b/camp", law="processes_laws:Counting", shards=3)
        plan.fly(0)
        plan.fly_in_processes()
        plan.merge(worst=0)
        with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            pool.submit(tl.campaign, spec(3), "c/camp", law="processes_laws:Counting", worst=0).result(timeout=120)
        self.assertEqual(self.files("b/camp"), self.files("c/camp"))
        self.assertNotEqual(self.files("a/camp"), self.files("b/camp"))

    def test_a_process_without_a_result_is_found(self) -> None:
        self.laws.write_text(LAWS.replace('raise RuntimeError("no idea")', "__import__('os')._exit(0)"))
        law = "processes_laws:Failing"
        message = "their processes ended without a result"
        self.refuses(tl.Error, message, lambda: tl.campaign(spec(), "-camp", law=law, threads=2, worst=0))

    def test_the_program_without_python_names_the_one_that_flies_it(self) -> None:
        program = ROOT / "target" / "debug" / "tautline"
        tl.CampaignFolder.plan(spec(), "camp", law="processes_laws:Counting")
        ran = subprocess.run([program, "campaign", "missing", "camp"], capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 2)
        # It is another build, or has no laws in Python.
        self.assertRegex(ran.stderr, "python -m tautline campaign|planned by")
        (self.folder / "camp.toml").write_text('scenario = "pentagon"\nruns = 12\n')
        words = "campaign", "plan", "camp.toml", "--python-law", "a:B", "--out", "c"
        ran = subprocess.run([program, *words], capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 2)
        self.assertIn("--python-law a:B: this program cannot import laws in Python", ran.stderr)
        self.assertFalse((self.folder / "c").exists())

    def test_an_exception_of_the_law_ends_the_campaign_with_its_traceback(self) -> None:
        with self.assertRaises(tl.Error) as caught:
            tl.campaign(spec(), "camp", law="processes_laws:Failing", threads=2, shards=4, worst=0)
        self.assertRegex(str(caught.exception), r"shard \d in a process of its own: (?s:.*)RuntimeError: no idea")
        self.assertFalse((self.folder / "camp" / "campaign.json").exists())
        self.refuses(RuntimeError, "no idea", lambda: tl.CampaignFolder("camp").fly(0))

    def test_wrong_names_and_folders_are_refused(self) -> None:
        for name, kind, message in (
            ("processes_laws", tl.Error, "MODULE:CLASS is needed"),
            ("processes_laws:", tl.Error, "MODULE:CLASS is needed"),
            ("processes_laws:Nope", tl.Error, "processes_laws has no Nope"),
            ("processes_laws:two", tl.Error, "must be a class"),
            ("processes_laws:Bare", TypeError, "gain"),
            ("no_such_module:Law", ModuleNotFoundError, "no_such_module"),
            ("sys:exit", tl.Error, "has no file"),
            ("__main__:Law", tl.Error, "cannot import a script"),
        ):
            with self.subTest(name=name):
                self.refuses(kind, message, lambda name=name: tl.campaign(spec(), "camp", law=name))
                self.assertFalse((self.folder / "camp").exists())
        self.refuses(tl.Error, "out: missing beside a dictionary", lambda: tl.campaign(spec()))
        self.refuses(TypeError, "MODULE:CLASS", lambda: tl.CampaignFolder.plan(spec(), "camp", law=Springs()))
        self.refuses(tl.Error, "no such campaign", lambda: tl.CampaignFolder("nowhere"))
        plan = tl.CampaignFolder.plan(spec(), "camp", shards=3)
        self.assertEqual((plan.path.name, plan.runs, plan.shards, plan.law), ("camp", 12, 3, None))
        self.refuses(tl.Error, "shards: must be below 3, got 3", lambda: plan.fly([0, 3]))
        self.refuses(tl.Error, "2 of 3 shards are missing", lambda: plan.fly(1) or plan.merge())

    @unittest.skipUnless(os.name == "posix", "sends a signal")
    def test_processes_end_with_the_one_that_started_them(self) -> None:
        # Each shard would fly for minutes.
        given = f"{spec(200_000)!r}, 'camp', law='processes_laws:Counting', threads=2, shards=2"
        code = f"import tautline as tl; tl.campaign({given})"
        pattern = f"tautline._shard_process {self.folder}"
        listed = lambda: subprocess.run(["pgrep", "-f", pattern], capture_output=True, text=True).stdout  # noqa: E731
        with subprocess.Popen([sys.executable, "-c", code]) as running:
            self.wait(lambda: len(listed().split()) == 2)
            running.kill()
        self.wait(lambda: listed() == "", 20)

    def wait(self, what: Callable[[], bool], within_s: float = 60) -> None:
        end_s = time.monotonic() + within_s
        while not what():
            self.assertLess(time.monotonic(), end_s)
            time.sleep(0.05)

    @unittest.skipUnless(os.name == "posix", "sends a signal")
    def test_ctrl_c_ends_all_processes_and_keeps_their_flights(self) -> None:
        script = self.folder / "campaign.py"
        script.write_text(
            "import signal\nimport tautline as tl\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
            f"tl.campaign({spec(4000)!r}, 'camp', law='processes_laws:Counting', threads=2, shards=2, worst=0)\n"
        )
        journals = lambda: list((self.folder / "camp" / "parts").glob("*.journal*"))  # noqa: E731
        with subprocess.Popen([sys.executable, script], stderr=subprocess.PIPE, text=True) as running:
            end_s = time.monotonic() + 60
            while sum(file.stat().st_size > 2000 for file in journals()) < 2:
                self.assertLess(time.monotonic(), end_s)
                self.assertIsNone(running.poll())
                time.sleep(0.02)
            running.send_signal(signal.SIGINT)
            _, words = running.communicate(timeout=60)
        self.assertTrue(words.rstrip().endswith("KeyboardInterrupt"), words)
        left = subprocess.run(["pgrep", "-f", f"tautline._shard_process {self.folder}"], capture_output=True, text=True)
        self.assertEqual(left.stdout, "")
        self.assertTrue(all(file.stat().st_size > 2000 for file in journals()))


class Dictionaries(Case):
    def test_a_dictionary_is_its_file(self) -> None:
        file = self.folder / "camp.toml"
        text = 'scenario = "pentagon"\nruns = 4\nlaws = ["edge-tension", "laplacian"]\n[set]\ntime.duration_s = 1.0\n'
        file.write_text(text + '[vary]\n"start.jitter_m" = { uniform = [0.0, 0.3] }\n')
        of_file = tl.campaign(file, self.folder / "a" / "camp", worst=0)
        given = spec(4, laws=["edge-tension", "laplacian"])
        of_dictionary = tl.campaign(given, self.folder / "b" / "camp", worst=0)
        self.assertEqual(of_file.to_dict()["laws"], of_dictionary.to_dict()["laws"])
        self.assertTrue(of_file.to_pandas().equals(of_dictionary.to_pandas()))
        self.refuses(tl.Error, "unknown", lambda: tl.campaign({**given, "rums": 3}, self.folder / "c"))
        self.refuses(TypeError, "a value of TOML", lambda: tl.campaign({**given, "seed": object()}, self.folder / "c"))


class Progress(Case):
    def test_every_study_reports_its_progress(self) -> None:
        short = {"time.duration_s": 1.0}
        for name, study in (
            ("compare", lambda tell: tl.compare("pentagon", ["laplacian"], runs=3, set=short, progress=tell)),
            ("sweep", lambda tell: tl.sweep("pentagon", {"law.alpha": [1, 2]}, set=short, progress=tell)),
            ("margin", lambda tell: tl.margin("pentagon", "law.alpha", 1, 2, scan=2, set=short, progress=tell)),
            ("attack", lambda tell: tl.attack("pentagon", start=0.1, flights=5, set=short, progress=tell)),
            ("campaign", lambda tell: tl.campaign(spec(), self.folder / "a", worst=0, progress=tell)),
            ("law", lambda tell: tl.campaign(spec(), self.folder / "b", law=Springs(), worst=0, progress=tell)),
            ("shard", lambda tell: tl.CampaignFolder.plan(spec(), self.folder / "c").fly(0, progress=tell)),
        ):
            with self.subTest(study=name):
                seen: list[tuple[int, int | None]] = []
                study(lambda done, total, seen=seen: seen.append((done, total)))
                self.assertTrue(seen)
                done, total = seen[-1]
                self.assertEqual([now for now, _ in seen], sorted(now for now, _ in seen))
                # A search may need fewer flights than its most.
                self.assertTrue(total is None or (done <= total if name == "margin" else done == total), seen[-1])

    def test_an_exception_of_the_function_ends_the_study(self) -> None:
        def stop(done: int, total: int | None) -> None:
            raise ZeroDivisionError("enough")

        many = spec(100_000)
        for name, law in (("a", None), ("b", Springs())):
            began_s = time.monotonic()
            given = {"out": self.folder / name, "law": law, "progress": stop}
            self.refuses(ZeroDivisionError, "enough", lambda given=given: tl.campaign(many, **given))
            self.assertLess(time.monotonic() - began_s, 30)
        self.refuses(TypeError, "progress: True, a function or None", lambda: tl.compare("pentagon", progress=3))

    def test_true_is_a_bar(self) -> None:
        code = "import tautline as tl; tl.compare('pentagon', ['laplacian'], runs=2, progress=True)"
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn("100%|", ran.stderr)
        code = "import sys; sys.modules['tqdm'] = sys.modules['tqdm.auto'] = None; " + code
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertIn("ImportError: progress=True needs tqdm: pip install tqdm", ran.stderr)


if __name__ == "__main__":
    unittest.main()
