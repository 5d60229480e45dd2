"""Whether a curve of a given length is the least of all: it encloses the most, or hangs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.breaks import whole
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.convexity import shapes_of
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import PROVED, Solution
from varcalc.symbolic.convexity import Shape, shapes
from varcalc.symbolic.derived import derived
from varcalc.symbolic.separation import separates

BY_LENGTH = "by the isoperimetric inequality no curve of this length encloses more: there is no other valley"
SAME_VALUE = 1e-9
"""Relative difference of two values that is none."""
HEIGHTS_ASKED = 9
"""Places at which a curve is asked how high it is."""
ANGLE_HALVINGS = 60
"""Halvings by which the angle of an arc is found."""
ON_SHORE = 8 * float(np.finfo(float).eps)
"""Of where a place is: how far off a straight line it is on it."""
ALONE = -1
ROWS = {0: 0, 1: 1, ALONE: 2}
"""Where multiples of rates are kept that stand beside x, beside y, and alone."""
SAME_SCALE = 1e-12
"""Relative difference of two scales that is round-off."""
IN_ARC_LENGTH = "in the curve by its arc length, which is given"
"""In what :func:`proved_in_arc_length` proves the functional convex."""


def by_length(solution: Solution) -> str:
    """Why there is no other valley than the solution's, which is as long as others; empty where that is not proved."""
    problem, sign, least = solution.problem, solution.problem.sign, least_by_length(solution.problem)
    if least is not None and sign * solution.value <= least + solution.error.value + SAME_VALUE * abs(least):
        return BY_LENGTH
    if solution.curve is None:
        return ""
    y = solution.curve(np.linspace(*solution.interval, HEIGHTS_ASKED), 0)[0]
    proved = proved_in_arc_length(problem, solution.multipliers, y)
    return f"{PROVED} {IN_ARC_LENGTH}: there is no other valley" if proved else ""


def least_by_length(problem: Functional) -> float | None:
    """The least that the integral of a curve in the plane can be, as it is minimised; None where that is not proved.

    It is proved where L is a sum of multiples of coordinates times their rates, an area up to what the ends say, and a
    level that of the length. No closed curve encloses more than a circle of its length, and between two given points
    none does than an arc: with the rest of the arc's circle it would (Osserman, "The isoperimetric inequality", Bull.
    Amer. Math. Soc. 84, 1978). With a straight shore, on which its ends lie and along which nothing is summed, none
    does than a semicircle: with its mirror image it would.
    """
    if not (isinstance(problem, Curve) and problem.n == 2 and problem.order == 1 and problem.symbols.kind is ca.SX):
        return None
    closed, shore = bool(problem.start.periodic), _shore(problem) if any(problem.slides) else None
    ends = np.array([end.values(2) for end in (problem.start, problem.end)])
    known = closed or shore is not None or np.isfinite(ends).all()
    if (any(problem.slides) and shore is None) or problem.end_cost_expression is not None or not known:
        return None
    integrand, constraints, _ = shapes_of(problem, problem.span, tuple(problem.parameters.values()))
    told = zip(problem.traced, constraints, strict=True)
    lengths = [_length(shape, high) for t, ((_, high), shape) in told if isinstance(t.constraint, Isoperimetric)]
    products, length = _products(integrand), min(lengths, default=math.inf)
    if products is None or not math.isfinite(length):
        return None
    turned = abs(products[0, 1] - products[1, 0])
    if shore is not None:
        point, along = shore
        summed = (along @ products[:2] @ along, (point @ products[:2] + products[2]) @ along)
        return None if np.any(summed) else -turned * length**2 / (2 * math.pi)
    chord = np.zeros(2) if closed else ends[1] - ends[0]
    middle = np.zeros(2) if closed else 0.5 * (ends[0] + ends[1])
    straight = float(middle @ products[:2] @ chord + products[2] @ chord)
    enclosed = _segment(length, math.hypot(*chord.tolist()))
    return problem.sign * straight - turned * enclosed


def _shore(problem: Curve) -> tuple[np.ndarray, np.ndarray] | None:
    """A point of the straight line on which both ends lie, where one slides, and along it; None where they do not."""
    q, t = ca.SX.sym("q", 2), ca.SX.sym("t")
    lines, places = list[tuple[np.ndarray, np.ndarray]](), list[np.ndarray]()
    for label in ("start", "end"):
        phi = problem.traced_slide(label, t, q, ca.SX)
        if phi is None:
            places.append(getattr(problem, label).values(2))
        elif (line := _straight(phi, q)) is None:
            return None
        else:
            lines.append(line)
            places += [line[0], line[0] + line[1]]
    point, along = lines[0]
    across = np.array([-along[1], along[0]])
    sizes = [np.abs(point).max() + np.abs(place).max() for place in places]
    on = [abs(across @ (place - point)) <= ON_SHORE * size for place, size in zip(places, sizes, strict=True)]
    return (point, along) if all(on) else None


