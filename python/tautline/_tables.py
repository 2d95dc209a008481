"""What was found, as rows: lists of findings that become tables."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import pandas


class Finding(Mapping[str, Any]):
    """One finding: its keys are those of the command line's JSON, and attributes too (``finding.min_m``)."""

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
        """The names of the two that it is about; of an approach to an obstacle the vehicle and the obstacle."""
        first, second = self._values["who"]
        return first, second

    def __repr__(self) -> str:
        return f"Finding({', '.join(f'{key}={value!r}' for key, value in self._values.items())})"


class Findings(Sequence[Finding]):
    """Findings in their order."""

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
        """A row a finding; the names of the two stand in ``first`` and ``second``. Imports pandas."""
        return frame([flat(row) for row in self._rows])

    def __repr__(self) -> str:
        return f"Findings({self._rows!r})"

    def _repr_html_(self) -> str:
        return table([flat(row) for row in self._rows])


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """A finding with its two names apart."""
    cells: dict[str, Any] = {}
    for key, value in row.items():
        if key == "who":
            cells["first"], cells["second"] = value
        else:
            cells[key] = value
    return cells


def frame(rows: Any, **more: Any) -> pandas.DataFrame:
    """A table of pandas, which is imported here."""
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pandas.DataFrame(rows, **more)


def table(rows: Sequence[Mapping[str, Any]], most: int = 10) -> str:
    """Rows as a table in HTML, the first of them where there are many."""
    if not rows:
        return "<p>none</p>"
    columns = list(dict.fromkeys(key for row in rows for key in row))
    head = "".join(f"<th>{html.escape(str(column))}</th>" for column in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell(row.get(column)))}</td>" for column in columns) + "</tr>"
        for row in rows[:most]
    )
    more = f"<p>and {len(rows) - most} more</p>" if len(rows) > most else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def cell(value: object) -> str:
    """A value as people read it."""
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
