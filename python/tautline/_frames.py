"""Tables of other libraries: data frames and tables of Arrow, which the audit reads as a file of Parquet."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ._arguments import EXACT_INTEGER, LARGE_INTEGER
from ._native import Error
from ._tables import Table, import_pyarrow

#: Remedy for a column that the reader does not know.
REMEDY = "give numbers as float64, times as time stamps and names as text, or remove the column"
#: Beginnings of the types of times in NumPy, pandas, polars and Arrow.
TIMES = ("datetime", "timedelta", "timestamp", "duration")
#: Words of a column for an axis. In a name of several levels the axis comes last.
AXES = {f"{prefix}{axis}" for prefix in ("", "v", "v_") for axis in "xyz"}


class ArrowTable(Protocol):
    """A table that exports a stream of Arrow, such as a data frame of pandas, polars or pyarrow."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...


def is_frame(value: object) -> bool:
    """Whether a value is a table of another library: a data frame, or one that exports a stream of Arrow."""
    exports = hasattr(value, "__arrow_c_stream__") or hasattr(value, "__dataframe__")
    return exports and not isinstance(value, type)


class ParquetFrame:
    """A table in a temporary file of Parquet, which exists as long as this object."""

    def __init__(self, frame: object) -> None:
        pyarrow = import_pyarrow()
        from pyarrow import parquet

        name = type(frame).__name__
        if isinstance(frame, Table) and hasattr(frame, "audit"):
            raise TypeError(f"t: a {name} has an audit of its own; call .audit(...) on it")
        if name in ("Series", "ChunkedArray"):
            raise TypeError(f"t: a {name} has a single column; give a table, or positions beside the times")
        table = to_table(pyarrow, frame)
        folder = tempfile.mkdtemp(prefix="tautline-")
        weakref.finalize(self, remove, folder, os.getpid())
        # The reader names the only vehicle of a table without names after its file.
        self.path = Path(folder) / "table.parquet"
        try:
            parquet.write_table(table, self.path, compression="none")
        except pyarrow.ArrowException as problem:
            raise Error(f"t: the table cannot be stored: {problem}; {REMEDY}") from None


def remove(folder: str, process: int) -> None:
    """Removes the folder of a process, unless this is a copy of the process."""
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def to_table(pyarrow: Any, frame: object) -> Any:
    """Returns a table of another library as a table of Arrow, with columns that the reader of Parquet knows.

    NaN becomes null: the vehicle is not seen, as in arrays. Durations become time stamps, whose unit the reader knows.
    """
    try:
        if type(frame).__module__.partition(".")[0] == "pandas":
            table = of_pandas(pyarrow, frame)
        elif hasattr(frame, "__arrow_c_stream__"):
            table = pyarrow.table(frame)
        else:
            from pyarrow import interchange

            table = interchange.from_dataframe(frame)
    except (AttributeError, TypeError, ValueError, pyarrow.ArrowException) as problem:
        if isinstance(problem, Error):
            raise
        raise Error(f"t: {type(frame).__name__} cannot be read as a table: {problem}; {REMEDY}") from None
    check_names(table.column_names)
    columns = zip(table.column_names, table.columns, strict=True)
    return pyarrow.table({name: to_known(pyarrow, name, column) for name, column in columns})


def to_known(pyarrow: Any, name: str, column: Any) -> Any:
    """Returns a column with a type that the reader of Parquet knows. Raises :class:`Error` where it has none."""
    types = pyarrow.types
    if isinstance(column.type, pyarrow.BaseExtensionType):
        # Its numbers have a meaning that the file would lose, such as days since 1970.
        raise Error(f"t: column {name!r} has the type {column.type}; {REMEDY}")
    if types.is_dictionary(column.type):
        column = decoded(pyarrow, column)
    kind = column.type
    if types.is_duration(kind):
        return column.cast(pyarrow.int64()).cast(pyarrow.timestamp(kind.unit))
    if types.is_string_view(kind):
        return column.cast(pyarrow.string())
    if types.is_float16(kind):
        column = column.cast(pyarrow.float32())
    if types.is_uint32(kind) or types.is_uint64(kind):
        try:
            return column.cast(pyarrow.int64())
        except pyarrow.ArrowInvalid:
            raise Error(f"t: column {name!r}: {LARGE_INTEGER}") from None
    if types.is_floating(kind):
        from pyarrow import compute

        is_nan = compute.is_nan(column)
        return compute.if_else(is_nan, None, column) if compute.any(is_nan).as_py() else column
    return column


