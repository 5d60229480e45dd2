"""Conditions that hold all along the curve, held against closed forms in 60 digits."""

from dataclasses import replace

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.by_tube import bounded
from varcalc.certificates.choice import silent
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.pathwise import pathwise
from varcalc.certificates.proof import BITS, SERIES_LENGTH
from varcalc.certificates.setting import setting_along
from varcalc.study.reference import load
from varcalc.verify.candidate import candidate


def kinetic(x, y, v):
    return ca.sumsqr(v) / 2


def on_a_sphere(radius):
    return vc.Holonomic(lambda x, y: ca.sumsqr(y) - radius**2)


def on_the_sphere(start, end, **options):
    """Motions on the sphere of radius 5, between points that lie on it exactly."""
    return vc.Problem(kinetic, vc.Fixed(0, start), vc.Fixed(1, end), [on_a_sphere(5)], **options)


def angle(start, end):
    return mpmath.acos(mpmath.mpf(int(np.dot(start, end))) / 25)


NEAR, ANTIPODE_NEARLY = ((3, 4, 0), (0, 3, 4)), ((3, 4, 0), (-4, -3, 0))


@pytest.mark.parametrize("ends", [NEAR, ANTIPODE_NEARLY])
def test_the_least_energy_on_a_sphere(ends, bounds):
    certificate = vc.certify(vc.solve(on_the_sphere(*ends)))
    low, high = bounds(certificate)
    assert low <= (5 * angle(*ends)) ** 2 / 2 <= high
    assert certificate.width < 1e-15
    assert certificate.scope is Scope.TUBE


@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("great_circle/embedded", lambda: 3 * mpmath.acos(mpmath.mpf(4) / 9)),
        ("great_circle/energy", lambda: (3 * mpmath.acos(mpmath.mpf(4) / 9)) ** 2 / 2),
        # the cylinder of radius 5, unrolled
        ("cylinder/embedded", lambda: mpmath.hypot(5 * mpmath.atan2(4, 3), 2)),
        # the cone of slope 4/3, unrolled: 5 and 10 from its apex, a quarter turn seen under 3/5 of that
        ("cone/embedded", lambda: mpmath.sqrt(125 - 100 * mpmath.cos(mpmath.pi / 2 * 3 / 5))),
    ],
)
def test_references_in_space(name, exact, bounds):
    low, high = bounds(vc.certify(vc.solve(load(name)[0].problem)))
    assert low <= exact() <= high
    assert high - low < 1e-18


def test_a_length_that_has_a_factor(bounds):
    """The energy is stated without it, and so are the multipliers."""
    length = vc.Curve(
        lambda q, dq: 0.1 * ca.norm_2(dq) / 0.3,
        *map(vc.At, NEAR),
        [vc.Holonomic(lambda q: ca.sumsqr(q) - 25)],
    )
    low, high = bounds(vc.certify(vc.solve(length)))
    exact = mpmath.mpf(0.1) / mpmath.mpf(0.3) * 5 * angle(*NEAR)
    assert low <= exact <= high
    assert high - low < 1e-18


def test_two_conditions(bounds):
    """The sphere of radius 5 at the height 3 is a circle of radius 4."""
    level = vc.Holonomic(lambda x, y: y[2] - 3)
    problem = vc.Problem(kinetic, vc.Fixed(0, (4, 0, 3)), vc.Fixed(1, (0, 4, 3)), [on_a_sphere(5), level])
    low, high = bounds(vc.certify(vc.solve(problem)))
    assert low <= 2 * mpmath.pi**2 <= high
    assert high - low < 1e-15


def test_a_maximum(bounds):
    problem = vc.Problem(
        lambda x, y, v: -ca.sumsqr(v) / 2, vc.Fixed(0, NEAR[0]), vc.Fixed(1, NEAR[1]), [on_a_sphere(5)], maximise=True
    )
    low, high = bounds(vc.certify(vc.solve(problem)))
    assert low <= -((5 * angle(*NEAR)) ** 2) / 2 <= high


def test_an_end_that_lies_off_by_round_off_says_what_is_meant(bounds):
    """y_1 = sin x to the line to what sin(1) is rounded by: the curve is known, and so is its value."""
    problem = vc.Problem(
        kinetic,
        vc.Fixed(0, (0, 0)),
        vc.Fixed(1, (2, float(np.sin(1.0)))),
        [vc.Holonomic(lambda x, y: y[1] - ca.sin(x))],
    )
    certificate = vc.certify(vc.solve(problem))
    low, high = bounds(certificate)
    off = mpmath.mpf(float(np.sin(1.0))) - mpmath.sin(1)
    exact = 2 + (mpmath.mpf(1) / 2 + mpmath.sin(2) / 4 + 2 * off * mpmath.sin(1) + off**2) / 2
    assert low <= exact <= high
    assert high - low < abs(off) * mpmath.sin(1)
    assert "line between their values there" in str(certificate)
    assert certificate.scope is Scope.ALL


