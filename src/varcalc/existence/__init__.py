"""Whether there is a minimum at all, and what stands in its way.

Looked at only where no method gave an answer: levels out of reach, functionals
without a bound, minima with corners, infima that no curve attains.
"""

from __future__ import annotations

from varcalc.existence.approach import outdone
from varcalc.existence.feasibility import explained
from varcalc.existence.second_look import second_look, with_rival

__all__ = ["explained", "outdone", "second_look", "with_rival"]
