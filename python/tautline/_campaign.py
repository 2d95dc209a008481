"""Campaigns: thousands of flights, and shares with confidence intervals."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from . import _native
from ._answers import Answer, LawResult
from ._arguments import PathLike, count, optional_count, optional_number, optional_path, path, with_files
from ._law import ControlLaw, check_law
from ._native import Error
from ._tables import Rows, Table, import_pyarrow

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Campaign(Answer, Table):
    """Result of a campaign: the keys of ``campaign.json``, its folder, and a table with a row for each flight."""

    laws: Rows[LawResult]

    def __init__(self, is_good: bool, headline: str, text: str, found: str, folder: Path) -> None:
        super().__init__(is_good, headline, text, found)
        self._folder = folder

    @property
    def folder(self) -> Path:
        """Folder with the parts, ``results.parquet``, ``campaign.json`` and ``campaign.html``."""
        return self._folder

    def to_arrow(self) -> pyarrow.Table:
        """Returns a table of Arrow with a row for each flight. Imports pyarrow."""
        import_pyarrow()
        import pyarrow.parquet

        return pyarrow.parquet.read_table(self._folder / "results.parquet")

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a data frame with a row for each flight. Imports pandas and pyarrow."""
        return self.to_arrow().to_pandas()


def campaign(
    spec: PathLike,
    out: PathLike | None = None,
    *,
    law: ControlLaw | None = None,
    shards: int | None = None,
    threads: int | None = None,
    until_width: float | None = None,
    until_decided: float | None = None,
    worst: int = 10,
) -> Campaign:
    """Flies a campaign (docs/campaigns.md) on all cores into a folder, by default ``out/NAME`` after the name of the
    file.

    A further call continues an interrupted campaign, also one of the command line. With more ``runs`` in the file it
    keeps the flights that were flown, and the intervals widen. The ``worst`` flights are flown again, with recordings
    and reports.

    ``law`` is a law in Python, which flies every run in place of the scenario's law, on the calling thread alone. Only
    the same call with a law of the same name continues such a campaign.

    Raises ``FileNotFoundError`` for a missing specification and :class:`Error` for a wrong one.
    """
    file = path(spec, "spec")
    folder, many = optional_path(out, "out"), (optional_count(shards, "shards"), optional_count(threads, "threads"))
    until = optional_number(until_width, "until_width"), optional_number(until_decided, "until_decided")
    check_law(law)
    answer = with_files([file], lambda: _native.campaign(file, law, folder, *many, *until, count(worst, "worst")))
    return Campaign(*answer[0], Path(answer[1]).absolute())


class Proportion(NamedTuple):
    """Share of flights with its confidence interval."""

    #: Share, from 0 to 1; None for no flights.
    share: float | None
    #: Bounds of the true share, with 95 % confidence.
    low: float
    high: float


def proportion(successes: int, of: int) -> Proportion:
    """Returns the share of ``successes`` of ``of`` independent flights with the interval of campaigns: Clopper and
    Pearson, 95 %. The number of flights must be fixed beforehand.

    Raises :class:`Error` for counts below 0, or more successes than flights.
    """
    counted, total = count(successes, "successes"), count(of, "of")
    if counted > total:
        raise Error(f"successes: must be at most of = {total}, got {counted}")
    return Proportion(*_native.proportion(counted, total))
