"""All zeros of combinations of smooth functions, by Chebyshev series that stand for them.

A function that is costly to evaluate is replaced, panel by panel, by a Chebyshev series whose last coefficients are
round-off and which foretells the function between its points (Boyd, "Solving Transcendental Equations", SIAM 2014,
ch. 3; Battles and Trefethen, SIAM J. Sci. Comput. 25 (2004) 1743). A linear combination of functions is then a
polynomial on each panel. The panel is halved until the coefficients show that the polynomial has no zero in a part, or
is monotone there: no zero can be passed over, however many combinations share the functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce
from typing import Protocol

import numpy as np
from numpy.polynomial import chebyshev

from varcalc.numerics.chebyshev import roots, to_series
from varcalc.numerics.roots import bracketed_newton

PROXY_DEGREE = 15
"""Of the series: about the cheapest for twelve digits, whatever the function."""
PROXY_RESOLVED = 1e-11
"""Of a function's largest value in a panel: the last coefficients of a series that stands for it."""
ENOUGH = PROXY_RESOLVED / 2
"""How well values need be told for that."""
FORETOLD = 10.0
"""By how many times that the series may be off at places that it has not seen."""
CHECKED = np.array([-0.613, 0.287])
"""Where that is looked at, in a panel from -1 to 1."""
MOST_RATIO = 30.0
"""Of the largest to the least value in a panel: beside what is large, what is small has no digits."""
PANEL_HALVINGS = 12
"""Of a panel; one that is no smooth function's even so is given up."""
PARTINGS = 20
"""Halvings of a panel after which a part in which a polynomial has both a zero and a flat place is one place."""
SLACK = 1e-10
"""Of what is summed: what the series may be off."""
TORN = 1e-6
"""Of the sum of coefficients: a value that is farther off from the series at a break is that of its other side."""
BISECTIONS = 40
"""To begin with, on the series."""
BESIDE = 0.1
"""Of a part: how far beside it a zero may turn out to be."""
CLOSE, SUM_ROUND_OFF, NOISY = 1e-15, 4e-15, 0.25
"""Of a panel, of what is summed, and of the noise of that: a zero is not told more closely."""
RATE_OFF, BENT = PROXY_RESOLVED * PROXY_DEGREE**2, PROXY_DEGREE**4 / 6
"""Of what is summed: what the derivative of a series may be off, and half the second one at the most (Markov)."""
IS_ZERO = 1e-9
"""Of what is summed: what is left of a combination at its zero, beside noise."""


def reduced(function: np.ufunc, values: np.ndarray, axis: int) -> np.ndarray:
    """``function.reduce`` along a short axis: it takes a tenth of the time, one slice after the other."""
    return reduce(function, np.moveaxis(values, axis, 0))


