"""Rays that get through a surface in narrow windows of directions, layers written as ``Graded``, tables of CasADi's."""

from __future__ import annotations

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import minimize

from varcalc import optics

RODS = {
    "windows of less than 0.003": (
        (1.493, 0.7175, 5.0744, 1.0175, 1.027), (-2.6308, 0.9254), (6.2014, 0.8638), 30.4, 16.0, 9
    ),
    "a window between momenta of 1.6 and -1.4": (
        (1.673, 0.5386, 1.8413, 1.2141, 1.0485), (-1.7196, 0.7239), (4.8111, -0.4401), 22.6, 10.0, 5
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RODS)
def test_rays_through_narrow_windows_of_total_reflection_are_found(name: str) -> None:
    """A rod between two faces: rays are y cos wσ + p/w sin wσ, and get out where p² at the second face is below n²."""
    (axis, fall, length, before, behind), (x, y), (far, high), within, longest, count = RODS[name]

    def ends(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights at the receiver and σ in the rod; not numbers where rays do not get there."""
        start, p, w = y - x * np.tan(angles), before * np.sin(angles), axis * fall
        with np.errstate(all="ignore"):
            sigma = length / np.sqrt(axis**2 * (1 - (fall * start) ** 2) - p**2)
            climb = p * np.cos(w * sigma) - w * start * np.sin(w * sigma)
            last = start * np.cos(w * sigma) + p / w * np.sin(w * sigma)
            return last + (far - length) * climb / np.sqrt(behind**2 - climb**2) - high, sigma

    angles = np.linspace(-1.2, 1.2, 1_000_000)
    off, sigma = ends(angles)
    crossed = np.flatnonzero((off[1:] * off[:-1] < 0) & (np.abs(np.diff(off)) < 0.05))
    rod = optics.Stratified(lambda height: axis * ca.sqrt(1 - (fall * height) ** 2))
    faces = [optics.Plane((0, 0), (1, 0)), optics.Plane((length, 0), (1, 0))]
    scene = optics.Scene([optics.Uniform(before), rod, optics.Uniform(behind)], faces)
    rays = scene.rays((x, y), (far, high), within=within)
    own = np.array([np.arctan2(*ray.tangents[0][::-1]) for ray in rays])
    close = crossed[sigma[crossed] < longest]
    assert len(close) == count
    assert all(np.abs(own - angle).min() < 1e-5 for angle in angles[close])
    assert rays.unresolved == 0


def test_a_graded_index_of_the_height_is_searched_as_layers() -> None:
    """n = 1/√y has rays of all steepness that come to where it is infinite: a fan left cells unresolved."""
    pair = (0.0, 1.0), (1.2, 0.7)
    rays = optics.Scene(optics.Graded(lambda x, y: 1 / ca.sqrt(y))).rays(*pair)
    layers = optics.Scene(optics.Stratified(lambda y: 1 / ca.sqrt(y))).rays(*pair)
    assert rays.unresolved == 0
    assert [ray.optical_path for ray in rays] == [ray.optical_path for ray in layers]


@pytest.mark.parametrize(("axis", "dimension"), [(0, 2), (0, 3), (1, 3), (2, 3)])
def test_a_graded_index_of_any_one_coordinate_is_searched_as_layers(axis: int, dimension: int) -> None:
    """n² = a - b y from a kink at -1 upwards: from y = 0 at the momentum w a ray is back after σ = 4 w / b.

    ∫ n² dσ = (4aw - 8w³/3) / b.
    """
    a, b, sine = 1.5, 0.8, 0.3
    w, p = math.sqrt(a) * sine, math.sqrt(a * (1 - sine**2))

    def index(*place: ca.SX) -> ca.SX:
        return ca.sqrt(a + b - b * ca.fabs(place[axis] + 1))

    ahead = np.roll(np.eye(dimension)[0], axis + 1)
    rays = optics.Scene(optics.Graded(index)).rays(np.zeros(dimension), p * 4 * w / b * ahead, within=4.0)
    own = [ray for ray in rays if abs(ray.tangents[0][axis] - sine) < 1e-12]
    assert [ray.optical_path for ray in own] == pytest.approx([(4 * a * w - 8 * w**3 / 3) / b], rel=1e-13)
    assert [ray.tangents[0] @ ahead for ray in own] == pytest.approx([math.sqrt(1 - sine**2)], rel=1e-13)
    assert rays.unresolved == 0


def test_a_graded_index_of_the_height_keeps_its_parameters() -> None:
    medium = optics.Graded(lambda x, y, z, p: ca.sqrt(1 - 2 * p.fall * ca.tanh(z)), parameters={"fall": 0.3})
    rays = optics.Scene(medium).rays((0, 0, 0), (0.3, 0.1, 0.2))
    step = 1e-6
    paths = [
        optics.Scene(medium.with_parameters({"fall": 0.3 + s})).rays((0, 0, 0), (0.3, 0.1, 0.2)) for s in (-step, step)
    ]
    rate = (paths[1][0].optical_path - paths[0][0].optical_path) / (2 * step)
    assert rays[0].derivatives["fall"] == pytest.approx(rate, rel=1e-7)


@pytest.fixture(name="table")
def fixture_table() -> optics.Stratified:
    heights = np.linspace(-1, 0, 9)
    found = ca.interpolant("n", "bspline", [heights], 1.3 + 0.01 * np.sin(4 * heights))
    return optics.Stratified(found)


def test_rays_end_where_a_table_of_casadi_ends(table: optics.Stratified) -> None:
    """Beyond its knots a spline of CasADi's is 0, and no optical path grows to its limit."""
    bundle = optics.Scene(table).trace((0, -0.5), [(1, 1), (1, 2)], optical_path=20.0)
    assert not np.any(bundle.arrived)


def test_all_rays_of_a_table_of_casadi_are_found_by_quadrature(table: optics.Stratified) -> None:
    scene = optics.Scene(table)
    rays = scene.rays((0, -0.5), (0.4, -0.3))
    assert rays.unresolved == 0
    integrated = scene.trace((0, -0.5), [rays[0].tangents[0]], optical_path=rays[0].optical_path)
    assert integrated.points[0] == pytest.approx((0.4, -0.3), abs=1e-12)
    own = scene.rays((0, -0.5), (0.4, -0.3), model=optics.Invariants())
    assert [ray.optical_path for ray in own] == pytest.approx([ray.optical_path for ray in rays], rel=1e-14)


def test_the_search_of_one_pair_in_space_tells_how_far_it_has_come() -> None:
    ball = optics.Scene([optics.Uniform(1.0)], [optics.Sphere((0, 0, 0), 1.0, mirror=True)])
    told: list[str] = []
    rays = ball.rays((2, 0.3, 0), (1.5, 1.2, 0.4), progress=lambda done, total, what: told.append(what))
    assert len(rays) == 1
    assert any("cells left" in what for what in told)


@pytest.mark.parametrize("up", [(0.6, 0.8), (-0.6, 0.8), (2 / 7, 3 / 7, -6 / 7)])
def test_a_graded_index_of_layers_in_any_direction_is_searched_as_layers(up: tuple[float, ...]) -> None:
    """The same across ``up``, with the kink at a height of -1."""
    a, b, sine = 1.5, 0.8, 0.3
    w, p = math.sqrt(a) * sine, math.sqrt(a * (1 - sine**2))
    dimension, direction = len(up), np.array(up)
    ahead = np.cross([*up, 0][:3], (0, 0, 1))[:dimension]
    ahead = ahead / np.linalg.norm(ahead)

    def index(*place: ca.SX) -> ca.SX:
        height = sum(u * x for u, x in zip(up, place, strict=True))
        return ca.sqrt(a + b - b * ca.fmax(height + 1, -(2 * height + 2) / 2))

    rays = optics.Scene(optics.Graded(index)).rays(np.zeros(dimension), p * 4 * w / b * ahead, within=4.0)
    own = [ray for ray in rays if abs(ray.tangents[0] @ direction - sine) < 1e-12]
    assert [ray.optical_path for ray in own] == pytest.approx([(4 * a * w - 8 * w**3 / 3) / b], rel=1e-13)
    assert [ray.tangents[0] @ ahead for ray in own] == pytest.approx([math.sqrt(1 - sine**2)], rel=1e-13)
    assert rays.unresolved == 0
    assert max(ray.error for ray in rays) < 1e-11


@pytest.mark.parametrize("order", [(0, 1, 0, 1), (1, 0, 1, 0, 1), (0, 1, 2, 0, 1, 2)])
def test_each_order_of_reflections_from_balls_has_its_one_ray(order: tuple[int, ...]) -> None:
    """Between convex mirrors that do not hide each other the length is convex in the points: there is one ray.

    Each reflection narrows the directions that come to it some tenfold.
    """
    middles, radius = np.array([[0.0, 0.0], [4.0, 0.3], [1.7, 4.0]]), 0.8
    source, receiver = np.array([-1.1, 1.9]), np.array([4.9, 2.2])

    def length(angles: np.ndarray) -> float:
        on = middles[list(order)] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return float(np.linalg.norm(np.diff(np.vstack([source, on, receiver]), axis=0), axis=1).sum())

    inward = middles.mean(axis=0) - middles[list(order)]
    best = minimize(length, np.arctan2(inward[:, 1], inward[:, 0]), method="BFGS", options={"gtol": 1e-9})
    mirrors = [optics.Sphere(tuple(middles[k]), radius, mirror=True) for k in order]
    [ray] = optics.Scene(optics.Uniform(1.0), mirrors).rays(source, receiver)
    assert ray.optical_path == pytest.approx(best.fun, rel=1e-12)


@pytest.mark.parametrize(("seed", "reflections"), [(0, 3), (0, 4), (9, 4)])
def test_all_rays_by_several_reflections_inside_an_ellipse(seed: int, reflections: int) -> None:
    """Rays that come past a focus are turned all round within a thousandth of their directions."""
    rng = np.random.default_rng(seed)
    long, source, receiver = rng.uniform(1.5, 3), rng.uniform(-0.6, 0.6, 2), rng.uniform(-0.6, 0.6, 2)
    shape = np.diag([1 / long**2, 1.0])
    angles = np.linspace(0.1, 0.1 + 2 * np.pi, 1_000_001)
    place, ahead = np.tile(source, (len(angles), 1)), np.column_stack([np.cos(angles), np.sin(angles)])
    for _ in range(reflections):
        along, bend = np.sum(place @ shape * ahead, axis=1), np.sum(ahead @ shape * ahead, axis=1)
        rest = np.sum(place @ shape * place, axis=1) - 1
        place = place + ((np.sqrt(along**2 - bend * rest) - along) / bend)[:, None] * ahead
        normal = place @ shape / np.linalg.norm(place @ shape, axis=1)[:, None]
        ahead = ahead - 2 * np.sum(ahead * normal, axis=1)[:, None] * normal
    off = receiver - place
    miss = ahead[:, 0] * off[:, 1] - ahead[:, 1] * off[:, 0]
    met = (miss[1:] * miss[:-1] <= 0) & (np.sum(ahead * off, axis=1)[1:] > 0)
    mirror = optics.Implicit(lambda x, y: (x / long) ** 2 + y**2 - 1, mirror=True)
    rays = optics.Scene(optics.Uniform(1.0), [mirror] * reflections).rays(source, receiver, within=100.0)
    assert len(rays) == np.count_nonzero(met)
    assert rays.unresolved == 0


def test_rays_by_two_balls_in_a_medium_that_bends_them_are_found() -> None:
    """n² = 1 + 0.15 y: rays are parabolas, which meet balls at zeros of quartics; the receiver is put on the last one.

    High arcs come to the second ball within some 1e-5 of the directions.
    """
    rng, pull = np.random.default_rng(1), np.array([0.0, 0.075])
    source, radius = rng.uniform((-4, -1), (-2, 1)), 0.2
    middles = rng.uniform([(-0.4, -1.4), (1.6, 0.6)], [(0.4, -0.6), (2.4, 1.4)])

    def met(place: np.ndarray, momentum: np.ndarray, middle: np.ndarray, constant: float) -> float:
        away = place - middle
        squared = momentum @ momentum + away @ pull
        roots = np.roots(np.array([pull @ pull / 4, momentum @ pull, squared, 2 * momentum @ away, constant]))
        return float(min(roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-9)].real, default=np.inf))

    def last_arc(angle: float) -> tuple[np.ndarray, np.ndarray] | None:
        place = source
        momentum = np.sqrt(1 + 2 * pull[1] * source[1]) * np.array([np.cos(angle), np.sin(angle)])
        for number, middle in enumerate(middles):
            clear = [np.sum((place - m) ** 2) - radius**2 for m in middles]
            if number:
                clear[0] = 0.0
            sigma = [met(place, momentum, m, c) for m, c in zip(middles, clear, strict=True)]
            if not sigma[number] < sigma[1 - number]:
                return None
            place = place + sigma[number] * momentum + sigma[number] ** 2 / 2 * pull
            momentum = momentum + sigma[number] * pull
            normal = (place - middle) / np.linalg.norm(place - middle)
            momentum = momentum - 2 * (momentum @ normal) * normal
        return place, momentum

    angle = next(angle for angle in np.linspace(-np.pi, 0.0, 40_001) if last_arc(angle) is not None)
    place, momentum = last_arc(angle) or (source, pull)
    receiver = place + 0.8 * momentum + 0.32 * pull
    mirrors = [optics.Sphere(tuple(middle), radius, mirror=True) for middle in middles]
    rays = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(1 + 0.15 * y)), mirrors).rays(source, receiver)
    assert min(abs(np.arctan2(*ray.tangents[0][::-1]) - angle) for ray in rays) < 1e-9


