"""Arcs and circles of the isoperimetric problems, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import chord_and_arc, dido_shore, isoperimetric_circle

REFERENCES = {r.name: r for r in (*chord_and_arc.references, *dido_shore.references, *isoperimetric_circle.references)}


def arc(length, guess):
    """Half angle and radius of the arc over a chord of length 2."""
    angle = mp.findroot(lambda a: mp.sin(a) / a - mp.mpf(2) / length, guess)
    return angle, 1 / mp.sin(angle)


@pytest.mark.parametrize("case", ["chord_and_arc", "chord_and_arc/between"])
def test_graph(prove, case):
    angle, r = arc(3, 1.5)
    curve = lambda p: (r * mp.sin(p), r * (mp.cos(p) - mp.cos(angle)))  # noqa: E731
    area = prove(REFERENCES[case], (curve, -angle, angle), multipliers=[-r])
    assert float(r) == pytest.approx(1.00282021911990, rel=1e-14)
    assert float(area) == pytest.approx(1.42907454463303, rel=1e-14)


def test_overhanging_curve(prove):
    angle, r = arc(4, 1.9)
    curve = lambda p: [r * mp.sin(p), r * (mp.cos(p) - mp.cos(angle))]  # noqa: E731
    area = prove(REFERENCES["chord_and_arc/curve"], (curve, -angle, angle), multipliers=[-r])
    assert float(angle) == pytest.approx(1.89549426703398, rel=1e-14)
    assert float(area) == pytest.approx(2.44687896394576, rel=1e-14)


def test_closed_curve(prove):
    r = 3 / (2 * mp.pi)
    curve = lambda p: [r * mp.cos(p), r * mp.sin(p)]  # noqa: E731
    prove(REFERENCES["isoperimetric_circle"], (curve, mp.mpf(0), 2 * mp.pi), multipliers=[-r])


@pytest.mark.parametrize("case", ["dido_shore", "dido_shore/free"])
def test_shore(prove, case):
    r = 3 / mp.pi
    curve = lambda p: [r * (1 - mp.cos(p)), r * mp.sin(p)]  # noqa: E731
    prove(REFERENCES[case], (curve, mp.mpf(0), mp.pi), multipliers=[-r])
