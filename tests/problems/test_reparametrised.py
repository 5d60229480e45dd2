"""One light ray in four coordinates, in 40 digits."""

import math

import mpmath as mp

from varcalc.problems import reparametrised

REFERENCES = {r.name.partition("/")[2]: r for r in reparametrised.references}


def ray(end):
    """The ray from z = 1 to ``end`` in n = |z|: straight in z^2."""
    return lambda t: mp.sqrt(1 + (end**2 - 1) * t)


def polar_end(theta, r):
    return mp.mpf(r) * mp.expj(mp.mpf(theta))


def test_in_x_and_in_t(prove):
    z = ray(mp.mpc(2, 1))
    value = prove(REFERENCES[""], (lambda t: (z(t).real, z(t).imag), mp.mpf(0), mp.mpf(1)))
    assert abs(value - mp.sqrt(5)) < 1e-30
    prove(REFERENCES["curve"], (lambda t: [z(t).real, z(t).imag], mp.mpf(0), mp.mpf(1)))


def test_in_polar_coordinates(prove):
    end = REFERENCES["polar"].problem.end
    z = ray(polar_end(end.x, end.y))
    prove(REFERENCES["polar"], (lambda t: (mp.arg(z(t)), abs(z(t))), mp.mpf(0), mp.mpf(1)))
    end = REFERENCES["radius"].problem.end
    w = ray(polar_end(end.y, end.x))
    prove(REFERENCES["radius"], (lambda t: (abs(w(t)), mp.arg(w(t))), mp.mpf(0), mp.mpf(1)))


def test_all_have_one_value():
    # the ends in polar coordinates are the doubles next to those of the others
    values = [r.exact.value for r in REFERENCES.values()]
    assert max(values) - min(values) <= 2 * math.ulp(values[0])
