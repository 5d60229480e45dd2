"""All rays between random pairs of points, against closed forms and independent fans; and how many pairs a second.

Run: python benchmarks/arrivals.py [--count N] [--media N] [--family NAME]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import chain
from multiprocessing import get_context
from pathlib import Path

import click
import numpy as np

from campaigns import layer_fans, layer_pairs, plane_fans, plane_pairs, ray_campaign, switched_layers
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
from campaigns.ray_campaign import campaign
from varcalc import optics

RECORDS = Path(__file__).parent / "records" / "arrivals.json"
SEED = 1662
"""The year of Fermat's letter on refraction."""
NEAR_EVERY = 3
"""Every third pair lies within a millionth of the caustic, down to round-off."""
WITHIN = 40.0
"""Optical path up to which the layers are searched: more than any arrival has."""
LAYERED = {**layer_fans.FAMILIES, **switched_layers.FAMILIES}
RANDOM = [*LAYERED, *plane_fans.FAMILIES]
"""Names of the families that are held against fans."""
AGREED = 4e-16
"""What the closed forms' own round-off may add to a claimed error, relative to the optical path."""


@dataclass(frozen=True)
class Tally:
    """What came of one family: pairs, those within a millionth of the caustic, rays there are, and what went wrong.

    ``missed`` counts rays that were not found of pairs nothing of which is said to be unresolved, ``missed_and_said``
    those of others; ``unresolved`` counts pairs.
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
    worst: float | None
    seconds: float
    missed_and_said: int = 0


def by_fans(own: ray_campaign.Tally) -> Tally:
    """What came of a family whose rays are known from a fan: how many there are, and to within what they agree."""
    rays = own.rays + own.missed_in_silence + own.missed_and_said
    return Tally(
        own.family, own.pairs, 0, rays, 0, own.missed_in_silence, own.unsure, own.false, 0, None, own.seconds,
        own.missed_and_said,
    )  # fmt: skip


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


def known(count: int) -> list[Tally]:
    """The families with closed forms, ``count`` pairs each.

    Between mirrors and through graded lenses they are a fifth: there every pair has a scene of its own.
    """
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
    begun_mirrors = time.perf_counter()
    between = [scene.rays(pair.source, pair.receiver) for scene, pair in guides]
    mirrors = time.perf_counter() - begun_mirrors
    rods = [graded_lens_pair(rng) for _ in range(count // 5)]
    begun_rods = time.perf_counter()
    through = [lens.scene().rays(pair.source, pair.receiver, within=within) for lens, pair, within in rods]
    lenses = time.perf_counter() - begun_rods
    return [
        tally("n² = 1 - 2y", pairs, one, middle - begun),
        tally("layers", receivers, other, ended - middle),
        tally("fish-eye", arcs, third, last - ended),
        tally("between mirrors", [pair for _, pair in guides], between, mirrors),
        tally("graded lenses", [pair for _, pair, _ in rods], through, lenses),
    ]


def drawn(media: int, families: Sequence[str]) -> Iterator[Tally]:
    """What came of so many random ``media`` of each of the ``families``, 40 pairs in layers and 20 in the plane."""
    names = [name for name in RANDOM if name in families]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(_of_family, name, media) for name in names]):
            yield done.result()


def _of_family(name: str, media: int) -> Tally:
    if name in LAYERED:
        return by_fans(campaign(name, LAYERED[name], media, layer_pairs.asked))
    return by_fans(campaign(name, plane_fans.FAMILIES[name], media, plane_pairs.asked))


@dataclass(frozen=True)
class Speed:
    """Pairs a second with the optical path, index and tangents of every ray, and with its spreading besides."""

    scene: str
    asked: str
    pairs: int
    per_second: float
    per_processor_second: float
    with_spreading: float


def timed(scene: str, asked: str, question: Callable[[], list[optics.Rays]]) -> Speed:
    """Ask once, with everything compiled, and count the time on the clock and that of the processors."""
    begun, used = time.perf_counter(), time.process_time()
    answers = question()
    assert all(ray.index >= 0 for rays in answers for ray in rays)
    clock, processor = time.perf_counter() - begun, time.process_time() - used
    assert all(ray.spreading >= 0 for rays in answers for ray in rays)
    whole = time.process_time() - used
    pairs = len(answers)
    return Speed(scene, asked, pairs, pairs / clock, pairs / processor, pairs / whole)


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
@click.option(
    "--count", default=1000, show_default=True, help="Pairs of each family with a closed form; 0 for no pairs."
)
@click.option("--media", default=8, show_default=True, help="Media of each random family; 0 for none.")
@click.option("--family", "families", multiple=True, type=click.Choice(RANDOM), help="Of those; all when left out.")
@click.option("--receivers", default=4000, show_default=True, help="Receivers that are timed; 0 for none.")
def main(count: int, media: int, families: tuple[str, ...], receivers: int) -> None:
    """Run the campaigns, store what came of them, and exit 1 when a ray was missed, false or worse than claimed."""
    stored = json.loads(RECORDS.read_text()) if RECORDS.exists() else {}
    tallies = {one["family"]: one for one in stored.get("campaigns", [])}
    done = []
    for one in chain(known(count) if count else [], drawn(media, families or RANDOM) if media else []):
        worst = "" if one.worst is None else f"; worst relative error {one.worst:.1e}"
        print(
            f"{one.family}: {one.pairs} pairs, {one.near} within 1e-6 of the caustic ({one.on_caustic} on it to "
            f"round-off), {one.rays} rays: {one.missed} missed in silence, {one.unresolved} pairs unresolved, "
            f"{one.false} false, {one.beyond} worse than claimed{worst}; {one.seconds:.1f} s",
            flush=True,
        )
        tallies[one.family] = asdict(one)  # what is not measured anew stays
        stored["campaigns"] = list(tallies.values())
        RECORDS.write_text(json.dumps(stored, indent=1) + "\n")
        done.append(one)
    rates = speeds(receivers) if receivers else []
    for one in rates:
        print(
            f"{one.scene}, {one.asked}: {one.per_second:.0f} pairs a second, {one.per_processor_second:.0f} for each "
            f"second of a processor, {one.with_spreading:.0f} with the spreading ({one.pairs} pairs)"
        )
    if rates:
        RECORDS.write_text(json.dumps({**stored, "speeds": [asdict(s) for s in rates]}, indent=1) + "\n")
    sys.exit(any(one.missed or one.false or one.beyond for one in done))


if __name__ == "__main__":
    main()
