"""A motion: its coordinates against time, and its phase portrait, its orbit, or what many motions beside it do."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from varcalc.axes import Axis, numbered
from varcalc.charts.colours import OTHER_COLOURS
from varcalc.mechanics import RigidMotion
from varcalc.mechanics.closed_orbits import ClosedOrbit
from varcalc.mechanics.experiment import LOOKED_AT, Flights, Moved, Section
from varcalc.mechanics.motion import Ensemble, Motion
from varcalc.showing import counted
from varcalc.study.drawing import Drawing, Line, Panel, Points

LEVELS = 14
MOST_NAMES = 6
"""In a line of the legend, and panels of an ensemble."""
MOST_LINES = 200
"""Motions of an ensemble that are drawn."""
TIMES_DRAWN = 2001


def motion_picture(moved: Moved) -> Figure:
    """Coordinates against time on the left; on the right what the experiment asks for.

    Without that it is the phase portrait of one coordinate, and the orbit of more.
    """
    figure, right = _beside_times(moved.motion, moved.title)
    _beside(right, moved)
    return figure


def course_picture(moved: Moved) -> Figure:
    """The left panel of :func:`motion_picture` by itself: coordinates against time."""
    figure = Figure(figsize=(5.5, 4.2), layout="constrained")
    _course(figure.subplots(), moved.motion)
    return figure


def beside_picture(moved: Moved) -> Figure:
    """The right panel of :func:`motion_picture` by itself: the phase portrait, the orbit, or what was asked for."""
    figure = Figure(figsize=(5.5, 4.4), layout="constrained")
    _beside(figure.subplots(), moved)
    return figure


def _beside(panel: Axes, moved: Moved) -> None:
    """What the experiment asks for beside its motion."""
    if isinstance(asked := moved.experiment.beside, Section):
        _section(panel, moved, asked)
    elif isinstance(asked, Flights):
        _flights(panel, moved, asked)
    else:
        _energies(panel, moved)
        _orbit(panel, moved.motion)


def motion_of_picture(motion: Motion) -> Figure:
    """A motion alone: its coordinates against time, and its way in phase space, or that of two coordinates."""
    figure, right = _beside_times(motion, "")
    _orbit(right, motion)
    return figure


def closed_orbit_picture(orbit: ClosedOrbit) -> Figure:
    """A closed orbit, as its motion once round."""
    return motion_of_picture(orbit.motion)


def ensemble_drawing(ensemble: Ensemble) -> Drawing:
    """Coordinates of many motions against time, the first few of them."""
    time, *axes = _axes(ensemble.axes, ensemble.q.shape[1])
    panels = [
        [Panel([Line(ensemble.times, row, colour=0) for row in ensemble.q[:MOST_LINES, k]], time.label, axis.label)]
        for k, axis in enumerate(axes[:MOST_NAMES])
    ]
    return Drawing(counted(len(ensemble.q), "motion"), lambda: panels)


def _axes(given: tuple[Axis, ...], n: int) -> tuple[Axis, ...]:
    """The axes of a motion, whatever it came from."""
    return given or (Axis("t"), *map(Axis, numbered("q", n)))


def _beside_times(motion: Motion, title: str) -> tuple[Figure, Axes]:
    """A figure with the coordinates against time on its left, and what is free on its right."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
    _course(left, motion)
    figure.suptitle(title)
    return figure, right


def _course(panel: Axes, motion: Motion) -> None:
    """The coordinates against time, and where events are."""
    times = np.linspace(*motion.span, LOOKED_AT)
    q = motion.q(times)
    time, *axes = _axes(motion.axes, len(q))
    for number, (axis, values) in enumerate(zip(axes, q, strict=True)):
        panel.plot(times, values, color=OTHER_COLOURS[number % len(OTHER_COLOURS)], label=axis.label)
    for event in motion.events:
        panel.axvline(event.t, color="0.8", linewidth=0.8, zorder=0)
    panel.set_xlabel(time.label)
    panel.set_ylabel(axes[0].label if len(axes) == 1 else "coordinates")
    if len(q) > 1:
        panel.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=MOST_NAMES)


def _orbit(panel: Axes, motion: Motion) -> None:
    """The rate of the only coordinate over it, or the second of several over the first."""
    times = np.linspace(*motion.span, LOOKED_AT)
    q = motion.q(times)
    time, *axes = _axes(motion.axes, len(q))
    across, up = (q[0], motion.v(times)[0]) if len(q) == 1 else (q[0], q[1])
    panel.plot(across, up, color=OTHER_COLOURS[0], linewidth=2 if len(q) == 1 else None)
    if len(q) > 1:
        panel.plot(across[:1], up[:1], "o", color=OTHER_COLOURS[0])
        if axes[0].unit == axes[1].unit:
            panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(axes[0].label)
    panel.set_ylabel(axes[0].over(time).label if len(q) == 1 else axes[1].label)


def _section(axes: Axes, moved: Moved, asked: Section) -> None:
    many, (_, names, rates) = moved.many, moved.axes
    assert many is not None
    for number, (q, v) in enumerate(zip(many.q[:, asked.shown], many.v[:, asked.shown], strict=True)):
        axes.plot(q, v, ".", markersize=1.5, color=OTHER_COLOURS[number % len(OTHER_COLOURS)])
    axes.set_xlabel(names[asked.shown])
    axes.set_ylabel(rates[asked.shown])
    axes.set_title(f"{counted(len(many.q), 'motion')} at {asked.event.name}", fontsize="medium")


def _flights(axes: Axes, moved: Moved, asked: Flights) -> None:
    many = moved.many
    assert many is not None
    times = many.times[:, 0].reshape(len(asked.second), len(asked.first))
    image = axes.pcolormesh(
        asked.first, asked.second, times, norm=LogNorm(), shading="nearest", cmap="viridis", rasterized=True
    )
    _, names, _ = moved.axes
    unit = moved.experiment.system.time_unit
    axes.figure.colorbar(image, ax=axes, label=f"time to {asked.event.name}" + (f" ({unit})" if unit else ""))
    axes.set_facecolor("0.9")  # where it does not come to that
    axes.set_xlabel(f"{names[0]} at rest")
    axes.set_ylabel(f"{names[1]} at rest")


def _energies(axes: Axes, moved: Moved) -> None:
    """The levels of the energy about a motion in one coordinate, and the separatrices among them."""
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


def rigid_drawing(motion: RigidMotion) -> Drawing:
    """ω along the body's axes, and where its third axis points in space."""
    times = np.linspace(*motion.span, TIMES_DRAWN)
    turning = [
        Line(times, values, label=rf"$\omega_{number}$")
        for number, values in enumerate(motion.angular_velocity(times), start=1)
    ]
    axis = motion.rotation(times)[:, 2]
    course = Panel(turning, "t", "angular velocity")
    pointing = Panel([Line(*axis), Points(*axis[:, :1])], "x", "y", "z", title="the third axis", sphere=True)
    return Drawing("", lambda: [[course, pointing]])
