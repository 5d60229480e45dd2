"""The cross-section of soft spheres, over the angle of deflection, for n² = 1 + U0/E small and large.

A soft sphere is one of the refractive index n: σ = b |db/dΘ|/sin Θ of rays that go through it, the line by
σ = (n² R²/4) |(n cos Θ/2 - 1)(n - cos Θ/2)|/(cos Θ/2 (1 + n² - 2 n cos Θ/2)²).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 5.8 and eq. 5.36.
"""

import numpy as np

from varcalc import optics
from varcalc.study.drawing import Drawing, Line, Panel, Points

SOFT, HARD, STEP = (1.1, 1.15), (10.0, 20.0, 50.0, 1000.0), 1e-4
IMPACTS = np.linspace(0.06, 0.97, 14)


def deflections(n, impacts):
    """Angles (m,) by which rays in the plane are turned by a sphere of the radius 1 and the index ``n``."""
    sphere = optics.Sphere(center=(0.0, 0.0), radius=1.0)
    scene = optics.Scene([optics.Uniform(1.0), optics.Uniform(n), optics.Uniform(1.0)], [sphere, sphere])
    points = np.column_stack([np.full(len(impacts), -2.0), impacts])
    bundle = scene.trace(points, np.tile([1.0, 0.0], (len(impacts), 1)), optical_path=5.0 + 2 * n)
    return np.abs(np.arctan2(bundle.directions[:, 1], bundle.directions[:, 0]))


def parts(indices):
    """A line and dots for each index, σ in units of R²/4."""
    found = []
    for number, n in enumerate(indices):
        most = 2 * np.arccos(1 / n)
        angles = np.linspace(0.0, min(most, 3.1), 400)
        c = np.cos(angles / 2)
        line = n**2 * np.abs((n * c - 1) * (n - c)) / (c * (1 + n**2 - 2 * n * c) ** 2)
        before, after = (deflections(n, IMPACTS * (1 + sign * STEP)) for sign in (-1, 1))
        middle = (before + after) / 2
        sigma = 4 * IMPACTS * np.abs(2 * STEP * IMPACTS / (after - before)) / np.sin(middle)
        found += [Line(angles, line, label=f"n = {n:g}", colour=number), Points(middle, sigma, colour=number)]
    return found


def panels():
    """Soft spheres on the left, nearly hard ones on the right."""
    return [[
        Panel(parts(SOFT), "Θ", "4 σ/R²", title="soft", logarithmic=True),
        Panel(parts(HARD), "Θ", "4 σ/R²", title="nearly hard", within=(0.0, np.pi, 0.0, 1.6)),
    ]]  # fmt: skip


figure = Drawing("Soft-sphere scattering", panels)
