"""Campaigns: thousands of flights, and shares with confidence intervals."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native
from ._answers import Answer, LawResult
from ._arguments import PathLike, count, optional_count, optional_number, optional_path, path, with_files
from ._law import ControlLaw, check_law
from ._native import Error
from ._processes import fly_shards
from ._progress import Progress, to_report
from ._scenario import to_toml_value
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


def planned(
    spec: PathLike | Mapping[str, Any],
    out: PathLike | None,
    law: ControlLaw | str | None,
    shards: int | None,
    until_width: float | None = None,
    until_decided: float | None = None,
) -> tuple[dict[str, object], list[str]]:
    """Returns the plan of a campaign for the native module, and the files that it reads."""
    folder, text, files = optional_path(out, "out"), None, []
    if folder == "":
        raise Error("out: the path of the folder is empty")
    if isinstance(spec, Mapping):
        if folder is None:
            raise Error("out: missing beside a dictionary; give a folder")
        file = f"{Path(folder).name}.toml"
        text = "".join(f"{json.dumps(str(key))} = {to_toml_value(value)}\n" for key, value in spec.items())
    else:
        file = path(spec, "spec")
        files = [file]
    if not isinstance(law, str):
        check_law(law)
    plan: dict[str, object] = {
        "spec": file,
        "text": text,
        "law": law,
        "out": folder,
        "shards": optional_count(shards, "shards"),
        "until_width": optional_number(until_width, "until_width"),
        "until_decided": optional_number(until_decided, "until_decided"),
    }
    return plan, files


class CampaignFolder:
    """A planned campaign in a folder. Any process that sees the folder can fly any of its shards (docs/clusters.md).

    ``CampaignFolder(folder)`` opens a campaign, also one of the command line; :meth:`plan` makes one. Raises
    :class:`Error` where the folder holds no campaign, or if another program, or another file of the law, planned it.
    """

    def __init__(self, folder: PathLike) -> None:
        self._native = _native.CampaignFolder(path(folder, "folder"))

    @classmethod
    def plan(
        cls,
        spec: PathLike | Mapping[str, Any],
        out: PathLike,
        *,
        law: str | None = None,
        shards: int | None = None,
        until_width: float | None = None,
        until_decided: float | None = None,
    ) -> CampaignFolder:
        """Plans a campaign into the folder ``out``, or opens the same campaign there. The arguments are those of
        :func:`campaign`; a law in Python is a name ``"MODULE:CLASS"``, which all processes import."""
        plan, files = planned(spec, out, law, shards, until_width, until_decided)
        if not isinstance(law, (str, type(None))):
            raise TypeError("law: MODULE:CLASS is needed, which other processes can import")
        return cls._of(with_files(files, lambda: _native.CampaignFolder.plan(plan)))

    @classmethod
    def _of(cls, native: _native.CampaignFolder) -> CampaignFolder:
        made = cls.__new__(cls)
        made._native = native
        return made

    @property
    def path(self) -> Path:
        """The folder."""
        return Path(self._native.path)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self._native.manifest[1]

    @property
    def shards(self) -> int:
        """Number of shards, which count from 0."""
        return self._native.manifest[2]

    @property
    def law(self) -> str | None:
        """Name of the law in Python; None for laws of the specification."""
        return self._native.manifest[3]

    def missing(self) -> list[int]:
        """Returns the shards that are not flown."""
        return self._native.missing()

    def fly(self, shards: int | Iterable[int], *, threads: int = 1, progress: Progress = None) -> None:
        """Flies shards in this process. Finished flights are kept, also after an exception.

        A law in Python flies on the calling thread alone, whatever the number of threads.
        """
        chosen = [count(shard, "shards") for shard in (shards if isinstance(shards, Iterable) else [shards])]
        if wrong := [shard for shard in chosen if shard >= self.shards]:
            raise Error(f"shards: must be below {self.shards}, got {wrong[0]}")
        self._native.fly(chosen, count(threads, "threads"), to_report(progress))

    def fly_in_processes(self, processes: int | None = None, *, progress: Progress = None) -> None:
        """Flies the missing shards in processes of their own, by default one for each core. Begins no further shard
        once the rule ``until_width`` or ``until_decided`` is met. Raises :class:`Error` with the output of a failed
        process."""
        many = optional_count(processes, "processes")
        if many == 0:
            raise Error("processes: must be at least 1, got 0")
        report, missing, runs = to_report(progress), self.missing(), self.runs / self.shards

        def ended(flown: int) -> None:
            if report is not None:
                report(round(flown * runs), round(len(missing) * runs))

        fly_shards(self.path, missing, many or os.cpu_count() or 1, ended, self._native.has_answer)
        if not self._native.has_answer() and (left := self.missing()):
            raise Error(f"shards {left}: their processes ended without a result; the law must not end its process")

    def merge(self, *, worst: int = 10, progress: Progress = None) -> Campaign:
        """Merges all shards and writes the answer, its table and its page, as :func:`campaign` does. Raises
        :class:`Error` where shards are missing."""
        return Campaign(*self._native.merge(count(worst, "worst"), to_report(progress)), self.path.absolute())

    def __repr__(self) -> str:
        return f"CampaignFolder({str(self.path)!r})"


def campaign(
    spec: PathLike | Mapping[str, Any],
    out: PathLike | None = None,
    *,
    law: ControlLaw | str | None = None,
    shards: int | None = None,
    threads: int | None = None,
    until_width: float | None = None,
    until_decided: float | None = None,
    worst: int = 10,
    progress: Progress = None,
) -> Campaign:
    """Flies a campaign (docs/campaigns.md) on all cores into a folder, by default ``out/NAME`` after the name of the
    file. ``spec`` is a file, or a dictionary with its keys and a folder ``out``.

    A further call continues an interrupted campaign, also one of the command line. With more ``runs`` in the file it
    keeps the flights that were flown, and the intervals widen. The ``worst`` flights are flown again, with recordings
    and reports.

    ``law`` is a law in Python, which flies every run in place of the scenario's law:

    * ``"MODULE:CLASS"`` flies in ``threads`` processes, by default one for each core. They import the module and make
      a new object for each flight. The folder holds the SHA-256 of the file of the module: another file is refused.
      Modules that it imports are not compared.
    * An object flies on the calling thread alone. Only the same call with a law of the same name continues such a
      campaign.

    ``progress`` is True for a bar of tqdm, or a function of the work done and its total.

    Raises ``FileNotFoundError`` for a missing specification and :class:`Error` for a wrong one.
    """
    plan, files = planned(spec, out, law, shards, until_width, until_decided)
    many, report = optional_count(threads, "threads"), to_report(progress)
    if isinstance(law, str):
        if many == 0:
            raise Error("threads: must be at least 1, got 0")
        folder = CampaignFolder._of(with_files(files, lambda: _native.CampaignFolder.plan(plan)))
        folder.fly_in_processes(many, progress=report)
        return folder.merge(worst=worst)
    more = count(worst, "worst"), report
    answer, found = with_files(files, lambda: _native.campaign(plan, many, *more))
    return Campaign(*answer, Path(found).absolute())


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
