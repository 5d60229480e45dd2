"""Crossings of a river, in 40 digits."""

import mpmath as mp

from varcalc.problems import zermelo

REFERENCES = {r.name.partition("/")[2]: r for r in zermelo.references}
ZERO, ONE = mp.mpf(0), mp.mpf(1)


def slope_for(c):
    """y'(x) for the value c of L_y'."""

    def slope(x):
        w = 4 * mp.mpf(zermelo.CURRENT) * x * (1 - x)
        k = w + c * (1 - w**2)
        return k * mp.sqrt((1 - w**2) / (1 - k**2))

    return slope


def landing(c):
    return mp.quad(slope_for(c), [0, 1], method="gauss-legendre")


def test_point_opposite(prove, antiderivative):
    y = antiderivative(slope_for(mp.findroot(landing, -0.4)), ZERO, ONE)
    prove(REFERENCES[""], (lambda x: (x, y(x)), ZERO, ONE))


def test_landing_left_to_the_current(prove):
    w = mp.mpf(zermelo.CURRENT)
    prove(REFERENCES["drift"], (lambda x: (x, w * (2 * x**2 - 4 * x**3 / 3)), ZERO, ONE))


def test_landing_paid_for(prove, antiderivative):
    c = mp.findroot(lambda c: c + 2 * mp.mpf(zermelo.COST) * landing(c), -0.2)
    y = antiderivative(slope_for(c), ZERO, ONE)
    prove(REFERENCES["walk"], (lambda x: (x, y(x)), ZERO, ONE))
