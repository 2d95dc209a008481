"""Tests that the code of the pages on Python runs."""

import os
import re

from shared import ROOT, Case, passing

#: Pages, each with a number of blocks that it exceeds.
PAGES = {"python": 8, "learning": 1}


class Session(Case):
    def test_every_block_of_python_on_the_pages_runs(self) -> None:
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        for page, many in PAGES.items():
            text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
            blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
            self.assertGreater(len(blocks), many)
            t, p = passing()
            names = {"t": t, "p": p}
            for number, block in enumerate(blocks, 1):
                with self.subTest(page=page, block=number):
                    exec(compile(block, f"docs/{page}.md, block {number}", "exec"), names)

    def test_a_session_with_the_whole_interface(self) -> None:
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        spec = 'scenario = "pentagon"\nruns = 4\n[set]\ntime.duration_s = 2.0\n'
        spec += '[vary]\n"start.jitter_m" = { uniform = [0.0, 0.2] }\n'
        (self.folder / "spec.toml").write_text(spec)
        import numpy as np, tautline as tl  # noqa: E401
        t, p = passing()
        a = tl.audit(t, p, delta=1.5)
        a.verdict, a.separation_m, a.closest[0].pair, a.violations.to_pandas(), a.to_dict(), a.to_html("a.html")
        with self.assertRaises(tl.ViolationError):
            a.raise_for_violation()
        s = tl.Scenario("pentagon", set={"time.duration_s": 60})
        f = tl.fly(s, record="run.mcap")
        f.t, f.positions, f.velocities, f.report
        class Springs(tl.Law):
            def __init__(self, slots): self.slots = slots  # noqa: E704
            def control(self, obs, out): out[:] = self.slots - obs.positions - 2 * obs.velocities  # noqa: E704
        tl.fly(s, law=Springs(s.slots_m))
        u = np.zeros((len(s), 3))
        sim = tl.Simulation(s); sim.step(u); sim.positions, sim.separation_m  # noqa: E702
        self.assertGreater(tl.check(s).certified_m, 2.0)
        t, p = tl.read("run.mcap").to_numpy(hz=50)
        self.assertEqual(p.shape, (60 * 50 + 1, 5, 3))
        self.assertEqual(tl.campaign("spec.toml").runs, 4)
        self.assertTrue(f.passed)
        self.assertTrue((self.folder / "a.html").read_text().startswith("<!DOCTYPE html>"))
