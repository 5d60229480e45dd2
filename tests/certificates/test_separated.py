"""Lengths from a line on which a power of the depth makes the metric infinite, by beta functions of 60 digits."""

import casadi as ca
import mpmath
import pytest

import varcalc as vc


def sines(m, angle):
    """The integral of sin^m from 0 to an angle below pi."""
    half = mpmath.beta((m + 1) / 2, mpmath.mpf(1) / 2) / 2
    part = mpmath.betainc((m + 1) / 2, mpmath.mpf(1) / 2, 0, mpmath.sin(angle) ** 2) / 2
    return part if angle <= mpmath.pi / 2 else 2 * half - part


def shortest(power, across, depth):
    """The least integral of y^-power ds from the origin: y = a sin(phi)^(1/power), phi up to what meets the end."""
    power, across, depth = map(mpmath.mpf, (power, across, depth))
    m = 1 / power

    def missed(angle):
        return m * sines(m, angle) / mpmath.sin(angle) ** m - across / depth

    angle = mpmath.findroot(missed, (0.01, 3.1), "anderson", tol=1e-100, maxsteps=400)
    return m * (across / (m * sines(m, angle))) ** (1 - power) * sines(m - 2, angle)


CASES = {
    "before it turns": (lambda y: y**-0.3, vc.Fixed(0, 0), vc.Fixed(0.5, 2), lambda: shortest(0.3, 0.5, 2)),
    "after it turned": (lambda y: 1 / y**0.375, vc.Fixed(0, 0), vc.Fixed(2, 0.5), lambda: shortest(0.375, 2, 0.5)),
    "upwards to a line": (
        lambda y: 3 / (2 - 2 * y) ** 0.625, vc.Fixed(-1, 0.25), vc.Fixed(0, 1),
        lambda: 3 / mpmath.mpf(2) ** 0.625 * shortest(0.625, 1, 0.75),
    ),
}  # fmt: skip


@pytest.mark.parametrize(("n", "start", "end", "exact"), CASES.values(), ids=CASES)
def test_a_length_from_a_singular_line_is_certified(n, start, end, exact, bounds):
    problem = vc.Problem(lambda x, y, v: n(y) * ca.sqrt(1 + v**2), start, end)
    certificate = vc.certify(vc.solve(problem))
    low, high = bounds(certificate)
    assert low <= exact() <= high
    assert certificate.width < 1e-13


@pytest.mark.parametrize("height", [1e-3, 1e-7])
def test_of_a_wrong_length_nothing_false_is_proved(height, holds_of_a_wave):
    problem = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) / y**0.3, vc.Fixed(0, 0), vc.Fixed(1, 2))
    assert holds_of_a_wave(vc.solve(problem), height, shortest(0.3, 1, 2))


def test_a_metric_of_two_powers_is_refused():
    problem = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) / (y**0.3 * (1 + y) ** 0.2), vc.Fixed(0, 0), vc.Fixed(1, 2))
    with pytest.raises(vc.VariationalError, match="no certificate"):
        vc.certify(vc.solve(problem))
