"""Light rays in graded and layered media, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import elliptic_ray, exponential_index, linear_index, parabolic_ray, refraction

MODULES = (elliptic_ray, exponential_index, linear_index, parabolic_ray, refraction)
REFERENCES = {r.name: r for module in MODULES for r in module.references}
ZERO = mp.mpf(0)


@pytest.mark.parametrize(
    ("case", "beta", "across", "rise", "guess"),
    [("linear_index", 1, 1, 0, 0.5), ("linear_index/rising", 0.5, 1, 0.4, 0.6)],
)
def test_linear_index(prove, case, beta, across, rise, guess):
    beta, rise = mp.mpf(beta), mp.mpf(rise)

    def y(x, phi):
        # Brizard, eq. 1.38
        return 1 / beta - mp.cos(phi) / beta * mp.cosh(beta * x / mp.cos(phi) - mp.log(mp.sec(phi) + mp.tan(phi)))

    phi = mp.findroot(lambda phi: y(mp.mpf(across), phi) - rise, guess)
    prove(REFERENCES[case], (lambda x: (x, y(x, phi)), ZERO, mp.mpf(across)))


@pytest.mark.parametrize(
    ("case", "beta", "across", "rise", "guess"),
    [("exponential_index", 0.5, 2, 0.5, 0.6), ("exponential_index/arch", 1, 2.5, 0, 1.25)],
)
def test_exponential_index(prove, case, beta, across, rise, guess):
    def y(x, phi):
        # Brizard, eq. 1.56
        return mp.log(mp.cos(beta * x - phi) / mp.cos(phi)) / beta

    phi = mp.findroot(lambda phi: y(mp.mpf(across), phi) - rise, guess)
    prove(REFERENCES[case], (lambda x: (x, y(x, phi)), ZERO, mp.mpf(across)))


@pytest.mark.parametrize(
    ("case", "rise", "sine", "value"),
    [("parabolic_ray", 0, 0.25, 0.494521305498037), ("parabolic_ray/rising", 0.2, 0.6, None)],
)
def test_parabolic_ray(prove, case, rise, sine, value):
    x1, y1 = mp.mpf(0.5), mp.mpf(rise)

    def y(x, slope):
        # free fall with unit launch speed
        return slope * x - (1 + slope**2) * x**2 / 2

    slope = mp.findroot(lambda s: y(x1, s) - y1, sine)
    path = prove(REFERENCES[case], (lambda x: (x, y(x, slope)), ZERO, x1))
    if value is not None:
        assert float(path) == pytest.approx(value, rel=1e-14)
        assert float(mp.degrees(mp.atan(slope))) == pytest.approx(15, rel=1e-14)


def ellipse(a, b):
    """The Luneburg ray r = a cos(s) + p sin(s) from a to b in units of the lens, p found from s(b)."""
    sigma = mp.findroot(lambda s: mp.norm((b - a * mp.cos(s)) / mp.sin(s)) ** 2 + mp.norm(a) ** 2 - 2, 1.1)
    p = (b - a * mp.cos(sigma)) / mp.sin(sigma)
    return (lambda s: a * mp.cos(s) + p * mp.sin(s)), sigma


def test_elliptic_ray_in_the_plane(prove):
    path, sigma = ellipse(mp.matrix([1, 0]), mp.matrix([0.25, 0.875]))
    prove(REFERENCES["elliptic_ray/curve"], (lambda s: list(2 * path(s)), ZERO, sigma))


def test_elliptic_ray_in_polar_coordinates(prove):
    end = REFERENCES["elliptic_ray"].problem.end
    theta, r = mp.mpf(end.x), mp.mpf(end.y)
    path, sigma = ellipse(mp.matrix([1, 0]), mp.matrix([r * mp.cos(theta), r * mp.sin(theta)]) / 2)
    polar = lambda s: (mp.atan2(path(s)[1], path(s)[0]), 2 * mp.norm(path(s)))  # noqa: E731
    prove(REFERENCES["elliptic_ray"], (polar, ZERO, sigma))


def test_elliptic_ray_from_its_axis():
    # Brizard, sect. 1.4.2: r^2 = r0^2 (1 + e)/(1 + e cos(2 theta)) with r0 on the axis, and problem 8's angle
    path, _ = ellipse(mp.matrix([1, 0]), mp.matrix([0.25, 0.875]))
    nearest = mp.findroot(lambda s: mp.diff(lambda t: mp.norm(path(t)) ** 2, s), 0.9)
    r0, r1 = mp.norm(path(nearest)), mp.norm(path(nearest + mp.pi / 2))
    e = (r1**2 - r0**2) / (r1**2 + r0**2)
    angle = lambda s: mp.atan2(path(s)[1], path(s)[0])  # noqa: E731
    for s in map(mp.mpf, (0.1, 0.5, 1.0)):
        theta = angle(s) - angle(nearest)
        assert abs(mp.norm(path(s)) ** 2 - r0**2 * (1 + e) / (1 + e * mp.cos(2 * theta))) < 1e-25
        velocity = mp.matrix([mp.diff(lambda t, k=k: path(t)[k], s) for k in (0, 1)])
        radial = (velocity.T * path(s))[0] / mp.norm(velocity) / mp.norm(path(s))
        sine = (1 + e * mp.cos(2 * theta)) / mp.sqrt(1 + e**2 + 2 * e * mp.cos(2 * theta))
        assert abs(mp.sqrt(1 - radial**2) - sine) < 1e-25


@pytest.mark.parametrize(
    ("case", "edges", "indices", "rise"),
    [("refraction", (-1, 0, 1), (1, 1.5), 2), ("refraction/plate", (-1, 0, 0.5, 2), (1, 1.75, 1.25), 3)],
)
def test_refraction(prove, piece, case, edges, indices, rise):
    layers = [(mp.mpf(a), mp.mpf(b), mp.mpf(n)) for a, b, n in zip(edges, edges[1:], indices, strict=False)]
    # n sin(theta), the same in all layers
    snell = mp.findroot(lambda s: sum((b - a) * s / mp.sqrt(n**2 - s**2) for a, b, n in layers) - rise, (0.5, 0.8))
    pieces, height = [], ZERO
    for a, b, n in layers:
        slope = snell / mp.sqrt(n**2 - snell**2)
        pieces.append(piece(lambda x, a=a, height=height, slope=slope: (x, height + slope * (x - a)), a, b))
        height += slope * (b - a)
    prove(REFERENCES[case], *pieces)
