"""Single rays followed leg by leg through the media and surfaces of a scene."""

from __future__ import annotations

import numpy as np

from varcalc.optics.beam import NOTHING, Beam, RayStatus
from varcalc.optics.legs import Leg
from varcalc.optics.march import March

LOST = (RayStatus.SINGULAR, RayStatus.TOO_MANY_STEPS)
"""Rays that end so cannot be followed a second time to where they ended."""


def followed(march: March, beam: Beam, path: float) -> tuple[list[Leg], Beam, RayStatus]:
    """The legs of one ray, with its neighbours, up to the optical path ``path``; its end and how it ended."""
    legs, status = [], RayStatus.ARRIVED
    for number, model in enumerate(march.models):
        leaving = march.shapes[number - 1] if number else NOTHING
        arrival = model.advance(beam, np.full(1, path), leaving)
        status = RayStatus(int(arrival.status[0]))
        if status in LOST:
            return legs, beam, status
        legs.append(model.leg(beam, float(arrival.beam.optical_path[0])))
        beam = arrival.beam
        if status is not RayStatus.ARRIVED or arrival.struck[0] == NOTHING:
            break
        if number == len(march.surfaces) or arrival.struck[0] != march.shapes[number]:
            return legs, beam, RayStatus.OUT_OF_ORDER
        beam, total = march.refracted(number, beam)
        if total[0]:
            return legs, beam, RayStatus.TOTAL_REFLECTION
    return legs, beam, status
