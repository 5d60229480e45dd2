"""Lengths whose metric is infinite at an end: the singular coordinate becomes an integral that is prescribed.

Let the square of the speed be a(z) x'^2/b(z)^2 + c(z) z'^2, with b = 0 at the end, as of the brachistochrone in the
depth z^2. With x' = d b alpha', d the distance in x between the ends, it is d^2 a alpha'^2 + c z'^2, which is regular,
and the integral of b alpha' is 1 (a sub-Riemannian problem: Montgomery, "A Tour of Subriemannian Geometries", AMS
2002, ch. 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, flint
from varcalc.certificates.degree import degrees
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.levels import meeting
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import squared
from varcalc.problem.conditions import Fixed, Free, Isoperimetric
from varcalc.problem.problem import Curve, Problem
from varcalc.symbolic.instructions import Program
from varcalc.verify.along_curve import AlongCurve

UNIT = "unit_of_z_squared"
"""The parameter of the regular problem that holds the unit of z^2."""
LINE_START, LINE_END = "start_along_line", "end_along_line"
"""Its parameters that hold the ends along the singular line, of whose distance x and alpha are shares."""
POINTS = 257
"""Points of the curve that the regular problem is begun at."""
ROOM = 1e-9
"""Change of the curve, in units of its size, that positive values are to survive: it meets its integral within less."""
STEEPEST = 0.1
"""One over what a bump on [0, 1] and its slope stay below."""
VANISHING = "where L is infinite no coordinate in which the metric neither vanishes nor ends in a root is at hand"
BROKEN_POWER = "where L is infinite the curve is regular in a coordinate of which the distance is no whole power"
FREE_ROOT = "beside a free end the coordinate in which L is infinite is covered where it is plus or minus a square"
FORWARD_HALVINGS = 10
"""How often a box is halved to show that a curve runs forward in it."""


class Product:
    """A product of powers of SX expressions with an exact rational factor; equal factors are counted together."""

    def __init__(self, expression: Any) -> None:
        self.factor = Fraction(1)
        self.powers: list[tuple[Any, int]] = []
        self._take(expression, 1)

    def _take(self, e: Any, power: int) -> None:
        if e.is_constant():
            self.factor *= Fraction(float(e)) ** power
        elif e.is_op(ca.OP_TWICE):
            self.factor *= Fraction(2) ** power
            self._take(e.dep(0), power)
        elif e.is_op(ca.OP_NEG):
            self.factor *= -1 if power % 2 else 1
            self._take(e.dep(0), power)
        elif e.is_op(ca.OP_SQ):
            self._take(e.dep(0), 2 * power)
        elif self._is_power(e, power):
            inner, exponent = Product(e.dep(0)), Fraction(float(e.dep(1)))
            for base, own in inner.powers:
                self._count(base, int(own * exponent) * power)
        elif e.is_op(ca.OP_INV):
            self._take(e.dep(0), -power)
        elif e.is_op(ca.OP_MUL) or e.is_op(ca.OP_DIV):
            self._take(e.dep(0), power)
            self._take(e.dep(1), power if e.is_op(ca.OP_MUL) else -power)
        else:
            self._count(e, power)

    @staticmethod
    def _is_power(e: Any, power: int) -> bool:
        """Whether a power of a product of even powers has even powers itself, as (z^4)^1.5 has, which is z^6."""
        if not (e.is_op(ca.OP_POW) or e.is_op(ca.OP_CONSTPOW)) or not e.dep(1).is_constant():
            return False
        inner, exponent = Product(e.dep(0)), Fraction(float(e.dep(1)))
        found = [own * exponent for _, own in inner.powers]
        even = all(own % 2 == 0 for _, own in inner.powers)
        return inner.factor == 1 and even and all(p.denominator == 1 and p * power % 2 == 0 for p in found)

    def _count(self, e: Any, power: int) -> None:
        for k, (known, before) in enumerate(self.powers):
            if ca.is_equal(known, e, 8):
                self.powers[k] = known, before + power
                return
        self.powers.append((e, power))

    def expression(self) -> Any:
        """The product; Unproved where its factor is no double."""
        number = self.factor.numerator / self.factor.denominator if self.factor else 0.0
        if Fraction(number) != self.factor:
            raise Unproved("the constants of the metric cannot be put together without rounding")
        total = ca.SX(number)
        for e, power in self.powers:
            total = total * e**power
        return total

    def power_of(self, symbol: Any) -> int | None:
        """The power of a symbol in the product; None where it occurs in another way."""
        total = 0
        for e, power in self.powers:
            if ca.is_equal(e, symbol, 8):
                total += power
            elif ca.depends_on(e, symbol):
                return None
        return total

    @property
    def monic(self) -> bool:
        """Whether the product is plus or minus the power of one expression."""
        return len(self.powers) == 1 and abs(self.factor) == 1

    def times(self, e: Any, power: int) -> None:
        """Multiply by a power."""
        self._count(e, power)

    def without_poles(self, symbol: Any) -> Any:
        """Take the even negative powers of ``symbol`` out: the b of a/b^2."""
        b = ca.SX(1)
        for k, (e, power) in enumerate(self.powers):
            if power < 0 and power % 2 == 0 and ca.is_equal(e, symbol, 8):
                b = b * e ** (-power // 2)
                self.powers[k] = e, 0
        self.powers = [(e, power) for e, power in self.powers if power]
        return b


@dataclass(frozen=True)
class Metric:
    """The square of the speed, a x'^2/b^2 + c z'^2, x being function ``cyclic``.

    z^2 is measured in ``unit``, for which ``symbol`` stands in a and c; ``ends`` are the values of z, None where it is
    free, and ``along_line`` those of x.
    """

    cyclic: int
    a: Any
    b: Any
    c: Any
    symbol: Any
    unit: float
    ends: tuple[float | None, float | None]
    along_line: tuple[float, float]


@dataclass(frozen=True)
class Regular:
    """The regular problem whose energy, times ``factor``, is the square of the length, and a curve close to its answer.

    Function 0 is alpha, function 1 is z; ``abscissa_is_z`` tells that the abscissa of the user's graph is a power of z.
    """

    problem: Problem
    guess: Any
    abscissa_is_z: bool
    factor: Fraction


def regular(along: AlongCurve) -> Regular | None:
    """The regular problem of a singular length; None where it is none of two functions, one of them cyclic."""
    form, s = along.form, along.symbols
    plain = not (along.integrals or along.paths or len(along.numbers) or form.ends.joint or form.held)
    if not (plain and form.coordinates.energetic and form.stated.is_lifted and along.n == 2 and along.order == 1):
        return None
    factor, H = _square(along)
    block = ca.hessian(H, s.dy)[0]
    cyclic = [i for i in (0, 1) if not ca.depends_on(H, s.y[i])]
    ends = [np.asarray(given, dtype=float)[0] for given in (form.ends.start, form.ends.end)]
    if len(cyclic) != 1 or block.nnz() != 2 or ca.depends_on(block, ca.vertcat(s.x, s.dy)):
        return None
    i = cyclic[0]
    if any(np.isnan(end[i]) for end in ends):
        return None
    rows = np.eye(2)
    own, other = (Product(ca.substitute([H], [s.dy], [ca.DM(rows[k])])[0]) for k in (i, 1 - i))
    # one factor may be taken out of both, and must where it is no double
    common, own.factor, other.factor = own.factor, Fraction(1), other.factor / (own.factor or 1)
    symbol = ca.SX.sym("unit")
    unit, places, along_line = _in_own_unit(along, i, (own, other), symbol)
    if other.power_of(s.y[1 - i]):
        raise Unproved(VANISHING)
    b = own.without_poles(s.y[1 - i])
    metric = Metric(i, own.expression(), b, other.expression(), symbol, unit, places, along_line)
    weight = ca.Function("b", [s.y, s.parameters], [b])
    t = np.linspace(0.0, 1.0, POINTS)
    y, dy = along.evaluate(t, 0), along.evaluate(t, 1)
    y[1 - i] /= math.sqrt(unit)
    rate = dy[i] / np.maximum(np.asarray(weight(y, form.problem.parameter_values)).ravel(), 1e-12)
    alpha = np.r_[0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))] / ((y[i][-1] - y[i][0]) or 1.0)

    def guess(at: Any) -> np.ndarray:
        return np.array([np.interp(at, t, alpha), np.interp(at, t, y[1 - i])])

    assert form.lifted is not None
    return Regular(_stated(along, metric), guess, ca.depends_on(form.lifted[0], s.y[1 - i]), factor * common)


def _square(along: AlongCurve) -> tuple[Fraction, Any]:
    """A factor, and over it the square of the speed in the form's coordinates, from the user's own L.

    The form's integrand will not do: that L is a length was seen at points. Unproved where its operations do not say.
    """
    problem, s, lifted = along.form.problem, along.form.problem.symbols, along.form.lifted
    assert lifted is not None
    x, y, dx, dy = lifted
    factor, H = squared(problem.integrand)
    slopes = [[symbol is s.dy] * int(symbol.numel()) for symbol in s.all]
    if not degrees(ca.Function("H", s.all, [H]), slopes)[0][0] <= 2.0:
        raise Unproved("L is not proved to be the root of a quadratic form in the velocities")
    by_slope = ca.gradient(H, s.dy)
    if isinstance(problem, Curve):
        return factor, ca.substitute([H], [s.y, s.dy], [y, dy])[0]
    parts = ca.substitute([H, by_slope, ca.gradient(by_slope, s.dy) / 2], [s.x, s.y, s.dy], [x, y, s.kind(0)])
    return factor, parts[0] * dx**2 + parts[1] * dx * dy + parts[2] * dy**2


def _coordinates(along: AlongCurve) -> tuple[tuple[Any, Any], tuple[np.ndarray, np.ndarray]]:
    """The user's two coordinates in those of the form, and their values at both ends, NaN where free."""
    form = along.form
    assert form.lifted is not None
    ends = form.problem.start, form.problem.end
    if isinstance(form.problem, Curve):
        first, second = ca.vertsplit(form.lifted[1])
        return (first, second), (ends[0].values(2), ends[1].values(2))
    at = [np.array([float(end.x), float(end.values(1)[0])]) for end in ends]
    return form.lifted[:2], (at[0], at[1])


