"""Pickles that detect damaged bytes: a SHA-256 over all values, checked when the pickle is loaded."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._native import Error


def sealed(*values: Any) -> tuple[Any, ...]:
    """Returns the values and their SHA-256."""
    return *values, hash_of(values)


def unsealed(what: str, *values: Any) -> tuple[Any, ...]:
    """Returns the values without their SHA-256. Raises :class:`Error` where they do not have it."""
    *found, hash = values
    if hash != hash_of(found):
        raise Error(f"{what}: the bytes of the pickle are damaged; pickle the object again")
    return tuple(found)


def hash_of(value: Any) -> str:
    """Returns the SHA-256 of nested values and arrays, which does not depend on the process."""
    hasher = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, Mapping):
            add([part for item in value.items() for part in item])
        elif isinstance(value, (list, tuple)):
            hasher.update(f"list {len(value)}\n".encode())
            for part in value:
                add(part)
        elif isinstance(value, np.ndarray) and value.dtype.kind != "O":
            hasher.update(f"array {value.dtype.str} {value.shape}\n".encode())
            hasher.update(value.tobytes())
        elif isinstance(value, np.ndarray):
            add(value.tolist())
        else:
            text = repr(value).encode("utf-8", "surrogatepass")
            hasher.update(f"{type(value).__name__} {len(text)}\n".encode())
            hasher.update(text)

    add(value)
    return hasher.hexdigest()
