"""Where an extremal exists, how many there are, and what is said beyond the last one."""

from functools import cache

import casadi as ca
import mpmath as mp
import pytest

import varcalc as vc

TOUCHING = mp.findroot(lambda t: t * mp.tanh(t) - 1, 1.2)
WIDEST = TOUCHING / mp.cosh(TOUCHING)
"""a_c: half the width of the widest film between two unit rings (t tanh t = 1)."""
INDIRECT = (vc.Collocation(), vc.Shooting(), vc.FirstIntegral())
METHODS = (vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), *INDIRECT)


def film(half):
    return vc.Problem(lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(-half, 1.0), vc.Fixed(half, 1.0))


@cache
def diagnosed(excess):
    """What is said of a film so much wider than the widest, and what solve and extremals gave for it."""
    return vc.diagnose(film(float(WIDEST) + excess))


def necks(half):
    """c of both catenaries y = c cosh(x/c), c cosh(half/c) = 1: the shallow one first."""

    def miss(ratio):
        return mp.log(mp.cosh(ratio) * half / ratio)

    return [half / mp.findroot(miss, bounds, "illinois") for bounds in ((0.1, TOUCHING), (TOUCHING, 12))]


def area(half, c):
    """The area of a catenoid over 2 pi."""
    return c * (half + c * mp.sinh(2 * half / c) / 2)


def conjugate(half, c):
    """Lindelof's construction: the tangents at conjugate points meet on the axis, so u - coth u agrees, u = x/c."""
    start = -mp.mpf(half) / c
    return c * mp.findroot(lambda u: u - mp.coth(u) - (start - mp.coth(start)), (0.05, -start), "illinois")


def bratu(strength):
    return vc.Problem(lambda x, y, v: v**2 / 2 - strength * ca.exp(y), vc.Fixed(0.0, 0.0), vc.Fixed(1.0, 0.0))


def bratu_heights(strength):
    """y(1/2) of both solutions: t = sqrt(2 lambda) cosh(t/4), y(1/2) = 2 log cosh(t/4)."""
    with mp.workdps(40):  # next to the fold, whose t lies between them, half of the digits go
        fold = 4 * mp.findroot(lambda u: u * mp.tanh(u) - 1, 1.2)

        def miss(t):
            return t - mp.sqrt(2 * mp.mpf(strength)) * mp.cosh(t / 4)

        roots = [mp.findroot(miss, bounds, "illinois", maxsteps=300) for bounds in ((0, fold), (fold, 60))]
        return [float(2 * mp.log(mp.cosh(t / 4))) for t in roots]


def oscillator(duration, end):
    return vc.Problem(lambda t, q, v: (v**2 - q**2) / 2, vc.Fixed(0.0, 0.0), vc.Fixed(float(duration), end))


def action(duration, end):
    """S of q = end sin(t)/sin(T)."""
    return float(end**2 * mp.cot(duration) / 2)


# two catenaries


@pytest.fixture(scope="module", params=[0.5, 0.6])
def both_films(request):
    return request.param, vc.extremals(film(request.param))


def test_both_catenaries_are_found_and_told_apart(both_films):
    half, found = both_films
    shallow, deep = necks(half)
    assert [s.y(0.0) for s in found] == pytest.approx([float(shallow), float(deep)], abs=1e-10)
    assert [s.value for s in found] == pytest.approx([float(area(half, c)) for c in (shallow, deep)], abs=1e-12)
    for solution, c in zip(found, (shallow, deep), strict=True):
        assert abs(solution.value - area(half, c)) <= 2 * solution.error.value <= 1e-12
        assert abs(solution.y(0.0) - c) <= 2 * solution.error.curve <= 1e-9
    assert [s.index for s in found] == [0, 1]
    assert [vc.verify(s).verdict for s in found] == [vc.Verdict.MINIMUM, vc.Verdict.SADDLE]
    assert len(found[0].conjugate_points) == 0
    assert found[1].conjugate_points == pytest.approx([float(conjugate(half, deep))], abs=1e-9)


def test_solve_takes_the_shallow_catenary(both_films):
    half, _ = both_films
    solution = vc.solve(film(half))
    assert solution.y(0.0) == pytest.approx(float(necks(half)[0]), abs=1e-6)
    assert abs(solution.value - float(area(half, necks(half)[0]))) <= solution.error.value


