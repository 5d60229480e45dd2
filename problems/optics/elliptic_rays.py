"""Rays in n = n0 √(2 - (r/R)²) are ellipses about the centre.

Bouguer's n r sin φ is kept; with e² = 1 - (n r sin φ/(n0 R))² the ray that leaves its nearest point r0 at θ = 0 is
r² = r0² (1 + e)/(1 + e cos 2θ), r0 = R √(1 - e), and its angle with the radius is given by
sin φ = (1 + e cos 2θ)/√(1 + e² + 2e cos 2θ), a right angle at θ = 0 and π/2 (problem 8).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.4.2, eq. 1.45, problem 8.
"""

import numpy as np

from varcalc import optics

N0, R, E = 1.2, 2.0, 0.45
NEAREST = R * np.sqrt(1 - E)


def radius(theta):
    """r(θ)."""
    return NEAREST * np.sqrt((1 + E) / (1 + E * np.cos(2 * theta)))


def ray_of(scene):
    """The ray to a point three quarters round, its places in polar coordinates, its directions."""
    theta = 4.0
    end = radius(theta) * np.array([np.cos(theta), np.sin(theta)])
    (ray,) = (r for r in scene.rays((NEAREST, 0.0), end, within=20.0) if abs(r.tangents[0][1] - 1) < 1e-9)
    s = np.linspace(0.0, ray.optical_path, 301)
    x, y = ray.point(s).T
    return np.hypot(x, y), np.unwrap(np.arctan2(y, x)), ray.tube.direction(s)


def ellipse(scene):
    """r²(θ)."""
    r, theta, _ = ray_of(scene)
    return np.abs(r**2 - radius(theta) ** 2).max() / R**2


def angle(scene):
    """The sine of the angle between the radius and the ray."""
    _, theta, ahead = ray_of(scene)
    sine = np.cos(theta) * ahead[:, 1] - np.sin(theta) * ahead[:, 0]
    known = (1 + E * np.cos(2 * theta)) / np.sqrt(1 + E**2 + 2 * E * np.cos(2 * theta))
    return np.abs(sine - known).max()


study = optics.Study(
    optics.Scene(optics.Radial(lambda r: N0 * np.sqrt(2 - (r / R) ** 2))),
    optics.PointSource((NEAREST, 0.0)),
    [(np.cos(a), np.sin(a)) for a in np.linspace(0.3, np.pi - 0.3, 15)],
    optical_path=9.0,
    title="n = n0 √(2 - (r/R)²)",
    known={"r²(θ)": ellipse, "angle with the radius, problem 8": angle},
)
