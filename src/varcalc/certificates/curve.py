"""The curve of a certificate and its momenta: polynomials on pieces, exact, close to those of a solution.

The curve y0 meets its ends exactly and is continuous (of order two with its slope). The momenta p are any continuous
functions close to the curve's own: what they fall short by enters the proof as residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from varcalc.certificates.balls import (
    ROUND_OFF,
    Around,
    Ball,
    Box,
    Poly,
    Series,
    anchored,
    differentiation,
    flint,
    nodes,
    polynomial,
    transform,
)
from varcalc.certificates.crossings import edges_at_crossings
from varcalc.certificates.jets import Switch
from varcalc.certificates.statement import Statement
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.verify.given_curve import distinct

CURVE_DEGREE = 24
"""Degree of the polynomials of one piece."""
CURVE_RESOLVED = 1e-13
"""Last coefficients of a curve in Chebyshev polynomials, relative to the largest, below which it is resolved."""
FIELD_RESOLVED = 1e-5
"""The same of the coefficients of Jacobi's equation, from which the field need not be exact."""
MOST_CURVE_PIECES = 256
VERTEX_ROUND_OFF = 8 * float(np.finfo(float).eps)
"""Distance from a vertex, relative to where it lies, from which on round-off takes no place to the piece beside."""
NOTHING = 1e-24
"""Size of a curve, relative to the length of the interval, that is taken for none."""
SHORTEST = 2.0**-14
"""Length of a piece, relative to the interval, below which it is not cut."""

Part: TypeAlias = tuple[float, float, np.ndarray]
"""Where a piece of the curve begins and ends, and the functions (n, N + 1) at its nodes."""


@dataclass(frozen=True)
class Samples:
    """Abscissae x (N + 1,), states (m, N + 1), controls (n, N + 1) and momenta (m, N + 1) at the nodes of a piece.

    ``forces`` (m, N + 1) are the derivatives of H by the states, which the momenta are integrated from, ``pulls``
    (N + 1, n) those by the controls.
    """

    x: np.ndarray
    states: np.ndarray
    controls: np.ndarray
    momenta: np.ndarray
    forces: np.ndarray
    pulls: np.ndarray
    hessian: np.ndarray
    turning: np.ndarray
    """Gradients (N + 1, levels, ...) of what is integrated to levels, by the other states and the controls."""

    @property
    def start(self) -> float:
        """Where the piece begins."""
        return float(self.x[0])

    @property
    def end(self) -> float:
        """Where it ends."""
        return float(self.x[-1])

    @property
    def half(self) -> float:
        """Half its length."""
        return 0.5 * (self.end - self.start)


@dataclass(frozen=True)
class Piece:
    """The polynomials of one piece, in its own variable on [-1, 1]."""

    centre: Ball
    half: Ball
    functions: list[Poly]
    numbers: list[Poly]
    momenta: list[Poly]
    order: int
    switches: list[Switch]
    """Signs of what H switches on, where they are known all along the piece."""

    def box(self) -> Box:
        """All of the piece."""
        return Box(self.centre, self.half, flint().arb(-1), flint().arb(1))

    def lifted(self, around: Around) -> tuple[list[Series], list[Series]]:
        """The states and the controls as series."""
        slopes = [around.box.local(p) for p in self.functions]
        rows, unit = [[around.series(p) for p in slopes]], around.box.unit
        for k in range(self.order):
            slopes = [p.derivative() for p in slopes]
            rows.append([around.series(p) / unit ** (k + 1) for p in slopes])
        states = [s for row in rows[:-1] for s in row] + [around.series(p) for p in self.numbers]
        return states, rows[-1]


def widened(
    statement: Statement, states: Sequence[Series], controls: Sequence[Series], moved: Sequence[Ball]
) -> tuple[list[Series], list[Series]]:
    """States and controls of a piece, each with all that it is when ``moved`` by no more than that."""
    room = [flint().arb(0, 1) * far for far in moved]
    wide = [v + far for v, far in zip(states, room[: statement.bare], strict=True)]
    return wide, [v + far for v, far in zip(controls, room[statement.states :], strict=True)]


