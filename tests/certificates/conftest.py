"""Closed forms in 60 digits, and what a certificate proves, in as many."""

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates.duality import DualBound
from varcalc.certificates.statement import statement


@pytest.fixture(autouse=True)
def _sixty_digits():
    with mpmath.workdps(60):
        yield


@pytest.fixture
def bounds():
    """The two ends of a certificate's interval."""
    return lambda certificate: [mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure)]


@pytest.fixture
def holds_of_a_wave(bounds):
    """Whether nothing false is proved of a solution on [0, 1] to which a wave is added: it may be refused."""

    def holds(solution, height, exact):
        def wrong(x, k):
            return solution.curve(x, k) + height * (2 * np.pi) ** k * np.sin(2 * np.pi * x + k * np.pi / 2)

        try:
            low, high = bounds(vc.certify(replace(solution, curve=wrong, extremal=None)))
        except vc.VariationalError:
            return True
        return low <= exact <= high

    return holds


@pytest.fixture
def waving():
    """The curve ``along`` of a solution on [0, 1] with a wave of a size added, as its dual is asked for it."""

    def waved(along, size, wave):
        def evaluate(x, k):
            turned = [np.sin, np.cos, lambda t: -np.sin(t)][k](wave * np.pi * x) * (wave * np.pi) ** k
            return along.evaluate(x, k) + size * turned

        dual = DualBound(statement(replace(along, evaluate=evaluate)), [(-np.inf, np.inf)])
        dual.check()
        return dual

    return waved
