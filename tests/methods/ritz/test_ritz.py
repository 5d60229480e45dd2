"""The direct method against extremals of one's own choosing: orders, claims, upper bounds, refusals.

For any L and any curve y*, L + s(x) y with s = d/dx L_v - L_y (second order:
s = d/dx L_v - L_y - d^2/dx^2 L_w, w = y'') along y* has y* as an extremal and
keeps the second derivatives of L, hence the index. s is formed by CasADi from
the curve; the value on it is a Gauss sum of its own, exact to round-off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.elements import banded_step
from varcalc.methods.ritz.newton import _dense_step, newton_step
from varcalc.methods.ritz.system import RitzSystem, quadrature_points
from varcalc.numerics.mesh import Space

ROUND_OFF = 2e-14


@dataclass(frozen=True)
class Manufactured:
    """A problem with a known extremal: its value, and the curve as a function of x, shape (n, m)."""

    problem: vc.Problem
    value: float
    curve: ca.Function

    def largest_error(self, solution):
        x = np.linspace(*self.problem.span, 1501)
        return float(np.abs(np.atleast_2d(solution.y(x)) - np.asarray(self.curve(x[None, :]))).max())


def gauss_sum(span, panels=40, count=20):
    """Nodes and weights that integrate a smooth function to round-off."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    edges = np.linspace(*span, panels + 1)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


def manufacture(lagrangian, curve, span, order=1):
    """The problem that has ``curve`` as its extremal, with the second derivatives of ``lagrangian``."""
    x = ca.SX.sym("x")
    y = ca.vertcat(*curve(x))
    n = y.numel()
    along = [y, ca.jacobian(y, x)]
    along += [ca.jacobian(along[-1], x)] if order == 2 else []
    symbols = [ca.SX.sym(name, n) for name in ("y", "v", "w")[: order + 1]]

    def total_derivative(expression):
        return ca.jacobian(expression, x)

    bare = lagrangian(x, *symbols)
    partial = [ca.substitute(ca.gradient(bare, s), ca.vertcat(*symbols), ca.vertcat(*along)) for s in symbols]
    source = total_derivative(partial[1]) - partial[0]
    if order == 2:
        source -= total_derivative(total_derivative(partial[2]))
    load = ca.Function("load", [x], [ca.densify(source)])

    def loaded(x, *slopes):
        return lagrangian(x, *slopes) + ca.dot(load(x), slopes[0])

    value = ca.Function("value", [x], [loaded(x, *along)])
    known = ca.Function("curve", [x], [ca.densify(y)])
    slope = ca.Function("slope", [x], [ca.densify(along[1])])
    abscissae, weights = gauss_sum(span)
    exact = math.fsum(np.asarray(value(abscissae[None, :])).ravel() * weights)

    def given(function, at):
        numbers = np.asarray(function(at)).ravel()
        return float(numbers[0]) if n == 1 else tuple(map(float, numbers))

    ends = [vc.Fixed(at, given(known, at), given(slope, at) if order == 2 else None) for at in span]
    return Manufactured(vc.Problem(loaded, *ends, order=order), exact, known)


def first_order(x, y, v):
    return (1 + y**2) * v**2 / 2 + v**4 / 12 + ca.cos(x) * y**4 / 4


def coupled(x, y, v):
    return (v[0] ** 2 + v[1] ** 2 + ca.sin(x) * v[0] * v[1]) / 2 + (y[0] ** 2 * (1 + y[1] ** 2) + y[0] * v[1]) / 2


def second_order(x, y, v, w):
    return (1 + y**2 / 4) * w**2 / 2 + v**4 / 12 + (1 + x) * y**2 / 2


@cache
def manufactured(kind):
    return {
        "scalar": lambda: manufacture(first_order, lambda x: [ca.exp(-x / 2) * ca.sin(3 * x) / 2], (0.0, 2.0)),
        "vector": lambda: manufacture(coupled, lambda x: [ca.sin(4 * x), 1 / (1 + x**2)], (-0.5, 1.5)),
        "second order": lambda: manufacture(second_order, lambda x: [ca.sin(3 * x) + x], (0.0, 2.0), order=2),
    }[kind]()


