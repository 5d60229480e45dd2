"""Derivatives of the optical path in the parameters of media and surfaces, against closed forms evaluated here."""

from functools import cache

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import least_squares

from varcalc import optics

PARABOLIC = optics.Stratified(lambda y, p: ca.sqrt(p.n0**2 - 2 * p.g * y), {"n0": 1.2, "g": 0.7})
EXPONENTIAL = optics.Stratified(lambda y, p: p.n0 * ca.exp(-p.beta * y), {"n0": 1.5, "beta": 0.4})


def parabolic_path(n0, g, b, sign):
    """The optical path from the origin to b where n² = n0² - 2 g y; ``sign`` -1 for the lower ray."""
    mean, distance = n0**2 - g * b[1], mp.hypot(*b)
    sigma = mp.sqrt(2 * (mean + sign * mp.sqrt(mean**2 - (g * distance) ** 2))) / g
    climb = b[1] / sigma + g * sigma / 2
    return n0**2 * sigma - g * climb * sigma**2 + g**2 * sigma**3 / 3


def exponential_path(n0, beta, a, b):
    """Row O4: the optical path in n0 exp(-beta y)."""
    k = -beta
    squared = mp.exp(2 * k * a[1]) + mp.exp(2 * k * b[1])
    return n0 / abs(k) * mp.sqrt(squared - 2 * mp.exp(k * (a[1] + b[1])) * mp.cos(k * (b[0] - a[0])))


def slope(function, at):
    with mp.workdps(40):
        return float(mp.diff(function, mp.mpf(at)))


@pytest.mark.parametrize("space", [False, True])
def test_squared_index_linear_in_height(space):
    b = (0.6, 0.2)
    ends = ((0, 0, 0), (0.36, 0.48, 0.2)) if space else ((0, 0), b)
    rays = optics.Scene(PARABOLIC).rays(*ends)
    assert len(rays) == 2
    for ray, sign in zip(rays, (-1, 1), strict=True):
        by_index = slope(lambda v, sign=sign: parabolic_path(v, 0.7, b, sign), 1.2)
        by_gradient = slope(lambda v, sign=sign: parabolic_path(1.2, v, b, sign), 0.7)
        assert ray.derivatives == pytest.approx({"n0": by_index, "g": by_gradient}, rel=1e-12)


def test_exponential_index():
    a, b = (0.0, 0.1), (1.3, 0.5)
    [ray] = optics.Scene(EXPONENTIAL).rays(a, b)
    assert ray.derivatives["n0"] == pytest.approx(slope(lambda v: exponential_path(v, 0.4, a, b), 1.5), rel=1e-12)
    assert ray.derivatives["beta"] == pytest.approx(slope(lambda v: exponential_path(1.5, v, a, b), 0.4), rel=1e-12)


def test_media_known_by_name_have_their_numbers_for_parameters():
    a, b = (1.0, 0.2), (-0.3, 0.7)

    def path(n0, radius):
        a2, b2 = (radius**2 + p[0] ** 2 + p[1] ** 2 for p in (a, b))
        return n0 * radius * mp.asin(radius * mp.hypot(a[0] - b[0], a[1] - b[1]) / mp.sqrt(a2 * b2))

    ray = optics.Scene(optics.fish_eye(2.0, 1.1)).rays(a, b, within=3.0)[0]
    assert ray.derivatives["index"] == pytest.approx(slope(lambda v: path(v, 1.1), 2.0), rel=1e-12)
    assert ray.derivatives["radius"] == pytest.approx(slope(lambda v: path(2, v), 1.1), rel=1e-12)


def test_an_interface_and_the_index_behind_it():
    glass = optics.Uniform(lambda p: p.n, {"n": 1.5})
    floor = optics.Implicit(lambda x, y, p: y - p.height, parameters={"height": 0.1})
    scene = optics.Scene([optics.Uniform(1.0), glass], [floor])
    a, b = (-1.0, 1.0), (1.0, -1.0)

    def path(n, height):
        def excess(x):  # Snell's law at (x, height)
            return (x - a[0]) / mp.hypot(x - a[0], a[1] - height) - n * (b[0] - x) / mp.hypot(b[0] - x, height - b[1])

        x = mp.findroot(excess, 0.2)
        return mp.hypot(x - a[0], a[1] - height) + n * mp.hypot(b[0] - x, height - b[1])

    [ray] = scene.rays(a, b)
    assert ray.derivatives["n"] == pytest.approx(slope(lambda v: path(v, mp.mpf("0.1")), 1.5), rel=1e-12)
    assert ray.derivatives["height"] == pytest.approx(slope(lambda v: path(mp.mpf(1.5), v), 0.1), rel=1e-12)
    moved = scene.with_parameters({"n": 1.6, "height": 0.2})
    assert moved.rays(a, b)[0].optical_path == pytest.approx(float(path(mp.mpf(1.6), mp.mpf(0.2))), rel=1e-14)


