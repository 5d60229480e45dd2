"""Small oscillations about an equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.linalg

from varcalc.mechanics.lagrange import Lagrange

AT_REST = 1e-8
"""Of the terms of L_q: what is left of it at an equilibrium."""
ROUND_OFF = 1e-12
"""Of the largest squared frequency: less is a zero mode."""


@dataclass(frozen=True)
class NormalModes:
    """Angular ``frequencies`` (n,), ascending by their squares, ``shapes`` (n, n) by columns, and which are ``stable``.

    Of an unstable mode the frequency is the rate at which it grows.
    """

    frequencies: np.ndarray
    shapes: np.ndarray
    stable: np.ndarray


def normal_modes(lagrange: Lagrange, q0: np.ndarray, numbers: np.ndarray) -> NormalModes:
    """The modes of L_vv q'' = L_qq q about ``q0`` (Landau and Lifshitz, "Mechanics", sect. 23).

    Raises ValueError where ``q0`` is no equilibrium, and where gyroscopic terms couple the rates.
    """
    s = lagrange.symbols
    slope = ca.densify(ca.gradient(lagrange.value, s.q))
    parts = [slope, lagrange.mass, ca.densify(ca.jacobian(slope, s.q)), ca.densify(ca.jacobian(lagrange.momenta, s.q))]
    function = ca.Function("about", s.all, parts)
    pull, mass, stiffness, mixed = (np.array(part) for part in function(0.0, q0, np.zeros_like(q0), numbers))
    if np.abs(pull).max() > AT_REST * max(np.abs(stiffness).max(), 1e-300) * max(1.0, np.abs(q0).max()):
        raise ValueError(f"q0 = {q0} is no equilibrium: L_q is {pull.ravel()} there")
    if np.abs(mixed - mixed.T).max() > AT_REST * max(np.abs(mixed).max(), 1e-300):
        raise ValueError("L couples rates and coordinates (gyroscopic terms), for which these modes are not enough")
    squared, shapes = scipy.linalg.eigh(-stiffness, mass)
    squared[np.abs(squared) <= ROUND_OFF * np.abs(squared).max()] = 0.0
    return NormalModes(np.sqrt(np.abs(squared)), shapes, squared > 0)
