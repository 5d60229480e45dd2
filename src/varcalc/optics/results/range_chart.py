"""The range chart: how far from a source its rays come to a height, against the angle at which they leave.

Where the curve of a crossing passes the receiver's distance there is an
arrival; where it turns round, a caustic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.optics.media.medium import Field
from varcalc.optics.rays.ray import Rays
from varcalc.optics.scene import Scene
from varcalc.optics.surfaces import Plane
from varcalc.optics.validation import point
from varcalc.problem.conditions import numbers, told, whole
from varcalc.showing import Plotted
from varcalc.spelling import spelled

DEFAULT_ANGLES = 720
"""Angles looked at by default, half a degree apart."""
OFF_AXIS = 1e-3
"""Radians by which they are turned: a ray that leaves along the receiver's height touches it at once."""


@dataclass(frozen=True, repr=False, eq=False)
class RangeChart(Plotted):
    """Reach against launching angle.

    Attributes
    ----------
    angles : ndarray, shape (m,)
        Launching angles above the horizontal, in radians.
    reach : ndarray, shape (m, k)
        The first coordinate at the first, second, ... crossing of the receiver's height; not a number where there is
        none.
    momentum : ndarray, shape (m,)
        p = n cos(angle), which is constant along rays through horizontal layers.
    receiver : tuple of float
    arrivals : Rays
        Every ray to the receiver.
    """

    angles: np.ndarray
    reach: np.ndarray
    momentum: np.ndarray
    receiver: tuple[float, float]
    arrivals: Rays


@spelled
def range_chart(
    scene: Scene,
    source: Sequence[float],
    receiver: Sequence[float],
    *,
    angles: np.ndarray | None = None,
    crossings: int = 2,
    within: float | None = None,
) -> RangeChart:
    """The range chart of a source in a medium of the plane without surfaces, with all arrivals at a receiver.

    Raises TypeError or ValueError for a scene with surfaces or in space, and as :meth:`Scene.rays` does.

    Parameters
    ----------
    scene : Scene
        In the plane, of one medium; heights are the last coordinate.
    source, receiver : sequence of two floats
    angles : array_like, shape (m,), optional
        Launching angles in radians, all round by default.
    crossings : int
        How many crossings of the receiver's height are followed.
    within : float, optional
        The optical path up to which rays are looked for and up to which they are followed from one crossing to the
        next; :meth:`Scene.usual_range` when left out.

    Examples
    --------
    A stone thrown at 45 degrees comes farthest, as does a ray where n² = 1 - 2y.

    >>> import casadi as ca
    >>> from varcalc import optics
    >>> scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    >>> chart = optics.range_chart(scene, (0, 0), (0.5, 0), angles=np.radians([15, 45, 75]), crossings=1)
    >>> chart.reach.ravel().round(12)
    array([0.5, 1. , 0.5])
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a Scene, not {told(scene)}")
    start, target = np.array(point("source", source)), point("receiver", receiver)
    if scene.surfaces or len(start) != 2 or scene.dimension == 3:
        raise ValueError("a range chart is drawn of one medium in the plane; the scene has surfaces, or is in space")
    whole("crossings", crossings)
    arrivals = scene.rays(start, target, within=within)
    farthest = scene.usual_range(start, target) if within is None else float(within)
    tried = (
        np.linspace(-np.pi, np.pi, DEFAULT_ANGLES, endpoint=False) + OFF_AXIS
        if angles is None
        else np.atleast_1d(numbers("angles", angles))
    )
    return RangeChart(
        angles=tried,
        reach=_reach(scene, start, target[1], tried, crossings, farthest),
        momentum=float(Field(scene.media[0], 2).index(start[None])[0]) * np.cos(tried),
        receiver=(target[0], target[1]),
        arrivals=arrivals,
    )


def _reach(
    scene: Scene, start: np.ndarray, height: float, angles: np.ndarray, crossings: int, farthest: float
) -> np.ndarray:
    """The first coordinates (m, crossings) at which rays at ``angles`` (m,) cross a height, one time after another.

    A ray that goes round, or along, is not followed for ever: up to an optical path ``farthest`` for each crossing.
    """
    points = np.tile(start, (len(angles), 1))
    headings = np.column_stack([np.cos(angles), np.sin(angles)])
    reach = np.full((len(angles), crossings), np.nan)
    plane, alive = Plane((0.0, height), (0.0, 1.0)), np.arange(len(angles))
    for number in range(crossings):
        bundle = scene.trace(points[alive], headings[alive], optical_path=farthest, until=plane)
        met = bundle.arrived
        alive = alive[met]
        if not len(alive):
            break
        points[alive], headings[alive] = bundle.points[met], bundle.directions[met]
        reach[alive, number] = points[alive, 0]
    return reach
