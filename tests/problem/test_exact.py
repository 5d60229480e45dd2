"""Problems whose functions hold numbers, with these as parameters."""

import casadi as ca

import varcalc as vc
from varcalc.problem.exact import exactly


def values(problem):
    """L at x = 0.3, y = 1.7, v = -0.4."""
    given = [0.3, 1.7, -0.4, [], problem.parameter_values, []]
    return float(ca.Function("L", problem.symbols.all, [problem.integrand])(*given))


def stated(lagrangian, **options):
    return vc.Problem(lagrangian, vc.Fixed(0, 1), vc.Fixed(1, 2), **options)


def test_a_function_without_numbers_stays():
    problem = stated(lambda x, y, v, p: p.a * v**2 / 2 - 4 * y + ca.sqrt(1 + y**2.5), parameters={"a": 0.3})
    assert exactly(problem) is problem
    other = problem.with_parameters({"a": 0.7})
    assert exactly(other) is other


def test_numbers_become_parameters_each_once():
    problem = stated(lambda x, y, v: 5 * (0.2 * v**2) + 0.2 * y**3 - 5 * x)
    exact = exactly(problem)
    assert sorted(exact.parameters.values()) == [0.2, 5.0]
    assert values(exact) == 5 * (0.2 * 0.4**2) + 0.2 * 1.7**3 - 5 * 0.3


def test_other_values_of_the_parameters_and_names_that_are_taken():
    problem = stated(lambda x, y, v, p: 0.1 * (0.3 * v**2) * p.number_0, parameters={"number_0": 1.0})
    other = problem.with_parameters({"number_0": 3.0})
    exact = exactly(other)
    assert exact.parameters["number_0"] == 3.0
    assert sorted(exact.parameters.values()) == [0.1, 0.3, 3.0]


def test_a_function_that_has_changed_is_not_taken_for_the_one_that_was():
    factors = [0.3]
    problem = stated(lambda x, y, v: factors[0] * v**2)
    factors[0] = 0.4
    assert exactly(problem) is None
