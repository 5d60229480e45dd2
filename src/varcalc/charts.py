"""Pictures. The only module that imports matplotlib, and it knows no solver.

Every function takes records that were computed elsewhere and returns a
matplotlib ``Figure`` of its own: nothing is drawn on a screen, and no setting
of matplotlib is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from varcalc.compare import Comparison, Row, label
from varcalc.conditions import Isoperimetric, Periodic
from varcalc.functional import Functional
from varcalc.lagrangian import Lagrangian
from varcalc.problem import Curve

LADDER = "NoneType"
COLOURS = {
    "Ritz": ("#0072b2", "#d55e00"),
    "Collocation": ("#009e73",),
    "Shooting": ("#cc79a7",),
    "FirstIntegral": ("#e69f00",),
    "SciPyBvp": ("#56b4e9",),
    LADDER: ("#7a5195",),
}
"""The colours of methods, the same in every picture: first as they come, then with other options.

They are the colours of Okabe and Ito, told apart by every kind of eye, and one more."""

OTHER_COLOURS = ("#882255", "#999933", "#44aa99", "#661100")
"""For methods that are not the library's, in the order in which they appear (Tol's muted scheme)."""

DARKER = 0.65
"""Factor of brightness from one variant of a colour to the next."""

EXACT_COLOUR = "0.80"
INK = "0.20"
GRID = "0.90"

EXACT_WIDTH = 8.0
ROUTE_WIDTH = 2.4
DIFFERENCE_WIDTH = 1.8
THREAD_WIDTH = 0.6
"""A thin line that runs through the stripes, and holds them together where a curve stands alone."""
STRIPE = 3.0
"""Length of the stripes in which coinciding curves alternate, in line widths."""

SAMPLES = 501
"""Points a curve is drawn with, denser at the ends, where it may be steep."""

ENVELOPE = 8
"""Samples to either side over which a line of differences takes its largest value, so that it can be read."""

ALIGNED = "place and start moved to coincide"
"""Said where closed curves are drawn upon each other: the functional does not tell where one lies or begins."""

FLOOR = float(np.finfo(float).eps) / 8
"""Relative difference drawn for two numbers that are equal: a logarithmic axis has no zero."""

LABEL_GAP = 0.075
"""Least distance of two labels beside the lower panel, as a fraction of its height."""

ROUNDING_LABEL = "double precision"

Points = np.ndarray
"""Shape (n, m): m points of n components."""


@dataclass(frozen=True)
class _Line:
    """A curve to draw: ``at`` maps parameters of shape (m,) within ``span`` to points of shape (n, m)."""

    label: str
    colour: str
    at: Callable[[np.ndarray], Points]
    span: tuple[float, float]
    closed: bool = False

    def samples(self) -> np.ndarray:
        start, end = self.span
        return start + (end - start) * (1 - np.cos(np.linspace(0, np.pi, SAMPLES))) / 2


def comparison_picture(comparison: Comparison, *, title: str = "", downward: bool = False) -> Figure:
    """All curves of ``comparison`` over each other, and their differences beneath.

    Each component of y has a panel of its own; a :class:`varcalc.Curve` in the
    plane is drawn in the plane. The lowest panel shows, on a logarithmic axis,
    the distance of every curve from the exact one, or from that of the route
    claiming the least error where no exact curve is known. ``title`` is by
    default the problem's name; ``downward`` draws the last coordinate downward.
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
        routes = [line if line is reference else _aligned(line, reference, free) for line in routes]
    in_plane = isinstance(comparison.problem, Curve) and comparison.problem.n == 2
    others = [line for line in routes if line is not reference]
    figure, panels, lowest = _panels(1 if in_plane else comparison.problem.n, in_plane, bool(others))
    note = ALIGNED if reference.closed and others else ""
    _draw_curves(panels, routes, exact, comparison.problem, in_plane, note)
    if downward:
        panels[-1].invert_yaxis()
    if lowest is not None:
        _draw_differences(lowest, others, reference, isinstance(comparison.problem, Curve))
    if lowest is not None or not in_plane:
        (lowest or panels[-1]).set_xlabel("t" if isinstance(comparison.problem, Curve) else "x", color=INK)
    panels[0].set_title(
        f"{title or comparison.problem.name}    J = {_value(comparison):.14g}",
        loc="left",
        color=INK,
        fontsize=12,
        pad=12,
    )
    return figure