def test_a_name_in_two_media_is_one_parameter():
    layers = [optics.Uniform(lambda p: p.n, {"n": 1.2}), optics.Uniform(lambda p: 2 * p.n, {"n": 1.2})]
    [ray] = optics.Scene(layers, [optics.Plane((0, 0), (0, 1))]).rays((0, 1), (0, -1))
    assert ray.derivatives == pytest.approx({"n": 3.0}, rel=1e-14)


def test_a_profile_is_fitted_to_measured_times():
    """Times of the closed form with an error of 1e-6 each give back its parameters within their standard errors."""
    rng = np.random.default_rng(3)
    pairs = [((0.0, float(h)), (float(x), float(top))) for h, x, top in rng.uniform((0, 1, 0), (0.5, 2, 1), (12, 3))]
    true = {"n0": 1.6, "beta": 0.55}
    times = np.array([float(exponential_path(*true.values(), *pair)) for pair in pairs])
    measured = times + 1e-6 * rng.standard_normal(len(times))
    scene = optics.Scene(EXPONENTIAL)

    @cache
    def rays(*values):
        moved = scene.with_parameters(dict(zip(true, values, strict=True)))
        return [moved.rays(*pair, within=6.0)[0] for pair in pairs]

    fit = least_squares(
        lambda values: [ray.optical_path for ray in rays(*values)] - measured,
        [1.5, 0.4],
        jac=lambda values: np.array([[ray.derivatives[name] for name in true] for ray in rays(*values)]),
        xtol=1e-14,
    )
    deviation = 1e-6 * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    assert np.all(np.abs(fit.x - list(true.values())) < 3 * deviation)
    assert np.max(np.abs(fit.jac.T @ fit.fun)) < 1e-10
    assert fit.njev < 8


def test_sound_in_deep_water():
    """The optical path is in inverse proportion to the speed on the axis; the channel's shape counts along the ray."""
    scene = optics.Scene(optics.munk_profile())
    rays = scene.rays((0, -1010.0), (2e4, -2500.0), within=2.2e4)
    assert len(rays) == 2
    for ray in rays:
        assert ray.derivatives["speed"] == pytest.approx(-ray.optical_path / 1500, rel=1e-12)
    step = 1e-6
    moved = [
        scene.with_parameters({"epsilon": 0.00737 + h}).rays((0, -1010.0), (2e4, -2500.0), within=2.2e4)
        for h in (step, -step)
    ]
    for ray, more, less in zip(rays, *moved, strict=True):
        difference = (more.optical_path - less.optical_path) / (2 * step)
        assert ray.derivatives["epsilon"] == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize("smooth", [True, False])
def test_the_index_at_the_heights_of_a_table(smooth):
    """By the chain rule they make up the derivatives of n² = n0² - 2 g y, which a table holds exactly."""
    heights = np.linspace(-0.4, 1.02, 7)
    table = optics.Tabulated(heights, np.sqrt(1.44 - 1.4 * heights), smooth)
    scene, b = optics.Scene(table), (0.6, 0.2)
    rays = scene.rays((0, 0), b, within=3.0)
    assert len(rays) == 2
    for ray, sign in zip(rays, (-1, 1), strict=True):
        by_value = np.array([ray.derivatives[f"n{k}"] for k in range(7)])
        by_index = slope(lambda v, sign=sign: parabolic_path(v, 0.7, b, sign), 1.2)
        by_gradient = slope(lambda v, sign=sign: parabolic_path(1.2, v, b, sign), 0.7)
        assert by_value @ (1.2 / np.array(table.n)) == pytest.approx(by_index, rel=1e-12)
        assert by_value @ (-heights / np.array(table.n)) == pytest.approx(by_gradient, rel=1e-11)
    step = 1e-5
    moved = [scene.with_parameters({"n2": table.n[2] + h}).rays((0, 0), b, within=3.0)[0] for h in (step, -step)]
    difference = (moved[0].optical_path - moved[1].optical_path) / (2 * step)
    assert rays[0].derivatives["n2"] == pytest.approx(difference, rel=1e-7)


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"\['k'\] are no parameters of this scene; it has \['g', 'n0'\]"):
        optics.Scene(PARABOLIC).with_parameters({"k": 1.0})
    with pytest.raises(TypeError, match="parameters must be a mapping from names to numbers"):
        optics.Scene(PARABOLIC).with_parameters([1.0])
    with pytest.raises(ValueError, match="are no parameters of this Stratified"):
        PARABOLIC.with_parameters({"k": 1.0})
    with pytest.raises(ValueError, match="are no parameters of this Plane"):
        optics.Plane((0, 0), (1, 0)).with_parameters({"k": 1.0})
    with pytest.raises(ValueError, match=r"p\.h is used but not declared"):
        optics.Stratified(lambda y, p: p.h * y, {"n0": 1.0})
    with pytest.raises(TypeError, match="with p last"):
        optics.Stratified(lambda y: y, {"n0": 1.0})
    kinked = optics.Stratified(lambda y, p: 1 + p.a * ca.fabs(y - 0.123) ** 0.05, {"a": 0.0})
    [ray] = optics.Scene(kinked).rays((0, 0), (0.5, 0.3))
    with pytest.raises(ArithmeticError, match="not smooth along the ray"):
        _ = ray.derivatives
