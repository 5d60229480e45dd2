"""Problem and Curve: a person's functions called once, wrong ones refused at once."""

import math
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

START, END = vc.Fixed(0, 0), vc.Fixed(1, 1)


def square(x: Any, y: Any, dy: Any) -> Any:
    return dy**2


def length(q: Any, dq: Any) -> Any:
    return ca.norm_2(dq)


def problem(lagrangian: Any = square, start: Any = START, end: Any = END, *rest: Any, **options: Any) -> vc.Problem:
    return vc.Problem(lagrangian, start, end, *rest, **options)


def vectors(lagrangian: Any) -> vc.Problem:
    return vc.Problem(lagrangian, vc.Fixed(0, (0, 0)), vc.Fixed(1, (1, 1)))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: problem(3.0), TypeError, "lagrangian must be a function, not 3.0"),
        # ends
        (lambda: problem(square, (0, 0)), TypeError, "start must be Fixed, Free, OnCurve or Periodic"),
        (lambda: problem(square, START, vc.At((0, 0))), TypeError, "end must be Fixed, Free, OnCurve or Periodic"),
        (lambda: problem(square, END, START), ValueError, "the end must lie right of the start"),
        (lambda: problem(square, START, vc.Fixed(0, 1)), ValueError, "the end must lie right of the start"),
        (lambda: problem(square, START, vc.Fixed(1, (1, 2))), ValueError, "start has 1 components and end has 2"),
        (lambda: problem(square, START, vc.Fixed(1, (1,))), ValueError, "both ends need the same form of y"),
        (lambda: problem(square, vc.Fixed(0, 0, 1)), ValueError, "start.dy cannot be fixed .* use order=2"),
        (lambda: problem(square, START, vc.Fixed(1, 0, 1)), ValueError, "end.dy cannot be fixed"),
        (lambda: problem(square, vc.Periodic(0, 1), END), ValueError, "Periodic must be given as both ends"),
        (
            lambda: problem(square, vc.Periodic(0, 1), vc.Periodic(0, 2)),
            ValueError,
            "Periodic must be given as both ends, with the same abscissae",
        ),
        (lambda: problem(square, vc.Periodic(), vc.Periodic()), ValueError, r"need abscissae: Periodic\(x0, x1\)"),
        # the domain
        (lambda: problem(lambda x, y, dy: ca.log(y) + dy**2, vc.Fixed(0, -1)), ValueError, "start = .* outside"),
        (
            lambda: problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), START, vc.Fixed(1, -1)),
            ValueError,
            "end = .* lies outside the domain .* move the end, or check the sign under roots",
        ),
        (lambda: problem(lambda x, y, dy: ca.sqrt(x - 2) + dy**2), ValueError, "lies outside the domain"),
        # the function
        (lambda: problem(lambda x, y: y), TypeError, r"lagrangian must accept 3 arguments .* \(x, y\)"),
        (lambda: problem(lambda x, y, dy: dy**2, order=2), TypeError, "lagrangian must accept 4 arguments"),
        (lambda: problem(square, parameters={"g": 1.0}), TypeError, "must accept 4 arguments .* p comes last"),
        (lambda: problem(lambda x, y, dy, p: dy**2), TypeError, "must accept 3 arguments"),
        (lambda: problem(lambda x, y, dy: "L"), TypeError, "lagrangian must return a CasADi expression or a number"),
        (lambda: problem(lambda x, y, dy: None), TypeError, "lagrangian must return a CasADi expression or a number"),
        (lambda: vectors(lambda x, y, dy: dy**2), ValueError, r"must return a scalar, .* shape \(2, 1\)"),
        (lambda: vectors(lambda x, y, dy: dy**2), ValueError, "use ca.dot or ca.sumsqr"),
        (
            lambda: problem(lambda x, y, dy, p: p.h * dy**2, parameters={"g": 1.0, "k": 2.0}),
            ValueError,
            r"p.h is used but not declared; give it in parameters= or unknowns= \(declared: g, k\)",
        ),
        # options
        (lambda: problem(order=3), ValueError, "order must be 1 or 2, not 3"),
        (lambda: problem(order=True), ValueError, "order must be 1 or 2, not True"),
        (lambda: problem(maximise="no"), TypeError, "maximise must be True or False, not 'no'"),
        (lambda: problem(name=3), TypeError, "name must be a text, not 3"),
        (lambda: problem(unknowns={"lambda": 1.0}), ValueError, "unknowns: 'lambda' is no name that p.<name> could"),
        (lambda: problem(parameters={"__class__": 1}), ValueError, "parameters: '__class__' is no name"),
        (lambda: problem(parameters={"g": "9"}), TypeError, r"parameters\['g'\] must be a number, not '9'"),
        (lambda: problem(parameters={"g": True}), TypeError, r"parameters\['g'\] must be a number, not True"),
        (lambda: problem(breakpoints=0.5), TypeError, r"breakpoints must be a sequence, .* breakpoints=\[...\]"),
        (lambda: problem(breakpoints="0.5"), TypeError, "breakpoints must be a sequence, not '0.5'"),
        (lambda: problem(end_cost=3.0), TypeError, "end_cost must be a function, not 3.0"),
        (lambda: problem(parameters={"g": math.nan}), ValueError, r"parameters\['g'\] must be finite"),
        (lambda: problem(parameters={"2g": 1}), ValueError, "parameters: '2g' is no name"),
        (lambda: problem(parameters=[1.0]), TypeError, "parameters must be a mapping"),
        (lambda: problem(unknowns={"k": "large"}), TypeError, r"unknowns\['k'\] must be a number"),
        (
            lambda: problem(parameters={"k": 1}, unknowns={"k": 1}),
            ValueError,
            r"\['k'\] are given both in parameters and in unknowns",
        ),
        (lambda: problem(breakpoints=(1.5,)), ValueError, r"breakpoints = 1.5 must lie strictly between the ends"),
        (lambda: problem(breakpoints=(0,)), ValueError, "breakpoints = 0.0 must lie strictly"),
        (
            lambda: problem(square, START, vc.OnCurve(lambda x, y: x - 1, 1), breakpoints=(0.5,)),
            ValueError,
            "breakpoints: abscissae inside the interval cannot be kept while an end slides",
        ),
        (lambda: problem(maximum=True), TypeError, "Problem has no argument .maximum.; did you mean .maximise."),
        (lambda: problem(end_cost=lambda x, y: y), TypeError, "end_cost must accept 4 arguments"),
        # ends that slide
        (lambda: problem(end=vc.OnCurve(lambda x: x - 1, 1)), TypeError, r"end.phi must accept 2 .* \(x\); .* never p"),
        (lambda: problem(end=vc.OnCurve(lambda x, y: 1.0, 1)), ValueError, "end.phi depends neither on x nor on y"),
        (lambda: problem(end=vc.OnCurve(lambda x, y: "x", 1)), TypeError, "end.phi must return a CasADi expression"),
        (lambda: problem(start=vc.Free(0, n=2)), ValueError, "start has 2 components and end has 1"),
        (
            lambda: vc.Problem(lambda x, y, dy: dy[0], vc.Fixed(0, (0, 0)), vc.OnCurve(lambda x, y: y, 1, n=2)),
            ValueError,
            r"end.phi must return a scalar, but its result has shape \(2, 1\)",
        ),
        # components
        (lambda: problem(lambda x, y, dy: dy**2 + y[5]), ValueError, r"is not there: .* one component, \[0\]"),
        (lambda: vectors(lambda x, y, dy: dy[0] * y[-3]), ValueError, r"2 components, \[0\] to \[1\]"),
        (lambda: vectors(lambda x, y, dy: sum(v**2 for v in dy)), TypeError, "lagrangian unpacks or loops over"),
        # constraints
        (lambda: problem(square, START, END, 3), TypeError, r"constraints must be a sequence, not 3"),
        (
            lambda: problem(square, START, END, [vc.Holonomic(lambda x, y: 0.0)]),
            ValueError,
            r"constraints\[0\].phi does not depend on the curve",
        ),
        (lambda: problem(square, START, END, [vc.Through(1, 3)]), ValueError, r"Through.* misses it by 2; move one"),
        (lambda: problem(square, START, END, [vc.Through(0, 0)]), ValueError, r"abscissa of start .*; leave it out"),
        (lambda: problem(square, START, END, vc.Through(0.5, 1)), TypeError, r"write constraints=\[...\]"),
        (lambda: problem(square, START, END, [square]), TypeError, r"constraints\[0\] must be Isoperimetric"),
        (lambda: problem(square, START, END, [vc.Through(2, 0)]), ValueError, r"constraints\[0\].x .* must lie"),
        (lambda: problem(square, START, END, [vc.Through(0.5, (0, 1))]), ValueError, "Through.y must have 1"),
        (
            lambda: problem(square, START, END, [vc.Isoperimetric(lambda x, y: y, 1)]),
            TypeError,
            r"constraints\[0\].g must accept 3 arguments",
        ),
        (
            lambda: problem(square, START, END, [vc.Through(0.5, 1), vc.Holonomic(square)]),
            TypeError,
            r"constraints\[1\].phi must accept 2 arguments",
        ),
        (
            lambda: problem(square, START, END, [vc.Bound(lambda x, y: y, lower=0)]),
            TypeError,
            r"constraints\[0\].h must accept 3 arguments",
        ),
    ],
)  # fmt: skip
def test_wrong_problems(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: vc.Curve(length, START, END), TypeError, "start must be At, OnSurface or Periodic"),
        (lambda: vc.Curve(length, vc.At((0, 0)), vc.At((1, 1, 1))), ValueError, "2 coordinates and end has 3"),
        (lambda: vc.Curve(length, vc.Periodic(), vc.At((0, 1))), ValueError, "both ends of a closed Curve"),
        (lambda: vc.Curve(length, vc.Periodic(0, 1), vc.Periodic(0, 1)), ValueError, r"write Periodic\(\)"),
        (
            lambda: vc.Curve(lambda q, dq: ca.sumsqr(dq), vc.At((0, 0)), vc.At((1, 1))),
            ValueError,
            "lagrangian is not homogeneous of degree one in dq: .* is a Problem in that parameter",
        ),
        (
            lambda: vc.Curve(lambda q, dq: 1 + dq[0], vc.At((0, 0)), vc.At((1, 1))),
            ValueError,
            "not homogeneous of degree one",
        ),
        (
            lambda: vc.Curve(length, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(lambda q, dq: q[0], 1)]),
            ValueError,
            r"constraints\[0\].g is not homogeneous",
        ),
        (
            lambda: vc.Curve(lambda q, dq: ca.norm_2(dq) * ca.sqrt(-1 - q[0] ** 2), vc.At((0, 0)), vc.At((1, 1))),
            ValueError,
            "is not a number anywhere near the ends",
        ),
        (
            lambda: vc.Curve(length, vc.At((0, 0)), vc.At((1, 1)), [vc.Through(0.5, (1, 1))]),
            TypeError,
            "Through needs an abscissa, which a Curve does not have",
        ),
        (lambda: vc.Curve(length, vc.At((0, 0)), vc.At((1, 1)), order=2), TypeError, "order"),  # type: ignore[call-arg]
        (
            lambda: vc.Curve(length, vc.At((0, 0)), vc.OnSurface(lambda q: 1, (1, 1))),
            ValueError,
            "end.phi does not depend on q",
        ),
        (
            lambda: vc.Curve(length, vc.At((0, 0)), vc.OnSurface(lambda q, p: q[0], (1, 1))),
            TypeError,
            "end.phi must accept 1 argument here",
        ),
        (lambda: vc.Curve(lambda x, q, dq: q, vc.At((0, 0)), vc.At((1, 1))), TypeError, "must accept 2 arguments"),
    ],
)
def test_wrong_curves(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_constraints_and_breakpoints_may_come_from_a_generator() -> None:
    given = problem(square, START, END, (vc.Through(x, x) for x in (0.25, 0.5)), breakpoints=iter((0.5, 0.75, 0.5)))
    assert [c.x for c in given.of_type(vc.Through)] == [0.25, 0.5]
    assert given.breakpoints == (0.5, 0.75)


def test_the_number_of_functions_says_nothing_of_their_form() -> None:
    assert problem(start=vc.Free(0, n=1)).scalar
    assert not vc.Problem(lambda x, y, dy: dy[0] ** 2, vc.Free(0, n=1), vc.Fixed(1, (1,))).scalar


def test_a_lambda_has_no_name_of_its_own() -> None:
    assert problem(lambda x, y, dy: dy**2).name == "functional"
    assert problem(square).name == "square"
    assert problem(name="line").name == "line"


def test_a_sliding_end_on_interpolated_data() -> None:
    shore = cubic_by_coefficients()
    given = problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.OnCurve(lambda x, y: y - shore(x), 0.9))
    assert given.symbols.kind is ca.MX
    found = vc.solve(given)
    # the nearest point of y = x^3 - x from (0, 1): x + (y - 1)(3 x^2 - 1) = 0
    foot = np.polynomial.Polynomial([1, 2, -3, -4, 0, 3]).roots()
    foot = foot[np.isreal(foot) & (foot.real > 0)].real
    assert found.value == pytest.approx(np.hypot(foot, foot**3 - foot - 1).min(), rel=1e-9)


