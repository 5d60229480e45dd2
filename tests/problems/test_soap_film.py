"""The catenaries of soap films, in 40 digits."""

import mpmath as mp
import pytest

from varcalc.problems import soap_film

REFERENCES = {r.name.partition("/")[2]: r for r in soap_film.references}


@pytest.mark.parametrize(
    ("case", "a", "neck", "value"),
    [
        ("", 0.5, 0.848337938094979, 0.953624106702003),
        ("local", 0.6, 0.745071089852171, None),
        ("fold", 0.6627, 0.5573, None),
    ],
)
def test_equal_rings(prove, case, a, neck, value):
    c = mp.findroot(lambda c: c * mp.cosh(mp.mpf(a) / c) - 1, neck)
    area = prove(REFERENCES[case], (lambda x: (x, c * mp.cosh(x / c)), -mp.mpf(a), mp.mpf(a)))
    assert float(c) == pytest.approx(neck, rel=1e-14 if case != "fold" else 1e-2)
    if value is not None:
        assert float(area) == pytest.approx(value, rel=1e-14)


def test_unequal_rings(prove):
    end = mp.mpf(0.8)
    c, b = mp.findroot(lambda c, b: (c * mp.cosh(b / c) - 1, c * mp.cosh((end - b) / c) - 1.5), (0.97, 0.2))
    prove(REFERENCES["unequal"], (lambda x: (x, c * mp.cosh((x - b) / c)), mp.mpf(0), end))


def test_the_stable_one_of_two_is_given():
    # the other root has its lowest point much nearer the axis and more area
    assert REFERENCES["unequal"].exact.y(0.2) > 0.9
    assert REFERENCES["local"].exact.value > 1 > REFERENCES[""].exact.value
