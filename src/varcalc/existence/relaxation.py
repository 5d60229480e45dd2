"""The convexified problem: what finer and finer corners bring the functional down to.

Where L is not convex in the slope, curves that alternate between two slopes
come lower than any smooth one, and in the limit replace L by its convex
envelope in the slope (Dacorogna, "Direct Methods in the Calculus of
Variations", ch. 9). By Caratheodory's theorem two slopes suffice for one
unknown function: the relaxed problem is solved over polygons, each piece of
which has two slopes and their shares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from varcalc.existence.relaxed_polygons import least_relaxed
from varcalc.existence.rounded import points_along, rounded_off
from varcalc.existence.slope_sectors import by_sector, slope_sectors
from varcalc.methods.ritz.ipopt import quiet
from varcalc.numerics.mesh import gauss
from varcalc.problem.breaks import breaks, on_curve
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric, Through
from varcalc.problem.end_cost import end_cost
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.evaluation import PointEvaluator

SPREADS = (0.3, 1.0, 3.0)
"""Half distances of the two slopes at the start, in units of the problem's slope."""
FAR_WELLS = 8.0
"""Slopes of wells, in units of the chord's, from which on they are the unit."""
TRIED_SLOPES = np.concatenate([-(2.0 ** np.arange(7, -11, -0.25)), [0.0], 2.0 ** np.arange(-10, 7.25, 0.25)])
"""Slopes between which a chord is sought below L: in units of the problem's slope and of 1, about 0 and the chord."""
SAME_VALUE = 1e-8
"""Difference of two values, relative to the larger or 1, that IPOPT makes."""
ROUNDED_OFF = 1e-3
"""How wide what switches is rounded off, in units of its size on the chord."""
MIXED = 1e-2
"""Share of the lesser slope from which a piece counts as mixed."""
UNUSED = 1e-6
"""Share of a slope up to which nothing has it."""
LEVEL = 1e-3
"""Rise of the chord, relative to its ordinates, that tells nothing of slopes."""
PIECE_POINTS, POINTS_OVER_JUMPS = 3, 48
"""Gauss points on a piece, and of the value that is told where L switches on the way."""
FEASIBLE = 1e-8
"""How nearly conditions are kept by what keeps them."""
IPOPT_ITERATIONS = 300
CLOSER, CLOSER_SLOPES = 3, 17
"""How often slopes are tried closer about the ends of chords, and how many."""
ENVELOPES = 6
"""How often other slopes enter, while that leads on."""
FACTORS = 2.0 ** np.arange(-6.0, 7.0)
"""Factors by which two slopes are drawn apart, or together."""


@dataclass(frozen=True)
class Relaxed:
    """A minimum of the convexified functional over polygons on ``x`` (pieces + 1,).

    ``value`` is the functional (with the person's sign), ``y`` the ordinates,
    ``slopes`` (2, pieces) the slopes of each piece and ``shares`` (2, pieces)
    the parts of it that have them. One of ``prices`` a level is what it costs,
    as it is minimised, and ``momenta`` (pieces,) are what the slopes do.
    """

    value: float
    x: np.ndarray
    y: np.ndarray
    slopes: np.ndarray
    shares: np.ndarray
    prices: np.ndarray
    momenta: np.ndarray

    @property
    def mixed(self) -> np.ndarray:
        """Pieces on which two different slopes alternate, shape (pieces,) of bool."""
        apart = np.abs(np.diff(self.slopes, axis=0)[0]) > MIXED * np.abs(self.slopes).max()
        return (self.shares.min(0) > MIXED) & apart


def applies(problem: Functional) -> bool:
    """Whether the relaxed problem can be stated: one function, first order, fixed abscissae, no other unknowns."""
    return (
        isinstance(problem, Problem)
        and problem.n == 1
        and problem.order == 1
        and not problem.unknowns
        and not any(end.slides or end.periodic for end in (problem.start, problem.end))
        and not any(isinstance(c, Holonomic | Through) for c in problem.constraints)
    )


