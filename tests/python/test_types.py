"""Tests of types and docstrings: mypy passes, the stub equals the native module, public items have docstrings."""

import inspect
import re
import subprocess
import sys
import unittest

import tautline as tl
from shared import ROOT


SETTINGS = str(ROOT / "python" / "pyproject.toml")


class Types(unittest.TestCase):
    def mypy(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Runs mypy in a folder from which the installed package is imported."""
        line = [sys.executable, "-m", *words]
        return subprocess.run(line, cwd=ROOT / "tests", capture_output=True, text=True, check=False, timeout=600)

    def test_the_package_passes_mypy(self) -> None:
        ran = self.mypy("mypy", "--config-file", SETTINGS, str(ROOT / "python" / "tautline"))
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)

    def test_the_stub_equals_the_native_module(self) -> None:
        ran = self.mypy("mypy.stubtest", "tautline._native", "--mypy-config-file", SETTINGS, "--ignore-disjoint-bases")
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)

    def test_mypy_checks_code_that_uses_the_package(self) -> None:
        wrong = "import tautline as tl\ntl.audit('a.csv', delta='1.5')\n"
        right = "import tautline as tl\nx: float | None = tl.audit('a.csv', delta=1.5).closest[0].lower\n"
        for code, text in ((1, wrong), (0, right)):
            ran = self.mypy("mypy", "--strict", "-c", text)
            self.assertEqual(ran.returncode, code, ran.stdout + ran.stderr)

    def test_mypy_finds_wrong_words_keywords_and_laws(self) -> None:
        law = """
import numpy as np, tautline as tl
from numpy.typing import NDArray
class Mine:
    def control(self, obs: tl.Observation, out: NDArray[np.float64]) -> None:
        out[:] = 0.0
class NoLaw:
    pass
"""
        right = [
            "tl.audit('a.csv', motion='linear', format='csv', fps=30).closest[0].indices",
            "tl.read('a.csv', duplicates='first', time_unit='ms').audit(delta=1.0, rules='none')",
            "tl.fly('pentagon', law=Mine()).audit(limit={'speed': 5.0})",
            "tl.compare('pentagon', ['orca', Mine()], overwrite=True).laws[0].violated.count + 1",
            "(tl.margin('pentagon', 'time.dt_s', 1, 2, law=Mine(), verdict='clear').turn or exit()).bracket[0] + 1.0",
            "tl.audit('a.csv').plot().axes, tl.sweep('pentagon', {'law.alpha': [1.0]}).to_pandas()",
            "tl.compare('pentagon').laws[0].min_median_m.value, list(tl.compare('pentagon').laws)",
            "dict(tl.fly('pentagon'))",
            "tl.audit(tl.read('a.csv').to_arrow(), delta=1.0), tl.audit(tl.fly('pentagon').closest, delta=1.0)",
            "tl.fly('pentagon').reasons[0].data.get('deepest'), tl.campaign('c.toml').laws[0].clear.low / 2",
            "tl.export('a.csv', 'b.skyb', to='skyb', overwrite=True)",
            "tl.audit([0.0, 1.0], [[[0.0, 0.0]], [[1.0, 1.0]]], delta=1.0)",
            "tl.Simulation.load(tl.Simulation('pentagon', law=Mine()).save(), law=Mine()).step([[0.0] * 3] * 5)",
        ]
        wrong = [
            "tl.audit('a.csv', motion='liner')",
            "tl.audit('a.csv', fromat='csv')",
            "tl.audit('a.csv', format='cvs')",
            "tl.read('a.csv', time_unit='m')",
            "tl.read('a.csv', fsp=30)",
            "tl.fly('pentagon', law=NoLaw())",
            "tl.fly('pentagon').audit(detla=1.0)",
            "tl.compare('pentagon', [NoLaw()])",
            "tl.compare('pentagon', force=True)",
            "tl.margin('pentagon', 'time.duration_s', 1, 2, verdict='won')",
            "tl.export('a.csv', 'b.skyb', to='sky')",
            "tl.read('a.csv').audit(rules='nothing')",
            "tl.audit('a.csv').closest[0].min_m",
            "tl.audit('a.csv').limits[0].closest.lower",
            "tl.compare('pentagon').laws[0].violated.shares",
            "tl.margin('pentagon', 'time.duration_s', 1, 2).turn.bracket",
            "tl.fly('pentagon').reasons[0].message",
        ]
        ran = self.mypy("mypy", "--strict", "-c", law + "\n".join(right))
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)
        ran = self.mypy("mypy", "--strict", "-c", law + "\n".join(wrong))
        before = len(law.splitlines())
        found = {int(number) - before for number in re.findall(r"<string>:(\d+): error", ran.stdout)}
        self.assertEqual(found, set(range(1, len(wrong) + 1)), ran.stdout)

    def test_public_items_have_docstrings(self) -> None:
        for name in tl.__all__:
            thing = getattr(tl, name)
            self.assertTrue(inspect.getdoc(thing), name)
            if inspect.isclass(thing) and thing.__module__.startswith("tautline"):
                for member, value in vars(thing).items():
                    if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                        self.assertTrue(inspect.getdoc(value), f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
