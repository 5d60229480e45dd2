"""Deflection angles of a Lennard-Jones potential beside SciPy's quad, with what both are off by.

    python benchmarks/scattering.py [--angles N] [--energy E]

Processor time. What both are held against is the same integral in many digits, by mpmath, at a few impact parameters.
"""

from __future__ import annotations

import argparse
import time

import mpmath as mp
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from varcalc import mechanics

HELD, BY_QUAD = 8, 200


def potential(r: float) -> float:
    """Of depth 1."""
    return 4 * (r**-12 - r**-6)


def by_quad(impact: float, energy: float) -> float:
    """The angle as it is written in textbooks, with r = r₁/(1 - x²)."""
    closest = brentq(lambda r: 1 - potential(r) / energy - (impact / r) ** 2, 0.6, 1.1 + impact, xtol=1e-15)

    def rate(x: float) -> float:
        r = closest / (1 - x * x)
        return 2 * x * impact / (closest * np.sqrt(abs(1 - potential(r) / energy - (impact / r) ** 2)))

    return np.pi - 2 * quad(rate, 0, 1, epsabs=1e-13, epsrel=1e-13, limit=200)[0]


def exact(impact: float, energy: float, near: float) -> float:
    """The same in 30 digits."""
    with mp.workdps(30):
        b = mp.mpf(impact)
        closest = mp.findroot(lambda r: 1 - potential(r) / energy - (b / r) ** 2, near)

        def rate(x: mp.mpf) -> mp.mpf:
            r = closest / (1 - x**2)
            return 2 * x * b / (closest * mp.sqrt(1 - potential(r) / energy - (b / r) ** 2))

        return float(mp.pi - 2 * mp.quad(rate, [0, 0.4, 0.75, 1], method="gauss-legendre", maxdegree=6))


def main() -> None:
    """Prints both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=100_000)
    parser.add_argument("--energy", type=float, default=2.0)
    given = parser.parse_args()
    scattering, impact = mechanics.Scattering(potential, given.energy), np.linspace(0.05, 3.0, given.angles)
    began = time.process_time()
    found = scattering.deflection(impact)
    rate = given.angles / (time.process_time() - began)
    some = np.linspace(0, given.angles - 1, HELD).astype(int)
    known = np.array([exact(float(impact[k]), given.energy, float(found.closest[k])) for k in some])
    print(f"varcalc: {rate:,.0f} angles a second, off by {np.abs(found.angle[some] - known).max():.1e}")
    began = time.process_time()
    for b in np.linspace(0.05, 3.0, BY_QUAD):
        by_quad(float(b), given.energy)
    rate = BY_QUAD / (time.process_time() - began)
    off = max(abs(by_quad(float(impact[k]), given.energy) - known[i]) for i, k in enumerate(some))
    print(f"SciPy's quad: {rate:,.0f} angles a second, off by {off:.1e}")


if __name__ == "__main__":
    main()
