"""Curves of solutions in their own coordinates, on their surface or in space; branches and sweeps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import casadi as ca
import contourpy
import numpy as np

from varcalc.axes import coordinates
from varcalc.charts.lines import DRAWN_POINTS
from varcalc.problem.conditions import Holonomic
from varcalc.problem.functional import SPACE, Functional
from varcalc.search import Branch, Extremals
from varcalc.solution import Solution
from varcalc.solve.sweep import VALUE, Sweep
from varcalc.study.drawing import Drawing, Line, Net, Panel, Points, Shades

NET_LINES = 25
"""Lines of a net in each direction of a surface."""
SECTIONS, SECTION_POINTS = 13, 81
"""Planes in each direction that cut a surface given by an equation, and places along each side of one."""
SURFACE_MARGIN = 0.4
"""Of the extent of a curve: by how much its surface is drawn beyond it."""
CLOSED_TURN = 1e-9
"""Of the size of a surface: points that are so near are one, where an angle has made a turn."""
TURN = 2 * np.pi
STRAIGHT = 1e-3
"""Of the extent of a curve: one that is bent by less looks in no direction."""
MOST_LABELS = 8
"""Lines that are named one by one."""


def solution_drawing(solution: Solution) -> Drawing:
    """The curve of a solution. Raises ValueError where it has none."""
    solution.interval  # noqa: B018  refuses what has no curve, before anything is drawn
    title = f"{solution.problem.name}: J = {solution.value:.12g}"
    return Drawing(title, lambda: _panels(solution.problem, [(solution, "")]))


def extremals_drawing(extremals: Extremals) -> Drawing:
    """Every extremal, named by its value. Raises ValueError where there is none."""
    if not extremals:
        raise ValueError(f"there is no extremal to draw: {extremals.searched}")
    problem = extremals[0].problem
    told = [(s, f"J = {s.value:.8g}" if k < MOST_LABELS else "") for k, s in enumerate(extremals)]
    return Drawing(f"{problem.name}: {len(extremals)} extremals", lambda: _panels(problem, told))


def branch_drawing(branch: Branch) -> Drawing:
    """The functional along a branch, with its folds."""
    parts = [Line(branch.parameter, branch.value)]
    if len(branch.folds):
        parts.append(Points(branch.folds, branch.fold_values, label="folds", colour=1))
    return Drawing(branch.solutions[0].problem.name, lambda: [[Panel(parts, branch.name, "functional")]])


def sweep_drawing(sweep: Sweep) -> Drawing:
    """The functional over one name; as a map over two; over the last of more, a line for each of the others' values."""
    names, values = list(sweep.grid), sweep.values
    if not np.isfinite(values).any():
        raise ValueError("there is no answer to draw: no point of the sweep has one; see failures")
    across = np.array(sweep.grid[names[0 if sweep.paired else -1]], dtype=float)
    functional = sweep.labelled(VALUE, "functional")
    if len(names) == 2 and not sweep.paired and min(values.shape) > 1:
        shades = Shades(across, np.array(sweep.grid[names[0]]), values, functional)
        return Drawing("", lambda: [[Panel([shades], sweep.labelled(names[1]), sweep.labelled(names[0]))]])
    rows = values.reshape(-1, len(across))
    others = [] if sweep.paired else list(product(*(sweep.grid[name] for name in names[:-1])))
    labels = [", ".join(f"{n} = {v:g}" for n, v in zip(names[:-1], at, strict=True)) for at in others]
    named = len(rows) > 1 and len(rows) <= MOST_LABELS
    order = np.argsort(across, kind="stable")
    parts = [
        kind(across[order], row[order], label=labels[k] if named and kind is Line else "", colour=k)
        for k, row in enumerate(rows)
        for kind in (Line, Points)
    ]
    below = sweep.labelled(names[0 if sweep.paired else -1])
    return Drawing("", lambda: [[Panel(parts, below, functional)]])


def _panels(problem: Functional, told: Sequence[tuple[Solution, str]]) -> list[list[Panel]]:
    """The curves of solutions of one problem: on its surface, in space, in the plane, or each component by itself."""
    abscissae = [_abscissae(solution) for solution, _ in told]
    curves = [_ordinates(solution, s) for (solution, _), s in zip(told, abscissae, strict=True)]
    graph = problem.axes is not problem.ordinates
    if problem.surface_expressions:
        places = [np.vstack([s, q]) if graph else q for s, q in zip(abscissae, curves, strict=True)]
        points = [problem.on_surface(q) for q in places]
        return [[_in_space([_net(problem, places)], points, told, coordinates(SPACE), bare=True)]]
    labels = [axis.label for axis in problem.axes]
    if not graph and problem.n == SPACE:
        return [[_in_space(_sections(problem, curves), curves, told, labels)]]
    if not graph and problem.n < SPACE:
        return [[Panel([*_lines(curves, told)], *labels, equal=True)]]
    x, *ys = [axis.label for axis in (problem.abscissa, *problem.ordinates)]
    return [
        [Panel([*_lines([np.vstack([s, q[k]]) for s, q in zip(abscissae, curves, strict=True)], told)], x, y)]
        for k, y in enumerate(ys)
    ]


