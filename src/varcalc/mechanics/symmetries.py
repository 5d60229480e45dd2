"""Invariants of motions: ignorable coordinates, and Noether's for a symmetry that is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.mechanics.lagrange import Lagrange
from varcalc.problem.conditions import function, text
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression

HOLDS = 1e-9
"""Of the terms of an identity: what is left of it at random places, if it holds."""


@spelled
@dataclass(frozen=True, repr=False)
class Symmetry(Brief):
    """An infinitesimal change of coordinates ``xi(t, q[, p])`` (n numbers) and of time ``tau(t, q[, p])``.

    The Lagrangian may change by the rate of ``gauge(t, q[, p])``, as it does under a Galilean boost.
    Raises TypeError or ValueError for what are no functions, and where neither coordinates nor time change.
    """

    xi: Callable[..., Any] | None = None
    tau: Callable[..., Any] | None = None
    gauge: Callable[..., Any] | None = None
    name: str = "symmetry"

    def __post_init__(self) -> None:
        given = [name for name in ("xi", "tau", "gauge") if getattr(self, name) is not None]
        for name in given:
            function(f"Symmetry.{name}", getattr(self, name))
        if not {"xi", "tau"} & {*given}:
            raise ValueError("Symmetry changes nothing; give xi=, tau= or both")
        text("Symmetry.name", self.name)


def noether(lagrange: Lagrange, symmetry: Symmetry, parameters: Mapping[str, float]) -> Expression:
    """The invariant L_v·(ξ - v τ) + L τ - F of a symmetry.

    Raises ValueError where the action is no such invariant: the identity of Noether (Gelfand and Fomin, "Calculus of
    Variations", sect. 37) is put to the test at random places.
    """
    s, n = lagrange.symbols, lagrange.symbols.q.numel()
    zero = ca.SX(0)
    tau = s.traced("tau", symmetry.tau, s.t, s.q) if symmetry.tau else zero
    gauge = s.traced("gauge", symmetry.gauge, s.t, s.q) if symmetry.gauge else zero
    xi = s.column("xi", symmetry.xi, n, s.t, s.q) if symmetry.xi else ca.SX.zeros(n)

    def rate(of: Expression) -> Expression:
        return ca.jtimes(of, s.q, s.v) + ca.jacobian(of, s.t)

    turned = rate(xi) - s.v * rate(tau)
    terms = ca.vertcat(
        ca.gradient(lagrange.value, s.q) * xi, lagrange.momenta * turned,  # each for itself: what cancels has a size
        ca.gradient(lagrange.value, s.t) * tau, lagrange.value * rate(tau), -rate(gauge),
    )  # fmt: skip
    function = ca.Function("identity", s.all, [terms])
    for place in lagrange.places(parameters):
        here = np.array(function(*place)).ravel()
        if np.all(np.isfinite(here)) and abs(here.sum()) > HOLDS * max(np.abs(here).max(), 1e-300):
            raise ValueError(
                f"{symmetry.name} is no symmetry of L: its change is {here.sum():.3g} at t = {place[0][0]:.3g}, "
                f"q = {place[1]}, v = {place[2]}, and not zero; a gauge= may be missing"
            )
    return ca.dot(lagrange.momenta, xi - s.v * tau) + lagrange.value * tau - gauge
