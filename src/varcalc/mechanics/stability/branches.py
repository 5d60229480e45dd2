"""Bifurcation charts: equilibria followed in a parameter by arc length, through folds and where branches meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np

from varcalc.mechanics.arguments import ascending_span, finite_column
from varcalc.mechanics.stability.curve import RestCurve, Station
from varcalc.mechanics.system import System, check_system
from varcalc.problem.conditions import text
from varcalc.showing import Shown
from varcalc.spelling import check_names, spelled

PARAMETER_SHARES = np.array([0.0, 0.1719, 0.3931, 0.6142, 0.8353, 1.0])
"""Shares of the range of the parameter at which all equilibria are searched for: no likely places of bifurcations."""
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.01, 0.05, 1e-7
"""Of the box: lengths of a step."""
LEAST_COSINE = 0.95
"""Of the angle between successive tangents."""
MOST_STATIONS = 2000
ONE_PLACE = 1e-6
"""Of the box: places so near are one."""
BRANCH_OFFSET = 1e-3
"""Of the box: how far from where branches meet another is looked for."""


class BifurcationKind(Enum):
    """What happens at a bifurcation; each member carries its meaning."""

    FOLD = "two equilibria meet and vanish: the branch turns back in the parameter"
    PITCHFORK = "two equilibria leave a third, on one side of the parameter"
    TRANSCRITICAL = "two branches cross, each on either side of the parameter"
    OSCILLATION = "the equilibrium stays, and its small motions begin to swing farther and farther"


@dataclass(frozen=True, repr=False, eq=False)
class Bifurcation(Shown):
    """A bifurcation at ``place`` (n,) where the parameter has the value ``parameter``, which is off by ``error``."""

    kind: BifurcationKind
    parameter: float
    place: np.ndarray
    error: float


@dataclass(frozen=True, repr=False, eq=False)
class EquilibriumBranch(Shown):
    """Equilibria in the order of the branch: ``places`` (m, n) at ``parameter`` (m,), and which are ``stable`` (m,)."""

    parameter: np.ndarray
    places: np.ndarray
    stable: np.ndarray


@dataclass(frozen=True, repr=False)
class BifurcationChart(Shown):
    """All ``branches`` that were found over the parameter ``name``, their ``bifurcations``, and what was ``searched``.

    ``unresolved`` counts parts of the boxes searched in which there may be other equilibria.
    """

    name: str
    branches: tuple[EquilibriumBranch, ...]
    bifurcations: tuple[Bifurcation, ...]
    searched: str
    unresolved: int


@spelled
def bifurcation_chart(
    system: System,
    low: Sequence[float] | np.ndarray,
    high: Sequence[float] | np.ndarray,
    name: str,
    between: tuple[float, float],
) -> BifurcationChart:
    """The equilibria of a ``system`` from ``low`` to ``high`` (n,) over the parameter ``name``, ``between`` two values.

    All equilibria at both ends and at some values between are searched for by :meth:`System.equilibria`; each one that
    lies on no branch yet begins one, which is followed by its arc length both ways until it leaves the box or the
    range (Keller, in "Applications of Bifurcation Theory", 1977). Folds, and places where branches meet, are solved
    for as regular zeros of extended equations (Seydel, "Practical Bifurcation and Stability Analysis", sect. 5.4,
    5.5); the branches that meet there are followed too. An island of equilibria that none of the values searched at
    cuts is not seen.

    Raises ValueError for a ``name`` that is no parameter, for constraints, and for forces that depend on the time.

    >>> import casadi as ca
    >>> hoop = System(lambda t, q, v, p: (v[0]**2 + (p.w * ca.sin(q[0]))**2) / 2 + ca.cos(q[0]), ("theta",),
    ...               parameters={"w": 0.5})
    >>> chart = bifurcation_chart(hoop, [-1.5], [1.4], "w", (0.5, 2.0))
    >>> [(one.kind.name, round(one.parameter, 12)) for one in chart.bifurcations]
    [('PITCHFORK', 1.0)]
    """
    check_system(system)
    first, last = ascending_span(between, "between", "values")
    check_names("parameters of this system", [text("name", name)], system.parameters)
    lowest, highest = finite_column("low", low, system.n), finite_column("high", high, system.n)
    corners = np.append(lowest, first), np.append(highest, last)
    walk = _EquilibriumCurve(RestCurve.of(system, name, corners[1] - corners[0]), *corners)
    unresolved, values = 0, first + (last - first) * PARAMETER_SHARES
    for value in values:
        found = system.with_parameters({name: float(value)}).equilibria(low, high)
        unresolved += found.unresolved
        for place in found.places:
            walk.from_start(np.append(place, value))
    searched = f"equilibria at {len(values)} values of {name} from {first:g} to {last:g} and all branches through them"
    branches = tuple(_branch(one) for one in walk.branches)
    return BifurcationChart(name, branches, tuple(walk.bifurcations), searched, unresolved)


def _branch(stations: list[Station]) -> EquilibriumBranch:
    z = np.array([one.z for one in stations])
    return EquilibriumBranch(z[:, -1], z[:, :-1], np.array([one.stable for one in stations]))


class _EquilibriumCurve:
    """All branches of a curve of equilibria between the corners ``low`` and ``high`` (n + 1,), the parameter last."""

    def __init__(self, curve: RestCurve, low: np.ndarray, high: np.ndarray) -> None:
        self.curve, self.low, self.high = curve, low, high
        self.branches: list[list[Station]] = []
        self.bifurcations: list[Bifurcation] = []

    def from_start(self, z: np.ndarray) -> None:
        """The branch through an equilibrium, both ways, unless it lies on one already; then those that it meets."""
        waiting = [z]
        while waiting:
            start = self.curve.station(waiting.pop(), None)
            if start is None or self._known(start.z):
                continue
            forward = self._followed(start)
            backward = self._followed(start.turned())
            stations = [one.turned() for one in backward[:0:-1]] + forward
            self.branches.append(stations)
            for before, after in pairwise(stations):
                waiting += self._between(before, after)

    def _inside(self, z: np.ndarray) -> bool:
        room = ONE_PLACE * (self.high - self.low)
        return bool(np.all((z >= self.low - room) & (z <= self.high + room)))

    def _known(self, z: np.ndarray) -> bool:
        """Whether a place lies on a branch that was followed, corrected from its neighbours there."""
        for stations in self.branches:
            places = np.array([one.z for one in stations]) / self.curve.size
            target = z / self.curve.size
            near = int(np.argmin(np.linalg.norm(places - target, axis=1)))
            for station in {max(near - 1, 0), near, min(near + 1, len(stations) - 1)}:
                one = stations[station]
                length = float(one.tangent @ ((z - one.z) / self.curve.size))
                if abs(length) <= 2 * LONGEST_STEP:
                    met = self.curve.step(one, length)
                    if met is not None and np.abs((met.z - z) / self.curve.size).max() <= ONE_PLACE:
                        return True
        return False

    def _followed(self, start: Station) -> list[Station]:
        """The stations from a start, in the direction of its tangent, to the edge or round to the start."""
        stations, step = [start], FIRST_STEP
        while len(stations) < MOST_STATIONS and step >= SHORTEST_STEP:
            here = stations[-1]
            following = self.curve.step(here, step)
            if following is None or here.tangent @ following.tangent < LEAST_COSINE:
                step /= 2
                continue
            if not self._inside(following.z):
                edge = self.curve.at_edge(here, step, self.low, self.high)
                if edge is not None:
                    stations.append(edge)
                break
            stations.append(following)
            gone = np.linalg.norm((following.z - start.z) / self.curve.size)
            if len(stations) > 3 and gone < step and following.tangent @ start.tangent > LEAST_COSINE:
                stations.append(start)
                break
            step = min(1.5 * step, LONGEST_STEP)
        return stations

    def _between(self, before: Station, after: Station) -> list[np.ndarray]:
        """What happens between two stations; and places on branches that leave there."""
        if before.side * after.side < 0:
            return self._meeting(before, after)
        if before.tangent[-1] * after.tangent[-1] < 0:
            found = self.curve.fold(before, after)
            if found is not None:
                self._note(BifurcationKind.FOLD, *found)
        elif before.stable != after.stable:
            self._note(BifurcationKind.OSCILLATION, *self.curve.change(before, after))
        return []

    def _meeting(self, before: Station, after: Station) -> list[np.ndarray]:
        found = self.curve.meeting(before, after)
        if found is None:
            return []
        z, error = found
        leaving, kind = [], BifurcationKind.TRANSCRITICAL
        for tangent in self.curve.other_tangents(z, before.tangent):
            if abs(tangent[-1]) < abs(np.linalg.norm(tangent[:-1])) * BRANCH_OFFSET:
                kind = BifurcationKind.PITCHFORK
            leaving += [z + sign * BRANCH_OFFSET * tangent * self.curve.size for sign in (1, -1)]
        if abs(before.tangent[-1]) < BRANCH_OFFSET**0.5 and before.tangent[-1] * after.tangent[-1] < 0:
            kind = BifurcationKind.PITCHFORK  # met along the branch that turns
        self._note(kind, z, error)
        corrected = (self.curve.beside(guess, z) for guess in leaving)
        return [one for one in corrected if one is not None and self._inside(one)]

    def _note(self, kind: BifurcationKind, z: np.ndarray, error: float) -> None:
        """Keep a bifurcation that is not known yet."""
        for one in self.bifurcations:
            if np.abs((np.append(one.place, one.parameter) - z) / self.curve.size).max() <= ONE_PLACE:
                if one.kind is BifurcationKind.TRANSCRITICAL and kind is BifurcationKind.PITCHFORK:
                    self.bifurcations[self.bifurcations.index(one)] = replace(one, kind=kind)
                return
        self.bifurcations.append(Bifurcation(kind, float(z[-1]), z[:-1], error))
