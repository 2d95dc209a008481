"""Shields for vehicles and simulators of your own: a certificate for any law."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arguments import count as whole_number
from ._arguments import exact_array, number
from ._native import Error


class Shield:
    """Changes commands of a law only where this is needed to keep all vehicles ``delta_m`` apart, between samples too.

    Example, for a simulator of your own::

        shield = tl.Shield(positions, delta_m=1.0, period_s=0.05)
        for _ in range(steps):
            safe = shield.filter(positions, velocities, policy(positions))
            ...                             # Hold `safe` (N, 3) for 0.05 s.

    Example, for one vehicle (``index`` counts from 0; messages count vehicles from 1)::

        shield = tl.Shield(starts, delta_m=1.0, period_s=0.05, index=2)
        safe = shield.filter(position, velocity, wanted, inbox)
        for receiver, message in shield.messages():
            send(receiver, message)         # Bytes. They may arrive late, twice or never.

    ``positions`` and ``velocities`` are the starts of all vehicles (N, 3) or (N, 2), which all vehicles know. The other
    arguments are explained in docs/shield.md. The certificate holds while commands up to ``accel_m_s2`` are carried
    out and the errors stay within their bounds; ``report()`` names a bound that was exceeded.

    Raises :class:`Error` for settings or starts that cannot be certified.
    """

    def __init__(
        self,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        *,
        delta_m: float,
        period_s: float,
        index: int | None = None,
        accel_m_s2: float = 5.0,
        brake_m_s2: float | None = None,
        max_speed_m_s: float = 2.0,
        position_error_m: float = 0.0,
        velocity_error_m_s: float = 0.0,
        disturbance_m_s2: float = 0.0,
        a22_per_s: float = 0.0,
        tracker_per_s2: float = 4.0,
        tracker_per_s: float = 4.0,
        measurement_delay_periods: int = 0,
        actuator_lag_s: float = 0.0,
        tracking_error_m: float | None = None,
        path_error_m: float = 0.0,
        ease_m: float | None = None,
        turn: float = 1.0,
    ) -> None:
        starts = _rows(positions, "positions", None)
        speeds = np.zeros_like(starts) if velocities is None else _rows(velocities, "velocities", len(starts))
        settings = {
            "accel_m_s2": accel_m_s2,
            "brake_m_s2": brake_m_s2,
            "max_speed_m_s": max_speed_m_s,
            "position_error_m": position_error_m,
            "velocity_error_m_s": velocity_error_m_s,
            "disturbance_m_s2": disturbance_m_s2,
            "a22_per_s": a22_per_s,
            "tracker_per_s2": tracker_per_s2,
            "tracker_per_s": tracker_per_s,
            "actuator_lag_s": actuator_lag_s,
            "tracking_error_m": tracking_error_m,
            "path_error_m": path_error_m,
            "ease_m": ease_m,
            "turn": turn,
        }
        given = [(name, number(value, name)) for name, value in settings.items() if value is not None]
        if index is not None:
            index = whole_number(index, "index")
        self.index = index
        self._axes = np.shape(positions)[1]
        self._native = _native.Shield(
            starts,
            speeds,
            number(delta_m, "delta_m"),
            number(period_s, "period_s"),
            whole_number(measurement_delay_periods, "measurement_delay_periods"),
            given,
            index,
        )

    def filter(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        wanted: ArrayLike,
        inbox: Sequence[bytes] = (),
        *,
        lost: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Returns the accelerations to hold over the next period [m/s^2], in the shape of ``wanted``.

        For all vehicles the arguments are (N, 3) or (N, 2), and the shields exchange their messages, except those from
        i to j with ``lost[i, j]``. With an ``index`` they are the measured own position, velocity and command (3,) or
        (2,), and ``inbox`` holds the messages that have arrived. A command that is not finite makes the vehicle brake.

        Raises :class:`Error` for a wrong shape or a wrong message.
        """
        own = self.index is not None
        rows = 1 if own else self._native.count
        shape = np.shape(wanted)
        named: dict[str, Any] = {"positions": positions, "velocities": velocities, "wanted": wanted}
        given = [_rows([value] if own else value, name, rows) for name, value in named.items()]
        if own and lost is not None:
            raise Error("lost: only for the shields of all vehicles; leave lost messages out of inbox")
        for message in inbox:
            self._native.hear(message)
        commands = self._native.filter(*given)
        if not own:
            drops = None if lost is None else np.ascontiguousarray(lost, dtype=bool)
            if drops is not None and drops.shape != (rows, rows):
                raise Error(f"lost: must have the shape ({rows}, {rows}), got {drops.shape}; give a row per sender")
            self._native.exchange(drops)
        return np.asarray(commands[0] if own else commands)[..., : shape[-1]]

    def messages(self) -> list[tuple[int, bytes]]:
        """Takes the messages to send after ``filter``, each with its receiver. Vehicles far away get none."""
        return self._native.messages()

    @property
    def certificate(self) -> str:
        """Certificate in words, with its assumptions."""
        return self._native.certificate

    @property
    def tube_m(self) -> float:
        """Bound on the distance of a vehicle to its reference [m]."""
        return self._native.tube_m

    def report(self) -> dict[str, Any]:
        """Returns the numbers so far; ``exceeded`` names an assumption that did not hold, or is None."""
        counters, exceeded = self._native.report()
        return {**json.loads(counters), "exceeded": exceeded}

    def __repr__(self) -> str:
        whose = f"{self._native.count} vehicles" if self.index is None else f"vehicle {self.index + 1}"
        return f"<tautline.Shield of {whose}: {self.certificate}>"


def _rows(value: ArrayLike, name: str, count: int | None) -> NDArray[np.float64]:
    """Returns rows of three numbers, z = 0 where two are given."""
    rows = exact_array(value, name)
    if rows.ndim != 2 or rows.shape[1] not in (2, 3) or (count is not None and len(rows) != count):
        wanted = "N" if count is None else count
        shape = np.shape(value)
        raise Error(f"{name}: must have the shape ({wanted}, 3) or ({wanted}, 2), got {shape}; give a row per vehicle")
    return np.ascontiguousarray(np.pad(rows, ((0, 0), (0, 3 - rows.shape[1]))))
