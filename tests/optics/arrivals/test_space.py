"""All rays in space where no plane is known to hold them, against Fermat's principle and closed forms."""

import re

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar, root

from varcalc import optics
from varcalc.optics.arrivals import space, space_fan
from varcalc.optics.arrivals.directions import SIDE, headings, placed
from varcalc.progress import Interrupted

AIR = optics.Uniform(1.0)
LEVEL = optics.Plane((0, 0, 0), (0, 0, 1))


def test_the_lattice_of_directions():
    rng = np.random.default_rng(1687)
    vectors = rng.normal(size=(200, 3))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    face, place = placed(vectors)
    assert place.min() >= 0
    assert place.max() <= SIDE
    there, rates = headings(face, place)
    np.testing.assert_allclose(there, vectors, rtol=0, atol=1e-14)
    step = SIDE * 1e-5
    for k in (0, 1):
        ahead, behind = (headings(face, place + sign * step * np.eye(2)[k])[0] for sign in (1, -1))
        np.testing.assert_allclose(rates[:, k] * 2 * step, ahead - behind, rtol=0, atol=1e-12)


@pytest.mark.parametrize("radius", [0.45, 0.05, 0.011])
def test_a_ball_mirrors_each_point_once_however_small_it_is(radius):
    """Alhazen's problem for points outside: one ray, whose path is the least over the arc that both points see.

    Where the ball stands between them they see no arc in common.
    """
    scene_of = lambda middle: optics.Scene([AIR, AIR], [optics.Sphere(middle, radius, mirror=True)])  # noqa: E731
    rng, A = np.random.default_rng(965), np.array([-1.5, 0.0, 0.0])
    for _ in range(6):
        middle, B = rng.uniform(-0.4, 0.4, 3), np.array([rng.uniform(1, 1.5), *rng.uniform(-1, 1, 2)])
        to_a, to_b = A - middle, B - middle
        between = np.arccos(to_a @ to_b / np.linalg.norm(to_a) / np.linalg.norm(to_b))
        first = to_a / np.linalg.norm(to_a)
        second = to_b - (to_b @ first) * first
        second /= np.linalg.norm(second)

        def path(turn, first=first, second=second, to_a=to_a, to_b=to_b):
            at = radius * (np.cos(turn) * first + np.sin(turn) * second)
            return np.linalg.norm(at - to_a) + np.linalg.norm(at - to_b)

        horizons = [np.arccos(radius / np.linalg.norm(to)) for to in (to_a, to_b)]
        seen = max(0.0, between - horizons[1]), min(between, horizons[0])
        exact = []
        if seen[0] < seen[1]:
            exact = [minimize_scalar(path, bounds=seen, method="bounded", options={"xatol": 1e-10}).fun]
        rays = scene_of(middle).rays(A, B)
        assert [ray.optical_path for ray in rays] == pytest.approx(exact, abs=1e-12)
        assert rays.unresolved == 0


def test_a_mirror_of_three_axes_about_its_middle():
    """The six rays go by the vertices: 2 a along the points, 2 sqrt(b² + ε²) and 2 sqrt(c² + ε²) across."""
    a, b, c, off = 1.0, 1.3, 1.7, 0.01
    mirror = optics.Implicit(lambda x, y, z: (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1, mirror=True)
    rays = optics.Scene([AIR, AIR], [mirror]).rays((off, 0, 0), (-off, 0, 0))
    exact = np.repeat([2 * a, 2 * np.hypot(b, off), 2 * np.hypot(c, off)], 2)
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=0, atol=1e-12)
    assert rays.unresolved == 0
    assert not rays.continuum


def test_rays_by_a_closed_mirror_are_as_many_as_a_sphere_demands():
    """Paths by points of a closed surface: least ones, saddles and largest ones count 1, -1, 1, together 2 (Morse)."""
    rng = np.random.default_rng(1925)
    for _ in range(12):
        axes = rng.uniform(0.5, 2, 3)
        ends = rng.normal(size=(2, 3))
        ends *= axes * rng.uniform(0, 0.9, (2, 1)) / np.linalg.norm(ends, axis=1)[:, None]
        mirror = optics.Implicit(
            lambda x, y, z, axes=axes: (x / axes[0]) ** 2 + (y / axes[1]) ** 2 + (z / axes[2]) ** 2 - 1, mirror=True
        )
        rays = optics.Scene([AIR, AIR], [mirror]).rays(*ends)
        assert rays.unresolved == 0
        assert sum((-1) ** ray.index for ray in rays) == 2


