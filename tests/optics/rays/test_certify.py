"""The optical path of a ray is proved, and least near it up to the first conjugate point."""

from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc import optics
from varcalc.certificates.balls import working
from varcalc.certificates.integrals import Unproved
from varcalc.optics.rays.straight_path import BITS, TERMS, _Chain, _proof


def test_a_parabola_in_a_linear_squared_index():
    """In n^2 = 1 - 2 y the path of the flat ray is b s - s^3/6 with s^2 = 2 (b - sqrt(b^2 - d^2))."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    flat, steep = sorted(scene.rays((0, 0), (0.5, 0.125)), key=lambda ray: ray.index)
    certificate = flat.certify((0.5, 0.125))
    with mpmath.workdps(50):
        b, d = 1 - mpmath.mpf("0.125"), mpmath.hypot(mpmath.mpf("0.5"), mpmath.mpf("0.125"))
        s = mpmath.sqrt(2 * (b - mpmath.sqrt(b * b - d * d)))
        low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
        assert low <= b * s - s**3 / 6 <= high
    assert certificate.width < 1e-18
    with pytest.raises(vc.VariationalError, match="no certificate"):
        steep.certify((0.5, 0.125))


def holds(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high


@pytest.fixture(autouse=True)
def _sixty_digits():
    with mpmath.workdps(60):
        yield


@pytest.mark.parametrize("index", [1.1, 1.3])
def test_a_straight_ray_has_its_index_times_its_length(index):
    """Of the index as a double, and not of the root of its rounded square."""
    certificate = optics.Scene(optics.Uniform(index)).rays((0, 0), (3, 4))[0].certify((3, 4))
    assert holds(certificate, mpmath.mpf(index) * 5)
    assert certificate.width < 1e-26


def test_parameters_of_a_medium_are_not_rounded_together():
    """n = n0 sqrt(1 - a^2 y^2) along its axis is n0; along y = h the flat ray is none, so the axis it is."""
    certificate = optics.Scene(optics.selfoc(1.1, 0.3)).rays((0, 0), (0, 1))[0].certify((0, 1))
    assert holds(certificate, mpmath.mpf(1.1))


def refracted(heights, indices, across):
    """The path through horizontal layers of ``heights``: int n sec, by the sine that Snell's law keeps."""
    heights, indices = (list(map(mpmath.mpf, values)) for values in (heights, indices))

    def reach(k):
        return sum(h * k / mpmath.sqrt(n * n - k * k) for h, n in zip(heights, indices, strict=True)) - across

    # from a root by bisection, since it is monotone, on to Newton's
    k = mpmath.findroot(reach, (0, min(indices) * (1 - mpmath.mpf(10) ** -9)), solver="anderson", tol=1e-110)
    return sum(h * n * n / mpmath.sqrt(n * n - k * k) for h, n in zip(heights, indices, strict=True))


@pytest.mark.parametrize("indices", [(1.0, 1.33), (1.52, 1.0, 1.7, 1.1)])
def test_plane_layers(indices):
    """Rays through horizontal layers of thickness 1."""
    count = len(indices)
    planes = [optics.Plane((0.3, -k), (0, 2)) for k in range(1, count)]
    scene = optics.Scene([optics.Uniform(n) for n in indices], planes)
    certificate = scene.rays((0, 0), (1.5, -count))[0].certify((1.5, -count))
    assert holds(certificate, refracted([1] * count, indices, mpmath.mpf("1.5")))
    assert certificate.index == 0
    assert certificate.tube > 0.01
    assert certificate.width < 1e-40
    assert "no curve is shorter that meets the surfaces within" in str(certificate)


def test_a_tilted_mirror_by_the_image_of_the_source():
    """The normal (1, 2) as it is given: its unit vector in doubles is that of another mirror."""
    scene = optics.Scene(optics.Uniform(1.1), optics.Plane((0.1, -1), (1, 2), mirror=True))
    certificate = scene.rays((0, 1), (3, 1))[0].certify((3, 1))
    across = (-mpmath.mpf(0.1) + 4) / 5
    assert holds(certificate, mpmath.mpf(1.1) * mpmath.hypot(3 + 2 * across, 4 * across))


def test_rays_in_a_circle_are_minima_on_the_near_side_alone():
    """Along a diameter, by either end of it: the far one is seen from beyond the mirror's focus."""
    mirror = optics.Sphere((0.1, 0), 0.7, mirror=True)
    rays = optics.Scene(optics.Uniform(1.0), mirror).rays((0.4, 0), (0, 0))
    near, far = (ray.certify((0, 0)) for ray in rays if abs(ray.tangents[0][1]) < 1e-6)
    a, b, radius = mpmath.mpf(0.4) - mpmath.mpf(0.1), mpmath.mpf(0.1), mpmath.mpf(0.7)
    assert holds(near, 2 * radius - a + b)
    assert holds(far, 2 * radius + a - b)
    assert (near.index, far.index) == (0, 1)
    assert far.tube == 0.0
    assert "falls in 1 direction" in str(far)


def test_the_axis_of_a_lens_in_space():
    """Along the axis: thicknesses times indices. Past the focus the path falls in both directions across."""
    surfaces = [
        optics.Conic((0, 0, 0), (0, 0, 3), 2.0, -0.5),
        optics.Asphere((0, 0, 0.4), (0, 0, 1), -2.0, 0.3, (0.01, -0.002)),
    ]
    lens = optics.Scene([optics.Uniform(1.1), optics.Uniform(1.53), optics.Uniform(1.0)], surfaces)
    before, past = (0, 0, 1.0), (0, 0, 8.0)
    glass = mpmath.mpf(0.4)
    for receiver, rays, conjugate in zip(
        (before, past), lens.arrivals((0, 0, -5), [before, past]), (0, 2), strict=True
    ):
        axial = min(rays, key=lambda ray: abs(ray.tangents[0][0]))
        certificate = axial.certify(receiver)
        assert holds(certificate, 5 * mpmath.mpf(1.1) + glass * mpmath.mpf(1.53) + receiver[2] - glass)
        assert certificate.index == conjugate == axial.index


