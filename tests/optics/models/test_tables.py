"""g of a table: changes to round-off, integrals that stop at its heights, and all rays by pieces of parabolas."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics.models.jumps import less_smooth
from varcalc.optics.models.reduction import Profile
from varcalc.optics.models.tables import TableProfile

HEIGHTS = np.array([-4.1, -2.7, -2.2, -0.4, 0.3, 1.9, 3.0])
INDEX = np.array([1.31, 1.12, 1.25, 1.4, 1.22, 1.08, 1.2])


def exact(medium, u):
    """n^2 at u by its cubic, in many digits."""
    k = int(np.clip(np.searchsorted(medium.heights, float(u), side="right") - 1, 0, medium.layers - 1))
    above = u - mp.mpf(medium.heights[k])
    return sum(mp.mpf(float(c)) * above**i for i, c in enumerate(medium.coefficients[k]))


def looked_up(heights, index, smooth):
    """n of a height by a table of CasADi's of n^2."""
    table = ca.interpolant("squared", "bspline" if smooth else "linear", [heights], index**2)
    return lambda y: ca.sqrt(table(y))


@pytest.mark.parametrize("casadi", [True, False])
@pytest.mark.parametrize("smooth", [True, False])
def test_changes_are_exact_however_small_and_through_any_number_of_layers(smooth, casadi):
    medium, rng = optics.Tabulated(HEIGHTS, INDEX, smooth=smooth), np.random.default_rng(5)
    other = optics.Stratified(looked_up(HEIGHTS, INDEX, smooth))
    profile = Profile(other, 1.0, 0.0) if casadi else TableProfile(medium)
    base = rng.uniform(HEIGHTS[0], HEIGHTS[-1], 60)
    base[:6] = HEIGHTS[1:]  # from a height of the table both ways
    x = np.where(rng.uniform(size=60) < 0.5, -1, 1) * 10.0 ** rng.uniform(-12, 0.5, 60)
    x = np.clip(x, HEIGHTS[0] - base, HEIGHTS[-1] - base)
    gain, _ = profile.changes(base, x)
    with mp.workdps(40):
        true = [
            float(exact(medium, mp.mpf(b) + mp.mpf(d)) - exact(medium, mp.mpf(b))) for b, d in zip(base, x, strict=True)
        ]
    slopes = np.abs(np.diff(INDEX**2) / np.diff(HEIGHTS)).max()
    layers = [np.searchsorted(HEIGHTS, at, side="right") for at in (base, base + x)]
    # cubics meet at the heights to their own round-off
    allowed = 1e-14 * slopes * np.abs(x) + np.where(layers[0] == layers[1], 1e-30, 1e-15)
    np.testing.assert_array_less(np.abs(gain - true), allowed)


def reached(squared, heights, start, cosine, up, distance):
    """Where a ray of piecewise linear n^2 is after a distance: parabola by parabola; None where it leaves the table."""
    slopes = np.diff(squared) / np.diff(heights)
    g = float(np.interp(start, heights, squared))
    p2, y, x = g * cosine**2, start, 0.0
    w = (1 if up else -1) * math.sqrt(max(g - p2, 0.0))
    while True:
        k = np.searchsorted(heights, y, side="right") - 1 if w > 0 else np.searchsorted(heights, y, side="left") - 1
        if not 0 <= k < len(slopes):
            return None
        # y'' = slope / 2 in sigma; the first height it comes to
        times = []
        for h in (heights[k], heights[k + 1]):
            within = w**2 - slopes[k] * (y - h)
            q = -(w + math.copysign(math.sqrt(within), w)) / 2 if within > 0 else 0.0
            times += [(t, h) for t in (4 * q / slopes[k], (y - h) / q) if t > 1e-9] if q else []
        t, h = min(times, default=(math.inf, None))
        rest = (distance - x) / math.sqrt(p2)
        if t >= rest:
            return y + w * rest + slopes[k] / 4 * rest**2
        x, y, w = x + t * math.sqrt(p2), h, w + slopes[k] / 2 * t


def stratified(heights, index):
    return optics.Stratified(looked_up(heights, index, False))


def graded(heights, index):
    return optics.Graded(lambda x, y: looked_up(heights, index, False)(y))


def tabulated(heights, index):
    return optics.Tabulated(heights, index, smooth=False)


@pytest.mark.parametrize(
    ("seed", "medium"), [*((k, tabulated) for k in range(4)), (1, stratified), (2, graded), (3, stratified)]
)
def test_all_rays_of_a_table_of_parabolas(seed, medium):
    rng = np.random.default_rng(seed)
    heights = np.sort(rng.uniform(-5, 0, 7))
    index = 1 + 0.05 * rng.uniform(size=7)
    (start, end), distance = rng.uniform(heights[1], heights[-2], 2), float(rng.uniform(5, 60))
    rays = optics.Scene(medium(heights, index)).rays((0, start), (distance, end))

    def beyond(angle):
        there = reached(index**2, heights, start, math.cos(angle), angle > 0, distance)
        return math.nan if there is None else there - end

    angles = np.unique(np.concatenate([np.linspace(-1.5, 1.5, 1500), np.linspace(-0.4, 0.4, 3000)]))
    there = np.array([beyond(t) for t in angles])
    found = []
    for k in np.flatnonzero(there[1:] * there[:-1] < 0):
        low, high = angles[k], angles[k + 1]
        for _ in range(45):
            middle = (low + high) / 2
            low, high = (middle, high) if beyond(middle) * there[k] > 0 else (low, middle)
        if abs(beyond(low) - beyond(high)) < 1e-6:  # else rays part at a kink
            found.append(low)
    assert rays.unresolved == 0
    assert sorted(math.atan2(*ray.tangents[0][::-1]) for ray in rays) == pytest.approx(found, abs=1e-9)


