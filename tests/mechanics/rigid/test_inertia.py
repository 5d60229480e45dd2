"""Inertia tensors: against integrals, the parallel axes, and each other."""

import math

import mpmath as mp
import numpy as np
import pytest

from varcalc.mechanics import EulerAngles, Inertia, TopKind, principal


def by_slices(mass, low, high, area, radii):
    """Moments about x and z of a solid of revolution about z, from its discs: ∫ dm (r²/4 + z²), ∫ dm r²/2."""
    density = mass / mp.quad(area, [low, high])
    across = mp.quad(lambda z: density * area(z) * (radii(z) ** 2 / 4 + z**2), [low, high])
    along = mp.quad(lambda z: density * area(z) * radii(z) ** 2 / 2, [low, high])
    return float(across), float(along)


@pytest.mark.parametrize(
    ("solid", "point", "low", "high", "radius"),
    [
        (Inertia.cone(2.0, 0.3, 0.7), (0, 0, 0), 0, 0.7, lambda z: 3 * z / 7),
        (Inertia.cylinder(2.0, 0.3, 0.7), (0, 0, 0), -0.35, 0.35, lambda z: mp.mpf("0.3")),
        (Inertia.sphere(2.0, 0.3), (0, 0, 0), -0.3, 0.3, lambda z: mp.sqrt(abs(mp.mpf("0.3") ** 2 - z**2))),
        (
            Inertia.ellipsoid(2.0, 0.3, 0.3, 0.7), (0, 0, 0), -0.7, 0.7,
            lambda z: mp.mpf("0.3") * mp.sqrt(abs(1 - (z / mp.mpf("0.7")) ** 2)),
        ),
    ],
)  # fmt: skip
def test_solids_of_revolution_against_their_discs(solid, point, low, high, radius):
    across, along = by_slices(solid.mass, mp.mpf(str(low)), mp.mpf(str(high)), lambda z: radius(z) ** 2, radius)
    np.testing.assert_allclose(solid.about(point), np.diag([across, across, along]), rtol=1e-14, atol=1e-16)


def test_the_cone_about_its_centre_of_mass():
    m, radius, height = 2.0, 0.3, 0.7
    across = 3 / 20 * m * (radius**2 + height**2 / 4)
    np.testing.assert_allclose(Inertia.cone(m, radius, height).principal.moments[1:], across, rtol=1e-14)


def test_shells_rings_and_plates_are_limits_of_solids():
    thin = 1e-6
    outer, inner = Inertia.sphere((1 + thin) ** 3, 1 + thin), Inertia.sphere(1.0, 1.0)
    shell = outer - inner
    np.testing.assert_allclose(shell.tensor, Inertia.spherical_shell(shell.mass, 1 + thin / 2).tensor, rtol=1e-8)
    pairs = [
        (Inertia.plate(2.0, 0.3, 0.5), Inertia.box(2.0, 0.3, 0.5, 1e-9)),
        (Inertia.rod(2.0, 0.3), Inertia.box(2.0, 1e-9, 1e-9, 0.3)),
        (Inertia.disc(2.0, 0.3), Inertia.cylinder(2.0, 0.3, 1e-9)),
        (Inertia.ring(2.0, 0.3), Inertia.cylindrical_shell(2.0, 0.3, 1e-9)),
    ]
    for flat, solid in pairs:
        np.testing.assert_allclose(flat.tensor, solid.tensor, rtol=1e-13, atol=1e-17)
    tube = Inertia.cylinder(2 * (1 + thin) ** 2, 1 + thin, 2.0) - Inertia.cylinder(2.0, 1.0, 2.0)
    np.testing.assert_allclose(tube.tensor, Inertia.cylindrical_shell(tube.mass, 1 + thin / 2, 2.0).tensor, rtol=1e-8)


