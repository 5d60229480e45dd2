"""Lines on which kinks of the slope hold a curve, placed from a path that shows them.

A line begins and ends on curves that move where their equation puts them, or goes on as a line of the next kink, with
the momentum that the pieces of L have there; in between what presses it takes the momentum from the one to the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import root

from varcalc.existence.least_paths import Chain, LeastPath
from varcalc.existence.linear_between import Beside, LinearBetweenKinks, around
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.roots import bracketed_newton
from varcalc.problem.breaks import breaks

PIECES_OF_LINE, POINTS_OF_LINE = 256, 4
"""Pieces of a line, and Gauss points on each, by which it is summed what presses it."""
LEVELS_BESIDE = 1.5 * 3.0 ** np.arange(6)
"""Levels of the path about which a curve that moves is looked for, one after the other."""
NEWTON_ROUND_OFF = 4e-16
"""Relative step of Newton's method to it that is round-off."""
ON_SURFACE = 1e-11
"""Distance from a kink of the place, in units of the curve's size, at which a curve is on it."""
PLACES_OF_CHANGE, HALVINGS = 129, 48
"""Places between which it is seen where a curve comes to such a kink, and times that what lies between is halved."""
PLACED_TO, STEPS_TO_PLACE, STRAYING = 1e-13, 60, 4.0
"""Relative error in the unknowns of a chain of lines to which they are looked for, looks for each of them at most, and
how far a chain may be from where it was seen, in pieces of the path.
"""
BEYOND_KINK = 1e-6
"""By what part of a kink's strength a momentum may be beyond it."""
SHORTEST_LINE, AS_LONG_AS_SEEN = 1e-9, 0.4
"""Part of the interval that is as good as none, and of a line that goes on as it came that is another one."""
MOST_PARTS = 4
"""Parts at most of what looks like one line."""


