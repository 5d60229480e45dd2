"""Stability charts of systems that are driven periodically: growth over one or two parameters, and its boundaries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from varcalc.mechanics.arguments import finite_column
from varcalc.mechanics.stability.crossing import PassingRoots, passings
from varcalc.mechanics.stability.surface import PiecewiseSeries
from varcalc.mechanics.system import System, check_system
from varcalc.problem.conditions import numbers, positive, reals, told
from varcalc.progress import Interrupted, Progress, Telling, telling
from varcalc.showing import Plotted, Shown
from varcalc.spelling import spelled

CHECKED = 5
"""Places of a chart, in either parameter, at which the system is asked whether it stands still."""
SAFE = 16.0
"""By how many times the error of the series multipliers may be off."""


@dataclass(frozen=True, repr=False, eq=False)
class Boundaries(Shown):
    """Where multipliers pass 1 or -1, or meet or leave the unit circle elsewhere.

    Values of the parameters ``places`` (b, 2), and the ``multipliers`` (b,), complex, those off the real axis by the
    one above it; ``errors`` (b,) are what the values of the first parameter may be off. A multiplier 1 has motions
    that repeat themselves after a period, and -1 after two.
    """

    places: np.ndarray
    multipliers: np.ndarray
    errors: np.ndarray


@dataclass(frozen=True, repr=False, eq=False)
class StabilityChart(Plotted):
    """Growth of small motions over parameters: ``growth`` (m, k) over ``first`` (m,) and ``second`` (k,) values.

    ``growth`` is ln|largest multiplier|/period, the rate at which motions part at most, known to ``error`` (m, k);
    ``stable`` (m, k) is where it is not above that. ``names`` are the parameters'.
    """

    names: tuple[str, ...]
    first: np.ndarray
    second: np.ndarray
    growth: np.ndarray
    error: np.ndarray
    _source: MonodromySurface = field(repr=False)

    @property
    def stable(self) -> np.ndarray:
        """Where no motion grows (m, k), to the ``error``."""
        return self.growth <= self.error

    @cached_property
    def boundaries(self) -> Boundaries:
        """Where multipliers pass 1 and -1, and leave the unit circle, for each of the ``second`` values.

        These are roots in the first parameter: of det(Y ∓ 1) of the monodromy matrix Y, and, off the real axis, where
        two of the multipliers meet (of systems that keep the symplectic form), or two that are conjugate have the
        product 1 (of others). They are followed by their series; every change of a sign between neighbouring
        values of ``first``, and every pair of roots between which it dips through zero there, is brought to the exact
        matrix by Newton's steps.
        """
        return self._source.boundaries(self.first, self.second)


@dataclass(frozen=True)
class MonodromySurface:
    """The monodromy matrix of a ``system`` about ``q0`` over parameters ``names``, between ``low`` and ``high``."""

    system: System
    q0: np.ndarray
    period: Callable[[Any], Any]
    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    surface: PiecewiseSeries = field(default_factory=PiecewiseSeries)

    def numbers(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All parameters (m, c) and the periods (m,)."""
        chosen = dict(zip(self.names, (first, second), strict=False))
        columns = {name: chosen.get(name, np.full(len(first), value)) for name, value in self.system.parameters.items()}
        periods = np.broadcast_to(reals("what period returns", self.period(SimpleNamespace(**columns))), first.shape)
        return np.stack(list(columns.values()), axis=1), np.array(periods)

    def values(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """The entries of the matrix, and the logarithm of its determinant (m, N² + 1).

        Rates are those in a time that a period is 2π of, so that units do not decide what is round-off.
        """
        numbers, periods = self.numbers(first, second)
        with_rate = np.hstack([numbers, np.zeros((len(numbers), 1))])
        matrices, logarithms = self.system.about_rest(self.q0, with_rate, periods)
        unit = np.repeat([0, 1], self.system.n)
        matrices *= (periods / (2 * np.pi))[:, None, None] ** (unit[:, None] - unit)
        return np.hstack([matrices.reshape(len(first), -1), logarithms[:, None]])

    def carried(self, told: Telling) -> MonodromySurface:
        """The same with its series."""
        return replace(self, surface=PiecewiseSeries.of(self.values, self.low, self.high, told))

    def check(self) -> None:
        """Refuse a place that does not stand still, and periods that are none, somewhere on the chart."""
        grid = np.meshgrid(*(np.linspace(a, b, CHECKED) for a, b in zip(self.low, self.high, strict=True)))
        numbers, periods = self.numbers(grid[0].ravel(), grid[1].ravel())
        self.system.check_standing(self.q0, numbers, periods)

    def chart(self, first: np.ndarray, second: np.ndarray) -> StabilityChart:
        """The chart over a grid."""
        values, off = self.surface.on_grid(first, second)
        _, periods = self.numbers(np.repeat(first, len(second)), np.tile(second, len(first)))
        size = 2 * self.system.n
        matrices, logarithm = values[:, :, :-1].reshape(-1, size, size), values[:, :, -1].ravel()
        covered = np.isfinite(logarithm)
        conserves = self.system.lagrange.forces.is_zero()
        largest, condition = _largest(matrices[covered], logarithm[covered], conserves=conserves)
        noise = SAFE * off[:, :, :-1].max(axis=2).ravel()[covered]
        growth, rounding = np.full((2, len(logarithm)), np.nan)
        rounding[covered] = np.minimum(noise * condition, np.maximum(noise, np.sqrt(noise))) / np.maximum(
            largest, 1e-300
        )
        with np.errstate(divide="ignore"):
            growth[covered] = np.log(largest)
        shape = len(first), len(second)
        growth, rounding = ((rate / periods).reshape(shape) for rate in (growth, rounding))
        return StabilityChart(self.names, first, second, growth, rounding, self)

    def boundaries(self, first: np.ndarray, second: np.ndarray) -> Boundaries:
        """See :attr:`StabilityChart.boundaries`."""
        values, found = self.surface.on_grid(first, second)[0], []
        conserves = self.system.lagrange.forces.is_zero()
        for passing in passings(self.system.n, conserves=conserves):
            crossing = PassingRoots(passing, self.surface, self.values)
            at, rows = crossing.on_series(values, first, second)
            at, errors, multipliers = crossing.exact(at, second[rows])
            met = (at >= first[0]) & (at <= first[-1]) & np.isfinite(multipliers)
            found.append([at[met], second[rows][met], multipliers[met], errors[met]])
        at, other, multipliers, errors = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort([at, other])
        return Boundaries(np.stack([at, other], axis=1)[order], multipliers[order], errors[order])


def _largest(matrices: np.ndarray, logarithm: np.ndarray, *, conserves: bool) -> tuple[np.ndarray, np.ndarray]:
    """The sizes (m,) of the largest eigenvalues of matrices (m, N, N), and how many times more they are off."""
    if matrices.shape[1] == 4 and conserves:
        # of ρ = µ + 1/µ there are two, with the sum tr Y and the sum of squares tr Y² + 4
        total, squares = np.trace(matrices, axis1=1, axis2=2), np.einsum("mij,mji->m", matrices, matrices)
        root = np.sqrt((2 * squares + 8 - total**2).astype(complex))
        half = np.stack([total + root, total - root]) / 4
        # on the circle where half is real and at most 1: there the root has no real part, to the last digit
        found = np.abs(half + np.sqrt(half**2 - 1))
        on_circle = (half.imag == 0) & (np.abs(half.real) <= 1)
        return np.where(on_circle, 1, np.maximum(found, 1 / found)).max(axis=0), np.full(len(matrices), np.inf)
    if matrices.shape[1] > 2:
        values = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
        return values, np.full(len(values), np.inf)
    half = (matrices[:, 0, 0] + matrices[:, 1, 1]) / 2
    under = half**2 - np.exp(logarithm)
    root = np.sqrt(np.abs(under))
    with np.errstate(divide="ignore"):
        return np.where(under > 0, np.abs(half) + root, np.exp(logarithm / 2)), np.where(
            under > 0, np.abs(half) / root, 1
        )


@spelled
def stability_chart(
    system: System,
    q0: Sequence[float] | np.ndarray,
    period: float | Callable[[Any], Any],
    parameters: Mapping[str, Any],
    *,
    progress: Progress = None,
) -> StabilityChart:
    """Growth of small motions of a driven ``system`` about ``q0`` (n,), over one or two of its parameters.

    ``parameters`` takes one name or two to ascending values, (m,) and (k,); ``period`` is a number, or a function of
    the parameters, as in ``lambda p: 2 * np.pi / p.w``. Each point has the largest of Floquet's multipliers
    (Yakubovich and Starzhinskii, "Linear Differential Equations with Periodic Coefficients", ch. II). The monodromy
    matrix is carried for so many points that Chebyshev series stand for it, and read from these everywhere.
    ``progress`` is as :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which holds
    the chart with no numbers where nothing is known yet. Raises ValueError where ``q0`` does not stand still or the
    equations do not repeat themselves, somewhere on the chart, and where the matrix is no smooth function of the
    parameters.

    >>> import casadi as ca
    >>> from scipy.special import mathieu_a, mathieu_b
    >>> mathieu = System(lambda t, q, v, p: (v[0]**2 - (p.a - 2 * p.q * ca.cos(2 * t)) * q[0]**2) / 2, ("x",),
    ...                  parameters={"a": 0.0, "q": 1.3})
    >>> chart = stability_chart(mathieu, [0.0], np.pi, {"a": np.linspace(-2, 2, 50)})
    >>> bool(np.abs(chart.boundaries.places[:, 0] - [mathieu_a(0, 1.3), mathieu_b(1, 1.3)]).max() < 1e-13)
    True
    """
    check_system(system)
    if not isinstance(parameters, Mapping):
        raise TypeError(f"parameters must map names to values, not {told(parameters)}; write {{'a': [0.0, 1.0]}}")
    if not 0 < len(parameters) <= 2 or not set(parameters) <= set(system.parameters):
        raise ValueError(f"parameters must name one or two of {sorted(system.parameters)}, not {told([*parameters])}")
    axes = [numbers(f"parameters[{name!r}]", values) for name, values in parameters.items()]
    for name, values in zip(parameters, axes, strict=True):
        if values.ndim != 1 or len(values) < 2 or not np.all(np.diff(values) > 0):
            raise ValueError(f"parameters[{name!r}] must be two ascending values or more, not {told(values)}")
    axes = axes if len(axes) == 2 else [*axes, np.zeros(1)]
    length = period if callable(period) else positive("period", period)
    given = length if callable(length) else (lambda p: length)
    low, high = (np.array([at[k] for at in axes]) for k in (0, -1))
    place = finite_column("q0", q0, system.n)
    source = MonodromySurface(system, place, given, tuple(parameters), low, high)
    source.check()
    with telling(progress, "stability chart") as tell:
        source = source.carried(tell)
    if source.surface.stopped:
        raise Interrupted(source.chart(axes[0], axes[1]))
    if not source.surface.resolved:
        raise ValueError("parameters: the monodromy matrix is no smooth function of them there; take a smaller range")
    return source.chart(axes[0], axes[1])