def test_an_end_on_the_edge_of_the_domain_is_admitted() -> None:
    vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), START, END)
    vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / -y), START, vc.Fixed(1, -1))


def test_the_lagrangian_is_called_once() -> None:
    calls = []

    def counted(x: Any, y: Any, dy: Any) -> Any:
        calls.append(type(y))
        return dy**2 + y**2

    given = vc.Problem(counted, START, END)
    vc.solve(given)
    vc.solve(given, vc.Collocation())
    assert calls == [ca.SX]


# NumPy

PAIRS = [
    (lambda m: lambda x, y, dy: m.sqrt(1 + dy**2) * m.exp(-x) + m.log(2 + y**2)),
    (lambda m: lambda x, y, dy: m.sin(y) ** 2 + m.cosh(dy) + m.tanh(x * y)),
    (lambda m: lambda x, y, dy: m.fabs(dy) * m.cos(x) + m.arctan(y) if m is np else m.fabs(dy) * m.cos(x) + m.atan(y)),
]


@pytest.mark.parametrize("make", PAIRS)
def test_numpy_functions_serve_as_well_as_casadis(make: Callable[[Any], Callable[..., Any]]) -> None:
    with_numpy, with_casadi = (vc.Problem(make(module), START, END) for module in (np, ca))
    x, y, dy = (np.linspace(a, 2, 7) for a in (0.1, -1, -2))
    found, expected = (p.integrand_values(x, y[None], dy[None]) for p in (with_numpy, with_casadi))
    assert np.array_equal(found, expected)
    assert np.isfinite(expected).all()