def kept(case, elements, degree, optimiser=None):
    """The solution on a mesh that is kept; nothing of it is promised but the error it claims."""
    method = vc.Ritz(elements, degree, refine=False, optimiser=optimiser)
    solution = vc.solve(case.problem, method)
    assert (solution.stats.elements, solution.stats.degree) == (elements, degree)
    return solution


# orders of convergence

MESHES = {1: (32, 64), 2: (16, 32), 3: (12, 24), 4: (8, 16), 5: (4, 8), 6: (3, 6)}
"""Elements for each degree, fine enough for the asymptotic regime and coarse enough to stay above round-off."""
MESHES_OF = {
    "scalar": MESHES,
    "vector": MESHES | {6: (4, 8)},
    "second order": {3: (12, 24), 4: (8, 16), 5: (6, 12), 6: (6, 12)},
}
CASES = [(kind, degree, meshes) for kind, by_degree in MESHES_OF.items() for degree, meshes in by_degree.items()]


def order_of(errors, elements):
    return math.log(errors[0] / errors[1]) / math.log(elements[1] / elements[0])


@pytest.mark.parametrize(("kind", "degree", "elements"), CASES)
def test_order_of_the_value(kind, degree, elements):
    case = manufactured(kind)
    errors = [kept(case, count, degree).value - case.value for count in elements]
    expected = 2 * (degree + 1 - case.problem.order)
    assert errors[1] > 3 * ROUND_OFF * abs(case.value), "too fine to tell"
    assert order_of(errors, elements) == pytest.approx(expected, abs=0.4)


@pytest.mark.parametrize(("kind", "degree", "elements"), CASES)
def test_order_of_the_curve(kind, degree, elements):
    case = manufactured(kind)
    errors = [case.largest_error(kept(case, count, degree)) for count in elements]
    # one power more than the slope (Aubin and Nitsche: Ciarlet, "The Finite Element Method", sect. 3.2)
    assert order_of(errors, elements) == pytest.approx(degree + 1, abs=0.5)


@pytest.mark.parametrize(("kind", "degree", "elements"), CASES)
@pytest.mark.parametrize("optimiser", [vc.Newton(), vc.Ipopt()])
def test_claims_on_kept_meshes(kind, degree, elements, optimiser):
    case = manufactured(kind)
    for count in (4, *elements):
        solution = kept(case, count, degree, optimiser)
        delivered = abs(solution.value - case.value)
        assert 0.1 <= solution.error.value / max(delivered, ROUND_OFF) <= 10
        assert 0.1 <= solution.error.curve / case.largest_error(solution) <= 10


def test_exponential_in_the_degree():
    # y = arctan x has the slope 1/(1 + x^2), with poles at +-i: a polynomial of degree p misses it in the mean square
    # by (1 + sqrt 2)^-p (Trefethen, "Approximation Theory and Approximation Practice", ch. 8), the value by the square
    quarter = math.pi / 4
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - 2 * x / (1 + x**2) ** 2 * y, vc.Fixed(-1, -quarter), vc.Fixed(1, quarter)
    )
    exact = math.pi / 8 - 1 / 4
    degrees = range(5, 16, 2)
    errors = [vc.solve(problem, vc.Ritz(1, degree, refine=False)).value - exact for degree in degrees]
    assert min(errors) > 10 * ROUND_OFF, "too fine to tell"
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx((1 + math.sqrt(2)) ** 4, rel=0.1)


# kept meshes


@pytest.mark.parametrize("tol", [1e-2, 1e-12])
def test_a_mesh_that_is_kept_is_reported_as_it_is(tol):
    case = manufactured("scalar")
    solution = vc.solve(case.problem, vc.Ritz(4, 3, refine=False), tol=tol)
    assert solution.x == pytest.approx(np.linspace(0, 2, 5))
    assert (solution.stats.elements, solution.stats.degree) == (4, 3)
    assert solution.value - case.value > 1e-4  # the mesh is coarse, whatever the tolerance
    assert solution.error.value >= solution.value - case.value


