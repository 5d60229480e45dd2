"""Ends and waypoints that no curve of the problem can meet are refused at once."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def square(x: Any, y: Any, dy: Any) -> Any:
    return ca.sumsqr(dy)


def length(q: Any, dq: Any) -> Any:
    return ca.norm_2(dq)


def sphere(q: Any) -> Any:
    return ca.sumsqr(q) - 1


def above(height: float, **bounds: float) -> vc.Problem:
    return vc.Problem(square, vc.Fixed(0, height), vc.Fixed(1, 0), [vc.Bound(lambda x, y, dy: y, **bounds)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: vc.Curve(length, vc.At((1, 0, 0)), vc.At((0, 0, 1.1)), [vc.Holonomic(sphere)]),
            r"end = At.* violates constraints\[0\] \(Holonomic\): phi is 0.21 there instead of 0; move one",
        ),
        (
            lambda: vc.Problem(square, vc.Fixed(0, (1, 0)), vc.Free(1), [vc.Holonomic(lambda x, y: y[0] - y[1])]),
            r"start = .* violates constraints\[0\] \(Holonomic\): phi is 1 there",
        ),
        (lambda: above(-0.25, lower=0), r"start = .* \(Bound\): h is -0.25 there, 0.25 below lower = 0"),
        (lambda: above(3, upper=2), r"start = .* \(Bound\): h is 3 there, 1 above upper = 2"),
        (
            lambda: vc.Problem(
                square,
                vc.Fixed(0, 0),
                vc.Fixed(1, 0),
                [vc.Through(0.5, 2), vc.Bound(lambda x, y, dy: y + x, upper=1)],
            ),
            r"constraints\[0\] = Through.* violates constraints\[1\] \(Bound\): h is 2.5 there, 1.5 above upper = 1",
        ),
    ],
)  # fmt: skip
def test_a_place_off_a_constraint_is_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_round_off_is_admitted_at_every_scale(scale: float) -> None:
    def globe(q: Any) -> Any:
        return ca.sumsqr(q) - scale**2

    angles = np.linspace(0.1, 6, 25)
    for a, b in pairwise(angles):
        ends = [vc.At(scale * np.array([np.cos(v), np.sin(v)])) for v in (a, b)]
        vc.Curve(length, *ends, [vc.Holonomic(globe)])
    with pytest.raises(ValueError, match="violates"):
        vc.Curve(length, vc.At((scale, 0)), vc.At((0, scale * (1 + 1e-7))), [vc.Holonomic(globe)])


def test_an_end_upon_an_obstacle_is_admitted() -> None:
    above(0.0, lower=0)
    above(1 / 3, upper=1 - 2 / 3)


def test_what_may_still_be_met_is_not_judged() -> None:
    ends = vc.Fixed(0, 0), vc.Fixed(1, 3)
    vc.Problem(square, *ends, [vc.Bound(lambda x, y, dy: dy + y, upper=1)])
    vc.Problem(
        lambda x, y, dy, p: dy**2,
        *ends,
        [vc.Bound(lambda x, y, dy, p: y - p.height, upper=0)],
        unknowns={"height": 1.0},
    )
    vc.Problem(square, vc.Fixed(0, (2, None)), vc.Fixed(1, (0, 1)), [vc.Holonomic(lambda x, y: y[0] + y[1] - 1)])


def test_other_parameter_values_are_judged_anew() -> None:
    wall = vc.Problem(
        lambda x, y, dy, p: dy**2,
        vc.Fixed(0, 1),
        vc.Fixed(1, 1),
        [vc.Bound(lambda x, y, dy, p: y - p.height, lower=0)],
        parameters={"height": 0.5},
    )
    wall.with_parameters({"height": 1.0})
    with pytest.raises(ValueError, match=r"start = .* h is -1 there, 1 below lower = 0"):
        wall.with_parameters({"height": 2.0})


def level(factor, value, **options):
    return vc.Isoperimetric(lambda x, y, dy: factor * y * ca.sqrt(1 + dy**2), value, **options)


def test_an_integral_that_is_prescribed_twice_is_refused_by_name():
    with pytest.raises(ValueError, match=r"constraints\[1\] prescribes the integral that constraints\[0\] does"):
        vc.Problem(square, vc.Fixed(0, 0), vc.Fixed(1, 0), [level(1, 1.0), level(2, 2.0)])


@pytest.mark.parametrize(
    "others",
    [
        [vc.Isoperimetric(lambda x, y, dy: y, 1.0)],
        [level(1, None, lower=0.0), level(1, None, upper=2.0)],
        [level(2, 3.0)],  # which contradicts the other: what cannot be met is the solver's to say
    ],
)
def test_other_integrals_and_other_levels_are_let_be(others):
    vc.Problem(square, vc.Fixed(0, 0), vc.Fixed(1, 0), [level(1, 1.0), *others])
