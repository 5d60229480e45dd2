"""The picture of all that was measured of a problem: convergence, claims, and what each accuracy costs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from varcalc.charts.colours import INK, colours_by_label
from varcalc.charts.panels import FLOOR, plain
from varcalc.charts.work_precision import BRIEFEST, delivered_error, draw_claims, drawable, failures, front, top_edge
from varcalc.study.compare import EXACT_FLOOR
from varcalc.study.records import MAXIMUM, Record, measured_order
from varcalc.study.routes import Knob

SPREAD_WIDTH = 11.0
UPPER, LOWER = 3.7, 3.0
"""Heights of the two rows of a problem: convergence with claims, and times."""
SPREAD_HEADING = 1.5
MARKERS = ("o", "s", "D", "v", "P", "X", "<", ">")
"""Those of the curves that options make, in the order in which they appear."""
DEGREE_MARKER = "^"
LADDER_LABEL = "ladder"
TOO_GOOD = "better than the closed form"
ERROR_LABEL = "relative error of the value"
NARROW = (5.4, 5.2)
"""Of a picture of one panel, in inches."""
BENEATH = 4.0
"""By how much wider the line of a second route of one kind is: it runs beneath that of the first."""
PALE = 0.35
STAYS = 0.75
"""Of its first error: what a line keeps to its last that does not converge."""
LABEL_OFFSET = np.array([0.035, 0.045])
"""Where an order is written: beside a point of its curve, at these shares of the extent of all points."""

Time = Callable[[Record], float | None]
TIMES: tuple[tuple[str, Time], ...] = (
    ("build", lambda r: r.build_ms),
    ("solve", lambda r: r.solve_ms),
    ("re-solve, everything built", lambda r: r.resolve_ms),
)
"""The lower panels: what each is called, and its time in a record."""


@dataclass(frozen=True)
class LineStyle:
    """The colours of routes and the markers of curves, the same throughout a figure."""

    colours: Mapping[str, str]
    markers: Mapping[str, str]

    @classmethod
    def of(cls, records: Sequence[Record]) -> LineStyle:
        """Those for all that is to be drawn."""
        names = dict.fromkeys(r.curve for r in records if r.knob == Knob.ELEMENT)
        markers = dict(zip(names, cycle(MARKERS), strict=False))
        markers |= {r.curve: DEGREE_MARKER for r in records if r.knob == Knob.DEGREE}
        return cls(colours_by_label(list(dict.fromkeys(r.route for r in records))), markers)

    def beneath(self, route: str) -> int:
        """How many routes of the same kind come before: their curves coincide, so that this one is drawn wider."""
        heads = [name.partition("(")[0] for name in self.colours]
        place = list(self.colours).index(route)
        return heads[:place].count(heads[place])


def work_precision_picture(records: Sequence[Record], *, title: str = "Speed against accuracy") -> Figure:
    """All that was measured, two rows of panels a problem; every axis but that of degrees is logarithmic.

    Above: the error of the value over the number of unknowns, a line for each
    option that was turned, with its measured order where the length of the
    elements was; and the claimed over the delivered errors. Below: the error
    over the times to build, to solve, and to solve again with everything
    built. There every setting is a dot, the fastest way of each route to each
    accuracy is joined, and a solve that found no answer is a cross at the
    upper edge. Errors are relative to max(1, abs(value)), hollow where the
    value is better than the closed form, dotted where double precision ends.
    Raises ValueError when there is nothing to draw, or errors are not known
    because there was no closed form.
    """
    drawn = drawable(records)
    problems, style = list(dict.fromkeys(r.problem for r in drawn)), LineStyle.of(drawn)
    height = (UPPER + LOWER) * len(problems) + SPREAD_HEADING
    figure = Figure(figsize=(SPREAD_WIDTH, height), layout="constrained", facecolor="white")
    grid = figure.add_gridspec(2 * len(problems), 3, height_ratios=[UPPER, LOWER] * len(problems))
    for i, problem in enumerate(problems):
        of_problem = [r for r in drawn if r.problem == problem]
        spaces = (grid[2 * i, :2], grid[2 * i, 2], *(grid[2 * i + 1, k] for k in range(len(TIMES))))
        _draw_problem(problem, of_problem, [figure.add_subplot(space) for space in spaces], style)
    figure.suptitle(title, x=0.01, ha="left", fontsize=14, color=INK)
    _legend(figure, drawn, style)
    return figure


def _draw_problem(problem: str, records: Sequence[Record], panels: Sequence[Axes], style: LineStyle) -> None:
    convergence, claims, *times = panels
    top = top_edge(records)
    for panel in panels:
        _logarithmic(panel, top)
    _finished_convergence(convergence, records, style)
    draw_claims(claims, records, style.colours, top)
    claims.set_xlabel("delivered error", color=INK)
    claims.set_ylabel("claimed error", color=INK)
    claims.text(0.97, 0.04, "claims too little", transform=claims.transAxes, ha="right", fontsize=9, color="0.45")
    limits = _time_limits(records)
    for panel, (name, time) in zip(times, TIMES, strict=True):
        for route in style.colours:
            _draw_route(panel, [r for r in records if r.route == route], time, style.colours[route], top)
        _mark_epsilon(panel)
        panel.set_xlim(*limits)
        panel.set_xlabel(f"{name}, milliseconds", color=INK)
    for panel in times[1:]:
        panel.tick_params(labelleft=False)
    convergence.set_title(problem, fontsize=12, color=INK, loc="left", fontweight="bold")
    times[0].set_ylabel(ERROR_LABEL, color=INK)


def convergence_picture(records: Sequence[Record], *, title: str = "") -> Figure:
    """How the error of one problem's value falls with the unknowns, as each route's options turn: one narrow panel.

    It is the upper left panel of :func:`work_precision_picture`. Raises ValueError as that does, and where no
    option was turned.
    """
    drawn = drawable(records)
    style = LineStyle.of([r for r in drawn if r.knob in (Knob.ELEMENT, Knob.DEGREE)])
    if not _curves(drawn):
        raise ValueError("no route has an option to turn that answered, so there is no convergence to draw")
    figure = Figure(figsize=NARROW, layout="constrained", facecolor="white")
    panel = figure.subplots()
    _logarithmic(panel, top_edge(drawn))
    _finished_convergence(panel, drawn, style)
    panel.set_title(title, fontsize=12, color=INK, loc="left")
    handles = [handle for part in _handles(style) for handle in part]
    figure.legend(handles=handles, loc="outside lower left", ncols=2, frameon=False, labelcolor=INK)
    return figure


def _logarithmic(panel: Axes, top: float) -> None:
    """Both axes logarithmic, that of errors from round-off to ``top``."""
    plain(panel)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_ylim(FLOOR / 4, top)
    panel.yaxis.set_major_locator(LogLocator(numticks=7))
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_minor_formatter(NullFormatter())


def _mark_epsilon(panel: Axes) -> None:
    """Where double precision ends."""
    panel.axhline(np.finfo(float).eps, color=INK, linewidth=0.8, linestyle=(0, (2, 3)), zorder=1.5)


def _finished_convergence(panel: Axes, records: Sequence[Record], style: LineStyle) -> None:
    """The error over the unknowns, with what its axes are."""
    _mark_epsilon(panel)
    _draw_convergence(panel, records, style)
    panel.set_xlabel("unknowns", color=INK)
    panel.set_ylabel(ERROR_LABEL, color=INK)


def _curves(records: Iterable[Record]) -> dict[tuple[str, str], list[Record]]:
    """The answers along each curve that turning an option makes, from coarse to fine."""
    found: dict[tuple[str, str], list[Record]] = {}
    for r in records:
        if r.ok and r.unknowns and r.knob in (Knob.ELEMENT, Knob.DEGREE):
            found.setdefault((r.route, r.curve), []).append(r)
    return {key: sorted(rs, key=lambda r: r.unknowns or 0) for key, rs in found.items()}


def _draw_convergence(panel: Axes, records: Sequence[Record], style: LineStyle) -> None:
    """The error over the unknowns; each curve ends at its first point where double precision does."""
    points: list[np.ndarray] = []
    named: list[tuple[np.ndarray, float, str]] = []
    for (route, curve), line in _curves(records).items():
        resolved = [r for i, r in enumerate(line) if not i or delivered_error(line[i - 1]) > EXACT_FLOOR / 100]
        at = np.array([(r.unknowns, delivered_error(r)) for r in resolved], dtype=float)
        colour, beneath = style.colours[route], style.beneath(route)
        panel.plot(
            *at.T, color=colour, linewidth=1.3 + BENEATH * beneath, alpha=PALE if beneath else 0.9,
            zorder=2 - 0.1 * beneath, solid_capstyle="round",
        )  # fmt: skip
        points.append(at)
        if beneath:
            continue
        too_good = np.array([r.too_good for r in resolved])
        _draw_points(panel, at, too_good, colour, style.markers[curve])
        order = measured_order(line)
        if order is not None:
            named.append((at[at[:, 1] > EXACT_FLOOR], order, colour))
        elif too_good.all() and len(at) > 1 and at[-1, 1] > STAYS * at[0, 1]:
            side = "above" if line[-1].sought == MAXIMUM else "below"
            panel.annotate(
                f"{side} the {line[-1].sought},\nand not converging to it", at[-1], (0, 7), color=colour,
                textcoords="offset points", ha="right", fontsize=9,
            )  # fmt: skip
    _name_orders(panel, np.vstack([_along(at) for at in points]) if points else np.empty((0, 2)), named)


def _draw_points(panel: Axes, at: np.ndarray, hollow: np.ndarray, colour: str, marker: str) -> None:
    """Markers, some of them ``hollow``."""
    for chosen, face, edge in ((~hollow, colour, "white"), (hollow, "white", colour)):
        panel.plot(
            *at[chosen].T, marker, color=colour, markersize=5.5, markerfacecolor=face, markeredgecolor=edge,
            markeredgewidth=0.5 if edge == "white" else 1.3, zorder=3,
        )  # fmt: skip


def _along(at: np.ndarray) -> np.ndarray:
    """Places along a line on logarithmic axes, its points (k, 2) among them."""
    places = np.arange(len(at))
    dense = np.linspace(0, len(at) - 1, 8 * len(at))
    return np.column_stack([np.interp(dense, places, np.log10(column)) for column in at.T])


def _name_orders(panel: Axes, taken: np.ndarray, named: Sequence[tuple[np.ndarray, float, str]]) -> None:
    """Each order beside its curve, at the point beside which there is most room, and none beside the panel."""
    extent = np.ptp(taken, axis=0) if len(taken) else np.ones(2)
    first, last = (taken[:, 0].min(), taken[:, 0].max()) if len(taken) else (-np.inf, np.inf)
    for at, order, colour in named:
        places = np.vstack([np.log10(at) + side * LABEL_OFFSET * extent for side in (1, -1)])
        room = np.linalg.norm((places[:, None] - taken) / extent, axis=-1).min(axis=1)
        room[(places[:, 0] < first) | (places[:, 0] > last)] = -1.0
        best = int(np.argmax(room))
        taken = np.vstack([taken, places[best]])
        x, y = 10 ** places[best]
        panel.text(x, y, f"$h^{{{order:.1f}}}$", color=colour, fontsize=11, ha="center", va="center", zorder=5)


def _draw_route(panel: Axes, records: Sequence[Record], time: Time, colour: str, top: float) -> None:
    """A dot for each setting, the fastest way to each accuracy, crosses for failures, stars for the ladder."""
    timed = [r for r in records if time(r) is not None]
    at = np.array([max(time(r) or 0.0, BRIEFEST) for r in timed])
    errors = np.array([delivered_error(r) if r.ok else np.nan for r in timed])
    driven = np.array([r.knob == Knob.TOLERANCE for r in timed], dtype=bool)
    if any(r.route == LADDER_LABEL for r in timed):
        panel.plot(at, errors, "*", color=colour, markersize=11, markeredgecolor="white", markeredgewidth=0.6, zorder=5)
    else:
        joined = front(at, errors)
        panel.plot(at[joined], errors[joined], color=colour, linewidth=1.6, zorder=2.5)
        panel.plot(at[~driven], errors[~driven], "o", color=colour, markersize=3, alpha=0.45, linewidth=0, zorder=2)
        panel.plot(at[driven], errors[driven], "o", color=colour, markersize=5.5, markeredgecolor="white",
                   markeredgewidth=0.6, zorder=4)  # fmt: skip
    failures(panel, at[np.isnan(errors)], top, colour)


def _time_limits(records: Sequence[Record]) -> tuple[float, float]:
    """A little more than all times of one problem, and at least a decade."""
    times = [max(t, BRIEFEST) for r in records for _, time in TIMES if (t := time(r)) is not None]
    low, high = min(times) / 1.6, max(times) * 1.6
    return low, max(high, 10 * low)


def _legend(figure: Figure, records: Sequence[Record], style: LineStyle) -> None:
    """Each route by its colour, then each kind of curve and of point by its marker."""
    routes, marks = _handles(style)
    marks += [
        Line2D([], [], color=INK, marker="o", markersize=5.5, linewidth=0, label="to a tolerance"),
        Line2D([], [], color=INK, marker="o", markersize=5, linewidth=0, markerfacecolor="white", label=TOO_GOOD),
    ]
    if not all(r.ok for r in records):
        marks.append(Line2D([], [], color=INK, marker="x", linewidth=0, markersize=6, label="no answer"))
    figure.legend(
        handles=[*routes, *marks], loc="outside lower left", ncols=5, frameon=False, fontsize=9.5, labelcolor=INK
    )


def _handles(style: LineStyle) -> tuple[list[Line2D], list[Line2D]]:
    """What stands in a legend for the routes, and for the kinds of curves."""
    routes = [_route_handle(name, colour, style.beneath(name)) for name, colour in style.colours.items()]
    marks = [
        Line2D([], [], color=INK, marker=m, markersize=5, linewidth=0, label=name) for name, m in style.markers.items()
    ]
    return routes, marks


def _route_handle(name: str, colour: str, beneath: int) -> Line2D:
    if name == LADDER_LABEL:
        return Line2D([], [], color=colour, marker="*", markersize=11, linewidth=0, label="ladder's choice")
    return Line2D([], [], color=to_rgba(colour, PALE if beneath else 1.0), linewidth=1.5 + BENEATH * beneath,
                  marker="o", markersize=5, markerfacecolor=colour, markeredgecolor="white", label=name)  # fmt: skip
