"""The least value under conditions that IPOPT comes to over polygons, at second order over Hermite's cubics.

Nothing of it is the library's. Coarse polygons are begun at random, the best of them halved twice, with what switches
rounded off ever less; what that comes to is summed by fine rules as it is stated, and two meshes tell the error.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from campaigns.conditioned import Conditioned, Range
from campaigns.kinds import Switches
from campaigns.least_seen import _cubic, _straight

PIECES, ROUNDED = (60, 180, 400), (1e-2, 1e-3, 1e-4)
"""Pieces of first order, one mesh after the other (a third of that at second), and how wide switches are rounded."""
STARTS, FOLLOWED, ITERATIONS, SECONDS = 6, 2, 200, 3.0
"""Curves at random, those followed to finer meshes, and IPOPT's iterations and seconds for each."""
SAME = 1e-5
"""Relative difference of values of one curve."""
FINE, RULES_APART = (12, 17), 3.0
"""Parts of a piece, of three Gauss points each, by which it is summed in the end, and how often what two rules differ
by makes it worse: a jump of L lies between points.
"""
KEPT = 1e-6
"""How nearly conditions are kept by what counts."""
SHORTEST = 0.02
"""Part of the interval that is left at least where its ends slide."""
FAR = 1e3
"""Ordinates that are as good as infinite."""


class Seen(NamedTuple):
    """The least value that was seen, how far that of a coarser mesh was off, and whether the curve is far out."""

    value: float
    error: float
    far: bool


