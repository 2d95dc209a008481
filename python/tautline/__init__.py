"""Audits recordings of swarms, flies scenarios and control laws.

Example::

    import numpy as np, tautline as tl
    a = tl.audit(t, p, delta=1.5)          # Audits positions.
    f = tl.fly("pentagon")                 # Flies and audits a scenario.

Units are SI, in one inertial frame with z up. Tables of vectors have the shape (N, 3), with a row for each vehicle.
Vehicle numbers start at 0 in arrays and indices, and at 1 in names, pairs and messages. Wrong input raises
:class:`Error` (a ``ValueError``) with place, problem and remedy, a wrong type ``TypeError``, a missing file
``FileNotFoundError``. Reading, audits and flights release the interpreter's lock.
"""

from ._answers import Answer, Comparison, Margin, Sweep
from ._arguments import ReadOptions
from ._audit import Audit, AuditOptions, ViolationError, audit
from ._campaign import Campaign, CampaignFolder, Proportion, campaign, proportion
from ._flight import Flight, fly
from ._judgement import Fact, Finding
from ._law import ControlLaw, Law
from ._native import Error, Observation
from ._program import attack, compare, export, margin, sweep, validate
from ._recording import Recording, read
from ._scenario import Check, Scenario, check, scenarios
from ._shield import Shield
from ._simulation import Simulation
from ._tables import Row, Rows, Table
from ._vector import VectorSimulation

__all__ = [
    "Answer",
    "Audit",
    "AuditOptions",
    "Campaign",
    "CampaignFolder",
    "Check",
    "Comparison",
    "ControlLaw",
    "Error",
    "Fact",
    "Finding",
    "Flight",
    "Law",
    "Margin",
    "Observation",
    "Proportion",
    "ReadOptions",
    "Recording",
    "Row",
    "Rows",
    "Scenario",
    "Shield",
    "Simulation",
    "Sweep",
    "Table",
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

for _name in __all__:
    # Help and pickles name the public module.
    globals()[_name].__module__ = "tautline"
del _name
