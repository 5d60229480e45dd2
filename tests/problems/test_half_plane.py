"""The semicircles of the half-plane, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import half_plane

REFERENCES = {r.name.partition("/")[2]: r for r in half_plane.references}


def semicircle(start, end):
    """Centre, radius, and the angles of the ends from the downward x axis."""
    (x0, y0), (x1, y1) = (map(mp.mpf, p) for p in (start, end))
    centre = mp.findroot(lambda m: (x0 - m) ** 2 + y0**2 - (x1 - m) ** 2 - y1**2, 1)
    radius = mp.hypot(x0 - centre, y0)
    first, last = mp.atan2(y0, centre - x0), mp.atan2(y1, centre - x1)
    return (lambda a: (centre - radius * mp.cos(a), radius * mp.sin(a))), first, last


@pytest.mark.parametrize(
    ("case", "start", "end", "H"),
    [("", (0, 1), (2, 2), 1), ("low", (0, 0.1), (2, 0.1), 1), ("ray", (0, 1), (3, 0.5), 1.5)],
)
def test_graph(prove, case, start, end, H):
    curve, first, last = semicircle(start, end)
    value = prove(REFERENCES[case], (curve, first, last))
    square = mp.mpf(end[0] - start[0]) ** 2 + mp.mpf(end[1] - start[1]) ** 2
    assert abs(value - H * mp.acosh(1 + square / (2 * mp.mpf(start[1]) * mp.mpf(end[1])))) < 1e-25


def test_curve(prove):
    curve, first, last = semicircle((0, 1), (1, 2))
    prove(REFERENCES["curve"], (lambda a: list(curve(a)), first, last))


def test_waypoint(prove):
    prove(REFERENCES["waypoint"], semicircle((0, 1), (1, 2)), semicircle((1, 2), (3, 1)))
