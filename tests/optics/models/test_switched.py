"""Kinks and jumps of the index inside one medium, against broken straight lines, arcs and images."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics.models.equations import RayStops
from varcalc.optics.models.switched import SwitchedFlow

MEDIA = {
    "layers": optics.Stratified,
    "graded": lambda n: optics.Graded(lambda x, y: n(y)),
}


def bowl(a, b):
    return lambda y: ca.sqrt(a - b * ca.fabs(y))


@pytest.mark.parametrize("kind", MEDIA)
def test_a_ray_over_a_kink_is_made_of_parabolas(kind):
    a, b, theta, sigma = 1.5, 0.8, 0.3, 7.0
    scene = optics.Scene(MEDIA[kind](bowl(a, b)))
    px, py = np.sqrt(a) * np.array([np.cos(theta), np.sin(theta)])
    # from y = 0 upwards and back takes σ = 4 py/b; then the same below: y = py s - b s²/4
    arch = 4 * py / b
    turns, rest = divmod(sigma, arch)
    y = (-1) ** turns * (py * rest - b * rest**2 / 4)
    whole = a * arch - b * (py * arch**2 / 2 - b * arch**3 / 12)
    path = turns * whole + a * rest - b * (py * rest**2 / 2 - b * rest**3 / 12)
    bundle = scene.trace((0, 0), (px, py), optical_path=path, model=optics.Hamilton())
    np.testing.assert_allclose(bundle.points[0], [px * sigma, y], atol=2e-13)
    assert bundle.status[0] == optics.RayStatus.ARRIVED


@pytest.mark.parametrize("kind", MEDIA)
@pytest.mark.parametrize("angle", [-0.3, -0.7, -1.2, 0.4])
def test_a_jump_refracts_and_reflects_as_a_surface_does(kind, angle):
    thick, thin = 1.5, 1.0
    heading = np.array([np.cos(angle), np.sin(angle)])
    scene = optics.Scene(MEDIA[kind](lambda y: ca.if_else(y > 0, thick, thin)))
    bundle = scene.trace((0, 1), heading, optical_path=9.0)
    first = -1 / heading[1] if heading[1] < 0 else np.inf
    if thick * first > 9:
        end, last = np.array([0, 1]) + heading * 9 / thick, heading
    else:
        along = thick * heading[0] / thin
        total = along > 1
        last = np.array([heading[0], -heading[1]]) if total else np.array([along, -np.sqrt(1 - along**2)])
        end = np.array([first * heading[0], 0]) + last * (9 - thick * first) / (thick if total else thin)
    np.testing.assert_allclose(bundle.points[0], end, atol=1e-13)
    np.testing.assert_allclose(bundle.directions[0], last, atol=1e-14)


def test_neighbours_go_through_kinks_and_jumps_with_their_ray():
    # a lens with an edge and a cusp inside: no layers, no centre
    lens = optics.Graded(
        lambda x, y: ca.if_else(x**2 + 2 * y**2 < 1, 1.4 - 0.2 * ca.fabs(x - 0.3 * y), 1 + 0.05 * ca.sin(x + y))
    )
    scene = optics.Scene(lens)
    angles, step = np.linspace(-0.35, 0.35, 9), 1e-5
    fan = lambda turn: np.column_stack([np.cos(angles + turn), np.sin(angles + turn)])  # noqa: E731
    middle = scene.trace((-2, 0), fan(0), optical_path=5.0, with_spreading=True)
    sides = [scene.trace((-2, 0), fan(way * step), optical_path=5.0).points for way in (-1, 1)]
    across = np.column_stack([-middle.directions[:, 1], middle.directions[:, 0]])
    moved = np.abs(np.sum((sides[1] - sides[0]) / (2 * step) * across, axis=1))
    assert np.ptp(moved) > 1  # some are gathered, others spread
    np.testing.assert_allclose(middle.spreading, moved, rtol=1e-7)


@pytest.mark.parametrize("kind", MEDIA)
def test_a_ray_that_is_totally_reflected_is_found_beside_the_straight_one(kind):
    scene = optics.Scene(MEDIA[kind](lambda y: ca.if_else(y > 0, 1.5, 1.0)))
    rays = scene.rays((0, 1), (3, 0.5))
    np.testing.assert_allclose([ray.optical_path for ray in rays], 1.5 * np.hypot(3, [0.5, 1.5]), rtol=1e-14)
    assert rays.unresolved == 0
    # closer, the reflected one would be too steep; there is the straight one
    assert len(scene.rays((0, 1), (1, 0.5))) == 1
    # and what is refracted comes to the other side, once
    (through,) = scene.rays((0, 1), (1, -1))
    x = 1 / through.tangents[0][1] * -through.tangents[0][0]
    np.testing.assert_allclose(through.optical_path, 1.5 * np.hypot(x, 1) + np.hypot(1 - x, 1), rtol=1e-14)
    np.testing.assert_allclose(1.5 * through.tangents[0][0], through.tangents[1][0], rtol=1e-13)


def test_rays_of_a_step_index_guide_are_those_of_its_images():
    half, core, within = 0.2, 1.5, 2.6
    scene = optics.Scene(optics.Stratified(lambda y: ca.if_else(ca.fabs(y) < half, core, 1.0)))
    a, b = np.array([0.0, 0.1]), np.array([1.6, -0.05])
    rays = scene.rays(a, b, within=within)
    # images of the receiver in both walls; what is steeper than the critical angle leaves the core
    heights = [2 * half * k + (-1) ** k * b[1] - a[1] for k in range(-9, 10)]
    paths = [core * np.hypot(b[0], h) for h in heights if b[0] / np.hypot(b[0], h) > 1 / core]
    paths = np.sort([path for path in paths if path <= within])
    assert len(paths) > 3
    np.testing.assert_allclose([ray.optical_path for ray in rays], paths, rtol=1e-13)
    assert rays.unresolved == 0


def test_layers_that_jump_are_no_matter_of_quadrature_and_continuous_ones_are():
    jump = optics.Stratified(lambda y: ca.if_else(y > 0, 1.5, 1.0))
    with pytest.raises(optics.DoesNotApply, match="without jumps"):
        optics.Scene(jump).trace((0, 1), (1, -1), optical_path=1.0, model=optics.Invariants())
    # a comparison that leaves the index continuous is a kink
    bent = optics.Scene(optics.Stratified(lambda y: ca.sqrt(ca.if_else(y > 1, 1 - 0.5 * (y - 1), 1.0))))
    assert {ray.model for ray in bent.rays((0, 0), (4, 0))} == {"invariants and quadrature"}


def test_kinks_in_a_graded_medium_have_the_rays_of_layers():
    n = bowl(1.5, 0.8)
    a, b = (0, 0.3), (2, -0.2)
    layers, graded = (optics.Scene(MEDIA[kind](n)).rays(a, b, within=4) for kind in MEDIA)
    assert layers.unresolved == graded.unresolved == 0
    assert len(layers) == len(graded) == 3
    for one, other in zip(layers, graded, strict=True):
        assert one.index == other.index
        np.testing.assert_allclose(one.optical_path, other.optical_path, rtol=1e-13)
        s = np.linspace(0.1, 0.9, 3) * one.optical_path
        np.testing.assert_allclose(one.point(s), other.point(s), atol=1e-11)


def test_the_end_of_a_ray_through_a_kink_is_at_its_optical_path():
    """What is left of it when it is followed anew is within its error, and was refused as beyond its end."""
    index = lambda x, y: ca.sqrt(1 - 0.58 * ca.fmax(0, y - 0.55 + 0.1 * x))  # noqa: E731
    end = (2.9, 0.1)
    rays = optics.Scene(optics.Graded(index)).rays((0, 0), end, within=11.0)
    assert len(rays) == 2
    for ray in rays:
        np.testing.assert_allclose(ray.point(ray.optical_path), end, rtol=0, atol=1e-8)
        np.testing.assert_allclose(ray.point([0.0, ray.optical_path])[1], end, rtol=0, atol=1e-8)
        with pytest.raises(ValueError, match="must lie between"):
            ray.point(ray.optical_path * (1 + 1e-6))


def through_stairs(start, direction, path, index):
    """Where a ray is at an optical path if n is ``index(k)`` between x = k and k + 1, and how many steps it crossed."""
    x, y = start
    along = index(0) * direction[1] / np.hypot(*direction)  # Snell: what is kept of the momentum
    for k in range(10_000):
        n = index(k)
        across = np.sqrt(n**2 - along**2)
        if path * across / n**2 <= k + 1 - x:
            return np.array([x + path * across / n**2, y + path * along / n**2]), k
        path -= (k + 1 - x) * n**2 / across
        x, y = k + 1, y + (k + 1 - x) * along / across
    raise AssertionError


def test_an_index_of_many_steps_is_compiled_once_and_has_the_rays_of_its_layers():
    scene = optics.Scene(optics.Graded(lambda x, y: 1.5 + 0.01 * ca.floor(x)))
    starts, directions = np.array([(0.5, 0.0), (0.3, 0.1)]), np.array([(1.0, 1.0), (1.0, 0.2)])
    bundle = scene.trace(starts, directions, optical_path=60.0)
    for k in range(2):
        there, crossed = through_stairs(starts[k], directions[k], 60.0, lambda step: 1.5 + 0.01 * step)
        assert crossed > 20
        np.testing.assert_allclose(bundle.points[k], there, rtol=1e-13)
    flow = SwitchedFlow(
        optics.Graded(lambda x, y: 1.5 + 0.01 * ca.floor(x)), 2, 0, RayStops(lambda state, _, __: state[4] - 60.0, 1, 0)
    )
    flow.ensemble(np.array([[0.5, 0.0, 1.2, 0.9, 0.0]]), np.empty((1, 0)))
    assert len(flow._regions) > 20
    assert len({id(region.flow) for region in flow._regions.values()}) == 1
    assert len({id(region.field._call) for region in flow._regions.values()}) == 1


def test_tables_are_compiled_for_few_of_their_pieces_and_rays_go_from_one_to_the_next():
    heights = np.array([-1.5, -0.83, -0.41, -0.17, 0.22, 0.37, 0.71, 1.5])
    squared = np.array([1.93, 2.11, 2.03, 2.31, 2.17, 2.43, 2.29, 2.57])

    def index(x, y):
        return ca.sqrt(np.interp(y + 0.37 * x, heights, squared))

    flow = SwitchedFlow(optics.Graded(index), 2, 0, RayStops(lambda state, _, __: state[4] - 2.5, 1, 0))
    start, angle = np.array([-2.0, 0.1]), 0.9
    n = np.sqrt(np.interp(start[1] + 0.37 * start[0], heights, squared))
    p, across = n * np.array([np.cos(angle), np.sin(angle)]), np.array([0.37, 1.0])
    landing = flow.ensemble(np.array([[*start, *p, 0.0]]), np.empty((1, 0)))
    # between two knots ∇n² is constant, and a ray a parabola: from knot to knot, by its height u = y + 0.37 x
    r, path = start, 0.0
    for _ in range(20):
        u, rise = r @ across, p @ across
        k = int(np.clip(np.searchsorted(heights, u + 1e-12 * rise) - 1, 0, 6))
        pull = np.diff(squared)[k] / np.diff(heights)[k] * across / 2
        ways = [np.roots([pull @ across / 2, rise, u - edge]) for edge in heights[k : k + 2]]
        ahead = [float(t.real) for t in np.concatenate(ways) if abs(t.imag) < 1e-12 and t.real > 1e-9]
        cubic = [pull @ pull / 3, pull @ p, np.interp(u, heights, squared), path - 2.5]
        last = [float(t.real) for t in np.roots(cubic) if abs(t.imag) < 1e-12 and t.real > 0]
        t = min([*ahead, *last])
        path += np.polyval([*cubic[:3], 0.0], t)
        r, p = r + p * t + pull * t**2 / 2, p + pull * t
        if t in last:
            break
    np.testing.assert_allclose(landing.states[0, :2], r, rtol=1e-12)
    assert len(flow._regions) > 5
    assert len({id(region.flow) for region in flow._regions.values()}) <= 3


def test_a_step_that_a_whole_number_takes_away_has_no_end():
    # between x = 0 and 1 the second step does not depend on y, elsewhere it does
    scene = optics.Scene(optics.Graded(lambda x, y: 1.5 + 0.1 * ca.floor(0.4 * y * ca.floor(x))))
    bundle = scene.trace([(0.2, 2.4), (0.2, 2.6)], [(1.0, 0.0), (1.0, 0.0)], optical_path=3.0)
    # beyond x = 1 it is floor(0.96) = 0 and floor(1.04) = 1 until x = 2; there floor(1.92) = 1 and floor(2.08) = 2
    n = np.array([[1.5, 1.5, 1.6], [1.5, 1.6, 1.7]])
    x = 2 + (3.0 - 0.8 * n[:, 0] - n[:, 1]) / n[:, 2]
    np.testing.assert_allclose(bundle.points, np.column_stack([x, [2.4, 2.6]]), rtol=1e-14)


def test_whole_numbers_that_a_sine_touches_hold_no_ray_up():
    """n is 1.5 where sin x is positive and 1.3 where it is not; at 1 and -1 the sine touches other whole numbers."""
    scene = optics.Scene(optics.Graded(lambda x, y: 1.5 + 0.2 * ca.floor(ca.sin(x))))
    rng = np.random.default_rng(1)
    start, angle = rng.uniform(0.2, 0.4, 200), rng.uniform(-0.6, 0.6, 200)
    bundle = scene.trace(
        np.column_stack([start, 0 * start]), np.column_stack([np.cos(angle), np.sin(angle)]), optical_path=40.0,
        model=optics.Hamilton(),
    )  # fmt: skip
    assert np.all(bundle.arrived)
    for x, theta, there in zip(start, angle, bundle.points, strict=True):
        direction = (np.cos(theta) / np.pi, np.sin(theta) / np.pi)
        ahead, _ = through_stairs((x / np.pi, 0.0), direction, 40.0 / np.pi, lambda step: (1.5, 1.3)[step % 2])
        np.testing.assert_allclose(there, np.pi * ahead, atol=1e-8)
