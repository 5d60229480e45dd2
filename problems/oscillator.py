"""The action of harmonic oscillators: least while the time is shorter than half a period.

    S[q] = half the integral of (q'^2 - w^2 q^2) dt

from a to b in the time T is stationary on
q = (a sin(w (T - t)) + b sin(w t))/sin(w T), where
S = w ((a^2 + b^2) cos(w T) - 2 a b)/(2 sin(w T)); a minimum for w T < pi. An end that
is free comes to rest: q = a cos(w (T - t))/cos(w T), S = -w a^2 tan(w T)/2, a
minimum for w T < pi/2.

Source: Feynman and Hibbs, "Quantum Mechanics and Path Integrals", problem 2-2;
Gelfand and Fomin, "Calculus of Variations", sect. 6 (free ends) and ch. 5 (minima).
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable

SOURCE = 'Feynman and Hibbs, "Quantum Mechanics and Path Integrals", problem 2-2'
FREE_END = 'Gelfand and Fomin, "Calculus of Variations", sect. 6'
SLOW, FAST = 0.5, 1.3


def action(x, y, dy):
    return (dy**2 - y**2) / 2


def anisotropic(x, y, dy, p):
    return (ca.sumsqr(dy) - (p.w1 * y[0]) ** 2 - (p.w2 * y[1]) ** 2) / 2


def motion(t: Any, w: float, T: float, a: float, b: float) -> np.ndarray:
    t = np.asarray(t, dtype=float)
    return (a * np.sin(w * (T - t)) + b * np.sin(w * t)) / math.sin(w * T)


def least_action(w: float, T: float, a: float, b: float) -> float:
    return w * ((a**2 + b**2) * math.cos(w * T) - 2 * a * b) / (2 * math.sin(w * T))


def released(t: Any, w: float, T: float, a: float) -> np.ndarray:
    return a * np.cos(w * (T - np.asarray(t, dtype=float))) / math.cos(w * T)


def released_action(w: float, T: float, a: float) -> float:
    return -w * a**2 * math.tan(w * T) / 2


references = (
    vc.Reference(
        name="oscillator",
        problem=vc.Problem(action, vc.Fixed(0, 0), vc.Fixed(2, 1)),
        exact=vc.Exact(least_action(1, 2, 0, 1), lambda x: motion(x, 1, 2, 0, 1), "sine"),
        source=SOURCE,
        statement="The motion of an oscillator from 0 to 1 in less than half a period.",
    ),
    vc.Reference(
        name="oscillator/anisotropic",
        problem=vc.Problem(
            anisotropic, vc.Fixed(0, (1, 0.5)), vc.Fixed(2, (0.5, -1)), parameters={"w1": 1.0, "w2": FAST}
        ),
        exact=vc.Exact(
            least_action(1, 2, 1, 0.5) + least_action(FAST, 2, 0.5, -1),
            lambda x: np.array([motion(x, 1, 2, 1, 0.5), motion(x, FAST, 2, 0.5, -1)]),
            "Lissajous curve",
        ),
        source=SOURCE,
        statement="The motion of an anisotropic oscillator in the plane.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="oscillator/released",
        problem=vc.Problem(action, vc.Fixed(0, 1), vc.Free(1)),
        exact=vc.Exact(released_action(1, 1, 1), lambda x: released(x, 1, 1, 1), "cosine"),
        source=FREE_END,
        statement="The motion of an oscillator to a free end.",
    ),
    vc.Reference(
        name="oscillator/half_released",
        problem=vc.Problem(
            anisotropic, vc.Fixed(0, (1, 1)), vc.Fixed(2, (0.5, None)), parameters={"w1": 1.0, "w2": SLOW}
        ),
        exact=vc.Exact(
            least_action(1, 2, 1, 0.5) + released_action(SLOW, 2, 1),
            lambda x: np.array([motion(x, 1, 2, 1, 0.5), released(x, SLOW, 2, 1)]),
            "sine and cosine",
        ),
        source=FREE_END,
        statement="The motion of an anisotropic oscillator to an end of which one coordinate is free.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
