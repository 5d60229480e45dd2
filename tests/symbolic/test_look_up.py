import math
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.integrands import CompiledIntegrands, pointwise
from varcalc.symbolic.instructions import Call, instructions
from varcalc.symbolic.look_up import as_sums, cells, enclosed, in_cells, knots, within_knots

Y = ca.SX.sym("y")
FIRST, SECOND = np.array([0.0, 0.5, 0.7, 2.0]), np.array([-1.0, 0.0, 2.0, 3.0, 7.0])


def called_in(expression):
    function = ca.Function("f", [Y], [expression])
    return [i.operation.function for i in instructions(function) if isinstance(i.operation, Call)]


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_knots_of_a_table_and_of_its_derivatives_are_read(kind):
    table = ca.interpolant("n", kind, [FIRST, SECOND], np.arange(20.0) ** 2)
    bounded = within_knots(table(ca.vertcat(Y, Y**2)))
    functions = called_in(ca.vertcat(bounded, ca.gradient(bounded, Y), ca.hessian(bounded, Y)[0]))
    assert len(functions) > 2
    for function in functions:
        first, second = knots(function)
        assert first.tolist() == FIRST.tolist()
        assert second.tolist() == SECOND.tolist()
    (wide,) = called_in(bounded)
    assert cells(wide, 1, np.array([-2.0, 0.0, 1.0]), np.array([0.0, 1.0, 11.0])) == pytest.approx([2, 0.5, 3.5])


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_table_is_no_number_beyond_its_knots(kind):
    table = ca.interpolant("n", kind, [FIRST], FIRST**2)
    bounded = within_knots(table(Y))
    assert str(within_knots(bounded)) == str(bounded)
    value = ca.Function("f", [Y], [bounded, ca.gradient(bounded, Y)])
    for within in (0.0, 2.0, math.nextafter(2.0, 3.0), -1e-16):  # round-off beyond the last knot is on it
        assert float(value(within)[0]) == pytest.approx(float(table(round(within))), abs=1e-14)
    assert np.isnan(np.array(value(2.001))).all()
    assert np.isnan(np.array(value(-0.001))).all()


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_table_is_enclosed(kind):
    random = np.random.default_rng(1)
    for count in (4, 9, 60):
        edges = np.cumsum(random.uniform(0.1, 1, count))
        (table,) = called_in(within_knots(ca.interpolant("n", kind, [edges], random.standard_normal(count))(Y)))
        for width in (1e-4, 0.1, 4.0):
            least = random.uniform(edges[0] - 0.2, edges[-1], 100)
            greatest = least + width * random.uniform(0, 1, 100)
            for a, b, low, high in zip(least, greatest, *enclosed(table, least, greatest), strict=True):
                places = np.linspace(max(a, edges[0]), min(edges[-1], b), 300)
                values = np.array(table(places[None])).ravel()
                assert np.isnan(low) if b < edges[0] else low <= values.min() + 1e-12 <= high + 2e-12
                assert np.isnan(high) if b < edges[0] else values.max() <= high + 1e-12


