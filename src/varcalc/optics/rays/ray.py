"""One ray between two points, and all of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from varcalc.axes import Axis, measured, unit_of_length
from varcalc.optics.media.medium import Medium
from varcalc.optics.rays.beam import AT_END, RayStatus
from varcalc.optics.rays.derivatives import path_derivatives
from varcalc.optics.rays.leg import Leg
from varcalc.optics.rays.tube import RayTube
from varcalc.optics.surfaces import Surface
from varcalc.problem.conditions import positive, reals
from varcalc.showing import Fact, Plotted, counted, figure_of, line

if TYPE_CHECKING:
    from varcalc.certificates import Certificate
    from varcalc.optics.rays.straight_path import RayCertificate

MOST_RAYS, MOST_PATHS = 6, 4
"""Rays that are told one by one in a print, and in a line."""
SPEED_OF_LIGHT = 299_792_458.0
"""In vacuum, in metres a second (SI)."""


@dataclass(frozen=True)
class FoundTogether:
    """What k rays that were found together share, and what is known of each: a row.

    ``counts`` (k,) are numbers of conjugate points, ``degenerate`` (k,) says which rays end at one, and ``leaving`` and
    ``arriving`` (k, d) are unit vectors along them at A and at B. How a ray spreads and its way are asked of its row.
    """

    counts: np.ndarray
    degenerate: np.ndarray
    leaving: np.ndarray
    arriving: np.ndarray
    model: str
    spread: Callable[[int], float]
    way: Callable[[int], Sequence[Leg]]
    media: Sequence[Medium] = ()
    surfaces: Sequence[Surface] = ()
    axes: tuple[Axis, ...] = ()

    def rays(self, paths: np.ndarray, errors: np.ndarray) -> list[Ray]:
        """The rays, whose optical ``paths`` (k,) are known to within ``errors`` (k,)."""
        return [
            Ray(path, error, self, row)
            for row, (path, error) in enumerate(zip(paths.tolist(), errors.tolist(), strict=True))
        ]

    def alone(self, row: int, spreading: float, legs: Sequence[Leg]) -> FoundTogether:
        """The same of one ray, of which all has been asked."""
        one = [row]
        return replace(
            self, counts=self.counts[one], degenerate=self.degenerate[one], leaving=self.leaving[one],
            arriving=self.arriving[one], spread=partial(_known, spreading), way=partial(_known, tuple(legs)),
        )  # fmt: skip


def _known(answer: Any, row: int) -> Any:
    return answer


@dataclass(frozen=True, repr=False, eq=False)
class Ray(Plotted):
    """A ray from A to B.

    Attributes
    ----------
    optical_path : float
        ∫ n ds from A to B, in units of length; see :meth:`travel_time`.
    error : float
        An estimate of the error of ``optical_path``.
    index : int
        The number of conjugate points between A and B, each as often as its multiplicity (the KMAH index): 0 for a
        ray of locally least time. A reflection, at a mirror or at a jump of the index, counts none: what it does to
        the phase is its coefficient's (Červený, "Seismic Ray Theory", sect. 4.12).
    spreading : float
        ``|dr⊥/dθ|`` at B in the plane, ``|dA/dΩ|`` in space: the intensity of a source at A is in
        inverse proportion to it.
    degenerate : bool
        True where B itself is conjugate to A, on a caustic: then the spreading is zero to round-off.
    tangents : tuple of ndarray, shape (d,)
        Unit vectors along the ray at A and at B.
    model : str
        The models that carried the ray.
    """

    optical_path: float
    error: float
    together: FoundTogether = field(repr=False)
    """What it shares with the rays that were found with it: millions of rays are small objects."""
    row: int = field(repr=False)

    def known_to(self, error: float) -> Ray:
        """The same ray, whose optical path is known to within ``error``."""
        return Ray(self.optical_path, error, self.together, self.row)

    @property
    def index(self) -> int:
        """See above."""
        return int(self.together.counts[self.row])

    @property
    def degenerate(self) -> bool:
        """See above."""
        return bool(self.together.degenerate[self.row])

    @property
    def tangents(self) -> tuple[np.ndarray, np.ndarray]:
        """See above."""
        return self.together.leaving[self.row], self.together.arriving[self.row]

    @property
    def model(self) -> str:
        """See above."""
        return self.together.model

    @property
    def media(self) -> Sequence[Medium]:
        """The media that the ray goes through, in order."""
        return self.together.media

    @property
    def surfaces(self) -> Sequence[Surface]:
        """The surfaces that it meets, in order."""
        return self.together.surfaces

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Names and units of the coordinates, where the scene declares them."""
        return self.together.axes

    def _headline(self) -> str:
        return f"A ray in {'the plane' if len(self.tangents[0]) == 2 else 'space'}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("optical path", figure_of(self.optical_path, self.error, unit_of_length(self.axes)))
        yield Fact("caustics", f"{counted(self.index, 'conjugate point')} on the way" + self._on_caustic())
        yield Fact("spreading", f"{self.spreading:.6g}")
        for label, tangent in zip(("leaves along", "arrives along"), self.tangents, strict=True):
            yield Fact(label, direction(tangent))
        yield Fact("carried by", self.model)

    def _on_caustic(self) -> str:
        return ", and one at its end: it ends on a caustic" if self.degenerate else ""

    def __getstate__(self) -> dict[str, Any]:
        alone = self.together.alone(self.row, self.spreading, self.legs)
        return {"optical_path": self.optical_path, "error": self.error, "together": alone, "row": 0}

    @cached_property
    def spreading(self) -> float:
        """See above."""
        return self.together.spread(self.row)

    @cached_property
    def legs(self) -> Sequence[Leg]:
        """The ray between surfaces, followed anew when it is first asked for.

        There is none where no direction, to round-off, leads along the ray: it all but rests along a layer, or its
        neighbours grow apart too fast.
        """
        return self.together.way(self.row)

    def _followed(self) -> Sequence[Leg]:
        """The same; ArithmeticError where there is none."""
        if not self.legs:
            raise ArithmeticError(
                "the ray cannot be followed: rays whose directions differ by round-off come apart on the way by as "
                "much as A and B are; its optical path, spreading and directions at A and B are known"
            )
        return self.legs

    @cached_property
    def conjugate_points(self) -> np.ndarray:
        """Where neighbouring rays from A cross this one, shape (index, d), in the order in which they are met.

        Raises ArithmeticError where the ray cannot be followed.
        """
        last = self.optical_path * (1 - AT_END) if self.degenerate else np.inf
        foci = [position for leg in self._followed() for path, position in leg.foci() if path < last]
        return np.array(foci).reshape(-1, len(self.tangents[0]))

    @cached_property
    def derivatives(self) -> dict[str, float]:
        """The derivatives of ``optical_path`` in the parameters of the media and surfaces, by name; A and B stay.

        Fermat's principle makes them one integral along the ray, ∂S/∂p = ∫ ∂n/∂p ds. A name that stands in several
        media or surfaces is one parameter, which changes in all of them by the same amount.

        Raises ArithmeticError where the index is not smooth along the ray, or the ray cannot be followed.
        """
        return path_derivatives(self._followed(), self.media, self.surfaces)

    def travel_time(self, speed: float = SPEED_OF_LIGHT) -> float:
        """The time from A to B: the optical path over the ``speed`` to which the index is referred.

        That is the speed of light in vacuum, in metres a second; of sound, the speed where the index is 1. A medium
        with dispersion is one wavelength's: the time is that of the phase.

        Raises TypeError or ValueError for a speed that is not a positive number.
        """
        return self.optical_path / positive("speed", speed)

    def certify(self, end: Sequence[float] | None = None) -> Certificate | RayCertificate:
        """Prove between which two numbers the optical path lies, and whether it is the least near this ray.

        In one medium it is the infimum over the curves in a tube around the ray from its first point to ``end``, a
        point (d,) within round-off of where the ray arrives; by default the very doubles at which it does. See
        :func:`varcalc.certify`: a ray beyond a conjugate point is refused, since no tube around it has it for its
        least. Through surfaces between uniform media it is the path of the one ray near this one, with the number of
        its conjugate points; where there are none it is the least by way of these surfaces, see
        :class:`RayCertificate`.

        Raises :class:`varcalc.VariationalError` where there is no proof of a ray in one medium, and ArithmeticError of
        one through surfaces, with what failed; ValueError for surfaces between media that are not uniform, and
        ImportError where python-flint is not installed.

        >>> from varcalc import optics
        >>> duct = optics.Scene(optics.Stratified(lambda y: 1.5 - y**2 / 8))
        >>> ray = duct.rays((0, 0.1), (1, 0.2))[0]
        >>> ray.certify((1, 0.2)).width < 1e-18
        True
        >>> water = optics.Scene([optics.Uniform(1.0), optics.Uniform(1.33)], optics.Plane((0, 0), (0, 1)))
        >>> certificate = water.rays((0, 1), (1, -1))[0].certify((1, -1))
        >>> certificate.width < 1e-40, certificate.index
        (True, 0)
        """
        from varcalc.optics.rays.fermat import certified_path

        if not self.surfaces:
            return certified_path(self.media[0], self._followed()[0], end)
        from varcalc.optics.rays.straight_path import certified_straight_path

        return certified_straight_path(self, end)

    def point(self, s: float | np.ndarray) -> np.ndarray:
        """The point of the ray at the optical path ``s`` from A, shape ``np.shape(s) + (d,)``.

        Raises ValueError for ``s`` beyond the ends of the ray, ArithmeticError where it cannot be followed.
        """
        wanted, end = reals("s", s), self.tube.optical_path
        # followed a second time the ray ends where it does to within its error
        return self.tube.point(np.where((wanted > end) & (wanted <= self.optical_path + self.error), end, wanted))

    @cached_property
    def tube(self) -> RayTube:
        """The ray with its neighbours from A: its spreading and intensity all along.

        Raises ArithmeticError where the ray cannot be followed.
        """
        return RayTube(RayStatus.ARRIVED, self._followed())


