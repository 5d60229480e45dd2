"""Geodesics of sphere, spheroid and cylinder: conjugate points, continua, windings, poles."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from geographiclib.constants import Constants
from geographiclib.geodesic import Geodesic

import varcalc as vc

# the sphere


def on_sphere(q):
    return ca.sumsqr(q) - 1


def great_circle(angle):
    """Between two points of the unit sphere in space; exact antipodes for pi."""
    end = [-1.0, 0.0, 0.0] if angle == math.pi else [math.cos(angle), math.sin(angle), 0.0]
    return vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At([1.0, 0.0, 0.0]), vc.At(end), [vc.Holonomic(on_sphere)])


def by_longitude(y, v):
    return ca.sqrt(v**2 + ca.cos(y) ** 2)


def equator(angle):
    return vc.Problem(lambda x, y, v: by_longitude(y, v), vc.Fixed(0, 0), vc.Fixed(angle, 0))


@pytest.fixture(scope="module")
def both_ways():
    return vc.extremals(great_circle(2.5))


def test_the_arcs_of_a_great_circle_and_their_indices(both_ways):
    lengths = [2.5, 2 * float(mp.pi) - 2.5]
    assert [s.value for s in both_ways][:2] == pytest.approx(lengths, abs=1e-11)
    assert [s.index for s in both_ways][:2] == [0, 1]
    # pi along the long arc, as a share of it
    assert both_ways[1].conjugate_points == pytest.approx([float(mp.pi) / lengths[1]], abs=1e-9)


@pytest.mark.parametrize("angle", [0.5, 2.5, 3.0])
def test_solve_takes_the_short_arc(angle):
    solution = vc.solve(great_circle(angle))
    assert abs(solution.value - angle) <= 10 * solution.error.value + 1e-15
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_antipodes_have_a_continuum_of_shortest_arcs():
    refused = vc.solve(
        great_circle(math.pi), vc.Ritz(starts=1), throw=False,
        guess=lambda t: [math.cos(math.pi * t), 0.6 * math.sin(math.pi * t), 0.8 * math.sin(math.pi * t)],
    )  # fmt: skip
    assert refused.verdict is vc.Verdict.DEGENERATE
    assert refused.value == pytest.approx(float(mp.pi), abs=1e-9)


def test_antipodes_in_angles():
    assert vc.solve(equator(math.pi), throw=False).verdict is vc.Verdict.DEGENERATE
    [one] = vc.extremals(equator(math.pi))
    assert one.verdict is vc.Verdict.DEGENERATE
    assert one.value == pytest.approx(float(mp.pi), abs=1e-12)


def test_past_the_antipode_the_equator_is_a_saddle():
    arc = vc.solve(equator(4.0), vc.Collocation(), guess=lambda x: 0.0)
    check = vc.verify(arc)
    assert arc.value == pytest.approx(4.0, abs=1e-12)
    assert (check.verdict, check.index) == (vc.Verdict.SADDLE, 1)
    assert check.conjugate_points == pytest.approx([float(mp.pi)], abs=1e-10)


def near_the_pole(latitude, longitude):
    """The angle between two points of one latitude, by the cosine rule."""
    b, w = mp.radians(latitude), mp.radians(longitude)
    return mp.acos(mp.sin(b) ** 2 + mp.cos(b) ** 2 * mp.cos(w))


@pytest.mark.parametrize("method", [None, vc.Shooting(), vc.FirstIntegral()], ids=repr)
def test_a_great_circle_close_to_the_pole_in_angles(method):
    b, w = math.radians(60), math.radians(179.9)
    problem = vc.Problem(lambda x, y, v: by_longitude(y, v), vc.Fixed(0, b), vc.Fixed(w, b))
    solution = vc.solve(problem, method)
    assert abs(solution.value - float(near_the_pole(60, 179.9))) <= 10 * solution.error.value <= 1e-9


def test_the_same_embedded_in_space():
    b, w = math.radians(60), math.radians(179.9)
    start, end = (
        [math.cos(b) * math.cos(lon), math.cos(b) * math.sin(lon), math.sin(b)] for lon in (0.0, w)
    )  # fmt: skip
    embedded = vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At(start), vc.At(end), [vc.Holonomic(on_sphere)])
    solution = vc.solve(embedded)
    assert solution.value == pytest.approx(float(near_the_pole(60, 179.9)), abs=1e-11)
    assert solution.stats.elements <= 2


# the spheroid

EARTH = Geodesic.WGS84
A, F = Constants.WGS84_a, Constants.WGS84_f


def principal_radii(latitude):
    e2 = F * (2 - F)
    across = A / ca.sqrt(1 - e2 * ca.sin(latitude) ** 2)
    return (1 - e2) * across**3 / A**2, across


def spheroid_length(x, y, v):
    M, N = principal_radii(y)
    return ca.sqrt((M * v) ** 2 + (N * ca.cos(y)) ** 2)


def on_earth(first, last, longitude):
    """Latitude by longitude, in degrees."""
    a, b, w = map(math.radians, (first, last, longitude))
    return vc.Problem(spheroid_length, vc.Fixed(0, a), vc.Fixed(w, b))


def azimuth(solution):
    """The direction at the start, in degrees from north."""
    M, N = (float(r) for r in principal_radii(solution.y(0.0)))
    return math.degrees(math.atan2(N * math.cos(solution.y(0.0)), M * solution.dy(0.0)))


def first_conjugate(latitude, direction, upto):
    """Longitude in radians where the reduced length of geographiclib first vanishes; None before ``upto`` metres."""
    line = EARTH.Line(latitude, 0, direction, Geodesic.ALL)

    def reduced(s):
        return line.Position(s, Geodesic.ALL)["m12"]

    if reduced(upto) > 0:
        return None
    s = mp.findroot(lambda s: reduced(float(s)), (upto / 2, upto), "illinois", tol=1e-12, verify=False)
    return math.radians(line.Position(float(s), Geodesic.ALL | Geodesic.LONG_UNROLL)["lon2"])


def test_the_equator_is_shortest_as_far_as_it_is():
    limit = 180 * (1 - F)
    before = vc.solve(on_earth(0, 0, limit - 1e-2))
    assert before.value == pytest.approx(A * math.radians(limit - 1e-2), rel=1e-12)
    assert vc.verify(before).verdict is vc.Verdict.MINIMUM
    assert vc.solve(on_earth(0, 0, limit), throw=False).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize("longitude", [179.9])
def test_beyond_it_two_mirror_images_are_shorter(longitude):
    oracle = EARTH.Inverse(0, 0, 0, longitude)["s12"]
    assert oracle < A * math.radians(longitude)
    solution = vc.solve(on_earth(0, 0, longitude))
    assert abs(solution.value - oracle) <= 10 * solution.error.value <= 1e-2
    found = vc.extremals(on_earth(0, 0, longitude))
    assert [s.value for s in found] == pytest.approx([oracle, oracle, A * math.radians(longitude)], rel=1e-13)
    assert [s.index for s in found] == [0, 0, 1]
    assert found[0].y(1.0) == pytest.approx(-found[1].y(1.0), rel=1e-6)
    assert found[2].conjugate_points == pytest.approx([math.pi * (1 - F)], abs=1e-10)


def test_almost_antipodal_points():
    oracle = EARTH.Inverse(30, 0, -29.9, 179.8)
    solution = vc.solve(on_earth(30, -29.9, 179.8))
    assert abs(solution.value - oracle["s12"]) <= 10 * solution.error.value <= 1e-2
    found = vc.extremals(on_earth(30, -29.9, 179.8))
    assert found[0].value == pytest.approx(oracle["s12"], abs=1e-6)
    assert azimuth(found[0]) == pytest.approx(oracle["azi1"], abs=1e-6)
    for geodesic in found:
        place = first_conjugate(30, azimuth(geodesic), geodesic.value)
        assert geodesic.conjugate_points == pytest.approx([] if place is None else [place], abs=1e-8)
    assert [s.index for s in found] == [0, 0, 1]


def meridian():
    """From the equator over a pole to the equator."""
    return 2 * A * mp.ellipe(mp.mpf(F) * (2 - F))


def test_no_success_over_the_pole_in_angles():
    # the shortest way is a meridian, no graph over longitude: graphs come near it, and none is as short
    assert float(meridian()) == pytest.approx(EARTH.Inverse(0, 0, 0, 180)["s12"], abs=1e-6)
    with pytest.raises(vc.VariationalError, match="not attained") as refusal:
        vc.solve(on_earth(0, 0, 180))
    assert refusal.value.verdict is vc.Verdict.NOT_ATTAINED


def test_over_the_pole_embedded_in_space():
    flat = (1 - F) ** 2
    spheroid = vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At([A, 0, 0]), vc.At([-A, 0, 0]),
        [vc.Holonomic(lambda q: (q[0] ** 2 + q[1] ** 2 + q[2] ** 2 / flat) / A**2 - 1)],
    )  # fmt: skip
    for side in (1, -1):
        solution = vc.solve(
            spheroid,
            guess=lambda t, side=side: [A * math.cos(math.pi * t), 0, side * (1 - F) * A * math.sin(math.pi * t)],
        )
        assert abs(solution.value - float(meridian())) <= min(10 * solution.error.value, 1e-3)
        assert solution.q(0.5) == pytest.approx([0, 0, side * (1 - F) * A], abs=1.0)


# the cylinder


def test_every_winding_of_a_cylinder_is_a_local_minimum():
    helices = vc.extremals(
        vc.Problem(lambda z, angle, slope: ca.sqrt(1 + slope**2), vc.Fixed(0, 0), vc.Fixed(1, 2)),
        period=2 * np.pi, windings=2,
    )  # fmt: skip
    lengths = {k: float(mp.hypot(1, 2 + 2 * mp.pi * k)) for k in range(-2, 3)}
    assert list(helices.windings) == sorted(lengths, key=lengths.__getitem__)
    assert [s.value for s in helices] == pytest.approx([lengths[k] for k in helices.windings], abs=1e-12)
    assert {vc.verify(s).verdict for s in helices} == {vc.Verdict.MINIMUM}
    assert [s.index for s in helices] == [0] * 5
