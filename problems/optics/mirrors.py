"""Mirrors, plane and curved, in the plane and in space: equal angles, and paths that are stationary, not always least.

Within a circle light comes from a to b by as many as four points of the mirror (Alhazen's problem). In complex numbers
they are the roots z on the unit circle of conj(ab) z⁴ - conj(a + b) z³ + (a + b) z - ab; the longest of the paths is a
maximum among those by neighbouring points. A plane mirror shows b behind it.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.3.1; M. Born, E. Wolf,
"Principles of Optics", sect. 3.2.2; P. M. Neumann, Amer. Math. Monthly 105 (1998) 523, for Alhazen's problem.
"""

import numpy as np

from varcalc import optics

A, B = (-0.55, 0.2), (0.5, 0.15)
circle = optics.Sphere((0.0, 0.0), 1.0, mirror=True)


def alhazen():
    """The points of the circle at which light is reflected from A to B, as complex numbers; and A and B."""
    a, b = complex(*A), complex(*B)
    roots = np.roots([np.conj(a * b), -np.conj(a + b), 0, a + b, -a * b])
    return roots[np.abs(np.abs(roots) - 1) < 1e-9], a, b


def paths(scene):
    """The optical paths of all rays by the circle, against the roots."""
    z, a, b = alhazen()
    rays = scene.rays(A, B)
    known = np.sort(np.abs(z - a) + np.abs(z - b))
    return np.abs(np.array([ray.optical_path for ray in rays]) - known).max() if len(rays) == len(known) else np.inf


def equal_angles(scene):
    """The tangents before and behind the mirror: what is along the normal turns round, the rest stays."""
    worst = 0.0
    for ray in scene.rays(A, B):
        hit = ray.point(ray.legs[0].at(np.array([ray.legs[0].length])).optical_path[0])
        normal, (before, behind) = hit / np.linalg.norm(hit), ray.tangents
        worst = max(worst, np.abs(before - 2 * normal * (before @ normal) - behind).max())
    return worst


def longest_is_a_maximum(scene):
    """By how much the path by a neighbouring point of the circle is longer than the longest ray: by nothing."""
    z, a, b = alhazen()
    far = z[np.argmax(np.abs(z - a) + np.abs(z - b))] * np.exp(1j * np.linspace(-0.3, 0.3, 101))
    return max(0.0, float((np.abs(far - a) + np.abs(far - b)).max()) - scene.rays(A, B)[-1].optical_path)


def in_space(_):
    """A sphere and a slanted plane in space: the path to an image, and tangents of rays that are reflected at both."""
    normal, foot = np.array([1.0, 2.0, -2.0]) / 3, np.array([0.1, 0.3, -1.0])
    a, b = np.array([0.3, 0.5, -2.1]), np.array([-0.4, 1.2, -1.9])
    plane = optics.Plane(tuple(foot.tolist()), tuple(normal.tolist()), mirror=True)
    (ray,) = optics.Scene(optics.Uniform(1.0), plane).rays(a, b)
    image = b - 2 * normal * ((b - foot) @ normal)
    path = abs(ray.optical_path - np.linalg.norm(image - a))
    start, heading = np.array([0.2, -0.1, 0.3]), np.array([0.48, 0.6, 0.64])
    sphere = optics.Sphere((0.0, 0.0, 0.0), 1.0, mirror=True)
    way = start @ heading
    hit = start + (np.sqrt(way**2 + 1 - start @ start) - way) * heading
    end = optics.Scene(optics.Uniform(1.0), sphere).trace(start, heading, optical_path=2.0)
    left = 2.0 - np.linalg.norm(hit - start)
    back = heading - 2 * hit * (heading @ hit)
    return max(path, np.abs(end.points[0] - hit - left * back).max(), np.abs(end.directions[0] - back).max())


study = optics.Study(
    optics.Scene(optics.Uniform(1.0), circle),
    optics.PointSource(A),
    24,
    optical_path=2.6,
    receiver=B,
    title="A circular mirror",
    known={
        "paths by the circle (Alhazen)": paths,
        "equal angles at the circle": equal_angles,
        "the longest path is a maximum": longest_is_a_maximum,
        "plane and sphere in space": in_space,
    },
)
