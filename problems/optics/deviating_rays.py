"""Neighbouring rays in a medium without any symmetry obey the ray deviation equation, eq. 1.51.

By the length along the ray, with t its direction and Ξ the deviation, Jacobi's equation of n|dx| is
d/ds(n (1 - tt) Ξ' + (Ξ·∇n) t) = (t·Ξ') ∇n + (Ξ·∇)∇n. It does not say how far neighbours are ahead, which may be chosen:
t·Ξ' = 0. Then t times what stands in the bracket is Ξ·∇n all along. It is integrated here by itself, and compared with
the library's spreading and with rays close by.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.4.3, eq. 1.50-1.51.
"""

from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from varcalc import optics

LENGTH = 3.0
START, HEADING = np.array([-1.3, 0.2, 0.1]), np.array([0.8, 0.36, 0.48])


def index(x, y, z):
    return 1.4 + 0.3 * ca.exp(-(x**2) - 2 * y**2) * ca.cos(z) + 0.1 * x * y - 0.05 * ca.sin(2 * z + x)


_r = ca.SX.sym("r", 3)
_n = index(_r[0], _r[1], _r[2])
_derivatives = ca.Function("n", [_r], [_n, ca.gradient(_n, _r), ca.hessian(_n, _r)[0]])


def rates(_, state):
    """d/ds of place, direction, optical path, and two deviations with their momenta."""
    n, gradient, hessian = (np.array(value) for value in _derivatives(state[:3]))
    n, gradient, t = n.item(), gradient.ravel(), state[3:6]
    out = [t, (gradient - t * (t @ gradient)) / n, [n]]
    for first in (7, 13):
        moved, pushed = state[first : first + 3], state[first + 3 : first + 6]
        out += [(pushed - t * (t @ pushed)) / n, hessian @ moved]
    return np.concatenate(out)


def deviations():
    """The end of the ray of length 3 by eq. 1.40 and 1.51: place, direction, optical path, deviations, what is kept."""
    across = np.linalg.svd(HEADING[None])[2][1:]
    n = float(_derivatives(START)[0])
    pushed = [np.concatenate([np.zeros(3), n * one]) for one in across]
    begin = np.concatenate([START, HEADING, [0.0], *pushed])
    end = solve_ivp(rates, (0, LENGTH), begin, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    gradient = np.array(_derivatives(end[:3])[1]).ravel()
    moved = end[[7, 8, 9, 13, 14, 15]].reshape(2, 3)
    kept = [end[10:13] @ end[3:6] - end[7:10] @ gradient, end[16:19] @ end[3:6] - end[13:16] @ gradient]
    return end[:3], end[3:6], end[6], moved, np.abs(kept).max()


def traced(scene):
    """The place and the direction at the end, and the area between the neighbours."""
    place, ahead, path, moved, kept = deviations()
    bundle = scene.trace(START, HEADING, optical_path=path, with_spreading=True)
    area = abs(np.linalg.det(np.vstack([moved, ahead])))
    missed = np.abs(bundle.points[0] - place).max(), np.abs(bundle.directions[0] - ahead).max()
    return max(*missed, abs(bundle.spreading[0] - area) / area, kept)


def close_by(scene):
    """The same area from rays a little beside, their differences made better by halving (Richardson)."""
    _, ahead, path, moved, _ = deviations()
    across = np.linalg.svd(HEADING[None])[2][1:]
    projected = np.linalg.svd(ahead[None])[2][1:]

    def differences(h):
        turned = [np.cos(h) * HEADING + way * np.sin(h) * one for one in across for way in (1, -1)]
        ends = scene.trace(START, turned, optical_path=path).points
        return (ends[::2] - ends[1::2]) / (2 * h) @ projected.T

    halved = [differences(h) for h in (0.016, 0.008, 0.004)]
    better = [(4 * fine - rough) / 3 for rough, fine in pairwise(halved)]
    known = moved @ projected.T
    return np.abs((16 * better[1] - better[0]) / 15 - known).max() / np.abs(known).max()


study = optics.Study(
    optics.Scene(optics.Graded(index)),
    optics.PointSource(tuple(START)),
    [HEADING + 0.15 * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0, 2 * np.pi, 13)[:-1]],
    optical_path=5.0,
    title="A medium without symmetry",
    known={"eq. 1.51 along a ray": traced, "rays close by": close_by},
)
