"""Every extremal of a problem: scans of the initial slope, deflation, continuation in a parameter."""

from __future__ import annotations

from varcalc.search.continuation import Branch, continue_branch
from varcalc.search.extremals import by_slope_alone, extremals
from varcalc.search.sequence import Extremals, FoundExtremal

__all__ = ["Branch", "Extremals", "FoundExtremal", "by_slope_alone", "continue_branch", "extremals"]
