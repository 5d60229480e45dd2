"""A study of a scene: the rays of a source with their wavefronts and caustic, and every ray to a receiver.

A study is declared; :meth:`Study.run` carries it out and gives plain arrays, which pictures are drawn from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from varcalc.axes import Axis, measured, unit_of_length
from varcalc.optics.media.medium import Field, Medium
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.rays.sources import Source
from varcalc.optics.rays.tube import RayTube
from varcalc.optics.results.wavefronts import Caustic, Wavefront, caustic_of, ray_tubes, wavefront
from varcalc.optics.scene import Scene
from varcalc.optics.surfaces import Geometry, Surface
from varcalc.optics.validation import point
from varcalc.problem.conditions import functions, positive, real, text, whole
from varcalc.progress import Interrupted, Progress, Stage, telling
from varcalc.showing import Plotted, Shown, counted
from varcalc.spelling import spelled
from varcalc.tables import shown, table

TRACK_POINTS = 241
"""Points along a ray, evenly spaced in optical path, where they show how it bends."""
MOST_TRACK_POINTS = 7681
"""The same where it goes to and fro many times."""
OFF_CHORD = 4e-3
"""Of a ray's extent: how far a point may lie off the chord of its neighbours; what is drawn is off by a quarter."""
THINNEST = 1e-3
"""Of the longer side: what a picture shows at least of the other."""
BACKGROUND_POINTS = 160
"""Points of each side of the picture at which index and surfaces are looked at."""
MARGIN = 0.06
"""Of the extent of what is drawn, left free around it."""
FLAT_SIDES = 0.15
"""Ratio of the sides below which each has a margin, and a scale, of its own."""
FRONT_RAYS = 8
"""Rays of a wavefront for each ray of the study that is drawn."""


