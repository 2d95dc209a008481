"""Control laws in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._native import Observation


class Law:
    """A control law: derive from it and write :meth:`control`.

        class Springs(tl.Law):
            def control(self, obs, out):
                out[:] = obs.slots_m - obs.positions - 2 * obs.velocities

    Nothing is certified of it, and the judge judges it like any other. It is asked in the thread that flies. What it remembers
    is its own: copies of a simulation ask the same object.
    """

    #: What it is called in reports; the name of the class unless given.
    name: str | None = None
    #: How near of each other vehicles must be to be in ``obs.near`` [m]; None for a law that senses nobody.
    sensing_range_m: float | None = None
    #: What counts as a formation reached: ``"places"`` (slots where the reference has carried them), ``"displacements"`` (up to
    #: translation) or ``"distances"`` (up to rotation, reflection and translation).
    reaches: ClassVar[str] = "displacements"

    def control(self, obs: Observation, out: NDArray[np.float64]) -> None:
        """Writes accelerations [m/s^2] into ``out``, an array (N, 3) that is NaN everywhere before: a vehicle without a command
        ends the flight with an error.

        ``obs`` has ``t`` [s], ``positions`` and ``velocities`` (N, 3), ``slots_m`` (N, 3) where the vehicles shall be now, and
        more (:class:`tautline.Observation`). What is raised here ends the flight and is raised by what flew it.
        """
        raise NotImplementedError("write control(self, obs, out) of your law")


def check_law(law: object) -> None:
    """Refuses the class of a law in the place of a law, and names that are none."""
    if isinstance(law, type):
        raise TypeError(f"law: a law is needed, not the class {law.__name__}: make one, {law.__name__}(...)")
    if not isinstance(name := getattr(law, "name", None), (str, type(None))):
        raise TypeError(f"name: the law's name is a string, not {type(name).__name__}")
