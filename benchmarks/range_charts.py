"""How long the range charts of all scenes of the catalogue take, each in a process that has drawn none yet.

Run: python benchmarks/range_charts.py
"""

from __future__ import annotations

import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

from varcalc import optics
from varcalc.study.scenes import load_study, scene_catalogue

RECORDS = Path(__file__).parent / "records" / "range_charts.json"
LIMIT = 3.0
"""Seconds of processor time that a chart may take."""


@dataclass(frozen=True)
class Timed:
    """A chart: how many rays were traced for it, how many arrivals it tells, and seconds, what is compiled included."""

    scene: str
    rays: int
    arrivals: int
    clock: float
    processor: float


def charted(name: str) -> Timed | None:
    """The time of one chart; None for a scene with surfaces or in space, or without a point source and a receiver."""
    study = load_study(name)
    if study.receiver is None or not isinstance(study.source, optics.PointSource):
        return None
    if study.scene.surfaces or len(study.receiver) != 2:
        return None
    begun, used = time.perf_counter(), time.process_time()
    chart = optics.range_chart(study.scene, study.source.point, study.receiver, within=study.within)
    clock, processor = time.perf_counter() - begun, time.process_time() - used
    return Timed(name, len(chart.angles), len(chart.arrivals), clock, processor)


def main() -> None:
    """Time all charts, store it, and exit 1 when one took too long."""
    found = []
    for name in scene_catalogue():
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as own:
            one = own.submit(charted, name).result()
        if one is not None:
            found.append(one)
            print(f"{one.scene:22} {one.rays:5} rays, {one.arrivals:3} arrivals: {one.processor:.2f} s", flush=True)
    RECORDS.write_text(json.dumps([asdict(one) for one in found], indent=1) + "\n")
    sys.exit(any(one.processor > LIMIT for one in found))


if __name__ == "__main__":
    main()
