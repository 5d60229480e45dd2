"""Many runs with stops of their own, against closed forms: the same questions put to each engine."""

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators import NONE, OUTCOMES, Dop853, OnDemand, RunOutcome, Taylor, for_many

pytest.importorskip("heyoka", reason="the Taylor engine is heyoka's")

ENGINES = [Taylor(), Dop853(), OnDemand()]
STOPPED, BLOW_UP, NOT_FINITE, TOO_MANY = (
    OUTCOMES.index(o)
    for o in (RunOutcome.STOPPED, RunOutcome.BLOW_UP, RunOutcome.NOT_FINITE, RunOutcome.TOO_MANY_STEPS)
)


def free_fall(stops=lambda y, c: y[0]):
    """Height, speed and elapsed time; the constant is a time."""
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 3), ca.SX.sym("c")
    system = ca.Function("fall", [s, y, c], [ca.vertcat(y[1], -1, 1)])
    return system, ca.Function("stops", [s, y, c], [stops(y, c)])


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_every_run_goes_to_its_own_stop(engine):
    heights = np.geomspace(0.01, 100.0, 37)  # more than one batch, and no multiple of its width
    flow = engine.compile(*free_fall())
    landing = flow.ensemble(np.column_stack([heights, 0 * heights, 0 * heights]), np.zeros((37, 1)))
    assert np.all(landing.outcomes == STOPPED)
    np.testing.assert_allclose(landing.reached, np.sqrt(2 * heights), rtol=4e-15)
    np.testing.assert_allclose(landing.states[:, 1], -np.sqrt(2 * heights), rtol=4e-15)
    np.testing.assert_allclose(landing.states[:, 0], 0.0, atol=1e-13)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_a_distance_is_met_where_it_is_although_its_series_soon_ends(engine):
    # along a straight line the series of √(x² + b²) ends at |x| = b, that of the motion never
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c")
    line = ca.Function("line", [s, y, c], [ca.vertcat(1, 0)])
    flow = engine.compile(line, ca.Function("stops", [s, y, c], [ca.sqrt(y[0] ** 2 + y[1] ** 2) - 1]))
    beside = np.geomspace(1e-3, 0.9, 19)
    half = np.sqrt(1 - beside**2)
    across = flow.ensemble(np.column_stack([-half, beside]), np.zeros((19, 1)), until=5.0, leaving=(0,))
    towards = flow.ensemble(np.column_stack([-2 - half, beside]), np.zeros((19, 1)), until=5.0)
    np.testing.assert_allclose(across.reached, 2 * half, rtol=1e-14)
    np.testing.assert_allclose(towards.reached, 2, rtol=1e-14)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_the_first_of_several_stops_counts(engine):
    flow = engine.compile(*free_fall(lambda y, c: ca.vertcat(y[0], y[2] - c)))
    start = np.tile([0.5, 0.0, 0.0], (9, 1))
    times = np.linspace(0.6, 1.4, 9)[:, None]
    landing = flow.ensemble(start, times)
    np.testing.assert_allclose(landing.reached, np.minimum(times[:, 0], 1.0), rtol=4e-15)
    np.testing.assert_array_equal(landing.stopped_by[[0, 1, 7, 8]], [1, 1, 0, 0])


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
@pytest.mark.parametrize("offset", [0.0, 1e-17, -1e-17])
def test_a_run_that_leaves_a_stop_comes_back_to_it(engine, offset):
    speeds = np.array([1e-3, 0.3, 1.0, 20.0])
    flow = engine.compile(*free_fall())
    landing = flow.ensemble(np.column_stack([0 * speeds + offset, speeds, 0 * speeds]), np.zeros((4, 1)), leaving=(0,))
    np.testing.assert_allclose(landing.reached, 2 * speeds, rtol=1e-13, atol=3e-14)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_a_run_that_fails_leaves_the_others_alone(engine):
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c")
    system = ca.Function("blow", [s, y, c], [ca.vertcat(y[0] ** 2 * ca.sqrt(y[1]), 0)])
    stops = ca.Function("stops", [s, y, c], [y[0] - c])
    start = np.array([[1.0, 1.0]] * 8 + [[1.0, -1.0]] + [[1.0, 1.0]] * 3)  # a root of a negative number in row 8
    targets = np.linspace(2.0, 5.0, 12)[:, None]
    targets[[3, 10]] = -1.0  # never met: the solution is infinite at s = 1
    landing = engine.compile(system, stops).ensemble(start, targets)
    good = np.delete(np.arange(12), [3, 8, 10])
    assert np.all(landing.outcomes[good] == STOPPED)
    np.testing.assert_allclose(landing.reached[good], 1 - 1 / targets[good, 0], rtol=1e-12)
    assert landing.outcomes[8] == NOT_FINITE
    assert set(landing.outcomes[[3, 10]]) <= {BLOW_UP, TOO_MANY}
    assert np.all(np.isfinite(landing.states))
    assert np.all(landing.stopped_by[[3, 8, 10]] == NONE)