def _abscissae(solution: Solution) -> np.ndarray:
    first, last = solution.interval
    return first + (last - first) * (1 - np.cos(np.linspace(0, np.pi, DRAWN_POINTS))) / 2


def _ordinates(solution: Solution, s: np.ndarray) -> np.ndarray:
    """The functions (n, m) at abscissae (m,)."""
    return np.asarray(solution.y(s), dtype=float).reshape(solution.problem.n, -1)


def _lines(curves: Sequence[np.ndarray], told: Sequence[tuple[Solution, str]]) -> Iterable[Line]:
    for number, (curve, (_, label)) in enumerate(zip(curves, told, strict=True)):
        yield Line(*curve, label=label, colour=number)
        yield Points(*curve[:, [0, -1]], colour=number)


def _in_space(
    nets: Sequence[Net], curves: Sequence[np.ndarray], told: Sequence[tuple[Solution, str]], labels: Sequence[str],
    *, bare: bool = False,
) -> Panel:  # fmt: skip
    """Curves on nets, seen from the side towards which the first of them is bent."""
    x, y, z = labels
    first = curves[0]
    bulge = first[:, first.shape[1] // 2] - first[:, [0, -1]].mean(axis=1)
    bent = np.linalg.norm(bulge) > STRAIGHT * np.ptp(first, axis=1).max()
    return Panel([*nets, *_lines(curves, told)], x, y, z, bare=bare, towards=bulge.tolist() if bent else None)


def _net(problem: Functional, places: Sequence[np.ndarray]) -> Net:
    """The surface about curves at ``places`` (2, m); the whole turn of a coordinate that is an angle."""
    every = np.concatenate(places, axis=1)
    low, high = every.min(axis=1), every.max(axis=1)
    middle, size = every[:, :1], float(np.abs(problem.on_surface(every)).max())
    ranges = []
    for k, (a, b) in enumerate(zip(low, high, strict=True)):
        turned = middle + TURN * (np.arange(len(middle)) == k)[:, None]
        away = np.abs(problem.on_surface(turned) - problem.on_surface(middle)).max()
        room = SURFACE_MARGIN * (b - a or 1.0)
        ranges.append(((a + b - TURN) / 2, (a + b + TURN) / 2) if away <= CLOSED_TURN * size else (a - room, b + room))
    first, second = (np.linspace(a, b, 4 * NET_LINES) for a, b in ranges)
    few = [np.linspace(a, b, NET_LINES) for a, b in ranges]
    lines = [np.vstack([np.full_like(second, value), second]) for value in few[0]]
    lines += [np.vstack([first, np.full_like(first, value)]) for value in few[1]]
    return Net([problem.on_surface(line) for line in lines])


def _sections(problem: Functional, curves: Sequence[np.ndarray]) -> list[Net]:
    """The surfaces on which a curve in space is held, by sections with planes of one coordinate."""
    held = [t.expression for t in problem.traced if isinstance(t.constraint, Holonomic)]
    every = np.concatenate(curves, axis=1)
    middle = (every.min(axis=1) + every.max(axis=1)) / 2
    half = (0.5 + SURFACE_MARGIN) * float(np.ptp(every, axis=1).max() or 1.0)
    return [Net(list(_cuts(problem, phi, middle, half))) for phi in held]


def _cuts(problem: Functional, phi: ca.SX, middle: np.ndarray, half: float) -> Iterable[np.ndarray]:
    s = problem.symbols
    function = ca.Function("phi", [s.y, s.parameters, s.unknowns], [phi])
    sides = [np.linspace(m - half, m + half, SECTION_POINTS) for m in middle]
    for k in range(SPACE):
        across, up = (j for j in range(SPACE) if j != k)
        for value in np.linspace(middle[k] - half, middle[k] + half, SECTIONS):
            grid = np.empty((SPACE, SECTION_POINTS, SECTION_POINTS))
            grid[across], grid[up] = np.meshgrid(sides[across], sides[up])
            grid[k] = value
            level = function(grid.reshape(SPACE, -1), problem.parameter_values, problem.unknown_guesses)
            levels = np.array(level).reshape(SECTION_POINTS, SECTION_POINTS)
            for line in contourpy.contour_generator(sides[across], sides[up], levels).lines(0.0):
                places = np.full((SPACE, len(line)), value)
                places[[across, up]] = np.asarray(line).T
                yield places
