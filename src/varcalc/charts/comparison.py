"""The picture of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from varcalc.charts.colours import EXACT_COLOUR, INK, colours_of
from varcalc.charts.lines import (
    ALIGNED,
    DrawnCurve,
    aligned,
    distance_along,
    envelope,
    free_directions,
    is_closed,
    shaped,
)
from varcalc.charts.panels import FLOOR, label_beside, plain
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve
from varcalc.study.compare import Comparison, Row

EXACT_WIDTH = 8.0

ROUTE_WIDTH = 2.4

DIFFERENCE_WIDTH = 1.8

THREAD_WIDTH = 0.6
"""A thin line that runs through the stripes, and holds them together where a curve stands alone."""

STRIPE = 3.0
"""Length of the stripes in which coinciding curves alternate, in line widths."""


ROUNDING_LABEL = "double precision"


def comparison_picture(
    comparison: Comparison, *, title: str = "", downward: bool = False, legend_beneath: bool = False
) -> Figure:
    """All curves of ``comparison`` over each other, and their differences beneath.

    Each component of y has a panel of its own; a :class:`varcalc.Curve` in the
    plane is drawn in the plane. The lowest panel shows, on a logarithmic axis,
    the distance of every curve from the exact one, or from that of the route
    claiming the least error where no exact curve is known. ``title`` is by
    default the problem's name; ``downward`` draws the last coordinate downward,
    ``legend_beneath`` puts the legend under the panels, where a narrow picture has room.
    Raises ValueError when there is no curve to draw.
    """
    routes, exact = _lines(comparison)
    if not routes and exact is None:
        raise ValueError(
            "there is no curve to draw: no route answered, and the closed form gives no curve; see the reasons in rows"
        )
    reference = exact or _most_certain(comparison, routes)
    if reference.closed:
        free = free_directions(comparison.problem)
        routes = [line if line is reference else aligned(line, reference, free) for line in routes]
    in_plane = isinstance(comparison.problem, Curve) and comparison.problem.n == 2
    others = [line for line in routes if line is not reference]
    figure, panels, lowest = _panels(1 if in_plane else comparison.problem.n, in_plane, bool(others))
    note = ALIGNED if reference.closed and others else ""
    _draw_curves(panels, routes, exact, comparison.problem, in_plane)
    _draw_legend(figure, panels[0], note, legend_beneath)
    if downward:
        panels[-1].invert_yaxis()
    if lowest is not None:
        _draw_differences(lowest, others, reference, isinstance(comparison.problem, Curve))
    if lowest is not None or not in_plane:
        (lowest or panels[-1]).set_xlabel(comparison.problem.abscissa.label, color=INK)
    panels[0].set_title(
        f"{title or comparison.problem.name}: J = {_value(comparison):.14g}",
        loc="left",
        color=INK,
        fontsize=12,
        pad=12,
    )
    return figure


def _lines(comparison: Comparison) -> tuple[list[DrawnCurve], DrawnCurve | None]:
    """The curves of the routes that answered, and the exact one if there is one."""
    n = comparison.problem.n
    colours = colours_of(comparison.rows)
    routes = [_route(row, colour, n) for row, colour in zip(comparison.rows, colours, strict=True) if row.ok]
    if comparison.exact is None or comparison.exact.y is None:
        return routes, None
    span = routes[0].span if routes else comparison.problem.span
    closed = is_closed(comparison.problem)
    return routes, DrawnCurve("closed form", EXACT_COLOUR, shaped(comparison.exact.y, n), span, closed)


def _route(row: Row, colour: str, n: int) -> DrawnCurve:
    solution = row.solution
    if solution is None:
        raise ValueError(f"{row.label} holds no solution, so it has no curve")
    if isinstance(solution.problem, Curve):
        return DrawnCurve(row.label, colour, shaped(solution.q, n), (0.0, 1.0), is_closed(solution.problem))
    return DrawnCurve(row.label, colour, shaped(solution.y, n), solution.interval)


def _most_certain(comparison: Comparison, routes: Sequence[DrawnCurve]) -> DrawnCurve:
    claims = [row.solution.error.curve for row in comparison.rows if row.ok and row.solution is not None]
    return routes[int(np.argmin(claims))]


def _panels(count: int, in_plane: bool, with_differences: bool) -> tuple[Figure, list[Axes], Axes | None]:
    """A figure with ``count`` panels for the curves, and one for the differences beneath if wanted."""
    heights = [4.2 if count == 1 else 2.4] * count + ([2.6] if with_differences else [])
    figure = Figure(figsize=(8.0, sum(heights) + 0.6), layout="constrained", facecolor="white")
    axes = list(np.atleast_1d(figure.subplots(len(heights), 1, height_ratios=heights)))
    for panel in axes:
        plain(panel)
    if not in_plane:
        for panel in axes[:-1]:
            panel.sharex(axes[-1])
            panel.tick_params(labelbottom=False)
    return figure, axes[:count], axes[-1] if with_differences else None


def _draw_curves(
    panels: Sequence[Axes], routes: Sequence[DrawnCurve], exact: DrawnCurve | None, problem: Functional, in_plane: bool
) -> None:
    """The closed form as a wide band; upon it the routes in stripes that alternate where they coincide."""
    if exact is not None:
        _draw_line(panels, exact, in_plane, EXACT_WIDTH, "solid")
    for i, line in enumerate(routes):
        _draw_line(panels, line, in_plane, ROUTE_WIDTH, _stripe(i, len(routes)))
    ordinates = problem.ordinates
    for panel, axis in zip(panels, ordinates[1:] if in_plane else ordinates, strict=True):
        short = len(axis.name.partition("_")[0]) == 1 and not axis.unit
        panel.set_ylabel(axis.label, rotation=0 if short else 90, labelpad=12 if short else 4, color=INK)
    if in_plane:
        panels[0].set_xlabel(ordinates[0].label, color=INK)
        panels[0].set_aspect("equal", adjustable="datalim")


def _draw_legend(figure: Figure, panel: Axes, note: str, beneath: bool) -> None:
    handles, labels = panel.get_legend_handles_labels()
    if beneath:
        legend = figure.legend(handles, labels, loc="outside lower left", ncols=2, frameon=False, fontsize=9)
    else:
        legend = panel.legend(handles, labels, loc="best", frameon=False, fontsize=9)
    for text in legend.get_texts():
        text.set_color(INK)
    title = legend.get_title()
    title.set_text(note)
    title.set_fontsize(9)
    title.set_color(INK)
    for handle in legend.get_lines():
        handle.set_linestyle("solid")


def _draw_line(
    panels: Sequence[Axes],
    line: DrawnCurve,
    in_plane: bool,
    width: float,
    style: str | tuple[float, tuple[float, float]],
) -> None:
    s = line.samples()
    points = line.at(s)
    rows = [(points[0], points[1])] if in_plane else [(s, component) for component in points]
    for panel, (across, up) in zip(panels, rows, strict=True):
        panel.plot(across, up, color=line.colour, linewidth=THREAD_WIDTH, zorder=1.9)
        panel.plot(across, up, color=line.colour, linewidth=width, label=line.label, linestyle=style)
        panel.plot(across[[0, -1]], up[[0, -1]], "o", color=INK, markersize=4.5, zorder=9)


def _stripe(index: int, count: int) -> str | tuple[float, tuple[float, float]]:
    """The dashes of line ``index`` out of ``count``, filling the gaps of the others."""
    if count == 1:
        return "solid"
    return (count - index) * STRIPE, (STRIPE, (count - 1) * STRIPE)


def _draw_differences(panel: Axes, routes: Sequence[DrawnCurve], reference: DrawnCurve, along: bool) -> None:
    scale = float(np.nanmax(np.abs(reference.at(reference.samples())))) or 1.0
    levels = []
    for i, line in enumerate(routes):
        s, distance = distance_along(line, reference, along)
        seen = envelope(np.maximum(distance, FLOOR * scale))
        panel.plot(s, seen, color=line.colour, linewidth=THREAD_WIDTH, zorder=1.9)
        panel.plot(s, seen, color=line.colour, linewidth=DIFFERENCE_WIDTH, linestyle=_stripe(i, len(routes)))
        levels.append(float(np.nanmedian(seen)))
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(numticks=7))
    panel.yaxis.set_minor_formatter(NullFormatter())
    levels.append(_mark_rounding(panel, scale))
    panel.set_ylabel(f"distance from\n{'the ' if reference.colour == EXACT_COLOUR else ''}{reference.label}", color=INK)
    panel.margins(x=0.01)
    label_beside(panel, levels, [*((line.label, line.colour) for line in routes), (ROUNDING_LABEL, INK)])


def _mark_rounding(panel: Axes, scale: float) -> float:
    """A line at the spacing of double precision numbers, beneath which there is nothing to be seen; its level."""
    level = float(np.finfo(float).eps) * scale
    low, high = panel.get_ylim()
    panel.set_ylim(min(low, level / 20), max(3 * high, 100 * level))
    panel.axhline(level, color=INK, linewidth=0.8, linestyle=(0, (2, 3)))
    return level


def _value(comparison: Comparison) -> float:
    """The exact value, or that of the first route where it is not known."""
    if comparison.exact is not None:
        return comparison.exact.value
    return next(row.value for row in comparison.rows if row.ok)
