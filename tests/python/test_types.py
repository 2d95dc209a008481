"""Tests of types and docstrings: mypy passes, the stub equals the native module, public items have docstrings."""

import inspect
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
        right = "import tautline as tl\nx: float | None = tl.audit('a.csv', delta=1.5).separation_m\n"
        for code, text in ((1, wrong), (0, right)):
            ran = self.mypy("mypy", "--strict", "-c", text)
            self.assertEqual(ran.returncode, code, ran.stdout + ran.stderr)

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
