"""The optical path of a ray is proved least near it, up to the first conjugate point."""

from fractions import Fraction

import casadi as ca
import mpmath
import pytest

import varcalc as vc
from varcalc import optics


def test_a_parabola_in_a_linear_squared_index():
    """In n^2 = 1 - 2 y the path of the flat ray is b s - s^3/6 with s^2 = 2 (b - sqrt(b^2 - d^2))."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    flat, steep = sorted(scene.rays((0, 0), (0.5, 0.125)), key=lambda ray: ray.index)
    certificate = flat.certify((0.5, 0.125))
    with mpmath.workdps(50):
        b, d = 1 - mpmath.mpf("0.125"), mpmath.hypot(mpmath.mpf("0.5"), mpmath.mpf("0.125"))
        s = mpmath.sqrt(2 * (b - mpmath.sqrt(b * b - d * d)))
        low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
        assert low <= b * s - s**3 / 6 <= high
    assert certificate.width < 1e-18
    with pytest.raises(vc.VariationalError, match="no certificate"):
        steep.certify((0.5, 0.125))


def test_a_ray_through_a_surface_is_no_curve_of_one_medium():
    water = optics.Scene([optics.Uniform(1.0), optics.Uniform(1.33)], [optics.Plane((0, 0), (0, 1))])
    with pytest.raises(ValueError, match="in one medium"):
        water.rays((0, 1), (1, -1))[0].certify()
