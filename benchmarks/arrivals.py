"""All rays between random pairs of points, against closed forms and independent fans.

Run: python benchmarks/arrivals.py [--family NAME] [--blocks N] [--workers N] [--renew] [--show]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

import click
import numpy as np

from campaigns import exact_pairs, layer_fans, layer_pairs, plane_fans, plane_pairs, switched_layers
from campaigns.bounded import Failed, results
from campaigns.ray_campaign import (
    Block,
    Family,
    Tally,
    code,
    counted_block,
    store,
    stored,
    summed,
    table,
    wanted,
)

RECORDS = Path(__file__).parent / "records" / "arrivals.csv"
LIMIT = 900.0
"""Seconds of processor time after which a block, its fan included, is given up."""
MEDIA = 8
"""Blocks of a family, where nothing else is said: 40 pairs each in layers, 20 in the plane."""
MANY = {
    "n² = 1 - 2y": 12, "layers": 12, "fish-eye": 12, "between mirrors": 20, "graded lenses": 20, "wells": 5,
    "channels to 1000 km": 3, **dict.fromkeys(plane_fans.FAMILIES, 15),
}  # fmt: skip
"""Of families whose blocks take little, or much."""


Scenery = TypeVar("Scenery")


def _of_media(
    drawn: Mapping[str, Callable[[np.random.Generator], Scenery]],
    asked: Callable[[Scenery, np.random.Generator, Tally], Iterable[str]],
) -> dict[str, Block]:
    """Blocks of one medium each, which ``asked`` asks for its pairs."""

    def of(scenery: Callable[[np.random.Generator], Scenery]) -> Block:
        return lambda rng, tally: asked(scenery(rng), rng, tally)

    return {name: of(scenery) for name, scenery in drawn.items()}


BLOCKS_OF: dict[str, Block] = {
    **exact_pairs.FAMILIES,
    **_of_media({**layer_fans.FAMILIES, **switched_layers.FAMILIES}, layer_pairs.asked),
    **_of_media(plane_fans.FAMILIES, plane_pairs.asked),
}
"""How each family draws and asks a block."""
FAMILIES = {name: Family(block, MANY.get(name, MEDIA)) for name, block in BLOCKS_OF.items()}
"""By name."""


def block(task: tuple[str, int], of_code: str) -> Tally:
    """What came of one block."""
    family, number = task
    return counted_block(family, FAMILIES[family].block, number, of_code)


@click.command()
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="Only these families.")
@click.option("--blocks", default=None, type=int, help="At most so many blocks of each family.")
@click.option("--workers", default=1, show_default=True, help="Processes that work side by side.")
@click.option("--renew", is_flag=True, help="Do again what other code did.")
@click.option("--show", is_flag=True, help="Print what is stored, and ask nothing.")
def main(families: tuple[str, ...], blocks: int | None, workers: int, renew: bool, show: bool) -> None:
    """Do the blocks that the record lacks, one by one; exit 1 when a ray was missed, false or worse than claimed."""
    rows, now = stored(RECORDS), code()
    tasks = [] if show else wanted(FAMILIES, families or list(FAMILIES), blocks)
    missing = [task for task in tasks if task not in rows or (renew and rows[task].code != now)]
    failures = 0
    for task, done in results(partial(block, of_code=now), missing, LIMIT, workers) if missing else ():
        if isinstance(done, Failed):
            failures += 1
            print(f"{task[0]} {task[1]}: {done.value}", flush=True)
            continue
        rows[task] = done
        print(done, flush=True)
        store(RECORDS, _in_order(rows))
    print(table(summed(_in_order(rows))))
    older = sum(row.code != now for row in rows.values())
    if older:
        print(f"{older} of {len(rows)} blocks are of other code; --renew does them again")
    sys.exit(failures > 0 or any(row.wrong for row in rows.values()))


def _in_order(rows: dict[tuple[str, int], Tally]) -> list[Tally]:
    """The blocks in the order of the families."""
    names = list(FAMILIES)
    return sorted(rows.values(), key=lambda row: (names.index(row.family), row.number))


if __name__ == "__main__":
    main()