def test_both_catenaries_up_to_the_fold_and_none_beyond():
    found = diagnosed(-1e-7).evidence["extremals"]
    assert [s.y(0.0) for s in found] == pytest.approx([float(c) for c in necks(float(WIDEST) - 1e-7)], abs=1e-8)
    assert [s.index for s in found] == [0, 1]
    beyond = diagnosed(1e-6).evidence["extremals"]
    assert len(beyond) == 0
    assert "all with initial slope in [-1e+06, 1e+06]" in beyond.searched


@pytest.mark.parametrize("excess", [1e-6, 1e-3, 1.0])
def test_no_route_has_a_film_wider_than_the_widest(excess):
    problem = film(float(WIDEST) + excess)
    for method in (vc.Ritz(), vc.Collocation(), vc.FirstIntegral()):
        assert not vc.solve(problem, method, throw=False).status.ok, method


@pytest.mark.parametrize("excess", [1e-6, 1e-1])
def test_nor_has_ipopt(excess):
    assert not vc.solve(film(float(WIDEST) + excess), vc.Ritz(optimiser=vc.Ipopt()), throw=False).status.ok


@pytest.mark.parametrize("excess", [1e-6, 1e-1])
def test_the_ladder_has_no_film_wider_than_the_widest(excess):
    refused = diagnosed(excess).evidence["solution"]
    assert not refused.status.ok
    assert refused.verdict is vc.Verdict.NO_EXTREMAL


def test_shooting_has_no_film_wider_than_the_widest():
    assert not vc.solve(film(float(WIDEST) + 1e-6), vc.Shooting(), throw=False).status.ok


def test_the_fold_itself_by_continuation():
    scaled = vc.Problem(
        lambda t, y, v, p: y * ca.sqrt(p.half**2 + v**2), vc.Fixed(-1, 1), vc.Fixed(1, 1), parameters={"half": 0.6}
    )
    branch = vc.continue_branch(vc.solve(scaled), "half", until=0.8)
    assert branch.folds == pytest.approx([float(WIDEST)], abs=1e-12)
    assert branch.parameter[-1] == 0.6
    assert branch.solutions[-1].y(0.0) == pytest.approx(float(necks(0.6)[1]), abs=1e-9)


# two discs

DISCS = 1.0
"""The area of both discs over 2 pi."""


def equal_to_discs():
    """a_G: where the catenoid has the area of the discs; with r = a/c, c = 1/cosh r."""
    r = mp.findroot(lambda r: (r + mp.sinh(r) * mp.cosh(r)) / mp.cosh(r) ** 2 - DISCS, 0.6)
    return r / mp.cosh(r)


def test_below_goldschmidts_width_the_catenoid_beats_the_discs():
    half = float(equal_to_discs()) - 1e-3
    solution = vc.solve(film(half))
    assert solution.value < DISCS
    assert not solution.local


@pytest.mark.parametrize("half", [0.53, 0.6, 0.66])
def test_beyond_it_the_catenoid_is_a_minimum_among_its_neighbours_only(half):
    assert equal_to_discs() < half < WIDEST
    solution = vc.solve(film(half))
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
    assert solution.value > DISCS
    assert solution.local
    assert solution.lower == pytest.approx(DISCS, abs=1e-6)


# the oscillator


def test_before_the_conjugate_point_the_action_is_least():
    solution = vc.solve(oscillator(2, 1.0))
    assert solution.value == pytest.approx(action(2, 1), abs=1e-14)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize(("duration", "index"), [(4, 1), (7, 2), (10, 3)])
def test_beyond_it_the_motion_is_a_saddle_and_the_action_unbounded(duration, index):
    with pytest.raises(vc.VariationalError, match="unbounded below") as refusal:
        vc.solve(oscillator(duration, 1.0))
    assert refusal.value.verdict is vc.Verdict.UNBOUNDED
    [motion] = vc.extremals(oscillator(duration, 1.0))
    assert motion.value == pytest.approx(action(duration, 1), abs=1e-12)
    check = vc.verify(motion)
    assert (check.verdict, check.index) == (vc.Verdict.SADDLE, index)
    assert check.conjugate_points == pytest.approx([float(k * mp.pi) for k in range(1, index + 1)], abs=1e-10)


