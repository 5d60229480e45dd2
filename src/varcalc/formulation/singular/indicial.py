"""With which powers of the distance from an end extremals grow where L is singular in x there.

Where the dependence of L on the slope blows up or dies like a power of the
distance d from an end, d^s y'^2 say, the momentum L_y' = const makes y - y0 grow
like a power e of it. Where L_yy beside L_y'y' does so as well, so that
d^2 (L_yy - d/dx L_yy') / L_y'y' tends to a number kappa other than zero, e is
the larger root of e (e + s - 1) = kappa (the indicial equation: Hartman,
"Ordinary Differential Equations", ch. XI); where it tends to zero like a power
of d, that power is added to e again and again, and so is that of what L_y pulls
with. In t with d = t^b all are whole powers of t where they are fractions of
small denominators. Where they are not, meshes are graded toward the end: polynomials on elements that shrink by a
common ratio come near every power at a geometric rate (Schwab, "p- and hp-Finite Element Methods", sect. 3.3), and b
is no larger than the curve needs to leave the end smoothly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from varcalc.formulation.singular.detection import A_FRACTION, LARGEST_DENOMINATOR, PROBE, completed_ends, end_points
from varcalc.formulation.singular.powers import ANY_SLOPES, scaling
from varcalc.problem.problem import Problem

FEW_SLOPES = np.array([-1e6, -1e3, -1.0, -1e-3, 1e-3, 1.0, 1e3, 1e6])
MEASURED = 1e-4
"""Accuracy with which an exponent is measured."""
SMOOTH = 6
"""Power of the distance from which what is no whole power of it counts for one."""
LEAVES, MOST_LEAVES = 2, 8
"""Power of t that a curve grows with next to an end toward which its mesh is graded: at least, and at most, as what is
left of polynomials times more is not told apart at the end itself.
"""
SHRINK = 0.1
"""Ratio of an element to its neighbour in a mesh that is graded toward an end."""
DIGITS, MOST_LAYERS = 13.0, 10
"""Digits to which what L comes to in the element at the end is nothing, and layers that round-off tells apart."""
SQUARED, NEXT_TO_END = 150, 3
"""Decades of the distance that can be squared, and decades of t from the innermost vertex to the first point of a rule.
"""
LARGEST_POWER = 40
"""Largest power of t in x: a step of a twentieth in t leaves numbers that can still be squared."""
MOST_WHOLE = 2 * LARGEST_DENOMINATOR
"""Largest denominator, and numerator, of a power that is taken for a fraction."""
SAME_MOMENTUM = 1e-3
"""Slopes by which it is seen that the momentum is the same at both distances, and its relative change that is none:
the least power that counts, a twelfth, changes it by a third."""
REGULAR_POWER, REGULAR_SHARE = 1e-2, 1e-4
"""Powers of L_y'y', and values of kappa at the nearer distance, that are none: beside a regular end they are 1e-9."""
LEFT_OVER = 1e-2
"""Share of two terms that is left when they cancel and tells nothing, as where L is a length and a curve is upright."""
STAYS, NO_INTEGRAL = 0.5, -1.0 + 1e-7
"""Share of a distance from the ordinate of an end that is left nearer to that, and the power of L with no integral."""
SURELY_NEGATIVE = -1e-4
"""What is as little below zero is as good as zero, with the digits that L keeps so near an end."""


@dataclass(frozen=True)
class Growth:
    """Beside an end the distance from it is t^``abscissa``, and the curve grows like t^``ordinate``.

    Where other powers are not whole a mesh is to have so many ``layers``, each SHRINK as far from the end as the last,
    and t^``ordinate`` is all of the first power where the distance is t^``fractional``.
    """

    abscissa: int = 1
    ordinate: int = 1
    layers: int = 0
    fractional: float = 1.0

    @property
    def plain(self) -> bool:
        """Whether the abscissa itself serves."""
        return self == Growth()

    @property
    def steep(self) -> bool:
        """Whether the slope of the curve is infinite at the end."""
        return self.ordinate < self.abscissa


@dataclass(frozen=True)
class SingularEnd:
    """An end at ``place`` where L_y'y' grows like the ``power`` of the distance, and kappa comes to ``share``.

    ``steps`` are the powers of the distance by which terms of an extremal follow one another.
    """

    place: float
    power: float
    share: float
    steps: tuple[float, ...] = ()

    @property
    def discriminant(self) -> float:
        """That of the indicial equation, by four: negative where variations oscillate infinitely often at the end."""
        return (0.5 * (1.0 - self.power)) ** 2 + self.share

    @property
    def oscillates(self) -> bool:
        """Whether variations beside the end oscillate infinitely often."""
        return self.discriminant < SURELY_NEGATIVE

    @property
    def euler(self) -> bool:
        """Whether kappa is other than zero there."""
        return abs(self.share) >= REGULAR_SHARE

    @property
    def exponent(self) -> float:
        """The larger root of the indicial equation: of two solutions the one of finite value."""
        return 0.5 * (1.0 - self.power) + math.sqrt(max(self.discriminant, 0.0))


def singular_end(place: float, steps: np.ndarray, second: np.ndarray) -> SingularEnd | None:
    """What L_yy, L_yy', L_y'y' (3, 2) at two ``steps`` from a place tell of variations; None where that is regular.

    None where L_yy and d/dx L_yy' all but cancel as well.
    """
    (yy, mixed, pp), ratio = second, math.log(steps[0] / steps[1])
    if not (np.isfinite(second).all() and (pp > 0).all()):
        return None
    growth = math.log(mixed[0] / mixed[1]) / ratio if mixed[0] * mixed[1] > 0 else 0.0
    mixed_rate = growth * mixed / steps  # d/dx L_yy'
    if abs(yy[1] - mixed_rate[1]) < LEFT_OVER * (abs(yy[1]) + abs(mixed_rate[1])):
        return None
    shares = steps**2 * (yy - mixed_rate) / pp
    power = math.log(pp[0] / pp[1]) / ratio
    follow = (math.log(shares[0] / shares[1]) / ratio,) if shares[0] * shares[1] > 0 else ()
    regular = abs(power) < REGULAR_POWER and abs(shares[1]) < REGULAR_SHARE
    if regular and not any(_broken(step) for step in follow):
        return None
    return SingularEnd(place, power, float(shares[1]), follow)


def singular_ends_of(problem: Problem) -> tuple[SingularEnd | None, SingularEnd | None]:
    """What becomes of variations of the chord, of one function of first order, beside either end."""
    points = np.array(completed_ends(problem))
    steps = (points[1, 0] - points[0, 0]) * np.array([PROBE, PROBE]) * [[1.0], [-1.0]]
    slope = _chord(points)
    places, y = points[:, :1] + steps, points[:, 1:] + slope * steps
    with np.errstate(all="ignore"):
        found = problem.integrand_derivatives(places.ravel(), y.ravel()[None], np.full((1, 4), slope))
        hessian = problem.sign * found.hessian.reshape(2, 2, 3, 3)
        # what L_y is beside its part that grows with y, whose powers are those of L_yy
        whole = (problem.sign * found.gradient[:, 1]).reshape(2, 2)
        pull = whole - y * hessian[:, :, 1, 1]
        momentum = hessian[:, :, 2, 2]
        second = np.stack([hessian[:, :, 1, 1], hessian[:, :, 1, 2], momentum], axis=1)
        ends = [singular_end(float(points[k, 0]), steps[k], second[k]) for k in (0, 1)]
        # where L_y drives a curve off the ordinate of the end however near it is, none that begins there is extremal;
        # a free end is where it does not, which is looked for at zero
        free = [not end.fixed for end in (problem.start, problem.end)]
        drives = np.where(np.array(free)[:, None], pull, whole)
        driven = np.abs(steps**2 * drives / momentum)[:, 1] > REGULAR_SHARE * np.abs(points[:, 1]).max()
        ends = [None if end is not None and end.euler and driven[k] else end for k, end in enumerate(ends)]
        return _pulled(ends[0], steps[0], pull[0], momentum[0]), _pulled(ends[1], steps[1], pull[1], momentum[1])


def infinite_at(problem: Problem) -> str | None:
    """The end of an L of second degree at whose ordinate all curves have infinite values; None where none is shown.

    With the slope that makes L least it is a parabola of y. Where the least point of that stays away from the ordinate
    of the end, L is above a share of the rise between them on every curve that comes near it: a power of the distance.
    """
    points, width = np.array(end_points(problem)), problem.span[1] - problem.span[0]
    steps = width * np.array([PROBE, PROBE]) * [[1.0], [-1.0]]
    y = points[:, 1:].repeat(2, axis=1)
    with np.errstate(all="ignore"):
        found = problem.integrand_derivatives((points[:, :1] + steps).ravel(), y.ravel()[None], np.zeros((1, 4)))
        value = problem.sign * found.rows[:, 0].reshape(2, 2)
        gradient = problem.sign * found.gradient.reshape(2, 2, 3)
        hessian = problem.sign * found.hessian.reshape(2, 2, 3, 3)
        share = gradient[:, :, 2] / hessian[:, :, 2, 2]
        least = value - 0.5 * share * gradient[:, :, 2]
        slope = gradient[:, :, 1] - share * hessian[:, :, 1, 2]
        bend = hessian[:, :, 1, 1] - hessian[:, :, 1, 2] ** 2 / hessian[:, :, 2, 2]
        away, rise = np.abs(slope / bend), 0.5 * slope**2 / bend
        half_way = least - 0.75 * rise  # of the parabola at half of the way to its least point
        power = np.log(half_way[:, 1] / half_way[:, 0]) / math.log(PROBE[1] / PROBE[0])
        convex = (hessian[:, :, 2, 2] > 0).all(1) & (bend > 0).all(1) & (half_way > 0).all(1)
        shown = convex & (away[:, 1] > STAYS * away[:, 0]) & (away[:, 0] > 0) & (power < NO_INTEGRAL)
    return None if not shown.any() else "start" if shown[0] else "end"


def _chord(points: np.ndarray) -> float:
    slope = float((points[1, 1] - points[0, 1]) / (points[1, 0] - points[0, 0]))
    return slope if math.isfinite(slope) else 0.0


def momenta_beside_ends(problem: Problem) -> np.ndarray:
    """L_y' at both distances from either end, for a few slopes: shape (ends, distances, slopes)."""
    ((x0, y0), (x1, y1)), count = (end.tolist() for end in end_points(problem)), len(FEW_SLOPES)
    steps = (x1 - x0) * np.array(PROBE)
    x = np.concatenate([x0 + steps, x1 - steps]).repeat(count)
    y = np.array([y0, y0, y1, y1]).repeat(count)
    momenta = problem.integrand_derivatives(x, y[None], np.tile(FEW_SLOPES, 4)[None]).gradient[:, 2]
    return momenta.reshape(2, 2, count)


