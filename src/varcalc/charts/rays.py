"""Pictures of rays: over the index, with wavefronts, caustic and surfaces; and how far they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from varcalc.axes import Axis, coordinates
from varcalc.charts.colours import INK
from varcalc.charts.panels import plain
from varcalc.optics.propagation.bundle import Bundle
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.results.range_chart import RangeChart
from varcalc.optics.results.study import FLAT_SIDES, Background, Seen, Track, background
from varcalc.optics.results.wavefronts import Wavefront
from varcalc.showing import counted

RAY, LOST, FRONT, CAUSTIC, ARRIVAL = "#0072b2", "#999999", "#009e73", "#d55e00", "#7a5195"
SHADES = "Greys"
"""The index, the higher the darker, light enough for what is drawn upon it."""
DARKEST = 0.45
FRONT_GAP = 8.0
"""Neighbouring points of a wavefront that lie so many times the usual distance apart are not joined."""
CROSSINGS = ("#0072b2", "#56b4e9", "#009e73", "#e69f00")
SIZE = 8.0
LEGEND_COLUMNS = 3
"""So that a picture in a page, which is narrower, holds its legend."""
FEW_RAYS = 12
"""To a receiver, that leave room for broad lines."""
MOST_RAYS = 61
"""Of a bundle that are drawn."""


@dataclass(frozen=True)
class View:
    """What is to be drawn of rays: see :class:`varcalc.optics.Seen`."""

    axes: Sequence[Axis]
    behind: Background
    tracks: tuple[Track, ...] = ()
    arriving: tuple[Track, ...] = ()
    wavefronts: tuple[Wavefront, ...] = ()
    foci: np.ndarray | None = None
    source: Sequence[float] | None = None
    receiver: Sequence[float] | None = None
    title: str = ""


def rays_picture(seen: Seen) -> Figure:
    """The rays of a study over the index of their medium, with wavefronts, caustic, surfaces and arrivals.

    Rays in space are drawn as seen along the middle coordinate. Raises
    ValueError when no ray could be followed anywhere.
    """
    if not seen.tracks and not seen.arriving:
        raise ValueError("there is no ray to draw: none could be followed; see the status of the rays")
    source = seen.study.source
    return _picture(View(
        seen.study.scene.axes(source.dimension), seen.background(), seen.tracks, seen.arriving, seen.wavefronts,
        seen.caustic.points if len(seen.caustic) else None,
        None if hasattr(source, "direction") else getattr(source, "point", None), seen.study.receiver,
        seen.study.title,
    ))  # fmt: skip


def ray_picture(ray: Ray) -> Figure:
    """One ray between two points over what it goes through."""
    return found_rays_picture(Rays((ray,), "", "", axes=ray.axes))


def found_rays_picture(rays: Rays) -> Figure:
    """All rays between two points over what they go through, with their conjugate points.

    Raises ValueError where there is none.
    """
    if not rays:
        raise ValueError(f"there is no ray to draw: {rays.reason}")
    first = rays[0]
    tracks = tuple(Track.of(ray.tube) for ray in rays)
    points = np.concatenate([track.points for track in tracks])
    foci = np.concatenate([ray.conjugate_points for ray in rays])
    source, receiver = tracks[0].points[[0, -1]]
    behind = background(first.media, first.surfaces, points)
    return _picture(View(
        rays.axes or _axes(points), behind, arriving=tracks, foci=foci if len(foci) else None, source=source,
        receiver=receiver, title=f"{len(rays)} ray{'s' * (len(rays) > 1)}",
    ))  # fmt: skip


def bundle_picture(bundle: Bundle) -> Figure:
    """Rays of a bundle, evenly chosen where it has many, over what they go through.

    Raises ValueError where none could be followed.
    """
    origin = bundle.origin
    rows = np.unique(np.linspace(0, len(bundle) - 1, MOST_RAYS).astype(int)) if len(bundle) else np.arange(0)
    going = [row for row in rows.tolist() if bundle.optical_path[row] > 0]
    tubes = [] if origin is None else origin.tubes(going, bundle.optical_path)
    known = [(bundle.status[row], tube) for row, tube in zip(going, tubes, strict=False) if tube.legs]
    if origin is None or not known:
        raise ValueError("there is no ray to draw: none could be followed; see the status of the rays")
    tracks = tuple(Track(Track.of(tube).points, RayStatus(int(status))) for status, tube in known)
    points = np.concatenate([track.points for track in tracks])
    shown = f", {len(tracks)} of them drawn" if len(tracks) < len(bundle) else ""
    behind = background(origin.media, origin.surfaces, points)
    return _picture(View(bundle.axes or _axes(points), behind, tracks, title=f"{counted(len(bundle), 'ray')}{shown}"))


def _axes(points: np.ndarray) -> tuple[Axis, ...]:
    return tuple(map(Axis, coordinates(points.shape[1])))


def _picture(view: View) -> Figure:
    behind = view.behind
    extent = float(np.ptp(behind.up)) / float(np.ptp(behind.across))
    equal = FLAT_SIDES <= extent <= 1 / FLAT_SIDES
    height = SIZE * min(max(extent, 0.45), 1.2) if equal else 0.6 * SIZE
    figure = Figure(figsize=(SIZE + 1.2, height + 1.4), layout="constrained", facecolor="white")
    panel = figure.subplots()
    plain(panel)
    _draw_background(figure, panel, behind)
    _draw_tracks(panel, view.tracks)
    for front in view.wavefronts:
        _draw_front(panel, front)
    if view.foci is not None:
        panel.plot(*view.foci[:, [0, -1]].T, "o", color=CAUSTIC, markersize=3, zorder=8)
    broad = 2.2 if len(view.arriving) <= FEW_RAYS else 1.0
    for track in view.arriving:
        panel.plot(*track.points[:, [0, -1]].T, color=ARRIVAL, linewidth=broad, zorder=7)
    _mark_ends(panel, view)
    panel.set_xlim(behind.across[0], behind.across[-1])
    panel.set_ylim(behind.up[0], behind.up[-1])
    if equal:
        panel.set_aspect("equal")
    last = view.axes[-1].label
    short = len(view.axes[-1].name) == 1 and not view.axes[-1].unit
    panel.set_xlabel(view.axes[0].label, color=INK)
    panel.set_ylabel(last, rotation=0 if short else 90, labelpad=12 if short else 4, color=INK)
    panel.set_title(view.title, loc="left", color=INK, fontsize=12, pad=12)
    _legend(figure, view)
    return figure


def range_picture(chart: RangeChart, *, title: str = "") -> Figure:
    """Where rays cross the receiver's height, against the angle at which they leave, with every arrival marked."""
    figure = Figure(figsize=(SIZE, 4.8), layout="constrained", facecolor="white")
    panel = figure.subplots()
    plain(panel)
    degrees = np.degrees(chart.angles)
    for k, reach in enumerate(chart.reach.T):
        if not np.isfinite(reach).any():
            continue
        panel.plot(degrees, reach, color=CROSSINGS[k % len(CROSSINGS)], linewidth=1.8, label=f"crossing {k + 1}")
    panel.axhline(chart.receiver[0], color=INK, linewidth=0.8, linestyle=(0, (2, 3)), label="receiver")
    for number, ray in enumerate(chart.arrivals):
        angle = np.degrees(np.arctan2(ray.tangents[0][1], ray.tangents[0][0]))
        label = "arrivals" if number == 0 else None
        panel.plot(angle, chart.receiver[0], "o", color=ARRIVAL, markersize=7, zorder=6, label=label)
    panel.set_xlabel("launching angle, degrees above the horizontal", color=INK)
    across, up = chart.arrivals.axes or map(Axis, coordinates(2))
    panel.set_ylabel(f"{across.label} at {up.at(chart.receiver[1:], 6)}", color=INK)
    panel.set_title(title, loc="left", color=INK, fontsize=12, pad=12)
    figure.legend(loc="outside right upper", frameon=False, labelcolor=INK, fontsize=9)
    return figure


