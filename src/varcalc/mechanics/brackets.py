"""Poisson brackets of functions of coordinates and momenta."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from varcalc.problem.conditions import function
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression

Observable = Callable[[Any, Any], Any]
"""A function of coordinates and momenta, both columns."""


@spelled
def poisson(f: Observable, g: Observable) -> Observable:
    """The bracket {f, g} = f_q·g_p - f_p·g_q, as a function of the same kind.

    Raises TypeError for what are no functions. Source: Goldstein, Poole and Safko, "Classical Mechanics", sect. 9.5.

    >>> import casadi as ca
    >>> spin = lambda k: lambda q, p: ca.cross(q, p)[k]
    >>> bracket = poisson(spin(0), spin(1))
    >>> q, p = ca.DM([1, 2, 3]), ca.DM([0.5, -1, 2])
    >>> float(bracket(q, p)) == float(spin(2)(q, p))
    True
    """
    function("f", f)
    function("g", g)

    def bracket(q: Expression, p: Expression) -> Expression:
        """The value at q and p (n,)."""
        n = q.numel()
        at_q, at_p = ca.SX.sym("q", n), ca.SX.sym("p", n)
        first, second = ca.SX(f(at_q, at_p)), ca.SX(g(at_q, at_p))
        value = ca.dot(ca.gradient(first, at_q), ca.gradient(second, at_p))
        value -= ca.dot(ca.gradient(first, at_p), ca.gradient(second, at_q))
        return ca.Function("bracket", [at_q, at_p], [value])(q, p)

    return bracket
