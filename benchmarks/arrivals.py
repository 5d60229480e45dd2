"""All rays between random pairs of points, against what is known of them without tracing; and how many pairs a second.

Run: python benchmarks/arrivals.py [--count N]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click
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
from varcalc import optics

RECORDS = Path(__file__).parent / "records" / "arrivals.json"
SEED = 1662
"""The year of Fermat's letter on refraction."""
NEAR_EVERY = 3
"""Every third pair lies within a millionth of the caustic, down to round-off."""
WITHIN = 40.0
"""Optical path up to which the layers are searched: more than any arrival has."""
AGREED = 4e-16
"""What the closed forms' own round-off may add to a claimed error, relative to the optical path."""


@dataclass(frozen=True)
class Tally:
    """What came of one family: pairs, those within a millionth of the caustic, rays there are, and what went wrong.

    ``missed`` counts rays that were not found of pairs nothing of which is said to be unresolved, ``unresolved`` pairs.
    ``on_caustic`` counts pairs where round-off decides how many rays there are. ``worst`` is the largest error of an
    optical path, relative to it, and ``beyond`` counts errors larger than claimed.
    """

    family: str
    pairs: int
    near: int
    rays: int
    on_caustic: int
    missed: int
    unresolved: int
    false: int
    beyond: int
    worst: float
    seconds: float


def tally(family: str, drawn: list[Drawn], answers: list[optics.Rays], seconds: float) -> Tally:
    """Compare the ``answers`` with what was ``drawn``."""
    missed = unresolved = false = beyond = close = 0
    worst = 0.0
    for one, rays in zip(drawn, answers, strict=True):
        close += int(one.on_caustic)
        unresolved += int(rays.unresolved > 0)
        if len(rays) != len(one.paths):
            if not one.on_caustic:
                missed += max(0, len(one.paths) - len(rays)) if rays.unresolved == 0 else 0
                false += max(0, len(rays) - len(one.paths))
            continue
        for ray, path in zip(rays, one.paths, strict=True):
            error = abs(ray.optical_path - path)
            worst = max(worst, error / path)
            beyond += bool(error > ray.error + AGREED * path)
    near = sum(bool(abs(one.depth) < 1e-6) for one in drawn)
    rays = sum(len(one.paths) for one in drawn)
    return Tally(family, len(drawn), near, rays, close, missed, unresolved, false, int(beyond), float(worst), seconds)


def campaigns(count: int) -> list[Tally]:
    """All families, ``count`` pairs each, but between mirrors a fifth: there every pair has a scene of its own."""
    rng = np.random.default_rng(SEED)
    pairs = [linear_pair(rng, number % NEAR_EVERY == 0) for number in range(count)]
    layers = Layers()
    receivers = layered_receivers(rng, layers, count)
    begun = time.perf_counter()
    one = linear_scene().arrivals([d.source for d in pairs], [d.receiver for d in pairs])
    middle = time.perf_counter()
    other = layers.scene().arrivals(receivers[0].source, [d.receiver for d in receivers], within=WITHIN)
    ended = time.perf_counter()
    arcs = [fish_eye_pair(rng) for _ in range(count)]
    eye = optics.Scene(optics.fish_eye())
    third = eye.arrivals([d.source for d in arcs], [d.receiver for d in arcs], within=2 * np.pi * TURNS)
    last = time.perf_counter()
    guides = [guide_pair(rng) for _ in range(count // 5)]
    drawn = time.perf_counter()
    between = [scene.rays(pair.source, pair.receiver) for scene, pair in guides]
    mirrors = time.perf_counter() - drawn
    return [
        tally("n² = 1 - 2y", pairs, one, middle - begun),
        tally("layers", receivers, other, ended - middle),
        tally("fish-eye", arcs, third, last - ended),
        tally("between mirrors", [pair for _, pair in guides], between, mirrors),
    ]


@dataclass(frozen=True)
class Speed:
    """Pairs a second with all that a ray knows but its points: optical path, index, spreading, tangents."""

    scene: str
    asked: str
    pairs: int
    per_second: float
    per_processor_second: float


def timed(scene: str, asked: str, question: Callable[[], list[optics.Rays]]) -> Speed:
    """Ask once, with everything compiled, and count the time on the clock and that of the processors."""
    begun, used = time.perf_counter(), time.process_time()
    answers = question()
    assert all(ray.index >= 0 for rays in answers for ray in rays)
    clock, processor = time.perf_counter() - begun, time.process_time() - used
    return Speed(scene, asked, len(answers), len(answers) / clock, len(answers) / processor)


def speeds(count: int) -> list[Speed]:
    """How fast pairs are answered in three media."""
    fish_eye = optics.Scene(optics.fish_eye())
    return [
        *speeds_in("n² = 1 - 2y", linear_scene(), (-0.9, -1.0), (0.9, 0.05), None, count),
        *speeds_in("fish-eye", fish_eye, (-1.0, -1.0), (1.0, 1.0), 6.0, count),
        *speeds_in("Munk's channel", optics.Scene(optics.munk_profile()), (2e4, -4000.0), (1e5, -100.0), None, count),
    ]


def speeds_in(
    name: str, scene: optics.Scene, low: Sequence[float], high: Sequence[float], within: float | None, count: int
) -> list[Speed]:
    """Receivers of one source, pairs with no end in common, and one call a pair; points between two corners."""
    rng = np.random.default_rng(SEED)
    receivers = rng.uniform(low, high, (count, 2))
    source, sources = (0.1, -0.2), rng.uniform(low, high, (count // 4, 2))
    few, single = receivers[: count // 4], receivers[: count // 200]
    scene.arrivals(source, receivers[:2], within=within)  # what is compiled is compiled
    return [
        timed(name, "one source", lambda: scene.arrivals(source, receivers, within=within)),
        timed(name, "as many sources", lambda: scene.arrivals(sources, few, within=within)),
        timed(name, "one call a pair", lambda: [scene.rays(source, one, within=within) for one in single]),
    ]


@click.command()
@click.option("--count", default=1000, show_default=True, help="Pairs of each family.")
@click.option("--receivers", default=4000, show_default=True, help="Receivers that are timed; 0 for none.")
def main(count: int, receivers: int) -> None:
    """Run the campaigns, store what came of them, and exit 1 when a ray was missed, false or worse than claimed."""
    tallies = campaigns(count)
    for one in tallies:
        print(
            f"{one.family}: {one.pairs} pairs, {one.near} within 1e-6 of the caustic ({one.on_caustic} on it to "
            f"round-off), {one.rays} rays: {one.missed} missed in silence, {one.unresolved} pairs unresolved, "
            f"{one.false} false, {one.beyond} worse than claimed; worst relative error {one.worst:.1e}; "
            f"{one.seconds:.1f} s"
        )
    rates = speeds(receivers) if receivers else []
    for one in rates:
        print(
            f"{one.scene}, {one.asked}: {one.per_second:.0f} pairs a second, {one.per_processor_second:.0f} for each "
            f"second of a processor ({one.pairs} pairs)"
        )
    RECORDS.write_text(
        json.dumps({"campaigns": [asdict(t) for t in tallies], "speeds": [asdict(s) for s in rates]}, indent=1) + "\n"
    )
    sys.exit(any(one.missed or one.false or one.beyond for one in tallies))


if __name__ == "__main__":
    main()
