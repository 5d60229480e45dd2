"""Geodesics of torus and spheroid by Clairaut's relation, in 40 digits, and against geographiclib."""

import mpmath as mp
import numpy as np
import pytest
from geographiclib.geodesic import Geodesic

from varcalc.problems import spheroid, torus

REFERENCES = {r.name: r for r in (*torus.references, *spheroid.references)}


def between(function, a, b):
    return mp.quad(function, [a, b], method="gauss-legendre")


@pytest.mark.parametrize(("case", "graph"), [("torus", True), ("torus/curve", False)])
def test_torus(prove, antiderivative, case, graph):
    (u0, _), (u1, v1) = (map(mp.mpf, p) for p in (torus.START, torus.END))
    rho = lambda u: 2 + mp.cos(u)  # noqa: E731
    rate = lambda u, c: c / (rho(u) * mp.sqrt(rho(u) ** 2 - c**2))  # noqa: E731
    c = mp.findroot(lambda c: between(lambda u: rate(u, c), u0, u1) - v1, 1.4)
    v = antiderivative(lambda u: rate(u, c), u0, u1)
    curve = (lambda u: (u, v(u))) if graph else (lambda u: [u, v(u)])
    value = prove(REFERENCES[case], (curve, u0, u1))
    length = between(lambda u: rho(u) / mp.sqrt(1 - (c / rho(u)) ** 2) / rho(u), u0, u1)
    assert abs(value - length) < 1e-24


def clairaut(f, reduced, c):
    """dlambda/dbeta and dl/dbeta of a spheroid of equatorial radius 1, on the way north.

    From ds^2 = (1 - e^2 cos^2 beta) dbeta^2 + cos^2 beta dlambda^2 and cos^2(beta) dlambda/ds = c.
    """
    cosine = mp.cos(reduced)
    meridian = mp.sqrt(1 - f * (2 - f) * cosine**2)
    root = mp.sqrt(cosine**2 - c**2)
    return c * meridian / (cosine * root), meridian * cosine / root


def by_reduced_latitude(parameters, latitudes, longitude, vertex):
    """The geodesic in the parameter w: sin(beta) = cos(alpha0) sin(w), the vertex at w = pi/2."""
    f = mp.mpf(parameters["f"])
    low, high = (mp.atan((1 - f) * mp.tan(mp.mpf(v))) for v in latitudes)

    def of(c):
        top = mp.sqrt(1 - c**2)
        first, last = (mp.asin(mp.sin(b) / top) for b in (low, high))
        last = mp.pi - last if vertex else last

        def rate(w):
            # clairaut() times dbeta/dw = top cos(w)/cos(beta), where cos^2(beta) - c^2 = top^2 cos^2(w)
            cosine2 = 1 - (top * mp.sin(w)) ** 2
            return c * mp.sqrt(1 - f * (2 - f) * cosine2) / cosine2

        return first, last, rate, top

    def miss(c):
        first, last, rate, _ = of(c)
        return between(rate, first, last) - mp.mpf(longitude)

    return f, of, miss


CASES = {
    "spheroid": (spheroid.EARTH, (-0.5, 0.8), 0.7, False),
    "spheroid/flight": (spheroid.EARTH, (0.7, 0.75), 1.8, True),
    "spheroid/curve": (spheroid.EARTH, (0.7, 0.75), 1.8, True),
    "spheroid/flat": (spheroid.FLAT, (-0.4, 0.9), 1.0, False),
}
GUESSES = {
    "spheroid": spheroid.northward,
    "spheroid/flight": spheroid.flight,
    "spheroid/curve": spheroid.flight,
    "spheroid/flat": spheroid.flat,
}
GRAPHS = {"spheroid": lambda p, q: (p, q), "spheroid/flat": lambda p, q: (p, q), "spheroid/flight": lambda p, q: (q, p)}


@pytest.mark.parametrize("case", CASES)
def test_spheroid(prove, antiderivative, case):
    parameters, latitudes, longitude, vertex = CASES[case]
    f, of, miss = by_reduced_latitude(parameters, latitudes, longitude, vertex)
    guess = mp.sin(GUESSES[case].azimuth)
    c = mp.findroot(miss, (guess, guess + 1e-9))
    first, last, rate, top = of(c)
    along = antiderivative(rate, first, last)

    def curve(w):
        sine = top * mp.sin(w)
        latitude = mp.atan(sine / mp.sqrt(1 - sine**2) / (1 - f))
        return GRAPHS.get(case, lambda p, q: [p, q])(latitude, along(w))

    prove(REFERENCES[case], (curve, first, last))


def test_clairauts_rates_agree_with_the_smooth_ones():
    f, of, _ = by_reduced_latitude(spheroid.FLAT, (-0.4, 0.9), 1.0, False)
    c = mp.mpf(0.5)
    *_, rate, top = of(c)
    w = mp.mpf(0.3)
    beta = mp.asin(top * mp.sin(w))
    assert abs(clairaut(f, beta, c)[0] * top * mp.cos(w) / mp.cos(beta) - rate(w)) < 1e-30


@pytest.mark.parametrize("case", [c for c in CASES if c != "spheroid/flat"])
def test_geographiclib(case):
    _, latitudes, longitude, _ = CASES[case]
    low, high = np.degrees(latitudes)
    inverse = Geodesic.WGS84.Inverse(low, 0, high, np.degrees(longitude))
    assert REFERENCES[case].exact.value == pytest.approx(inverse["s12"], rel=3e-15)


def test_points_against_geographiclib():
    low, high = np.degrees((0.7, 0.75))
    inverse = Geodesic.WGS84.Inverse(low, 0, high, np.degrees(1.8))
    direct = Geodesic.WGS84.Direct(low, 0, inverse["azi1"], 0.3 * inverse["s12"])
    point = REFERENCES["spheroid/curve"].exact.y(np.array([0.3]))[:, 0]
    assert np.degrees(point) == pytest.approx([direct["lat2"], direct["lon2"]], rel=1e-13)