@pytest.mark.parametrize("engine", [Taylor(ensemble_steps=7), Dop853(most_steps=7)], ids=lambda e: e.name)
def test_steps_are_bounded(engine):
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c")
    system = ca.Function("turn", [s, y, c], [ca.vertcat(y[1], -y[0])])
    stops = ca.Function("stops", [s, y, c], [y[0] - c])
    landing = engine.compile(system, stops).ensemble(np.array([[1.0, 0.0]] * 5), np.array([[2.0]] * 4 + [[0.5]]))
    assert np.all(landing.outcomes[:4] == TOO_MANY)
    assert landing.outcomes[4] == STOPPED
    assert landing.reached[4] == pytest.approx(np.pi / 3, rel=1e-13)


def test_many_runs_are_spread_over_the_cores():
    heights = np.geomspace(0.01, 100.0, 2000)
    landing = (
        Taylor()
        .compile(*free_fall())
        .ensemble(np.column_stack([heights, 0 * heights, 0 * heights]), np.zeros((2000, 1)))
    )
    np.testing.assert_allclose(landing.reached, np.sqrt(2 * heights), rtol=4e-15)


def test_a_system_that_depends_on_the_abscissa_is_refused():
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c", 0)
    with pytest.raises(ValueError, match="must not depend on s"):
        Dop853().compile(ca.Function("f", [s, y, c], [s]), ca.Function("g", [s, y, c], [y]))


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_an_ensemble_goes_to_abscissae_of_its_own(engine):
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c")
    flow = engine.compile(ca.Function("blow", [s, y, c], [c * y**2]))
    until = np.linspace(0.0, 0.9, 11)
    until[4] = 2.0  # beyond the pole, in the middle of a batch
    landing = flow.ensemble(np.ones((11, 1)), np.ones((11, 1)), until=until)
    good = np.arange(11) != 4
    np.testing.assert_allclose(landing.states[good, 0], 1 / (1 - until[good]), rtol=1e-10)
    np.testing.assert_array_equal(landing.reached[good], until[good])
    assert np.all(landing.outcomes[good] == OUTCOMES.index(RunOutcome.COMPLETED))
    assert landing.outcomes[4] in (BLOW_UP, TOO_MANY)
    assert np.isfinite(landing.states[4, 0])


