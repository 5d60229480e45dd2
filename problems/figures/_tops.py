import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Line, Panel, Points

TILT, PERIODS = 1.0, 6
top = mechanics.Top(I1=1.0, I3=1.0, Mgh=0.1)  # a = M g h I1/p_ψ² is 0.1 with p_ψ = 1


def panels(ratio):
    """θ over φ, and the axis on a sphere, of a top with this p_φ/p_ψ."""
    start = mechanics.EulerAngles(0.0, TILT, 0.0)
    rate = (ratio - np.cos(TILT)) / np.sin(TILT) ** 2
    omega = [0.0, rate * np.sin(TILT), 1.0]
    found = top.nutation(start, omega)
    motion = top.motion(start, omega, (0.0, PERIODS * found.period))
    times = np.linspace(*motion.span, 1201)
    angles, axis = motion.euler_angles(times), motion.rotation(times)[:, 2]
    phi = np.unwrap(angles.phi)
    limits = [Line([phi[0], phi[-1]], [theta, theta], dashed=True, colour=1) for theta in found.theta]
    return [[
        Panel([Line(phi, angles.theta, colour=0), *limits], "φ", "θ"),
        Panel([Line(*axis, colour=0), Points(*axis[:, :1], colour=1)], "x", "y", "z", sphere=True),
    ]]  # fmt: skip
