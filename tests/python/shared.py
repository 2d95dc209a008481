"""Helpers of the tests of the Python package."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import unittest
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tautline as tl

ROOT = Path(__file__).resolve().parents[2]


def passing(instants: int = 100) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns times (T,) and positions (T, 4, 3) of vehicles 3 m apart; vehicle 1 comes within 0.5 m of vehicle 2."""
    t = np.arange(instants) * 0.1
    p = np.zeros((instants, 4, 3))
    p[:, :, 0] = 3.0 * np.arange(4)
    p[:, 0, 0] = np.linspace(0.0, 2.5, instants)
    return t, p


def short(name: str = "pentagon", **sets: object) -> tl.Scenario:
    """Returns a built-in scenario with a duration of two seconds."""
    return tl.Scenario(name, set={"time.duration_s": 2.0, **sets})


def printed_json(words: list[str]) -> dict:
    """Returns what the command line prints as JSON."""
    ran = subprocess.run([sys.executable, "-m", "tautline", *words], capture_output=True, check=False)
    return json.loads(ran.stdout)


# Calls `do` and reports on standard output: `busy` once it has taken processor time, then how it ended.
_INTERRUPTIBLE = """
import signal, threading, time
import numpy as np
import tautline as tl
signal.signal(signal.SIGINT, signal.default_int_handler)
def interruptible(do):
    def watch():
        begin_s = time.process_time()
        while time.process_time() - begin_s < 0.3:
            time.sleep(0.005)
        print("busy", flush=True)
    threading.Thread(target=watch, daemon=True).start()
    try:
        do()
        print("finished")
    except KeyboardInterrupt:
        print("interrupted")
"""


def interrupted(code: str, within_s: float = 60.0) -> list[str]:
    """Runs code in a child process, sends SIGINT once its call of ``interruptible`` is busy, and returns the lines that
    it prints from then on. Raises ``TimeoutExpired`` unless the child ends within a time after the signal [s]."""
    command = [sys.executable, "-c", _INTERRUPTIBLE + code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        try:
            first = child.stdout.readline() if child.stdout else ""
            child.send_signal(signal.SIGINT)
            rest, _ = child.communicate(timeout=within_s)
        except BaseException:
            child.kill()
            raise
    return [first.strip(), *rest.split("\n")[:-1]][1:] if first == "busy\n" else [first.strip(), *rest.split("\n")]


class Case(unittest.TestCase):
    """A test with a temporary folder."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def refuses(self, kind: type[BaseException], message: str, do: Callable[[], object]) -> None:
        """Asserts that an error of exactly this class is raised whose message contains a text."""
        with self.assertRaises(kind) as caught:
            do()
        self.assertIs(type(caught.exception), kind)
        self.assertIn(message, str(caught.exception))


class Springs(tl.Law):
    """Pulls every vehicle to its slot."""

    def control(self, obs, out):
        out[:] = obs.slots_m - obs.positions - 2 * obs.velocities
