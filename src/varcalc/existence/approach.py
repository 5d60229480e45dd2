"""How the infimum is approached when no curve attains it: polygons on finer and finer meshes.

A minimising sequence that concentrates, its steepest slope growing with the
mesh, has no limit among the curves asked for (Weierstrass's example; Dacorogna,
"Direct Methods in the Calculus of Variations", sect. 3.1). Polygons have
bounded slopes: where curves with an infinite slope at an end come lower than
the limit of all polygons, there is a Lavrentiev gap (Ball and Mizel, Archive
for Rational Mechanics and Analysis 90, 1985).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from varcalc.existence.broken_curve import between_two_points
from varcalc.formulation import Coordinates, Form, Sampled, Stated, extended, formulate, rewriter, straight
from varcalc.methods.answer import Extremal
from varcalc.methods.ritz.method import Rung, Rungs
from varcalc.methods.ritz.newton import Newton
from varcalc.methods.ritz.slack import within_bounds, without_inequalities
from varcalc.numerics.mesh import SpaceCurve
from varcalc.problem.conditions import Bound, Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict
from varcalc.symbolic.derived import Cache

POLYGON_PIECES, MORE_PIECES = (16, 32, 64, 128), (256, 512, 1024)
"""Pieces of the polygons, and of those that tell a jump from a layer that is only thin."""
STEEPENING = 1.7
"""Growth of the steepest slope at each halving of the mesh that is concentration (2 for a jump)."""
GROWING = 1.4
"""Growth from which it may come to be that: of a slope that is infinite like the root of the distance."""
STANDING = 0.97
"""Share of the height of a low jump beside such a slope that each refinement of the mesh leaves, and three do."""
SINGULAR_POWERS = (2, 3, 4, 5, 6)
"""Powers k of the abscissa, x - x_end ~ t^k, that give a curve an infinite slope at an end."""
SMOOTH_DEGREE = 10
VALUES_RESOLVED = 1e-9
"""Difference, relative to what is summed, below which two values are one."""
BESIDE_END = (1e-3, 1e-4)
"""Shares of t, from a singular end, at which it is seen how L grows along a curve toward it."""
SMALL_TAIL = 1e-3
"""Share of a value that is nothing beside it."""
SURELY_SUMMABLE = 0.98
"""Power of the distance from an end whose inverse is summed up to it: with room for what measures a power of 1."""
CLEAR_SHARE = 0.5
"""Share of the polygons' limit below which a singular curve has to come."""


@dataclass(frozen=True)
class MinimisingSequence:
    """Minima over polygons: on ``elements`` pieces their ``values`` (person's sign), steepest slopes and where."""

    elements: np.ndarray
    values: np.ndarray
    steepest: np.ndarray
    where: float
    maximise: bool
    last: Extremal = field(repr=False)

    @property
    def limit(self) -> float:
        """What the values tend to, by Aitken's extrapolation of the last three."""
        a, b, c = (float(v) for v in self.values[-3:])
        first, second = b - a, c - b
        return c if first == second or abs(second) >= abs(first) else c - second**2 / (second - first)

    @property
    def concentrates(self) -> bool:
        """Whether the steepest slope grows with every refinement as that of a jump does, while the values improve."""
        steepest = self.steepest[-len(POLYGON_PIECES) :]  # what stands upright may be lower than the first pieces
        growing = bool(np.all(steepest[1:] > STEEPENING * steepest[:-1])) or self._stands
        return growing and bool(np.all(np.diff(-self.values if self.maximise else self.values) < 0))

    @property
    def _stands(self) -> bool:
        """Whether a part of the steepest piece's height does not fall like the root of its width, as the rest may."""
        if len(self.elements) < len(POLYGON_PIECES) + len(MORE_PIECES):
            return False
        heights = self.steepest / self.elements
        low = (heights[1:] - math.sqrt(0.5) * heights[:-1])[-len(MORE_PIECES) :]
        return bool(low[0] > 0 and (low[1:] > STANDING * low[:-1]).all())

    @property
    def finding(self) -> Finding:
        """What the meshes show where the sequence concentrates."""
        last = slice(-len(POLYGON_PIECES), None)
        told = zip(self.elements[last], self.values[last], strict=True)
        table = ", ".join(f"{v:.6g} on {n}" for n, v in told)
        bound, extreme = ("supremum", "greatest") if self.maximise else ("infimum", "least")
        sentence = (
            f"the {bound} is not attained: the {extreme} values over polygons, {table} pieces, tend to "
            f"{self.limit:.6g}, while the slope at x = {self.where:.4g} grows to {self.steepest[-1]:.3g} without bound"
        )
        numbers = {f"on {n} pieces": float(v) for n, v in zip(self.elements, self.values, strict=True)}
        numbers |= {"limit": self.limit, "steepest": float(np.max(self.steepest))}
        return Finding(Verdict.NOT_ATTAINED, sentence, numbers)