def sampled(statement: Statement) -> list[Samples]:
    """The solution's curve at the nodes of pieces on which it is resolved."""
    edges = edges_at_crossings(statement, _edges(statement))
    done = [_samples(statement, a, b) for a, b in pairwise(edges)]
    shortest = SHORTEST * (edges[-1] - edges[0])
    while len(done) < MOST_CURVE_PIECES:
        coarse = [
            s
            for s in done
            if s.half > shortest and not (_resolved(s, _largest(statement, done), statement) and _smooth(s))
        ]
        if not coarse:
            break
        halves = [(s, 0.5 * (s.start + s.end)) for s in coarse]
        parts = [_samples(statement, a, b) for s, c in halves for a, b in ((s.start, c), (c, s.end))]
        done = sorted([s for s in done if not any(s is c for c in coarse)] + parts, key=lambda s: s.start)
    return carried_on(statement, done)


def _edges(statement: Statement) -> list[float]:
    """The vertices of the curve, and the knots of tables in place of those that lie all but on one.

    The ends and the waypoints are those of the problem: vertices may be a bit of round-off away.
    """
    vertices, knots = distinct(statement.along.vertices), np.array(statement.knots)
    given = [*statement.along.span, *statement.waypoints]
    apart = np.abs(vertices[:, None] - given).min(axis=1) > SHORTEST * statement.along.length
    vertices = np.unique([*vertices[apart], *given])
    if not len(knots):
        return vertices.tolist()
    apart = np.abs(vertices[:, None] - knots).min(axis=1) > SHORTEST * (vertices[-1] - vertices[0])
    kept = apart | np.isin(vertices, [vertices[0], vertices[-1], *statement.waypoints])
    return sorted({*vertices[kept].tolist(), *knots.tolist()})


def at_crossings(statement: Statement, samples: list[Samples]) -> list[Samples]:
    """The samples on pieces that meet where the curve crosses what H switches on."""
    edges = edges_of(samples)
    moved = edges_at_crossings(statement, edges)
    return samples if moved == edges else sampled_on(statement, moved)


def edges_of(samples: Sequence[Samples]) -> list[float]:
    """Where pieces begin, and where the last of them ends."""
    return [*(s.start for s in samples), samples[-1].end]


def sampled_on(statement: Statement, edges: Sequence[float]) -> list[Samples]:
    """The curve of a statement at the nodes of given pieces."""
    return carried_on(statement, [_samples(statement, a, b) for a, b in pairwise(edges)])


def carried_on(statement: Statement, samples: list[Samples]) -> list[Samples]:
    """The samples with momenta of numbers that go on from piece to piece."""
    first, reached = statement.n * statement.order, np.zeros((len(statement.along.numbers), 1))
    joined = []
    for s in samples:
        momenta = s.momenta.copy()
        momenta[first:] += reached
        reached = momenta[first:, -1:]
        joined.append(replace(s, momenta=momenta))
    return joined


def _largest(statement: Statement, samples: Sequence[Samples]) -> np.ndarray:
    """The size of each state and momentum; of the functions, and of their momenta, that of the largest (2 m, 1)."""
    rows = np.abs(np.hstack([np.vstack([s.states, s.momenta]) for s in samples])).max(axis=1)
    n, m = statement.n, statement.bare
    for first in range(0, n * statement.order, n):
        for at in (first, m + first):
            rows[at : at + n] = rows[at : at + n].max()
    # the momentum of a number may vanish: what it is held against is that of the functions
    whole = rows[0] * rows[m] if n else 0.0
    for i in range(n * statement.order, m):
        rows[m + i] = max(rows[m + i], whole / max(rows[i], 1e-300))
    return rows[:, None]


