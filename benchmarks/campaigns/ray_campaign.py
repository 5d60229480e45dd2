"""A campaign over families of random media, block by block: each stored as it is done, and known by its code."""

from __future__ import annotations

import csv
import hashlib
import sys
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

import varcalc as vc

PARTS = ("optics", "integrators", "numerics", "symbolic")
"""Of the package: what rays are found by."""
CODE_DIGITS = 12


@dataclass
class Tally:
    """What came of one block of a family: a medium with its pairs, or so many pairs.

    Attributes
    ----------
    family, number, code : str, int, str
        What was drawn, and by which code it was answered (:func:`code`).
    pairs, near, on_caustic : int
        Pairs; those within a millionth of the caustic; those on it to round-off, which decides how many rays they have.
    rays : int
        Rays there are.
    missed, missed_and_said : int
        Rays that were not found: of pairs nothing of which is said to be unresolved, and of others.
    unresolved : int
        Pairs of which something is said to be unresolved, whatever they found.
    more, false, unconfirmed : int
        Rays that a fan does not show; those of them that its own rule takes elsewhere; that it could not follow so far.
    beyond, worst : int, float
        Optical paths that are off by more than claimed; the largest error, relative to the path, where it is known.
    seconds : float
        Of processor time, for the answers.
    """

    family: str
    number: int = 0
    code: str = ""
    pairs: int = 0
    near: int = 0
    on_caustic: int = 0
    rays: int = 0
    missed: int = 0
    missed_and_said: int = 0
    unresolved: int = 0
    more: int = 0
    false: int = 0
    unconfirmed: int = 0
    beyond: int = 0
    worst: float = 0.0
    seconds: float = 0.0

    @property
    def wrong(self) -> bool:
        """Whether anything came out that must not."""
        return bool(self.missed or self.false or self.beyond)

    def added(self, other: Tally) -> None:
        """Count the ``other`` with this one."""
        for field in fields(self)[3:]:
            own, more = getattr(self, field.name), getattr(other, field.name)
            setattr(self, field.name, max(own, more) if field.name == "worst" else own + more)

    def __str__(self) -> str:
        worst = f", worst relative error {self.worst:.1e}" if self.worst else ""
        return (
            f"{self.family}: {self.pairs} pairs, {self.near} within 1e-6 of the caustic ({self.on_caustic} on it to "
            f"round-off), {self.rays} rays: {self.missed} missed in silence, {self.missed_and_said} missed and said "
            f"so, {self.false} false, {self.beyond} worse than claimed{worst}; {self.unresolved} pairs unresolved, "
            f"{self.more} rays more than the fan shows, {self.unconfirmed} not confirmed; {self.seconds:.1f} s"
        )


Block = Callable[[np.random.Generator, Tally], Iterable[str]]
"""Draws a block, adds what came of it to a tally, and gives a line for whatever is wrong."""


@dataclass(frozen=True)
class Family:
    """A family of the campaign: how a block of it is drawn and asked, and how ``many`` blocks it has."""

    block: Block
    many: int


def code() -> str:
    """A digest of what finds rays, and of what is drawn and how it is judged: rows of another are of other code.

    That is what a campaign has imported from beside this module.
    """
    package = Path(vc.__file__).parent
    files = [file for part in PARTS for file in (package / part).rglob("*.py")]
    files += [Path(str(module.__file__)) for name, module in sys.modules.items() if name.startswith("campaigns.")]
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:CODE_DIGITS]


def counted_block(family: str, block: Block, number: int, of_code: str) -> Tally:
    """What came of one block; what is wrong is printed."""
    tally = Tally(family, number, of_code)
    rng = np.random.default_rng([zlib.crc32(family.encode()), number])
    for line in block(rng, tally):
        print(f"  {family} {number} {line}", flush=True)
    return tally


def stored(path: Path) -> dict[tuple[str, int], Tally]:
    """The blocks in a file; none when there is no file."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        rows = [_read(row) for row in csv.DictReader(file)]
    return {(row.family, row.number): row for row in rows}


def _read(row: dict[str, str]) -> Tally:
    kinds: dict[str, Callable[[str], Any]] = {"str": str, "int": int, "float": float}
    return Tally(**{field.name: kinds[str(field.type)](row[field.name]) for field in fields(Tally)})


def store(path: Path, rows: Iterable[Tally]) -> None:
    """Write the blocks over whatever the file held, all or nothing: an interruption leaves the file as it was."""
    whole = path.with_suffix(".new")
    with whole.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [field.name for field in fields(Tally)], lineterminator="\n")
        table.writeheader()
        table.writerows({**vars(row), "worst": f"{row.worst:.2g}", "seconds": f"{row.seconds:.3f}"} for row in rows)
    whole.replace(path)


def wanted(families: dict[str, Family], names: Sequence[str], most: int | None) -> list[tuple[str, int]]:
    """Blocks of the families ``names``, the first of each before the second of any: what is begun is a fair sample."""
    many = {name: families[name].many if most is None else min(most, families[name].many) for name in names}
    return [(name, k) for k in range(max(many.values(), default=0)) for name in names if k < many[name]]


def summed(rows: Iterable[Tally]) -> list[Tally]:
    """What came of each family, and of all."""
    families: dict[str, Tally] = {}
    for row in rows:
        for name in (row.family, "all"):
            families.setdefault(name, Tally(name)).added(row)
    together = families.pop("all", Tally("all"))
    return [*families.values(), together]


def table(tallies: Iterable[Tally]) -> str:
    """The same as a table of Markdown."""
    lines = [
        "| family | pairs | rays | missed | missed, said so | false | path off | unresolved | s a pair |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for one in tallies:
        each = f"{one.seconds / max(1, one.pairs):.2g}"
        counts = (one.pairs, one.rays, one.missed, one.missed_and_said, one.false, one.beyond, one.unresolved, each)
        lines.append(f"| {' | '.join([one.family, *map(str, counts)])} |")
    return "\n".join(lines)
