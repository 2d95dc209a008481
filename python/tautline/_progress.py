"""Progress of studies: a bar, or a function of the caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: Receives the units of work that are done, and their number if it is known. Units depend on the study.
Report = Callable[[int, "int | None"], object]
#: What `progress=` takes: None or False for none, True for a bar of tqdm, or a function.
Progress = bool | Report | None


class Bar:
    """A bar of tqdm."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise ImportError("progress=True needs tqdm: pip install tqdm") from None
        # The units differ from study to study.
        self._bar: Any = tqdm(bar_format="{percentage:3.0f}%|{bar}| {elapsed}<{remaining}")

    def __call__(self, done: int, total: int | None) -> None:
        self._bar.total = total
        self._bar.update(done - self._bar.n)
        if total is not None and done >= total:
            self._bar.close()


def to_report(progress: Progress) -> Report | None:
    """Returns the function that receives the progress. Raises ``TypeError`` for other values."""
    if progress is None or progress is False:
        return None
    if progress is True:
        return Bar()
    if not callable(progress):
        raise TypeError(f"progress: True, a function or None is needed, not {type(progress).__name__}")
    return progress