@pytest.mark.parametrize(("engine", "off"), [(Taylor(), 1e-13), (Dop853(), 1e-9)], ids=["Taylor", "DOP853"])
def test_runs_that_fail_side_by_side_are_told_as_far_as_they_come(engine, off):
    """y = 1 / (1 / y(0) - s), with its pole before the last abscissa for most of what is carried together."""
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c", 0)
    flow, places = engine.compile(ca.Function("blow", [s, y, c], [y**2])), np.linspace(0, 2, 33)
    starts = np.geomspace(0.1, 1.97, 80)
    runs = flow.trajectories(places, starts[:, None], np.zeros(0))
    landing = flow.ensemble(starts[:, None], np.zeros((80, 0)), until=2.0)
    for k, run in enumerate(runs):
        whole = starts[k] < 0.5
        assert run.completed == (landing.outcomes[k] == OUTCOMES.index(RunOutcome.COMPLETED)) == whole
        known = np.isfinite(run.states[:, 0])
        np.testing.assert_array_equal(known, places < (np.inf if whole else 1 / starts[k]))
        np.testing.assert_allclose(1 / run.states[known, 0], 1 / starts[k] - places[known], rtol=0, atol=off)
        for end in (run.reached, landing.reached[k]):
            assert end == pytest.approx(2.0 if whole else 1 / starts[k], rel=1e-9)
        assert np.isfinite(landing.states[k, 0])


def parabola():
    """A stone thrown upwards from 0 at speed 1: it comes to 1/2 at s = 1."""
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c")
    system = ca.Function("fall", [s, y, c], [ca.vertcat(y[1], -1)])
    return system, ca.Function("stops", [s, y, c], [ca.vertcat(y[0] - c, y[0] + 1)])


@pytest.mark.parametrize("engine", [Taylor(), OnDemand()], ids=lambda e: e.name)
def test_the_first_of_two_zeros_in_one_step_counts(engine):
    """The solution is a polynomial, so that no step is too long for it, and both zeros lie close together."""
    gaps = np.geomspace(1e-12, 0.3, 23)
    flow = engine.compile(*parabola())
    landing = flow.ensemble(np.tile([0.0, 1.0], (23, 1)), (0.5 - gaps)[:, None])
    assert np.all(landing.stopped_by == 0)
    np.testing.assert_allclose(1 - landing.reached, np.sqrt(2 * gaps), rtol=1e-3, atol=1e-7)
    assert np.all(landing.reached < 1)


def test_a_stop_that_is_nearly_touched_is_passed():
    gaps = np.geomspace(1e-12, 0.3, 23)
    landing = Taylor().compile(*parabola()).ensemble(np.tile([0.0, 1.0], (23, 1)), (0.5 + gaps)[:, None])
    assert np.all(landing.stopped_by == 1)
    np.testing.assert_allclose(landing.reached, 1 + np.sqrt(3), rtol=1e-14)


def test_a_stop_that_is_touched_is_met_there_or_passed():
    landing = Taylor().compile(*parabola()).ensemble(np.array([[0.0, 1.0]]), np.array([[0.5]]))
    assert landing.stopped_by[0] == 1 or landing.reached[0] == pytest.approx(1, abs=1e-7)


def along_a_line(level):
    """x' = v, with a stop at a zero of the level and one at x = 3."""
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 0)
    system = ca.Function("line", [s, y, c], [ca.vertcat(y[1], 0)])
    return system, ca.Function("stops", [s, y, c], [ca.vertcat(level(y[0]), y[0] - 3)])


@pytest.mark.parametrize(
    ("level", "touched"),
    [
        (lambda x: ca.cos(x) - 1, 0.0),
        (lambda x: (x - 0.5) ** 4, 0.5),
        (lambda x: ca.sin(1 / (x + 2)) - 1, 2 / np.pi - 2),
    ],
)
def test_round_off_beside_a_stop_that_is_touched_holds_nobody_up(level, touched):
    """There the level has any sign, and zeros that no series tells."""
    speeds = np.random.default_rng(0).uniform(0.5, 1.5, 500)
    start = np.column_stack([np.full(500, -1.8), speeds])
    landing = Taylor().compile(*along_a_line(level)).ensemble(start, np.zeros((500, 0)))
    passed = landing.stopped_by == 1
    assert np.all(passed | (np.abs(landing.states[:, 0] - touched) < 1e-7))
    np.testing.assert_allclose(landing.reached[passed], 4.8 / speeds[passed], rtol=1e-14)
    assert passed.mean() > 0.9
    assert landing.steps.max() < 1000


