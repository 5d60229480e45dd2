"""The inequality in a tube around the curve: what makes Hilbert's invariant integral a bound.

With w = z - z0 and S = S0 + p w + w Q w/2 the functional minus its value on the curve is the integral of F(x, w, u)
and terms at the ends. F vanishes with w and u, its gradient there is (r, q), and its matrix of second derivatives is

    [ H_zz - Q' - Q A - A^T Q    H_zu - Q B ]
    [ H_uz - B^T Q                  H_uu    ].

Where it exceeds diag(kappa, mu) for |w| <= delta, |u| <= rho, F >= r w + q u + kappa |w|^2/2 + mu |u|^2/2 there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Series, coefficient, enclosed, flint, polynomial
from varcalc.certificates.curve import Piece
from varcalc.certificates.field import JacobiFields, dynamics
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.setting import Setting
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement

Matrix: TypeAlias = list[list[Any]]
"""Of polynomials, series or numbers."""
INEQUALITY_ORDER = 10
"""Order of the Taylor forms of the inequality."""
AT_MIDDLE = 2
"""The same at the middle of a box, where only Q has a slope."""
MOST_CUTS = 200
"""How often boxes are cut for the inequality."""


@dataclass(frozen=True)
class Tube:
    """Widths of a tube, and what is to be proved in it; states and controls in units of ``sizes``.

    ``stiffness`` bounds H_uu from below where |u| <= ``rho`` (one for each piece), ``tilt`` bounds |H_zu - Q B| from
    above. Infinite widths are for H of second degree.
    """

    delta: float
    rho: tuple[float, ...]
    kappa: float
    mu: float
    stiffness: tuple[float, ...]
    tilt: tuple[float, ...]
    sizes: tuple[np.ndarray, np.ndarray]


class TooWide(Unproved):
    """The inequality is not proved on the box of that ``number``."""

    def __init__(self, reason: str, number: int) -> None:
        super().__init__(reason)
        self.number = number


class Slopes:
    """Q on one piece: M U^-1 of two matrices of polynomials, U the identity where there is more than one state.

    So U^T M is symmetric, and the inequality can be multiplied by U from both sides, which leaves no quotient in it.
    """

    def __init__(self, U: Matrix, M: Matrix) -> None:
        self.U, self.M = U, M

    @classmethod
    def through(cls, Q: np.ndarray) -> Slopes:
        """Through values of Q (N + 1, m, m) at the nodes."""
        m = Q.shape[1]
        upper = {(i, j): polynomial(Q[:, i, j]) for i in range(m) for j in range(i, m)}
        unit = [[flint().arb_poly([int(i == j)]) for j in range(m)] for i in range(m)]
        return cls(unit, [[upper[min(i, j), max(i, j)] for j in range(m)] for i in range(m)])

    @classmethod
    def none(cls, m: int) -> Slopes:
        """Q = 0."""
        return cls.through(np.zeros((2, m, m)))

    def series(self, around: Around) -> tuple[Series, Matrix]:
        """U, a number 1 where it is the identity, and M."""
        M = [[around.series(around.box.local(p)) for p in row] for row in self.M]
        return (around.series(around.box.local(self.U[0][0])) if len(M) == 1 else 1), M


def slopes(field: JacobiFields | None, count: int, states: int, parted: Sequence[int] = ()) -> list[Slopes]:
    """Q of each piece, continuous but for where ``parted`` pieces begin."""
    if field is None:
        return [Slopes.none(states)] * count
    if states == 1:
        return [Slopes(*([[polynomial(v[:, 0, 0])]] for v in pair)) for pair in zip(field.U, field.M, strict=True)]
    turned = np.linalg.solve(field.U.swapaxes(2, 3), field.M.swapaxes(2, 3))
    Q = 0.5 * (turned + turned.swapaxes(2, 3))
    for k in set(range(1, count)) - set(parted):
        Q[k, 0] = Q[k - 1, -1]  # continuous to the last bit
    return [Slopes.through(values) for values in Q]


@dataclass(frozen=True)
class Prover:
    """The inequality of one tube, for any box."""

    setting: Setting
    slopes: Sequence[Slopes]
    tube: Tube

    @property
    def statement(self) -> Statement:
        """What the certificate is about."""
        return self.setting.statement

    @property
    def pieces(self) -> Sequence[Piece]:
        """The curve."""
        return self.setting.pieces

    def wide(self, boxes: Sequence[tuple[int, Box]]) -> bool:
        """Whether the inequality fails at the middle of a box already, so that smaller boxes would not help."""
        try:
            return not all(self._holds_at_middle(k, box) for k, box in boxes)
        except Undecided:
            return True

    def _holds_at_middle(self, k: int, box: Box) -> bool:
        return self._holds_for_numbers(k, Around(box, AT_MIDDLE, False))

    def _holds_for_numbers(self, k: int, around: Around) -> bool:
        """Whether the inequality is proved at the middle of a box, or at once on all of it; L may switch there."""
        demands, matrices = self._demands(k, around, AT_MIDDLE)
        heads = [[[v[0] for v in row] for row in matrix] for matrix in matrices]
        return _positive([d[0] for d in demands]) and all(definite([flint().arb_mat(matrix)]) for matrix in heads)

    def prove(self, boxes: Sequence[tuple[int, Box]], deepest: int) -> None:
        """Prove the inequality on boxes, as many at once as it holds on, or halved ``deepest`` times where needed.

        Raises :class:`TooWide`.
        """
        number, run, cuts, failed = 0, 1, 0, False
        while number < len(boxes):
            run = min(run, _in_a_row(boxes, number))
            if run == 1:
                cuts = self._prove_halved(number, *boxes[number], deepest, cuts)
            elif not self._held(*_joined(boxes[number : number + run])):
                run, failed = run // 2, True
                continue
            # what twice as many failed on fails on them again, next to where it did
            number, run, failed = number + run, run if failed else 2 * run, False

    def _held(self, k: int, box: Box) -> bool:
        try:
            return self._holds(k, box)
        except Undecided:
            return False

    def _prove_halved(self, number: int, k: int, whole: Box, deepest: int, cuts: int) -> int:
        """Prove the inequality on one box; how often boxes have been cut, of which ``cuts`` before."""
        waiting = [(whole, 0)]
        while waiting:
            box, depth = waiting.pop()
            reason = ""
            try:
                if self._holds(k, box):
                    continue
            except Undecided as undecided:
                reason = f" ({undecided})"
            cuts += 1
            if depth == deepest or cuts > MOST_CUTS or self.wide([(k, box)]):
                raise TooWide(
                    f"the matrix of second derivatives, with Q from Jacobi's equation, is not proved to exceed "
                    f"diag(kappa, mu) in the tube near {box.at:.6g}{reason}",
                    number,
                )
            waiting += [(b, depth + 1) for b in reversed(box.halves())]
        return cuts

    def _holds(self, k: int, box: Box) -> bool:
        try:
            return self._holds_smoothly(k, box)
        except Undecided:
            return self._holds_for_numbers(k, Around(box, AT_MIDDLE, True))

    def _holds_smoothly(self, k: int, box: Box) -> bool:
        views = [
            self._demands(k, Around(box, INEQUALITY_ORDER + 1 + w, w), INEQUALITY_ORDER + 1 + w) for w in (False, True)
        ]
        (demands, matrices), (beside, rests) = views
        return _enclosed_positive(demands, beside) and all(map(_definite, matrices, rests))

    def _demands(self, k: int, around: Around, terms: int) -> tuple[list[Series], list[Matrix]]:
        """What must be positive, as series, and what positive definite: what rho must meet, and the inequality."""
        statement, tube = self.statement, self.tube
        m, n = statement.states, statement.n
        zero = flint().arb_series([0], terms)
        U, M = self.slopes[k].series(around)
        second, A, B = self._second(k, around, M)
        demands, matrices = [U] if m == 1 else [], []
        mixed = [[second[i][m + j] for j in range(n)] for i in range(m)]
        mixed = _less_scaled(_times(mixed, U), _product(M, B), tube.sizes)
        uu = [[zero + second[m + i][m + j] for j in range(n)] for i in range(n)]
        if tube.delta < np.inf:
            matrices.append(_less(uu, tube.stiffness[k]))
            room = tube.tilt[k] ** 2 * (U * U)
            demands.append(zero + room - sum(v * v for row in mixed for v in row))
        zz = self._bent(second, U, M, A, around)
        corner = _less(uu, tube.mu)
        across = _transposed(mixed)
        full = [[*a, *b] for a, b in zip(corner, across, strict=True)]
        full += [[*a, *b] for a, b in zip(mixed, zz, strict=True)]
        return demands, [*matrices, [[zero + v for v in row] for row in full]]

    def _bent(self, second: Matrix, U: Series, M: Matrix, A: Matrix, around: Around) -> Matrix:
        """(H_zz - kappa) U^2 - (U M' - M U') - (M A + A^T M) U, in units of the states; U is a scalar or 1."""
        sizes, m = self.tube.sizes[0].tolist(), self.statement.states
        zz = _times(_less([row[:m] for row in second[:m]], self.tube.kappa), U * U)
        rest = _times([[around.slope(v) for v in row] for row in M], U)
        if m == 1:
            rest[0][0] = rest[0][0] - M[0][0] * around.slope(U)
        if self.statement.order == 2 or self.statement.levels:
            bent = _times(_product(M, A), U)
            rest = [[v + bent[i][j] + bent[j][i] for j, v in enumerate(row)] for i, row in enumerate(rest)]
        return [[zz[i][j] - rest[i][j] * (sizes[i] * sizes[j]) for j in range(m)] for i in range(m)]

    def _second(self, k: int, around: Around, M: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        """Second derivatives of H less sigma f over the tube, in units of states and controls; A and B as series.

        f are the rates of the states, sigma = Q w: only levels have rates that are not of first degree.
        """
        statement, piece, tube = self.statement, self.pieces[k], self.tube
        n, m, bare = statement.n, statement.states, statement.bare
        found, wide = flint(), self.tube.delta < np.inf
        states, controls = piece.lifted(around)
        x = around.abscissa()
        if around.terms == AT_MIDDLE:
            x, states, controls = x[0], list(map(head, states)), list(map(head, controls))
        room = [found.arb(0, tube.delta * size) if wide else 0 for size in tube.sizes[0].tolist()]
        if wide:
            states = [s + w for s, w in zip(states, room[:bare], strict=True)]
            controls = [
                s + found.arb(0, tube.rho[k] * size) for s, size in zip(controls, tube.sizes[1].tolist(), strict=True)
            ]
        second = statement.jet(x, states, controls, 2, piece.switches, crossing=around.terms == AT_MIDDLE).second
        A, B = (grid.tolist() for grid in dynamics(n, statement.order, m))
        matrix: Matrix = [[0] * (m + n) for _ in range(m + n)]
        places = [*range(bare), *range(m, m + n)]
        terms = [(1, second)]
        for j, jet in enumerate(statement.level_jets(x, states, controls, 2)):
            A[bare + j][:bare] = [jet.first.get(i, 0) for i in range(bare)]
            B[bare + j] = [jet.first.get(bare + i, 0) for i in range(n)]
            if jet.second:
                terms.append((-sum(M[bare + j][c] * w for c, w in enumerate(room)), jet.second))
        for factor, entries in terms:
            for (i, j), value in entries.items():
                matrix[places[i]][places[j]] = matrix[places[i]][places[j]] + factor * value
                if i != j:
                    matrix[places[j]][places[i]] = matrix[places[i]][places[j]]
        scale = [*tube.sizes[0].tolist(), *tube.sizes[1].tolist()]
        return (
            [[v * (c * d) for v, d in zip(row, scale, strict=True)] for row, c in zip(matrix, scale, strict=True)],
            A,
            B,
        )


def _in_a_row(boxes: Sequence[tuple[int, Box]], first: int) -> int:
    """How many boxes of one piece follow each other from that number on."""
    last = first
    while last + 1 < len(boxes) and _adjoin(*boxes[last : last + 2]):
        last += 1
    return last + 1 - first


def _adjoin(left: tuple[int, Box], right: tuple[int, Box]) -> bool:
    return left[0] == right[0] and bool(left[1].high == right[1].low)


def _joined(boxes: Sequence[tuple[int, Box]]) -> tuple[int, Box]:
    """Boxes in a row as one."""
    (k, first), (_, last) = boxes[0], boxes[-1]
    return k, Box(first.centre, first.half, first.low, last.high)


def _less_scaled(a: Matrix, b: Matrix, sizes: tuple[np.ndarray, np.ndarray]) -> Matrix:
    """a - b, b brought to units of states and controls."""
    scale = np.outer(*sizes).tolist()
    return [[v - w * s for v, w, s in zip(*rows, strict=True)] for rows in zip(a, b, scale, strict=True)]


def _times(matrix: Matrix, factor: Any) -> Matrix:
    return matrix if isinstance(factor, int) else [[v * factor for v in row] for row in matrix]


def _less(matrix: Matrix, number: float) -> Matrix:
    """The matrix less a multiple of the identity."""
    return [[v - number if i == j else v for j, v in enumerate(row)] for i, row in enumerate(matrix)]


def _transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix, strict=True)]


def _product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum(v * w for v, w in zip(row, column, strict=True) if not _zero(w)) for column in columns] for row in a]


def _zero(number: Any) -> bool:
    return isinstance(number, float | int) and number == 0


def _eliminated(matrix: Matrix) -> list[Series]:
    """The pivots of elimination without division: a symmetric matrix is positive definite where all are positive."""
    work, pivots = [list(row) for row in matrix], []
    while work:
        (head, *across), *rest = work
        pivots.append(head)
        work = [[head * v - row[0] * w for v, w in zip(row[1:], across, strict=True)] for row in rest]
    return pivots


def _enclosed_positive(centred: Sequence[Series], whole: Sequence[Series]) -> bool:
    return _positive([enclosed(c, w, INEQUALITY_ORDER) for c, w in zip(centred, whole, strict=True)])


def _definite(centred: Matrix, whole: Matrix) -> bool:
    """Whether a matrix of Taylor forms is proved positive definite: in a frame, or by its pivots as such forms.

    The pivots of many rows widen much, and those in a frame widen with all that the matrix changes by in a box.
    """
    if len(centred) > 2 and definite(_coefficients(centred, whole)):
        return True
    return _enclosed_positive(*map(_eliminated, (centred, whole)))


def _coefficients(centred: Matrix, whole: Matrix) -> list[Any]:
    """The matrices by which the powers of t come in a Taylor form, the last one over all of the box."""
    rows = [[[coefficient(v, k) for v in row] for row in centred] for k in range(INEQUALITY_ORDER)]
    return [
        flint().arb_mat(grid) for grid in (*rows, [[coefficient(v, INEQUALITY_ORDER) for v in row] for row in whole])
    ]


def definite(coefficients: Sequence[Any]) -> bool:
    """Whether the sum of symmetric matrices times powers of t is proved positive definite for t in [-1, 1].

    It is looked at in a frame in which the first of them is all but the identity, where elimination loses little.
    """
    first, found = coefficients[0], flint()
    size = first.nrows()
    middle = np.array([[float(first[i, j].mid()) for j in range(size)] for i in range(size)])
    try:
        frame = found.arb_mat(np.linalg.inv(np.linalg.cholesky(middle)).tolist())
    except np.linalg.LinAlgError:
        return False
    total = found.arb_mat(size, size)
    for k, matrix in enumerate(coefficients):
        turned = frame * matrix * frame.transpose()
        total += turned * found.arb(0, 1) if k else turned
    work = [[total[i, j] for j in range(size)] for i in range(size)]
    while work:
        (head, *across), *rest = work
        if not head > 0:
            return False
        work = [[v - row[0] * w / head for v, w in zip(row[1:], across, strict=True)] for row in rest]
    return True


def _positive(balls: Sequence[Ball]) -> bool:
    return all(bool(ball > 0) for ball in balls)
