"""Answers of checks, studies and exports, with the types of their keys. docs/studies.md and
docs/campaigns.md explain the keys of studies."""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING, Any

from . import _display
from ._pickles import sealed, unsealed
from ._tables import Column, OpenRow, Record, Row, Rows, Table, format_cell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Result(Record):
    """A result. Its keys are those of its JSON, as in a dictionary: ``result["laws"]``, ``result.keys()``. They are
    attributes as well; as attributes, lists of objects are tables. Printing shows the headline and the summary."""

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


class Answer(Result):
    """Result of a check, a study or an export."""

    if TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any: ...

    def __init__(self, is_good: bool, headline: str, text: str, found: str) -> None:
        super().__init__(headline, text, found)
        #: Whether the exit code of the command line would be 0.
        self.is_good = is_good

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the first figure of the study's page, into ``ax`` or a new figure. Returns the figure.

        It shows the shares of flights of each law with their 95 % intervals. For a search it shows the smallest
        separation found. Imports matplotlib. Raises ``TypeError`` for an answer without a figure.
        """
        figure: Figure | None = _display.import_plots().answer(self, ax)
        if figure is None:
            raise TypeError(f"{type(self).__name__}: this answer has no plot")
        return figure

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


class Estimate(Row):
    """An estimate with its 95 % interval, whose bounds are None for too few flights."""

    value: float | None
    low: float | None
    high: float | None


class FlightSummary(OpenRow):
    """A flight of a study."""

    seed: int
    outcome: str
    refused: list[str]
    ended_early: str | None
    reached: bool
    reached_at_s: float | None
    delta_m: float
    min_m: float | None
    min_at_s: float | None
    min_pair: list[int] | None
    certified_m: float | None
    breaks_certificate: bool
    path_length_m: float
    peak_control_m_s2: float | None
    total_control_m_s: float
    energy_max_over_initial: float | None
    steps: int
    refined_steps: int
    overlong_steps: int
    scenario_sha256: str
    state_hash: str


# A keyword of Python is no annotation.
FlightSummary._kinds = {**FlightSummary._kinds, "pass": bool}


class LawResult(OpenRow):
    """Flights of a study under a law."""

    name: str
    clear: Share
    violated: Share
    reached: Share


class ComparedLaw(LawResult):
    """Flights of a comparison under a law."""

    kind: str
    overrides: list[str]
    ended_early: int
    undecided: int
    refused: int
    reached_median_s: Estimate
    reached_p95_s: Estimate
    min_smallest_m: float | None
    min_smallest_seed: int | None
    min_median_m: Estimate
    path_length_mean_m: Estimate
    peak_control_largest_m_s2: float | None
    peak_control_median_m_s2: Estimate
    total_control_mean_m_s: Estimate
    repeated: bool
    flights: Rows[FlightSummary]


class Comparison(Answer, Table):
    """Answer of :func:`compare`. As a table it has a row for each law, as ``laws``."""

    laws: Rows[ComparedLaw]

    def _columns(self) -> dict[str, Column]:
        return self.laws._columns()


class Turn(Row):
    """Turn of a verdict between a smaller and a larger value."""

    bracket: tuple[float, float]
    holds_below: bool
    turns: int


class Probe(OpenRow):
    """Flights of a search for a margin with a value of its key."""

    value: float
    held: Share
    min_m: float | None
    repeated: bool
    flights: Rows[FlightSummary]


class Margin(Answer, Table):
    """Answer of :func:`margin`. ``turn`` is None where the verdict is the same at every value. As a table it has a row
    for each value that was flown, as ``probes``."""

    turn: Turn | None
    probes: Rows[Probe]

    def _columns(self) -> dict[str, Column]:
        return self.probes._columns()

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the result at each value of the key, and where the verdict turns. Returns the figure.

        Shows separations for single flights, else the share of runs with the verdict and its 95 % interval. ``ax`` are
        axes of matplotlib, which it imports.
        """
        figure: Figure = _display.import_plots().margin(self, ax)
        return figure


class Point(OpenRow):
    """Flights of a sweep with the same values of its keys."""

    values: list[float]  # type: ignore[assignment]
    held: Share
    violated: Share
    min_smallest_m: float | None
    min_median_m: Estimate
    reached_median_s: Estimate
    repeated: bool
    refused: int
    first_refusal: str | None
    flights: Rows[FlightSummary]


class Sweep(Answer, Table):
    """Answer of :func:`sweep`. As a table it has a row for each point, as ``points``, and a column for each key in
    place of ``values``."""

    points: Rows[Point]

    def _columns(self) -> dict[str, Column]:
        columns = self.points._columns()
        of_points: list[list[float]] = columns.pop("values")[0]
        keys = [swept["key"] for swept in self["grid"]]
        return {key: ([values[k] for values in of_points], float) for k, key in enumerate(keys)} | columns

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the share of runs with the verdict over one key with its 95 % interval, or as a map over two keys.
        Returns the figure. ``ax`` are axes of matplotlib, which it imports."""
        figure: Figure = _display.import_plots().sweep(self, ax)
        return figure
