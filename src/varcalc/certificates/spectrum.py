"""The lowest eigenvalues of Rayleigh's quotient, each between Ritz's upper bound and Lehmann's lower one.

Let A and G be the quadratic forms of L and of the prescribed integrand, L raised by gamma times the latter so that its
matrix H of second derivatives by (y, y') is positive definite at each x. With Ritz functions y_i, any fluxes s_i that
vanish where an end is free, and w_i = H^-1 (G y_i + s_i', s_i), Goerisch's matrix is C = integral of w_i H w_j. If
A - (r + t) G + r t C is negative on a space of dimension i, at least i eigenvalues lie between t and r; where no more
than m lie below r, the one of number m + 1 - i exceeds t (Zimmermann and Mertins, "Variational bounds to eigenvalues
of self-adjoint eigenvalue problems with arbitrary spectrum", Z. Anal. Anwend. 14 (1995) 327; Goerisch and Haunhorst,
"Eigenwertschranken für Eigenwertaufgaben mit partiellen Differentialgleichungen", ZAMM 65 (1985) 129).

That no more than m lie below r is proved by a field of extremals of L - r g on each of the m + 1 parts between zeros
of an eigenfunction: where a curve vanishes at m points its energy is positive (Courant's principle; Sturm).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Series, above, below, flint, integral, working
from varcalc.certificates.certificate import Hypothesis, Means, ProvedInterval, decimals
from varcalc.certificates.choice import proved_tube
from varcalc.certificates.curve import Piece, joint_states, pieces, sampled_on
from varcalc.certificates.eigenfunctions import Eigenfunctions, eigenfunctions
from varcalc.certificates.ends import prove_ends
from varcalc.certificates.inequalities import with_multipliers
from varcalc.certificates.integrals import Unproved, check_enclosed
from varcalc.certificates.proof import BITS, EXPRESSION, SERIES_LENGTH
from varcalc.certificates.rayleigh import homogeneous
from varcalc.certificates.setting import setting_along
from varcalc.certificates.smooth import Undecided, head, reciprocal
from varcalc.certificates.statement import Statement, statement
from varcalc.formulation.graph import graph_form
from varcalc.methods.answer import Extremal
from varcalc.problem.conditions import Isoperimetric, Through, whole
from varcalc.problem.exact import exactly
from varcalc.problem.problem import Problem
from varcalc.progress import Interrupted, Progress, Telling, telling
from varcalc.showing import line
from varcalc.verify.along_curve import AlongCurve, in_form

PRODUCT_ORDER = 20
"""Order of the Taylor forms of integrals."""
TOLERANCE = 1e-22
"""Remainders of integrals, in units of the eigenvalues."""
MOST_BOXES = 600
NEXT = 3
"""Eigenvalues, beyond those that are asked for, between which the widest gap is looked for."""
NEARER = 0.75
"""Where in that gap r is."""
NEAREST, FARTHEST_BOUND = 2.0**-100, 2.0**-4
"""Distances of a bound from Ritz's value that are tried, relative to r, each four times the one before."""
POINTS_FOR_GAMMA = 65
"""Points of an element at which L is looked at for gamma."""

RITZ = "Ritz's functions meet the ends, and their quotients lie below the upper bound"
LEHMANN = "Lehmann's and Maehly's condition, with Goerisch's fluxes, holds for the lower bound and r = {:.6g}"
COUNT = "no more than {} lie below r: with as many zeros between the ends the energy of L - r g is positive"
POSITIVE = "L + gamma g is positive definite in the curve and its slope, gamma = {:.6g}"


@dataclass(frozen=True, repr=False, kw_only=True)
class Eigenvalue(ProvedInterval):
    """A proof that an eigenvalue lies between ``lower`` and ``upper``.

    ``number`` counts the eigenvalues from the least, with their multiplicity, beginning at 1; for a functional that is
    to be greatest, from the greatest. The eigenvalue is the functional's value where the prescribed integral is 1.
    """

    number: int

    def __repr__(self) -> str:
        return line("Eigenvalue", [f"number {self.number}", f"{self.digits} digits", *self.enclosure[:1]])

    def _headline(self) -> str:
        return f"Theorem: eigenvalue number {self.number} lies between two numbers."

    def __str__(self) -> str:
        return self._theorem(f"eigenvalue number {self.number}", "")


