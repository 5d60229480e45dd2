"""End points that are parameters: placed, checked, moved, and told of in the sensitivities."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.problems._curves import Cycloid


def length(start, end, **parameters):
    return vc.Problem(lambda x, y, dy, p: ca.sqrt(1 + dy**2), start, end, parameters=parameters)


def test_an_end_takes_its_place_from_the_parameters():
    line = length(vc.Fixed(0, 0), vc.Fixed(vc.Parameter("a"), vc.Parameter("b")), a=3, b=4)
    assert (line.end, line.span) == (vc.Fixed(3.0, 4.0), (0.0, 3.0))
    moved = line.with_parameters({"a": 5, "b": 12})
    assert (moved.end, moved.span) == (vc.Fixed(5.0, 12.0), (0.0, 5.0))
    assert (line.end, line.span) == (vc.Fixed(3.0, 4.0), (0.0, 3.0))
    for method in (vc.Ritz(), vc.Collocation(), vc.Shooting(), vc.FirstIntegral()):
        assert vc.solve(line, method).value == pytest.approx(5, rel=1e-12)
        assert vc.solve(moved, method).value == pytest.approx(13, rel=1e-12)


def test_components_slopes_and_free_ends():
    pair = vc.Problem(
        lambda x, y, dy, p: ca.sumsqr(dy),
        vc.Fixed(0, [0, vc.Parameter("b")]),
        vc.Fixed(1, [None, 0]),
        parameters={"b": 2},
    )
    assert vc.solve(pair.with_parameters({"b": 3})).value == pytest.approx(9, rel=1e-12)
    beam = vc.Problem(
        lambda x, y, dy, ddy, p: ddy**2,
        vc.Fixed(0, 0, vc.Parameter("s")),
        vc.Fixed(1, 0, 0),
        parameters={"s": 1},
        order=2,
    )
    assert vc.solve(beam.with_parameters({"s": 2})).value == pytest.approx(16, rel=1e-12)
    free = vc.Problem(
        lambda x, y, dy, p: dy**2 + y**2, vc.Fixed(0, 1), vc.Free(vc.Parameter("to")), parameters={"to": 1}
    )
    assert vc.solve(free.with_parameters({"to": 2})).value == pytest.approx(math.tanh(2), rel=1e-10)


def test_a_curve_with_an_end_that_moves():
    line = vc.Curve(
        lambda q, dq, p: ca.sqrt(ca.sumsqr(dq)), vc.At([0, 0]), vc.At([3, vc.Parameter("h")]), parameters={"h": 4}
    )
    known = vc.solve(line)
    moved = vc.solve(line.with_parameters({"h": 0}), guess=known)
    assert moved.value == pytest.approx(3, rel=1e-12)
    assert known.sensitivities["h"] == pytest.approx(0.8, rel=1e-10)


def test_an_end_that_slides_beside_one_that_moves():
    to_line = length(vc.Fixed(vc.Parameter("a"), 0), vc.OnCurve(lambda x, y: x + y - 4, 2.0), a=0.0)
    for a in (0.0, -1.0):
        moved = to_line.with_parameters({"a": a})
        assert vc.solve(moved).value == pytest.approx((4 - a) / math.sqrt(2), rel=1e-10)


@pytest.mark.parametrize(("across", "depth"), [(1.0, 1.0), (3.0, 0.7), (0.3, 2.0)])
def test_every_method_at_a_singular_end(across, depth):
    fall = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * 9.81 * y)),
        vc.Fixed(0, 0),
        vc.Fixed(vc.Parameter("across"), vc.Parameter("depth")),
        parameters={"across": 1.0, "depth": 1.0},
    )
    vc.solve(fall)  # what it keeps must not serve the others wrongly
    moved = fall.with_parameters({"across": across, "depth": depth})
    exact = Cycloid.through(across, depth).descent_time(9.81)
    for method in (vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.FirstIntegral()):
        assert vc.solve(moved, method).value == pytest.approx(exact, rel=1e-9)


def test_the_singular_end_itself_may_move():
    fall = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * 9.81 * (y - p.top))),
        vc.Fixed(vc.Parameter("left"), vc.Parameter("top")),
        vc.Fixed(1, 1),
        parameters={"left": 0.0, "top": 0.0},
    )
    lefts, tops = [0.0, -0.5, 0.25], [0.0, 0.5, -1.0]
    found = vc.sweep(fall, {"left": lefts, "top": tops})
    exact = [[Cycloid.through(1 - x, 1 - y).descent_time(9.81) for y in tops] for x in lefts]
    np.testing.assert_allclose(found.values, exact, rtol=1e-10)


def test_sensitivities_to_ends():
    # the distance of two points, and its gradient: the unit vector between them
    line = length(
        vc.Fixed(vc.Parameter("a"), vc.Parameter("b")),
        vc.Fixed(vc.Parameter("c"), vc.Parameter("d")),
        a=0,
        b=0,
        c=3,
        d=4,
    )
    found = dict(vc.solve(line).sensitivities)
    assert found == pytest.approx({"a": -0.6, "b": -0.8, "c": 0.6, "d": 0.8}, abs=1e-12)


def test_sensitivities_with_a_level_and_a_parameter_of_l():
    p = {"k": 0.5, "to": 1.0, "height": 0.5}
    hung = vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2,
        vc.Fixed(0, 0),
        vc.Fixed(vc.Parameter("to"), vc.Parameter("height")),
        [vc.Isoperimetric(lambda x, y, dy, p: y, 0.4)],
        parameters=p,
    )
    found = vc.solve(hung, tol=1e-13).sensitivities
    for name, step in (("k", 1e-4), ("to", 1e-4), ("height", 1e-4)):
        low, high = (vc.solve(hung.with_parameters({name: p[name] + s}), tol=1e-13).value for s in (-step, step))
        assert found[name] == pytest.approx((high - low) / (2 * step), rel=1e-6)


def test_a_sensitivity_that_is_not_known_is_no_number():
    fall = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / y),
        vc.Fixed(vc.Parameter("a"), 0),
        vc.Fixed(1, 1),
        parameters={"a": 0},
    )
    assert math.isnan(vc.solve(fall).sensitivities["a"])


def test_what_cannot_be_an_end_is_refused():
    with pytest.raises(ValueError, match="holds the parameter a, which is not declared"):
        length(vc.Fixed(0, 0), vc.Fixed(1, vc.Parameter("a")), b=1)
    line = length(vc.Fixed(0, 0), vc.Fixed(vc.Parameter("a"), 1), a=1)
    with pytest.raises(ValueError, match="the end must lie right of the start"):
        line.with_parameters({"a": -1})
    with pytest.raises(ValueError, match="moves an end"):
        vc.continue_branch(vc.solve(line), "a", until=2.0)
    with pytest.raises(TypeError, match="only the ends may be parameters"):
        vc.Through(0.5, vc.Parameter("a"))
    with pytest.raises(TypeError, match=r"Parameter\.name must be a text"):
        vc.Parameter(3)  # type: ignore[arg-type]
    fall = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / y),
        vc.Fixed(0, 0),
        vc.Fixed(1, vc.Parameter("d")),
        parameters={"d": 1},
    )
    with pytest.raises(ValueError, match="outside the domain of the Lagrangian"):
        fall.with_parameters({"d": -1})
    swept = vc.sweep(fall, {"d": [1.0, 0.5, -1.0]}).points
    assert [point.ok for point in swept] == [True, True, False]
    assert "outside the domain of the Lagrangian" in swept[2].message