def test_conjugate_zero_ends_leave_a_continuum_of_minima():
    problem = oscillator(mp.pi, 0.0)
    assert vc.solve(problem, throw=False).verdict is vc.Verdict.DEGENERATE
    [one] = vc.extremals(problem)
    assert one.verdict is vc.Verdict.DEGENERATE
    assert one.value == pytest.approx(0.0, abs=1e-12)
    assert vc.verify(one).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize("end", [1.0, -2.0, 1e-3, 1e-6])
def test_at_half_a_period_any_other_end_leaves_no_motion_and_no_bound(end):
    # q = end t/pi + c sin t: the action is linear in c
    problem = oscillator(mp.pi, end)
    refusal = vc.solve(problem, throw=False)
    assert not refusal.status.ok
    assert refusal.verdict is vc.Verdict.UNBOUNDED


@pytest.mark.parametrize("halves", [2, 3])
@pytest.mark.parametrize("end", [0.0, 1e-6, 1.0])
def test_at_further_halves_the_action_is_unbounded(halves, end):
    assert vc.solve(oscillator(halves * mp.pi, end), throw=False).verdict is vc.Verdict.UNBOUNDED


@pytest.mark.parametrize("halves", [1, 2, 3])
def test_no_route_has_a_motion_where_there_is_none(halves):
    assert len(vc.extremals(oscillator(halves * mp.pi, 1.0))) == 0
    for method in METHODS:
        assert not vc.solve(oscillator(halves * mp.pi, 1.0), method, throw=False).status.ok, method


# Bratu's problem

STRONGEST = 8 * WIDEST**2
"""lambda_c."""


def test_both_solutions_of_bratus_problem():
    found = vc.extremals(bratu(3.0))
    assert sorted(s.y(0.5) for s in found) == pytest.approx(bratu_heights(3.0), abs=1e-10)
    assert [vc.verify(s).verdict for s in found] == [vc.Verdict.MINIMUM, vc.Verdict.SADDLE]
    assert [s.index for s in found] == [0, 1]
    assert vc.solve(bratu(3.0)).y(0.5) == pytest.approx(bratu_heights(3.0)[0], abs=1e-6)


def test_the_fold_of_bratus_problem():
    family = vc.Problem(
        lambda x, y, v, p: v**2 / 2 - p.k * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"k": 3.0}
    )
    branch = vc.continue_branch(vc.solve(family), "k", until=4.0)
    assert branch.folds == pytest.approx([float(STRONGEST)], abs=1e-11)
    assert branch.solutions[-1].y(0.5) == pytest.approx(bratu_heights(3.0)[1], abs=1e-9)


@pytest.mark.parametrize("excess", [1e-13, 1e-10, 1e-6, 1e-3, 5.0])
def test_no_route_has_a_solution_beyond_the_fold(excess):
    problem = bratu(float(STRONGEST) + excess)
    for method in (vc.Ritz(), vc.Collocation(), vc.FirstIntegral()):
        assert not vc.solve(problem, method, throw=False).status.ok, method


@pytest.mark.parametrize("excess", [1e-13, 4.8e-12, 1e-10, 1e-8, 1e-6, 1e-4])
def test_shooting_has_no_solution_beyond_the_fold(excess):
    assert not vc.solve(bratu(float(STRONGEST) + excess), vc.Shooting(), throw=False).status.ok


@pytest.mark.parametrize("short", [1e-6, 1e-8, 1e-10, 1e-12])
def test_shooting_has_one_just_before_it(short):
    strength = float(STRONGEST) - short
    solution = vc.solve(bratu(strength), vc.Shooting())
    missed = min(abs(solution.y(0.5) - height) for height in bratu_heights(strength))
    assert missed < 2 * solution.error.curve + 1e-15
    assert solution.error.curve < 1e-7


@pytest.mark.parametrize("excess", [1e-6, 0.1])
def test_beyond_the_fold_the_functional_has_no_bound_and_no_extremal(excess):
    problem = bratu(float(STRONGEST) + excess)
    assert vc.solve(problem, throw=False).verdict is vc.Verdict.UNBOUNDED
    assert len(vc.extremals(problem)) == 0


# what diagnose says


def test_of_a_film_too_wide_that_there_is_none():
    assert diagnosed(1e-6).verdict is vc.Verdict.NO_EXTREMAL
    assert diagnosed(-1e-7).verdict is not vc.Verdict.NO_EXTREMAL
