"""Lagrangians that are linear in the slope but for a kink, against closed forms of total variation."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from mpmath import mp

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.formulation.epigraph import epigraph_form
from varcalc.methods.ritz.ipopt import Ipopt

mp.dps = 25
TURNING = 2 * mp.pi


def of_a_wave(weight: int) -> tuple[mp.mpf, mp.mpf]:
    """Where the least of |y'| + weight (y - sin 2 pi x)^2 comes to rest before its crest, and its value there."""

    def turned(a: mp.mpf) -> mp.mpf:
        above = mp.quad(lambda x: mp.sin(TURNING * x) - mp.sin(TURNING * a), [a, mp.mpf(1) / 2 - a])
        return 2 * weight * above - 2  # what presses a rest takes the momentum from 1 to -1

    a = mp.findroot(turned, (0.01, 0.24), solver="anderson")
    level = mp.sin(TURNING * a)
    off = mp.quad(lambda x: (mp.sin(TURNING * x) - level) ** 2, [a, mp.mpf(1) / 2 - a])
    return a, 4 * level + 2 * weight * off


def wave(weight: float, factor: float = 1.0, slope: float = 0.0) -> vc.Lagrangian:
    return lambda x, y, v: factor * (ca.fabs(v - slope) + weight * (y - slope * x - ca.sin(2 * math.pi * x)) ** 2)


@pytest.mark.parametrize("weight", [8, 20, 400])
@pytest.mark.parametrize("ends", [(vc.Periodic(0, 1), vc.Periodic(0, 1)), (vc.Fixed(0, 0), vc.Fixed(1, 0))])
def test_a_wave_is_cut_at_its_crests(weight: int, ends: tuple[vc.End, vc.End]) -> None:
    solution = vc.solve(vc.Problem(wave(weight), *ends))
    a, value = of_a_wave(weight)
    assert solution.value == pytest.approx(float(value), abs=1e-12)
    assert solution.error.value < 1e-10
    x = np.array([0.25, 0.75])
    assert solution.curve(x, 0)[0] == pytest.approx(np.array([1, -1]) * float(mp.sin(TURNING * a)), abs=1e-9)


def test_a_kink_at_another_slope_and_in_another_unit_is_the_same() -> None:
    tilted = vc.Problem(wave(20, 1e3, 0.7), vc.Fixed(0, 0), vc.Fixed(1, 0.7))
    assert vc.solve(tilted).value == pytest.approx(1e3 * float(of_a_wave(20)[1]), rel=1e-12)


@pytest.mark.parametrize("weight", [9.0, 100.0])
def test_free_ends_of_a_ramp_are_at_rest(weight: float) -> None:
    # the momentum is 0 at the end and 1 where the rest ends, at 1 / sqrt(weight)
    rest = 1 / math.sqrt(weight)
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + weight * (y - x) ** 2, vc.Free(0), vc.Free(1))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(1 - 2 * rest + 2 * weight * rest**3 / 3, abs=1e-12)
    assert solution.curve(np.array([0.0, 1.0]), 0)[0] == pytest.approx([rest, 1 - rest], abs=1e-9)


def test_the_greatest_is_found_alike() -> None:
    problem = vc.Problem(lambda x, y, v: -ca.fabs(v) - 9 * (y - x) ** 2, vc.Free(0), vc.Free(1), maximise=True)
    assert vc.solve(problem).value == pytest.approx(-(1 - 2 / 3 + 2 / 9), abs=1e-12)


def test_of_two_wells_the_curve_is_in_the_lower_one() -> None:
    # y = 1 and y = -1 are as good but for a tilt: at rest at y the tilt is nothing but a number
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + 30 * (y**2 - 1) ** 2 + 0.5 * y + x, vc.Free(0), vc.Free(1))
    with mp.workdps(25):
        y = mp.findroot(lambda y: 120 * y * (y**2 - 1) + mp.mpf(1) / 2, -1)
        value = 30 * (y**2 - 1) ** 2 + y / 2 + mp.mpf(1) / 2
    assert vc.solve(problem).value == pytest.approx(float(value), abs=1e-12)


def told_of(solution: vc.Solution) -> float:
    """The limit that a refusal ends with."""
    return float(solution.message.rsplit(" ", 1)[1])


