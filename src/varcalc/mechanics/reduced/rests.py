"""Where a motion in one coordinate can rest: equilibria, circular orbits, separatrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.mechanics.reduced.effective import EffectivePotential
from varcalc.mechanics.reduced.routh import OneCoordinate
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.showing import Shown

LEVEL, NO_CURVATURE = 1e-9, 1e-2
"""Of the curvature of W beside a place, of its size: less is a curvature of 0 there."""
ONE_PLACE = 1e-9
"""Of a coordinate: two places so near are one."""


@dataclass(frozen=True, repr=False)
class Rest(Shown):
    """A place at which the coordinate can rest: an equilibrium, or a circular orbit where angles go on.

    Attributes
    ----------
    place, energy : float
    stable : bool
        Whether the effective potential is least there.
    rate : float
        The angular frequency of small oscillations, or where it is not stable the rate λ at which motions part from
        it; 0 where that is of higher order.
    angular_rates : mapping
        The rate of each ignorable coordinate, by name.
    """

    place: float
    energy: float
    stable: bool
    rate: float
    angular_rates: Mapping[str, float]

    @property
    def logarithm(self) -> float:
        """1/λ where it is not stable, 0 where it is.

        A motion whose energy is off by ε takes ln(1/ε)/λ, and what does not depend on ε, for every time it passes.
        """
        if self.stable:
            return 0.0
        return 1 / self.rate if self.rate > 0 else np.inf


def rests(potential: EffectivePotential, nodes: PotentialNodes, names: tuple[str, ...]) -> tuple[Rest, ...]:
    """The rests in one chart, in ascending order: where the slope of W changes its sign between the nodes."""
    _, slope = potential.at(nodes.u)
    turn = np.flatnonzero(np.sign(slope[1:]) * np.sign(slope[:-1]) < 0)
    level = np.flatnonzero(slope[1:-1] == 0) + 1
    sides = slope[level - 1] * slope[level + 1] < 0
    places = np.sort(potential.place(np.concatenate([nodes.u[turn], nodes.u[level[sides]]])))
    stops = potential.place(potential.stops)
    found: list[Rest] = []
    for place in places:
        kink = len(stops) and np.min(np.abs(stops - place)) <= ONE_PLACE * max(1.0, abs(place))
        if not kink and not (found and abs(found[-1].place - place) <= ONE_PLACE * max(abs(place), ONE_PLACE)):
            found.append(_rest(potential.one, float(place), names))
    return tuple(found)


def _rest(one: OneCoordinate, place: float, names: tuple[str, ...]) -> Rest:
    slope = ca.gradient(one.potential, one.q)
    parts = [one.potential, ca.gradient(slope, one.q), one.inertia, one.steady]
    energy, bent, inertia, rates = (
        np.array(p, dtype=float).ravel() for p in ca.Function("rest", [one.q], parts)(place)
    )
    squared = float(bent[0] / inertia[0])
    around = place + NO_CURVATURE * (abs(place) or 1.0) * np.array([[-1.0, 1.0]])
    size = np.abs(np.array(ca.Function("bent", [one.q], [parts[1]])(around))).max()
    rate = np.sqrt(abs(squared)) if abs(float(bent[0])) > LEVEL * size else 0.0
    steep = np.array(ca.Function("slope", [one.q], [slope])(around)).ravel()
    return Rest(
        place, float(energy[0]), bool(steep[1] > steep[0]), float(rate), dict(zip(names, rates.tolist(), strict=True))
    )
