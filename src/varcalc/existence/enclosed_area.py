"""Whether a curve of a given length encloses the most that one can."""

from __future__ import annotations

from varcalc.problem.isoperimetry import least_by_length
from varcalc.solution import Solution

BY_LENGTH = "by the isoperimetric inequality no curve of this length encloses more: there is no other valley"
TOLD = 1e-9
"""Relative difference of two values that is none."""


def by_length(solution: Solution) -> str:
    """Why there is no other valley than the solution's, where it encloses as much as its length lets it; else empty."""
    sign, least = solution.problem.sign, least_by_length(solution.problem)
    if least is None or not sign * solution.value <= least + solution.error.value + TOLD * abs(least):
        return ""
    return BY_LENGTH