def regular(momenta: np.ndarray) -> bool:
    """Whether the momentum is the same at both distances from either end, whatever the slope: no power of x then."""
    far, near = momenta.swapaxes(0, 1)
    with np.errstate(invalid="ignore"):  # infinite ones are not the same
        return bool((np.abs(near - far) <= SAME_MOMENTUM * np.minimum(np.abs(near), np.abs(far))).all())


def unfelt(momenta: np.ndarray) -> tuple[bool, bool]:
    """Whether L does not feel the slope at the ordinate of either end, as where a power of y is a factor of it."""
    start, end = (bool((beside == 0.0).all()) for beside in momenta)
    return start, end


def powers_at_ends(problem: Problem) -> list[Growth]:
    """With which powers of t extremals leave both ends, whose coordinates are known."""
    start, end = completed_ends(problem)
    width = float(end[0] - start[0])
    seen = singular_ends_of(problem)
    return [
        _powers(problem, point, inward, beside)
        for point, inward, beside in zip((start, end), (width, -width), seen, strict=True)
    ]


def _powers(problem: Problem, end: np.ndarray, inward: float, beside: SingularEnd | None) -> Growth:
    """The powers at one end, of which variations tell what lies ``beside`` it."""
    if beside is not None and beside.oscillates:
        return Growth()
    place, held = float(end[0]), bool(end[1] != 0.0)
    if beside is not None and beside.euler:
        exponent = beside.exponent
    else:
        found = growth(problem, place, place + inward)
        exponent = 1.0 if found is None else found
    return growth_of(exponent, beside, held=held)