@spelled
@dataclass(frozen=True, repr=False)
class Study(Shown):
    """What is to be seen of a scene.

    Raises TypeError or ValueError for arguments that do not fit each other.

    Parameters
    ----------
    scene, source, rays, optical_path
        As for :func:`caustic`: the rays are followed to the optical path.
    receiver : sequence of float, optional
        A point of the last medium: every ray from the source to it is sought. The source must be a point.
    wavefronts : int
        How many wavefronts are drawn, at equal steps of the optical path.
    within : float, optional
        The optical path up to which rays to the receiver are looked for; see :meth:`Scene.rays`.
    title : str
    known : mapping of str to callable
        What is known of the rays of the scene: names, and functions that take the scene to the largest error against
        what is known, relative to its size.
    """

    scene: Scene
    source: Source
    rays: Any
    optical_path: float
    receiver: Sequence[float] | None = None
    wavefronts: int = 0
    within: float | None = None
    title: str = ""
    known: Mapping[str, Callable[[Scene], Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene):
            raise TypeError(f"Study.scene must be a Scene, not {self.scene!r}")
        if not isinstance(self.source, Source):
            raise TypeError(f"Study.source must be a PointSource or a PlaneWave, not {self.source!r}")
        positive("Study.optical_path", self.optical_path)
        whole("Study.wavefronts", self.wavefronts, 0)
        text("Study.title", self.title)
        functions("Study.known", self.known)
        if self.within is not None:
            positive("Study.within", self.within)
        if self.receiver is not None:
            point("Study.receiver", self.receiver)
            if not hasattr(self.source, "point") or hasattr(self.source, "direction"):
                raise ValueError("Study.receiver is reached from a point; give a PointSource, or no receiver")

    def run(self, *, progress: Progress = None) -> Seen:
        """Carry the study out.

        ``progress`` is as :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which
        holds what was seen by then.

        Raises ValueError as :func:`wavefront` and :meth:`Scene.rays` do.
        """
        parts: list[Any] = [[], None, []]
        steps = self._tubes, self._arrivals, self._fronts
        number = 0
        with telling(progress, self.title or "study") as told:

            def tell(what: str) -> None:
                told(number, len(steps), ", ".join(filter(None, (("rays", "arrivals", "wavefronts")[number], what))))

            try:
                for number, step in enumerate(steps):
                    tell("")
                    parts[number] = step(tell)
            except KeyboardInterrupt as stop:
                if isinstance(stop, Interrupted) and number < len(steps) - 1:  # of a bundle there is no front
                    parts[number] = stop.known
                raise Interrupted(self._seen(*parts)) from stop
        return self._seen(*parts)

    def _tubes(self, tell: Callable[[str], None]) -> list[RayTube]:
        def followed(done: int, what: str) -> None:
            tell(", ".join(filter(None, (f"{done} followed", what))))

        return ray_tubes(self.scene, self.source, self.rays, self.optical_path, Stage(followed))

    def _arrivals(self, tell: Callable[[str], None]) -> Rays | None:
        if self.receiver is None:
            return None
        start = self.source.starts(1)[0][0]
        return self.scene.rays(start, self.receiver, within=self.within, progress=lambda *told: tell(told[2]))

    def _seen(self, tubes: Sequence[RayTube], arrivals: Rays | None, fronts: Sequence[Wavefront]) -> Seen:
        return Seen(
            study=self,
            tracks=tuple(Track.of(tube) for tube in tubes if tube.legs),
            caustic=caustic_of(tubes, self.source.dimension),
            wavefronts=tuple(fronts),
            arrivals=arrivals,
            arriving=tuple(
                _track(ray.point, ray.optical_path, RayStatus.ARRIVED) for ray in arrivals or () if ray.legs
            ),
        )

    def errors(self) -> dict[str, float]:
        """By how much the rays of the scene miss what is known of them: the largest errors, by name.

        Raises TypeError where one of ``known`` gives no number.
        """
        return {name: real(f"Study.known[{name!r}]", missed(self.scene)) for name, missed in self.known.items()}

    def _fronts(self, tell: Callable[[str], None]) -> list[Wavefront]:
        rays = _denser(self.rays)
        steps = self.optical_path * np.arange(1, self.wavefronts + 1) / self.wavefronts if self.wavefronts else []
        return [
            wavefront(self.scene, self.source, rays, float(path), progress=lambda *told: tell(told[2]))
            for path in steps
        ]


@dataclass(frozen=True)
class Track:
    """A ray as it is drawn: points (k, d) in the order they are passed, and how it ended."""

    points: np.ndarray
    status: RayStatus

    @classmethod
    def of(cls, tube: RayTube) -> Track:
        """The whole of a ray that was followed."""
        return _track(tube.point, tube.optical_path, tube.status)


@dataclass(frozen=True)
class Background:
    """What the rays go through, on a grid: first coordinates (w,), last coordinates (h,).

    ``index`` (h, w) is None where there are several media; ``levels`` holds for each surface its level (h, w), zero
    on it, and not a number where the surface does not reach.
    """

    across: np.ndarray
    up: np.ndarray
    index: np.ndarray | None
    levels: tuple[np.ndarray, ...]
    mirrors: tuple[bool, ...]


@dataclass(frozen=True, repr=False)
class Seen(Plotted):
    """What a study has found.

    Attributes
    ----------
    study : Study
    tracks, arriving : tuple of Track
        The rays of the source, and those to the receiver.
    caustic : Caustic
    wavefronts : tuple of Wavefront
    arrivals : Rays or None
        Every ray to the receiver; None where there is no receiver.
    """

    study: Study
    tracks: tuple[Track, ...]
    caustic: Caustic
    wavefronts: tuple[Wavefront, ...]
    arrivals: Rays | None
    arriving: tuple[Track, ...]

    @cached_property
    def errors(self) -> dict[str, float]:
        """See :meth:`Study.errors`."""
        return self.study.errors()

    def background(self) -> Background:
        """Index and surfaces where the rays are, in the plane of the first and the last coordinate."""
        drawn = np.concatenate([track.points for track in (*self.tracks, *self.arriving)])
        return background(self.study.scene.media, self.study.scene.surfaces, drawn)

    @property
    def unit(self) -> str:
        """The unit of optical paths, as the scene declares it."""
        return unit_of_length(self.study.scene.axes(self.study.source.dimension))

    def table(self) -> str:
        """The rays to the receiver, and how the others ended, in plain text."""
        counts = Counter(track.status for track in self.tracks)
        ended = ", ".join(f"{count} {status.name.lower().replace('_', ' ')}" for status, count in counts.items())
        path = self.study.optical_path
        rays = counted(len(self.tracks), "ray")
        lines = [f"{rays} up to an optical path of {measured(f'{path:g}', self.unit)}: {ended}"]
        if len(self.caustic):
            lines.append(f"{counted(len(self.caustic), 'conjugate point')} on them")
        if self.arrivals is not None:
            lines += ["", *_arrival_lines(self.arrivals, self.study.receiver)]
        if self.errors:
            lines += ["", *(f"{name}: missed by {error:.1e}" for name, error in self.errors.items())]
        return "\n".join(lines)

    def document(self) -> dict[str, Any]:
        """The same as what JSON can hold."""
        rays = [
            {
                "optical_path": ray.optical_path, "error": ray.error, "index": ray.index,
                "spreading": ray.spreading, "degenerate": ray.degenerate, "model": ray.model,
                "departure": ray.tangents[0].tolist(), "arrival": ray.tangents[1].tolist(),
                "conjugate_points": ray.conjugate_points.tolist(),
            }
            for ray in self.arrivals or ()
        ]  # fmt: skip
        return {
            "title": self.study.title,
            "rays": Counter(track.status.name for track in self.tracks),
            "caustic": self.caustic.points.tolist(),
            "receiver": None if self.study.receiver is None else list(self.study.receiver),
            "arrivals": rays,
            "errors": self.errors,
            "reason": "" if self.arrivals is None else self.arrivals.reason,
            "searched": "" if self.arrivals is None else self.arrivals.searched,
        }


def background(media: Sequence[Medium], surfaces: Sequence[Surface], drawn: np.ndarray) -> Background:
    """Index and surfaces about points (m, d) of rays, in the plane of the first and the last coordinate."""
    d = drawn.shape[1]
    low, high = drawn.min(0)[[0, -1]], drawn.max(0)[[0, -1]]
    extent = np.maximum(high - low, THINNEST * float((high - low).max()) or 1.0)
    room = MARGIN * np.where(extent.min() < FLAT_SIDES * extent.max(), extent, extent.max())
    across, up = (np.linspace(a, b, BACKGROUND_POINTS) for a, b in zip(low - room, high + room, strict=True))
    plane = np.zeros((len(up), len(across), d))
    plane[:] = np.median(drawn, axis=0)
    plane[..., 0], plane[..., -1] = np.meshgrid(across, up)
    flat = plane.reshape(-1, d)
    index = None
    if len(media) == 1:
        index = Field(media[0], d).index(flat).reshape(plane.shape[:2])
    levels = tuple(_level(surface, flat).reshape(plane.shape[:2]) for surface in surfaces)
    return Background(across, up, index, levels, tuple(surface.mirror for surface in surfaces))


def _track(at: Any, path: float, status: RayStatus) -> Track:
    """The points of a ray at equal steps of its optical path, so close that its bends look round."""
    count = TRACK_POINTS
    while True:
        points = at(np.linspace(0.0, path, count))
        off, extent = np.abs(points[1:-1:2] - (points[:-2:2] + points[2::2]) / 2), np.ptp(points, axis=0)
        if count >= MOST_TRACK_POINTS or not (off > OFF_CHORD * np.maximum(extent, THINNEST * extent.max())).any():
            return Track(points, status)
        count = 2 * count - 1


def _denser(rays: Any) -> Any:
    """More rays of the same kind, for wavefronts that are to look smooth: between those given, in their order."""
    if isinstance(rays, int):
        return FRONT_RAYS * rays
    given = np.asarray(rays, dtype=float)
    if len(given) < 2:
        return rays
    places = np.linspace(0, len(given) - 1, FRONT_RAYS * (len(given) - 1) + 1)
    columns = given.reshape(len(given), -1).T
    between = np.column_stack([np.interp(places, np.arange(len(given)), column) for column in columns])
    return between.reshape(-1, *given.shape[1:])


def _level(surface: Surface, points: np.ndarray) -> np.ndarray:
    """The level of a surface at points (m, d); not a number where it does not reach."""
    geometry = Geometry(surface, points.shape[1])
    with np.errstate(all="ignore"):
        level = np.asarray(geometry.level(points), dtype=float)
        return np.where(geometry.belongs(points), level, np.nan)


def _arrival_lines(arrivals: Rays, receiver: Sequence[float] | None) -> list[str]:
    where = "(" + ", ".join(f"{x:g}" for x in receiver or ()) + ")"
    if not len(arrivals):
        return [f"no ray to {where}: {arrivals.reason}"]
    lines = [f"{len(arrivals)} ray{'s' * (len(arrivals) > 1)} to {where}, of {arrivals.searched}", ""]
    headings = (str(Axis("optical path", unit_of_length(arrivals.axes))), "error", "caustics", "spreading")
    return [*lines, table((), headings, map(_arrival_cells, arrivals), last=("direction",))]


def _arrival_cells(ray: Ray) -> tuple[str, ...]:
    ahead = ", ".join(f"{x:.6f}" for x in ray.tangents[0])
    note = "  on a caustic" if ray.degenerate else ""
    numbers = (ray.optical_path, ".14g"), (ray.error, ".1e"), (ray.index, "d"), (ray.spreading, ".6g")
    return *(shown(value, form) for value, form in numbers), f"({ahead}){note}"
