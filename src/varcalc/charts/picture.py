"""The picture of any object that can be drawn, by its class: what ``plot()`` gives."""

from __future__ import annotations

from functools import singledispatch

from matplotlib.figure import Figure

from varcalc.charts.comparison import comparison_picture
from varcalc.charts.curves import branch_drawing, extremals_drawing, solution_drawing, sweep_drawing
from varcalc.charts.drawing import drawing_picture
from varcalc.charts.motion import closed_orbit_picture, ensemble_drawing, motion_of_picture, motion_picture
from varcalc.charts.rays import bundle_picture, found_rays_picture, range_picture, ray_picture, rays_picture
from varcalc.charts.spread import work_precision_picture
from varcalc.mechanics import ClosedOrbit, Ensemble, Motion, Moved
from varcalc.optics import Bundle, RangeChart, Ray, Rays, Seen
from varcalc.search import Branch, Extremals
from varcalc.solution import Solution
from varcalc.solve.sweep import Sweep
from varcalc.study.compare import Comparison
from varcalc.study.drawing import Drawing
from varcalc.study.records import WorkPrecision


@singledispatch
def picture(shown: object) -> Figure:
    """The picture of an object. Raises TypeError for one that has none, and ValueError where there is nothing to draw.

    Another class is drawn by ``picture.register``.
    """
    raise TypeError(f"there is no picture of a {type(shown).__name__}")


def _of_solution(shown: Solution) -> Figure:
    return drawing_picture(solution_drawing(shown))


def _of_extremals(shown: Extremals) -> Figure:
    return drawing_picture(extremals_drawing(shown))


def _of_branch(shown: Branch) -> Figure:
    return drawing_picture(branch_drawing(shown))


def _of_sweep(shown: Sweep) -> Figure:
    return drawing_picture(sweep_drawing(shown))


def _of_ensemble(shown: Ensemble) -> Figure:
    return drawing_picture(ensemble_drawing(shown))


def _of_comparison(shown: Comparison) -> Figure:
    return comparison_picture(shown)


def _of_range(shown: RangeChart) -> Figure:
    return range_picture(shown)


def _of_measurements(shown: WorkPrecision) -> Figure:
    return work_precision_picture(shown.records)


for kind, draw in {
    Drawing: drawing_picture, Solution: _of_solution, Extremals: _of_extremals, Branch: _of_branch, Sweep: _of_sweep,
    Comparison: _of_comparison, WorkPrecision: _of_measurements, Motion: motion_of_picture, Moved: motion_picture,
    ClosedOrbit: closed_orbit_picture, Ensemble: _of_ensemble, Ray: ray_picture, Rays: found_rays_picture,
    Bundle: bundle_picture, Seen: rays_picture, RangeChart: _of_range,
}.items():  # fmt: skip
    picture.register(kind, draw)
