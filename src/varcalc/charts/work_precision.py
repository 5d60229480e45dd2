"""Pictures of speed against accuracy, and of claimed against delivered errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from varcalc.charts.colours import INK, colours_by_label
from varcalc.charts.panels import plain
from varcalc.study.work_precision import Record

FLOOR = float(np.finfo(float).eps) / 8
"""Relative error drawn for none at all: a logarithmic axis has no zero."""
BRIEFEST = 1e-2
"""Milliseconds drawn for a time of none, as that of building where nothing is built."""
LEAST_TOP = 1e-1
"""The upper edge of the errors is at least this; failures are drawn on it."""
WIDTH = 10.5
ROW = 3.4
HEADING = 1.3


def cold_picture(records: Sequence[Record], *, title: str = "Error against the time to build and solve") -> Figure:
    """The error of the value against the time to build and solve together: a panel a problem, else as above.

    Only the fastest way to each accuracy is joined: a setting that is slower
    and no better than another is a point beside the line. Raises ValueError as
    :func:`work_precision_picture` does.
    """
    drawn = drawable(records)
    problems, colours = list(dict.fromkeys(r.problem for r in drawn)), colours_by_label(_methods(drawn))
    columns = min(3, len(problems))
    names = [problems[i : i + columns] for i in range(0, len(problems), columns)]
    figure, rows = _figure(["" for _ in names], columns, title, colours, crosses=not all(r.ok for r in drawn))
    top = top_edge(drawn)
    for row, panels in zip(names, rows, strict=True):
        for panel, problem in zip(panels, row, strict=False):
            of_problem = [r for r in drawn if r.problem == problem]
            for method, colour in colours.items():
                _draw_line(panel, [r for r in of_problem if r.method == method], _whole, colour, top, fastest=True)
            finish(panel, top)
            panel.set_title(problem, fontsize=10, color=INK, loc="left")
            panel.tick_params(labelbottom=True)
        for panel in panels[len(row) :]:
            panel.set_visible(False)
        panels[0].set_ylabel("relative error of the value", color=INK)
    for panel in rows[-1]:
        panel.set_xlabel("milliseconds", color=INK)
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
    problems, colours = list(dict.fromkeys(r.problem for r in drawn)), colours_by_label(_methods(drawn))
    columns = min(3, len(problems))
    names = [problems[i : i + columns] for i in range(0, len(problems), columns)]
    figure, rows = _figure(["" for _ in names], columns, title, colours, crosses=False)
    low, high = FLOOR / 2, top_edge(drawn)
    for row, panels in zip(names, rows, strict=True):
        for panel, problem in zip(panels, row, strict=False):
            _draw_claims(panel, [r for r in drawn if r.problem == problem], colours, low, high)
            panel.set_title(problem, fontsize=10, color=INK, loc="left")
        for panel in panels[len(row) :]:
            panel.set_visible(False)
        panels[0].set_ylabel("claimed", color=INK)
    for panel in rows[-1]:
        panel.set_xlabel("delivered", color=INK)
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


def _methods(records: Sequence[Record]) -> list[str]:
    return list(dict.fromkeys(r.method for r in records))


def top_edge(records: Sequence[Record]) -> float:
    """The upper edge of the errors."""
    return max(LEAST_TOP, *(10 * max(delivered_error(r), claimed_error(r)) for r in records if r.ok), 0.0)


def delivered_error(record: Record) -> float:
    """The error of the value that a record is drawn at."""
    return max(abs(record.value_error or 0.0) / record.size, FLOOR)


def claimed_error(record: Record) -> float:
    """The claim that a record is drawn at."""
    return max((record.claimed_error or 0.0) / record.size, FLOOR)


def _figure(
    rows: Sequence[str], columns: int, title: str, colours: dict[str, str], *, crosses: bool
) -> tuple[Figure, list[list[Axes]]]:
    """A grid of logarithmic panels, with the methods named once above them."""
    width = WIDTH * max(columns, 2) / 3
    figure = Figure(figsize=(width, ROW * len(rows) + HEADING), layout="constrained", facecolor="white")
    grid = figure.subplots(len(rows), columns, squeeze=False, sharex="row", sharey=True)
    for panel in grid.flat:
        plain(panel)
        panel.set_xscale("log")
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_minor_formatter(NullFormatter())
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=INK)
    handles = [Line2D([], [], color=c, marker="o", markersize=5, linewidth=1.6, label=m) for m, c in colours.items()]
    if crosses:
        handles.append(Line2D([], [], color=INK, marker="x", linestyle="none", markersize=6, label="no answer"))
    figure.legend(
        handles=handles, loc="outside lower left", ncols=min(len(handles), 2 * columns), frameon=False, fontsize=9,
        labelcolor=INK,
    )  # fmt: skip
    return figure, [list(row) for row in grid]


def _draw_line(
    panel: Axes,
    records: Sequence[Record],
    time: Callable[[Record], float | None],
    colour: str,
    top: float,
    *,
    fastest: bool = False,
) -> None:
    """The points of one method in the order of its tolerances, joined as long as it answers."""
    ordered = sorted((r for r in records if time(r) is not None), key=lambda r: -r.setting)
    at = np.array([max(time(r) or 0.0, BRIEFEST) for r in ordered])
    errors = np.array([delivered_error(r) if r.ok else np.nan for r in ordered])
    joined = front(at, errors) if fastest else np.arange(len(at))
    panel.plot(at[joined], errors[joined], color=colour, linewidth=1.2, alpha=0.7, zorder=2)
    panel.plot(at, errors, "o", color=colour, markersize=4.5, markeredgecolor="white", markeredgewidth=0.5, zorder=3)
    failed = at[np.isnan(errors)]
    crosses = panel.plot(failed, np.full(len(failed), top), "x", color=colour, markersize=7, clip_on=False, zorder=4)
    crosses[0].set_in_layout(False)


def front(at: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """The points that no other beats in both time and error, the slowest last."""
    known = [i for i in np.argsort(at, kind="stable") if np.isfinite(errors[i])]
    best = np.minimum.accumulate(errors[known]) if known else np.empty(0)
    return np.array([i for n, i in enumerate(known) if n == 0 or errors[i] < best[n - 1]], dtype=int)


def _draw_claims(panel: Axes, records: Sequence[Record], colours: dict[str, str], low: float, high: float) -> None:
    edge = np.array([low, high])
    # what a comparison holds against an answer: ten times its claim is exceeded, and the round-off of a value
    shaded = np.geomspace(1e-13, high, 50)
    panel.fill_between(shaded, np.full(50, low), shaded / 10, color="0.93", linewidth=0, zorder=1)
    panel.plot(edge, edge, color=INK, linewidth=0.8, linestyle=(0, (2, 3)), zorder=1.5)
    for method, colour in colours.items():
        own = sorted((r for r in records if r.method == method), key=lambda r: -r.setting)
        delivered, claimed = [delivered_error(r) for r in own], [claimed_error(r) for r in own]
        panel.plot(delivered, claimed, color=colour, linewidth=0.8, alpha=0.4, zorder=2)
        panel.plot(
            delivered, claimed, "o", color=colour, markersize=5, markeredgecolor="white", markeredgewidth=0.5, zorder=3
        )
    panel.set_yscale("log")
    panel.set_xlim(low, high)
    panel.set_ylim(low, high)
    panel.set_aspect("equal")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(numticks=6))
        axis.set_minor_formatter(NullFormatter())
