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


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("excess", [4e-4, 1.5e-3])
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
