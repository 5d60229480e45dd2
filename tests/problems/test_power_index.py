"""Rays in n = y^-s, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import power_index

REFERENCES = {r.name.partition("/")[2]: r for r in power_index.references}


@pytest.mark.parametrize(
    ("case", "power", "across", "guess"),
    [("", 1 / 3, 1, 1.6), ("steep", 3 / 4, 1, 1.5), ("gentle", 1 / 4, 1, 1.5), ("beyond", 1 / 3, 4, 2.5)],
)
def test_ray(prove, case, power, across, guess):
    m = 1 / mp.mpf(power)

    def area(phi):
        """The integral of sin^m from 0, hypergeometric in sin^2 or in cos^2."""
        s, c = mp.sin(phi), mp.cos(phi)
        if c > 0.7:
            return s ** (m + 1) / (m + 1) * mp.hyp2f1(0.5, (m + 1) / 2, (m + 3) / 2, s**2)
        return mp.beta((m + 1) / 2, 0.5) / 2 - c * mp.hyp2f1(0.5, (1 - m) / 2, 1.5, c**2)

    end = mp.findroot(lambda phi: m * area(phi) - across * mp.sin(phi) ** m, guess)
    a = across / (m * area(end))
    # phi = w^3 keeps the integrand bounded at the start for all these powers
    curve = lambda w: (a * m * area(w**3), a * mp.sin(w**3) ** m)  # noqa: E731
    # a derivative of y^(-1/3) has an exponent that is rounded to double precision
    prove(REFERENCES[case], (curve, mp.mpf(0), mp.cbrt(end)), residual=1e-14)


def test_elementary_for_the_cube_root():
    # S_3 = 2/3 - cos + cos^3/3 and S_1 = 1 - cos
    ray = power_index.Ray.through(1, 1, 1 / 3)
    c = mp.cos(mp.findroot(lambda phi: 2 - 3 * mp.cos(phi) + mp.cos(phi) ** 3 - mp.sin(phi) ** 3, 1.6))
    depth = (1 - c**2) ** mp.mpf(-1.5)
    assert ray.optical_path == pytest.approx(float(3 * depth ** (mp.mpf(2) / 3) * (1 - c)), rel=1e-15)
