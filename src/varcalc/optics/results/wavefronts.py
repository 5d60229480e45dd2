"""Wavefronts and caustics of a source: the surfaces of equal optical path, and the envelope of the rays.

The optical path from the source is the eikonal S, with |∇S| = n, and its level
surfaces stand at right angles to the rays (Born and Wolf, "Principles of
Optics", sect. 3.1.1; Brizard, "An Introduction to Lagrangian Mechanics",
sect. 1.4). Rays that are infinitely near cross at their conjugate points,
zeros of the ray deviation equation (Brizard, eq. 1.50-1.51), which make up the
caustic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from varcalc.optics.media.medium import Field
from varcalc.optics.models.watch import Watch
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.rays.sources import Source
from varcalc.optics.rays.tube import RayTube
from varcalc.optics.scene import Scene
from varcalc.optics.validation import number, positive
from varcalc.problem.conditions import reals
from varcalc.progress import Interrupted, Progress, Stage
from varcalc.showing import Shown
from varcalc.spelling import spelled


@dataclass(frozen=True, repr=False, eq=False)
class Wavefront(Shown):
    """Points of equal optical path from a source, one row a ray.

    Attributes
    ----------
    points, normals : ndarray, shape (m, d)
        Where the rays are, and the unit vectors along them, at right angles to the wavefront.
    optical_path : float
        S on the wavefront, in units of length.
    status : ndarray of int, shape (m,)
        Members of :class:`RayStatus`: rays that have not arrived are not on the wavefront.
    """

    points: np.ndarray
    normals: np.ndarray
    optical_path: float
    status: np.ndarray

    @property
    def arrived(self) -> np.ndarray:
        """True (m,) for the rays that have come as far as the wavefront."""
        return self.status == RayStatus.ARRIVED


@dataclass(frozen=True, repr=False, eq=False)
class Caustic(Shown):
    """Points where neighbouring rays of a source cross, one row each: a curve in the plane, surfaces in space.

    Attributes
    ----------
    points : ndarray, shape (k, d)
        In the order of the rays, and along each ray.
    optical_path : ndarray, shape (k,)
        From the source to each.
    ray, order : ndarray of int, shape (k,)
        The row of the ray that touches the caustic there, and which of its conjugate points it is: 1, 2, ...
        Points of the same order make up one sheet.
    status : ndarray of int, shape (m,)
        How each ray ended: members of :class:`RayStatus`. One that comes to a singular index is followed to the last
        surface before only.
    """

    points: np.ndarray
    optical_path: np.ndarray
    ray: np.ndarray
    order: np.ndarray
    status: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


@spelled
def wavefront(scene: Scene, source: Source, rays: Any, optical_path: float, *, progress: Progress = None) -> Wavefront:
    """The wavefront of a source at an optical path.

    Raises TypeError or ValueError for a source on a surface, where the index is not positive, or of another dimension
    than the scene.

    Parameters
    ----------
    scene : Scene
    source : Source
        A :class:`PointSource` or a :class:`PlaneWave`.
    rays : int or array_like
        Which rays of the source: see there.
    optical_path : float
        In units of length; divided by the speed of light in vacuum it is the time since the wave left.
    progress : callable or bool, optional
        As for :meth:`Scene.trace`, and so is what Ctrl-C raises.

    Returns
    -------
    Wavefront

    Examples
    --------
    In a fish-eye the wavefronts of a point of the rim close on the point opposite, after π n0 a/2.

    >>> import numpy as np
    >>> from varcalc import optics
    >>> source = optics.PointSource((1, 0))
    >>> front = optics.wavefront(optics.Scene(optics.fish_eye()), source, [(0, 1), (-1, 1), (-1, -2)], np.pi)
    >>> bool(np.allclose(front.points, (-1, 0)))
    True
    """
    points, directions = _started(scene, source, rays)
    path = number("optical_path", optical_path)
    bundle = scene.trace(points, directions, optical_path=path, progress=progress)
    return Wavefront(bundle.points, bundle.directions, float(optical_path), bundle.status)


@spelled
def caustic(scene: Scene, source: Source, rays: Any, optical_path: float) -> Caustic:
    """The conjugate points on the rays of a source, up to an optical path, through surfaces as well.

    Parameters
    ----------
    scene, source, rays, optical_path
        As for :func:`wavefront`, and so are the errors raised; rays are followed to the optical path.

    Returns
    -------
    Caustic

    Examples
    --------
    Stones thrown with the same speed have an envelope, and so have rays where n² falls linearly.

    >>> import casadi as ca
    >>> from varcalc import optics
    >>> scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    >>> envelope = optics.caustic(scene, optics.PointSource((0, 0)), [(1, 1), (1, 2)], 2.0)
    >>> (envelope.points[:, 1] - (0.5 - envelope.points[:, 0] ** 2 / 2)).round(12) + 0.0
    array([0., 0.])
    """
    return caustic_of(ray_tubes(scene, source, rays, optical_path), source.dimension)


def caustic_of(tubes: Sequence[RayTube], dimension: int) -> Caustic:
    """The caustic that rays already followed with their neighbours touch."""
    found = [(*focus, row, k + 1) for row, tube in enumerate(tubes) for k, focus in enumerate(tube.foci)]
    return Caustic(
        points=np.array([position for _, position, _, _ in found]).reshape(-1, dimension),
        optical_path=np.array([path for path, _, _, _ in found]),
        ray=np.array([row for _, _, row, _ in found], dtype=int),
        order=np.array([order for _, _, _, order in found], dtype=int),
        status=np.array([int(tube.status) for tube in tubes], dtype=np.int8),
    )


@spelled
def ray_tube(scene: Scene, source: Source, ray: Any, optical_path: float) -> RayTube:
    """One ray of a source with its neighbours, up to an optical path: points, conjugate points and intensity along it.

    Parameters
    ----------
    scene, source, optical_path
        As for :func:`wavefront`, and so are the errors raised; the ray is followed to the optical path.
    ray : array_like
        The ray, as the source names it: a direction (d,); an offset, a number in the plane or (2,) in space.

    Returns
    -------
    RayTube

    Examples
    --------
    >>> import numpy as np
    >>> from varcalc import optics
    >>> tube = optics.ray_tube(optics.Scene(optics.Uniform(1.0)), optics.PointSource((0, 0, 0)), (1, 0, 0), 4.0)
    >>> tube.intensity(np.array([1.0, 2.0, 4.0])).values
    array([1.    , 0.25  , 0.0625])
    """
    [tube] = ray_tubes(scene, source, reals("ray", ray)[None], optical_path)
    return tube


def _started(scene: Any, source: Any, rays: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where the rays of a source start and which way; TypeError where scene or source is none."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be an optics.Scene, not {scene!r}")
    if not isinstance(source, Source):
        raise TypeError(f"source must be a PointSource or a PlaneWave, not {source!r}")
    return source.starts(rays)


def ray_tubes(
    scene: Scene, source: Source, rays: Any, optical_path: float, stage: Stage | None = None
) -> list[RayTube]:
    """Several rays of a source, each as :func:`ray_tube` gives it; arguments and errors are those of `wavefront`.

    A ``stage`` is told of them. Ctrl-C raises :class:`Interrupted`, which holds those that were followed by then.
    """
    stage = stage or Stage()
    points, directions = _started(scene, source, rays)
    scene.trace(points, directions, optical_path=0.0)  # goes nowhere, but refuses what cannot be traced
    positive("optical_path", optical_path)
    dimension = points.shape[1]
    propagator = Propagator(scene.media, scene.surfaces, None, dimension)
    beam = source.beam(Field(scene.media[0], dimension), points, directions)
    tubes: list[RayTube] = []
    try:
        for row in range(len(beam)):
            stage(row, "")
            watch = Watch(stage.later(row))
            legs, status = propagator.followed(beam.take(np.array([row])), float(optical_path), watch)
            tubes.append(RayTube(status, legs))
    except KeyboardInterrupt as stop:
        raise Interrupted(tubes) from stop
    return tubes
