"""Checks arguments of functions and converts them for the native module. `what` is the name of the argument."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import Error

T = TypeVar("T")
#: Codes of errors for a file that cannot be opened.
MISSING_FILE_CODES = (
    "recording/not-found",
    "scenario/not-found",
    "scenario/cannot-read",
    "campaign/cannot-read",
    "files/cannot-read",
)
PathLike = str | os.PathLike[str]

if TYPE_CHECKING:
    from ._words import Duplicates, MessageClock, PlanEnd, ReadFormat, TimeUnit

#: Largest integer up to which every integer is a float64.
EXACT_INTEGER = 2**53
#: Problem and remedy of a larger integer.
LARGE_INTEGER = "an integer is larger than 2^53 and is no float64; subtract an offset first"


def exact_array(value: object, what: str) -> NDArray[np.float64]:
    """Returns an array of float64 with exactly the given numbers: of an array, a tensor, or nested lists.

    An array of float64 is returned as it is. Raises ``TypeError`` for other kinds of numbers and :class:`Error` for
    integers that float64 cannot hold.
    """
    # No masked array, and no conversion: calls that step a simulation pass here.
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    array = value if isinstance(value, np.ndarray) else foreign_array(value, what)
    if isinstance(array, np.ma.MaskedArray):
        raise TypeError(f"{what}: a masked array has unknown numbers; give it as .filled(numpy.nan)")
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "f" and size <= 8:
        if array is not value and has_large_number(array) and may_have_large_integer(value):
            raise Error(f"{what}: {LARGE_INTEGER}")
        return array.astype(np.float64, copy=False)
    if kind in "iu":
        if may_have_large_integer(array):
            raise Error(f"{what}: {LARGE_INTEGER}")
        return array.astype(np.float64)
    raise TypeError(f"{what}: real numbers of at most 64 bits are needed, not {array.dtype}; give float64 or float32")


def foreign_array(value: object, what: str) -> NDArray[Any]:
    """Returns the array of a list or of an array of another library, such as a tensor."""
    if isinstance(value, (list, tuple)):
        rows = (row for part in value for row in (part, *(part if isinstance(part, (list, tuple)) else ())))
        if any(isinstance(row, np.ma.MaskedArray) for row in rows):
            raise TypeError(f"{what}: a masked array has unknown numbers; give it as .filled(numpy.nan)")
        try:
            return np.asarray(value)
        except ValueError as problem:
            raise Error(f"{what}: {problem}; give rows of equal length") from None
    try:
        if hasattr(value, "__array__"):
            return np.asarray(value)
        if hasattr(value, "__dlpack__"):
            return np.from_dlpack(value)
    except (TypeError, ValueError, RuntimeError, BufferError) as problem:
        raise TypeError(f"{what}: {problem}") from None
    raise TypeError(f"{what}: an array is needed, not {type(value).__name__}; give numpy.asarray(..., dtype=float)")


def has_large_number(array: NDArray[Any]) -> bool:
    """Whether an array of floats has a finite number from which a larger integer could have been rounded."""
    sizes = np.abs(array)
    return bool(((sizes >= EXACT_INTEGER) & np.isfinite(sizes)).any())


def may_have_large_integer(value: object) -> bool:
    """Whether the source of an array has an integer above 2^53, which NumPy rounds beside a float.

    True for a table or an array of another library whose type is not a float: its integers are rounded beside
    unknown numbers and other columns.
    """
    if isinstance(value, (list, tuple)):
        return any(map(may_have_large_integer, value))
    if isinstance(value, np.ndarray):
        is_integer = value.dtype.kind in "iu" and value.size > 0
        return is_integer and (int(value.max()) > EXACT_INTEGER or int(value.min()) < -EXACT_INTEGER)
    if isinstance(value, (int, np.integer)):
        return abs(int(value)) > EXACT_INTEGER
    if isinstance(value, (float, np.floating)):
        return False
    return "float" not in str(getattr(value, "dtype", "")).lower()


class ReadOptions(TypedDict, total=False):
    """Options of reading, as keyword arguments of :func:`read`, :func:`audit` and :func:`export`."""

    format: ReadFormat | None
    time_unit: TimeUnit | None
    fps: float | None
    time_scale: float | None
    sort: bool
    duplicates: Duplicates | None
    one_vehicle: bool
    skip_incomplete: bool
    distinct: bool
    clock: MessageClock | None
    scale: float | Iterable[float] | None
    axes: str | None
    dimensions: int | str | None
    column: Mapping[str, str] | None
    start: Mapping[str, Iterable[float]] | None
    layout: str | None
    frame: str | None
    topic: str | Sequence[str] | None
    origin: Iterable[float] | None
    plan_end: PlanEnd | None
    join: bool
    allow_unfinished: bool


def number(value: object, what: str) -> float:
    """Returns a number. Raises :class:`Error` for an integer that float64 cannot hold."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{what}: a number is needed, not {type(value).__name__}")
    try:
        found = float(value)
    except OverflowError:
        raise Error(f"{what}: the number is too large") from None
    if isinstance(value, (int, np.integer)) and found != int(value):
        raise Error(f"{what}: the integer {value} is no float64; give {found!r}")
    return found


def optional_number(value: object, what: str) -> float | None:
    """Returns a number or None."""
    return None if value is None else number(value, what)


