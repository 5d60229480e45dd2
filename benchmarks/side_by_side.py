"""varcalc beside other packages on the same work, in one process on one core: table of ratios, records, chart.

Cold means everything from the functional to the answer: new function objects
and new ends for every repeat. What a package needs only once in a process
(its import, plug-ins, tables) is loaded by a first solve that is not counted.
Times are processor time of the one thread, which is what the wall clock shows on an
idle core: on a shared machine a wall clock charges the long solves for their neighbours
and lets the short ones pass. Every package runs through settings of its own from loose to tight; what counts at
an error is its fastest setting that meets it. A package that is not installed
is named as missing. See README.md in this folder for the rules.

Run: python benchmarks/side_by_side.py [--tasks NAME ...] [--repeats 5] [--store FILE] [-o PICTURE]
     python benchmarks/side_by_side.py --draw FILE
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib.metadata import packages_distributions, version
from pathlib import Path
from typing import Any

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # before NumPy is loaded: one core for everybody

import varcalc as vc  # noqa: E402
from peers.adapter import Adapter, NotSolvedError  # noqa: E402
from tasks import SHIFT, TASKS, Task  # noqa: E402
from varcalc.charts import cold_picture  # noqa: E402
from varcalc.study.work_precision import ENOUGH_SECONDS, Record, WorkPrecision, about  # noqa: E402
from varcalc.tables import table  # noqa: E402

HERE = Path(__file__).parent
PEERS = ("casadi_radau", "asset", "yapss", "mpopt", "rockit", "dymos", "scipy_bvp", "geographiclib")
OWN: dict[str, Any] = {"Ritz": vc.Ritz(), "Collocation": vc.Collocation(), "ladder": None}
TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
TARGETS = (1e-4, 1e-6, 1e-9, 1e-12)
MEASURE = "Ritz"
"""The method that ratios are to."""
BROKEN = (NotSolvedError, RuntimeError, ValueError, ArithmeticError, vc.VariationalError)
"""What a package raises when it has no answer."""

Timed = tuple[float, float, float, float, dict[str, Any]]
"""Milliseconds to build and to solve, the value, the exact one, and what else is known of the answer."""


def own(method: Any, tolerance: float) -> Callable[[Task], Timed]:
    """One cold solve by varcalc: the building is what the method reports, and tracing the functional."""

    def timed(task: Task) -> Timed:
        began = time.process_time()
        problem = task.problem()
        traced = time.process_time() - began
        solution = vc.solve(problem, method, tol=tolerance)
        spent, build = time.process_time() - began, traced + solution.stats.build
        known = {"claimed_error": solution.error.value, "unknowns": solution.stats.unknowns}
        return 1e3 * build, 1e3 * (spent - build), solution.value, task.exact, known

    return timed


def peer(adapter: Adapter, setting: Any) -> Callable[[Task], Timed]:
    """One cold solve by a peer. It claims no error, so what it delivers stands for that."""

    def timed(task: Task) -> Timed:
        began = time.process_time()
        made = adapter.build(task, setting)
        built = time.process_time()
        value = adapter.solve(made)
        ended = time.process_time()
        known = {"claimed_error": abs(value - task.exact)}
        return 1e3 * (built - began), 1e3 * (ended - built), value, task.exact, known

    return timed


def measured(name: str, method: str, setting: float, timed: Callable[[Task], Timed], repeats: int) -> Record:
    """The median of cold solves, each with other ends, and the worst error among them."""
    try:
        timed(TASKS[name](1.0))
        runs, began = [], time.process_time()
        while len(runs) < repeats and (not runs or time.process_time() - began < ENOUGH_SECONDS):
            runs.append(timed(TASKS[name](1 + SHIFT * (1 + len(runs)))))
    except BROKEN as error:
        return Record(name, method, setting, "no answer", reason=str(error).partition("\n")[0])
    worst = max(runs, key=lambda run: abs(run[2] - run[3]))
    return Record(
        name, method, setting, "solved", build_ms=statistics.median(run[0] for run in runs),
        solve_ms=statistics.median(run[1] for run in runs), value_error=worst[2] - worst[3],
        size=max(1.0, abs(worst[3])), **worst[4],
    )  # fmt: skip


def timed_failure(record: Record, spent: float) -> Record:
    """A record without an answer, at the time it took to have none."""
    return Record(record.problem, record.method, record.setting, record.status, 0.0, 1e3 * spent, reason=record.reason)


def installed() -> tuple[list[Adapter], list[str]]:
    """The adapters whose package is here, and the names of the packages that are not."""
    adapters = [importlib.import_module(f"peers.{name}").ADAPTER for name in PEERS]
    here = [a for a in adapters if importlib.util.find_spec(a.package) is not None]
    return here, [a.name for a in adapters if a not in here]


def everything(tasks: Sequence[str], repeats: int, store: Path) -> WorkPrecision:
    """Every package on every task, in turns; stored after each task, so that an interruption costs one."""
    adapters, missing = installed()
    found = packages_distributions()
    versions = {a.name: version(found[a.package][0]) for a in adapters}
    known = about() | versions | cold_start() | {"missing": ", ".join(missing)}
    records: list[Record] = []
    for name in tasks:
        entries = [(label, tol, own(method, tol)) for label, method in OWN.items() for tol in TOLERANCES]
        entries += [
            (a.name, 1.0 / (1 + i), peer(a, setting))
            for a in adapters
            if a.tasks is None or name in a.tasks
            for i, setting in enumerate(a.settings)
        ]
        for label, setting, timed in entries:
            began = time.process_time()
            record = measured(name, label, setting, timed, repeats)
            records.append(record if record.ok else timed_failure(record, time.process_time() - began))
        WorkPrecision(tuple(records), known).save(store)
        print(f"{name}: {len(entries)} settings", file=sys.stderr)
    return WorkPrecision(tuple(records), known)


def cold_start() -> dict[str, str]:
    """``varcalc run brachistochrone`` from the shell: wall clock and peak of memory, median of three."""
    command = [sys.executable, "-c", "from varcalc.cli import main; main()", "run", "brachistochrone"]
    times = []
    for _ in range(3):
        began = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)
        times.append(time.perf_counter() - began)
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return {"varcalc run brachistochrone": f"{statistics.median(times):.2f} s, {memory:.0f} MB"}


def fastest(records: Sequence[Record], target: float) -> float | None:
    """Milliseconds of the fastest setting whose error is within ``target``, relative to max(1, abs(value))."""
    met = [r for r in records if r.ok and r.value_error is not None and abs(r.value_error) <= target * r.size]
    return min(((r.build_ms or 0.0) + (r.solve_ms or 0.0) for r in met), default=None)


def ratios(found: WorkPrecision, target: float) -> str:
    """Milliseconds by task and package at one error, with the ratio to varcalc's Ritz."""
    names = list(dict.fromkeys(r.method for r in found.records))
    rows = []
    for task in dict.fromkeys(r.problem for r in found.records):
        times = {n: fastest([r for r in found.records if (r.problem, r.method) == (task, n)], target) for n in names}
        unit = times.get(MEASURE)
        rows.append((task, *(cell(times[n], None if n == MEASURE else unit) for n in names)))
    heading = f"error <= {target:.0e}: milliseconds to build and solve (times that of {MEASURE})"
    return "\n".join([heading, table(("",), names, rows)])


def cell(time_ms: float | None, unit: float | None) -> str:
    """A time, and its ratio; a dash where the error was never met."""
    if time_ms is None:
        return "-"
    return f"{time_ms:.2f}" if unit is None else f"{time_ms:.2f} ({time_ms / unit:.1f})"


def main() -> None:
    """Measure or load, print the tables, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="*", choices=list(TASKS), default=list(TASKS))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--store", type=Path, default=HERE / "records" / "side_by_side.json")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "records" / "side_by_side.png")
    parser.add_argument("--draw", type=Path, help="print and draw this file of records, measure nothing")
    chosen = parser.parse_args()
    if chosen.draw is None:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        found = everything(chosen.tasks, chosen.repeats, chosen.store)
    else:
        found = WorkPrecision.load(chosen.draw)
    for target in TARGETS:
        print(ratios(found, target), end="\n\n")
    for name, words in found.about.items():
        print(f"{name}: {words or 'none'}")
    cold_picture(found.records, title="Error against the time to build and solve, cold").savefig(chosen.output, dpi=130)


if __name__ == "__main__":
    main()