def test_a_refined_mesh_meets_the_tolerance_from_any_first_mesh():
    case = manufactured("scalar")
    for method in (vc.Ritz(), vc.Ritz(4, 3), vc.Ritz(50, 1), vc.Ritz(1, 30)):
        solution = vc.solve(case.problem, method, tol=1e-12)
        assert solution.value == pytest.approx(case.value, rel=1e-12)


@pytest.mark.parametrize("kind", ["scalar", "vector", "second order"])
def test_claims_are_kept_on_the_way(kind):
    case = manufactured(kind)
    for tol in (1e-2, 1e-4, 1e-6, 1e-8):
        solution = vc.solve(case.problem, vc.Ritz(2), tol=tol)
        assert solution.error.value <= tol * max(1.0, abs(case.value))
        delivered = max(abs(solution.value - case.value), ROUND_OFF * abs(case.value))
        assert solution.error.value >= 0.1 * delivered


def test_many_elements():
    case = manufactured("scalar")
    solution = kept(case, 2000, 4)
    assert solution.value == pytest.approx(case.value, rel=1e-13)
    assert case.largest_error(solution) < 1e-12
    assert solution.stats.unknowns == 2000 * 4 - 1


def test_many_elements_under_a_level():
    # the greatest area over a chord of 2 under an arc of length pi/2 sqrt 2: a quarter of a circle of radius sqrt 2
    problem = vc.Problem(
        lambda x, y, v: y, vc.Fixed(-1, 0), vc.Fixed(1, 0),
        [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), math.pi / math.sqrt(2))], maximise=True,
    )  # fmt: skip
    solution = vc.solve(problem, vc.Ritz(500, 4, refine=False))
    assert solution.value == pytest.approx(math.pi / 2 - 1, rel=1e-11)
    assert solution.multipliers[0] == pytest.approx(math.sqrt(2), rel=1e-8)  # dA/dL is the radius


# both optimisers, both factorisations


@pytest.mark.parametrize(("kind", "degree", "elements"), CASES)
def test_the_optimisers_find_the_same_curve(kind, degree, elements):
    case = manufactured(kind)
    newton, ipopt = (kept(case, elements[0], degree, o) for o in (vc.Newton(), vc.Ipopt()))
    assert newton.value == pytest.approx(ipopt.value, rel=1e-12)
    x = np.linspace(*case.problem.span, 101)
    assert newton.y(x) == pytest.approx(ipopt.y(x), abs=1e-7)


def system_of(problem, elements, degree):
    form = formulate(problem)
    space = Space(np.linspace(*form.span, elements + 1), degree, form.n, form.order, form.ends.periodic)
    return RitzSystem(form, space, quadrature_points(degree))


def beside_the_baseline(system, bend=0.0):
    """The unknowns of the straight line, displaced at random and then until the side conditions are met."""
    z = system.pack(system.space.fit(system.form.start.curve), system.form.start.unknowns)
    z = z + bend * np.random.default_rng(1).standard_normal(len(z))
    for _ in range(20):
        at = system.evaluate(z)
        z = z - np.linalg.pinv(at.jacobian) @ at.conditions
    assert np.abs(system.evaluate(z).conditions).max(initial=0.0) < 1e-14
    return z


def with_a_level():
    return vc.Problem(
        lambda x, y, v: ca.sqrt(1 + v**2) * (1 + y**2), vc.Fixed(0, 0), vc.Fixed(1, 0.3),
        [vc.Isoperimetric(lambda x, y, v: y, 0.17), vc.Isoperimetric(lambda x, y, v: x * y, 0.11)],
    )  # fmt: skip


def with_an_unknown():
    return vc.Problem(
        lambda x, y, v, p: (v - p.k * x) ** 2 + y**2 * (1 + p.k**2), vc.Fixed(0, 0), vc.Fixed(1, 1),
        [vc.Isoperimetric(lambda x, y, v, p: y**2 + p.k * x, 0.5)], unknowns={"k": 0.5},
    )  # fmt: skip


