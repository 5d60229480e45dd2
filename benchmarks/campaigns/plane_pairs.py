"""All rays between points of random media of the plane, against fans that know nothing of varcalc."""

from __future__ import annotations

import time

import numpy as np

from campaigns.plane_fans import SIGMA, Scenery, aimed, closest, fan, met
from campaigns.ray_campaign import Tally
from varcalc import optics

RECEIVERS = 20
RAYS, STEPS = 4_000, 240
ROUGH = 5e-3
"""Launching angles of one ray agree so well as the net has it; optical paths to ten times that."""
STRAYED = 1e-3
"""A ray that comes no nearer to its target, as the fan's rule takes it by fine steps, is none of it."""
EDGE = 1e-3
"""Of the largest optical path: rays so near to it are on neither side."""


def asked(scenery: Scenery, rng: np.random.Generator, tally: Tally) -> list[str]:
    """Add one medium to a tally; a line for every ray that is missed or false."""
    source = rng.uniform(-1, 1, 2)
    targets = rng.uniform(-1.2, 1.2, (RECEIVERS, 2))
    angles = np.linspace(0, 2 * np.pi, RAYS + 1) + 1e-4
    places, paths = fan(scenery, source, angles, STEPS)
    begun = time.process_time()
    answers = optics.Scene(scenery.medium).arrivals(source, targets, within=scenery.within)
    tally.seconds += time.process_time() - begun
    lines = []
    for target, rays in zip(targets, answers, strict=True):
        tally.pairs += 1
        tally.rays += len(rays)
        tally.unresolved += rays.unresolved > 0
        own = [(float(np.arctan2(*ray.tangents[0][::-1])), ray.optical_path) for ray in rays]
        net = met(places, paths, target, scenery.within)
        rough = [(float(angles[k : k + 2].mean()), float(paths[step : step + 2, k].mean())) for step, k in net]
        # what both have needs no further look; what one of them lacks is aimed at by the fan's own rule
        for guess, (step, _) in zip(rough, net, strict=True):
            if any(_alike(guess, other, ROUGH) for other in own):
                continue
            found = aimed(scenery, source, target, guess[0], SIGMA * scenery.within / STEPS * (step + 0.5))
            if found is None or found[1] > (1 - EDGE) * scenery.within:
                continue
            if any(_alike(found, one, scenery.same) for one in own):
                continue
            tally.missed += rays.unresolved == 0
            tally.missed_and_said += rays.unresolved > 0
            tally.rays += 1
            lines.append(f"missed: {source} to {target}, {found}, unresolved {rays.unresolved}")
        n = scenery.squared(source[None])[0][0]
        for one in own:
            if any(_alike(one, guess, ROUGH) for guess in rough):
                continue
            found = aimed(scenery, source, target, one[0], one[1] / n)
            tally.more += found is not None
            if found is None:
                lines.append(f"unconfirmed: {source} to {target}, {one}")
                tally.unconfirmed += 1
                tally.false += closest(scenery, source, target, one[0], one[1] / n) > STRAYED
    return lines


def _alike(one: tuple[float, float], other: tuple[float, float], close: float) -> bool:
    """Whether launching angles and optical paths are so close."""
    turn = abs(np.remainder(one[0] - other[0] + np.pi, 2 * np.pi) - np.pi)
    return bool(turn < close and abs(one[1] - other[1]) < 10 * close)
