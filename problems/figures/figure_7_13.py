"""The effective potential W(u) of the heavy top, u = cos θ, for several α and β.

W = u + (α - β u)²/(1 - u²), from the Routhian, where p_φ = α I1 Ω and p_ψ = β I1 Ω with Ω² = 2 M g h/I1: infinite at
u = ±1 but where α = ±β, with one minimum.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 7.13.
"""

import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel

PAIRS = ((0.1, 0.2), (0.5, 0.5), (0.5, 1.0), (1.0, 1.0), (1.5, 1.0))
top = mechanics.Top(I1=2.0, I3=1.0, Mgh=1.0)  # Ω = 1
U = np.linspace(-0.999, 0.999, 801)


def potential(alpha, beta):
    """The energy of a top whose axis is at rest, less that of its spin."""
    momenta = {"phi": alpha * top.I1, "psi": beta * top.I1}
    theta = np.arccos(U)[None]
    return top.system.routhian(momenta).energies(theta, np.zeros_like(theta)) - momenta["psi"] ** 2 / (2 * top.I3)


def panels():
    """W over u."""
    lines = [Line(U, potential(*pair), label="α = {:g}, β = {:g}".format(*pair)) for pair in PAIRS]
    return [[Panel([*lines, Line(U, U, dashed=True, label="gravity alone")], "u = cos θ", "W", within=(-1, 1, -1, 5))]]


figure = Drawing("The effective potential of the heavy top", panels)