def test_the_ray_by_two_convex_mirrors_that_are_no_conics_is_found() -> None:
    """The length is least in the points; within 1e-4 of the directions rays come to the second mirror."""
    middles, sizes = np.array([[1.824, -1.1693], [-1.4029, 0.0512]]), (0.1674, 0.0358)
    source, receiver = np.array([1.1342, 2.0505]), np.array([-0.4469, 2.7416])

    def length(angles: np.ndarray) -> float:
        ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        far = np.array(sizes) / (ahead[:, 0] ** 4 + ahead[:, 1] ** 4 + 0.3 * np.prod(ahead, axis=1) ** 2) ** 0.25
        points = np.vstack([source, middles + far[:, None] * ahead, receiver])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    def mirror(middle: np.ndarray, size: float) -> optics.Implicit:
        def level(x: ca.SX, y: ca.SX) -> ca.SX:
            u, v = (x - middle[0]) / size, (y - middle[1]) / size
            return size * (u**4 + v**4 + 0.3 * (u * v) ** 2 - 1) / 4

        return optics.Implicit(level, mirror=True)

    inward = source + receiver - 2 * middles
    best = minimize(length, np.arctan2(inward[:, 1], inward[:, 0]), method="BFGS", options={"gtol": 1e-9})
    mirrors = [mirror(middle, size) for middle, size in zip(middles, sizes, strict=True)]
    [ray] = optics.Scene(optics.Uniform(1.0), mirrors).rays(source, receiver)
    assert ray.optical_path == pytest.approx(best.fun, rel=1e-10)