def test_numpy_functions_are_taken_quietly_and_nothing_global_changes() -> None:
    def mixed(x: Any, y: Any, dy: Any) -> Any:
        return np.sqrt(1 + dy**2) / np.sqrt(y)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        filters, errors = list(warnings.filters), np.geterr()
        given = vc.Problem(mixed, START, END)
        assert warnings.filters == filters
        assert np.geterr() == errors
        assert vc.solve(given).value == pytest.approx(2.58190451282777, rel=1e-12)
        assert warnings.filters == filters
        assert np.geterr() == errors
    assert not caught
    # NumPy's own work is as it was
    with pytest.warns(RuntimeWarning):
        np.log(np.array([-1.0]))


def test_a_persons_own_warnings_are_heard() -> None:
    def warning(x: Any, y: Any, dy: Any) -> Any:
        warnings.warn("mind the gap", UserWarning, stacklevel=1)
        return dy**2

    with pytest.warns(UserWarning, match="mind the gap"):
        vc.Problem(warning, START, END)


# interpolated data


def sampled_cubic() -> Callable[[Any], Any]:
    """x^3 - x by a cubic spline through samples, which reproduces it."""
    knots = np.linspace(-0.5, 1.5, 21)
    return ca.interpolant("load", "bspline", [knots], knots**3 - knots)


