"""The least polygons that keep bounds and levels, whose ends slide on phi = 0 from wherever they begin.

An interior-point method makes least what is summed over straight pieces, with what switches rounded off a little. Once
it is built it finds one polygon after another: only what it begins from differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.existence.rounded import rounded_off
from varcalc.formulation import formulate
from varcalc.methods.ritz.ipopt import quiet
from varcalc.numerics.mesh import GAUSS_SHARES, composite_gauss
from varcalc.problem.conditions import Bound, Isoperimetric
from varcalc.problem.end_cost import end_cost
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.tracing import Expression

PIECES_KEPT = 24
"""Of a polygon."""
SWITCHED_WITHIN = 0.02
"""Width over which what switches is rounded off, relative to its size along the known curve."""
OPTIONS = quiet({"tol": 1e-7, "max_iter": 80})
"""Of IPOPT, for one polygon."""
NEAREST_ENDS = 1e-2
"""How near to each other the abscissae of the ends may come, in units of the interval."""
EVENLY_APART = 1e-1
"""Of what is summed along the known curve: what a polygon of a Curve costs besides, with its vertices evenly apart."""
MISSED_BY_KEPT, LEAST_SIZE = 1e-6, 1e-3
"""By how much of its size a condition may be missed by what keeps it, and the least that is its size."""
RULES, RULE_POINTS, WORSE_BY = (10, 16), 2, 3.0
"""Parts of a piece by which two rules sum a polygon, Gauss points on each, and how often what the rules differ by makes
its value worse: a jump of L lies between points.
"""
LABELS = "start", "end"


@dataclass(frozen=True)
class KeptPolygon:
    """Vertices x (K + 1,), or parameters of a Curve, and ordinates or coordinates y (n, K + 1).

    The ``value`` is what is minimised along it, made worse by what is not known of that, and ``size`` the integral of
    the absolute value of L. ``kept`` tells whether it keeps all conditions between its vertices as well.
    """

    x: np.ndarray
    y: np.ndarray
    value: float
    size: float
    kept: bool

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The ordinates (n, m) at x (m,)."""
        return np.array([np.interp(np.atleast_1d(x), self.x, row) for row in self.y])


