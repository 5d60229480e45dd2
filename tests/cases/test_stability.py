"""Buckling: the straight state of a compressed rod changes its index at Euler's loads."""

import casadi as ca
import mpmath as mp
import pytest

import varcalc as vc

EULER = float(mp.pi**2)
ANTISYMMETRIC = float(4 * mp.findroot(lambda u: mp.tan(u) - u, 4.5) ** 2)
"""The second load of a clamped rod, tan(k/2) = k/2."""


def rod(load, clamped):
    """int (w^2 - P v^2)/2 over a unit length, P in units of EI/L^2."""
    ends = [(x, 0, 0) if clamped else (x, 0) for x in (0, 1)]
    return vc.Problem(lambda x, y, v, w: (w**2 - load * v**2) / 2, *(vc.Fixed(*end) for end in ends), order=2)


PINNED = [(0.99, 0), (1.01, 1), (3.99, 1), (4.01, 2), (9.01, 3)]
CLAMPED = [(3.99, 0), (4.01, 1), (0.999 * ANTISYMMETRIC / EULER, 1), (1.001 * ANTISYMMETRIC / EULER, 2), (16.1, 3)]


@pytest.mark.parametrize(
    ("clamped", "share", "index"), [(c, *case) for c, cases in ((False, PINNED), (True, CLAMPED)) for case in cases]
)
def test_the_index_counts_the_loads_passed(clamped, share, index):
    problem = rod(share * EULER, clamped)
    straight = vc.solve(problem, vc.Collocation(), guess=lambda x: 0.0, throw=False)
    check = vc.verify(straight)
    assert check.index == index
    assert check.verdict is (vc.Verdict.SADDLE if index else vc.Verdict.MINIMUM)
    # quadratic: where the index is positive there is no bound
    solution = vc.solve(problem, throw=False)
    assert (solution.status.ok, solution.verdict) == ((False, vc.Verdict.UNBOUNDED) if index else (True, None))


@pytest.mark.parametrize(("clamped", "load"), [(False, EULER), (True, 4 * EULER), (True, ANTISYMMETRIC)])
def test_at_the_load_itself_the_end_is_conjugate(clamped, load):
    straight = vc.solve(rod(load, clamped), vc.Collocation(), guess=lambda x: 0.0, throw=False)
    findings = vc.verify(straight).findings
    assert vc.Verdict.DEGENERATE in {f.verdict for f in findings}


def elastica(load, clamped):
    """Euler's own: int theta'^2/2 + P cos(theta) along the rod, its ends at one height."""
    ends = (vc.Fixed(0, 0), vc.Fixed(1, 0)) if clamped else (vc.Free(0), vc.Free(1))
    return vc.Problem(
        lambda s, angle, bend: bend**2 / 2 + load * ca.cos(angle), *ends,
        [vc.Isoperimetric(lambda s, angle, bend: ca.sin(angle), 0)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("clamped", "share", "index"),
    [(False, 0.99, 0), (False, 1.01, 1), (False, 4.01, 2), (True, 3.99, 0), (True, 4.01, 1)],
)
def test_the_elastica_buckles_at_the_same_loads(clamped, share, index):
    problem = elastica(share * EULER, clamped)
    straight = vc.solve(problem, vc.Collocation(), guess=lambda s: 0.0, throw=False)
    assert straight.value == pytest.approx(share * EULER, rel=1e-12)
    check = vc.verify(straight)
    assert check.index == index
    assert check.verdict is (vc.Verdict.SADDLE if index else vc.Verdict.MINIMUM)


def test_beyond_the_load_the_bent_elastica_is_the_minimum():
    # k = sin(angle at the end / 2), sqrt(P) = 2 K(k); along it theta'^2/2 = P (cos theta - cos theta_0)
    load = 1.5 * EULER
    k = mp.findroot(lambda k: 2 * mp.ellipk(k * k) - mp.sqrt(load), 0.7)
    energy = 2 * mp.sqrt(load) * 2 * (mp.ellipe(k * k) - (1 - k * k) * mp.ellipk(k * k))  # int theta'^2/2
    compression = 4 * mp.ellipe(k * k) / mp.sqrt(load) - 1  # int cos theta
    solution = vc.solve(elastica(load, clamped=False), guess=lambda s: 1.5 * mp.cos(mp.pi * s))
    assert solution.value == pytest.approx(float(energy / 1 + load * compression), rel=1e-10)
    assert abs(solution.y(0.0)) == pytest.approx(float(2 * mp.asin(k)), abs=1e-5)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
