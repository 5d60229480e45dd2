"""All rays where n² is of second degree, against a scan of σ, closed forms of foci, and the rays that are carried."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

from varcalc import optics

NODES, WEIGHTS = np.polynomial.legendre.leggauss(120)


def solutions(curvature, sigma):
    """cos wσ, sin(wσ)/w and (1 - cos wσ)/w², or their like."""
    w = np.sqrt(complex(-curvature))
    if w == 0:
        return np.ones_like(sigma), sigma, sigma**2 / 2
    return np.cos(w * sigma).real, (np.sin(w * sigma) / w).real, (2 * np.sin(w * sigma / 2) ** 2 / w**2).real


def scanned(squared, hessian, pull, a, b, within, longest=30.0):
    """Optical paths from a to b up to one, by σ at which the momentum that leads to b there has the square n²."""
    curvatures, axes = np.linalg.eigh(hessian)
    curvatures[np.abs(curvatures) < 1e-14] = 0.0
    start, way = (pull + hessian @ a) @ axes, (b - a) @ axes

    def momentum(sigma):
        parts = [solutions(k, sigma) for k in curvatures]
        return [(d - g * second) / first for d, g, (_, first, second) in zip(way, start, parts, strict=True)]

    def excess(sigma):
        return sum(p**2 for p in momentum(sigma)) - squared(a)

    def path(sigma):
        along, total = sigma * (NODES + 1) / 2, 0.0
        for k, p, g in zip(curvatures, momentum(sigma), start, strict=True):
            zeroth, first, _ = solutions(k, along)
            total += WEIGHTS @ (p * zeroth + g * first) ** 2 * sigma / 2
        return total

    grid = np.linspace(1e-3, longest, 60001)
    with np.errstate(all="ignore"):
        values = excess(grid)
    found = []
    for k in np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1])):
        sigma = brentq(excess, *grid[k : k + 2], xtol=1e-15)
        if abs(excess(sigma)) < 1e-3:  # not a pole
            found.append(path(sigma))
    return np.sort([s for s in found if s < within])


@pytest.mark.parametrize("dimension", [2, 3])
def test_all_rays_of_random_saddles_hills_and_valleys(dimension):
    rng = np.random.default_rng(1788)
    many = 0
    for number in range(12):
        hessian = rng.normal(size=(dimension, dimension)) * 0.7
        hessian = (hessian + hessian.T) / 2
        if number % 3 == 0:
            hessian[-1] = hessian[:, -1] = 0.0
        pull, middle, within = 0.4 * rng.normal(size=dimension), rng.uniform(1.5, 3), rng.uniform(3, 6)

        def squared(r, hessian=hessian, pull=pull, middle=middle):
            return middle + 2 * pull @ r + r @ hessian @ r

        a, b = rng.uniform(-0.5, 0.5, (2, dimension))
        if min(squared(a), squared(b)) < 0.1:
            continue

        def index(*r, hessian=hessian, pull=pull, middle=middle):
            r = ca.vertcat(*r)
            return ca.sqrt(middle + 2 * ca.dot(ca.DM(pull), r) + ca.dot(r, ca.DM(hessian) @ r))

        given = (lambda x, y, f=index: f(x, y)) if dimension == 2 else (lambda x, y, z, f=index: f(x, y, z))
        rays = optics.Scene(optics.Graded(given)).rays(a, b, within=within)
        exact = scanned(squared, hessian, pull, a, b, within)
        assert rays.unresolved == 0
        np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=1e-10)
        for ray in rays:
            assert ray.index == len(ray.conjugate_points)
            np.testing.assert_allclose(ray.point(np.array([ray.optical_path]))[0], b, rtol=0, atol=1e-9)
        many += len(rays)
    assert many > 20


def test_foci_of_a_duct_to_which_rays_of_all_angles_come():
    """n² = 2 - y²: from its axis to a point of it at x rays come by σ = mπ, p_x = x/σ and either sign of p_y."""
    x, m = 5.0, np.arange(2, 4)
    rays = optics.Scene(optics.Stratified(lambda y: ca.sqrt(2 - y**2))).rays((0, 0), (x, 0), within=8.5)
    sigma = m * np.pi
    exact = np.repeat(x**2 / sigma + (2 - (x / sigma) ** 2) * sigma / 2, 2)
    exact = np.sort([np.sqrt(2) * x, *exact[exact < 8.5]])
    assert len(exact) == 3
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=1e-13)
    assert rays.unresolved == 0
    assert not rays.continuum
    assert rays[1].tangents[0][1] == pytest.approx(-rays[2].tangents[0][1], abs=1e-13)


def test_foci_of_a_rod_are_continua():
    rays = optics.Scene(optics.Graded(lambda x, y, z: ca.sqrt(2 - y**2 - z**2))).rays((0, 0, 0), (5, 0, 0), within=8.5)
    assert rays.continuum
    sigma = 2 * np.pi
    exact = [np.sqrt(2) * 5, 25 / sigma + (2 - (5 / sigma) ** 2) * sigma / 2]
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=1e-13)
    assert [ray.degenerate for ray in rays] == [False, True]


def test_rays_that_grow_apart_beyond_what_directions_tell_are_told():
    """Along the ridge of n² = 1.5 + x² - y² rays come to B after any number of turns across it, along cosh σ."""
    scene = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(1.5 + x**2 - y**2)))
    a, b = np.array([0.05, 0.3]), np.array([-0.1, 0.2])
    near, far = scene.rays(a, b, within=9.0), scene.rays(a, b, within=40.0)
    exact = scanned(lambda r: 1.5 + r[0] ** 2 - r[1] ** 2, np.diag([1.0, -1.0]), np.zeros(2), a, b, 9.0)
    np.testing.assert_allclose([ray.optical_path for ray in near], exact, rtol=1e-10)
    assert len(exact) > 5
    assert near.unresolved == 0
    assert far.unresolved == 0
    sigma = np.linspace(0.1, 60.0, 600_001)

    def left(sigma):
        """n² at A less that of the momentum that comes to B over σ: x is of cosh and sinh, y of cos and sin."""
        along, across = b[0] / np.sinh(sigma) - a[0] / np.tanh(sigma), b[1] - a[1] * np.cos(sigma)
        return (1.5 + a[0] ** 2 - a[1] ** 2 - along**2) * np.sin(sigma) ** 2 - across**2

    def path(sigma):
        """∫ (x'² + y'²) dσ, by what is kept: x'² - x² and y'² + y²."""
        x = [b[0] / np.sinh(sigma) - a[0] / np.tanh(sigma), b[0] / np.tanh(sigma) - a[0] / np.sinh(sigma)]
        y = [b[1] / np.sin(sigma) - a[1] / np.tan(sigma), b[1] / np.tan(sigma) - a[1] / np.sin(sigma)]
        kept = x[0] ** 2 - a[0] ** 2 + y[0] ** 2 + a[1] ** 2
        return (b[0] * x[1] - a[0] * x[0] + b[1] * y[1] - a[1] * y[0] + kept * sigma) / 2

    places = sigma[:-1][np.diff(np.sign(left(sigma))) != 0]
    paths = np.sort([path(brentq(left, s, s + sigma[1] - sigma[0], xtol=1e-15, rtol=1e-15)) for s in places])
    np.testing.assert_allclose([ray.optical_path for ray in far], paths[paths <= 40.0], rtol=1e-12)
    ends = np.array([ray.point(np.array([ray.optical_path]))[0] for ray in far if ray.legs])
    assert len(near) < len(ends) < len(far)
    np.testing.assert_allclose(ends, np.tile(b, (len(ends), 1)), rtol=0, atol=1e-5)


def test_rays_across_a_saddle_spread_as_the_closed_form_says():
    """n² = 1 + y²: y = p sinh σ - cosh σ / 2 from -0.5, x = c σ; nothing but its end tells where such a ray goes."""
    distance = 60.0
    [ray] = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(1 + y**2))).rays((0, -0.5), (distance, 0.7))
    with mp.workdps(60):
        # c² + p² = 1.25, c σ = distance, p sinh σ - cosh σ / 2 = 0.7
        sigma = mp.findroot(
            lambda s: (distance / s) ** 2 + ((mp.mpf("0.7") + mp.cosh(s) / 2) / mp.sinh(s)) ** 2 - mp.mpf("1.25"),
            mp.mpf(distance),
        )
        c, p = distance / sigma, (mp.mpf("0.7") + mp.cosh(sigma) / 2) / mp.sinh(sigma)
        last = p * mp.cosh(sigma) - mp.sinh(sigma) / 2
        path = mp.quad(lambda s: 1 + (p * mp.sinh(s) - mp.cosh(s) / 2) ** 2, mp.linspace(0, sigma, 41))
        # neighbours start with the momentum (-p, c), and come (-p σ, c sinh σ) apart
        spread = abs((-p * sigma) * last - c * mp.sinh(sigma) * c) / mp.hypot(c, last)
    assert ray.optical_path == pytest.approx(float(path), rel=1e-13)
    assert ray.spreading == pytest.approx(float(spread), rel=1e-6)
    assert ray.index == 0
