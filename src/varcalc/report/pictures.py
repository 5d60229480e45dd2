"""Pictures within a page: figures at a size that suits it, and small sketches of a few lines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from varcalc.report.page import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 4.8
"""Of a picture, in inches: narrow enough that its words can be read on a telephone."""
TICKS = 6
"""Intervals of a horizontal axis of that width, at most."""
PIXELS = 116.0
"""Of an inch of a picture on a wide screen."""
SKETCH = (120.0, 72.0)
"""Width and height of a sketch, without its margin."""
SKETCH_POINTS = 240


def picture(figure: Figure, alt: str, caption: str, *, height: float | None = None) -> Picture:
    """A figure at the width of a page's pictures, and a ``height`` in inches; ``alt`` says what is seen."""
    from matplotlib.ticker import AutoLocator

    from varcalc.charts import themed_svg

    width, old = WIDTH, figure.get_size_inches()
    figure.set_size_inches(width, height or width * old[1] / old[0])
    for panel in figure.axes:
        if isinstance(panel.xaxis.get_major_locator(), AutoLocator):  # it takes its labels to be shorter than they are
            panel.locator_params(axis="x", nbins=TICKS)
    drawn = themed_svg(figure, alt + caption)
    return Picture(drawn.svg, alt, caption, PIXELS * width, drawn.colours)


def sketch(lines: Sequence[np.ndarray], *, equal: bool = False, downward: bool = False, alike: bool = False) -> str:
    """A few lines, each (2, m), as a small SVG without axes.

    ``equal`` gives both axes one scale; lines that are ``alike`` have one colour.

    Returns nothing where there is no line of numbers.
    """
    given = [line[:, np.isfinite(line).all(axis=0)] for line in lines]
    given = [line for line in given if line.shape[1] > 1]
    if not given:
        return ""
    everything = np.concatenate(given, axis=1)
    low, high = everything.min(axis=1), everything.max(axis=1)
    extent = np.where(high > low, high - low, 1.0)
    scale = np.array(SKETCH) / extent
    if equal:
        scale[:] = scale.min()
    room = (np.array(SKETCH) - scale * (high - low)) / 2
    paths = [
        f'<path class="line{0 if alike else number % 4}" d="{_path(_placed(line, low, scale, room, downward))}"/>'
        for number, line in zip(count(), given, strict=False)
    ]
    across, up = SKETCH
    return f'<svg viewBox="-6 -6 {across + 12:g} {up + 12:g}" aria-hidden="true">{"".join(paths)}</svg>'


def _placed(line: np.ndarray, low: np.ndarray, scale: np.ndarray, room: np.ndarray, downward: bool) -> np.ndarray:
    places = (line - low[:, None]) * scale[:, None] + room[:, None]
    if not downward:  # SVG counts downward
        places[1] = SKETCH[1] - places[1]
    chosen = np.unique(np.linspace(0, places.shape[1] - 1, SKETCH_POINTS).round().astype(int))
    return places[:, chosen]


def _path(places: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places.T)
