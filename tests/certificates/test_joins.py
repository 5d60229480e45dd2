"""Powers of |e| and of fmax(e, 0), which have no second derivative where they begin, against closed forms."""

from dataclasses import replace

import casadi as ca
import mpmath
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.kinks import kinks


def one_sided_spring(k, start, end, length):
    """int v^2/2 + k fmax(y, 0)^2/2 from -start to end: a line up to c, and beyond s sinh(w (x - c))/w."""
    k, start, end, length = map(mpmath.mpf, (k, start, end, length))
    w = mpmath.sqrt(k)
    c = mpmath.findroot(
        lambda c: start / c * mpmath.sinh(w * (length - c)) / w - end, (length / 1000, length * 999 / 1000), "anderson"
    )
    slope = start / c
    return slope**2 * c / 2 + slope**2 * mpmath.sinh(2 * w * (length - c)) / (4 * w)


def drag(m, c, f, length):
    """int m v^2/2 + c |v|^3 - f y between zeros: the momentum m v + 3 c v |v| is f (length/2 - x)."""
    m, c, f, length = map(mpmath.mpf, (m, c, f, length))

    def rate(x):
        momentum = f * (length / 2 - x)
        v = mpmath.sign(momentum) * (mpmath.sqrt(m**2 + 12 * c * abs(momentum)) - m) / (6 * c)
        return m * v**2 / 2 + c * abs(v) ** 3 + f * x * v  # the load, integrated by parts

    return mpmath.quad(rate, [0, length / 2, length])


def spring(x, y, v):
    return v**2 / 2 + 25 * ca.fmax(0, y) ** 2


CASES = {
    "a spring on one side": (spring, (0, -1), (1, 1), {}, lambda: one_sided_spring(50, 1, 1, 1)),
    "written as a product": (
        lambda x, y, v: v**2 / 2 + 25 * (ca.fmax(y, 0) * ca.fmax(0, y)), (0, -1), (1, 1), {},
        lambda: one_sided_spring(50, 1, 1, 1),
    ),
    "a maximum": (
        lambda x, y, v: -spring(x, y, v), (0, -1), (1, 1), {"maximise": True},
        lambda: -one_sided_spring(50, 1, 1, 1),
    ),
    "a cube of the slope": (
        lambda x, y, v: v**2 + ca.fabs(v) ** 3 - 5 * y, (0, 0), (1, 0), {}, lambda: drag(2, 1, 5, 1)
    ),
}  # fmt: skip


@pytest.mark.parametrize(("lagrangian", "start", "end", "options", "exact"), CASES.values(), ids=CASES)
def test_a_power_is_certified_among_all_curves(lagrangian, start, end, options, exact, bounds):
    certificate = vc.certify(vc.solve(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), **options)))
    low, high = bounds(certificate)
    assert low <= exact() <= high
    assert certificate.width < 1e-13
    assert certificate.scope is Scope.ALL


@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_widens_the_interval_or_is_refused(power, holds_of_a_wave):
    solution = vc.solve(vc.Problem(spring, vc.Fixed(0, -1), vc.Fixed(1, 1)))
    assert holds_of_a_wave(solution, 10.0**-power, one_sided_spring(50, 1, 1, 1))


def test_a_power_that_is_taken_away_is_not_bounded_by_its_tangent():
    """-2 fmax(y, 0)^2 lies below its tangents."""
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 - 2 * ca.fmax(y, 0) ** 2, vc.Fixed(0, -1), vc.Fixed(1, 1)))
    with pytest.raises(
        vc.VariationalError, match="no certificate: kinks and jumps that the curve meets are covered where"
    ):
        vc.certify(solution)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v: v**2 / 2 + ca.sqrt(ca.fabs(y)),
        lambda x, y, v: v**2 / 2 + ca.fabs(y) ** 0.7,
        lambda x, y, v: v**2 / 2 + ca.fmax(0, y) ** 0.5,
        lambda x, y, v: v**2 / 2 + ca.fabs(y) * ca.fmax(-0.1, y),
        lambda x, y, v: v**2 / 2 + (ca.fmax(0, y) - 0.2) ** 2,
        lambda x, y, v: v**2 / 2 + y * ca.fabs(y),
        lambda x, y, v: v**2 / 2 + 2 * ca.fabs(y) - ca.fabs(y) ** 3,
        lambda x, y, v: v**2 / 2 + ca.if_else(y < 0.3, ca.fabs(y), 0.3),
        lambda x, y, v: v**2 / 2 + ca.if_else(y < 0.3, 0, y),
    ],
)
def test_what_is_not_convex_is_not_taken_for_it(lagrangian):
    """Roots lie above their tangents nowhere; what is turned over, or jumps, is no convex term."""
    line = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, -1), vc.Fixed(1, 1)))
    assert kinks(replace(line, problem=vc.Problem(lagrangian, vc.Fixed(0, -1), vc.Fixed(1, 1)))) is None