def test_rays_through_the_gap_between_two_balls_are_found() -> None:
    """Neighbours are stopped by one of two balls each; through the gap of 0.002 rad one comes to a third behind them.

    It comes back to both; the receiver is put on it.
    """
    rng = np.random.default_rng(6)
    toward = rng.uniform(-0.2, 0.2)
    ahead, up = np.array([np.cos(toward), np.sin(toward)]), np.array([-np.sin(toward), np.cos(toward)])
    behind = (4.0 + rng.uniform(-0.5, 0.5)) * ahead + rng.uniform(-0.09, 0.09) * up
    middles, place, momentum = [behind, 2 * ahead + 0.502 * up, 2 * ahead - 0.502 * up], np.zeros(2), ahead
    for middle in middles:
        off = place - middle
        along = momentum @ off
        place = place - (along + np.sqrt(along**2 - off @ off + 0.25)) * momentum
        momentum = momentum - 8 * (momentum @ (place - middle)) * (place - middle)
    mirrors = [optics.Sphere(tuple(middle), 0.5, mirror=True) for middle in middles]
    rays = optics.Scene(optics.Uniform(1.0), mirrors).rays((0, 0), place + 0.3 * momentum)
    assert min(np.linalg.norm(ray.tangents[0] - ahead) for ray in rays) < 1e-12


