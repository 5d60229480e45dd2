"""A figure that is given as plain data: panels of lines, points and levels, in the plane and in space."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from varcalc.charts.colours import COLOURS, INK
from varcalc.charts.panels import plain
from varcalc.study.drawing import Drawing, Levels, Line, Net, Panel, Points, Shades, Text

PALETTE: tuple[str, ...] = tuple(hues[0] for hues in COLOURS.values())
WIDTH, HEIGHT = 4.4, 3.8
"""Of a panel, in inches."""
MOST_TICKS = 3
"""Of an axis in space, where there is little room."""
MERIDIANS = 13
"""Of the sphere that an orbit lies on."""
FAINT: dict[str, Any] = {"color": "0.75", "linewidth": 0.5}
ELEVATIONS, FROM_THE_SIDE = (-40.0, 60.0), 15.0
"""Between which, in degrees, things in space are looked at, and by how much from the side."""


def drawing_picture(drawing: Drawing) -> Figure:
    """The figure: its panels in their rows."""
    rows = drawing.rows
    widest = max(map(len, rows))
    figure = Figure(figsize=(WIDTH * widest, HEIGHT * len(rows)), layout="constrained")
    grid = figure.add_gridspec(len(rows), widest)
    for row, panels in enumerate(rows):
        for column, panel in enumerate(panels):
            whole = slice(None) if len(panels) == 1 else column
            place = grid[row, whole]
            if panel.z:
                _in_space(figure.add_subplot(place, projection="3d"), panel)
            else:
                _in_plane(figure.add_subplot(place), panel)
    figure.suptitle(drawing.title)
    return figure


def _in_plane(axes: Any, panel: Panel) -> None:
    plain(axes)
    _fill(axes, panel)
    if panel.within is not None:
        axes.set_xlim(*panel.within[:2])
        axes.set_ylim(*panel.within[2:])
    if panel.logarithmic:
        axes.set_yscale("log")
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim" if panel.within is None else "box")


def _in_space(axes: Any, panel: Panel) -> None:
    if panel.sphere:
        around, down = np.linspace(0, 2 * np.pi, MERIDIANS), np.linspace(0, np.pi, MERIDIANS)
        ring, fall = np.meshgrid(around, down)
        sphere = np.sin(fall) * np.cos(ring), np.sin(fall) * np.sin(ring), np.cos(fall)
        axes.plot_wireframe(*sphere, **FAINT)
    if panel.sphere or panel.bare:
        axes.set_axis_off()
    if panel.towards is not None:
        x, y, z = panel.towards
        up = float(np.degrees(np.arctan2(z, np.hypot(x, y))))
        axes.view_init(
            elev=float(np.clip(up, *ELEVATIONS)) + FROM_THE_SIDE,
            azim=float(np.degrees(np.arctan2(y, x))) + FROM_THE_SIDE,
        )
    _fill(axes, panel)
    axes.set_zlabel(panel.z)
    axes.locator_params(nbins=MOST_TICKS)
    axes.set_aspect("equal")


def _fill(axes: Any, panel: Panel) -> None:
    numbers = count()
    for part in panel.parts:
        if isinstance(part, Line | Levels):
            number = next(numbers) if part.colour is None else part.colour
            _draw_lines(axes, part, PALETTE[number % len(PALETTE)])
        else:
            _draw_behind(axes, part)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)
    if panel.title:
        axes.set_title(panel.title, fontsize="medium")
    if any(isinstance(part, Line) and part.label for part in panel.parts):
        axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.25 if panel.z else 1.0, 0.5))


def _draw_lines(axes: Any, part: Line | Levels, colour: str) -> None:
    if isinstance(part, Levels):
        axes.contour(
            part.x, part.y, part.values, levels=list(part.levels), colors=[colour], linewidths=1.0,
            linestyles="dashed" if part.dashed else "solid",
        )  # fmt: skip
    elif isinstance(part, Points):
        axes.plot(*part.places, "o", color=colour, markersize=4, label=part.label or None)
    else:
        style = "--" if part.dashed else "-"
        axes.plot(*part.places, style, color=colour, linewidth=1.2, label=part.label or None)


def _draw_behind(axes: Any, part: Text | Net | Shades) -> None:
    """What stands beside the lines, or behind them."""
    if isinstance(part, Text):
        axes.annotate(part.text, (part.x, part.y), color=INK, fontsize="small")
    elif isinstance(part, Net):
        for places in part.lines:
            axes.plot(*places, **FAINT)
    else:
        image = axes.pcolormesh(part.x, part.y, part.values, shading="nearest", cmap="viridis")
        axes.figure.colorbar(image, ax=axes, label=part.label)
