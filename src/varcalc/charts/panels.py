"""What all panels share: no frame, a light grid, ink that is not black, names written beside the lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from varcalc.charts.colours import GRID_COLOUR, INK

FLOOR = float(np.finfo(float).eps) / 8
"""Relative difference drawn for none at all: a logarithmic axis has no zero."""
LABEL_GAP = 0.075
"""Least distance of two labels beside the lower panel, as a fraction of its height."""


def plain(panel: Axes) -> None:
    """Take frame and ticks away and lay a light grid beneath."""
    panel.grid(visible=True, color=GRID_COLOUR, linewidth=0.8)
    panel.set_axisbelow(True)
    panel.tick_params(which="both", colors=INK, length=0)
    for side in panel.spines.values():
        side.set_visible(False)


def label_beside(panel: Axes, levels: Sequence[float], labels: Sequence[tuple[str, str]]) -> None:
    """Texts with their colours, each at its own level right of the panel, moved apart where they would overlap."""
    low, high = np.log10(panel.get_ylim())
    order = np.argsort(levels, kind="stable")
    heights = apart((np.log10(np.asarray(levels)[order]) - low) / (high - low))
    for height, i in zip(heights, order, strict=True):
        text, colour = labels[i]
        panel.annotate(
            text, (1.01, height), xycoords="axes fraction", color=colour, fontsize=9, va="center",
            annotation_clip=False,
        )  # fmt: skip


def apart(heights: np.ndarray) -> np.ndarray:
    """Ascending heights moved as little as need be: those that crowd spread out about their mean, within 0 and 1."""
    groups = [[float(h)] for h in heights]
    middles = [min(max(float(h), 0.0), 1.0) for h in heights]
    i = 1
    while i < len(groups):
        reach = LABEL_GAP * (len(groups[i - 1]) + len(groups[i])) / 2
        if middles[i] - middles[i - 1] >= reach - 1e-12:
            i += 1
            continue
        groups[i - 1 : i + 1] = [groups[i - 1] + groups[i]]
        middle, half = float(np.mean(groups[i - 1])), LABEL_GAP * (len(groups[i - 1]) - 1) / 2
        middles[i - 1 : i + 1] = [max(min(middle, 1.0 - half), half)]
        i = max(1, i - 1)
    spread = [m + LABEL_GAP * (np.arange(len(g)) - (len(g) - 1) / 2) for g, m in zip(groups, middles, strict=True)]
    return np.concatenate(spread)
