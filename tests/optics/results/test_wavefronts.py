"""Wavefronts, caustics and intensities, against closed forms evaluated here."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus

PARABOLIC = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1.2**2 - 2 * 0.7 * y)))
N0, G = 1.2, 0.7


def derivative_round_a_circle(values):
    """The derivative of samples (m, d) at m even places of a circle, by Fourier's series."""
    m = len(values)
    waves = np.fft.fftfreq(m, 1 / m)[:, None] * (np.abs(np.fft.fftfreq(m, 1 / m)) < m / 2)[:, None]
    return np.fft.ifft(1j * waves * np.fft.fft(values, axis=0), axis=0).real


def unit(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def gradient(function, point):
    with mp.workdps(40):
        place = tuple(map(mp.mpf, point))
        return np.array([float(mp.diff(function, place, axis)) for axis in ((1, 0), (0, 1))])


class TestWavefronts:
    def test_rays_are_perpendicular_to_wavefronts_and_the_eikonal_grows_with_the_index(self):
        """In the fish-eye S(A, B) = n0 a asin(a |A - B| / sqrt((a² + A²)(a² + B²)))."""
        n0, a, source = 2.0, 1.1, (0.4, -0.3)

        def eikonal(x, y):
            squares = (a**2 + source[0] ** 2 + source[1] ** 2) * (a**2 + x**2 + y**2)
            return n0 * a * mp.asin(a * mp.hypot(x - source[0], y - source[1]) / mp.sqrt(squares))

        front = optics.wavefront(optics.Scene(optics.fish_eye(n0, a)), optics.PointSource(source), 64, 0.7)
        assert front.arrived.all()
        along = derivative_round_a_circle(front.points)
        assert np.max(np.abs(np.sum(along * front.normals, axis=1))) < 1e-12
        for point, normal in zip(front.points[::16], front.normals[::16], strict=True):
            assert float(eikonal(*point)) == pytest.approx(0.7, rel=1e-12)
            index = n0 / (1 + point @ point / a**2)
            np.testing.assert_allclose(gradient(eikonal, point), index * normal, rtol=1e-11, atol=1e-12)

    @pytest.mark.parametrize("path", [0.3, 1.1])
    def test_wavefronts_in_space_where_the_squared_index_is_linear(self, path):
        """The optical path is that of OPTICS's closed form at every point, and |∇S| = n."""
        medium = optics.Stratified(lambda z: ca.sqrt(N0**2 - 2 * G * z))
        front = optics.wavefront(optics.Scene(medium), optics.PointSource((0, 0, 0)), 50, path)
        for point, normal in zip(front.points, front.normals, strict=True):
            reached, momentum = min((_arrival(point, sign) for sign in (-1, 1)), key=lambda both: abs(both[0] - path))
            assert reached == pytest.approx(path, rel=1e-12)
            np.testing.assert_allclose(normal * np.sqrt(N0**2 - 2 * G * point[2]), momentum, rtol=1e-11, atol=1e-12)

    def test_wavefronts_behind_an_interface_stand_across_the_rays(self):
        scene = optics.Scene([optics.Uniform(1.5), optics.Uniform(1.0)], [optics.Sphere((0, 0), 1.0)])
        front = optics.wavefront(scene, optics.PointSource((0.2, 0.1)), 128, 2.5)
        assert front.arrived.all()
        assert np.min(np.linalg.norm(front.points, axis=1)) > 1
        along = derivative_round_a_circle(front.points)
        assert np.max(np.abs(np.sum(along * front.normals, axis=1))) < 1e-11

    def test_a_plane_wave_is_focused_by_a_luneburg_lens_at_the_right_optical_path(self):
        heights = np.array([-0.9, -0.3, 0.4, 0.8])
        scene = optics.Scene([optics.Uniform(1.0), optics.luneburg()], [optics.Sphere((0, 0), 1.0)])
        wave = optics.PlaneWave((-1.5, 0), (1, 0))
        front = optics.wavefront(scene, wave, heights, 1.5 + np.pi / 2)
        np.testing.assert_allclose(front.points, np.tile([1.0, 0.0], (4, 1)), atol=1e-12)

    def test_rays_that_do_not_come_so_far_are_marked(self):
        scene = optics.Scene([optics.Uniform(1.5), optics.Uniform(1.0)], [optics.Plane((0, 0), (0, 1))])
        front = optics.wavefront(scene, optics.PointSource((0, 1)), [(0, -1), (1, -0.5)], 5.0)
        assert front.status.tolist() == [RayStatus.ARRIVED, RayStatus.TOTAL_REFLECTION]


def _arrival(point, sign):
    """The optical path to ``point`` from the origin in n² = n0² - 2 g z and the momentum there, by one of two rays."""
    with mp.workdps(30):
        mean, distance, height = mp.mpf(N0) ** 2 - G * mp.mpf(point[2]), mp.norm(mp.matrix(point)), mp.mpf(point[2])
        sigma = mp.sqrt(2 * (mean + sign * mp.sqrt(mean**2 - (G * distance) ** 2))) / G
        climb = height / sigma + G * sigma / 2
        path = N0**2 * sigma - G * climb * sigma**2 + G**2 * sigma**3 / 3
        return float(path), np.array([point[0] / sigma, point[1] / sigma, climb - G * sigma], dtype=float)


class TestCaustics:
    def test_squared_index_linear_in_height(self):
        angles = np.linspace(0.15, np.pi - 0.15, 12)
        found = optics.caustic(PARABOLIC, optics.PointSource((0, 0)), unit(angles), 300.0)
        x, y = found.points.T
        np.testing.assert_array_equal(found.ray, np.arange(12))
        np.testing.assert_allclose(y, N0**2 / (2 * G) - G * x**2 / (2 * N0**2), rtol=1e-10, atol=1e-10)
        sigma = N0 / (G * np.sin(angles))
        np.testing.assert_allclose(x, N0 * np.cos(angles) * sigma, rtol=1e-10, atol=1e-10)
        path = N0**2 * sigma - N0 * G * np.sin(angles) * sigma**2 + G**2 * sigma**3 / 3
        np.testing.assert_allclose(found.optical_path, path, rtol=1e-10)

    def test_a_point_inside_luneburgs_medium(self):
        """The first conjugate point at tan(sigma) = |p0|²/(r0.p0), outside the lens; the second at -r0."""
        start = np.array([0.5, 0.2])
        directions = unit(np.array([0.3, 1.2, 2.5]))
        found = optics.caustic(optics.Scene(optics.luneburg()), optics.PointSource(start), directions, 5.0)
        first, second = (found.points[found.order == order] for order in (1, 2))
        momenta = np.sqrt(2 - start @ start) * directions
        sigma = np.mod(np.arctan2(np.sum(momenta**2, axis=1), momenta @ start), np.pi)[:, None]
        np.testing.assert_allclose(first, start * np.cos(sigma) + momenta * np.sin(sigma), atol=1e-10)
        np.testing.assert_allclose(second, np.tile(-start, (3, 1)), atol=1e-10)

    def test_sagittal_and_tangential_foci_of_a_rod(self):
        """psi = a z/cos(theta): the sagittal focus at pi, the tangential one where tan(psi) = -psi tan²(theta)."""
        gradient_of_index, theta = 0.4, 0.3
        rod = optics.Scene(optics.selfoc(1.5, gradient_of_index))
        heading = (np.sin(theta) * 0.6, np.sin(theta) * 0.8, np.cos(theta))
        found = optics.caustic(rod, optics.PointSource((0, 0, 0)), [heading], 14.0)
        tangential = mp.findroot(lambda psi: mp.tan(psi) + psi * mp.tan(theta) ** 2, 2.9)
        foci = np.array([float(tangential), np.pi]) * np.cos(theta) / gradient_of_index
        np.testing.assert_allclose(found.points[:2, 2], foci, rtol=1e-10)

    def test_every_point_of_a_fish_eye_has_a_perfect_image(self):
        """Both conjugate points of a ray in space are the one point -a² A/|A|², after pi n0 a/2."""
        source = np.array([0.6, 0.3, -0.2])
        scene = optics.Scene(optics.fish_eye(2.0, 1.1))
        found = optics.caustic(scene, optics.PointSource(source), [(0, 1, 0), (-1, 0.2, 0.4)], 4.5)
        image = -(1.1**2) * source / (source @ source)
        np.testing.assert_array_equal(found.order, [1, 2, 1, 2])
        np.testing.assert_allclose(found.points, np.tile(image, (4, 1)), atol=1e-9)
        np.testing.assert_allclose(found.optical_path, np.pi * 1.1, rtol=1e-10)

    def test_the_caustic_of_a_mirror(self):
        """Parallel light in a circular mirror: a nephroid, x = (3 cos t - cos 3t)/4, y = (3 sin t - sin 3t)/4."""
        scene = optics.Scene(optics.Uniform(1.0), optics.Conic((1, 0), (-1, 0), 1.0, mirror=True))
        angle = np.linspace(-0.7, 0.7, 10)  # the ray meets the circle at (cos, sin)
        found = optics.caustic(scene, optics.PlaneWave((-2, 0), (1, 0)), np.sin(angle), 3.6)
        nephroid = 3 * unit(angle) - unit(3 * angle)
        np.testing.assert_allclose(found.points, nephroid / 4, atol=1e-12)

    def test_no_caustic_where_the_index_is_uniform_or_falls_to_a_boundary(self):
        fan = unit(np.linspace(0.1, 3.0, 7))
        for medium in (optics.Uniform(1.3), optics.Stratified(lambda y: 1 / y)):
            found = optics.caustic(optics.Scene(medium), optics.PointSource((0, 1)), fan, 3.0)
            assert len(found) == 0
            assert found.points.shape == (0, 2)
            assert np.all(found.status == RayStatus.ARRIVED)

    def test_a_table_has_the_caustic_of_the_profile_it_was_made_from(self):
        """n² = 1 - 2 y in a table, which rays may leave: those that do have touched nothing."""
        heights = np.linspace(-6, 0.45, 20)
        table = optics.Scene(optics.Tabulated(heights, np.sqrt(1 - 2 * heights)))
        found = optics.caustic(table, optics.PointSource((0, 0)), unit(np.radians([40, 60, 85, 120])), 3.0)
        assert found.ray.tolist() == [0, 1, 3]
        assert found.status[2] == RayStatus.OUTSIDE
        np.testing.assert_allclose(found.points[:, 1], (1 - found.points[:, 0] ** 2) / 2, atol=1e-12)

    def test_both_sheets_behind_a_ball_of_glass(self):
        """Rotational symmetry puts one of a ray's conjugate points on the axis; the other lies in its plane."""
        ball = [optics.Uniform(1.0), optics.Uniform(1.5), optics.Uniform(1.0)]
        scene = optics.Scene(ball, [optics.Sphere((0, 0, 0), 1.0)] * 2)
        wave = optics.PlaneWave((0, 0, -2), (0, 0, 1))
        offsets = np.array([(0.0, 0.0), (0.1, 0.0), (0.18, 0.24)])
        found = optics.caustic(scene, wave, offsets, 6.0)
        assert found.order.tolist() == [1, 2] * 3
        np.testing.assert_allclose(found.points[:2], [[0, 0, 1.5]] * 2, atol=1e-12)  # n R/(2 (n - 1))
        height = np.linalg.norm(offsets[1:], axis=1)
        turned = 2 * (np.arcsin(height) - np.arcsin(height / 1.5))
        np.testing.assert_allclose(found.points[3::2, :2], 0, atol=1e-12)
        np.testing.assert_allclose(found.points[3::2, 2], height / np.sin(turned), rtol=1e-12)
        starts = offsets[1:] @ wave.axes
        outward = np.sum(np.cross(starts, found.points[2::2]) * (0, 0, 1), axis=1)
        np.testing.assert_allclose(outward, 0, atol=1e-12)

    def test_rays_into_a_singular_centre_are_marked(self):
        scene, source = optics.Scene(optics.eaton()), optics.PointSource((0.5, 0))
        assert optics.caustic(scene, source, [(-1, 0), (0, 1)], 2.0).status.tolist() == [RayStatus.SINGULAR, 0]
        with pytest.raises(ValueError, match="could not be followed anywhere"):
            optics.ray_tube(scene, source, (-1, 0), 2.0).point(0.0)


class TestRainbow:
    """A sphere of n = 4/3 in which light is reflected once: the rays that leave it have a caustic, which goes to
    infinity at the deviation 137.9703411 degrees."""

    INDEX = 4 / 3
    DROP = optics.Sphere((0, 0), 1.0)
    SCENE = optics.Scene(
        [optics.Uniform(1.0), optics.Uniform(INDEX), optics.Uniform(1.0)],
        [DROP, optics.Sphere((0, 0), 1.0, mirror=True), DROP],
    )
    WAVE = optics.PlaneWave((-2.0, 0.0), (1.0, 0.0))

    def deviation(self, height):
        return mp.pi + 2 * mp.asin(height) - 4 * mp.asin(height / self.INDEX)

    def test_least_deviation(self):
        least = np.sqrt((4 - self.INDEX**2) / 3)  # sin i, from cos² i = (n² - 1)/3
        degrees = 137.9703411
        assert float(mp.degrees(self.deviation(least))) == pytest.approx(degrees, abs=5e-8)
        tube = optics.ray_tube(self.SCENE, self.WAVE, least, 50.0)
        ahead = tube.direction(40.0)
        assert np.degrees(np.arccos(ahead[0])) == pytest.approx(degrees, abs=5e-8)
        beam = tube.at(40.0)  # parallel to its neighbours: the caustic is infinitely far
        turning = beam.momentum[0, 0] * beam.turned[0, 0, 1] - beam.momentum[0, 1] * beam.turned[0, 0, 0]
        assert abs(turning) < 1e-14

    def test_the_caustic_outside(self):
        """Straight rays r + s t at the angle D(h) touch their envelope at s = -(dr/dh . t')/D', t' across t."""
        heights = np.array([0.88, 0.9, 0.93])  # beyond the rainbow's ray, where rays come together
        found = optics.caustic(self.SCENE, self.WAVE, heights, 60.0)
        outside = np.linalg.norm(found.points, axis=1) > 1
        for k, h in zip(found.ray[outside], found.points[outside], strict=True):
            with mp.workdps(40):
                np.testing.assert_allclose(h, self.envelope(mp.mpf(heights[k])), rtol=1e-10)
        assert sorted(found.ray[outside]) == [0, 1, 2]

    def envelope(self, height):
        def turned(h):
            return -self.deviation(h)  # light above the axis is turned clockwise

        def left(h):  # where the ray leaves: at the angle of incidence to its direction
            angle = turned(h) + mp.asin(h)
            return mp.matrix([mp.cos(angle), mp.sin(angle)])

        moved = mp.matrix([mp.diff(lambda h, i=i: left(h)[i], height) for i in (0, 1)])
        heading = turned(height)
        ahead = mp.matrix([mp.cos(heading), mp.sin(heading)])
        across = mp.matrix([-mp.sin(heading), mp.cos(heading)])
        far = -(moved.T * across)[0] / mp.diff(turned, height)
        return np.array([float(v) for v in left(height) + far * ahead])


class TestIntensity:
    def test_inverse_square_law_where_the_index_is_uniform(self):
        s = np.array([0.3, 1.0, 7.0])
        tube = optics.ray_tube(optics.Scene(optics.Uniform(1.5)), optics.PointSource((1, 2, 3)), (1, -1, 2), 7.0)
        np.testing.assert_allclose(tube.intensity(s).values, (1.5 / s) ** 2, rtol=1e-14)

    @pytest.mark.parametrize("space", [False, True])
    def test_fish_eye(self, space):
        n0, a = 2.0, 1.1
        start = (0.6, 0.3, -0.2)[: 3 if space else 2]
        heading = (-1.0, 0.2, 0.4)[: 3 if space else 2]
        tube = optics.ray_tube(optics.Scene(optics.fish_eye(n0, a)), optics.PointSource(start), heading, 4.5)
        s = np.array([0.2, 1.3, 3.2, 3.7, 4.4])
        index = n0 / (1 + np.sum(tube.point(s) ** 2, axis=1) / a**2)
        width = np.abs(n0 * a / 2 * np.sin(2 * s / (n0 * a)) / index)
        light = tube.intensity(s)
        np.testing.assert_allclose(light.values, width ** (-2.0 if space else -1.0), rtol=1e-11)
        assert light.caustics.tolist() == [0, 0, 0, 2, 2] if space else [0, 0, 0, 1, 1]
        assert not light.on_caustic.any()
        focus = tube.intensity(np.array([0.0, np.pi * n0 * a / 2]))
        assert focus.on_caustic.all()
        assert np.isinf(focus.values).all()
        assert focus.caustics.tolist() == [0, 0]

    def test_a_ray_between_two_points_has_it_too(self):
        _, second = PARABOLIC.rays((0, 0), (0.5, 0))
        light = second.tube.intensity(np.array([second.optical_path / 2, second.optical_path]))
        assert light.values[1] == pytest.approx(1 / second.spreading, rel=1e-10)
        assert light.caustics[1] == second.index == 1

    def test_a_plane_wave_in_a_lens_gains_by_what_its_cross_section_loses(self):
        """Luneburg's medium from the plane through its centre: x = p sin(sigma), y = h cos(sigma), p² = 2 - h²."""
        tube = optics.ray_tube(optics.Scene(optics.luneburg()), optics.PlaneWave((0, 0), (1, 0)), 0.3, 2.0)
        sigma = np.linspace(0.1, 1.2, 5)
        p2 = 2 - 0.3**2
        s = sigma + (p2 - 0.3**2) * np.sin(2 * sigma) / 4 + 0 * sigma
        point, momentum = _luneburg_plane(0.3, sigma)
        np.testing.assert_allclose(tube.point(s), point, atol=1e-13)
        moved = np.column_stack([-0.3 / np.sqrt(p2) * np.sin(sigma), np.cos(sigma)])
        cross = np.abs(moved[:, 0] * momentum[:, 1] - moved[:, 1] * momentum[:, 0]) / np.linalg.norm(momentum, axis=1)
        np.testing.assert_allclose(tube.intensity(s).values, 1 / cross, rtol=1e-12)


def _luneburg_plane(height, sigma):
    p = np.sqrt(2 - height**2)
    point = np.column_stack([p * np.sin(sigma), height * np.cos(sigma)])
    return point, np.column_stack([p * np.cos(sigma), -height * np.sin(sigma)])


def test_what_is_refused():
    scene = optics.Scene(optics.Uniform(1.0), optics.Plane((0, 0), (1, 0), mirror=True))
    with pytest.raises(ValueError, match="lies on surface 0"):
        optics.caustic(scene, optics.PointSource((0, 1)), 8, 2.0)
    with pytest.raises(ValueError, match="optical_path must be a positive number"):
        optics.caustic(scene, optics.PointSource((1, 1)), 8, -2.0)
    with pytest.raises(ValueError, match="named by their offsets, of shape"):
        optics.wavefront(scene, optics.PlaneWave((1, 0), (1, 0)), [(1, 2)], 1.0)
    with pytest.raises(ValueError, match="must have 2 coordinates"):
        optics.wavefront(scene, optics.PointSource((0, 0, 1)), 8, 1.0)
    with pytest.raises(ValueError, match="point has 2 coordinates and direction 3"):
        optics.PlaneWave((0, 0), (0, 0, 1))
    with pytest.raises(ValueError, match="rays must be at least 1"):
        optics.wavefront(scene, optics.PointSource((1, 1)), 0, 1.0)
