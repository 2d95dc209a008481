"""Commands of the command line as functions: exports, laws side by side, margins, sweeps, attacks, the claims of the paper."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from . import _display, _native
from ._scenario import Scenario, scenario_of
from ._tables import Finding, Findings, cell
from ._words import (
    PathLike,
    by_name,
    count,
    flag,
    listed,
    maybe,
    maybe_count,
    maybe_path,
    number,
    one_recording,
    path,
    paths,
    reading,
    text,
    with_files,
)


class Answer(Finding):
    """What a command answers: a mapping with the keys of its JSON, which are attributes too; lists of rows become tables."""

    def __init__(self, is_good: bool, text: str) -> None:
        super().__init__(json.loads(text))
        #: Whether the command line would end with 0.
        self._is_good = is_good

    @property
    def is_good(self) -> bool:
        """Whether the command line would end with exit code 0: judged and good."""
        return self._is_good

    def __bool__(self) -> bool:
        raise TypeError("an answer is neither true nor false: ask is_good")

    def __getattr__(self, key: str) -> Any:
        value = super().__getattr__(key)
        is_rows = isinstance(value, list) and value and all(isinstance(row, dict) for row in value)
        return Findings(value) if is_rows else value

    def to_dict(self) -> dict[str, Any]:
        """Everything that ``--json`` prints."""
        return dict(self)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {'good' if self.is_good else 'bad'}: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        plain = [(key, cell(value)) for key, value in self.items() if not isinstance(value, (list, dict))]
        tables = [(key, value) for key in self if isinstance(value := getattr(self, key), Findings)]
        shown = "".join(f"<h4>{escape(key)}</h4>{value._repr_html_()}" for key, value in tables)
        return _display.card("good" if self.is_good else "bad", type(self).__name__, plain) + shown


def export(
    recording: PathLike | Sequence[PathLike],
    output: PathLike,
    *,
    to: str | None = None,
    sample_hz: float | None = None,
    force: bool = False,
    **read_as: Any,
) -> None:
    """Writes a recording of any format as CSV, Parquet, NPZ or MCAP, the same to the last bit.

    The format is that of the name of ``output``, or ``to``: ``csv``, ``parquet``, ``npz``, ``mcap``. Curves are sampled at ``sample_hz``. A file
    that exists is overwritten with ``force``. ``read_as`` is as in :func:`tautline.audit`. Raises as :func:`tautline.read`, and ``OSError`` where the file
    cannot be written.
    """
    recordings = one_recording(paths(recording, "recording"), read_as)
    options, target = reading(**read_as), path(output, "output")
    how = text(to, "to"), maybe(sample_hz, "sample_hz"), flag(force, "force")
    with_files(recordings, lambda: _native.export(recordings, options, target, *how))


def asked(scenario: Scenario | PathLike, set: Mapping[str, Any] | None) -> _native.Scenario:
    """The scenario of a study, as its file says it now."""
    found = scenario_of(scenario, set)
    found._check_unchanged()
    return found._native


def outputs(csv: PathLike | None, latex: PathLike | None, html: PathLike | None, force: bool, threads: int | None) -> dict[str, str | bool | int | None]:
    """Files and threads of a study."""
    return {
        "csv": maybe_path(csv, "csv"),
        "latex": maybe_path(latex, "latex"),
        "html": maybe_path(html, "html"),
        "force": flag(force, "force"),
        "threads": maybe_count(threads, "threads"),
    }


def compare(
    scenario: Scenario | PathLike,
    laws: Sequence[str] | None = None,
    *,
    runs: int = 20,
    seed: int = 0,
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    force: bool = False,
    threads: int | None = None,
) -> Answer:
    """Flies laws from the same starts, on all cores: ``answer.laws.to_pandas()`` is a row a law. docs/compare.md says what each number means.

    Laws are kinds or names of tables ``[laws.NAME]``; all that the scenario has unless given. Files that exist are overwritten
    with ``force``.
    """
    return Answer(
        *_native.compare(
            asked(scenario, set),
            laws=None if laws is None else listed(laws, "laws"),
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            outputs=outputs(csv, latex, html, force, threads),
        )
    )


def margin(
    scenario: Scenario | PathLike,
    key: str,
    start: float,
    stop: float,
    *,
    runs: int = 1,
    seed: int = 0,
    verdict: str = "pass",
    scan: int = 5,
    halvings: int = 6,
    log: bool = False,
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    force: bool = False,
    threads: int | None = None,
) -> Answer:
    """How much of one key a verdict (``pass``, ``clear``, ``reached``) survives: the two values between ``start`` and ``stop`` between which it
    turns. docs/margins.md says more."""
    return Answer(
        *_native.margin(
            asked(scenario, set),
            key=str(key),
            start=number(start, "start"),
            stop=number(stop, "stop"),
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            verdict=str(verdict),
            scan=count(scan, "scan"),
            halvings=count(halvings, "halvings"),
            logarithmic=flag(log, "log"),
            outputs=outputs(csv, latex, html, force, threads),
        )
    )


def sweep(
    scenario: Scenario | PathLike,
    keys: Mapping[str, Sequence[float]],
    *,
    runs: int = 1,
    seed: int = 0,
    verdict: str = "pass",
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    force: bool = False,
    threads: int | None = None,
) -> Answer:
    """Flies the grid of one key or two, such as ``{"network.loss": np.linspace(0, 0.5, 11)}``: ``answer.points.to_pandas()`` is a row a
    point, with the share of runs that show a verdict (``pass``, ``clear``, ``reached``). docs/sweeps.md says more."""
    swept = []
    for key, values in by_name(keys, "keys").items():
        if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
            raise TypeError(f"keys: {key} needs a list of numbers, not {values!r}")
        swept.append((str(key), [number(value, key) for value in values]))
    return Answer(
        *_native.sweep(
            asked(scenario, set),
            keys=swept,
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            verdict=str(verdict),
            outputs=outputs(csv, latex, html, force, threads),
        )
    )


def attack(
    scenario: Scenario | PathLike,
    *,
    start: float | None = None,
    velocity: float | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    apart: float | None = None,
    flights: int = 1000,
    seeds: int = 1,
    seed: int = 0,
    set: Mapping[str, Any] | None = None,
    out: PathLike | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    force: bool = False,
    threads: int | None = None,
) -> Answer:
    """Searches for the worst start (up to ``start`` [m] from the scenario's), velocity (``velocity`` [m/s]) or keys (``vary``, with bounds). What
    it does not find is no proof. docs/attack.md says more."""
    varied = []
    for key, bounds in by_name(vary, "vary").items():
        if not isinstance(bounds, (list, tuple)) or len(bounds) != 2:
            raise TypeError(f"vary: {key} needs a lower and an upper bound, not {bounds!r}")
        varied.append((str(key), number(bounds[0], key), number(bounds[1], key)))
    return Answer(
        *_native.attack(
            asked(scenario, set),
            start=maybe(start, "start"),
            velocity=maybe(velocity, "velocity"),
            apart=maybe(apart, "apart"),
            vary=varied,
            flights=count(flights, "flights"),
            seeds=count(seeds, "seeds"),
            seed=count(seed, "seed"),
            out=maybe_path(out, "out"),
            outputs=outputs(csv, latex, html, force, threads),
        )
    )


def validate(out: PathLike | None = None, *, force: bool = False, threads: int | None = None) -> Answer:
    """Reproduces the paper and judges its claims and ours; figures and a page are left in the folder ``out`` where one is given."""
    with tempfile.TemporaryDirectory() as folder:
        at = str(Path(folder) / "validate") if out is None else path(out, "out")
        return Answer(*_native.validate(at, flag(force, "force"), maybe_count(threads, "threads")))
