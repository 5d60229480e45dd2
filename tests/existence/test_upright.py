"""Films about an axis, held against the greatest rise that a graph from their rim can have."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import mpmath
import pytest

import varcalc as vc

RIM, FAR = 0.5, 1.7
METHODS = (None, vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting())


def rise_of(first_integral: float, load: float = 0.0) -> float:
    """How far x v/sqrt(1 + v^2) = C + load x rises between the rim and the far end.

    With q = C + load x the slope is q/sqrt(x^2 - q^2), and x - q = (1 - load) x - C vanishes at the rim at most: with
    its root u for a variable nothing is singular.
    """
    far, near = ((1 - load) * x - first_integral for x in (FAR, RIM))

    def part(u: Any) -> Any:
        x = (u * u + first_integral) / (1 - load)
        q = first_integral + load * x
        return 2 * q / mpmath.sqrt(x + q) / (1 - load)

    return float(mpmath.quad(part, [mpmath.sqrt(max(near, 0.0)), mpmath.sqrt(far)]))


def film(rise: float, load: float = 0.0) -> vc.Problem:
    return vc.Problem(
        lambda x, y, dy: x * ca.sqrt(1 + dy**2) + load * y, vc.Fixed(RIM, 0.0), vc.Fixed(FAR, rise), name="film"
    )


def test_the_greatest_rise() -> None:
    assert rise_of(RIM) == pytest.approx(RIM * math.acosh(FAR / RIM), rel=1e-14)


@pytest.mark.parametrize(("method", "excess"), [*((method, 4e-4) for method in METHODS), (None, 1.5e-3)], ids=str)
def test_a_film_torn_at_its_rim_is_no_graph(method: Any, excess: float) -> None:
    solution = vc.solve(film(rise_of(RIM) * (1 + excess)), method, throw=False)
    assert not solution.status.ok


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("excess", [1.5e-3])
def test_a_loaded_film_torn_at_its_rim(method: Any, excess: float) -> None:
    # its Lagrangian is no metric's, so that no other coordinates tell of it
    solution = vc.solve(film(rise_of(0.9 * RIM, 0.1) * (1 + excess), 0.1), method, throw=False)
    assert not solution.status.ok


@pytest.mark.parametrize("share", [0.9, 0.9999, 0.999999])
def test_a_film_that_all_but_tears(share: float) -> None:
    # the value of x^2/sqrt(x^2 - C^2) is (x sqrt(x^2 - C^2) + C^2 arcosh(x/C))/2
    C = share * RIM
    parts = [(x * math.sqrt(x * x - C * C) + C * C * math.acosh(x / C)) / 2 for x in (RIM, FAR)]
    solution = vc.solve(film(rise_of(C)))
    assert solution.value == pytest.approx(parts[1] - parts[0], abs=10 * solution.error.value)
    assert solution.error.value < 1e-9


@pytest.mark.parametrize("share", [0.9, 0.9999])
def test_a_loaded_film_that_holds(share: float) -> None:
    solution = vc.solve(film(rise_of(share * 0.9 * RIM, 0.1), 0.1))
    slope = float(solution.dy(FAR))
    exact = (share * 0.9 * RIM + 0.1 * FAR) / FAR
    assert slope / math.sqrt(1 + slope**2) == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize("method", [None, vc.FirstIntegral()])
def test_through_the_pole_of_polar_coordinates_no_graph_is_shortest(method):
    # down to y = 0 at one angle and up at another costs the sum of the radii: what comes near it stands upright
    distance = vc.Problem(lambda x, y, dy: ca.sqrt(1.5 * y**2 + dy**2), vc.Fixed(0, 0.9), vc.Fixed(1.3, -1.0))
    refused = vc.solve(distance, method, throw=False)
    assert not refused.status.ok


HIGHEST, STIFFNESS = 0.9, 4.0
"""The ordinate from which a graph sets out upright, and k of sqrt(1 + v^2) + k y^2/2."""


def of_spring() -> tuple[float, float]:
    """On which length a spring's curve from the highest ordinate ends level, and its value.

    1/sqrt(1 + v^2) + k y^2/2 keeps its value, k HIGHEST^2/2 where v is infinite and 1 + k y^2/2 where it is 0.
    """
    lowest = mpmath.sqrt(HIGHEST**2 - 2 / STIFFNESS)

    def rate(t: Any) -> Any:  # y = lowest + t^2: the slope vanishes there as t does
        less = STIFFNESS * (2 * lowest + t * t) / 2
        w = 1 - less * t * t
        return 2 * w / mpmath.sqrt(less * (1 + w)), lowest + t * t, w

    top = mpmath.sqrt(HIGHEST - lowest)
    length = mpmath.quad(lambda t: rate(t)[0], [0, top])
    # sqrt(1 + v^2) dx is dy/sqrt(1 - w^2)
    value = mpmath.quad(lambda t: rate(t)[0] * (1 / rate(t)[2] + STIFFNESS * rate(t)[1] ** 2 / 2), [0, top])
    return float(length), float(value)


CONDITIONS = [
    pytest.param([], 0.0, id="free"),
    pytest.param([vc.Bound(lambda x, y, v: y, lower=0.0)], 0.0, id="slack bound"),
    pytest.param([], 1.0, id="kink beyond the curve"),
    pytest.param([vc.Bound(lambda x, y, v: y, lower=0.0)], 1.0, id="both"),
]


@pytest.mark.parametrize(("conditions", "kink"), CONDITIONS)
@pytest.mark.parametrize("above", [0.3, 0.1])
def test_a_spring_that_starts_too_high_falls_upright(conditions: list[vc.Bound], kink: float, above: float) -> None:
    length, value = of_spring()

    def spring(x: Any, y: Any, v: Any) -> Any:
        return ca.sqrt(1 + v**2) + STIFFNESS * y**2 / 2 + kink * ca.fabs(ca.fmin(y, 0))

    problem = vc.Problem(spring, vc.Fixed(0, HIGHEST + above), vc.Free(length), conditions)
    found = vc.solve(problem, throw=False)
    assert found.verdict is vc.Verdict.NOT_ATTAINED
    # what stands upright costs its height
    limit = float(found.message.split("tend to ")[1].split(",")[0])
    assert limit == pytest.approx(value + above, abs=2e-4)


@pytest.mark.parametrize("conditions", [[], [vc.Bound(lambda x, y, v: y, lower=0.0)]], ids=["free", "slack bound"])
@pytest.mark.parametrize("slope", [2.0, 50.0])
def test_a_spring_that_starts_lower_has_a_minimum(conditions: list[vc.Bound], slope: float) -> None:
    start = math.sqrt(HIGHEST**2 - 2 / STIFFNESS / math.sqrt(1 + slope**2))
    problem = vc.Problem(
        lambda x, y, v: ca.sqrt(1 + v**2) + STIFFNESS * y**2 / 2,
        vc.Fixed(0, start),
        vc.Free(of_spring()[0]),
        conditions,
    )
    found = vc.solve(problem, throw=False)
    assert found.status.ok


@pytest.mark.parametrize("span", [(0.35, 0.83), (-0.53, 0.19), (1.06, 1.77), (-1.33, -0.81), (0.35, 1.52)])
def test_a_curve_that_does_not_move_stands_nowhere_upright(span):
    """y' + y'^2 between equal ends: the constant, whose computed slopes are round-off."""
    found = vc.solve(vc.Problem(lambda x, y, dy: dy + dy**2, *(vc.Fixed(x, 1) for x in span)))
    assert found.value == pytest.approx(0.0, abs=1e-15)
    assert found.y(sum(span) / 2) == pytest.approx(1.0, abs=1e-15)


def test_a_string_too_long_for_a_graph_is_told_to_be_a_curve():
    """Of length 6 over a chord of 2 the arc that encloses most is more than a semicircle, of length π, and no graph."""
    string = vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 6)
    problem = vc.Problem(lambda x, y, dy: y, vc.Fixed(-1, 0), vc.Fixed(1, 0), [string], maximise=True)
    solution = vc.solve(problem, vc.Ritz(starts=1), throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    # graphs come as near as one likes to a half disc on two walls
    assert f"tend to {6 - math.pi + math.pi / 2:.4g}" in solution.message
    assert "no graph y(x)" in solution.message
    assert "state the problem as a Curve" in solution.message
