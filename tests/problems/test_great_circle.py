"""Great circles, in 40 digits."""

import mpmath as mp

from varcalc.problems import great_circle

REFERENCES = {r.name.partition("/")[2]: r for r in great_circle.references}


def position(theta, phi):
    return mp.matrix([mp.sin(theta) * mp.cos(phi), mp.sin(theta) * mp.sin(phi), mp.cos(theta)])


def arc(start, end):
    """The point a fraction t of the shorter great circle along, and the angle between its ends."""
    angle = mp.acos((start.T * end)[0] / mp.norm(start) ** 2)
    return (lambda t: (mp.sin((1 - t) * angle) * start + mp.sin(t * angle) * end) / mp.sin(angle)), angle


def angles(point):
    return mp.acos(point[2]), mp.atan2(point[1], point[0])


def test_azimuth_by_polar_angle(prove):
    north, south, apart = map(mp.mpf, (great_circle.NORTH, great_circle.SOUTH, great_circle.APART))
    path, _ = arc(position(north, 0), position(south, apart))
    prove(REFERENCES[""], (lambda t: angles(path(t)), mp.mpf(0), mp.mpf(1)))


def test_polar_angle_by_azimuth(prove):
    path, _ = arc(position(mp.mpf(great_circle.SOUTH), 0), position(mp.mpf(great_circle.NORTH), mp.mpf(2)))
    prove(REFERENCES["longitude"], (lambda t: angles(path(t))[::-1], mp.mpf(0), mp.mpf(1)))


def test_brizards_form():
    # cos(phi - beta) = tan(alpha) cot(theta), the first integral being sin(alpha)
    theta, phi = mp.mpf(great_circle.NORTH), mp.mpf(great_circle.APART)
    path, _ = arc(position(theta, 0), position(mp.mpf(great_circle.SOUTH), phi))
    slope = mp.diff(lambda t: angles(path(t))[1], 0.5) / mp.diff(lambda t: angles(path(t))[0], 0.5)
    at = angles(path(mp.mpf(0.5)))
    sine = mp.sin(at[0]) ** 2 * slope / mp.sqrt(1 + (mp.sin(at[0]) * slope) ** 2)
    tangent = sine / mp.sqrt(1 - sine**2)
    # phi grows with theta, and so does phi - beta = arccos(tan(alpha) cot(theta))
    betas = [p - mp.acos(tangent * mp.cot(t)) for t, p in map(angles, map(path, map(mp.mpf, (0, 0.3, 1))))]
    assert all(abs(b - betas[0]) < 1e-30 for b in betas)


def test_in_space(prove):
    path, angle = arc(mp.matrix([2, 2, 1]), mp.matrix([-1, 2, 2]))
    prove(REFERENCES["embedded"], (lambda t: list(path(t)), mp.mpf(0), mp.mpf(1)))
    energy = prove(REFERENCES["energy"], (lambda t: (t, list(path(t))), mp.mpf(0), mp.mpf(1)))
    assert abs(energy - (3 * angle) ** 2 / 2) < 1e-30
