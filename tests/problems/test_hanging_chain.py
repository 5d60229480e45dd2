"""The catenaries of hanging chains, in 40 digits."""

import mpmath as mp
import pytest

import varcalc as vc
from varcalc.problems import hanging_chain

REFERENCES = {r.name.partition("/")[2]: r for r in hanging_chain.references}


def catenary(span, rise, length, guess):
    """y, and the multiplier that raises the directrix to y = -k, of a chain from the origin."""
    span, rise, length = mp.mpf(span), mp.mpf(rise), mp.mpf(length)
    c = mp.findroot(lambda c: 2 * c * mp.sinh(span / (2 * c)) - mp.sqrt(length**2 - rise**2), guess)
    lowest = span / 2 - c * mp.atanh(rise / length)
    k = -c * mp.cosh(lowest / c)
    return (lambda x: (x, c * mp.cosh((x - lowest) / c) + k)), -k


@pytest.mark.parametrize(
    ("case", "span", "rise", "length", "guess", "sag"),
    [
        ("", 1, 0, 1.5, 0.3, 0.502633261648315),
        ("unequal", 2, 1, 3, 0.6, None),
        ("shallow", 1, 0, 1.01, 2, 0.0614511611163111),
        ("taut", 1, 0, 1.0001, 20, 0.00612393868316615),
    ],
)
def test_chain(prove, case, span, rise, length, guess, sag):
    curve, height = catenary(span, rise, length, guess)
    # the energy of the unequal chain is a small difference of its two ends' parts
    prove(REFERENCES[case], (curve, mp.mpf(0), mp.mpf(span)), multipliers=[height], scale=rise)
    if sag is not None:
        assert float(-curve(mp.mpf(0.5))[1]) == pytest.approx(sag, rel=1e-14)


def test_end_that_slides_on_a_pole(prove):
    curve, height = catenary(2, 0, 3, 0.6)
    prove(REFERENCES["sliding"], (curve, mp.mpf(0), mp.mpf(1)), multipliers=[height])


@pytest.mark.parametrize("method", [vc.Ritz(), vc.Collocation(), vc.FirstIntegral()])
@pytest.mark.parametrize("slack", [1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 0.1, 0.5, 1.0])
def test_no_claim_is_finer_than_round_off(method, slack):
    # a taut chain is stiff: what round-off leaves of its length costs the tension, hundreds of times the value
    length = 1 + slack
    c = mp.findroot(lambda c: 2 * c * mp.sinh(1 / (2 * c)) - mp.mpf(length), 1 / mp.sqrt(24 * slack))
    exact = -(c**2) * (mp.sinh(1 / c) - 1 / c) / 2
    problem = vc.Problem(
        hanging_chain.energy, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(hanging_chain.arc_length, length)]
    )
    solution = vc.solve(problem, method)
    assert abs(solution.value - exact) <= 3 * solution.error.value
