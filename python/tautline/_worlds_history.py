"""History of many worlds, from which another process repeats their bits."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Error

#: First bytes of saved worlds, and the number of bytes of the SHA-256 behind them.
MAGIC, HASH = b"tautline worlds 1\n", 32
#: Largest memory of the arrays of a history [bytes]; a longer history is dropped.
MAX_BYTES = 256 << 20
#: Reasons why worlds cannot be saved, with remedies.
NOT_KEPT = "save: worlds in flight keep no history; give keep_history=True, or save after a reset of all worlds"
STOPPED = "save: a call failed after some worlds had moved; save after a reset of all worlds"
TOO_LONG = "save: the accelerations since the last reset of all worlds exceed 256 MiB; save or reset more often"

Starts = tuple[NDArray[np.float64], NDArray[np.float64]] | None


class History:
    """Calls since the last reset of all worlds. Steps are kept only with ``keep_history=True``."""

    def __init__(self, keeps_steps: bool, seeds: list[int]) -> None:
        self.keeps_steps = keeps_steps
        self._lost: str | None = None
        self._begin(seeds, None)

    def _begin(self, seeds: list[int], starts: Starts) -> None:
        self._calls: list[dict[str, Any]] = []
        self._arrays: list[NDArray[Any]] = []
        self._bytes, self._lost = 0, None
        self._add({"seeds": seeds}, *(starts or ()))

    def _add(self, call: dict[str, Any], *arrays: NDArray[Any]) -> None:
        self._calls.append({**call, "arrays": len(arrays)})
        self._arrays.extend(arrays)
        self._bytes += sum(array.nbytes for array in arrays)
        if self._bytes > MAX_BYTES:
            self.lose(TOO_LONG)

    def lose(self, reason: str) -> None:
        """Drops the history up to the next reset of all worlds."""
        self._calls, self._arrays, self._lost = [], [], self._lost or reason

    def add_step(self, u: NDArray[np.floating[Any]] | None, steps: int) -> None:
        """Adds steps under the law, or with accelerations (E, N, 3) or (E, N, 2), which must not change later."""
        if not self.keeps_steps:
            self.lose(NOT_KEPT)
        elif self._lost is None:
            self._add({"steps": steps}, *(() if u is None else (u,)))

    def add_reset(self, mask: NDArray[np.bool_], seeds: list[int], starts: Starts) -> None:
        """Adds a reset of the worlds with ``mask`` to these seeds of all worlds. A reset of all begins anew."""
        if mask.all():
            self._begin(seeds, starts)
        elif self._lost is None:
            self._add({"seeds": seeds}, mask, *(starts or ()))

    def copy(self) -> History:
        """Returns an independent copy."""
        copied = object.__new__(History)
        copied.__dict__.update(self.__dict__, _calls=list(self._calls), _arrays=list(self._arrays))
        return copied

    def saved(self, about: dict[str, Any], state: NDArray[np.float64]) -> bytes:
        """Returns the history as bytes, with facts about the worlds and their present state."""
        if self._lost is not None:
            raise Error(self._lost)
        header = json.dumps({**about, "calls": self._calls, "keeps_steps": self.keeps_steps})
        file = io.BytesIO()
        named = {f"a{number}": array for number, array in enumerate(self._arrays)}
        np.savez(file, allow_pickle=False, header=np.array(header), state=state, **named)
        return MAGIC + hashlib.sha256(file.getvalue()).digest() + file.getvalue()


class Saved:
    """Contents of saved worlds."""

    def __init__(self, data: object) -> None:
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise TypeError(f"data: bytes are needed, not {type(data).__name__}")
        found = bytes(data)
        rest = found[len(MAGIC) + HASH :]
        if not found.startswith(MAGIC) or found[len(MAGIC) :][:HASH] != hashlib.sha256(rest).digest():
            raise Error(f"data: not the bytes of save(), or damaged ({len(found)} bytes)")
        with np.load(io.BytesIO(rest), allow_pickle=False) as arrays:
            self.about: dict[str, Any] = json.loads(str(arrays["header"]))
            self.state: NDArray[np.float64] = arrays["state"]
            self._arrays = [arrays[f"a{number}"] for number in range(len(arrays.files) - 2)]

    def calls(self) -> Iterator[tuple[dict[str, Any], list[NDArray[Any]]]]:
        """Returns the calls with their arrays, in order. The first one has the seeds and starts of all worlds."""
        arrays = iter(self._arrays)
        for call in self.about["calls"]:
            yield call, [next(arrays) for _ in range(call["arrays"])]

    def check(self, state: Callable[[], NDArray[np.float64]]) -> None:
        """Raises :class:`Error` where the repeated state differs."""
        if state().tobytes() != self.state.tobytes():
            raise Error("data: the flight did not repeat; load it with the program that saved it")
