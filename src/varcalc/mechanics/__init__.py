"""Mechanics from the action principle: a Lagrangian in, its equations, motions, invariants and actions out.

What a Lagrangian says is ``system`` with ``lagrange``, ``legendre``, ``symmetries``, ``brackets``, ``frames`` and
``constraints``. ``motion`` runs it, through events by ``passages``; ``course`` carries a state over a span with its
claim. ``closed_orbits`` has ``orbit_symmetry``; ``equilibria`` are seen ``linearised``, by their ``monodromy``
(Floquet) and by ``galerkin``; ``stability`` goes over parameters; ``scattering``, ``reduced`` and ``rigid`` are
packages of their own. ``experiment`` holds a motion against what is known of it.
"""

from __future__ import annotations

from typing import NoReturn

from varcalc.mechanics.brackets import poisson
from varcalc.mechanics.closed_orbits import ClosedOrbit, ClosedOrbits
from varcalc.mechanics.constraints import Pfaffian
from varcalc.mechanics.equilibria import Equilibria
from varcalc.mechanics.examination import Examination, Examined
from varcalc.mechanics.experiment import Experiment, Flights, Moved, Section
from varcalc.mechanics.frames import charged, rotating
from varcalc.mechanics.galerkin import Stepped
from varcalc.mechanics.legendre import Hamiltonian
from varcalc.mechanics.linearised import Linearised, NormalModes
from varcalc.mechanics.monodromy import Floquet
from varcalc.mechanics.motion import Ensemble, Event, Happening, Motion
from varcalc.mechanics.orbit_symmetry import Repeats, Returns
from varcalc.mechanics.passages import Passages
from varcalc.mechanics.reduced.inverse import force_of_orbit, well_width
from varcalc.mechanics.reduced.orbits import End, ReducedOrbit
from varcalc.mechanics.reduced.reduced import ReducedMotion
from varcalc.mechanics.reduced.rests import Rest
from varcalc.mechanics.rigid.body import RigidBody
from varcalc.mechanics.rigid.free import Cones, Polhode, PolhodeKind, SteadyRotation
from varcalc.mechanics.rigid.inertia import Inertia, Principal, TopKind, principal
from varcalc.mechanics.rigid.motion import RigidMotion
from varcalc.mechanics.rigid.nutation import Nutation, NutationCase
from varcalc.mechanics.rigid.rotations import EulerAngles, quaternion_of, rotation_matrix
from varcalc.mechanics.rigid.top import Top
from varcalc.mechanics.scattering.branches import Rainbow
from varcalc.mechanics.scattering.collision import Collision
from varcalc.mechanics.scattering.deflection import Deflections, Orbiting, ScatteringOutcome
from varcalc.mechanics.scattering.inversion import firsov
from varcalc.mechanics.scattering.scattering import Glory, Scattering
from varcalc.mechanics.stability.branches import (
    Bifurcation,
    BifurcationChart,
    BifurcationKind,
    EquilibriumBranch,
    bifurcation_chart,
)
from varcalc.mechanics.stability.chart import Boundaries, StabilityChart, stability_chart
from varcalc.mechanics.stability.fast_drive import Averaged, averaged
from varcalc.mechanics.stability.response import Response
from varcalc.mechanics.symmetries import Symmetry
from varcalc.mechanics.system import System
from varcalc.problem.conditions import Holonomic
from varcalc.spelling import NoAttribute, uncalled

__all__ = [
    "Averaged",
    "Bifurcation",
    "BifurcationChart",
    "BifurcationKind",
    "Boundaries",
    "ClosedOrbit",
    "ClosedOrbits",
    "Collision",
    "Cones",
    "Deflections",
    "End",
    "Ensemble",
    "Equilibria",
    "EquilibriumBranch",
    "EulerAngles",
    "Event",
    "Examination",
    "Examined",
    "Experiment",
    "Flights",
    "Floquet",
    "Glory",
    "Hamiltonian",
    "Happening",
    "Holonomic",
    "Inertia",
    "Linearised",
    "Motion",
    "Moved",
    "NormalModes",
    "Nutation",
    "NutationCase",
    "Orbiting",
    "Passages",
    "Pfaffian",
    "Polhode",
    "PolhodeKind",
    "Principal",
    "Rainbow",
    "ReducedMotion",
    "ReducedOrbit",
    "Repeats",
    "Response",
    "Rest",
    "Returns",
    "RigidBody",
    "RigidMotion",
    "Scattering",
    "ScatteringOutcome",
    "Section",
    "StabilityChart",
    "SteadyRotation",
    "Stepped",
    "Symmetry",
    "System",
    "Top",
    "TopKind",
    "averaged",
    "bifurcation_chart",
    "charged",
    "firsov",
    "force_of_orbit",
    "poisson",
    "principal",
    "quaternion_of",
    "rotating",
    "rotation_matrix",
    "stability_chart",
    "well_width",
]


def __getattr__(name: str) -> NoReturn:
    """No such name: the error suggests one that is near."""
    raise NoAttribute(__name__, name, __all__)


uncalled(__name__)
