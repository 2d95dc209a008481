"""Campaigns: thousands of flights, one answer with an error bar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from . import _native
from ._program import Answer
from ._words import PathLike, count, maybe, maybe_count, maybe_path, path, with_files

if TYPE_CHECKING:
    import pandas


class Campaign(Answer):
    """The answer of a campaign: the keys of ``campaign.json``, and its folder."""

    def __init__(self, is_good: bool, text: str, folder: Path) -> None:
        super().__init__(is_good, text)
        self._folder = folder

    @property
    def folder(self) -> Path:
        """Where its parts, ``results.parquet``, ``campaign.json`` and ``campaign.html`` are."""
        return self._folder

    def to_pandas(self) -> pandas.DataFrame:
        """A row a flight. Imports pandas, and pyarrow, which reads Parquet."""
        try:
            import pandas
        except ImportError:
            raise ImportError("tables need pandas: pip install pandas pyarrow") from None
        return pandas.read_parquet(self._folder / "results.parquet")


def campaign(
    spec: PathLike,
    out: PathLike | None = None,
    *,
    shards: int | None = None,
    threads: int | None = None,
    until_width: float | None = None,
    until_decided: float | None = None,
    worst: int = 10,
) -> Campaign:
    """Flies a campaign (docs/campaigns.md) on all cores into a folder, by default ``out/NAME`` of the specification's name. Called again, also
    after Ctrl-C, it goes on from where it was. The ``worst`` flights are flown again, with recordings and reports.

    Raises ``FileNotFoundError`` for a missing specification, :class:`Error` for what is wrong in it.
    """
    file = path(spec, "spec")
    folder, many = maybe_path(out, "out"), (maybe_count(shards, "shards"), maybe_count(threads, "threads"))
    until = maybe(until_width, "until_width"), maybe(until_decided, "until_decided")
    flown = with_files([file], lambda: _native.campaign(file, folder, *many, *until, count(worst, "worst")))
    is_good, text, at = flown
    return Campaign(is_good, text, Path(at).absolute())
