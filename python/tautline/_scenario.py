"""Scenarios, and their checks before a flight."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _display, _native
from ._answers import Answer
from ._arguments import PathLike, mapping, with_files
from ._judgement import Statement
from ._native import Error
from ._tables import Row, Rows


class Scenario:
    """A scenario: a built-in one by its name, a file, or TOML text (:meth:`from_toml`).

    ``set`` overrides keys: ``Scenario("pentagon", set={"time.duration_s": 60})``. Values are numbers, bools, strings,
    lists and dictionaries. Scenarios are equal if they fly the same.

    Raises ``FileNotFoundError`` for a missing file and :class:`Error`, with line, column and remedy, for a wrong one.
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
        """Returns the scenario of a TOML text. Paths in it are relative to the working folder."""
        scenario = cls.__new__(cls)
        scenario._read(text, True, set, [])
        return scenario

    def _read(self, source: str, is_text: bool, set: Mapping[str, Any] | None, files: list[str]) -> None:
        self._source, self._is_text = source, is_text
        self._sets = [f"{key}={to_toml_value(value)}" for key, value in mapping(set, "set").items()]
        self._native = with_files(files, lambda: _native.Scenario(source, is_text, self._sets))
        #: Files that the scenario was read from.
        self.files: tuple[str, ...] = tuple(files)

    def _check_unchanged(self) -> None:
        """Raises where a file of the scenario has changed or is missing: a flight would not be that of the file."""
        now = with_files(self.files, lambda: _native.Scenario(self._source, self._is_text, self._sets))
        if now.sha256 != self.sha256:
            name = "the scenario" if self._is_text else self._source
            raise Error(f"{name}: a file has changed since it was read; create a new Scenario")

    def _source_state(self) -> tuple[Any, ...]:
        """Returns the arguments of `restore` for this scenario."""
        return self._source, self._is_text, self._sets, self.files, self.sha256

    def __reduce__(self) -> tuple[Any, ...]:
        return restore, self._source_state()

    def __eq__(self, other: object) -> bool:
        """Whether two scenarios fly the same: their complete texts are equal."""
        return self.sha256 == other.sha256 if isinstance(other, Scenario) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.sha256)

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self._native.name

    @property
    def law(self) -> str:
        """Name of the law."""
        return self._native.law

    @property
    def delta_m(self) -> float:
        """Safety distance delta [m]."""
        return self._native.delta_m

    @property
    def duration_s(self) -> float:
        """Duration of the flight [s]."""
        return self._native.duration_s

    @property
    def dt_s(self) -> float:
        """Time step [s]."""
        return self._native.dt_s

    @property
    def steps(self) -> int:
        """Number of steps."""
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
        """(E, 2) linked vehicles, from 0."""
        return np.array(self._native.links, dtype=np.int64).reshape(-1, 2)

    @property
    def sha256(self) -> str:
        """SHA-256 of the complete scenario."""
        return self._native.sha256

    def to_toml(self) -> str:
        """Returns the complete scenario: with every default, and with shapes as points."""
        return self._native.toml

    def __len__(self) -> int:
        return self._native.count

    def __repr__(self) -> str:
        size = f"{len(self)} vehicles, {self.duration_s:g} s"
        return f"<Scenario {self.name}: {size}, delta {self.delta_m:g} m, {self.law}>"

    def _repr_html_(self) -> str:
        rows = [
            ("vehicles", str(len(self))),
            ("duration", f"{self.duration_s:g} s"),
            ("delta", f"{self.delta_m:g} m"),
            ("law", self.law),
        ]
        ways = np.stack([self.positions_m, self.slots_m])
        drawing = _display.draw_paths(ways, "From the start to the slots, from above")
        return _display.make_card("open", self.name, rows, drawing)


def to_scenario(given: Scenario | PathLike, set: Mapping[str, Any] | None = None) -> Scenario:
    """Returns a scenario, or reads it by its name or path, with overrides. Every call that flies or checks a scenario
    calls this function, which refuses a scenario with a changed file."""
    if not isinstance(given, Scenario):
        return Scenario(given, set=set)
    given._check_unchanged()
    if not set:
        return given
    sets = [f"{key}={to_toml_value(value)}" for key, value in mapping(set, "set").items()]
    return restore(given._source, given._is_text, given._sets + sets, given.files)


def restore(source: str, is_text: bool, sets: list[str], files: tuple[str, ...], sha256: str | None = None) -> Scenario:
    """Reads a scenario again. Raises :class:`Error` where its hash differs from ``sha256``."""
    scenario = Scenario.__new__(Scenario)
    scenario._source, scenario._is_text, scenario._sets, scenario.files = source, is_text, sets, files
    scenario._native = with_files(files, lambda: _native.Scenario(source, is_text, sets))
    if sha256 not in (None, scenario.sha256):
        raise Error(f"{'the scenario' if is_text else source}: a file has changed since the Scenario was created")
    return scenario


def to_toml_value(value: Any) -> str:
    """Returns a value as TOML."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, os.PathLike)):
        return json.dumps(os.fspath(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(key))} = {to_toml_value(x)}" for key, x in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(to_toml_value(x) for x in value) + "]"
    raise TypeError(f"set: a value of TOML is needed, not {type(value).__name__}")


def scenarios() -> list[str]:
    """Returns the names of the built-in scenarios."""
    return _native.scenarios()


class CheckWarning(Row):
    """A warning of a check, with a code that programs may compare."""

    code: str
    message: str


class PredictedMargin(Row):
    """Predicted tolerance of the formation to an imperfection. ``value`` is None where every value is tolerated."""

    key: str
    state: str
    bound: str
    value: float | None


class Check(Answer):
    """Check of a scenario before the first step, with the keys of ``tautline check --json``. It is good if it does not
    refuse the flight. Its tables are ``warnings``, ``margins`` and ``certificate_void``."""

    #: Certified smallest separation [m]; None without a certificate.
    certified_m: float | None
    #: Reasons why nothing is certified.
    certificate_void: Rows[Statement]
    #: Warnings, the worst one first.
    warnings: Rows[CheckWarning]
    #: Predicted tolerances, without a shield and without models of vehicles.
    margins: Rows[PredictedMargin]

    def _repr_html_(self) -> str:
        rows = [(warning.code, warning.message) for warning in self.warnings]
        return _display.make_card("good" if self.is_good else "bad", self.headline, rows)


def check(scenario: Scenario | PathLike, *, set: Mapping[str, Any] | None = None) -> Check:
    """Checks a scenario before the first step: certificate, stability, step, traps, rigidity.

    Raises :class:`Error` for a wrong scenario.
    """
    return Check(*to_scenario(scenario, set)._native.check())
