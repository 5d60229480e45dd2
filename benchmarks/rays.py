"""Rays per second against error: ``Scene.trace`` beside integrators that people use, on media with closed forms.

Every ray starts and ends where its closed form says; the error is the largest distance of an end point from it.
The peers integrate Hamilton's ray equations in σ to the σ of the end, which they are given; ``trace`` finds the end
itself, by optical path or at a surface. Rates are told twice: by the wall clock, and by the processor time of all
threads, which on a shared machine is the steadier. What a first call compiles is in a column of its own.

Run: python benchmarks/rays.py [--rays 200000] [--store FILE] [-o PICTURE]
     python benchmarks/rays.py --growth [--largest 10000000] [--store FILE] [-o PICTURE]
     python benchmarks/rays.py --draw FILE [-o PICTURE]
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # before NumPy is loaded

import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from varcalc import optics  # noqa: E402
from varcalc.charts.colours import COLOURS, INK, OTHER_COLOURS  # noqa: E402
from varcalc.charts.panels import plain  # noqa: E402
from varcalc.study.work_precision import about  # noqa: E402
from varcalc.tables import table as drawn  # noqa: E402

HERE = Path(__file__).parent
N0, A, LENGTH = 1.6, 0.3, 2 * np.pi / 0.3
SOURCE = 0.6
"""The fish-eye's source, on the x axis."""
STEPS = (25, 50, 100, 200, 400)
"""Of Runge and Kutta's method."""
TOLERANCES = (1e-6, 1e-9, 1e-12, 3e-14)
REPEATS = 5
TARGETS = (1e-6, 1e-9, 1e-12)
OTHER_PACKAGES = ("numba", "pyrateoptics")
"""Looked for; with numba the method of Runge and Kutta is compiled, pyrateoptics has no adapter here."""

Pull = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Task:
    """m rays: ``start`` and unit ``heading`` (m, 3), the stop, and what is known of the ends.

    ``pull`` is ∇n²/2 at points (3, m), ``momentum`` (m, 3) the peers' other initial value, ``sigma`` (m,) their end.
    """

    name: str
    scene: optics.Scene
    start: np.ndarray
    heading: np.ndarray
    stop: dict[str, Any]
    exact: np.ndarray
    momentum: np.ndarray
    pull: Pull | None = None
    sigma: np.ndarray | None = None


def luneburg(m: int) -> Task:
    """A plane wave, focused on the rim."""
    rng = np.random.default_rng(0)
    height, turn = 0.98 * np.sqrt(rng.random(m)), 2 * np.pi * rng.random(m)
    start = np.column_stack([-np.sqrt(1 - height**2), height * np.cos(turn), height * np.sin(turn)])
    ahead = np.tile([1.0, 0, 0], (m, 1))
    return Task(
        "Luneburg", optics.Scene(optics.luneburg()), start, ahead, {"until": optics.Sphere((0, 0, 0), 1.0)},
        ahead, ahead, lambda r: -r, np.full(m, np.pi / 2),
    )  # fmt: skip


def fan(m: int) -> tuple[np.ndarray, np.ndarray]:
    """The source and unit vectors within 100 degrees of -x."""
    rng = np.random.default_rng(0)
    cosine, turn = 1 - (1 - np.cos(np.radians(100))) * rng.random(m), 2 * np.pi * rng.random(m)
    sine = np.sqrt(1 - cosine**2)
    return np.tile([SOURCE, 0, 0], (m, 1)), np.column_stack([-cosine, sine * np.cos(turn), sine * np.sin(turn)])


def fish_eye(m: int) -> Task:
    """To the image of the source, at the optical path π."""
    start, heading = fan(m)
    momentum = 2 / (1 + SOURCE**2) * heading
    angle = 2 * np.arctan(SOURCE)
    nodes, weights = np.polynomial.legendre.leggauss(300)
    path, weights = np.pi * (nodes + 1) / 2, weights * np.pi / 2
    height = np.cos(angle) * np.cos(path)[:, None] - np.sin(angle) * heading[:, 0] * np.sin(path)[:, None]
    sigma = weights @ (1 + height) ** -2  # n = 1 + cos χ along the great circle that the ray is the image of

    def pull(r: np.ndarray) -> np.ndarray:
        return -8 * r / (1 + np.sum(r * r, axis=0)) ** 3

    image = np.tile([-1 / SOURCE, 0, 0], (m, 1))
    scene = optics.Scene(optics.fish_eye())
    return Task("fish-eye", scene, start, heading, {"optical_path": np.pi}, image, momentum, pull, sigma)


