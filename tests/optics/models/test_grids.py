"""Tables of several coordinates, gone through cell by cell: against the same index as a formula, and in layers."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.symbolic.grids import on_grid
from varcalc.symbolic.look_up import within_knots

SIDES = np.linspace(-2, 2, 8), np.array([-2.0, -1.1, -0.7, 0.1, 0.4, 1.3, 2.0])


def table(kind, function, sides=SIDES):
    values = function(*np.meshgrid(*sides, indexing="ij"))
    return ca.interpolant("n", kind, [list(own) for own in sides], values.ravel(order="F"))


def looked_up(kind, function, sides=SIDES):
    n = table(kind, function, sides)
    if len(sides) == 2:
        return optics.Graded(lambda x, y: n(ca.vertcat(x, y)))
    return optics.Graded(lambda x, y, z: n(ca.vertcat(x, y, z)))


@pytest.mark.parametrize(
    ("kind", "index"),
    [
        ("linear", lambda x, y: 1.4 + 0.1 * x - 0.07 * y + 0.03 * x * y),
        ("bspline", lambda x, y: 1.4 - 0.1 * x**2 + 0.05 * x * y**2 + 0.01 * y**3 - 0.02 * x**3 * y),
    ],
)
def test_a_table_of_a_polynomial_is_the_polynomial(kind, index):
    rng = np.random.default_rng(1751)
    told, given = optics.Scene(optics.Graded(index)), optics.Scene(looked_up(kind, index))
    for _ in range(2):
        a, b = rng.uniform(-1.5, 1.5, (2, 2))
        rays, others = given.rays(a, b, within=6.0), told.rays(a, b, within=6.0)
        assert rays.unresolved == 0
        inside = [ray for ray in others if np.abs(ray.point(np.linspace(0, ray.optical_path, 200))).max() < 2]
        assert [ray.optical_path for ray in rays] == pytest.approx([ray.optical_path for ray in inside], rel=1e-12)
        assert [ray.spreading for ray in rays] == pytest.approx([ray.spreading for ray in inside], rel=1e-9)
        assert rays[0].index == 0


def test_a_table_of_heights_with_another_coordinate_is_that_of_heights():
    heights, index = SIDES[1], 1.3 + 0.1 * np.sin(np.arange(7.0))
    flat = optics.Scene(looked_up("linear", lambda x, y: np.interp(y, heights, index) + 0 * x))
    n = ca.interpolant("n", "linear", [list(heights)], index)
    layers = optics.Scene(optics.Graded(lambda x, y: n(y)))
    a, b = (-1.3, 0.2), (1.2, -0.3)
    rays, others = flat.rays(a, b, within=5.0), layers.rays(a, b, within=5.0)
    assert rays.unresolved == 0
    assert [ray.optical_path for ray in rays] == pytest.approx([ray.optical_path for ray in others], rel=1e-12)
    assert [ray.spreading for ray in rays] == pytest.approx([ray.spreading for ray in others], rel=1e-8)


def test_neighbours_are_bent_by_the_kinks_at_knots():
    scene = optics.Scene(looked_up("linear", lambda x, y: 1.3 + 0.1 * np.sin(3 * x + y**2)))
    angle, turn = 0.41, 1e-6
    headings = [(np.cos(t), np.sin(t)) for t in (angle - turn, angle, angle + turn)]
    bundle = scene.trace((-1.6, -1.2), headings, optical_path=3.5, with_spreading=True)
    before, here, after = bundle.points
    ahead = bundle.directions[1]
    across = (after - before) / (2 * turn)
    np.testing.assert_allclose(abs(ahead[0] * across[1] - ahead[1] * across[0]), bundle.spreading[1], rtol=1e-6)
    assert np.linalg.norm(here - before) > turn


def test_rays_in_space_go_through_the_cells_of_a_table():
    index = lambda x, y, z: 1.4 + 0.1 * x - 0.05 * y * z + 0.04 * x * z  # noqa: E731
    sides = (*SIDES, np.linspace(-2, 2, 5))
    told, given = optics.Scene(optics.Graded(index)), optics.Scene(looked_up("linear", index, sides))
    directions = np.random.default_rng(3).normal(size=(20, 3))
    ends = [scene.trace((0.1, 0.2, -0.3), directions, optical_path=2.2).points for scene in (told, given)]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-12)


def test_rays_end_where_they_leave_a_table():
    scene = optics.Scene(looked_up("bspline", lambda x, y: 1.4 + 0.1 * np.cos(x + y)))
    bundle = scene.trace((0, 0), [(1, 0.2), (0.1, 1)], optical_path=20.0)
    assert [optics.RayStatus(code) for code in bundle.status] == [optics.RayStatus.OUTSIDE] * 2
    np.testing.assert_allclose(np.abs(bundle.points).max(axis=1), 2.0, rtol=1e-14)


def test_rays_along_an_edge_go_to_the_side_to_which_they_are_pulled():
    """n = 1.5 + |y|/10 pulls away from y = 0, and n = 1.5 - |y|/10 back to it, where no ray can stay."""
    sides = np.linspace(-2, 2, 5), np.linspace(-2, 2, 5)
    away = optics.Scene(looked_up("linear", lambda x, y: 1.5 + 0.1 * np.abs(y) + 0 * x, sides))
    back = optics.Scene(looked_up("linear", lambda x, y: 1.5 - 0.1 * np.abs(y) + 0 * x, sides))
    down = optics.Scene(looked_up("linear", lambda x, y: 1.5 - 0.1 * y + 0 * x, sides))
    told = optics.Scene(optics.Graded(lambda x, y: 1.5 - 0.1 * y)).trace((-1, 0), (1, 0), optical_path=2.0)
    np.testing.assert_allclose(down.trace((-1, 0), (1, 0), optical_path=2.0).points, told.points, rtol=0, atol=1e-13)
    assert away.trace((-1, 0), (1, 0), optical_path=2.0).points[0, 1] > 0
    assert back.trace((-1, 0), (1, 0), optical_path=2.0).status[0] == optics.RayStatus.SINGULAR


def test_tables_askew_and_about_a_centre_are_gone_through_as_well():
    """n = r looked up at r², whose rays are lines in the square of the complex plane; and a plane's table turned."""
    squares = np.linspace(0.2, 9.3, 12)
    radial = ca.interpolant("n", "linear", [list(squares)], squares)
    scene = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(radial(x**2 + y**2))))
    a, b = 1.0 + 0.0j, 1.2 * np.exp(1.0j)
    (ray,) = scene.rays((a.real, a.imag), (b.real, b.imag), within=1.5)
    assert ray.optical_path == pytest.approx(abs(b**2 - a**2) / 2, rel=1e-12)
    n = table("linear", lambda u, v: 1.4 + 0.1 * u + 0.05 * u * v)
    turned = optics.Scene(optics.Graded(lambda x, y: n(ca.vertcat(0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x))))
    told = optics.Scene(
        optics.Graded(lambda x, y: 1.4 + 0.1 * (0.6 * x + 0.8 * y) + 0.05 * (0.6 * x + 0.8 * y) * (0.6 * y - 0.8 * x))
    )
    rays, others = (one.rays((-0.9, -0.8), (0.7, 0.9), within=4.0) for one in (turned, told))
    assert rays.unresolved == 0
    assert [ray.optical_path for ray in rays] == pytest.approx([ray.optical_path for ray in others], rel=1e-12)
    assert [ray.spreading for ray in rays] == pytest.approx([ray.spreading for ray in others], rel=1e-9)