def test_a_stop_that_is_crossed_at_a_triple_zero_is_met():
    """Round-off of a cube is its sign up to its third root."""
    speeds = np.random.default_rng(0).uniform(0.5, 1.5, 500)
    start = np.column_stack([np.zeros(500), speeds])
    landing = Taylor().compile(*along_a_line(lambda x: (x - 0.5) ** 3)).ensemble(start, np.zeros((500, 0)))
    assert np.all(landing.stopped_by == 0)
    np.testing.assert_allclose(landing.states[:, 0], 0.5, atol=1e-4)


def test_a_run_that_leaves_a_stop_along_it_goes_on():
    """At the top of its way, on the stop: it moves off it by the second derivative only."""
    landing = Taylor().compile(*parabola()).ensemble(np.array([[0.5, 0.0]]), np.array([[0.5]]), leaving=(0,))
    assert landing.stopped_by[0] == 1
    assert landing.reached[0] == pytest.approx(np.sqrt(3), rel=1e-14)


@pytest.mark.parametrize("engine", [*ENGINES, for_many()], ids=lambda e: e.name)
def test_a_floor_is_told_at_the_end_of_the_first_step_below_it(engine):
    """y = exp(-s) sinks to 0 in the limit; the second stop is a time, met where it is sooner, and the last two floors.

    On the way back up nothing is below the other floor, and a run that leaves a floor goes on.
    """
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 2)
    system = ca.Function("sinking", [s, y, c], [ca.vertcat(c[0] * y[0], 1)])
    stops = ca.Function("stops", [s, y, c], [ca.vertcat(y[0] + 1, y[1] - c[1], y[0] - 1e-6, 2 - y[0])])
    flow = engine.compile(system, stops, at_ends=(2, 3))
    rates, times = np.array([-1.0, -1.0, 1.0, 0.5]), np.array([np.inf, 3.0, 1e3, 1.0])
    landing = flow.ensemble(np.tile([1.0, 0.0], (4, 1)), np.column_stack([rates, times]))
    assert np.all(landing.outcomes == STOPPED)
    np.testing.assert_array_equal(landing.stopped_by, [2, 1, 3, 1])
    np.testing.assert_allclose(landing.states[:, 0], np.exp(rates * landing.reached), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(landing.reached[[1, 3]], [3.0, 1.0], rtol=1e-12)
    assert np.log(1e6) * (1 - 1e-6) <= landing.reached[0] < np.log(1e6) + 20
    assert np.log(2) * (1 - 1e-6) <= landing.reached[2] < np.log(2) + 20
    on = flow.ensemble(landing.states[:1], np.array([[-1.0, 60.0]]), leaving=(2,))
    assert on.reached[0] > 0


def test_interpreted_and_compiled_steps_agree():
    heights = np.geomspace(0.01, 100.0, 300)
    start = np.column_stack([heights, 0 * heights, 0 * heights])
    ends = []
    for columns in (0, 10**9):
        flow = Taylor().compile(*free_fall())
        flow.stops._call._seen = columns
        ends.append(flow.ensemble(start, np.zeros((300, 1))))
        assert (flow.stops._call._compiled is None) == (columns == 0)
    np.testing.assert_allclose(ends[0].states, ends[1].states, rtol=1e-14, atol=1e-14)


def test_runs_are_many_more_than_step_together():
    heights = np.geomspace(0.01, 100.0, 9000)
    start = np.column_stack([heights, 0 * heights, 0 * heights])
    landing = Taylor().compile(*free_fall()).ensemble(start, np.zeros((9000, 1)))
    np.testing.assert_allclose(landing.reached, np.sqrt(2 * heights), rtol=4e-15)
