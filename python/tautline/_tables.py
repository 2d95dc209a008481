"""Findings, and their tables."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

from . import _native

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Table:
    """A flat table: a row for each finding, instant or flight, and a column of plain values for each key.

    Libraries of data frames read it without a copy through Arrow, such as ``polars.DataFrame(table)``.
    """

    def _columns(self) -> dict[str, Any]:
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a data frame of pandas. Imports pandas."""
        return to_frame(self._columns())

    def to_arrow(self) -> pyarrow.Table:
        """Returns a table of Arrow. Imports pyarrow."""
        pyarrow = import_pyarrow()
        return pyarrow.table({name: to_arrow_column(values) for name, values in self._columns().items()})

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Exports the table to any library that reads the Arrow PyCapsule interface. Imports pyarrow."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)


class Finding(Mapping[str, Any]):
    """A finding. The keys of the command line's JSON are attributes as well (``finding.min_m``). As attributes, nested
    objects are findings and lists of objects are tables."""

    def __init__(self, values: Mapping[str, Any], vehicles: Sequence[str] = ()) -> None:
        self._values = dict(values)
        self._vehicles = vehicles

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return dict(self) == dict(other) if isinstance(other, Mapping) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_") or key not in self._values:
            raise AttributeError(f"{type(self).__name__} has no attribute or key {key!r}")
        value = self._values[key]
        if isinstance(value, Mapping):
            return Finding(value, self._vehicles)
        is_rows = isinstance(value, list) and value and all(isinstance(row, Mapping) for row in value)
        return Findings(value, self._vehicles) if is_rows else value

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(key for key in self._values if key.isidentifier())})

    @property
    def pair(self) -> tuple[str, str]:
        """Names of the two vehicles, or of the vehicle and the obstacle."""
        if "who" not in self._values:
            raise AttributeError(f"{type(self).__name__} has no pair")
        first, second = self._values["who"]
        return first, second

    @property
    def indices(self) -> tuple[int | None, ...]:
        """Indices of the vehicles of the finding, from 0; None for an obstacle. Empty where it names no vehicle."""
        names = self._values.get("who", [self._values["vehicle"]] if "vehicle" in self._values else [])
        return tuple(index_of(name, self._vehicles) for name in names)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{key}={value!r}' for key, value in self._values.items())})"


class Findings(Sequence[Finding], Table):
    """A list of findings, and a table with a row for each. ``first`` and ``second`` name a pair, ``first_index`` and
    ``second_index`` are the indices from 0. Nested keys are joined by dots; nested tables are left out."""

    def __init__(self, rows: Sequence[Mapping[str, Any]], vehicles: Sequence[str] = ()) -> None:
        self._rows = [Finding(row, vehicles) for row in rows]

    @overload
    def __getitem__(self, index: int) -> Finding: ...
    @overload
    def __getitem__(self, index: slice) -> list[Finding]: ...
    def __getitem__(self, index: int | slice) -> Finding | list[Finding]:
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, Sequence) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def _columns(self) -> dict[str, Any]:
        rows = [flatten(row) for row in self._rows]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def __repr__(self) -> str:
        return f"Findings({self._rows!r})"

    def _repr_html_(self) -> str:
        return make_table([flatten(row) for row in self._rows])


def index_of(name: str, vehicles: Sequence[str]) -> int | None:
    """Returns the index of a vehicle; None for an obstacle."""
    return vehicles.index(name) if name in vehicles else None


def flatten(row: Finding) -> dict[str, Any]:
    """Returns plain values by key, with the names and indices of a pair in cells of their own."""
    cells: dict[str, Any] = {}

    def add(prefix: str, values: Mapping[str, Any]) -> None:
        for key, value in values.items():
            name = prefix + key
            if isinstance(value, Mapping):
                add(f"{name}.", value)
            elif key == "who":
                cells[f"{prefix}first"], cells[f"{prefix}second"] = value
            elif key.endswith("pair") and isinstance(value, (list, tuple)) and len(value) == 2:
                cells[f"{name}.first"], cells[f"{name}.second"] = value
            elif not (isinstance(value, list) and any(isinstance(one, (Mapping, list)) for one in value)):
                cells[name] = value

    add("", row)
    if "who" in row and row._vehicles:
        cells["first_index"], cells["second_index"] = row.indices
    elif "vehicle" in row and row._vehicles:
        (cells["vehicle_index"],) = row.indices
    return cells


def import_pyarrow() -> Any:
    """Imports pyarrow."""
    try:
        import pyarrow
    except ImportError:
        raise ImportError("tables of Arrow need pyarrow: pip install pyarrow") from None
    return pyarrow


def to_arrow_column(values: Any) -> Any:
    """Returns a column of Arrow; one of several types, or of integers above 64 bits, becomes text."""
    pyarrow = import_pyarrow()
    try:
        return pyarrow.array(values)
    except (OverflowError, pyarrow.ArrowInvalid, pyarrow.ArrowTypeError):
        return pyarrow.array([None if value is None else str(value) for value in values])


def to_frame(columns: Any) -> pandas.DataFrame:
    """Returns a data frame of pandas. Imports pandas."""
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    exact = {name: pandas.Series(values, dtype=object) for name, values in columns.items() if is_rounded(values)}
    return pandas.DataFrame({**columns, **exact})


def is_rounded(values: Any) -> bool:
    """Whether pandas would round an integer of a list, because another value is None or a float."""
    if not isinstance(values, list) or all(isinstance(value, int) for value in values):
        return False
    return any(isinstance(value, int) and abs(value) > 2**53 for value in values)


def make_table(rows: Sequence[Mapping[str, Any]], max_rows: int = 10) -> str:
    """Returns the first rows as a table in HTML."""
    if not rows:
        return "<p>none</p>"
    columns = list(dict.fromkeys(key for row in rows for key in row))
    head = "".join(f"<th>{html.escape(str(column))}</th>" for column in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(format_cell(row.get(key), str(key)))}</td>" for key in columns) + "</tr>"
        for row in rows[:max_rows]
    )
    more = f"<p>and {len(rows) - max_rows} more</p>" if len(rows) > max_rows else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


#: Last words of keys with a separation or another distance that must not be shown larger than it is.
DISTANCES = ("separation_m", "min_m", "min", "least", "lower", "lower_m", "clearance_m", "certified_m")


def format_cell(value: object, key: str) -> str:
    """Returns the value of a key as text, rounded to six digits, or down for a separation."""
    if value is None:
        return "-"
    if isinstance(value, float) and key.rpartition(".")[2] in DISTANCES:
        return _native.separation_text(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
