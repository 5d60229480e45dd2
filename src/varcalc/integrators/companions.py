"""A system with a companion for every operation that a series cannot see from afar."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from varcalc.symbolic.instructions import interpret
from varcalc.symbolic.tracing import Expression
from varcalc.symbolic.variation import LEAST_POWER, LOCAL, SEEN_FROM_AFAR, VARYING

OFF_CENTRE = 0.5
"""Added to u in arsinh u: what is odd or even in time has a series with gaps, and what looks ahead must have none."""
SOFT = 1e-9
"""Below that ln |u| is smooth: a run may go through u = 0 where nothing comes of it."""
POWERS = {ca.OP_POW, ca.OP_CONSTPOW}
BY_SIZE = {ca.OP_SQRT, ca.OP_LOG, ca.OP_INV}
LENGTHS = {ca.OP_HYPOT, ca.OP_ATAN2}
FROM_EDGES: dict[int, tuple[float, ...]] = {
    ca.OP_LOG1P: (-1.0,), ca.OP_ACOSH: (1.0,), ca.OP_ASIN: (-1.0, 1.0), ca.OP_ACOS: (-1.0, 1.0),
              ca.OP_ATANH: (-1.0, 1.0)}  # fmt: skip
"""Where the domain of an operation ends."""
RULES = {operation: rule for operation, rule in VARYING.items() if operation not in SEEN_FROM_AFAR}
"""How far arguments may go unseen, by operation; sines are seen from everywhere."""


def with_companions(system: ca.Function) -> ca.Function:
    """``(s, Y (N,), c) -> dY/ds`` with k states more: arsinh u, or ln |u| where u matters by factors.

    Their series end where the operation on u begins to matter. They begin at zero: only their rates count.
    """
    s, state, constants = (ca.SX.sym(name, system.numel_in(k)) for k, name in enumerate("sYc"))
    rates = ca.densify(system(s, state, constants))
    logarithms: list[Expression] = []
    arguments: list[Expression] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        for found, kept in zip(_watched(operation, operands), (arguments, logarithms), strict=True):
            for u in found:
                moves = ca.depends_on(u, ca.vertcat(s, state))
                if moves and not any(ca.is_equal(u, known, 8) for known in kept):
                    kept.append(u)
        return ca.SX.unary(operation, *operands) if len(operands) == 1 else ca.SX.binary(operation, *operands)

    interpret(system, [ca.vertsplit(s), ca.vertsplit(state), ca.vertsplit(constants)], ca.SX, applied)

    def rate(u: Expression) -> Expression:
        return ca.jtimes(u, state, rates) + ca.jacobian(u, s)

    by_size = [u * rate(u) / (u**2 + SOFT**2) for u in logarithms]
    on_own_scale = [rate(u) / ca.sqrt(1 + (u + OFF_CENTRE) ** 2) for u in arguments]
    count = len(by_size) + len(on_own_scale)
    longer = ca.SX.sym("Z", state.numel() + count)
    all_rates = ca.substitute(ca.vertcat(rates, *by_size, *on_own_scale), state, longer[: state.numel()])
    return ca.Function("with_companions", [s, longer, constants], [ca.densify(all_rates)], {"cse": True})


def _watched(operation: int, operands: Sequence[Expression]) -> tuple[list[Expression], list[Expression]]:
    """The arguments of an operation that matter by their value, and those that matter by their size."""
    a, b = operands[0], operands[-1]
    if operation not in RULES:
        return [], []
    if operation in POWERS:
        whole = b.is_constant() and float(b).is_integer() and 0 <= float(b) < LEAST_POWER
        return ([] if b.is_constant() else [b]), ([] if whole else [a])
    if operation in LENGTHS:
        return [], [a**2 + b**2]
    if operation in FROM_EDGES:
        return [], [a - edge for edge in FROM_EDGES[operation]]
    if operation == ca.OP_DIV:
        return [], [b]
    return ([a], []) if operation in LOCAL else ([], [a])
