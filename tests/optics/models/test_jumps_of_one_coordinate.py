"""All rays through an index that is constant in shells or layers, against Bouguer's and Snell's laws in closed form."""

import itertools

import casadi as ca
import numpy as np
import pytest

from varcalc import optics

ANGLES, BISECTIONS = 400, 60


def stepped(edges, index):
    """The index as a function of the coordinate."""

    def n(u):
        value = index[-1]
        for edge, below in zip(edges[::-1], index[-2::-1], strict=True):
            value = ca.if_else(u < edge, below, value)
        return value

    return n


class Layers:
    """How far along, and on which optical path, rays of the invariant c go between two heights of one layer."""

    lowest = -np.inf

    def least(self, n, c):
        return -np.inf

    def size(self, n, u):
        return n

    def between(self, n, c, u, v):
        height, speed = abs(v - u), np.sqrt(n**2 - c**2)
        return np.array([c * height / speed, n**2 * height / speed])


class Shells:
    """The same about a centre, with angles for lengths."""

    lowest = 0.0

    def least(self, n, c):
        return c / n

    def size(self, n, u):
        return n * u

    def between(self, n, c, u, v):
        nearest = c / n
        chords = [np.sqrt((r - nearest) * (r + nearest)) for r in (min(u, v), max(u, v))]
        angles = np.arctan2(chords, nearest)
        return np.array([angles[1] - angles[0], n * (chords[1] - chords[0])])


def passages(kind, edges, index, ends, c, way, within):
    """What a ray has come along, and its optical path, whenever it comes to the second height."""
    walls, (u, there), out, sums = np.array([kind.lowest, *edges, np.inf]), ends, [], np.zeros(2)
    k = np.searchsorted(edges, u)
    while sums[1] <= within:
        turn = kind.least(index[k], c)
        to = walls[k + 1] if way > 0 else max(walls[k], turn)
        if min(u, to) <= there <= max(u, to) and there != u:
            out.append(sums + kind.between(index[k], c, u, there))
        if np.isinf(to):
            break
        sums, u = sums + kind.between(index[k], c, u, to), to
        if (way < 0 and turn == to) or c >= kind.size(index[k + way], u):
            way = -way
        else:
            k += way
    return out


def all_rays(kind, edges, index, ends, distances, within):
    """The optical paths of the rays that come as far as is asked for, between the invariants at which rays part."""
    home = index[np.searchsorted(edges, ends[0])]
    most = kind.size(home, ends[0])
    parts = [kind.size(n, edge) for k, edge in enumerate(edges) for n in index[k : k + 2]]
    parts = np.unique([0.0, most, *(c for c in parts if c < most)])
    found = []
    for way in (-1, 1):
        for low, high in itertools.pairwise(parts):
            share = (1 - np.cos(np.pi * np.linspace(0, 1, ANGLES))) / 2
            cs = low + (high - low) * (1e-11 + (1 - 2e-11) * share)
            came = [passages(kind, edges, index, ends, c, way, within) for c in cs]
            for k, distance in [(k, d) for k in range(max(map(len, came))) for d in distances]:
                off = np.array([own[k][0] - distance if len(own) > k else np.nan for own in came])
                for j in np.flatnonzero(off[1:] * off[:-1] < 0):
                    a, b = cs[j], cs[j + 1]
                    for _ in range(BISECTIONS):
                        own = passages(kind, edges, index, ends, (a + b) / 2, way, within)[k:]
                        a, b = ((a + b) / 2, b) if own and (own[0][0] - distance) * off[j] > 0 else (a, (a + b) / 2)
                    if own and abs(own[0][0] - distance) < 1e-8 and own[0][1] <= within:
                        found.append(own[0][1])
    return np.sort(found)