def _samples(statement: Statement, a: float, b: float) -> Samples:
    return samples_of(statement, a, b, np.array(statement.along.evaluate(_nodes_of(a, b), 0), dtype=float))


def _nodes_of(a: float, b: float) -> np.ndarray:
    x = 0.5 * (a + b) + 0.5 * (b - a) * nodes(CURVE_DEGREE)
    x[0], x[-1] = a, b
    return x


def samples_of(statement: Statement, a: float, b: float, y: np.ndarray) -> Samples:
    """The samples of a piece from a to b of the functions ``y`` (n, N + 1) at its nodes."""
    along, order = statement.along, statement.order
    x, half = _nodes_of(a, b), 0.5 * (b - a)
    rows = [y]
    for _ in range(order):
        rows.append(rows[-1] @ differentiation(CURVE_DEGREE).T / half)
    numbers = np.repeat(np.asarray(along.numbers, dtype=float)[:, None], len(x), axis=1)
    states, controls = np.vstack([*rows[:-1], numbers]), rows[-1]
    # at the ends as from within: L may jump there
    gradient, hessian, turning = statement.sampled(nodes_within(a, b), states, controls)
    forces, pulls = gradient[:, : statement.bare].T, gradient[:, statement.bare :]
    return Samples(x, states, controls, _momenta(statement, gradient, half), forces, pulls, hessian, turning)


def nodes_within(a: float, b: float) -> np.ndarray:
    """The nodes of the piece from a to b, those at its ends from within: beside them L or the curve is another."""
    inside = VERTEX_ROUND_OFF * max(abs(a), abs(b))
    return np.clip(0.5 * (a + b) + 0.5 * (b - a) * nodes(CURVE_DEGREE), a + inside, b - inside)


def _momenta(statement: Statement, gradient: np.ndarray, half: float) -> np.ndarray:
    """p with p' = H_z - A^T p, integrated: what is differentiated would be rough. H_u tells where to begin."""
    n, m, count = statement.n, statement.bare, len(gradient)
    momenta = np.zeros((m, count))
    xi = nodes(CURVE_DEGREE)
    for i in range(n):
        force = gradient[:, i]
        if statement.order == 1:
            p = half * integrated(force)
            momenta[i] = p + (gradient[:, m + i] - p).mean()
            continue
        # p1' = H_y, p2' = H_y' - p1 and p2 = H_y'': what is left is of first degree in x
        first = half * integrated(force)
        second = half * integrated(gradient[:, n + i] - first)
        slope, constant = np.polyfit(xi, gradient[:, m + i] - second, 1)
        momenta[i], momenta[n + i] = first - slope / half, second + constant + slope * xi
    for i in range(n * statement.order, m):
        momenta[i] = half * integrated(gradient[:, i])
    return momenta


def integrated(values: np.ndarray) -> np.ndarray:
    """The integral from -1 to each node of the polynomial through values (N + 1, ...) at the nodes."""
    return np.concatenate([0.0 * values[:1], np.linalg.solve(differentiation(CURVE_DEGREE)[1:, 1:], values[1:])])


def _resolved(samples: Samples, sizes: np.ndarray, statement: Statement) -> bool:
    rows = np.vstack([samples.states, samples.momenta])
    if not np.isfinite(rows).all():
        return True  # nothing is gained by smaller pieces; the balls will tell
    coefficients, noise = np.abs(transform(CURVE_DEGREE) @ rows.T), CURVE_RESOLVED * sizes[:, 0]
    if statement.order == 2:
        # slopes of a curve that is large beside what it varies by are round-off of the curve, by Markov's inequality
        n = statement.n
        noise[n : 2 * n] = np.maximum(noise[n : 2 * n], ROUND_OFF * CURVE_DEGREE**2 * sizes[:n, 0] / samples.half)
    return bool((coefficients[-3:].max(axis=0) <= noise).all())