def test_the_long_way_round_is_no_minimum():
    start, end = map(np.array, NEAR)
    whole = 2 * np.pi - float(angle(*NEAR))

    def long_way(x):
        across = end - start * (start @ end) / 25
        across = 5 * across / np.linalg.norm(across)
        return np.outer(start, np.cos(whole * x)) - np.outer(across, np.sin(whole * x))

    solution = vc.solve(on_the_sphere(*NEAR), vc.Collocation(), guess=long_way)
    assert solution.value == pytest.approx(25 * whole**2 / 2)
    with pytest.raises(vc.VariationalError, match="no certificate"):
        vc.certify(solution)


BY_THE_WAY, SHARE = (0, 5, 0), 0.25


def by_the_way():
    """The least energy from one end to the other by a point of the sphere, in a quarter of the time and the rest."""
    parts = zip((NEAR[0], BY_THE_WAY), (BY_THE_WAY, NEAR[1]), (SHARE, 1 - SHARE), strict=True)
    return sum((5 * angle(*ends)) ** 2 / 2 / mpmath.mpf(time) for *ends, time in parts)


def through_a_waypoint():
    way = vc.Through(SHARE, BY_THE_WAY)
    return vc.solve(vc.Problem(kinetic, vc.Fixed(0, NEAR[0]), vc.Fixed(1, NEAR[1]), [on_a_sphere(5), way]))


def test_a_waypoint_on_a_sphere(bounds):
    certificate = vc.certify(through_a_waypoint())
    low, high = bounds(certificate)
    assert low <= by_the_way() <= high
    assert certificate.width < 1e-15


@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_through_a_waypoint_widens_the_interval_or_is_refused(power, bounds):
    """The wave vanishes at the waypoint, or does not."""
    solution = through_a_waypoint()
    along = candidate(solution).along_best
    for count in (4, 3):
        w = count * np.pi

        def evaluate(x, k, w=w):
            return along.evaluate(x, k) + 10.0**-power * w**k * np.outer((0, 0, 1), np.sin(w * x + k * np.pi / 2))

        check_or_refuse(solution, replace(along, evaluate=evaluate), power < 9, bounds, by_the_way())


def check_or_refuse(solution, along, refusable, bounds, exact=None):
    """Whatever the curve, the interval holds the least energy; it is refused where it is wrong enough alone."""
    with working(BITS, SERIES_LENGTH):
        try:
            held = next(pathwise(along))
            certificate = bounded(solution, setting_along(held.along, solution.value, held.terms), silent, held)[2]
        except Unproved:
            assert refusable
            return
    low, high = bounds(certificate)
    assert low <= ((5 * angle(*NEAR)) ** 2 / 2 if exact is None else exact) <= high


@pytest.mark.parametrize("power", [1, 3, 6, 9, 12])
@pytest.mark.parametrize("way", [(1, 0, 0), (-4, 3, 0), (0, 0, 1)])
def test_a_wrong_curve_widens_the_interval_or_is_refused(power, way, bounds):
    """Beside the sphere and on it."""
    solution = vc.solve(on_the_sphere(*NEAR))
    along = candidate(solution).along_best
    w, height = 3 * np.pi, 10.0**-power

    def evaluate(x, k):
        return along.evaluate(x, k) + height * w**k * np.outer(way, np.sin(w * x + k * np.pi / 2))

    check_or_refuse(solution, replace(along, evaluate=evaluate), power < 9, bounds)


@pytest.mark.parametrize("power", [1, 4, 8])
def test_wrong_multipliers_widen_the_interval_or_are_refused(power, bounds):
    solution = vc.solve(on_the_sphere(*NEAR))
    along = candidate(solution).along_best
    mu = along.forces[0]
    check_or_refuse(
        solution, replace(along, forces=(lambda x: mu(x) + 10.0**-power * np.cos(7 * x),)), power < 8, bounds
    )


REFUSED = {
    "wholly given": ([vc.Holonomic(lambda x, y: y[0] + y[1] - 7)], (0, 7, None)),
    "beside prescribed integrals": ([on_a_sphere(5), vc.Isoperimetric(lambda x, y, v: y[2], 1.9)], (0, 3, 4)),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_is_not_covered_is_refused_with_the_reason(reason):
    constraints, end = REFUSED[reason]
    solution = vc.solve(vc.Problem(kinetic, vc.Fixed(0, (3, 4, 0)), vc.Fixed(1, end), constraints))
    with pytest.raises(vc.VariationalError, match=f"no certificate: conditions all along the curve .*{reason}"):
        vc.certify(solution)
