"""solve: one problem, the best answer that can be vouched for, or the reason why not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from varcalc.conditions import OnCurve
from varcalc.existence import explained, outdone, second_look
from varcalc.formulation import Form, Sampled
from varcalc.functional import Functional
from varcalc.methods.collocation import Collocation
from varcalc.methods.first_integral import FirstIntegral
from varcalc.methods.ritz import Ritz
from varcalc.problem import Curve, Problem
from varcalc.singular import Infinite, forms
from varcalc.slopes import vouched
from varcalc.solution import InfeasibleError, Solution, Status, VariationalError, Verdict, no_answer
from varcalc.tracing import check_arity


class Method(Protocol):
    """What every method offers: a solve of one form."""

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """A Solution, with a status that says why when there is none."""
        ...


Guess = Callable[[Any], Any] | Solution | None


def solve(
    problem: Functional,
    method: Method | None = None,
    *,
    tol: float = 1e-10,
    throw: bool = True,
    guess: Guess = None,
) -> Solution:
    """The extremal that makes the functional least (greatest with ``maximise``).

    ``tol`` bounds the error of the value relative to max(1, abs(value)).
    ``guess`` is a function of x (of t for a Curve) or an earlier Solution.
    Without ``method`` the cheapest route that meets the tolerance is taken.

    Raises VariationalError, with the status, the verdict and what was found,
    when there is no answer that stands; with ``throw=False`` the Solution is
    returned with that status instead. Raises TypeError or ValueError for
    unusable arguments.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> line = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, 4))
    >>> round(solve(line).value, 12)
    5.0
    """
    check_arguments(problem, method, tol)
    _check_guess(problem, guess)
    solution = _linear(problem, method or LADDER[0])
    if solution is None:
        solution = _attempt(problem, method, tol, guess) if method is not None else _climbed(problem, tol, guess)
    if method is None and not solution.status.ok:
        solution = second_look(problem, tol, solution)
    if throw and not solution.status.ok:
        raise (InfeasibleError if solution.verdict is Verdict.INFEASIBLE else VariationalError)(solution)
    return solution


WORTHLESS = 1e-6
"""Relative error at which an answer limited by round-off is none."""
GUESS_PLACES = 16
"""Abscissae at which a guess is looked at before it is used."""
SAME = 1e-9
"""Distance of two abscissae that counts as none, relative to the interval."""
LADDER: tuple[Ritz, ...] = (Ritz(),)
"""The route taken first: the direct method is the cheapest for most single solves, and it alone ends at a
minimum by construction (see docs/methods.md for the figures)."""
GUIDES: tuple[Method, ...] = (Collocation(), FirstIntegral())
"""Routes that may find an extremal where minimisation finds no way to it; it is minimised from there."""


def check_arguments(problem: Any, method: Any, tol: Any) -> None:
    """Raise TypeError or ValueError, naming the argument and the remedy, for what cannot be solved."""
    if not isinstance(problem, Problem | Curve):
        raise TypeError(f"problem must be a Problem or a Curve, not {problem!r}")
    if method is not None and (isinstance(method, type) or not hasattr(method, "solve")):
        hint = f"; write {method.__name__}()" if isinstance(method, type) else ""
        raise TypeError(f"method must be a method object such as Ritz() or Shooting(), not {method!r}{hint}")
    if isinstance(tol, bool) or not (isinstance(tol, float | int | np.number) and math.isfinite(tol) and tol > 0):
        raise ValueError(f"tol must be a positive number, not {tol!r}")


def _check_guess(problem: Functional, guess: Any) -> None:
    """Refuse a guess that cannot be a curve of this problem, before anything is built for it."""
    if guess is None:
        return
    if isinstance(guess, Solution):
        _check_kin(problem, guess)
        first, last = guess.interval
    elif callable(guess):
        check_arity("guess", guess, 1, "guess is a function of the abscissa (of t for a Curve)")
        first, last = problem.span
    else:
        raise TypeError(f"guess must be a function of x or a Solution, not {guess!r}")
    # inside, since a guess may be singular at the ends where the extremal is
    places = first + (last - first) * (np.arange(GUESS_PLACES) + 0.5) / GUESS_PLACES
    values = _values(problem, guess.y if isinstance(guess, Solution) else guess, places)
    bad = ~np.isfinite(values).all(axis=0)
    if bad.any():
        raise ValueError(f"guess is not a finite number at {places[bad][0]:.6g}; give one that is, or leave it out")


def _check_kin(problem: Functional, guess: Solution) -> None:
    """Refuse a Solution whose curve is not of this problem's kind."""
    other = guess.problem
    if guess.curve is None:
        raise ValueError("guess is a Solution that holds no curve; leave it out, or give a function of x")
    if isinstance(problem, Curve) != isinstance(other, Curve):
        kinds = ("Curve", "Problem") if isinstance(problem, Curve) else ("Problem", "Curve")
        raise ValueError(f"guess is a Solution of a {kinds[1]} and the problem is a {kinds[0]}; give a function")
    if other.n != problem.n:
        raise ValueError(
            f"guess is a Solution with {other.n} unknown functions and the problem has {problem.n}; give a function"
        )
    sliding = any(isinstance(e, OnCurve) for e in (problem.start, problem.end, other.start, other.end))
    width = problem.span[1] - problem.span[0]
    if not sliding and max(abs(a - b) for a, b in zip(problem.span, other.span, strict=True)) > SAME * width:
        raise ValueError(
            f"guess is a Solution from {other.span[0]} to {other.span[1]} and the problem goes from "
            f"{problem.span[0]} to {problem.span[1]}; give a function of x that covers it"
        )