class Functions(Protocol):
    """Families of F functions of one unknown each, and what need not be known of them; families go by numbers."""

    def __call__(self, family: np.ndarray, at: np.ndarray, enough: float = 0.0) -> np.ndarray:
        """Values (m, F) of families (m,) at places (m,), as well as they can be told or ``enough``, of their sizes.

        They are not numbers where a function does not exist, -∞ where it is not known.
        """
        ...

    def sampled(self, family: np.ndarray, at: np.ndarray, enough: float) -> np.ndarray:
        """The same (P, m, F) at places (P, m) of panels; of what nobody asks for in a panel, roughly."""
        ...

    def scale(self, family: np.ndarray) -> np.ndarray:
        """Sizes (m, F) of the functions below which they need not be told from zero."""
        ...

    def noise(self, family: np.ndarray, at: np.ndarray) -> np.ndarray:
        """How much of the values (m, F) of families (m,) at places (m,) is round-off."""
        ...

    def inside(self, at: np.ndarray, way: int) -> np.ndarray:
        """Where to look in place of the edges ``at`` (P,) of panels on the side ``way``, for those that are breaks."""
        ...

    def beyond(self, family: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Which functions (P, F) of families (P,) nobody asks for in panels where they have ``values`` (P, m, F)."""
        ...


@dataclass(frozen=True)
class Proxies:
    """Series of F functions of the ``family`` (P,) on panels from ``low`` to ``high`` (P,): ``coefficients`` (P, F, N).

    Panels are in order of families, and in each of places; those where nobody asks for any function are left out.
    ``at_edges`` (P, 2, F) are the functions' own values at
    ``ends`` (P, 2), the edges or next to those. ``given_up`` counts by family (n,) panels on which no series stands
    for what exists, ``looked_at`` (n,) places.
    """

    functions: Functions
    family: np.ndarray
    low: np.ndarray
    high: np.ndarray
    coefficients: np.ndarray
    ends: np.ndarray
    at_edges: np.ndarray
    given_up: np.ndarray
    looked_at: np.ndarray

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The least and the greatest (P, F) that the series can be on their panels.

        Between 4n Chebyshev points a polynomial of degree n is no more than 1/cos(π/8) times as far from a value as
        at them (Ehlich and Zeller, Math. Z. 86 (1964) 41).
        """
        values = self.coefficients @ _AT_MANY.T
        middle, half = (values.max(-1) + values.min(-1)) / 2, (values.max(-1) - values.min(-1)) / 2
        return middle - half / np.cos(np.pi / 8), middle + half / np.cos(np.pi / 8)


_POINTS, _TO_SERIES = roots(PROXY_DEGREE + 1), to_series(PROXY_DEGREE + 1)
_HALVES = [_TO_SERIES @ chebyshev.chebvander((_POINTS + side) / 2, PROXY_DEGREE) for side in (-1, 1)]
"""From a series to those on the left and on the right half of its panel."""
_AT_MANY = chebyshev.chebvander(roots(4 * PROXY_DEGREE), PROXY_DEGREE)
_AT_CHECKED = chebyshev.chebvander(CHECKED, PROXY_DEGREE)


@dataclass(frozen=True)
class ProxyPanels:
    """Panels of each ``family`` (P,) from ``low`` to ``high`` (P,) with the functions' ``values`` (P, N + 2, F).

    Series of ``coefficients`` (P, F, N) stand for the functions where they are ``fine`` (P,).
    """

    family: np.ndarray
    low: np.ndarray
    high: np.ndarray
    values: np.ndarray
    fine: np.ndarray
    coefficients: np.ndarray

    @classmethod
    def of(cls, functions: Functions, family: np.ndarray, low: np.ndarray, high: np.ndarray) -> ProxyPanels:
        """One series on each panel."""
        places = ((low + high) / 2)[:, None] + ((high - low) / 2)[:, None] * np.append(_POINTS, CHECKED)
        values = functions.sampled(family, places, ENOUGH)
        return cls(family, low, high, values, *_series(functions, family, low, high, values))

    def take(self, rows: np.ndarray) -> ProxyPanels:
        """Some of them."""
        return ProxyPanels(*(getattr(self, own.name)[rows] for own in fields(self)))


def proxies(
    functions: Functions, family: np.ndarray, low: np.ndarray, high: np.ndarray, known: ProxyPanels | None = None
) -> Proxies:
    """Series of the functions of each ``family`` from ``low`` to ``high`` (P,), halved until they stand for them.

    Those ``known`` to stand for them elsewhere are taken along.
    """
    every = family if known is None else np.append(family, known.family)
    kept, count = [], int(every.max(initial=-1)) + 1
    given_up, looked_at = np.zeros(count, dtype=int), np.zeros(count, dtype=int)
    if known is not None:
        kept.append((known.family, known.low, known.high, known.coefficients))
        looked_at += known.values.shape[1] * np.bincount(known.family, minlength=count)
    for halving in range(PANEL_HALVINGS + 1):
        panels = ProxyPanels.of(functions, family, low, high)
        values, fine = panels.values, panels.fine
        looked_at += values.shape[1] * np.bincount(family, minlength=count)
        kept.append((family[fine], low[fine], high[fine], panels.coefficients[fine]))
        hopeless = np.any(np.all(np.isneginf(values), axis=1), axis=1) & ~fine  # nothing is known anywhere in the panel
        if halving == PANEL_HALVINGS:
            hopeless = ~fine
        given_up += np.bincount(family[hopeless], minlength=count)
        rest = np.flatnonzero(~fine & ~hopeless)
        if len(rest) == 0:
            break
        low, high, middle = low[rest], high[rest], (low + high)[rest] / 2
        family, low, high = np.tile(family[rest], 2), np.append(low, middle), np.append(middle, high)
    family, low, high, series = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    order = np.lexsort((low, family))
    order = order[~np.isnan(series[order, :, 0]).all(axis=1)]
    family, low, high = family[order], low[order], high[order]
    ends = np.column_stack([functions.inside(low, 1), functions.inside(high, -1)])
    places, back = np.unique(np.stack([np.repeat(family, 2), ends.ravel()]), axis=1, return_inverse=True)
    own = places[0].astype(int)
    at_edges = functions(own, places[1])[back.reshape(-1, 2)]
    noise = functions.noise(own, places[1])[back.reshape(-1, 2)]
    at_edges = _own_side(series[order], at_edges, noise, ends != np.column_stack([low, high]))
    looked_at += np.bincount(own, minlength=count)
    return Proxies(functions, family, low, high, series[order], ends, at_edges, given_up, looked_at)


def _own_side(series: np.ndarray, at_edges: np.ndarray, noise: np.ndarray, breaks: np.ndarray) -> np.ndarray:
    """The values ``at_edges`` of panels (P, 2, F), at ``breaks`` (P, 2) where they jump those of ``series`` (P, F, N).

    What lies so close to a break is told on one side of it or on the other, as round-off has it. By the ``noise``
    (P, 2, F) it may differ from the series as well.
    """
    from_series = np.stack([chebyshev.chebval(x, np.moveaxis(series, -1, 0)) for x in (-1.0, 1.0)], axis=1)
    size = np.abs(series).sum(axis=-1)[:, None]
    near = np.abs(at_edges - from_series) <= (TORN + noise) * size
    other = breaks[..., None] & np.isfinite(from_series) & ~near
    return np.where(other, from_series, at_edges)


def _series(
    functions: Functions, family: np.ndarray, low: np.ndarray, high: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whether (P,) series stand for the functions at points and checked places (P, N + 2, F), and them (P, F, N)."""
    noise = np.maximum(np.stack([functions.noise(family, low), functions.noise(family, high)]), PROXY_RESOLVED)
    own, checked = values[:, : PROXY_DEGREE + 1], values[:, PROXY_DEGREE + 1 :]
    series = np.tensordot(own, _TO_SERIES, (1, 1))
    with np.errstate(all="ignore"):
        scale = functions.scale(family)
        sizes = np.abs(own)
        largest, least = (reduced(bound, sizes, 1) for bound in (np.maximum, np.minimum))
        size = np.maximum(largest, scale)
        tail = np.maximum(*np.moveaxis(np.abs(series[..., -2:]), -1, 0))
        off = reduced(np.maximum, np.abs(series @ _AT_CHECKED.T - checked.transpose(0, 2, 1)), 2)
        resolved, alike = noise.max(axis=0), noise.max(axis=0) <= MOST_RATIO * noise.min(axis=0)
        even = alike & (size <= MOST_RATIO * np.maximum(least, scale))
        idle = reduced(np.logical_and, np.isnan(values), 1) | functions.beyond(family, values)
        series[idle] = np.nan
        fine = idle | (even & (tail <= resolved * size) & (off <= FORETOLD * resolved * size))
    return fine.all(axis=1), series


@dataclass(frozen=True)
class ProxyZeros:
    """Where combinations vanish: ``at`` (z,) and the numbers ``which`` (z,) of the combinations.

    ``touching`` (z,) says that a combination turns round there; ``rates`` (z,) are its derivatives. ``lost`` (l,) are
    the numbers of combinations of which zeros of the series are none of the functions.
    """

    at: np.ndarray
    which: np.ndarray
    rates: np.ndarray
    touching: np.ndarray
    lost: np.ndarray


def zeros(series: Proxies, panel: np.ndarray, weights: np.ndarray, offset: np.ndarray, touch: np.ndarray) -> ProxyZeros:
    """All zeros of the combinations ``weights`` (k, F) of functions less ``offset`` (k,), each on one ``panel`` (k,).

    A weight of 0 leaves a function out, whether it exists or not. A critical point within ``touch`` (k,) of zero is
    a zero at which the combination turns round.
    """
    with np.errstate(all="ignore"):
        used = np.where(weights[:, :, None] != 0, series.coefficients[panel], 0.0)
        c = np.einsum("kf,kfn->kn", weights, used)
        c[:, 0] -= offset
        rest = np.abs(c[:, 1:]).sum(axis=1)
        size = np.abs(c[:, 0] + offset) + rest + np.abs(offset)
        maybe = np.flatnonzero(np.isfinite(size) & (np.abs(c[:, 0]) <= rest + SLACK * size))
        return _Isolation(
            series, panel[maybe], weights[maybe], offset[maybe], c[maybe], size[maybe], touch[maybe]
        ).zeros(maybe)


@dataclass(frozen=True)
class _Parts:
    """Parts from ``low`` to ``high`` (q,) of the panels ``row`` (q,), in units in which those go from -1 to 1."""

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[_Parts]) -> _Parts:
        """All of them."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("row", "low", "high")))

    def take(self, rows: np.ndarray) -> _Parts:
        """Some of them."""
        return _Parts(self.row[rows], self.low[rows], self.high[rows])


@dataclass
class _Isolation:
    """The zeros of k polynomials ``c`` (k, N)."""

    series: Proxies
    panel: np.ndarray
    weights: np.ndarray
    offset: np.ndarray
    c: np.ndarray
    size: np.ndarray
    touch: np.ndarray

    def __post_init__(self) -> None:
        self.rate = np.zeros_like(self.c)
        self.rate[:, :-1] = chebyshev.chebder(self.c, axis=1)

    def zeros(self, numbers: np.ndarray) -> ProxyZeros:
        """See :func:`zeros`."""
        monotone, flat = self._parted()
        monotone, ends, folded = self._beside_folds(monotone)
        parts, values, touching = self._beside_turns(*self._runs(flat))
        parts = _Parts.joined([monotone, parts])
        left, right = (np.concatenate(pair) for pair in zip(ends, values, strict=True))
        crossing = np.flatnonzero((np.sign(left) != np.sign(right)) & (left != 0))
        at, lost = self._polished(parts.take(crossing), left[crossing])
        rows = np.concatenate([parts.row[crossing][~lost], folded[0], touching[0]])
        places = np.concatenate([at[~lost], self._place(*folded), self._place(*touching)])
        turns = np.arange(len(rows)) >= np.count_nonzero(~lost)
        panel = self.panel[rows]
        low, high = self.series.low[panel], self.series.high[panel]
        local = np.clip((2 * places - low - high) / (high - low), -1.0, 1.0)
        rates = np.where(turns, 0.0, _summed(self.rate[rows], local[:, None])[:, 0] * 2 / (high - low))
        return ProxyZeros(places, numbers[rows], rates, turns, numbers[parts.row[crossing][lost]])

    def _parted(self) -> tuple[_Parts, _Parts]:
        """Parts on which the polynomials are monotone, and parts that are places at which they are flat and zero."""
        k = len(self.c)
        parts, series = _Parts(np.arange(k), -np.ones(k), np.ones(k)), np.stack([self.c, self.rate], axis=1)
        monotone = []
        for _ in range(PARTINGS):
            rest = np.abs(series[..., 1:]).sum(axis=-1)
            empty = np.abs(series[:, 0, 0]) > rest[:, 0] + SLACK * self.size[parts.row]
            rising = np.abs(series[:, 1, 0]) > rest[:, 1]
            monotone.append(parts.take(np.flatnonzero(~empty & rising)))
            again = np.flatnonzero(~empty & ~rising)
            parts, series = parts.take(again), series[again]
            middle = (parts.low + parts.high) / 2
            halves = _Parts(parts.row, parts.low, middle), _Parts(parts.row, middle, parts.high)
            parts = _Parts.joined(halves)
            series = np.concatenate([series @ half.T for half in _HALVES])
        return _Parts.joined(monotone), parts

    def _beside_folds(
        self, monotone: _Parts
    ) -> tuple[_Parts, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """The monotone parts but for those with a touching turn at the edge of a panel, the values at their ends.

        And the rows and places of these turns. For round-off they may come out beyond the edge, on either side of it.
        """
        ends = self._at(monotone.row, monotone.low), self._at(monotone.row, monotone.high)
        touch = self.touch[monotone.row]
        slopes = [_summed(self.rate[monotone.row], x[:, None])[:, 0] for x in (monotone.low, monotone.high)]
        bend = np.abs(slopes[1] - slopes[0]) / (monotone.high - monotone.low)
        folds = [
            (np.abs(place) == 1) & (np.abs(value) <= touch) & (slope**2 <= 2 * bend * touch)
            for place, value, slope in zip((monotone.low, monotone.high), ends, slopes, strict=True)
        ]
        rows, places = (
            [own[fold] for own, fold in zip(pair, folds, strict=True)]
            for pair in ((monotone.row, monotone.row), (monotone.low, monotone.high))
        )
        rest = np.flatnonzero(~(folds[0] | folds[1]))
        return (
            monotone.take(rest), (ends[0][rest], ends[1][rest]), (np.concatenate(rows), np.concatenate(places)),
        )  # fmt: skip

    def _runs(self, flat: _Parts) -> tuple[_Parts, np.ndarray]:
        """Neighbouring flat parts as one, and the turning point (q,) in each, not a number where there is none."""
        flat = flat.take(np.lexsort((flat.low, flat.row)))
        new = np.append(True, (np.diff(flat.row) > 0) | (flat.low[1:] > flat.high[:-1]))[: len(flat.row)]
        first = np.flatnonzero(new)
        last = np.append(first[1:] - 1, len(flat.row) - 1)[: len(first)]
        runs = _Parts(flat.row[first], flat.low[first], flat.high[last])
        slopes = [_summed(self.rate[runs.row], x[:, None])[:, 0] for x in (runs.low, runs.high)]
        turns = np.sign(slopes[0]) != np.sign(slopes[1])
        at = self._bisected(self.rate[runs.row], runs.low, runs.high, slopes[0])
        return runs, np.where(turns, at, np.nan)

    def _beside_turns(
        self, runs: _Parts, turn: np.ndarray
    ) -> tuple[_Parts, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """The monotone parts of the runs, the values at their ends, and the rows and places of touching turns."""
        turns = np.flatnonzero(np.isfinite(turn))
        top = np.full(len(turn), np.nan)
        top[turns] = self._true(runs.row[turns], turn[turns])
        left, right = self._at(runs.row, runs.low), self._at(runs.row, runs.high)
        touches = np.abs(top) <= self.touch[runs.row]
        whole, split = np.flatnonzero(np.isnan(turn)), np.flatnonzero(np.isfinite(turn) & ~touches)
        parts = _Parts.joined([
            runs.take(whole),
            _Parts(runs.row[split], runs.low[split], turn[split]),
            _Parts(runs.row[split], turn[split], runs.high[split]),
        ])  # fmt: skip
        values = (
            np.concatenate([left[whole], left[split], top[split]]),
            np.concatenate([right[whole], top[split], right[split]]),
        )
        rows = np.flatnonzero(touches)
        return parts, values, (runs.row[rows], turn[rows])

    def _at(self, row: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The combinations at x: their own values at the edges of panels, the series' inside."""
        used = self.weights[row]
        edges = self.series.at_edges[self.panel[row], np.where(x < 0, 0, 1)]
        own = np.where(used != 0, used * edges, 0.0).sum(axis=1) - self.offset[row]
        return np.where(np.abs(x) == 1, own, _summed(self.c[row], x[:, None])[:, 0])

    def _bisected(self, c: np.ndarray, low: np.ndarray, high: np.ndarray, first: np.ndarray) -> np.ndarray:
        sign = np.sign(first)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            same = _summed(c, middle[:, None])[:, 0] * sign > 0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return (low + high) / 2

    def _polished(self, parts: _Parts, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The zeros (z,) in parts at whose left end the values are ``first``, and which of them are none."""
        row, sign = parts.row, np.sign(first)
        start = self._bisected(self.c[row], parts.low, parts.high, first)
        flat = (SUM_ROUND_OFF + NOISY * self._noise(row, self._place(row, start))) * self.size[row]
        values, done = np.empty(len(row)), np.zeros(len(row), dtype=bool)

        def function(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The values (z,), positive at the left ends and zero where one was found, and their derivatives."""
            # what has come to round-off, and made its last step, stays there: it is not asked for with the others
            going = np.flatnonzero(~done)
            values[going] = self._true(row[going], at[going])
            rate = _summed(self.rate[row], at[:, None])[:, 0]
            left = np.where(done, 0.0, sign * values)
            with np.errstate(all="ignore"):
                step = values / rate
                after = self.size[row] * (RATE_OFF * np.abs(step) + BENT * step**2)
            done[:] |= (np.abs(values) <= np.maximum(flat, CLOSE * np.abs(rate))) | (after <= flat)
            return left, sign * rate

        # a series with few digits may put a zero on the wrong side of where its panel was parted
        room = BESIDE * (parts.high - parts.low)
        low, high = np.maximum(parts.low - room, -1.0), np.minimum(parts.high + room, 1.0)
        at, _ = bracketed_newton(function, low, high, start, absolute=CLOSE, flat=flat)
        places = self._place(row, at)
        # the last step is one within round-off, but where there is a jump in place of a zero
        lost = ~(np.abs(values) <= (IS_ZERO + self._noise(row, places)) * self.size[row])
        return places, lost

    def _noise(self, row: np.ndarray, places: np.ndarray) -> np.ndarray:
        noise = self.series.functions.noise(self.series.family[self.panel[row]], places)
        return np.max(noise, axis=1, initial=0.0, where=self.weights[row] != 0)

    def _place(self, row: np.ndarray, x: np.ndarray) -> np.ndarray:
        panel = self.panel[row]
        low, high = self.series.low[panel], self.series.high[panel]
        inside = (low + high) / 2 + (high - low) / 2 * x
        return np.where(np.abs(x) == 1, self.series.ends[panel, np.where(x < 0, 0, 1)], inside)

    def _true(self, row: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The combinations' own values at x."""
        if len(row) == 0:
            return np.zeros(0)
        values = self.series.functions(self.series.family[self.panel[row]], self._place(row, x))
        return np.where(self.weights[row] != 0, values * self.weights[row], 0.0).sum(axis=1) - self.offset[row]


def _summed(c: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Series ``c`` (k, N) at x (k, m), row by row."""
    return np.einsum("kn,kmn->km", c, chebyshev.chebvander(x, c.shape[1] - 1))