def _lines(comparison: Comparison) -> tuple[list[_Line], _Line | None]:
    """The curves of the routes that answered, and the exact one if there is one."""
    n = comparison.problem.n
    colours = _colours(comparison.rows)
    routes = [_route(row, colour, n) for row, colour in zip(comparison.rows, colours, strict=True) if row.ok]
    if comparison.exact is None or comparison.exact.y is None:
        return routes, None
    span = routes[0].span if routes else comparison.problem.span
    closed = _is_closed(comparison.problem)
    return routes, _Line("closed form", EXACT_COLOUR, _shaped(comparison.exact.y, n), span, closed)


def _is_closed(problem: Functional) -> bool:
    return isinstance(problem, Curve) and isinstance(problem.start, Periodic)


def _colours(rows: Sequence[Row]) -> list[str]:
    """The colour of each row: its method's own, and a variant of it for every further set of options."""
    used: set[tuple[str, int]] = set()
    strangers = dict.fromkeys(name for row in rows if (name := type(row.method).__name__) not in COLOURS)
    hues = COLOURS | {s: (OTHER_COLOURS[i % len(OTHER_COLOURS)],) for i, s in enumerate(strangers)}
    colours = []
    for row in rows:
        name = type(row.method).__name__
        plain = row.method is None or label(row.method) == name
        variant = next(i for i in count(0 if plain else 1) if (name, i) not in used)
        used.add((name, variant))
        known = hues[name]
        darker = DARKER ** max(0, variant - len(known) + 1)
        red, green, blue = to_rgb(known[min(variant, len(known) - 1)])
        colours.append(to_hex((darker * red, darker * green, darker * blue)))
    return colours


def _route(row: Row, colour: str, n: int) -> _Line:
    solution = row.solution
    if solution is None:
        raise ValueError(f"{row.label} holds no solution, so it has no curve")
    if isinstance(solution.problem, Curve):
        return _Line(row.label, colour, _shaped(solution.q, n), (0.0, 1.0), _is_closed(solution.problem))
    return _Line(row.label, colour, _shaped(solution.y, n), solution.interval)


def free_directions(problem: Functional) -> np.ndarray:
    """Along which coordinates a closed curve may be moved at no cost, as n truth values.

    Those that occur neither in the Euler-Lagrange equations of the functional
    and its prescribed integrals, nor in any pathwise constraint, as far as
    the formulas show it: terms that would cancel are not looked for.
    """
    integrals = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    pathwise = [t.expression for t in problem.traced if not isinstance(t.constraint, Isoperimetric)]
    equations = [Lagrangian(problem.symbols, e).euler_lagrange for e in (problem.integrand, *integrals)]
    by_place = ca.jacobian(ca.vertcat(*equations, *pathwise), problem.symbols.y)
    return np.array(ca.DM(by_place.sparsity(), 1)).any(axis=0) == 0


def _aligned(line: _Line, reference: _Line, free: np.ndarray) -> _Line:
    """A closed curve with its middle moved onto that of another along ``free``, beginning where that one begins."""
    once = np.arange(SAMPLES) / SAMPLES
    move = np.where(free, reference.at(once).mean(axis=1) - line.at(once).mean(axis=1), 0.0)[:, None]
    moved = replace(line, at=lambda t: line.at(t) + move)
    (first,) = _nearest(moved, reference.at(np.zeros(1)))
    return replace(line, at=lambda t: moved.at(np.mod(t + first, 1.0)))


