"""Pickles that detect damaged bytes and other versions: a SHA-256 over a version and all values, checked on loading."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._native import Error


#: Version of the values in pickles. It increases when their keys or their order change.
VERSION = "tautline 2"


def sealed(*values: Any) -> tuple[Any, ...]:
    """Returns the version, the values and their SHA-256."""
    return VERSION, *values, hash_of((VERSION, *values))


def unsealed(what: str, *values: Any) -> tuple[Any, ...]:
    """Returns the values alone. Raises :class:`Error` for another SHA-256 or version."""
    *found, hash = values
    if hash != hash_of(found):
        raise Error(f"{what}: the bytes of the pickle are damaged; pickle the object again")
    if found[:1] != [VERSION]:
        raise Error(f"{what}: the pickle is of another version of tautline; make the object again with this version")
    return tuple(found[1:])


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
