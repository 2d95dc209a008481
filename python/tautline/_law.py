"""Control laws in Python."""

from __future__ import annotations

import hashlib
import importlib.machinery
import importlib.util
import os
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ._native import Error

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


def import_law(name: str) -> tuple[Callable[[], ControlLaw], str]:
    """Returns a function that makes the law ``MODULE:CLASS``, and the SHA-256 of the file of the module.

    The class, or function, is called without arguments. The module is searched in the working folder as well. Its code
    is that of the bytes with this SHA-256, also where the module was imported before and has changed since.
    """
    module_name, _, path = name.partition(":")
    if not module_name or not path:
        raise Error(f"law: MODULE:CLASS is needed, such as my_laws:Springs, got {name!r}")
    if module_name == "__main__":
        raise Error("law: other processes cannot import a script; move the class into a module")
    if os.getcwd() not in sys.path and "" not in sys.path:
        sys.path.insert(0, os.getcwd())
    importlib.invalidate_caches()
    spec = importlib.util.find_spec(module_name)
    if spec is None:
        raise ModuleNotFoundError(f"No module named {module_name!r}", name=module_name)
    if spec.origin is None or not isinstance(spec.loader, importlib.machinery.SourceFileLoader):
        raise Error(f"law: {module_name} has no file of Python that other processes can import")
    source = Path(spec.origin).read_bytes()
    sha256 = hashlib.sha256(source).hexdigest()
    found: Any = module_of(spec, spec.loader, source, sha256)
    for part in path.split("."):
        if not hasattr(found, part):
            raise Error(f"law: {module_name} has no {path}")
        found = getattr(found, part)
    if not callable(found):
        raise Error(f"law: {name} must be a class, or a function that returns a law")

    def make() -> ControlLaw:
        law: ControlLaw = found()
        check_law(law)
        return law

    return make, sha256


def module_of(
    spec: importlib.machinery.ModuleSpec, loader: importlib.machinery.SourceFileLoader, source: bytes, sha256: str
) -> types.ModuleType:
    """Returns the module of exactly this source, under a name of its own."""
    name = f"{spec.name}.{sha256}"
    if name not in sys.modules:
        module = types.ModuleType(name)
        module.__dict__.update(__file__=spec.origin, __package__=spec.parent)
        code = loader.source_to_code(source, spec.origin or name)
        sys.modules[name] = module
        try:
            exec(code, module.__dict__)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]
