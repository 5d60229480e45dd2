"""A scene: what rays go through. Its two questions are ``trace`` and ``rays``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from numbers import Real
from typing import Any

import casadi as ca
import numpy as np

from varcalc.axes import Axis, coordinates, declared_axes
from varcalc.optics.arrivals.search import PairSearch
from varcalc.optics.media.dispersion import Dispersion
from varcalc.optics.media.medium import Medium
from varcalc.optics.models.model import Model, checked_model
from varcalc.optics.propagation.bundle import Bundle, Starts, traced
from varcalc.optics.propagation.sequential import CompiledScene
from varcalc.optics.rays.ray import Rays
from varcalc.optics.surfaces import Surface, touched
from varcalc.optics.validation import how_far, matched, point, positive, rows, unit_rows
from varcalc.problem.conditions import is_vector, named, sequence, told
from varcalc.problem.reading import latex, text
from varcalc.progress import Interrupted, Progress
from varcalc.showing import Fact, Shown, brief, counted, line, listed
from varcalc.spelling import check_names, spelled

LONGEST = 120
"""Characters of the formula of an index."""
MOST_PARTS = 6
"""Media and surfaces that are told one by one."""


@spelled
class Scene(Shown):
    """Media and the surfaces between them.

    Raises TypeError or ValueError where the media and surfaces do not fit each other.

    Parameters
    ----------
    media : Medium or sequence of Medium
        In the order in which a ray from the source meets them: one more than there are surfaces. The medium after
        a mirror is that before it, and need not be repeated.
    surfaces : sequence of Surface, optional
        In the order in which a ray meets them.
    wavelength : float, optional
        In micrometres, in vacuum, for media with dispersion.
    names, units : sequence of str, optional
        Of the coordinates, 2 or 3, such as ``("range", "height")`` and ``("km", "km")``, for prints and pictures.

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
        names: Sequence[str] = (),
        units: Sequence[str] = (),
    ) -> None:
        given: tuple[Medium, ...] = _members("media", Medium, media)
        self.surfaces: tuple[Surface, ...] = _members("surfaces", Surface, surfaces)
        self.wavelength: float | None = None if wavelength is None else positive("wavelength", wavelength)
        if self.wavelength is not None:
            given = tuple(medium.at_wavelength(self.wavelength) for medium in given)
        self.media: tuple[Medium, ...] = _one_more(given, self.surfaces)
        dimensions = {item.dimension for item in (*self.media, *self.surfaces)} - {None}
        if len(dimensions) > 1:
            raise ValueError(
                "the scene has parts in the plane and parts in space; give all points 2 or all 3 coordinates"
            )
        self.dimension: int | None = dimensions.pop() if dimensions else None
        self.names: Sequence[str] = sequence("names", names)
        self.units: Sequence[str] = sequence("units", units)
        if self.names or self.units:
            self.dimension = _as_declared(self.dimension, len(self.names or self.units))
            self.axes(self.dimension)
        self._compiled = CompiledScene(self.media, self.surfaces, self.dimension)
        self._pairs = PairSearch(self._compiled)

    def __reduce__(self) -> tuple[Any, ...]:
        return _scene, (self.media, self.surfaces, self.wavelength, self.names, self.units)

    def __repr__(self) -> str:
        return line("Scene", [brief(list(self.media)), *([brief(list(self.surfaces))] if self.surfaces else [])])

    def _headline(self) -> str:
        space = {None: "", 2: " in the plane", 3: " in space"}[self.dimension]
        return f"A scene{space} of {counted(len(self.media), 'medium', 'media')}" + (
            f" and {counted(len(self.surfaces), 'surface')}" if self.surfaces else ""
        )

    def _facts(self) -> Iterator[Fact]:
        axes = self.axes(self.dimension or 2)
        met = [part for pair in zip_longest(self.media, self.surfaces) for part in pair if part is not None]
        shown = met if len(met) <= MOST_PARTS else met[: MOST_PARTS - 1]
        for part in shown:
            yield part_fact(part, axes)
        if len(shown) < len(met):
            yield Fact("", f"and {len(met) - len(shown)} more")
        numbers = {name: value for part in met for name, value in part.parameters.items()}
        if numbers:
            yield Fact("parameters", listed(numbers))
        if any(axis.unit for axis in axes):
            yield Fact("axes", ", ".join(map(str, axes)))

    def axes(self, dimension: int) -> tuple[Axis, ...]:
        """The names and units of the coordinates, as declared, or x, y, z, of points of a ``dimension``."""
        return declared_axes(self.names, self.units, coordinates(dimension))

    def at_wavelength(self, wavelength: float) -> Scene:
        """The scene in light of ``wavelength``, in micrometres in vacuum."""
        return _scene(self.media, self.surfaces, wavelength, self.names, self.units)

    def with_parameters(self, values: Mapping[str, float]) -> Scene:
        """The scene for other values of its media's and surfaces' parameters.

        Raises ValueError for a name that none of them has.
        """
        values = named("parameters", values)
        known = {name for part in (*self.media, *self.surfaces) for name in part.parameters}
        check_names("parameters of this scene", values, sorted(known))
        media = [m.with_parameters({k: v for k, v in values.items() if k in m.parameters}) for m in self.media]
        surfaces = [s.with_parameters({k: v for k, v in values.items() if k in s.parameters}) for s in self.surfaces]
        return _scene(media, surfaces, self.wavelength, self.names, self.units)

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
        progress: Progress = None,
    ) -> Bundle:
        """Carry a bundle of rays through the scene, each with steps, an end and a status of its own.

        Raises TypeError or ValueError for arguments that do not fit the scene: a source on a surface or where the index
        is not positive, a direction of length zero, no stop. :class:`DoesNotApply`, a ValueError, for a model
        that cannot treat the scene.

        Parameters
        ----------
        points, directions : array_like, shape (m, d) or (d,)
            Where the rays start and which way; one point serves for all directions, and one direction for all
            points. Directions need not have length one.
        optical_path : float or array_like, shape (m,)
            The optical path ∫ n ds at which to stop.
        until : Surface
            The surface at which to stop. One of the two is given; or both, and then a ray that has not come to the
            surface within the optical path has missed it.
        with_spreading : bool
            Whether to carry d - 1 neighbours of each ray along, which costs about three times as much.
        wavelength : float, optional
            That of the light, in micrometres in vacuum, if it is another than the scene's.
        model : Model, optional
            What carries the rays, such as ``optics.Invariants()``; the cheapest that applies in each medium when
            left out. The answer names it.
        progress : callable or bool, optional
            As :data:`varcalc.progress.Progress` says: told of the rays, or whether to show a bar on standard error.
            Ctrl-C raises :class:`varcalc.Interrupted`, which holds the bundle; rays that had not come to an end by then
            are where they were, with the status ``INTERRUPTED``.

        Returns
        -------
        Bundle

        Notes
        -----
        Beside the results and the checked sources, some 150 bytes a ray in space, memory is bounded: 65536 rays
        are on their way at once, spread over the cores.
        """
        if wavelength is not None:
            return self.at_wavelength(wavelength).trace(
                points, directions, optical_path=optical_path, until=until, with_spreading=with_spreading, model=model,
                progress=progress,
            )  # fmt: skip
        starts = self._starts(points, directions, optical_path, until)
        propagator = self._compiled.propagator(until, starts.points.shape[1], checked_model(model))
        if until is not None:
            starts.on_stop[:] = touched(propagator.geometries[propagator.stop], starts.points)
        axes = self.axes(starts.points.shape[1])
        return _on_axes(axes, lambda: traced(propagator, starts, with_spreading=with_spreading, progress=progress))

    def rays(
        self, A: Any, B: Any, *, within: float | None = None, wavelength: float | None = None,
        model: Model | None = None, progress: Progress = None,
    ) -> Rays:  # fmt: skip
        """All rays from A to B, each polished to round-off, none twice and none false.

        Every direction is searched. In space, unless the medium keeps rays in a plane, as layers and a centre do,
        that is a net of directions, and rays in whose neighbourhood it is too coarse may be missed. Where there
        are infinitely many rays, by winding, the optical path limits the search.

        Raises TypeError or ValueError for A = B, a source on a surface or where the index is not positive.
        :class:`DoesNotApply`, a ValueError, for a model that cannot treat the scene.

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
        progress : callable or bool, optional
            As :data:`varcalc.progress.Progress` says: told of what is left of the search. Ctrl-C raises
            :class:`varcalc.Interrupted`, which holds the rays that are known by then.

        Returns
        -------
        Rays
            A sequence, the shortest optical path first; empty, with a ``reason``, where there is none.

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
            return self.at_wavelength(wavelength).rays(A, B, within=within, model=model, progress=progress)
        if not all(is_vector(place) and not any(map(is_vector, place)) for place in (A, B)):
            A, B = point("A", A), point("B", B)
        try:
            return self._named(self._pairs.arrivals("A", A, "B", B, within, model, progress)[0])
        except Interrupted as stop:
            raise Interrupted(self._named(stop.known[0])) from stop

    def usual_range(self, A: Any, B: Any) -> float:
        """The optical path up to which :meth:`rays` looks for rays from A to B when ``within`` is left out.

        Raises as :meth:`rays` does.
        """
        return self._pairs.usual_range("A", point("A", A), "B", point("B", B))

    def arrivals(
        self, sources: Any, receivers: Any, *, within: float | None = None, wavelength: float | None = None,
        model: Model | None = None, progress: Progress = None,
    ) -> list[Rays]:  # fmt: skip
        """All rays of many pairs of points: what :meth:`rays` gives, one answer for each pair, in one search.

        In layers and about a centre what stands for the rays between two heights is shared by all pairs at these;
        elsewhere the rays of a source are shared by all the receivers it is paired with, so that thousands of
        receivers of one source take not much longer than a few.

        Raises TypeError or ValueError as :meth:`rays` does, naming the row.

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
        progress : callable or bool, optional
            As :data:`varcalc.progress.Progress` says: told of the pairs, or whether to show a bar on standard error.
            Ctrl-C raises :class:`varcalc.Interrupted`, which holds the answers that are known by then.

        Returns
        -------
        list of Rays

        Examples
        --------
        >>> import casadi as ca
        >>> from varcalc import optics
        >>> scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
        >>> [len(rays) for rays in scene.arrivals((0, 0), [(0.5, 0), (0.9, 0), (1.0, 0), (1.1, 0)])]
        [2, 2, 1, 0]
        """
        if wavelength is not None:
            return self.at_wavelength(wavelength).arrivals(
                sources, receivers, within=within, model=model, progress=progress
            )
        found = self._pairs.arrivals("sources", sources, "receivers", receivers, within, model, progress)
        return [self._named(rays) for rays in found] if self.names or self.units else found

    def _named(self, rays: Rays) -> Rays:
        """The rays with the names and units of the scene, where it has any."""
        if not (self.names or self.units):
            return rays
        return rays.along(self.axes(self.dimension or 2))

    def _starts(self, points: Any, directions: Any, optical_path: Any, until: Surface | None) -> Starts:
        """Where rays start, off every surface, along which unit directions, and how far they go, checked.

        None of them is said to be on the surface at which it stops.
        """
        start = rows("points", points, self.dimension)
        heading = unit_rows("directions", directions, start.shape[1])
        start, heading = matched("points", start, "directions", heading)
        for number, on in enumerate(self._compiled.touched(start)):
            if np.any(on):
                raise ValueError(
                    f"points: row {int(np.argmax(on))} lies on surface {number} of the scene, so that it is not said "
                    "which side the ray starts from; move it off by any amount"
                )
        if optical_path is None and until is None:
            raise ValueError("give optical_path=, until=, or both, to say where the rays are to stop")
        if until is not None and not isinstance(until, Surface):
            remedy = "; how far rays go is said by optical_path=" if isinstance(until, Real) else ""
            raise TypeError(f"until must be a surface such as Plane or Sphere, not {until!r}{remedy}")
        unlimited = np.broadcast_to(np.inf, len(start))
        limit = unlimited if optical_path is None else how_far("optical_path", optical_path, len(start))
        index = self._compiled.index_at_source(start)
        return Starts(start, heading, index, limit, np.zeros(len(start), dtype=bool))


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
        between, need = counted(len(surfaces), "surface"), "needs" if len(surfaces) == 1 else "need"
        fewer = f", or {len(surfaces) + 1 - mirrors} when those after mirrors are left out" if mirrors else ""
        raise ValueError(
            f"a scene has a medium before its first surface and one after each, so that {between} {need} "
            f"{counted(len(surfaces) + 1, 'medium', 'media')}{fewer}; there are {len(media)}"
        )
    for number, surface in enumerate(surfaces):
        if surface.mirror and full[number] != full[number + 1]:
            raise ValueError(f"surface {number} is a mirror, so the medium after it must be that before it")
    return full


def _scene(
    media: Sequence[Medium], surfaces: Sequence[Surface], wavelength: float | None, names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> Scene:  # fmt: skip
    return Scene(media, surfaces, wavelength=wavelength, names=names, units=units)


def _members(name: str, kind: type, given: Any) -> tuple[Any, ...]:
    """One medium or surface, or several; TypeError, with what to write, for anything else."""
    items = given if isinstance(given, Sequence) and not isinstance(given, str) else (given,)
    for item in items:
        if isinstance(item, kind):
            continue
        remedy = ""
        if kind is Medium and callable(item):
            remedy = "; an index that varies is written Graded(n)"
        elif kind is Medium and isinstance(item, int | float | Dispersion):
            remedy = f"; write Uniform({'optics.GLASSES[...]' if isinstance(item, Dispersion) else item})"
        elif isinstance(item, Medium | Surface):
            remedy = "; media come first, and surfaces second"
        raise TypeError(
            f"{name} must hold members of varcalc.optics such as {_EXAMPLES[name]}, not {told(item)}{remedy}"
        )
    return tuple(items)


def _on_axes(axes: tuple[Axis, ...], carried: Callable[[], Bundle]) -> Bundle:
    """The bundle that is ``carried``, with the names of its coordinates; so too where that is interrupted."""
    try:
        return replace(carried(), axes=axes)
    except Interrupted as stop:
        raise Interrupted(replace(stop.known, axes=axes)) from stop


_EXAMPLES = {"media": "Uniform or Graded", "surfaces": "Plane or Sphere"}


def part_fact(part: Medium | Surface, axes: Sequence[Axis]) -> Fact:
    """What a medium or a surface is, with the formula of its index."""
    if isinstance(part, Surface):
        return Fact("mirror" if part.mirror else "surface", repr(part))
    place, names = ca.SX.sym("r", len(axes)), [axis.name for axis in axes]
    symbols = {name: ca.SX.sym(name) for name in part.parameters}
    named = [(place, names), *((symbol, [name]) for name, symbol in symbols.items())]
    kind = type(part).__name__.lower()
    try:
        index = part.parametric_index(place, symbols)
        told = text(index, named)
    except (TypeError, ValueError, RuntimeError, NotImplementedError):  # of another dimension, or of no formula
        return Fact("medium", repr(part))
    if not isinstance(index, ca.SX) or len(told) > LONGEST:
        return Fact("medium", repr(part))
    return Fact("medium", f"{kind}, n = {told}", f"n = {latex(index, named)}")


def _as_declared(dimension: int | None, count: int) -> int:
    """The number of coordinates, as names or units declare it."""
    if count not in {2, 3} or dimension not in {None, count}:
        raise ValueError(
            f"names and units must be of the {dimension or '2 or 3'} coordinates of a point, not of {count}"
        )
    return count