PROBLEMS = {
    "scalar": lambda: manufactured("scalar").problem,
    "vector": lambda: manufactured("vector").problem,
    "second order": lambda: manufactured("second order").problem,
    "free end": lambda: vc.Problem(lambda x, y, v: v**2 + ca.cosh(y), vc.Fixed(0, 1), vc.Free(1)),
    "levels": with_a_level,
    "unknown": with_an_unknown,
    # conditions that couple the ends, and a curve that closes
    "cost": lambda: vc.Problem(
        lambda x, y, v: v**2 / 2 + y**2, vc.Free(0), vc.Free(1), end_cost=lambda x0, y0, x1, y1: (y0 - 1) ** 2 + y0 * y1
    ),
    "sliding": lambda: vc.Problem(
        lambda x, y, v: ca.sqrt(1 + v**2),
        vc.OnCurve(lambda x, y: y - x - 1, x=0.0), vc.OnCurve(lambda x, y: y + x**2 - 6, x=1.0),
    ),
    "closed": lambda: vc.Problem(
        lambda x, y, v, w: w**2 / 2 + (y - ca.sin(x)) ** 2, vc.Periodic(0, 6), vc.Periodic(0, 6), order=2
    ),
}  # fmt: skip


@pytest.mark.parametrize("optimiser", [None, vc.Ipopt()])
@pytest.mark.parametrize(("slope", "intercept", "guess"), [(-0.3, 1, 1), (-1.23, 1.15, 5), (0.9, -1.91, 9)])
def test_no_step_carries_an_end_that_slides_past_the_other(slope, intercept, guess, optimiser):
    """Backwards, lengths are negative and have no lower bound."""
    line = vc.OnCurve(lambda x, y: y - intercept - slope * x, x=guess)
    shortest = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(0, 0), line)
    solution = vc.solve(shortest, vc.Ritz(optimiser=optimiser))
    assert solution.value == pytest.approx(abs(intercept) / math.hypot(1, slope), rel=1e-11)
    assert solution.x[-1] == pytest.approx(-slope * intercept / (1 + slope**2), rel=1e-5)


def test_no_step_carries_a_start_that_slides_past_the_end():
    length = vc.Problem(
        lambda x, y, v: ca.sqrt(1 + v**2), vc.OnCurve(lambda x, y: y - 1 - 0.3 * x, x=-1), vc.Fixed(0, 0)
    )
    assert vc.solve(length).value == pytest.approx(1 / math.sqrt(1.09), rel=1e-11)


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize(("elements", "degree"), [(7, 3), (20, 5)])
def test_banded_and_dense_steps_agree(name, elements, degree):
    system = system_of(PROBLEMS[name](), elements, degree)
    at = system.evaluate(beside_the_baseline(system, 1e-4))
    multipliers = 0.1 * np.arange(1.0, len(at.conditions) + 1)
    assert_same_step(system, at, multipliers)


def assert_same_step(system, at, multipliers):
    banded = banded_step(system, at, multipliers)
    dense = _dense_step(system, at, multipliers)
    assert banded is not None
    assert dense is not None
    assert banded[3] == dense.shift == 0.0
    size = np.abs(dense.change).max()
    assert size > 1e-5
    assert banded[0] == pytest.approx(dense.change, abs=1e-9 * size)
    assert banded[1] == pytest.approx(dense.multipliers, rel=1e-8)
    assert banded[2] == pytest.approx(dense.decrement, rel=1e-8)


def test_both_factorisations_shift_what_is_no_minimum():
    problem = vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1))
    system = system_of(problem, 10, 4)
    at = system.evaluate(beside_the_baseline(system))
    banded, dense = banded_step(system, at, np.zeros(0)), _dense_step(system, at, np.zeros(0))
    assert banded is not None
    assert dense is not None
    assert banded[3] > 0
    assert dense.shift > 0
    assert at.gradient @ banded[0] < 0
    assert at.gradient @ dense.change < 0


@pytest.mark.parametrize("elements", range(23, 43, 2))
def test_conditions_that_repeat_one_another_raise_nothing(elements):
    # what is left of the second is round-off of either sign, or nothing, where the factors find the matrix singular
    system = system_of(PROBLEMS["levels"](), elements, 3)
    at = system.evaluate(beside_the_baseline(system, 1e-4))
    rows, missed = at.jacobian[:1], at.conditions[:1]
    twice = replace(at, jacobian=np.vstack([rows, 3 * rows]), conditions=np.concatenate([missed, 3 * missed]))
    step = banded_step(system, twice, np.full(len(at.conditions), 0.1))
    assert step is None or np.isfinite(step[0]).all()


