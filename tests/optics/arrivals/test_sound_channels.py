"""Every eigenray of two ocean channels that can be written down: Munk's profile to 1000 km, and Pekeris's guide."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import lambertw

from varcalc import optics

AXIS, EPSILON = 1300.0, 0.00737
STEEPEST = 1.405  # rays go farther than 1000 km before they come back to the axis once
NODES, WEIGHTS = np.polynomial.legendre.leggauss(320)


def along(turn, height, below):
    """Range and optical path of rays from Munk's axis to where f = ``height``, turning at f = ``turn`` (k,).

    c = c1 (1 + ε f) with f = η - 1 + exp(-η) (Munk, J. Acoust. Soc. Am. 55 (1974) 220), so that η is Lambert's W of
    f, one branch below the axis and one above; dx = dz/tan θ with Snell's law, and f = turn sin² φ.
    """
    end = np.arcsin(np.sqrt(np.minimum(height / turn, 1.0)))
    phi = end[:, None] / 2 * (1 + NODES)
    f = turn[:, None] * np.sin(phi) ** 2
    first = (1 if below else -1) * np.sqrt(2 * f) + f / 3
    eta = np.where(f < 1e-4, first, 1 + f + lambertw(-np.exp(-1 - f), 0 if below else -1).real)
    for _ in range(2):  # next to the axis f does not tell η well
        eta = eta - (eta + np.expm1(-eta) - f) / -np.expm1(-eta)
    slope = np.abs(np.expm1(-eta))
    rate = 2 * np.sqrt(turn)[:, None] * np.sin(phi) / (slope * np.sqrt(EPSILON * (2 + EPSILON * (turn[:, None] + f))))
    rate = rate * AXIS / 2 * WEIGHTS * end[:, None] / 2
    c = 1 / (1 + EPSILON * turn)
    return np.sum(rate * (1 + EPSILON * f), axis=1), np.sum(rate / (1 + EPSILON * f), axis=1) / c


def families(turn, height, below, most):
    """Range and optical path (k,) of each way from the axis to a height: loops, and then up to it or back to it."""
    low, high = (np.array(along(turn, turn, side)) for side in (True, False))
    last, loop = np.array(along(turn, np.full(len(turn), height), below)), low if below else high
    for half in range(most):
        first, second = (
            (low, high) if (half % 2 == 0) == below else (high, low)
        )  # the last half loop goes to the height
        whole = 2 * ((half + 1) // 2) * first + 2 * (half // 2) * second
        yield half, whole + last
        yield half + most, whole + 2 * loop - last


def munk_eigenrays(distance, eta, within):
    """The optical paths of all rays from the axis to η at a distance: the zeros of every family."""
    height, below, most = eta - 1 + np.exp(-eta), eta > 0, int(distance / 1.5e4)
    turns = (1 / np.cos(np.linspace(1e-3, STEEPEST, 6001)) - 1) / EPSILON
    turns = np.unique(np.append(turns[turns > height], height * (1 + 10.0 ** np.linspace(-12, 0, 400))))
    found = []
    for name, (came, _) in families(turns, height, below, most):
        for k in np.flatnonzero(np.sign(came[1:] - distance) != np.sign(came[:-1] - distance)):

            def family(turn, name=name):
                return dict(families(np.array([turn]), height, below, most))[name][:, 0]

            turn = brentq(lambda t, family=family: family(t)[0] - distance, turns[k], turns[k + 1], xtol=1e-13)
            found.append(family(turn)[1])
    return np.sort([path for path in found if path <= within])


@pytest.mark.parametrize(("distance", "depth"), [(1e5, 1000.0), (1e6, 1000.0), (1e6, 2500.0)])
def test_every_eigenray_of_munks_channel(distance, depth):
    """In the profile without surface and bottom: rays of all angles, up to 54 loops, the latest along the axis."""
    scene = optics.Scene(optics.munk_profile())
    rays = scene.rays((0.0, -AXIS), (distance, -depth), within=1.001 * distance)
    expected = munk_eigenrays(distance, 2 * (depth - AXIS) / AXIS, 1.001 * distance)
    got = np.array([ray.optical_path for ray in rays])
    assert len(got) == len(expected)
    np.testing.assert_allclose(got, expected, rtol=1e-13)
    assert rays.unresolved == 0


@pytest.mark.parametrize("distance", [1000.0, 3000.0, 12000.0])
@pytest.mark.parametrize("reflections", [1, 2, 7])
@pytest.mark.parametrize("surface_first", [True, False])
def test_rays_of_pekeris_guide_are_straight_to_images(distance, reflections, surface_first):
    """Water between its surface and the bottom: the images of Jensen, Kuperman, Porter, Schmidt, sect. 2.4.4.

    The bottom reflects all of what meets it below the critical angle. Rays that graze the surfaces come to them far
    from each other.
    """
    depth, source, receiver = 100.0, 36.0, 46.0
    top, bottom = optics.Plane((0, 0), (0, 1), mirror=True), optics.Plane((0, -depth), (0, 1), mirror=True)
    sides = [top, bottom] if surface_first else [bottom, top]
    scene = optics.Scene([optics.Uniform(1.0)] * (reflections + 1), [sides[k % 2] for k in range(reflections)])
    image = -source
    for k in range(reflections):
        image = -image if sides[k % 2] is top else -2 * depth - image
    # the last mirror image sees the receiver straight ahead
    expected = np.hypot(distance, image + receiver)
    (ray,) = scene.rays((0.0, -source), (distance, -receiver))
    assert abs(ray.optical_path - expected) <= 1e-14 * expected
    assert ray.index == 0
    angle = np.arctan2(abs(image + receiver), distance)
    assert abs(abs(ray.tangents[0][1]) - np.sin(angle)) < 1e-13
    assert abs(ray.spreading - expected) <= 1e-12 * expected