def _shaped(curve: Callable[[np.ndarray], object], n: int) -> Callable[[np.ndarray], Points]:
    """``curve`` with its result in shape (n, m), whether it is scalar, constant or a vector."""
    return lambda s: np.broadcast_to(np.asarray(curve(s), dtype=float), (n, s.size))


def _most_certain(comparison: Comparison, routes: Sequence[_Line]) -> _Line:
    claims = [row.solution.error.curve for row in comparison.rows if row.ok and row.solution is not None]
    return routes[int(np.argmin(claims))]


def _panels(count: int, in_plane: bool, with_differences: bool) -> tuple[Figure, list[Axes], Axes | None]:
    """A figure with ``count`` panels for the curves, and one for the differences beneath if wanted."""
    heights = [4.2 if count == 1 else 2.4] * count + ([2.6] if with_differences else [])
    figure = Figure(figsize=(8.0, sum(heights) + 0.6), layout="constrained", facecolor="white")
    axes = list(np.atleast_1d(figure.subplots(len(heights), 1, height_ratios=heights)))
    for panel in axes:
        _plain(panel)
    if not in_plane:
        for panel in axes[:-1]:
            panel.sharex(axes[-1])
            panel.tick_params(labelbottom=False)
    return figure, axes[:count], axes[-1] if with_differences else None


def _plain(panel: Axes) -> None:
    panel.grid(visible=True, color=GRID, linewidth=0.8)
    panel.set_axisbelow(True)
    panel.tick_params(which="both", colors=INK, length=0)
    for side in panel.spines.values():
        side.set_visible(False)


def _draw_curves(
    panels: Sequence[Axes], routes: Sequence[_Line], exact: _Line | None, problem: Functional, in_plane: bool, note: str
) -> None:
    """The closed form as a wide band; upon it the routes in stripes that alternate where they coincide."""
    if exact is not None:
        _draw_line(panels, exact, in_plane, EXACT_WIDTH, "solid")
    for i, line in enumerate(routes):
        _draw_line(panels, line, in_plane, ROUTE_WIDTH, _stripe(i, len(routes)))
    for panel, name in zip(panels, ["y"] if in_plane else _component_names(problem), strict=True):
        panel.set_ylabel(name, rotation=0, labelpad=12, color=INK)
    if in_plane:
        panels[0].set_xlabel("x", color=INK)
        panels[0].set_aspect("equal", adjustable="datalim")
    legend = panels[0].legend(
        frameon=False, labelcolor=INK, fontsize=9, loc="best", title=note or None, title_fontsize=9
    )
    legend.get_title().set_color(INK)
    for handle in legend.get_lines():
        handle.set_linestyle("solid")


def _draw_line(
    panels: Sequence[Axes], line: _Line, in_plane: bool, width: float, style: str | tuple[float, tuple[float, float]]
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


def _component_names(problem: Functional) -> list[str]:
    n = problem.n
    if isinstance(problem, Curve):
        return ["x", "y", "z"][:n] if n <= 3 else [f"$q_{{{i + 1}}}$" for i in range(n)]
    return ["y"] if n == 1 else [f"$y_{{{i + 1}}}$" for i in range(n)]


def _draw_differences(panel: Axes, routes: Sequence[_Line], reference: _Line, along: bool) -> None:
    scale = float(np.nanmax(np.abs(reference.at(reference.samples())))) or 1.0
    levels = []
    for i, line in enumerate(routes):
        s, distance = _distance_along(line, reference, along)
        seen = _envelope(np.maximum(distance, FLOOR * scale))
        panel.plot(s, seen, color=line.colour, linewidth=THREAD_WIDTH, zorder=1.9)
        panel.plot(s, seen, color=line.colour, linewidth=DIFFERENCE_WIDTH, linestyle=_stripe(i, len(routes)))
        levels.append(float(np.nanmedian(seen)))
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(numticks=7))
    panel.yaxis.set_minor_formatter(NullFormatter())
    levels.append(_mark_rounding(panel, scale))
    panel.set_ylabel(f"distance from\n{'the ' if reference.colour == EXACT_COLOUR else ''}{reference.label}", color=INK)
    panel.margins(x=0.01)
    _label_beside(panel, levels, [*((line.label, line.colour) for line in routes), (ROUNDING_LABEL, INK)])


