"""All rays between points of random layers, against fans that know nothing of varcalc."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from campaigns.layer_fans import LONGEST, STEEPEST, Scenery, closer, counted, fan
from campaigns.ray_campaign import Tally
from varcalc import optics

RECEIVERS, STOPS = 40, 8
"""Of one source, at so many distances."""
RAYS = 75_000
"""Of slight rays; a third as many are steep."""
BESIDE, NEAR, FINER = 1e-6, 1e-5, 64
"""Radians beside a ray that is looked at, how near to its height it comes, in parts of all heights, and parts of a step
in which it is taken there: steep rays turn quickly."""


def asked(scenery: Scenery, rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Add one medium to a tally; yields a line for every pair where something was missed."""
    farthest = scenery.turn * rng.uniform(*scenery.turns)
    step = scenery.turn / scenery.steps
    stops = np.unique(rng.integers(1, max(2, int(farthest / step)), STOPS))
    steep = np.linspace(-STEEPEST, STEEPEST, RAYS // 3)
    slight = np.arctan(np.linspace(-1, 1, RAYS) * min(scenery.spread, 14.0))
    rays = fan(scenery, np.unique(np.concatenate([steep, slight])), step, stops)
    which = rng.integers(0, len(stops), RECEIVERS)
    heights = rng.uniform(*scenery.heights, RECEIVERS)
    scene = optics.Scene(scenery.medium)
    largest = float(np.sqrt(np.max(scenery.g(np.linspace(*scenery.heights, 200)))))
    within = LONGEST * largest * stops * step
    begun = time.process_time()
    answers: list[optics.Rays | None] = [None] * RECEIVERS
    for stop in np.unique(which):
        rows = np.flatnonzero(which == stop)
        ends = np.column_stack([np.full(len(rows), stops[stop] * step), heights[rows]])
        for row, found in zip(rows, scene.arrivals((0, scenery.source), ends, within=within[stop]), strict=True):
            answers[row] = found
    tally.seconds += time.process_time() - begun
    for stop, height, found in zip(which, heights, answers, strict=True):
        assert found is not None
        count = counted(rays, stop, height, within[stop])
        if count != len(found):
            count = counted(closer(rays, step, stop, height), 0, height, within[stop])
        tally.pairs += 1
        tally.rays += max(count, len(found))
        tally.unresolved += found.unresolved > 0
        strayed = 0
        if len(found) > count:
            tally.more += len(found) - count
            strayed = _strayed(scenery, found, step, stops[: stop + 1], height)
        lost = max(0, count - len(found))
        tally.false += strayed
        tally.missed += lost if found.unresolved == 0 else 0
        tally.missed_and_said += lost if found.unresolved else 0
        if lost or strayed:
            place = f"({stops[stop] * step:.17g}, {height:.17g})"
            said = f"{len(found)} of {count}, {strayed} of them false, {found.unresolved} unresolved"
            yield f"from height {scenery.source:.17g} to {place}: {said}"


def _strayed(scenery: Scenery, found: optics.Rays, step: float, stops: np.ndarray, height: float) -> int:
    """How many of the rays do not come to the height as the fan's rule takes them."""
    angles = np.array([np.arctan2(*ray.tangents[0][::-1]) for ray in found])
    beside = angles[:, None] + BESIDE * np.array([-1.0, 0.0, 1.0])
    own = np.unique(beside)
    there = fan(scenery, own, step / FINER, FINER * stops[-1:]).heights[-1][np.searchsorted(own, beside)]
    around = (there.min(axis=1) <= height) & (there.max(axis=1) >= height)
    near = np.abs(there[:, 1] - height) <= NEAR * (scenery.heights[1] - scenery.heights[0])
    return int(np.count_nonzero(~around & ~near))
