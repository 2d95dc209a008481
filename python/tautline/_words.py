"""Options of functions as the words of the command line, which says what they mean and what is wrong with them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ._native import Error

T = TypeVar("T")
PathLike = str | os.PathLike[str]


def number(value: object, what: str) -> str:
    """A number in digits that read back to the same bits."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{what}: a number is needed, not {type(value).__name__}")
    try:
        return repr(float(value))
    except OverflowError:
        raise Error(f"{what}: the number is too large") from None


def numbers(value: Iterable[object], what: str) -> str:
    """Numbers between commas."""
    return ",".join(number(x, what) for x in value)


def of_each(option: str, value: object, what: str) -> list[str]:
    """A number of every vehicle, or a dictionary of numbers by vehicle."""
    if value is None:
        return []
    if isinstance(value, Mapping):
        return [f"{option}={name}={number(x, what)}" for name, x in value.items()]
    return [f"{option}={number(value, what)}"]


def word(name: str) -> str:
    """An option as the command line spells it."""
    return "--" + name.replace("_", "-")


def option(name: str, value: Any) -> list[str]:
    """``--name=value``, or nothing of None; once for each of a list."""
    if value is None:
        return []
    if isinstance(value, (list, tuple)):
        return [part for each in value for part in option(name, each)]
    if isinstance(value, str):
        return [f"{word(name)}={value}"]
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return [f"{word(name)}={int(value)}"]
    return [f"{word(name)}={number(value, name)}"]


def options(**given: Any) -> list[str]:
    """Each as :func:`option`."""
    return [part for name, value in given.items() for part in option(name, value)]


def flags(**given: Any) -> list[str]:
    """``--name`` of each that is true."""
    for name, value in given.items():
        if not isinstance(value, (bool, np.bool_)):
            raise TypeError(f"{name}: True or False is needed, not {type(value).__name__}")
    return [word(name) for name, value in given.items() if value]


def files(**given: PathLike | None) -> list[str]:
    """``--name=path`` of each that is given."""
    return [f"{word(name)}={path(value, name)}" for name, value in given.items() if value is not None]


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
    """A path as text that is never taken for an option."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{what}: a path is needed, not {type(value).__name__}")
    text = os.fspath(value)
    return f".{os.sep}{text}" if text.startswith("-") else text


def paths(given: object, what: str) -> list[str]:
    """A path or a list of them."""
    files = [path(file, what) for file in (given if isinstance(given, (list, tuple)) else [given])]
    if not files:
        raise Error(f"{what}: none is given")
    return files


def with_files(files: Iterable[PathLike], do: Callable[[], T]) -> T:
    """Does something that reads files; where that fails and one is missing, it is a ``FileNotFoundError``."""
    try:
        return do()
    except Error as error:
        if all(Path(file).exists() for file in files):
            raise
        raise FileNotFoundError(str(error)) from None


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
) -> list[str]:
    """How a recording is read: the words of ``tautline audit --help`` under *Reading*."""
    words = options(
        format=format,
        time_unit=time_unit,
        fps=fps,
        time_scale=time_scale,
        duplicates=duplicates,
        axes=axes,
        dimensions=dimensions,
        layout=layout,
        frame=frame,
        topic=topic,
    )
    words += flags(sort=sort, one_vehicle=one_vehicle, join=join, allow_unfinished=allow_unfinished)
    if scale is not None:
        words += [f"--scale={numbers(scale, 'scale') if isinstance(scale, Iterable) else number(scale, 'scale')}"]
    words += [] if origin is None else [f"--origin={numbers(origin, 'origin')}"]
    words += [f"--column={role}={name}" for role, name in by_name(column, "column").items()]
    return words + [f"--start={name}={numbers(place, 'start')}" for name, place in by_name(start, "start").items()]
