"""Control laws in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._native import Observation
    from ._words import Reaches


class ControlLaw(Protocol):
    """Any object with a method ``control``: a law for :func:`fly`, simulations and studies.

    The attributes ``name``, ``sensing_range_m`` and ``reaches`` of :class:`Law` are optional.
    """

    def control(self, obs: Observation, out: NDArray[np.float64], /) -> None:
        """Writes the accelerations [m/s^2] of all vehicles into ``out`` (N, 3)."""


class Law:
    """Optional base class of control laws with the defaults of all attributes: subclasses define :meth:`control`.

    Example::

        class Springs(tl.Law):
            def control(self, obs, out):
                out[:] = obs.slots_m - obs.positions - 2 * obs.velocities  # Damped springs.

    Such a law has no certificate; its flights are audited like all others. The calling thread calls it. Copies of a
    simulation share the object, so its state is not copied. A study flies one object many times: a law with a memory
    clears it where ``obs.t`` is 0.
    """

    #: Name in reports; the name of the class unless given.
    name: str | None = None
    #: Largest separation of the pairs in ``obs.near`` [m]; None for a law without sensing.
    sensing_range_m: float | None = None
    #: How a formation counts as reached. With ``"places"`` the vehicles are at the slots, moved with the reference.
    #: ``"displacements"`` ignores a translation, ``"distances"`` also a rotation and a reflection.
    reaches: ClassVar[Reaches] = "displacements"

    def control(self, obs: Observation, out: NDArray[np.float64]) -> None:
        """Writes the accelerations [m/s^2] of all vehicles into ``out``.

        ``out`` is an array (N, 3) that is NaN at the start. A vehicle whose row is not finite ends the flight with an
        error. ``obs`` is a :class:`tautline.Observation`. It has the time ``t`` [s], and as arrays (N, 3)
        ``positions``, ``velocities`` and the slots of this time, ``slots_m``. An exception ends the flight, and the
        call that flies raises it again.
        """
        raise NotImplementedError("write control(self, obs, out) of your law")


def check_law(law: object) -> None:
    """Raises ``TypeError`` for a class in place of its instance, and for a name that is not a string."""
    if isinstance(law, type):
        raise TypeError(f"law: a law is needed, not the class {law.__name__}; give {law.__name__}(...)")
    if not isinstance(name := getattr(law, "name", None), (str, type(None))):
        raise TypeError(f"law.name: must be a string, not {type(name).__name__}")
