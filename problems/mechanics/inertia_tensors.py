"""Inertia tensors of points and simple solids: cube, dumb-bell, plate and cone, about any point and their own axes.

Cube about a corner: M b²/12 times 8 and -3. Dumb-bell of two m at ±b e: 2 m b² (1 - e e), one moment of which is zero.
Plate about a corner: principal axes turned by arctan(2 C/(B - A))/2. Cone: 3 M (H² + R²/4)/5 about its vertex.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 7.1 and problems 1 and 3.
"""

import numpy as np

from varcalc import mechanics

M, A, B = 1.7, 0.6, 1.1
TILT, TURN = 0.7, 2.1


def cube():
    """About a corner, by parallel axes, and about its middle."""
    solid, unit = mechanics.Inertia.box(M, A, A, A), M * A**2 / 12
    corner = unit * (11 * np.eye(3) - 3)
    return max(np.abs(solid.about([A / 2] * 3) - corner).max(), np.abs(solid.tensor - 2 * unit * np.eye(3)).max())


def dumbbell():
    """Two masses on a tilted line: the tensor, its moments, and the axis without one."""
    e = np.array([np.sin(TILT) * np.cos(TURN), np.sin(TILT) * np.sin(TURN), np.cos(TILT)])
    found = mechanics.Inertia.points([M, M], [A * e, -A * e])
    wrong = found.tensor - 2 * M * A**2 * (np.eye(3) - np.outer(e, e))
    axis = found.principal.axes[:, 0]
    moments = found.principal.moments - 2 * M * A**2 * np.array([0, 1, 1])
    return max(np.abs(wrong).max(), np.abs(moments).max(), np.linalg.norm(np.cross(axis, e)))


def plate():
    """About a corner, and the angle of its principal axes there."""
    corner = mechanics.Inertia.plate(M, A, B).about([-A / 2, -B / 2, 0])
    a, b, c = M * B**2 / 3, M * A**2 / 3, M * A * B / 4
    known = [[a, -c, 0], [-c, b, 0], [0, 0, a + b]]
    angle = np.arctan2(2 * c, b - a) / 2
    turned = (
        mechanics.EulerAngles(angle, 0.0, 0.0).rotation.T @ corner @ mechanics.EulerAngles(angle, 0.0, 0.0).rotation
    )
    return max(np.abs(corner - known).max(), abs(turned[0, 1]))


def cone():
    """About its vertex and about its centre of mass."""
    solid = mechanics.Inertia.cone(M, A, B)
    vertex = 3 / 5 * M * np.diag([B**2 + A**2 / 4, B**2 + A**2 / 4, A**2 / 2])
    centre = 3 / 20 * M * np.diag([A**2 + B**2 / 4, A**2 + B**2 / 4, 2 * A**2])
    return max(np.abs(solid.about([0, 0, 0]) - vertex).max(), np.abs(solid.tensor - centre).max())


experiment = mechanics.Examination(
    "Inertia tensors", {"cube": cube, "dumb-bell": dumbbell, "plate": plate, "cone": cone}
)
