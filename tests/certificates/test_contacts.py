"""Bounds of several functions, whose places of contact a solver knows to its mesh: the certificate finds them."""

from functools import cache
from itertools import pairwise

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates.contacts import TouchedArc, at_contacts
from varcalc.verify.along_curve import along_curve


def round_a_ball(width, radius, n=2):
    """The shortest curve between the points -width and width on an axis round a ball about the middle."""
    start, end = ((sign * width, *[0] * (n - 1)) for sign in (-1, 1))
    ball = vc.Bound(lambda q, dq: ca.sumsqr(q), lower=radius**2)
    return vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At(start), vc.At(end), [ball])


@cache
def string_round_a_disc(width, radius):
    return vc.solve(round_a_ball(width, radius))


@pytest.mark.parametrize(("width", "radius"), [(2, 1), (1.5, 0.5), (3, 2)])
def test_a_string_round_a_disc(width, radius, bounds):
    """Two tangents and an arc: 2 sqrt(w^2 - r^2) + 2 r asin(r/w)."""
    certificate = vc.certify(string_round_a_disc(width, radius))
    w, r = mpmath.mpf(width), mpmath.mpf(radius)
    low, high = bounds(certificate)
    assert low <= 2 * mpmath.sqrt(w**2 - r**2) + 2 * r * mpmath.asin(r / w) <= high
    assert high - low < 1e-13
    assert certificate.tube < 1  # on the other side it is as short


def test_a_string_round_a_ball_in_space(bounds):
    """As round a disc in the plane of its ends and the middle: two tangents and what is left of the angle."""
    ball = vc.Bound(lambda q, dq: ca.sumsqr(q), lower=1)
    string = vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((-2, 0.25, 0.25)), vc.At((2, 0.25, 0.5)), [ball])
    a, b = (mpmath.sqrt(mpmath.mpf(v)) for v in ("4.125", "4.3125"))
    angle = mpmath.acos((mpmath.mpf(-4) + mpmath.mpf("0.1875")) / (a * b)) - mpmath.acos(1 / a) - mpmath.acos(1 / b)
    low, high = bounds(vc.certify(vc.solve(string)))
    assert low <= mpmath.sqrt(a**2 - 1) + mpmath.sqrt(b**2 - 1) + angle <= high
    assert high - low < 1e-12


def test_the_places_of_contact_are_those_of_the_tangents():
    """A particle of least energy round a disc runs at constant speed: it comes to it after the share of a tangent."""
    solution = string_round_a_disc(3, 2)
    along = along_curve(solution.extremal)
    s, tangent, whole = along.symbols, np.sqrt(5), 2 * np.sqrt(5) + 4 * np.arcsin(2 / 3)
    disc = (ca.sumsqr(s.y) / 4 - 1,)
    edges = [0, 0.2, 0.3026, 0.45, 0.55, 0.6974, 1]
    pieces = [TouchedArc(a, b, disc if 0.3 < a < 0.6 else ()) for a, b in pairwise(edges)]
    found = at_contacts(along, ca.sumsqr(s.dy), pieces)
    share = tangent / whole
    assert np.abs(found.vertices - [0, share, 1 - share, 1]).max() < 1e-12
    assert np.abs((found.evaluate(np.linspace(share, 1 - share, 9), 0) ** 2).sum(axis=0) / 4 - 1).max() < 1e-12


def test_places_that_are_known_are_left_alone():
    solution = string_round_a_disc(3, 2)
    along = along_curve(solution.extremal)
    disc = (ca.sumsqr(along.symbols.y) / 4 - 1,)
    arcs = [TouchedArc(0, 0.3026, ()), TouchedArc(0.3026, 0.6974, disc), TouchedArc(0.6974, 1, ())]
    assert at_contacts(along, ca.sumsqr(along.symbols.dy), arcs) is None
