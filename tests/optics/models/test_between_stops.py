"""How far rays come through measured tables of many heights, against sums in closed form and integrals of mpmath's."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics.models.passages import RayPassages
from varcalc.optics.models.reduction import Profile
from varcalc.optics.models.tables import TableProfile

DIGITS = 40


def measured(seed, smooth, count=60):
    """A sound channel with noise at heights of very different distances, some next to each other."""
    rng = np.random.default_rng([44, seed])
    steps = rng.choice([2.0, 30.0, 90.0], count) * rng.uniform(0.5, 1.5, count)
    heights = 3400 * np.cumsum(steps) / np.sum(steps) - 3500
    eta = -2 * (heights + 1300) / 1300
    speed = 1500 * (1 + 0.00737 * (eta + np.exp(-eta) - 1)) + rng.normal(0, 0.05, count)
    return optics.Tabulated(heights, 1500 / speed, smooth=smooth)


class Layers:
    """n² of a table in cubics, as it has them, in numbers of many digits."""

    def __init__(self, table):
        self.heights = [mp.mpf(h) for h in table.heights]
        self.cubics = [[mp.mpf(float(value)) for value in row] for row in table.coefficients]

    def squared(self, layer, u):
        s = u - self.heights[layer]
        a, b, c, d = self.cubics[layer]
        return a + s * (b + s * (c + s * d))

    def layer(self, u, way):
        """The one in which a ray goes on from a height."""
        inside = [h <= u if way > 0 else h < u for h in self.heights[1:-1]]
        return sum(inside)

    def turn(self, layer, u, to, C):
        """Where n² first comes down to C on the way; None where it does not."""
        a, b, c, d = self.cubics[layer]
        if d == c == 0:
            places = [self.heights[layer] + (C - a) / b] if b else []
        else:
            near = np.roots([float(d), float(c), float(b), float(a - C)])
            left = lambda s: a - C + s * (b + s * (c + s * d))  # noqa: E731
            places = [self.heights[layer] + mp.findroot(left, mp.mpf(s)) for s in near[np.isreal(near)].real]
        between = [place for place in places if (place - u) * (to - place) > 0]
        return min(between, key=lambda place: abs(place - u)) if between else None

    def gone(self, u, way, C, stop=None):
        """How far per unit of invariant, and on which optical path, a ray comes to ``stop`` or to where it turns."""
        sums = mp.matrix([0, 0])
        while u != stop:
            layer = self.layer(u, way)
            to = self.heights[layer + 1] if way > 0 else self.heights[layer]
            if stop is not None and (to - stop) * way > 0:
                to = stop
            turn = self.turn(layer, u, to, C)
            sums += self.stretch(layer, u, to if turn is None else turn, C)
            if turn is not None:
                return sums if stop is None else None
            if to in (self.heights[0], self.heights[-1]) and to != stop:
                return None
            u = to
        return sums

    def stretch(self, layer, u, to, C):
        """In a layer: by closed form where n² is linear, else with squares from either end."""
        w = [mp.sqrt(max(self.squared(layer, end) - C, mp.mpf(0))) for end in (u, to)]
        if self.cubics[layer][2:] == [0, 0]:
            time = 2 * abs(to - u) / (w[0] + w[1])
            return mp.matrix(
                [time, C * time + mp.mpf(2) / 3 * abs(to - u) * (w[0] + w[1] - w[0] * w[1] / (w[0] + w[1]))]
            )
        half, total = (to - u) / 2, mp.matrix([0, 0])
        for end, way in ((u, half), (to, -half)):
            for power in (0, 1):
                total[power] += abs(way) * mp.quad(
                    lambda t, end=end, way=way, power=power: self.rate(layer, end + way * t**2, C, power) * 2 * t,
                    mp.linspace(0, 1, 9),
                    method="gauss-legendre",
                )
        return total

    def rate(self, layer, u, C, power):
        squared = self.squared(layer, u)
        return squared**power / mp.sqrt(abs(squared - C)) if squared != C else mp.mpf(0)


def passages(table, ends, angles):
    """S, U, D and their optical paths by the library, and in numbers of many digits; not numbers for what leaves."""
    found, _ = RayPassages.between(TableProfile(table), np.array([ends]), np.array([1e6]))
    start, end = (mp.mpf(float(place[0])) for place in (found.start, found.end))
    layers, way, out = Layers(table), int(found.way[0]), []
    for angle in angles:
        C = layers.squared(layers.layer(start, 1), start) * mp.cos(mp.mpf(angle)) ** 2
        parts = layers.gone(start, way, C, end), layers.gone(end, way, C), layers.gone(start, -way, C)
        known = [part if part is not None else mp.matrix([mp.nan, mp.nan]) for part in parts]
        out.append([float(mp.sqrt(C) * part[0]) for part in known] + [float(part[1]) for part in known])
    return found.at(np.zeros(len(angles), dtype=int), np.array(angles)), np.array(out)


@pytest.mark.parametrize("seed", range(4))
def test_rays_of_linear_tables_come_as_far_as_sums_say(seed):
    with mp.workdps(DIGITS):
        found, known = passages(measured(seed, smooth=False), (-1200.0, -700.0), np.linspace(0.01, 1.2, 40))
    np.testing.assert_allclose(found, known, rtol=1e-11)


@pytest.mark.parametrize("seed", range(2))
def test_rays_of_splines_come_as_far_as_integrals_say(seed):
    with mp.workdps(DIGITS):
        found, known = passages(measured(seed, smooth=True, count=30), (-2900.0, -2700.0), [0.02, 0.2])
    np.testing.assert_allclose(found, known, rtol=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_every_turn_of_a_spline_is_a_node(seed):
    # between heights next to each other a cubic may fall and rise again with the same slopes at both
    table = measured(seed, smooth=True)
    profile = TableProfile(table)
    heights = np.array(table.heights)
    nodes = profile.nodes(-1200.0, -700.0, heights[0], heights[-1]).u
    for low, thick, (_, b, c, d) in zip(heights[:-1], np.diff(heights), table.coefficients, strict=True):
        roots = np.roots([3 * d, 2 * c, b])
        for turn in roots[np.isreal(roots)].real:
            if 1e-6 * thick < turn < thick * (1 - 1e-6):
                assert np.abs(nodes - (low + turn)).min() < 1e-9 * thick


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_rays_through_measured_tables_arrive(seed, smooth):
    table = measured(seed, smooth)
    scene, a, b = optics.Scene(table), (0.0, -1200.0), (1e4, -700.0)
    rays = scene.rays(a, b)
    assert len(rays) > 0
    for ray in rays:
        end = scene.trace(a, ray.tangents[0], optical_path=ray.optical_path)
        np.testing.assert_allclose(end.points[0], b, atol=1e-9 * 1e4)


@pytest.mark.parametrize("seed", range(6))
def test_rays_turn_back_beside_a_kink_as_closed_forms_say(seed):
    # level rays from within a hair of the kink to a whole layer from it; what is written by fabs has no knots
    rng = np.random.default_rng([45, seed])
    place, fall = rng.uniform(-1, 1), rng.uniform(0.05, 0.8)
    medium = optics.Stratified(lambda y: ca.sqrt(1.5 - fall * ca.fabs(y - place)))
    far = np.array([place - 1 / fall, place, place + 1 / fall])
    table = optics.Tabulated(far, np.sqrt(1.5 - fall * np.abs(far - place)), smooth=False)
    ends = place + 10.0 ** rng.uniform(-9, -1, 2) * rng.choice([-1.0, 1.0], 2)
    angles = np.array([1e-9, 1e-6, 1e-3, 0.1, 0.5])
    found = RayPassages.between(Profile(medium, 1.0, place), ends[None], np.array([20.0]))[0]
    with mp.workdps(DIGITS):
        known = passages(table, tuple(ends), angles)[1]
    np.testing.assert_allclose(found.at(np.zeros(len(angles), dtype=int), angles), known, rtol=1e-9, atol=1e-13)