def certify_eigenvalues(problem: Problem, count: int, *, progress: Progress = None) -> tuple[Eigenvalue, ...]:
    """Prove between which two numbers each of the lowest ``count`` eigenvalues lies.

    The problem is Rayleigh's: the integrals of L and of the one prescribed integrand g are quadratic forms of a curve
    y(x), g of y alone and positive, and the ends are held at zero or free. Its eigenvalues are the stationary values of
    the quotient of the two.

    Raises TypeError or ValueError for other arguments, ArithmeticError where the proof is not found, with the
    inequality that failed, and ImportError where python-flint is not installed.

    Parameters
    ----------
    problem:
        Of one function and first order, with one :class:`varcalc.Isoperimetric` and no other condition.
    count:
        How many eigenvalues.
    progress:
        As :data:`varcalc.progress.Progress` says. Ctrl-C raises :class:`varcalc.Interrupted`, which holds the
        eigenvalues that are proved by then.

    Returns
    -------
    tuple of Eigenvalue
        In their order, the least first (the greatest, of a maximum).

    References
    ----------
    Zimmermann and Mertins, Z. Anal. Anwend. 14 (1995) 327; Goerisch and Haunhorst, ZAMM 65 (1985) 129.

    Examples
    --------
    >>> import varcalc as vc
    >>> norm = vc.Isoperimetric(lambda x, y, v: y**2, 1.0)
    >>> string = vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [norm])
    >>> [round(e.lower / 9.869604401089358, 9) for e in vc.certify_eigenvalues(string, 3)]
    [1.0, 4.0, 9.0]
    """
    if not isinstance(problem, Problem):
        raise TypeError(f"problem must be a varcalc.Problem, not {problem!r}")
    whole("count", count)
    flint()
    began = time.perf_counter()
    written = exactly(problem)
    lost = (Hypothesis(EXPRESSION, Means.CONSTRUCTION),) if written is None else ()
    stated = problem if written is None else written
    assert isinstance(stated, Problem)
    _check(stated)
    found: list[Eigenvalue] = []
    try:
        with telling(progress, problem.name) as told, working(BITS, SERIES_LENGTH):
            for eigenvalue in _proof(stated, count, told):
                seconds = time.perf_counter() - began
                found.append(replace(eigenvalue, proved=(*eigenvalue.proved, *lost), seconds=seconds))
    except (Unproved, Undecided) as unproved:
        raise ArithmeticError(f"no certificate: {unproved}") from None
    except KeyboardInterrupt as stop:
        raise Interrupted(tuple(found)) from stop
    return tuple(found)


def _check(problem: Problem) -> None:
    """ValueError where a problem is none of Rayleigh's that is covered."""
    plain = problem.n == 1 and problem.order == 1 and not any(problem.slides) and problem.end_cost is None
    if not plain or problem.unknowns or problem.start.periodic or problem.symbols.kind is not ca.SX:
        raise ValueError("eigenvalues are certified of one function y(x) between ends that are held at zero or free")
    if len(problem.constraints) != 1 or not isinstance(problem.constraints[0], Isoperimetric):
        raise ValueError("a Rayleigh quotient has one condition, the Isoperimetric of what it is divided by")
    if not problem.constraints[0].equality:
        raise ValueError("the Isoperimetric of a Rayleigh quotient must prescribe a level, not limits")


def _proof(problem: Problem, count: int, told: Telling) -> Iterator[Eigenvalue]:
    """The eigenvalues, one after the other."""
    plain = _along(problem, 0.0)
    stated = statement(plain)
    check_enclosed(stated.function, "the Lagrangian")
    if ca.depends_on(plain.integrals[0], plain.symbols.dy):
        raise Unproved("the prescribed integrand depends on the slope")
    told(0, None, "eigenfunctions")
    ritz = eigenfunctions(lambda x: _coefficients(problem, x), plain.vertices, _held(stated), count + NEXT)
    own = ritz.eigenvalues
    m = count + int(np.argmax(np.diff(own[count - 1 :]) / (1.0 + np.arange(NEXT))))
    r = float(own[m - 1] + NEARER * (own[m] - own[m - 1]))
    told(0, None, f"no more than {m} eigenvalues lie below {r:.3g}")
    _prove_count(problem, ritz, m, r)
    told(0, None, "integrals")
    gamma = _raising(problem, ritz, r)
    forms = _Forms(stated, [_exact(problem, ritz, k) for k in range(m)], own[:m].tolist(), gamma)
    matrices = forms.integrated()
    sentences = RITZ, LEHMANN.format(r), COUNT.format(m), POSITIVE.format(gamma)
    proved = tuple(Hypothesis(sentence, Means.BALLS) for sentence in sentences)
    for k in told.over(range(count), lambda k: f"eigenvalue {k + 1}"):
        low, high = _bounds(matrices, r, gamma, k)
        if problem.maximise:
            low, high = -high, -low
        text = decimals(low, high)
        yield Eigenvalue(number=k + 1, lower=below(low), upper=above(high), enclosure=text, proved=proved, seconds=0.0)


