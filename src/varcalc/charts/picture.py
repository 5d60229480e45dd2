"""The picture of any object that can be drawn, by its class: what ``plot()`` gives."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any

from matplotlib.figure import Figure

from varcalc.charts.comparison import comparison_picture
from varcalc.charts.curves import branch_drawing, extremals_drawing, solution_drawing, sweep_drawing
from varcalc.charts.drawing import drawing_picture
from varcalc.charts.motion import (
    closed_orbit_picture,
    ensemble_drawing,
    motion_of_picture,
    motion_picture,
    rigid_drawing,
)
from varcalc.charts.rays import bundle_picture, found_rays_picture, range_picture, ray_picture, rays_picture
from varcalc.charts.scattering import scattering_drawing
from varcalc.charts.spread import work_precision_picture
from varcalc.charts.stability import stability_drawing
from varcalc.mechanics import ClosedOrbit, Ensemble, Motion, Moved, RigidMotion, Scattering, StabilityChart
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


def _drawn(drawing: Callable[[Any], Drawing]) -> Callable[[Any], Figure]:
    """The picture of what ``drawing`` makes panels of."""
    return lambda shown: drawing_picture(drawing(shown))


def _of_measurements(shown: WorkPrecision) -> Figure:
    return work_precision_picture(shown.records)


for kind, draw in {
    Drawing: drawing_picture, Solution: _drawn(solution_drawing), Extremals: _drawn(extremals_drawing),
    Branch: _drawn(branch_drawing), Sweep: _drawn(sweep_drawing), Comparison: comparison_picture,
    WorkPrecision: _of_measurements, Motion: motion_of_picture, Moved: motion_picture,
    ClosedOrbit: closed_orbit_picture, Ensemble: _drawn(ensemble_drawing), RigidMotion: _drawn(rigid_drawing),
    Scattering: _drawn(scattering_drawing), StabilityChart: _drawn(stability_drawing), Ray: ray_picture,
    Rays: found_rays_picture, Bundle: bundle_picture, Seen: rays_picture, RangeChart: range_picture,
}.items():  # fmt: skip
    picture.register(kind, draw)
