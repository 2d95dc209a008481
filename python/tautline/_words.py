"""Arguments of functions, checked and as the native half takes them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from . import _native
from ._native import Error

T = TypeVar("T")
#: Codes of errors about a file that cannot be opened.
MISSING = ("recording/not-found", "scenario/not-found", "scenario/cannot-read", "campaign/cannot-read", "files/cannot-read")
PathLike = str | os.PathLike[str]


def number(value: object, what: str) -> float:
    """A number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{what}: a number is needed, not {type(value).__name__}")
    try:
        return float(value)
    except OverflowError:
        raise Error(f"{what}: the number is too large") from None


def maybe(value: object, what: str) -> float | None:
    """A number, or None."""
    return None if value is None else number(value, what)


def numbers(value: object, what: str) -> list[float]:
    """A list of numbers."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise TypeError(f"{what}: a list of numbers is needed, not {type(value).__name__}")
    return [number(x, what) for x in value]


def three(value: object, what: str) -> list[float] | None:
    """Three numbers, or None."""
    if value is None:
        return None
    found = numbers(value, what)
    if len(found) != 3:
        raise Error(f"{what}: three numbers are needed, not {len(found)}")
    return found


def count(value: object, what: str) -> int:
    """A whole number from 0."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{what}: a whole number is needed, not {type(value).__name__}")
    if not 0 <= value < 2**63:
        raise Error(f"{what}: {value} is not a whole number from 0")
    return int(value)


def maybe_count(value: object, what: str) -> int | None:
    """A whole number from 0, or None."""
    return None if value is None else count(value, what)


def of_vehicles(value: object, what: str) -> tuple[float | None, list[tuple[str, float]]]:
    """A number of every vehicle, or a dictionary of numbers by vehicle."""
    if isinstance(value, Mapping):
        return None, by_vehicle(value, what)
    return maybe(value, what), []


def by_vehicle(value: object, what: str) -> list[tuple[str, float]]:
    """Numbers by name."""
    return [(str(name), number(x, what)) for name, x in by_name(value, what).items()]


def flag(value: object, what: str) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what}: True or False is needed, not {type(value).__name__}")
    return bool(value)


def text(value: object, what: str) -> str | None:
    """A word, or None."""
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{what}: a string is needed, not {type(value).__name__}")
    return value


def by_name(value: object, what: str) -> Mapping[Any, Any]:
    """A dictionary, empty of None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{what}: a dictionary is needed, not {type(value).__name__}")
    return value


def listed(value: object, what: str) -> list[str]:
    """Names: of a list, and not the letters of one."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise TypeError(f"{what}: a list of names is needed, not {type(value).__name__}")
    return [str(name) for name in value]


def path(value: object, what: str) -> str:
    """A path as text. A name such as `-` is a file, and not standard output."""
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise TypeError(f"{what}: a path is needed, not {type(value).__name__}")
    found = os.fspath(value)
    return f".{os.sep}{found}" if found.startswith("-") else found


def maybe_path(value: object, what: str) -> str | None:
    """A path, or None."""
    return None if value is None else path(value, what)


def paths(given: object, what: str) -> list[str]:
    """A path or a list of them."""
    files = [path(file, what) for file in (given if isinstance(given, (list, tuple)) else [given])]
    if not files:
        raise Error(f"{what}: none is given")
    return files


def with_files(files: Iterable[PathLike], do: Callable[[], T]) -> T:
    """Does something that reads files; where that fails because one is missing, it is a ``FileNotFoundError``."""
    try:
        return do()
    except Error as error:
        if error.code not in MISSING or all(Path(file).exists() for file in files):
            raise
        missing = FileNotFoundError(str(error))
        missing.code = error.code  # type: ignore[attr-defined]
        raise missing from None


def reading(
    *,
    format: str | None = None,
    time_unit: str | None = None,
    fps: float | None = None,
    time_scale: float | None = None,
    sort: bool = False,
    duplicates: str | None = None,
    one_vehicle: bool = False,
    scale: float | Iterable[float] | None = None,
    axes: str | None = None,
    dimensions: str | None = None,
    column: Mapping[str, str] | None = None,
    start: Mapping[str, Iterable[float]] | None = None,
    layout: str | None = None,
    frame: str | None = None,
    topic: str | Sequence[str] | None = None,
    origin: Iterable[float] | None = None,
    join: bool = False,
    allow_unfinished: bool = False,
) -> _native.ReadOptions:
    """How a recording is read: the options of ``tautline audit --help`` under *Reading*."""
    metres = None
    if scale is not None:
        metres = numbers(scale, "scale") if isinstance(scale, Iterable) else [number(scale, "scale")]
    places = [(str(name), three(place, "start") or [0.0] * 3) for name, place in by_name(start, "start").items()]
    return _native.ReadOptions(
        format=text(format, "format"),
        time_unit=text(time_unit, "time_unit"),
        fps=maybe(fps, "fps"),
        time_scale=maybe(time_scale, "time_scale"),
        sort=flag(sort, "sort"),
        duplicates=text(duplicates, "duplicates"),
        one_vehicle=flag(one_vehicle, "one_vehicle"),
        scale=metres,
        axes=text(axes, "axes"),
        dimensions=None if dimensions is None else str(dimensions),
        column=[(str(role), str(name)) for role, name in by_name(column, "column").items()],
        start=places,
        layout=text(layout, "layout"),
        frame=text(frame, "frame"),
        topic=[topic] if isinstance(topic, str) else listed(topic or [], "topic"),
        origin=three(origin, "origin"),
        allow_unfinished=flag(allow_unfinished, "allow_unfinished"),
    )


def one_recording(files: list[str], read_as: Mapping[str, Any]) -> list[str]:
    """The files of one recording: several belong together with ``join=True`` alone."""
    if len(files) > 1 and not flag(read_as.get("join", False), "join"):
        raise Error("several recordings are given, and one is needed; give each by itself, or join=True for files of one recording")
    return files
