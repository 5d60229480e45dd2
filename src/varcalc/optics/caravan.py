"""Bundles of any size, some of their rays at a time."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from varcalc.optics.beam import launched, spreading
from varcalc.optics.bundle import Bundle
from varcalc.optics.march import March

CHUNK = 1 << 16
"""Rays carried together: beside the results, that bounds the memory."""
LONG = 1 << 20
"""More rays than this are long work."""


@dataclass(frozen=True)
class Sources:
    """Where m rays start, along which unit vectors (both (m, d)), and how far they are to go.

    ``index`` is that at the start, ``limit`` the optical path (both (m,)); ``on_stop`` (m,) marks rays that start
    on the surface at which they are to stop.
    """

    points: np.ndarray
    directions: np.ndarray
    index: np.ndarray
    limit: np.ndarray
    on_stop: np.ndarray


def carried(march: March, sources: Sources, *, with_spreading: bool, progress: bool | None) -> Bundle:
    """The ends of all rays; with a bar for long work on a terminal, or as ``progress`` says."""
    m, d = sources.points.shape
    bundle = Bundle(
        np.empty((m, d)), np.empty((m, d)), np.empty(m), np.empty(m, np.int8),
        np.empty(m) if with_spreading else None, march.name,
    )  # fmt: skip
    parts = [slice(first, min(first + CHUNK, m)) for first in range(0, m, CHUNK)]
    shown = (m > LONG and sys.stderr.isatty()) if progress is None else progress
    for part in _watched(parts, m) if shown else parts:
        beam = launched(sources.points[part], sources.directions[part], sources.index[part], neighbours=with_spreading)
        end, status = march.run(beam, sources.limit[part], sources.on_stop[part])
        bundle.points[part], bundle.optical_path[part], bundle.status[part] = end.position, end.optical_path, status
        bundle.directions[part] = end.momentum / np.linalg.norm(end.momentum, axis=1)[:, None]
        if bundle.spreading is not None:
            bundle.spreading[part] = spreading(end)
    return bundle


def _watched(parts: Iterable[slice], total: int) -> Iterator[slice]:
    """``parts``, with a bar on standard error while they are worked through."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("rays", total=total)
        for part in parts:
            yield part
            bar.advance(task, part.stop - part.start)