def chords(edges, index, radius, c, way, path):
    """How many conjugate points a ray through shells passes in its plane, and what angle it turns through.

    With t = ±sqrt((n r)² - c²), the optical path along a chord of index n, the angle to a radius changes with c by
    D + 1/t₀ - 1/t, and neighbours are as far away as t times that: where it is zero they meet.
    """
    walls, k = np.array([0.0, *edges, np.inf]), int(np.searchsorted(edges, radius))
    t, known, count, angle = way * np.sqrt((index[k] * radius) ** 2 - c**2), 0.0, 0, 0.0
    begun, thrown_back = False, 0
    while True:
        inwards = t < 0 and index[k] * walls[k] > c
        wall, following = (walls[k], k - 1) if inwards else (walls[k + 1], k + 1)
        end = (-1 if inwards else 1) * np.sqrt((index[k] * wall) ** 2 - c**2)
        stop = min(end, t + path)
        rate = known + 1 / t
        count += begun and (t * rate - 1) * (stop * rate - 1) < 0
        angle += np.arctan2(stop, c) - np.arctan2(t, c)
        path -= stop - t
        if stop < end:
            return count, angle, thrown_back
        known, begun = rate - 1 / end, True
        if index[following] * wall > c:
            t, k = np.sign(end) * np.sqrt((index[following] * wall) ** 2 - c**2), following
        else:
            t, thrown_back = -end, thrown_back + 1


def drawn(seed, low):
    """Edges, the index between them, two heights, how far apart they are, and an optical path."""
    rng = np.random.default_rng([19, seed])
    edges = np.sort(rng.uniform(low, 1.0, 1 + seed % 3))
    return edges, rng.uniform(1, 2, len(edges) + 1), rng.uniform(low, 1.2, 2), rng.uniform(0.4, 3.0)


