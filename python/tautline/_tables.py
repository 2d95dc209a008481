"""Findings, and their tables."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import pandas


class Finding(Mapping[str, Any]):
    """A finding. The keys of the command line's JSON are attributes as well (``finding.min_m``)."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = dict(values)

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_") or key not in self._values:
            raise AttributeError(key)
        return self._values[key]

    @property
    def pair(self) -> tuple[str, str]:
        """Names of the two vehicles, or of the vehicle and the obstacle."""
        first, second = self._values["who"]
        return first, second

    def __repr__(self) -> str:
        return f"Finding({', '.join(f'{key}={value!r}' for key, value in self._values.items())})"


class Findings(Sequence[Finding]):
    """A list of findings."""

    def __init__(self, rows: Sequence[Mapping[str, Any]]) -> None:
        self._rows = [Finding(row) for row in rows]

    @overload
    def __getitem__(self, index: int) -> Finding: ...
    @overload
    def __getitem__(self, index: slice) -> list[Finding]: ...
    def __getitem__(self, index: int | slice) -> Finding | list[Finding]:
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table with a row for each finding; ``first`` and ``second`` name the pair. Imports pandas."""
        return to_frame([flatten(row) for row in self._rows])

    def __repr__(self) -> str:
        return f"Findings({self._rows!r})"

    def _repr_html_(self) -> str:
        return make_table([flatten(row) for row in self._rows])


def flatten(row: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a finding with the names of its pair in two cells."""
    cells: dict[str, Any] = {}
    for key, value in row.items():
        if key == "who":
            cells["first"], cells["second"] = value
        else:
            cells[key] = value
    return cells


def to_frame(rows: Any, **more: Any) -> pandas.DataFrame:
    """Returns a table of pandas. Imports pandas."""
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pandas.DataFrame(rows, **more)


def make_table(rows: Sequence[Mapping[str, Any]], max_rows: int = 10) -> str:
    """Returns the first rows as a table in HTML."""
    if not rows:
        return "<p>none</p>"
    columns = list(dict.fromkeys(key for row in rows for key in row))
    head = "".join(f"<th>{html.escape(str(column))}</th>" for column in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(format_cell(row.get(column)))}</td>" for column in columns) + "</tr>"
        for row in rows[:max_rows]
    )
    more = f"<p>and {len(rows) - max_rows} more</p>" if len(rows) > max_rows else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def format_cell(value: object) -> str:
    """Returns a value as text, rounded to six digits."""
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
