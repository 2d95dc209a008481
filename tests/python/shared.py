"""Helpers of the tests of the Python package."""

from __future__ import annotations

import json
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