def test_a_ring_of_rays_is_one_for_infinitely_many():
    """From A by a spherical mirror about the origin to -A: along the axis, 2 R, and by all of the equator."""
    A = np.array([0.3, 0.1, 0.2])
    rays = optics.Scene([AIR, AIR], [optics.Sphere((0, 0, 0), 1.0, mirror=True)]).rays(A, -A)
    assert rays.continuum
    exact = [2.0, 2.0, 2 * np.sqrt(1 + A @ A)]
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=0, atol=1e-12)
    assert [ray.degenerate for ray in rays] == [False, False, True]


@pytest.mark.parametrize("narrow", [4, 16])
def test_rays_about_a_centre_are_those_of_the_plane_when_it_is_not_told(narrow):
    """The same index, once as of a centre, whose passages tell all of its rays, and once of three coordinates."""
    A, B = (-1.0, 0.1, 0.2), (2.4, 0.03, -0.3)
    told = optics.Scene(optics.Radial(lambda r: 1 + 0.6 * ca.exp(-narrow * r**2))).rays(A, B, within=8.0)
    given = optics.Graded(lambda x, y, z: 1 + 0.6 * ca.exp(-narrow * (x**2 + y**2 + z**2)))
    rays = optics.Scene(given).rays(A, B, within=8.0, model=optics.Hamilton())  # which knows of no centre
    assert len(rays) == len(told) == 3
    np.testing.assert_allclose(
        [ray.optical_path for ray in rays], [ray.optical_path for ray in told], rtol=0, atol=1e-11
    )
    assert [ray.index for ray in rays] == [0, 1, 2]
    assert rays.unresolved == 0


def test_a_ball_of_glass_is_met_as_a_surface_and_as_a_jump_of_the_index():
    A, B = (-2.0, 0.1, 0.1), (2.0, 0.2, 0.3)
    lens = optics.Sphere((0, 0, 0), 0.5)
    glass = optics.Scene([AIR, optics.Uniform(1.5), AIR], [lens, lens]).rays(A, B)
    jump = optics.Graded(lambda x, y, z: 1 + 0.5 * ca.if_else(x**2 + y**2 + z**2 < 0.25, 1, 0))
    rays = optics.Scene(jump).rays(A, B)
    np.testing.assert_allclose(rays[0].optical_path, glass[0].optical_path, rtol=0, atol=1e-12)
    assert len(rays) == len(glass) == 1
    assert rays.unresolved == glass.unresolved == 0


@pytest.mark.parametrize("smooth", [True, False])
def test_layers_behind_a_plane_hold_their_rays_in_a_vertical_plane(smooth):
    """Above z = 0 a table, below air: the ray in space is that in the plane through both points."""
    heights = np.linspace(-1, 3, 9)
    table = optics.Tabulated(heights, 1.3 + 0.1 * np.sin(heights), smooth=smooth)
    flat = optics.Scene([AIR, table], [optics.Plane((0, 0), (0, 1))]).rays((0, -1), (np.hypot(1, 0.5), 1))
    rays = optics.Scene([AIR, table], [optics.Plane((0, 0, 0), (0, 0, 1))]).rays((0, 0, -1), (1, 0.5, 1))
    assert len(rays) == len(flat) == 1
    assert rays[0].optical_path == pytest.approx(flat[0].optical_path, abs=1e-11)
    assert rays.unresolved == 0


def test_pairs_of_one_source_are_answered_as_alone():
    lens = optics.Sphere((0.1, 0.0, 0.2), 0.5)
    scene = optics.Scene([AIR, optics.Uniform(1.4), AIR], [lens, lens])
    targets = [(2.0, 0.2, 0.1), (1.0, -0.3, 0.2), (1.5, 0.0, 3.0)]
    together = scene.arrivals((-1.5, 0.1, 0.0), targets)
    alone = [scene.rays((-1.5, 0.1, 0.0), target) for target in targets]
    paths = [[[ray.optical_path for ray in rays] for rays in answers] for answers in (together, alone)]
    assert [len(own) for own in paths[0]] == [len(own) for own in paths[1]]
    for own, other in zip(*paths, strict=True):
        np.testing.assert_allclose(own, other, rtol=0, atol=1e-12)
    assert not any(rays.unresolved for rays in together)


