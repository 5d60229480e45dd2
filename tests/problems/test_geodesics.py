"""Distances on a spheroid: against geographiclib, and against elliptic integrals in 30 digits."""

import math

import mpmath as mp
import numpy as np
import pytest
from geographiclib.geodesic import Geodesic

import varcalc as vc
from varcalc.problems import spheroid
from varcalc.problems.spheroid import EARTH, FLAT, distances

COUNT = 60
NANOMETRES = 15e-9
"""What geographiclib promises."""


def scattered(rng, count=COUNT):
    return np.column_stack([np.degrees(np.arcsin(rng.uniform(-1, 1, count))), rng.uniform(-180, 180, count)])


def pairs(kind):
    """Starts and ends in degrees."""
    rng = np.random.default_rng(1828)
    start, end = scattered(rng), scattered(rng)
    if kind == "meridians":
        end[:, 1] = start[:, 1]
    elif kind == "over a pole":
        start[:, 0], end[:, 0] = np.abs(start[:, 0]), np.abs(end[:, 0])
        end[:, 1] = start[:, 1] + 180
    elif kind == "at the poles":
        end[:, 0] = 90 * np.sign(end[:, 0])
    elif kind == "equator":
        start[:, 0] = end[:, 0] = 0
        end[:, 1] = start[:, 1] + rng.uniform(-179, 179, COUNT)
    elif kind == "short":
        end = start + 10 ** rng.uniform(-6, 0, (COUNT, 1)) * rng.normal(size=(COUNT, 2))
        end[:, 0] = np.clip(end[:, 0], -90, 90)
    elif kind == "date line":
        start[:, 1], end[:, 1] = 180 - 5 * rng.uniform(size=COUNT), -180 + 5 * rng.uniform(size=COUNT)
    elif kind in NEARLY_ANTIPODAL:
        off = 0.0 if kind == "antipodes" else 0.3
        end = np.column_stack([-start[:, 0], start[:, 1] + 180]) + off * rng.normal(size=(COUNT, 2))
        start, end = start[:6], end[:6]
        end[:, 0] = np.clip(end[:, 0], -90, 90)
    return start, end


NEARLY_ANTIPODAL = ("antipodes", "next to antipodes")
APART = ("anywhere", "meridians", "over a pole", "at the poles", "equator", "short", "date line")


@pytest.mark.parametrize("kind", [*APART, *NEARLY_ANTIPODAL])
def test_against_geographiclib(kind):
    start, end = pairs(kind)
    found = distances(np.radians(start), np.radians(end), EARTH)
    known = np.array(
        [Geodesic.WGS84.Inverse(*a, *b, Geodesic.DISTANCE)["s12"] for a, b in zip(start, end, strict=True)]
    )
    answered = np.isfinite(found.lengths)
    off = np.abs(found.lengths - known)[answered]
    assert np.all(off <= found.errors[answered] + NANOMETRES)
    assert np.all(off <= 1e-12 * known[answered] + NANOMETRES)
    # certain is what is shorter than half the polar circumference of the sphere within
    assert np.all(found.certain == (known < math.pi * EARTH["a"] * (1 - EARTH["f"])))
    assert np.all(answered | ~found.certain)
    assert answered.mean() > 0.9


def karney(ends, a, f):
    """The length of the geodesic between two points by Karney's (2013) eq. 7-9, from geographiclib's azimuths."""
    (phi1, lam1), (phi2, lam2) = ((mp.mpf(v) for v in p) for p in ends)
    (lat1, lon1), (lat2, lon2) = np.degrees(ends)
    guess = Geodesic(a, f).Inverse(lat1, lon1, lat2, lon2)
    forth = mp.mpf(1 if abs(guess["azi2"]) < 90 else -1)
    beta1, beta2 = (mp.atan((1 - mp.mpf(f)) * mp.tan(v)) for v in (phi1, phi2))

    def arc(azimuth):
        sine0 = mp.sin(azimuth) * mp.cos(beta1)
        cosine2 = forth * mp.sqrt(1 - (sine0 / mp.cos(beta2)) ** 2)
        sigma1 = mp.atan2(mp.sin(beta1), mp.cos(azimuth) * mp.cos(beta1))
        sigma2 = mp.atan2(mp.sin(beta2), cosine2 * mp.cos(beta2))
        sigma2 += 2 * mp.pi if sigma2 < sigma1 else 0
        k2 = f * (2 - mp.mpf(f)) * (1 - sine0**2) / (1 - mp.mpf(f)) ** 2
        return sine0, sigma1, sigma2, lambda s: mp.sqrt(1 + k2 * mp.sin(s) ** 2)

    def miss(azimuth):
        sine0, sigma1, sigma2, root = arc(azimuth)
        omega = [mp.atan2(sine0 * mp.sin(s), mp.cos(s)) for s in (sigma1, sigma2)]
        rate = mp.quad(lambda s: (2 - mp.mpf(f)) / (1 + (1 - mp.mpf(f)) * root(s)), [sigma1, sigma2])
        gone = omega[1] - omega[0] - f * sine0 * rate - (lam2 - lam1)
        return gone - 2 * mp.pi * mp.nint(gone / (2 * mp.pi))

    first = mp.radians(mp.mpf(guess["azi1"]))
    _, sigma1, sigma2, root = arc(mp.findroot(miss, (first, first * (1 + mp.mpf(10) ** -9))))
    return mp.mpf(a) * (1 - mp.mpf(f)) * mp.quad(root, [sigma1, sigma2])


