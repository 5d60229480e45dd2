"""What is read of narrow places in the plane."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.narrow import narrow_places

R = ca.SX.sym("r", 2)
AWAY = (R[0] - 0.3017) ** 2 + (R[1] - 0.1021) ** 2


def narrow(expression):
    return narrow_places(ca.Function("f", [R], [expression]), np.array([0.01, 0.02]), 16.0)


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize(
    "spot", [lambda u: ca.exp(-u), lambda u: 1 / (1 + u), lambda u: 1 / ca.cosh(u), lambda u: ca.tanh(5 - u)]
)
def test_a_spot_is_found_with_its_width(spot, width):
    places = narrow(1 + 0.1 * spot(AWAY / width**2))
    smallest = places.width.argmin()
    assert width / 16 < places.width[smallest] < 16 * width
    assert np.abs(places.middle[smallest] - [0.3017, 0.1021]).max() < 16 * width


def test_a_thin_wall_is_found_all_along():
    places = narrow(1 + 0.1 * ca.exp(-(((R[0] + 0.7 * R[1] - 0.2) / 1e-2) ** 2)))
    off = np.abs(places.middle @ [1, 0.7] - 0.2)
    assert np.all(off < 0.15)
    assert np.ptp(places.middle[:, 0]) > 10


@pytest.mark.parametrize("smooth", [R[0] ** 2 + R[1], 1.5 + ca.sin(40 * R[0] + R[1]), 4 / (20 + ca.sumsqr(R)) ** 2])
def test_nothing_is_narrow_in_what_is_smooth_or_waves_everywhere(smooth):
    places = narrow(smooth)
    assert np.all(places.width >= 0.5)
