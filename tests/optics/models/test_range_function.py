"""All rays of layers: weak ducts, wells and barriers, kinks, rods to their edges, against fans and closed forms."""

import itertools
import math
import pickle

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from varcalc import optics
from varcalc.optics.models.passages import RayPassages
from varcalc.optics.models.reduction import Profile


def heights_at(slope_of_g, start, p_squared, slopes, distance):
    """Where rays of y'' = g'/(2 p^2) come to after a distance, many at once; steep ones need shorter steps."""
    there = np.empty_like(slopes)
    for part in np.array_split(np.argsort(p_squared), 10):

        def rates(_, state, part=part):
            y, v = np.split(state, 2)
            return np.concatenate([v, slope_of_g(y) / (2 * p_squared[part])])

        begun = np.concatenate([np.full(len(part), start), slopes[part]])
        run = solve_ivp(rates, (0, distance), begun, method="DOP853", rtol=1e-9, atol=1e-9)
        there[part] = run.y[: len(part), -1]
    return there


@pytest.mark.parametrize(
    ("strength", "start", "distance", "end", "count"),
    [
        (1e-3, 1.1522, 274.737, 0.0495, 3),
        (1e-5, -0.1317, 1470.0, -1.6675, 1),
        (3e-5, 0.2, 900.0, -0.35, 3),
        (3e-5, -0.6, 1300.0, 0.5, 5),
    ],
)
def test_weak_ducts_hide_no_ray(strength, start, distance, end, count):
    n = lambda y: 1 + strength * np.exp(-(y**2))  # noqa: E731
    scene = optics.Scene(optics.Stratified(lambda y: 1 + strength * ca.exp(-(y**2))))
    rays = scene.rays((0, start), (distance, end))
    # a fan about the angles of rays that the duct can hold, and about the straight line
    angles = np.arctan((end - start) / distance) + np.linspace(-3, 3, 6001) * math.sqrt(2 * strength)

    def slope(y):
        excess = strength * np.exp(-(y**2))
        return -4 * y * excess * (1 + excess)

    there = heights_at(slope, start, n(start) ** 2 * np.cos(angles) ** 2, np.tan(angles), distance)
    assert np.count_nonzero(np.diff(np.sign(there - end))) == count
    assert len(rays) == count
    assert rays.unresolved == 0


@pytest.mark.parametrize(("distance", "end", "count"), [(36.08, -0.1546, 1), (700.0, 0.0482, 3), (1900.0, 0.3, 11)])
def test_a_duct_whose_rays_come_to_rest_far_out_leaves_nothing_unresolved(distance, end, count):
    # beside the angle at which rays leave the duct for good they turn back thousands of widths away
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 + 1e-4 / (1 + y**2))))
    rays = scene.rays((0, -0.225), (distance, end))
    angles = np.arctan((end + 0.225) / distance) + np.linspace(-3, 3, 6001) * 1e-2
    squared = (1 + 1e-4 / (1 + 0.225**2)) * np.cos(angles) ** 2
    slope = lambda y: -2e-4 * y / (1 + y**2) ** 2  # noqa: E731
    there = heights_at(slope, -0.225, squared, np.tan(angles), distance)
    assert np.count_nonzero(np.diff(np.sign(there - end))) == count
    assert (len(rays), rays.unresolved) == (count, 0)


@pytest.mark.parametrize(("distance", "count"), [(8.0, 1), (14.0, 3), (20.0, 3), (25.0, 3)])
def test_rays_below_a_parabolic_layer_are_all_found(distance, count):
    # n^2 = 1 - c (1 - (y - h)^2 / w^2) within w of h; in it u'' = k^2 u, so that a ray comes back where
    # tanh(k s / 2) = sine / (k w), after s = 2 / k atanh(sine / (k w))
    c, w, h, start, end = 0.2, 0.4, 2.4, 0.43, 0.39
    k = math.sqrt(c) / w
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - c * ca.fmax(0, 1 - ((y - h) / w) ** 2))))
    rays = scene.rays((0, start), (distance, end))

    def too_far(z):
        sine = math.sqrt(c) * math.tanh(z)
        return math.sqrt(1 - sine**2) * ((2 * (h - w) - start - end) / sine + 2 * z / k) - distance

    turns = [brentq(too_far, *part, xtol=1e-14) for part in itertools.pairwise((0.01, 1.1, 18)) if distance > 9]
    sines = [math.sqrt(c) * math.tanh(z) for z in turns]
    direct = (end - start) / math.hypot(distance, end - start)
    assert (len(rays), rays.unresolved) == (count, 0)
    assert sorted(ray.tangents[0][1] for ray in rays) == pytest.approx(sorted([direct, *sines]), rel=1e-12)


