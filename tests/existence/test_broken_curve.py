"""Curves that jump at their ends, and what they say of a minimum."""

from __future__ import annotations

import math

import casadi as ca
import pytest

import varcalc as vc
from varcalc.existence.broken_curve import _broken_curves, _Family, broken_curve


def graph(lagrangian, first, last):
    return vc.Problem(lagrangian, vc.Fixed(*first), vc.Fixed(*last))


@pytest.mark.parametrize("height", [1e-1, 1e-3, 1e-6])
def test_what_a_jump_costs_near_a_singular_line_is_resolved(height):
    # in the half-plane a jump from ``height`` to c costs log(c / height), and the level c costs 1 / c
    problem = graph(lambda x, y, v: ca.sqrt(1 + v**2) / y, (0, height), (1, 1))
    found = broken_curve(problem)
    assert found.value >= math.log(1 / height) + 1 - 1e-9  # least at c = 1, where 1/c + 2 log c - log height turns
    assert found.value == pytest.approx(math.log(1 / height) + 1, rel=1e-9)


def test_a_shortest_way_is_not_called_local():
    # the geodesic of the half-plane is the least of all: no curve of any kind is shorter
    height = 1e-3
    solution = vc.solve(graph(lambda x, y, v: ca.sqrt(1 + v**2) / y, (0, height), (1, 1)))
    assert solution.value == pytest.approx(math.acosh(1 + (1 + (1 - height) ** 2) / (2 * height)), rel=1e-13)
    assert not solution.local


@pytest.mark.parametrize("half", [0.53, 0.6, 0.66])
def test_two_discs_are_less_than_a_catenary(half):
    film = graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (-half, 1), (half, 1))
    assert broken_curve(film).value == pytest.approx(1, abs=1e-12)
    assert vc.solve(film).local


def test_no_jump_where_it_costs_infinitely_much():
    assert broken_curve(graph(lambda x, y, v: v**2 + y**2, (0, 0), (1, 1))) is None


@pytest.mark.parametrize("origin", [0.0, 5.0, -5.0, 1e3])
@pytest.mark.parametrize(("wide", "high"), [(1.0, 1.0), (1e3, 1e-3), (1e-3, 1e3)])
def test_two_discs_are_found_at_any_origin_and_in_any_units(origin, wide, high):
    half = 0.6 * wide
    film = graph(
        lambda x, y, v: (y / high - origin) * ca.sqrt(1 + (v * wide / high) ** 2) / wide,
        (-half, (1 + origin) * high),
        (half, (1 + origin) * high),
    )
    solution = vc.solve(film)
    assert solution.local
    assert solution.lower == pytest.approx(1, abs=1e-11)
    assert broken_curve(film).level == pytest.approx(origin * high, abs=1e-12 * high * (1 + abs(origin)))


@pytest.mark.parametrize(
    ("added", "between_ends"),
    [
        (lambda x, y, v: 3.0 * v, 0.6),
        (lambda x, y, v: -40.0 * y * v, -20 * (1.2**2 - 1)),
        (lambda x, y, v: 5.0 * (y + x * v), 5 * 0.6 * (1.2 + 1)),
    ],
    ids=["of y", "of its square", "of a product"],
)
def test_a_jump_may_earn_one_way_what_the_other_costs(added, between_ends):
    # the derivative of a function of x and y changes all curves' values alike: the two discs stay the same
    film = graph(lambda x, y, v: y * ca.sqrt(1 + v**2) + added(x, y, v), (-0.6, 1), (0.6, 1.2))
    solution = vc.solve(film)
    assert solution.local
    assert solution.lower == pytest.approx((1 + 1.2**2) / 2 + between_ends, abs=1e-8)
    assert broken_curve(film).level == pytest.approx(0, abs=1e-12)


def test_no_jump_where_it_earns_something_there_and_back():
    # -|v| there and back earns 2: nothing bounds it, and no broken curve stands for that
    assert broken_curve(graph(lambda x, y, v: v - ca.sqrt(1 + v**2), (0, 0), (1, 1))) is None


@pytest.mark.parametrize("origin", [0.0, 0.3, -4.0])
def test_a_level_where_jumps_cost_least_is_found_where_they_cost_something_on_either_side(origin):
    film = graph(lambda x, y, v: ca.fabs(y - origin) * ca.sqrt(1 + v**2), (-0.6, 1 + origin), (0.6, 1.2 + origin))
    found = broken_curve(film)
    assert found.value == pytest.approx(0.5 + 0.72, abs=1e-12)
    assert found.level == pytest.approx(origin, abs=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.3, -0.2])
def test_the_level_at_which_nothing_costs_any_more_is_found_to_round_off(shift):
    # the two discs lie at y = shift, an edge that is no end: beyond it the integrand changes its sign
    film = graph(lambda x, y, v: (y - shift) * ca.sqrt(1 + v**2), (-0.6, 1 + shift), (0.6, 1 + shift))
    found = broken_curve(film)
    assert found.value == pytest.approx(1, abs=1e-13)
    assert found.level == pytest.approx(shift, abs=1e-12)


def test_the_search_for_a_level_costs_few_evaluations(monkeypatch):
    film = graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (-0.6, 1), (0.6, 1))
    calls = []
    original = _Family.at

    def counted(family, levels, *rule):
        calls.append(len(levels))
        return original(family, levels, *rule)

    monkeypatch.setattr(_Family, "at", counted)
    broken_curve(film)
    # golden sections took 70 calls a place, each of three parts
    assert len(calls) < 40


@pytest.mark.parametrize(
    ("lagrangian", "first", "last"),
    [
        (lambda x, y, v: y * ca.sqrt(1 + v**2), (-0.6, 1), (0.6, 1)),
        (lambda x, y, v: ca.sqrt(v**2 + ca.sin(y) ** 2), (0, 1.3), (3, 1.8)),
        (lambda x, y, v: 1.5 * (1 - y) * ca.sqrt(1 + v**2), (0, 0), (1, 0.2)),
        (lambda x, y, v: ca.sqrt(1 + v**2) * (2 + ca.cos(3 * y)), (0, 0), (3, 1)),
    ],
)
def test_only_curves_above_the_ceiling_are_left_out(lagrangian, first, last):
    problem = graph(lagrangian, first, last)
    everything = _broken_curves(problem, math.inf)
    for share in (0.9, 0.999, 1 + 1e-6, 1.05, 1.3):
        ceiling = share * everything[0].value
        wanted = [found for found in everything if found.value <= ceiling]
        given = [found for found in _broken_curves(problem, ceiling) if found.value <= ceiling]
        assert [f.value for f in given] == pytest.approx([f.value for f in wanted], rel=1e-12)