def test_rays_that_small_balls_spread_too_much_for_any_angle_to_meet_a_point_are_found() -> None:
    """Parabolas by two balls of 0.03 spread by 4e7: angles as close as numbers are told miss the point by 1e-8.

    In 40 digits each of the eight has a root within round-off of its angle.
    """
    balls = (((1.7741300224422156, -0.5623158666337074), 0.0335), ((0.3651127409176471, -0.8226857552122873), 0.0377))
    source, receiver, pull = (2.2160, -0.8152), (2.8391, -1.6529), mp.mpf("0.075")

    def off(angle: mp.mpf) -> mp.mpf:
        x, y = map(mp.mpf, source)
        size = mp.sqrt(1 + 2 * pull * y)
        p, q = size * mp.cos(angle), size * mp.sin(angle)
        for middle, radius in ((middle, mp.mpf(radius)) for middle, radius in balls):
            u, v = x - middle[0], y - middle[1]
            terms = [pull**2 / 4, q * pull, p**2 + q**2 + v * pull, 2 * (u * p + v * q), u**2 + v**2 - radius**2]
            roots = np.roots([float(term) for term in terms])
            first = min(roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-9)].real)
            s = mp.findroot(lambda at, t=terms: t[4] + at * (t[3] + at * (t[2] + at * (t[1] + at * t[0]))), first)
            x, y, q = x + p * s, y + q * s + pull * s**2 / 2, q + pull * s
            u, v = (x - middle[0]) / radius, (y - middle[1]) / radius
            p, q = p - 2 * (p * u + q * v) * u, q - 2 * (p * u + q * v) * v
        s = (receiver[0] - x) / p
        return y + q * s + pull * s**2 / 2 - receiver[1]

    mirrors = [optics.Sphere(middle, radius, mirror=True) for middle, radius in balls]
    rays = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(1 + 0.15 * y)), mirrors).rays(source, receiver)
    assert (len(rays), rays.unresolved) == (8, 0)
    with mp.workdps(40):
        for ray in rays:
            angle = mp.atan2(*map(mp.mpf, ray.tangents[0][::-1]))
            assert off(angle - mp.mpf(2e-15)) * off(angle + mp.mpf(2e-15)) < 0