def test_what_is_narrower_than_a_mesh_in_a_table_is_seen():
    # a v^2 from 0 to 1 is least at a v = const: 1 / (integral of 1 / a), the logarithm of a line between two knots
    values, h = np.ones(501), 1 / 500
    values[194] = 1e-3
    table = ca.interpolant("a", "linear", [np.linspace(0, 1, 501)], values)
    exact = 1 / (1 - 2 * h + 2 * h * math.log(1000) / (1 - 1e-3))
    solution = vc.solve(vc.Problem(lambda x, y, dy: table(x) * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(exact, abs=1e-9)
    assert abs(solution.value - exact) <= solution.error.value


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_no_curve_leaves_a_table_of_the_ordinate(kind):
    # a bspline is 0 beyond its knots, and a way through nothing takes no time
    heights = np.linspace(-1, 2, 21)
    table = ca.interpolant("n", kind, [heights], 1 + 0.3 * np.sin(7 * np.linspace(0, 1, 21)))

    def index(y):
        return float(table(y))

    edges = [0.0, *heights[(heights > 1e-9) & (heights < 1 - 1e-9)], 1.0]

    def over(integrand, c):  # n / sqrt(1 + y'^2) = c along the ray, by Beltrami
        return sum(quad(integrand, a, b, args=(c,), epsabs=1e-13)[0] for a, b in pairwise(edges))

    c = brentq(lambda c: over(lambda y, c: c / math.sqrt(index(y) ** 2 - c**2), c) - 1, 0.1, 0.69, xtol=1e-15)
    exact = over(lambda y, c: index(y) ** 2 / math.sqrt(index(y) ** 2 - c**2), c)
    solution = vc.solve(vc.Problem(lambda x, y, dy: table(y) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(exact, abs=1e-9)


def test_a_narrow_spike_in_a_table_of_the_ordinate_is_not_missed():
    # whoever crosses it pays: more than the straight line costs without it
    heights = np.linspace(-1, 2, 301)
    values = np.where(np.arange(301) == 150, 4.0, 1.0)
    table = ca.interpolant("n", "linear", [heights], values)
    ray = vc.Problem(lambda x, y, dy: table(y) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = vc.solve(ray, vc.Ritz(), throw=False)
    assert not (solution.status.ok and solution.value < math.sqrt(2) + 1e-3)


def test_an_end_beyond_a_table_is_refused():
    table = ca.interpolant("n", "bspline", [FIRST], 1 + FIRST)
    with pytest.raises(ValueError, match=r"end = Fixed.*outside the domain"):
        vc.Problem(lambda x, y, dy: table(y) * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 3))


@pytest.mark.parametrize(("kind", "degree", "tables"), [("linear", None, 2), ("bspline", 3, 2), ("bspline", 5, 0)])
def test_tables_of_one_argument_are_cubics_in_cells(kind, degree, tables):
    """One table in the argument of another; a spline of another degree stays what it is."""
    y, options = ca.SX.sym("y"), {"degree": [degree]} if degree else {}
    outer = ca.interpolant("outer", kind, [np.linspace(0, 2, 13)], np.exp(np.linspace(0, 2, 13)), options)
    edges = np.linspace(0, 2, 14) ** 1.5
    inner = ca.interpolant("inner", kind, [edges], np.sqrt(np.linspace(0.1, 3.9, 14)), options)
    written = within_knots(ca.sin(outer(inner(y))) + inner(y) ** 2)
    cells = in_cells(written, y)
    assert len(cells.tables) == tables
    places = np.random.default_rng(7).uniform(edges[0], edges[-1], 50)
    there = ca.Function("there", [y, cells.constants], [cells.expression])
    own = [float(there(place, row)) for place, row in zip(places, cells.at(places[:, None]), strict=True)]
    plain = ca.Function("plain", [y], [written])
    assert own == pytest.approx([float(plain(place)) for place in places], rel=1e-12)
    if tables:
        assert np.all(np.isnan(cells.at(np.array([[edges[0] - 0.1], [edges[-1] + 0.1]]))))


def test_a_linear_table_on_whose_knots_the_curve_may_rest_is_named():
    """The least curve of a table with a valley rests at 0, one of many kinks, which are not read as such."""
    places = np.linspace(-2, 2, 101)
    table = ca.interpolant("t", "linear", [places], 9 * np.abs(places) + 0.02 * np.cos(40 * places))
    held = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + table(y), vc.Fixed(0, 1), vc.Fixed(3, 1)), throw=False)
    assert not held.status.ok
    assert "a linear table of y has a kink at each knot" in held.message


def test_a_table_of_few_lines_is_a_sum_of_absolute_values():
    random = np.random.default_rng(3)
    for count in (2, 3, 12):
        edges = np.cumsum(random.uniform(0.1, 1, count))
        table = within_knots(ca.interpolant("n", "linear", [edges], random.standard_normal(count))(Y**2))
        written = as_sums(table, Y)
        assert str(written).count("fabs") == count - 2
        both = ca.Function("both", [Y], [table, written, ca.gradient(table, Y), ca.gradient(written, Y)])
        places = np.sqrt(random.uniform(edges[0], edges[-1], 50))
        one, other, rate, other_rate = (np.asarray(v).ravel() for v in both.map(50)(places[None]))
        assert other == pytest.approx(one, abs=1e-14 * np.abs(one).max())
        assert other_rate == pytest.approx(rate, abs=1e-12 * np.abs(rate).max())
        assert np.isnan([float(v) for v in both(math.sqrt(edges[-1] + 1e-3))]).all()


def test_knots_at_which_a_table_is_straight_are_no_kinks():
    places = np.linspace(-2, 2, 1001)
    written = as_sums(within_knots(ca.interpolant("n", "linear", [places], 9 * np.abs(places) + places)(Y)), Y)
    assert str(written).count("fabs") == 1


def test_other_tables_stay_tables():
    x = ca.SX.sym("x")
    smooth = within_knots(ca.interpolant("n", "bspline", [SECOND], SECOND**2)(Y))
    along = within_knots(ca.interpolant("n", "linear", [SECOND], SECOND**2)(x))
    long = within_knots(ca.interpolant("n", "linear", [np.arange(100.0)], np.arange(100.0) ** 2)(Y))  # bends everywhere
    flat = within_knots(ca.interpolant("n", "linear", [FIRST, SECOND], np.arange(20.0))(ca.vertcat(Y, Y)))
    for table in (smooth, along, long, flat):
        assert str(as_sums(table, Y)) == str(table)


def test_a_table_that_is_convex_is_proved_so():
    convex, bent = ([8.0, 0.0, 1.0], [0.0, 3.0, 1.0])
    for values, proved in ((convex, True), (bent, False)):
        table = ca.interpolant("n", "linear", [[-2.0, 0.0, 2.0]], values)
        solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + table(y), vc.Fixed(0, 1), vc.Fixed(1, 1.5)))  # noqa: B023
        assert ("proved convex" in solution.searched) == proved


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_integrands_of_a_table_and_their_derivatives_are_what_casadi_makes_of_them(kind):
    heights = np.linspace(-1, 2, 61)
    table = ca.interpolant("index", kind, [heights.tolist()], (1 + heights**2 + np.sin(3 * heights)).tolist())
    level = vc.Isoperimetric(lambda x, y, dy, p: table(y + p.a * x) * dy**2, 1.0)
    problem = vc.Problem(
        lambda x, y, dy, p: p.a * table(y) * ca.sqrt(1 + dy**2) + table(y / 2) * table(x),
        vc.Fixed(0, 0.5), vc.Fixed(1, 0.5), [level], parameters={"a": 0.3},
    )  # fmt: skip
    form = formulate(problem)
    within, edges = np.random.default_rng(5).uniform(-0.9, 1.6, 60), [-1 - 1e-13, 2 + 1e-13, -1.01, 2.01]
    y = np.concatenate([within, [heights[4]], edges])
    x, dy = np.linspace(0, 1, len(y)), np.linspace(-3, 3, len(y))
    source = CompiledIntegrands(form, x, np.array([[0.3]]))
    values, gradients, hessians = source.derivatives(np.column_stack([y, dy]))
    found = np.concatenate([values[..., None], gradients, hessians.reshape(*hessians.shape[:2], -1)], axis=2)
    rows = pointwise(form).map(len(y))(x, y, dy, np.zeros((0, len(y))), np.full(len(y), 0.3), np.zeros((0, len(y))))
    expected = np.asarray(rows).T.reshape(found.shape)
    np.testing.assert_allclose(found[:-4], expected[:-4], rtol=1e-10, atol=1e-10)
    # beyond an edge by round-off CasADi has its value, and no slope; what is further beyond is no number
    np.testing.assert_allclose(found[-4:, 0, 0], expected[-4:, 0, 0], rtol=1e-10)
    assert np.isnan(found[-4:, 0, 0]).tolist() == [False, False, True, True]
    np.testing.assert_array_equal(source.values(np.column_stack([y, dy])), values)
