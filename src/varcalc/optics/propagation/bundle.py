"""Bundles of rays of any size: some of them are carried at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from varcalc.axes import Axis, measured, unit_of_length
from varcalc.optics import validation
from varcalc.optics.media.medium import Medium
from varcalc.optics.models.model import Model
from varcalc.optics.models.watch import Watch
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import RayStatus, launched, spreading
from varcalc.optics.rays.tube import RayTube
from varcalc.optics.surfaces import Surface
from varcalc.problem.conditions import truth
from varcalc.progress import Interrupted, Progress, Stage, telling
from varcalc.showing import Fact, Plotted, counted, line


@dataclass(frozen=True, eq=False)
class Origin:
    """Where a bundle comes from: enough to follow single rays of it again, for pictures."""

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    until: Surface | None
    model: Model | None
    points: np.ndarray
    directions: np.ndarray
    index: np.ndarray

    def tubes(self, rows: Iterable[int], optical_path: np.ndarray) -> list[RayTube]:
        """The rays of some ``rows``, each up to its optical path (m,)."""
        propagator = Propagator(self.media, self.surfaces, self.until, self.points.shape[1], self.model)
        beam = launched(self.points, self.directions, self.index, neighbours=False)
        found = []
        for row in rows:
            legs, status = propagator.followed(beam.take(np.array([row])), float(optical_path[row]))
            found.append(RayTube(status, tuple(legs)))
        return found


@dataclass(frozen=True, repr=False, eq=False)
class Bundle(Plotted):
    """The ends of m rays in d dimensions, one row a ray.

    Attributes
    ----------
    points, directions : ndarray, shape (m, d)
        Where each ray ended, and the unit vector it was heading along.
    optical_path : ndarray, shape (m,)
        ∫ n ds from the start, in units of length.
    status : ndarray of int, shape (m,)
        Members of :class:`RayStatus`; the numbers of a ray that did not arrive are those of the last place known.
    spreading : ndarray, shape (m,), or None
        ``|dr⊥/dθ|`` in the plane, ``|dA/dΩ|`` in space, where it was asked for.
    model : str
        The models that carried the rays.
    """

    points: np.ndarray
    directions: np.ndarray
    optical_path: np.ndarray
    status: np.ndarray
    spreading: np.ndarray | None
    model: str
    axes: tuple[Axis, ...] = field(repr=False, default=())
    """Names and units of the coordinates."""
    origin: Origin | None = field(repr=False, default=None, compare=False)

    def __repr__(self) -> str:
        return line("Bundle", [counted(len(self), "ray"), f"{int(self.arrived.sum())} arrived", self.model])

    def __len__(self) -> int:
        return len(self.points)

    @property
    def arrived(self) -> np.ndarray:
        """True (m,) for the rays that ended where they were to end."""
        return self.status == RayStatus.ARRIVED

    def _headline(self) -> str:
        return f"{counted(len(self), 'ray')} in {'the plane' if self.points.shape[1] == 2 else 'space'}"

    def _facts(self) -> Iterator[Fact]:
        counts = Counter(RayStatus(int(code)) for code in self.status)
        told = [f"{counted(counts[status], 'ray')}: {status.message}" for status in RayStatus if counts[status]]
        yield from (Fact("" if number else "ended", words) for number, words in enumerate(told))
        if self.arrived.any():
            paths = self.optical_path[self.arrived]
            yield Fact(
                "optical path", measured(f"from {paths.min():.9g} to {paths.max():.9g}", unit_of_length(self.axes))
            )
        yield Fact("carried by", self.model)


@dataclass(frozen=True)
class Starts:
    """Where m rays start, along which unit vectors (both (m, d)), and how far they are to go.

    ``index`` is that at the start, ``limit`` the optical path (both (m,)); ``on_stop`` (m,) marks rays that start
    on the surface at which they are to stop.
    """

    points: np.ndarray
    directions: np.ndarray
    index: np.ndarray
    limit: np.ndarray
    on_stop: np.ndarray


def traced(propagator: Propagator, starts: Starts, *, with_spreading: bool, progress: Progress) -> Bundle:
    """The ends of all rays; ``progress`` is told of them.

    Ctrl-C raises :class:`Interrupted` with the bundle, in which rays that have not come to an end are at the last place
    known.
    """
    truth("with_spreading", with_spreading)
    m, d = starts.points.shape
    bundle = Bundle(
        np.empty((m, d)), np.empty((m, d)), np.empty(m), np.empty(m, np.int8),
        np.empty(m) if with_spreading else None, propagator.name,
        origin=Origin(
            propagator.media, propagator.surfaces, propagator.until, propagator.model, starts.points,
            starts.directions, starts.index,
        ),
    )  # fmt: skip
    parts = validation.chunks(m)
    carried = 0
    with telling(progress, "rays") as told:
        stage = Stage(lambda done, what: told(done, m, what))
        with stage.stoppable():
            for part in parts:
                told(part.start, m)
                _carry(propagator, starts, bundle, part, Watch(stage.later(part.start), kept=True))
                carried = part.stop
                if stage.stopped:
                    break
            else:
                told(m, m)
    if stage.stopped:
        _not_begun(starts, bundle, slice(carried, m))
        raise Interrupted(bundle)
    return bundle


def _not_begun(starts: Starts, bundle: Bundle, part: slice) -> None:
    """Rays that nobody has carried, where they start."""
    bundle.points[part], bundle.directions[part] = starts.points[part], starts.directions[part]
    bundle.optical_path[part], bundle.status[part] = 0.0, RayStatus.INTERRUPTED
    if bundle.spreading is not None:
        bundle.spreading[part] = 0.0


def _carry(propagator: Propagator, starts: Starts, bundle: Bundle, part: slice, watch: Watch) -> None:
    """A part of the rays to their ends, which the bundle takes up."""
    beam = launched(
        starts.points[part], starts.directions[part], starts.index[part], neighbours=bundle.spreading is not None
    )
    end, status = propagator.ends(beam, starts.limit[part], starts.on_stop[part], watch)
    bundle.points[part], bundle.optical_path[part], bundle.status[part] = end.position, end.optical_path, status
    bundle.directions[part] = end.momentum / np.linalg.norm(end.momentum, axis=1)[:, None]
    if bundle.spreading is not None:
        bundle.spreading[part] = spreading(end)
