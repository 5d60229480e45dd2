"""Indirect methods beside SciPy's solve_bvp: soap film, boundary layers and Bratu's reaction, at equal error.

varcalc is given the functional; solve_bvp is given the Euler-Lagrange equation that its user derived by hand,
as NumPy functions of all nodes at once, with and without the analytic Jacobians of equation and ends. Three times of
varcalc's are measured: cold, from the functional to the answer with nothing built; warm, a new parameter value for a
problem that was solved before at others, begun from the straight line like all the others; and swept, each of 100
values in one call. solve_bvp has its one kind, and, to hold against the last, each of those values begun from the mesh
and the curve of the value before.

What counts at an error is the fastest setting that meets it: for varcalc its tolerances and some kept degrees, for
solve_bvp tolerances from 1e-3 to 1e-13, first meshes of 5, 10 and 20 nodes (for layers also one graded by hand), each
with and without Jacobians. Errors are measured in two ways, the same for all: of the value, relative to
max(1, abs(value)), and of the curve, the largest distance from the exact one. solve_bvp computes no value: it gets that
of its spline by Gauss's rule, outside the clock; a sweep keeps no curves, and has no row there. Times are processor
time, the median of repeats, each at other parameter values.

Run: python benchmarks/indirect.py [--tasks NAME ...] [--repeats 5] [--store FILE] [-o PICTURE]
     python benchmarks/indirect.py --draw FILE
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # before NumPy is loaded: one core for everybody

import casadi as ca  # noqa: E402
import numpy as np  # noqa: E402
from scipy.integrate import solve_bvp  # noqa: E402

import varcalc as vc  # noqa: E402
from varcalc.charts import cold_picture  # noqa: E402
from varcalc.problems import bratu  # noqa: E402
from varcalc.problems._curves import Catenary  # noqa: E402
from varcalc.study.work_precision import ENOUGH_SECONDS, Record, WorkPrecision, about  # noqa: E402
from varcalc.tables import table as drawn  # noqa: E402

HERE = Path(__file__).parent
OWN: dict[str, Any] = {"Collocation": vc.Collocation(), "Shooting": vc.Shooting()}
WARM, SWEPT = " warm", " swept"
VALUES = 100
"""Values of a sweep."""
PEER = "SciPy solve_bvp"
OWN_TOLERANCES = (1e-4, 1e-6, 1e-9, 1e-12, 1e-14, 1e-15)
OWN_DEGREES = (12, 16, 20, 25)
"""Degrees of one polynomial that is kept: a tolerance is for the value, and the curve may be wanted better."""
PEER_TOLERANCES = tuple(10.0**-k for k in range(3, 14))
NODES = (5, 10, 20)
MOST_NODES = 10000
"""Nodes after which solve_bvp gives up; a step there takes a second."""
TARGETS = (1e-4, 1e-6, 1e-9, 1e-12)
SHIFT = 1e-3
"""Relative change of the parameter (of the distance from the fold, next to it) from one repeat to the next."""
FOLD = 0.6627434193491816
"""Half the distance of two rings of radius one beyond which there is no catenary."""
PLACES = 400

Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Task:
    """A functional of one parameter on ``span``, its exact value and curve, and its equation as solve_bvp takes it.

    ``rates(x, s)`` are the derivatives of s = (y, y'), ``jacobian`` (2, 2, m) theirs; ``lagrangian(x, y, y')`` is
    what is integrated, in NumPy; ``places`` are the abscissae at which curves are compared.
    """

    lagrangian: Callable[[Any, Any, Any], Any]
    span: tuple[float, float]
    ends: tuple[float, float]
    parameter: tuple[str, float]
    value: float
    curve: Callable[[np.ndarray], np.ndarray]
    rates: Rates
    jacobian: Rates
    places: np.ndarray
    width: float | None = None
    """That of the boundary layers, where there are any."""


def film(half: float) -> Task:
    """The soap film between equal rings of radius one, ``half`` their half distance; abscissa in its units."""
    catenary = Catenary.over_axis((-half, 1.0), (half, 1.0))
    square = half**2

    def rates(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        return np.array([s[1], (square + s[1] ** 2) / s[0]])

    def jacobian(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        out = np.zeros((2, 2, x.size))
        out[0, 1], out[1, 0], out[1, 1] = 1.0, -(square + s[1] ** 2) / s[0] ** 2, 2 * s[1] / s[0]
        return out

    return Task(
        lambda x, y, dy: y * np.sqrt(square + dy**2), (-1.0, 1.0), (1.0, 1.0), ("half", half),
        catenary.moment_about_axis, lambda t: catenary.above_axis(half * t), rates, jacobian,
        np.linspace(-1.0, 1.0, PLACES),
    )  # fmt: skip


def layer(epsilon: float) -> Task:
    """Between two walls: the integral of (epsilon y'^2 + y^2) / 2, y = 1 at both ends, layers sqrt(epsilon) wide.

    y = (e^(-x/w) + e^(-(1-x)/w)) / (1 + e^(-1/w)) with w = sqrt(epsilon), and J = w tanh(1 / (2 w)).
    """
    width = math.sqrt(epsilon)

    def rates(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        return np.array([s[1], s[0]]) / width

    def jacobian(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        out = np.zeros((2, 2, x.size))
        out[0, 1] = out[1, 0] = 1.0 / width
        return out

    def curve(x: np.ndarray) -> np.ndarray:
        return (np.exp(-x / width) + np.exp((x - 1.0) / width)) / (1.0 + math.exp(-1.0 / width))

    near = np.linspace(0.0, min(0.5, 40.0 * width), PLACES)
    places = np.unique(np.concatenate([near, 1.0 - near, np.linspace(0.0, 1.0, PLACES)]))
    return Task(
        lambda x, y, dy: (epsilon * dy**2 + y**2) / 2, (0.0, 1.0), (1.0, 1.0), ("epsilon", epsilon),
        width * math.tanh(0.5 / width), curve, rates, jacobian, places, width,
    )  # fmt: skip


def reaction(rate: float) -> Task:
    """Bratu's reaction: the integral of y'^2/2 - rate e^y, the stable one of its two states."""
    exact = bratu.reaction(rate, "", "").exact

    def rates(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        return np.array([s[1], -rate * np.exp(s[0])])

    def jacobian(x: np.ndarray, s: np.ndarray) -> np.ndarray:
        out = np.zeros((2, 2, x.size))
        out[0, 1], out[1, 0] = 1.0, -rate * np.exp(s[0])
        return out

    return Task(
        lambda x, y, dy: dy**2 / 2 - rate * np.exp(y), (0.0, 1.0), (0.0, 0.0), ("rate", rate), exact.value,
        exact.y, rates, jacobian, np.linspace(0.0, 1.0, PLACES),
    )  # fmt: skip


def films(half: float) -> Callable[[float], Task]:
    """Films by the factor on their distance from the fold."""
    return lambda f: film(FOLD - f * (FOLD - half))


TASKS: dict[str, Callable[[float], Task]] = {
    "soap film 0.6": films(0.6),
    "soap film 0.6627": films(0.6627),
    **{f"layer 1e-{k}": lambda f, k=k: layer(f * 10.0**-k) for k in (2, 4, 6, 8)},
    **{f"Bratu {rate}": lambda f, rate=rate: reaction(rate / f) for rate in (1, 2, 3.5)},
}
"""Each task by a factor, 1 + SHIFT * repeat."""


def functional(name: str) -> vc.Problem:
    """The problem of a task as varcalc is given it, its function new."""
    task = TASKS[name](1.0)
    (a, b), (first, last) = task.span, task.ends
    lagrangians = {
        "half": lambda x, y, dy, p: y * ca.sqrt(p.half**2 + dy**2),
        "epsilon": lambda x, y, dy, p: (p.epsilon * dy**2 + y**2) / 2,
        "rate": lambda x, y, dy, p: dy**2 / 2 - p.rate * ca.exp(y),
    }
    parameter, value = task.parameter
    return vc.Problem(lagrangians[parameter], vc.Fixed(a, first), vc.Fixed(b, last), parameters={parameter: value})


@dataclass(frozen=True)
class Run:
    """One solve: milliseconds, and the errors of the value and of the curve, with what else is known."""

    build_ms: float
    solve_ms: float
    value_error: float
    curve_error: float
    known: dict[str, Any]


def cold(name: str, method: Any, tolerance: float) -> Callable[[Task], Run]:
    """From the functional to the answer."""

    def timed(task: Task) -> Run:
        began = time.process_time()
        problem = functional(name).with_parameters(dict([task.parameter]))
        solution = vc.solve(problem, method, tol=tolerance)
        return delivered(task, solution, 1e3 * (time.process_time() - began))

    return timed


def warm(name: str, method: Any, tolerance: float) -> Callable[[Task], Run]:
    """A new parameter value for a problem that was solved at another."""
    problem = functional(name)

    def timed(task: Task) -> Run:
        began = time.process_time()
        solution = vc.solve(problem.with_parameters(dict([task.parameter])), method, tol=tolerance)
        return delivered(task, solution, 1e3 * (time.process_time() - began))

    return timed


def swept(name: str, method: Any, tolerance: float) -> Record:
    """Each of many values in one call, the one of the first solve included; everything built before."""
    problem, tasks = functional(name), [TASKS[name](1 + SHIFT * k) for k in range(VALUES)]
    grid = {tasks[0].parameter[0]: [task.parameter[1] for task in tasks]}
    label = type(method).__name__ + SWEPT
    vc.sweep(problem, grid, method, tol=tolerance)
    began = time.process_time()
    found = vc.sweep(problem, grid, method, tol=tolerance)
    spent = 1e3 * (time.process_time() - began) / VALUES
    if found.failures:
        return Record(name, label, tolerance, "no answer", 0.0, spent, reason=found.failures[0].reason)
    missed = max((p.value - task.value for p, task in zip(found.points, tasks, strict=True)), key=abs)
    claimed = float(found.claimed_errors.max())
    return Record(
        name, label, tolerance, "solved", 0.0, spent, value_error=missed, claimed_error=claimed,
        size=max(1.0, abs(tasks[0].value)),
    )  # fmt: skip


def peer_swept(name: str, tolerance: float, nodes: int) -> Record:
    """solve_bvp with Jacobians at the same values, each begun from the last mesh and curve."""
    tasks = [TASKS[name](1 + SHIFT * k) for k in range(VALUES // 5)]
    label, times, errors = PEER + SWEPT, [], []
    x, y = np.linspace(*tasks[0].span, nodes), np.zeros((2, nodes))
    y[0] = np.interp(x, tasks[0].span, tasks[0].ends)
    for task in tasks:
        began = time.process_time()
        found = bvp(task, x, y, tolerance, True)
        times.append(1e3 * (time.process_time() - began))
        if not found.success:
            return Record(name, label, tolerance, "no answer", 0.0, times[-1], reason=found.message)
        errors.append(worth(task, found)[0] - task.value)
        x, y = found.x, found.y
    worst = max(errors, key=abs)
    return Record(
        name, label, tolerance, "solved", 0.0, statistics.median(times), value_error=worst, claimed_error=abs(worst),
        size=max(1.0, abs(tasks[0].value)),
    )  # fmt: skip


def delivered(task: Task, solution: vc.Solution, spent_ms: float) -> Run:
    """What a solution of varcalc's is worth."""
    known = {
        "claimed_error": solution.error.value, "unknowns": solution.stats.unknowns,
        "iterations": solution.stats.iterations,
    }  # fmt: skip
    missed = float(np.abs(np.ravel(solution.y(task.places)) - task.curve(task.places)).max())
    built = min(1e3 * solution.stats.build, spent_ms)
    return Run(built, spent_ms - built, solution.value - task.value, missed, known)


def peer(tolerance: float, nodes: int, given: bool, graded: bool) -> Callable[[Task], Run]:
    """solve_bvp with a tolerance and a first mesh, with Jacobians ``given`` or not."""

    def timed(task: Task) -> Run:
        first, last = task.ends
        began = time.process_time()
        x = by_hand(task, nodes) if graded else np.linspace(*task.span, nodes)
        y = np.zeros((2, nodes))
        y[0] = first + (last - first) * (x - x[0]) / (x[-1] - x[0])
        found = bvp(task, x, y, tolerance, given)
        spent = 1e3 * (time.process_time() - began)
        if not found.success:
            raise RuntimeError(found.message)
        value, missed = worth(task, found)
        return Run(0.0, spent, value - task.value, missed, {"claimed_error": abs(value - task.value),
                                                            "unknowns": 2 * found.x.size})  # fmt: skip

    return timed


def bvp(task: Task, x: np.ndarray, y: np.ndarray, tolerance: float, given: bool) -> Any:
    """solve_bvp from a mesh and a curve, with Jacobians ``given`` or not."""
    first, last = task.ends
    jacobians: dict[str, Any] = {"fun_jac": task.jacobian, "bc_jac": lambda a, b: (AT_START, AT_END)} if given else {}
    with np.errstate(all="ignore"):
        return solve_bvp(
            task.rates, lambda a, b: np.array([a[0] - first, b[0] - last]), x, y, tol=tolerance, max_nodes=MOST_NODES,
            **jacobians,
        )  # fmt: skip


AT_START, AT_END = np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
DEEP = 16.0
"""Widths of a layer that a mesh graded by hand spends most of its nodes on."""


def by_hand(task: Task, nodes: int) -> np.ndarray:
    """Shishkin's mesh: a third of the nodes in either layer, the others evenly between."""
    assert task.width is not None
    a, b = task.span
    edge, third = min(0.25 * (b - a), DEEP * task.width), nodes // 3
    return np.unique(np.concatenate([
        np.linspace(a, a + edge, third + 1), np.linspace(a + edge, b - edge, nodes - 2 * third),
        np.linspace(b - edge, b, third + 1),
    ]))[:nodes]  # fmt: skip


def worth(task: Task, found: Any) -> tuple[float, float]:
    """The functional along solve_bvp's spline, and the largest distance from the exact curve."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(found.x)[:, None]
    x = (found.x[:-1, None] + half * (1 + nodes)).ravel()
    y, rate = found.sol(x)[0], found.sol(x, 1)[0]
    value = float((half * weights).ravel() @ task.lagrangian(x, y, rate))
    return value, float(np.abs(found.sol(task.places)[0] - task.curve(task.places)).max())


BROKEN = (RuntimeError, ValueError, ArithmeticError, vc.VariationalError)


def measured(name: str, method: str, setting: float, timed: Callable[[Task], Run], repeats: int) -> Record:
    """The median of solves at neighbouring parameter values, with the worst errors among them."""
    began = time.process_time()
    try:
        timed(TASKS[name](1.0))
        began, runs = time.process_time(), []
        while len(runs) < repeats and (not runs or time.process_time() - began < ENOUGH_SECONDS):
            runs.append(timed(TASKS[name](1 + SHIFT * (1 + len(runs)))))
    except BROKEN as error:
        spent = 1e3 * (time.process_time() - began)
        return Record(name, method, setting, "no answer", 0.0, spent, reason=str(error).partition("\n")[0])
    worst = max(runs, key=lambda run: abs(run.value_error))
    return Record(
        name, method, setting, "solved", build_ms=statistics.median(run.build_ms for run in runs),
        solve_ms=statistics.median(run.solve_ms for run in runs), value_error=worst.value_error,
        curve_error=max(run.curve_error for run in runs), size=max(1.0, abs(TASKS[name](1.0).value)), **worst.known,
    )  # fmt: skip


def entries(name: str) -> Iterator[tuple[str, float, Callable[[Task], Run]]]:
    """Every method at every setting."""
    for label, method in OWN.items():
        for tolerance in OWN_TOLERANCES:
            yield label, tolerance, cold(name, method, tolerance)
            yield label + WARM, tolerance, warm(name, method, tolerance)
    for degree in OWN_DEGREES:
        method = vc.Collocation(degree=degree, refine=False)
        yield "Collocation", 10.0**-degree, cold(name, method, 1e-9)
        yield "Collocation" + WARM, 10.0**-degree, warm(name, method, 1e-9)
    layered = TASKS[name](1.0).width is not None
    for tolerance in PEER_TOLERANCES:
        for nodes in NODES:
            for given in (True, False):
                yield PEER, tolerance, peer(tolerance, nodes, given, False)
                if layered:
                    yield PEER, tolerance, peer(tolerance, nodes, given, True)


def everything(tasks: Sequence[str], repeats: int, store: Path) -> WorkPrecision:
    """All methods on all tasks, stored after each."""
    records: list[Record] = []
    for name in tasks:
        records += [measured(name, label, setting, timed, repeats) for label, setting, timed in entries(name)]
        records += [swept(name, OWN["Collocation"], tolerance) for tolerance in OWN_TOLERANCES[:-1]]
        records += [peer_swept(name, tolerance, nodes) for tolerance in PEER_TOLERANCES for nodes in NODES]
        WorkPrecision(tuple(records), about()).save(store)
        print(f"{name}: measured", file=sys.stderr)
    return WorkPrecision(tuple(records), about())


def value_of(record: Record) -> float:
    """The error of the value."""
    return abs(record.value_error or 0.0) / record.size


def curve_of(record: Record) -> float:
    """The error of the curve, infinite where it is not known."""
    return math.inf if record.curve_error is None else record.curve_error


def fastest(records: Sequence[Record], target: float, error: Callable[[Record], float]) -> float | None:
    """Milliseconds of the fastest setting that meets an error."""
    met = [r for r in records if r.ok and error(r) <= target]
    return min(((r.build_ms or 0.0) + (r.solve_ms or 0.0) for r in met), default=None)


def table(found: WorkPrecision, target: float, what: str, error: Callable[[Record], float]) -> str:
    """Milliseconds by task and method, and how many times as fast as solve_bvp the better of varcalc's is."""
    names = list(dict.fromkeys(r.method for r in found.records))
    rows = []
    for task in dict.fromkeys(r.problem for r in found.records):
        times = {n: fastest([r for r in found.records if (r.problem, r.method) == (task, n)], target, error)
                 for n in names}  # fmt: skip
        ratios = [ratio(times.get(PEER + kind), [times.get(own + kind) for own in OWN]) for kind in ("", SWEPT)]
        ratios.insert(1, ratio(times.get(PEER), [times.get(own + WARM) for own in OWN]))
        rows.append((task, *("-" if times[n] is None else f"{times[n]:.2f}" for n in names), *ratios))
    heading = f"error of the {what} <= {target:.0e}: milliseconds; times as fast as solve_bvp"
    return "\n".join([heading, drawn(("",), [*names, "cold: times", "warm: times", "swept: times"], rows)])


def ratio(theirs: float | None, own: Sequence[float | None]) -> str:
    """How many times as fast as solve_bvp."""
    best = min((t for t in own if t is not None), default=None)
    if best is None:
        return "-"
    return "never so exact" if theirs is None else f"{theirs / best:.1f}"


def main() -> None:
    """Measure or load, print the tables, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="*", choices=list(TASKS), default=list(TASKS))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--store", type=Path, default=HERE / "records" / "indirect.json")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "records" / "indirect.png")
    parser.add_argument("--draw", type=Path, help="print and draw this file of records, measure nothing")
    chosen = parser.parse_args()
    if chosen.draw is None:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        found = everything(chosen.tasks, chosen.repeats, chosen.store)
    else:
        found = WorkPrecision.load(chosen.draw)
    for what, error in (("value", value_of), ("curve", curve_of)):
        for target in TARGETS:
            print(table(found, target, what, error), end="\n\n")
    title = "Error of the value against time: varcalc's indirect methods, cold and warm, and solve_bvp"
    drawn = [replace(r, method=r.method.replace(WARM, "(warm)").replace(SWEPT, "(swept)")) for r in found.records]
    cold_picture(drawn, title=title).savefig(chosen.output, dpi=130)


if __name__ == "__main__":
    main()
