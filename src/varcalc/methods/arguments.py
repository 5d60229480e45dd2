"""What a person asks for, checked before anything is built for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.formulation import Sampled
from varcalc.problem.conditions import told
from varcalc.problem.functional import Functional, check_functional
from varcalc.problem.problem import Curve
from varcalc.solution import Solution
from varcalc.symbolic.tracing import check_arity

Guess = Callable[[Any], Any] | Solution | None
"""A curve to start from: a function of the abscissa, or an earlier Solution."""


@dataclass(frozen=True)
class KnownCurve:
    """A curve to start from that takes all abscissae at once, as a person's guess need not."""

    curve: Sampled


Start = Guess | KnownCurve
"""What is started from, a person's guess or a curve that is known here."""
GUESS_PLACES = 16
"""Abscissae at which a guess is looked at before it is used."""
LARGEST = sys.float_info.max
"""What tolerances may be at most: whole numbers beyond that are no floats."""
SAME_ABSCISSA = 1e-9
"""Distance of two abscissae that counts as none, relative to the interval."""


def check_arguments(problem: Any, method: Any, tol: Any) -> None:
    """Raise TypeError or ValueError, naming the argument and the remedy, for what cannot be solved."""
    check_functional(problem)
    if method is not None and (isinstance(method, type) or not hasattr(method, "solve")):
        hint = f"; write {method.__name__}()" if isinstance(method, type) else ""
        raise TypeError(f"method must be a method object such as Ritz() or Shooting(), not {method!r}{hint}")
    check_tolerance(tol)


def check_tolerance(tol: Any) -> None:
    """Raise ValueError for what is no tolerance."""
    if isinstance(tol, bool) or not (isinstance(tol, float | int | np.floating | np.integer) and 0 < tol <= LARGEST):
        raise ValueError(f"tol must be a positive number, not {told(tol)}")


def check_guess(problem: Functional, guess: Any) -> None:
    """Refuse a guess that cannot be a curve of this problem, before anything is built for it."""
    if guess is None:
        return
    if isinstance(guess, Solution):
        _check_kin(problem, guess)
    elif callable(guess):
        check_arity("guess", guess, 1, "guess is a function of the abscissa (of t for a Curve)")
    else:
        raise TypeError(f"guess must be a function of x or a Solution, not {guess!r}")
    places, values = _looked_at(problem, guess)
    bad = ~np.isfinite(values).all(axis=0)
    if bad.any():
        raise ValueError(f"guess is not a finite number at {places[bad][0]:.6g}; give one that is, or leave it out")


def _looked_at(problem: Functional, guess: Any) -> tuple[np.ndarray, np.ndarray]:
    """A guess at a few places (m,), inside, since it may be singular at the ends where the extremal is; (n, m).

    A Solution is looked at in the coordinates it was found in: at abscissae of the person's it would have to be
    inverted for each.
    """
    inside = (np.arange(GUESS_PLACES) + 0.5) / GUESS_PLACES
    if isinstance(guess, Solution) and guess.extremal is not None:
        first, last = guess.extremal.form.span
        places = first + (last - first) * inside
        return places, guess.extremal.evaluate(places, 0)
    first, last = guess.interval if isinstance(guess, Solution) else problem.span
    places = first + (last - first) * inside
    return places, sampled_guess(problem, guess.y if isinstance(guess, Solution) else guess, places)


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
    sliding = any((*problem.slides, *other.slides))
    sliding = sliding or problem.templates is other.templates  # parameters have moved the ends
    width = problem.span[1] - problem.span[0]
    if not sliding and max(abs(a - b) for a, b in zip(problem.span, other.span, strict=True)) > SAME_ABSCISSA * width:
        raise ValueError(
            f"guess is a Solution from {other.span[0]} to {other.span[1]} and the problem goes from "
            f"{problem.span[0]} to {problem.span[1]}; give a function of x that covers it"
        )


def sampled_guess(problem: Functional, function: Callable[[Any], Any] | KnownCurve, x: np.ndarray) -> np.ndarray:
    """A curve to start from at x (m,), as (n, m): a person's guess is asked one abscissa at a time."""
    if isinstance(function, KnownCurve):
        return function.curve(x)
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
