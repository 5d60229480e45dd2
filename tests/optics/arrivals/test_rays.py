"""All rays between two points, against closed forms evaluated here."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

from varcalc import integrators, optics
from varcalc.optics.arrivals import fan
from varcalc.optics.models import watch
from varcalc.optics.models.watch import MOST_SEARCHED
from varcalc.optics.rays.ray import SHADOW, no_rays

AIR, GLASS = optics.Uniform(1.0), optics.Uniform(1.5)


def parabolic(n0=1.0, g=1.0):
    return optics.Scene(optics.Stratified(lambda y: ca.sqrt(n0**2 - 2 * g * y)))


def parabolic_paths(n0, g, a, b):
    """Optical paths of all rays from a to b where n² = n0² - 2 g y, one rising to the caustic last."""
    n2, dy, d2 = n0**2 - 2 * g * a[1], b[1] - a[1], float(np.sum((np.array(b) - a) ** 2))
    mean = n2 - g * dy
    inside = mean**2 - g**2 * d2
    if inside < 0:
        return []
    sigma = np.sqrt(2 * (mean + np.array([-1, 1]) * np.sqrt(inside)) / g**2)
    sigma[0] = np.sqrt(2 * d2 / (mean + np.sqrt(inside)))  # without cancellation
    climb = dy / sigma + g * sigma / 2  # n sin(theta) at the start
    return list(n2 * sigma - g * climb * sigma**2 + g**2 * sigma**3 / 3)


def test_arrivals_where_the_squared_index_is_linear():
    scene = parabolic()
    first, second = scene.rays((0, 0), (0.5, 0))
    assert first.optical_path == pytest.approx(0.494521305498037, rel=1e-14)
    assert second.optical_path == pytest.approx(0.730223565893552, rel=1e-14)
    assert (first.index, second.index) == (0, 1)
    np.testing.assert_allclose(np.degrees(np.arctan2(*first.tangents[0][::-1])), 15.0, rtol=1e-13)
    np.testing.assert_allclose(second.conjugate_points, [[2 - np.sqrt(3), np.sqrt(3) * (2 - np.sqrt(3))]], rtol=1e-10)
    assert first.error < 1e-14
    np.testing.assert_allclose(second.point(np.array([0.0, second.optical_path])), [[0, 0], [0.5, 0]], atol=1e-14)
    assert first.model == "linear ray equation"


def test_no_arrival_is_missed_and_none_is_false():
    """Random pairs, a third of them within a millionth of the caustic, on either side."""
    rng = np.random.default_rng(7)
    scene = parabolic(1.0, 1.0)
    a = np.array([0.0, 0.0])
    for k in range(24):
        x = rng.uniform(-0.9, 0.9)
        y = rng.uniform(-1.0, 0.5 - x**2 / 2)
        if k % 3 == 0:
            y = 0.5 - x**2 / 2 + rng.choice([-1, 1]) * 10 ** rng.uniform(-9, -6)
        paths = parabolic_paths(1.0, 1.0, a, (x, y))
        rays = scene.rays(a, (x, y))
        np.testing.assert_allclose([r.optical_path for r in rays], paths, rtol=1e-12)
        assert [r.index for r in rays] == list(range(len(paths)))


def test_the_caustic_and_the_shadow():
    [ray] = parabolic().rays((0, 0), (1, 0))
    assert ray.degenerate
    assert ray.optical_path == pytest.approx(2 * np.sqrt(2) / 3, rel=1e-14)
    dark = parabolic().rays((0, 0), (1.001, 0))
    assert len(dark) == 0
    assert "shadow" in dark.reason
    assert not parabolic().rays((0, 0), (1 + 1e-9, 0))


def test_a_point_in_reach_of_a_source_deep_down_in_other_units():
    scene = parabolic(1.6, 2e-4)
    a, b = (1e3, -2e3), (7e3, 500.0)
    rays = scene.rays(a, b)
    np.testing.assert_allclose([r.optical_path for r in rays], parabolic_paths(1.6, 2e-4, a, b), rtol=1e-12)


@pytest.mark.parametrize(
    ("index", "path"),
    [
        (lambda y: 2.0 / y, lambda d2, y1, y2: 2.0 * np.arccosh(1 + d2 / (2 * y1 * y2))),
        (lambda y: 1 / (1 + y), lambda d2, y1, y2: np.arccosh(1 + d2 / (2 * (1 + y1) * (1 + y2)))),
    ],
    ids=["H/y", "c = 1 + y"],
)
def test_one_ray_and_no_conjugate_point_where_the_speed_is_linear(index, path):
    a, b = np.array([0.1, 0.7]), np.array([1.4, 0.4])
    [ray] = optics.Scene(optics.Stratified(index)).rays(a, b)
    assert ray.optical_path == pytest.approx(path(np.sum((b - a) ** 2), a[1], b[1]), rel=1e-13)
    assert ray.index == 0


def test_the_exponential_index():
    k, a, b = -0.4, np.array([0.0, 0.2]), np.array([2.0, 0.5])
    [ray] = optics.Scene(optics.Stratified(lambda y: 1.3 * ca.exp(k * y))).rays(a, b)
    e = np.exp(k * np.array([a[1], b[1]]))
    exact = 1.3 / abs(k) * np.sqrt(e[0] ** 2 + e[1] ** 2 - 2 * e[0] * e[1] * np.cos(k * (b[0] - a[0])))
    assert ray.optical_path == pytest.approx(exact, rel=1e-13)
    beyond = optics.Scene(optics.Stratified(lambda y: 1.3 * ca.exp(k * y))).rays((0, 0), (np.pi / 0.4 + 0.01, 0.0))
    assert len(beyond) == 0


@pytest.mark.parametrize("dimension", [2, 3])
def test_both_ways_round_in_a_fish_eye(dimension):
    a, b = np.array([1.0, 0.2, 0.1])[:dimension], np.array([-0.3, 0.9, 0.4])[:dimension]
    rays = optics.Scene(optics.fish_eye()).rays(a, b, within=6.0)
    chord = np.linalg.norm(a - b) / np.sqrt((1 + a @ a) * (1 + b @ b))
    short = 2 * np.arcsin(chord)
    np.testing.assert_allclose([r.optical_path for r in rays], [short, 2 * np.pi - short], rtol=1e-12)
    assert [r.index for r in rays] == [0, dimension - 1]
    np.testing.assert_allclose(rays[1].conjugate_points, np.tile(-a / (a @ a), (dimension - 1, 1)), atol=1e-10)
    exact = (np.sin(short) * (1 + b @ b) / 2) ** (dimension - 1)
    np.testing.assert_allclose([r.spreading for r in rays], exact, rtol=1e-11)


def test_the_antipode_of_a_fish_eye_is_a_continuum():
    rays = optics.Scene(optics.fish_eye()).rays((1, 0), (-1, 0))
    assert rays.continuum
    assert rays[0].degenerate
    assert rays[0].optical_path == pytest.approx(np.pi, rel=1e-13)


def test_layers_in_space_bend_rays_in_a_vertical_plane():
    a, b = np.array([0.0, 0.0, 0.0]), np.array([0.3, 0.4, 0.0])
    rays = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))).rays(a, b)
    np.testing.assert_allclose(
        [r.optical_path for r in rays], parabolic_paths(1.0, 1.0, np.zeros(2), (0.5, 0.0)), rtol=1e-12
    )
    assert [r.index for r in rays] == [0, 1]
    angle = np.deg2rad([15.0, 75.0])
    in_plane = np.abs(2 * np.cos(2 * angle)) * np.sin(angle)  # |dX/dθ| sin θ, with X = sin 2θ
    sagittal = 2 * np.sin(angle)  # σ: layers do not bend rays sideways
    np.testing.assert_allclose([r.spreading for r in rays], in_plane * sagittal, rtol=1e-12)


def test_refraction_at_a_plane_is_fermats():
    [ray] = optics.Scene([AIR, GLASS], [optics.Plane((0, 0), (0, 1))]).rays((-1.0, 1.0), (1.0, -1.0))
    x = brentq(lambda x: (x + 1) / np.hypot(x + 1, 1) - 1.5 * (1 - x) / np.hypot(1 - x, 1), -1, 1, xtol=1e-15)
    assert ray.optical_path == pytest.approx(np.hypot(x + 1, 1) + 1.5 * np.hypot(1 - x, 1), rel=1e-14)
    np.testing.assert_allclose(ray.point(np.hypot(x + 1, 1)), [x, 0], atol=1e-14)
    assert ray.index == 0
    assert ray.model == "straight segments"


def test_a_hollow_mirror_has_a_shortest_and_a_longest_ray():
    """Alhazen's problem inside a circle, for two points near its centre."""
    mirror = optics.Sphere((0, 0), 1.0, mirror=True)
    a, b = np.array([0.1, 0.0]), np.array([-0.1, 0.05])
    rays = optics.Scene(AIR, mirror).rays(a, b)
    t = np.linspace(0, 2 * np.pi, 20001)

    def path(t):
        p = np.stack([np.cos(t), np.sin(t)])
        return np.hypot(*(p - a[:, None])) + np.hypot(*(p - b[:, None]))

    values = path(t[:-1])
    turning = np.flatnonzero((values - np.roll(values, 1)) * (np.roll(values, -1) - values) < 0)
    np.testing.assert_allclose([r.optical_path for r in rays], np.sort(values[turning]), rtol=1e-7)
    assert [r.index for r in rays] == [0, 1]  # a minimum, and a maximum with a focus on the way


