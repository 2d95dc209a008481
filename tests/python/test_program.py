"""Tests of the command line in the package, and of its commands as functions."""

import inspect
import json
import os
import re
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np
import tautline as tl
from shared import ROOT, Case, passing, short
from tautline import _arguments

SPEC = """\
scenario = "pentagon"
runs = {runs}
seed = 5
[set]
time.duration_s = 2.0
[vary]
"start.jitter_m" = {{ uniform = [0.0, 0.3] }}
"""


def tautline(*words: object, **options) -> subprocess.CompletedProcess[str]:
    """Runs the command that the package installs."""
    command = [str(Path(sys.executable).with_name("tautline")), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, **options)


class Command(Case):
    def test_the_installed_command_has_the_programs_exit_codes(self) -> None:
        t, p = passing()
        np.savez(self.folder / "p.npz", t=t, positions=p)
        for code, words in (
            (0, ["--version"]),
            (0, ["audit", self.folder / "p.npz", "--delta", "0.4"]),
            (1, ["audit", self.folder / "p.npz", "--delta", "1.5"]),
            (2, ["audit", self.folder / "none.npz", "--delta", "1.5"]),
            (2, ["bogus"]),
            (2, ["export", self.folder / "p.npz", "-o", self.folder / "none" / "p.csv"]),
        ):
            self.assertEqual(tautline(*words).returncode, code, words)

    def test_the_command_runs_as_a_module_and_pages_show_it(self) -> None:
        t, p = passing()
        np.savez(self.folder / "p.npz", t=t, positions=p)
        words = [sys.executable, "-m", "tautline", "audit", "p.npz", "--delta", "0.4", "--html", "a.html"]
        ran = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, check=False, timeout=300)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn("CLEAR if straight between samples", ran.stdout)
        self.assertIn("tautline audit p.npz --delta 0.4", (self.folder / "a.html").read_text())

    def test_python_has_every_option_of_the_command_line(self) -> None:
        options = set(re.findall(r"^ +(?:-., )?--([a-z-]+)", tautline("audit", "--help").stdout, re.MULTILINE))
        self.assertIn("max-gap", options)
        outputs = {"color", "json", "quiet", "junit", "events", "html", "figures", "summary", "annotations", "proof"}
        outputs |= {"allow-undecided", "no-config", "help", "open"}
        taken = {*inspect.signature(tl.audit).parameters, *inspect.signature(_arguments.read_options).parameters}
        taken |= {"from", "until", "input-format"} if {"from_s", "until_s", "format"} <= taken else set()
        missing = {name for name in options - outputs - taken if name.replace("-", "_") not in taken}
        self.assertEqual(missing, set())

    def test_functions_print_nothing(self) -> None:
        text = "import tautline as tl\n"
        text += "tl.compare('pentagon', ['laplacian'], runs=1, set={'time.duration_s': 2})\n"
        text += "tl.fly('pentagon', set={'time.duration_s': 2})"
        ran = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=300)
        self.assertEqual((ran.stdout, ran.stderr), ("", ""))

    def test_pandas_and_matplotlib_are_imported_on_use(self) -> None:
        text = "import sys, tautline\nassert not {'pandas', 'matplotlib'} & set(sys.modules)"
        subprocess.run([sys.executable, "-c", text], check=True, timeout=60)


