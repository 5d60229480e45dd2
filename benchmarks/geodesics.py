"""Distances on the Earth's spheroid, many pairs at a time, beside geographiclib: pairs a second, and errors.

Run: python benchmarks/geodesics.py [--count N] [--antipodal N]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np

import varcalc as vc
from varcalc.problems import spheroid
from varcalc.problems.spheroid import EARTH, Distances, distances

RECORDS = Path(__file__).parent / "records" / "geodesics.json"
SEED = 1828
"""The year of Gauss's general investigations of curved surfaces."""
PROMISED = 15e-9
"""Metres by which geographiclib may be off itself."""
WANTED = 1e-12
"""Relative error of a length that is right."""
REPEATS = 3

Pairs = tuple[np.ndarray, np.ndarray]
"""Starts and ends, each (K, 2) of latitudes and longitudes in degrees."""


def scattered(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points spread evenly over a sphere."""
    return np.column_stack([np.degrees(np.arcsin(rng.uniform(-1, 1, count))), rng.uniform(-180, 180, count)])


def meridians(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """No difference of longitude."""
    return start, np.column_stack([end[:, 0], start[:, 1]])


def over_a_pole(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """Half a turn of longitude, both in the north."""
    return np.abs(start) * [1, 0] + start * [0, 1], np.column_stack([np.abs(end[:, 0]), start[:, 1] + 180])


def along_the_equator(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """On the equator, up to 179 degrees apart."""
    return start * [0, 1], start * [0, 1] + np.outer(rng.uniform(-179, 179, len(start)), [0, 1])


def short(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """From a metre to a hundred kilometres."""
    near = start + 10 ** rng.uniform(-5, 0, (len(start), 1)) * rng.normal(size=start.shape)
    return start, np.clip(near, [-90, -400], [90, 400])


def date_line(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """Five degrees to either side of it at most."""
    sides = 180 - 5 * rng.uniform(size=(2, len(start)))
    return np.column_stack([start[:, 0], sides[0]]), np.column_stack([end[:, 0], -sides[1]])


def coincident(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """Twice the same point."""
    return start, start.copy()


def nearly_antipodal(start: np.ndarray, end: np.ndarray, rng: np.random.Generator) -> Pairs:
    """Within some fifty kilometres of the antipode."""
    off = 0.3 * rng.normal(size=start.shape)
    return start, np.clip(start * [-1, 1] + [0, 180] + off, [-90, -400], [90, 400])


FAMILIES: dict[str, Callable[[np.ndarray, np.ndarray, np.random.Generator], Pairs]] = {
    "anywhere": lambda start, end, rng: (start, end),
    "meridians": meridians,
    "over a pole": over_a_pole,
    "along the equator": along_the_equator,
    "1 m to 100 km": short,
    "over the date line": date_line,
    "coincident": coincident,
    "nearly antipodal": nearly_antipodal,
}


@dataclass(frozen=True)
class Tally:
    """What came of one family: pairs, those not certain, and answers that are wrong though certain, or though not.

    ``without`` counts pairs without an answer, ``worst`` is the largest relative error beyond what geographiclib may
    be off, ``metres`` the largest error, ``beyond`` counts errors beyond claim and that. Times are of one processor.
    """

    family: str
    pairs: int
    uncertain: int
    without: int
    wrong: int
    wrong_uncertain: int
    worst: float
    metres: float
    beyond: int
    microseconds: float
    geographiclib: float


def processor_time(work: Callable[[], object], repeats: int) -> float:
    """The least processor time of some repeats, in seconds."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return min(spent)


def known(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The distances by geographiclib."""
    from geographiclib.geodesic import Geodesic

    return np.array([Geodesic.WGS84.Inverse(*e, Geodesic.DISTANCE)["s12"] for e in np.hstack([start, end]).tolist()])


def tally(family: str, pairs: Pairs, solved: Callable[[np.ndarray, np.ndarray], Distances], repeats: int) -> Tally:
    """Solve the pairs, and compare."""
    lengths, radians = known(*pairs), [np.radians(p) for p in pairs]
    found = solved(*radians)
    off = np.abs(found.lengths - lengths)
    missing = np.isnan(off)
    wrong = ~missing & (off > WANTED * lengths + PROMISED)
    share = np.maximum(off - PROMISED, 0.0)[~missing] / np.maximum(lengths, 1e-300)[~missing]
    count = len(lengths)
    return Tally(
        family, count, int((~found.certain).sum()), int(missing.sum()), int((wrong & found.certain).sum()),
        int((wrong & ~found.certain).sum()), float(share.max(initial=0.0)), float(off[~missing].max(initial=0.0)),
        int((off > found.errors + PROMISED).sum()),
        1e6 * processor_time(lambda: solved(*radians), repeats) / count,
        1e6 * processor_time(lambda: known(*pairs), repeats) / count,
    )  # fmt: skip


def on_the_earth(start: np.ndarray, end: np.ndarray) -> Distances:
    """By the departure from great circles."""
    return distances(start, end, EARTH)


def in_latitude_and_longitude(start: np.ndarray, end: np.ndarray) -> Distances:
    """By the energy of curves in latitude and longitude, their ends parameters."""
    names = ("lat1", "lon1", "lat2", "lon2")
    first, last = (vc.At([vc.Parameter(n) for n in pair]) for pair in (names[:2], names[2:]))
    curve = vc.Curve(
        spheroid.speed, first, last, parameters=EARTH | dict(zip(names, (0.7, 0.0, 0.75, 1.8), strict=True))
    )
    values = dict(zip(names, np.hstack([start, end]).T, strict=True))
    found = vc.sweep(curve, vc.Paired(values), vc.Ritz(), tol=1e-13)
    answered = np.isfinite(found.values)
    return Distances(found.values, found.claimed_errors, answered)


def temperate(rng: np.random.Generator, count: int) -> Pairs:
    """Within 57 degrees of the equator, and 115 of longitude: no pole is near the way."""
    latitudes, longitudes = np.degrees(rng.uniform(-1, 1, (2, count))), np.degrees(rng.uniform(0, 2, (2, count)))
    return np.column_stack([latitudes[0], longitudes[0]]), np.column_stack([latitudes[1], longitudes[1]])


def row(t: Tally) -> str:
    """A tally as a line of text."""
    counts = f"{t.pairs:7d} {t.uncertain:9d} {t.without:5d} {t.wrong + t.wrong_uncertain:5d}"
    rates = f"{t.microseconds:9.1f} {1e6 / t.microseconds:9.0f} {1e6 / t.geographiclib:13.0f}"
    return f"{t.family:26} {counts} {t.worst:8.1e} {1e9 * t.metres:8.1f} {rates}"


HEAD = f"{'pairs':>34} uncertain  none wrong {'worst':>8} {'nm':>8} {'us':>9}  a second geographiclib"


@click.command()
@click.option("--count", default=10000, show_default=True, help="Pairs of each family.")
@click.option("--antipodal", default=300, show_default=True, help="Nearly antipodal pairs, solved one by one.")
def main(count: int, antipodal: int) -> None:
    """Measure every family, store what came of it, and exit 1 where an answer was wrong or worse than claimed."""
    tallies = []
    for name, family in FAMILIES.items():
        rng = np.random.default_rng(SEED)
        few = family is nearly_antipodal
        size = antipodal if few else count
        pairs = family(scattered(rng, size), scattered(rng, size), rng)
        tallies.append(tally(name, pairs, on_the_earth, 1 if few else REPEATS))
    pairs = temperate(np.random.default_rng(SEED), count)
    tallies.append(tally("as curves, temperate", pairs, in_latitude_and_longitude, REPEATS))
    print("\n".join([HEAD, *map(row, tallies)]))
    RECORDS.write_text(json.dumps([asdict(t) for t in tallies], indent=1) + "\n", encoding="utf-8")
    sys.exit(any(t.wrong or t.wrong_uncertain or t.beyond for t in tallies))


if __name__ == "__main__":
    main()