@pytest.mark.parametrize("most", [space.MOST_PARTED_SLOWLY, 1200])
def test_rays_by_a_mirror_of_steep_waves_are_kept_where_cells_are_left(monkeypatch, most):
    """Along the crests a reflected path is straight: paths are hypotenuses of those in the section across them."""
    monkeypatch.setattr(space, "MOST_PARTED_SLOWLY", most)
    height, wave, A, B = 0.1, 11.0, np.array([-0.4, 2.0]), np.array([0.4, 0.4])

    def level(x):
        return height * np.sin(wave * x)

    def slope(x):
        y, rise = level(x), height * wave * np.cos(wave * x)
        return sum((x - p[0] + (y - p[1]) * rise) / np.hypot(x - p[0], y - p[1]) for p in (A, B))

    def clear(x, end):
        share = np.linspace(1e-6, 1, 4001)
        way = np.outer(1 - share, (x, level(x))) + np.outer(share, end)
        return np.all(way[:, 1] > level(way[:, 0]))

    grid = np.linspace(-3, 3, 20001)
    at = np.flatnonzero(np.diff(np.sign(slope(grid))))
    seen = [x for k in at if clear(x := brentq(slope, grid[k], grid[k + 1], xtol=1e-15), A) and clear(x, B)]
    across = [np.hypot(x - A[0], level(x) - A[1]) + np.hypot(x - B[0], level(x) - B[1]) for x in seen]
    mirror = optics.Implicit(lambda x, y, z: z - height * ca.sin(wave * x) + 0 * y, mirror=True)
    rays = optics.Scene(optics.Uniform(1.0), mirror).rays((A[0], 0, A[1]), (B[0], 1.4, B[1]), within=3.2)
    exact = np.sort([path for path in np.hypot(across, 1.4) if path < 3.2])
    assert len(exact) > 4
    assert (rays.unresolved > 0) == (most == 1200)
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=0, atol=1e-12)


ROD = optics.Scene([AIR, optics.Graded(lambda x, y, z: ca.sqrt(2.56 - 0.25 * (x**2 + y**2)))], [LEVEL])
"""A rod behind the plane z = 0."""


def rays_into_the_rod(height, off, depth):
    """Optical paths of the rays from the axis, at a height before the rod, to a place off it at a depth inside.

    At the angle θ a ray comes in at x₀ = h tan θ, and x = x₀ cos wσ + sin θ sin(wσ)/w at z = p_z σ.
    """
    w = 0.5

    def at(theta):
        start, p = height * np.tan(theta), np.sin(theta)
        along = np.sqrt(2.56 - (w * start) ** 2 - p**2)
        sigma = depth / along
        s, c = np.sin(w * sigma), np.cos(w * sigma)
        path = along**2 * sigma + (w * start) ** 2 * (sigma - s * c / w) / 2 + p**2 * (sigma + s * c / w) / 2
        return start * c + p * s / w - off, path - start * p * s**2 + height / np.cos(theta)

    last = brentq(lambda theta: 2.56 - (w * height * np.tan(theta)) ** 2 - np.sin(theta) ** 2, 0, 1.55)
    grid = (last - 1e-12) * np.sin(np.linspace(-np.pi / 2, np.pi / 2, 200001))
    found = np.flatnonzero(np.diff(np.sign(at(grid)[0])))
    return np.sort([at(brentq(lambda t: at(t)[0], *grid[k : k + 2], xtol=1e-15))[1] for k in found])


def test_all_rays_into_a_rod_up_to_an_optical_path():
    exact = rays_into_the_rod(1.0, 0.3, 5.0)
    rays = ROD.rays((0, 0, -1), (0.3, 0, 5), within=12.0)
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact[exact < 12], rtol=0, atol=1e-11)
    assert len(rays) > 2
    assert rays.unresolved == 0


def test_rays_to_and_fro_without_end_are_all_told_up_to_where_cells_are_too_many(monkeypatch):
    monkeypatch.setattr(space, "MOST_PARTED", 3000)
    exact = rays_into_the_rod(1.0, 0.3, 5.0)
    rays = ROD.rays((0, 0, -1), (0.3, 0, 5))
    assert rays.unresolved == 1
    complete = float(re.search("not all of them from ([.0-9]+) on", rays.searched)[1])
    found = np.array([ray.optical_path for ray in rays])
    assert 10 < complete < exact[-1]
    np.testing.assert_allclose(found[found < complete], exact[exact < complete], rtol=0, atol=1e-11)


def test_what_is_known_is_given_back_when_a_search_in_space_is_stopped():
    def stop(done, total, what):
        if "from the optical path 1" in what:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as stopped:
        ROD.rays((0, 0, -1), (0.3, 0, 5), progress=stop)
    known, exact = stopped.value.known, rays_into_the_rod(1.0, 0.3, 5.0)
    assert known.unresolved == 1
    assert known.searched.endswith("stopped before its end")
    assert known[0].optical_path == pytest.approx(exact[0], abs=1e-11)


