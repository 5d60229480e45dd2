"""Whether a curve of a given length is the least of all: it encloses the most, or hangs."""

from __future__ import annotations

import numpy as np

from varcalc.problem.arc_length import IN_ARC_LENGTH, proved_in_arc_length
from varcalc.problem.isoperimetry import least_by_length
from varcalc.solution import PROVED, Solution

BY_LENGTH = "by the isoperimetric inequality no curve of this length encloses more: there is no other valley"
SAME_VALUE = 1e-9
"""Relative difference of two values that is none."""
HEIGHTS_ASKED = 9
"""Places at which a curve is asked how high it is."""


def by_length(solution: Solution) -> str:
    """Why there is no other valley than the solution's, which is as long as others; empty where that is not proved."""
    problem, sign, least = solution.problem, solution.problem.sign, least_by_length(solution.problem)
    if least is not None and sign * solution.value <= least + solution.error.value + SAME_VALUE * abs(least):
        return BY_LENGTH
    if solution.curve is None:
        return ""
    y = solution.curve(np.linspace(*solution.interval, HEIGHTS_ASKED), 0)[0]
    proved = proved_in_arc_length(problem, solution.multipliers, y)
    return f"{PROVED} {IN_ARC_LENGTH}: there is no other valley" if proved else ""
