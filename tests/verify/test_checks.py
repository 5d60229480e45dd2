"""Each check for itself: residual, Legendre, Weierstrass, first integrals, corners, the bound."""

import math
import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.verify.jacobi import Canonical, CarriedPlane


def swing(x, y, dy):
    return (dy**2 - y**2) / 2


def checked(problem, method=None, guess=None):
    return vc.verify(vc.solve(problem, method, guess=guess))


def test_the_residual_is_in_proportion_to_the_error_of_the_curve():
    solution = vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1)))

    def off_by(size):
        def curve(x, derivative):
            bump = np.sin(math.pi * x) if derivative == 0 else math.pi * np.cos(math.pi * x)
            exact = np.sin(x) if derivative == 0 else np.cos(x)
            return np.atleast_2d(exact / math.sin(2) + size * bump)

        return vc.verify(replace(solution, curve=curve, extremal=None)).residual

    assert off_by(0.0) < 1e-14
    assert off_by(1e-4) / off_by(1e-6) == pytest.approx(100, rel=0.02)


def test_legendre_takes_the_least_eigenvalue():
    matrix = np.array([[2.0, 1.0], [1.0, 3.0]])
    pair = vc.Problem(lambda x, y, dy: dy.T @ matrix @ dy / 2, vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 2]))
    assert checked(pair).legendre == pytest.approx(np.linalg.eigvalsh(matrix)[0])


def test_legendre_counts_isoperimetric_multipliers():
    # the chain: H = (y + lambda) sqrt(1 + y'^2), H_y'y' = (y + lambda)/(1 + y'^2)^(3/2)
    chain = vc.Problem(
        lambda x, y, dy: y * ca.sqrt(1 + dy**2),
        vc.Fixed(-0.5, 0),
        vc.Fixed(0.5, 0),
        [vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 1.5)],
    )
    solution = vc.solve(chain)
    check = vc.verify(solution)
    # y + lambda = c cosh(x/c), least second derivative at the ends: c / cosh(1/(2 c))^2, with sinh(1/(2 c)) = 3/(4 c)
    from scipy.optimize import brentq

    c = brentq(lambda c: math.sinh(0.5 / c) - 0.75 / c, 0.1, 1)
    assert check.legendre == pytest.approx(c / math.cosh(0.5 / c) ** 2, rel=1e-6)
    assert (check.verdict, check.index) == (vc.Verdict.MINIMUM, 0)


def test_a_curve_is_judged_across_its_direction():
    length = vc.Curve(lambda q, dq: 3 * ca.norm_2(dq), vc.At([0, 0]), vc.At([3, 4]))
    check = checked(length)
    # F_vv across the direction is 3/|dq|, with |dq| = 5 in t
    assert check.legendre == pytest.approx(3 / 5)
    assert check.weierstrass >= -1e-12
    assert check.invariants.keys() == {"momentum[0]", "momentum[1]", "speed"}


def test_weierstrass_looks_between_the_axes():
    # along y = 0 the excess is |w|^2 - 5 (w0 w1)^2/(1 + |w|^2): negative only where both components are steep
    strong = vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) - 5 * (dy[0] * dy[1]) ** 2 / (1 + ca.sumsqr(dy)),
        vc.Fixed(0, [0, 0]),
        vc.Fixed(1, [0, 0]),
    )
    solution = vc.solve(strong, vc.Collocation(), guess=lambda x: [0.0, 0.0], throw=False)
    check = vc.verify(solution)
    assert check.verdict is vc.Verdict.WEAK_MINIMUM
    assert abs(check.weierstrass.slope).min() > 0.1


def test_the_excess_survives_pickling():
    excess = checked(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1))).weierstrass
    again = pickle.loads(pickle.dumps(excess))
    assert (float(again), again.at) == (float(excess), excess.at)


def test_first_integrals_have_names_and_small_drifts():
    pendulum = checked(vc.Problem(lambda x, y, dy: dy**2 / 2 + ca.cos(y), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert pendulum.invariants.keys() == {"energy"}
    clairaut = checked(
        vc.Problem(lambda x, y, dy: ca.sqrt(1 + (ca.sin(x) * dy) ** 2), vc.Fixed(0.6, 0), vc.Fixed(1.3, 0.8))
    )
    assert clairaut.invariants.keys() == {"momentum"}
    # central force: of (r, phi) phi is ignorable, and time
    kepler = checked(
        vc.Problem(
            lambda x, y, dy: (dy[0] ** 2 + (y[0] * dy[1]) ** 2) / 2 + 1 / y[0],
            vc.Fixed(0, [1.0, 0.0]),
            vc.Fixed(1, [1.1, 0.9]),
        ),
    )
    assert kepler.invariants.keys() == {"energy", "momentum[1]"}
    for check in (pendulum, clairaut, kepler):
        assert max(check.invariants.values()) < 1e-5


def test_a_first_integral_that_drifts_is_measured():
    solution = vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1)))

    def line(x, derivative):
        return np.atleast_2d(np.full_like(x, 0.5) if derivative else x / 2)

    # along y = x/2 the energy (y'^2 + y^2)/2 goes from 1/8 to 5/8
    assert vc.verify(replace(solution, curve=line, extremal=None)).invariants["energy"] > 0.3


