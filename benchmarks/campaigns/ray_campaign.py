"""Campaigns over families of random media: each medium asked in its turn, what came of it printed and stored."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np


@dataclass
class Tally:
    """What came of a family: pairs, rays that were found, and what was missed, by whether that was said.

    ``more`` counts what was found that the fan does not show, ``false`` what of that its own rule takes elsewhere,
    ``unconfirmed`` what the fan's own rule could not follow as far; ``unsure`` pairs that say that some of the search
    was left unresolved, whatever they found.
    """

    family: str
    pairs: int = 0
    rays: int = 0
    missed_in_silence: int = 0
    missed_and_said: int = 0
    more: int = 0
    false: int = 0
    unconfirmed: int = 0
    unsure: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        return (
            f"{self.family}: {self.pairs} pairs, {self.rays} rays: {self.missed_in_silence} missed in silence, "
            f"{self.missed_and_said} missed and said so, {self.more} more than the fan shows, "
            f"{self.false} false, {self.unconfirmed} not confirmed, {self.unsure} pairs unsure; "
            f"{self.pairs / self.seconds:.0f} pairs a second"
        )


Scenery = TypeVar("Scenery")


def campaign(
    name: str,
    drawn: Callable[[np.random.Generator], Scenery],
    media: int,
    asked: Callable[[Scenery, np.random.Generator, Tally], Iterable[str]],
) -> Tally:
    """What came of so many ``media`` of one family.

    ``asked`` adds a medium to the tally, and gives a line for whatever is missed.
    """
    tally = Tally(name)
    for number in range(media):
        rng = np.random.default_rng([zlib.crc32(name.encode()), number])
        for line in asked(drawn(rng), rng, tally):
            print(f"  {name} {number} {line}", flush=True)
    print(tally, flush=True)
    return tally
