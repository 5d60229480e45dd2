"""A system reduced to one coordinate."""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.mechanics.reduced.charts import OpenChart, charts
from varcalc.mechanics.reduced.effective import EffectivePotential
from varcalc.mechanics.reduced.orbits import ReducedOrbit, Regions
from varcalc.mechanics.reduced.rests import ONE_PLACE, Rest, rests
from varcalc.mechanics.reduced.routh import OneCoordinate
from varcalc.problem.conditions import finite
from varcalc.spelling import spelled
from varcalc.symbolic.switches import switches


@spelled
class ReducedMotion:
    """The motions of a system in its one ``coordinate``, the momenta of the ``ignorable`` ones being given.

    What is kept is a(q) q'²/2 + W(q), W being the effective potential: time and angles follow by quadrature (Landau
    and Lifshitz, "Mechanics", sect. 11 and 14; Brizard, "An Introduction to Lagrangian Mechanics", eq. 4.6 to 4.10).
    The line is cut where L is singular, and the parts that are the same points of space, as those of positive and
    negative radii are, count once. A coordinate of which L is periodic with 2π is an angle, and looked at for one
    turn, from where W is greatest. See :meth:`System.reduced`, which makes one.
    """

    def __init__(self, one: OneCoordinate, coordinate: str, ignorable: tuple[str, ...]) -> None:
        self.coordinate: str = coordinate
        self.ignorable: tuple[str, ...] = ignorable
        self._one = one

    def __repr__(self) -> str:
        return f"ReducedMotion({self.coordinate}{'; ' + ', '.join(self.ignorable) if self.ignorable else ''})"

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """The places where the coordinate can rest, in ascending order: equilibria, and circular orbits.

        They are changes of sign of dW/dq between places so close that a cubic foretells W, in enclosures of it between
        which nothing narrow lies; where W is level without being extreme there is none.
        """
        return tuple(sorted((one for region in self._regions for one in region.rests), key=lambda one: one.place))

    @property
    def separatrices(self) -> tuple[Rest, ...]:
        """The rests that are not stable: at their energies motions take for ever, by the logarithm that each names."""
        return tuple(one for one in self.rests if not one.stable)

    def orbits(self, energy: float) -> tuple[ReducedOrbit, ...]:
        """The motions of an ``energy``, one for each well or region in which it allows any, in ascending order.

        An energy that is a separatrix's to round-off is that one. At the energy of a rest that is stable the coordinate
        does not move: there is no motion but what :attr:`rests` tells of. Raises ValueError for an energy that is not
        finite.
        """
        height = finite("energy", energy)
        found = [orbit for region in self._regions for orbit in region.orbits(height)]
        return tuple(sorted(found, key=lambda orbit: orbit.low))

    @cached_property
    def _regions(self) -> tuple[Regions, ...]:
        one = self._one
        functions = [one.potential, one.inertia, 1 / one.inertia]
        functions += [*ca.vertsplit(one.steady), *ca.vertsplit(one.carried)] if self.ignorable else []
        jump = next((one for one in switches(functions, [self._one.q]) if one.jumps), None)
        if jump is not None:
            raise ValueError(
                f"L switches ({jump.word}), and may jump, where {jump.argument} is zero: reduce each side by itself"
            )
        found = charts(functions, one.q, one.covering)
        return tuple(self._of_angle(chart) if chart.turning else self._between(chart) for chart in found)

    def _between(self, chart: OpenChart) -> Regions:
        potential = EffectivePotential(self._one, chart)
        nodes = potential.nodes(0.0, 0.0, *chart.limits)
        return Regions(potential, nodes, rests(potential, nodes, self.ignorable), self.ignorable)

    def _of_angle(self, chart: OpenChart) -> Regions:
        """A turn that begins where W is largest, so that each well lies in it whole."""
        whole = EffectivePotential(self._one, chart)
        wide = whole.nodes(chart.low, chart.high, chart.low - np.pi, chart.high + np.pi)
        inside = (wide.u >= chart.low) & (wide.u < chart.high)
        known = rests(whole, wide, self.ignorable)
        top = float(wide.u[inside][np.argmin(wide.g[inside])])
        top = min((rest.place for rest in known), key=lambda place: abs(place - top), default=top)
        begun = OpenChart(top, top + 2 * np.pi, turning=True)
        potential = EffectivePotential(self._one, begun)
        nodes = potential.nodes(begun.low, begun.high, begun.low, begun.high)
        inner = [
            rest
            for rest in rests(potential, nodes, self.ignorable)
            if top + ONE_PLACE < rest.place < begun.high - ONE_PLACE
        ]
        first = [rest for rest in known if rest.place == top]
        return Regions(potential, nodes, (*first, *inner), self.ignorable)
