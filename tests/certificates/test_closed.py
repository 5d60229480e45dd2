"""Closed Curves under a prescribed length or area, held against closed forms in 60 digits."""

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc

RING = vc.Periodic()


def area(q, dq):
    return (q[0] * dq[1] - q[1] * dq[0]) / 2


def speed(q, dq):
    return ca.norm_2(dq)


def slanted(q, dq):
    return ca.sqrt(1.2 * dq[0] ** 2 + 0.9 * dq[1] ** 2 + 0.2 * dq[0] * dq[1])


def within_a_metric(length):
    """The area enclosed by a length in a metric that is the same everywhere."""
    a, b, c = map(mpmath.mpf, (1.2, 0.9, 0.2))
    return mpmath.mpf(length) ** 2 / (4 * mpmath.pi * mpmath.sqrt(a * b - (c / 2) ** 2))


def weighted(strength):
    """The area of the weight 1 - strength |q|^2, by Green's theorem."""
    return lambda q, dq: (1 - strength * ca.sumsqr(q) / 2) * area(q, dq)


def round_the_top(strength, length):
    """That of the circle about the origin."""
    radius = mpmath.mpf(length) / (2 * mpmath.pi)
    return mpmath.pi * radius**2 - mpmath.mpf(strength) * mpmath.pi * radius**4 / 2


CASES = {
    "wherever it lies": (lambda q, dq: q[0] * dq[1], slanted, 1.3, lambda: within_a_metric(1.3)),
    "where it weighs most": (weighted(0.5), speed, 2.0, lambda: round_the_top(0.5, 2.0)),
}


@pytest.mark.parametrize(("lagrangian", "g", "length", "exact"), CASES.values(), ids=CASES)
def test_the_greatest_area_is_certified(lagrangian, g, length, exact, bounds):
    solution = vc.solve(vc.Curve(lagrangian, RING, RING, [vc.Isoperimetric(g, length)], maximise=True))
    certificate = vc.certify(solution)
    low, high = bounds(certificate)
    assert low <= exact() <= high
    assert certificate.width < 1e-18


def test_of_a_wrong_curve_nothing_false_is_proved(holds_of_a_wave):
    solution = vc.solve(vc.Curve(area, RING, RING, [vc.Isoperimetric(speed, 1.0)], maximise=True))
    assert holds_of_a_wave(solution, 1e-5, 1 / (4 * mpmath.pi))


def circle(turns, length):
    """A circle of that length, run round so many times."""
    angle, radius = 2 * np.pi * turns, length / (2 * np.pi * turns)
    return lambda t: radius * np.array([np.cos(angle * t), np.sin(angle * t)])


@pytest.mark.parametrize(
    ("lagrangian", "turns"), [(area, 2), (weighted(-0.5), 1)], ids=["run round twice", "where it weighs least"]
)
def test_what_is_no_greatest_area_is_not(lagrangian, turns):
    problem = vc.Curve(lagrangian, RING, RING, [vc.Isoperimetric(speed, 2.0)], maximise=True)
    solution = vc.solve(problem, vc.Collocation(), guess=circle(turns, 2.0))
    with pytest.raises(vc.VariationalError, match="no field of extremals"):
        vc.certify(solution)
