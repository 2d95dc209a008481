"""Rows with typed attributes, and their tables."""

from __future__ import annotations

import html
import inspect
import types
import typing
from collections.abc import ItemsView, Iterable, Iterator, KeysView, Mapping, Sequence, ValuesView
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from . import _native

if TYPE_CHECKING:
    import pandas
    import pyarrow

#: Types of the values of a column: in pandas, in pandas with missing values, and in Arrow.
DTYPES = {
    float: ("float64", "float64", "float64"),
    int: ("int64", "Int64", "int64"),
    bool: ("bool", "boolean", "bool_"),
    str: ("string", "string", "string"),
}
#: Values of a column, and their type as an annotation; None for a type that is inferred.
Column = tuple[Any, Any]


class Table:
    """A flat table: a row for each finding, instant or flight, and a column of plain values for each key.

    Its columns and their types do not depend on the number of rows. With pyarrow, other libraries read it through
    Arrow: ``polars.DataFrame(answer)``, ``duckdb.sql("from answer")``, ``pyarrow.table(answer)``.

    A table is no ``collections.abc.Mapping`` or ``Sequence``: polars would read it by its keys or items.
    """

    def _columns(self) -> dict[str, Column]:
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a data frame of pandas. Imports pandas."""
        try:
            import pandas
        except ImportError:
            raise ImportError("tables need pandas: pip install pandas") from None
        return pandas.DataFrame({name: to_series(pandas, *column) for name, column in self._columns().items()})

    def to_arrow(self) -> pyarrow.Table:
        """Returns a table of Arrow. Imports pyarrow."""
        pyarrow = import_pyarrow()
        return pyarrow.table({name: to_arrow_column(*column) for name, column in self._columns().items()})

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Exports the table to any library that reads the Arrow PyCapsule interface. Imports pyarrow."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)


class Record:
    """Values by key. Keys are attributes as well: as attributes, objects are rows and lists of objects are tables.
    Subclasses annotate their keys."""

    _kinds: Mapping[str, Any] = {}

    def __init_subclass__(cls) -> None:
        own = inspect.get_annotations(cls, eval_str=True)
        cls._kinds = {**cls._kinds, **{key: kind for key, kind in own.items() if not key.startswith("_")}}

    def __init__(self, values: Mapping[str, Any], vehicles: Sequence[str] = ()) -> None:
        self._values, self._vehicles = dict(values), vehicles
        # A key such as `values` replaces the method of this name.
        self.__dict__.update({key: value for key, value in self._values.items() if hasattr(Mapping, key)})

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, key: object) -> bool:
        return key in self._values

    def keys(self) -> KeysView[str]:
        """Returns the keys."""
        return self._values.keys()

    def values(self) -> ValuesView[Any]:
        """Returns the values."""
        return self._values.values()

    def items(self) -> ItemsView[str, Any]:
        """Returns pairs of a key and its value."""
        return self._values.items()

    def get(self, key: str, /, default: Any = None) -> Any:
        """Returns the value of a key, or the default."""
        return self._values.get(key, default)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Record):
            return self._values == other._values
        return self._values == dict(other) if isinstance(other, Mapping) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    if not TYPE_CHECKING:

        def __getattr__(self, key):
            if key.startswith("_") or not (key in self._values or key in self._kinds):
                raise AttributeError(f"{type(self).__name__} has no attribute or key {key!r}")
            kind, value = without_none(self._kinds.get(key)), self._values.get(key)
            if typing.get_origin(kind) is Rows:
                return Rows(typing.get_args(kind)[0], value or (), self._vehicles)
            if kind is None and isinstance(value, list) and value and all(isinstance(row, Mapping) for row in value):
                return Rows(Row, value, self._vehicles)
            if isinstance(value, Mapping) and (kind is None or is_row(kind)):
                return (kind or Row)(value, self._vehicles)
            return tuple(value) if typing.get_origin(kind) is tuple else value

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._kinds, *filter(str.isidentifier, self._values)})

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{key}={value!r}' for key, value in self._values.items())})"


class Row(Record, Mapping[str, Any]):
    """A row of a result: a mapping with the keys of its JSON, which are attributes as well. As attributes, objects are
    rows and lists of objects are tables. Subclasses annotate their keys."""

    @property
    def indices(self) -> tuple[int | None, ...]:
        """Indices of the vehicles of the row, from 0; None for an obstacle. Empty where it names no vehicle."""
        names = self._values.get("subjects", [self._values["vehicle"]] if "vehicle" in self._values else [])
        return tuple(self._vehicles.index(name) if name in self._vehicles else None for name in names)


class OpenRow(Row):
    """A row with more keys than those that are annotated."""

    if TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any: ...


R = TypeVar("R", bound=Row, covariant=True)


class Rows(Table, Generic[R]):
    """A list of rows, and a table. In the table nested keys are joined by dots, and nested tables are left out.
    ``first`` and ``second`` are the subjects, ``first_index`` and ``second_index`` their indices from 0."""

    def __init__(self, kind: type[R], rows: Iterable[Mapping[str, Any]], vehicles: Sequence[str] = ()) -> None:
        self._kind, self._rows = kind, [kind(row, vehicles) for row in rows]

    @overload
    def __getitem__(self, index: int) -> R: ...
    @overload
    def __getitem__(self, index: slice) -> list[R]: ...
    def __getitem__(self, index: int | slice) -> R | list[R]:
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[R]:
        return iter(self._rows)

    def __reversed__(self) -> Iterator[R]:
        return reversed(self._rows)

    def __contains__(self, row: object) -> bool:
        return row in self._rows

    def index(self, row: object) -> int:
        """Returns the index of the first equal row. Raises ``ValueError`` if no row is equal."""
        return self._rows.index(row)  # type: ignore[arg-type]

    def count(self, row: object) -> int:
        """Returns the number of equal rows."""
        return self._rows.count(row)  # type: ignore[arg-type]

    def __eq__(self, other: object) -> bool:
        return self._rows == list(other) if isinstance(other, (Rows, Sequence)) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def _columns(self) -> dict[str, Column]:
        columns = to_columns(self._kind, self._rows)
        for k, name in enumerate(name for name in ("first", "second", "vehicle") if name in columns):
            indices = [row.indices[k] if k < len(row.indices) else None for row in self._rows]
            columns[f"{name}_index"] = indices, int | None
        return columns

    def __repr__(self) -> str:
        return f"Rows({self._rows!r})"

    def _repr_html_(self) -> str:
        return make_table(self._columns(), len(self))


def without_none(kind: Any) -> Any:
    """Returns an annotation without None. Several types are those of any object."""
    if typing.get_origin(kind) not in (typing.Union, types.UnionType):
        return kind
    kinds = [one for one in typing.get_args(kind) if one is not type(None)]
    return kinds[0] if len(kinds) == 1 else object


def is_row(kind: Any) -> bool:
    """Whether an annotation is a class of rows."""
    return isinstance(kind, type) and issubclass(kind, Row)


def to_columns(kind: type[Row], rows: Sequence[Mapping[str, Any] | None], prefix: str = "") -> dict[str, Column]:
    """Returns values and type of each column: of the annotated keys, then of other keys of the rows."""
    columns: dict[str, Column] = {}
    for key in dict.fromkeys([*kind._kinds, *(key for row in rows for key in row or ())]):
        name, declared, values = prefix + key, kind._kinds.get(key), [row.get(key) if row else None for row in rows]
        inner = without_none(declared)
        if is_row(inner) or (declared is None and any(isinstance(value, Mapping) for value in values)):
            columns |= to_columns(inner or Row, values, f"{name}.")
        elif key == "subjects" or key.endswith("pair"):
            start, item = prefix if key == "subjects" else f"{name}.", (*typing.get_args(inner), None)[0]
            for k, end in enumerate(("first", "second")):
                cells = [value[k] if value and k < len(value) else None for value in values]
                columns[start + end] = cells, item and item | None
        elif typing.get_origin(inner) in (Rows, Mapping) or any(is_nested(value) for value in values):
            continue
        else:
            # A missing value must not round integers.
            is_integer = {type(value) for value in values} == {int, type(None)}
            columns[name] = values, int | None if is_integer else declared | None if prefix and declared else declared
    return columns


def is_nested(value: object) -> bool:
    """Whether a value is a list of objects or lists."""
    return isinstance(value, list) and any(isinstance(one, (Mapping, list)) for one in value)


def import_pyarrow() -> Any:
    """Imports pyarrow."""
    try:
        import pyarrow
    except ImportError:
        raise ImportError("tables of Arrow need pyarrow: pip install pyarrow") from None
    return pyarrow


def to_arrow_column(values: Any, kind: Any = None) -> Any:
    """Returns a column of Arrow; one of several types, or of integers above 63 bits, becomes text."""
    pyarrow, kind = import_pyarrow(), without_none(kind)
    item = (typing.get_args(kind) or (kind,))[0]
    dtype = getattr(pyarrow, DTYPES[item][2])() if item in DTYPES else None
    try:
        if kind is not object:
            return pyarrow.array(values, pyarrow.list_(dtype) if item is not kind else dtype)
    except (OverflowError, pyarrow.ArrowInvalid, pyarrow.ArrowTypeError):
        pass
    return pyarrow.array([None if value is None else str(value) for value in values], pyarrow.string())


def to_series(pandas: Any, values: Any, kind: Any = None) -> Any:
    """Returns a column of pandas."""
    inner = without_none(kind)
    dtypes = DTYPES.get(inner, ("object", "object"))
    try:
        return pandas.Series(values, dtype=None if kind is None else dtypes[inner is not kind])
    except OverflowError:
        return pandas.Series(values, dtype="object")


def make_table(columns: Mapping[str, Column], count: int, max_rows: int = 10) -> str:
    """Returns the first rows as a table in HTML."""
    if count == 0:
        return "<p>none</p>"
    head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(shown_cell(cells[k], name))}</td>" for name, (cells, _) in columns.items())
        for k in range(min(count, max_rows))
    )
    more = f"<p>and {count - max_rows} more</p>" if count > max_rows else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def shown_cell(value: object, key: str) -> str:
    """Returns the value of a key as a text for a small table. Long lists are cut."""
    text, most = format_cell(value, key), 200 if isinstance(value, str) else 40
    return text if len(text) <= most else f"{text[: most - 1]}…"


#: Last words of keys with a separation or another distance that must not be shown larger than it is.
DISTANCES = ("separation_m", "min_m", "min", "least", "lower", "lower_m", "clearance_m", "certified_m")


def format_cell(value: object, key: str) -> str:
    """Returns the value of a key as text, rounded to six digits, or down for a separation."""
    if value is None:
        return "-"
    if isinstance(value, float) and key.rpartition(".")[2] in DISTANCES:
        return _native.separation_text(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
