"""Oscillators, beams, splines, strings and regulators, in 40 digits."""

import math

import mpmath as mp
import pytest

from varcalc.problems import beam, bratu, elastic_support, oscillator, periodic_load, regulator, spline

MODULES = (beam, bratu, elastic_support, oscillator, periodic_load, regulator, spline)
REFERENCES = {r.name: r for module in MODULES for r in module.references}
ZERO, ONE = mp.mpf(0), mp.mpf(1)


def swing(w, T, a, b):
    """The motion with frequency w from a to b in the time T, or to a free end where b is None."""
    w = mp.mpf(w)
    sine = a * mp.tan(w * T) if b is None else (b - a * mp.cos(w * T)) / mp.sin(w * T)
    return lambda t: a * mp.cos(w * t) + sine * mp.sin(w * t)


@pytest.mark.parametrize(
    ("case", "T", "motions"),
    [
        ("oscillator", 2, [(1, 2, 0, 1)]),
        ("oscillator/anisotropic", 2, [(1, 2, 1, 0.5), (1.3, 2, 0.5, -1)]),
        ("oscillator/released", 1, [(1, 1, 1, None)]),
        ("oscillator/half_released", 2, [(1, 2, 1, 0.5), (0.5, 2, 1, None)]),
    ],
)
def test_oscillator(prove, case, T, motions):
    parts = [swing(*m) for m in motions]
    value = prove(REFERENCES[case], (lambda t: (t, [p(t) for p in parts]), ZERO, mp.mpf(T)))
    if case == "oscillator":
        assert float(value) == pytest.approx(-0.228828777180143, rel=1e-14)


@pytest.mark.parametrize(
    ("case", "shape"),
    [
        ("beam", lambda x: x**4 - 2 * x**3 + x**2),
        ("beam/supported", lambda x: x**4 - 2 * x**3 + x),
        ("beam/cantilever", lambda x: x**4 - 4 * x**3 + 6 * x**2),
    ],
)
def test_beam(prove, case, shape):
    prove(REFERENCES[case], (lambda x: (x, shape(x) / 16), ZERO, ONE))


def test_beam_under_tension(prove):
    k = mp.mpf(5)
    scale = 1 / (1 - 2 * mp.tanh(k / 2) / k)

    def y(x):
        return scale * (x - (mp.sinh(k * (x - ONE / 2)) + mp.sinh(k / 2)) / (k * mp.cosh(k / 2)))

    prove(REFERENCES["beam/tension"], (lambda x: (x, y(x)), ZERO, ONE))


def test_natural_spline(prove):
    rise = lambda x: (x, (3 * x - x**3) / 2)  # noqa: E731
    prove(REFERENCES["spline"], (rise, ZERO, ONE), (lambda x: (x, rise(2 - x)[1]), ONE, 2 * ONE))


def test_hermite_spline(prove):
    prove(REFERENCES["spline/plane"], (lambda x: (x, [x + x**2 - x**3, 2 * x**2 - x**3]), ZERO, ONE))


@pytest.mark.parametrize(("case", "penalty"), [("regulator", 0), ("regulator/end_cost", 2)])
def test_regulator(prove, case, penalty):
    # y' = -penalty y at the end
    slope = -(mp.sinh(1) + penalty * mp.cosh(1)) / (mp.cosh(1) + penalty * mp.sinh(1))
    prove(REFERENCES[case], (lambda x: (x, mp.cosh(x) + slope * mp.sinh(x)), ZERO, ONE))


def test_boundary_layer(prove):
    k = 1 / mp.sqrt(mp.mpf(REFERENCES["regulator/layer"].problem.parameters["eps"]))
    prove(REFERENCES["regulator/layer"], (lambda x: (x, mp.sinh(k * (1 - x)) / mp.sinh(k)), ZERO, ONE))


def test_followed_signal(prove):
    problem = REFERENCES["regulator/signal"].problem
    eps, end = mp.mpf(problem.parameters["eps"]), mp.mpf(problem.end.x)
    # the last period ends at a double, where the sine is not quite zero
    rest = mp.sin(end) / mp.sinh(end / mp.sqrt(eps))
    prove(
        REFERENCES["regulator/signal"],
        (lambda x: (x, (mp.sin(x) - rest * mp.sinh(x / mp.sqrt(eps))) / (1 + eps)), ZERO, end),
    )


def test_elastic_support(prove):
    T = mp.mpf(2)

    def string(k):
        return lambda x: k - k * mp.cosh(x) + (1 - k + k * mp.cosh(T)) / mp.sinh(T) * mp.sinh(x)

    # dJ/dk = 0: the integral of y - k is T k
    k = mp.findroot(lambda k: mp.quad(lambda x: string(k)(x) - 2 * k, [0, T]), 0.2)
    prove(REFERENCES["elastic_support"], (lambda x: (x, string(k)(x)), ZERO, T), unknowns=[k])
    assert float(k) == pytest.approx(math.tanh(1) / (2 + 2 * math.tanh(1)), rel=1e-15)


def test_periodic_load(prove):
    value = prove(REFERENCES["periodic_load"], (lambda x: (x, mp.cos(x) / 3 + mp.sin(2 * x) / 6), ZERO, 2 * mp.pi))
    assert abs(value + mp.pi / 4) < 1e-30


@pytest.mark.parametrize(("case", "rate", "middle"), [("bratu", 3, 0.640146696041464), ("bratu/mild", 1, None)])
def test_bratu(prove, case, rate, middle):
    theta = mp.findroot(lambda t: t - mp.sqrt(2 * rate) * mp.cosh(t / 4), 2)
    y = lambda x: 2 * mp.log(mp.cosh(theta / 4) / mp.cosh((x - mp.mpf(0.5)) * theta / 2))  # noqa: E731
    prove(REFERENCES[case], (lambda x: (x, y(x)), ZERO, ONE))
    if middle is not None:
        assert float(y(mp.mpf(0.5))) == pytest.approx(middle, rel=1e-14)
