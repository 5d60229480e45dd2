"""Invariants and quadrature, against closed forms evaluated here."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import optics

MODEL = optics.Invariants()


def test_the_horizontal_refraction_of_an_exponential_atmosphere():
    """37.726190 arc minutes; the integrand -n'/n tan φ is made regular by r = R + u²."""
    N, H, R = mp.mpf("2.8e-4"), mp.mpf(8000), mp.mpf(6371000)
    with mp.workdps(30):

        def bending(u):
            h = u**2
            n = 1 + N * mp.exp(-h / H)
            root = mp.sqrt((n * (R + h)) ** 2 - ((1 + N) * R) ** 2)
            return N / H * mp.exp(-h / H) / n * (1 + N) * R / root * 2 * u

        exact = mp.quad(bending, [0, 20, 100, 300, 1000], method="gauss-legendre")
    assert round(float(exact * 180 * 60 / mp.pi), 6) == 37.726190
    scene = optics.Scene(optics.exponential_atmosphere(earth_radius=6371e3))
    out = scene.trace((0, 6371e3), (1, 0), until=optics.Sphere((0, 0), 6371e3 + 6e5), model=MODEL)
    angle = -np.arctan2(out.directions[0, 1], out.directions[0, 0])
    assert angle == pytest.approx(float(exact), rel=1e-12)


def test_semicircles_where_the_index_is_inverse_to_the_height():
    scene = optics.Scene(optics.Stratified(lambda y: 2.0 / y))
    [ray] = scene.rays((0.1, 0.7), (1.4, 0.4), model=MODEL)
    d2 = 1.3**2 + 0.3**2
    assert ray.optical_path == pytest.approx(2 * np.arccosh(1 + d2 / (2 * 0.7 * 0.4)), rel=1e-13)
    centre = (1.4**2 + 0.4**2 - 0.1**2 - 0.7**2) / (2 * 1.3)
    radii = np.hypot(*(ray.point(np.linspace(0, ray.optical_path, 9)) - [centre, 0]).T)
    np.testing.assert_allclose(radii, np.hypot(0.1 - centre, 0.7), rtol=1e-13)


def test_the_exponential_index_reaches_its_top_at_the_angle_over_beta():
    beta, start = 0.4, 0.6
    scene = optics.Scene(optics.Stratified(lambda y: 1.3 * ca.exp(-beta * y)))
    wall = optics.Plane((start / beta, 0), (1, 0))
    top = scene.trace((0, 0), (np.cos(start), np.sin(start)), until=wall, model=MODEL)
    np.testing.assert_allclose(top.directions, [[1, 0]], atol=1e-13)
    np.testing.assert_allclose(top.points[0, 1], -np.log(np.cos(start)) / beta, rtol=1e-12)


def test_the_linear_index_bends_rays_into_catenaries():
    """n = n0 (1 - β y): with C = cos φ0, 1 - β y = C cosh(β x/C - arcosh(1/C))."""
    beta, start, x = 0.3, 0.5, 2.2
    scene = optics.Scene(optics.Stratified(lambda y: 1.4 * (1 - beta * y)))
    end = scene.trace((0, 0), (np.cos(start), np.sin(start)), until=optics.Plane((x, 0), (1, 0)), model=MODEL)
    c = np.cos(start)
    exact = (1 - c * np.cosh(beta * x / c - np.arccosh(1 / c))) / beta
    assert end.points[0, 1] == pytest.approx(exact, rel=1e-12)


def test_ellipses_and_bouguers_invariant():
    """n² = 2 - r²: r = r0 cos σ + p0 sin σ, ellipses about the centre."""
    r0, turn = np.array([0.3, 0.2]), 1.1
    p0 = np.sqrt(2 - r0 @ r0) * np.array([np.cos(turn), np.sin(turn)])
    sigma = 5.0
    path = 2 * sigma - (
        (r0 @ r0) * (sigma / 2 + np.sin(2 * sigma) / 4)
        + (p0 @ p0) * (sigma / 2 - np.sin(2 * sigma) / 4)
        + (r0 @ p0) * np.sin(sigma) ** 2
    )
    end = optics.Scene(optics.luneburg()).trace(r0, p0, optical_path=path, model=MODEL)
    np.testing.assert_allclose(end.points[0], r0 * np.cos(sigma) + p0 * np.sin(sigma), rtol=1e-12)
    p = end.directions[0] * np.sqrt(2 - np.sum(end.points[0] ** 2))
    kept = [r[0] * q[1] - r[1] * q[0] for r, q in ((r0, p0), (end.points[0], p))]
    assert kept[1] == pytest.approx(kept[0], rel=1e-13)


