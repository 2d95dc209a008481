"""Shields for vehicles and simulators of your own: a certificate for any law."""

from __future__ import annotations

import json
import secrets
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arguments import count as whole_number
from ._arguments import exact_array, number
from ._native import Error
from ._pickles import sealed, unsealed

if TYPE_CHECKING:
    from typing_extensions import Unpack


class ShieldSettings(TypedDict, total=False):
    """Optional settings of a shield. docs/shield.md explains them."""

    accel_m_s2: float
    brake_m_s2: float | None
    max_speed_m_s: float
    position_error_m: float
    velocity_error_m_s: float
    disturbance_m_s2: float
    a22_per_s: float
    tracker_per_s2: float
    tracker_per_s: float
    measurement_delay_periods: int
    period_tolerance: float
    hang_periods: int
    elapsed_error_s: float
    measurement_age_s: float
    actuator_lag_s: float
    tracking_error_m: float | None
    path_error_m: float
    half_height_m: float | None
    ease_m: float | None
    turn: float


class Shield:
    """Changes commands of a law only where this is needed to keep all vehicles ``delta_m`` apart, between samples too.

    Example, for a simulator of your own::

        shield = tl.Shield(positions, delta_m=1.0, period_s=0.05)
        for _ in range(steps):
            safe = shield.filter(positions, velocities, policy(positions))
            ...                             # Hold `safe` (N, 3) for 0.05 s.

    Example, for one vehicle. Each vehicle announces its own start, and creates its shield from all announced starts.
    Starts and messages count vehicles from 0::

        settings = {"delta_m": 1.0, "period_s": 0.05, "brake_m_s2": 2.0}
        broadcast(tl.Shield.start(position, velocity, **settings))   # Bytes.
        shield = tl.Shield(starts=received, index=2, **settings)
        safe = shield.filter(position, velocity, wanted, inbox)
        for receiver, message in shield.messages():
            send(receiver, message)         # 64 bytes. They may arrive late, twice or never.

    ``positions`` and ``velocities`` are the starts of all vehicles (N, 3) or (N, 2). Vehicles with announced starts may
    have different settings, except for ``delta_m`` and ``half_height_m``. Messages carry a hash of the starts: a
    vehicle that holds other starts voids the certificate.

    The certificate holds while commands up to ``accel_m_s2`` are carried out and the errors stay within their bounds;
    ``report()`` names a bound that was exceeded, and lists the checked assumptions. Shields can be copied and pickled;
    only one of a shield and its copies may fly on.

    Raises :class:`Error` for settings or starts that cannot be certified.
    """

    def __init__(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        *,
        delta_m: float,
        period_s: float,
        starts: Sequence[bytes] | None = None,
        index: int | None = None,
        **settings: Unpack[ShieldSettings],
    ) -> None:
        given = _settings(delta_m, period_s, settings)
        self.index = None if index is None else whole_number(index, "index")
        if starts is not None:
            if positions is not None or velocities is not None:
                raise Error("starts: contain positions and velocities; leave positions and velocities out")
            if self.index is None:
                raise Error("index: is needed beside starts; give the number of the vehicle, counted from 0")
            self._native = _native.Shield.of_starts([_bytes(start) for start in starts], self.index, given)
            return
        if self.index is not None:
            raise Error(
                "index: the shield of one vehicle needs the starts that all vehicles announced; give "
                "starts=[...], each from tl.Shield.start of that vehicle"
            )
        if positions is None:
            raise Error("positions: are needed; give a row per vehicle, or starts and index for one vehicle")
        rows = _rows(positions, "positions", None)
        speeds = np.zeros_like(rows) if velocities is None else _rows(velocities, "velocities", len(rows))
        self._native = _native.Shield(rows, speeds, given)

    @staticmethod
    def start(
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        *,
        delta_m: float,
        period_s: float,
        flight: int | None = None,
        **settings: Unpack[ShieldSettings],
    ) -> bytes:
        """Returns the start of one vehicle as bytes, to be sent to all other vehicles.

        ``flight`` tells messages of this flight from those of an earlier one; it is random unless given.
        """
        rows = _rows([position], "position", 1)
        speeds = np.zeros_like(rows) if velocity is None else _rows([velocity], "velocity", 1)
        chosen = secrets.randbits(63) if flight is None else whole_number(flight, "flight")
        return _native.Shield.start(rows, speeds, chosen, _settings(delta_m, period_s, settings))

    def filter(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        wanted: ArrayLike,
        inbox: Iterable[bytes] = (),
        *,
        lost: ArrayLike | None = None,
        elapsed_s: float | None = None,
        age_s: float = 0.0,
    ) -> NDArray[np.float64]:
        """Returns the accelerations to hold over the next period [m/s^2], in the shape of ``wanted``.

        For all vehicles the arguments are (N, 3) or (N, 2), and the shields exchange their messages, except those from
        i to j with ``lost[i, j]``. With an ``index`` they are the measured own position, velocity and command (3,) or
        (2,), and ``inbox`` holds the messages that have arrived. Messages that are none are dropped and counted as
        ``invalid_messages``. A command that is not finite makes the vehicle brake.

        ``elapsed_s`` is the time since the last call by the clock of the vehicle, the period unless given. ``age_s`` is
        the age of the measurement, with the setting ``measurement_age_s``.

        Raises :class:`Error` for a wrong shape.
        """
        own = self.index is not None
        rows = 1 if own else self._native.count
        given = self._each(rows, {"positions": positions, "velocities": velocities, "wanted": wanted})
        if own and lost is not None:
            raise Error("lost: only for the shields of all vehicles; leave lost messages out of inbox")
        drops = None if lost is None else np.ascontiguousarray(lost, dtype=bool)
        if drops is not None and drops.shape != (rows, rows):
            raise Error(f"lost: must have the shape ({rows}, {rows}), got {drops.shape}; give a row per sender")
        for message in inbox:
            self._native.hear(_bytes(message))
        commands = self._native.filter(given[0], given[1], given[2], _times(elapsed_s, age_s))
        if not own:
            self._native.exchange(drops)
        return self._shaped(commands, wanted)

    def brake(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        *,
        elapsed_s: float | None = None,
        age_s: float = 0.0,
    ) -> NDArray[np.float64]:
        """Returns the accelerations of the brake for the next period [m/s^2], where there is no command of a law.

        Call it in the place of ``filter`` in a period in which the law gives no command. Messages wait. ``elapsed_s``
        and ``age_s`` are those of ``filter``.
        """
        rows = 1 if self.index is not None else self._native.count
        given = self._each(rows, {"positions": positions, "velocities": velocities})
        return self._shaped(self._native.brake(given[0], given[1], _times(elapsed_s, age_s)), positions)

    def messages(self) -> list[tuple[int, bytes]]:
        """Takes the messages to send after ``filter``: receivers, counted from 0, and 64 bytes each.

        Vehicles far away get no message.
        """
        return self._native.messages()

    def observe(self, positions: ArrayLike, velocities: ArrayLike, since_s: float) -> None:
        """Records true states, ``since_s`` after the instant of the last command, for the report of a simulation."""
        rows = 1 if self.index is not None else self._native.count
        p, v = self._each(rows, {"positions": positions, "velocities": velocities})
        self._native.observe(p, v, number(since_s, "since_s"))

    def observe_measurement(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        true_positions: ArrayLike,
        true_velocities: ArrayLike,
    ) -> None:
        """Records measured states and the true states that they measured, for the report of a simulation."""
        rows = 1 if self.index is not None else self._native.count
        named: dict[str, object] = {
            "positions": positions,
            "velocities": velocities,
            "true_positions": true_positions,
            "true_velocities": true_velocities,
        }
        self._native.observe_measurement(*self._each(rows, named))

    @property
    def certificate(self) -> str:
        """Certificate in words, with its assumptions."""
        return self._native.certificate

    @property
    def tube_m(self) -> float:
        """Bound on the distance of a vehicle to its reference [m]."""
        return self._native.tube_m

    def report(self) -> dict[str, Any]:
        """Returns the numbers so far. A share that was never observed is None.

        ``exceeded`` is an assumption that did not hold, in words, or None; ``exceeded_code`` is its code.
        ``assumptions`` lists each assumption with its ``source``, and whether it ``held``: None where the observations
        do not decide it. Without :meth:`observe` and :meth:`observe_measurement` a shield cannot see a bias of its own
        measurements.
        """
        counters, assumptions, exceeded = self._native.report()
        text, code = (None, None) if exceeded is None else exceeded
        return {
            **json.loads(counters),
            "exceeded": text,
            "exceeded_code": code,
            "assumptions": json.loads(assumptions),
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return unpickle_shield, sealed(self.index, self._native.save())

    def __repr__(self) -> str:
        whose = f"{self._native.count} vehicles" if self.index is None else f"vehicle {self.index + 1}"
        return f"<tautline.Shield of {whose}: {self.certificate}>"

    def _each(self, rows: int, named: dict[str, object]) -> list[NDArray[np.float64]]:
        """Returns a row of three numbers for each shield."""
        own = self.index is not None
        return [_rows([value] if own else value, name, rows) for name, value in named.items()]

    def _shaped(self, commands: NDArray[np.float64], like: ArrayLike) -> NDArray[np.float64]:
        """Returns commands with the axes of an argument."""
        return np.asarray(commands[0] if self.index is not None else commands)[..., : np.shape(like)[-1]]


def unpickle_shield(*pickled: Any) -> Shield:
    """Returns the shield of a pickle."""
    index, saved = unsealed("Shield", *pickled)
    shield = object.__new__(Shield)
    shield.index, shield._native = index, _native.Shield.load(saved)
    return shield


def _settings(
    delta_m: float, period_s: float, settings: ShieldSettings
) -> tuple[float, float, list[int], list[tuple[str, float]]]:
    """Returns checked settings for the native module."""
    others: dict[str, Any] = dict(settings)
    unknown = next((name for name in others if name not in ShieldSettings.__annotations__), None)
    if unknown is not None:
        names = ", ".join(ShieldSettings.__annotations__)
        raise TypeError(f"{unknown}: is no setting of a shield; give one of {names}")
    whole = [whole_number(others.pop(name, 0), name) for name in ("measurement_delay_periods", "hang_periods")]
    given = [(name, number(value, name)) for name, value in others.items() if value is not None]
    return number(delta_m, "delta_m"), number(period_s, "period_s"), whole, given


def _times(elapsed_s: float | None, age_s: float) -> tuple[float | None, float] | None:
    """Returns the times of an instant; None for a period and a new measurement."""
    if elapsed_s is None and age_s == 0.0:
        return None
    return None if elapsed_s is None else number(elapsed_s, "elapsed_s"), number(age_s, "age_s")


def _bytes(message: object) -> bytes:
    """Returns the bytes of a message; none for an object of another type."""
    try:
        return bytes(memoryview(message))  # type: ignore[arg-type]
    except TypeError:
        return b""


def _rows(value: object, name: str, count: int | None) -> NDArray[np.float64]:
    """Returns rows of three numbers, z = 0 where two are given."""
    rows = exact_array(value, name)
    if rows.ndim != 2 or rows.shape[1] not in (2, 3) or (count is not None and len(rows) != count):
        wanted = "N" if count is None else count
        shapes = f"({wanted}, 3) or ({wanted}, 2), got {rows.shape}"
        raise Error(f"{name}: must have the shape {shapes}; give a row per vehicle")
    return np.ascontiguousarray(np.pad(rows, ((0, 0), (0, 3 - rows.shape[1]))))
