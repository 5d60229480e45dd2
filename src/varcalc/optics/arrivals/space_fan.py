"""The rays of a source in space, as far as they may matter, laid out in cells over the directions all round.

The first directions are those of a lattice. Between them more are looked at: where some of these come into the last
medium and others do not, or the usual ones do not foretell where they go, the cell is replaced by smaller ones.
Those whose rays may come to what is small, first to the first surface, and by it to the second, and so on, are halved
until they are small beside it: a ball is a target at a known place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from varcalc.optics.arrivals.cells import beam_of, cell_states
from varcalc.optics.arrivals.directions import SIDE, headings
from varcalc.optics.arrivals.space_cells import COLUMNS, MOVED, PATH, P, R, SpaceCells, bernstein, patch
from varcalc.optics.models.hamilton import HamiltonRays
from varcalc.optics.models.straight import StraightRays
from varcalc.optics.models.watch import MOST_SEARCHED, NOT_FOLLOWED, Watch, searching
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import RayStatus, launched, stride, unpacked
from varcalc.progress import Stage

CELLS = 16
"""Cells along one side of a face of directions, to begin with."""
MORE_LOOKS = 8
"""By how many times more directions along it it is looked for surfaces and for jumps of the index."""
LOOKS_SLOW = 4
"""The same for what bends rays, and for surfaces that are no quadrics: both take more time."""
FINER_AT_EDGES = 2
"""How often cells are halved to begin with where some of their rays come in and others do not."""
CELLS_ACROSS = 6
"""Cells across a surface that is small, at least."""
MOST_WINDOWS, MOST_WINDOWS_SLOWLY = 12_000, 6_000
"""Cells that are looked at for one surface, and where it takes a hundred times longer to carry a ray."""
UNFORESEEN = 0.25
"""Of a cell: rays between four that are farther from where these foretell them have met something narrow."""
LOOKED_AHEAD = 1.25
"""Of the scene: how far these are followed."""
AT_EDGES = 2.0
"""Times as far apart may rays of such a cell come by a surface if all of them come to it."""
LEAST_WIDTH = 2**8
"""Steps of the lattice: cells so narrow are not halved."""
STEP_SHARE = 0.25
"""How far a ray goes in one step: of the size of the scene, or of the distance from it."""
SHORT_STEPS = 0.1
"""Of the rays: the share that goes farther in one step than it should."""
MOST_STEPS = 400
"""Steps of one ray."""
CORNERS = np.array([[[0, 0], [0, 1]], [[1, 0], [1, 1]]])
"""Of a square, one axis a coordinate."""
PATH_STEPS = 12
"""Newton's steps to σ for models that carry rays to optical paths."""
SAME_SIGMA = 1e-12
"""Relative differences of σ that do not count."""


@dataclass(frozen=True)
class SpaceReach:
    """How far rays are followed: to the optical path ``path``, and ``far`` from ``middle`` (3,).

    The points to reach lie within ``reach`` of it; ``size`` is that of the scene.
    """

    path: float
    far: float
    middle: np.ndarray
    reach: float
    size: float


