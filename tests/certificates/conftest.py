"""Closed forms in 60 digits, and what a certificate proves, in as many."""

from fractions import Fraction

import mpmath
import pytest


@pytest.fixture(autouse=True)
def _sixty_digits():
    with mpmath.workdps(60):
        yield


@pytest.fixture
def bounds():
    """The two ends of a certificate's interval."""
    return lambda certificate: [mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure)]