def test_rays_come_to_a_corner_of_the_index_in_time():
    # n^2 = 1 + a |y|: the ray that comes to rest at y = 0 from h does so after 4 sqrt(h / a) in sigma, and those beside
    # it go through or turn back: nothing is left to rest there
    a, h = 1e-3, 0.4
    scene = optics.Scene(optics.Tabulated([-2.0, 0.0, 2.0], np.sqrt([1 + 2 * a, 1.0, 1 + 2 * a]), smooth=False))
    reach = 2 * math.sqrt(h / a)  # of sigma, and so of x, from h to rest
    for share in (0.5, 0.9, 1.3, 2.3, 4.5):
        rays = scene.rays((0, h), (share * reach, -0.1))
        slopes = np.linspace(-0.1, 0.1, 200001)
        squared = (1 + a * h) / (1 + slopes**2)
        # parabolas, by hand: down to y = 0 where the ray comes so far, and on from there
        sigma = share * reach / np.sqrt(squared)
        w = slopes * np.sqrt(squared)
        with np.errstate(invalid="ignore"):
            speed = np.sqrt(w**2 - a * h)  # at y = 0
            met = (-w - speed) * 2 / a
            there = -speed * (sigma - met) - a * (sigma - met) ** 2 / 4
        came = np.where((w < 0) & (sigma > met), there, np.nan) + 0.1
        count = np.count_nonzero(came[1:] * came[:-1] < 0)
        assert (len(rays), rays.unresolved) == (count, 0)


def test_two_wells_and_the_barrier_between_them():
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(2 + 0.5 * ca.sin(3 * y) + 0.3 * ca.cos(7 * y))))
    rays = scene.rays((0, 0.3), (6, 0.9), within=15)
    angles = np.linspace(-1.5, 1.5, 20001)
    g = 2 + 0.5 * math.sin(0.9) + 0.3 * math.cos(2.1)
    slope = lambda y: 1.5 * np.cos(3 * y) - 2.1 * np.sin(7 * y)  # noqa: E731
    there = heights_at(slope, 0.3, g * np.cos(angles) ** 2, np.tan(angles), 6.0)
    steep = np.abs(np.diff(there)) > 1.0  # rays that part at a barrier
    assert np.count_nonzero((np.diff(np.sign(there - 0.9)) != 0) & ~steep) <= len(rays) + rays.unresolved


def test_rays_through_a_kink_are_pieces_of_parabolas():
    # n^2 = a - b |y|: from the axis at the momentum w up or down a ray is back after 4 w / b in sigma, p sigma along it
    a, b = 1.5, 0.8
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(a - b * ca.fabs(y))))
    for half_waves, sine in ((1, 0.3), (2, 0.5)):
        w, p = math.sqrt(a) * sine, math.sqrt(a) * math.sqrt(1 - sine**2)
        distance = half_waves * p * 4 * w / b
        rays = scene.rays((0, 0), (distance, 0))
        own = [ray for ray in rays if abs(abs(ray.tangents[0][1]) - sine) < 1e-9]
        assert len(own) == 2  # up first, and down first
        # the path is the integral of n^2 over sigma: of w^2 - b w s + b^2 s^2/4 + p^2, n^2 = p^2 + (w - b s/2)^2
        exact = half_waves * (p**2 * 4 * w / b + 4 * w**3 / (3 * b))
        assert own[0].optical_path == pytest.approx(exact, rel=1e-11)


def test_a_ray_in_a_kinked_index_ends_where_its_parabolas_do():
    a, b = 1.5, 0.8
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(a - b * ca.fabs(y))))
    rays = scene.rays((0, 0.2), (2.0, -0.1))
    assert len(rays) > 3
    for ray in rays[:4]:
        p, w = math.sqrt(a - b * 0.2) * np.array(ray.tangents[0])
        y, left = 0.2, 2.0 / p
        while True:  # to the next place on the axis, or as far as sigma goes
            side = math.copysign(1.0, y if y != 0 else w)
            roots = np.roots([-side * b / 4, w, y])
            ahead = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 1e-9]
            step = min(ahead) if ahead else math.inf
            if step >= left:
                y = y + w * left - side * b / 4 * left**2
                break
            y, w, left = 0.0, w - side * b / 2 * step, left - step
        assert y == pytest.approx(-0.1, abs=1e-9)