def test_a_box_is_six_tetrahedra_and_eight_boxes():
    a, b, c, m = 0.4, 0.5, 0.9, 3.0
    box = Inertia.box(m, a, b, c)
    corner = np.array([-a, -b, -c]) / 2
    edges = np.diag([a, b, c])
    total = None
    for order in ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]):
        corners = corner + np.vstack([np.zeros(3), np.cumsum(edges[order], axis=0)])
        piece = Inertia.tetrahedron(m / 6, corners)
        total = piece if total is None else total + piece
    np.testing.assert_allclose(total.tensor, box.tensor, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(total.centre, 0, atol=1e-16)
    small = Inertia.box(m / 8, a / 2, b / 2, c / 2)
    parts = [small.moved([i * a / 4, j * b / 4, k * c / 4]) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    whole = parts[0]
    for part in parts[1:]:
        whole = whole + part
    np.testing.assert_allclose(whole.tensor, box.tensor, rtol=1e-14, atol=1e-16)
    hollow = whole - parts[3]
    np.testing.assert_allclose((hollow + parts[3]).tensor, box.tensor, rtol=1e-14, atol=1e-16)


def test_the_dumbbell_has_one_direction_without_moment():
    m, b, theta, phi = 1.3, 0.4, 0.7, 2.1
    along = np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
    tilted = Inertia.points([m, m], [b * along, -b * along])
    exact = 2 * m * b**2 * (np.eye(3) - np.outer(along, along))  # Brizard, eq. 7.22
    np.testing.assert_allclose(tilted.tensor, exact, rtol=1e-14, atol=1e-16)
    found = tilted.principal
    assert found.kind is TopKind.LINEAR
    assert found.moments[0] == 0
    np.testing.assert_allclose(np.abs(found.axes[:, 0] @ along), 1, rtol=1e-14)
    turned = Inertia.dumbbell(m, m, 2 * b).turned(EulerAngles(phi + math.pi / 2, theta, 0.0).rotation)
    np.testing.assert_allclose(turned.tensor, exact, rtol=1e-14, atol=1e-16)
    unequal = Inertia.dumbbell(1.0, 3.0, 2.0)
    np.testing.assert_allclose(unequal.tensor, np.diag([3.0, 3.0, 0.0]), rtol=1e-14)  # reduced mass times length²
    np.testing.assert_allclose(unequal.centre, 0, atol=1e-16)


def test_principal_axes_are_a_right_handed_frame_that_diagonalises():
    rng = np.random.default_rng(3)
    body = Inertia.points(rng.uniform(1, 2, 9), rng.normal(size=(9, 3)))
    found = body.principal
    assert found.kind is TopKind.ASYMMETRIC
    np.testing.assert_allclose(found.axes.T @ body.tensor @ found.axes, np.diag(found.moments), atol=1e-13)
    np.testing.assert_allclose(np.cross(found.axes[:, 0], found.axes[:, 1]), found.axes[:, 2], atol=1e-14)
    assert body.moment(found.axes[:, 2]) == pytest.approx(found.moments[2], rel=1e-14)
    corner = Inertia.box(1.0, 1.0, 1.0, 1.0)
    assert corner.moment([1, 1, 1], [0.5, 0.5, 0.5]) == pytest.approx(1 / 6, rel=1e-14)
    assert corner.moment([0, 0, 2.0], [0.5, 0.5, 0.5]) == pytest.approx(2 / 3, rel=1e-14)
    assert [s.principal.kind for s in (Inertia.sphere(1, 1), Inertia.disc(1, 1), Inertia.box(1, 1, 2, 3))] == [
        TopKind.SPHERICAL, TopKind.SYMMETRIC, TopKind.ASYMMETRIC,
    ]  # fmt: skip


def test_the_plate_of_the_problem_turns_onto_its_axes():
    # Brizard, ch. 7, problem 1: about a corner A = M b²/3, B = M a²/3, C = M a b/4
    m, a, b = 1.7, 0.6, 1.1
    corner = Inertia.plate(m, a, b).about([-a / 2, -b / 2, 0])
    A, B, C = m * b**2 / 3, m * a**2 / 3, m * a * b / 4
    np.testing.assert_allclose(corner, [[A, -C, 0], [-C, B, 0], [0, 0, A + B]], rtol=1e-14, atol=1e-16)
    half, apart = (A + B) / 2, math.hypot((A - B) / 2, C)
    np.testing.assert_allclose(principal(corner).moments, [half - apart, half + apart, A + B], rtol=1e-14)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Inertia.sphere(-1, 1), "mass must be a positive number"),
        (lambda: Inertia.cone(1, 0, 1), "radius must be a positive number"),
        (lambda: Inertia.points([1, 2], [[0, 0, 0]]), r"positions must be \(m, 3\)"),
        (lambda: Inertia.points([1, -2], [[0, 0, 0], [1, 0, 0]]), "masses must be positive"),
        (lambda: Inertia.sphere(1, 1) - Inertia.sphere(1, 1), "cannot be cut out"),
        (lambda: Inertia.sphere(1, 1).turned(np.diag([1, 1, 2])), "orthogonal"),
        (lambda: Inertia.sphere(1, 1).moment([0, 0, 0]), "axis must have a direction"),
        (lambda: Inertia.sphere(1, 1).about([0, 0]), "point must be three finite numbers"),
        (lambda: Inertia.tetrahedron(1, np.zeros((3, 3))), "four points"),
        (lambda: principal(np.diag([1.0, 1.0, 2.5])), "of no body"),
        (lambda: principal([[1, 2, 0], [0, 1, 0], [0, 0, 1]]), "symmetric matrix"),
    ],
)
def test_what_is_no_body_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