@dataclass(frozen=True)
class FreeEnd:
    """With which powers of t extremals leave a free end, and the ``ordinate`` that L holds there; None where none."""

    growth: Growth
    ordinate: float | None


def powers_at_a_free_end(problem: Problem, at_start: bool) -> FreeEnd | None:
    """What L_y' = 0 makes of extremals beside the free end of a problem; None where that is not known.

    From c they depart by the powers by which L_yy and what else L_y holds bend them. Where kappa is not zero they come
    to the ordinate at which L_y vanishes, told where it is zero.
    """
    beside = singular_ends_of(problem)[0 if at_start else 1]
    if beside is None or beside.oscillates:
        return None
    bent = [step for step in beside.steps if step > A_FRACTION]
    if not beside.euler:
        found = growth_of(min(bent, default=2.0), beside, held=True)
        return None if found.abscissa == 1 and not found.layers else FreeEnd(found, None)  # whole powers
    if beside.exponent <= 0:
        return None
    return FreeEnd(growth_of(min([beside.exponent, *bent]), beside), 0.0)


def growth(problem: Problem, place: float, toward: float) -> float | None:
    """The power of the distance from a ``place``, on the way ``toward`` another, that y grows with there: L_y' = const.

    None where no power that is a curve's does.
    """
    # the level of the momentum is that of the chord half way: far from it another power may rule
    ends = np.array(completed_ends(problem))
    trial = float((ends[1, 1] - ends[0, 1]) / (ends[1, 0] - ends[0, 0])) or 1.0
    count = len(ANY_SLOPES)
    steps = (toward - place) * np.array([0.5, *PROBE])
    x = (place + steps).repeat([1, count, count])
    y = np.interp([place + steps[0], place], *ends.T).repeat([1, 2 * count])
    slopes = np.concatenate([[trial], np.tile(math.copysign(1.0, trial) * ANY_SLOPES, 2)])
    momenta = problem.integrand_derivatives(x, y[None], slopes[None]).gradient[:, 2]
    slope = scaling(ANY_SLOPES, list(momenta[1:].reshape(2, -1)), float(momenta[0]))
    return None if slope is None or not math.isfinite(slope) or slope <= -1 else 1.0 + slope