def test_a_rod_has_all_its_rays_to_the_edge():
    # n^2 = n0^2 (1 - a^2 y^2): y = A cos(w s) + q/w sin(w s), w = n0 a, s = x/p, p^2 + q^2 = n(A)^2
    n0, a, A, B, X = 1.5, 0.5, -1.6324, 1.7036, 1.2138
    scene = optics.Scene(optics.Stratified(lambda y: n0 * ca.sqrt(1 - (a * y) ** 2)))
    rays = scene.rays((0, A), (X, B), within=5.68)
    w, n = n0 * a, n0 * math.sqrt(1 - (a * A) ** 2)
    angle = np.linspace(-math.pi / 2 + 1e-6, math.pi / 2 - 1e-6, 2_000_001)
    s, q = X / (n * np.cos(angle)), n * np.sin(angle)
    miss = A * np.cos(w * s) + q / w * np.sin(w * s) - B
    # the path is the integral of n^2 ds, half of n0^2 + p^2 - q.. on average: kept by the bound asked for
    change = np.flatnonzero(np.diff(np.sign(miss)))
    paths = []
    for k in change:
        sigma = np.linspace(0, s[k], 4001)
        y = A * np.cos(w * sigma) + q[k] / w * np.sin(w * sigma)
        paths.append(np.trapezoid(n0**2 * (1 - (a * y) ** 2), sigma))
    assert len(rays) == np.count_nonzero(np.array(paths) <= 5.68) == 4
    assert rays.unresolved == 0


@pytest.mark.parametrize(("h", "k", "far"), [(80.0, 0.01, 700.0), (1.0, 0.3, 8.0), (1.0, 0.3, 20.0)])
@pytest.mark.parametrize(
    "index",
    [
        lambda y, h, k: ca.sqrt(ca.if_else(y < h, 1.0, 1 - k * (y - h))),
        lambda y, h, k: ca.if_else(y < h, 1.0, ca.sqrt(1 - k * (y - h))),
        lambda y, h, k: 2 * ca.if_else(y > h, -ca.sqrt(1 - k * (y - h)), -1) / -2,
        lambda y, h, k: ca.sqrt(1 - k * ca.fmax(y - h, 0)),
    ],
    ids=["root of a choice", "choice of a root", "multiple of a choice", "root of a greatest"],
)
def test_a_linear_ionosphere_gives_back_its_rays_beside_the_level_one(index, h, k, far):
    # n = 1 below h, n^2 with the slope -k above: 2 (h cot a + sin 2a / k) along the layers
    scene = optics.Scene(optics.Stratified(lambda y: index(y, h, k)))
    rays = scene.rays((0, 0), (far, 0))
    angle = np.linspace(0.02, math.pi / 2 - 1e-6, 400_001)
    distance = 2 * (h / np.tan(angle) + np.sin(2 * angle) / k)
    skies = np.count_nonzero(np.diff(np.sign(distance - far)))
    assert len(rays) == 1 + skies
    assert rays.unresolved == 0
    assert rays[0].optical_path == pytest.approx(far, rel=1e-12)


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-4])
def test_a_wall_far_off_whose_exponential_is_nothing_hides_no_straight_ray(width):
    scene = optics.Scene(optics.Stratified(lambda y: 1 + 1e-2 * ca.exp(-(((y - 3.3333) / width) ** 2))))
    [ray] = scene.rays((0, 0), (5.0, 0.3))
    assert ray.optical_path == pytest.approx(math.hypot(5.0, 0.3), rel=1e-12)


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4, 1e-6])
def test_narrow_wall_turns_level_rays_back_and_lets_steep_ones_through(width):
    # n² dips to a half within a few widths of a height
    middle, depth = 0.5173, 0.5
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - depth * ca.exp(-(((y - middle) / width) ** 2)))))

    def squared(y):
        return 1 - mp.mpf(depth) * mp.exp(-(((y - middle) / width) ** 2))

    def passed(p):
        return mp.quad(lambda y: p / mp.sqrt(squared(y) - p**2), marks, method="gauss-legendre")

    marks = [0, *(middle + k * width for k in (-10, -3, 0, 3, 10)), 0.8]
    p = mp.findroot(lambda p: passed(p) - 0.5, (0.52, 0.53))
    through = mp.quad(lambda y: squared(y) / mp.sqrt(squared(y) - p**2), marks, method="gauss-legendre")
    [ray] = scene.rays((0, 0), (0.5, 0.8))
    # heights are rounded to 1e-16, which is much of a wall as thin as this
    assert ray.optical_path == pytest.approx(float(through), rel=max(1e-13, 1e-17 / width))

    # along the middle, where n² is least, a ray rests as long as it must, and leaves to either side
    slow = mp.sqrt(1 - mp.mpf(depth))

    def climb(low, high):
        places = [low, *(p for p in marks[1:-1] if low < p < high), high]
        return mp.quad(lambda y: mp.sqrt(squared(y) - slow**2), places, method="gauss-legendre")

    resting, straight, mirrored = scene.rays((0, 0), (4.0, 0.2))
    assert resting.optical_path == pytest.approx(
        float(4 * slow + climb(0, middle) + climb(0.2, middle)), abs=resting.error
    )
    assert straight.optical_path == pytest.approx(math.hypot(4.0, 0.2), rel=1e-13)
    # a mirror at most four widths before the middle
    assert mirrored.optical_path == pytest.approx(math.hypot(4.0, 2 * middle - 0.2), abs=4 * width)
    [through] = scene.rays((0, 0), (4.0, 0.8))  # others are too level to come through
    assert max(resting.error, through.error) < 1e-6
    assert through.optical_path == pytest.approx(
        float(4 * slow + climb(0, middle) + climb(middle, 0.8)), abs=through.error
    )


