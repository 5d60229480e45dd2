"""Single rays followed leg by leg through the media and surfaces of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from varcalc import engines
from varcalc.engines import Flow
from varcalc.optics.beam import NOTHING, Beam, RayStatus
from varcalc.optics.legs import Leg, hamilton_leg, straight_leg
from varcalc.optics.march import March
from varcalc.optics.straight import StraightRays
from varcalc.optics.system import packed, ray_system

LOST = (RayStatus.SINGULAR, RayStatus.TOO_MANY_STEPS)
"""Rays that end so cannot be followed a second time to where they ended."""


@dataclass
class Tracks:
    """The rays of one scene; what is compiled is kept."""

    march: March
    _flows: dict[int, Flow] = field(init=False, default_factory=dict, repr=False)

    def legs(self, beam: Beam, path: float) -> tuple[list[Leg], Beam, RayStatus]:
        """The legs of one ray, with its neighbours, up to the optical path ``path``; its end and how it ended."""
        legs, status = [], RayStatus.ARRIVED
        for number in range(len(self.march.media)):
            leaving = self.march.shapes[number - 1] if number else NOTHING
            arrival = self.march.models[number].advance(beam, np.full(1, path), leaving)
            status = RayStatus(int(arrival.status[0]))
            if status in LOST:
                return legs, beam, status
            legs.append(self._leg(number, beam, arrival.beam))
            beam = arrival.beam
            if status is not RayStatus.ARRIVED or arrival.struck[0] == NOTHING:
                break
            if number == len(self.march.surfaces) or arrival.struck[0] != self.march.shapes[number]:
                return legs, beam, RayStatus.OUT_OF_ORDER
            beam, total = self.march.refracted(number, beam)
            if total[0]:
                return legs, beam, RayStatus.TOTAL_REFLECTION
        return legs, beam, status

    def _leg(self, number: int, before: Beam, after: Beam) -> Leg:
        """The leg in medium ``number`` from ``before`` to ``after``."""
        model = self.march.models[number]
        end = float(after.optical_path[0])
        if isinstance(model, StraightRays):
            return straight_leg(
                before, model.squared_index, (end - float(before.optical_path[0])) / model.squared_index
            )
        dimension, here = self.march.dimension, self.march.fields[number]
        if number not in self._flows:
            system = ray_system(self.march.media[number], dimension, dimension - 1)
            self._flows[number] = engines.available()[0].compile(system)
        pieces = model.pieces(before, end) or [(0.0, np.zeros(0), packed(before)[0])]
        return hamilton_leg(pieces, self._flows[number], dimension, lambda r: here(r)[1] / 2, model.sigma(before, end))