def _along(problem: Problem, eigenvalue: float, evaluate: Any = None, vertices: Sequence[float] = ()) -> AlongCurve:
    """A curve of L - eigenvalue g, by default zero."""
    form = graph_form(problem)
    zero = evaluate or (lambda x, _: np.zeros((1, len(x))))
    edges = np.unique([*form.span, *form.conditions.knots, *vertices])
    lambdas = np.full(len(form.conditions.integrals), -eigenvalue)
    return in_form(Extremal(form, zero, np.zeros(0), edges, lambdas, {}))


def _held(stated: Statement) -> tuple[bool, bool]:
    return bool(stated.held[0][0]), bool(stated.held[1][0])


def _coefficients(problem: Problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Second derivatives of L and of g by (y, y') on y = 0, in numbers."""
    zero = np.zeros((1, len(x)))
    (_, energy, _), (_, more, _) = (statement(_along(problem, v)).sampled(x, zero, zero) for v in (0.0, -1.0))
    # between the two is what is integrated to the level
    return energy[:, ::2, ::2], (more - energy)[:, ::2, ::2]


def _prove_count(problem: Problem, ritz: Eigenfunctions, m: int, r: float) -> None:
    """Prove that no more than m eigenvalues lie below r, and that both integrals are quadratic forms."""
    zeros = ritz.zeros(m)
    if len(zeros) != m:
        raise Unproved(f"eigenfunction {m + 1} has {len(zeros)} zeros between the ends")
    level = graph_form(problem).conditions.integrals[0].expression
    cut = with_multipliers(problem, [(level, -r)], [Through(x, 0.0) for x in zeros])
    setting = setting_along(_along(cut, 0.0, vertices=[*zeros, *ritz.edges.tolist()]), 1.0)
    lowest = _along(problem, r, ritz.evaluate(0), ritz.edges.tolist())
    if not (homogeneous(setting) and homogeneous(setting_along(lowest, 1.0))):
        raise Unproved("L and the prescribed integrand are not proved quadratic forms, or an end is held off zero")
    prove_ends(proved_tube(setting))


def _raising(problem: Problem, ritz: Eigenfunctions, r: float) -> float:
    """gamma, by which L + gamma g is positive definite with room to spare."""
    x = np.concatenate([np.linspace(a, b, POINTS_FOR_GAMMA)[1:-1] for a, b in pairwise(ritz.edges)])
    energy, norm = _coefficients(problem, x)
    if not (energy[:, 1, 1].min() > 0 and norm[:, 0, 0].min() > 0):
        raise Unproved("L is not convex in the slope, or the prescribed integrand is not positive")
    lowest = (energy[:, 0, 0] - energy[:, 0, 1] ** 2 / energy[:, 1, 1]) / norm[:, 0, 0]
    return float(0.5 * (r - ritz.eigenvalues[0]) - lowest.min())


def _exact(problem: Problem, ritz: Eigenfunctions, number: int) -> list[Piece]:
    """An eigenfunction with its momentum as exact polynomials on the elements."""
    function = ritz.evaluate(number)
    stated = statement(_along(problem, float(ritz.eigenvalues[number]), function, ritz.edges.tolist()))
    samples = sampled_on(stated, ritz.edges.tolist())
    return pieces(stated, samples, joint_states(stated, samples))


Matrix = list[list[Ball]]


@dataclass(frozen=True)
class _Forms:
    """The quadratic forms of eigenfunctions, each a list of pieces."""

    stated: Statement
    functions: Sequence[Sequence[Piece]]
    eigenvalues: Sequence[float]
    gamma: float

    def integrated(self) -> tuple[Matrix, Matrix, Matrix]:
        """A (with gamma), G and C."""
        count, found = len(self.functions), flint()
        waiting, tried = [(k, piece.box()) for k, piece in enumerate(self.functions[0])], 0
        totals = [[[found.arb(0)] * count for _ in range(count)] for _ in range(3)]
        allowed = TOLERANCE * max(1.0, abs(self.eigenvalues[-1] + self.gamma))
        while waiting:
            (k, box), tried = waiting.pop(), tried + 1
            reason = "it is too rough there"
            try:
                parts = self._on_box(k, box)
                if all(bool(abs(rest) * box.unit < allowed) for *_, (_, rest) in parts):
                    for form, i, j, (main, rest) in parts:
                        totals[form][i][j] += (main + rest) * box.unit
                    continue
            except Undecided as undecided:
                reason = str(undecided)
            if tried > MOST_BOXES or box.narrow:
                raise Unproved(f"the Lagrangian is not enclosed near {box.at:.6g}: {reason}")
            waiting += [(k, half) for half in box.halves()]
        for matrix in totals:
            for i, j in np.ndindex(count, count):
                matrix[max(i, j)][min(i, j)] = matrix[min(i, j)][max(i, j)]
        return totals[0], totals[1], totals[2]

    def _on_box(self, k: int, box: Box) -> list[tuple[int, int, int, tuple[Ball, Ball]]]:
        views = [self._series(k, Around(box, PRODUCT_ORDER + 1 + w, bool(w))) for w in (0, 1)]
        return [
            (form, i, j, integral(centred, around, PRODUCT_ORDER))
            for (form, i, j, centred), (*_, around) in zip(*views, strict=True)
        ]

    def _series(self, k: int, around: Around) -> list[tuple[int, int, int, Series]]:
        """The integrands of the entries on and above the diagonals."""
        x, zero = around.abscissa(), flint().arb_series([0], around.terms)
        states = [flint().arb(0)], [flint().arb(0)]
        own = self.stated.jet(x, *states, 2, self.functions[0][k].switches).second
        weight = zero + self.stated.level_jets(x, *states, 2)[0].second.get((0, 0), 0)
        P, R = (zero + own.get(key, 0) for key in ((1, 1), (0, 1)))
        S = zero + own.get((0, 0), 0) + self.gamma * weight
        determinant = P * S - R * R
        if not (head(P) > 0 and head(determinant) > 0 and head(weight) > 0):
            raise Undecided("L + gamma g, or g, is not proved positive definite")
        inverse = reciprocal(determinant)
        rows = []
        for pieces_of, eigenvalue in zip(self.functions, self.eigenvalues, strict=True):
            piece = pieces_of[k]
            (y,), (slope,) = piece.lifted(around)
            flux = around.series(around.box.local(piece.momenta[0])) / flint().arb(eigenvalue + self.gamma)
            rows.append((y, slope, flux, weight * y + around.slope(flux)))
        found = []
        for i, (y, v, s, e) in enumerate(rows):
            for j, (z, u, t, f) in enumerate(rows[i:], start=i):
                found.append((0, i, j, P * (v * u) + R * (y * u + z * v) + S * (y * z)))
                found.append((1, i, j, weight * (y * z)))
                found.append((2, i, j, inverse * (P * (e * f) - R * (e * t + f * s) + S * (s * t))))
        return found


def _bounds(matrices: tuple[Matrix, Matrix, Matrix], r: float, gamma: float, k: int) -> tuple[Ball, Ball]:
    """Two numbers between which eigenvalue k, counted from 0, lies."""
    m, found = len(matrices[0]), flint()
    shifted, quotient = found.arb(r) + gamma, matrices[0][k][k] / matrices[1][k][k]

    def falling(factors: Sequence[Ball]) -> int:
        """On how many dimensions the sum of the three forms is negative at least."""
        total: Any = found.arb_mat(m, m)
        for factor, matrix in zip(factors, matrices, strict=True):
            total += found.arb_mat(matrix) * factor
        return negative(total.tolist())

    room = NEAREST
    low = high = None
    while room < FARTHEST_BOUND and (low is None or high is None):
        t, top = (quotient.lower() - shifted * room).lower(), (quotient.upper() + shifted * room).upper()
        if low is None and t > 0 and falling([found.arb(1), -(shifted + t), shifted * t]) >= m - k:
            low = t
        if high is None and falling([found.arb(1), -top, found.arb(0)]) > k:
            high = top
        room *= 4.0
    if low is None or high is None:
        raise Unproved(f"eigenvalue {k + 1} is not proved to lie near {float(quotient.mid()) - gamma:.9g}")
    return (low - gamma).lower(), (high - gamma).upper()


def negative(matrix: Matrix) -> int:
    """On how many dimensions a symmetric form is proved negative at least: the negative pivots of elimination."""
    work, count = [list(row) for row in matrix], 0
    while work:
        k = max(range(len(work)), key=lambda i: float(abs(work[i][i].mid())))
        pivot = work[k][k]
        if pivot.contains(0):
            return count
        count += bool(pivot < 0)
        rest = [i for i in range(len(work)) if i != k]
        work = [[work[i][j] - work[i][k] * work[k][j] / pivot for j in rest] for i in rest]
    return count