@pytest.mark.parametrize("seed", range(8))
def test_all_rays_about_a_centre_with_jumps_are_found(seed):
    edges, index, radii, angle = drawn(seed, 0.25)
    a, b = (radii[0], 0.0), (radii[1] * np.cos(angle), radii[1] * np.sin(angle))
    rays = optics.Scene(optics.Radial(stepped(edges, index))).rays(a, b, within=5.0)
    around = [angle, 2 * np.pi - angle, 2 * np.pi + angle, 4 * np.pi - angle, 4 * np.pi + angle]
    known = all_rays(Shells(), edges, index, radii, around, 5.0)
    assert rays.unresolved == 0
    np.testing.assert_allclose([ray.optical_path for ray in rays], known, rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("dimension", [2, 3])
def test_all_rays_of_layers_with_jumps_are_found(seed, dimension):
    edges, index, heights, distance = drawn(seed, -1.0)
    flat = np.array([distance]) if dimension == 2 else distance * np.array([0.6, 0.8])
    a, b = np.append(0 * flat, heights[0]), np.append(flat, heights[1])
    within = 4.0 * np.linalg.norm(b - a)
    rays = optics.Scene(optics.Stratified(stepped(edges, index))).rays(a, b, within=within)
    known = all_rays(Layers(), edges, index, heights, [distance], within)
    assert rays.unresolved == 0
    np.testing.assert_allclose([ray.optical_path for ray in rays], known, rtol=1e-12)


@pytest.mark.parametrize("impact", [0.02, 0.1, 0.3, 0.45])
def test_a_ray_through_a_core_is_refracted_at_its_rim(impact):
    core, n, start, path = 0.5, 1.6, 1.3, 4.0
    scene = optics.Scene(optics.Radial(lambda r: ca.if_else(r < core, n, 1.0)))
    heading = (-np.sqrt(1 - (impact / start) ** 2), impact / start)
    bundle = scene.trace((start, 0), heading, optical_path=path)
    outside, inside = (np.sqrt(r**2 - impact**2) for r in (start, core))
    beyond = path - (outside - inside) - 2 * n * np.sqrt(core**2 - (impact / n) ** 2)  # behind the core
    last = np.hypot(impact, inside + beyond)
    at = [np.arccos(impact / r) for r in (start, core, n * core, last)]
    angle = (at[0] - at[1]) + 2 * at[2] + (at[3] - at[1])
    assert bundle.arrived.all()
    np.testing.assert_allclose(bundle.points[0], last * np.array([np.cos(angle), np.sin(angle)]), atol=1e-14)


@pytest.mark.parametrize("rim", [0.2, 0.46])
def test_a_formula_that_is_no_number_beyond_its_jump_is_told_as_well_from_beyond(rim):
    # rays can be gone along backwards, and seen from the far point the root inside the rim is no number
    lens = optics.Scene(optics.Radial(lambda r: ca.if_else(r < 1, ca.sqrt(2 + rim - r**2), 1.0)))
    near, far = (-0.21, 1.07), (1.4, -1.5)
    there, back = lens.rays(near, far, within=11.0), lens.rays(far, near, within=11.0)
    assert there.unresolved == back.unresolved == 0
    np.testing.assert_allclose([r.optical_path for r in there], [r.optical_path for r in back], rtol=1e-12)


def test_layers_told_beside_the_angle_at_which_they_open_are_resolved():
    # round-off decides on which side of the jump a ray is that all but grazes the layer behind it
    edges, index = [-0.9956, -0.8445, -0.536], [1.15, 1.857, 1.3963, 1.866]
    rays = optics.Scene(optics.Stratified(stepped(edges, index))).rays((0, 0.878), (2.0, -0.2063), within=5.0)
    known = all_rays(Layers(), edges, index, (0.878, -0.2063), [2.0], 5.0)
    assert rays.unresolved == 0
    np.testing.assert_allclose([ray.optical_path for ray in rays], known, rtol=1e-12)


@pytest.mark.parametrize("seed", [13, 14, 16, 19])
@pytest.mark.parametrize("dimension", [2, 3])
def test_conjugate_points_of_rays_in_shells_are_those_between_their_chords(seed, dimension):
    edges, index, (start, there), angle = drawn(seed, 0.25)
    across, thrown_back = np.array([1.0]) if dimension == 2 else np.array([0.6, 0.8]), 0
    a = np.append(start, 0 * across)
    b = there * np.append(np.cos(angle), np.sin(angle) * across)
    for ray in optics.Scene(optics.Radial(stepped(edges, index))).rays(a, b, within=5.0):
        up = ray.tangents[0][0]
        c = index[np.searchsorted(edges, start)] * start * np.sqrt(1 - up**2)
        count, turned, back = chords(edges, index, start, c, np.sign(up), ray.optical_path)
        # every half turn about the centre neighbours of other planes meet
        assert ray.index == count + (int(turned / np.pi) if dimension == 3 else 0)
        assert len(ray.conjugate_points) == ray.index
        thrown_back += back
    assert thrown_back > 0 or seed == 16


@pytest.mark.parametrize("dimension", [2, 3])
def test_neighbours_never_meet_in_layers_of_constant_index(dimension):
    # how far a ray comes grows with its invariant on every stretch, also behind a total reflection
    for seed in (10, 19, 23):
        edges, index, heights, distance = drawn(seed, -1.0)
        flat = np.array([distance]) if dimension == 2 else distance * np.array([0.6, 0.8])
        scene = optics.Scene(optics.Stratified(stepped(edges, index)))
        rays = scene.rays(np.append(0 * flat, heights[0]), np.append(flat, heights[1]), within=6.0)
        assert [ray.index for ray in rays] == [0] * len(rays)
        assert all(len(ray.conjugate_points) == 0 for ray in rays)


@pytest.mark.parametrize("seed", [3, 5, 8, 19])
def test_a_ray_that_is_thrown_back_has_as_many_conjugate_points_backwards(seed):
    # the index is that of the second variation, which knows no direction
    rng = np.random.default_rng([5, seed])
    count, about_centre = 1 + rng.integers(3), seed % 2 == 0
    edges = np.sort(rng.uniform(0.25 if about_centre else -1.0, 1.0, count))
    index, slopes = rng.uniform(1, 2, count + 1), rng.uniform(-0.4, 0.4, count + 1)

    def n(u):
        value = index[-1] + slopes[-1] * (u - edges[-1]) / (1 + (u - edges[-1]) ** 2)
        for edge, least, slope in reversed(list(zip(edges, index, slopes, strict=False))):
            value = ca.if_else(u < edge, least + slope * (u - edge) / (1 + (u - edge) ** 2), value)
        return value

    ends, distance = rng.uniform(0.25 if about_centre else -1.0, 1.2, 2), rng.uniform(0.4, 3)
    a, b = np.array([0.0, ends[0]]), np.array([distance, ends[1]])
    if about_centre:
        a, b = (r * np.array([np.cos(p), np.sin(p)]) for r, p in zip(ends, (0.0, distance), strict=True))
    scene = optics.Scene(optics.Radial(n) if about_centre else optics.Stratified(n))
    there, back = scene.rays(a, b, within=6.0), scene.rays(b, a, within=6.0)
    size_a, size_b = (float(scene.media[0].index(ca.DM(end))) for end in (a, b))
    assert len(there) == len(back) > 0
    for one, other in zip(there, back, strict=True):
        assert one.index == other.index == len(one.conjugate_points) == len(other.conjugate_points)
        assert one.spreading / size_a == pytest.approx(other.spreading / size_b, rel=1e-9)


def heights_in_rod(slope, n, bend, cladding, start, far):
    """Where rays of a slope come in a rod of n²(1 - bend² y²), by sines; at |y| = 1 reflected totally, or gone."""
    g = n**2 * (1 - (bend * start) ** 2)
    theta = np.arctan(slope)
    c, w, rate = np.sqrt(g) * np.cos(theta), np.sqrt(g) * np.sin(theta), bend * n
    reach = np.hypot(start, w / rate)
    phase = np.arctan2(rate * start, w) + rate * far / c
    inside = reach * np.sin(phase)
    edge = np.arcsin(1 / np.maximum(reach, 1.0))
    rising = np.where(w >= 0, 1, -1)
    # totally reflected rays go to and fro between the phases of both edges
    gone = np.mod(np.arcsin(start / reach) + rising * rate * far / c + edge, 4 * edge)
    folded = reach * np.sin(np.where(gone < 2 * edge, gone - edge, 3 * edge - gone))
    return np.where(reach <= 1, inside, np.where(c > cladding, folded, np.inf))


@pytest.mark.parametrize(
    ("n", "bend", "cladding", "start", "end"),
    [
        (1.43, 0.28, 1.25, 0.434, (9.53, -0.845)),
        (1.77, 0.41, 1.57, -0.235, (23.9, -0.618)),
        (1.74, 0.27, 2.07, -0.029, (4.59, -0.939)),
        (1.73, 0.61, 1.24, -0.406, (16.08, -0.793)),
    ],
)
def test_both_edges_of_a_rod_are_met_by_the_same_rays(n, bend, cladding, start, end):
    # what is told to round-off is no window between the two, in which rays would pass one edge alone
    def index(y):
        return ca.if_else(ca.fabs(y) < 1, n * ca.sqrt(ca.fmax(1 - bend**2 * y**2, 1e-3)), cladding)

    slopes = np.tan(np.linspace(-1.5, 1.5, 200_001))
    off = heights_in_rod(slopes, n, bend, cladding, start, end[0]) - end[1]
    near = np.abs(off) < 0.5  # folds are steep, but continuous
    expected = np.flatnonzero((off[:-1] * off[1:] < 0) & near[:-1] & near[1:])
    rays = optics.Scene(optics.Stratified(index)).rays((0, start), end, within=2.5 * n * end[0])
    assert rays.unresolved == 0
    found = np.sort([ray.tangents[0][1] / ray.tangents[0][0] for ray in rays])
    assert len(found) == len(expected) > 0
    assert np.all((slopes[expected] <= found) & (found <= slopes[expected + 1]))