def test_rays_through_air_into_graded_glass():
    n0, g = 1.5, 0.3
    glass = optics.Stratified(lambda y: ca.sqrt(n0**2 + 2 * g * y))
    scene = optics.Scene([AIR, glass], [optics.Plane((0, 0), (0, 1))])
    rays = scene.rays((-1.0, 1.0), (0.8, -0.9))

    def path(x, arc):
        return np.hypot(x + 1, 1) + parabolic_paths(n0, g, np.zeros(2), (0.8 - x, 0.9))[arc]

    for arc, ray in enumerate(rays):  # the glass bends rays up: one goes straight, one by way of its deepest point
        x, y = ray.point(_crossing(ray))
        assert y == pytest.approx(0.0, abs=1e-13)
        assert ray.optical_path == pytest.approx(path(x, arc), rel=1e-13)
        assert path(x + 1e-4, arc) == pytest.approx(path(x - 1e-4, arc), abs=1e-11)
    assert len(rays) == 2
    assert rays[0].model == "straight segments, linear ray equation"


def _crossing(ray):
    """The optical path at which the first of the two legs ends."""
    return float(ray.legs[0].at(np.array([ray.legs[0].length])).optical_path[0])


def test_reasons_for_no_ray():
    assert "dark" in parabolic().rays((0, 0), (0, 0.6)).reason
    corner = optics.Scene([AIR, GLASS, AIR], [optics.Plane((0, 0), (1, 0)), optics.Plane((0, 0), (0, 1))])
    rays = corner.rays((-1.0, -1.0), (1.0, 1.0))  # n > sqrt 2: what enters one face of a cube cannot leave by the next
    assert len(rays) == 0
    assert "total reflection" in rays.reason
    ball = optics.Scene([AIR, GLASS], optics.Sphere((0, 0), 1.0))
    assert "shadow" in ball.rays((-3.0, 0.0), (5.0, 4.0)).reason


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ((0, 0), (0, 0), "the same point"),
        ((0, 0.7), (0, 0), "index is nan at the source"),
        ((0, 0), (0, 0, 1), "A has 2 coordinates, B 3"),
        ((0, 0), "there", "must be made of numbers"),
    ],
)
def test_bad_ends_are_refused(a, b, message):
    with pytest.raises((ValueError, TypeError), match=message):
        parabolic().rays(a, b)


