"""Who watches rays go from one kink, jump or knot of the index to the next, of which a short way may hold thousands."""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field

import numpy as np

from varcalc.integrators.protocol import TOO_MANY_STEPS, Landing
from varcalc.progress import Stage
from varcalc.showing import counted


@dataclass
class Watch:
    """Tells a ``stage`` how far rays have come, counts what they come to, and says when that is enough.

    One ray goes through no more than ``most`` pieces of the index, and all together through those that are ``left``.
    A call that is ``kept`` gives back what rays have come to when Ctrl-C stops it; another one is ended by it.
    """

    stage: Stage = field(default_factory=Stage)
    most: float = math.inf
    left: float = math.inf
    kept: bool = False

    def lets_on(self, number: int, rays: int) -> bool:
        """Whether so many ``rays``, which have come through ``number`` pieces each, go into the next."""
        if number == 0:
            return True
        self.stage(0, f"{counted(rays, 'ray')} in piece {number + 1} of the index")
        self.left -= rays
        return number < self.most and self.left > 0 and not (self.kept and self.stage.stopped)

    @contextmanager
    def going(self, ends: Landing, rows: np.ndarray) -> Generator[None]:
        """A round of the rays ``rows``, none of which has come to its end where Ctrl-C comes in between."""
        try:
            yield
        except KeyboardInterrupt:
            ends.outcomes[rows] = TOO_MANY_STEPS
            raise

    def stoppable(self) -> AbstractContextManager[None]:
        """What is done within ends at Ctrl-C; the call goes on with what is known where it is :attr:`kept`."""
        return self.stage.stoppable() if self.kept else nullcontext()


MOST_SEARCHED, MOST_SEARCHED_TOGETHER = 256, 300_000
"""Pieces of the index through which a search follows one ray, and all rays of a pair of points.

Where there are more, neighbours have parted at so many jumps that they foretell nothing of each other; some indices
have infinitely many on a short way, as floor(sin(1/x)).
"""
NOT_FOLLOWED = 2.0**32
"""In place of what such rays have come through: no number that says it is as large."""


def searching(stage: Stage, pairs: int) -> Watch:
    """Who watches the rays of a search for so many pairs of points."""
    return Watch(stage, MOST_SEARCHED, MOST_SEARCHED_TOGETHER * pairs)


UNWATCHED = Watch()
"""Nobody, who lets all rays on."""