def _smooth(samples: Samples) -> bool:
    """Whether the coefficients of Jacobi's equation are resolved: H_uu may nearly vanish far from where the curve does.

    Whatever has no inverse is taken to be smooth; the field will tell.
    """
    n = len(samples.controls)
    uu = samples.hessian[:, -n:, -n:]
    if not np.isfinite(samples.hessian).all() or not (np.abs(np.linalg.det(uu)) > 0).all():
        return True
    inverse = np.linalg.inv(uu).reshape(len(uu), -1)
    coefficients = np.abs(transform(CURVE_DEGREE) @ inverse)
    return bool(coefficients[-3:].max() <= FIELD_RESOLVED * np.abs(inverse).max())


def joint_states(statement: Statement, samples: list[Samples]) -> np.ndarray:
    """The states (pieces + 1, m) where pieces meet: what the ends are held at, and what the samples are elsewhere."""
    joints = np.array([s.states[:, 0] for s in samples] + [samples[-1].states[:, -1]])
    for end, row in ((0, 0), (1, -1)):
        held = statement.held[end][: statement.bare]
        joints[row] = np.where(held, statement.values[end][: statement.bare], joints[row])
    for k, given in held_inside(statement, samples):
        joints[k, : statement.n] = np.where(np.isnan(given), joints[k, : statement.n], given)
    if statement.periodic:
        joints[-1] = joints[0]
    return joints


def held_inside(statement: Statement, samples: list[Samples]) -> list[tuple[int, np.ndarray]]:
    """The numbers of the pieces that begin at waypoints, with the values demanded there."""
    waypoints = statement.waypoints
    return [(k, waypoints[at]) for k, s in enumerate(samples) if k and (at := s.start) in waypoints]


def pieces(statement: Statement, samples: list[Samples], joints: np.ndarray) -> list[Piece]:
    """The exact polynomials close to samples, with the states ``joints`` where they meet."""
    n, order = statement.n, statement.order
    momenta = _joint_momenta(statement, samples, joints)
    momentum_sizes = _largest(statement, samples)[statement.bare :, 0].tolist()
    found = flint()
    built = []
    for k, s in enumerate(samples):
        a, b = found.arb(s.start), found.arb(s.end)
        centre, half = (a + b) / 2, (b - a) / 2
        functions = [
            _function(s.states[i], joints[k, i::n][:order], joints[k + 1, i::n][:order], half) for i in range(n)
        ]
        numbers = [found.arb_poly([found.arb(float(c))]) for c in statement.along.numbers]
        p = _integrals(statement, s, momentum_sizes, half, momenta[k])
        built.append(Piece(centre, half, functions, numbers, p, order, statement.switches(centre, half)))
    return built


def _integrals(
    statement: Statement, s: Samples, sizes: Sequence[float], half: Ball, ends: tuple[list[Ball], list[Ball]]
) -> list[Poly]:
    """The momenta of a piece with given values at its ends, integrated exactly: what they miss is round-off of forces.

    Differentiated they would miss their own round-off by far more, on a short piece or where they are large.
    """
    found: list[Poly] = []
    n, length = statement.n, 2 * s.half
    for i, (force, size, first, last) in enumerate(zip(s.forces, sizes, *ends, strict=True)):
        rate = polynomial(force, size / length)
        if statement.order == 2 and n <= i < 2 * n:
            rate = rate - found[i - n]
        found.append(anchored((rate * half).integral(), first, last))
    return found


def _function(values: np.ndarray, start: np.ndarray, end: np.ndarray, half: Ball) -> Poly:
    """A polynomial close to ``values`` that takes given values, and of order two slopes, at its ends."""
    found = flint()
    poly = anchored(polynomial(values), found.arb(float(start[0])), found.arb(float(end[0])))
    if len(start) == 1:
        return poly
    slope = poly.derivative()
    first = half * found.arb(float(start[1])) - slope(found.arb(-1))
    last = half * found.arb(float(end[1])) - slope(found.arb(1))
    # cubics that vanish at both ends and have slope 1 at one of them
    left = found.arb_poly([1, -1, -1, 1]) * (first / 4)
    right = found.arb_poly([-1, -1, 1, 1]) * (last / 4)
    return poly + left + right


