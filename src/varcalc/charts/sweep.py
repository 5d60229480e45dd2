"""Values over the parameters of a sweep: a line of one, a map of two."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from varcalc.charts.colours import INK, OTHER_COLOURS
from varcalc.charts.panels import plain

if TYPE_CHECKING:
    from varcalc.solve.sweep import Sweep

NO_ANSWER = "0.85"
"""The colour of points without an answer."""


def sweep_picture(sweep: Sweep) -> Figure:
    """The values of a sweep over one parameter, or over two; grey where there is no answer.

    Paired values are drawn over the first name. Raises ValueError for more than two parameters, and where no point
    has an answer.
    """
    names = list(sweep.grid)[:1] if sweep.paired else list(sweep.grid)
    if len(names) > 2:
        raise ValueError(f"a sweep over {len(names)} parameters, {', '.join(names)}, is no picture; sweep one or two")
    values = np.asarray(sweep.values, dtype=float)
    if not np.isfinite(values).any():
        raise ValueError("no point of the sweep has an answer to draw")
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    panel = figure.add_subplot()
    first = np.array(sweep.grid[names[0]], dtype=float)
    panel.set_xlabel(names[0], color=INK)
    if len(names) == 1:
        order = np.argsort(first, kind="stable")
        panel.plot(first[order], values[order], ".-", color=OTHER_COLOURS[0])
        for place in first[~np.isfinite(values)]:
            panel.axvline(place, color=NO_ANSWER, linewidth=3, zorder=0)
        panel.set_ylabel("value", color=INK)
        plain(panel)
        return figure
    second = np.array(sweep.grid[names[1]], dtype=float)
    across, up = np.argsort(first), np.argsort(second)
    shown = np.ma.masked_invalid(values[np.ix_(across, up)].T)
    panel.set_facecolor(NO_ANSWER)
    image = panel.pcolormesh(first[across], second[up], shown, shading="nearest", cmap="viridis")
    figure.colorbar(image, ax=panel, label="value")
    panel.set_ylabel(names[1], color=INK)
    return figure
