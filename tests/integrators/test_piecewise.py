"""Runs through kinks and jumps, and along a switch where both sides lead back, against closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators import Dop853, Piecewise, RunOutcome, for_one
from varcalc.symbolic.sides import Sides

ENGINES = [Piecewise(for_one(4000, quick=True)), Piecewise(Dop853())]
s, y, c = ca.SX.sym("s"), ca.SX.sym("y", 2), ca.SX.sym("c", 1)


def system(acceleration):
    return ca.Function("system", [s, y, c], [ca.vertcat(y[1], acceleration)])


def in_a_wedge(t):
    """X'' = -sign(x) from rest at 1: parabolas, each of them half a bounce long."""
    quarter = math.sqrt(2)
    number, ahead = divmod(t + quarter, 2 * quarter)
    return (-1) ** number * (1 - (ahead - quarter) ** 2 / 2)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("direction", [1, -1])
def test_a_wedge_both_ways_and_between(engine, direction):
    flow = engine.compile(system(-ca.sign(y[0])))
    times = direction * np.linspace(0, 20, 7)
    run = flow.trajectory(times, np.array([1.0, 0.0]), np.zeros(1), dense=True)
    exact = [in_a_wedge(abs(t)) for t in times]
    np.testing.assert_allclose(run.states[:, 0], exact, rtol=0, atol=1e-12)
    between = direction * np.linspace(0, 20, 200)
    np.testing.assert_allclose(run.trajectory(between)[:, 0], [in_a_wedge(abs(t)) for t in between], rtol=0, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_many_and_up_to_a_stop_on_the_switch(engine):
    stops = ca.Function("stops", [s, y, c], [ca.vertcat(y[0] + 0.5, y[0])])
    flow = engine.compile(system(-ca.sign(y[0])), stops)
    states = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    landing = flow.ensemble(states, np.zeros((3, 1)), until=np.full(3, 20.0))
    np.testing.assert_allclose(landing.reached, [math.sqrt(2), 2.0, 2.0], rtol=1e-14)
    assert landing.stopped_by.tolist() == [1, 1, 1]
    further = flow.ensemble(landing.states[:2], np.zeros((2, 1)), until=np.full(2, 20.0), leaving=(1,))
    fall = [v - math.sqrt(v**2 - 1) for v in (math.sqrt(2), 2.0)]  # from 0 with -v to -1/2, pushed back by 1
    np.testing.assert_allclose(further.reached, fall, rtol=1e-13)
    assert further.stopped_by.tolist() == [0, 0]


@pytest.mark.parametrize("engine", ENGINES)
def test_dry_friction_slows_holds_and_lets_go(engine):
    """Half swings about ±0.3; and a body that is let go when A sin t = μ."""
    swing = engine.compile(system(-y[0] - 0.3 * ca.sign(y[1])))
    run = swing.trajectory(np.arange(5) * np.pi, np.array([2.0, 0.0]), np.zeros(1))
    np.testing.assert_allclose(run.states[:, 0], [2.0, -1.4, 0.8, -0.2, -0.2], rtol=0, atol=1e-10)
    pushed = engine.compile(system(0.9 * ca.sin(s) - 0.4 * ca.sign(y[1])))
    times = np.array([0.0, 0.3, 1.0, 2.0])
    run = pushed.trajectory(times, np.zeros(2), np.zeros(1))
    free = math.asin(0.4 / 0.9)
    speeds = [0.9 * (math.cos(free) - math.cos(t)) - 0.4 * (t - free) for t in times[2:]]
    np.testing.assert_allclose(run.states[:, 1], [0.0, 0.0, *speeds], rtol=0, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_steps_in_time(engine):
    """X'' = frac(t): its rate grows by a half and its place by v + 1/6 in each unit; floor(t) adds whole numbers."""
    flow = engine.compile(system(ca.fmod(s, c[0]) + ca.floor(s)))
    run = flow.trajectory(np.array([0.0, 20.5]), np.zeros(2), np.ones(1))
    assert run.states[-1, 1] == pytest.approx(20.5**2 / 2, rel=1e-13)
    backwards = flow.trajectory(np.array([0.0, -3.25]), np.zeros(2), np.ones(1))
    # before 0 the two add up to s - 1: fmod goes from 0 to -1 where floor is one below
    assert backwards.states[-1, 1] == pytest.approx(3.25**2 / 2 + 3.25, rel=1e-13)


def test_a_branch_that_is_not_meant_need_not_be_a_number():
    flow = ENGINES[0].compile(system(ca.if_else(y[0] > 0, -ca.sqrt(y[0] + 0.01), ca.log(1 - y[0]))))
    run = flow.trajectory(np.array([0.0, 10.0]), np.array([1.0, 0.0]), np.zeros(1))
    assert run.completed
    (x, v) = run.states[-1]

    def height(at):
        return 2 / 3 * ((at + 0.01) ** 1.5 - 0.001) if at > 0 else (1 - at) * math.log(1 - at) + at

    assert v**2 / 2 + height(x) == pytest.approx(height(1.0), rel=1e-13)


def test_a_switch_of_a_branch_that_is_not_meant_need_not_be_a_number():
    """On x > 0 there is |ln x| with its kink at 1, beyond it a constant pull."""
    rates = ca.if_else(y[0] > 0.1, -ca.fabs(ca.log(y[0])), 1.0)
    run = ENGINES[0].compile(system(rates)).trajectory(np.array([0.0, 9.0]), np.array([2.0, 0.0]), np.zeros(1))

    def height(x):
        inner = x * math.log(x) - x
        if x >= 1:
            return inner
        return -2 - inner if x > 0.1 else height(0.1 + 1e-16) - (x - 0.1)

    assert run.completed
    assert run.states[-1, 1] ** 2 / 2 + height(run.states[-1, 0]) == pytest.approx(height(2.0), rel=1e-12)


def test_what_depends_on_whole_numbers_only():
    """A checkerboard in time: the pull is 1 in every other half second, and -2 in the others."""
    pull = ca.if_else(ca.fmod(ca.floor(2 * s), 2) == 0, 1, -2)
    run = ENGINES[0].compile(system(pull)).trajectory(np.array([0.0, 3.25]), np.zeros(2), np.zeros(1))
    assert run.states[-1, 1] == pytest.approx(3 * (0.5 - 1.0) + 0.25, rel=1e-13)
    board = ca.if_else(ca.fmod(ca.floor(y[0]) + ca.floor(2 * y[0]), 2) > 0, 1, -1)  # 1 from 1/2 to 3/2, -1 up to 5/2
    run = ENGINES[0].compile(system(board)).trajectory(np.array([0.0, 1.0]), np.array([0.1, 2.0]), np.zeros(1))
    energies = [run.states[k, 1] ** 2 / 2 for k in (0, 1)]
    work = -0.4 + 1.0 - (run.states[1, 0] - 1.5)
    assert 1.5 < run.states[1, 0] < 2.5
    assert energies[1] - energies[0] == pytest.approx(work, rel=1e-12)


def test_where_the_equations_do_not_say_how_to_go_on():
    ridge = ENGINES[0].compile(system(ca.sign(y[0])))
    assert ridge.trajectory(np.array([0.0, 1.0]), np.zeros(2), np.zeros(1)).outcome is RunOutcome.UNDECIDED
    assert ridge.trajectory(np.array([0.0, 1.0]), np.array([0.0, -1.0]), np.zeros(1)).states[-1, 0] == pytest.approx(
        -1.5, rel=4e-16
    )


def test_switches_within_switches_are_read_on_each_side():
    f = ca.Function("f", [s, y, c], [ca.sign(ca.fabs(y[0]) - 1) + ca.fabs(c) * ca.remainder(y[1], 1)])
    sides = Sides(f, (0, 1))
    assert [p.stepped for p in sides.places] == [False, False, True]
    for point in ([0.2, 0.3], [-0.2, 0.7], [3.0, -2.6], [-3.0, 1.4]):
        arguments = np.array(sides.arguments(0.0, point, -2.0)).ravel()
        side = [1 if a > 0 else -1 for a in arguments[:2]] + [0]
        below = math.floor(arguments[2])
        on = sides.on(side)
        function = ca.Function("held", [*sides.symbols, sides.counts], [on.results[0], on.arguments])
        value, inside = function(0.0, point, -2.0, [below, below + (below < 0)])
        assert float(value) == pytest.approx(float(f(0.0, point, -2.0)), abs=1e-15)
        np.testing.assert_allclose(np.array(inside).ravel(), arguments, rtol=0, atol=1e-15)
