"""Pictures of speed against accuracy, and of claimed against delivered errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from varcalc.charts.colours import GRID_COLOUR, INK, colours_by_label
from varcalc.charts.panels import FLOOR, plain
from varcalc.study.compare import EXACT_FLOOR, EXACT_MARGIN
from varcalc.study.records import Record

BRIEFEST = 1e-2
"""Milliseconds drawn for a time of none, as that of building where nothing is built."""
LEAST_TOP = 1e-1
"""The upper edge of the errors is at least this; failures are drawn on it."""
PANEL_WIDTH = 10.5
PANEL_ROW = 3.4
PANEL_HEADING = 1.3


def cold_picture(records: Sequence[Record], *, title: str = "Error against the time to build and solve") -> Figure:
    """The error of the value against the time to build and solve together: a panel a problem, else as above.

    Only the fastest way to each accuracy is joined: a setting that is slower
    and no better than another is a point beside the line. Raises ValueError as
    :func:`work_precision_picture` does.
    """
    drawn = drawable(records)
    colours = colours_by_label(list(dict.fromkeys(r.method for r in drawn)))
    figure, panels = _panels(drawn, colours, title, ("milliseconds", "relative error of the value"))
    top = top_edge(drawn)
    for panel, of_problem in panels:
        for method, colour in colours.items():
            _draw_line(panel, [r for r in of_problem if r.method == method], colour, top)
        finish(panel, top)
        panel.tick_params(labelbottom=True)
    return figure


def _whole(record: Record) -> float | None:
    """Milliseconds to build and solve."""
    return None if record.build_ms is None or record.solve_ms is None else record.build_ms + record.solve_ms


def claims_picture(records: Sequence[Record], *, title: str = "Claimed against delivered error") -> Figure:
    """What each answer claims to be wrong by, against what it is wrong by: a panel a problem, a point a tolerance.

    Both relative to max(1, abs(value)). Below the diagonal a claim is too
    small; the shaded corner is where it is so by more than the factor of ten and
    the round-off that a comparison allows. Raises ValueError as
    :func:`work_precision_picture` does.
    """
    drawn = [r for r in drawable(records) if r.ok]
    if not drawn:
        raise ValueError("no method found an answer, so there is no claim to draw; see the reasons in the records")
    colours = colours_by_label(list(dict.fromkeys(r.route for r in drawn)))
    figure, panels = _panels(drawn, colours, title, ("delivered", "claimed"))
    top = top_edge(drawn)
    for panel, of_problem in panels:
        draw_claims(panel, of_problem, colours, top)
        panel.set_aspect("equal")
    return figure


def finish(panel: Axes, top: float) -> None:
    """The axis of errors, and the line where double precision ends."""
    panel.axhline(np.finfo(float).eps, color=INK, linewidth=0.8, linestyle=(0, (2, 3)), zorder=1.5)
    panel.set_yscale("log")
    panel.set_ylim(FLOOR / 2, top)


def drawable(records: Sequence[Record]) -> list[Record]:
    """The records that have a place in a picture: methods that apply, errors that are known."""
    drawn = [r for r in records if r.status != "not applicable"]
    if not drawn:
        raise ValueError("there is nothing to draw: no method applied to any problem")
    unknown = list(dict.fromkeys(r.problem for r in drawn if r.ok and r.value_error is None))
    if unknown:
        raise ValueError(
            f"the errors of {', '.join(unknown)} are not known, as no closed form was given; measure References, "
            "or give exact= to work_precision"
        )
    return drawn


def top_edge(records: Sequence[Record]) -> float:
    """The upper edge of the errors."""
    return max(LEAST_TOP, *(10 * max(delivered_error(r), claimed_error(r)) for r in records if r.ok), 0.0)


def delivered_error(record: Record) -> float:
    """The error of the value that a record is drawn at."""
    return max(abs(record.value_error or 0.0) / record.size, FLOOR)


def claimed_error(record: Record) -> float:
    """The claim that a record is drawn at."""
    return max((record.claimed_error or 0.0) / record.size, FLOOR)


def _panels(
    records: Sequence[Record], colours: dict[str, str], title: str, axes: tuple[str, str]
) -> tuple[Figure, list[tuple[Axes, list[Record]]]]:
    """A logarithmic panel a problem, with its records; the methods named once beneath, the ``axes`` at the edges."""
    problems = list(dict.fromkeys(r.problem for r in records))
    columns = min(3, len(problems))
    rows = -(-len(problems) // columns)
    width = PANEL_WIDTH * max(columns, 2) / 3
    figure = Figure(figsize=(width, PANEL_ROW * rows + PANEL_HEADING), layout="constrained", facecolor="white")
    grid = figure.subplots(rows, columns, squeeze=False, sharex="row", sharey=True)
    for panel in grid.flat:
        plain(panel)
        panel.set_xscale("log")
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_minor_formatter(NullFormatter())
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=INK)
    handles = [Line2D([], [], color=c, marker="o", markersize=5, linewidth=1.6, label=m) for m, c in colours.items()]
    if not all(r.ok for r in records):
        handles.append(Line2D([], [], color=INK, marker="x", linestyle="none", markersize=6, label="no answer"))
    figure.legend(
        handles=handles, loc="outside lower left", ncols=min(len(handles), 2 * columns), frameon=False, fontsize=9,
        labelcolor=INK,
    )  # fmt: skip
    for panel in grid.flat[len(problems) :]:
        panel.set_visible(False)
    for panel in grid[-1]:
        panel.set_xlabel(axes[0], color=INK)
    for panel in grid[:, 0]:
        panel.set_ylabel(axes[1], color=INK)
    panels = list(zip(grid.flat, problems, strict=False))
    for panel, problem in panels:
        panel.set_title(problem, fontsize=10, color=INK, loc="left")
    return figure, [(panel, [r for r in records if r.problem == problem]) for panel, problem in panels]


def _draw_line(panel: Axes, records: Sequence[Record], colour: str, top: float) -> None:
    """The points of one method, the fastest to each accuracy joined."""
    ordered = sorted((r for r in records if _whole(r) is not None), key=lambda r: -r.setting)
    at = np.array([max(_whole(r) or 0.0, BRIEFEST) for r in ordered])
    errors = np.array([delivered_error(r) if r.ok else np.nan for r in ordered])
    joined = front(at, errors)
    panel.plot(at[joined], errors[joined], color=colour, linewidth=1.2, alpha=0.7, zorder=2)
    panel.plot(at, errors, "o", color=colour, markersize=4.5, markeredgecolor="white", markeredgewidth=0.5, zorder=3)
    failures(panel, at[np.isnan(errors)], top, colour)


def failures(panel: Axes, times: np.ndarray, top: float, colour: str) -> None:
    """Crosses on the top edge at the times that failures took."""
    crosses = panel.plot(times, np.full(len(times), top), "x", color=colour, markersize=7, clip_on=False, zorder=6)
    crosses[0].set_in_layout(False)


def front(at: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """The points that no other beats in both time and error, the slowest last."""
    known = [i for i in np.argsort(at, kind="stable") if np.isfinite(errors[i])]
    best = np.minimum.accumulate(errors[known]) if known else np.empty(0)
    return np.array([i for n, i in enumerate(known) if n == 0 or errors[i] < best[n - 1]], dtype=int)


def draw_claims(panel: Axes, records: Sequence[Record], colours: Mapping[str, str], top: float) -> None:
    """The claimed over the delivered errors of each route's answers; shaded where a claim is too small to be allowed.

    That is by more than the factor of ten and the round-off that a comparison grants.
    """
    low = FLOOR / 4
    shaded = np.geomspace(EXACT_FLOOR, top, 50)
    panel.fill_between(shaded, np.full(50, low), shaded / EXACT_MARGIN, color=GRID_COLOUR, linewidth=0, zorder=1)
    panel.plot([low, top], [low, top], color=INK, linewidth=0.8, linestyle=(0, (2, 3)), zorder=1.5)
    for route, colour in colours.items():
        known = [r for r in records if r.ok and r.route == route and r.claimed_error is not None]
        panel.plot(
            [delivered_error(r) for r in known], [claimed_error(r) for r in known], "o", color=colour, markersize=4.5,
            markeredgecolor="white", markeredgewidth=0.4, alpha=0.85, zorder=3,
        )  # fmt: skip
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(numticks=6))
        axis.set_minor_formatter(NullFormatter())
    panel.set_yscale("log")
    panel.set_xlim(low, top)
    panel.set_ylim(low, top)
