"""Deflation: a known root is not found again, its neighbour is."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.collocation.method import first_unknowns
from varcalc.methods.collocation.system import CollocationSystem, collocation_space
from varcalc.search.collected import scales_of
from varcalc.search.deflation import deflated_newton, is_singular


def collocated(lagrangian, start, end):
    form = forms(vc.Problem(lagrangian, start, end))[0]
    return CollocationSystem(form, collocation_space(form, np.array(form.span), 20))


def middle(system, z):
    return float(system.space.evaluate(system.unpack(z).coefficients, np.array([0.5]))[0, 0])


def test_the_same_start_leads_to_the_other_root_once_one_is_known():
    system = collocated(lambda x, y, dy: dy**2 / 2 - 3 * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0))
    start = first_unknowns(system, system.form.start.curve)
    known = []
    for _ in range(2):
        known.append(deflated_newton(system, start, known, scales_of(system.form)))
    roots = [mp.findroot(lambda t: t - mp.sqrt(6) * mp.cosh(t / 4), guess) for guess in (1.0, 10.0)]
    assert [middle(system, z) for z in known] == pytest.approx([float(2 * mp.log(mp.cosh(t / 4))) for t in roots])
    assert not any(is_singular(system, z) for z in known)


def test_a_single_root_is_not_found_twice():
    system = collocated(lambda x, y, dy: dy**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    start = first_unknowns(system, system.form.start.curve)
    only = deflated_newton(system, start, [], scales_of(system.form))
    assert deflated_newton(system, start, [only], scales_of(system.form)) is None


def test_conjugate_ends_leave_a_direction_open():
    system = collocated(lambda x, y, dy: dy**2 - y**2, vc.Fixed(0, 0), vc.Fixed(float(mp.pi), 0))
    assert is_singular(system, first_unknowns(system, system.form.start.curve))