@pytest.mark.parametrize(("start", "infimum"), [(-0.5, 1.5), (-2.0, 3.0)])
def test_what_leaves_a_given_end_by_a_jump_is_refused_with_the_infimum(start: float, infimum: float) -> None:
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + 50 * (y - x) ** 2, vc.Fixed(0, start), vc.Fixed(1, 1))
    solution = vc.solve(problem, throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    assert told_of(solution) == pytest.approx(infimum, rel=1e-2)


def test_the_greater_branch_of_a_closed_curve_need_not_close() -> None:
    problem = vc.Problem(wave(20), vc.Periodic(0, 1), vc.Periodic(0, 1))
    lifted = epigraph_form(formulate(problem), lambda x: 0.1 * np.sin(2 * math.pi * x)[None])
    assert lifted is not None
    coarse = vc.Ritz(elements=12, degree=5, refine=False, starts=1, optimiser=Ipopt())
    found = coarse.solve(lifted, tol=1e-3, guess=lifted.start.curve)
    assert found.value == pytest.approx(float(of_a_wave(20)[1]), abs=0.02)  # 10 for the best constant


def test_a_jump_from_well_to_well_is_refused_with_the_supremum() -> None:
    problem = vc.Problem(
        lambda x, y, v: -ca.fabs(v) - 30 * (y**2 - 1) ** 2 - 10 * (x - 0.5) * y, vc.Free(0), vc.Free(1), maximise=True
    )
    solution = vc.solve(problem, throw=False)
    with mp.workdps(25):  # at rest in one well the momentum goes from 0 to that of a fall
        y = mp.findroot(lambda y: 60 * y * (y**2 - 1) - mp.mpf(1) / 4, 1)
        value = -(30 * (y**2 - 1) ** 2 - mp.mpf(5) / 2 * y + 2 * y)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    assert "the supremum is not attained: graphs that are ever steeper near x = 0.5" in solution.message
    assert told_of(solution) == pytest.approx(float(value), rel=1e-2)


def test_a_step_is_followed_by_a_jump_that_no_graph_has() -> None:
    # beside the step the momentum goes from 0 to 1 over half of the interval
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + 20 * (y - ca.if_else(x < 0.5, 0, 1)) ** 2, vc.Free(0), vc.Free(1))
    solution = vc.solve(problem, throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    assert told_of(solution) == pytest.approx(0.9 + 20 * 0.05**2, rel=1e-2)


def test_a_fit_that_changes_its_weight_is_followed_without_a_jump() -> None:
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + ca.if_else(x < 0.5, 5, 50) * (y - x) ** 2, vc.Free(0), vc.Free(1))
    first, last = 1 / math.sqrt(5), 1 / math.sqrt(50)
    value = 1 - first - last + (5 * first**3 + 50 * last**3) / 3
    assert vc.solve(problem).value == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("ends", [(vc.Free(0), vc.Free(1)), (vc.Free(0), vc.Fixed(1, 3))])
def test_constant_data_are_their_own_fit(ends: tuple[vc.End, vc.End]) -> None:
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.fabs(v) + 20 * (y - 3) ** 2, *ends))
    assert solution.value == pytest.approx(0.0, abs=1e-12)
    assert solution.y(np.array([0.0, 0.3, 1.0])) == pytest.approx(3.0, abs=1e-9)


def test_a_weak_fit_is_one_constant() -> None:
    # the momentum is at most weight / 4, which the kink takes
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.fabs(v) + 3.5 * (y - x) ** 2, vc.Free(0), vc.Free(1)))
    assert solution.value == pytest.approx(3.5 / 12, abs=1e-12)
    assert solution.dy(0.2) == 0.0


def test_the_rate_by_a_weight_is_that_of_the_closed_form() -> None:
    ramp = vc.Problem(
        lambda x, y, v, p: ca.fabs(v) + p.weight * (y - x) ** 2, vc.Free(0), vc.Free(1), parameters={"weight": 9.0}
    )
    assert vc.solve(ramp).sensitivities["weight"] == pytest.approx(2 / 3 / 27, rel=1e-10)


@pytest.mark.parametrize("rest", [0.2, 0.004])
def test_a_rest_begins_at_a_given_start_on_the_data(rest: float) -> None:
    # the data go above their start, and come back there after the rest
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v) + 40 * (y - x * (rest - x)) ** 2, vc.Fixed(0, 0), vc.Fixed(1, rest - 1)
    )
    assert vc.solve(problem).value == pytest.approx(1 - rest + 40 * rest**5 / 30, abs=1e-12)


def test_a_fit_by_absolute_values_of_a_ramp_is_at_rest_at_its_ends() -> None:
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + 8 * ca.fabs(y - x), vc.Free(0), vc.Free(1))
    assert vc.solve(problem).value == pytest.approx(1 - 2 / 8 + 1 / 8, abs=1e-12)


