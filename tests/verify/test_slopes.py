"""Slopes at which L jumps, which a curve of another slope does not meet: on one alone L may be lower."""

import casadi as ca
import pytest

import varcalc as vc

JUMPING = {
    # by corners between the slopes 1 and 1 + sqrt 6, on a tangent of v²/2 + 3 through (1, 1/2)
    "on both sides": (lambda v: v**2 / 2 + ca.if_else(ca.fabs(v) > 1, 3, 0), 1.2),
    # 1 on half of the way, and 2 on the other: 3 for 3.25
    "upward": (lambda v: v**2 + ca.if_else(v > 1, 1, 0), 1.5),
    "as branches": (lambda v: ca.if_else(v <= 1, v**2, v**2 + 1), 1.5),
    "downward": (lambda v: v**2 + ca.if_else(-v > 1, 1, 0), -1.5),
    # at rest on half of the way and with the slope 1 on the other
    "at one slope": (lambda v: v**2 / 2 + ca.if_else(v == 0, 0, 0.5), 0.5),
    "stairs": (lambda v: v**2 / 2 + 2 * ca.ceil(v), 1.2),
}


@pytest.mark.parametrize("method", [None, vc.Collocation()], ids=["ladder", "Collocation"])
@pytest.mark.parametrize("name", JUMPING)
def test_a_straight_line_beside_a_lower_slope_is_not_called_least(name, method):
    L, end = JUMPING[name]
    straight = float(ca.DM(L(ca.DM(end))))
    solution = vc.solve(vc.Problem(lambda x, y, v: L(v), vc.Fixed(0, 0), vc.Fixed(1, end)), method, throw=False)
    if solution.status.ok:
        assert solution.value < straight - 0.05
    else:
        assert solution.verdict in (vc.Verdict.WEAK_MINIMUM, None)
        assert "there is no" not in solution.message


@pytest.mark.parametrize(("end", "value"), [(0.5, 0.25), (2.5, 7.25)])
def test_a_straight_line_below_all_chords_is_least_beside_a_jump(end, value):
    """Of v² + (v > 1) the chord from (1, 1) to (2, 5) is all that lies below."""
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 + ca.if_else(v > 1, 1, 0), vc.Fixed(0, 0), vc.Fixed(1, end)))
    assert solution.value == pytest.approx(value, rel=1e-13)
    assert not solution.local