def test_a_range_that_is_no_length_is_refused():
    with pytest.raises(ValueError, match="within must be a positive"):
        parabolic().rays((0, 0), (0.5, 0), within=-1)
    with pytest.raises(ValueError, match="B lies on surface 0"):
        optics.Scene([AIR, GLASS], [optics.Plane((0, 0), (0, 1))]).rays((0, 1), (3, 0))


def test_refraction_in_space_is_that_in_the_plane_of_incidence():
    scene = optics.Scene([AIR, GLASS], [optics.Plane((0, 0, 0), (0, 0, 1))])
    [ray] = scene.rays((-0.6, -0.8, 1.0), (0.6, 0.8, -1.0))
    [flat] = optics.Scene([AIR, GLASS], [optics.Plane((0, 0), (0, 1))]).rays((-1.0, 1.0), (1.0, -1.0))
    assert ray.optical_path == pytest.approx(flat.optical_path, rel=1e-14)
    assert ray.index == 0


def test_a_graded_medium_in_space_without_a_plane_for_the_rays():
    """A rod, from its axis: r = (p/w) sin(w σ) in the plane of the axis and B, and σ = z/pz."""
    n0, a, length, within = 1.5, 0.8, 2.0, 4.5
    rays = optics.Scene(optics.selfoc(n0, a)).rays((0, 0, 0), (0.3, 0.1, length), within=within)
    w, expected = n0 * a, []
    for across in (np.hypot(0.3, 0.1), -np.hypot(0.3, 0.1)):  # B on the side the ray starts to, and on the other

        def miss(pz, across=across):
            return np.sqrt(n0**2 - pz**2) / w * np.sin(w * length / pz) - across

        grid = np.linspace(0.3, n0 - 1e-9, 4001)
        brackets = [(p, q) for p, q in pairwise(grid) if miss(p) * miss(q) < 0]
        sigma = length / np.array([brentq(miss, p, q, xtol=1e-15) for p, q in brackets])
        square = (n0**2 - (length / sigma) ** 2) / w**2  # ∫ r² dσ = square (σ/2 - sin(2 w σ)/(4 w))
        expected += list(n0**2 * sigma - w**2 * square * (sigma / 2 - np.sin(2 * w * sigma) / (4 * w)))
    expected = sorted(path for path in expected if path <= within)
    assert len(expected) >= 1
    np.testing.assert_allclose([r.optical_path for r in rays], expected, rtol=1e-12)