def fish_eye_to_plane(m: int) -> Task:
    """To the plane x = -1, where the great circle of the stereographic image crosses another plane."""
    start, heading = fan(m)
    square, c = SOURCE**2, -1.0
    at = np.array([2 * SOURCE, 0, 0, square - 1]) / (1 + square)
    # dX/dS = (dX/dr) t/n for X = (2r, r² - 1)/(1 + r²), n = 2/(1 + r²)
    along = SOURCE * heading[:, 0]
    tangent = np.column_stack([heading - 2 * along[:, None] * start / (1 + square), 2 * along / (1 + square)])
    level, slope = at[0] + c * at[3], tangent[:, 0] + c * tangent[:, 3]
    path = np.mod(np.arctan2(slope, level) + np.arccos(c / np.hypot(level, slope)) * np.array([[1], [-1]]), 2 * np.pi)
    path = path.min(axis=0)[:, None]
    there = at * np.cos(path) + tangent * np.sin(path)
    exact = there[:, :3] / (1 - there[:, 3:])
    stop = {"until": optics.Plane((c, 0, 0), (1, 0, 0))}
    return Task("fish-eye to a plane", optics.Scene(optics.fish_eye()), start, heading, stop, exact, heading)


def rod(m: int) -> Task:
    """Skew rays through one paraxial period."""
    rng = np.random.default_rng(0)
    far, turn = 0.4 * np.sqrt(rng.random(m)), 2 * np.pi * rng.random(m)
    start = np.column_stack([far * np.cos(turn), far * np.sin(turn), np.zeros(m)])
    steep, turn = 0.2 * np.sqrt(rng.random(m)), 2 * np.pi * rng.random(m)
    squared = N0**2 * (1 - A**2 * far**2)
    across = np.column_stack([steep * np.cos(turn), steep * np.sin(turn)])
    momentum = np.column_stack([across, np.sqrt(squared - steep**2)])
    sigma, w = LENGTH / momentum[:, 2], N0 * A
    ends = start[:, :2] * np.cos(w * sigma)[:, None] + across / w * np.sin(w * sigma)[:, None]
    return Task(
        "rod", optics.Scene(optics.selfoc(N0, A)), start, momentum / np.sqrt(squared)[:, None],
        {"until": optics.Plane((0, 0, LENGTH), (0, 0, 1))}, np.column_stack([ends, np.full(m, LENGTH)]),
        momentum, lambda r: -((N0 * A) ** 2) * r * np.array([[1.0], [1.0], [0.0]]), sigma,
    )  # fmt: skip


TASKS = (luneburg, fish_eye, fish_eye_to_plane, rod)
Record = dict[str, Any]


def measured(task: Task, method: str, setting: float, run: Callable[[], np.ndarray], repeats: int = REPEATS) -> Record:
    """The best of some runs, after a first one that is told apart."""
    rays, times = len(task.exact), []
    for _ in range(repeats + 1):
        wall, processor = time.perf_counter(), time.process_time()
        ends = run()
        times.append((time.perf_counter() - wall, time.process_time() - processor))
    later = times[1:] or times
    return {
        "task": task.name, "method": method, "setting": setting, "rays": rays, "first_s": times[0][0],
        "wall_s": min(t[0] for t in later), "processor_s": min(t[1] for t in later),
        "error": float(np.abs(ends - task.exact[: len(ends)]).max()),
    }  # fmt: skip


def own(task: Task) -> Record:
    """varcalc."""
    record: Record = {}

    def run() -> np.ndarray:
        bundle = task.scene.trace(task.start, task.heading, **task.stop)
        record["model"] = bundle.model
        if not np.all(bundle.arrived):
            raise ArithmeticError(f"{task.name}: {bundle}")
        return bundle.points

    return measured(task, "varcalc", 0.0, run) | record


def own_spreading(m: int) -> Record:
    """varcalc with geometrical spreading, in the fish-eye at the optical path 2: (sin S)² (1 + r²)²/4."""
    task = fish_eye(m)

    def run() -> np.ndarray:
        bundle = task.scene.trace(task.start, task.heading, optical_path=2.0, with_spreading=True)
        exact = (np.sin(2.0) * (1 + np.sum(bundle.points**2, axis=1)) / 2) ** 2
        return task.exact + (bundle.spreading / exact - 1)[:, None]

    return measured(task, "varcalc", 0.0, run) | {"task": "fish-eye, spreading"}


