"""A well that barely pays for the way there is found beside a curve at rest, which itself sums next to nothing."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

LENGTH = 3.0
SHAPES = {
    "Gaussian": lambda t, m: m.exp(-(t**2)),
    "soliton": lambda t, m: 1 / m.cosh(t) ** 2,
    "tent": lambda t, m: m.fmax(0, 1 - m.fabs(t)),
}
PLACES = [(1.35, 0.19), (-2.06, 0.35), (0.9, 0.5)]
"""Of the well, and its width."""
KINDS = ["plain", "free", "maximum", "bounded", "levelled", "pair"]


def depth_and_value(place, width, shape, free):
    """The depth at which the best of straight ways costs nothing, 3 % more, and what that way sums then."""
    share = np.linspace(0.02, 0.9 if free else 0.48, 400)
    legs = 1 if free else 2
    way = np.linspace(0, 1, 20_001)
    along = np.trapezoid(SHAPES[shape]((way * place - place) / width, np), way)
    kinetic, within = legs * place**2 / (2 * share * LENGTH), LENGTH * (1 - legs * share * (1 - along))
    best = int(np.argmin(kinetic / within))
    depth = 1.03 * kinetic[best] / within[best]
    return depth, kinetic[best] - depth * within[best]


def stated(kind, place, depth, well):
    """A problem of a kind."""

    def action(x, y, v):
        return v**2 / 2 - depth * well(y)

    ends = vc.Fixed(0, 0.0), vc.Fixed(LENGTH, 0.0)
    if kind == "free":
        return vc.Problem(action, ends[0], vc.Free(LENGTH))
    if kind == "maximum":
        return vc.Problem(lambda x, y, v: -action(x, y, v), *ends, maximise=True)
    if kind == "bounded":
        return vc.Problem(action, *ends, [vc.Bound(lambda x, y, v: y, lower=-4.0, upper=4.0)])
    if kind == "levelled":
        return vc.Problem(action, *ends, [vc.Isoperimetric(lambda x, y, v: y * ca.sin(2 * np.pi * x / LENGTH), 0.0)])
    if kind == "pair":
        rest = [vc.Fixed(0, [0.0, 0.0]), vc.Fixed(LENGTH, [0.0, 0.0])]
        return vc.Problem(lambda x, y, v: action(x, y[0], v[0]) + v[1] ** 2 / 2 + y[1] ** 2, *rest)
    return vc.Problem(action, *ends)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_no_higher_than_the_best_straight_way(kind, shape):
    centre, width = PLACES[(KINDS.index(kind) + list(SHAPES).index(shape)) % len(PLACES)]
    depth, value = depth_and_value(centre, width, shape, kind == "free")
    found = vc.solve(stated(kind, centre, depth, lambda y: SHAPES[shape]((y - centre) / width, ca)))
    assert value < 0
    assert (-found.value if kind == "maximum" else found.value) < value
    assert not found.local


@pytest.mark.parametrize("place", [(1.2, -0.9), (-0.8, -1.25), (2.0, 1.0), (-2.4, 0.5)])
def test_off_the_lines_along_one_function(place):
    width = 0.18
    size = float(np.hypot(*place))
    depth, value = depth_and_value(size, width, "Gaussian", free=False)
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: ca.sumsqr(v) / 2 - depth * ca.exp(-ca.sumsqr(y - ca.DM(place)) / width**2),
            vc.Fixed(0, [0.0, 0.0]), vc.Fixed(LENGTH, [0.0, 0.0]),
        )
    )  # fmt: skip
    assert found.value < value < 0
    assert not found.local