def test_what_is_no_grid_is_not_read_as_one():
    values = table("linear", lambda x, y: 1 + 0 * x)
    n = lambda place: within_knots(values(place))  # noqa: E731
    r = ca.SX.sym("r", 2)
    assert on_grid(1 + r[0], r) is None
    assert on_grid(n(ca.vertcat(n(r), r[1])), r) is None
    assert len(on_grid(n(ca.vertcat(2 * r[1] + 1, r[0])) ** 2 + n(ca.vertcat(r[0], r[0])), r).edges) == 2


def test_tables_tell_their_derivatives_in_each_cell():
    """Of t = u²v - 3v² + 2uv³ at u = 2y + 1, v = x, and at u = v = x, by hand."""
    t, r = table("bspline", lambda u, v: u**2 * v - 3 * v**2 + 2 * u * v**3), ca.SX.sym("r", 2)
    grid = on_grid(within_knots(t(ca.vertcat(2 * r[1] + 1, r[0])) + t(ca.vertcat(r[0], r[0]))), r)
    told = ca.Function("told", [r, grid.constants], [ca.vec(part.T) for part in grid.told])
    x, y = 0.3, -0.6
    u, v = 2 * y + 1, x
    cells = [np.searchsorted(edges, at) - 1 for edges, at in zip(grid.edges, (u, v), strict=True)]
    values, slopes, bends = (part.toarray().ravel() for part in told((x, y), grid.numbers(np.array([cells]))[0]))
    own = [u**2 * v - 3 * v**2 + 2 * u * v**3, v**3 - 3 * v**2 + 2 * v**4]
    first = [2 * u * v + 2 * v**3, u**2 - 6 * v + 6 * u * v**2, 0, 3 * v**2 - 6 * v + 8 * v**3]
    second = [2 * v, 2 * u + 6 * v**2, 2 * u + 6 * v**2, -6 + 12 * u * v, 0, 0, 0, 6 * v - 6 + 24 * v**2]
    np.testing.assert_allclose(values, own, rtol=0, atol=1e-12)
    np.testing.assert_allclose(slopes, first, rtol=0, atol=1e-11)
    np.testing.assert_allclose(bends, second, rtol=0, atol=1e-10)