def test_direction_cosines_along_layers_in_space_after_thousands_of_turns():
    duct = optics.Scene(optics.Stratified(lambda y: 1.5 * ca.sqrt(1 - 0.3 * y**2)))
    start, heading = np.array([0.1, 0.2, 0.3]), np.array([0.8, 0.3, 0.4])
    heading /= np.linalg.norm(heading)
    n0 = 1.5 * np.sqrt(1 - 0.3 * 0.09)
    end = duct.trace(start, heading, optical_path=1e5, model=MODEL)
    n1 = 1.5 * np.sqrt(1 - 0.3 * end.points[0, 2] ** 2)
    np.testing.assert_allclose(n1 * end.directions[0, :2], n0 * heading[:2], rtol=1e-13)
    # the height is harmonic in σ, and so is where the path is known
    w = 1.5 * np.sqrt(0.3)
    sigma = (end.points[0, 0] - start[0]) / (n0 * heading[0])
    height = 0.3 * np.cos(w * sigma) + n0 * heading[2] / w * np.sin(w * sigma)
    assert end.points[0, 2] == pytest.approx(height, abs=1e-9)  # after 1e5 units, 1e-14 of each


def test_a_ray_through_the_centre():
    scene = optics.Scene(optics.fish_eye())
    through = scene.trace((0.5, 0.0), (-1, 0), optical_path=2.0, model=MODEL, with_spreading=True)
    far = np.tan(1.0 - np.arctan(0.5))
    np.testing.assert_allclose(through.points, [[-far, 0]], atol=1e-13)
    np.testing.assert_allclose(through.spreading, np.sin(2.0) * (1 + far**2) / 2, rtol=1e-12)


def test_a_catenary_has_two_rays_one_or_none():
    """Case 25: n = y, ends at height 1: rays as soap films, down to the ratio 0.6627434193."""
    scene = optics.Scene(optics.Stratified(lambda y: y))
    rays = scene.rays((-0.5, 1.0), (0.5, 1.0), model=MODEL)
    value = [0.953624106702003, 1.08951989470823]
    np.testing.assert_allclose([ray.optical_path for ray in rays], value, rtol=1e-12)
    assert [ray.index for ray in rays] == [0, 1]
    np.testing.assert_allclose(rays[1].conjugate_points[0, 0], 0.152911438598456, rtol=1e-10)
    folded = 0.662743419349182
    assert len(scene.rays((-folded + 1e-7, 1.0), (folded - 1e-7, 1.0), model=MODEL)) == 2
    assert len(scene.rays((-folded - 1e-6, 1.0), (folded + 1e-6, 1.0), model=MODEL)) == 0