def approached(problem: Functional, *, closely: bool = False) -> MinimisingSequence | None:
    """Minima over polygons on finer and finer meshes; None where a mesh has none.

    The meshes go on, if they are to be looked at ``closely``, while the slope grows.

    Only graphs of first order without conditions but levels are looked at, and those that keep their bounds without
    being asked.
    """
    if not (isinstance(problem, Problem) and problem.order == 1):
        return None
    others = [c for c in problem.constraints if not (isinstance(c, Isoperimetric) and c.equality)]
    if not all(isinstance(c, Bound) and c.interval[0] < c.interval[1] for c in others):
        return None
    form = without_inequalities(formulate(problem))
    rows: list[tuple[int, float, float]] = []
    where, last = math.nan, None
    for elements in (*POLYGON_PIECES, *(MORE_PIECES if closely else ())):
        if elements in MORE_PIECES and not rows[-1][-1] > GROWING * rows[-2][-1]:
            break
        rungs = Rungs(form, Newton(), 12)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # what stands upright may be shared out among neighbours in many ways
            rung = rungs.start(rungs.first_space(elements, 1), None if last is None else _ordinates(last))
        if isinstance(rung, str):
            return None
        slopes, middles = _slopes(rung)
        rows.append((elements, form.sign * rung.value, slopes.max()))
        where, last = float(middles[np.argmax(slopes)]), _extremal(form, rung)
    assert last is not None
    if not within_bounds(formulate(problem), last):
        return None
    elements, values, steepest = np.array(rows).T
    return MinimisingSequence(elements.astype(int), values, steepest, where, problem.maximise, last)


def _ordinates(curve: Extremal) -> Sampled:
    return lambda x: curve.evaluate(x, 0)


def _extremal(form: Form, rung: Rung) -> Extremal:
    """The polygon of a mesh."""
    space = rung.system.space
    curve = space.curve(rung.system.coefficients(rung.z))
    numbers = rung.system.unknowns(rung.z)
    return Extremal(form, curve, numbers, space.vertices, np.zeros(0), {})


def _slopes(rung: Rung) -> tuple[np.ndarray, np.ndarray]:
    """The largest slope of each piece, and its middle."""
    vertices = rung.system.space.vertices
    y = rung.system.space.evaluate(rung.system.coefficients(rung.z), vertices)
    return np.abs(np.diff(y) / np.diff(vertices)).max(0), 0.5 * (vertices[1:] + vertices[:-1])


@dataclass(frozen=True)
class Gap:
    """A curve with an infinite slope at one end: its value, and the power k of x - x_end ~ t^k.

    ``scale`` is the sum of the absolute contributions to the value, ``curve`` the ordinates as a function of x. Where L
    has no integral up to the end along it, ``tail`` is what each e-fold of t adds there, which no sum of samples shows.
    """

    value: float
    scale: float
    power: int
    at_start: bool
    curve: Sampled = field(repr=False)
    tail: float = 0.0

    def clear_of(self, value: float, sign: float) -> bool:
        """Whether a value is clearly worse than this one."""
        if self.tail > SMALL_TAIL * abs(value):
            return False
        return sign * (value - self.value) > CLEAR_SHARE * abs(value) + VALUES_RESOLVED * self.scale

    def finding(self, limit: float) -> Finding:
        """What the gap is, where other curves come down to ``limit``."""
        end = "start" if self.at_start else "end"
        sentence = (
            f"a Lavrentiev gap: curves of bounded slope come down to {limit:.6g} only, but one that leaves the {end} "
            f"like the power 1/{self.power} of the distance reaches {self.value:.6g}"
        )
        return Finding(Verdict.GAP, sentence, {"value": self.value})


def gap(problem: Functional, approach: MinimisingSequence) -> Gap | None:
    """A curve with an infinite slope at an end that is clearly better than the limit of all polygons."""
    if not between_two_points(problem):
        return None
    found = [
        found
        for at_start in (True, False)
        for k in SINGULAR_POWERS
        if (found := _steep(problem, k, at_start, least=True))
    ]
    sign = problem.sign
    best = min(found, key=lambda g: sign * g.value, default=None)
    if best is None:
        return None
    last = float(approach.values[-1])
    # the extrapolation may be off by as much as it adds; a curve between the two proves nothing
    sure = approach.limit - sign * abs(approach.limit - last)
    if not best.clear_of(sure, sign):
        return None
    # the polygons may have been in another valley
    beside = _polygons_beside(problem, best)
    return best if beside is None or best.clear_of(beside, sign) else None