@pytest.mark.parametrize("fall", [0.03, 0.16, 1.0])
@pytest.mark.parametrize(("source", "receiver", "distance"), [(0.361, 0.354, 33.86), (0.0, 0.3, 6.0), (0.2, 0.2, 25.0)])
def test_rays_below_a_kink_are_resolved_down_to_level_ones(fall, source, receiver, distance):
    # n² = 1 up to the height 1, and falls linearly above: up, over and down again comes as far as
    # (2 - source - receiver) cot t + 2 sin 2t / fall
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - fall * ca.fmax(y - 1, 0))))
    rays = scene.rays((0, source), (distance, receiver), within=4 * distance)

    def beyond(t):
        return (2 - source - receiver) / np.tan(t) + 2 * np.sin(2 * t) / fall - distance

    angles = np.geomspace(1e-4, 1.5707, 400_001)
    places = angles[:-1][np.diff(np.sign(beyond(angles))) != 0]
    exact = [brentq(beyond, t, t * 1.001, xtol=1e-15) for t in places]
    paths = [math.hypot(distance, receiver - source)]
    paths += [
        # ∫n² dσ over the parabola is 2 w (1 - w²)/f + 2 w³/(3 f), times two
        (2 - source - receiver) / math.sin(t) + 4 * math.sin(t) * (1 - 2 * math.sin(t) ** 2 / 3) / fall
        for t in exact
    ]
    assert rays.unresolved == 0
    paths = sorted(path for path in paths if path <= 4 * distance)
    assert [ray.optical_path for ray in rays] == pytest.approx(paths, rel=1e-11)


def test_rays_that_turn_where_the_index_is_nothing_are_resolved():
    scene = optics.Scene(optics.Stratified(lambda z: 1.78 - 0.43 * ca.exp(z / 71)))
    assert [scene.rays((0, -500), (x, -100)).unresolved for x in (50, 300, 2000)] == [0, 0, 0]