def equations(task: Task, m: int) -> tuple[Callable[[float, np.ndarray], np.ndarray], np.ndarray]:
    """Hamilton's ray equations of the first m rays, each scaled to its own σ, as a stacked system on [0, 1]."""
    pull, sigma = task.pull, task.sigma
    assert pull is not None
    assert sigma is not None
    scale = sigma[:m]

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        state = y.reshape(6, m)
        return np.concatenate([state[3:] * scale, pull(state[:3]) * scale]).ravel()

    return rates, np.concatenate([task.start[:m].T, task.momentum[:m].T]).ravel()


def taken(task: Task, m: int) -> Task:
    """The first m rays."""
    return Task(task.name, task.scene, task.start[:m], task.heading[:m], task.stop, task.exact[:m], task.momentum[:m])


def scipy_one_by_one(task: Task) -> Iterator[Record]:
    """SciPy's DOP853, ray by ray."""
    from scipy.integrate import solve_ivp

    few = 30
    singles = [equations(Task(**{**vars(task), **rows(task, k)}), 1) for k in range(few)]
    for tolerance in TOLERANCES:

        def run(tolerance: float = tolerance) -> np.ndarray:
            ends = [
                solve_ivp(rates, (0, 1), start, "DOP853", rtol=tolerance, atol=tolerance).y[:3, -1]
                for rates, start in singles
            ]
            return np.array(ends)

        yield measured(taken(task, few), "SciPy DOP853, one by one", tolerance, run, 2)


def rows(task: Task, k: int) -> dict[str, Any]:
    """The parts of a task that belong to ray k."""
    names = ("start", "heading", "exact", "momentum", "sigma")
    return {name: getattr(task, name)[k : k + 1] for name in names}


def scipy_stacked(task: Task) -> Iterator[Record]:
    """SciPy's DOP853 on 1000 rays as one system."""
    from scipy.integrate import solve_ivp

    m = 1000
    rates, start = equations(task, m)
    for tolerance in TOLERANCES:

        def run(tolerance: float = tolerance) -> np.ndarray:
            found = solve_ivp(rates, (0, 1), start, "DOP853", rtol=tolerance, atol=tolerance, t_eval=[1.0])
            return found.y[:, -1].reshape(6, m)[:3].T

        yield measured(taken(task, m), "SciPy DOP853, stacked", tolerance, run, 2)


def runge_kutta(task: Task) -> Iterator[Record]:
    """The classical method in NumPy, on 10 000 rays together."""
    m = 10_000
    rates, start = equations(task, m)
    for steps in STEPS:

        def run(steps: int = steps) -> np.ndarray:
            y, h = start, 1 / steps
            for _ in range(steps):
                a = rates(0, y)
                b = rates(0, y + h / 2 * a)
                c = rates(0, y + h / 2 * b)
                y = y + h / 6 * (a + 2 * b + 2 * c + rates(0, y + h * c))
            return y.reshape(6, m)[:3].T

        yield measured(taken(task, m), "NumPy RK4", steps, run, 1)


def compiled_runge_kutta(task: Task) -> Iterator[Record]:
    """The classical method compiled by numba, ray by ray on one thread; the pull is a number times the position."""
    from numba import njit

    factors = {
        "Luneburg": lambda q: -1.0 + 0 * q, "fish-eye": lambda q: -8 / (1 + q) ** 3, "rod": lambda q: -0.2304 + 0 * q
    }  # fmt: skip
    factor, last = njit(factors[task.name]), 0.0 if task.name == "rod" else 1.0

    @njit(fastmath=True)
    def slope(x: float, y: float, z: float) -> Any:
        f = factor(x * x + y * y + z * z)
        return f * x, f * y, last * f * z

    @njit(fastmath=True)
    def carried(start: Any, momentum: Any, sigma: Any, steps: int) -> Any:
        ends = np.empty_like(start)
        for ray in range(len(start)):
            x, y, z = start[ray]
            u, v, w = momentum[ray]
            h = sigma[ray] / steps
            for _ in range(steps):  # of r'' = f(r): the stages of r are those of Nyström's form
                a, b, c = slope(x, y, z)
                d, e, f = slope(x + h / 2 * u, y + h / 2 * v, z + h / 2 * w)
                q = h * h / 4
                g, k, m = slope(x + h / 2 * u + q * a, y + h / 2 * v + q * b, z + h / 2 * w + q * c)
                n, o, p = slope(x + h * u + 2 * q * d, y + h * v + 2 * q * e, z + h * w + 2 * q * f)
                x += h * u + h * h / 6 * (a + d + g)
                y += h * v + h * h / 6 * (b + e + k)
                z += h * w + h * h / 6 * (c + f + m)
                u += h / 6 * (a + 2 * d + 2 * g + n)
                v += h / 6 * (b + 2 * e + 2 * k + o)
                w += h / 6 * (c + 2 * f + 2 * m + p)
            ends[ray, 0], ends[ray, 1], ends[ray, 2] = x, y, z
        return ends

    m = 10_000
    for steps in STEPS:
        arguments = task.start[:m], task.momentum[:m], task.sigma[:m], steps
        yield measured(taken(task, m), "numba RK4", steps, lambda a=arguments: carried(*a), 2)