def _polygons_beside(problem: Problem, steep: Gap) -> float | None:
    """The least value over polygons that descending from a steep curve leads to; None where it leads to none."""
    form = formulate(problem)
    rungs = Rungs(form, Newton(), 1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        rung = rungs.start(rungs.first_space(POLYGON_PIECES[-1], 1), steep.curve)
    return None if isinstance(rung, str) else form.sign * rung.value


def outdone(solution: Solution) -> Gap | None:
    """A curve with an infinite slope at an end that is clearly better than a solution; None when none was found.

    Only the simplest curve of each power is looked at, which costs one
    evaluation of the functional: enough to doubt a minimum where L is singular.
    """
    problem = solution.problem
    if not between_two_points(problem):
        return None
    sign = problem.sign
    for at_start in (True, False):
        for power in SINGULAR_POWERS:
            found = _steep(problem, power, at_start, least=False)
            if found is None:
                continue
            if found.clear_of(solution.value, sign):
                return found
    return None


def _steep(problem: Problem, power: int, at_start: bool, *, least: bool) -> Gap | None:
    """A value over curves smooth in s where x - x_end ~ s^power: the ``least``, or that of y linear in s.

    The latter counts when a finer rule confirms it.
    """
    form = _stretched(problem, power, at_start)
    rungs = Rungs(form, Newton(), 1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        space = rungs.first_space(1, SMOOTH_DEGREE)
        if least:
            rung = rungs.start(space, None)
            if isinstance(rung, str):
                return None
            system, z = rung.system, rung.z
        else:
            system = rungs.system(space)
            z = system.pack(system.space.fit(form.start.curve), form.start.unknowns)
        finer, again = rungs.prolonged(system, z)
        at = finer.evaluate(again)
        coarse = at.value if least else system.evaluate(z).value
    size = max(abs(coarse), abs(at.value))
    settled = math.isfinite(size) and abs(coarse - at.value) <= CLEAR_SHARE * size
    if not settled:
        return None
    (a, b), along = problem.span, space.curve(system.coefficients(z))

    def curve(x: np.ndarray) -> np.ndarray:
        share = np.clip((x - a if at_start else b - x) / (b - a), 0.0, 1.0) ** (1 / power)
        return along(share if at_start else 1 - share, 0)

    tail = _tail(problem, along, power, at_start)
    return Gap(form.sign * at.value, at.scale, power, at_start, curve, tail)


def _tail(problem: Problem, along: SpaceCurve, power: int, at_start: bool) -> float:
    """What each e-fold of s adds to the integral of L along a curve of s next to an end; 0 where that is ever less."""
    (a, b), near = problem.span, np.array(BESIDE_END)
    s, inward = (near, b - a) if at_start else (1 - near, a - b)
    speed = (b - a) * power * near ** (power - 1)
    x = (a if at_start else b) + inward * near**power
    with np.errstate(all="ignore"):
        far, close = np.abs(problem.integrand_values(x, along(s, 0), along(s, 1) / speed) * speed)
        return float(close * near[1]) if close >= far * (near[0] / near[1]) ** SURELY_SUMMABLE else 0.0


def _stretched(problem: Problem, power: int, at_start: bool) -> Form:
    """The problem in s over [0, 1], where the distance from one end in x is a power of that in s."""
    plain = formulate(problem)
    symbols = extended(problem, problem.n, 0)
    a, b = problem.span
    near = symbols.x if at_start else 1 - symbols.x
    speed = (b - a) * power * near ** (power - 1)
    x = a + (b - a) * near**power if at_start else b - (b - a) * near**power
    rewrite = rewriter(problem, symbols, x, symbols.y, [symbols.dy / speed], speed)
    integrand = plain.sign * rewrite(problem.integrand, True)
    ends = plain.start.curve(np.array(problem.span))
    stated = Stated(symbols, integrand, integrand, (x, symbols.y, speed, symbols.dy))
    return replace(
        plain,
        coordinates=Coordinates(stated, note=f"x ~ s^{power}"),
        start=replace(plain.start, curve=straight((0.0, 1.0), ends[:, 0], ends[:, 1])),
        cache=Cache(),
    )
