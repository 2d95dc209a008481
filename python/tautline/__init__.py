"""Judge recorded swarms, fly scenarios into formation, write control laws.

    import numpy as np, tautline as tl
    a = tl.audit(t, p, delta=1.5)          # did any two come closer than 1.5 m, between samples too?
    f = tl.fly("pentagon")                 # a flight in a rigid-body engine, every step judged

SI units, one inertial frame with z up. Tables of vectors are (N, 3), a row per vehicle; vehicles are counted from 0 in
arrays and from 1 in names, pairs and messages. What is wrong with the input is a :class:`Error` (a ``ValueError``) that says
what the command line says; a wrong dtype is a ``TypeError``, a missing file a ``FileNotFoundError``. The interpreter's lock
is free while anything is read, judged or flown.
"""

from ._audit import Audit, ViolationError, audit
from ._campaign import Campaign, campaign
from ._flight import Flight, fly
from ._law import Law
from ._native import Error, Observation
from ._program import Answer, attack, compare, export, margin, sweep, validate
from ._recording import Recording, read
from ._scenario import Check, Scenario, check, scenarios
from ._simulation import Simulation
from ._tables import Finding, Findings

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
    "Recording",
    "Scenario",
    "Simulation",
    "ViolationError",
    "attack",
    "audit",
    "campaign",
    "check",
    "compare",
    "export",
    "fly",
    "margin",
    "read",
    "scenarios",
    "sweep",
    "validate",
]

__version__ = "0.1.0"