class KeptPolygons:
    """The polygons of a functional of first order without unknowns; what switches has its size along x (m,), y (n, m).

    Both ends slide on their phi = 0, where they do so.
    """

    def __init__(self, problem: Functional, x: np.ndarray, y: np.ndarray) -> None:
        self.problem = problem
        self._share = np.linspace(0.0, 1.0, PIECES_KEPT + 1)
        asked = [(t.constraint, t.expression) for t in problem.traced]
        self._levels = [(c.interval, e) for c, e in asked if isinstance(c, Isoperimetric)]
        bounds = [(c.interval, e) for c, e in asked if isinstance(c, Bound)]
        self._steep = [(i, e) for i, e in bounds if ca.depends_on(e, problem.symbols.dy)]
        self._placed = [(i, e) for i, e in bounds if not ca.depends_on(e, problem.symbols.dy)]
        self._integrals = [problem.sign * problem.integrand, *(e for _, e in self._levels)]
        self._summed = self._function(self._integrals)
        self._bounded = self._function([e for _, e in (*self._steep, *self._placed)])
        self._solver, self._asked = self._program(self._points(x, y), self._weight(x, y))
        self._box, self._limits = self._ends(), self._between()

    def _points(self, x: np.ndarray, y: np.ndarray) -> list[list[np.ndarray]]:
        """What all symbols are on the pieces of a polygon, one array for each entry."""
        middle, slopes = 0.5 * (y[:, 1:] + y[:, :-1]), np.diff(y) / np.diff(x)
        numbers = [np.array(v) for v in self.problem.parameter_values]
        return [[0.5 * (x[1:] + x[:-1])], list(middle), list(slopes), [], numbers, []]

    def _weight(self, x: np.ndarray, y: np.ndarray) -> float:
        """What the squares of the rises of all pieces cost besides: where a parameter may run as it likes, evenly."""
        known = None if isinstance(self.problem, Problem) else self.stated(x, y)
        return 0.0 if known is None else EVENLY_APART * known.size / float((np.diff(y) ** 2).sum())

    def _function(self, expressions: Sequence[Expression], points: list[list[np.ndarray]] | None = None) -> ca.Function:
        """``expressions`` as a column, of x, y and slopes; with what switches in them rounded off, given ``points``."""
        problem, s = self.problem, self.problem.symbols
        if points is not None and s.kind is ca.SX:
            expressions = [rounded_off(problem, e, SWITCHED_WITHIN, points) for e in expressions]
        column = ca.densify(ca.vertcat(*expressions)) if expressions else s.kind(0, 1)
        return ca.Function(
            "along", [s.x, s.y, s.dy], [ca.substitute(column, s.parameters, ca.DM(problem.parameter_values))]
        )

    def _program(self, points: list[list[np.ndarray]], weight: float) -> tuple[ca.Function, ca.Function]:
        """The solver of vertices and abscissae of the ends, and what it asks of them."""
        n, m = self.problem.n, len(self._share)
        y, ends = ca.MX.sym("y", n, m), ca.MX.sym("ends", 2)
        width = ends[1] - ends[0]
        x, steps = ends[0] + width * ca.DM(self._share).T, width * ca.DM(np.diff(self._share)).T
        rise = y[:, 1:] - y[:, :-1]
        slopes = rise / ca.repmat(steps, n, 1)
        along = self._function(self._integrals, points).map(m - 1)
        sums = ca.MX.zeros(len(self._integrals))
        for share in GAUSS_SHARES:
            sums += 0.5 * along(x[:-1] + share * steps, y[:, :-1] + share * rise, slopes) @ steps.T
        steep = self._function([e for _, e in self._steep], points).map(m - 1)
        placed = self._function([e for _, e in self._placed], points).map(m)
        asked = ca.veccat(
            sums[1:], steep(x[:-1] + 0.5 * steps, y[:, :-1] + 0.5 * rise, slopes), placed(x, y, ca.MX.zeros(n, m)),
            *self._slid(y, ends), width,
        )  # fmt: skip
        unknown = ca.veccat(y, ends)
        program = {"x": unknown, "f": sums[0] + self._cost(y, ends) + weight * ca.sumsqr(rise), "g": asked}
        return ca.nlpsol("kept", "ipopt", program, OPTIONS), ca.Function("asked", [unknown], [asked])

    def _slid(self, y: ca.MX, ends: ca.MX) -> list[ca.MX]:
        """Phi at the ends that slide."""
        kind, found = self.problem.symbols.kind, list[ca.MX]()
        at, to = kind.sym("x"), kind.sym("y", self.problem.n)
        for side, label in enumerate(LABELS):
            level = self.problem.traced_slide(label, at, to, kind)
            if level is not None:
                found.append(ca.Function("phi", [at, to], [level])(ends[side], y[:, -side]))
        return found

    def _cost(self, y: ca.MX | np.ndarray, ends: ca.MX | np.ndarray) -> ca.MX | float:
        """What the ends cost, as it is minimised."""
        cost = end_cost(self.problem)
        if cost is None:
            return 0.0
        return self.problem.sign * cost(ends[0], y[:, 0], ends[1], y[:, -1], self.problem.parameter_values, [])

    def _between(self) -> np.ndarray:
        """Between what all that is asked lies, (number, 2)."""
        m, slid = len(self._share), sum(self.problem.slides)
        rows = [i for i, _ in self._levels]
        rows += [i for _ in range(m - 1) for i, _ in self._steep] + [i for _ in range(m) for i, _ in self._placed]
        nearest = NEAREST_ENDS * float(np.ptp(self.problem.span))
        return np.array([*rows, *slid * [(0.0, 0.0)], (nearest, np.inf)])

    def _ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Between what the numbers of a polygon lie: the given ends are theirs."""
        n, form = self.problem.n, formulate(self.problem)
        numbers = np.full((n, len(self._share)), np.nan)
        abscissae = np.array(self.problem.span, dtype=float)
        for side, given in enumerate((form.ends.start, form.ends.end)):
            if not self.problem.slides[side]:
                numbers[:, -side] = given[0, :n]
            elif isinstance(self.problem, Problem):
                abscissae[side] = np.nan
        every = np.append(numbers.ravel("F"), abscissae)
        return np.where(np.isnan(every), -np.inf, every), np.where(np.isnan(every), np.inf, every)

    def least(self, x: np.ndarray, y: np.ndarray) -> KeptPolygon | None:
        """The least polygon begun from one with K + 1 vertices evenly apart; None where none is found."""
        low, high = self._box
        begun = np.clip(np.append(y.ravel("F"), x[[0, -1]]), low, high)
        with np.errstate(all="ignore"):
            z = self._solver(x0=begun, lbx=low, ubx=high, lbg=self._limits[:, 0], ubg=self._limits[:, 1])["x"]
            z = np.clip(z.full().ravel(), low, high)
            asked = self._asked(z).full().ravel()
        if not (np.isfinite(z).all() and _keeps(asked, self._limits)):
            return None
        return self.stated(z[-2] + (z[-1] - z[-2]) * self._share, z[:-2].reshape(-1, len(self._share), order="F"))

    def stated(self, x: np.ndarray, y: np.ndarray) -> KeptPolygon | None:
        """A polygon with what is minimised along it as it is stated; None where that is no number."""
        (coarse, *_), (fine, size, kept) = (self._by_rule(x, y, parts) for parts in RULES)
        value = fine + WORSE_BY * abs(fine - coarse) + float(self._cost(y, x[[0, -1]]))
        return KeptPolygon(x, y, value, size, kept) if np.isfinite(value) else None

    def _by_rule(self, x: np.ndarray, y: np.ndarray, parts: int) -> tuple[float, float, bool]:
        """The integral of L along a polygon, that of its absolute value, and whether levels and bounds are kept."""
        edges = (x[:-1, None] + np.diff(x)[:, None] * np.arange(parts) / parts).ravel()
        points, weights = composite_gauss(np.append(edges, x[-1]), RULE_POINTS)
        slopes = np.repeat(np.diff(y) / np.diff(x), RULE_POINTS * parts, axis=1)
        at = points[None], np.array([np.interp(points, x, row) for row in y]), slopes
        along, bounded = (np.asarray(function(*at)) for function in (self._summed, self._bounded))
        sums, sizes = along @ weights, np.abs(along) @ weights
        kept = _keeps(sums[1:], np.array([i for i, _ in self._levels]).reshape(-1, 2), sizes[1:])
        for (interval, _), row in zip((*self._steep, *self._placed), bounded, strict=True):
            kept = kept and _keeps(row, np.array([interval]))
        return float(sums[0]), float(sizes[0]), kept


def _keeps(values: np.ndarray, limits: np.ndarray, sizes: np.ndarray | float = 0.0) -> bool:
    """Whether values (m,) lie within their limits (m, 2), or (1, 2), but for what is no miss of that size."""
    edges = np.where(np.isfinite(limits), np.abs(limits), 0.0).max(axis=1, initial=LEAST_SIZE)
    room = MISSED_BY_KEPT * np.maximum(edges, sizes)
    return bool(((values >= limits[:, 0] - room) & (values <= limits[:, 1] + room)).all())
