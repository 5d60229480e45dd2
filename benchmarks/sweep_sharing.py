"""One sweep by a pool of processes, by Dask on the same cores, and killed and resumed: seconds, and what differs.

Three kinds of points: one problem whose parameter moves, which are solved many together; a problem that a function
makes anew for each; and problems with a bound, by IPOPT. The pool and the cluster are up, and each has done a sweep
before the clock starts, so that what is measured is the sharing. Seconds are those of the wall clock, and of the
processor in all processes together, which other programs do not lengthen. Overhead is what these are beyond those of as
many processes that solve a part of the same points each and hand nothing back: cores that are busy together are slower
than one is alone, and that is not the sharing's doing.

Run: python benchmarks/sweep_sharing.py [POINTS] [CORES]; it writes records/sweeps.json beside itself.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
import psutil

import varcalc as vc
from varcalc.study.records import about

RECORD = Path(__file__).parent / "records" / "sweeps.json"
REPEATS = 3
"""Timings of which the least counts."""
BOUNDED = 500
"""What a point made anew costs in points that are moved, and one under a bound in those: so many fewer are taken."""


def pendulum() -> vc.Problem:
    """A swing in the time 1, the pull p.k."""
    return vc.Problem(
        lambda x, y, dy, p: dy**2 / 2 + p.k * ca.cos(y), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1.0}
    )


def made_anew(k: float) -> vc.Problem:
    """The same, made for each value."""
    return vc.Problem(lambda x, y, dy: dy**2 / 2 + k * ca.cos(y), vc.Fixed(0, 0), vc.Fixed(1, 1))


def under_a_bound() -> vc.Problem:
    """A loaded string under a ceiling."""
    return vc.Problem(
        lambda x, y, dy, p: dy**2 / 2 - p.k * y,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        [vc.Bound(lambda x, y, dy, p: y, upper=1.02)],
        parameters={"k": 1.0},
    )


KINDS: dict[str, tuple[Callable[..., vc.Problem], int]] = {
    "moved": (pendulum, 1),
    "made anew": (made_anew, 10),
    "under a bound": (under_a_bound, BOUNDED),
}
"""What is swept, and of how many points one is taken."""


def values(count: int) -> dict[str, np.ndarray]:
    """The values of k."""
    return {"k": np.linspace(0.1, 5.0, count)}


def processor_seconds() -> float:
    """What this process and all that it has started have had of the processor."""
    whole = psutil.Process()
    return sum(sum(p.cpu_times()[:2]) for p in (whole, *whole.children(recursive=True)))


def in_a_row(source: Callable[..., vc.Problem], count: int, part: int, parts: int) -> None:
    """One process' part of the points, neighbours as in a chunk of a sweep, of which nothing is handed back."""
    vc.sweep(source, {name: np.array_split(among, parts)[part] for name, among in values(count).items()})


def seconds(
    source: Callable[..., vc.Problem], count: int, pool: Executor, dask: Executor, cores: int
) -> dict[str, np.ndarray]:
    """The least seconds of a few sweeps each way, in turn: of the wall clock, and of the processor."""
    parts = [(source, count, part, cores) for part in range(cores)]
    ways: dict[str, Callable[[], object]] = {
        "alone": lambda: in_a_row(source, count, 0, 1),
        "apart": lambda: list(pool.map(in_a_row, *zip(*parts, strict=True))),
        "pool": lambda: vc.sweep(source, values(count), executor=pool, cores=cores),
        "dask": lambda: vc.sweep(source, values(count), executor=dask, cores=cores),
    }
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for _ in range(REPEATS):
        for name, way in ways.items():
            began, worked = time.perf_counter(), processor_seconds()
            way()
            spent[name].append((time.perf_counter() - began, processor_seconds() - worked))
    return {name: np.min(times, axis=0) for name, times in spent.items()}


def compared(points: int, cores: int) -> list[dict[str, object]]:
    """A row for each kind of points."""
    from distributed import Client, LocalCluster

    pool = ProcessPoolExecutor(cores, multiprocessing.get_context("spawn"))
    cluster = LocalCluster(n_workers=cores, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    rows: list[dict[str, object]] = []
    with pool, cluster, Client(cluster) as client:
        for kind, (source, share) in KINDS.items():
            count = max(points // share, 4 * cores)
            dask = client.get_executor()
            for executor in (pool, dask):
                vc.sweep(source, values(4 * cores), executor=executor, cores=cores)
            spent = seconds(source, count, pool, dask, cores)
            rows.append({"kind": kind, "points": count, "cores": cores} | {
                f"{name}_s": float(wall) for name, (wall, _) in spent.items()
            } | {
                f"{name}_overhead_by_{what}": float(spent[name][k] / spent["apart"][k] - 1)
                for name in ("pool", "dask") for k, what in enumerate(("clock", "processor"))
            } | {
                f"dask_of_pool_by_{what}": float(spent["pool"][k] / spent["dask"][k])
                for k, what in enumerate(("clock", "processor"))
            })  # fmt: skip
    return rows


def killed_and_resumed(points: int, cores: int) -> dict[str, object]:
    """A sweep killed (SIGKILL) when a third of its points are stored, and resumed, held against an unbroken one."""
    whole = vc.sweep(made_anew, values(points), cores=cores)
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "sweep.jsonl"
        process = subprocess.Popen([sys.executable, __file__, "--into", str(store), str(points), str(cores)])
        while process.poll() is None and (not store.exists() or store.read_bytes().count(b"\n") < points // 3):
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        process.wait()
        kept = store.read_bytes().count(b"\n") - 1
        resumed = vc.sweep(made_anew, values(points), cores=cores, store=store)
    off = np.abs(resumed.values - whole.values)
    return {
        "points": points, "stored_when_killed": kept, "statuses_differ": sum(
            a.status != b.status for a, b in zip(resumed.points, whole.points, strict=True)
        ), "largest_difference": float(off.max()),
        "beyond_the_claims": int((off > resumed.claimed_errors + whole.claimed_errors).sum()),
    }  # fmt: skip


def main() -> None:
    """Measure, print and write the record; or be the process that is killed."""
    arguments = sys.argv[1:]
    if arguments[:1] == ["--into"]:
        os.setpgrp()
        vc.sweep(made_anew, values(int(arguments[2])), cores=int(arguments[3]), store=arguments[1])
        return
    points, cores = (int(given) for given in (*arguments, *("10000", "2")[len(arguments) :]))
    rows = compared(points, cores)
    resumed = killed_and_resumed(points, cores)
    for row in (*rows, resumed):
        print(", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()))
    RECORD.write_text(json.dumps({"about": about(), "sharing": rows, "resumed": resumed}, indent=1) + "\n")


if __name__ == "__main__":
    main()