@pytest.mark.parametrize("ends", [(vc.Periodic(0, 1), vc.Periodic(0, 1)), (vc.Fixed(0, 0), vc.Fixed(1, 0))])
def test_a_fit_by_absolute_values_of_a_wave_is_cut_at_its_crests(ends: tuple[vc.End, vc.End]) -> None:
    # what presses a rest is 12 all along, and takes the momentum from 1 to -1
    problem = vc.Problem(lambda x, y, v: ca.fabs(v) + 12 * ca.fabs(y - ca.sin(2 * math.pi * x)), *ends)
    a = mp.mpf(1) / 4 - mp.mpf(1) / 12
    level = mp.sin(TURNING * a)
    off = mp.quad(lambda x: mp.sin(TURNING * x) - level, [a, mp.mpf(1) / 2 - a])
    assert vc.solve(problem).value == pytest.approx(float(4 * level + 24 * off), abs=1e-11)


def test_between_two_kinks_the_slope_costs_nothing_and_each_holds_a_line() -> None:
    weight = 400
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v - 1) + ca.fabs(v + 1) + weight * (y - 4 * x * (1 - x)) ** 2, vc.Free(0), vc.Free(1)
    )
    # lines of slope 1 lie from 0 to a, where the momentum comes to 2, and about x = 3/8, where it goes back to 0
    a = mp.findroot(lambda a: weight * (mp.mpf(3) / 2 * a**2 - mp.mpf(8) / 3 * a**3) - 1, 0.04)
    long = mp.cbrt(mp.mpf(3) / (2 * weight))
    b, c = mp.mpf(3) / 8 - long / 2, mp.mpf(3) / 8 + long / 2
    slopes = 2 * a + 2 * (4 * b * (1 - b) - 4 * a * (1 - a)) + 2 * long + 2 * (mp.mpf(1) / 2 - c)
    off = mp.quad(lambda x: ((a - x) * (3 - 4 * a - 4 * x)) ** 2, [0, a]) + 16 * long**5 / 30
    assert vc.solve(problem).value == pytest.approx(float(2 * (slopes + weight * off)), abs=1e-11)


def test_a_weak_fit_is_on_the_line_of_one_of_two_kinks() -> None:
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v + 1) + ca.fabs(v - 1) + 0.5 * (y - 10 * x) ** 2, vc.Free(0), vc.Free(1)
    )
    # the momentum is at most 9 / 8, of the 2 that the kink takes
    assert vc.solve(problem).value == pytest.approx(2 + 0.5 * 81 / 12, abs=1e-12)


@pytest.mark.parametrize("raised", [0.3, -0.05])
def test_a_level_of_a_fit_raises_all_of_it(raised: float) -> None:
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v) + 9 * (y - x) ** 2, vc.Free(0), vc.Free(1),
        [vc.Isoperimetric(lambda x, y, v: y, 0.5 + raised)],
    )  # fmt: skip
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(1 - 2 / 3 + 2 / 9 + 9 * raised**2, abs=1e-11)
    assert solution.multipliers[0] == pytest.approx(18 * raised, abs=1e-9)


def test_a_level_that_only_a_jump_keeps_is_refused_with_the_infimum() -> None:
    # the ramp is raised at its start, by a jump, and rests at its end
    raised, weight = 0.2, 5.0
    level = 0.5 + raised - raised**2 / 2
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v) + weight * (y - x) ** 2, vc.Fixed(0, 0), vc.Fixed(1, 1),
        [vc.Isoperimetric(lambda x, y, v: y, level)],
    )  # fmt: skip
    solution = vc.solve(problem, throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    infimum = 1 + weight * ((1 - raised) * raised**2 + raised**3 / 3)
    assert told_of(solution) == pytest.approx(infimum, rel=1e-2)


def test_a_load_far_narrower_than_the_lines_of_a_curve_is_summed():
    # the curve follows a quarter of the load up to where it rests, and what presses it there takes 1 to 0
    size, width, place = mp.mpf("0.939"), mp.mpf("0.01"), mp.mpf("0.401")

    def load(x):
        return size / width * mp.exp(-(((x - place) / width) ** 2))

    def pressed(a):
        return size * mp.sqrt(mp.pi) / 2 * (1 - mp.erf((a - place) / width))

    a = mp.findroot(
        lambda a: pressed(a) - (1 - a) * load(a) - 1, (place - 2.5 * width, place - width), solver="anderson"
    )
    height = load(a) / 4
    risen = -mp.quad(lambda x: load(x) ** 2 / 8, [place - 9 * width, place - 4 * width, a])
    exact = height + risen - height * pressed(a) + 2 * height**2 * (1 - a)
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v) + 2 * y**2 - 93.9 * ca.exp(-(((x - 0.401) / 0.01) ** 2)) * y,
        vc.Fixed(0, 0),
        vc.Free(1),
    )
    assert vc.solve(problem).value == pytest.approx(float(exact), abs=1e-10)