def cubic_by_coefficients() -> Callable[[Any], Any]:
    """x^3 - x as a B-spline on [-1/2, 3/2]; CasADi evaluates it with MX symbols only."""
    a, b = -0.5, 1.5
    blossom = [p * q * r - (p + q + r) / 3 for p, q, r in ((a, a, a), (a, a, b), (a, b, b), (b, b, b))]
    return lambda x: ca.bspline(x, ca.DM(blossom), [[a] * 4 + [b] * 4], [3], 1)


@pytest.mark.parametrize(("load", "kind"), [(sampled_cubic(), None), (cubic_by_coefficients(), ca.MX)])
def test_interpolated_data_in_the_lagrangian(load: Callable[[Any], Any], kind: type | None) -> None:
    # y'^2 + 2 f y: y'' = f
    given = vc.Problem(lambda x, y, dy: dy**2 + 2 * load(x) * y, START, vc.Fixed(1, 0))
    assert kind in (None, given.symbols.kind)
    solution = vc.solve(given, tol=1e-12)
    x = np.linspace(0, 1, 11)
    exact = x**5 / 20 - x**3 / 6 + x * (1 / 6 - 1 / 20)
    assert solution.y(x) == pytest.approx(exact, abs=1e-9)
    # J = -int y'^2 on the extremal
    slope = np.polynomial.Polynomial([1 / 6 - 1 / 20, 0, -1 / 2, 0, 1 / 4])
    value = -float((slope**2).integ()(1.0))
    assert solution.value == pytest.approx(value, abs=1e-12)
    assert vc.solve(given, vc.Collocation(), tol=1e-12).value == pytest.approx(value, abs=1e-12)


