from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Columns",
    "Error",
    "Flown",
    "Observation",
    "Scenario",
    "Seen",
    "Simulation",
    "audit",
    "audit_in_rust",
    "call",
    "fly",
    "main",
    "read",
]

class Error(ValueError):
    """The input is wrong: the message names the place, the value and the remedy, as the command line does."""

@final
class Observation:
    """What a law is told at one instant; the arrays are its own and may be kept."""

    @property
    def t(self) -> float:
        """Time of the flight [s]."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 3) positions [m]: row i is what vehicle i knows of itself."""
    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 3) velocities [m/s]."""
    @property
    def slots_m(self) -> NDArray[np.float64]:
        """(N, 3) where the vehicles shall be now [m]: the slots of the leg, carried along with the reference."""
    @property
    def leg(self) -> int:
        """The leg, from 0."""
    @property
    def reference_velocity_m_s(self) -> tuple[float, float, float]:
        """Velocity of the reference [m/s]."""
    @property
    def reference_acceleration_m_s2(self) -> tuple[float, float, float]:
        """Acceleration of the reference [m/s^2]."""
    @property
    def near(self) -> NDArray[np.int64]:
        """(K, 2) pairs i < j of vehicles, from 0, that are near each other; none unless the law has a sensing range."""
    @property
    def shared(self) -> bool:
        """Whether all know of each other what each knows of itself, ``positions`` and ``velocities``; what follows is None then."""
    @property
    def heard_positions(self) -> NDArray[np.float64] | None:
        """(N, N, 3) positions [m]: ``[i, j]`` is what vehicle i last heard of vehicle j."""
    @property
    def heard_velocities(self) -> NDArray[np.float64] | None:
        """(N, N, 3) velocities [m/s], in the same way."""
    @property
    def heard_ages_s(self) -> NDArray[np.float64] | None:
        """(N, N) how old that is [s]."""
    @property
    def seen_positions(self) -> NDArray[np.float64] | None:
        """(N, N, 3) positions [m] of vehicle j that vehicle i sees with a sensor, where the law has a sensing range."""
    @property
    def seen_velocities(self) -> NDArray[np.float64] | None:
        """(N, N, 3) velocities [m/s], in the same way."""

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
    def judged(self) -> tuple[str, list[tuple[tuple[int, int], float, float, float]]]: ...
    @property
    def ending(self) -> str | None: ...
    def copy(self, noise_seed: int | None) -> Simulation: ...

@final
class Flown:
    @property
    def passed(self) -> bool: ...
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
    def seen(self) -> Seen: ...

@final
class Seen:
    """What a flight said of itself beside its instants."""

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

def audit(
    words: Sequence[str],
    command: str,
    times: Any | None,
    positions: Any | None,
    velocities: Any | None,
    names: Sequence[str],
    seen: Seen | None,
) -> tuple[str, str, str, str]: ...
def audit_in_rust(times: NDArray[np.float64], positions: NDArray[np.float64], delta_m: float) -> tuple[float, float]: ...
def call(words: Sequence[str], text: str | None = None) -> tuple[bool, str]: ...
def fly(
    scenario: Scenario, law: object | None, record: str | None, html: str | None, command: str, keep: bool
) -> Flown: ...
def main(arguments: Sequence[str]) -> int: ...
def read(words: Sequence[str]) -> Columns: ...
