"""Mechanics from the action principle: a Lagrangian in, its equations, motions, invariants and actions out."""

from __future__ import annotations

from varcalc.mechanics.brackets import poisson
from varcalc.mechanics.closed_orbits import ClosedOrbit, ClosedOrbits
from varcalc.mechanics.constraints import Pfaffian
from varcalc.mechanics.equilibria import Equilibria, NormalModes
from varcalc.mechanics.examination import Examination, Examined
from varcalc.mechanics.experiment import Experiment, Flights, Moved, Section
from varcalc.mechanics.frames import charged, rotating
from varcalc.mechanics.galerkin import Stepped
from varcalc.mechanics.legendre import Hamiltonian
from varcalc.mechanics.motion import Ensemble, Event, Happening, Motion
from varcalc.mechanics.orbit_symmetry import Repeats, Returns
from varcalc.mechanics.passages import Passages
from varcalc.mechanics.symmetries import Symmetry
from varcalc.mechanics.system import System
from varcalc.problem.conditions import Holonomic

__all__ = [
    "ClosedOrbit",
    "ClosedOrbits",
    "Ensemble",
    "Equilibria",
    "Event",
    "Examination",
    "Examined",
    "Experiment",
    "Flights",
    "Hamiltonian",
    "Happening",
    "Holonomic",
    "Motion",
    "Moved",
    "NormalModes",
    "Passages",
    "Pfaffian",
    "Repeats",
    "Returns",
    "Section",
    "Stepped",
    "Symmetry",
    "System",
    "charged",
    "poisson",
    "rotating",
]