def test_a_hessian_convex_only_along_the_levels_is_factored_by_bands():
    # J = int v^2 - 11 y^2 on [0, 1] is no minimum (11 > pi^2), but is one on curves of mean zero (11 < 4 pi^2)
    mean = vc.Isoperimetric(lambda x, y, v: y, 0.0)
    problem = vc.Problem(lambda x, y, v: v**2 - 11 * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [mean])
    system = system_of(problem, 50, 4)
    at = system.evaluate(beside_the_baseline(system))
    step = newton_step(system, at, np.zeros(1))
    assert step is not None
    assert step.definite
    assert_same_step(system, at, np.zeros(1))


def test_a_fine_mesh_holds_what_a_level_alone_makes_a_minimum():
    # the lowest eigenvalue of a string, whose second variation is negative but for the level
    norm = vc.Isoperimetric(lambda x, y, v: y**2, 1.0)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [norm]), vc.Ritz(100, 9))
    assert solution.value == pytest.approx(math.pi**2, abs=2 * solution.error.value)


# what is no answer, or too good to be true

HALF_PLANE = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) / y, vc.Fixed(0, 0.1), vc.Fixed(2, 0.1))


@pytest.mark.parametrize("optimiser", [vc.Newton(), vc.Ipopt()])
@pytest.mark.parametrize("elements", [1, 2, 3, 5, 16])
def test_no_mesh_exploits_its_quadrature(elements, optimiser):
    # a geodesic of the half-plane that leaves and arrives almost vertically, where y is small: between the points of
    # a coarse rule the trial curve could dive
    answered = 0
    for degree in (1, 2, 3, 4, 6, 9, 14):
        if elements * degree <= 2:
            continue  # one unknown or none
        method = vc.Ritz(elements, degree, refine=False, optimiser=optimiser)
        solution = vc.solve(HALF_PLANE, method, throw=False)
        if solution.status.ok:
            answered += 1
            assert solution.value >= math.acosh(201) * (1 - 1e-13)
            assert solution.error.value >= 0.1 * (solution.value - math.acosh(201))
    assert answered >= 3


def oscillator(duration):
    return vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(duration, 1))


@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Ritz(30, 3)])
def test_a_saddle_is_refused(method):
    # the first conjugate point is at pi: a minimum for T = 3, a saddle of index 1 for T = 4
    assert vc.solve(oscillator(3), method).value == pytest.approx(0.5 / math.tan(3), rel=1e-11)
    with pytest.raises(vc.VariationalError) as refusal:
        vc.solve(oscillator(4), method)
    assert str(refusal.value)


@pytest.mark.parametrize(("elements", "degree"), [(1, 2), (1, 3), (2, 1), (2, 3), (5, 2), (60, 3)])
def test_no_mesh_is_too_coarse_to_see_a_saddle(elements, degree):
    # on the coarsest meshes the action has one unknown and looks like a minimum: the richer space tells
    method = vc.Ritz(elements, degree, refine=False)
    assert vc.solve(oscillator(3), method).status.ok
    assert not vc.solve(oscillator(4), method, throw=False).status.ok


@pytest.mark.parametrize("optimiser", [vc.Newton(), vc.Ipopt()])
def test_the_coarsest_mesh_of_all(optimiser):
    # no unknown is left: the value is that of the straight line
    solution = vc.solve(oscillator(1), vc.Ritz(1, 1, refine=False, optimiser=optimiser))
    assert solution.value == pytest.approx(1 / 3, rel=1e-14)
    # one unknown is left
    solution = vc.solve(oscillator(1), vc.Ritz(1, 2, refine=False, optimiser=optimiser))
    assert 0.5 / math.tan(1) < solution.value < 1 / 3