def _linear(problem: Functional, method: Method) -> Solution | None:
    """A refusal when a first-order Lagrangian is linear in the slope, in which case nothing in it fixes a curve."""
    s = problem.symbols
    if not isinstance(problem, Problem) or problem.order != 1 or problem.constraints:
        return None
    if ca.hessian(problem.integrand, s.dy)[0].nnz():
        return None
    message = "the Lagrangian is linear in the slope: nothing in it fixes a curve between these ends"
    return no_answer(problem, method, Status.REFUSED, message, Verdict.SINGULAR)


def _climbed(problem: Functional, tol: float, guess: Guess) -> Solution:
    """The ladder: each route in turn, and extremals of the indirect ones as starts for the direct one.

    An extremal that an indirect method finds may be a saddle. It is an answer
    only when minimising from there stays at it.
    """
    failure: Solution | None = None
    for method in LADDER:
        solution = _attempt(problem, method, tol, guess)
        if solution.status.ok or solution.verdict is not None:
            return solution
        failure = failure or solution
    for guide in GUIDES:
        extremal = _attempt(problem, guide, tol, guess)
        if extremal.status.ok:
            solution = _attempt(problem, replace(LADDER[0], starts=1), tol, extremal)
            if solution.status.ok:
                return solution
    assert failure is not None
    return failure


def _attempt(problem: Functional, method: Method, tol: float, guess: Guess) -> Solution:
    """The first answer of a method that stands, over all forms; else the failure that got furthest."""
    failure: Solution | None = None
    try:
        candidates = forms(problem)
    except Infinite as reason:
        return no_answer(problem, method, Status.REFUSED, str(reason), Verdict.INFEASIBLE)
    for way in _quick_first(method, len(candidates)):
        for form in candidates:
            if form is None or (form.weak_only and not isinstance(way, Ritz)):
                continue
            if form.refused and not isinstance(way, FirstIntegral):
                failure = failure or no_answer(problem, way, Status.REFUSED, form.refused)
                continue
            start = guess if guess is not None or failure is None or failure.curve is None else failure
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                solution = _worth_something(way.solve(form, tol=tol, guess=_sampled(problem, form, start)))
            if solution.verdict in {Verdict.NOT_ATTAINED, Verdict.DEGENERATE}:
                return solution
            if solution.status.ok:
                return _beyond_doubt(vouched(_compared(solution, failure), form), form)
            if failure is None or (math.isnan(failure.value) and not math.isnan(solution.value)) or solution.verdict:
                failure = solution
    assert failure is not None
    hopeless = all(form is not None and form.refused for form in candidates)
    return failure if hopeless else explained(problem, failure)


def _beyond_doubt(solution: Solution, form: Form) -> Solution:
    """The solution, refused when L is singular at an end and a curve that is steeper there is far better."""
    if form.energetic or not any(form.singular) or (better := outdone(solution)) is None:
        return solution
    return replace(solution, status=Status.REFUSED, verdict=Verdict.GAP, message=better.sentence(solution.value))


def _compared(solution: Solution, failure: Solution | None) -> Solution:
    """The solution, marked local when a curve met on the way has a better value."""
    if failure is None or failure.curve is None or not math.isfinite(failure.error.value):
        return solution
    sign = -1.0 if solution.problem.maximise else 1.0
    margin = failure.error.value + solution.error.value + 1e-12 * abs(solution.value)
    if sign * failure.value < sign * solution.value - margin:
        return replace(solution, local=True, lower=failure.value)
    return solution


def _worth_something(solution: Solution) -> Solution:
    """The solution, refused when round-off leaves it fewer digits than an answer needs, as at conjugate ends."""
    if solution.status is Status.ROUND_OFF and solution.error.value > WORTHLESS * max(1.0, abs(solution.value)):
        message = f"round-off leaves an error of {solution.error.value:.2g}: the ends are conjugate, or nearly so"
        return replace(solution, status=Status.NOT_CONVERGED, message=message)
    return solution


def _quick_first(method: Method, count: int) -> list[Method]:
    """Where there is a choice of forms, each is tried from the first starting curves before any is tried from all."""
    if isinstance(method, Ritz) and method.starts > 2 and count > 1:
        return [replace(method, starts=2), method]
    return [method]


def _sampled(problem: Functional, form: Form, guess: Guess) -> Sampled | None:
    """A guess in the coordinates of a form."""
    if guess is None:
        return None
    if isinstance(guess, Solution):
        curve = guess.curve
        return None if curve is None else form.pull(lambda x: curve(x, 0))
    return form.pull(lambda x: _values(problem, guess, x))


def _values(problem: Functional, function: Callable[[Any], Any], x: np.ndarray) -> np.ndarray:
    """A person's guess at x (m,), asked one abscissa at a time, as (n, m)."""
    given = [function(float(v)) for v in x]
    try:
        rows = [np.asarray(v, dtype=float).ravel() for v in given]
    except (TypeError, ValueError):
        raise TypeError(f"guess must return numbers at each x, not {given[0]!r}") from None
    for row in rows:
        if row.shape != (problem.n,):
            numbers = "1 number" if problem.n == 1 else f"{problem.n} numbers"
            raise ValueError(f"guess must return {numbers} at each x, not {row.size}")
    return np.array(rows).T