def test_no_ray_goes_through_a_medium_where_the_index_is_negative():
    """n = 1.6 - 0.08 ρ²: beyond ρ = sqrt(20) only n² is what it is of another medium."""
    scene = optics.Scene([AIR, optics.Graded(lambda x, y, z: 1.6 - 0.08 * (x**2 + y**2))], [LEVEL])
    ends = scene.trace((0, 0, -1), [(1, 0, 0.5), (5, 0, 1), (60, 0, 1)], optical_path=70.0)
    statuses = [optics.RayStatus.ARRIVED, optics.RayStatus.TOTAL_REFLECTION, optics.RayStatus.SINGULAR]
    assert [optics.RayStatus(code) for code in ends.status] == statuses


BALLS = {
    "A": ((0.9, 1.5, 0.0), 0.03, 0.0),
    "B": ((-0.9, -1.5, 0.6), 0.07, 0.0),
    "lens": ((-1.2, 0.2, 0.1), 0.04, 1.5),
    "lens behind": ((1.1, -0.4, 0.3), 0.05, 1.4),
}  # fmt: skip
"""Middles and radii of small balls; the index of those that are no mirrors."""


@pytest.mark.parametrize(
    "order",
    [("A", "B"), ("B", "A", "B"), ("B", "lens behind"), ("lens", "lens behind")],
    ids=" ".join,
)
def test_the_ray_from_one_small_ball_to_the_next_is_found(order: tuple[str, ...]) -> None:
    """At each point on a ball n_k u_k - n_(k+1) u_(k+1) is along the normal: solved for from a polygon by the middles.

    The rays come to some 1e-4 to 1e-6 of the directions. By convex mirrors there is one, since the length is convex in
    the points, and by lenses that are seen from beyond their foci, far off the axis, one as well.
    """
    A, B = np.array([-2, 0.1, 0.3]), np.array([2, -0.2, 0.1])
    surfaces, n, middles, radii, points = [], [1.0], [], [], []
    way = [A, *(np.array(BALLS[name][0]) for name in order), B]
    for before, name, after in zip(way[:-2], order, way[2:], strict=True):
        middle, radius, index = np.array(BALLS[name][0]), *BALLS[name][1:]
        toward = [(end - middle) / np.linalg.norm(end - middle) for end in (before, after)]
        between = (toward[0] + toward[1]) / np.linalg.norm(toward[0] + toward[1])
        for side in [between] if index == 0 else toward:
            surfaces.append(optics.Sphere(tuple(middle), radius, mirror=index == 0))
            points.append(middle + radius * side)
            middles.append(middle)
            radii.append(radius)
        n += [1.0] if index == 0 else [index, 1.0]
    middles, radii, n = np.array(middles), np.array(radii), np.array(n)

    def legs(on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        each = np.diff(np.vstack([A, on, B]), axis=0)
        length = np.linalg.norm(each, axis=1)
        return each / length[:, None], length

    def broken(unknowns: np.ndarray) -> np.ndarray:
        out, pulls = unknowns[: -len(radii)].reshape(-1, 3), unknowns[-len(radii) :]
        ahead, _ = legs(middles + radii[:, None] * out)
        snell = n[:-1, None] * ahead[:-1] - n[1:, None] * ahead[1:] - pulls[:, None] * out
        return np.append(snell.ravel(), np.sum(out**2, axis=1) - 1)

    start = np.append(((np.array(points) - middles) / radii[:, None]).ravel(), -np.ones(len(radii)))
    solved = root(broken, start, tol=1e-14)
    assert np.abs(solved.fun).max() < 1e-12
    exact = n @ legs(middles + radii[:, None] * solved.x[: -len(radii)].reshape(-1, 3))[1]
    rays = optics.Scene(list(map(optics.Uniform, n)), surfaces).rays(A, B)
    assert [ray.optical_path for ray in rays] == pytest.approx([exact], abs=1e-12)
    assert rays.unresolved == 0


def test_no_ray_comes_from_one_ball_to_another_in_its_shadow() -> None:
    balls = [optics.Sphere((0, 0, 0), 0.5, mirror=True), optics.Sphere((1, 0.1, 0), 0.1, mirror=True)]
    rays = optics.Scene(AIR, balls).rays((-2, 0, 0), (0.5, 2, 0))
    assert len(rays) == 0
    assert rays.unresolved == 0


def test_a_ray_by_convex_mirrors_is_known_to_be_the_only_one_where_cells_are_left(monkeypatch) -> None:
    """The length is convex in points of the balls."""
    monkeypatch.setattr(space_fan, "MOST_WINDOWS", 400)
    balls = [optics.Sphere(middle, 0.1, mirror=True) for middle in ((-0.6, 0.1, 0.2), (0.7, 0.8, 0.1))]
    rays = optics.Scene(AIR, balls).rays((-2, 0.1, 0.3), (2, -0.2, 0.1))
    assert len(rays) == 1
    assert rays.unresolved == 0
