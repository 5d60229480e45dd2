"""The motion of a rigid body: its angular velocity against time, and the way of its third axis on the sphere."""

from __future__ import annotations

import numpy as np

from varcalc.mechanics import RigidMotion
from varcalc.study.drawing import Drawing, Line, Panel, Points

SAMPLES = 2001


def rigid_drawing(motion: RigidMotion) -> Drawing:
    """ω along the body's axes, and where its third axis points in space."""
    times = np.linspace(*motion.span, SAMPLES)
    turning = [
        Line(times, values, label=rf"$\omega_{number}$")
        for number, values in enumerate(motion.angular_velocity(times), start=1)
    ]
    axis = motion.rotation(times)[:, 2]
    course = Panel(turning, "t", "angular velocity")
    pointing = Panel([Line(*axis), Points(*axis[:, :1])], "x", "y", "z", title="the third axis", sphere=True)
    return Drawing("", lambda: [[course, pointing]])
