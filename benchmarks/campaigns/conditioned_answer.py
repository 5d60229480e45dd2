"""Whether the curve of an answer keeps all that was asked under conditions, and has the value that is said of it."""

from __future__ import annotations

import casadi as ca
import numpy as np

import varcalc as vc
from campaigns.conditioned import Conditioned
from campaigns.kinds import Switches

PANELS, ALIKE, KEPT = 6000, 2e-5, 1e-6
"""Panels of three Gauss points by which it is summed, how nearly that is its value, and how nearly conditions are kept.
"""


def fault(given: Conditioned, solution: vc.Solution) -> str:
    """In what an answer's curve is not what is said of it; empty where it is."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    first, last = solution.interval
    # elements may be tiny: their ends are ends of panels
    edges = np.union1d(np.linspace(first, last, PANELS + 1), np.clip(solution.x, first, last))
    half = np.diff(edges) / 2
    x = (edges[:-1, None] + half[:, None] * (1 + nodes)).ravel()
    y, v = solution.curve(x, 0), solution.curve(x, 1)
    bends = solution.curve(x, 2) if given.order == 2 else 0 * y
    shares = (half[:, None] * weights).ravel()
    symbols = ca.SX.sym("x"), *(ca.SX.sym(name, given.functions) for name in "yvw")
    of = [given.lagrangian(*symbols, Switches()), *(r.of(*symbols[:3]) for r in [*given.bounds, *given.levels])]
    rows = np.asarray(ca.Function("all", list(symbols), [ca.densify(ca.vertcat(*of))])(x[None], y, v, bends))
    wrong = [
        f"breaks {b.name} by {off:.1e}"
        for b, row in zip(given.bounds, rows[1:], strict=False)
        if (off := max(b.lower - row.min(), row.max() - b.upper)) > KEPT
    ]
    for level, row in zip(given.levels, rows[1 + len(given.bounds) :], strict=True):
        off = max(level.lower - float(row @ shares), float(row @ shares) - level.upper)
        wrong += [f"misses {level.name} by {off:.1e}"] * (off > KEPT)
    ends = solution.curve(np.array([first, last]), 0)
    wrong += _at_ends(given, (first, last), ends)
    own = float(rows[0] @ shares + given.cost(first, ca.DM(ends[:, 0]), last, ca.DM(ends[:, 1]), Switches()))
    wrong += [f"sums to {own:.8g}"] * (abs(own - given.sign * solution.value) > ALIKE * max(1.0, abs(own)))
    return ", ".join(wrong)


def _at_ends(given: Conditioned, span: tuple[float, float], reached: np.ndarray) -> list[str]:
    if given.closed:
        return ["is not closed"] * bool(np.abs(reached[:, 0] - reached[:, 1]).max() > KEPT)
    wrong = []
    for name, end, x, y in zip(("start", "end"), given.ends, span, reached.T, strict=True):
        if end.phi is not None:
            off = abs(float(end.phi(x, float(y[0]))))
        else:
            off = max(abs(x - end.x), 0.0 if end.free else float(np.abs(y - end.y).max()))
        wrong += [f"misses its {name} by {off:.1e}"] * (off > KEPT)
    return wrong
