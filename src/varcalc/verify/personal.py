"""A solution's curve in the person's own coordinates, with the person's Lagrangian, negated for a maximum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from varcalc.formulation import Sampled, side_conditions
from varcalc.formulation.singular import forms
from varcalc.methods.answer import Extremal
from varcalc.verify.setting import Setting, setting
from varcalc.verify.trial import Trial, distinct


def personal(trial: Trial) -> Setting:
    """The Lagrangian function of the person's problem along the solution's curve; never an energy, never a gauge."""
    solution, own = trial.solution, trial.own
    if own is not None and (own.form.lift is None or setting(own).slides):
        along = setting(own)
        if own.form.energetic:
            factor = 0.5 / abs(solution.value)  # multipliers of J^2 become those of J by the chain rule
            forces = tuple(_times(factor, mu) for mu in along.forces)
            along = replace(along, forces=forces)
        return replace(along, integrand=own.form.functional) if not along.slides else along
    problem = solution.problem
    assert solution.curve is not None
    form = own.form if own is not None else next(filter(None, forms(problem)))
    sign = -1.0 if problem.maximise else 1.0
    nodes = distinct(solution.x)
    numbers = np.array([solution.unknowns[k] for k in problem.unknowns], dtype=float)
    conditions = side_conditions(problem, lambda expression, _: expression)
    integrals, paths = conditions["integrals"], conditions["pathwise"]
    lambdas = -sign * np.array([float(solution.multipliers[c.index]) for c in integrals])
    forces = [solution.multipliers[c.index] if solution.multipliers else None for c in paths]
    return Setting(
        extremal=Extremal(form, solution.curve, numbers, nodes, lambdas, {}),
        symbols=problem.symbols,
        order=problem.order,
        integrand=sign * problem.integrand,
        integrals=tuple(c.expression for c in integrals),
        paths=tuple(c.expression for c in paths),
        limits=paths,
        lambdas=lambdas,
        forces=tuple(np.zeros_like if mu is None else _times(sign, mu) for mu in forces),
        span=(float(nodes[0]), float(nodes[-1])),
        vertices=nodes,
        evaluate=solution.curve,
        numbers=numbers,
        slides=False,
    )


def _times(factor: float, mu: Sampled) -> Sampled:
    return lambda s: factor * mu(s)
