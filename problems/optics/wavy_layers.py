"""Layers without a closed form: n cos(angle) is kept, and the rest is a quadrature, eq. 1.33.

n = 1.2 + 0.3 sin(3y) exp(-y/2): the rays of a point to and fro between two turning points. How far they have come at a
height is the integral of α/√(n² - α²), α = n cos φ, taken here by a double-exponential rule that knows nothing of how
the library takes it; at a turning point the integrand is infinite.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 1.3.2, eq. 1.32-1.34; H.
Takahasi, M. Mori, Publ. RIMS 9 (1974) 721, for the rule.
"""

import numpy as np

from varcalc import optics

ANGLE = 0.22


def index(y):
    return 1.2 + 0.3 * np.sin(3 * y) * np.exp(-y / 2)


def turning_height(kept, low, high):
    """Where n = ``kept``, between two heights, bisected."""
    sign = np.sign(index(low) - kept)
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if (index(middle) - kept) * sign > 0 else (low, middle)
    return (low + high) / 2


def come(high):
    """How far the ray has come along the layers at a height, which may be the top: by tanh(π/2 sinh t)."""
    t = np.arange(-450, 451) * 0.01
    u = np.pi / 2 * np.sinh(t)
    weights = 0.01 * high * np.pi / 4 * np.cosh(t) / np.cosh(u) ** 2
    return float(np.sum(rate((TOP - high) + high / (1 + np.exp(2 * u))) * weights))


KEPT = index(0.0) * np.cos(ANGLE)
TOP = turning_height(KEPT, 0.6, 1.2)


def rate(down):
    """dx/dy so far below the top; n - α is told from its change since there."""
    y = TOP - down
    change = np.expm1(down / 2) * np.sin(3 * y) - 2 * np.cos(3 * TOP - 1.5 * down) * np.sin(1.5 * down)
    return KEPT / np.sqrt(0.3 * np.exp(-TOP / 2) * change * (index(y) + KEPT))


def snell(scene):
    """n cos φ along a ray."""
    (ray, *_) = scene.rays((0.0, 0.0), (2 * come(TOP), 0.0))
    s = np.linspace(0, ray.optical_path, 201)
    kept = index(ray.point(s)[:, 1]) * ray.tube.direction(s)[:, 0]
    return np.ptp(kept) / kept[0]


def half_way(scene):
    """x at the height 0.4, and back at 0 after the turning point."""
    heading = (np.cos(ANGLE), np.sin(ANGLE))
    over, level = (optics.Plane((0.0, y), (0.0, 1.0)) for y in (0.4, 0.0))
    up = scene.trace((0.0, 0.0), heading, until=over).points[0, 0]
    back = scene.trace((0.0, 0.0), heading, until=level).points[0, 0]
    whole = 2 * come(TOP)
    return max(abs(up - come(0.4)) / up, abs(back - whole) / whole)


study = optics.Study(
    optics.Scene(optics.Stratified(index)),
    optics.PointSource((0.0, 0.0)),
    [(np.cos(a), np.sin(a)) for a in np.linspace(-0.6, 0.6, 25)],
    optical_path=6.0,
    title="n = 1.2 + 0.3 sin(3y) exp(-y/2)",
    known={"n cos φ": snell, "x(y) by quadrature": half_way},
)
