"""Tables of other libraries: data frames and tables of Arrow, which the audit reads as a file of Parquet."""

from __future__ import annotations

import os
import tempfile
import weakref
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import EXACT_INTEGER, LARGE_INTEGER
from ._native import Error
from ._tables import import_pyarrow


def is_frame(value: object) -> bool:
    """Whether a value is a table of another library: a data frame, or one that exports a stream of Arrow."""
    return hasattr(value, "__arrow_c_stream__") or hasattr(value, "__dataframe__")


class ParquetFrame:
    """A table in a temporary file of Parquet, which exists as long as this object."""

    def __init__(self, frame: object) -> None:
        pyarrow = import_pyarrow()
        import pyarrow.parquet

        table = to_table(pyarrow, frame)
        with tempfile.NamedTemporaryFile(suffix=".parquet", prefix="tautline-", delete=False) as file:
            self.path = Path(file.name)
            weakref.finalize(self, remove, file.name)
            pyarrow.parquet.write_table(table, file, compression="none")


def remove(file: str) -> None:
    """Removes a file, unless it is missing."""
    try:
        os.remove(file)
    except OSError:
        pass


def to_table(pyarrow: Any, frame: object) -> Any:
    """Returns a table of another library as a table of Arrow.

    An index of pandas that has a name or times becomes a column. Columns of several levels get one name, such as
    ``x_cf1``. Durations become time stamps, whose unit the reader knows.
    """
    if type(frame).__module__.split(".")[0] == "pandas":
        frame = without_levels(frame)
    try:
        table = pyarrow.table(frame)
    except (TypeError, ValueError, pyarrow.ArrowException) as problem:
        raise Error(f"t: the table cannot be read: {problem}; give columns of numbers, times and names") from None
    if repeated := {name for name in table.column_names if table.column_names.count(name) > 1}:
        raise Error(f"t: two columns have the name {min(repeated)!r}; rename one")
    columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if pyarrow.types.is_dictionary(kind):
            column, kind = column.cast(kind.value_type), kind.value_type
        if pyarrow.types.is_duration(kind):
            column = column.cast(pyarrow.int64()).cast(pyarrow.timestamp(kind.unit))
        elif pyarrow.types.is_large_string(kind) or pyarrow.types.is_string_view(kind):
            column = column.cast(pyarrow.string())
        columns[name] = column
    return pyarrow.table(columns)


def without_levels(frame: Any) -> Any:
    """Returns a data frame of pandas whose index and columns have one level, and no index that is a value."""
    if frame.columns.nlevels > 1:
        frame = frame.set_axis(["_".join(str(level) for level in name if level != "") for name in frame.columns], axis=1)
    index = frame.index
    if any(name is not None for name in index.names) or index.dtype.kind in "mM":
        frame = frame.reset_index(names="t") if index.nlevels == 1 and index.name is None else frame.reset_index()
    return frame


def to_seconds(value: object) -> NDArray[np.float64] | None:
    """Returns ``datetime64`` as seconds since its first instant, ``timedelta64`` as seconds; None for other values.

    Raises :class:`Error` for an unknown time, and for a unit whose length varies.
    """
    array = value if isinstance(value, np.ndarray) else getattr(value, "to_numpy", lambda: None)()
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "mM":
        return None
    if np.isnat(array).any():
        raise Error("t: a time is unknown (NaT); remove the instant")
    unit, _ = np.datetime_data(array.dtype)
    if unit in ("generic", "Y", "M"):
        raise Error(f"t: the unit of {array.dtype} has no fixed length; give seconds or a finer unit")
    if array.dtype.kind == "M" and array.size:
        array = array - array.flat[0]
    if array.size and int(np.abs(array.astype(np.int64)).max()) > EXACT_INTEGER:
        raise Error(f"t: {LARGE_INTEGER}")
    return array / np.timedelta64(1, "s")