def test_the_value_is_an_upper_bound_on_coarse_meshes():
    # sqrt(1 + y'^2) has branch points near the slopes of a steep curve, which a rule exact for cubes does not resolve
    case = manufacture(
        lambda x, y, v: ca.sqrt(1 + v**2) + (1 + y**2) * v**2 / 2, lambda x: [ca.exp(-x) * ca.sin(4 * x)], (0.0, 2.0)
    )
    lowest = min(kept(case, elements, degree).value for elements in (4, 6, 8) for degree in (3, 4, 5, 6))
    assert lowest >= case.value - ROUND_OFF * abs(case.value)


def layered(k, end):
    """The least integral of v^2/2 + cosh(k y) from (0, 0) to (1, end), from v^2/2 - cosh(k y) = e - 1, in 20 digits.

    J = int v dy - (e - 1), greatest where the abscissa is 1; y = 2/k asinh(sqrt(e / 2) sinh u) takes out the layer
    at 0, since cosh(k y) - 1 + e = e cosh(u)^2.
    """
    with mpmath.workdps(20):

        def top(e):
            return mpmath.asinh(mpmath.sinh(mpmath.mpf(k) * end / 2) / mpmath.sqrt(e / 2))

        def slope(u, e):
            return (
                2 / mpmath.mpf(k) * mpmath.sqrt(e / 2) * mpmath.cosh(u) / mpmath.sqrt(1 + e / 2 * mpmath.sinh(u) ** 2)
            )

        def integral(power, e):
            parts = mpmath.linspace(0, top(e), 9)
            return mpmath.quad(lambda u: slope(u, e) * (mpmath.sqrt(2 * e) * mpmath.cosh(u)) ** power, parts)

        log_e = mpmath.findroot(lambda t: integral(-1, mpmath.exp(t)) - 1, (-k, -k + 2), tol=1e-17)
        e = mpmath.exp(log_e)
        return float(integral(1, e) - (e - 1))


@pytest.mark.parametrize(("k", "end"), [(10, 1.0), (20, 1.0), (40, 0.5)])
def test_a_layer_is_reached(k, end):
    # the error does not fall before the bisections have arrived at the layer, of width exp(-k end / 2) / k
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ca.cosh(k * y), vc.Fixed(0, 0), vc.Fixed(1, end))
    solution = vc.solve(problem, vc.Ritz())
    value = layered(k, mpmath.mpf(end))
    assert solution.value == pytest.approx(value, rel=1e-10)
    assert abs(solution.value - value) <= 2 * solution.error.value


@pytest.mark.parametrize("options", [{"elements": 0}, {"degree": 0}, {"elements": 2.5}, {"starts": -1}])
def test_a_mesh_that_cannot_be_is_refused(options):
    with pytest.raises(
        (ValueError, TypeError), match=f"Ritz.{next(iter(options))} must be (at least 1|a whole number)"
    ):
        vc.Ritz(**options)


@pytest.mark.parametrize("optimiser", [vc.Newton(), vc.Ipopt()])
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_higher_eigenvalues_by_orthogonality_to_the_lower_modes(mode, optimiser):
    # several levels, some of them zero, and a baseline that meets none: Courant and Hilbert, vol. 1, ch. VI
    unit = vc.Isoperimetric(lambda x, y, v: y**2, 1.0)
    lower = [vc.Isoperimetric(lambda x, y, v, k=k: y * ca.sin(k * ca.pi * x), 0.0) for k in range(1, mode)]
    string = vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [unit, *lower])
    solution = vc.solve(string, vc.Ritz(optimiser=optimiser), tol=1e-12)
    eigenvalue = (mode * math.pi) ** 2
    assert solution.value == pytest.approx(eigenvalue, rel=2e-12)
    # dJ/dlevel of the normalisation is the eigenvalue itself
    assert solution.multipliers[0] == pytest.approx(eigenvalue, rel=1e-8)


def test_a_degree_too_low_for_the_order_is_refused():
    beam = vc.Problem(lambda x, y, dy, ddy: ddy**2, vc.Fixed(0, 0, 0), vc.Fixed(1, 1, 0), order=2)
    with pytest.raises(vc.VariationalError, match="degree=1 is too low for a functional of order 2; give at least 3"):
        vc.solve(beam, vc.Ritz(degree=1))
    assert vc.solve(beam, vc.Ritz(degree=3)).value == pytest.approx(12, rel=1e-12)