@pytest.mark.parametrize("medium", [stratified, graded])
def test_rays_are_carried_to_surfaces_in_pieces_of_parabolas(medium):
    heights = np.array([-3.0, -1.8, -1.1, -0.2, 0.4, 2.0])
    index = np.array([1.3, 1.25, 1.4, 1.32, 1.37, 1.2])
    scene = optics.Scene([medium(heights, index), optics.Uniform(1.0)], [optics.Plane((2.5, 0), (1, 0))])
    angles = np.linspace(-0.5, 0.5, 21)
    bundle = scene.trace((0, -0.3), [(math.cos(t), math.sin(t)) for t in angles], until=scene.surfaces[0])
    there = [reached(index**2, heights, -0.3, math.cos(t), t > 0, 2.5) for t in angles]
    assert all(y is not None for y in there)
    assert bundle.points[:, 1] == pytest.approx(there, abs=1e-13)


def test_rays_about_a_centre_of_a_table_are_lines_of_the_squared_plane():
    """n = r: w = z^2 maps rays to straight lines, and their optical paths are half the lengths of these."""
    radii = np.linspace(0.5, 3, 9)
    scene = optics.Scene(optics.Radial(ca.interpolant("n", "linear", [radii], radii)))
    for a, b in ((1.0, 1.2 * np.exp(1.0j)), (0.8 * np.exp(0.2j), 2.0 * np.exp(-0.9j))):
        rays = scene.rays((a.real, a.imag), (b.real, b.imag), within=6.0)
        assert [ray.optical_path for ray in rays] == pytest.approx([abs(b**2 - a**2) / 2], rel=1e-13)
        assert rays.unresolved == 0


@pytest.mark.parametrize(("strength", "ends"), [(1e-6, (-1000, -300)), (1e-6, (-4800, -10)), (-1e-6, (-300, -1000))])
@pytest.mark.parametrize("smooth", [True, False])
def test_rays_that_leave_a_table_take_none_of_their_neighbours_with_them(strength, ends, smooth):
    heights = np.linspace(-5000, 0, 11)
    table = optics.Tabulated(heights, 1 + strength * (heights + 2500), smooth=smooth)
    rays = optics.Scene(table).rays((0, ends[0]), (1e4, ends[1]))
    assert (len(rays), rays.unresolved) == (1, 0)


def test_many_receivers_of_a_table_are_answered_as_each_alone():
    scene = optics.Scene(optics.Tabulated(HEIGHTS, INDEX))
    receivers = np.column_stack([np.linspace(2, 9, 9), np.linspace(-3.5, 2.5, 9)])
    together = scene.arrivals((0, 0.1), receivers)
    for k in range(0, 9, 4):
        alone = scene.rays((0, 0.1), receivers[k])
        assert [ray.optical_path for ray in together[k]] == pytest.approx(
            [ray.optical_path for ray in alone], rel=1e-12
        )
        assert together[k].unresolved == alone.unresolved


@pytest.mark.parametrize("scale", [1e-9, 1e-7, 1e-5, 1.0, 1e3])
def test_kinks_and_knots_are_placed_whatever_the_unit_of_length(scale):
    """At a tenth of a micrometre, in metres, two kinks were taken for one, and tables lost their knots."""
    kinks = optics.Stratified(lambda y: ca.sqrt(1.5 - 0.1 * ca.fabs((y / scale) ** 2 - 1)))
    assert Profile(kinks, 1.0, 0.3 * scale).stops == pytest.approx(np.array([-scale, scale]), rel=1e-14)
    knots = np.linspace(0, 3, 7) * scale
    table = ca.interpolant("n", "linear", [knots], 1.2 + 0.1 * np.sin(np.arange(7.0)))
    profile = Profile(optics.Stratified(lambda y: table(ca.sqrt(y**2))), 1.0, 0.3 * scale)
    assert profile.stops / scale == pytest.approx(np.linspace(-3, 3, 13), rel=1e-12, abs=1e-5)
    height = np.array([-2.2, 0.3, 1.7]) * scale
    expected = np.interp(np.abs(height), knots, 1.2 + 0.1 * np.sin(np.arange(7.0))) ** 2
    assert profile.at(height)[0] == pytest.approx(expected, rel=1e-14)


def test_a_table_at_the_value_of_another_is_gone_through_cell_by_cell():
    """Its knots lie where the inner table, a line from 0 to 3 and one on to 4, has their values."""
    inner = ca.interpolant("inner", "linear", [np.array([-2.0, 1.0, 3.0])], np.array([0.0, 3.0, 4.0]))
    outer = ca.interpolant("outer", "linear", [np.array([0.0, 0.5, 3.25, 4.0])], np.array([1.0, 1.2, 2.3, 2.4]))
    medium = optics.Stratified(lambda y: outer(inner(y)))
    u = ca.SX.sym("u")
    switched, knots = less_smooth(ca.SX(medium.squared_index(ca.vertcat(0, u))), u, 1e6)
    assert len(switched) == 0
    np.testing.assert_allclose(knots, [-2, -1.5, 1, 1.5, 3], rtol=0, atol=1e-12)
    # from -1.5 to 1 n = 0.4 (y + 4.5), in which rays are y + 4.5 = C cosh((x - x₀) / C)
    size, (first, last) = 4.0, (-0.7, 1.3)
    a, b = ((x, size * math.cosh(x / size) - 4.5) for x in (first, last))
    exact = 0.4 * size / 2 * (last - first + size / 2 * (math.sinh(2 * last / size) - math.sinh(2 * first / size)))
    rays = optics.Scene(medium).rays(a, b)
    assert rays.unresolved == 0
    assert min(abs(ray.optical_path - exact) for ray in rays) < 1e-12