def test_an_interpolated_index() -> None:
    # n(y) = 1 + y / 5 sampled, a ray from (0, 0) to (1, 0): a catenary, c cosh((x - 1/2) / c) = 1 / a + y
    heights = np.linspace(-2, 2, 9)
    index = ca.interpolant("index", "bspline", [heights], 1 + heights / 5)
    sampled = vc.solve(vc.Problem(lambda x, y, dy: index(y) * ca.sqrt(1 + dy**2), START, vc.Fixed(1, 0)), tol=1e-12)
    formula = vc.solve(vc.Problem(lambda x, y, dy: (1 + y / 5) * ca.sqrt(1 + dy**2), START, vc.Fixed(1, 0)), tol=1e-12)
    from scipy.optimize import brentq

    c = brentq(lambda c: c * math.cosh(0.5 / c) - 5, 1, 5, xtol=1e-16)
    exact = (c / 2 + c**2 * math.sinh(1 / c) / 2) / 5
    assert formula.value == pytest.approx(exact, rel=1e-12)
    assert sampled.value == pytest.approx(exact, rel=1e-12)


# other parameter values


def test_other_parameter_values_share_what_is_built() -> None:
    calls = []

    def weighted(x: Any, y: Any, dy: Any, p: Any) -> Any:
        calls.append(1)
        return p.k * dy**2 + p.m * y**2

    given = vc.Problem(weighted, START, END, parameters={"k": 1.0, "m": 1.0})
    first = vc.solve(given, tol=1e-12)
    functions = dict(given.cache.products)
    other = given.with_parameters({"m": 4.0})
    again = vc.solve(other, tol=1e-12)
    assert other.cache is given.cache
    assert all(other.cache.products[name] is function for name, function in functions.items())
    assert given.parameters == {"k": 1.0, "m": 1.0}
    assert other.parameters == {"k": 1.0, "m": 4.0}
    assert calls == [1]
    # sqrt(k m) coth sqrt(m / k)
    assert first.value == pytest.approx(1 / math.tanh(1), rel=1e-12)
    assert again.value == pytest.approx(2 / math.tanh(2), rel=1e-12)
    fresh = vc.solve(vc.Problem(weighted, START, END, parameters={"k": 1.0, "m": 4.0}), tol=1e-12)
    assert again.value == pytest.approx(fresh.value, rel=1e-14)
    assert vc.solve(given, tol=1e-12).value == first.value


def test_strange_parameters_are_refused() -> None:
    given = vc.Problem(lambda x, y, dy, p: p.k * dy**2, START, END, parameters={"k": 1.0})
    with pytest.raises(TypeError, match=r"parameters must be a mapping from names to numbers, not 2\.0"):
        given.with_parameters(2.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"\['m'\] are no parameters of this problem; it has \['k'\]"):
        given.with_parameters({"m": 1.0})
    with pytest.raises(ValueError, match=r"parameters\['k'\] must be finite"):
        given.with_parameters({"k": math.inf})


# derivatives


def test_derivatives_of_the_integrand_are_those_of_the_formula() -> None:
    given = vc.Problem(lambda x, y, dy, p: p.k * x * y**2 * dy**3, START, END, parameters={"k": 3.0})
    x, y, v = np.array([0.1, 0.7]), np.array([0.5, 2.0]), np.array([-1.0, 0.3])
    for k, problem in ((3.0, given), (5.0, given.with_parameters({"k": 5.0}))):
        found = problem.integrand_derivatives(x, y[None], v[None])
        np.testing.assert_allclose(found.value, k * x * y**2 * v**3, rtol=1e-15)
        gradient = np.array([y**2 * v**3, 2 * x * y * v**3, 3 * x * y**2 * v**2])
        np.testing.assert_allclose(found.gradient, k * gradient.T, rtol=1e-15)
        mixed = np.array([2 * y * v**3, 3 * y**2 * v**2, 6 * x * y * v**2])
        diagonal = np.array([0 * x, 2 * x * v**3, 6 * x * y**2 * v])
        hessian = np.zeros((2, 3, 3))
        for (a, b), row in zip([(0, 1), (0, 2), (1, 2)], mixed, strict=True):
            hessian[:, a, b] = hessian[:, b, a] = k * row
        hessian[:, range(3), range(3)] = k * diagonal.T
        np.testing.assert_allclose(found.hessian, hessian, rtol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_lagrangian_without_second_derivative_in_the_slopes_is_linear(n: int) -> None:
    start, end = vc.Fixed(0, [0.0] * n), vc.Fixed(1, [1.0] * n)
    assert vc.Problem(lambda x, y, dy: ca.dot(y, dy) + x * y[0] ** 2, start, end).linear
    assert not vc.Problem(lambda x, y, dy: ca.dot(y, dy) + dy[n - 1] ** 2, start, end).linear