def test_the_range_where_the_squared_index_is_linear():
    """Case 26."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    first, second = scene.rays((0, 0), (0.5, 0), model=MODEL)
    assert first.optical_path == pytest.approx(0.494521305498037, rel=1e-14)
    assert second.optical_path == pytest.approx(0.730223565893552, rel=1e-14)
    [last] = scene.rays((0, 0), (1, 0), model=MODEL)
    assert last.degenerate
    assert last.optical_path == pytest.approx(0.942809041582063, rel=1e-13)
    assert "shadow" in scene.rays((0, 0), (1 + 1e-9, 0), model=MODEL).reason


def test_the_time_where_the_speed_is_linear():
    """Case 27."""
    [ray] = optics.Scene(optics.Stratified(lambda z: 1 / (1 + z))).rays((0, 0), (1, 0), model=MODEL)
    assert ray.optical_path == pytest.approx(np.arccosh(1.5), rel=1e-13)
    half = ray.point(ray.optical_path / 2)
    assert half[1] == pytest.approx(0.118033988749895, rel=1e-12)


def test_total_reflection_at_its_angle():
    """Case 28, in layers."""
    glass = optics.Stratified(lambda y: 1.5 + 0 * y)
    scene = optics.Scene([glass, optics.Uniform(1.0)], [optics.Plane((0, 0), (0, 1))])
    critical = np.arcsin(1 / 1.5)
    angles = critical + np.array([-1e-9, 1e-9])
    out = scene.trace((0, -1), np.column_stack([np.sin(angles), np.cos(angles)]), optical_path=5.0, model=MODEL)
    assert list(out.status) == [optics.RayStatus.ARRIVED, optics.RayStatus.TOTAL_REFLECTION]


def test_the_antipode_of_a_fish_eye_and_the_rim_of_a_luneburg_lens():
    """Case 29."""
    rays = optics.Scene(optics.fish_eye()).rays((1, 0), (-1, 0), model=MODEL)
    assert rays.continuum
    assert rays[0].optical_path == pytest.approx(np.pi, rel=1e-13)
    rim = optics.Scene(optics.luneburg()).trace((-1, 0), (1, 0), optical_path=1 + np.pi / 2, model=MODEL)
    np.testing.assert_allclose(rim.points, [[1, 0]], atol=1e-13)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("start", [0.0, 1e-200, 1e-30, 0.2, -0.2])
def test_rays_through_or_from_a_centre_go_straight_on(start: float, d: int) -> None:
    """n = sqrt(2 - r²) is even, so that x from the centre has the optical path (x n + 2 arcsin(x / sqrt 2)) / 2."""
    scene = optics.Scene(optics.luneburg())
    x, way = np.zeros(d), np.eye(d)[0]
    x[0] = start

    def path(x: float) -> float:
        return (x * np.sqrt(2 - x**2) + 2 * np.arcsin(x / np.sqrt(2))) / 2

    for end in (-0.1, 0.0, 0.5):
        if end > start:
            out = scene.trace(x, way, optical_path=path(end) - path(start), with_spreading=True, model=MODEL)
            assert out.arrived.all()
            np.testing.assert_allclose(out.points, [end * way], atol=1e-13)
            np.testing.assert_allclose(out.directions, [way], atol=1e-13)


@pytest.mark.parametrize("start", [1e-30, 1e-12, 1e-6])
def test_rays_that_start_next_to_a_centre_keep_their_digits(start: float) -> None:
    scene = optics.Scene(optics.luneburg())
    ways = np.array([[0.6, 0.8], [0.0, -1.0], [1.0, 0.0]])
    ours = scene.trace((start, 0), ways, optical_path=0.5, with_spreading=True, model=MODEL)
    theirs = scene.trace((start, 0), ways, optical_path=0.5, with_spreading=True, model=optics.Hamilton())
    assert ours.arrived.all()
    np.testing.assert_allclose(ours.points, theirs.points, atol=1e-12)
    np.testing.assert_allclose(ours.spreading, theirs.spreading, rtol=1e-10)


def test_a_bundle_of_which_some_rays_start_from_the_centre() -> None:
    medium = optics.Radial(lambda r: ca.sqrt(2 - r**2), center=(0.3, -0.2))
    points = np.array([[0.3, -0.2], [0.7, 0.1], [0.3, -0.1], [0.3 + 1e-20, -0.2]])
    ways = np.array([[1.0, 0], [0.6, 0.8], [0, -1.0], [0.8, -0.6]])
    scene = optics.Scene(medium)
    ours = scene.trace(points, ways, optical_path=0.7, with_spreading=True, model=MODEL)
    theirs = scene.trace(points, ways, optical_path=0.7, with_spreading=True, model=optics.Hamilton())
    np.testing.assert_allclose(ours.points, theirs.points, atol=1e-12)
    np.testing.assert_allclose(ours.directions, theirs.directions, atol=1e-12)
    np.testing.assert_allclose(ours.spreading, theirs.spreading, rtol=1e-11)


@pytest.mark.parametrize("dark", [0.0, 0.3])
def test_a_ray_ends_where_the_index_vanishes_with_its_slope(dark: float) -> None:
    """Straight down in n = |y - dark| the optical path to y is ((1 - dark)² - (y - dark)²) / 2."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.fabs(y - dark)))
    whole = (1 - dark) ** 2 / 2
    short = scene.trace((0, 1), (0, -1), optical_path=0.9 * whole, model=MODEL)
    np.testing.assert_allclose(short.points, [[0, dark + (1 - dark) * np.sqrt(0.1)]], atol=1e-13)
    for path in (1.01 * whole, 4.0):
        assert scene.trace((0, 1), (0, -1), optical_path=path, model=MODEL).status == [optics.RayStatus.SINGULAR]
    up = scene.trace((0, 1), (0, 1), optical_path=4.0, model=MODEL)
    np.testing.assert_allclose(up.points, [[0, dark + np.sqrt((1 - dark) ** 2 + 8)]], atol=1e-13)
