"""Files that pages use but do not create."""

from __future__ import annotations

import shutil
import tempfile
import unittest
from pathlib import Path

from commands import TAUTLINE, run
from pages import ROOT

PENTAGON = "tautline run pentagon --out out/pentagon --quiet"
FLIGHT = "tautline run pentagon --set time.duration_s=10 --out out/short --quiet --no-figures --no-snapshots"

# Page: files that it needs.
NEEDED_BY = {
    "docs/checkable-proofs.md": ["check_proof.py"],
    "docs/ci.md": ["flights"],
    "docs/viewer.md": ["out/pentagon", "flight.csv"],
}

# File or folder: commands that create it. Exit code 1 is allowed: a flight of 10 s does not reach its formation.
MADE_BY = {
    "check_proof.py": [f"cp {ROOT}/python/tautline/check_proof.py ."],
    "out/pentagon": [PENTAGON],
    "flight.csv": [FLIGHT, "tautline export out/short -o flight.csv"],
    "flights": [
        FLIGHT,
        "mkdir flights",
        "printf '[audit]\\ndelta_m = 0.5\\n' > flights/tautline.toml",
        "tautline export out/short -o flights/monday.csv",
        "cp flights/monday.csv flights/tuesday.csv",
    ],
}


class Fixtures:
    """Files that are created once, for the first page that needs them."""

    def __init__(self) -> None:
        self._place = tempfile.TemporaryDirectory(prefix="tautline-docs-")
        unittest.addModuleCleanup(self._place.cleanup)
        self.root = Path(self._place.name)
        self.programs = self.root / "bin"
        self.programs.mkdir()
        (self.programs / "tautline").symlink_to(TAUTLINE)

    def folder(self, page: str) -> Path:
        """Returns a new folder for a page, with its files and the examples."""
        folder = Path(tempfile.mkdtemp(dir=self.root))
        shutil.copytree(ROOT / "examples", folder / "examples")
        for name in NEEDED_BY.get(page, []):
            self._copy(self._made(name), folder / name)
        return folder

    def _made(self, name: str) -> Path:
        home = self.root / "made" / name.replace("/", "-")
        if not home.exists():
            home.mkdir(parents=True)
            for command in MADE_BY[name]:
                ran = run(command, home, self.programs)
                if ran.exit_code not in (0, 1):
                    raise RuntimeError(f"{name} cannot be made: {command}\n{ran.output}")
        return home / name

    @staticmethod
    def _copy(made: Path, to: Path) -> None:
        to.parent.mkdir(parents=True, exist_ok=True)
        if made.is_dir():
            shutil.copytree(made, to)
        else:
            shutil.copy(made, to)
