"""Light rays in n = n0 sqrt(2 - (r/R)^2), Luneburg's lens: ellipses about the centre.

    S[q] = integral of n |dq|,  or, in polar coordinates,  S[r] = integral of n sqrt(r^2 + r'^2) dtheta

In units of R and with dsigma = n0 ds/n the ray equation is r'' = -r, so that
r = A cos(sigma) + p sin(sigma), |p|^2 = 2 - |A|^2: an ellipse,
r^2 = r0^2 (1 + e)/(1 + e cos(2 theta)) from its axis. For given ends c = cos(sigma)
solves 2 c^2 - 2 (A.B) c + |A|^2 + |B|^2 - 2 = 0, the greater root being the
shorter ray, and S = n0 R (sigma + sin(sigma) (c - A.B)).

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.4.2
and problem 8; Luneburg, "Mathematical Theory of Optics".
"""

import math
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._roots import increasing_root

SOURCE = 'Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.4.2 and problem 8'
N0, R = 1.5, 2.0
START, END = (2.0, 0.0), (0.5, 1.75)
A, B = np.array(START) / R, np.array(END) / R
DOT = float(A @ B)
COSINE = (DOT + math.sqrt(DOT**2 - 2 * float(A @ A + B @ B - 2))) / 2
SIGMA = math.acos(COSINE)
P = (B - A * COSINE) / math.sin(SIGMA)


def speed(q, dq, p):
    return p.n0 * ca.sqrt(2 - ca.sumsqr(q) / p.R**2) * ca.norm_2(dq)


def polar_length(x, y, dy, p):
    return p.n0 * ca.sqrt(2 - (y / p.R) ** 2) * ca.sqrt(y**2 + dy**2)


def path(sigma: Any) -> np.ndarray:
    """Optical path up to sigma, in units of n0 R: the integral of 2 - r^2."""
    s, c = np.sin(sigma), np.cos(sigma)
    return sigma - (A @ A - 1) * s * c - (A @ P) * s**2


def q(t: Any) -> np.ndarray:
    """The point a fraction t of the optical path along."""
    t = np.asarray(t, dtype=float)

    def covered(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = np.multiply.outer(A, np.cos(sigma)) + np.multiply.outer(P, np.sin(sigma))
        return path(sigma), 2 - (point**2).sum(axis=0)

    sigma = increasing_root(covered, 0.0, SIGMA, t * path(SIGMA))
    return R * (np.multiply.outer(A, np.cos(sigma)) + np.multiply.outer(P, np.sin(sigma)))


def radius(theta: Any) -> np.ndarray:
    """The distance from the centre at a polar angle, counted from the start."""
    c, s = np.cos(theta), np.sin(theta)
    sigma = np.arctan2(A[0] * s, P[1] * c - P[0] * s)
    return R * np.hypot(A[0] * np.cos(sigma) + P[0] * np.sin(sigma), P[1] * np.sin(sigma))


OPTICAL_PATH = N0 * R * float(SIGMA + math.sin(SIGMA) * (COSINE - DOT))

references = (
    vc.Reference(
        name="elliptic_ray",
        problem=vc.Problem(
            polar_length,
            vc.Fixed(0, START[0]),
            vc.Fixed(math.atan2(END[1], END[0]), math.hypot(*END)),
            parameters={"n0": N0, "R": R},
        ),
        exact=vc.Exact(OPTICAL_PATH, radius, "ellipse"),
        source=SOURCE,
        statement="A light ray in n0 sqrt(2 - (r/R)^2), in polar coordinates.",
    ),
    vc.Reference(
        name="elliptic_ray/curve",
        problem=vc.Curve(speed, vc.At(START), vc.At(END), parameters={"n0": N0, "R": R}),
        exact=vc.Exact(OPTICAL_PATH, q, "ellipse"),
        source=SOURCE,
        statement="The same light ray as a curve in the plane.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
)