class Functions(Case):
    def test_a_campaign_has_an_answer_and_a_table_and_is_repeatable(self) -> None:
        spec, out = self.folder / "spec.toml", self.folder / "out"
        spec.write_text(SPEC.format(runs=6))
        answer = tl.campaign(spec, out, worst=0)
        self.assertEqual((answer.runs, answer.laws[0].violated["of"] if "of" in answer.laws[0].violated else 6), (6, 6))
        self.assertEqual(answer.to_dict(), json.loads((out / "campaign.json").read_text()))
        self.assertEqual(len(answer.to_pandas()), 6)
        before = (out / "results.parquet").read_bytes()
        self.assertEqual(tl.campaign(spec, out, worst=0).to_dict(), answer.to_dict())
        self.assertEqual((out / "results.parquet").read_bytes(), before)

    def test_a_campaign_of_the_command_line_continues_in_python_and_back(self) -> None:
        program = ROOT / "target" / "debug" / "tautline"
        if not program.exists():
            self.skipTest(f"{program} is not built")
        spec, out, again = self.folder / "spec.toml", self.folder / "out", self.folder / "again"
        spec.write_text(SPEC.format(runs=4))

        def command(*words: object) -> subprocess.CompletedProcess[str]:
            line = [str(word) for word in (program, "campaign", *words)]
            return subprocess.run(line, capture_output=True, text=True, check=False)

        # Half of the flights by the program, the others and the merge in Python.
        command("plan", spec, "--out", out, "--shards", 2)
        self.assertEqual(command("shard", out, "--shard", 0).returncode, 0)
        before = next(out.glob("parts/*0.jsonl")).read_bytes()
        self.assertEqual(tl.campaign(spec, out, worst=0).runs, 4)
        self.assertEqual(next(out.glob("parts/*0.jsonl")).read_bytes(), before)
        # The other way, with more runs.
        tl.campaign(spec, again, worst=0)
        self.assertEqual((again / "results.parquet").read_bytes(), (out / "results.parquet").read_bytes())
        spec.write_text(SPEC.format(runs=6))
        ran = command("run", spec, "--out", again, "--worst", 0)
        self.assertIn("2 flights in", ran.stdout, ran.stderr)
        answer = tl.campaign(spec, again, worst=0)
        self.assertEqual((answer.runs, answer.intervals), (6, "confidence-sequence"))
        # Another campaign is refused.
        spec.write_text(SPEC.format(runs=6) + "\n")
        self.refuses(tl.Error, "the folder holds campaign", lambda: tl.campaign(spec, out, until_width=0.5, worst=0))

    def test_compare(self) -> None:
        answer = tl.compare(short(), ["edge-tension", "laplacian"], runs=3, html=self.folder / "c.html")
        self.assertEqual(answer.laws.to_pandas()["name"].tolist(), ["edge-tension", "laplacian"])
        self.assertEqual((answer.runs, answer["runs"], answer.laws[1].violated.of), (3, 3, 3))
        self.assertTrue(str(answer).startswith(answer.headline + "\n"), str(answer))
        self.assertTrue((self.folder / "c.html").exists())
        page = self.folder / "c.html"
        self.refuses(tl.Error, "exists", lambda: tl.compare(short(), ["laplacian"], runs=1, html=page))
        of_text = tl.compare(tl.Scenario.from_toml(short().to_toml()), ["laplacian"], runs=1)
        self.assertEqual(of_text.laws[0].name, "laplacian")

    def test_margin(self) -> None:
        found = tl.margin("pentagon", "time.duration_s", 2, 60, scan=2, halvings=1)
        self.assertEqual((found.key, found.turn and found.turn.holds_below), ("time.duration_s", False))
        self.assertFalse(found.probes[0].get("holds", False))

    def test_sweep(self) -> None:
        found = tl.sweep(short(), {"law.alpha": np.array([0.5, 1.0]), "law.delta_m": [1, 9]}, verdict="clear")
        self.assertEqual(found["grid"][1], {"key": "law.delta_m", "values": [1.0, 9.0]})
        self.assertEqual([point.refused for point in found.points], [0, 1, 0, 1])
        self.assertEqual(found.points[3].values, [1.0, 9.0])
        self.assertTrue(found.is_good)

    def test_attack(self) -> None:
        found = tl.attack(short(), start=0.1, flights=6, vary={"sensing.latency_s": (0.0, 0.1)})
        self.assertEqual(found["scenario"], json.loads(json.dumps(found.to_dict()))["scenario"])

    def test_check(self) -> None:
        found = tl.check("pentagon")
        self.assertAlmostEqual(found.certified_m, 2.055307, places=6)
        self.assertTrue(found.is_good)
        refused = tl.check("pentagon-collinear")
        self.assertFalse(refused.is_good)
        self.assertIn("start-on-line", [warning.code for warning in refused.warnings])
        self.assertEqual(found.to_dict()["vehicles"], found.vehicles)

    def test_scenarios(self) -> None:
        self.assertIn("pentagon", tl.scenarios())
        changes = {"start.positions_m.2.x": 9.2, "law.kind": "displacement", "graph": {"kind": "star"}}
        s = tl.Scenario("pentagon", set=changes)
        self.assertEqual((s.law, len(s), s.links.shape), ("displacement", 5, (4, 2)))
        self.assertEqual(tl.Scenario.from_toml(s.to_toml()).sha256, s.sha256)
        file = self.folder / "s.toml"
        file.write_text(s.to_toml())
        self.assertEqual(tl.Scenario(file).sha256, s.sha256)
        self.assertEqual(tl.fly(s, set={"time.duration_s": 2.0}).scenario.duration_s, 2.0)

    @unittest.skipUnless(os.environ.get("TAUTLINE_LONG"), "minutes: set TAUTLINE_LONG")
    def test_validate(self) -> None:
        self.assertTrue(tl.validate(self.folder / "validate").is_good)


