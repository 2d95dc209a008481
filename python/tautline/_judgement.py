"""Judgements of recordings and flights: status, findings, and the facts that they rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ._answers import Result
from ._tables import Row, Rows


class Finding(Row):
    """A finding on two vehicles, on a vehicle and an obstacle, or on one vehicle. What is not known is None.

    It lasts from ``from_s`` to ``to_s``. The value at ``at_s``, such as a separation, is between ``lower`` and
    ``upper``. A sampling rate of ``rate_hz`` would decide an undecided finding.
    """

    subjects: tuple[str, ...]
    from_s: float | None
    to_s: float | None
    at_s: float | None
    lower: float | None
    upper: float | None
    unit: str
    limit: float | None
    rate_hz: float | None

    def __init__(self, values: Mapping[str, Any], vehicles: Sequence[str] = ()) -> None:
        flat = {**values, **values.get("value", {})}
        super().__init__({key: flat[key] for key in Finding._kinds}, vehicles)

    @property
    def pair(self) -> tuple[str, str]:
        """The two subjects of a finding on a pair."""
        first, second = self.subjects
        return first, second


class Fact(Row):
    """A fact that a judgement rests on, such as ``motion`` or ``time-unit``, and its source, such as ``recorded``. A
    number has a unit. The subject is the vehicle, the obstacle or the file that the fact is about."""

    fact: str
    source: str
    value: float | str | None
    unit: str | None
    subject: str | None


class Part(Row):
    """Answer to a part of the question: ``separation``, a limit such as ``speed_m_s``, ``well_clear``, ``presence`` or
    ``plan``. ``closest`` is the finding nearest to its limit, or farthest beyond it."""

    part: str
    status: str
    closest: Finding | None
    #: Numbers of violations and of undecided times.
    violations: int
    undecided: int


class Statement(Row):
    """A sentence with a code, which programs may compare."""

    code: str
    text: str


class Judgement(Result):
    """Judgement of a recording or a flight."""

    #: ``clear``, ``violation`` or ``undecided``. A flight that ended early is never ``clear``.
    status: str
    #: Facts that the judgement rests on.
    facts: Rows[Fact]
    #: Names of the vehicles.
    vehicles: list[str]

    def _findings(self, key: str, among: Sequence[str] | None = None) -> Rows[Finding]:
        """Returns findings on separations: all, or those whose second subject is among some names."""
        found = [answer[key] for answer in self["answers"] if answer["part"] == "separation"]
        rows = [row for each in found for row in (each if key == "closest" else each["listed"])]
        return Rows(Finding, [row for row in rows if among is None or row["subjects"][-1] in among], self.vehicles)

    @property
    def is_proved(self) -> bool:
        """Whether the status is clear, and rests on no assumption."""
        return bool(self["proved"])

    @property
    def delta_m(self) -> float | None:
        """Safety distance [m], a scaled distance with an ellipsoid or cylinder; None where only radii are given."""
        delta: float | None = self["question"]["delta"]
        return delta

    @property
    def separation_m(self) -> float | None:
        """Smallest separation [m], scaled with an ellipsoid; a lower bound for curves and bounded motion. None where
        two vehicles are never present together."""
        return next((finding.lower for finding in self._findings("closest", self.vehicles)), None)

    @property
    def closest(self) -> Rows[Finding]:
        """Closest approaches: at most ten of pairs of vehicles, then at most ten to obstacles."""
        return self._findings("closest")

    @property
    def obstacles(self) -> Rows[Finding]:
        """Closest approaches to obstacles, the last findings of :attr:`closest`."""
        return self._findings("closest", self["question"]["obstacles"])

    @property
    def violations(self) -> Rows[Finding]:
        """Violations of separations in order of time. If there are many, the worst ones and the first one of each
        pair."""
        return self._findings("violations")

    @property
    def undecided(self) -> Rows[Finding]:
        """Intervals in which a separation is undecided."""
        return self._findings("undecided")

    @property
    def answers(self) -> Rows[Part]:
        """Answers to all parts of the question."""
        parts = [
            {
                **{key: answer[key] for key in ("part", "status")},
                "closest": next(map(Finding, answer["closest"]), None),
                **{key: answer[key]["count"] for key in ("violations", "undecided")},
            }
            for answer in self["answers"]
        ]
        return Rows(Part, parts, self.vehicles)

    @property
    def limits(self) -> Rows[Part]:
        """Answers to the limits on single vehicles (``limit``, ``fence``)."""
        keys = self["question"]["limits"]
        return Rows(Part, [answer for answer in self.answers if answer.part in keys], self.vehicles)