def _joint_momenta(
    statement: Statement, samples: list[Samples], joints: np.ndarray
) -> list[tuple[list[Ball], list[Ball]]]:
    """The momenta at both ends of each piece: shared where pieces meet, and at free ends what the ends ask for.

    What is held at a waypoint has momenta of its own on either side. Those of the functions go on from piece to piece
    by their forces: what is missed is left to the controls, as on a short piece it would be a large force.
    """
    rows = _shared_momenta(statement, samples, joints)
    found = [(list(a), list(b)) for a, b in pairwise(rows)]
    waypoints = held_inside(statement, samples)
    for i in range(statement.n):
        cuts = [0, *(k for k, given in waypoints if not np.isnan(given[i])), len(samples)]
        for first, last in pairwise(cuts):
            at_end = (first == 0, last == len(samples))
            known = [
                float(row[i].mid()) if reached and not (statement.held[end][i] or statement.periodic) else None
                for end, (reached, row) in enumerate(zip(at_end, (rows[0], rows[-1]), strict=True))
            ]
            carried = _carried(samples[first:last], i, known, ring=statement.periodic and all(at_end))
            balls = [flint().arb(v) for v in carried]
            balls = [rows[0][i] if known[0] is not None else balls[0], *balls[1:-1],
                     rows[-1][i] if known[1] is not None else balls[-1]]  # fmt: skip
            for k, (start, end) in enumerate(pairwise(balls), first):
                found[k][0][i], found[k][1][i] = start, end
    return found


def _carried(samples: list[Samples], i: int, known: list[float | None], *, ring: bool) -> list[float]:
    """The momenta of function i where pieces meet, that grow by its force, from what they are ``known`` to be.

    ``ring`` tells that the last is the first. Where neither end is known their mean is that of the samples.
    """
    x = np.array(edges_of(samples))
    own = np.array([s.momenta[i, 0] for s in samples])
    grown = np.r_[0.0, np.cumsum([s.momenta[i, -1] - s.momenta[i, 0] for s in samples])]
    lengths, (first, last) = np.diff(x), known
    if ring or (first is not None and last is not None):
        reached = 0.0 if ring or first is None or last is None else last - first
        grown = grown + (reached - grown[-1]) * (x - x[0]) / (x[-1] - x[0])
    if first is None:
        first = float(((own - grown[:-1]) * lengths).sum() / lengths.sum()) if last is None else last - grown[-1]
    values: list[float] = (first + grown).tolist()
    return [*values[:-1], values[0]] if ring else values


def _shared_momenta(statement: Statement, samples: list[Samples], joints: np.ndarray) -> list[list[Ball]]:
    """The momenta where pieces meet, and at the ends."""
    found, m = flint(), statement.bare
    rows = [samples[0].momenta[:, 0]]
    rows += [0.5 * (a.momenta[:, -1] + b.momenta[:, 0]) for a, b in pairwise(samples)]
    rows.append(samples[-1].momenta[:, -1])
    cost, first = statement.cost, statement.n * statement.order
    for i in range(first, m):
        if cost is not None and cost.index(0, i) is not None:
            rows = [row - rows[-1] * (np.arange(m) == i) for row in rows]  # counted from the end, not the start
    balls = [[found.arb(float(v)) for v in row] for row in rows]
    if statement.periodic:
        balls[-1] = balls[0]
        return balls
    jet = None if cost is None else cost.jet(*end_values(statement, joints), 1)
    for end, row in ((0, 0), (1, -1)):
        for i in range(m):
            if not statement.held[end][i]:
                at = None if cost is None else cost.index(end, i)
                slope = found.arb(0) if jet is None or at is None else found.arb(0) + jet.first.get(at, 0)
                balls[row][i] = -slope if end else slope
    return balls


