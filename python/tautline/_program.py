"""Commands of the command line as functions: exports, studies, and the validation of the paper's claims."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from ._answers import Answer, Comparison, Margin, Sweep
from ._arguments import (
    PathLike,
    ReadOptions,
    boolean,
    count,
    mapping,
    number,
    optional_count,
    optional_number,
    optional_path,
    optional_text,
    optional_vector,
    path,
    paths,
    read_options,
    single_recording,
    with_files,
)
from ._law import ControlLaw, check_law
from ._progress import Progress, to_report
from ._scenario import Scenario, to_scenario

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._words import ExportFormat, Verdict


def export(
    recording: PathLike | Sequence[PathLike],
    output: PathLike,
    *,
    to: ExportFormat | None = None,
    sample_hz: float | None = None,
    overwrite: bool = False,
    tolerance: float | None = None,
    delta: float | None = None,
    ellipsoid: Sequence[float] | None = None,
    obstacles: PathLike | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
    compressed: bool = False,
    skyb_version: int = 2,
    **read_as: Unpack[ReadOptions],
) -> Answer | None:
    """Writes a recording of any format as CSV, Parquet, NPZ or MCAP without rounding, or a flight for drones.

    The name of ``output`` gives the format, unless ``to`` is ``csv``, ``parquet``, ``npz`` or ``mcap``. Curves are
    sampled at ``sample_hz``. ``overwrite`` replaces an existing file. The options of reading are those of
    :func:`tautline.audit`. Raises the exceptions of :func:`tautline.read`, and ``OSError`` where the file cannot be
    written.

    With ``to`` as ``crazyflie``, ``skyb`` or ``skyc``, writes the flight within ``tolerance``
    [m] and judges the written motion. ``delta`` [m], ``ellipsoid`` (3,) [m] and ``obstacles`` replace the limits of the
    recording. ``from_s`` and ``until_s`` [s] select a part. ``compressed`` is for ``crazyflie``, ``skyb_version`` (1
    or 2) for ``skyb``. Returns an :class:`Answer`; it is not good, and no file is written, where the flight or the
    written motion is not clear.
    """
    recordings = single_recording(paths(recording, "recording"), read_as)
    options, target = read_options(**read_as), path(output, "output")
    more = optional_text(to, "to"), optional_number(sample_hz, "sample_hz"), boolean(overwrite, "overwrite")
    drones = {
        "tolerance": optional_number(tolerance, "tolerance"),
        "delta": optional_number(delta, "delta"),
        "ellipsoid": optional_vector(ellipsoid, "ellipsoid"),
        "obstacles": optional_path(obstacles, "obstacles"),
        "from_s": optional_number(from_s, "from_s"),
        "until_s": optional_number(until_s, "until_s"),
        "compressed": boolean(compressed, "compressed"),
        "skyb_version": count(skyb_version, "skyb_version"),
    }
    answer = with_files(recordings, lambda: _native.export(recordings, options, target, *more, drones))
    return None if answer is None else Answer(*answer)


def study_scenario(scenario: Scenario | PathLike, set: Mapping[str, Any] | None) -> _native.Scenario:
    """Returns the scenario of a study."""
    return to_scenario(scenario, set)._native


def checked_law(law: ControlLaw | None) -> ControlLaw | None:
    """Returns a law in Python. Raises ``TypeError`` for a class."""
    check_law(law)
    return law


def names_and_laws(laws: object) -> list[str | ControlLaw]:
    """Returns names and laws in Python. A single string is refused: its letters are no names."""
    if isinstance(laws, (str, bytes)) or not isinstance(laws, Iterable):
        raise TypeError(f"laws: a list of names and laws is needed, not {type(laws).__name__}")
    given = list(laws)
    for law in given:
        if not isinstance(law, str):
            check_law(law)
    return given


def outputs(
    csv: PathLike | None,
    latex: PathLike | None,
    html: PathLike | None,
    overwrite: bool,
    threads: int | None,
    progress: Progress,
) -> dict[str, object]:
    """Returns the files, threads and progress of a study."""
    return {
        "csv": optional_path(csv, "csv"),
        "latex": optional_path(latex, "latex"),
        "html": optional_path(html, "html"),
        "force": boolean(overwrite, "overwrite"),
        "threads": optional_count(threads, "threads"),
        "progress": to_report(progress),
    }


def compare(
    scenario: Scenario | PathLike,
    laws: Sequence[str | ControlLaw] | None = None,
    *,
    shield: bool = False,
    runs: int = 20,
    seed: int = 0,
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Comparison:
    """Flies laws from the same starts, on all cores. ``answer.laws.to_pandas()`` has a row for each law.

    ``laws`` are kinds, names of tables ``[laws.NAME]``, and laws in Python, by default all that the scenario has. Laws
    in Python fly on the calling thread alone, and nothing is proved about them. ``shield`` flies each
    law twice, as ``NAME+bare`` and under the shield as ``NAME+shield``. ``overwrite``
    replaces existing files. More in docs/studies.md.
    """
    return Comparison(
        *_native.compare(
            study_scenario(scenario, set),
            laws=None if laws is None else names_and_laws(laws),
            shield=boolean(shield, "shield"),
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            outputs=outputs(csv, latex, html, overwrite, threads, progress),
        )
    )


def margin(
    scenario: Scenario | PathLike,
    key: str,
    start: float,
    stop: float,
    *,
    law: ControlLaw | None = None,
    runs: int = 1,
    seed: int = 0,
    verdict: Verdict = "pass",
    scan: int = 5,
    halvings: int = 6,
    log: bool = False,
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Margin:
    """Searches between ``start`` and ``stop`` for the two values of a key between which a verdict turns.

    ``verdict`` is ``pass``, ``clear`` or ``reached``. A law in Python flies in place of the scenario's law, on the
    calling thread alone. More in docs/studies.md.
    """
    return Margin(
        *_native.margin(
            study_scenario(scenario, set),
            law=checked_law(law),
            key=str(key),
            start=number(start, "start"),
            stop=number(stop, "stop"),
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            verdict=str(verdict),
            scan=count(scan, "scan"),
            halvings=count(halvings, "halvings"),
            logarithmic=boolean(log, "log"),
            outputs=outputs(csv, latex, html, overwrite, threads, progress),
        )
    )


def sweep(
    scenario: Scenario | PathLike,
    keys: Mapping[str, Sequence[float]],
    *,
    law: ControlLaw | None = None,
    runs: int = 1,
    seed: int = 0,
    verdict: Verdict = "pass",
    set: Mapping[str, Any] | None = None,
    csv: PathLike | None = None,
    latex: PathLike | None = None,
    html: PathLike | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Sweep:
    """Flies a grid over one key or two, such as ``{"network.loss": np.linspace(0, 0.5, 11)}``.

    ``answer.points.to_pandas()`` has a row for each point, with the share of runs that have the ``verdict``.
    ``verdict`` is ``pass``, ``clear`` or ``reached``. A law in Python flies in place of the scenario's law, on the
    calling thread alone. More in docs/studies.md.
    """
    swept = []
    for key, values in mapping(keys, "keys").items():
        if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
            raise TypeError(f"keys: {key} needs a list of numbers, not {values!r}")
        swept.append((str(key), [number(value, key) for value in values]))
    return Sweep(
        *_native.sweep(
            study_scenario(scenario, set),
            law=checked_law(law),
            keys=swept,
            runs=count(runs, "runs"),
            seed=count(seed, "seed"),
            verdict=str(verdict),
            outputs=outputs(csv, latex, html, overwrite, threads, progress),
        )
    )


def attack(
    scenario: Scenario | PathLike,
    *,
    law: ControlLaw | None = None,
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
    overwrite: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Answer:
    """Searches for the flight with the smallest separation.

    * ``start``: largest offset of each start position [m].
    * ``velocity``: largest offset of each start velocity [m/s].
    * ``vary``: keys, each with a lower and an upper bound.
    * ``apart``: smallest separation of two start positions [m].
    * ``law``: law in Python, which flies in place of the scenario's law, on the calling thread alone.

    A search without a violation proves nothing. More in docs/studies.md.
    """
    varied = []
    for key, bounds in mapping(vary, "vary").items():
        if not isinstance(bounds, (list, tuple)) or len(bounds) != 2:
            raise TypeError(f"vary: {key} needs a lower and an upper bound, not {bounds!r}")
        varied.append((str(key), number(bounds[0], key), number(bounds[1], key)))
    return Answer(
        *_native.attack(
            study_scenario(scenario, set),
            law=checked_law(law),
            start=optional_number(start, "start"),
            velocity=optional_number(velocity, "velocity"),
            apart=optional_number(apart, "apart"),
            vary=varied,
            flights=count(flights, "flights"),
            seeds=count(seeds, "seeds"),
            seed=count(seed, "seed"),
            out=optional_path(out, "out"),
            outputs=outputs(csv, latex, html, overwrite, threads, progress),
        )
    )


def validate(
    out: PathLike | None = None, *, overwrite: bool = False, threads: int | None = None, progress: Progress = None
) -> Answer:
    """Measures the claims of the paper and of tautline. Writes figures and a page into the folder ``out``, if given."""
    with tempfile.TemporaryDirectory() as folder:
        at = str(Path(folder) / "validate") if out is None else path(out, "out")
        given = boolean(overwrite, "overwrite"), optional_count(threads, "threads"), to_report(progress)
        return Answer(*_native.validate(at, *given))
