"""Higher eigenvalues of Rayleigh's quotient, held against closed forms in 60 digits."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import spectrum
from varcalc.certificates.balls import flint, working
from varcalc.certificates.integrals import Unproved


def quotient(lagrangian, start=None, end=None, weight=lambda x, y, v: y**2, level=1.0, **more):
    ends = start or vc.Fixed(0, 0), end or vc.Fixed(1, 0)
    return vc.Problem(lagrangian, *ends, [vc.Isoperimetric(weight, level)], **more)


def holds(proved, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, proved.enclosure))
    return low <= exact <= high and proved.lower <= exact <= proved.upper


def airy(energy):
    """Vanishes where y'' = (x - energy) y has a solution with zero ends in [0, 1]."""
    return mpmath.airyai(-energy) * mpmath.airybi(1 - energy) - mpmath.airyai(1 - energy) * mpmath.airybi(-energy)


def bessel(count):
    """int x v^2 under int x y^2 = 1 on [1, 2]: zeros of a cross product of Bessel functions, squared."""

    def missed(k):
        return mpmath.besselj(0, k) * mpmath.bessely(0, 2 * k) - mpmath.besselj(0, 2 * k) * mpmath.bessely(0, k)

    return [mpmath.findroot(missed, n * mpmath.pi) ** 2 for n in range(1, count + 1)]


def between_walls(count):
    """y'' = (x^2 - E) y is exp(-x^2/2) times Kummer's function, for odd solutions x times another; zero at x = 6."""

    def missed(energy, odd):
        return mpmath.hyp1f1((1 + 2 * odd - energy) / 4, mpmath.mpf(1 + 2 * odd) / 2, 36)

    near = [(2 * k + 1, 2 * k + 1 + mpmath.mpf(10) ** -6) for k in range(count)]
    return [mpmath.findroot(lambda e, k=k: missed(e, k % 2), n, solver="secant") for k, n in enumerate(near)]


