"""What is measured at the ends at other parameter values, against forms that are found for themselves there."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import Infinite, forms
from varcalc.formulation.singular.alike import _measurements


def descent(lagrangian, parameters, end=(1, 1), **options):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(*end), parameters=parameters, **options)


PROBLEMS = {
    "gravity": (
        descent(lambda x, y, v, p: ca.sqrt((1 + v**2) / (2 * p.g * y)), {"g": 9.81}),
        [[9.81], [1.62], [1e6], [0.0], [-1.0], [np.inf]],
    ),
    "the end": (
        descent(
            lambda x, y, v, p: ca.sqrt((1 + v**2) / y), {"X": 1, "Y": 1}, (vc.Parameter("X"), vc.Parameter("Y"))
        ),
        [[1, 1], [5, 0.2], [1, 0], [-1, 1], [1e-3, 1], [1, -1]],
    ),
    "the power": (
        descent(lambda x, y, v, p: ca.sqrt(1 + v**2) * y**-p.k, {"k": 0.5}), [[0.5], [0.49], [1 / 3], [0.0], [1.2]]
    ),
    "no longer a metric": (
        descent(lambda x, y, v, p: ca.sqrt((1 + v**2 + p.e * v**4) / y), {"e": 0.0}), [[0.0], [1e-3], [0.5]]
    ),
    "no longer conformal": (
        descent(lambda x, y, v, p: ca.sqrt((1 + p.c * v**2) / y), {"c": 1.0}), [[1.0], [1.0 + 1e-6], [2.0]]
    ),
    "a line that moves away": (
        descent(lambda x, y, v, p: ca.sqrt((1 + v**2) / (y + p.h)), {"h": 0.0}), [[0.0], [1e-9], [0.1], [3.0]]
    ),
    "a line that comes near": (
        descent(lambda x, y, v, p: ca.sqrt((1 + v**2) / (y + p.h)), {"h": 3.0}), [[3.0], [1.0], [0.01], [0.0]]
    ),
    "a free end": (
        vc.Problem(
            lambda x, y, v, p: ca.sqrt((1 + v**2) / y) * p.k, vc.Fixed(0, 0), vc.Free(vc.Parameter("X")),
            parameters={"k": 1.0, "X": 1.0},
        ),
        [[1, 1], [2, 3], [1, -1], [0, 1]],
    ),
    "a maximum": (
        descent(lambda x, y, v, p: -p.k * ca.sqrt((1 + v**2) / y), {"k": 1.0}, maximise=True), [[1.0], [3.0], [-1.0]]
    ),
    "several functions": (
        vc.Problem(
            lambda x, y, v, p: ca.sumsqr(v) + ca.sqrt(p.k) * ca.sumsqr(y), vc.Fixed(0, [0] * 5), vc.Fixed(1, [1] * 5),
            parameters={"k": 1.0},
        ),
        [[1.0], [2.0], [-1.0], [np.nan]],
    ),
}  # fmt: skip


def found_anew(problem, form, values):
    """Whether the form tried first at other values is the one of ``problem``; False where there is no problem."""
    if not np.all(np.isfinite(values)):
        return False
    try:
        there = forms(problem.with_parameters(dict(zip(problem.parameters, map(float, values), strict=True))))[0]
    except (Infinite, ValueError):
        return False
    return there is not None and there.cache is form.cache


@pytest.mark.parametrize("name", PROBLEMS)
def test_where_a_form_is_the_same(name):
    problem, values = PROBLEMS[name]
    form = forms(problem)[0]
    found = form.elsewhere.alike(np.array(values, dtype=float))
    assert found[0]  # its own values
    expected = [found_anew(problem, form, v) for v in values]
    # where it says so it is so, and where it does not, something there is another
    assert not np.any(found & ~np.array(expected))
    assert found.tolist() == expected or name in {"no longer conformal", "gravity", "a maximum", "several functions"}


@pytest.mark.parametrize("name", ["gravity", "the end", "several functions"])
def test_one_by_one_and_together(name):
    problem, values = PROBLEMS[name]
    alike = forms(problem)[0].elsewhere.alike
    many = np.tile(np.array(values, dtype=float), (20, 1))
    assert alike(many).tolist() == [bool(alike(v[None])[0]) for v in many]


def test_the_function_that_measures_is_written_out_for_few_functions_only():
    problem, _ = PROBLEMS["several functions"]
    forms(problem)[0].elsewhere.alike(np.ones((1, 1)))
    (evaluate,) = _measurements(problem).values()
    assert evaluate.function.is_a("MXFunction")