def decoded(pyarrow: Any, column: Any) -> Any:
    """Returns the values of a column of categories."""
    kind = column.type.value_type
    kind = pyarrow.string() if pyarrow.types.is_string_view(kind) else kind
    return pyarrow.chunked_array([part.dictionary.cast(kind).take(part.indices) for part in column.chunks], kind)


def check_names(names: list[str]) -> None:
    """Raises :class:`Error` for two columns with one name."""
    if len(set(names)) < len(names):
        repeated = next(name for name in names if names.count(name) > 1)
        raise Error(f"t: two columns have the name {repeated!r}; rename one")


def of_pandas(pyarrow: Any, frame: Any) -> Any:
    """Returns a data frame of pandas as a table of Arrow.

    An index that has a name or times becomes a column, another index is left out. Columns of several levels get one
    name, such as ``cf1.x``.
    """
    frame = frame.set_axis(column_names(list(frame.columns)), axis=1)
    check_names(list(frame.columns))
    levels = {}
    for level, name in enumerate(frame.index.names):
        has_times = frame.index.get_level_values(level).dtype.kind in "mM"
        name = "t" if name is None and has_times else name
        if name is not None and str(name) not in frame.columns:
            levels[level] = str(name)
    if levels:
        frame = frame.reset_index(level=list(levels), names=list(levels.values()))
    try:
        return pyarrow.Table.from_pandas(frame, preserve_index=False)
    except (TypeError, ValueError, pyarrow.ArrowException):
        for name in frame.columns:
            try:
                pyarrow.array(frame[name], from_pandas=True)
            except (TypeError, ValueError, pyarrow.ArrowException):
                problem = "holds values of several kinds, or of no known kind"
                raise Error(f"t: column {name!r} {problem}; {REMEDY}") from None
        raise


def column_names(names: list[object]) -> list[str]:
    """Returns the names of columns: of two levels ``vehicle.axis``, in either order.

    Raises :class:`Error` where the words of both levels are axes.
    """
    tuples = [name if isinstance(name, tuple) else (name,) for name in names]
    parts = [[str(level) for level in levels if level != ""] for levels in tuples]
    pairs = [levels for levels in parts if len(levels) == 2]
    are_axes = [bool(pairs) and all(levels[k].lower() in AXES for levels in pairs) for k in (0, 1)]
    if all(are_axes):
        raise Error("t: both levels of the columns are axes, such as x; rename the vehicles")
    return [".".join(levels[::-1] if are_axes[0] and len(levels) == 2 else levels) for levels in parts]


def to_seconds(value: object) -> NDArray[np.float64] | None:
    """Returns ``datetime64`` as seconds since its first instant, ``timedelta64`` as seconds; None for other values.

    Raises :class:`Error` for an unknown time, and for a unit whose length varies.
    """
    array: Any = value
    if not isinstance(value, np.ndarray):
        if not str(getattr(value, "dtype", getattr(value, "type", ""))).lower().startswith(TIMES):
            return None
        array = np.asarray(value)
        if array.dtype.kind == "O":
            # Time stamps of pandas with a time zone.
            array = value.to_numpy(dtype="datetime64[ns]")  # type: ignore[attr-defined]
    if array.dtype.kind not in "mM":
        return None
    if np.isnat(array).any():
        raise Error("t: a time is unknown (NaT); remove the instant")
    unit, _ = np.datetime_data(array.dtype)
    if unit in ("generic", "Y", "M"):
        raise Error(f"t: the unit of {array.dtype} has no fixed length; give seconds or a finer unit")
    counts = array.astype(np.int64)
    first = int(counts.flat[0]) if array.dtype.kind == "M" and array.size else 0
    if array.size and max(int(counts.max()) - first, first - int(counts.min())) > EXACT_INTEGER:
        raise Error(f"t: {array.dtype} counts beyond 2^53, where float64 rounds; give a coarser unit")
    if array.dtype.kind == "M" and array.size:
        array = array - array.flat[0]
    seconds: NDArray[np.float64] = array / np.timedelta64(1, "s")
    return seconds
