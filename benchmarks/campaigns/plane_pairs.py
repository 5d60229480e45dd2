"""All rays between points of random media of the plane, against fans that know nothing of varcalc."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from campaigns.plane_fans import SIGMA, Meeting, Scenery, aimed, closest, nets
from campaigns.ray_campaign import Tally
from varcalc import optics

RECEIVERS = 20
RAYS, STEPS = 100_000, 240
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
    meetings: list[list[Meeting]] = [[] for _ in targets]
    for net in nets(scenery, source, angles, STEPS):
        for known, target in zip(meetings, targets, strict=True):
            known.extend(net.met(target, scenery.within))
    begun = time.process_time()
    answers = optics.Scene(scenery.medium).arrivals(source, targets, within=scenery.within)
    tally.seconds += time.process_time() - begun
    lines: list[str] = []
    for target, rays, rough in zip(targets, answers, meetings, strict=True):
        tally.pairs += 1
        tally.rays += len(rays)
        tally.unresolved += rays.unresolved > 0
        own = [(float(np.arctan2(*ray.tangents[0][::-1])), ray.optical_path) for ray in rays]
        # what both have needs no further look; what one of them lacks is aimed at by the fan's own rule
        for launch in _missed(scenery, source, target, own, rough):
            tally.missed += rays.unresolved == 0
            tally.missed_and_said += rays.unresolved > 0
            tally.rays += 1
            lines.append(f"missed: {source} to {target}, {launch}, unresolved {rays.unresolved}")
        n = scenery.squared(source[None])[0][0]
        for one in own:
            if any(_alike(one, guess[:2], ROUGH) for guess in rough):
                continue
            found = aimed(scenery, source, target, one[0], one[1] / n)
            tally.more += found is not None
            if found is None:
                lines.append(f"unconfirmed: {source} to {target}, {one}")
                tally.unconfirmed += 1
                tally.false += closest(scenery, source, target, one[0], one[1] / n) > STRAYED
    return lines


def _missed(
    scenery: Scenery, source: np.ndarray, target: np.ndarray, own: list[tuple[float, float]], rough: list[Meeting]
) -> Iterator[tuple[float, float]]:
    """Rays of the fan that are none of ``own``, each of which answers for one ray of the fan alone."""
    left = list(own)
    for guess in rough:
        alike = next((one for one in left if _alike(guess[:2], one, ROUGH)), None)
        if alike is not None:
            left.remove(alike)
            continue
        found = aimed(scenery, source, target, guess.angle, SIGMA * scenery.within / STEPS * guess.steps)
        if found is None or found[1] > (1 - EDGE) * scenery.within:
            continue
        if not any(_alike(found, one, scenery.same) for one in own):
            yield found


def _alike(one: tuple[float, float], other: tuple[float, float], close: float) -> bool:
    """Whether launching angles and optical paths are so close."""
    turn = abs(np.remainder(one[0] - other[0] + np.pi, 2 * np.pi) - np.pi)
    return bool(turn < close and abs(one[1] - other[1]) < 10 * close)
