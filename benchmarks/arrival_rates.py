"""How many pairs of points a second get all their rays.

Run: python benchmarks/arrival_rates.py [--receivers N]
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import casadi as ca
import click
import numpy as np

from campaigns.arrival_pairs import linear_scene
from varcalc import optics

RECORDS = Path(__file__).parent / "records" / "arrival_rates.json"
SEED = 1662
"""The year of Fermat's letter on refraction."""


@dataclass(frozen=True)
class Speed:
    """Pairs a second with the optical path, index and tangents of every ray, and with its spreading besides."""

    scene: str
    asked: str
    pairs: int
    rays: float
    """Of one pair, on average."""
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
    return Speed(scene, asked, pairs, sum(map(len, answers)) / pairs, pairs / clock, pairs / processor, pairs / whole)


def speeds(count: int) -> list[Speed]:
    """How fast pairs are answered: first where rays are closed forms, then by the range function."""
    fish_eye = optics.Scene(optics.fish_eye())
    rod = optics.Scene(optics.Stratified(lambda y: 1.5 * ca.sqrt(1 - y**2 / 4)))
    centre = optics.Scene(optics.Radial(lambda r: ca.sqrt(2.25 - r**2 / 2)))
    saddle = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(2 + 0.3 * x * y)))
    square = (-1.0, -1.0), (1.0, 1.0)
    return [
        *speeds_in("n² = 1 - 2y", linear_scene(), (-0.9, -1.0), (0.9, 0.05), None, count),
        *speeds_in("rod, n² = 2.25 - 9y²/16", rod, *square, None, count),
        *speeds_in("n² = 2.25 - r²/2", centre, *square, None, count),
        *speeds_in("saddle, n² = 2 + 0.3xy", saddle, *square, None, count),
        *speeds_in("fish-eye", fish_eye, *square, 6.0, count),
        *speeds_in("Munk's channel", optics.Scene(optics.munk_profile()), (2e4, -4000.0), (1e5, -100.0), None, count),
    ]


def speeds_in(
    name: str, scene: optics.Scene, low: Sequence[float], high: Sequence[float], within: float | None, count: int
) -> list[Speed]:
    """Receivers of one source, pairs with no end in common, and one call a pair; points between two corners.

    The first of the pairs are asked about first, while tables are made that serve all the others.
    """
    rng = np.random.default_rng(SEED)
    receivers = rng.uniform(low, high, (count, 2))
    source, sources = (0.1, -0.2), rng.uniform(low, high, (count, 2))
    first, single = slice(count // 4), receivers[: count // 200]
    scene.arrivals(source, receivers[:2], within=within)  # what is compiled is compiled
    return [
        timed(name, "one source", lambda: scene.arrivals(source, receivers, within=within)),
        timed(name, "as many sources", lambda: scene.arrivals(sources[first], receivers[first], within=within)),
        timed(name, "as many sources, more", lambda: scene.arrivals(sources, receivers[::-1], within=within)),
        timed(name, "one call a pair", lambda: [scene.rays(source, one, within=within) for one in single]),
    ]


@click.command()
@click.option("--receivers", default=4000, show_default=True, help="Receivers that are timed.")
def main(receivers: int) -> None:
    """Measure, print and store."""
    rates = speeds(receivers)
    for one in rates:
        print(
            f"{one.scene}, {one.asked}: {one.per_second:.0f} pairs a second, {one.per_processor_second:.0f} for each "
            f"second of a processor, {one.with_spreading:.0f} with the spreading ({one.pairs} pairs, "
            f"{one.rays:.1f} rays each)"
        )
    RECORDS.write_text(json.dumps([asdict(one) for one in rates], indent=1) + "\n")


if __name__ == "__main__":
    main()
