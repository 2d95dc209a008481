"""Audits recordings of swarms, flies scenarios and control laws.

Example::

    import numpy as np, tautline as tl
    a = tl.audit(t, p, delta=1.5)          # Audits positions.
    f = tl.fly("pentagon")                 # Flies and audits a scenario.

Units are SI, in one inertial frame with z up. Tables of vectors have the shape (N, 3), with a row for each vehicle.
Vehicle numbers start at 0 in arrays, and at 1 in names, pairs and messages. Wrong input raises :class:`Error` (a
``ValueError``) with the message of the command line, a wrong dtype ``TypeError``, a missing file
``FileNotFoundError``. Reading, audits and flights release the interpreter's lock.
"""

from ._audit import Audit, ViolationError, audit
from ._campaign import Campaign, Proportion, campaign, proportion
from ._flight import Flight, fly
from ._law import Law
from ._native import Error, Observation
from ._program import Answer, attack, compare, export, margin, sweep, validate
from ._recording import Recording, read
from ._scenario import Check, Scenario, check, scenarios
from ._shield import Shield
from ._simulation import Simulation
from ._tables import Finding, Findings
from ._vector import VectorSimulation

__all__ = [
    "Answer",
    "Audit",
    "Campaign",
    "Check",
    "Error",
    "Finding",
    "Findings",
    "Flight",
    "Law",
    "Observation",
    "Proportion",
    "Recording",
    "Scenario",
    "Shield",
    "Simulation",
    "VectorSimulation",
    "ViolationError",
    "attack",
    "audit",
    "campaign",
    "check",
    "compare",
    "export",
    "fly",
    "margin",
    "proportion",
    "read",
    "scenarios",
    "sweep",
    "validate",
]

__version__ = "0.1.0"
