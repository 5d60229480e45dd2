"""Abscissae at which a problem switches, read from its expressions."""

import math

import casadi as ca
import pytest

import varcalc as vc
from varcalc.problem.breaks import breaks, crowded, on_curve


def problem(lagrangian, **options):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, 1), **options)


@pytest.mark.parametrize(
    ("weight", "expected"),
    [
        (lambda x: ca.if_else(x > 1 / 3, 1.01, 1), [1 / 3]),
        (lambda x: 1 + ca.floor(5 * x), [0.2, 0.4, 0.6, 0.8]),
        (lambda x: 1 + ca.fabs(ca.sin(20 * x)), [k * math.pi / 20 for k in range(1, 7)]),
        (lambda x: 1 + ca.fmax(x**2 - 0.25, 0), [0.5]),
        (lambda x: ca.if_else(ca.logic_and(x > 0.3, x < 0.3 + 1e-9), 2, 1), [0.3, 0.3 + 1e-9]),
        (lambda x: 2 + ca.sign(x + 1), []),
        (ca.cos, []),
    ],
)
def test_they_are_read_to_round_off(weight, expected):
    assert breaks(problem(lambda x, y, dy: weight(x) * dy**2)) == pytest.approx(expected, abs=1e-15, rel=1e-13)


def test_those_given_are_kept_and_those_read_are_joined_to_them():
    given = problem(lambda x, y, dy: ca.if_else(x < 0.5, 1, 2) * dy**2, breakpoints=[0.25, 0.5])
    assert breaks(given) == (0.25, 0.5)
    assert given.breakpoints == (0.25, 0.5)


def test_they_move_with_parameters():
    step = problem(lambda x, y, dy, p: ca.if_else(x < p.at, 1, 2) * dy**2, parameters={"at": 0.25})
    assert breaks(step) == (0.25,)
    assert breaks(step.with_parameters({"at": 0.75})) == (0.75,)


def test_too_many_to_be_placed_are_left_out_and_no_answer_is_called_right():
    given = problem(lambda x, y, dy: (1 + ca.fabs(ca.sin(4e3 * x))) * dy**2)
    assert breaks(given) == ()
    assert crowded(given) is not None
    assert crowded(problem(lambda x, y, dy: (1 + ca.floor(1e6 * x)) * dy**2)) is not None
    solution = vc.solve(given, vc.Ritz(elements=4, refine=False), throw=False)
    assert not solution.status.ok
    assert "at more abscissae than a mesh can be broken at" in solution.message


def test_what_switches_on_the_curve_has_no_abscissa():
    given = problem(lambda x, y, dy: ca.fabs(dy) + ca.fmax(y, x))
    assert breaks(given) == ()
    assert [s.word for s in on_curve(given)] == ["fabs", "fmax"]


@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.Collocation(), vc.Shooting(), vc.FirstIntegral()])
def test_every_method_has_its_mesh_break_there(method):
    """Of L = w(x) y'^2 the least value is the inverse of the integral of 1 / w."""
    for weight, inverse in ((lambda x: ca.if_else(x > 1 / 3, 1.01, 1), 1 / 3 + 2 / 3 / 1.01),
                            (lambda x: 1 + ca.floor(3 * x), (1 + 1 / 2 + 1 / 3) / 3)):  # fmt: skip
        solution = vc.solve(problem(lambda x, y, dy, weight=weight: weight(x) * dy**2), method)
        assert abs(solution.value - 1 / inverse) <= solution.error.value + 1e-14 / inverse
        assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_a_comparison_of_what_itself_jumps():
    # of fmod(8 x, .3) < .1: where a period begins, and a third further on
    problem = vc.Problem(
        lambda x, y, v: ca.if_else(ca.fmod(8 * x, 0.3) < 0.1, 2, 1) * v**2, vc.Fixed(0.01, 0), vc.Fixed(0.3, 1)
    )
    expected = sorted([k * 0.3 / 8 for k in range(1, 8)] + [(k * 0.3 + 0.1) / 8 for k in range(8)])
    assert list(breaks(problem)) == pytest.approx([x for x in expected if 0.01 < x < 0.3], abs=1e-12)


@pytest.mark.parametrize("span", [(0.0, 1.0), (-1.0, 2.0)])
def test_a_jump_exactly_at_an_end_is_kept_off_the_integrator(span):
    """Of floor(x + 1) at the end only the value at one point differs, which no integral sees."""
    a, b = span
    steps = range(round(b - a))
    least = 1 / sum(1 / (2 + k) for k in steps)
    given = vc.Problem(lambda x, y, v: (2 - a + ca.floor(x)) * v**2, vc.Fixed(a, 0), vc.Fixed(b, 1))
    solution = vc.solve(given, vc.Shooting())
    assert abs(solution.value - least) <= 4e-15 * least