@pytest.mark.parametrize("shape", [EARTH, FLAT], ids=["Earth", "flat"])
def test_against_elliptic_integrals(shape):
    """Short geodesics and long, in 30 digits from the same coordinates."""
    ends = [
        ((0.3, 0.1), (0.3 + 1e-7, 0.1 + 2e-7)), ((-0.9, 3.0), (-0.9 + 1e-4, 3.0 - 3e-5)), ((1.4, -2.0), (1.2, 0.4)),
        ((-0.5, 0.2), (0.8, 0.9)), ((0.7, 0.1), (0.75, 1.9)), ((1e-3, 0.3), (-2e-3, 1.4)),
    ]  # fmt: skip
    with mp.workdps(30):
        exact = [karney(e, shape["a"], shape["f"]) for e in ends]
    found = distances([e[0] for e in ends], [e[1] for e in ends], shape)
    assert found.certain.all()
    off = np.array([float(abs(mp.mpf(length) - known)) for length, known in zip(found.lengths, exact, strict=True)])
    assert np.all(off <= found.errors)
    assert np.all(found.errors <= 1e-12 * found.lengths)


def test_a_point_is_no_distance_from_itself():
    found = distances([[0.3, 0.1], [math.pi / 2, 0.0]], [[0.3, 0.1], [math.pi / 2, 0.0]], EARTH)
    assert found.lengths.tolist() == [0.0, 0.0]
    assert found.certain.all()


@pytest.mark.parametrize(
    ("start", "end", "message"),
    [
        ([[0.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]], "one of each for a pair"),
        ([[2.0, 0.0]], [[0.0, 0.0]], "latitudes within pi/2"),
        ([[0.0, math.nan]], [[0.0, 0.0]], "must be finite"),
        ([0.0, 1.0, 2.0], [[0.0, 0.0]], r"as \(K, 2\) latitudes and longitudes"),
    ],
)
def test_what_are_no_points_is_refused(start, end, message):
    with pytest.raises(ValueError, match=message):
        distances(start, end, EARTH)


def test_latitude_and_longitude_themselves_for_many_pairs():
    """A curve between points that are parameters, in the coordinates that come first to mind; away from the poles."""
    rng = np.random.default_rng(7)
    latitudes, longitudes = rng.uniform(-1, 1, (2, COUNT)), rng.uniform(0, 2, (2, COUNT))
    curve = vc.Curve(
        spheroid.speed,
        vc.At((vc.Parameter("lat1"), vc.Parameter("lon1"))),
        vc.At((vc.Parameter("lat2"), vc.Parameter("lon2"))),
        parameters=EARTH | {"lat1": 0.7, "lon1": 0.0, "lat2": 0.75, "lon2": 1.8},
    )
    names = {"lat1": latitudes[0], "lat2": latitudes[1], "lon1": longitudes[0], "lon2": longitudes[1]}
    found = vc.sweep(curve, vc.Paired(names), vc.Ritz(), tol=1e-13)
    ends = np.degrees([latitudes[0], longitudes[0], latitudes[1], longitudes[1]]).T
    known = np.array([Geodesic.WGS84.Inverse(*e, Geodesic.DISTANCE)["s12"] for e in ends])
    assert not found.failures
    assert np.all(np.abs(found.values - known) <= found.claimed_errors + NANOMETRES)
    assert np.all(found.claimed_errors <= 1e-12 * known)