class OnLines:
    """Where curves that move are, by a path that they are near to, and what is summed along lines."""

    def __init__(self, kinks: LinearBetweenKinks, path: LeastPath) -> None:
        self.kinks, self.path, self.problem = kinks, path, kinks.problem
        self.span: tuple[float, float] = self.problem.span
        self.free = [not (end.fixed or end.periodic) for end in (self.problem.start, self.problem.end)]
        self.given = [end.fixed for end in (self.problem.start, self.problem.end)]
        self.size = float(np.abs(path.ordinates).max() + np.ptp(path.ordinates)) + path.step
        self._breaks = np.array(breaks(self.problem))

    def near(self, x: np.ndarray) -> np.ndarray:
        """Ordinates of the path at x (m,)."""
        return np.interp(around(self.problem, x), self.path.x, self.path.ordinates)

    def moving(self, piece: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Ordinates at x (m,), near y (m,), where what is missed of the equation changes its sign upwards; else NaN."""
        low, high = np.full(len(x), np.nan), np.full(len(x), np.nan)
        for levels in LEVELS_BESIDE * self.path.step:
            left = np.flatnonzero(np.isnan(low))
            if not len(left):
                break
            below, above = (self.kinks.beside(x[left], y[left] + way * levels).missed[piece] for way in (-1, 1))
            known = left[(below <= 0.0) & (above >= 0.0)]
            low[known], high[known] = y[known] - levels, y[known] + levels

        def falling(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            beside = self.kinks.beside(x, at)
            return -beside.missed[piece], -beside.rates[1][piece]

        return bracketed_newton(falling, low, high, 0.5 * (low + high), relative=NEWTON_ROUND_OFF)[0]

    def slopes(self, piece: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The slopes there of the curve that moves on a piece, which may be a kink of the place."""
        beside = self.kinks.beside(x, y)
        slopes = -beside.rates[0][piece] / beside.rates[1][piece]
        for on, by_x, by_y in zip(self._on(beside), *beside.surface_rates, strict=True):
            slopes = np.where(on, -by_x / by_y, slopes)
        return slopes

    def _on(self, beside: Beside) -> np.ndarray:
        """Whether points (m,) are on the kinks of the place: (surfaces, m)."""
        return np.abs(beside.surfaces) <= ON_SURFACE * self.size * np.abs(beside.surface_rates[1])

    def sides(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """On which sides of the kinks of the place points (m,) are, 0 for on one: (surfaces, m)."""
        beside = self.kinks.beside(x, y)
        return np.where(self._on(beside), 0.0, np.sign(beside.surfaces))

    def changes(self, along: Callable[[np.ndarray], np.ndarray], start: float, end: float) -> list[float]:
        """Abscissae in between at which L changes, or a curve comes to a kink of the place, or leaves it."""
        first, last = self.span
        if self.problem.start.periodic:
            seams = [*self._breaks, *(self._breaks - (last - first)), *(self._breaks + (last - first)), first, last]
        else:
            seams = self._breaks.tolist()
        found = [float(x) for x in seams if start < x < end]
        if not self.kinks.surfaces:
            return sorted(found)
        x = np.linspace(start, end, PLACES_OF_CHANGE)
        sides = self.sides(x, along(x))
        at = np.flatnonzero((np.diff(sides, axis=1) != 0).any(axis=0))
        low, high, before = x[at], x[at + 1], sides[:, at]
        for _ in range(HALVINGS if len(at) else 0):
            middle = 0.5 * (low + high)
            same = (self.sides(middle, along(middle)) == before).all(axis=0)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return sorted([*found, *low.tolist()])

    def pressed(self, kink: int, start: float, end: float, ordinate: float) -> tuple[np.ndarray, np.ndarray]:
        """Places along a line (m + 1,), from its start, and what it has been pressed by up to each."""

        def along(x: np.ndarray) -> np.ndarray:
            return ordinate + self.kinks.slopes[kink] * (x - start)

        way = 1.0 if end >= start else -1.0
        marks = self.changes(along, min(start, end), max(start, end))[:: int(way)]
        edges = [start, *marks, end]
        share = max(1, PIECES_OF_LINE // (len(edges) - 1))
        places = np.concatenate([np.linspace(a, b, share + 1)[:-1] for a, b in pairwise(edges)] + [np.array([end])])
        x, weights = composite_gauss(places, POINTS_OF_LINE)
        terms = (self.kinks.beside(x, along(x)).pressed[kink] * weights).reshape(-1, POINTS_OF_LINE)
        return places, np.append(0.0, np.cumsum(terms.sum(axis=1)))

    def momenta(self, chain: Chain) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Places along each line of a chain, what the momentum is there, and the ordinates.

        Where nothing else says what the first one is it is half way between the least and the greatest that would do.
        """
        known = self.known(chain)
        number = min(known) if known else 0
        lines, y = list[tuple[np.ndarray, np.ndarray, np.ndarray]](), chain.ordinate
        for kink, (start, end) in zip(chain.kinks, pairwise(chain.corners), strict=True):
            x, pressed = self.pressed(kink, start, end, y)
            lines.append((x, pressed, y + self.kinks.slopes[kink] * (x - start)))
            y += self.kinks.slopes[kink] * (end - start)
        totals = np.append(0.0, np.cumsum([pressed[-1] for _, pressed, _ in lines]))
        if known:
            begun = known[number] - totals[number]
        else:
            room = [self.kinks.beside(x, on).momenta[k : k + 2] - pressed - total for k, (x, pressed, on), total
                    in zip(chain.kinks, lines, totals[:-1], strict=True)]  # fmt: skip
            begun = 0.5 * (max(r[0].max() for r in room) + min(r[1].min() for r in room))
        for (x, pressed, on), total in zip(lines, totals[:-1], strict=True):
            yield x, begun + total + pressed, on

    def known(self, chain: Chain) -> dict[int, float]:
        """The momenta that the pieces of L, or a free end, have at corners of a chain, by their numbers."""
        x, y = np.array(chain.corners), self.ordinates(chain)
        momenta = self.kinks.beside(x, y).momenta
        known = {k + 1: float(momenta[max(pair), k + 1]) for k, pair in enumerate(pairwise(chain.kinks))}
        if self.closes(chain):
            known |= {k: float(momenta[max(chain.kinks[0], chain.kinks[-1]), k]) for k in (0, len(x) - 1)}
        for side, free, number in zip(chain.sides, self.free, (0, len(x) - 1), strict=True):
            if side is not None:
                known[number] = float(momenta[side, number])
            elif free:
                known[number] = 0.0
        return dict(sorted(known.items()))

    def closes(self, chain: Chain) -> bool:
        """Whether it is all of a closed curve, from one of its corners on."""
        return self.problem.start.periodic and chain.sides == (None, None) and len(chain.kinks) > 1

    def ordinates(self, chain: Chain) -> np.ndarray:
        """The ordinates of the corners of a chain."""
        rises = self.kinks.slopes[list(chain.kinks)] * np.diff(chain.corners)
        return chain.ordinate + np.append(0.0, np.cumsum(rises))

    def beyond(self, chain: Chain) -> tuple[int, float, int] | None:
        """Where the momentum along a chain is furthest beyond what a kink takes: the line, x, the piece; else None."""
        worst: tuple[float, tuple[int, float, int]] | None = None
        for number, (kink, (x, momenta, y)) in enumerate(zip(chain.kinks, self.momenta(chain), strict=True)):
            lower, upper = self.kinks.beside(x, y).momenta[kink : kink + 2]
            over = np.array([lower - momenta, momenta - upper]) / float((upper - lower).max())
            side, at = np.unravel_index(int(np.argmax(over)), over.shape)
            if over[side, at] > BEYOND_KINK and (worst is None or over[side, at] > worst[0]):
                worst = float(over[side, at]), (number, float(x[at]), kink + int(side))
        return None if worst is None else worst[1]

    def holds(self, chain: Chain) -> bool:
        """Whether the momentum along a chain goes from each that is known to the next, and no kink takes more."""
        known, size = self.known(chain), 0.0
        turned = [0.0]
        for kink, (x, momenta, y) in zip(chain.kinks, self.momenta(chain), strict=True):
            turned.append(turned[-1] + float(momenta[-1] - momenta[0]))
            lower, upper = self.kinks.beside(x, y).momenta[kink : kink + 2]
            size = max(size, float((upper - lower).max()))
        missed = [(known[b] - known[a]) - (turned[b] - turned[a]) for a, b in pairwise(known)]
        if self.problem.start.periodic and chain.sides == (None, None):
            missed.append(turned[-1])
        return all(abs(m) <= BEYOND_KINK * size for m in missed) and self.beyond(chain) is None


def _solved(places: OnLines, chain: Chain, parts: int = MOST_PARTS) -> Iterator[Chain]:
    """A chain that begins and ends where the equations say, begun from one nearby; none where it has no length.

    One along which the momentum would be more than the kinks take is at most so many ``parts``.
    """
    solved = _at_its_place(places, chain)
    if solved is None:
        return
    beyond = places.beyond(solved) if parts > 1 else None
    if beyond is None:
        yield solved
        return
    number, x, piece = beyond
    ordinate = float(np.interp(x, solved.corners, places.ordinates(solved)))
    first = replace(
        solved, corners=(*solved.corners[: number + 1], x), kinks=solved.kinks[: number + 1],
        sides=(solved.sides[0], piece),
    )  # fmt: skip
    last = Chain((x, *solved.corners[number + 1 :]), ordinate, solved.kinks[number:], (piece, solved.sides[1]))
    yield from _solved(places, first, parts - 1)
    yield from _solved(places, last, parts - 1)


def _at_its_place(places: OnLines, chain: Chain) -> Chain | None:
    """A chain of which all lines have a length, as its equations say; None for none."""
    begun = np.array([*chain.corners, chain.ordinate])
    found = root(
        lambda z: _missed(places, _of(chain, z)), begun, tol=PLACED_TO, options={"maxfev": STEPS_TO_PLACE * len(begun)}
    )
    solved = _of(chain, found.x)
    first, last = places.span
    at_ends = ((0, chain.sides[0]), (-1, chain.sides[1]))
    fixed = not places.closes(chain)
    edges = [
        x if fixed and side is None else solved.corners[k] for (k, side), x in zip(at_ends, places.span, strict=True)
    ]
    solved = replace(solved, corners=(edges[0], *solved.corners[1:-1], edges[1]))
    room = STRAYING * (places.path.x[1] - places.path.x[0])
    near = solved.corners[0] <= chain.corners[-1] + room and solved.corners[-1] >= chain.corners[0] - room
    # a line that ends with the momentum with which it began solves them with no length, wherever a curve moves
    pieces = [chain.sides[0], *map(max, pairwise(chain.kinks)), chain.sides[1]]
    least = [
        AS_LONG_AS_SEEN * length if a == b is not None else SHORTEST_LINE * (last - first)
        for (a, b), length in zip(pairwise(pieces), np.diff(chain.corners), strict=True)
    ]
    long = bool((np.diff(solved.corners) > least).all()) and np.isfinite(found.x).all()
    if not (near and long):
        return None
    beyond = [not places.problem.start.periodic and out for out in (edges[0] < first, edges[1] > last)]
    if not any(beyond):
        return solved
    sides = [None if out else side for out, side in zip(beyond, chain.sides, strict=True)]
    return _at_its_place(places, replace(_within(solved, places.span), sides=(sides[0], sides[1])))


def _within(chain: Chain, span: tuple[float, float]) -> Chain:
    """A chain whose first and last lines end with the interval."""
    start, end = max(chain.corners[0], span[0]), min(chain.corners[-1], span[1])
    return replace(chain, corners=(start, *chain.corners[1:-1], end))


def _of(chain: Chain, z: np.ndarray) -> Chain:
    return replace(chain, corners=tuple(z[:-1].tolist()), ordinate=float(z[-1]))


def _missed(places: OnLines, chain: Chain) -> list[float]:
    """What a chain misses of its equations: as many as there are corners, and one."""
    x, y, problem = np.array(chain.corners), places.ordinates(chain), places.problem
    out = list[float]()
    whole = chain.sides == (None, None)
    for side, given, end, number in zip(
        chain.sides, places.given, (problem.start, problem.end), (0, len(x) - 1), strict=True
    ):
        if side is not None:
            out.append(_off(places, side, x[number], y[number]))
            continue
        if places.closes(chain):
            out.append(y[-1] - y[0] if number else x[-1] - x[0] - (places.span[1] - places.span[0]))
            continue
        out.append(x[number] - places.span[min(number, 1)])
        if given and not (all(places.given) and whole and number and len(chain.kinks) == 1):
            out.append(y[number] - float(end.values(1)[0]))
    known = places.known(chain)
    pressed = np.append(0.0, np.cumsum([
        places.pressed(kink, a, b, at)[1][-1] for kink, (a, b), at in zip(chain.kinks, pairwise(x), y, strict=False)
    ]))  # fmt: skip
    out += [known[b] - known[a] - float(pressed[b] - pressed[a]) for a, b in pairwise(known)]
    if whole and problem.start.periodic and not places.closes(chain):
        out.append(float(pressed[-1]))
    return _of_length(chain, out, x, places)


def _of_length(chain: Chain, missed: list[float], x: np.ndarray, places: OnLines) -> list[float]:
    """The same, but that a line of no length does not solve them, wherever it is, that begins and ends as it may."""
    first, last = chain.sides
    if len(chain.kinks) > 1 or (first, last) == (None, None):
        return missed
    share = np.float64(x[1] - x[0]) / max(chain.corners[1] - chain.corners[0], SHORTEST_LINE)
    if first == last:
        start, end, turned = missed
        return [start, (end - start) / share, turned / share**2]
    if any(given and side is None for given, side in zip(places.given, chain.sides, strict=True)):
        at = 0 if last is None else -1
        return [m / share if k == at % len(missed) else m for k, m in enumerate(missed)]
    return missed


def _off(places: OnLines, piece: int, x: float, y: float) -> float:
    """How far a point is from the curve that moves on a piece, in its equation, or that of a kink of the place."""
    at, on = np.array([x]), np.array([y])
    if places.kinks.surfaces:
        found = places.moving(piece, at, on)
        number = np.flatnonzero(places.sides(at, found)[:, 0] == 0)
        if len(number):
            return float(places.kinks.beside(at, on).surfaces[number[0], 0])
    return float(places.kinks.beside(at, on).missed[piece, 0])


def settled(places: OnLines, guesses: Sequence[Chain]) -> list[Chain] | None:
    """The chains that begin near ``guesses``, of which two that lead to none apart are one where their lines meet.

    None where they overlap all the same.
    """
    left, known = sorted(guesses, key=lambda c: c.corners[0]), dict[Chain, list[Chain]]()

    def solved(guess: Chain) -> list[Chain]:
        """The chains that a guess leads to, if they hold and follow each other; none where they do not."""
        if guess not in known:
            parts = list(_solved(places, guess))
            stand = all(map(places.holds, parts)) and all(_in_order(a, b) for a, b in pairwise(parts))
            known[guess] = parts if stand else []
        return known[guess]

    k, width, kinks = 0, places.span[1] - places.span[0], len(places.kinks.slopes)
    while k < len(left) - 1 + int(places.problem.start.periodic):
        at_seam = k == len(left) - 1
        following = left[0].moved(width) if at_seam else left[k + 1]
        first, last = solved(left[k]), solved(following)
        apart = first and last and _in_order(first[-1], last[0])
        if at_seam and k == 0:
            closed = None if apart else left[0].closed(width)
            return first if closed is None else solved(closed)
        ones = [] if apart else list(left[k].together_with(following, kinks))
        one = next(filter(solved, ones), None)
        if one is None and k + 2 < len(left) and not last:
            three = [whole for both in ones for whole in both.together_with(left[k + 2], kinks)]
            if (one := next(filter(solved, three), None)) is not None:
                del left[k + 2]
        if one is None:
            k += 1
        else:
            left = [one.moved(-width), *left[1:-1]] if at_seam else [*left[:k], one, *left[k + 2 :]]
            k = max(k - 1, 0)
    chains = [chain for guess in left for chain in solved(guess)]
    return chains if all(_in_order(a, b) for a, b in pairwise(chains)) else None


def _in_order(chain: Chain, other: Chain) -> bool:
    return chain.corners[-1] <= other.corners[0]