def everything(rays: int, store: Path) -> list[Record]:
    """All methods on all tasks, in turns; stored as they come."""
    here = [name for name in OTHER_PACKAGES if importlib.util.find_spec(name) is not None]
    known = {"missing": ", ".join(name for name in OTHER_PACKAGES if name not in here), "cores": str(os.cpu_count())}
    known |= {name: version(name) for name in (*here, "heyoka")}
    peers = [scipy_one_by_one, scipy_stacked, runge_kutta, *([compiled_runge_kutta] if "numba" in here else [])]
    records: list[Record] = []
    for make in TASKS:
        task = make(rays)
        records.append(own(task))
        if task.pull is not None:
            for peer in peers:
                records += list(peer(task))
        saved(records, store, known)
    records.append(own_spreading(rays))
    saved(records, store, known)
    return records


def saved(records: list[Record], store: Path, known: dict[str, str]) -> None:
    """Write the records with a note of where they were made."""
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    document = {"about": about() | known | {"load": load}, "records": records}
    store.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def rates_of(record: Record) -> tuple[float, float]:
    """Rays a second by the wall clock, and by the processor time on one core."""
    return record["rays"] / record["wall_s"], record["rays"] / record["processor_s"]


def table(records: list[Record]) -> str:
    """Every measurement."""
    lines = [
        (r["task"], r["method"], f"{r['setting']:g}", f"{r['error']:.1e}", *(f"{x / 1e3:.1f}" for x in rates_of(r)),
         f"{r['first_s']:.2f}")
        for r in records
    ]  # fmt: skip
    names = ("setting", "error", "k rays/s, wall", "k rays/s, one core's time", "first call, s")
    return drawn(("task", "method"), names, lines)


def ratios(records: list[Record]) -> str:
    """How many times as fast varcalc is, by processor time, as the fastest setting of each peer at an error."""
    lines = []
    for task in dict.fromkeys(r["task"] for r in records):
        mine = next(r for r in records if r["task"] == task and r["method"] == "varcalc")
        for target in TARGETS:
            cells = []
            for method in dict.fromkeys(r["method"] for r in records if r["method"] != "varcalc"):
                met = [r for r in records if (r["task"], r["method"]) == (task, method) and r["error"] <= target]
                fastest = max((rates_of(r)[1] for r in met), default=None)
                cells.append("-" if fastest is None else f"{rates_of(mine)[1] / fastest:.0f}")
            if any(cell != "-" for cell in cells):
                lines.append((task, f"{target:.0e}", *cells))
    names = list(dict.fromkeys(r["method"] for r in records if r["method"] != "varcalc"))
    return drawn(("task", "error <="), names, lines)


def picture(records: list[Record]) -> Figure:
    """Rays a second of one core's time against the error, a panel a task."""
    tasks = [t for t in dict.fromkeys(r["task"] for r in records) if sum(r["task"] == t for r in records) > 1]
    figure = Figure(figsize=(12, 4.6), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(tasks), sharey=True)
    for panel, task in zip(panels, tasks, strict=True):
        for k, method in enumerate(dict.fromkeys(r["method"] for r in records)):
            own_records = [r for r in records if (r["task"], r["method"]) == (task, method)]
            if not own_records:
                continue
            colour = COLOURS["Ritz"][0] if method == "varcalc" else OTHER_COLOURS[k - 1]
            panel.plot(
                [max(r["error"], 1e-16) for r in own_records], [rates_of(r)[1] for r in own_records], "o-",
                color=colour, label=method, markersize=9 if method == "varcalc" else 5, linewidth=1.4,
            )  # fmt: skip
        plain(panel)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_title(task, color=INK, fontsize=11, loc="left")
        panel.set_xlabel("largest error of an end point", color=INK)
    panels[0].set_ylabel("rays a second of one core's time", color=INK)
    panels[0].legend(frameon=False, fontsize=9, labelcolor=INK)
    figure.suptitle("Rays through media with closed forms", x=0.01, ha="left", fontsize=13, color=INK)
    return figure