def test_a_beam_keeps_its_energy():
    beam = vc.Problem(lambda x, y, dy, ddy: ddy**2 / 2 + dy**2, vc.Fixed(0, 0, 0), vc.Fixed(1, 1, 0), order=2)
    check = checked(beam)
    assert check.invariants.keys() == {"energy", "momentum"}
    assert max(check.invariants.values()) < 1e-9


def test_refraction_keeps_weierstrass_and_erdmann():
    bent = vc.Problem(
        lambda x, y, dy: ca.if_else(x < 0.5, 1.0, 1.5) * ca.sqrt(1 + dy**2),
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        breakpoints=[0.5],
    )
    check = checked(bent)
    [corner] = [f for f in check.findings if "corner at 0.5" in f.sentence]
    assert corner.verdict is None
    assert corner.numbers["momentum"] < 1e-6
    assert math.isnan(corner.numbers["energy"])  # the abscissa of the corner is given, so nothing binds the energy


def test_a_waypoint_holds_its_corner():
    held = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(2, 0), [vc.Through(1, 1)])
    check = checked(held)
    assert any("the curve is held" in finding.sentence for finding in check.findings)
    assert check.verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("height", [1, 1e-6, 1e6])
def test_a_corner_that_no_extremal_has_is_found_out(height):
    solution = vc.solve(vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(-1, 0), vc.Fixed(1, height)))

    def broken(x, derivative):
        return height * np.atleast_2d(np.where(x > 0, 1.0, 0.0) if derivative else np.maximum(x, 0.0))

    nodes = np.array([-1.0, 0.0, 1.0])
    check = vc.verify(replace(solution, curve=broken, extremal=None, x=nodes))
    assert check.verdict is vc.Verdict.NO_EXTREMAL
    assert any("Weierstrass's and Erdmann's conditions fail" in finding.sentence for finding in check.findings)


@pytest.mark.parametrize(
    ("potential", "start", "end", "action"),
    [
        # the momentum is sqrt(2 V) of a kink that takes infinitely long: 2 sin(y / 2), (1 - y^2) / sqrt(2)
        (lambda y: 1 - ca.cos(y), (0, 0), (60, 6.2), 4 * (1 - math.cos(3.1))),
        (lambda y: (y**2 - 1) ** 2 / 4, (-25, -1), (25, 1), 4 / (3 * math.sqrt(2))),
    ],
)
def test_elements_shorter_than_the_digits_of_an_abscissa_make_no_corner(potential, start, end, action):
    kink = vc.Problem(lambda x, y, dy: dy**2 / 2 + potential(y), vc.Fixed(*start), vc.Fixed(*end))
    check = checked(kink)
    assert check.verdict is vc.Verdict.MINIMUM
    assert check.bound == pytest.approx(action, rel=1e-9)


def test_the_bound_lies_above_the_minimum():
    c = 0.848337938094979  # the neck of the film between rings of radius 1 at -0.5 and 0.5
    exact = c * (0.5 + c * math.sinh(1 / c) / 2)
    for degree in (4, 6):
        film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
        check = vc.verify(vc.solve(film, vc.Ritz(elements=1, degree=degree, refine=False)))
        assert exact < check.bound < exact + 1e-2


def test_interpolated_data_can_be_verified():
    table = ca.interpolant("n", "bspline", [np.linspace(-1, 2, 13)], 1 + 0.1 * np.linspace(-1, 2, 13) ** 2)
    ray = vc.Problem(lambda x, y, dy: table(y) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0.3), vc.Fixed(1, 0.6))
    check = checked(ray)
    assert (check.verdict, check.routes) == (vc.Verdict.MINIMUM, {"Jacobi": 0, "Ritz": 0})


def test_passages_are_counted_on_a_rotation():
    # X' = w P, P' = -w X turns by w: the plane X = 0 returns every pi/w
    w = 7.0

    def matrix(s):
        return np.broadcast_to(np.array([[0, w], [-w, 0]]), (len(s), 2, 2))

    system = Canonical((0.0, 2.0), np.array([0.0, 2.0]), 1, matrix, lambda s: None)
    carried = CarriedPlane(system, np.array([[0.0], [1.0]]))
    assert carried.points == pytest.approx(math.pi / w * np.arange(1, 5), abs=1e-13)
    assert carried.at_end == []
