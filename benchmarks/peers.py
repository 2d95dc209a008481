"""Peers: packages of PyPI, each in a virtual environment of its own, and the processes that measure them."""

import dataclasses
import json
import os
import pathlib
import shutil
import subprocess
import sys
from typing import Any

from program import pin

HERE = pathlib.Path(__file__).resolve().parent

# Time for an installation [s]; jax takes about a minute.
INSTALL_S = 900.0


class Skipped(Exception):
    """A peer that cannot be measured here. The message is the reason."""


@dataclasses.dataclass(frozen=True)
class Environment:
    """Packages that one peer needs, the module that proves them present, and the licence of the peer."""

    name: str
    packages: tuple[str, ...]
    module: str
    licence: str


ENVIRONMENTS = {
    environment.name: environment
    for environment in (
        Environment("mujoco", ("mujoco", "numba", "numpy"), "mujoco, numba", "Apache-2.0"),
        Environment("pybullet", ("pybullet", "numba", "numpy"), "pybullet, numba", "zlib"),
        Environment("crazyflow", ("crazyflow",), "crazyflow", "MIT"),
        Environment("gym-pybullet-drones", ("gym-pybullet-drones",), "gym_pybullet_drones", "MIT"),
        Environment("tables", ("numpy", "scipy", "pandas", "polars"), "scipy, pandas, polars", "BSD-3-Clause, MIT"),
    )
}

# The peer that needs no package: this Python.
PLAIN = "plain Python"


class Peers:
    """The environments under a folder. A missing one is installed if `install` is set, else it is skipped."""

    def __init__(self, folder: pathlib.Path, install: bool) -> None:
        self.folder = folder
        self.install = install
        self.reasons: dict[str, str] = {}
        self.interpreters: dict[str, str] = {PLAIN: sys.executable}
        self.versions: dict[str, str] = {PLAIN: sys.version.split()[0]}

    def python(self, name: str) -> str:
        """Returns the interpreter of a peer. Raises `Skipped` with the reason if its packages are missing."""
        if name in self.interpreters:
            return self.interpreters[name]
        if name in self.reasons:
            raise Skipped(self.reasons[name])
        environment = ENVIRONMENTS[name]
        folder = self.folder / name
        interpreter = folder / "bin/python"
        if not self._imports(interpreter, environment):
            if not self.install:
                return self._skip(name, f"{name} is not installed under {shown(self.folder)}")
            self._install(folder, environment)
        self.versions[name] = self._versions(interpreter, environment)
        self.interpreters[name] = str(interpreter)
        return str(interpreter)

    def measure(self, name: str, task: dict[str, Any], limit_s: float = 600.0) -> dict[str, Any]:
        """Runs the script `task["script"]` of this folder in the environment of a peer, on one core.

        The script reads the task as JSON from standard input and writes its answer as JSON to standard output. Logs of
        its packages stay in the folder of the environments.
        """
        try:
            done = subprocess.run(
                [os.path.abspath(self.python(name)), str(HERE / task["script"])],
                input=json.dumps(task),
                cwd=self.folder if self.folder.is_dir() else None,
                env=os.environ | {"POLARS_MAX_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
                capture_output=True,
                text=True,
                timeout=limit_s,
                preexec_fn=pin,
            )
        except subprocess.TimeoutExpired:
            raise Skipped(f"{name} took longer than {limit_s:.0f} s") from None
        if done.returncode != 0:
            raise Skipped(f"{name} failed: {last_line(done.stderr)}")
        answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return answer

    def _install(self, folder: pathlib.Path, environment: Environment) -> None:
        name = environment.name
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        pip = [str(folder / "bin/pip"), "install", "--quiet", "--disable-pip-version-check", *environment.packages]
        try:
            for words in ([sys.executable, "-m", "venv", str(folder)], pip):
                done = subprocess.run(words, capture_output=True, text=True, timeout=INSTALL_S)
                if done.returncode != 0:
                    self._skip(name, f"{name} cannot be installed from PyPI: {last_line(done.stderr)}")
        except subprocess.TimeoutExpired:
            self._skip(name, f"{name} cannot be installed within {INSTALL_S:.0f} s")
        if not self._imports(folder / "bin/python", environment):
            self._skip(name, f"{name} was installed and cannot be imported")

    def _imports(self, interpreter: pathlib.Path, environment: Environment) -> bool:
        if not interpreter.exists():
            return False
        done = subprocess.run([str(interpreter), "-c", f"import {environment.module}"], capture_output=True)
        return done.returncode == 0

    def _versions(self, interpreter: pathlib.Path, environment: Environment) -> str:
        code = "import sys, importlib.metadata as m; print(', '.join(f'{p} {m.version(p)}' for p in sys.argv[1:]))"
        words = [str(interpreter), "-c", code, *environment.packages]
        return subprocess.run(words, capture_output=True, text=True).stdout.strip()

    def _skip(self, name: str, reason: str) -> str:
        self.reasons[name] = reason
        raise Skipped(reason)


def shown(folder: pathlib.Path) -> str:
    """Returns a folder relative to the root of the project, or its last part: a page names no machine."""
    try:
        return str(folder.resolve().relative_to(HERE.parent))
    except ValueError:
        return folder.name


def last_line(text: str) -> str:
    """Returns the last line of an error, without the notices of pip and without folders of this machine."""
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("[notice]")]
    return lines[-1][:160].replace(str(HERE.parent) + "/", "") if lines else "no message"
