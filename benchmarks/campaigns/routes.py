"""The routes to an answer that the campaigns hold against the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from campaigns.truth import Answer
from varcalc.formulation import formulate
from varcalc.methods.collocation.scipy_bvp import FIRST_NODES, BoundaryValueProblem, inapplicable

Start = Callable[[Any], Any]
"""A starting curve: a number to a number."""

PEER = "SciPy solve_bvp alone"
PEER_TOLERANCE = 1e-3
"""solve_bvp's own default, and the relative error of the value granted to it as its claim."""
PEER_NODES = 1000
PANELS, POINTS = 2000, 4
"""Gauss's rule for the functional on solve_bvp's curve: no matter how steep it is."""


@dataclass(frozen=True)
class Route:
    """A method as ``solve`` takes it, whether it promises a minimum, and whether it looks at a starting curve."""

    method: Any
    minimises: bool = False
    starts: bool = True

    def answer(self, problem: vc.Problem, start: Start | None) -> tuple[Answer, vc.Solution]:
        """What the route says of a problem, from a starting curve or its own."""
        solution = vc.solve(problem, self.method, throw=False, guess=start)
        return Answer(
            ok=solution.status.ok, value=solution.value, claim=solution.error.value, verdict=solution.verdict,
            applies=solution.status is not vc.Status.REFUSED or solution.verdict is not None,
            message=solution.message, status=solution.status.name,
        ), solution  # fmt: skip


ROUTES = {
    "the ladder": Route(None, minimises=True),
    "Ritz (Newton)": Route(vc.Ritz(optimiser=vc.Newton()), minimises=True),
    "Ritz (IPOPT)": Route(vc.Ritz(optimiser=vc.Ipopt()), minimises=True),
    "Collocation": Route(vc.Collocation()),
    "Shooting": Route(vc.Shooting()),
    "FirstIntegral": Route(vc.FirstIntegral(), starts=False),
}


def peer_answer(problem: vc.Problem, start: Start | None) -> Answer:
    """What SciPy's solve_bvp says at its default tolerance, believed: its curve, and ``success``.

    The Euler-Lagrange equation and its Jacobian are handed to it ready made.
    The start is the straight line where none is given.
    """
    form = formulate(problem)
    reason = inapplicable(form)
    if reason:
        return Answer(ok=False, applies=False, message=reason)
    boundary = BoundaryValueProblem(form)
    nodes = np.linspace(*form.span, FIRST_NODES)
    values = form.start.curve(nodes) if start is None else np.array([[start(x) for x in nodes]])
    tower = np.vstack([values, np.gradient(values, nodes, axis=1, edge_order=2)])
    result = boundary.solve(nodes, tower, PEER_TOLERANCE, PEER_NODES)
    if not (result.success and np.isfinite(result.y).all()):
        return Answer(ok=False, message=result.message, status="gave up")
    value = functional(problem, lambda x: result.sol(x)[0], lambda x: result.sol(x)[1])
    return Answer(ok=True, value=value, claim=PEER_TOLERANCE * abs(value), status="success")


def functional(problem: vc.Problem, y: Callable[..., Any], dy: Callable[..., Any]) -> float:
    """The functional on a curve of one unknown function, by Gauss's rule on many panels."""
    s = problem.symbols
    integrand = ca.Function("L", [s.x, s.y, s.dy, s.parameters], [problem.integrand])
    x, weights = rule(problem.span, PANELS, POINTS)
    parameters = np.repeat(problem.parameter_values[:, None], len(x), axis=1)
    values: Any = integrand(x[None], y(x)[None], dy(x)[None], parameters)
    return float(np.asarray(values)[0] @ weights)


def rule(span: tuple[float, float], panels: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Abscissae and weights of Gauss's rule with so many points on each of so many equal panels."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    edges = np.linspace(*span, panels + 1)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