def _straight(phi: ca.SX, q: ca.SX) -> tuple[np.ndarray, np.ndarray] | None:
    """A point of the line phi = 0 of a point q, and a unit vector along it; None where it is not proved straight."""
    shape = shapes(ca.Function("shore", [q], [ca.densify(phi)]), [[None, None]])[0][0]
    told = [shape.part.linear.get(0, 0.0), shape.part.linear.get(1, 0.0), shape.part.constant]
    numbers = [number for number in told if isinstance(number, float)]
    size = math.hypot(*numbers[:2])
    if not shape.affine or len(numbers) < len(told) or not 0 < size < math.inf:
        return None
    across = np.array(numbers[:2]) / size
    return -numbers[2] / size * across, np.array([across[1], -across[0]])


def _products(integrand: Shape) -> np.ndarray | None:
    """The multiples (3, 2) of dx and dy times x, times y and alone that L is the sum of; None where it is not."""
    part, found = integrand.part, np.zeros((3, 2))
    terms = [*part.quadratic.items(), *(((ALONE, j), c) for j, c in part.linear.items())]
    if not integrand.bare or part.constant != 0.0:
        return None
    for (i, j), c in terms:
        if i not in ROWS or j not in (2, 3) or not isinstance(c, float):
            return None
        found[ROWS[i], j - 2] = c
    return found


def _length(level: Shape, most: float) -> float:
    """The greatest length that a level leaves whose integral is at ``most`` so much; infinite where it is of no length.

    It is of a multiple of the length where it is the root of the same multiple of both squares of the rates.
    """
    base = level.base
    if base is None or level.exponent != 0.5 or not base.bare or base.part.linear or base.part.constant != 0.0:
        return math.inf
    scales = base.part.quadratic
    scale = scales.get((2, 2))
    if set(scales) != {(2, 2), (3, 3)} or scale != scales[3, 3] or not isinstance(scale, float):
        return math.inf
    return most / math.sqrt(scale)


def _segment(length: float, chord: float) -> float:
    """The area between an arc of a circle and its chord, of such lengths; none where the arc is no longer than that."""
    if not chord < length:
        return 0.0
    low, high = 0.0, math.pi  # half the angle of the arc
    for _ in range(ANGLE_HALVINGS):
        half = 0.5 * (low + high)
        low, high = (half, high) if math.sin(half) * length > chord * half else (low, half)
    return (length / high) ** 2 / 4 * (high - math.sin(high) * math.cos(high))


def proved_in_arc_length(problem: Functional, multipliers: Sequence[Any], y: np.ndarray) -> bool:
    """Whether an extremal with ordinates y (m,) is least of all curves that are as long, L = f(y) w, w² = 1 + k y'².

    By its length s a curve has the slopes x' and y' with x'² + k y'² = 1, and the functional is the integral of f(y).
    With no more than 1 the slopes are a convex set, so that where f is convex an extremal whose multiplier there,
    f - λ, is not negative is least (Troutman, "Variational Calculus and Optimal Control", ch. 3): a chain that hangs,
    and not the arch that it makes upside down.
    """
    plain = isinstance(problem, Problem) and problem.n == problem.order == 1 and problem.symbols.kind is ca.SX
    if not plain or any(problem.slides) or problem.start.periodic or problem.end_cost_expression is not None:
        return False
    if problem.symbols.unknowns.numel() or len(problem.constraints) != 1 or not multipliers:
        return False
    values = tuple(problem.parameters.values())
    if not isinstance(multipliers[0], float) or not _weighs_length(problem, problem.span, values):
        return False
    still, steep = (np.array([_told(problem, values, float(height), v) for height in y]).T for v in (0.0, 1.0))
    heaviest = int(np.argmax(np.abs(still[0])))
    with np.errstate(all="ignore"):
        first, other = ((steep[:, heaviest] / still[:, heaviest]) ** 2 - 1.0).tolist()
        tension = problem.sign * (still[0] - multipliers[0] * still[1])
    return abs(first - other) <= SAME_SCALE * other and bool((tension > 0.0).all())


def _told(problem: Functional, values: Sequence[float], y: float, v: float) -> list[float]:
    """L and what is levelled at the start of the interval."""
    return [float(part) for part in whole(problem)(problem.span[0], y, v, [], [*values], [])]


@derived
def _weighs_length(problem: Functional, span: tuple[float, float], values: tuple[float, ...]) -> bool:
    """Whether L is f(y) w with a convex f, or a concave one for what is made greatest, and the one level that of w."""
    (traced,), s = problem.traced, problem.symbols
    low, high = traced.constraint.interval if isinstance(traced.constraint, Isoperimetric) else (0.0, 1.0)
    if low != high:
        return False
    level = ca.Function("level", s.all, [traced.expression])
    if ca.depends_on(traced.expression, s.y) or not separates(level, values) or not separates(whole(problem), values):
        return False
    (at_rest,), *_ = shapes(whole(problem), [[span], [None], [0.0], [], [*values], []])
    return at_rest.concave if problem.maximise else at_rest.convex