def _mark_rounding(panel: Axes, scale: float) -> float:
    """A line at the spacing of double precision numbers, beneath which there is nothing to be seen; its level."""
    level = float(np.finfo(float).eps) * scale
    low, high = panel.get_ylim()
    panel.set_ylim(min(low, level / 20), max(3 * high, 100 * level))
    panel.axhline(level, color=INK, linewidth=0.8, linestyle=(0, (2, 3)))
    return level


def _label_beside(panel: Axes, levels: Sequence[float], labels: Sequence[tuple[str, str]]) -> None:
    """Texts with their colours, each at its own level right of the panel, moved apart where they would overlap."""
    low, high = np.log10(panel.get_ylim())
    order = np.argsort(levels, kind="stable")
    heights = _apart((np.log10(np.asarray(levels)[order]) - low) / (high - low))
    for height, i in zip(heights, order, strict=True):
        text, colour = labels[i]
        panel.annotate(
            text, (1.01, height), xycoords="axes fraction", color=colour, fontsize=9, va="center",
            annotation_clip=False,
        )  # fmt: skip


def _apart(heights: np.ndarray) -> np.ndarray:
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


def _envelope(values: np.ndarray) -> np.ndarray:
    """The largest of the neighbouring values, at each place."""
    padded = np.pad(values, ENVELOPE, mode="edge")
    return np.nanmax(np.lib.stride_tricks.sliding_window_view(padded, 2 * ENVELOPE + 1), axis=-1)


def _distance_along(line: _Line, reference: _Line, along: bool) -> tuple[np.ndarray, np.ndarray]:
    """Places on ``line`` and their distances from ``reference``.

    Graphs are compared at equal abscissae, over what both cover. Curves that
    are not graphs are compared as sets of points, since their parameters need
    not run alike.
    """
    s = line.samples()
    if along:
        return s, _distance_to(reference, line.at(s))
    s = s[(s >= reference.span[0]) & (s <= reference.span[1])]
    return s, np.linalg.norm(line.at(s) - reference.at(s), axis=0)


def _distance_to(reference: _Line, points: Points) -> np.ndarray:
    """The distance of each point, shape (n, m), from the curve ``reference``."""
    return np.linalg.norm(points - reference.at(_nearest(reference, points)), axis=0)


def _nearest(reference: _Line, points: Points) -> np.ndarray:
    """Where on ``reference`` the foot of each point (n, m) lies.

    From the nearest sample, Newton's iteration moves along the curve until the
    way to the point is perpendicular to the tangent.
    """
    start, end = reference.span
    samples = np.linspace(start, end, 4 * SAMPLES)
    away = np.linalg.norm(points[:, :, None] - reference.at(samples)[:, None, :], axis=0)
    s = samples[np.argmin(away, axis=1)]
    step = 1e-5 * (end - start)
    for _ in range(4):
        left, right = np.maximum(s - step, start), np.minimum(s + step, end)
        tangent = (reference.at(right) - reference.at(left)) / (right - left)
        ahead = np.sum(tangent * (points - reference.at(s)), axis=0) / np.sum(tangent**2, axis=0)
        s = start + np.mod(s + ahead - start, end - start) if reference.closed else np.clip(s + ahead, start, end)
    return s


def _value(comparison: Comparison) -> float:
    """The exact value, or that of the first route where it is not known."""
    if comparison.exact is not None:
        return comparison.exact.value
    return next(row.value for row in comparison.rows if row.ok)
