"""Random problems certified: how many, how narrowly, in what time, and whether any interval misses the truth.

    python benchmarks/certificates.py [COUNT]

Convex quadratics with a closed form, actions of oscillators up to a conjugate point (and beyond, where nothing may be
proved), and problems made so that a polynomial is their extremal: v^2/2 - A cos(y) + f(x) y with f its defect. The
truth is taken in 50 digits at the doubles of the problem. Soap films are followed to their fold.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import casadi as ca
import mpmath
import numpy as np

import varcalc as vc

DIGITS = 50


def quadratic(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int (a v^2 + b y^2)/2 from 0 to Y in T: sqrt(a b) coth(sqrt(b/a) T) Y^2/2."""
    a, b, T, Y = 10 ** random.uniform(-2, 2, 4)
    problem = vc.Problem(
        lambda x, y, v, p: (p.a * v**2 + p.b * y**2) / 2, vc.Fixed(0, 0), vc.Fixed(T, Y), parameters={"a": a, "b": b}
    )
    A, B, t, h = map(mpmath.mpf, (a, b, T, Y))
    return problem, mpmath.sqrt(A * B) * mpmath.coth(mpmath.sqrt(B / A) * t) * h**2 / 2


def oscillator(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int (v^2 - y^2)/2 from 0 to Y in T: Y^2 cot(T)/2 for T < pi, and no minimum beyond."""
    T, Y = random.uniform(0.1, 4.0), random.uniform(-2, 2)
    problem = vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(T, Y))
    return problem, mpmath.mpf(Y) ** 2 * mpmath.cot(mpmath.mpf(T)) / 2 if mpmath.pi > T else None


def manufactured(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int v^2/2 - A cos(y) + f(x) y with f = Y'' - A sin(Y): the cubic Y is an extremal, a minimum for |A| < pi^2."""
    # so short that sums and small multiples of them are doubles: the curve meets its ends exactly
    c, A = random.integers(-64, 65, 4) / 64, random.uniform(0, 8)

    def curve(x: Any) -> tuple[Any, Any, Any]:
        y = ((c[3] * x + c[2]) * x + c[1]) * x + c[0]
        return y, (3 * c[3] * x + 2 * c[2]) * x + c[1], 6 * c[3] * x + 2 * c[2]

    def lagrangian(x: Any, y: Any, v: Any) -> Any:
        at, _, bend = curve(x)
        return v**2 / 2 - A * ca.cos(y) + (bend - A * ca.sin(at)) * y

    def value(x: Any) -> Any:
        at, slope, bend = curve(mpmath.mpf(x))
        return slope**2 / 2 - A * mpmath.cos(at) + (bend - A * mpmath.sin(at)) * at

    problem = vc.Problem(lagrangian, vc.Fixed(0, curve(0.0)[0]), vc.Fixed(1, float(sum(c[::-1]))))
    return problem, mpmath.quad(value, [0, 0.5, 1])


def outcome(problem: vc.Problem, exact: Any, widths: list[float], times: list[float]) -> str:
    """What becomes of one problem; ``exact`` is None where there is no minimum."""
    try:
        solution = vc.solve(problem)
        began = time.process_time()
        certificate = vc.certify(solution)
    except vc.VariationalError:
        return "refused, rightly" if exact is None else "refused"
    times.append(time.process_time() - began)
    widths.append(certificate.width / max(abs(certificate.lower), 1e-300))
    if exact is None:
        return "PROVED WHAT IS FALSE"
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return "certified" if low <= exact <= high else "MISSED THE TRUTH"


def films() -> Iterator[str]:
    """Soap films towards the fold at 0.6627434193491815..., which 13 digits are given of."""
    for k in range(1, 9):
        a = 0.6627434193492 - 10.0**-k
        film = vc.Problem(lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(-a, 1), vc.Fixed(a, 1))
        try:
            solution = vc.solve(film)
            began = time.process_time()
            certificate = vc.certify(solution)
        except vc.VariationalError as refusal:
            yield f"film 1e-{k} before the fold: {refusal}"
        else:
            spent = time.process_time() - began
            told = f"width {certificate.width:.1e}, tube {certificate.tube:.1e}, {spent:.2f} s"
            yield f"film 1e-{k} before the fold: {told}"


def main(count: int) -> None:
    """Print the counts of each family, and the films."""
    with mpmath.workdps(DIGITS):
        for family in (quadratic, oscillator, manufactured):
            random, counts = np.random.default_rng(1), Counter[str]()
            widths: list[float] = []
            times: list[float] = []
            for _ in range(count):
                counts[outcome(*family(random), widths, times)] += 1
            spread = f"median width {np.median(widths):.1e}, {1e3 * np.median(times):.0f} ms, worst {max(times):.2f} s"
            print(f"{family.__name__}: {dict(counts)}; {spread}")
    for line in films():
        print(line)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
