"""Scenarios: what is to be flown, complete and checked."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._native import Error
from ._tables import Findings
from ._words import PathLike, by_name, with_files


class Scenario:
    """A scenario: the name of a built-in one, a file, or TOML (:meth:`from_toml`).

    ``set`` overrides any key, as ``--set`` of the command line does: ``Scenario("pentagon", set={"time.duration_s": 60})``. Values
    are numbers, bools, strings, lists and dictionaries.

    Raises ``FileNotFoundError`` for a missing file, :class:`Error` for what is wrong in it, with line, column and remedy.
    """

    def __init__(self, source: PathLike = "pentagon", *, set: Mapping[str, Any] | None = None) -> None:
        if not isinstance(source, (str, os.PathLike)):
            raise TypeError(f"source: a name or a path is needed, not {type(source).__name__}")
        text = os.fspath(source)
        if isinstance(source, os.PathLike) and not Path(text).is_absolute():
            text = f".{os.sep}{text}"
        if text == "-":
            raise Error("source: `-` is neither a built-in scenario nor a file")
        is_file = any(mark in text for mark in "/\\.")
        self._read(text, False, set, [text] if is_file else [])

    @classmethod
    def from_toml(cls, text: str, *, set: Mapping[str, Any] | None = None) -> Scenario:
        """A scenario of the text of a scenario file; paths in it count from where Python runs."""
        scenario = cls.__new__(cls)
        scenario._read(text, True, set, [])
        return scenario

    def _read(self, source: str, is_text: bool, set: Mapping[str, Any] | None, files: list[str]) -> None:
        self._source, self._is_text = source, is_text
        self._sets = [f"{key}={value_as_toml(value)}" for key, value in by_name(set, "set").items()]
        self._native = with_files(files, lambda: _native.Scenario(source, is_text, self._sets))
        #: The files that it was read from.
        self.files: tuple[str, ...] = tuple(files)

    def _check_unchanged(self) -> None:
        """Raises where the file that it was read from says something else by now, or is gone: commands would read that one."""
        if not self.files:
            return
        now = with_files(self.files, lambda: _native.Scenario(self._source, self._is_text, self._sets))
        if now.sha256 != self.sha256:
            raise Error(f"{self._source} has changed since it was read: make a new Scenario of it")

    def __reduce__(self) -> tuple[Any, ...]:
        return restored, (self._source, self._is_text, self._sets, self.files, self.sha256)

    @property
    def name(self) -> str:
        """Its name."""
        return self._native.name

    @property
    def law(self) -> str:
        """The name of its law."""
        return self._native.law

    @property
    def delta_m(self) -> float:
        """The safety distance delta [m]."""
        return self._native.delta_m

    @property
    def duration_s(self) -> float:
        """How long it flies [s]."""
        return self._native.duration_s

    @property
    def dt_s(self) -> float:
        """Its step [s]."""
        return self._native.dt_s

    @property
    def steps(self) -> int:
        """How many steps it flies."""
        return self._native.steps

    @property
    def positions_m(self) -> NDArray[np.float64]:
        """(N, 3) positions at the start [m]."""
        return self._native.positions_m

    @property
    def velocities_m_s(self) -> NDArray[np.float64]:
        """(N, 3) velocities at the start [m/s]."""
        return self._native.velocities_m_s

    @property
    def slots_m(self) -> NDArray[np.float64]:
        """(N, 3) slots of the first leg [m]."""
        return self._native.slots_m

    @property
    def links(self) -> NDArray[np.int64]:
        """(E, 2) pairs of vehicles, from 0, that hear each other."""
        return np.array(self._native.links, dtype=np.int64).reshape(-1, 2)

    @property
    def sha256(self) -> str:
        """The hash of what is flown."""
        return self._native.sha256

    def to_toml(self) -> str:
        """The scenario with nothing left to be derived: every default, every shape as points."""
        return self._native.toml

    def __len__(self) -> int:
        return self._native.count

    def __repr__(self) -> str:
        return f"<Scenario {self.name}: {len(self)} vehicles, {self.duration_s:g} s, delta {self.delta_m:g} m, {self.law}>"

    def _repr_html_(self) -> str:
        rows = [("vehicles", str(len(self))), ("duration", f"{self.duration_s:g} s"), ("delta", f"{self.delta_m:g} m"), ("law", self.law)]
        ways = np.stack([self.positions_m, self.slots_m])
        return _display.card("open", self.name, rows, _display.paths(ways, "From the start to the slots, seen from above"))


def scenario_of(given: Scenario | PathLike, set: Mapping[str, Any] | None = None) -> Scenario:
    """A scenario, or what names one."""
    if not isinstance(given, Scenario):
        return Scenario(given, set=set)
    if not set:
        return given
    given._check_unchanged()
    sets = [f"{key}={value_as_toml(value)}" for key, value in by_name(set, "set").items()]
    return restored(given._source, given._is_text, given._sets + sets, given.files)


def restored(source: str, is_text: bool, sets: list[str], files: tuple[str, ...], sha256: str | None = None) -> Scenario:
    """A scenario by what it was read from; where a hash is given it must be that one."""
    scenario = Scenario.__new__(Scenario)
    scenario._source, scenario._is_text, scenario._sets, scenario.files = source, is_text, sets, files
    scenario._native = with_files(files, lambda: _native.Scenario(source, is_text, sets))
    if sha256 not in (None, scenario.sha256):
        raise Error(f"{source} is not what it was when the scenario was made")
    return scenario


def value_as_toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, os.PathLike)):
        return json.dumps(os.fspath(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(key))} = {value_as_toml(x)}" for key, x in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(value_as_toml(x) for x in value) + "]"
    raise TypeError(f"set: a value of TOML is needed, not {type(value).__name__}")


def scenarios() -> list[str]:
    """Names of the built-in scenarios."""
    return _native.scenarios()


class Check:
    """What is known of a scenario before the first step. Its keys, those of ``tautline check --json``, are attributes too."""

    def __init__(self, found: tuple[bool, str, str, str]) -> None:
        #: Whether nothing refuses the flight.
        self.is_good, self.headline, self.text, self._json = found
        self._found: dict[str, Any] = json.loads(self._json)

    @property
    def certified_m(self) -> float | None:
        """The distance below which no pair ever comes [m]; None where nothing is certified (``certificate_void`` says why)."""
        certified: float | None = self._found["certified_m"]
        return certified

    @property
    def warnings(self) -> Findings:
        """What stands in the way, the worst first: ``code`` and ``message``."""
        return Findings(self._found["warnings"])

    def to_dict(self) -> dict[str, Any]:
        """Everything that ``tautline check --json`` prints."""
        found: dict[str, Any] = json.loads(self._json)
        return found

    def __bool__(self) -> bool:
        raise TypeError("a check is neither true nor false: ask is_good")

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_") or key not in self._found:
            raise AttributeError(key)
        return self._found[key]

    def __repr__(self) -> str:
        return f"<Check {self.headline}>"

    def __str__(self) -> str:
        return f"{self.headline}\n{self.text}"

    def _repr_html_(self) -> str:
        rows = [(warning.code, warning.message) for warning in self.warnings]
        return _display.card("good" if self.is_good else "bad", self.headline, rows)


def check(scenario: Scenario | PathLike, *, set: Mapping[str, Any] | None = None) -> Check:
    """What is known before the first step: certificate, stability, honest step, traps, rigidity.

    Raises :class:`Error` for a scenario that is wrong.
    """
    return Check(scenario_of(scenario, set)._native.check())
