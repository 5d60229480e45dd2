"""Branches followed in a parameter: folds against closed forms, what lies on either side, where they end."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc

with mp.workdps(30):
    TURN = mp.findroot(lambda t: t * mp.tanh(t) - 1, 1.2)
    FILM_FOLD = TURN / mp.cosh(TURN)
    """The half-width beyond which no catenary joins rings of radius 1."""
    BRATU_FOLD = 8 * FILM_FOLD**2


def bratu(strength, **more):
    return vc.Problem(
        lambda x, y, dy, p: dy**2 / 2 - p.strength * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0),
        parameters={"strength": strength}, **more,
    )  # fmt: skip


def film(half):
    """The film between rings at x = -half and half, in t = x / half."""
    return vc.Problem(
        lambda t, y, dy, p: y * ca.sqrt(p.half**2 + dy**2), vc.Fixed(-1, 1), vc.Fixed(1, 1), parameters={"half": half}
    )


def heights(strength):
    """y(1/2) of both solutions, from theta = sqrt(2 strength) cosh(theta / 4)."""
    roots = [mp.findroot(lambda t: t - mp.sqrt(2 * strength) * mp.cosh(t / 4), start) for start in (1.0, 10.0)]
    return [float(2 * mp.log(mp.cosh(t / 4))) for t in roots]


def deep_neck(half):
    """c of the deep catenary c cosh(x / c): c cosh(half / c) = 1."""
    return float(half / mp.findroot(lambda r: mp.log(mp.cosh(r) * half / r), (TURN, 12), "illinois"))


def test_the_fold_of_bratu_and_the_way_back():
    branch = vc.continue_branch(vc.solve(bratu(1.0)), "strength", until=4.0)
    assert branch.folds == pytest.approx([float(BRATU_FOLD)], abs=1e-13)
    assert np.all(np.abs(branch.folds - float(BRATU_FOLD)) <= branch.fold_errors)
    assert branch.parameter[[0, -1]] == pytest.approx([1.0, 1.0])
    assert [branch.solutions[k].y(0.5) for k in (0, -1)] == pytest.approx(heights(1.0), abs=1e-10)
    assert branch.ended == "strength reached 1"
    for s in branch.solutions:
        exact = heights(s.problem.parameters["strength"])
        assert min(abs(s.y(0.5) - h) for h in exact) <= 1.5 * s.error.curve + 1e-12
    assert branch.value == pytest.approx([s.value for s in branch.solutions])


def test_the_fold_of_the_soap_film():
    branch = vc.continue_branch(vc.solve(film(0.3)), "half", until=1.0)
    assert branch.folds == pytest.approx([float(FILM_FOLD)], abs=1e-13)
    # at the fold the neck is c = half / t, and the value c (half + c sinh(2 t) / 2)
    neck = FILM_FOLD / TURN
    assert branch.fold_values == pytest.approx([float(neck * (FILM_FOLD + neck * mp.sinh(2 * TURN) / 2))], abs=1e-12)
    assert branch.solutions[-1].y(0.0) < 0.2


def test_a_branch_is_followed_backwards_as_well():
    c = deep_neck(0.5)
    deep = vc.solve(film(0.5), vc.Collocation(), guess=lambda t: c * np.cosh(t / (2 * c)))
    branch = vc.continue_branch(deep, "half", until=0.3)
    assert len(branch.folds) == 0
    assert branch.parameter[-1] == 0.3
    assert branch.solutions[-1].y(0.0) == pytest.approx(deep_neck(0.3), abs=1e-10)


def test_a_maximum_is_followed_as_its_own_sign_has_it():
    branch = vc.continue_branch(vc.solve(bratu(1.0)), "strength", until=2.0)
    turned = vc.Problem(
        lambda x, y, dy, p: p.strength * ca.exp(y) - dy**2 / 2, vc.Fixed(0, 0), vc.Fixed(1, 0),
        parameters={"strength": 1.0}, maximise=True,
    )  # fmt: skip
    other = vc.continue_branch(vc.solve(turned), "strength", until=2.0)
    assert other.value[-1] == pytest.approx(-branch.value[-1], abs=1e-12)


def test_two_functions_a_free_end_and_a_prescribed_integral_are_followed():
    pair = vc.Problem(
        lambda x, y, dy, p: (dy[0] ** 2 + dy[1] ** 2) / 2 - p.strength * ca.exp(y[0]) + y[1],
        vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, None]), parameters={"strength": 1.0},
    )  # fmt: skip
    branch = vc.continue_branch(vc.solve(pair), "strength", until=4.0)
    assert branch.folds == pytest.approx([float(BRATU_FOLD)], abs=1e-12)
    # y'' = 1 with y(0) = 0, y'(1) = 0 takes no part
    assert branch.solutions[-1].y(1.0)[1] == pytest.approx(-0.5, abs=1e-10)
    level = vc.Problem(
        lambda x, y, dy, p: dy**2 - p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 0),
        [vc.Isoperimetric(lambda x, y, dy, p: y, 1.0)], parameters={"k": 0.0},
    )  # fmt: skip
    end = vc.continue_branch(vc.solve(level), "k", until=4.0).solutions[-1]
    # y = a (cos(2 (x - 1/2)) - cos 1), of integral 1
    a = 1 / (np.sin(1.0) - np.cos(1.0))
    assert end.y(0.5) == pytest.approx(a * (1 - np.cos(1.0)), abs=1e-10)


def test_unusable_arguments_are_named():
    solution = vc.solve(bratu(1.0))
    with pytest.raises(ValueError, match="no parameter"):
        vc.continue_branch(solution, "k", until=2.0)
    with pytest.raises(ValueError, match="until must differ"):
        vc.continue_branch(solution, "strength", until=1.0)
    with pytest.raises(ValueError, match="holds no curve"):
        vc.continue_branch(vc.solve(bratu(5.0), throw=False), "strength", until=6.0)
    wall = vc.solve(bratu(1.0, constraints=[vc.Bound(lambda x, y, dy, p: y, upper=1.0)]))
    with pytest.raises(ValueError, match="inequality"):
        vc.continue_branch(wall, "strength", until=2.0)
