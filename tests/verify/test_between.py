"""Features narrower than a mesh: spots, loads, walls and fast changes at places that no mesh was told of."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.verify.between import unseen

RNG = np.random.default_rng(1733)
PLACES = [(float(10 ** RNG.uniform(-6, -2)), float(RNG.uniform(0.1, 0.9))) for _ in range(4)]
METHODS = [vc.Ritz(), vc.Collocation()]


def graph(L, first=(0, 0), last=(1, 1), constraints=()):
    return vc.Problem(L, vc.Fixed(*first), vc.Fixed(*last), constraints)


def marks_about(place, width):
    return [0, *(p for k in range(-12, 13) if 0 < (p := place + k * width) < 1), 1]


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize(("width", "place"), PLACES)
def test_weak_spot(method, width, place):
    # c(x) y' is constant, so the least integral of c y'^2 is 1 over that of 1 / c
    problem = graph(lambda x, y, v: (1 - 0.999 * ca.exp(-(((x - place) / width) ** 2))) * v**2)
    found = vc.solve(problem, method)
    with mp.workdps(20):
        compliance = mp.quad(
            lambda x: 1 / (1 - mp.mpf(0.999) * mp.exp(-(((x - place) / width) ** 2))), marks_about(place, width)
        )
    assert found.value == pytest.approx(float(1 / compliance), abs=1e-9)
    assert abs(found.value - float(1 / compliance)) <= 10 * found.error.value + 1e-12


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize(("width", "place"), PLACES)
def test_narrow_load(method, width, place):
    # y' = c - q(x), q the integral of the load; half its variance is what the load gains
    problem = graph(
        lambda x, y, v: v**2 / 2 - 10 * ca.exp(-(((x - place) / width) ** 2)) / (width * np.sqrt(np.pi)) * y,
        last=(1, 0),
    )
    found = vc.solve(problem, method)
    with mp.workdps(20):
        marks = marks_about(place, width)

        def shear(x):
            return 5 * (mp.erf((x - place) / width) + mp.erf(place / width))

        mean = mp.quad(shear, marks)
        exact = -(mp.quad(lambda x: shear(x) ** 2, marks) - mean**2) / 2
    assert found.value == pytest.approx(float(exact), rel=1e-8)


def wall(width):
    """v^2/2 - V(y), constant along the curve, and the action at the energy at which the way takes the time 1."""
    problem = graph(lambda x, y, v: v**2 / 2 + 0.1 / width * ca.exp(-(((y - 0.37) / width) ** 2)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    inner = [0.37 + side * width * 1.5**k for side in (-1, 0, 1) for k in range(-3, 30)]
    edges = np.array(sorted({0.0, 1.0, *(y for y in inner if 0 < y < 1)}))
    half = np.diff(edges)[:, None] / 2
    y, dy = edges[:-1, None] + half * (1 + nodes), half * weights

    def speed(energy):
        return np.sqrt(2 * (energy + 0.1 / width * np.exp(-(((y - 0.37) / width) ** 2))))

    energy = brentq(lambda e: np.sum(dy / speed(e)) - 1, 1e-6, 0.5, xtol=1e-16, rtol=1e-15)
    return problem, np.sum(dy * speed(energy)) - energy


@pytest.mark.parametrize("width", [1e-1, 3e-2, 1e-2, 1e-5])
def test_wall_across_the_way(width):
    problem, exact = wall(width)
    found = vc.solve(problem, throw=False)
    # where the way across is a millionth of the mesh no method of fixed meshes comes to an end, and says so
    assert found.status.ok or width <= 1e-2
    assert not found.status.ok or found.value == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-5])
def test_a_quadrature_goes_through_a_wall_of_any_width(width):
    problem, exact = wall(width)
    found = vc.FirstIntegral().solve(formulate(problem), tol=1e-10, guess=None)
    assert found.status.ok
    assert abs(found.value - exact) <= 10 * found.error.value + 1e-13


def test_fast_load():
    # y'' = -a cos(a x) with zero ends: y = (cos(a x) - 1) / a + c x
    a = 3000.0
    found = vc.solve(graph(lambda x, y, v: v**2 / 2 - a * ca.cos(a * x) * y, last=(1, 0)))
    c = (1 - np.cos(a)) / a
    exact = -0.5 * (0.5 - np.sin(2 * a) / (4 * a) - 2 * c * c + c * c)
    assert found.value == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("method", [vc.Ritz(), vc.Collocation(), vc.Shooting(), vc.FirstIntegral()])
def test_no_method_calls_right_what_it_did_not_see(method):
    # least where most of the change falls on the weak spot: 1 is what a mesh finds that does not see it
    problem = graph(lambda x, y, v: (1 - 0.999 * ca.exp(-(((x - 0.71) / 1e-4) ** 2))) * v**2)
    found = vc.solve(problem, method, throw=False)
    with mp.workdps(20):
        compliance = mp.quad(
            lambda x: 1 / (1 - mp.mpf(0.999) * mp.exp(-(((x - 0.71) / 1e-4) ** 2))), marks_about(0.71, 1e-4)
        )
    assert not found.status.ok or found.value == pytest.approx(float(1 / compliance), abs=1e-9)


@pytest.mark.parametrize(
    ("method", "width"),
    [
        (vc.Ritz(), 1e-4),
        (vc.Collocation(), 1e-4),
        (vc.Collocation(), 1e-6),
        (vc.FirstIntegral(), 1e-4),
        (vc.FirstIntegral(), 1e-6),
    ],
)
def test_no_method_calls_right_a_dip_of_a_reciprocal_that_it_did_not_see(method, width):
    # the value is the square of the length in the metric: 1 without the dip
    problem = graph(lambda x, y, v: (1 - 0.99 / (1 + ((y - 0.371) / width) ** 2)) * v**2)
    found = vc.solve(problem, method, throw=False)
    with mp.workdps(20):
        marks = sorted({0, 1, *(mp.mpf(0.371) + side * 10**k * width for side in (-1, 0, 1) for k in range(4))})
        marks = [mark for mark in marks if 0 <= mark <= 1]
        length = mp.quad(lambda y: mp.sqrt(1 - 0.99 / (1 + ((y - 0.371) / mp.mpf(width)) ** 2)), marks)
    assert not found.status.ok or found.value == pytest.approx(float(length**2), abs=1e-9)


@pytest.mark.parametrize(
    "method", [vc.Ritz(), vc.Collocation(), vc.FirstIntegral(), None], ids=lambda m: type(m).__name__
)
@pytest.mark.parametrize("width", [3e-4, 1.7e-6])
def test_a_step_where_two_elements_meet(method, width):
    # 1 + 3 (1 + tanh u) / 2 times the slope is constant; with e = exp(-2 u) the integral of 1 / n is that of
    # (1 + e) / (4 + e) = 1/4 + 3/4 e / (4 + e), and e / (4 + e) that of -1/2 ln(4 + e)
    problem = graph(lambda x, y, v: (1 + 1.5 * (1 + ca.tanh((x - 0.5) / width))) * v**2)
    found = vc.solve(problem, *([method] if method else []), throw=False)
    last = 0.5 / width
    logarithms = np.logaddexp(np.log(4), -2 * last) - np.logaddexp(np.log(4), 2 * last)
    exact = 1 / (width * (2 * last / 4 - 3 / 8 * logarithms))
    assert found.status.ok or isinstance(method, vc.Collocation)
    assert not found.status.ok or abs(found.value - exact) <= 10 * found.error.value + 1e-14


def test_slot_in_a_bound():
    # a ceiling at 1 with a slot down to a half: the string is drawn down to the tip of it
    def slot(x):
        return 1 - 0.5 * ca.exp(-(((x - 0.4) / 1e-3) ** 2))

    problem = graph(lambda x, y, v: v**2, (0, 0.9), (1, 0.9), [vc.Bound(lambda x, y, v: y - slot(x), upper=0)])
    found = vc.solve(problem, throw=False)
    assert not found.status.ok or found.value == pytest.approx(0.4**2 / 0.4 + 0.4**2 / 0.6, rel=2e-2)


@pytest.mark.parametrize(
    "L",
    [
        lambda x, y, v: (1 + y) * ca.sqrt(1 + v**2),
        lambda x, y, v: ca.sqrt(ca.cos(y) ** 2 + v**2),
        lambda x, y, v: v**2 / 2 - ca.exp(y),
        lambda x, y, v: v**2 / 2 + ca.cos(y),
        lambda x, y, v: (2 + ca.sin(20 * x)) * v**2,
        lambda x, y, v: (1 + 2 * ca.exp(-((x - 0.5) ** 2 + (y - 0.1) ** 2) / 0.04)) * ca.sqrt(1 + v**2),
    ],
)
def test_gentle_problems_hide_nothing(L):
    assert unseen(vc.solve(graph(L))) is None


def test_an_end_where_the_slope_is_infinite_hides_nothing():
    assert unseen(vc.solve(graph(lambda x, y, v: ca.sqrt((1 + v**2) / y)))) is None


def test_a_wall_that_only_the_looks_own_points_hit():
    # at the middle of the way, which is a point of the look and none of a Gauss rule of even degree
    width = 2e-4
    problem = graph(lambda x, y, v: v**2 / 2 + 0.1 * ca.exp(-(((y - 0.5) / width) ** 2)))
    found = vc.solve(problem, vc.Collocation(), throw=False)
    with mp.workdps(20):
        marks = marks_about(0.5, width)

        def speed(y, energy):
            return mp.sqrt(2 * (energy + mp.mpf(0.1) * mp.exp(-(((y - 0.5) / width) ** 2))))

        energy = mp.findroot(lambda e: mp.quad(lambda y: 1 / speed(y, e), marks) - 1, (mp.mpf("0.49"), mp.mpf("0.5")))
        exact = mp.quad(lambda y: speed(y, energy), marks) - energy
    assert not found.status.ok or found.value == pytest.approx(float(exact), abs=1e-9)


def test_a_bound_is_kept_everywhere_by_an_answer_in_pieces():
    # cosh v under a bound of the slope, with a kink of the place that is crossed twice
    most = 1.457
    problem = vc.Problem(
        lambda x, y, v: (
            ca.cosh(v) - 1.386 * ca.if_else(x > 1.024, y, 0) + 0.852 * ca.sin(2.826 * y) + 2.846 * ca.fmax(0, y + 0.084)
        ),
        vc.Fixed(0, 0.95),
        vc.Free(2),
        [vc.Bound(lambda x, y, v: v, lower=-most, upper=most)],
        end_cost=lambda x0, y0, x1, y1: -1.621 * y1,
    )
    solution = vc.solve(problem)
    slopes = solution.dy(np.linspace(0, 2, 40_001))
    assert np.abs(slopes).max() <= most + 3e-7


def test_what_varies_everywhere_is_refused_on_the_mesh_at_hand():
    problem = vc.Problem(
        lambda x, y, v: v**2 + ca.floor(ca.cos(v)) ** ca.fabs(y**-0.37), vc.Fixed(0, 0), vc.Fixed(1, 1e-9)
    )
    solution = vc.solve(problem, vc.Ritz(starts=1), tol=1e-6, throw=False)
    assert not solution.status.ok
    assert "varies faster than the points of the mesh can tell" in solution.message
    assert len(solution.x) < 10_000


@pytest.mark.parametrize(("width", "rise", "units"), [(1.888, -0.407, (0.1, 1e3)), (2.5, 0.3, (1.0, 1e3))])
def test_a_curve_that_is_far_from_its_end_at_the_point_next_to_that(width, rise, units):
    # e^-y sqrt(1 + y'^2) is an arc of the plane at radius e^-y and angle x: far up, at radius 0, it costs nothing but
    # on the way there, which a mesh in other units steps over
    sx, sy = units
    problem = graph(lambda x, y, v: ca.exp(-sy * y) * ca.sqrt(sx**2 + (sy * v) ** 2), last=(width / sx, rise / sy))
    radius = np.exp(-rise)
    assert vc.solve(problem).value == pytest.approx(np.sqrt(1 + radius**2 - 2 * radius * np.cos(width)), rel=1e-10)
