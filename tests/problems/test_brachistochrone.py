"""The cycloids of the brachistochrone, in 40 digits."""

import math

import mpmath as mp
import pytest

from varcalc.problems import brachistochrone

REFERENCES = {r.name.partition("/")[2]: r for r in brachistochrone.references}


def cycloid(across, depth, guess):
    """Radius and angle of the cycloid from the origin through a point."""
    across, depth = mp.mpf(across), mp.mpf(depth)
    angle = mp.findroot(lambda a: depth * (a - mp.sin(a)) - across * (1 - mp.cos(a)), guess) if depth else 2 * mp.pi
    return across / (angle - mp.sin(angle)), angle


@pytest.mark.parametrize(
    ("case", "across", "depth", "angle", "radius", "scaled_time"),
    [
        ("", 1, 1, 2.41201114391353, 0.572917037531750, 1.82568218939667),
        ("bottom", math.pi / 2, 1, math.pi, 0.5, math.pi / math.sqrt(2)),
        ("beyond", 5, 1, 4.59458571243343, 0.894829774601297, 4.34626868674841),
        ("level", 1, 0, 2 * math.pi, 1 / (2 * math.pi), math.sqrt(2 * math.pi)),
    ],
)
def test_descent(prove, case, across, depth, angle, radius, scaled_time):
    r, end = cycloid(across, depth, angle)
    value = prove(REFERENCES[case], (lambda a: (r * (a - mp.sin(a)), r * (1 - mp.cos(a))), mp.mpf(0), end))
    assert float(end) == pytest.approx(angle, rel=1e-14)
    assert float(r) == pytest.approx(radius, rel=1e-14)
    assert float(value * mp.sqrt(brachistochrone.GRAVITY)) == pytest.approx(scaled_time, rel=1e-14)


def test_upward(prove):
    r, end = cycloid(1, 1, 2.4)
    prove(REFERENCES["upward"], (lambda a: (r * (a - mp.sin(a)), -r * (1 - mp.cos(a))), mp.mpf(0), end))


def test_swapped(prove):
    r, end = cycloid(1, 1, 2.4)
    prove(REFERENCES["swapped"], (lambda a: (r * (1 - mp.cos(a)), r * (a - mp.sin(a))), mp.mpf(0), end))


def test_time_to_the_bottom():
    # Brizard, problem 2: pi sqrt(a/g)
    assert REFERENCES["bottom"].exact.value == pytest.approx(math.pi * math.sqrt(0.5 / 9.81), rel=1e-15)