@dataclass(frozen=True, repr=False)
class Rays(Plotted, Sequence[Ray]):
    """The rays from A to B, the shortest optical path first.

    Attributes
    ----------
    reason : str
        Why there is none, where there is none: shadow, total reflection, blocked, an index that is not real at B, or
        parts of the search that had to be given up, through which one may come.
    searched : str
        What was searched, in words.
    continuum : bool
        True where infinitely many rays join A and B, as from a point of a fish-eye to its image; one of them is
        given for all.
    unresolved : int
        How many narrow parts of the search were given up: where it is not zero, there may be more rays.
    """

    found: tuple[Ray, ...]
    reason: str
    searched: str
    continuum: bool = False
    unresolved: int = 0
    axes: tuple[Axis, ...] = field(repr=False, default=())
    """Names and units of the coordinates, where the scene declares them."""

    def __repr__(self) -> str:
        paths = [f"{ray.optical_path:.12g}" for ray in self.found]
        return line("Rays", [f"[{', '.join(paths[:MOST_PATHS])}{', ...' if len(paths) > MOST_PATHS else ''}]"])

    def along(self, axes: tuple[Axis, ...]) -> Rays:
        """The same rays in a scene with such axes, whose unit the lengths of what was searched have too."""
        unit = unit_of_length(axes)
        found = tuple(replace(ray, together=replace(ray.together, axes=axes)) for ray in self.found)
        searched = SEARCHED_LENGTH.sub(lambda length: measured(length[0], unit), self.searched)
        reason = self.reason.replace(self.searched, searched)
        return replace(self, found=found, reason=reason, searched=searched, axes=axes)

    def _headline(self) -> str:
        if not self.found:
            return f"No ray: {self.reason}"
        more = ", one for infinitely many" if self.continuum else ""
        return f"{counted(len(self.found), 'ray')}, the shortest optical path first{more}"

    def _facts(self) -> Iterator[Fact]:
        for number, ray in enumerate(self.found[:MOST_RAYS]):
            path = figure_of(ray.optical_path, ray.error, unit_of_length(self.axes))
            touched = ", ends on a caustic" if ray.degenerate else ""
            told = f"{path}, {counted(ray.index, 'caustic')}{touched}, along {direction(ray.tangents[0])}"
            yield Fact("" if number else "optical path", told)
        if len(self.found) > MOST_RAYS:
            yield Fact("", f"and {len(self.found) - MOST_RAYS} more")
        yield Fact("searched", self.searched)
        if self.unresolved:
            yield Fact("given up", f"{counted(self.unresolved, 'narrow part')} of the search: there may be more rays")

    @overload
    def __getitem__(self, key: int) -> Ray: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[Ray, ...]: ...
    def __getitem__(self, key: int | slice) -> Ray | tuple[Ray, ...]:
        return self.found[key]

    def __len__(self) -> int:
        return len(self.found)


def direction(vector: np.ndarray) -> str:
    """A direction in words: its components."""
    return f"({', '.join(f'{x:.6g}' for x in vector)})"


SEARCHED_LENGTH = re.compile(r"(?:(?<=optical paths up to )|(?<=no farther than ))[-+.e\d]*\d")
"""A length in the words of a search, which knows of no units."""
SHADOW = "shadow: no ray of the source comes to B"
"""Why there is no ray where nothing is in the way."""


def no_rays(reason: str, searched: str, unresolved: int = 0) -> Rays:
    """An answer without rays, and its ``reason``, which is known only where no part of the search was given up."""
    parts = "1 narrow part" if unresolved == 1 else f"{unresolved} narrow parts"
    open_ = f"no ray was found, but {parts} of the search had to be given up, and one may come to B through them"
    return Rays((), f"{open_ if unresolved else reason} (searched: {searched})", searched, unresolved=unresolved)
