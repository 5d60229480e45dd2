"""All rays between points of random layers, against fans that know nothing of varcalc: what is missed in silence.

Run: python benchmarks/layer_rays.py [--media N] [--family NAME]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from campaigns.layer_fans import FAMILIES, LONGEST, STEEPEST, Scenery, counted, fan, suspects
from campaigns.ray_campaign import Tally, campaign
from varcalc import optics

RECORDS = Path(__file__).parent / "records" / "layer_rays.csv"
RECEIVERS, STOPS = 40, 8
"""Of one source, at so many distances."""
RAYS = 15_000


def asked(scenery: Scenery, rng: np.random.Generator, tally: Tally) -> Iterator[str]:
    """Add one medium to a tally; yields a line for every pair where something was missed."""
    farthest = scenery.turn * rng.uniform(2, 16)
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
    begun = time.perf_counter()
    answers: list[optics.Rays | None] = [None] * RECEIVERS
    for stop in np.unique(which):
        rows = np.flatnonzero(which == stop)
        ends = np.column_stack([np.full(len(rows), stops[stop] * step), heights[rows]])
        for row, found in zip(rows, scene.arrivals((0, scenery.source), ends, within=within[stop]), strict=True):
            answers[row] = found
    tally.seconds += time.perf_counter() - begun
    for stop, height, found in zip(which, heights, answers, strict=True):
        assert found is not None
        count = counted(rays, stop, height, within[stop])
        if count != len(found):
            closer = fan(scenery, suspects(rays, stop, height), step, stops[: stop + 1])
            count = counted(closer, stop, height, within[stop])
        tally.pairs += 1
        tally.rays += len(found)
        tally.unsure += found.unresolved > 0
        tally.more += len(found) > count
        if len(found) < count:
            tally.missed_in_silence += found.unresolved == 0
            tally.missed_and_said += found.unresolved > 0
            place = f"({stops[stop] * step:.17g}, {height:.17g})"
            said = f"{len(found)} of {count}, {found.unresolved} unresolved"
            yield f"from height {scenery.source:.17g} to {place}: {said}"


@click.command()
@click.option("--media", default=14, show_default=True, help="Random media of each family, 40 pairs in each.")
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="All when left out.")
def main(media: int, families: tuple[str, ...]) -> None:
    """Run the campaign, store what came of it, and exit 1 when a ray was missed in silence."""
    sys.exit(campaign(FAMILIES, families, media, asked, RECORDS))


if __name__ == "__main__":
    main()
