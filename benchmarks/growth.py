"""How time and memory of the direct method grow with the size of a problem.

Two families, both of the soap film between equal rings a unit apart, whose area
is known:

* unknowns: quartic pieces on 2 to 250 000 equal elements, on a fixed mesh;
* functions: the same film in 1 to 100 further dimensions. The integrand
  y_1 sqrt(1 + |y'|^2) treats x and y_2, ..., y_n alike, so with the ends a
  unit apart along their diagonal the area stays what it was.

Every point is the median of fresh processes, so that the peak of memory is its
own; that of a process which only imports the package and solves the smallest
problem is drawn as a line. Records are stored, and drawn from the store.

Run: python benchmarks/growth.py [--largest 1000000] [--repeats 3] [--store FILE] [-o PICTURE]
     python benchmarks/growth.py --draw FILE -o PICTURE
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import casadi as ca
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import varcalc as vc
from varcalc.charts.colours import COLOURS, INK
from varcalc.charts.panels import plain
from varcalc.problems._curves import Catenary
from varcalc.study.work_precision import about

HERE = Path(__file__).parent
FAMILIES = ("unknowns", "functions")
UNKNOWNS = tuple(10**k for k in range(1, 7))
FUNCTIONS = (1, 2, 5, 10, 20, 50, 100)
DEGREE = 4
BENEATH = 0.02
"""Where lines of growth are drawn, as a share of the last time."""
EXACT = Catenary.over_axis((-0.5, 1), (0.5, 1)).moment_about_axis
COLOUR = {"build": COLOURS["Collocation"][0], "solve": COLOURS["Ritz"][0], "whole call": COLOURS["NoneType"][0]}


def film(functions: int) -> vc.Problem:
    """The soap film whose rings are a unit apart along the diagonal of x, y_2, ..., y_n."""
    step = 1 / math.sqrt(functions)
    start, end = [1.0] + [0.0] * (functions - 1), [1.0] + [step] * (functions - 1)
    if functions == 1:
        return vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.Fixed(step, 1))
    return vc.Problem(lambda x, y, dy: y[0] * ca.sqrt(1 + ca.sumsqr(dy)), vc.Fixed(0, start), vc.Fixed(step, end))


def measure(family: str, count: int) -> dict[str, Any]:
    """One solve in this process: seconds, peak of memory in MB, unknowns, error."""
    by_unknowns = family == "unknowns"
    method = vc.Ritz(elements=max(1, count // DEGREE), degree=DEGREE, refine=False) if by_unknowns else vc.Ritz()
    # load what small and large solves load
    vc.solve(film(1), vc.Ritz())
    vc.solve(film(1), vc.Ritz(elements=100, degree=DEGREE, refine=False))
    before = peak()
    began = time.perf_counter()
    solution = vc.solve(film(1 if by_unknowns else count), method, tol=1e-9, throw=False)
    whole = time.perf_counter() - began
    return {
        "family": family, "count": count, "unknowns": solution.stats.unknowns, "status": solution.status.name.lower(),
        "build_s": solution.stats.build, "solve_s": solution.stats.solve, "whole_s": whole, "before_mb": before,
        "peak_mb": peak(), "iterations": solution.stats.iterations, "error": solution.value - EXACT,
        "claimed": solution.error.value,
    }  # fmt: skip


def peak() -> float:
    """Peak of the resident memory of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measured(largest: int, repeats: int, store: Path) -> list[dict[str, Any]]:
    """All points, each the median of processes of its own, stored as they come."""
    points = [("unknowns", n) for n in UNKNOWNS if n <= largest] + [("functions", n) for n in FUNCTIONS]
    records = []
    for family, count in points:
        runs = []
        for _ in range(1 if count >= 10**6 else repeats):
            command = [sys.executable, __file__, "--one", family, str(count)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            runs.append(json.loads(done.stdout))
        times = ("build_s", "solve_s", "whole_s", "peak_mb", "before_mb")
        records.append(runs[0] | {key: statistics.median(run[key] for run in runs) for key in times})
        print(
            "{family:10s}{count:>9d}{unknowns:>9d}{whole_s:10.3f} s{peak_mb:9.0f} MB{error:+10.1e}".format(
                **records[-1]
            )
        )
        document = {"about": about(), "records": records}
        store.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return records


def picture(records: list[dict[str, Any]]) -> Figure:
    """Time above, memory beneath, against unknowns and against unknown functions; all axes logarithmic."""
    figure = Figure(figsize=(10, 7), layout="constrained", facecolor="white")
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, (family, across) in enumerate(zip(FAMILIES, ("unknowns", "unknown functions"), strict=True)):
        own = [r for r in records if r["family"] == family]
        at = [r["unknowns"] if family == "unknowns" else r["count"] for r in own]
        upper, lower = panels[0, column], panels[1, column]
        for name, key in (("build", "build_s"), ("solve", "solve_s"), ("whole call", "whole_s")):
            upper.plot(at, [r[key] for r in own], "o-", color=COLOUR[name], markersize=5, linewidth=1.4, label=name)
        slopes(upper, at, [r["whole_s"] for r in own], (1,) if column == 0 else (2,))
        lower.plot(at, [r["peak_mb"] for r in own], "o-", color=COLOUR["whole call"], markersize=5, linewidth=1.4)
        lower.axhline(min(r["before_mb"] for r in own), color=INK, linewidth=0.8, linestyle=(0, (2, 3)))
        lower.annotate(
            "before the solve", (0.99, min(r["before_mb"] for r in own)), xycoords=("axes fraction", "data"),
            ha="right", va="top", xytext=(0, -4), textcoords="offset points", fontsize=9, color=INK,
        )  # fmt: skip
        lower.set_xlabel(across, color=INK)
        for panel in (upper, lower):
            plain(panel)
            panel.set_xscale("log")
            panel.set_yscale("log")
    panels[1, 0].set_ylim(bottom=60)
    panels[0, 0].set_ylabel("seconds", color=INK)
    panels[1, 0].set_ylabel("peak of memory, MB", color=INK)
    panels[0, 0].legend(frameon=False, fontsize=9, labelcolor=INK)
    figure.suptitle("How a solve by Ritz grows", x=0.01, ha="left", fontsize=13, color=INK)
    return figure


def slopes(panel: Axes, at: list[float], seconds: list[float], powers: tuple[int, ...]) -> None:
    """Lines of growth by whole powers, beneath the last points."""
    for power in powers:
        back = [BENEATH * seconds[-1] * (x / at[-1]) ** power for x in at[len(at) // 2 :]]
        panel.plot(at[len(at) // 2 :], back, color=INK, linewidth=0.8, linestyle=(0, (2, 3)), zorder=1)
        panel.annotate(
            f"$\\propto n^{power}$" if power > 1 else "$\\propto n$", (at[len(at) // 2], back[0]), fontsize=9,
            color=INK, ha="right", va="center", xytext=(-3, 0), textcoords="offset points",
        )  # fmt: skip


def main() -> None:
    """Measure, store, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=UNKNOWNS[-1])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--store", type=Path, default=HERE / "records" / "growth.json")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "records" / "growth.png")
    parser.add_argument("--draw", type=Path, help="draw this file of records, measure nothing")
    parser.add_argument("--one", nargs=2, metavar=("FAMILY", "COUNT"), help="one point, in this process, as JSON")
    chosen = parser.parse_args()
    if chosen.one:
        print(json.dumps(measure(chosen.one[0], int(chosen.one[1]))))
        return
    if chosen.draw is None:
        records = measured(chosen.largest, chosen.repeats, chosen.store)
    else:
        records = json.loads(chosen.draw.read_text(encoding="utf-8"))["records"]
    picture(records).savefig(chosen.output, dpi=130)


if __name__ == "__main__":
    main()