@dataclass
class SpaceFan:
    """Rays of ``source`` (3,) through the scene ``propagator``; remembers how many were looked at and their ends."""

    propagator: Propagator
    source: np.ndarray
    bounds: SpaceReach
    pairs: int = 1
    stage: Stage = field(default_factory=Stage)
    looked_at: int = 0
    ends: Counter[RayStatus] = field(default_factory=Counter)
    entered: int = 0
    given_up: bool = False
    """Whether rays took more steps than are allowed, or came through too many pieces of the index."""
    medium: int = -1
    """The number of the medium in which the rays are laid out; the last, where nobody says."""
    farthest: int = 0
    """How many surfaces of the scene the ray has come to that came to most of them."""

    def __post_init__(self) -> None:
        self._looking, self._moving = searching(self.stage, self.pairs), searching(self.stage, self.pairs)
        if self.medium < 0:
            self.medium = len(self.propagator.surfaces)
        self._model, self._field = self.propagator.models[self.medium], self.propagator.fields[self.medium]

    def entries(self, face: np.ndarray, place: np.ndarray) -> np.ndarray:
        """The states (m, 20) of rays where they come into the medium; not a number where they do not."""
        heading, rates = headings(face, place)
        start = np.broadcast_to(self.source, heading.shape)
        index = self.propagator.fields[0].index(start)
        beam = launched(start, heading, index, neighbours=True)
        beam = replace(beam, turned=index[:, None, None] * rates)
        self.looked_at += len(face)
        if self.medium == 0:
            self.entered += len(face)
            return cell_states(beam)
        watch = Watch(self.stage, MOST_SEARCHED)
        rays = self.propagator.into_medium(self.medium, beam, np.full(len(face), self.bounds.path), watch)
        beam, alive = rays.beam, rays.alive
        self.farthest = max(self.farthest, int(rays.met.max(initial=0)))
        self.ends.update(RayStatus(int(code)) for code in rays.status[~alive])
        self.entered += int(np.sum(alive))
        return cell_states(beam.known(alive & np.all(np.isfinite(beam.moved), axis=(1, 2))))

    def at(self, face: np.ndarray, place: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """The states (m, 20) of rays ``sigma`` (m,) behind the last surface; not a number where they do not come."""
        return self.moved(self.entries(face, place), sigma)

    def moved(self, states: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """The ``states`` (m, 20) after ``sigma`` (m,) more in the last medium. What is none stays none."""
        ends = np.full_like(states, np.nan)
        rows = np.flatnonzero(np.isfinite(states[:, PATH]) & (sigma >= 0))
        if len(rows) == 0:
            return ends
        carry, beam, far = self._model, beam_of(states[rows], 3), sigma[rows]
        path = states[rows, PATH] + far * np.sum(states[rows, P] ** 2, axis=1)
        if isinstance(carry, HamiltonRays):
            there, grown = carry.onward(beam, far, path, self._moving)
        else:
            there, grown = carry.onward(beam, far, path)
        for _ in range(PATH_STEPS):
            late = far - grown
            if not np.any(np.abs(late) > SAME_SIGMA * far):
                break
            rate = np.sum(there.momentum**2, axis=1)  # the model knows optical paths only, which grow by n² dσ
            path = np.where(np.isfinite(rate), np.maximum(path + late * rate, beam.optical_path), path)
            there, grown = carry.onward(beam, far, path)
        ends[rows] = cell_states(there)
        return ends

    def pull(self, states: np.ndarray) -> np.ndarray:
        """dp/dσ (..., 3) of states (..., 20) in the last medium."""
        with np.errstate(all="ignore"):
            _, gradient, _ = self._field(states[..., R].reshape(-1, 3))
        return gradient.reshape(*states.shape[:-1], 3) / 2

    def cells(self) -> Iterator[SpaceCells]:
        """The first cells, one step after the other along the rays; those of corners at least one of which is known."""
        return self._laid_out(*self._first())

    def _laid_out(self, face: np.ndarray, low: np.ndarray, width: np.ndarray) -> Iterator[SpaceCells]:
        """The cells on these faces (q,) with these lower corners (q, 2) and widths (q,), see :meth:`cells`."""
        corners = low[:, None, None] + width[:, None, None, None] * CORNERS
        flat = np.column_stack([np.repeat(face, 4), corners.reshape(-1, 2)])
        rays, number = np.unique(flat, axis=0, return_inverse=True)
        number = number.reshape(-1, 2, 2)
        states, sigma = self.entries(rays[:, 0], rays[:, 1:]), 0.0
        for _ in range(MOST_STEPS):
            within = self._within(states)
            going = np.any(within[number], axis=(1, 2))
            if not np.any(going):
                return
            face, low, width, number = face[going], low[going], width[going], number[going]
            needed = np.zeros(len(states), dtype=bool)
            needed[number] = True
            states[~needed] = np.nan
            step = self._longest if self._straight else self._step(states[within])
            after = self.moved(states, np.full(len(states), step))
            state = np.stack([states[number], after[number]], axis=3)
            q = len(face)
            ends, unseen = np.tile([sigma, sigma + step], (q, 1)), np.full(q, np.inf)
            nothing = np.zeros((*state.shape[:-1], 3))
            cells = SpaceCells(face, low, width, ends, state, nothing, unseen, unseen, np.zeros(q, dtype=int))
            if not self._straight:
                cells = cells.take(np.flatnonzero(~cells.far_off(self.bounds.middle, self.bounds.reach)))
            yield replace(cells, pull=self.pull(cells.state))
            if self._straight:
                return
            states, sigma = after, sigma + step
            if self._moving.left <= 0:
                break
        self.given_up = True

    def parted(self, cells: SpaceCells) -> tuple[SpaceCells, np.ndarray]:
        """The eighths of the cells, which know their errors by a look into the middles, and which cell each is of."""
        q, half, steps = len(cells), cells.width // 2, 1 if self._straight else 2
        state = np.empty((q, 3, 3, steps + 1, COLUMNS))
        state[:, ::2, ::2, ::steps] = cells.state
        step = np.diff(cells.sigma, axis=1)[:, 0] / steps
        new = [(1, 1), (0, 1), (2, 1), (1, 0), (1, 2)]
        place = np.concatenate([cells.low + half[:, None] * np.array(at) for at in new])
        begin = self.at(np.tile(cells.face, len(new)), place, np.tile(cells.sigma[:, 0], len(new)))
        begin = begin.reshape(len(new), q, COLUMNS)
        for (a, b), states in zip(new, begin, strict=True):
            state[:, a, b, 0] = states
        for t in range(steps):
            missing = np.ones((3, 3), dtype=bool)
            missing[::2, ::2] = t + 1 < steps
            on = self.moved(state[:, missing, t].reshape(-1, COLUMNS), np.repeat(step, np.sum(missing)))
            state[:, missing, t + 1] = on.reshape(q, -1, COLUMNS)
        return cells.parted(state, self.pull(state))

    def held(self, cells: SpaceCells, target: np.ndarray) -> SpaceCells:
        """Those of the ``cells`` that may hold the ``target`` (3,), and dark ones beside them.

        The edge of what is lit may bulge through a side of a cell past all of its corners.
        """
        near = cells.take(np.flatnonzero(cells.may_hold(target)))
        dark = ~np.any(np.isfinite(near.state[..., PATH]), axis=3)
        sides = (dark[:, 0], (-1, 0)), (dark[:, 1], (1, 0)), (dark[:, :, 0], (0, -1)), (dark[:, :, 1], (0, 1))
        beside = [
            replace(near.take(rows), low=near.low[rows] + near.width[rows, None] * np.array(turn))
            for side, turn in sides
            if len(rows := np.flatnonzero(np.all(side, axis=1) & ~np.all(dark, axis=(1, 2))))
        ]
        if not beside:
            return near
        others = SpaceCells.joined(beside)
        key = np.column_stack([others.face, others.low, others.width, others.sigma])
        others = others.take(np.unique(key, axis=0, return_index=True)[1])
        place = others.low[:, None, None] + others.width[:, None, None, None] * CORNERS
        entry = self.entries(np.repeat(others.face, 4), place.reshape(-1, 2))
        unlit = np.flatnonzero(np.all(np.isnan(entry[:, PATH]).reshape(-1, 4), axis=1))
        others = others.take(unlit)
        nothing = np.full(len(others), np.inf)
        others = replace(others, state=np.full_like(others.state, np.nan), sideways=nothing, error=nothing)
        return SpaceCells.joined([near, others])

    @property
    def _straight(self) -> bool:
        """Whether the rays of the last medium are straight, and need no steps."""
        return isinstance(self._model, StraightRays)

    @property
    def _longest(self) -> float:
        """How far in σ straight rays go."""
        return self.bounds.path / float(self._field.index(self.bounds.middle[None])[0]) ** 2

    @property
    def resolution(self) -> str:
        """What is said of surfaces, of jumps and of what bends rays."""
        degrees = np.degrees(np.pi / 2 / CELLS / self._looks)
        parting = self.propagator.surfaces or self._looks == MORE_LOOKS
        what = "surfaces and jumps" if parting else "what bends rays and is"
        return f"{what} seen under more than {degrees:.2g}°" if self._looks > 1 else ""

    @property
    def unlit(self) -> bool:
        """Whether no ray comes from one surface to the next, which those between may do that are not looked at.

        All that may come to what is bounded are looked at.
        """
        surfaces = self.propagator.surfaces
        return 0 < self.farthest < len(surfaces) and not all(one.bounded for one in surfaces[: self.farthest + 1])

    @property
    def slow(self) -> bool:
        """Whether rays are integrated, or find surfaces step by step: it takes a hundred times longer than in one."""
        models, surfaces = self.propagator.models, self.propagator.geometries
        return any(isinstance(one, HamiltonRays) for one in models) or not all(one.quadric for one in surfaces)

    @property
    def _looks(self) -> int:
        last, surfaces = self._model, self.propagator.geometries
        if surfaces and not all(one.quadric for one in surfaces):
            return LOOKS_SLOW
        if surfaces or (isinstance(last, HamiltonRays) and last.jumps):
            return MORE_LOOKS
        return LOOKS_SLOW if isinstance(last, HamiltonRays) else 1

    def _first(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The faces (q,), lower corners (q, 2) and widths (q,) of the first cells."""
        looks, width = self._looks, SIDE // CELLS
        side, fine = CELLS * looks + 1, width // looks
        grid = np.argwhere(np.ones((6, side, side), dtype=bool))
        number = np.arange(len(grid)).reshape(6, side, side)
        number = np.lib.stride_tricks.sliding_window_view(number, (looks + 1, looks + 1), axis=(1, 2))
        number = number[:, ::looks, ::looks].reshape(-1, looks + 1, looks + 1)
        first = grid[number[:, 0, 0]] * (1, fine, fine)
        if looks == 1:
            return first[:, 0], first[:, 1:], np.full(len(first), width)
        small = self._windows
        small = small[small[:, 3] < fine]
        entry = self.entries(grid[:, 0], grid[:, 1:] * fine)
        course = self._course(entry)[number]
        even = course.min(axis=(1, 2)) == course.max(axis=(1, 2))
        even &= (course[:, 0, 0] < 0) | self._foreseen(entry, number)
        whole = np.flatnonzero(even & (course[:, 0, 0] >= 0))
        pieces = grid[number[~even, :-1, :-1].ravel()] * (1, fine, fine)
        parts = [(first[whole], width), *self._toward_edges(pieces, fine)]
        for size in np.unique(small[:, 3]):
            parts += self._toward_edges(small[small[:, 3] == size, :3], int(size))
        every = [np.column_stack([cells, np.full(len(cells), size)]) for cells, size in parts]
        cells = np.unique(np.concatenate(every), axis=0)
        return cells[:, 0], cells[:, 1:3], cells[:, 3]

    def _toward_edges(self, cells: np.ndarray, width: int) -> list[tuple[np.ndarray, int]]:
        """The ``cells`` (q, 3) of that width some of whose corners come in, and smaller ones where others do not."""
        parts: list[tuple[np.ndarray, int]] = []
        for last in (*[False] * FINER_AT_EDGES, True):
            corners = cells[:, 1:, None, None] + width * np.moveaxis(CORNERS, -1, 0)
            flat = np.column_stack([np.repeat(cells[:, 0], 4), np.moveaxis(corners, 1, -1).reshape(-1, 2)])
            rays, number = np.unique(flat, axis=0, return_inverse=True)
            course = self._course(self.entries(rays[:, 0], rays[:, 1:]))[number.reshape(-1, 4)]
            some, even = course.max(axis=1) >= 0, course.min(axis=1) == course.max(axis=1)
            parts.append((cells[some & (even | last)], width))
            cells, width = cells[some & ~even], width // 2
            cells = (cells[:, None] + width * np.insert(CORNERS.reshape(4, 2), 0, 0, axis=1)).reshape(-1, 3)
        return parts

    @cached_property
    def _windows(self) -> np.ndarray:
        """Cells (q, 4) whose rays may come to all surfaces before the medium, and are small beside these.

        They have the numbers of their faces, lower corners and widths.
        """
        if self.medium == 0:
            width = SIDE // CELLS
            grid = np.argwhere(np.ones((6, CELLS, CELLS), dtype=bool)) * (1, width, width)
            return np.column_stack([grid, np.full(len(grid), width)])
        number = self.medium - 1
        surface, shapes = self.propagator.surfaces[number], self.propagator.shapes
        inside = number > 0 and shapes[number] == shapes[number - 1] and not surface.mirror
        if surface.middle is None or inside:  # what comes through a surface comes to its other side
            before = replace(self, medium=self.medium - 1, looked_at=0, ends=Counter(), entered=0)
            windows = before._windows  # noqa: SLF001  of this class
        else:
            middle = np.asarray(surface.middle, dtype=float)
            away = float(np.linalg.norm(middle - self.bounds.middle)) + self.bounds.reach
            bounds = replace(self.bounds, far=self.bounds.far + away, middle=middle, reach=surface.extent)
            before = replace(self, bounds=bounds, medium=self.medium - 1, looked_at=0, ends=Counter(), entered=0)
            windows = before._toward_ball()  # noqa: SLF001  of this class
            if not surface.bounded:
                windows = np.unique(np.concatenate([windows, before._windows]), axis=0)  # noqa: SLF001  of this class
        self.looked_at += before.looked_at
        self.given_up |= before.given_up
        return windows

    def _toward_ball(self) -> np.ndarray:
        """Windows (q, 4) of this medium whose rays may come within the reach of the middle, small beside that."""
        windows, middle, radius = self._windows, self.bounds.middle, self.bounds.reach
        found, looked = [np.zeros((0, 4), dtype=int)], 0
        most = MOST_WINDOWS_SLOWLY if self.slow else MOST_WINDOWS
        for slab in self._laid_out(windows[:, 0], windows[:, 1:3], windows[:, 3]):
            cells = slab.take(np.flatnonzero(slab.may_hold(middle, radius)))
            while len(cells):
                looked += len(cells)
                narrow = (cells.width <= LEAST_WIDTH) | (looked > most)
                self.given_up |= bool(np.any(narrow))
                across, wanted = cells.across(middle), 2 * radius / CELLS_ACROSS
                small = narrow | (across <= np.where(self._come_on(cells), AT_EDGES * wanted, wanted))
                found.append(np.column_stack([cells.face, cells.low, cells.width])[small])
                cells = cells.take(np.flatnonzero(~small))
                if len(cells):
                    parts = self.parted(cells)[0]
                    cells = parts.take(np.flatnonzero(parts.may_hold(middle, radius)))
        return np.unique(np.concatenate(found), axis=0)

    def _come_on(self, cells: SpaceCells) -> np.ndarray:
        """True (q,) for cells all of whose rays come into the next medium, as far as they come into this.

        Beside an edge rays turn as a root: however small cells are made there, their rays go far apart.
        """
        behind = replace(self, medium=self.medium + 1, looked_at=0, ends=Counter(), entered=0)
        place = cells.low[:, None, None] + cells.width[:, None, None, None] * CORNERS
        entry = behind.entries(np.repeat(cells.face, 4), place.reshape(-1, 2))
        self.looked_at += behind.looked_at
        come = np.isfinite(entry[:, PATH]).reshape(-1, 2, 2)
        return np.all(come | np.isnan(cells.state[:, :, :, 0, PATH]), axis=(1, 2))

    def _course(self, entry: np.ndarray) -> np.ndarray:
        """What tells rays (m,) apart that are no neighbours: whether they come in, and through which jumps."""
        course = np.where(np.isfinite(entry[:, PATH]), 0.0, -1.0)
        last, rows = self._model, np.flatnonzero(course == 0)
        if isinstance(last, HamiltonRays) and last.jumps and len(rows):
            through = last.crossed(beam_of(entry[rows], 3), np.full(len(rows), self.bounds.path), self._looking)
            self.given_up |= not np.all(np.isfinite(through))
            course[rows] = np.nan_to_num(through, nan=NOT_FOLLOWED)
        return course

    def _foreseen(self, entry: np.ndarray, number: np.ndarray) -> np.ndarray:
        """True (q,) for cells of the rays ``number`` (q, k, k) whose corners foretell where those between them go."""
        last, looks = self._model, number.shape[1] - 1
        if self.propagator.surfaces or not isinstance(last, HamiltonRays) or last.jumps:
            return np.ones(len(number), dtype=bool)
        far = LOOKED_AHEAD * self.bounds.size / self.propagator.fields[0].index(self.source[None])
        corners = self.moved(entry[number[:, ::looks, ::looks].ravel()], np.repeat(far, 4 * len(number)))
        corners = corners.reshape(len(number), 2, 2, COLUMNS)
        start = unpacked(entry[:, : PATH + 1], 3)
        end, _ = last.onward(
            start, np.repeat(far, len(entry)), start.optical_path + far * np.sum(start.momentum**2, axis=1)
        )
        width, weights = SIDE // CELLS, bernstein(np.arange(looks + 1) / looks)
        control = patch(corners[..., R], *(width * corners[..., by] for by in MOVED))
        off = end.position[number] - np.einsum("ia,jb,qabd->qijd", weights, weights, control)
        extent = np.linalg.norm(np.ptp(control.reshape(len(control), 16, 3), axis=1), axis=1)
        return ~(np.linalg.norm(off, axis=-1).max(axis=(1, 2)) > UNFORESEEN * extent)

    def _within(self, states: np.ndarray) -> np.ndarray:
        """True (m,) for rays that may still come to a point."""
        away = np.linalg.norm(states[:, R] - self.bounds.middle, axis=1)
        with np.errstate(invalid="ignore"):
            return (states[:, PATH] < self.bounds.path) & (away < self.bounds.far)

    def _step(self, states: np.ndarray) -> float:
        """How far in σ all rays go, over which most of them turn little."""
        away = np.linalg.norm(states[:, R] - self.bounds.middle, axis=1) - self.bounds.reach
        length = STEP_SHARE * np.maximum(self.bounds.size, away)
        steps = stride(states[:, R], states[:, P], self._field, length)
        return float(np.quantile(steps[steps > 0], SHORT_STEPS)) if np.any(steps > 0) else self.bounds.size