def numbers(value: object, what: str) -> list[float]:
    """Returns a list of numbers."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise TypeError(f"{what}: a list of numbers is needed, not {type(value).__name__}")
    return [number(x, what) for x in value]


def optional_vector(value: object, what: str) -> list[float] | None:
    """Returns three numbers or None."""
    if value is None:
        return None
    found = numbers(value, what)
    if len(found) != 3:
        raise Error(f"{what}: three numbers are needed, not {len(found)}")
    return found


def name_or_numbers(value: object, what: str) -> str | None:
    """Returns a name as it is, numbers as a text with commas, or None."""
    if value is None or isinstance(value, str):
        return value
    return ",".join(repr(number) for number in numbers(value, what))


def count(value: object, what: str) -> int:
    """Returns an integer from 0 on."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{what}: a whole number is needed, not {type(value).__name__}")
    if not 0 <= value < 2**63:
        raise Error(f"{what}: must be a whole number from 0 on, got {value}")
    return int(value)


def optional_count(value: object, what: str) -> int | None:
    """Returns an integer from 0 on, or None."""
    return None if value is None else count(value, what)


def number_or_by_name(value: object, what: str) -> float | dict[str, float] | None:
    """Returns the number of all vehicles, numbers of vehicles by name, or None."""
    return numbers_by_name(value, what) if isinstance(value, Mapping) else optional_number(value, what)


def numbers_by_name(value: object, what: str) -> dict[str, float]:
    """Returns a dictionary of numbers."""
    return {str(name): number(x, what) for name, x in mapping(value, what).items()}


def boolean(value: object, what: str) -> bool:
    """Returns True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what}: True or False is needed, not {type(value).__name__}")
    return bool(value)


def optional_text(value: object, what: str) -> str | None:
    """Returns a string or None."""
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{what}: a string is needed, not {type(value).__name__}")
    return value


def mapping(value: object, what: str) -> Mapping[Any, Any]:
    """Returns a dictionary, an empty one for None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{what}: a dictionary is needed, not {type(value).__name__}")
    return value


def name_list(value: object, what: str) -> list[str]:
    """Returns names. A single string is refused: its letters are no names."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise TypeError(f"{what}: a list of names is needed, not {type(value).__name__}")
    return [str(name) for name in value]


def optional_names(value: object, what: str) -> list[str] | None:
    """Returns names or None."""
    return None if value is None else name_list(value, what)


def path(value: object, what: str) -> str:
    """Returns a path as text. A leading `-` gets `./` in front: it stands for a file, not for standard output."""
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise TypeError(f"{what}: a path is needed, not {type(value).__name__}")
    found = os.fspath(value)
    return f".{os.sep}{found}" if found.startswith("-") else found


def optional_path(value: object, what: str) -> str | None:
    """Returns a path or None."""
    return None if value is None else path(value, what)


def paths(given: object, what: str) -> list[str]:
    """Returns the paths of a path or a list of paths."""
    files = [path(file, what) for file in (given if isinstance(given, (list, tuple)) else [given])]
    if not files:
        raise Error(f"{what}: none is given")
    return files


def with_files(files: Iterable[PathLike], work: Callable[[], T]) -> T:
    """Calls ``work``, which reads files. Raises ``FileNotFoundError`` where it fails because one of them is missing."""
    try:
        return work()
    except Error as error:
        if error.code not in MISSING_FILE_CODES or all(Path(file).exists() for file in files):
            raise
        missing = FileNotFoundError(str(error))
        missing.code = error.code  # type: ignore[attr-defined]
        raise missing from None


def read_options(
    *,
    format: str | None = None,
    time_unit: str | None = None,
    fps: float | None = None,
    time_scale: float | None = None,
    sort: bool = False,
    duplicates: str | None = None,
    one_vehicle: bool = False,
    skip_incomplete: bool = False,
    distinct: bool = False,
    clock: str | None = None,
    scale: float | Iterable[float] | None = None,
    axes: str | None = None,
    dimensions: int | str | None = None,
    column: Mapping[str, str] | None = None,
    start: Mapping[str, Iterable[float]] | None = None,
    layout: str | None = None,
    frame: str | None = None,
    topic: str | Sequence[str] | None = None,
    origin: Iterable[float] | None = None,
    plan_end: str | None = None,
    join: bool = False,
    allow_unfinished: bool = False,
) -> _native.ReadOptions:
    """Returns the options of reading."""
    metres = None
    if scale is not None:
        metres = numbers(scale, "scale") if isinstance(scale, Iterable) else [number(scale, "scale")]
    starts = mapping(start, "start").items()
    return _native.ReadOptions(
        format=optional_text(format, "format"),
        time_unit=optional_text(time_unit, "time_unit"),
        fps=optional_number(fps, "fps"),
        time_scale=optional_number(time_scale, "time_scale"),
        sort=boolean(sort, "sort"),
        duplicates=optional_text(duplicates, "duplicates"),
        one_vehicle=boolean(one_vehicle, "one_vehicle"),
        skip_incomplete=boolean(skip_incomplete, "skip_incomplete"),
        distinct=boolean(distinct, "distinct"),
        clock=optional_text(clock, "clock"),
        scale=metres,
        axes=optional_text(axes, "axes"),
        dimensions=None if dimensions is None else str(dimensions),
        column=[(str(role), str(name)) for role, name in mapping(column, "column").items()],
        start=[(str(name), optional_vector(place, "start") or [0.0] * 3) for name, place in starts],
        layout=optional_text(layout, "layout"),
        frame=optional_text(frame, "frame"),
        topic=[topic] if isinstance(topic, str) else name_list(topic or [], "topic"),
        origin=optional_vector(origin, "origin"),
        plan_end=optional_text(plan_end, "plan_end"),
        allow_unfinished=boolean(allow_unfinished, "allow_unfinished"),
    )


def single_recording(files: list[str], read_as: Mapping[str, Any]) -> list[str]:
    """Returns the files. Raises :class:`Error` for several files without ``join=True``."""
    if len(files) > 1 and not boolean(read_as.get("join", False), "join"):
        raise Error("several recordings are given; give one, or join=True for the files of one recording")
    return files