def least_seen(given: Conditioned) -> Seen:
    """What IPOPT comes to, in the sense of the problem; infinite where nothing admitted was found."""
    rng = np.random.default_rng(11)
    scale = 1 if given.order == 1 else 3
    meshes = [_Mesh(given, n // scale, rounded) for n, rounded in zip(PIECES, ROUNDED, strict=True)]
    first = [meshes[0].least(_at_random(given, meshes[0].share, rng, number)) for number in range(STARTS)]
    lowest = sorted((f for f in first if f is not None), key=lambda f: f[0])
    followed = [f for k, f in enumerate(lowest) if k == 0 or f[0] > lowest[k - 1][0] + SAME * abs(f[0])][:FOLLOWED]
    best = Seen(given.sign * np.inf, np.inf, False)
    for _, start in followed:
        values, curve = [], start
        for coarse, mesh in pairwise(meshes):
            found = mesh.least(_between(given, coarse.share, curve, mesh.share))
            if found is None:
                break
            values.append(found[0])
            curve = found[1]
        if values and given.sign * best.value > min(values):
            error = abs(values[-1] - values[0]) if len(values) == len(meshes) - 1 else np.inf
            best = Seen(given.sign * min(values), error, meshes[-1].far(curve))
    return best


Found = tuple[np.ndarray, float, float]
"""The numbers at the vertices, and the abscissae of the ends."""


class _Mesh:
    """Sums over curves on equal pieces, and the solver for the least of them."""

    def __init__(self, given: Conditioned, pieces: int, rounded: float) -> None:
        self._given, self.share = given, np.linspace(0.0, 1.0, pieces + 1)
        if given.waypoint is not None:
            self.share = np.union1d(self.share, [given.waypoint / given.span])
        n, rows = given.functions, given.functions * given.order
        self._nodes = ca.MX.sym("nodes", rows, len(self.share))
        self._x0, self._x1 = ca.MX.sym("x0"), ca.MX.sym("x1")
        self._switches = Switches(rounded)
        value, levels = self._summed()
        slid = [
            end.phi(x, self._nodes[0, column])
            for end, x, column in zip(given.ends, (self._x0, self._x1), (0, -1), strict=True)
            if end.phi is not None and not given.closed
        ]
        closed = [self._nodes[:, 0] - self._nodes[:, -1]] if given.closed else []
        along = [self._places_of(b) for b in given.bounds]
        rows_of = [(r, given.levels[k]) for k, r in enumerate(levels)] + list(zip(along, given.bounds, strict=True))
        zero = [(c, Range("", lambda x, y, v: 0, 0.0, 0.0)) for c in [*slid, *closed]]
        ahead = (self._x1 - self._x0, Range("", lambda x, y, v: 0, SHORTEST * given.span, np.inf))
        both = [*zero, ahead, *rows_of]
        self._low = np.concatenate([np.full(c.numel(), r.lower) for c, r in both] or [np.zeros(0)])
        self._high = np.concatenate([np.full(c.numel(), r.upper) for c, r in both] or [np.zeros(0)])
        unknown = ca.veccat(self._nodes, self._x0, self._x1)
        conditions = ca.veccat(*(c for c, _ in both))
        quiet = {"print_level": 0, "sb": "yes", "max_iter": ITERATIONS, "max_cpu_time": SECONDS, "tol": 1e-9}
        options = {"print_time": 0, "ipopt": quiet}
        self._solver = ca.nlpsol("least", "ipopt", {"x": unknown, "f": value, "g": conditions}, options)
        self._conditions = ca.Function("conditions", [unknown], [conditions])
        self._lower, self._upper = self._ends(n)

    def _ends(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """What each unknown lies between."""
        given = self._given
        low = np.full((n * given.order, len(self.share)), -np.inf)
        if not given.closed:
            for end, column in zip(given.ends, (0, -1), strict=True):
                if not end.free and end.phi is None:
                    low[:, column] = np.concatenate([end.y, end.slopes])[: len(low)]
        if given.waypoint is not None:
            at = int(np.argmin(np.abs(self.share * given.span - given.waypoint)))
            low[:n, at] = given.witness.y(given.waypoint)[:, 0]
        high = np.where(np.isfinite(low), low, np.inf)
        slides = [end.phi is not None and not given.closed for end in given.ends]
        width = given.span
        ends_low = [-width if slides[0] else 0.0, (SHORTEST if slides[1] else 1.0) * width]
        ends_high = [(1 - SHORTEST) * width if slides[0] else 0.0, 2 * width if slides[1] else width]
        return np.concatenate([low.ravel("F"), ends_low]), np.concatenate([high.ravel("F"), ends_high])

    def far(self, curve: Found) -> bool:
        """Whether a curve is as good as infinitely far out, or its ends as far as they are let go."""
        ends, size = np.array(curve[1:]), len(self._lower)
        at_edge = np.isclose(ends, self._lower[-2:]) | np.isclose(ends, self._upper[-2:])
        slid = self._lower[size - 2 :] < self._upper[size - 2 :]
        return bool(np.abs(curve[0]).max() > FAR or (at_edge & slid).any())

    def _piece(self, densities: Any, points: tuple[float, ...]) -> ca.Function:
        """What ``densities`` are at points of a piece, of its ends and what lies at them: a column for each point."""
        order, rows = self._given.order, self._given.functions * self._given.order
        a, h, first, last = ca.SX.sym("a"), ca.SX.sym("h"), ca.SX.sym("first", rows), ca.SX.sym("last", rows)
        columns = []
        for t in points:
            y, v, bends = (_straight if order == 1 else _cubic)(t, h, first, last)
            columns.append(ca.vertcat(*densities(a + t * h, y, v, bends)))
        return ca.Function("piece", [a, h, first, last], [ca.horzcat(*columns)])

    def _on_pieces(self, piece: ca.Function) -> Any:
        width = self._x1 - self._x0
        starts, lengths = self._x0 + width * self.share[None, :-1], width * np.diff(self.share)[None]
        return piece.map(len(self.share) - 1)(starts, lengths, self._nodes[:, :-1], self._nodes[:, 1:]), lengths

    def _summed(self) -> tuple[Any, list[Any]]:
        given = self._given
        points, weights = np.polynomial.legendre.leggauss(2 if given.order == 1 else 4)

        def densities(x: Any, y: Any, v: Any, bends: Any) -> list[Any]:
            return [given.lagrangian(x, y, v, bends, self._switches), *(g.of(x, y, v) for g in given.levels)]

        columns, lengths = self._on_pieces(self._piece(densities, tuple(((1 + points) / 2).tolist())))
        shares = ca.vec(ca.DM(weights / 2) @ lengths)
        sums = columns @ shares
        n = given.functions
        cost = given.cost(self._x0, self._nodes[:n, 0], self._x1, self._nodes[:n, -1], self._switches)
        return sums[0] + cost, [sums[1 + k] for k in range(len(given.levels))]

    def _places_of(self, bound: Range) -> Any:
        """A bound at the vertices, and where curves bend, within pieces."""
        # of a slope one point of a piece tells all; at both ends of one other bounds of straight pieces tell it
        points = (0.0, 1.0) if self._given.order == 1 else (0.0, 0.35, 0.65, 1.0)
        piece = self._piece(lambda x, y, v, bends: [bound.of(x, y, v)], points)
        return ca.vec(self._on_pieces(piece)[0])

    def least(self, start: Found) -> tuple[float, Found] | None:
        """The value as it is stated of what IPOPT comes to, and the curve; None where that is not admitted."""
        guess = np.clip(np.concatenate([start[0].ravel("F"), start[1:]]), self._lower, self._upper)
        try:
            found = self._solver(x0=guess, lbx=self._lower, ubx=self._upper, lbg=self._low, ubg=self._high)
        except RuntimeError:  # L is no number there
            return None
        z = np.clip(np.asarray(found["x"]).ravel(), self._lower, self._upper)
        kept = np.asarray(self._conditions(z)).ravel()
        if not np.isfinite(z).all() or (np.maximum(self._low - kept, kept - self._high) > KEPT).any():
            return None
        curve = z[:-2].reshape(-1, len(self.share), order="F"), float(z[-2]), float(z[-1])
        coarse, fine = (self._stated(curve, parts) for parts in FINE)
        value = fine + RULES_APART * abs(fine - coarse)
        return (value, curve) if np.isfinite(value) else None

    def _stated(self, curve: Found, parts: int) -> float:
        """The functional of a curve, as it is stated, by a fine rule."""
        given, (nodes, x0, x1) = self._given, curve
        points, weights = np.polynomial.legendre.leggauss(3)
        t = ((np.arange(parts)[:, None] + (1 + points) / 2) / parts).ravel()
        a = x0 + (x1 - x0) * self.share
        length = np.repeat(np.diff(a), len(t))
        rows = given.functions * given.order
        at = np.tile(t, len(a) - 1)
        symbols = ca.SX.sym("a"), ca.SX.sym("h"), ca.SX.sym("t"), ca.SX.sym("p", rows), ca.SX.sym("q", rows)
        start, h, share, p, q = symbols
        y, v, bends = (_straight if given.order == 1 else _cubic)(share, h, p, q)
        function = ca.Function("L", list(symbols), [given.lagrangian(start + share * h, y, v, bends, Switches())])
        ends = [np.repeat(part, len(t), axis=1) for part in (nodes[:, :-1], nodes[:, 1:])]
        values = np.asarray(function(np.repeat(a[:-1], len(t))[None], length[None], at[None], *ends)).ravel()
        shares = np.tile(weights / 2 / parts, parts * (len(a) - 1)) * length
        n = given.functions
        cost = given.cost(x0, ca.DM(nodes[:n, 0]), x1, ca.DM(nodes[:n, -1]), Switches())
        return float(values @ shares) + float(cost)


def _at_random(given: Conditioned, share: np.ndarray, rng: np.random.Generator, number: int) -> Found:
    """The curve that meets all that is asked, and others beside it."""
    x = share * given.span
    y, size = given.witness.y(x), (0.0, 0.5, 1.5)[number % 3] if number else 0.0
    if given.closed or any(end.free or end.phi for end in given.ends):
        y = y + size * rng.normal(size=(len(y), 1))
    for turns in (1, 2, 3):
        y = y + size * rng.normal(size=(len(y), 1)) / turns * np.sin((1 + given.closed) * turns * np.pi * share)
    return (y if given.order == 1 else np.vstack([y, np.gradient(y, x, axis=1)])), 0.0, given.span


def _between(given: Conditioned, coarse: np.ndarray, curve: Found, fine: np.ndarray) -> Found:
    """A curve on a finer mesh."""
    nodes, *ends = curve
    return np.array([np.interp(fine, coarse, row) for row in nodes]), ends[0], ends[1]
