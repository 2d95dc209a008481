"""Types: the package passes mypy, its stub is what the native module is, and everything public says what it is."""

import inspect
import subprocess
import sys
import unittest

import tautline as tl
from shared import ROOT


SETTINGS = str(ROOT / "python" / "pyproject.toml")


class Types(unittest.TestCase):
    def mypy(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Runs mypy where the package is found as a user's code finds it: installed."""
        line = [sys.executable, "-m", *words]
        return subprocess.run(line, cwd=ROOT / "tests", capture_output=True, text=True, check=False, timeout=600)

    def test_the_package_passes_mypy(self) -> None:
        ran = self.mypy("mypy", "--config-file", SETTINGS, str(ROOT / "python" / "tautline"))
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)

    def test_the_stub_is_what_the_native_module_is(self) -> None:
        ran = self.mypy("mypy.stubtest", "tautline._native", "--mypy-config-file", SETTINGS, "--ignore-disjoint-bases")
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)

    def test_a_users_code_is_checked(self) -> None:
        wrong = "import tautline as tl\ntl.audit('a.csv', delta='1.5')\n"
        right = "import tautline as tl\nx: float | None = tl.audit('a.csv', delta=1.5).separation_m\n"
        for code, text in ((1, wrong), (0, right)):
            ran = self.mypy("mypy", "--strict", "-c", text)
            self.assertEqual(ran.returncode, code, ran.stdout + ran.stderr)

    def test_everything_public_says_what_it_is(self) -> None:
        for name in tl.__all__:
            thing = getattr(tl, name)
            self.assertTrue(inspect.getdoc(thing), name)
            if inspect.isclass(thing) and thing.__module__.startswith("tautline"):
                for member, value in vars(thing).items():
                    if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                        self.assertTrue(inspect.getdoc(value), f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
