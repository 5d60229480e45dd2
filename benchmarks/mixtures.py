"""Random mixtures of what misleads, by the ladder, against polygons that are found by hand.

An answer is wrong where an admitted polygon lies lower by more than ten times what it claims, and it is not said to be
local; where the curve it hands out sums to another value; or where that breaks a bound. Refusals are listed: the
polygon does not tell which are right. Of other kinds than graphs of one function, such as two functions, levels and
second order, what IPOPT comes to stands for the polygon. The kinds "conditioned-graph" and "conditioned" have bounds,
levels, sliding ends and costs of ends all at once; there the polygons of two meshes tell their own error, and slow
refusals, of more than two seconds, are counted by themselves.

Run: python benchmarks/mixtures.py FIRST LAST [--kind levelled-pair]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections import Counter

import click
import numpy as np

import varcalc as vc
from campaigns import conditioned_least
from campaigns.admissible import least_polygon
from campaigns.conditioned import Conditioned
from campaigns.conditioned_answer import fault
from campaigns.kinds import KINDS, Drawn
from campaigns.least_seen import least_seen
from campaigns.mixtures import Mixture, mixture

PANELS, ALIKE, KEPT = 6000, 2e-3, 1e-6
"""Panels by which an answer's curve is summed, how nearly that is its value, and how nearly bounds are kept."""

SEEN_TO = 3e-5
"""How nearly what IPOPT comes to is known, relatively."""
CONDITIONED = "conditioned-graph", "conditioned"
"""Kinds of graphs of one function, and of others, under bounds, levels and more at once."""
SLOW = 2.0
"""Seconds from which a refusal is slow."""


def told(number: int) -> tuple[str, str]:
    """What became of a functional, and a line on it."""
    given = mixture(number)
    begun = time.process_time()
    solution = vc.solve(given.problem, throw=False)
    seconds = time.process_time() - begun
    known = least_polygon(given)[0]
    if not solution.status.ok:
        return "refused", f"polygon {known:.9g}, {seconds:.2f} s: {solution.message[:160]}"
    lower = known < solution.value - max(10 * solution.error.value, 1e-7 * max(1.0, abs(known)))
    line = f"{solution.value:.9g}, claimed {solution.error.value:.0e}, polygon {known:.9g}, {seconds:.2f} s"
    if (fault := _fault(given, solution)) or (lower and not solution.local):
        return "wrong", f"{line} {fault}"
    return ("local" if lower else "right"), line


def told_of_kind(kind: str, number: int) -> tuple[str, str]:
    """The same of a functional of another kind."""
    given = Drawn(kind, number)
    begun = time.process_time()
    solution = vc.solve(given.problem, throw=False)
    seconds = time.process_time() - begun
    known = least_seen(given)
    if not solution.status.ok:
        return "refused", f"seen {known:.9g}, {seconds:.2f} s: {solution.message[:160]}"
    lower = known < solution.value - max(10 * solution.error.value, SEEN_TO * max(1.0, abs(known)))
    line = f"{solution.value:.9g}, claimed {solution.error.value:.0e}, seen {known:.9g}, {seconds:.2f} s"
    return ("local" if solution.local else "wrong") if lower else "right", line


def told_under_conditions(kind: str, number: int) -> tuple[str, str]:
    """The same of a functional under bounds, levels and more at once."""
    given = Conditioned(kind == "conditioned", number)
    begun = time.process_time()
    solution = vc.solve(given.problem, throw=False)
    seconds = time.process_time() - begun
    known, error, far = conditioned_least.least_seen(given)
    seen = f"seen {known:.9g} within {error:.0e}{' far out' if far else ''}, {seconds:.2f} s; {given.name}"
    if not solution.status.ok:
        outcome = "refused slowly" if seconds > SLOW else "refused"
        return outcome, f"{seen}: {solution.verdict} {solution.message[:200]}"
    line = f"{solution.value:.9g}, claimed {solution.error.value:.0e}, {seen}"
    if broken := fault(given, solution):
        return "wrong", f"{line} {broken}"
    room = max(10 * solution.error.value, SEEN_TO * max(1.0, abs(known)), error)
    lower = given.sign * (solution.value - known) > room
    if lower and far:  # there may be no least value, and an answer is a minimum among the curves near it
        return "falling", line
    return ("local" if solution.local else "wrong") if lower else "right", line


def _fault(given: Mixture, solution: vc.Solution) -> str:
    """In what an answer's curve is not what is said of it; empty where it is."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    edges = np.linspace(0.0, given.span, PANELS + 1)
    x = (edges[:-1, None] + (edges[1] - edges[0]) * (1 + nodes) / 2).ravel()
    y, v = np.ravel(solution.y(x)), np.ravel(solution.dy(x))
    if (y < given.low - KEPT).any() or (y > given.high + KEPT).any() or (np.abs(v) > given.steep * (1 + KEPT)).any():
        return "breaks a bound"
    values = given.problem.integrand_values(x, y[None], v[None])
    own = float(values @ np.tile(weights, PANELS)) * (edges[1] - edges[0]) / 2
    if given.end is None and given.cost is not None:
        own += float(given.cost(float(np.ravel(solution.y(given.span))[0])))
    return "" if abs(own - solution.value) <= ALIKE * max(1.0, abs(own)) else f"sums to {own:.6g}"


def _told(kind: str | None, number: int) -> tuple[str, str]:
    if kind is None:
        return told(number)
    return told_under_conditions(kind, number) if kind in CONDITIONED else told_of_kind(kind, number)


@click.command()
@click.argument("first", type=int)
@click.argument("last", type=int)
@click.option("--kind", type=click.Choice([*KINDS, *CONDITIONED]), help="Another kind than graphs of one function.")
def main(first: int, last: int, kind: str | None) -> None:
    """Try the functionals of these numbers, print all but the right ones; exit 1 when one is wrong."""
    warnings.simplefilter("ignore")
    outcomes: Counter[str] = Counter()
    for number in range(first, last):
        outcome, line = _told(kind, number)
        outcomes[outcome] += 1
        if outcome != "right":
            print(f"{number} {outcome}: {line}", flush=True)
    print(dict(outcomes))
    sys.exit(outcomes["wrong"] > 0)


if __name__ == "__main__":
    main()
