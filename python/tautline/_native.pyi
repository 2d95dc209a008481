from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CampaignFolder",
    "Columns",
    "Error",
    "FlightData",
    "Observation",
    "AuditOptions",
    "ReadOptions",
    "Scenario",
    "FlightFindings",
    "Shield",
    "Simulation",
    "VectorSimulation",
    "attack",
    "audit_arrays",
    "audit_files",
    "audit_in_rust",
    "audit_table",
    "campaign",
    "compare",
    "export",
    "fly",
    "main",
    "margin",
    "proportion",
    "read",
    "scenarios",
    "separation_text",
    "sweep",
    "validate",
]

class Error(ValueError):
    """Wrong input. The message has the place, the problem, the value and the remedy."""

    #: Stable code of the problem, such as ``audit/no-limit`` (docs/errors.md); None for an argument of a wrong form.
    code: str | None

@final
class Observation:
    """Observation of a law at an instant. The arrays are copies, which the law may keep."""

    @property
    def t(self) -> float:
        """Time of the flight [s]."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 3) positions [m]; row i is the own position that vehicle i measures."""
    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 3) velocities [m/s]."""
    @property
    def slots_m(self) -> NDArray[np.float64]:
        """(N, 3) slots of the leg [m], moved with the reference."""
    @property
    def leg(self) -> int:
        """Number of the leg, from 0."""
    @property
    def reference_velocity_m_s(self) -> tuple[float, float, float]:
        """Velocity of the reference [m/s]."""
    @property
    def reference_acceleration_m_s2(self) -> tuple[float, float, float]:
        """Acceleration of the reference [m/s^2]."""
    @property
    def near(self) -> NDArray[np.int64]:
        """(K, 2) pairs i < j, from 0, within the sensing range of the law; empty without a range."""
    @property
    def shared(self) -> bool:
        """Whether every vehicle knows all ``positions`` and ``velocities``; the arrays below are then None."""
    @property
    def received_positions(self) -> NDArray[np.float64] | None:
        """(N, N, 3) positions [m]; ``[i, j]`` is the last position of vehicle j that vehicle i received."""
    @property
    def received_velocities(self) -> NDArray[np.float64] | None:
        """(N, N, 3) velocities [m/s], with the same indices."""
    @property
    def received_ages_s(self) -> NDArray[np.float64] | None:
        """(N, N) ages of these positions and velocities [s]."""
    @property
    def sensed_positions(self) -> NDArray[np.float64] | None:
        """(N, N, 3) positions [m] of vehicle j from a sensor of vehicle i; None without a sensing range."""
    @property
    def sensed_velocities(self) -> NDArray[np.float64] | None:
        """(N, N, 3) velocities [m/s], with the same indices."""

@final
class Scenario:
    def __new__(cls, source: str, is_text: bool, overrides: Sequence[str]) -> Scenario: ...
    @property
    def name(self) -> str: ...
    @property
    def count(self) -> int: ...
    @property
    def delta_m(self) -> float: ...
    @property
    def unit(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def dt_s(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def law(self) -> str: ...
    @property
    def positions_m(self) -> NDArray[np.float64]: ...
    @property
    def velocities_m_s(self) -> NDArray[np.float64]: ...
    @property
    def slots_m(self) -> NDArray[np.float64]: ...
    @property
    def links(self) -> list[tuple[int, int]]: ...
    @property
    def toml(self) -> str: ...
    @property
    def sha256(self) -> str: ...
    def check(self) -> tuple[bool, str, str, str]: ...
    @property
    def part_ignored_by_environments(self) -> tuple[str, str] | None: ...
    @property
    def is_plane(self) -> bool: ...
    @property
    def is_exact(self) -> bool: ...
    @property
    def obstacles(self) -> int: ...

#: Safety distance [m], period [s], delay of measurements and missed instants [periods], other settings by name.
_ShieldSettings = tuple[float, float, list[int], list[tuple[str, float]]]

@final
class Shield:
    def __new__(
        cls,
        positions_m: NDArray[np.float64],
        velocities_m_s: NDArray[np.float64],
        settings: _ShieldSettings,
    ) -> Shield: ...
    @staticmethod
    def start(
        position_m: NDArray[np.float64],
        velocity_m_s: NDArray[np.float64],
        flight: int,
        settings: _ShieldSettings,
    ) -> bytes: ...
    @staticmethod
    def of_starts(starts: list[bytes], index: int, settings: _ShieldSettings) -> Shield: ...
    def filter(
        self,
        positions_m: NDArray[np.float64],
        velocities_m_s: NDArray[np.float64],
        wanted_m_s2: NDArray[np.float64],
        times: tuple[float | None, float] | None,
    ) -> NDArray[np.float64]: ...
    def brake(
        self,
        positions_m: NDArray[np.float64],
        velocities_m_s: NDArray[np.float64],
        times: tuple[float | None, float] | None,
    ) -> NDArray[np.float64]: ...
    def exchange(self, lost: NDArray[np.bool_] | None) -> None: ...
    def messages(self) -> list[tuple[int, bytes]]: ...
    def hear(self, message: bytes) -> None: ...
    def observe(
        self, positions_m: NDArray[np.float64], velocities_m_s: NDArray[np.float64], since_s: float
    ) -> None: ...
    def observe_measurement(
        self,
        positions_m: NDArray[np.float64],
        velocities_m_s: NDArray[np.float64],
        true_positions_m: NDArray[np.float64],
        true_velocities_m_s: NDArray[np.float64],
    ) -> None: ...
    @property
    def count(self) -> int: ...
    @property
    def certificate(self) -> str: ...
    @property
    def tube_m(self) -> float: ...
    def report(self) -> tuple[str, str, tuple[str, str] | None]: ...
    @staticmethod
    def load(saved: bytes) -> Shield: ...
    def save(self) -> bytes: ...

@final
class Simulation:
    def __new__(cls, scenario: Scenario, law: object | None) -> Simulation: ...
    def step(self, commands: NDArray[np.float64] | None, steps: int) -> None: ...
    @property
    def t(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def commands(self) -> NDArray[np.float64]: ...
    @property
    def separation_m(self) -> float | None: ...
    @property
    def closest(self) -> tuple[tuple[int, int], float, float] | None: ...
    @property
    def least_clearance_m(self) -> float | None: ...
    def judged(self) -> tuple[str, list[tuple[tuple[int, int], float, float, float, float]]]: ...
    @property
    def ending(self) -> str | None: ...
    def copy(self, noise_seed: int | None) -> Simulation: ...
    def save(self, scenario: Scenario) -> bytes: ...
    @staticmethod
    def load(scenario: Scenario, law: object | None, data: bytes) -> Simulation: ...
    @staticmethod
    def saved(data: bytes) -> tuple[str, str | None]: ...

@final
class VectorSimulation:
    def __new__(
        cls, scenario: Scenario, seeds: list[int], threads: int, autoreset: bool, is_environment: bool
    ) -> VectorSimulation: ...
    def copy(self) -> VectorSimulation: ...
    @staticmethod
    def most_worlds(scenario: Scenario) -> int: ...
    def step(self, commands: NDArray[np.floating[Any]] | None, steps: int) -> None: ...
    def reset(
        self,
        chosen: NDArray[np.bool_],
        seeds: list[int | None] | None,
        given: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
        is_environment: bool,
    ) -> None: ...
    def slots(self) -> NDArray[np.float64]: ...
    def measured(self) -> NDArray[np.float64]: ...
    def received(self) -> NDArray[np.float64]: ...
    def obstacles(self, count: int) -> NDArray[np.float64]: ...
    def shield_counts(self) -> list[tuple[int, int]]: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def least_clearance_m(self) -> NDArray[np.float64]: ...
    @property
    def is_over(self) -> NDArray[np.bool_]: ...
    @property
    def seeds(self) -> NDArray[np.uint64]: ...
    @property
    def t(self) -> NDArray[np.float64]: ...
    @property
    def steps(self) -> NDArray[np.uint64]: ...
    @property
    def endings(self) -> list[str | None]: ...
    def statuses(self, chosen: NDArray[np.bool_]) -> list[str | None]: ...
    def world(self, world: int) -> Simulation: ...

@final
class FlightData:
    @property
    def headline(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def report(self) -> str: ...
    @property
    def t(self) -> NDArray[np.float64]: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def velocities(self) -> NDArray[np.float64]: ...
    @property
    def commands(self) -> NDArray[np.float64]: ...
    @property
    def separations_m(self) -> NDArray[np.float64]: ...
    @property
    def findings(self) -> FlightFindings: ...

@final
class FlightFindings:
    """Limits, obstacles and audit of a flight."""

    def __new__(cls, scenario: Scenario, json: str) -> FlightFindings: ...
    @property
    def json(self) -> str: ...

@final
class Columns:
    @property
    def vehicles(self) -> list[str]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def planar(self) -> bool: ...
    @property
    def unit(self) -> str: ...
    @property
    def epoch_ns(self) -> int: ...
    @property
    def vehicle(self) -> NDArray[np.int64]: ...
    @property
    def t(self) -> NDArray[np.float64]: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    @property
    def velocity(self) -> NDArray[np.float64]: ...
    @property
    def radius(self) -> NDArray[np.float64]: ...
    @property
    def piece_vehicle(self) -> NDArray[np.int64]: ...
    @property
    def piece_span(self) -> NDArray[np.float64]: ...
    @property
    def piece_coefficients(self) -> NDArray[np.float64]: ...

_AuditOutcome = tuple[str, str, str, str, list[bool]]
_Answer = tuple[bool, str, str, str]

@final
class ReadOptions:
    def __new__(
        cls,
        *,
        format: str | None,
        time_unit: str | None,
        fps: float | None,
        time_scale: float | None,
        sort: bool,
        duplicates: str | None,
        one_vehicle: bool,
        skip_incomplete: bool,
        distinct: bool,
        clock: str | None,
        scale: Sequence[float] | None,
        axes: str | None,
        dimensions: str | None,
        column: Sequence[tuple[str, str]],
        start: Sequence[tuple[str, Sequence[float]]],
        layout: str | None,
        frame: str | None,
        topic: Sequence[str],
        origin: Sequence[float] | None,
        plan_end: str | None,
        allow_unfinished: bool,
    ) -> ReadOptions: ...

@final
class AuditOptions:
    def __new__(cls, **options: object) -> AuditOptions: ...

@final
class CampaignFolder:
    def __new__(cls, path: str) -> CampaignFolder: ...
    @staticmethod
    def plan(plan: dict[str, object]) -> CampaignFolder: ...
    @property
    def path(self) -> str: ...
    @property
    def manifest(self) -> tuple[str, int, int, str | None]: ...
    def missing(self) -> list[int]: ...
    def has_answer(self) -> bool: ...
    def fly(
        self, shards: Sequence[int], threads: int, progress: Callable[[int, int | None], object] | None
    ) -> None: ...
    def merge(self, worst: int, progress: Callable[[int, int | None], object] | None) -> _Answer: ...

def attack(
    scenario: Scenario,
    law: object | None,
    start: float | None,
    velocity: float | None,
    apart: float | None,
    vary: Sequence[tuple[str, float, float]],
    flights: int,
    seeds: int,
    seed: int,
    out: str | None,
    outputs: dict[str, object],
) -> _Answer: ...
def audit_arrays(
    question: AuditOptions,
    command: str,
    times: Any,
    positions: Any,
    velocities: Any | None,
    names: Sequence[str],
    findings: FlightFindings | None,
    html: str | None,
) -> _AuditOutcome: ...
def audit_files(
    question: AuditOptions, command: str, paths: Sequence[str], options: ReadOptions, html: str | None
) -> _AuditOutcome: ...
def audit_table(
    question: AuditOptions, command: str, table: str, options: ReadOptions, html: str | None
) -> _AuditOutcome: ...
def audit_in_rust(
    times: NDArray[np.float64], positions: NDArray[np.float64], delta_m: float
) -> tuple[float, float]: ...
def campaign(
    plan: dict[str, object],
    threads: int | None,
    worst: int,
    progress: Callable[[int, int | None], object] | None,
) -> tuple[_Answer, str]: ...
def compare(
    scenario: Scenario,
    laws: Sequence[object] | None,
    shield: bool,
    runs: int,
    seed: int,
    outputs: dict[str, object],
) -> _Answer: ...
def export(
    paths: Sequence[str],
    options: ReadOptions,
    output: str,
    to: str | None,
    sample_hz: float | None,
    force: bool,
    drones: dict[str, str | bool | int | float | list[float] | None],
) -> _Answer | None: ...
def fly(
    scenario: Scenario, law: object | None, record: str | None, html: str | None, command: str, keep: bool
) -> FlightData: ...
def main(arguments: Sequence[str]) -> int: ...
def margin(
    scenario: Scenario,
    law: object | None,
    key: str,
    start: float,
    stop: float,
    runs: int,
    seed: int,
    verdict: str,
    scan: int,
    halvings: int,
    logarithmic: bool,
    outputs: dict[str, object],
) -> _Answer: ...
def read(paths: Sequence[str], options: ReadOptions) -> Columns: ...
def scenarios() -> list[str]: ...
def separation_text(distance_m: float) -> str: ...
def sweep(
    scenario: Scenario,
    law: object | None,
    keys: Sequence[tuple[str, Sequence[float]]],
    runs: int,
    seed: int,
    verdict: str,
    outputs: dict[str, object],
) -> _Answer: ...
def validate(
    out: str, force: bool, threads: int | None, progress: Callable[[int, int | None], object] | None
) -> _Answer: ...
def proportion(count: int, of: int) -> tuple[float | None, float, float]: ...
