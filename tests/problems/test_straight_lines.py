"""Shortest paths in the plane and on surfaces that unroll, in 40 digits."""

from fractions import Fraction

import mpmath as mp
import pytest

from varcalc.problems import cone, cylinder, shortest_path

REFERENCES = {r.name: r for r in (*shortest_path.references, *cylinder.references, *cone.references)}
ONE = mp.mpf(1)


@pytest.mark.parametrize(
    ("case", "line", "end"),
    [
        ("shortest_path", lambda x: (x, 4 * x / 3), 3),
        ("shortest_path/free", lambda x: (x, ONE + 0 * x), 3),
        ("shortest_path/to_parabola", lambda x: (x, x / 2), 2),
        ("shortest_path/to_sphere", lambda x: (x, [3 * x / 2, 3 * x]), Fraction(10, 7)),
        ("shortest_path/curve", lambda t: [-3 * t, 4 * t], 1),
        ("shortest_path/circle_to_line", lambda t: [3 * (1 + t) / 5, 4 * (1 + t) / 5], 1),
        ("cylinder", lambda x: (x, x / 2), 2),
    ],
)
def test_plane(prove, case, line, end):
    prove(REFERENCES[case], (line, 0 * ONE, ONE * Fraction(end).numerator / Fraction(end).denominator))


def test_other_way_round_the_cylinder(prove):
    start = mp.mpf(cylinder.FAR_SIDE)
    value = prove(REFERENCES["cylinder/other_way"], (lambda x: (x, x / start), start, 0 * ONE))
    assert float(value) == pytest.approx(4.39837201424, abs=1e-11)


def test_helix_in_space(prove):
    turn = mp.atan2(4, 3)
    helix = lambda t: [5 * mp.cos(turn * t), 5 * mp.sin(turn * t), 2 * t]  # noqa: E731
    prove(REFERENCES["cylinder/embedded"], (helix, 0 * ONE, ONE))


def test_cone(prove):
    sine = mp.mpf(cone.SINE)
    # the straight line at the distance d from the apex, nearest it at the angle b
    b = mp.findroot(lambda b: mp.cos(b) - 1.5 * mp.cos(2 * sine - b), 0.3)
    prove(REFERENCES["cone"], (lambda x: (x, mp.cos(b) / mp.cos(sine * x - b)), 0 * ONE, 2 * ONE))


def test_cone_in_space(prove):
    end = 3 * mp.pi / 10
    b = mp.findroot(lambda b: 5 * mp.cos(b) - 10 * mp.cos(end - b), -0.1)

    def curve(psi):
        r = 5 * mp.cos(b) / mp.cos(psi - b)
        phi = psi * 5 / 3
        return [3 * r * mp.cos(phi) / 5, 3 * r * mp.sin(phi) / 5, 4 * r / 5]

    prove(REFERENCES["cone/embedded"], (curve, 0 * ONE, end))