def test_no_ray_goes_beyond_a_place_where_the_index_is_nothing():
    """n = 1 + cos y touches 0 at π: the level ray, and one of each number of crossings of the axis upwards and down."""
    rays = optics.Scene(optics.Stratified(lambda y: 1 + ca.cos(y))).rays((-0.2, 0), (0.2, 0), within=36.0)
    assert [ray.index for ray in rays] == [0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert rays.unresolved == 0

    def crossed(c, weight):
        """The integral of ``weight`` from the axis to the turning point and back, where y = turn (1 - q²)."""
        turn = mp.acos(c - 1)

        def along(q):
            y = turn * (1 - q * q)
            # (1 + cos y)² - c², without a difference of what is nearly the same
            left = 2 * mp.sin((turn + y) / 2) * mp.sin(turn * q * q / 2) * (1 + mp.cos(y) + c)
            return weight(1 + mp.cos(y)) * 2 * turn * q / mp.sqrt(left)

        return 2 * mp.quad(along, [0, 0.02, 0.1, 0.3, 1], method="gauss-legendre")

    with mp.workdps(25):
        for number in (1, 3, 5):
            ray = rays[2 * number]
            c = mp.findroot(lambda c, k=number: k * crossed(c, lambda n: c) - mp.mpf("0.4"), 0.012 / number**2)
            path = number * crossed(c, lambda n: n * n)
            assert abs(ray.optical_path - path) <= ray.error
            assert ray.error < 1e-11 * path


def test_waves_behind_a_place_without_an_index_are_not_looked_at():
    profile = Profile(optics.Stratified(lambda y: 1 + ca.cos(y**2)), 1.0, 0.1)
    nodes = profile.nodes(0.1, 0.3, -1000.0, 1000.0)
    assert np.allclose(nodes.u[[0, -1]], [-math.sqrt(math.pi), math.sqrt(math.pi)], rtol=1e-12)
    assert len(nodes.u) < 5000


def test_beside_a_medium_that_ends_in_the_dark_rays_are_catenaries():
    """n = max(1 - y, 0): Y = 1 - y = c cosh((x - x0)/c), as far as there is an index."""
    rays = optics.Scene(optics.Stratified(lambda y: ca.fmax(1 - y, 0))).rays((-0.2, 0.1), (0.2, 0.3), within=9.0)
    assert rays.unresolved == 0
    paths = []
    for sign in (1, -1):  # the second point beyond the lowest or before it

        def apart(c, sign=sign):
            return c * (mp.acosh(mp.mpf("0.9") / c) + sign * mp.acosh(mp.mpf("0.7") / c)) - mp.mpf("0.4")

        def path(c, sign=sign):
            first, last = mp.acosh(mp.mpf("0.9") / c), mp.acosh(mp.mpf("0.7") / c)
            return c * c * ((first + mp.sinh(2 * first) / 2) + sign * (last + mp.sinh(2 * last) / 2)) / 2

        grid = [mp.mpf(k) / 1000 for k in range(1, 700)]
        for low, high in itertools.pairwise(grid):
            if apart(low) * apart(high) < 0:
                paths.append(path(mp.findroot(apart, (low, high), solver="anderson")))
    paths.sort()
    assert len(paths) == 2
    for ray, exact in zip(rays, paths, strict=True):
        assert abs(ray.optical_path - exact) <= ray.error


@pytest.mark.parametrize("dimension", [2, 3])
def test_conjugate_points_are_counted_by_turning_points_as_they_are_along_the_ray(dimension):
    """The index, the spreading and the last direction, told without carrying a ray, and by Hamilton's equations."""
    wells = optics.Stratified(lambda y: ca.sqrt(2 + 0.5 * ca.sin(3 * y) + 0.3 * ca.cos(7 * y)))
    shell = optics.Radial(lambda r: ca.sqrt(1.5 + 0.5 * ca.exp(-(((r - 1) / 0.3) ** 2))))
    rod = optics.Stratified(lambda y: 1.6 / ca.cosh(y))
    first, last = np.zeros(dimension), np.zeros(dimension)
    cases = ((wells, (0.0, 0.3), (3.0, -0.2)), (shell, (0.7, 0.3), (-0.5, 0.6)), (rod, (0.0, 0.1), (11.0, 0.4)))
    for medium, a, b in cases:
        first[[0, -1]], last[[0, -1]] = a, b
        told = optics.Scene(medium).rays(first, last)
        for ray in told:
            tube = optics.ray_tube(optics.Scene(medium), optics.PointSource(first), ray.tangents[0], ray.optical_path)
            assert len(tube.foci) == ray.index
            assert ray.spreading == pytest.approx(tube.spreading(ray.optical_path), rel=1e-8)
    assert max(ray.index for ray in told) >= 2


def test_rays_of_ever_smaller_turns_along_a_kink_are_said_to_have_no_end():
    """In n² = 2 - |y| a ray from y = 0 at p_y comes back at σ = 4 p_y: x = 4 m p_x p_y, for any m up to infinity."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(2 - ca.fabs(y))))
    rays = scene.rays((0, 0), (3, 0), within=5.0)
    assert rays.unresolved > 0
    assert "no end" in rays.searched
    half = np.arange(1, 100)  # half periods
    sine = 3 / (4 * half)  # of twice the angle, as p_x p_y = sin(2θ)
    exact = []
    for count, twice in zip(half, sine, strict=True):
        for double in (np.arcsin(twice), np.pi - np.arcsin(twice)) if twice < 1 else ():
            p = np.sqrt(2) * np.sin(double / 2)
            path = count * (8 * p - 8 * p**3 / 3)  # of n² = 2 - |y| over 4 p: y = pσ - σ²/4
            exact += [path, path] if path <= 5.0 else []  # up first, and down first
    found = np.array([ray.optical_path for ray in rays])
    np.testing.assert_allclose(np.sort(found)[: 2 * 20], np.sort(exact)[: 2 * 20], rtol=1e-12)


def test_rays_through_a_shell_are_found_however_flat_its_tail_is_at_the_source():
    """Out there 2n²/|∇n²| is 1e21: with paths as long for a unit no ray through the shell was told from nothing."""
    scene = optics.Scene(optics.Radial(lambda r: 1 + 0.5 * ca.exp(-(((r - 1) / 0.05) ** 2))))
    a, b = np.array([-1.5, 0.3]), np.array([1.4, 0.2])
    near = scene.rays(a, b, within=8.0)
    assert scene.usual_range(a, b) < 100
    for rays in (scene.rays(a, b), scene.rays(a, b, within=1e22)):
        assert [ray.optical_path for ray in rays][: len(near)] == pytest.approx(
            [r.optical_path for r in near], rel=1e-12
        )
    c = [abs(a[0] * ray.tangents[0][1] - a[1] * ray.tangents[0][0]) for ray in near]

    def turned(c):  # the angle from a to b about the centre, of a ray that goes in and out again
        u = lambda r: (1 + 0.5 * np.exp(-(((r - 1) / 0.05) ** 2))) * r  # noqa: E731
        low = brentq(lambda r: u(r) - c, 1e-6, 0.9)
        part = lambda r: quad(  # noqa: E731
            lambda t: 2 * t * c / ((low + t * t) * np.sqrt(u(low + t * t) ** 2 - c * c)), 0, np.sqrt(r - low),
            points=[np.sqrt(x - low) for x in (0.9, 1.0, 1.1)], limit=400, epsabs=1e-12,
        )[0]  # fmt: skip
        return part(np.hypot(*a)) + part(np.hypot(*b))

    apart = np.arccos(a @ b / np.hypot(*a) / np.hypot(*b))
    assert min(abs(turned(c[0]) - way) for way in (apart, 2 * np.pi - apart)) < 1e-9


@pytest.mark.parametrize("dark", [2, 4])
def test_near_and_far_pairs_asked_together_where_rays_are_circles(dark):
    """In n = 1 / (1 + z) rays are circles about points at z = -1: one ray a pair, however steep.

    The optical path is a distance in Poincaré's half-plane, arcosh(1 + (dx² + dz²) / 2(1 + z_A)(1 + z_B)). Rays that
    go nearly upright to where the index grows without bound turn ever so far away, behind where they start.
    """
    rng = np.random.default_rng(20)
    height = 10 ** rng.uniform(-dark, 2, (60, 2)) - 1
    away = 10 ** rng.uniform(-3, 3, 60)
    a, b = np.column_stack([np.zeros(60), height[:, 0]]), np.column_stack([away, height[:, 1]])
    found = optics.Scene(optics.Stratified(lambda z: 1 / (1 + z))).arrivals(a, b)
    assert [(len(rays), rays.unresolved) for rays in found] == [(1, 0)] * 60
    for ray, (dx,), (z, w) in zip((rays[0] for rays in found), b[:, :1].tolist(), height.tolist(), strict=True):
        squared = mp.mpf(dx) ** 2 + (mp.mpf(w) - z) ** 2
        exact = mp.acosh(1 + squared / (2 * (1 + mp.mpf(z)) * (1 + mp.mpf(w))))
        known = 1e-15 / min(1 + z, 1 + w)  # round-off of the heights, which is no fault of the rays
        assert abs(ray.optical_path - exact) <= ray.error + known
        assert ray.error < 1e-10 * float(exact)


@pytest.mark.parametrize("height", [0.0, 1e-17, 1e-9, -1e-4, 0.3])
def test_rays_do_not_depend_on_which_height_is_called_nothing(height):
    """n² = a - b y above a kink at -1: from ``height`` at the momentum w a ray is as high again after σ = 4 w / b.

    Between two heights close to nothing the medium was looked at as far as a million times these, and no farther.
    """
    a, b, sine = 1.5 - 0.8 * height, 0.8, 0.3
    w, p = math.sqrt(a) * sine, math.sqrt(a * (1 - sine**2))
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(2.3 - b * ca.fabs(y + 1))))
    # steep rays come as far: sin 2θ is the same
    exact = [(4 * a * v - 8 * v**3 / 3) / b for v in (w, p)]
    rays = scene.rays((0, height), (p * 4 * w / b, height), within=4.0)
    assert [ray.optical_path for ray in rays] == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize(("distance", "end"), [(24.3, 1.2276), (78.8, -1.1567), (91.3, -0.2992), (91.3, -0.4378)])
def test_two_ducts_between_uniform_halves_leave_nothing_unresolved(distance, end):
    # far above and far below the index is one: rays rest there at one angle, though round-off tells two
    start, terms = -0.38305, [(0.00634657, 2.77651927, 2.32705438), (0.00289534, 1.02176663, 1.37559925)]

    def squared(y, functions=np):
        return 1 + sum(2 * a / functions.cosh((y - c) / w) ** 2 for a, c, w in terms)

    def slope(y):
        steepness = ((a / w, np.tanh((y - c) / w)) for a, c, w in terms)
        return sum(-4 * share * tanh * (1 - tanh**2) for share, tanh in steepness)

    rays = optics.Scene(optics.Stratified(lambda y: ca.sqrt(squared(y, ca)))).rays((0, start), (distance, end))
    angles = np.arctan((end - start) / distance) + np.linspace(-3, 3, 6001) * math.sqrt(2 * terms[0][0])
    there = heights_at(slope, start, squared(start) * np.cos(angles) ** 2, np.tan(angles), distance)
    assert (len(rays), rays.unresolved) == (np.count_nonzero(np.diff(np.sign(there - end))), 0)


@pytest.mark.parametrize("offset", [1e-3, 1e-6, 1e-9, 1e-11, 1e-15])
@pytest.mark.parametrize("windings", [None, 4.0])
def test_rays_past_a_centre_at_which_the_index_is_pointed(offset, windings):
    # the angle about the centre goes to half a turn as c log c, which parabolas in c do not tell
    scene = optics.Scene(optics.Radial(lambda r: 1 + 0.2 * r / (1 + r * r)))
    through = sum(r + 0.1 * math.log1p(r * r) for r in (0.8, 0.5))
    target = (0.5 * math.cos(offset), 0.5 * math.sin(offset))
    rays = scene.rays((-0.8, 0), target, within=windings)
    assert (len(rays), rays.unresolved) == (1, 0)
    assert abs(rays[0].optical_path - through) <= rays[0].error + offset**2


def test_a_point_behind_a_pointed_centre_is_no_shadow():
    # the ray goes straight through it, where its neighbours cannot be followed
    rays = optics.Scene(optics.Radial(lambda r: 1 + 0.2 * r / (1 + r * r))).rays((-0.8, 0), (0.5, 0))
    assert len(rays) + rays.unresolved > 0


def test_an_index_that_is_looked_up_between_many_knots_has_the_rays_of_the_table():
    heights = np.array([-1.5, -0.9, -0.7, -0.55, -0.3, -0.1, 0.05, 0.2, 0.45, 0.6, 0.85, 1.5])
    squared = 2 + 0.1 * np.cos(7 * heights)
    looked_up = optics.Scene(optics.Stratified(lambda y: ca.sqrt(np.interp(y, heights, squared))))
    table = optics.Scene(optics.Tabulated(heights, np.sqrt(squared), smooth=False))
    for end in ((2.0, 0.3), (1.5, -0.8), (3.5, 0.1)):
        own, other = (scene.rays((0, -0.2), end, within=6.0) for scene in (looked_up, table))
        assert (own.unresolved, other.unresolved) == (0, 0)
        inside = [ray for ray in own if np.abs(ray.point(ray.optical_path / 2)[1]) < 1.5]
        assert [ray.optical_path for ray in inside] == pytest.approx([ray.optical_path for ray in other], rel=1e-12)
    profile = Profile(looked_up.media[0], 1.0, 0.0)
    formulas = profile._formulas
    assert len(formulas.part) == len(heights) + 1  # one formula a piece, and not all knots in each
    assert len(formulas.parts) <= 4  # what is compiled for one piece serves those alike


def test_rays_that_come_to_rest_where_a_change_of_the_index_overflows_have_their_angle():
    """Far from a duct n is one; its change from there is told by squares of cosh that are no numbers."""
    medium = optics.Stratified(lambda y: ca.sqrt(1 + 0.01 / ca.cosh(y) ** 2))
    passages = RayPassages.between(Profile(medium, 1.0, 0.0), np.array([[-0.4, 0.3]]), np.array([4096.0]))[0]
    rest = math.acos(1 / math.sqrt(1 + 0.01 / math.cosh(0.4) ** 2))
    np.testing.assert_allclose(passages.breaks, [[0, rest, math.pi / 2]], rtol=1e-13)
    assert not passages.mild[0, 1]


@pytest.mark.parametrize(
    ("medium", "source", "target", "most"),
    [
        (optics.fish_eye(), (0.1, -0.2), (0.7, 0.4), 90),
        (optics.munk_profile(), (0, -1000), (5e4, -3000), 220),
        (optics.Stratified(lambda y: ca.sqrt(1 + 0.01 * ca.exp(-y * y))), (0, -0.3), (40, 0.2), 220),
    ],
)  # fmt: skip
def test_few_angles_tell_all_rays(medium, source, target, most):
    rays = optics.Scene(medium).rays(source, target)
    assert rays.unresolved == 0
    assert int(rays.searched.split("(")[1].split(" looked at")[0]) <= most


@pytest.mark.parametrize("distance", [30.0, 60.0, 200.0])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_ray_that_rests_along_a_layer_closer_than_angles_can_be_told_is_told(distance, dimension):
    """n = cosh y: a ray from -0.5 to 0.7 is next to the one that stays on y = 0 for ever, by e^(-distance).

    With n cos θ = c, 1 - c² = ε, it comes ∫ c dy / √(sinh² y + ε) far on an optical path ∫ cosh² y dy / √(sinh² y + ε).
    """
    ahead, across = [distance, *[0.0] * (dimension - 2)], [0.0] * (dimension - 1)
    scene = optics.Scene(optics.Stratified(ca.cosh))
    rays = scene.rays((*across, -0.5), (*ahead, 0.7))
    assert rays.unresolved == 0
    [ray] = rays
    with mp.workdps(120):
        # next to ε = 0 these elliptic integrals are logarithms, ∫ dy / √(sinh² y + ε) = ln(4 t / √ε) but for ε ln ε,
        # t = tanh(y / 2) at the end
        low, high = mp.tanh(mp.mpf("0.25")), mp.tanh(mp.mpf("0.35"))
        root = 4 * mp.sqrt(low * high) * mp.exp(-mp.mpf(distance) / 2)
        path = distance + (mp.cosh(mp.mpf("0.5")) - 1) + (mp.cosh(mp.mpf("0.7")) - 1)
        # |dx/dc| = 2 c/ε, and dc = sinh y dθ; a neighbour comes as far apart as x does, times the sine at the end
        spread = 2 / root**2 * mp.sinh(mp.mpf("0.5")) * mp.tanh(mp.mpf("0.7"))
        spread *= 1 if dimension == 2 else distance * mp.cosh(mp.mpf("0.5"))
    assert abs(ray.optical_path - float(path)) <= ray.error
    assert ray.optical_path == pytest.approx(float(path), rel=1e-13)
    assert ray.spreading == pytest.approx(float(spread), rel=1e-4)
    assert ray.index == 0
    np.testing.assert_allclose(ray.tangents[0][-1], math.tanh(0.5), rtol=1e-12)
    np.testing.assert_allclose(ray.tangents[1][-1], math.tanh(0.7), rtol=1e-12)


def test_a_ray_that_no_direction_leads_along_says_so_and_travels():
    ray = optics.Scene(optics.Stratified(ca.cosh)).rays((0, -0.5), (60, 0.7))[0]
    for asked in (lambda: ray.point(1.0), lambda: ray.conjugate_points, lambda: ray.derivatives, ray.certify):
        with pytest.raises(ArithmeticError, match="cannot be followed"):
            asked()
    again = pickle.loads(pickle.dumps(ray))
    assert (again.optical_path, again.spreading, again.legs) == (ray.optical_path, ray.spreading, ())


def test_where_another_pair_looks_farther_up_nothing_is_left_unresolved():
    """n² = 1 up to a height, and falls linearly above it: a ray that goes up and comes back is too long for one."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 0.215766 * ca.fmax(y - 1.80746, 0))))
    source, ends = (0, 0.13813348520855126), [(4.30564975, 0.117853), (4.30564975, 0.33756128)]
    for end, rays in zip(ends, scene.arrivals(source, ends, within=5.5973466768446475), strict=True):
        assert rays.unresolved == 0
        assert [ray.optical_path for ray in rays] == [pytest.approx(math.dist(source, end), rel=1e-12)]


def test_rays_of_a_fish_eye_that_go_far_out_are_told():
    """From (-0.1, 0.1) past the centre's side to all but the line on: great circles, by stereographic projection."""
    a, b = np.array([-0.11160955842714877, 0.1084432163436751]), np.array([-0.9882909228734448, 0.9600743773399096])
    within = 6 * math.pi
    rays = optics.Scene(optics.fish_eye()).rays(a, b, within=within)
    on_sphere = [np.append(2 * p, p @ p - 1) / (p @ p + 1) for p in (a, b)]
    angle = math.atan2(np.linalg.norm(np.cross(*on_sphere)), np.dot(*on_sphere))
    exact = sorted([angle + 2 * math.pi * k for k in range(3)] + [2 * math.pi * k - angle for k in range(1, 4)])
    assert rays.unresolved == 0
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=1e-13)
    assert [ray.index for ray in rays] == [int(path / math.pi) for path in exact]
    # on the sphere neighbours come apart as |sin|, and lengths in the plane are those of it over n
    spreads = [abs(math.sin(path)) * (1 + b @ b) / 2 for path in exact]
    np.testing.assert_allclose([ray.spreading for ray in rays], spreads, rtol=1e-7)
    with pytest.raises(ArithmeticError, match="cannot be followed"):
        rays[1].point(1.0)