class Recordings(Case):
    def test_exports_have_the_same_bits(self) -> None:
        f = tl.fly(short(), record=self.folder / "run.mcap")
        for format in ("csv", "parquet", "npz", "mcap"):
            file = self.folder / f"copy.{format}"
            tl.export(self.folder / "run.mcap", file)
            t, p = tl.read(file).to_numpy()
            np.testing.assert_array_equal(p, f.positions, format)
            np.testing.assert_array_equal(t, f.t, format)
        self.refuses(tl.Error, "exists", lambda: tl.export(self.folder / "run.mcap", self.folder / "copy.csv"))
        tl.export(self.folder / "run.mcap", self.folder / "copy.csv", overwrite=True)
        unknown = self.folder / "a.xyz"
        message = "has no extension of a known format"
        self.refuses(tl.Error, message, lambda: tl.export(self.folder / "run.mcap", unknown))

    def test_flights_for_drones_are_judged_after_their_encoding(self) -> None:
        t = np.arange(201) * 0.04
        p = np.zeros((201, 4, 3))
        p[:, :, 0] = 2.0 * np.arange(4)
        p[:, :, 1] = np.sin(t)[:, None]
        np.savez(self.folder / "pair.npz", t=t, positions=p)
        answer = tl.export(self.folder / "pair.npz", self.folder / "cf", to="crazyflie", delta=1.5, tolerance=0.02)
        assert answer is not None
        self.assertTrue(answer.is_good)
        self.assertIn("PROVED CLEAR", answer.verdict)
        self.assertLessEqual(answer.deviation["bound_m"], 0.02)
        self.assertAlmostEqual(answer.margin["margin"], 0.5, delta=0.04)
        self.assertEqual([vehicle["label"] for vehicle in answer["vehicles"]], ["1", "2", "3", "4"])
        self.assertEqual(tl.audit(self.folder / "cf", delta=1.5).verdict, "PROVED CLEAR")
        refused = tl.export(self.folder / "pair.npz", self.folder / "no.skyc", to="skyc", delta=2.5)
        assert refused is not None
        self.assertFalse(refused.is_good)
        self.assertIn("VIOLATION", refused.refusal)
        self.assertFalse((self.folder / "no.skyc").exists())
        unknown = lambda: tl.export(self.folder / "pair.npz", self.folder / "no", to="foo")  # noqa: E731
        self.refuses(tl.Error, "skyc", unknown)

    def test_a_rate_interpolates_except_across_gaps(self) -> None:
        file = self.folder / "a.csv"
        rows = [f"{0.1 * k:.1f},a,{k},0,0" for k in range(21) if not 8 < k < 13]
        file.write_text("t,id,x,y,z\n" + "\n".join(rows) + "\n")
        t, p = tl.read(file).to_numpy(hz=100)
        known = ~np.isnan(p[:, 0, 0])
        np.testing.assert_allclose(p[known, 0, 0], 10 * t[known], atol=1e-9)
        self.assertFalse(known[(t > 0.81) & (t < 1.29)].any())
        self.assertTrue(known[(t < 0.8) | (t > 1.31)].all())
        self.assertTrue((~np.isnan(tl.read(file).to_numpy(hz=100, max_gap_s=1.0)[1])).all())

    def test_curves_are_evaluated_and_have_no_rows(self) -> None:
        folder = self.folder / "figures"
        folder.mkdir()
        head = "duration," + ",".join(f"{axis}^{k}" for axis in ("x", "y", "z", "yaw") for k in range(8))
        for name, x in (("cf1", 0.0), ("cf2", 5.0)):
            piece = [2.0, x, 1.0, 0.5, *[0.0] * 5, *[0.0] * 24]
            (folder / f"{name}.csv").write_text(head + "\n" + ",".join(map(str, piece)) + "\n")
        recording = tl.read(folder)
        self.assertTrue(recording.has_curves)
        t, p = recording.to_numpy(hz=10)
        np.testing.assert_allclose(p[:, 0, 0], t + 0.5 * t**2, atol=1e-12)
        np.testing.assert_allclose(p[:, 1, 0], 5.0 + t + 0.5 * t**2, atol=1e-12)
        self.refuses(tl.Error, "hz=", lambda: recording.to_numpy())
        self.refuses(tl.Error, "no rows", lambda: recording.to_pandas())
        self.assertEqual(recording.audit(delta=1.0).verdict, "PROVED CLEAR")
        for hz, message in ((-1, "positive"), (float("nan"), "positive"), (1e12, "lower rate")):
            self.refuses(tl.Error, message, lambda hz=hz: recording.to_numpy(hz=hz))


if __name__ == "__main__":
    unittest.main()
