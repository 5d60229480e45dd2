"""A scene: what rays go through. Its two questions are ``trace`` and ``rays``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from varcalc.functional import named
from varcalc.optics.bundle import Bundle
from varcalc.optics.caravan import CHUNK, Sources, carried
from varcalc.optics.march import March
from varcalc.optics.media import Medium
from varcalc.optics.model import Model, Question
from varcalc.optics.models import checked_model
from varcalc.optics.plane import Section, section, whole_plane
from varcalc.optics.ray import Rays
from varcalc.optics.surfaces import Geometry, Surface
from varcalc.optics.two_point import Ends, TwoPoint
from varcalc.optics.values import numbers, point, rows, unit_rows

KEPT = 16
"""Ends of bundles for which compiled systems are kept."""
PAIRS = 4096
"""Pairs of points searched for together."""
RANGE = 5.0
"""Rays are looked for up to so many times the optical length of the scene."""
ON = 1e-12
"""A point is on a surface when it is no farther from it than this share of the scene's size."""


class Scene:
    """Media and the surfaces between them.

    Parameters
    ----------
    media : Medium or sequence of Medium
        In the order in which a ray from the source meets them: one more than there are surfaces. The medium after
        a mirror is that before it, and need not be repeated.
    surfaces : sequence of Surface, optional
        In the order in which a ray meets them.
    wavelength : float, optional
        In micrometres, in vacuum, for media with dispersion.

    Raises
    ------
    TypeError, ValueError
        Where the media and surfaces do not fit each other.

    Examples
    --------
    A plane wave is focused by a Luneburg lens to a point of its rim.

    >>> from varcalc import optics
    >>> scene = optics.Scene(optics.luneburg())
    >>> bundle = scene.trace([(-0.8, 0.6), (-1.0, 0.0)], [(1, 0), (1, 0)], until=optics.Sphere((0, 0), 1.0))
    >>> bundle.points.round(12) + 0.0
    array([[1., 0.],
           [1., 0.]])
    """

    def __init__(
        self,
        media: Medium | Sequence[Medium],
        surfaces: Surface | Sequence[Surface] = (),
        *,
        wavelength: float | None = None,
    ) -> None:
        self.surfaces = (surfaces,) if isinstance(surfaces, Surface) else tuple(surfaces)
        given = (media,) if isinstance(media, Medium) else tuple(media)
        for name, kind, items in (("media", Medium, given), ("surfaces", Surface, self.surfaces)):
            for item in items:
                if not isinstance(item, kind):
                    raise TypeError(
                        f"{name} must hold members of varcalc.optics such as Uniform or Plane, not {item!r}"
                    )
        self.wavelength = wavelength
        if wavelength is not None:
            if not (numbers("wavelength", wavelength).ndim == 0 and wavelength > 0):
                raise ValueError(f"wavelength must be one positive number, in micrometres, not {wavelength!r}")
            given = tuple(medium.at_wavelength(wavelength) for medium in given)
        self.media = _one_more(given, self.surfaces)
        dimensions = {item.dimension for item in (*self.media, *self.surfaces)} - {None}
        if len(dimensions) > 1:
            raise ValueError(
                "the scene has parts in the plane and parts in space; give all points 2 or all 3 coordinates"
            )
        self.dimension = dimensions.pop() if dimensions else None
        self._problems: dict[tuple[str, Model | None], TwoPoint] = {}  # what has been compiled
        self._marches: dict[tuple[Surface | None, int, Model | None], March] = {}

    def __repr__(self) -> str:
        return f"Scene({list(self.media)}, {list(self.surfaces)})"

    def at_wavelength(self, wavelength: float) -> Scene:
        """The scene in light of ``wavelength``, in micrometres in vacuum."""
        return Scene(self.media, self.surfaces, wavelength=wavelength)

    def with_parameters(self, values: Mapping[str, float]) -> Scene:
        """The scene for other values of its media's and surfaces' parameters.

        Raises ValueError for a name that none of them has.
        """
        values = named("parameters", values)
        known = {name for part in (*self.media, *self.surfaces) for name in part.parameters}
        if values.keys() - known:
            raise ValueError(f"{sorted(values.keys() - known)} are no parameters of this scene; it has {sorted(known)}")
        media = [m.with_parameters({k: v for k, v in values.items() if k in m.parameters}) for m in self.media]
        surfaces = [s.with_parameters({k: v for k, v in values.items() if k in s.parameters}) for s in self.surfaces]
        return Scene(media, surfaces, wavelength=self.wavelength)

    def trace(
        self,
        points: Any,
        directions: Any,
        *,
        optical_path: Any = None,
        until: Surface | None = None,
        with_spreading: bool = False,
        wavelength: float | None = None,
        model: Model | None = None,
        progress: bool | None = None,
    ) -> Bundle:
        """Carry a bundle of rays through the scene, each with steps, an end and a status of its own.

        Parameters
        ----------
        points, directions : array_like, shape (m, d) or (d,)
            Where the rays start and which way; one point serves for all directions, and one direction for all
            points. Directions need not have length one.
        optical_path : float or array_like, shape (m,)
            The optical path ∫ n ds at which to stop.
        until : Surface
            The surface at which to stop. Exactly one of the two is given.
        with_spreading : bool
            Whether to carry d - 1 neighbours of each ray along, which costs about three times as much.
        wavelength : float, optional
            That of the light, in micrometres in vacuum, if it is another than the scene's.
        model : Model, optional
            What carries the rays, such as ``optics.Invariants()``; the cheapest that applies in each medium when
            left out. The answer names it.
        progress : bool, optional
            Whether to show a bar on standard error; when left out, for long work on a terminal.

        Returns
        -------
        Bundle

        Raises
        ------
        TypeError, ValueError
            For arguments that do not fit the scene: a source on a surface or where the index is not positive, a
            direction of length zero, no stop or two. :class:`DoesNotApply`, a ValueError, for a model that cannot
            treat the scene.

        Notes
        -----
        Beside the results and the checked sources, some 150 bytes a ray in space, memory is bounded: 65536 rays
        are on their way at once, spread over the cores.
        """
        if wavelength is not None:
            return self.at_wavelength(wavelength).trace(
                points,
                directions,
                optical_path=optical_path,
                until=until,
                with_spreading=with_spreading,
                model=model,
                progress=progress,
            )
        start, heading = self._sources(points, directions)
        if (optical_path is None) == (until is None):
            raise ValueError("give either optical_path= or until=, to say where the rays are to stop")
        if until is not None and not isinstance(until, Surface):
            raise TypeError(f"until must be a surface such as Plane or Sphere, not {until!r}")
        limit = _limits(optical_path, len(start))
        index = self._index_at_source(start)
        march = self._march(until, start.shape[1], checked_model(model))
        on_stop = np.zeros(len(start), bool) if until is None else _on(until, start)
        sources = Sources(start, heading, index, limit, on_stop)
        return carried(march, sources, with_spreading=with_spreading, progress=progress)

    def rays(
        self, A: Any, B: Any, *, within: float | None = None, wavelength: float | None = None,
        model: Model | None = None,
    ) -> Rays:  # fmt: skip
        """All rays from A to B, each polished to round-off, none twice and none false.

        Every direction is searched. In space, unless the medium keeps rays in a plane, as layers and a centre do,
        that is a net of directions, and rays in whose neighbourhood it is too coarse may be missed. Where there
        are infinitely many rays, by winding, the optical path limits the search.

        Parameters
        ----------
        A, B : array_like, shape (d,)
            The source, in the first medium, and the point to reach, in the last.
        within : float, optional
            The optical path up to which rays are looked for; a multiple of the optical distance of A and B, and of
            the lengths over which the index changes there, when left out. It is stated in ``searched``.
        wavelength : float, optional
            That of the light, in micrometres in vacuum, if it is another than the scene's.
        model : Model, optional
            What finds and carries the rays, such as ``optics.Invariants()``; the cheapest that applies in each medium
            when left out. Each ray names it.

        Returns
        -------
        Rays
            A sequence, the shortest optical path first; empty, with a ``reason``, where there is none.

        Raises
        ------
        TypeError, ValueError
            For A = B, a source on a surface or where the index is not positive. :class:`DoesNotApply`, a ValueError,
            for a model that cannot treat the scene.

        Examples
        --------
        Two rays meet the far point of a parabolic profile's floor, one of them after touching the caustic.

        >>> import casadi as ca
        >>> from varcalc import optics
        >>> rays = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))).rays((0, 0), (0.5, 0))
        >>> [(round(ray.optical_path, 12), ray.index) for ray in rays]
        [(0.494521305498, 0), (0.730223565894, 1)]
        """
        if wavelength is not None:
            return self.at_wavelength(wavelength).rays(A, B, within=within, model=model)
        if np.array(A).ndim != 1 or np.array(B).ndim != 1:
            A, B = point("A", A), point("B", B)
        return self._arrivals("A", A, "B", B, within, model)[0]

    def arrivals(
        self, sources: Any, receivers: Any, *, within: float | None = None, wavelength: float | None = None,
        model: Model | None = None,
    ) -> list[Rays]:  # fmt: skip
        """All rays of many pairs of points: what :meth:`rays` gives, one answer for each pair, in one search.

        The rays of a source are shared by all the receivers it is paired with, so that thousands of receivers of
        one source take not much longer than a few.

        Parameters
        ----------
        sources, receivers : array_like, shape (k, d) or (d,)
            The ends of each pair; one source serves for all receivers, and one receiver for all sources.
        within : float, optional
            As for :meth:`rays`, for all pairs.
        wavelength : float, optional
            That of the light, in micrometres in vacuum, if it is another than the scene's.
        model : Model, optional
            As for :meth:`rays`; one that searches by itself, as ``Fermat`` does, goes from pair to pair.

        Returns
        -------
        list of Rays

        Raises
        ------
        TypeError, ValueError
            As :meth:`rays` does, naming the row.

        Examples
        --------
        >>> import casadi as ca
        >>> from varcalc import optics
        >>> scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
        >>> [len(rays) for rays in scene.arrivals((0, 0), [(0.5, 0), (0.9, 0), (1.0, 0), (1.1, 0)])]
        [2, 2, 1, 0]
        """
        if wavelength is not None:
            return self.at_wavelength(wavelength).arrivals(sources, receivers, within=within, model=model)
        return self._arrivals("sources", sources, "receivers", receivers, within, model)

    def _arrivals(self, source: str, A: Any, receiver: str, B: Any, within: Any, model: Any) -> list[Rays]:
        """The rays of each pair; the arguments go by the names ``source`` and ``receiver`` in messages."""
        starts, ends = self._pairs(source, A, receiver, B)
        if within is not None and not (numbers("within", within).ndim == 0 and within > 0):
            raise ValueError(f"within must be a positive optical path, not {within!r}")
        limit = self._usual_range(starts, ends) if within is None else np.full(len(starts), float(within))
        index = self._march(None, ends.shape[1]).fields[-1].index(ends)
        real = (index > 0) & np.isfinite(index)
        answers = [Rays((), f"the index is {n:g} at B, so that no ray comes there", "nothing") for n in index]
        order = np.lexsort(starts.T)
        order = order[real[order]]
        for first in range(0, len(order), PAIRS):
            rows = order[first : first + PAIRS]
            found = self._found(Ends(starts[rows], ends[rows], limit[rows]), checked_model(model))
            for row, rays in zip(rows, found, strict=True):
                answers[row] = rays
        return answers

    def _pairs(self, source: str, A: Any, receiver: str, B: Any) -> tuple[np.ndarray, np.ndarray]:
        """A and B as arrays (k, d), checked."""
        a, b = rows(source, A), rows(receiver, B)
        if a.shape[1] != b.shape[1] or self.dimension not in (None, a.shape[1]):
            raise ValueError(
                f"{source} has {a.shape[1]} coordinates, {receiver} {b.shape[1]}, "
                f"the scene {self.dimension or 'either number'}"
            )
        if len(a) != len(b) and 1 not in (len(a), len(b)):
            raise ValueError(f"there are {len(a)} {source} and {len(b)} {receiver}; give as many of both, or one")
        k = max(len(a), len(b)) if min(len(a), len(b)) else 0
        a, b = (np.array(np.broadcast_to(ends, (k, ends.shape[1]))) for ends in (a, b))
        same = np.all(a == b, axis=1)
        if np.any(same):
            raise ValueError(
                f"{source} and {receiver} are the same point{_row(same)}, which every direction leaves; give two points"
            )
        for name, end in ((source, a), (receiver, b)):
            for number, surface in enumerate(self.surfaces):
                on = _on(surface, end)
                if np.any(on):
                    raise ValueError(
                        f"{name} lies on surface {number} of the scene{_row(on)}; move it off by any amount"
                    )
        self._index_at_source(a)
        return a, b

    def _found(self, ends: Ends, model: Model | None) -> list[Rays]:
        """The rays of each of the pairs, by the model's own search where it has one, by the scene's otherwise."""
        problem, planes = self._problem(ends, model.companion if model else None)
        if model is None:
            return problem.found(ends, planes)
        answers: list[Rays | None] = []
        for k, (a, b, within) in enumerate(zip(ends.sources, ends.targets, ends.within, strict=True)):
            one = ends.take([k]), [planes[k]] if planes else []
            search, ray = (lambda one=one: problem.found(*one)[0]), partial(problem.ray, a, b)
            answers.append(model.between(Question(self.media, self.surfaces, a, b, float(within), ray, search)))
        left = [k for k, answer in enumerate(answers) if answer is None]
        rest = iter(problem.found(ends.take(left), [planes[k] for k in left] if planes else []) if left else [])
        return [next(rest) if answer is None else answer for answer in answers]

    def _problem(self, ends: Ends, model: Model | None) -> tuple[TwoPoint, list[Section]]:
        """The problem of the pairs, and the planes that hold the rays of each; no planes where there are none."""
        if ends.sources.shape[1] == 2:
            march = self._march(None, 2, model)
            return self._problems.setdefault(("plane", model), TwoPoint(march, march)), [whole_plane()] * len(ends)
        pairs = zip(ends.sources, ends.targets, strict=True)
        found = [section(self.media[0], a, b) for a, b in pairs] if len(self.media) == 1 else []
        planes = [plane for plane, _ in filter(None, found)]
        march = self._march(None, 3, model)
        if not planes:
            return self._problems.setdefault(("sphere", model), TwoPoint(march, march)), planes
        if ("space", model) not in self._problems:
            _, medium = next(filter(None, found))
            self._problems["space", model] = TwoPoint(March((medium,), (), None, 2, model), march)
        return self._problems["space", model], planes

    def _usual_range(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The optical paths (k,) up to which rays are looked for when nobody says."""
        lengths, largest = [np.linalg.norm(b - a, axis=1)], np.zeros(len(a))
        fields = self._march(None, a.shape[1]).fields
        for field, end in ((fields[0], a), (fields[-1], b)):
            squared, gradient, hessian = field(end)
            with np.errstate(all="ignore"):
                largest = np.fmax(largest, np.sqrt(squared))
                first = 2 * squared / np.linalg.norm(gradient, axis=1)
                second = np.sqrt(2 * squared / np.linalg.norm(hessian, axis=(1, 2)))
            lengths.append(np.minimum(first, second))
        for surface in self.surfaces:
            lengths += [_away(surface, a), _away(surface, b)]
        return RANGE * largest * sum(np.where(np.isfinite(length), length, 0.0) for length in lengths)

    def _march(self, until: Surface | None, dimension: int, model: Model | None = None) -> March:
        """The way through the scene; what has been compiled for it is kept, for a number of ends."""
        key = until, dimension, model
        if key not in self._marches:
            if len(self._marches) >= KEPT:
                self._marches.pop(next(iter(self._marches)))
            self._marches[key] = March(self.media, self.surfaces, until, dimension, model)
        return self._marches[key]

    def _sources(self, points: Any, directions: Any) -> tuple[np.ndarray, np.ndarray]:
        """Points and unit directions, as many of the one as of the other, off every surface."""
        start = rows("points", points, self.dimension)
        heading = unit_rows("directions", directions, start.shape[1])
        if len(start) != len(heading) and 1 not in (len(start), len(heading)):
            raise ValueError(
                f"there are {len(start)} points and {len(heading)} directions; give as many of both, or one"
            )
        m = len(heading) if len(start) == 1 else len(start)
        start, heading = (np.broadcast_to(a, (m, start.shape[1])) for a in (start, heading))
        for number, surface in enumerate(self.surfaces):
            on = _on(surface, start)
            if np.any(on):
                raise ValueError(
                    f"points: row {int(np.argmax(on))} lies on surface {number} of the scene, so that it is not said "
                    "which side the ray starts from; move it off by any amount"
                )
        return start, heading

    def _index_at_source(self, start: np.ndarray) -> np.ndarray:
        """n (m,) where the rays start; ValueError where it is no positive number."""
        index = _by_chunks(self._march(None, start.shape[1]).fields[0].index, start)
        bad = ~((index > 0) & np.isfinite(index))
        if np.any(bad):
            row = int(np.argmax(bad))
            raise ValueError(
                f"the index is {index[row]:g} at the source {tuple(start[row].tolist())}; rays start only "
                "where the index is a positive number"
            )
        return index


def _one_more(media: Sequence[Medium], surfaces: Sequence[Surface]) -> tuple[Medium, ...]:
    """One medium before the first surface and one after each; those after mirrors filled in."""
    mirrors = sum(surface.mirror for surface in surfaces)
    if len(media) == len(surfaces) + 1:
        full = tuple(media)
    elif len(media) == len(surfaces) + 1 - mirrors:
        rest = iter(media)
        full = (next(rest),)
        for surface in surfaces:
            full += (full[-1] if surface.mirror else next(rest),)
    else:
        raise ValueError(
            f"{len(surfaces)} surfaces, {mirrors} of them mirrors, need {len(surfaces) + 1} media, "
            f"or {len(surfaces) + 1 - mirrors} when those after mirrors are left out; there are {len(media)}"
        )
    for number, surface in enumerate(surfaces):
        if surface.mirror and full[number] != full[number + 1]:
            raise ValueError(f"surface {number} is a mirror, so the medium after it must be that before it")
    return full


def _extent(points: np.ndarray) -> float:
    """The size of a scene seen from the points of its sources."""
    return max(float(points.max(initial=0.0)), -float(points.min(initial=0.0))) or 1.0


def _by_chunks(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """``function`` (m,) of points (m, d), so many at a time; of one that is there m times, once."""
    if points.strides[0] == 0:
        return np.broadcast_to(function(points[:1]), len(points))
    return np.concatenate([function(points[k : k + CHUNK]) for k in range(0, len(points), CHUNK)] or [np.zeros(0)])


def _on(surface: Surface, points: np.ndarray) -> np.ndarray:
    """True (m,) for points on ``surface`` to round-off."""
    geometry, within = Geometry(surface, points.shape[1]), ON * _extent(points)

    def on(some: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return (_distance(geometry, some) <= within) & geometry.belongs(some)

    return _by_chunks(on, points).astype(bool)


def _away(surface: Surface, points: np.ndarray) -> np.ndarray:
    """The distance (m,) of points from ``surface``, to first order; not a number where its level is none."""
    return _distance(Geometry(surface, points.shape[1]), points)


def _distance(geometry: Geometry, points: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        return np.abs(geometry.level(points)) / np.linalg.norm(geometry.gradient(points), axis=1)


def _row(which: np.ndarray) -> str:
    """Where the first of the rows is, for a message; nothing where there is only one."""
    return f" in row {int(np.argmax(which))}" if len(which) > 1 else ""


def _limits(optical_path: Any, count: int) -> np.ndarray:
    """The optical path (m,) at which each ray stops, infinite where none is given."""
    if optical_path is None:
        return np.full(count, np.inf)
    limit = numbers("optical_path", optical_path)
    if limit.shape not in ((), (count,)):
        raise ValueError(
            f"optical_path must be one number or one for each of the {count} rays, not of shape {limit.shape}"
        )
    if np.any(limit < 0):
        raise ValueError("optical_path must not be negative; turn the directions round to go back")
    return np.broadcast_to(limit, (count,))
