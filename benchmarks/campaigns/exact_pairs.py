"""Blocks of random pairs of points between which all rays are known in closed form, and what came of them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np

from campaigns.arrival_pairs import (
    TURNS,
    Drawn,
    Layers,
    fish_eye_pair,
    guide_pair,
    layered_receivers,
    linear_pair,
    linear_scene,
)
from campaigns.graded_lenses import graded_lens_pair
from campaigns.ray_campaign import Block, Tally
from varcalc import optics

PAIRS, SCENES = 100, 10
"""Of a block: in one scene, and where each pair has a scene of its own."""
NEAR_EVERY = 3
"""Every third pair lies within a millionth of the caustic, down to round-off."""
CAUSTIC = 1e-6
WITHIN = 40.0
"""Optical path up to which the layers are searched: more than any arrival has."""
AGREED = 4e-16
"""What the closed forms' own round-off may add to a claimed error, relative to the optical path."""


def compared(tally: Tally, drawn: Sequence[Drawn], answers: Sequence[optics.Rays]) -> Iterator[str]:
    """Add to a tally what came of pairs; a line for each whose rays are not as many as there are, or not as claimed."""
    for one, rays in zip(drawn, answers, strict=True):
        tally.pairs += 1
        tally.near += bool(abs(one.depth) < CAUSTIC)
        tally.on_caustic += int(one.on_caustic)
        tally.rays += len(one.paths)
        tally.unresolved += rays.unresolved > 0
        lost = len(one.paths) - len(rays)
        if lost == 0:
            errors = [abs(ray.optical_path - path) for ray, path in zip(rays, one.paths, strict=True)]
            allowed = [ray.error + AGREED * path for ray, path in zip(rays, one.paths, strict=True)]
            beyond = int(np.count_nonzero(np.array(errors) > np.array(allowed)))
            tally.beyond += beyond
            tally.worst = max([tally.worst, *(float(e / p) for e, p in zip(errors, one.paths, strict=True))])
            if beyond:
                yield f"{one.source} to {one.receiver}: off by {max(errors):.3g}"
        elif not one.on_caustic:
            tally.missed += max(0, lost) if rays.unresolved == 0 else 0
            tally.missed_and_said += max(0, lost) if rays.unresolved else 0
            tally.false += max(0, -lost)
            said = f"{len(rays)} of {len(one.paths)}, {rays.unresolved} unresolved"
            yield f"{one.source} to {one.receiver}: {said}"


def _asked(
    tally: Tally, scene: optics.Scene, pairs: Sequence[Drawn], within: float | None, source: bool = False
) -> Iterator[str]:
    """Ask for all pairs at once, from one ``source`` or each from its own."""
    begun = time.process_time()
    sources = pairs[0].source if source else [pair.source for pair in pairs]
    answers = scene.arrivals(sources, [pair.receiver for pair in pairs], within=within)
    tally.seconds += time.process_time() - begun
    return compared(tally, pairs, answers)


def parabolas(rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Pairs in n² = 1 - 2y."""
    pairs = [linear_pair(rng, number % NEAR_EVERY == 0) for number in range(PAIRS)]
    return _asked(tally, linear_scene(), pairs, None)


def through_layers(rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Receivers of one source behind two planes."""
    layers = Layers()
    return _asked(tally, layers.scene(), layered_receivers(rng, layers, PAIRS), WITHIN, source=True)


def great_circles(rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Pairs in the fish-eye."""
    pairs = [fish_eye_pair(rng) for _ in range(PAIRS)]
    return _asked(tally, optics.Scene(optics.fish_eye()), pairs, 2 * np.pi * TURNS)


def images(rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Pairs between mirrors."""
    for _ in range(SCENES):
        scene, pair = guide_pair(rng)
        yield from _asked(tally, scene, [pair], None)


def graded_lenses(rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Pairs on two sides of a graded rod between plane faces."""
    for _ in range(SCENES):
        lens, pair, within = graded_lens_pair(rng)
        yield from _asked(tally, lens.scene(), [pair], within)


FAMILIES: dict[str, Block] = {
    "n² = 1 - 2y": parabolas, "layers": through_layers, "fish-eye": great_circles, "between mirrors": images,
    "graded lenses": graded_lenses,
}  # fmt: skip
"""By name."""