SPECTRA = {
    "string": (lambda x, y, v: v**2, {}, lambda n: [(k * mpmath.pi) ** 2 for k in range(1, n + 1)]),
    "one free end": (
        lambda x, y, v: v**2, {"end": vc.Free(1)}, lambda n: [((k - 0.5) * mpmath.pi) ** 2 for k in range(1, n + 1)]
    ),
    "two free ends": (
        lambda x, y, v: v**2 - 30 * y**2, {"start": vc.Free(0), "end": vc.Free(1)},
        lambda n: [(k * mpmath.pi) ** 2 - 30 for k in range(n)],
    ),
    "a ramp": (
        lambda x, y, v: v**2 + x * y**2, {},
        lambda n: [mpmath.findroot(airy, (k * mpmath.pi) ** 2 + 0.5) for k in range(1, n + 1)],
    ),
    "a ring": (
        lambda x, y, v: x * v**2,
        {"start": vc.Fixed(1, 0), "end": vc.Fixed(2, 0), "weight": lambda x, y, v: x * y**2, "level": 7.0}, bessel,
    ),
    "an oscillator between walls": (
        lambda x, y, v: v**2 + x**2 * y**2, {"start": vc.Fixed(-6, 0), "end": vc.Fixed(6, 0)}, between_walls
    ),
    "a slope that is mixed in": (  # y v integrates to nothing between zeros
        lambda x, y, v: v**2 + 6 * y * v, {}, lambda n: [(k * mpmath.pi) ** 2 for k in range(1, n + 1)]
    ),
    "a constant of its own": (
        lambda x, y, v: 0.1 * v**2, {},
        lambda n: [mpmath.mpf(0.1) * (k * mpmath.pi) ** 2 for k in range(1, n + 1)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SPECTRA)
def test_each_of_the_lowest_eigenvalues_lies_in_its_interval(name):
    lagrangian, more, exact = SPECTRA[name]
    found = vc.certify_eigenvalues(quotient(lagrangian, **more), 4)
    for proved, value in zip(found, exact(4), strict=True):
        assert holds(proved, value)
        assert proved.width < 1e-16 * max(1.0, abs(proved.upper))
    assert [e.number for e in found] == [1, 2, 3, 4]


def test_a_well_with_a_wall_in_its_middle_has_pairs_of_eigenvalues_close_together():
    """Steps of a potential on [-1, 1], even: k tan or cot equations on either side of the wall."""
    height = 200.0
    problem = quotient(
        lambda x, y, v: v**2 + ca.if_else(ca.fabs(x) < 0.25, height, 0.0) * y**2, vc.Fixed(-1, 0), vc.Fixed(1, 0)
    )
    found = vc.certify_eigenvalues(problem, 4)

    def missed(energy, even):
        k, q = mpmath.sqrt(energy), mpmath.sqrt(height - energy)
        inner = q * mpmath.tanh(q / 4) if even else q / mpmath.tanh(q / 4)
        return inner * mpmath.sin(0.75 * k) + k * mpmath.cos(0.75 * k)

    for proved, even in zip(found, (True, False, True, False), strict=True):
        assert holds(proved, mpmath.findroot(lambda e, even=even: missed(e, even), proved.lower))
    assert found[0].upper < found[1].lower


@pytest.mark.parametrize("depth", [10.0, 30.0, 100.0, 1e3, 1e6])
def test_a_narrow_well_is_seen_or_the_proof_is_refused(depth):
    """L = v^2 - 2 (a y/cosh(a x))^2: y = u' - a tanh(a x) u with u'' = -E u, which vanishes at both ends."""
    a, b = -1.3, 0.7
    problem = quotient(
        lambda x, y, v: v**2 - 2 * (depth / ca.cosh(depth * x)) ** 2 * y**2, vc.Fixed(a, 0), vc.Fixed(b, 0)
    )

    def solutions(k, x):
        steep = mpmath.mpf(depth) * mpmath.tanh(mpmath.mpf(depth) * x)
        sine, cosine = mpmath.sin(k * x), mpmath.cos(k * x)
        return cosine - steep * sine / k, -k * sine - steep * cosine

    def missed(energy):
        k = mpmath.sqrt(mpmath.mpc(energy))
        (even, odd), (other, last) = solutions(k, mpmath.mpf(a)), solutions(k, mpmath.mpf(b))
        # y vanishes throughout where E = -a^2 and u = cosh(a x): no eigenvalue
        return mpmath.re(even * last - other * odd) / (energy + mpmath.mpf(depth) ** 2)

    try:
        found = vc.certify_eigenvalues(problem, 2)
    except ArithmeticError:
        assert depth > 30.0
        return
    for proved in found:
        low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, proved.enclosure))
        assert missed(low) * missed(high) < 0
    assert found[0].upper < 0 < found[1].lower


def test_the_greatest_of_a_maximum():
    found = vc.certify_eigenvalues(quotient(lambda x, y, v: -(v**2), maximise=True), 2)
    assert holds(found[0], -(mpmath.pi**2))
    assert holds(found[1], -4 * mpmath.pi**2)


@pytest.mark.parametrize("seed", range(6))
def test_random_weights_with_a_known_spectrum(seed):
    """With y = m s, m = exp(a sin(b x)), int (v^2 + q y^2)/m^2 over int y^2/m^2 is int s'^2 + c s^2 over int s^2."""
    random = np.random.default_rng(seed)
    a, b, c = random.uniform(-1, 1), random.uniform(0.5, 6), random.uniform(-40, 40)

    def weight(x, p):
        return ca.exp(-2 * p.a * ca.sin(p.b * x))

    def energy(x, y, v, p):
        slope, bend = p.a * p.b * ca.cos(p.b * x), -p.a * p.b**2 * ca.sin(p.b * x)
        return weight(x, p) * (v**2 + (bend - slope**2 + p.c) * y**2)

    parameters = {"a": float(a), "b": float(b), "c": float(c)}
    problem = quotient(energy, weight=lambda x, y, v, p: weight(x, p) * y**2, parameters=parameters)
    for k, proved in enumerate(vc.certify_eigenvalues(problem, 3), start=1):
        assert holds(proved, (k * mpmath.pi) ** 2 + mpmath.mpf(float(c)))


