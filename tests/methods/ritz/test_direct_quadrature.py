"""What a Gauss sum misses, told from its own samples, against integrals in closed form."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.error import shortfall
from varcalc.numerics.mesh import gauss


def summed(function, vertices, count):
    """The composite Gauss sum, its samples (elements, points), and the sum of absolute contributions."""
    nodes, weights = gauss(count)
    half = 0.5 * np.diff(vertices)
    samples = function(vertices[:-1, None] + half[:, None] * (1 + nodes))
    return float(half @ (samples @ weights)), samples, float(half @ (np.abs(samples) @ weights))


def runge(x):
    return 1 / (1 + 25 * x**2)


def kink(x):
    return np.abs(x - 1 / 3)


def root(x):
    return np.sqrt(x + 1)


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (np.exp, math.e - 1 / math.e),
        (runge, 0.4 * math.atan(5)),
        (kink, 10 / 9),
        (root, 2 / 3 * 2**1.5),
    ],
    ids=["entire", "poles", "kink", "branch point at an end"],
)
@pytest.mark.parametrize("count", [5, 8, 13, 26])
@pytest.mark.parametrize("elements", [1, 3])
def test_the_sum_and_what_it_misses_are_the_integral(function, exact, count, elements):
    vertices = np.linspace(-1, 1, elements + 1)
    total, samples, scale = summed(function, vertices, count)
    assert total + shortfall(function, vertices, samples, scale) == pytest.approx(exact, rel=1e-13)


def test_a_resolved_integrand_is_not_sampled_again():
    vertices = np.array([-1.0, 1.0])
    _, samples, scale = summed(np.exp, vertices, 14)
    asked = []
    assert shortfall(asked.append, vertices, samples, scale) == 0.0
    assert not asked


def test_noise_comes_to_an_end():
    noise = np.random.default_rng(0)
    vertices = np.linspace(0, 1, 9)
    asked = []

    def sampled(x):
        asked.append(len(x))
        return noise.standard_normal(len(x))

    assert math.isfinite(shortfall(sampled, vertices, noise.standard_normal((8, 10)), 1.0))
    assert sum(asked) < 1e6


@pytest.mark.parametrize("optimiser", [vc.Newton(), vc.Ipopt()])
@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("elements", [1, 2, 3])
def test_no_kept_mesh_reports_less_than_the_minimum(elements, degree, optimiser):
    # the root has branch points 1e-2 from the real axis, between the points of every rule here
    problem = vc.Problem(lambda x, y, v: ca.sqrt(1e-4 + (v - 6 * x**5) ** 2), vc.Fixed(-1, 1), vc.Fixed(1, 1))
    method = vc.Ritz(elements, degree, refine=False, optimiser=optimiser)
    solution = method.solve(formulate(problem), tol=1e-10, guess=None)  # the ladder would go over to a finer mesh
    if solution.status.ok:
        # y = x^6 makes the root least at every point
        assert solution.value >= 2e-2 * (1 - 1e-13)


def test_a_level_is_settled_with_its_multiplier():
    # the greatest area over [-1, 1] under an arc of length pi/2 sqrt 2 is a quarter circle's; the length has branch
    # points near the steep ends, which the rule of a coarse mesh does not resolve
    problem = vc.Problem(
        lambda x, y, v: y, vc.Fixed(-1, 0), vc.Fixed(1, 0),
        [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), 0.999 * math.pi)], maximise=True,
    )  # fmt: skip
    half_angle = 0.5 * math.pi
    for _ in range(60):  # chord 2 = 2 r sin a, length 2 r a
        half_angle -= (0.999 * math.pi * math.sin(half_angle) - 2 * half_angle) / (
            0.999 * math.pi * math.cos(half_angle) - 2
        )
    radius = 1 / math.sin(half_angle)
    area = radius**2 * (half_angle - math.sin(half_angle) * math.cos(half_angle))
    for elements, degree in [(2, 4), (2, 8), (4, 4), (4, 6)]:
        solution = vc.solve(problem, vc.Ritz(elements, degree, refine=False), throw=False)
        if solution.status.ok:
            assert abs(solution.value - area) <= 2 * solution.error.value
