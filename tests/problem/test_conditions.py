"""Ends and constraints check their own arguments, in sentences that name them."""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import pytest

import varcalc as vc


def slope(x: Any, y: Any, dy: Any) -> Any:
    return dy


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: vc.Fixed("left", 0), TypeError, "Fixed.x must be a number, not 'left'"),
        (lambda: vc.Fixed(math.inf, 0), ValueError, "Fixed.x must be finite, not inf"),
        (lambda: vc.Fixed(0, math.nan), ValueError, "Fixed.y must be finite, not nan"),
        (lambda: vc.Fixed(0, (0, "up")), TypeError, r"Fixed.y\[1\] must be a number, not 'up'"),
        (lambda: vc.Fixed("1", 0), TypeError, "Fixed.x must be a number, not '1'"),  # type: ignore[arg-type]
        (lambda: vc.Fixed(0, ca.SX.sym("y")), TypeError, "Fixed.y must be a number, not SX"),
        (lambda: vc.Fixed(0, True), TypeError, "Fixed.y must be a number, not True"),
        (lambda: vc.Fixed((0, 1), 0), TypeError, "Fixed.x must be a number"),  # type: ignore[arg-type]
        (lambda: vc.Free(0, n=0), ValueError, "Free.n must be at least 1, not 0"),
        (lambda: vc.Free(0, n=1.5), TypeError, "Free.n must be a whole number, not 1.5"),  # type: ignore[arg-type]
        (lambda: vc.OnCurve(slope, 1, n=True), TypeError, "OnCurve.n must be a whole number, not True"),
        (lambda: vc.Periodic(0, 1, n="2"), TypeError, "Periodic.n must be a whole"),  # type: ignore[arg-type]
        (lambda: vc.Through(0.5, (1, None)), ValueError, "Through.y must give every component"),
        (lambda: vc.Fixed(0, ()), ValueError, "Fixed.y is empty; give one number for each unknown function"),
        (lambda: vc.Fixed(0, None), ValueError, r"use Free\(x\)"),
        (lambda: vc.Fixed(0, (None, None)), ValueError, r"use Free\(x\)"),
        (lambda: vc.Fixed(0, 1, (1, 2)), ValueError, "Fixed.dy must have as many components as Fixed.y"),
        (lambda: vc.Free(None), TypeError, "Free.x must be a number"),  # type: ignore[arg-type]
        (lambda: vc.OnCurve(3.0, 1), TypeError, "OnCurve.phi must be a function, not 3.0"),  # type: ignore[arg-type]
        (lambda: vc.OnCurve(slope, math.nan), ValueError, "OnCurve.x must be finite"),
        (lambda: vc.Periodic(0), ValueError, "needs both abscissae x0 and x1, or neither"),
        (lambda: vc.Periodic(1, 1), ValueError, "Periodic.x1 must lie right of Periodic.x0"),
        (lambda: vc.Periodic(1, 0), ValueError, "Periodic.x1 must lie right of Periodic.x0"),
        (lambda: vc.At(1.0), TypeError, "At.q must be a sequence of coordinates"),  # type: ignore[arg-type]
        (lambda: vc.At((0, math.inf)), ValueError, r"At.q\[1\] must be finite"),
        (lambda: vc.Fixed(0, 1e200), ValueError, "Fixed.y is .*, and squares of what is so large overflow"),
        (lambda: vc.Fixed(-1e200, 0), ValueError, "Fixed.x is .*, and squares of what is so large overflow"),
        (lambda: vc.Through(0, [1, 1e151]), ValueError, r"Through.y\[1\] is .*use a larger unit"),
        (lambda: vc.OnSurface("x", (0, 0)), TypeError, "OnSurface.phi must be a function"),  # type: ignore[arg-type]
        (lambda: vc.OnSurface(slope, (0, None)), TypeError, "must be a point"),  # type: ignore[arg-type]
        (lambda: vc.OnSurface(slope, 1.0), TypeError, "must be a point"),  # type: ignore[arg-type]
        (lambda: vc.Isoperimetric(1.0, 2.0), TypeError, "Isoperimetric.g must be a function"),  # type: ignore[arg-type]
        (lambda: vc.Isoperimetric(slope), ValueError, "Isoperimetric bounds nothing; give lower=, upper= or both"),
        (lambda: vc.Isoperimetric(slope, 1, lower=0), ValueError, "either value, or lower and upper, not both"),
        (lambda: vc.Isoperimetric(slope, math.nan), ValueError, "Isoperimetric.value must be finite"),
        (lambda: vc.Isoperimetric(slope, lower=2, upper=1), ValueError, r"lower \(2.0\) must not exceed upper \(1.0\)"),
        (lambda: vc.Holonomic(0), TypeError, "Holonomic.phi must be a function"),  # type: ignore[arg-type]
        (lambda: vc.Bound(0, lower=1), TypeError, "Bound.h must be a function"),  # type: ignore[arg-type]
        (lambda: vc.Bound(slope), ValueError, "Bound bounds nothing; give lower=, upper= or both"),
        (lambda: vc.Bound(slope, lower="low"), TypeError, "Bound.lower must be a number"),  # type: ignore[arg-type]
        (lambda: vc.Bound(slope, lower=1, upper=0), ValueError, "must not exceed upper"),
        (lambda: vc.Through(0.5, ()), ValueError, "Through.y is empty"),
        (lambda: vc.Through(math.nan, 0), ValueError, "Through.x must be finite"),
        (lambda: vc.Fixed(0, 0, slope=1), TypeError, "slope"),  # type: ignore[call-arg]
        (lambda: vc.Bound(slope, least=1), TypeError, "least"),  # type: ignore[call-arg]
    ],
)
def test_wrong_arguments(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_intervals() -> None:
    assert vc.Isoperimetric(slope, 3).interval == (3, 3)
    assert vc.Isoperimetric(slope, lower=1).interval == (1, math.inf)
    assert vc.Isoperimetric(slope, upper=1).interval == (-math.inf, 1)
    assert vc.Isoperimetric(slope, lower=1, upper=1).equality
    assert not vc.Isoperimetric(slope, lower=1, upper=2).equality
    assert vc.Bound(slope, upper=2).interval == (-math.inf, 2)
    assert vc.Bound(slope, lower=0, upper=2).interval == (0, 2)


def test_conditions_are_frozen() -> None:
    end = vc.Fixed(0, 1)
    with pytest.raises(AttributeError):
        end.x = 2  # type: ignore[misc]
    assert end == vc.Fixed(0, 1)


def test_a_matrix_of_casadi_is_no_number():
    with pytest.raises(TypeError, match=r"Fixed.x must be a number, not DM\(\[1, 2\]\)"):
        vc.Fixed(ca.DM([1, 2]), 0)
