"""A free symmetric top: ω goes round its axis by the body cone, the axis round the momentum by the space cone.

ω1 + i ω2 = ω0 exp(i n t) with n = ω3 (I3/I1 - 1); the axis turns about L at the rate L/I1, at the angle whose tangent
is I1/I3 times that of the angle between ω and the axis.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 7.2.2; L. D. Landau,
E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 33.
"""

import numpy as np

from varcalc import mechanics

ACROSS, ALONG, OMEGA = 1.0, 1.7, np.array([0.6, 0.0, 2.0])
TIMES = np.linspace(0.0, 40.0, 401)
body = mechanics.RigidBody([ACROSS, ACROSS, ALONG])
cones = body.cones(OMEGA)
# the momentum is upright: then θ is the angle of the space cone's axis, and φ turns evenly
start = mechanics.EulerAngles(0.0, np.arctan2(ACROSS * OMEGA[0], ALONG * OMEGA[2]), np.pi / 2)


def moved():
    """The motion over twenty turns."""
    return body.motion(start, OMEGA, (TIMES[0], TIMES[-1]))


def body_cone():
    """ω seen from the body."""
    known = OMEGA[0] * np.exp(1j * OMEGA[2] * (ALONG / ACROSS - 1) * TIMES)
    return np.abs(moved().angular_velocity(TIMES) - [known.real, known.imag, np.full(len(TIMES), OMEGA[2])]).max()


def space_cone():
    """The axis in space."""
    size = np.hypot(ACROSS * OMEGA[0], ALONG * OMEGA[2])
    phi, theta = size / ACROSS * TIMES, start.theta
    known = [np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi), np.full(len(TIMES), np.cos(theta))]
    return np.abs(moved().rotation(TIMES)[:, 2] - known).max()


def angles():
    """The angles of the cones."""
    return abs(np.tan(cones.momentum_angle) - ACROSS / ALONG * np.tan(cones.body_angle))


experiment = mechanics.Examination(
    "A free symmetric top", {"body cone": body_cone, "space cone": space_cone, "angles": angles}
)
