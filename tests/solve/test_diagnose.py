"""diagnose: the verdict on a problem and the numbers behind it."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca
import mpmath
import pytest

import varcalc as vc
from varcalc.solve import examination


def graph(lagrangian, first, last, constraints=(), **more):
    return vc.Problem(lagrangian, vc.Fixed(*first), vc.Fixed(*last), constraints, **more)


def soap_film(half):
    return graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (-half, 1), (half, 1))


def oscillator(duration, rise):
    return graph(lambda x, y, v: (v**2 - y**2) / 2, (0, 0), (duration, rise))


def chain(length):
    level = vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), length)
    return graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (0, 0), (1, 0), [level])


CASES = {
    "a chain shorter than its span": (chain(0.9), "INFEASIBLE"),
    "a chain as long as its span": (chain(1.0), "DEGENERATE"),
    "beyond the conjugate point": (oscillator(4, 1), "UNBOUNDED"),
    "conjugate ends": (oscillator(math.pi, 1), "UNBOUNDED"),
    "conjugate ends at rest": (oscillator(math.pi, 0), "DEGENERATE"),
    "beyond the fold": (soap_film(0.7), "NO_EXTREMAL"),
    "Mania": (graph(lambda x, y, v: (y**3 - x) ** 2 * v**6, (0, 0), (1, 1)), "GAP"),
    "Weierstrass": (graph(lambda x, y, v: x**2 * v**2, (-1, -1), (1, 1)), "NOT_ATTAINED"),
    "Bolza": (graph(lambda x, y, v: (1 - v**2) ** 2 + y**2, (0, 0), (1, 0)), "NOT_ATTAINED"),
    "linear in the slope": (graph(lambda x, y, v: y**2 + x * v, (0, 0), (1, 1)), "SINGULAR"),
    "a straight line": (graph(lambda x, y, v: ca.sqrt(1 + v**2), (0, 0), (1, 1)), "MINIMUM"),
    "a greatest value": (graph(lambda x, y, v: -ca.sqrt(1 + v**2), (0, 0), (1, 1), maximise=True), "MAXIMUM"),
}


@cache
def diagnosed(name):
    return vc.diagnose(CASES[name][0])


@pytest.mark.parametrize("name", CASES)
def test_the_verdict(name):
    (problem, verdict), diagnosis = CASES[name], diagnosed(name)
    assert diagnosis.verdict is vc.Verdict[verdict]
    assert diagnosis.findings
    assert str(diagnosis).startswith(f"{problem.name}: {diagnosis.verdict.value}")
    assert diagnosis.evidence["solution"].status.ok == (verdict in ("MINIMUM", "MAXIMUM"))


@pytest.mark.parametrize(("name", "indices"), [("beyond the conjugate point", [1]), ("conjugate ends", [])])
def test_beyond_a_conjugate_point_there_is_a_saddle_and_at_it_nothing(name, indices):
    assert [extremal.index for extremal in diagnosed(name).evidence["extremals"]] == indices


def test_the_relaxed_value_and_how_it_is_approached():
    diagnosis = diagnosed("Bolza")
    assert diagnosis.relaxed_value == pytest.approx(0, abs=1e-12)
    assert diagnosis.evidence["relaxed"].mixed.all()
    # y = 0 is stationary with J = 1 and fails Legendre: L_vv = 12 v^2 - 4
    [stationary] = [e for e in diagnosis.evidence["extremals"] if abs(e.value - 1) < 1e-9]
    assert math.isinf(stationary.index)
    assert stationary.verification.legendre == pytest.approx(-4, rel=1e-9)


def test_how_the_values_move_with_the_mesh():
    polygons = diagnosed("Weierstrass").evidence["polygons"]
    total = mpmath.nsum(lambda j: 1 / (3 * j**2 + 3 * j + 1), [0, mpmath.inf])
    rates = polygons.values * polygons.elements / 2
    assert rates[-1] == pytest.approx(float(2 / (3 * total)), rel=1e-2)


def test_goldschmidts_curve_is_named():
    film = vc.solve(soap_film(0.6))
    # below the fold at 0.6627 and above 0.5277 the catenary is only local: two discs have half the area 2 pi
    assert film.local
    assert film.lower == pytest.approx(1, abs=1e-9)
    diagnosis = vc.diagnose(soap_film(0.6))
    assert diagnosis.verdict is vc.Verdict.MINIMUM
    assert diagnosis.evidence["broken"].value == pytest.approx(1, abs=1e-9)
    assert not vc.solve(soap_film(0.5)).local  # below y = 0 lies another functional, which has no least value


@pytest.mark.parametrize("unit", [1e-7, 1e7])
def test_goldschmidts_curve_in_any_unit(unit):
    film = vc.solve(graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (-0.6 * unit, unit), (0.6 * unit, unit)))
    assert film.local
    assert film.lower == pytest.approx(unit**2, rel=1e-9)


def test_the_refusal_beyond_the_fold_says_what_was_searched():
    with pytest.raises(vc.VariationalError, match=r"initial slope in \[-1e\+06, 1e\+06\].*broken curve") as refusal:
        vc.solve(CASES["beyond the fold"][0])
    assert refusal.value.verdict is vc.Verdict.NO_EXTREMAL


def test_what_is_no_problem_is_refused():
    with pytest.raises(TypeError, match="must be a Problem or a Curve"):
        vc.diagnose(3)


def test_a_functional_of_many_extremals_is_told_by_the_first_of_them(monkeypatch):
    monkeypatch.setattr(examination, "VERIFIED", 1)
    bratu = graph(lambda x, y, v: v**2 / 2 - 3 * ca.exp(y), (0, 0), (1, 0))
    told = [finding.sentence for finding in vc.diagnose(bratu).findings]
    assert sum("extremal 1 of 2" in sentence for sentence in told) == 1
    assert not any("extremal 2 of 2" in sentence for sentence in told)
    assert sum(sentence.startswith("1 further extremal,") for sentence in told) == 1
