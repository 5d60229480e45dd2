"""Campaigns over families of random media: each medium asked in its turn, what came of it printed and stored."""

from __future__ import annotations

import csv
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TypeVar

import numpy as np


@dataclass
class Tally:
    """What came of a family: pairs, rays that were found, and what was missed, by whether that was said.

    ``more`` counts what was found that the fan does not show, each ray carried to its point by the library;
    ``unconfirmed`` what the fan's own rule could not follow as far; ``unsure`` pairs that say that some of the search
    was left unresolved, whatever they found.
    """

    family: str
    pairs: int = 0
    rays: int = 0
    missed_in_silence: int = 0
    missed_and_said: int = 0
    more: int = 0
    unconfirmed: int = 0
    unsure: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        return (
            f"{self.family}: {self.pairs} pairs, {self.rays} rays: {self.missed_in_silence} missed in silence, "
            f"{self.missed_and_said} missed and said so, {self.more} more than the fan shows, {self.unconfirmed} not "
            f"confirmed, {self.unsure} pairs unsure; {self.pairs / self.seconds:.0f} pairs a second"
        )


Scenery = TypeVar("Scenery")


def campaign(
    families: Mapping[str, Callable[[np.random.Generator], Scenery]],
    chosen: Sequence[str],
    media: int,
    asked: Callable[[Scenery, np.random.Generator, Tally], Iterable[str]],
    records: Path,
) -> bool:
    """Whether a ray was missed in silence in so many ``media`` of each family, all of them where none are ``chosen``.

    ``asked`` adds a medium to the tally, and gives a line for whatever is missed. What all families came to is stored.
    """
    tallies = []
    for name in chosen or families:
        tally = Tally(name)
        for number in range(media):
            rng = np.random.default_rng([zlib.crc32(name.encode()), number])
            for line in asked(families[name](rng), rng, tally):
                print(f"  {name} {number} {line}", flush=True)
        print(tally, flush=True)
        tallies.append(tally)
    if not chosen:
        with records.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [f.name for f in fields(Tally)])
            writer.writeheader()
            writer.writerows({**asdict(t), "seconds": round(t.seconds, 1)} for t in tallies)
    return any(t.missed_in_silence for t in tallies)
