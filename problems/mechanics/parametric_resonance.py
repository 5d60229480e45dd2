"""Parametric resonance: an oscillator whose stiffness goes up and down about twice in a period.

x'' + w0² (1 + h cos((2 w0 + e) t)) x = 0 grows with √((h w0/2)² - e²)/2, to first order in h. With τ = (w0 + e/2) t it
is Mathieu's equation x'' + (a - 2 q cos 2τ) x = 0, and its resonances lie between its characteristic values.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 27; N. W. McLachlan, "Theory and Application of
Mathieu Functions" (1947), ch. 2, 4.
"""

import casadi as ca
import numpy as np
from scipy.special import mathieu_a, mathieu_b

from varcalc import mechanics

OWN = 1.3
mathieu = mechanics.System(
    lambda t, q, v, p: (v[0] ** 2 - (p.a - 2 * p.q * ca.cos(2 * t)) * q[0] ** 2) / 2, ("x",),
    parameters={"a": 1.0, "q": 1.3}, name="Mathieu's equation",
)  # fmt: skip
swing = mechanics.System(
    lambda t, q, v, p: (v[0] ** 2 - OWN**2 * (1 + p.h * ca.cos((2 + p.share * p.h / 2) * OWN * t)) * q[0] ** 2) / 2,
    ("x",), parameters={"h": 0.0, "share": 0.0},
)  # fmt: skip


def boundaries():
    """How far those for q = 1.3 are from Mathieu's characteristic values."""
    chart = mechanics.stability_chart(mathieu, [0.0], np.pi, {"a": np.linspace(-2, 6, 40)})
    known = np.sort([mathieu_a(0, 1.3), mathieu_b(1, 1.3), mathieu_a(1, 1.3), mathieu_b(2, 1.3), mathieu_a(2, 1.3)])
    found = chart.boundaries.places[:, 0]
    return np.abs(found - known).max() if len(found) == len(known) else 1.0


def multipliers():
    """How far their product is from 1, and outside a resonance they are from the unit circle."""
    inside, outside = (mathieu.with_parameters({"a": a, "q": 0.5}).floquet([0.0], np.pi) for a in (1.0, 2.5))
    off = max(abs(abs(np.prod(one.multipliers)) - 1) for one in (inside, outside))
    circle = np.abs(np.abs(outside.multipliers) - 1).max()
    told = (inside.stable, outside.stable, sorted(outside.signatures)) == (False, True, [-1, 1])
    return max(off, circle) + float(not told)


def growth():
    """Whether the first order in h misses as h² does, in the middle and to the side: the order less 2, beyond 0.1."""
    h, share = np.array([0.01, 0.02, 0.04]), np.array([-0.5, 0.0, 0.6])
    chart = mechanics.stability_chart(
        swing, [0.0], lambda p: 2 * np.pi / ((2 + p.share * p.h / 2) * OWN), {"h": h, "share": share}
    )
    first_order = OWN * h[:, None] / 4 * np.sqrt(1 - share**2)
    misses = np.abs(chart.growth - first_order)
    return max(0.0, float((1.9 - np.log2(misses[1:] / misses[:-1])).max()))


experiment = mechanics.Examination(
    "Parametric resonance", {"boundaries": boundaries, "multipliers": multipliers, "growth": growth}
)