def growth_of(exponent: float, beside: SingularEnd | None = None, *, held: bool = False) -> Growth:
    """The powers of t in which a curve that grows like the ``exponent`` of the distance is smooth, or its mesh graded.

    ``held`` tells that it leaves an ordinate other than zero, where what L says of that is to be summed as well.
    """
    steps = () if beside is None else beside.steps
    power = 1.0 - exponent if beside is None else beside.power
    # the powers of the distance that integrals of L from a held ordinate grow with, of y^2 and of y
    kept = [v + power - 1 for v in steps if held]
    known = [v for v in (*steps, *kept) if _broken(v)]
    for b in range(1, MOST_WHOLE + 1):
        q = round(b * exponent)
        whole = 0 < q <= MOST_WHOLE and abs(exponent - q / b) <= MEASURED
        if whole and all(abs(v - round(b * v) / b) <= A_FRACTION for v in known):
            return Growth(b, q, fractional=b)
    sums = [2 * exponent + power - 1, *kept]
    decades = DIGITS / max(min(sums), DIGITS / SQUARED)
    q = min(max(LEAVES, math.ceil(exponent * decades / MOST_LAYERS)), MOST_LEAVES, math.floor(LARGEST_POWER * exponent))
    q = max(1, q)
    b = math.ceil(q / exponent)
    layers = min(math.ceil(decades / b), MOST_LAYERS, max(0, math.floor(SQUARED / b) - NEXT_TO_END))
    return Growth(b, q, layers, q / exponent)


def _pulled(end: SingularEnd | None, steps: np.ndarray, pull: np.ndarray, momentum: np.ndarray) -> SingularEnd | None:
    """The end with the power of the distance to which L_y (2,), at two ``steps`` from it, bends an extremal."""
    if not (np.isfinite(pull).all() and pull[0] * pull[1] > 0 and (momentum > 0).all()):
        return end
    bent = 2.0 + math.log(pull[0] / pull[1] * (momentum[1] / momentum[0])) / math.log(steps[0] / steps[1])
    if not _broken(bent):
        return end
    known = end or SingularEnd(0.0, 0.0, 0.0)
    return replace(known, steps=(*known.steps, bent))


def _broken(power: float) -> bool:
    """Whether a power of the distance is no whole one, and low enough to matter."""
    return 0.0 < power < SMOOTH and abs(power - round(power)) > A_FRACTION
