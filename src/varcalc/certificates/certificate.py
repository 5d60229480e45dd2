"""A certificate: two numbers between which the infimum lies, and the theorem that says so."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from varcalc.certificates.balls import Ball
from varcalc.showing import Fact, Shown, brief, line
from varcalc.solution import Solution


class Scope(Enum):
    """The curves a certificate speaks of: those that meet the ends and all constraints and, of them, the ones named."""

    ALL = "all curves"
    TUBE = "all curves in the tube, of any slope"
    WEAK = "all curves in the tube whose slopes are near too"


class Means(Enum):
    """How a hypothesis was proved."""

    BALLS = "by ball arithmetic"
    COMPOSITION = "by the rules of composition of convex functions"
    CONSTRUCTION = "by construction"


@dataclass(frozen=True)
class Hypothesis:
    """What the theorem needs, and how it was proved."""

    sentence: str
    means: Means

    def __str__(self) -> str:
        return f"{self.sentence} ({self.means.value})"


@dataclass(frozen=True)
class Distance:
    """How far any curve as good as the certified one lies from it, in y: root mean square over x, and largest."""

    mean: float
    largest: float


@dataclass(frozen=True, repr=False, kw_only=True)
class ProvedInterval(Shown):
    """Two numbers between which a third is proved to lie.

    ``lower`` and ``upper`` are doubles, rounded outward, ``enclosure`` the same interval as decimal strings with as
    many digits as it has. ``proved`` lists the hypotheses of the theorem, each with how it was proved; ``seconds`` is
    what the proof took.
    """

    lower: float
    upper: float
    enclosure: tuple[str, str]
    proved: tuple[Hypothesis, ...]
    seconds: float

    @property
    def width(self) -> float:
        """Length of the interval, from its decimal strings."""
        low, high = map(Fraction, self.enclosure)
        return float(high - low)

    @property
    def digits(self) -> int:
        """How many decimal digits of the value are proved."""
        size = max(abs(self.lower), abs(self.upper))
        return max(0, math.floor(-math.log10(self.width / size))) if self.width and size else 0

    def __contains__(self, value: float) -> bool:
        """Whether a number lies in the interval."""
        low, high = map(Fraction, self.enclosure)
        return low <= Fraction(value) <= high

    def _facts(self) -> Iterator[Fact]:
        for label, bound in zip(("at least", "at most"), self.enclosure, strict=True):
            yield Fact(label, bound)
        yield Fact("width", f"{self.width:.1g}")
        yield from (Fact("" if k else "proved", str(hypothesis)) for k, hypothesis in enumerate(self.proved))
        yield Fact("seconds", f"{self.seconds:.2g}")

    def _theorem(self, what: str, more: str) -> str:
        """The theorem about ``what``, and its hypotheses; ``more`` follows the width."""
        low, high = self.enclosure
        lines = [f"theorem:  {low}", f"          <= {what} <=", f"          {high}"]
        lines += [f"          The width is {self.width:.1g}. {more}".rstrip()]
        lines += [f"{'proved:' if not k else '':<9} {hypothesis}" for k, hypothesis in enumerate(self.proved)]
        return "\n".join([*lines, f"seconds:  {self.seconds:.2g}"])


@dataclass(frozen=True, repr=False, kw_only=True)
class Certificate(ProvedInterval):
    """A proof that the infimum (the supremum of a maximum) lies between ``lower`` and ``upper``.

    ``scope`` tells of which curves it is the infimum: ``tube`` is the greatest distance
    ``|y(x) - y0(x)|`` of these and ``slopes`` that of ``y'(x)`` from ``y0'(x)``, each infinite where it is not
    limited; ``integrals`` is the greatest difference, up to any x, of what is integrated to a prescribed level (one
    for each). Each curve of the scope whose value is as good as that of the certified curve y0 lies within
    ``distance`` of it; an eigenfunction's negative is as good as itself, and ``distance`` is infinite.

    y0 is a polynomial close to the curve of ``solution``, which meets the ends exactly.
    """

    solution: Solution
    scope: Scope
    tube: float
    slopes: float
    integrals: tuple[float, ...]
    distance: Distance

    def __repr__(self) -> str:
        return line("Certificate", [brief(self.solution.problem.name), f"{self.digits} digits", *self.enclosure[:1]])

    def _headline(self) -> str:
        what = "supremum" if self.solution.problem.maximise else "infimum"
        return f"Theorem: the {what} of {self.solution.problem.name} over {self.curves} lies between two numbers."

    def __str__(self) -> str:
        what = "supremum" if self.solution.problem.maximise else "infimum"
        near = f"{self.distance.largest:.1g} of the curve ({self.distance.mean:.1g} in root mean square)"
        # an eigenfunction's negative is as good as itself
        more = f"Whatever is as good lies within {near}." if self.distance.largest < math.inf else ""
        return self._theorem(f"{what} of {self.solution.problem.name} over {self.curves}", more)

    @property
    def curves(self) -> str:
        """The curves of the scope, in words."""
        if self.scope is Scope.ALL:
            return self.scope.value
        slopes = f" and {self.slopes:.3g} of its slope" if self.slopes < math.inf else ", of any slope"
        levels = (
            f" and {', '.join(f'{w:.3g}' for w in self.integrals)} of its integral up to any x"
            if self.integrals
            else ""
        )
        return f"the curves within {self.tube:.3g} of the curve{levels}{slopes},"


def decimals(lower: Ball, upper: Ball) -> tuple[str, str]:
    """Two exact balls as decimal strings, rounded outward, with two digits more than their distance tells."""
    low, high = _fraction(lower), _fraction(upper)
    size = max(abs(low), abs(high))
    width = high - low
    if not size:
        return "0", "0"
    digits = 20 if not width else 2 - _exponent(width)
    return _rounded(low, digits, down=True), _rounded(high, digits, down=False)


def _fraction(ball: Ball) -> Fraction:
    mantissa, exponent = (int(v) for v in ball.mid().man_exp())
    return Fraction(mantissa) * Fraction(2) ** exponent


def _exponent(value: Fraction) -> int:
    """The power of ten of the leading digit."""
    e = math.floor((value.numerator.bit_length() - value.denominator.bit_length()) * math.log10(2))
    while Fraction(10) ** (e + 1) <= value:
        e += 1
    while Fraction(10) ** e > value:
        e -= 1
    return e


def _rounded(value: Fraction, places: int, *, down: bool) -> str:
    """The number with so many decimal places."""
    scaled = value * Fraction(10) ** places
    whole = math.floor(scaled) if down else math.ceil(scaled)
    if places <= 0:
        return str(whole * 10**-places)
    text = f"{abs(whole):0{places + 1}d}"
    return f"{'-' if whole < 0 else ''}{text[:-places]}.{text[-places:]}"