def test_a_corner_of_a_table_is_no_layer_to_rest_along():
    """Beside the least index of a table of lines rays turn in time: what goes over it comes no farther than it does."""
    medium = optics.Tabulated([-1.0, -0.5, 0.0, 1.0], [1.5, 1.4, 1.5, 1.5], smooth=False)
    scene, source = optics.Scene(medium), (0.0, -0.9)
    for end in ((20.0, -0.3), (20.0, -0.8), (40.0, -0.45)):
        rays = scene.rays(source, end)
        assert rays.unresolved == 0
        for ray in rays:
            assert ray.legs
            np.testing.assert_allclose(ray.point(ray.optical_path), end, atol=1e-8)


def test_a_layer_that_is_flat_to_fourth_order_is_no_logarithm():
    """n² = 1 + y⁴: rays come as far as the fourth root of how far off an angle is says, not as its logarithm.

    How the ray to a far point spreads is not told so: it is counted, not given with another's spreading.
    """
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 + y**4)))
    [near] = scene.rays((0, -0.5), (60, 0.7))
    assert near.optical_path == pytest.approx(60 + (0.5**3 + 0.7**3) / 3, rel=1e-5)
    assert near.legs
    far = scene.rays((0, -0.5), (1e6, 0.7))
    assert len(far) == 0
    assert far.unresolved == 1