COUNTS = tuple(10**k for k in range(8))
GROWING: dict[str, Callable[[int], Task]] = {"fish-eye": fish_eye, "rod": rod}


def grown(name: str, count: int) -> Record:
    """One bundle in this process, its second where that is quick: seconds, and megabytes before and at most."""
    task = GROWING[name](2)
    rng = np.random.default_rng(0)
    heading = rng.random((count, 3)) * [0.2, 0.2, 0] + ([-1, 0, 0] if name == "fish-eye" else [0, 0, 1])
    start = task.start[0]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    times = []
    while len(times) < 2 and sum(times) < 60:
        began = time.perf_counter()
        bundle = task.scene.trace(start, heading, **task.stop, progress=False)
        times.append(time.perf_counter() - began)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    arrived = int(np.count_nonzero(bundle.arrived))
    return {"task": name, "rays": count, "arrived": arrived, "first_s": times[0], "wall_s": min(times),
            "before_mb": before, "peak_mb": peak}  # fmt: skip


def growth(largest: int, store: Path) -> list[Record]:
    """Both media, every count in a process of its own."""
    records = []
    for name in GROWING:
        for count in [c for c in COUNTS if c <= largest]:
            command = [sys.executable, __file__, "--one", name, str(count)]
            records.append(json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
            print("{task:10s}{rays:>10d}{first_s:10.3f} s{wall_s:10.4f} s{before_mb:8.0f}{peak_mb:8.0f} MB".format(
                **records[-1]), flush=True)  # fmt: skip
            saved(records, store, {"cores": str(os.cpu_count())})
    return records


def growth_picture(records: list[Record]) -> Figure:
    """Time and the memory a trace adds, against the number of rays."""
    figure = Figure(figsize=(10, 4.2), layout="constrained", facecolor="white")
    left, right = figure.subplots(1, 2)
    for task, colour in zip(GROWING, (COLOURS["Ritz"][0], COLOURS["Ritz"][1]), strict=True):
        mine = [r for r in records if r["task"] == task]
        rays = [r["rays"] for r in mine]
        left.plot(rays, [r["wall_s"] for r in mine], "o-", color=colour, label=task)
        left.plot(rays, [r["first_s"] for r in mine], "o:", color=colour, markersize=3, label=f"{task}, first call")
        right.plot(rays, [r["peak_mb"] - r["before_mb"] for r in mine], "o-", color=colour, label=task)
    for panel, words in ((left, "seconds, wall clock"), (right, "MB beside the sources")):
        plain(panel)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel("rays", color=INK)
        panel.set_ylabel(words, color=INK)
    left.legend(frameon=False, fontsize=9, labelcolor=INK)
    figure.suptitle("How a trace grows", x=0.01, ha="left", fontsize=13, color=INK)
    return figure


def main() -> None:
    """Measure or load, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rays", type=int, default=200_000)
    parser.add_argument("--growth", action="store_true", help="time and memory against the number of rays instead")
    parser.add_argument("--largest", type=int, default=COUNTS[-1])
    parser.add_argument("--store", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--draw", type=Path, help="print and draw this file of records, measure nothing")
    parser.add_argument("--one", nargs=2, metavar=("TASK", "COUNT"), help="one point of the growth, as JSON")
    chosen = parser.parse_args()
    if chosen.one:
        print(json.dumps(grown(chosen.one[0], int(chosen.one[1]))))
        return
    stem = "rays_growth" if chosen.growth else "rays"
    store = chosen.store or HERE / "records" / f"{stem}.json"
    if chosen.draw is not None:
        store = chosen.draw
    elif chosen.growth:
        growth(chosen.largest, store)
    else:
        everything(chosen.rays, store)
    document = json.loads(store.read_text(encoding="utf-8"))
    records = document["records"]
    growing = "peak_mb" in records[0]
    if not growing:
        print(table(records), ratios(records), sep="\n\n")
        for name, words in document["about"].items():
            print(f"{name}: {words or 'none'}")
    drawn = growth_picture(records) if growing else picture(records)
    drawn.savefig(chosen.output or store.with_suffix(".png"), dpi=130)


if __name__ == "__main__":
    main()
