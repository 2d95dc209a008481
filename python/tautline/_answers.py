"""Answers of checks, studies and exports, with the types of their keys. docs/studies.md and
docs/campaigns.md explain the keys of studies."""

from __future__ import annotations

import json
from html import escape
from typing import Any

from . import _display
from ._pickles import sealed, unsealed
from ._tables import OpenRow, Row, Rows, format_cell


class Result(Row):
    """A result: a mapping with the keys of its JSON, which are attributes as well. As attributes, lists of objects are
    tables. Printing shows the headline and the summary."""

    #: Attributes that are true or false in place of the result.
    _truth = "is_good"

    def __init__(self, headline: str, text: str, found: str) -> None:
        super().__init__(json.loads(found))
        self._json = found
        #: Result in a line.
        self.headline = headline
        #: Summary that the command line prints.
        self.text = text

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON that the command line prints, as a dictionary."""
        found: dict[str, Any] = json.loads(self._json)
        return found

    def __bool__(self) -> bool:
        raise TypeError(f"{type(self).__name__} is neither true nor false; use {self._truth}")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.headline}>"

    def __str__(self) -> str:
        return f"{self.headline}\n{self.text}"


class Answer(Result, OpenRow):
    """Result of a check, a study or an export."""

    def __init__(self, is_good: bool, headline: str, text: str, found: str) -> None:
        super().__init__(headline, text, found)
        #: Whether the exit code of the command line would be 0.
        self.is_good = is_good

    def __getstate__(self) -> tuple[Any, ...]:
        return sealed({**vars(self), "_values": None})

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        (attributes,) = unsealed(type(self).__name__, *state)
        self.__dict__.update(attributes, _values=json.loads(attributes["_json"]))

    def _repr_html_(self) -> str:
        plain = [(key, format_cell(value, key)) for key, value in self.items() if not isinstance(value, (list, dict))]
        tables = [(key, value) for key in self if isinstance(value := getattr(self, key), Rows)]
        shown = "".join(f"<h4>{escape(key)}</h4>{value._repr_html_()}" for key, value in tables)
        return _display.make_card("good" if self.is_good else "bad", self.headline, plain) + shown


class Share(Row):
    """``count`` of ``of``, with the interval of the share."""

    count: int
    of: int
    share: float | None
    low: float
    high: float
    confidence: float


class LawResult(OpenRow):
    """Flights of a study under a law."""

    name: str
    clear: Share
    violated: Share
    reached: Share


class Comparison(Answer):
    """Answer of :func:`compare`."""

    laws: Rows[LawResult]


class Turn(Row):
    """Turn of a verdict between a smaller and a larger value."""

    bracket: tuple[float, float]
    holds_below: bool
    turns: int


class Margin(Answer):
    """Answer of :func:`margin`. ``turn`` is None where the verdict is the same at every value."""

    turn: Turn | None
    probes: Rows[OpenRow]


class Point(OpenRow):
    """Flights of a sweep with the same values of its keys."""

    values: list[float]  # type: ignore[assignment]
    held: Share
    violated: Share


class Sweep(Answer):
    """Answer of :func:`sweep`."""

    points: Rows[Point]
