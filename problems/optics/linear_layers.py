"""Rays where the index falls linearly, n = n0 (1 - β y): catenaries hanging upside down.

With φ the angle of the ray, y = (1 - cos φ0/cos φ)/β and x = -(cos φ0/β) ln((sec φ + tan φ)/(sec φ0 + tan φ0)), which
are eq. 1.36 and 1.37. The ray turns at φ = 0, and its curvature is |k × ∇ ln n| = β cos² φ/cos φ0 (problem 6).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.3.3, eq. 1.35-1.38, problem 6.
"""

from itertools import pairwise

import numpy as np

from varcalc import optics

N0, BETA, ANGLE = 1.5, 0.4, np.pi / 3


def parametric(angle):
    """x and y of the ray where its angle is ``angle``."""
    climbed = np.arcsinh(np.tan(angle)) - np.arcsinh(np.tan(ANGLE))
    return -np.cos(ANGLE) / BETA * climbed, (1 - np.cos(ANGLE) / np.cos(angle)) / BETA


END = parametric(-0.8)


def ray_of(scene):
    """The ray that leaves at 60°, of those to a point on it behind the turning point; optical paths along it."""
    (ray,) = (ray for ray in scene.rays((0.0, 0.0), END) if abs(ray.tangents[0][0] - np.cos(ANGLE)) < 1e-6)
    return ray, np.linspace(0.0, ray.optical_path, 401)


def form(scene):
    """The points of the ray by their angles."""
    ray, s = ray_of(scene)
    ahead = ray.tube.direction(s)
    return np.abs(ray.point(s) - np.column_stack(parametric(np.arctan2(ahead[:, 1], ahead[:, 0])))).max() * BETA


def turning_point(scene):
    """The top of the ray: where its direction is level."""
    ray, s = ray_of(scene)
    low, high = s[0], s[-1]
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if ray.tube.direction(middle)[1] > 0 else (low, middle)
    return np.abs(ray.point(low) - parametric(0.0)).max() * BETA


def curvature(scene):
    """dφ/ds of the angles as polynomials in the optical path, and |k × ∇ ln n|; ds = dS/n."""
    ray, s = ray_of(scene)

    def angle(at):
        return np.arctan2(*ray.tube.direction(at).T[::-1])

    parts = [np.polynomial.Chebyshev.interpolate(angle, 20, ends).deriv() for ends in pairwise(s[::25])]
    height, ahead = ray.point(s)[:, 1], ray.tube.direction(s)
    rate = np.concatenate([part(s[25 * k : 25 * k + 25]) for k, part in enumerate(parts)] + [parts[-1](s[-1:])])
    bent = -rate * N0 * (1 - BETA * height)
    across = ahead[:, 0] * BETA / (1 - BETA * height)
    known = BETA * np.cos(angle(s)) ** 2 / np.cos(ANGLE)
    return max(np.abs(bent - known).max(), np.abs(across - known).max()) / BETA


study = optics.Study(
    optics.Scene(optics.Stratified(lambda y: N0 * (1 - BETA * y))),
    optics.PointSource((0.0, 0.0)),
    [(np.cos(a), np.sin(a)) for a in np.linspace(0.2, 1.4, 13)],
    optical_path=4.0,
    receiver=END,
    title="n = n0 (1 - βy)",
    known={"parametric form, eq. 1.36-1.37": form, "turning point": turning_point, "curvature, problem 6": curvature},
)