def test_a_surface_of_a_class_of_ones_own_is_what_its_level_says():
    """A plane that is lowered: what it inherits as its formula is not taken for it."""

    class Lowered(optics.Plane):
        def level(self, position):
            return position[1] + 0.25

    scene = optics.Scene([optics.Uniform(1.0), optics.Uniform(1.33)], Lowered((0, 0), (0, 1)))
    certificate = scene.rays((0, 0), (0, -1))[0].certify((0, -1))
    assert holds(certificate, mpmath.mpf("0.25") + mpmath.mpf("0.75") * mpmath.mpf(1.33))


def test_parameters_of_surfaces_and_media():
    """A plane at -h^2 and an index 1 + a^2, whose squares are not rounded."""
    ground = optics.Implicit(lambda x, y, p: y + p.h**2, parameters={"h": 0.7})
    media = [optics.Uniform(lambda p: 1 + p.a**2, {"a": 0.3}), optics.Uniform(1.33)]
    certificate = optics.Scene(media, ground).rays((0, 0), (0, -1))[0].certify((0, -1))
    h = mpmath.mpf(0.7) ** 2
    assert holds(certificate, h * (1 + mpmath.mpf(0.3) ** 2) + (1 - h) * mpmath.mpf(1.33))


def test_constants_of_a_surface_are_not_multiplied_together():
    """y = -0.1 (0.3 x) at x = 7, where CasADi by itself makes 0.03 of 0.1 * 0.3, rounded."""
    slope = mpmath.mpf(0.1) * mpmath.mpf(0.3)
    mirror = optics.Implicit(lambda x, y: 0.1 * (0.3 * x) + y, mirror=True)
    certificate = optics.Scene(optics.Uniform(1.0), mirror).rays((0, 1), (2, 1))[0].certify((2, 1))
    # the image of (0, 1) in slope x + y = 0
    away = 2 / (1 + slope**2)
    assert holds(certificate, mpmath.hypot(2 + away * slope, away))


def proof(media, surfaces, ends, hits, path):
    chain = _Chain(tuple(map(np.array, ends)), [optics.Uniform(n) for n in media], surfaces)
    with working(BITS, TERMS):
        return _proof(chain, np.array(hits, dtype=float), path)


def test_no_ray_is_proved_that_meets_a_surface_before():
    """On the axis of a ball a ray cannot enter it on the far side."""
    ball = optics.Sphere((0, 0), 1)
    ends = ((-3.0, 0.0), (4.0, 0.0))
    assert proof((1, 1.5, 1), [ball, ball], ends, [(-1, 0), (1, 0)], 8).index == 1
    with pytest.raises(Unproved, match="clear of surface 0"):
        proof((1, 1.5), [ball], ends, [(1, 0)], 8.5)


def test_a_ray_that_turns_back_at_a_refracting_surface_is_none():
    """The path is stationary on the plane for a reflected ray as well."""
    plane = optics.Plane((0, 0), (0, 1))
    ends = ((0.0, 1.0), (2.0, 1.0))
    with pytest.raises(Unproved, match="pass through surface 0"):
        proof((1, 1), [plane], ends, [(1, 0)], 2 * 2**0.5)
    mirror = optics.Plane((0, 0), (0, 1), mirror=True)
    assert holds(proof((1, 1), [mirror], ends, [(1, 0)], 2 * 2**0.5), 2 * mpmath.sqrt(2))
    with pytest.raises(Unproved, match="reflected by surface 0"):
        proof((1, 1), [mirror], ((0.0, 1.0), (2.0, -1.0)), [(1, 0)], 2 * 2**0.5)


@pytest.mark.parametrize("power", [1, 2, 4, 8])
def test_wrong_points_lead_to_the_ray_or_nowhere(power):
    plane, exact = optics.Plane((0, 0), (0, 1)), refracted([1, 1], [1, 1.33], mpmath.mpf(1))
    for side in (-1, 1):
        hit = [(0.5878671 + side * 10.0**-power, side * 10.0**-power)]
        try:
            found = proof((1.0, 1.33), [plane], ((0.0, 1.0), (1.0, -1.0)), hit, float(exact))
        except Unproved:
            assert power < 4
        else:
            assert holds(found, exact)


def test_an_end_on_a_caustic_is_refused():
    """From one focus of an ellipse to the other all paths are the same."""
    ellipse = optics.Implicit(lambda x, y: x**2 / 25 + y**2 / 9 - 1, mirror=True)
    with pytest.raises(ArithmeticError, match="on a caustic, or near"):
        optics.Scene(optics.Uniform(1.0), ellipse).rays((-4, 0), (4, 0))[0].certify((4, 0))


def test_surfaces_between_media_that_are_not_uniform_are_refused():
    layers = optics.Stratified(lambda y: ca.sqrt(2 - y))
    scene = optics.Scene([optics.Uniform(1.0), layers], optics.Plane((0, 0), (0, 1)))
    with pytest.raises(ValueError, match="for uniform media; one of these is Stratified"):
        scene.rays((0, 1), (1, -1))[0].certify()