def _unmoved(lift: Any) -> Any:
    """A coordinate without a constant that is added to it."""
    if lift.is_op(ca.OP_ADD) or lift.is_op(ca.OP_SUB):
        parts = lift.dep(0), lift.dep(1)
        if parts[1].is_constant():
            return parts[0]
        if lift.is_op(ca.OP_ADD) and parts[0].is_constant():
            return parts[1]
    return lift


def _in_own_unit(
    along: AlongCurve, i: int, parts: tuple[Product, Product], symbol: Any
) -> tuple[float, tuple[float | None, float | None], tuple[float, float]]:
    """The unit of z^2 in which its ends are 0 and 1 exactly, and these, None where free; the parts are brought to it.

    The unit is 1, and the ends must be exact, unless the user's singular coordinate is plus or minus z^2, zero at one
    end at least, and z occurs in the metric as an even power alone. The last are the ends along the singular line.
    """
    z = along.symbols.y[1 - i]
    powers = [part.power_of(z) for part in parts]
    lifts, ends = _coordinates(along)
    singular = [k for k, lift in enumerate(map(Product, lifts)) if lift.power_of(z) == 2 and lift.monic]
    if len(singular) == 1 and all(power is not None and power % 2 == 0 for power in powers):
        line = Product(_unmoved(lifts[1 - singular[0]]))
        depths = [abs(float(end[singular[0]])) for end in ends]
        given = [depth for depth in depths if not math.isnan(depth)]
        if line.monic and line.power_of(along.symbols.y[i]) == 1 and min(given, default=1.0) == 0.0:
            for part, power, more in zip(parts, powers, (0, 1), strict=True):
                part.times(symbol, (power or 0) // 2 + more)
            first, last = (None if math.isnan(depth) else float(depth > 0) for depth in depths)
            start, end = (float(line.factor * Fraction(float(end[1 - singular[0]]))) for end in ends)
            # where an end is free, any unit of its size will do
            found = float((along.evaluate(np.array([0.0, 1.0]), 0)[1 - i] ** 2).max())
            return (max(given) if len(given) > 1 else found) or 1.0, (first, last), (start, end)
    own = [np.asarray(given, dtype=float)[0] for given in (along.form.ends.start, along.form.ends.end)]
    _check_ends(along, own)
    first, last = (float(end[1 - i]) for end in own)
    start, end = (float(end[i]) for end in own)
    return 1.0, (first, last), (start, end)


def _check_ends(along: AlongCurve, ends: list[np.ndarray]) -> None:
    """Unproved where the ends in the form's coordinates are not exactly those that were given."""
    form, s, arb = along.form, along.symbols, flint().arb
    if np.isnan(ends).any():
        raise Unproved(FREE_ROOT)
    lifts, given = _coordinates(along)
    lift = Program(ca.Function("lift", [s.x, s.y, s.parameters], [ca.vertcat(*lifts)]))
    parameters = [Jet(arb(float(v))) for v in form.problem.parameter_values]
    if any(lift.is_op(op) for lift in lifts for op in (ca.OP_POW, ca.OP_CONSTPOW)):
        raise Unproved(BROKEN_POWER)
    for place, at, own in zip(given, (0.0, 1.0), ends, strict=True):
        places = [Jet(arb(at))], [Jet(arb(float(v))) for v in own], parameters
        found = [jet.value for jet in jets(lift, places, 0)[0]]
        if not all(v.is_exact() and v == arb(float(exact)) for v, exact in zip(found, place, strict=True)):
            raise Unproved("an end is rounded in the coordinate in which it is regular")


def _stated(along: AlongCurve, metric: Metric) -> Problem:
    s, given, i = along.symbols, along.form.problem, metric.cyclic
    start, end = metric.along_line
    # as a difference of two numbers the distance is no more rounded than they are
    across = {LINE_START: start, LINE_END: end} if start != end else {LINE_START: 0.0, LINE_END: 1.0}

    def placed(expression: Any, q: Any, p: Any) -> Any:
        """An expression of the given problem at the new coordinates, with its numbers and its unit from ``p``."""
        values = [getattr(p, name) for name in given.parameters]
        place = ca.vertcat(*([s.y[0], q[1]] if i == 0 else [q[1], s.y[1]]))
        old, new = [s.y, s.parameters, metric.symbol], [place, ca.vertcat(*values), getattr(p, UNIT)]
        return ca.substitute([expression], old, new)[0]

    def energy(t: Any, q: Any, v: Any, p: Any) -> Any:
        far = getattr(p, LINE_END) - getattr(p, LINE_START)
        return placed(metric.a, q, p) * (far * v[0]) ** 2 + placed(metric.c, q, p) * v[1] ** 2

    def distance(t: Any, q: Any, v: Any, p: Any) -> Any:
        return placed(metric.b, q, p) * v[0]

    first, last = metric.ends
    until = Free(1.0) if last is None else Fixed(1.0, (None, last))
    level = Isoperimetric(distance, 0.0 if start == end else 1.0)
    numbers = {**given.parameters, UNIT: metric.unit, **across}
    return Problem(energy, Fixed(0.0, (0.0, first)), until, [level], parameters=numbers, name=given.name)


def check_forward(setting: Setting) -> None:
    """Prove that z grows all along the curve, where the abscissa is a power of z; Unproved where it may not."""
    if not meeting(setting).reach() < STEEPEST * ROOM * float(setting.sizes[1].min()):
        raise Unproved("the curve that meets its ends exactly is not near enough to be known to run forward")
    waiting = [(k, box, 0) for k, box in setting.along.boxes]
    while waiting:
        k, box, depth = waiting.pop()
        slope = setting.pieces[k].lifted(Around(box, 1, whole=True))[1][1][0]
        if slope > ROOM * float(setting.sizes[1][1]):
            continue
        if depth == FORWARD_HALVINGS:
            raise Unproved(f"the curve is not proved to run forward near the share {box.at:.3g} of its length")
        waiting += [(k, half, depth + 1) for half in box.halves()]
