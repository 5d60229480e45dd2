"""Rays to one point in space where no plane is known to hold them: what the search over the sphere asks of a scene."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from varcalc import integrators
from varcalc.optics.beam import NOTHING, Beam, RayStatus, launched
from varcalc.optics.march import March
from varcalc.optics.passes import HamiltonLeg, LastLeg, StraightLeg
from varcalc.optics.straight import StraightRays


def last_leg(march: March) -> LastLeg:
    """How rays come past points in the last medium."""
    last = march.models[-1]
    if isinstance(last, StraightRays):
        return StraightLeg(last)
    return HamiltonLeg(march.media[-1], march.dimension, march.geometries, integrators.for_many())


@dataclass
class Approaches:
    """Where rays of ``source`` (d,) come closest to ``target`` (d,); remembers what became of the others.

    They are followed to the optical path ``within`` and the distance ``far`` from the target.
    """

    march: March
    leg: LastLeg
    source: np.ndarray
    target: np.ndarray
    within: float
    far: float
    ends: Counter[RayStatus] = field(default_factory=Counter)
    entered: int = 0

    def minima(self, headings: np.ndarray) -> tuple[np.ndarray, Beam]:
        """The rows of ``headings`` (m, d) whose rays pass the target, and the rays there."""
        march = self.march
        start = np.tile(self.source, (len(headings), 1))
        beam = launched(start, headings, march.fields[0].index(start), neighbours=True)
        beam, status, alive = march.to_last_medium(beam, np.full(len(headings), self.within))
        self.ends.update(RayStatus(int(code)) for code in status[~alive])
        rows = np.flatnonzero(alive)
        self.entered += len(rows)
        leaving = march.shapes[-1] if march.shapes else NOTHING
        found, at = self.leg.minima(beam.take(rows), self.target, self.within, self.far, leaving)
        return rows[found], at
