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

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._arithmetic import cos, numbers, sin, tan

SOURCE = 'Feynman and Hibbs, "Quantum Mechanics and Path Integrals", problem 2-2'
FREE_END = 'Gelfand and Fomin, "Calculus of Variations", sect. 6'
SLOW, FAST = 0.5, 1.3


def action(x, y, dy):
    return (dy**2 - y**2) / 2


def anisotropic(x, y, dy, p):
    return (ca.sumsqr(dy) - (p.w1 * y[0]) ** 2 - (p.w2 * y[1]) ** 2) / 2


def motion(t: Any, w: Any, T: Any, a: Any, b: Any) -> Any:
    t = numbers(t)
    return (a * sin(w * (T - t)) + b * sin(w * t)) / sin(w * T)


def least_action(w: Any, T: Any, a: Any, b: Any) -> Any:
    return w * ((a**2 + b**2) * cos(w * T) - 2 * a * b) / (2 * sin(w * T))


def released(t: Any, w: Any, T: Any, a: Any) -> Any:
    return a * cos(w * (T - numbers(t))) / cos(w * T)


def released_action(w: Any, T: Any, a: Any) -> Any:
    return -w * a**2 * tan(w * T) / 2


def fixed(number: Callable[[float], Any]) -> tuple[Any, Any]:
    w, T = number(1), number(2)
    return least_action(w, T, 0, 1), lambda x: motion(x, w, T, 0, 1)


def let_go(number: Callable[[float], Any]) -> tuple[Any, Any]:
    w, T = number(1), number(1)
    return released_action(w, T, 1), lambda x: released(x, w, T, 1)


def lissajous(number: Callable[[float], Any]) -> tuple[Any, Any]:
    w, fast, T = number(1), number(FAST), number(2)
    value = least_action(w, T, 1, 0.5) + least_action(fast, T, 0.5, -1)
    return value, lambda x: np.array([motion(x, w, T, 1, 0.5), motion(x, fast, T, 0.5, -1)])


def half_let_go(number: Callable[[float], Any]) -> tuple[Any, Any]:
    w, slow, T = number(1), number(SLOW), number(2)
    value = least_action(w, T, 1, 0.5) + released_action(slow, T, 1)
    return value, lambda x: np.array([motion(x, w, T, 1, 0.5), released(x, slow, T, 1)])


references = (
    vc.Reference(
        name="oscillator",
        problem=vc.Problem(action, vc.Fixed(0, 0), vc.Fixed(2, 1)),
        exact=vc.Exact.of(fixed, "sine"),
        source=SOURCE,
        statement="The motion of an oscillator from 0 to 1 in less than half a period.",
    ),
    vc.Reference(
        name="oscillator/anisotropic",
        problem=vc.Problem(
            anisotropic, vc.Fixed(0, (1, 0.5)), vc.Fixed(2, (0.5, -1)), parameters={"w1": 1.0, "w2": FAST}
        ),
        exact=vc.Exact.of(lissajous, "Lissajous curve"),
        source=SOURCE,
        statement="The motion of an anisotropic oscillator in the plane.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="oscillator/released",
        problem=vc.Problem(action, vc.Fixed(0, 1), vc.Free(1)),
        exact=vc.Exact.of(let_go, "cosine"),
        source=FREE_END,
        statement="The motion of an oscillator to a free end.",
    ),
    vc.Reference(
        name="oscillator/half_released",
        problem=vc.Problem(
            anisotropic, vc.Fixed(0, (1, 1)), vc.Fixed(2, (0.5, None)), parameters={"w1": 1.0, "w2": SLOW}
        ),
        exact=vc.Exact.of(half_let_go, "sine and cosine"),
        source=FREE_END,
        statement="The motion of an anisotropic oscillator to an end of which one coordinate is free.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