@pytest.mark.parametrize("power", [1, 3, 6, 9])
def test_wrong_eigenfunctions_widen_the_intervals_or_are_refused(power, monkeypatch):
    random, estimates = np.random.default_rng(power), spectrum.eigenfunctions

    def wrong(*arguments):
        found = estimates(*arguments)
        mixed = np.einsum("ij,jkl->ikl", random.normal(size=(len(found.values),) * 2), found.values)
        eigenvalues = found.eigenvalues * (1 + 10.0**-power * random.normal(size=len(found.eigenvalues)))
        return replace(found, values=found.values + 10.0**-power * mixed, eigenvalues=np.sort(eigenvalues))

    monkeypatch.setattr(spectrum, "eigenfunctions", wrong)
    try:
        found = vc.certify_eigenvalues(quotient(lambda x, y, v: v**2 + x * y**2), 3)
    except ArithmeticError:
        assert power < 6
        return
    for k, proved in enumerate(found, start=1):
        assert holds(proved, mpmath.findroot(airy, (k * mpmath.pi) ** 2 + 0.5))


def test_an_eigenfunction_left_out_is_noticed(monkeypatch):
    """Of numbers 1, 3, 4 ... the second is no estimate of eigenvalue 2."""
    estimates = spectrum.eigenfunctions

    def without_the_second(*arguments):
        found = estimates(*arguments[:-1], arguments[-1] + 1)
        kept = np.arange(len(found.eigenvalues)) != 1
        return replace(found, values=found.values[kept], eigenvalues=found.eigenvalues[kept])

    monkeypatch.setattr(spectrum, "eigenfunctions", without_the_second)
    with pytest.raises(ArithmeticError, match="zeros between the ends"):
        vc.certify_eigenvalues(quotient(lambda x, y, v: v**2), 2)


@pytest.mark.parametrize("share", [1.001, 1.5])
def test_a_number_that_more_eigenvalues_lie_below_is_refused(share):
    """As r a number beyond eigenvalue m + 1."""
    problem = quotient(lambda x, y, v: v**2)
    ritz = spectrum.eigenfunctions(lambda x: spectrum._coefficients(problem, x), np.array([0.0, 1.0]), (True, True), 4)
    with working(128, 24):
        spectrum._prove_count(problem, ritz, 2, 8.9 * np.pi**2)
        with pytest.raises(Unproved):
            spectrum._prove_count(problem, ritz, 2, share * 9 * np.pi**2)


def test_negative_dimensions_are_never_too_many():
    random, ball = np.random.default_rng(0), flint().arb
    for _ in range(200):
        size = int(random.integers(1, 6))
        matrix = random.normal(size=(size, size))
        matrix = matrix + matrix.T
        counted = spectrum.negative([[ball(float(v), 1e-3) for v in row] for row in matrix])
        moved = matrix + 1e-3 * np.diag(random.uniform(-1, 1, size))
        assert counted <= int((np.linalg.eigvalsh(moved) < 0).sum())


REFUSED = {
    "not quadratic": (lambda x, y, v: v**2 + y**4, {}, "not proved quadratic"),
    "not homogeneous": (lambda x, y, v: v**2 + y, {}, "not proved quadratic"),
    "an end off zero": (lambda x, y, v: v**2, {"end": vc.Fixed(1, 0.5)}, "off zero"),
    "a weight of the slope": (lambda x, y, v: v**2, {"weight": lambda x, y, v: v**2 + y**2}, "depends on the slope"),
    "a weight of both signs": (lambda x, y, v: v**2, {"weight": lambda x, y, v: (x - 0.5) * y**2}, "not positive"),
    "no ellipticity": (lambda x, y, v: (x - 0.5) * v**2, {}, "."),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_such_spectrum_is_refused(name):
    lagrangian, more, reason = REFUSED[name]
    with pytest.raises(ArithmeticError, match=reason):
        vc.certify_eigenvalues(quotient(lagrangian, **more), 2)


def test_what_is_no_rayleigh_quotient():
    plain = vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0))
    with pytest.raises(ValueError, match="one condition"):
        vc.certify_eigenvalues(plain, 2)
    with pytest.raises(ValueError, match="one function"):
        vc.certify_eigenvalues(quotient(lambda x, y, v: v**2, vc.Periodic(0, 1), vc.Periodic(0, 1)), 2)
    with pytest.raises(TypeError, match=r"varcalc\.Problem"):
        vc.certify_eigenvalues(vc.solve, 2)
    with pytest.raises(ValueError, match="count"):
        vc.certify_eigenvalues(quotient(lambda x, y, v: v**2), 0)