@pytest.mark.parametrize("medium", ["parabolas", "table", "rod", "hollow"])
def test_rays_that_come_upright_to_a_mirror_where_they_all_but_rest_are_found(medium: str) -> None:
    """Just below where n² = a + 2 b y + k y² vanishes: rays turn before they come there but for those within 1e-4.

    y'' = b + k y, with the climb y' there as back at y = 0; the receiver is put on one of them.
    """
    dark, a, b, k = {"rod": (2.0, 2.0, 0.0, -0.5), "hollow": (2 / 3, 1.0, -1.0, 0.75)}.get(
        medium, (1.0, 1.0, -0.5, 0.0)
    )
    wall, across = dark * (1 - 1e-8), 2e-5
    climb, left, w = np.sqrt(a - across**2), np.sqrt(a + 2 * b * wall + k * wall**2 - across**2), np.sqrt(abs(k))
    if medium == "rod":
        sigma = np.arcsin(w * wall / climb) / w
    elif medium == "hollow":
        sigma = np.log((left + w * (wall + b / k)) / (climb + w * b / k)) / w
    else:
        sigma = (climb - left) / -b
    index: optics.Medium = optics.Stratified(lambda y: ca.sqrt(a + 2 * b * y + k * y**2))
    if medium == "table":
        heights = np.array([-20.0, -4.0, -1.0, dark - 1e-13])
        index = optics.Tabulated(heights, np.sqrt(a + 2 * b * heights), smooth=False)
    mirror = optics.Plane((0, wall), (0, 1), mirror=True)
    rays = optics.Scene(index, mirror).rays((0, 0), (2 * across * sigma, 0))
    assert min((abs(ray.tangents[0][0] - across / np.sqrt(a)) for ray in rays), default=1.0) < 1e-9
