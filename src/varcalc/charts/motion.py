"""A motion: its coordinates against time, and its phase portrait, its orbit, or what many motions beside it do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from varcalc.charts.colours import OTHER_COLOURS
from varcalc.mechanics.experiment import Flights, Section

if TYPE_CHECKING:
    from varcalc.mechanics.experiment import Moved

LEVELS = 14
MOST_NAMES = 6
"""In a line of the legend."""


def motion_picture(moved: Moved) -> Figure:
    """Coordinates against time on the left; on the right what the experiment asks for.

    Without that it is the phase portrait of one coordinate, and the orbit of more.
    """
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
    times, q, v = moved.drawn
    time, names, _ = moved.axes
    for number, (name, values) in enumerate(zip(names, q, strict=True)):
        left.plot(times, values, color=OTHER_COLOURS[number % len(OTHER_COLOURS)], label=name)
    for event in moved.motion.events:
        left.axvline(event.t, color="0.8", linewidth=0.8, zorder=0)
    left.set_xlabel(time)
    left.set_ylabel(names[0] if len(names) == 1 else "coordinates")
    if len(q) > 1:
        left.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=MOST_NAMES)
    if isinstance(asked := moved.experiment.beside, Section):
        _section(right, moved, asked)
    elif isinstance(asked, Flights):
        _flights(right, moved, asked)
    elif len(q) == 1:
        _phase_portrait(right, moved, q[0], v[0])
    else:
        right.plot(q[0], q[1], color=OTHER_COLOURS[0])
        right.plot(q[0, :1], q[1, :1], "o", color=OTHER_COLOURS[0])
        right.set_xlabel(names[0])
        right.set_ylabel(names[1])
    figure.suptitle(moved.title)
    return figure


def _section(axes: Axes, moved: Moved, asked: Section) -> None:
    many, (_, names, rates) = moved.many, moved.axes
    assert many is not None
    for number, (q, v) in enumerate(zip(many.q[:, asked.shown], many.v[:, asked.shown], strict=True)):
        axes.plot(q, v, ".", markersize=1.5, color=OTHER_COLOURS[number % len(OTHER_COLOURS)])
    axes.set_xlabel(names[asked.shown])
    axes.set_ylabel(rates[asked.shown])
    axes.set_title(f"{len(many.q)} motions at {asked.event.name}", fontsize="medium")


def _flights(axes: Axes, moved: Moved, asked: Flights) -> None:
    many = moved.many
    assert many is not None
    times = many.times[:, 0].reshape(len(asked.second), len(asked.first))
    image = axes.pcolormesh(asked.first, asked.second, times, norm=LogNorm(), shading="nearest", cmap="viridis")
    _, names, _ = moved.axes
    unit = moved.experiment.system.time_unit
    axes.figure.colorbar(image, ax=axes, label=f"time to {asked.event.name}" + (f" ({unit})" if unit else ""))
    axes.set_facecolor("0.9")  # where it does not come to that
    axes.set_xlabel(f"{names[0]} at rest")
    axes.set_ylabel(f"{names[1]} at rest")


def _phase_portrait(axes: Axes, moved: Moved, q: np.ndarray, v: np.ndarray) -> None:
    portrait = moved.portrait
    if portrait is not None:
        levels = np.linspace(portrait.energy.min(), portrait.energy.max(), LEVELS)
        axes.contour(
            portrait.q, portrait.v, portrait.energy, levels=levels, colors="0.8", linewidths=0.7, linestyles="solid"
        )
        if portrait.separatrices:
            axes.contour(
                portrait.q, portrait.v, portrait.energy, levels=sorted(portrait.separatrices), colors=OTHER_COLOURS[1],
                linewidths=1.2, linestyles="dashed",
            )  # fmt: skip
    axes.plot(q, v, color=OTHER_COLOURS[0], linewidth=2)
    _, names, rates = moved.axes
    axes.set_xlabel(names[0])
    axes.set_ylabel(rates[0])