def _draw_background(figure: Figure, panel: Axes, behind: Background) -> None:
    if behind.index is not None and np.isfinite(behind.index).any():
        shown = np.ma.masked_invalid(behind.index)
        low, high = (float(v) for v in np.percentile(shown.compressed(), (1, 99)))
        if high - low > 1e-9 * abs(high):
            top = low + (high - low) / DARKEST
            image = panel.pcolormesh(
                behind.across, behind.up, shown, cmap=SHADES, vmin=low, vmax=top, shading="nearest", rasterized=True
            )
            bar = figure.colorbar(image, ax=panel, label="index", shrink=0.7, pad=0.02)
            bar.ax.set_ylim(low, high)
            bar.outline.set_visible(False)
            bar.ax.tick_params(colors=INK, length=0)
    for level, mirror in zip(behind.levels, behind.mirrors, strict=True):
        finite = level[np.isfinite(level)]
        if finite.size and finite.min() < 0 < finite.max():
            panel.contour(
                behind.across, behind.up, level, levels=[0.0], colors=INK, linewidths=2.4 if mirror else 1.2, zorder=4
            )


def _draw_tracks(panel: Axes, tracks: tuple[Track, ...]) -> None:
    thin = 1.1 if len(tracks) <= 60 else 0.6
    for track in tracks:
        colour = RAY if track.status == RayStatus.ARRIVED else LOST
        panel.plot(*track.points[:, [0, -1]].T, color=colour, linewidth=thin, alpha=0.8, zorder=5)


def _draw_front(panel: Axes, front: Wavefront) -> None:
    """The points joined in the order of the rays, but not across where rays are missing."""
    points = np.where(front.arrived[:, None], front.points, np.nan)[:, [0, -1]]
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    usual = np.nanmedian(apart) if np.isfinite(apart).any() else 0.0
    broken = np.insert(points, 1 + np.flatnonzero(apart > FRONT_GAP * usual), np.nan, axis=0)
    panel.plot(*broken.T, color=FRONT, linewidth=1.2, zorder=5.5)


def _mark_ends(panel: Axes, view: View) -> None:
    if view.source is not None:
        panel.plot(view.source[0], view.source[-1], "o", color=INK, markersize=6, zorder=9)
    if view.receiver is not None:
        panel.plot(
            view.receiver[0], view.receiver[-1], "s", color=ARRIVAL, markersize=7, zorder=9, markeredgecolor="white"
        )


def _legend(figure: Figure, view: View) -> None:
    """One entry for each kind of line there is."""
    ended = {track.status == RayStatus.ARRIVED for track in view.tracks}
    there = [
        (True in ended, Line2D([], [], color=RAY, label="rays")),
        (False in ended, Line2D([], [], color=LOST, label="rays that end early")),
        (bool(view.wavefronts), Line2D([], [], color=FRONT, label="wavefronts")),
        (
            view.foci is not None,
            Line2D([], [], color=CAUSTIC, marker="o", markersize=4, linestyle="", label="conjugate points"),
        ),
        (bool(view.arriving), Line2D([], [], color=ARRIVAL, linewidth=2.2, label="rays to the receiver")),
    ]
    handles = [line for present, line in there if present]
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=min(len(handles), LEGEND_COLUMNS),
        frameon=False,
        labelcolor=INK,
        fontsize=9,
    )
