"""Closed forms held against their problems in 40 digits, by mpmath alone.

A problem's functions are evaluated from CasADi's expressions instruction by
instruction; the curve, written again in each test, is differentiated
numerically in high precision. No solver of varcalc takes part.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc

DIGITS = 40
EXACTLY = mp.mpf(10) ** -24
IN_DIGITS = mp.mpf(10) ** -24
"""Relative difference of closed forms that are evaluated to many digits, and of quadratures in them."""
BESIDE = mp.mpf(10) ** -28
"""Where a corner is approached from one side, as a fraction of the piece."""
DOUBLE = 4e-15

UNARY = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_SQRT: mp.sqrt,
    ca.OP_EXP: mp.exp,
    ca.OP_LOG: mp.log,
    ca.OP_SIN: mp.sin,
    ca.OP_COS: mp.cos,
    ca.OP_TAN: mp.tan,
    ca.OP_SINH: mp.sinh,
    ca.OP_COSH: mp.cosh,
    ca.OP_TANH: mp.tanh,
    ca.OP_FABS: abs,
    ca.OP_SIGN: mp.sign,
    ca.OP_NOT: lambda a: mp.mpf(not a),
}
BINARY = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_POW: lambda a, b: a**b,
    ca.OP_CONSTPOW: lambda a, b: a**b,
    ca.OP_LT: lambda a, b: mp.mpf(a < b),
    ca.OP_LE: lambda a, b: mp.mpf(a <= b),
    ca.OP_IF_ELSE_ZERO: lambda a, b: b if a else mp.mpf(0),
}


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(DIGITS):
        yield


def in_mpmath(inputs, expressions):
    """A function of lists of mpmath numbers that evaluates the expressions, each to a list."""
    function = ca.Function("f", inputs, [ca.densify(e) for e in expressions])
    program = [
        (function.instruction_id(k), function.instruction_output(k), function.instruction_input(k))
        for k in range(function.n_instructions())
    ]
    constants = {
        k: mp.mpf(function.instruction_constant(k)) for k, step in enumerate(program) if step[0] == ca.OP_CONST
    }

    def evaluate(*arguments):
        work = {}
        results = [[None] * e.numel() for e in expressions]
        for k, (operation, out, given) in enumerate(program):
            if operation == ca.OP_CONST:
                work[out[0]] = constants[k]
            elif operation == ca.OP_INPUT:
                work[out[0]] = arguments[given[0]][given[1]]
            elif operation == ca.OP_OUTPUT:
                results[out[0]][out[1]] = work[given[0]]
            elif len(given) == 2:
                work[out[0]] = BINARY[operation](work[given[0]], work[given[1]])
            else:
                work[out[0]] = UNARY[operation](work[given[0]])
        return results

    return evaluate


def column(values):
    return [mp.mpf(v) for v in np.atleast_1d(values)]


def vector(y):
    return list(y) if isinstance(y, list | tuple) else [y]


def close(got, expected, scale=1, tolerance=EXACTLY):
    return abs(got - expected) <= tolerance * max(abs(scale), abs(expected))


def chebyshev_antiderivative(function, a, b, count=90):
    """The integral of a smooth function from ``a``, as a function of the upper end, by its Chebyshev series."""
    half, middle = (b - a) / 2, (a + b) / 2
    table = [mp.cospi(mp.mpf(2 * j + 1) / (2 * count)) for j in range(count)]
    values = [function(middle + half * t) for t in table]
    cosine = [mp.cospi(mp.mpf(j) / (2 * count)) for j in range(4 * count)]
    series = [
        2 * mp.fdot(values, [cosine[k * (2 * j + 1) % (4 * count)] for j in range(count)]) / count for k in range(count)
    ]
    series += [mp.mpf(0)] * 2
    # the integral of T_k is T_{k+1}/(2k + 2) - T_{k-1}/(2k - 2)
    integrated = [mp.mpf(0)] + [half * (series[k - 1] - series[k + 1]) / (2 * k) for k in range(1, count + 1)]

    def clenshaw(t):
        later, last = mp.mpf(0), mp.mpf(0)
        for c in reversed(integrated[1:]):
            later, last = 2 * t * later - last + c, later
        return t * later - last

    start = clenshaw(mp.mpf(-1))
    return lambda x: clenshaw((x - middle) / half) - start


@dataclass(frozen=True)
class Piece:
    """A smooth piece of an extremal: ``curve(s)`` gives (x, y) of a Problem or q of a Curve, s from ``a`` to ``b``.

    ``touching`` marks a piece that lies on the bound of a constraint.
    """

    curve: object
    a: object
    b: object
    touching: bool = False


class Claim:
    """A reference problem with an extremal of one or more pieces, given in mpmath."""

    def __init__(self, reference, pieces, multipliers=(), unknowns=(), scale=0, residual=EXACTLY):
        self.scale, self.residual = scale, residual
        self.reference, self.problem, self.pieces = reference, reference.problem, pieces
        self.graph = isinstance(self.problem, vc.Problem)
        self.multipliers, self.unknowns = multipliers, column(list(unknowns))
        self.parameters = column(list(self.problem.parameters.values()))
        p = self.problem
        s = p.symbols
        self.levels = [t for t in p.traced if isinstance(t.constraint, vc.Isoperimetric)]
        paths = [t.expression for t in p.traced if not isinstance(t.constraint, vc.Isoperimetric)]
        self.path = in_mpmath(s.all, [*paths, *(ca.gradient(e, s.y) for e in paths)])
        self.path_constraints = [t.constraint for t in p.traced if not isinstance(t.constraint, vc.Isoperimetric)]
        self.integrands = in_mpmath(s.all, [p.integrand, *(t.expression for t in self.levels)])
        weights = ca.SX.sym("weights", len(self.levels))
        whole = p.integrand + sum(weights[k] * t.expression for k, t in enumerate(self.levels))
        gradients = [ca.gradient(whole, v) for v in (s.y, s.dy, s.ddy)]
        self.whole = in_mpmath([*s.all, weights], [whole, *gradients])
        if p.end_cost_expression is not None:
            given, cost = p.end_cost_expression
            inputs = [*given, s.parameters, s.unknowns]
            self.cost = in_mpmath(inputs, [cost, *(ca.gradient(cost, g) for g in given)])

    # ---- along a piece

    def position(self, piece, s):
        """(x, [y...]) at s; a Curve has no abscissa, and s takes its place."""
        if self.graph:
            x, y = piece.curve(s)
            return x, vector(y)
        return s, vector(piece.curve(s))

    def slope(self, piece, s, component, order=1):
        """The derivative of a component by the abscissa, of first or second order."""
        if order == 2:
            return mp.diff(lambda t: self.slope(piece, t, component), s) / self.speed(piece, s)
        return mp.diff(lambda t: self.position(piece, t)[1][component], s) / self.speed(piece, s)

    def speed(self, piece, s):
        return mp.diff(lambda t: self.position(piece, t)[0], s)

    def arguments(self, piece, s):
        x, y = self.position(piece, s)
        dy = [self.slope(piece, s, k) for k in range(len(y))]
        ddy = [self.slope(piece, s, k, 2) for k in range(len(y))] if self.problem.order == 2 else []
        return [[x], y, dy, ddy, self.parameters, self.unknowns]

    def derivative(self, piece, s, which, component):
        """A component of L_y (1), L_y' (2) or L_y'' (3) along a piece, isoperimetric terms included."""
        return self.whole(*self.arguments(piece, s), column(list(self.multipliers)))[which][component]

    def rate(self, piece, s, which, component):
        """d/dx of L_y' (2) or L_y'' (3)."""
        return mp.diff(lambda t: self.derivative(piece, t, which, component), s) / self.speed(piece, s)

    def momentum(self, piece, s, component):
        value = self.derivative(piece, s, 2, component)
        if self.problem.order == 2:
            value -= self.rate(piece, s, 3, component)
        return value

    def euler_lagrange(self, piece, s):
        """The Euler-Lagrange expression, one entry for each unknown function."""
        result = []
        for k in range(self.problem.n):
            force = self.derivative(piece, s, 1, k)
            rate = mp.diff(lambda t, k=k: self.momentum(piece, t, k), s) / self.speed(piece, s)
            result.append(force - rate)
        return result

    # ---- the claims

    def samples(self, piece, count=4):
        # irrational fractions, so that no symmetry hides an error
        return [piece.a + (piece.b - piece.a) * mp.frac((k + 1) * mp.sqrt(2)) for k in range(count)]

    def is_an_extremal(self):
        for piece in self.pieces:
            for s in self.samples(piece):
                arguments = self.arguments(piece, s)
                residual = self.euler_lagrange(piece, s)
                scale = 1 + max(abs(self.derivative(piece, s, 1, k)) for k in range(self.problem.n))
                if self.path_constraints:
                    residual = self.obeys_constraints(piece, arguments, residual)
                assert all(abs(r) < self.residual * scale for r in residual), (self.reference.name, s, residual)

    def obeys_constraints(self, piece, arguments, residual):
        """Check the pathwise constraints, and take the multiplier's part out of the residual."""
        count = len(self.path_constraints)
        values = self.path(*arguments)
        for k, constraint in enumerate(self.path_constraints):
            gradient = values[count + k]
            if isinstance(constraint, vc.Holonomic):
                assert abs(values[k][0]) < EXACTLY
            else:
                lower, upper = constraint.interval
                assert lower - EXACTLY < values[k][0] < upper + EXACTLY
                if not piece.touching:
                    continue
                assert min(abs(values[k][0] - lower), abs(values[k][0] - upper)) < EXACTLY
                if not any(gradient):  # a bound on the slope: the momentum may take any value there
                    return [mp.mpf(0)]
            factor = mp.fdot(residual, gradient) / mp.fdot(gradient, gradient)
            if isinstance(constraint, vc.Bound):
                # L + mu h with mu of the sign that makes leaving the bound costly
                assert factor * (1 if lower == values[k][0] or abs(values[k][0] - lower) < EXACTLY else -1) > 0
            residual = [r - factor * g for r, g in zip(residual, gradient, strict=True)]
        return residual

    def meets_its_ends(self):
        p, first, last = self.problem, self.pieces[0], self.pieces[-1]
        if isinstance(p.start, vc.Periodic):
            self.closes()
            return
        ends = [(p.start, first, first.a, -1), (p.end, last, last.b, 1)]
        for (end, piece, s, sign), extra in zip(ends, self.end_cost_gradient(), strict=True):
            x, y = self.position(piece, s)
            if isinstance(end, vc.Fixed | vc.Free):
                assert close(x, mp.mpf(float(end.x)))
            if isinstance(end, vc.OnCurve | vc.OnSurface):
                self.slides(end, piece, s, sign, extra)
                continue
            wanted = self.demanded(end, "q" if isinstance(end, vc.At) else "y")
            for k, value in enumerate(wanted):
                if value is None:  # natural condition
                    assert abs(sign * self.momentum(piece, s, k) + extra[1 + k]) < EXACTLY
                else:
                    assert close(y[k], mp.mpf(float(value))), (self.reference.name, k, y[k])
            if p.order == 2:
                self.meets_slopes(end, piece, s)

    def demanded(self, end, name):
        """What an end demands of each component; None where it is free."""
        value = getattr(end, name, None)
        return [None] * self.problem.n if value is None else vector(value)

    def closes(self):
        """The ends of a periodic curve agree in position and momentum."""
        first, last = self.pieces[0], self.pieces[-1]
        for k in range(self.problem.n):
            assert close(self.position(first, first.a)[1][k], self.position(last, last.b)[1][k])
            assert close(self.momentum(first, first.a, k), self.momentum(last, last.b, k))

    def meets_slopes(self, end, piece, s):
        for k, value in enumerate(self.demanded(end, "dy")):
            if value is None:
                assert abs(self.derivative(piece, s, 3, k)) < EXACTLY
            else:
                assert close(self.slope(piece, s, k), mp.mpf(float(value)))

    def slides(self, end, piece, s, sign, extra):
        """phi = 0 and transversality: the boundary term of the first variation is normal to phi = 0."""
        sym = self.problem.symbols
        given = [sym.x, sym.y] if self.graph else [sym.y]
        phi = end.phi(*([sym.x, sym.y[0] if self.problem.scalar else sym.y] if self.graph else [sym.y]))
        values = in_mpmath(given, [ca.SX(phi), *(ca.gradient(phi, g) for g in given)])
        x, y = self.position(piece, s)
        value, *gradient = values(*([[x], y] if self.graph else [y]))
        gradient = [g for part in gradient for g in part]
        assert abs(value[0]) < EXACTLY
        p = [self.momentum(piece, s, k) for k in range(self.problem.n)]
        boundary = [sign * v + e for v, e in zip(p, extra[1:], strict=True)]
        if self.graph:
            arguments = self.arguments(piece, s)
            whole = self.whole(*arguments, column(list(self.multipliers)))[0][0]
            boundary = [sign * (whole - mp.fdot(p, arguments[2])) + extra[0], *boundary]
        factor = mp.fdot(boundary, gradient) / mp.fdot(gradient, gradient)
        assert all(abs(b - factor * g) < EXACTLY for b, g in zip(boundary, gradient, strict=True))

    def end_arguments(self):
        first, last = self.pieces[0], self.pieces[-1]
        (x0, y0), (x1, y1) = self.position(first, first.a), self.position(last, last.b)
        ends = [[x0], y0, [x1], y1] if self.graph else [y0, y1]
        return [*ends, self.parameters, self.unknowns]

    def end_cost_gradient(self):
        nothing = [mp.mpf(0)] * (1 + self.problem.n)
        if self.problem.end_cost is None:
            return nothing, nothing
        _, *parts = self.cost(*self.end_arguments())
        if not self.graph:
            return [mp.mpf(0), *parts[0]], [mp.mpf(0), *parts[1]]
        return [*parts[0], *parts[1]], [*parts[2], *parts[3]]

    def within(self, piece, fraction):
        """A parameter at the given fraction of a piece."""
        return piece.a + fraction * (piece.b - piece.a)

    def joins_smoothly(self):
        """Neighbouring pieces meet, and with the same momentum unless a waypoint holds the curve there."""
        held = [mp.mpf(float(c.x)) for c in self.problem.constraints if isinstance(c, vc.Through)]
        for left, right in zip(self.pieces, self.pieces[1:], strict=False):
            (x, y), (also_x, also_y) = self.position(left, left.b), self.position(right, right.a)
            assert not self.graph or close(x, also_x)
            assert all(close(a, b) for a, b in zip(y, also_y, strict=True))
            if self.problem.order == 2:
                assert close(self.slope(left, left.b, 0), self.slope(right, right.a, 0))
                assert close(self.derivative(left, left.b, 3, 0), self.derivative(right, right.a, 3, 0))
            if not any(close(x, h) for h in held):
                for k in range(self.problem.n):
                    before, after = self.within(left, 1 - BESIDE), self.within(right, BESIDE)
                    assert close(self.momentum(left, before, k), self.momentum(right, after, k))
        self.passes_its_waypoints()

    def passes_its_waypoints(self):
        for c in self.problem.constraints:
            if isinstance(c, vc.Through):
                x = mp.mpf(float(c.x))
                (at,) = [y for x_, y in (self.position(p, p.b) for p in self.pieces) if close(x_, x)]
                assert all(close(a, mp.mpf(float(b))) for a, b in zip(at, vector(c.y), strict=True))

    def integrals(self):
        """The functional, its end cost included, and the isoperimetric integrals."""
        totals = [mp.mpf(0)] * (1 + len(self.levels))
        for piece in self.pieces:
            for k in range(len(totals)):
                totals[k] += mp.quad(
                    lambda s, k=k, piece=piece: self.integrands(*self.arguments(piece, s))[k][0] * self.speed(piece, s),
                    [piece.a, piece.b],
                    method="gauss-legendre",
                )
        if self.problem.end_cost is not None:
            totals[0] += self.cost(*self.end_arguments())[0][0]
        return totals

    def has_the_value(self):
        value, *levels = self.integrals()
        exact = self.reference.exact.value
        assert close(mp.mpf(exact), value, scale=self.scale, tolerance=DOUBLE), (self.reference.name, exact, value)
        if self.reference.exact.form is not None:
            digits = self.reference.exact(DIGITS - 10)
            assert close(digits.value, value, tolerance=IN_DIGITS), (self.reference.name, digits.value, value)
        for level, traced in zip(levels, self.levels, strict=True):
            lower, upper = traced.constraint.interval
            assert lower - EXACTLY < level < upper + EXACTLY, (self.reference.name, level)
        return value

    def is_the_double_precision_curve(self):
        """The reference's own curve agrees at floating-point abscissae, to first order in their rounding."""
        if self.reference.exact.y is None:
            return
        marks = [s for piece in self.pieces for s in self.parameters_to_try(piece)]
        scale = max(abs(v) for piece, _, s in marks for v in self.position(piece, s)[1])
        at = np.array([float(x) for _, x, _ in marks])
        given = np.asarray(self.reference.exact.y(at), dtype=float).reshape(self.problem.n, len(at))
        for j, (piece, x, s) in enumerate(marks):
            _, y = self.position(piece, s)
            step = at[j] - x
            for k in range(self.problem.n):
                true = y[k] + (step * self.slope_by_mark(piece, s, k) if abs(step) > EXACTLY else 0)
                assert close(mp.mpf(given[k, j]), true, scale, DOUBLE), (self.reference.name, x, given[k, j], true)
        single = np.asarray(self.reference.exact.y(float(at[0])), dtype=float)
        assert single.shape == (() if self.problem.scalar else (self.problem.n,))

    def parameters_to_try(self, piece):
        points = [piece.a, *self.samples(piece, 5), piece.b]
        return [(piece, self.mark(piece, s), s) for s in points]

    def pace(self, piece, s):
        """What grows uniformly along a Curve: its functional, or its length where areas and levels rule."""
        arguments = self.arguments(piece, s)
        return mp.norm(arguments[2]) if self.levels else self.integrands(*arguments)[0][0]

    @cached_property
    def covered(self):
        """For each piece of a Curve, how far along it begins, and its pace integrated from there."""
        result, before = [], mp.mpf(0)
        for piece in self.pieces:
            along = chebyshev_antiderivative(lambda s, piece=piece: self.pace(piece, s), piece.a, piece.b)
            result.append((before, along))
            before += along(piece.b)
        return result, before

    def mark(self, piece, s):
        """The abscissa of a graph; the fraction covered of a Curve."""
        if self.graph:
            return self.position(piece, s)[0]
        pieces, total = self.covered
        before, along = pieces[self.pieces.index(piece)]
        return (before + along(s)) / total

    def slope_by_mark(self, piece, s, component):
        if self.graph:
            return self.slope(piece, s, component)
        return self.slope(piece, s, component) * self.covered[1] / self.pace(piece, s)

    def check(self):
        self.meets_its_ends()
        self.joins_smoothly()
        self.is_an_extremal()
        self.is_the_double_precision_curve()
        return self.has_the_value()


@pytest.fixture
def prove():
    """Check a reference against an extremal given in mpmath; returns the value by quadrature.

    ``scale`` is the size of the terms where the value is their small difference; ``residual`` bounds the
    Euler-Lagrange expression relative to its terms.
    """

    def check(reference, *pieces, **details):
        return Claim(reference, [p if isinstance(p, Piece) else Piece(*p) for p in pieces], **details).check()

    return check


@pytest.fixture
def piece():
    return Piece


@pytest.fixture
def antiderivative():
    return chebyshev_antiderivative
