"""Ends that slide where phi = 0 comes near in several places: the nearest is found, from wherever a solve begins."""

import re

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def two_bays(x, exp):
    """A shore with bays at 2 and 5."""
    return 3 - 2 * exp(-4 * (x - 2) ** 2) - 2.4 * exp(-4 * (x - 5) ** 2)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("begun", [4.0, 5.0])
def test_the_nearer_of_two_bays_is_found_from_the_other(begun, mirrored):
    """v^2/2 + 1/2 costs y^2/(2 x) + x/2 on the straight way to (x, y)."""
    sign = -1 if mirrored else 1
    shore = vc.OnCurve(lambda x, y: y - two_bays(sign * x, ca.exp), x=sign * begun)
    ends = (shore, vc.Fixed(0, 0)) if mirrored else (vc.Fixed(0, 0), shore)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + 0.5, *ends))
    x = np.linspace(1e-3, 8, 800_001)
    assert solution.value == pytest.approx((two_bays(x, np.exp) ** 2 / (2 * x) + x / 2).min(), abs=1e-9)
    assert "other places of the ends that slide" in solution.searched


def star(q, centre, lobes):
    """Negative within a wavy circle of radius about 1."""
    angle = ca.atan2(q[1], q[0] - centre)
    return (q[0] - centre) ** 2 + q[1] ** 2 - (1 + 0.3 * ca.cos(lobes * angle)) ** 2


def rim(centre, lobes):
    angle = np.linspace(0, 2 * np.pi, 2001)
    radius = 1 + 0.3 * np.cos(lobes * angle)
    return np.stack([centre + radius * np.cos(angle), radius * np.sin(angle)])


@pytest.mark.parametrize("begun", [(4.0, 0.1), (3.1, 0.9), (3.0, -1.0)])
def test_the_shortest_way_between_two_islands_leaves_from_the_sides_that_face_each_other(begun):
    shortest = vc.Curve(
        lambda q, dq: ca.norm_2(dq),
        vc.OnSurface(lambda q: star(q, -3.0, 3), (-begun[0], begun[1])),
        vc.OnSurface(lambda q: star(q, 3.0, 4), begun),
    )
    away = rim(3.0, 4)[:, :, None] - rim(-3.0, 3)[:, None, :]
    assert vc.solve(shortest).value == pytest.approx(np.hypot(*away).min(), abs=1e-5)


def test_a_method_that_follows_no_valley_tells_of_the_other_place():
    shore = vc.OnCurve(lambda x, y: y - two_bays(x, ca.exp), x=5.0)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + 0.5, vc.Fixed(0, 0), shore), vc.Collocation())
    x = np.linspace(1e-3, 8, 800_001)
    least = (two_bays(x, np.exp) ** 2 / (2 * x) + x / 2).min()
    assert solution.local or solution.value == pytest.approx(least, abs=1e-8)


def test_a_free_end_goes_along_with_the_one_that_slides_to_where_the_other_medium_is():
    """Two media meet on y = 0.04 x; level in the slow one costs 16 - 4/k, in the fast one 3 x + k (x - 4)² at most.

    By points far apart on phi = 0 the second, whose least one has its end where the media meet, looks dearer.
    """
    k = 1.762
    problem = vc.Problem(
        lambda x, y, v: ca.if_else(y > 0.04 * x, 3.0, 4.0) * ca.sqrt(1 + v**2),
        vc.Free(0.0),
        vc.OnCurve(lambda x, y: x - 4 - 0.5 * (y + 0.6), 4.0),
        end_cost=lambda x0, y0, x1, y1: k * (x1 - 4) ** 2 + (y1 - y0) ** 2 / 2,
    )
    solution = vc.solve(problem, throw=False)
    x = (4 + 0.5 * 0.6) / (1 - 0.5 * 0.04)
    level = 3 * x + k * (x - 4) ** 2
    assert level < 16 - 4 / k
    told = re.search(r"its end has the value ([\d.]+)", solution.message)
    least = float(told[1]) if solution.local and told else solution.value
    assert least <= level * (1 + 1e-3)


def balls(centres, radii):
    """A function of a point that is negative within balls: the product of what is so in each."""

    def phi(q):
        product = 1
        for centre, radius in zip(centres, radii, strict=True):
            product = product * (ca.sumsqr(q - ca.DM(centre)) - radius**2)
        return product

    return phi


def length(q, dq):
    return ca.norm_2(dq)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("radius", [0.3, 0.1, 0.003])
def test_a_ball_that_no_line_of_a_grid_meets_is_found_from_a_larger_one(dimension, radius):
    centres = np.zeros((2, dimension))
    centres[0, 0], centres[1, :2] = 5.0, (-0.1, 3.0)
    begun = np.zeros(dimension)
    begun[0] = 4.0
    end = vc.OnSurface(balls(centres.tolist(), (1.0, radius)), begun.tolist())
    solution = vc.solve(vc.Curve(length, vc.At((0.0,) * dimension), end))
    assert solution.value == pytest.approx(np.linalg.norm(centres[1]) - radius, abs=1e-10)
    assert not solution.local


def test_a_thin_slab_is_found_behind_the_start():
    """The slab |x + 1.03| < 1e-3 is nearer than the half plane beyond x = 4."""

    def phi(q):
        return ((q[0] + 1.03) ** 2 - 1e-6) * (4 - q[0])

    solution = vc.solve(vc.Curve(length, vc.At((0.0, 0.2)), vc.OnSurface(phi, (4.0, 0.0))))
    assert solution.value == pytest.approx(1.029, abs=1e-10)


@pytest.mark.parametrize("begun", [(3.0, 0.0), (-3.0, 0.0), (0.0, 2.0), (2.9, 0.0)])
def test_a_saddle_of_the_distance_to_an_ellipse_is_left(begun):
    """The nearest points of an ellipse of half axes 3 and 2 to (c, 0) lie at x = 9 c/5 (Lagrange's condition)."""
    c = 0.1
    ellipse = vc.OnSurface(lambda q: q[0] ** 2 / 9 + q[1] ** 2 / 4 - 1, begun)
    solution = vc.solve(vc.Curve(length, vc.At((c, 0.0)), ellipse))
    x = 9 * c / 5
    assert solution.value == pytest.approx(np.hypot(x - c, 2 * np.sqrt(1 - x**2 / 9)), abs=1e-12)
    assert not solution.local


def test_points_between_those_of_a_grid_show_no_way_that_is_none():
    """An ellipse of half axes 2 and 1 in one of 8 and 3: nearest are (0, 1) and (0, 3)."""
    inner = vc.OnSurface(lambda q: q[0] ** 2 / 4 + q[1] ** 2 - 1, (-2, 0))
    outer = vc.OnSurface(lambda q: q[0] ** 2 / 64 + q[1] ** 2 / 9 - 1, (8, 0.1))
    solution = vc.solve(vc.Curve(length, inner, outer))
    assert solution.value == pytest.approx(2.0, abs=1e-11)
    assert not solution.local
