"""Strings on obstacles, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import obstacle

REFERENCES = {r.name.partition("/")[2]: r for r in obstacle.references}
ZERO, ONE = mp.mpf(0), mp.mpf(1)


@pytest.mark.parametrize("case", ["", "string"])
def test_hill(prove, piece, case):
    s = 2 - mp.sqrt(3)
    prove(
        REFERENCES[case],
        piece(lambda x: (x, 2 * s * (2 + x)), -2 * ONE, -s),
        piece(lambda x: (x, 1 - x**2), -s, s, touching=True),
        piece(lambda x: (x, 2 * s * (2 - x)), s, 2 * ONE),
    )


def test_disc(prove, piece):
    touch = mp.matrix([-ONE / 2, mp.sqrt(3) / 2])
    arc = lambda a: [-mp.cos(a), mp.sin(a)]  # noqa: E731
    prove(
        REFERENCES["disc"],
        piece(lambda t: [-2 + t * (touch[0] + 2), t * touch[1]], ZERO, ONE),
        piece(arc, mp.pi / 3, 2 * mp.pi / 3, touching=True),
        piece(lambda t: [-touch[0] + t * (2 + touch[0]), (1 - t) * touch[1]], ZERO, ONE),
    )


def test_bounded_slope(prove, piece):
    a = 3 * ONE / 4
    prove(
        REFERENCES["slope"],
        piece(lambda x: (x, x), ZERO, a, touching=True),
        piece(lambda x: (x, 7 * ONE / 8 - 2 * (1 - x) ** 2), a, 2 - a),
        piece(lambda x: (x, 2 - x), 2 - a, 2 * ONE, touching=True),
    )