def relaxed(problem: Problem, pieces: int, near: Relaxed | None = None) -> Relaxed | None:
    """The lowest polygon of the convexified functional that IPOPT reaches from several starts; None when none.

    One that is known is where it starts, if it is given.
    """
    program = _RelaxedProgram(problem, pieces)
    found: list[Relaxed | None] = []
    if near is not None:
        start = program.keeping_level(program.beside(near))
        # what keeps the level is an upper bound as it is, wherever IPOPT goes from it
        found = [program.solved(start), *([program.read(start)] if program.misses(start) <= FEASIBLE else [])]
    if not any(found):
        found = [program.solved(start) for start in program.starts()]
    reached = [f for f in found if f is not None]
    if not reached:
        return None
    # of those that are alike the first: about the chord one pair of slopes alternates
    values = problem.sign * np.array([f.value for f in reached])
    same = SAME_VALUE * max(1.0, float(np.abs(values).max()))
    best = reached[int(np.argmax(values <= values.min() + same))]
    # slopes stay in the wells they began in, and their sectors: those that are worth more lead on
    for _ in range(ENVELOPES):
        lower = program.solved(program.entering(best))
        if lower is None or not problem.sign * lower.value < problem.sign * best.value - same:
            break
        best = lower
    return best


class _RelaxedProgram:
    """The relaxed problem as a nonlinear program in ordinates, shares and slopes, all of size one."""

    def __init__(self, problem: Problem, pieces: int) -> None:
        self.problem = problem
        a, b = problem.span
        self.x = np.union1d(np.linspace(a, b, pieces + 1), breaks(problem))
        self.pieces = pieces = len(self.x) - 1
        ends = np.concatenate([problem.start.values(1), problem.end.values(1)])
        known = ends[~np.isnan(ends)]
        first, last = np.where(np.isnan(ends), known[0] if len(known) else 0.0, ends)
        self.line = first + (last - first) * (self.x - a) / (b - a)
        self.free = np.ones(pieces + 1, dtype=bool)
        self.free[[0, -1]] = np.isnan(ends)
        self.height = max(float(np.abs(self.line).max()), float(np.ptp(self.line)), 1e-300)
        self.height = self.height if self.height > 1e-12 * (b - a) else b - a
        rise = float(np.ptp(self.line))
        self.steep = (rise if rise > LEVEL * self.height else self.height) / (b - a)
        self.sectors = slope_sectors(problem)
        self._values = by_sector(problem, self.sectors.branches)
        self._known_chords = dict[tuple[float, ...], list[tuple[float, float]]]()
        self._at_points = PointEvaluator(self._values)
        middle = pieces // 2
        slope = float(np.diff(self.line)[middle] / np.diff(self.x)[middle]) / self.steep
        chords = self._chords(self.x[middle], self.line[middle], slope)
        farthest = max((abs(end) for chord in chords for end in chord), default=0.0)
        if farthest > FAR_WELLS:  # between ends that are all but level the slopes of wells are the measure
            self.steep *= farthest
            self.height = max(self.height, self.steep * (b - a))
        self._state()

    def _state(self) -> None:
        """The program in CasADi's symbols."""
        count, widths = self.pieces, np.diff(self.x)
        inner, share = ca.MX.sym("ordinates", int(self.free.sum())), ca.MX.sym("shares", count)
        slopes = [ca.MX.sym(name, count) for name in ("steep", "shallow")]
        sectors = ca.MX.sym("sectors", 2 * count)
        placed = ca.MX(ca.DM(self.line))
        places = np.flatnonzero(self.free)
        for i, k in enumerate(places):
            placed[int(k)] = inner[i] * self.height
        steep = [v * self.steep for v in slopes]
        sides = list(zip((share, 1 - share), steep, ca.vertsplit(sectors, count), strict=True))
        totals = self._totals(self._values, placed, sides)
        cost, added = end_cost(self.problem), ca.MX(0)
        if cost is not None:
            ends = self.x[0], placed[0], self.x[-1], placed[-1]
            added = self.problem.sign * cost(*ends, self.problem.parameter_values, [])
        mean = (placed[1:] - placed[:-1]) / (widths * self.steep)
        rows = [share * slopes[0] + (1 - share) * slopes[1] - mean]
        self._lower, self._upper = [np.zeros(count)], [np.zeros(count)]
        for j, constraint in enumerate(self.problem.of_type(Isoperimetric)):
            rows.append(totals[1 + j])
            self._bounded(constraint.interval, 1)
        self._add_bounds(rows, placed, [v * self.steep for v in slopes])
        self._w = ca.vertcat(inner, share, *slopes)
        aim = value = totals[0] + added
        if any(not self.sectors.levels or not s.depends_on(self.problem.symbols.dy) for s in on_curve(self.problem)):
            # IPOPT finds no minimum on a kink, and what it finds between few points may owe its value to a jump
            aim = self._totals(self._rounded_off(), placed, sides)[0] + added
            value = self._totals(self._values, placed, sides, POINTS_OVER_JUMPS)[0] + added
        held, self._value = ca.vertcat(*rows), ca.Function("J", [self._w, sectors], [value])
        self._told = ca.Function("rows", [self._w, sectors], [held])
        size = ca.MX.sym("size")
        self._nlp = {"x": self._w, "p": ca.vertcat(size, sectors), "f": aim / size, "g": held}

    def _bounded(self, interval: tuple[float, float], count: int) -> None:
        self._lower.append(np.full(count, interval[0]))
        self._upper.append(np.full(count, interval[1]))

    def _rounded_off(self) -> ca.Function:
        """The same with what switches in L rounded off."""
        points = points_along(self.problem, lambda x: np.interp(x, self.x, self.line)[None])
        smooth = [
            (rounded_off(self.problem, integrand, ROUNDED_OFF, points), *levels)
            for integrand, *levels in self.sectors.branches
        ]
        return by_sector(self.problem, smooth)

    def _columns(self, count: int) -> list[Any]:
        numbers = self.problem.parameter_values
        return [np.zeros((0, count)), np.tile(numbers[:, None], (1, count)), np.zeros((0, count))]

    def _totals(
        self, values: ca.Function, y: Any, sides: list[tuple[Any, Any, Any]], points: int = PIECE_POINTS
    ) -> Any:
        """The functional and the levels along the polygon: ``sides`` are shares, slopes and the sectors of these."""
        mapped, columns = values.map(self.pieces), self._columns(self.pieces)
        nodes, weights = gauss(points)
        widths, total = np.diff(self.x), ca.MX(0)
        for node, weight in zip(0.5 * (1 + nodes), 0.5 * weights, strict=True):
            x, at = (self.x[:-1] + node * widths)[None], (y[:-1] * (1 - node) + y[1:] * node).T
            for part, slope, sector in sides:
                total = total + weight * ca.mtimes(mapped(x, at, slope.T, *columns, sector.T), part * widths)
        return total

    def _add_bounds(self, rows: list[Any], y: Any, slopes: list[Any]) -> None:
        """Every bound, in the middle of each piece, for both slopes."""
        for t in self.problem.traced:
            if isinstance(t.constraint, Bound):
                function = ca.Function("bound", self.problem.symbols.all, [ca.densify(t.expression)]).map(self.pieces)
                x, at = 0.5 * (self.x[1:] + self.x[:-1])[None], 0.5 * (y[1:] + y[:-1]).T
                for slope in slopes:
                    rows.append(function(x, at, slope.T, *self._columns(self.pieces)).T)
                    self._bounded(t.constraint.interval, self.pieces)

    def starts(self) -> Iterator[np.ndarray]:
        """Starts on the chord and on least polygons: between the slopes of L's convex envelope, or on either side."""
        yield self.between_touched(self.line, np.full(self.pieces, self.x[self.pieces // 2]))
        chord = np.diff(self.line) / (np.diff(self.x) * self.steep)
        middle = self.pieces // 2
        chords = self._chords(self.x[middle], self.line[middle], float(chord[middle]))
        if len(chords) > 1:  # of several wells a minimiser may use the outermost, whatever lies between
            low, high = (np.full(self.pieces, end) for end in (chords[0][0], chords[-1][1]))
            yield self._start(self.line, np.clip((high - chord) / (high - low), 0.0, 1.0), low, high)
        for spread in SPREADS:
            yield self._start(self.line, np.full(self.pieces, 0.5), chord - spread, chord + spread)
        for x, y in least_relaxed(self.problem, self.steep):
            yield self.between_touched(np.interp(self.x, x, y))

    def beside(self, known: Relaxed) -> np.ndarray:
        """The start on another polygon."""
        piece = np.searchsorted(known.x, 0.5 * (self.x[1:] + self.x[:-1])) - 1
        y = np.interp(self.x, known.x, known.y)
        return self._start(y, known.shares[0, piece], *(known.slopes[:, piece] / self.steep))

    def keeping_level(self, start: np.ndarray) -> np.ndarray:
        """The start with its slopes drawn apart until they sum the level on the way; itself where none do, or many."""
        inner, levels = int(self.free.sum()), list(self.problem.of_type(Isoperimetric))
        y = self.line.copy()
        y[self.free] = start[:inner] * self.height
        share, steep, shallow = start[inner:].reshape(3, self.pieces)
        mean = np.diff(y) / (np.diff(self.x) * self.steep)
        apart = steep - shallow

        def drawn(factor: float) -> np.ndarray:
            """The start with the slopes of all pieces that ``factor`` times as far apart."""
            return np.concatenate(
                [start[:inner], share, mean + (1 - share) * factor * apart, mean - share * factor * apart]
            )

        if len(levels) != 1 or not levels[0].equality:
            return drawn(1.0)

        def missed(factor: float) -> float:
            return float(self._of(self._told, drawn(factor))[self.pieces]) - levels[0].interval[0]

        sides = np.sign([missed(factor) for factor in FACTORS])
        changes = np.flatnonzero(sides[1:] * sides[:-1] < 0)
        if not len(changes):
            return drawn(1.0)
        nearest = changes[np.argmin(np.abs(changes - len(FACTORS) // 2))]
        return drawn(brentq(missed, *FACTORS[nearest : nearest + 2], xtol=1e-15, rtol=1e-14))

    def misses(self, w: np.ndarray) -> float:
        """By how much what is required is missed at most."""
        held = self._of(self._told, w)
        low, high = np.concatenate(self._lower), np.concatenate(self._upper)
        return float(np.maximum(low - held, held - high).max(initial=0.0))

    def between_touched(self, y: np.ndarray, places: np.ndarray | None = None) -> np.ndarray:
        """The start on a polygon whose slopes are those that the convex envelope touches L at.

        That is looked up at one place for each piece, in its middle unless others are given.
        """
        places = 0.5 * (self.x[1:] + self.x[:-1]) if places is None else places
        slopes = np.diff(y) / (np.diff(self.x) * self.steep)
        low, high = np.array(
            [self._touched(x, float(np.interp(x, self.x, y)), float(v)) for x, v in zip(places, slopes, strict=True)]
        ).T
        apart = high > low
        share = np.clip(np.divide(high - slopes, high - low, out=np.full(self.pieces, 0.5), where=apart), 0.0, 1.0)
        return self._start(y, share, low, high)

    def entering(self, known: Relaxed) -> np.ndarray:
        """The start on a known polygon with the slopes of which L, less what the momenta give for it, is least.

        Each takes the place of the one on its side of the mean slope, as columns enter a linear program: on that slope
        the momentum's line through the known ones does not lie below L.
        """
        mean = np.diff(known.y) / np.diff(known.x)
        found = [self._worth_most(known, sector) for sector in range(self.sectors.edges.shape[1])]
        slopes, worth = (np.array(rows) for rows in zip(*found, strict=True))
        best = np.take_along_axis(slopes, np.argmin(worth, axis=0)[None], axis=0)[0]
        # a slope that nothing has is none to go on with
        steep, shallow = np.where(known.mixed, np.sort(known.slopes, axis=0), mean)
        low = np.minimum(np.where(best <= mean, best, steep), mean)
        high = np.maximum(np.where(best > mean, best, shallow), mean)
        share = np.divide(high - mean, high - low, out=np.full(self.pieces, 0.5), where=high > low)
        return self._start(known.y, share, low / self.steep, high / self.steep)

    def _worth_most(self, known: Relaxed, sector: int) -> tuple[np.ndarray, np.ndarray]:
        """The slopes of a sector at which L less the momentum is least on each piece, and that; (pieces,) each."""
        middle, y = (0.5 * (rows[1:] + rows[:-1]) for rows in (known.x, known.y))
        about = float(np.median(np.diff(known.y) / np.diff(known.x))) / self.steep
        tried = np.tile(
            np.unique(np.clip(self.steep * self._tried(about), *self.sectors.edges[:, sector])), (len(y), 1)
        )
        prices, none = np.array([1.0, *known.prices]), np.zeros((1, 0))
        numbers = [none, self.problem.parameter_values[None], none, np.full((1, 1), float(sector))]
        best = least = np.zeros(len(y))
        for _ in range(CLOSER + 1):
            shape = tried.shape
            points = [np.repeat(rows, shape[1])[:, None] for rows in (middle, y)]
            summed = self._at_points(tried.size, *points, tried.reshape(-1, 1), *numbers) @ prices
            worth = summed.reshape(shape) - known.momenta[:, None] * tried
            worth = np.where(np.isfinite(worth), worth, np.inf)
            k = np.argmin(worth, axis=1)[:, None]
            best, least = (np.take_along_axis(rows, k, axis=1)[:, 0] for rows in (tried, worth))
            low, high = (np.take_along_axis(tried, np.clip(k + s, 0, shape[1] - 1), axis=1) for s in (-1, 1))
            tried = low + (high - low) * np.linspace(0.0, 1.0, CLOSER_SLOPES)
        return best, least

    def _start(self, y: np.ndarray, share: np.ndarray, steep: np.ndarray, shallow: np.ndarray) -> np.ndarray:
        return np.concatenate([y[self.free] / self.height, share, steep, shallow])

    def _touched(self, at: float, ordinate: float, slope: float) -> tuple[float, float]:
        """The slopes, in units of their own, at which the chord below L about one touches it; twice it where L does."""
        for low, high in self._chords(at, ordinate, slope):
            if low <= slope < high:
                return low, high
        return slope, slope

    def _chords(self, at: float, ordinate: float, slope: float) -> list[tuple[float, float]]:
        """The slopes, in units of their own, at which chords below L touch it at a place; looked for about one too."""
        asked = at, ordinate, slope, self.steep
        if asked not in self._known_chords:  # all pieces of a straight line may ask the same
            self._known_chords[asked] = self._chords_found(at, ordinate, slope)
        return self._known_chords[asked]

    def _chords_found(self, at: float, ordinate: float, slope: float) -> list[tuple[float, float]]:
        tried, values = self._finite(at, ordinate, self._tried(slope))
        hull = _lower_hull(tried, values)
        for _ in range(CLOSER):
            # a chord ends at the bottom of a well, as near as it is known: L may lie below one that ends beside it
            edges = {int(k) for pair in pairwise(hull) if pair[1] - pair[0] > 1 for k in pair}
            ends = [(tried[max(k - 1, 0)], tried[min(k + 1, len(tried) - 1)]) for k in edges]
            beside = [np.linspace(*pair, CLOSER_SLOPES) for pair in ends]
            tried, values = self._finite(at, ordinate, np.unique(np.concatenate([tried, *beside])))
            hull = _lower_hull(tried, values)
        return [(float(tried[k]), float(tried[j])) for k, j in pairwise(hull) if j - k > 1]

    def _tried(self, slope: float) -> np.ndarray:
        """Slopes that are tried, in units of their own, about 0 and one; the levels are among them."""
        levels = np.array([level.slope for level in self.sectors.levels])
        measures = [TRIED_SLOPES, TRIED_SLOPES / self.steep]
        return np.unique(np.concatenate([*measures, *(slope + row for row in measures), levels / self.steep]))

    def _finite(self, at: float, ordinate: float, tried: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes, in units of their own, at which L is finite at a place, and L there."""
        values = self._lowest(np.full(len(tried), at), np.full(len(tried), ordinate), self.steep * tried)[0]
        finite = np.isfinite(values)
        return tried[finite], values[finite]

    def _lowest(self, x: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """L at m points, the lowest that it comes to beside a level or is at it, and the sector of that; (m,) each."""
        sectors, none = self.sectors.of(slopes), np.zeros((1, 0))
        points = [np.tile(rows, 3)[:, None] for rows in (x, y, slopes)]
        numbers = [none, self.problem.parameter_values[None], none, sectors.reshape(-1, 1).astype(float)]
        values = self._at_points(3 * len(x), *points, *numbers)[:, 0].reshape(3, -1)
        best = np.argmin(np.where(np.isfinite(values), values, np.inf), axis=0)
        return tuple(np.take_along_axis(rows, best[None], axis=0)[0] for rows in (values, sectors))

    def _sectors(self, w: np.ndarray) -> np.ndarray:
        """The sectors of both slopes of each piece, (2 pieces,): at a level that in which L is lowest."""
        if not self.sectors.levels:
            return np.zeros(2 * self.pieces, dtype=int)
        inner, y = int(self.free.sum()), self.line.copy()
        y[self.free] = w[:inner] * self.height
        x, y = (np.tile(0.5 * (rows[1:] + rows[:-1]), 2) for rows in (self.x, y))
        return self._lowest(x, y, w[inner + self.pieces :] * self.steep)[1]

    def _of(self, function: ca.Function, w: np.ndarray) -> np.ndarray:
        """A function of the program, at numbers that are not bound to sectors."""
        return np.asarray(function(w, self._sectors(w))).ravel()

    @cached_property
    def _solver(self) -> ca.Function:
        """IPOPT on the program, whose parameter is the unit of the functional."""
        settings = {
            "tol": 1e-9, "max_iter": IPOPT_ITERATIONS, "bound_relax_factor": 0.0, "mu_strategy": "adaptive",
        }  # fmt: skip
        options = quiet(settings) | {"no_nlp_grad": True, "calc_lam_p": False}
        return ca.nlpsol("relaxed", "ipopt", self._nlp, options)

    def solved(self, guess: np.ndarray) -> Relaxed | None:
        """A minimum from a start."""
        count, start = self.pieces, self.line[self.free]
        size, sectors = abs(float(self._of(self._value, guess)[0])), self._sectors(guess)
        if not np.isfinite(size):
            return None
        room = np.full(len(guess), np.inf)
        low, high = -room, room.copy()
        low[len(start) : len(start) + count], high[len(start) : len(start) + count] = 0.0, 1.0
        levels = {"lbg": np.concatenate(self._lower), "ubg": np.concatenate(self._upper)}
        low[len(start) + count :], high[len(start) + count :] = self.sectors.edges[:, sectors] / self.steep
        numbers = np.array([size or 1.0, *sectors])
        result = self._solver(x0=guess, p=numbers, lbx=low, ubx=high, **levels)
        # a share a little below nothing, of a slope far away, makes a value of any size
        found = np.clip(np.asarray(result["x"]).ravel(), low, high)
        # what keeps the conditions is an upper bound, whether or not IPOPT calls it a minimum
        if not (self.misses(found) <= FEASIBLE and np.isfinite(self._of(self._value, found)[0])):
            return None
        return self.read(found, np.asarray(result["lam_g"]).ravel() * (size or 1.0))

    def read(self, w: np.ndarray, rows: np.ndarray | None = None) -> Relaxed:
        """What numbers stand for, and the multipliers of the rows; nothing has a price where these are not known."""
        levels = len(list(self.problem.of_type(Isoperimetric)))
        rows = np.zeros(self.pieces + levels) if rows is None else rows
        prices, momenta = rows[self.pieces :][:levels], -rows[: self.pieces] / (np.diff(self.x) * self.steep)
        inner = int(self.free.sum())
        y = self.line.copy()
        y[self.free] = w[:inner] * self.height
        share, one, other = w[inner:].reshape(3, self.pieces)
        sign = self.problem.sign
        value = sign * float(self._of(self._value, w)[0])
        # a slope that nothing has may be any
        one, other = np.where(share > UNUSED, one, other), np.where(share < 1 - UNUSED, other, one)
        return Relaxed(
            value, self.x, y, np.array([one, other]) * self.steep, np.array([share, 1 - share]), prices, momenta
        )


def _lower_hull(x: np.ndarray, y: np.ndarray) -> list[int]:
    """The numbers of the points of a graph that its convex envelope touches (Andrew's monotone chain)."""
    across, up = x.tolist(), y.tolist()  # single entries of an array are slow
    hull: list[int] = []
    for k, (right, high) in enumerate(zip(across, up, strict=True)):
        while len(hull) > 1:
            first, middle = hull[-2:]
            before, after = across[middle] - across[first], right - across[middle]
            if (up[middle] - up[first]) * after < (high - up[middle]) * before:  # the polygon through them is convex
                break
            hull.pop()
        hull.append(k)
    return hull