def end_values(statement: Statement, joints: np.ndarray) -> tuple[list[Ball], list[Ball], list[Ball]]:
    """The functions at the start and the end, and the numbers, of states (pieces + 1, m) where pieces meet."""
    n, order = statement.n, statement.order
    ball = flint().arb
    start, end = ([ball(float(v)) for v in row[:n]] for row in (joints[0], joints[-1]))
    return start, end, [ball(float(v)) for v in joints[-1][n * order :]]


def state_sizes(samples: Sequence[Samples], statement: Statement) -> np.ndarray:
    """A power of two of the size of each state, (m,): one for all functions, and of their slopes; each number's own."""
    n, order = statement.n, statement.order
    length = samples[-1].end - samples[0].start
    rows = np.hstack([s.states for s in samples])
    spread = max(float(np.ptp(rows[:n], axis=1).max()), 1e-3 * float(np.abs(rows[:n]).max()))
    unit = spread if spread > NOTHING * length else length  # what is left of a curve that vanishes has no size
    sizes = [unit / length**k for k in range(order) for _ in range(n)]
    sizes += [max(abs(float(c)), 1e-3) for c in statement.along.numbers]
    if statement.levels:
        slopes = np.abs(np.concatenate([s.turning for s in samples])).max(axis=0)
        scale = np.r_[sizes, [sizes[(order - 1) * n] / length] * n]
        sizes += (length * (slopes * scale).max(axis=1)).tolist()
    return 2.0 ** np.round(np.log2(sizes))


def fitted(values: np.ndarray, noise: float) -> Any:
    """The Chebyshev series of a piece through values at its nodes; last terms no larger than ``noise`` are dropped."""
    series = np.polynomial.Chebyshev.fit(nodes(CURVE_DEGREE), values, CURVE_DEGREE, domain=[-1, 1])
    return series.trim(noise)


def in_powers(series: Any) -> np.ndarray:
    """The coefficients in powers of the variable of a Chebyshev series."""
    return series.convert(kind=np.polynomial.Polynomial).coef


def mean_inside(values: np.ndarray) -> float:
    """The mean of ``values`` at the nodes of a piece, in which its ends have no part."""
    inside = 1.0 - nodes(CURVE_DEGREE) ** 2
    return float((values * inside).sum() / inside.sum())


def own_variable(x: Any, a: float, b: float) -> Any:
    """What runs from -1 to 1 between two abscissae, but for round-off of a + b and b - a."""
    return (2 * x - (a + b)) * (1 / (b - a))


def polynomial_at(t: Any, powers: Sequence[Any] | np.ndarray) -> Any:
    """The value at t of the polynomial that has these coefficients in powers."""
    value = 0 * t
    for c in powers[::-1]:
        value = value * t + c
    return value


def through(parts: Sequence[Part]) -> CurveOrSlope:
    """The curve through values at the nodes of parts, and its derivatives."""
    starts = np.array([a for a, _, _ in parts])
    series = [[np.polynomial.Chebyshev(row, domain=[a, b]) for row in values @ transform(len(values[0]) - 1).T]
              for a, b, values in parts]  # fmt: skip

    def evaluate(x: np.ndarray, k: int) -> np.ndarray:
        """The k-th derivative of the curve at ``x``: (rows, *x.shape)."""
        at = np.clip(np.searchsorted(starts, x, side="right") - 1, 0, len(starts) - 1)
        found = np.empty((len(series[0]), *np.shape(x)))
        for number in np.unique(at):
            here = at == number
            found[:, here] = [row.deriv(k)(x[here]) for row in series[number]]
        return found

    return evaluate