def test_without_heyoka_the_answers_are_the_same_to_fewer_digits(monkeypatch):
    for name, choice in (("default", integrators.Dop853), ("available", lambda: (integrators.Dop853(),))):
        monkeypatch.setattr(integrators, name, choice)
    rays = parabolic().rays((0, 0), (0.5, 0))
    np.testing.assert_allclose([r.optical_path for r in rays], [0.494521305498037, 0.730223565893552], rtol=1e-10)
    assert [r.index for r in rays] == [0, 1]


def test_many_pairs_are_answered_as_each_would_be():
    scene, rng = parabolic(), np.random.default_rng(4)
    sources, receivers = rng.uniform(-0.5, 0.2, (2, 7, 2))
    together = scene.arrivals(sources, receivers)
    shared = scene.arrivals(sources[0], receivers)
    for a, b, rays, of_one in zip(sources, receivers, together, shared, strict=True):
        np.testing.assert_allclose([r.optical_path for r in rays], parabolic_paths(1.0, 1.0, a, b), rtol=1e-13)
        np.testing.assert_allclose(
            [r.optical_path for r in of_one], parabolic_paths(1.0, 1.0, sources[0], b), rtol=1e-13
        )
        assert [r.index for r in rays] == list(range(len(rays)))


def test_pairs_in_space_share_a_source_and_differ_in_their_planes():
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    receivers = [(0.3, 0.4, 0.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (2.0, 0.0, 0.0)]
    answers = scene.arrivals((0, 0, 0), receivers)
    expected = parabolic_paths(1.0, 1.0, np.zeros(2), (0.5, 0.0))
    for rays in answers[:3]:
        np.testing.assert_allclose([r.optical_path for r in rays], expected, rtol=1e-13)
    assert "shadow" in answers[3].reason


def test_a_point_just_below_the_caustic_of_rays_that_have_all_but_stopped_rising():
    """Both rays are steep, and turn on the spot: branches of the miss were lost here."""
    b = (0.044105701203470904, 0.4990273279970481)
    rays = parabolic().rays((0, 0), b)
    np.testing.assert_allclose([r.optical_path for r in rays], parabolic_paths(1.0, 1.0, (0.0, 0.0), b), rtol=1e-13)
    assert [r.index for r in rays] == [0, 1]


def test_a_ray_that_would_have_to_leave_the_last_medium_on_its_way_is_none():
    """B lies above the plane, as if below it: parabolas come back up to it, but not in the last medium."""
    below = optics.Stratified(lambda y: ca.sqrt(1 + 2 * y))
    scene = optics.Scene([AIR, below], [optics.Plane((0, 0), (0, 1))])
    down, up = scene.rays((0.0, 0.2), (0.7, -0.1))
    assert [down.index, up.index] == [0, 1]
    assert len(up.conjugate_points) == 1
    assert "shadow" in scene.rays((0.0, 0.2), (0.7, 0.1)).reason


@pytest.mark.parametrize(
    ("sources", "receivers", "message"),
    [
        ([(0, 0)] * 2, [(1, 0)] * 3, "2 sources and 3 receivers"),
        ((0, 0), [(0.5, 0), (0, 0)], "same point in row 1"),
        ((0, 0), [(0.5, 0, 0)], "sources has 2 coordinates, receivers 3"),
    ],
)
def test_bad_pairs_are_refused(sources, receivers, message):
    with pytest.raises(ValueError, match=message):
        parabolic().arrivals(sources, receivers)


def test_no_pairs_have_no_answers():
    assert parabolic().arrivals(np.zeros((0, 2)), np.zeros((0, 2))) == []


def test_a_continuum_hides_no_ray_of_another_optical_path():
    """In n² = 2 - r², r = r₀ cos σ + p₀ sin σ meets -r₀ at σ = π for every p₀, and at π/2 for p₀ = -r₀."""
    rays = optics.Scene(optics.luneburg()).rays((-1, 0), (1, 0), within=4.0)
    assert rays.continuum
    np.testing.assert_allclose(
        [ray.optical_path for ray in rays], [1 + np.pi / 2, np.pi, 3 * np.pi / 2 - 1], rtol=1e-13
    )
    assert [ray.degenerate for ray in rays] == [False, True, False]
    before = optics.Scene(optics.luneburg()).rays((-1, 0), (1, 0), within=3.0)
    assert len(before) == 1
    assert not before.continuum


def test_many_turns_about_a_fish_eye():
    """All circles from A come to B after π/2 + kπ: rays that go far round come back out of step, and are given up."""
    rays = optics.Scene(optics.fish_eye()).rays((1, 0), (0, 1), within=13.0)
    np.testing.assert_allclose([ray.optical_path for ray in rays], np.pi / 2 + np.pi * np.arange(len(rays)), rtol=1e-12)
    assert len(rays) == 4


def test_the_time_of_a_ray_is_its_optical_path_over_a_speed():
    # c = 1500 (1 + y): the time between points of one depth is acosh(1 + d^2/2)/1500 at y = 0
    [ray] = optics.Scene(optics.Stratified(lambda y: 1 / (1 + y))).rays((0, 0), (1, 0))
    assert ray.travel_time(1500.0) == pytest.approx(np.arccosh(1.5) / 1500, rel=1e-13)
    assert ray.travel_time() == ray.optical_path / 299_792_458
    with pytest.raises(ValueError, match="speed"):
        ray.travel_time(0.0)


def through_ball(angle, centre, radius, index):
    """Where a ray from the origin leaves a ball lens, its direction there, and the optical path, by Snell's law."""
    ahead = np.array([np.cos(angle), np.sin(angle)])
    path, place = 0.0, np.zeros(2)
    for ratio in (index, 1 / index):
        way = (place - centre) @ ahead
        root = np.sqrt(way**2 - (place - centre) @ (place - centre) + radius**2)
        step = -way - root if ratio > 1 else -2 * way
        place = place + step * ahead
        path += step * (1 if ratio > 1 else index)
        normal = (place - centre) / radius * (1 if ratio > 1 else -1)
        cosine = -ahead @ normal
        ahead = ahead / ratio + (cosine / ratio - np.sqrt(1 - (1 - cosine**2) / ratio**2)) * normal
    return place, ahead, path


@pytest.mark.parametrize(("radius", "share"), [(0.2, -0.4), (0.02, -0.9), (0.02, 0.2), (0.003, 0.7)])
def test_lenses_that_are_seen_under_small_angles_are_looked_through(radius, share):
    centre, index = np.array([1.0, 0.31]), 1.6
    middle, half = np.arctan2(centre[1], centre[0]), np.arcsin(radius / np.hypot(*centre))
    angle = middle + half * share
    place, ahead, path = through_ball(angle, centre, radius, index)
    target = place + 0.7 * ahead
    ball = optics.Sphere(tuple(centre), radius)
    media = [optics.Uniform(1.0), optics.Uniform(index), optics.Uniform(1.0)]
    jump = optics.Graded(lambda x, y: ca.if_else((x - centre[0]) ** 2 + (y - centre[1]) ** 2 < radius**2, index, 1.0))
    for scene in (optics.Scene(media, [ball, ball]), optics.Scene(jump)):
        rays = scene.rays((0, 0), target, within=2.5)
        # round-off of the angle is magnified hundreds of times by the smallest of them
        assert any(abs(ray.optical_path - path - 0.7) < 1e-10 for ray in rays)
        # none is shorter than the straight line, as one that is carried backwards would be
        assert min(ray.optical_path for ray in rays) > np.hypot(*target) * (1 - 1e-13)


@pytest.mark.parametrize(("width", "share"), [(0.05, -0.5), (0.015, 0.8), (1e-5, -0.3)])
def test_what_bends_rays_is_seen_under_small_angles(width, share):
    centre = np.array([0.8, 0.27])
    scene = optics.Scene(
        optics.Graded(lambda x, y: 1 + 0.5 * ca.exp(-((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / width**2))
    )
    angle = np.arctan2(centre[1], centre[0]) + width * share
    heading = np.array([np.cos(angle), np.sin(angle)])
    (end,) = scene.trace((0, 0), heading, optical_path=1.7).points
    rays = scene.rays((0, 0), end, within=2.0)
    assert any(np.abs(ray.tangents[0] - heading).max() < 1e-8 for ray in rays)


def test_no_ray_of_a_fan_comes_into_the_last_medium():
    """Three curved surfaces in space, the last a cap that a whole net of first directions misses."""
    surfaces = [
        optics.Asphere((0, 0, 0.7), (0, 0, 1), -1.7, 0.4, (0.01,)),
        optics.Sphere((0, 0, -0.5), 1.7),
        optics.Conic((0, 0, 2.0), (0, 0, 1), 2.7, -1.0),
    ]
    scene = optics.Scene([optics.Uniform(n) for n in (1.43, 1.87, 1.38, 1.5)], surfaces)
    assert scene.rays((0, 0.36, -2.5), (-0.38, 0.08, 4.55)).searched


def test_one_narrow_lens_is_met_through_another():
    first, width = np.array([0.5, 0.1]), 1e-3
    lens = [(first, 0.6)]

    def index(x, y):
        return ca.sqrt(1 + sum(s * ca.exp(-((x - c[0]) ** 2 + (y - c[1]) ** 2) / width**2) for c, s in lens))

    heading = np.array([np.cos(a := np.arctan2(0.1, 0.5) + 0.9e-3), np.sin(a)])
    through_one = optics.Scene(optics.Graded(index)).trace((0, 0), heading, optical_path=1.1)
    # the second stands where a ray through the first goes, a little beside it
    lens.append((through_one.points[0] + 4e-4, 0.3))
    scene = optics.Scene(optics.Graded(index))
    (end,) = scene.trace((0, 0), heading, optical_path=1.8).points
    rays = scene.rays((0, 0), end, within=1.9)
    assert any(np.abs(ray.tangents[0] - heading).max() < 1e-8 for ray in rays)


def test_rays_along_a_narrow_ring_are_not_said_to_be_all():
    def ring(r):
        return ca.sqrt(1 + 0.1 * ca.exp(-(((r - 0.4) / 1e-2) ** 2)))

    ends = (-1.0, -0.17), (0.5, -0.14)
    exact = optics.Scene(optics.Radial(ring)).rays(*ends, within=2.0)
    given = optics.Scene(optics.Graded(lambda x, y: ring(ca.sqrt(x**2 + y**2))))
    told = given.rays(*ends, within=2.0)  # the centre is read
    assert [ray.optical_path for ray in told] == pytest.approx([ray.optical_path for ray in exact], rel=1e-12)
    rays = given.rays(*ends, within=2.0, model=optics.Hamilton())  # which knows of none
    assert rays.unresolved > 0
    assert "rays along what is narrow" in rays.searched
    wide = [ray.optical_path for ray in exact if ray.spreading < 100]
    assert wide
    assert all(any(abs(path - ray.optical_path) < 1e-9 for ray in rays) for path in wide)


def test_no_ray_is_lost_where_the_index_rises_at_once():
    width = 1e-2
    across = np.array([1.0, 0.7]) / np.hypot(1.0, 0.7)

    def index(x, y):
        return ca.sqrt(1 + 0.1 * ca.tanh((across[0] * x + across[1] * y - 0.16) / width))

    a, b = np.array([-0.9, 0.13]), np.array([0.95, -0.21])
    (ray,) = optics.Scene(optics.Graded(index)).rays(a, b)
    # by Snell's law what goes along the rise is kept: 0.9 before it and 1.1 behind
    along = np.array([-across[1], across[0]])
    slow, fast = np.sqrt(0.9) * ray.tangents[0] @ along, np.sqrt(1.1) * ray.tangents[1] @ along
    assert abs(slow - fast) < 1e-10
    # and the optical path differs from that through a jump by less than the rise is wide
    rise = [(0.16 - a @ across), (b @ across - 0.16)]
    places = np.linspace(-1, 1, 200_001)
    first, last = places - a @ along, b @ along - places
    jump = np.min(np.sqrt(0.9) * np.hypot(rise[0], first) + np.sqrt(1.1) * np.hypot(rise[1], last))
    assert abs(ray.optical_path - jump) < width


def test_an_index_interpolated_in_two_coordinates_is_carried_as_its_formula_is():
    # cubic splines hold 1 + y/10 exactly: rays are catenaries c cosh((x - b)/c) of the height 10 + y
    knots = np.linspace(-1, 2, 5)
    table = ca.interpolant("n", "bspline", [knots, knots], np.tile(1 + 0.1 * knots[:, None], 5).ravel())

    def foot(c):
        return c * np.arccosh(10 / c)

    c = brentq(lambda c: c * np.arccosh(11 / c) - foot(c) - 1, 1.0, 10 * (1 - 1e-12))
    left, right = foot(c) / c, np.arccosh(11 / c)
    path = 0.1 * c**2 * ((right - left) / 2 + (np.sinh(2 * right) - np.sinh(2 * left)) / 4)
    rays = optics.Scene(optics.Graded(lambda x, y: table(ca.vertcat(x, y)))).rays((0, 0), (1, 1), within=2.0)
    askew = optics.Scene(optics.Graded(lambda x, y: table(ca.vertcat(x - y, y)))).rays((0, 0), (1, 1), within=2.0)
    for found in (rays, askew):
        assert [ray.optical_path for ray in found] == pytest.approx([path], rel=1e-12)
        assert found.unresolved == 0


def test_where_the_search_was_given_up_in_parts_no_shadow_is_claimed():
    searched = "all directions of the plane"
    assert no_rays(SHADOW, searched).reason.startswith("shadow: no ray of the source comes to B")
    doubtful = no_rays(SHADOW, searched, unresolved=8)
    assert "8 narrow parts of the search had to be given up, and one may come to B" in doubtful.reason
    assert "shadow" not in doubtful.reason
    assert doubtful.unresolved == 8


@pytest.mark.parametrize("narrow", [10, 200])
def test_caustics_of_a_lens_in_an_all_but_uniform_medium_are_counted(narrow):
    """Steps from where nothing is seen of it lead over it: past both conjugate points, or into the second focus.

    Of three rays between two points two are least paths and one, through the lens, is a largest one (Morse).
    """
    scene = optics.Scene(optics.Graded(lambda x, y: 1 + 0.6 * ca.exp(-narrow * (x**2 + y**2))))
    rays = scene.rays((-1.0, 0.1), (2.4, 0.1), within=8.0)
    assert [ray.index for ray in rays] == [0, 0, 1]


@pytest.mark.parametrize("mirror", [True, False])
def test_rays_that_part_at_the_crests_of_a_wavy_surface(mirror):
    """Stationary paths by points (x, g(x)) both ends see; a ray before a crest and the next behind it both come in."""
    rng = np.random.default_rng(1662)
    scenes = [(0.377282571, 3.829437387, 5.400756868, 1.839710932, (-0.09986751, 1.24751824), (0.58328456, 1.30138835))]
    for _ in range(4):
        height, wave, phase, index = rng.uniform((0.02, 1, 0, 1.1), (0.6, 6, 6, 1.9))
        scenes.append((height, wave, phase, index, rng.uniform((-1, 0.7), (0, 2)), rng.uniform((0, 0.7), (1, 2))))
    for height, wave, phase, glass, A, above in scenes:
        B, index = (above, 1.0) if mirror else ((above[0], -above[1]), glass)

        def level(x, height=height, wave=wave, phase=phase):
            return height * np.sin(wave * x + phase)

        def slope(x, height=height, wave=wave, phase=phase, A=A, B=B, index=index):
            y, rise = level(x, height, wave, phase), height * wave * np.cos(wave * x + phase)
            ends = [(x - p[0] + (y - p[1]) * rise) / np.hypot(x - p[0], y - p[1]) for p in (A, B)]
            return ends[0] + index * ends[1]

        def clear(x, end, sign, level=level):
            share = np.linspace(1e-6, 1, 4001)
            way = np.outer(1 - share, (x, level(x))) + np.outer(share, end)
            return np.all(sign * (way[:, 1] - level(way[:, 0])) > 0)

        grid = np.linspace(-8, 8, 40001)
        at = np.flatnonzero(np.diff(np.sign(slope(grid))))
        found = [brentq(slope, grid[k], grid[k + 1], xtol=1e-15) for k in at]
        seen = [x for x in found if clear(x, A, 1) and clear(x, B, 1 if mirror else -1)]
        exact = [np.hypot(x - A[0], level(x) - A[1]) + index * np.hypot(x - B[0], level(x) - B[1]) for x in seen]
        surface = optics.Implicit(
            lambda x, y, height=height, wave=wave, phase=phase: y - height * np.sin(wave * x + phase), mirror=mirror
        )
        rays = optics.Scene([optics.Uniform(1.0), optics.Uniform(index)], [surface]).rays(A, B, within=9.0)
        exact = np.sort([path for path in exact if path < 9])
        np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("medium", "target", "said"),
    [
        (optics.Stratified(lambda y: ca.sqrt(1 - y)), (1, 2), "B = (1, 2) is dark: n² is -1 there"),
        (optics.Tabulated([-1, 0], [1.2, 1.3]), (1, 0.5), "B = (1, 0.5) is dark: the index is no number there"),
        (optics.Graded(lambda x, y: 1 - x**2 - y**2), (2, 0), "B = (2, 0) is dark: the index is -3 there"),
    ],
)
def test_a_dark_target_is_named_and_has_no_ray(medium, target, said):
    rays = optics.Scene(medium).rays((0, -0.3), target)
    assert len(rays) == rays.unresolved == 0
    assert said in str(rays)
    assert "searched: nothing" not in str(rays)


@pytest.mark.parametrize(
    ("medium", "target"),
    # upright rays come to rest where n² = 1 - y vanishes; cycloids end in cusps where 1/y is infinite
    [
        (optics.Stratified(lambda y: ca.sqrt(1 - y)), (0, 1)),
        (optics.Stratified(lambda y: 1 / ca.sqrt(y)), (0.5, 0)),
    ],
)
def test_no_claim_is_made_of_rays_that_end_where_the_index_is_nothing_or_infinite(medium, target):
    rays = optics.Scene(medium).rays((0, 0.3), target)
    assert len(rays) == 0
    assert rays.unresolved == 1
    assert "none such is looked for" in rays.reason


@pytest.mark.parametrize(
    ("index", "within", "most"),
    [
        (lambda x, y: 1.5 + 0.2 * ca.floor(ca.sin(1 / x)), 4.0, 64),
        (lambda x, y: 1.5 + 0.2 * ca.sign(ca.sin(1 / (x * y))), 1.2, 64),
        (lambda x, y: 1.5 + 0.1 * ca.tanh(ca.floor(1 / x)), 4.0, MOST_SEARCHED),
    ],
)
def test_infinitely_many_jumps_between_two_points_are_given_up_and_counted(index, within, most, monkeypatch):
    """Of infinitely many a quarter of those that are allowed are as many as all."""
    for module in (fan, watch):
        monkeypatch.setattr(module, "MOST_SEARCHED", most)
    told = []
    rays = optics.Scene(optics.Graded(index)).rays(
        (-1.7, -0.46), (1.2, 2.2), within=within, progress=lambda _done, _total, what: told.append(what)
    )
    assert len(rays) == 0
    assert rays.unresolved > 0
    assert f"rays through no more than {most} pieces of the index each" in rays.searched
    assert not any(f"in piece {most + 44} of the index" in what for what in told)


def test_rays_that_meet_few_of_infinitely_many_jumps_are_found_beside_them():
    """On the side of x < 0 nothing jumps before x = -1/π: there rays are straight lines."""
    scene = optics.Scene(optics.Graded(lambda x, y: 1.5 + 0.2 * ca.sign(ca.sin(1 / x))))
    rays = scene.rays((-2.0, 0.0), (-1.0, 0.5), within=6.0)
    assert rays.unresolved > 0
    assert rays[0].optical_path == pytest.approx(1.3 * np.hypot(1.0, 0.5), rel=1e-14)
