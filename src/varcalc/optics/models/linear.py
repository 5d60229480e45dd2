"""Rays in closed form, where n² is a polynomial of second degree: their equation r'' = ∇n²/2 is linear.

In a principal direction of n², with κ half its second derivative there, the
equation y'' = a + κ (y - y₀) is solved by y = y₀ + p F₁ + a F₂, where
F₁ = sin(wσ)/w and F₂ = (1 - cos(wσ))/w² with w² = -κ, or their like for κ ≥ 0:
Stumpff's functions (Battin, "An Introduction to the Mathematics and Methods of
Astrodynamics", sect. 4.5 and 4.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.numerics.roots import bracketed_newton, first_ahead, growing, quadratic_ahead
from varcalc.optics.media.medium import Medium, switching
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.rays.beam import DARK, NOTHING, Arrival, Beam, RayStatus, first_met
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Geometry
from varcalc.symbolic.evaluation import PointEvaluator

GROWN_ALIKE = 1.0
"""Of wσ: beyond it cosh and sinh are alike."""
SERIES_UP_TO = 1.0
"""Up to it Stumpff's third function is summed, since its closed form cancels."""
SERIES_TERMS = 14
"""Of that sum: the next is beyond round-off."""
TEST_PLACES = 12
"""Random places at which an identity between polynomials of second degree in each variable is put to the test."""
IDENTITY = 1e-12
FARTHEST_DARK, TOLD_DARK = 40.0, 1e-3
"""Of wσ: so far a ray has all but come to rest, and so well is it told where it is nearest to that."""
LAST_STEP = 4 * float(np.finfo(float).eps)
"""A step of so much of σ is the last."""


def is_linear(medium: Medium, dimension: int) -> bool:
    """Whether n² is a polynomial of second degree, told from its expression; one with kinks or jumps is none."""
    if isinstance(medium, Tabulated) or switching(medium, dimension):
        return False
    position = ca.SX.sym("r", dimension)
    return not ca.depends_on(ca.hessian(medium.squared_index(position), position)[0], position)


def ratio(medium: Medium, geometry: Geometry) -> float | None:
    """λ with g''' = λ g' along every ray, g the level of the surface; None where there is none.

    Where there is, g is a polynomial of second degree in tan(√-λ σ/2), and its first zero is written down.
    """
    d = geometry.dimension
    if not ca.SX(geometry.surface.belongs(ca.SX.sym("r", d))).is_constant():
        return None
    generator = np.random.default_rng(0)
    places = generator.normal(size=(2, TEST_PLACES, d))
    _, first, _, third = _levels(medium, geometry)(TEST_PLACES, *places).T
    if not np.all(np.isfinite(first)) or not np.all(np.isfinite(third)):
        return None
    found = float(first @ third / (first @ first)) if np.any(first) else 0.0
    return found if np.all(np.abs(third - found * first) <= IDENTITY * (np.abs(third) + np.abs(first))) else None


def _levels(medium: Medium, geometry: Geometry) -> PointEvaluator:
    """The level and its first three derivatives by σ along the rays at positions and momenta."""
    r, p = ca.SX.sym("r", geometry.dimension), ca.SX.sym("p", geometry.dimension)
    pull = ca.gradient(medium.squared_index(r), r) / 2
    levels = [ca.SX(geometry.surface.level(r))]
    for _ in range(3):
        levels.append(ca.densify(ca.jtimes(levels[-1], r, p) + ca.jtimes(levels[-1], p, pull)))
    return PointEvaluator(ca.Function("levels", [r, p], levels))


@dataclass(frozen=True)
class Motions:
    """F₀ = cos(wσ), F₁ and F₂ of one principal direction (m,), and the integrals of F₀² and F₁² from 0 to σ.

    Where F₀ = cosh(wσ), of the ``rate`` w and not 0, they grow alike, and what they are made to at last differs by
    far less: momenta are then told by αe^{wσ} + βe^{-wσ}, which for a decaying one has no part that grows.
    """

    sigma: np.ndarray
    rate: float
    zeroth: np.ndarray
    first: np.ndarray
    second: np.ndarray
    of_zeroth: np.ndarray
    of_first: np.ndarray

    def gone(self, p: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far rays go with the momenta ``p`` and pulls ``a`` (m,) at first, their momenta after it, and ∫ p² dσ.

        What is too large for a number is infinite.
        """
        far, momentum = p * self.first + a * self.second, p * self.zeroth + a * self.first
        path = p**2 * self.of_zeroth + p * a * self.first**2 + a**2 * self.of_first
        if self.rate == 0:
            return far, momentum, path
        w, x = self.rate, self.rate * self.sigma
        grows, decays = (p + a / w) / 2, (p - a / w) / 2
        up, down = np.where(grows == 0, 0.0, grows * np.expm1(x)), decays * np.expm1(-x)
        squares = np.where(grows == 0, 0.0, grows**2 * np.expm1(2 * x)) - decays**2 * np.expm1(-2 * x)
        told = (up - down) / w, p + up + down, squares / (2 * w) + 2 * grows * decays * self.sigma
        alike = x > GROWN_ALIKE
        return np.where(alike, told[0], far), np.where(alike, told[1], momentum), np.where(alike, told[2], path)


def motions(curvature: float, sigma: np.ndarray) -> Motions:
    """Those of κ = ``curvature`` at ``sigma`` (m,), without cancellation."""
    if curvature == 0:
        return Motions(sigma, 0.0, np.ones_like(sigma), sigma, sigma**2 / 2, sigma, sigma**3 / 3)
    w = np.sqrt(abs(curvature))
    sine, cosine = (np.sin, np.cos) if curvature < 0 else (np.sinh, np.cosh)
    half, other = sine(w * sigma / 2), cosine(w * sigma / 2)
    zeroth, first = 1 + 2 * np.sign(curvature) * half**2, 2 * half * other / w
    x = -4 * curvature * sigma**2
    with np.errstate(all="ignore"):
        third = (1 - zeroth * first / sigma) / x
    near = ~(np.abs(x) > SERIES_UP_TO)
    if np.any(near):
        third[near] = _third(x[near])
    rate = float(w) if curvature > 0 else 0.0
    second, of_zeroth = 2 * (half / w) ** 2, (sigma + zeroth * first) / 2
    return Motions(sigma, rate, zeroth, first, second, of_zeroth, 2 * sigma**3 * third)


def _third(x: np.ndarray) -> np.ndarray:
    """Stumpff's c₃ = 1/3! - x/5! + x²/7! - ..."""
    total = np.ones_like(x)
    for k in range(SERIES_TERMS, 0, -1):
        total = 1 - total * x / ((2 * k + 2) * (2 * k + 3))
    return total / 6


@dataclass(frozen=True)
class Linear(Model):
    """The linear ray equation in closed form: where n² is a polynomial of second degree.

    It needs surfaces whose levels g keep a ratio of g''' and g' along all rays: planes along the principal directions
    of n² or in which it is linear, spheres about its centre.
    """

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        if not is_linear(medium, dimension):
            raise DoesNotApply(
                "Linear needs n² to be a polynomial of second degree in the coordinates, which is not seen in that of "
                f"{type(medium).__name__}; take Hamilton()"
            )
        for geometry in surfaces:
            if ratio(medium, geometry) is None:
                raise DoesNotApply(
                    "Linear needs surfaces that rays meet at zeros known in closed form, such as planes along the "
                    f"axes of n² and spheres about its centre, and {geometry.surface} is none; take Hamilton()"
                )
        return LinearRays(medium, dimension, surfaces)


@dataclass
class LinearRays:
    """The model for a medium of that kind, with surfaces whose levels keep a constant :func:`ratio`."""

    medium: Medium
    dimension: int
    surfaces: Sequence[Geometry]

    name = "linear ray equation"

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """See :meth:`varcalc.optics.models.model.Carrier.advance`."""
        far = [self._distance(beam, k, k == leaving) for k in range(len(self.surfaces))]
        paths, end = _Paths(self, beam), np.full(len(beam), np.inf)
        limited = np.flatnonzero(np.isfinite(limit))
        if len(limited):
            end[limited] = paths.reaching(limit - beam.optical_path, limited)
        struck, sigma, status = first_met(far, end)
        there = paths.at(sigma)
        # a ray that comes to where the index vanishes with its slope never comes farther
        going = np.isfinite(there.optical_path) & ~paths.darkened(np.where(status == RayStatus.MISSED, np.inf, sigma))
        return Arrival(there, struck, np.where(going, status, int(RayStatus.SINGULAR)))

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:  # noqa: ARG002
        """See :meth:`varcalc.optics.models.model.Carrier.onward`."""
        return _Paths(self, beam).at(sigma), sigma

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        length = _Paths(self, beam).reaching(path - beam.optical_path, np.zeros(1, dtype=int))

        def at(sigma: np.ndarray) -> Beam:
            return _Paths(self, beam.take(np.zeros(len(sigma), dtype=int))).at(sigma)

        return Leg(at, float(length[0]))

    @cached_property
    def principal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Half the second derivatives of n² (d,) in its principal directions, those as columns, and ∇n²/2 at 0."""
        position = ca.SX.sym("r", self.dimension)
        hessian, gradient = ca.hessian(self.medium.squared_index(position), position)
        there = ca.Function("there", [position], [ca.densify(hessian), ca.densify(gradient)])(np.zeros(self.dimension))
        matrix, pull = np.array(there[0]) / 2, np.array(there[1]).ravel() / 2
        if not np.any(matrix - np.diag(np.diag(matrix))):
            return np.diag(matrix), np.eye(self.dimension), pull  # as they stand: no rounding by turning
        values, directions = np.linalg.eigh(matrix)
        return values, directions, pull

    def least(self, beam: Beam, number: int, *, leaving: bool) -> tuple[np.ndarray, np.ndarray]:
        """How closely rays of the plane pass surface ``number``: (m, 2) and, where it grows exponentially, (m, 2).

        The first is the level where it is least ahead of them, seen from their side, and its derivative by the
        launching angle: negative where the level falls for ever, its slope where that never changes, and not numbers
        for rays ``leaving`` the surface. The second is the factor by which the level grows at last.
        """
        turning, none = self._known[number][0], np.full((len(beam), 2), np.nan)
        table = self._rates[number](len(beam), beam.position, beam.momentum, beam.moved[:, 0], beam.turned[:, 0])
        side = np.where(table[:, 1 if leaving else 0] < 0, -1.0, 1.0)
        level, slope, bend = (side[:, None] * table[:, [k, k + 3]] for k in range(3))
        w, at_last = np.sqrt(abs(turning)), none
        if turning > 0:
            at_last = w * slope + bend
        if leaving:
            return none, at_last
        (A, B), ever = (slope[:, 0], bend[:, 0]), np.zeros(len(beam), dtype=bool)
        with np.errstate(all="ignore"):
            if turning < 0:
                sigma = np.mod(np.arctan2(-w * A, B), 2 * np.pi) / w
            else:
                sigma = np.fmax(np.arctanh(-w * A / B) / w if turning else -A / B, 0.0)
                ever = at_last[:, 0] < 0 if turning else B < 0
        f = motions(turning, np.where(np.isfinite(sigma), sigma, 0.0))
        least = np.where(ever[:, None], [-1.0, 0.0], level + slope * f.first[:, None] + bend * f.second[:, None])
        return np.where((turning == 0) & ~bend.any(axis=1, keepdims=True), slope, least), at_last

    @cached_property
    def _rates(self) -> list[PointEvaluator]:
        """The level of each surface and its first two derivatives by σ, and the derivatives of these by a deviation."""
        r, p, moved, turned = (ca.SX.sym(name, self.dimension) for name in ("r", "p", "m", "t"))
        state, pull, told = ca.vertcat(r, p), ca.gradient(self.medium.squared_index(r), r) / 2, []
        for geometry in self.surfaces:
            level = ca.SX(geometry.surface.level(r))
            slope = ca.jtimes(level, r, p)
            levels = ca.vertcat(level, slope, ca.jtimes(slope, state, ca.vertcat(p, pull)))
            rates = ca.jtimes(levels, state, ca.vertcat(moved, turned))
            outputs = [ca.densify(levels), ca.densify(rates)]
            told.append(PointEvaluator(ca.Function("rates", [r, p, moved, turned], outputs)))
        return told

    @cached_property
    def _known(self) -> list[tuple[float, PointEvaluator]]:
        """The ratio of each surface, and its levels along rays."""
        return [(ratio(self.medium, s) or 0.0, _levels(self.medium, s)) for s in self.surfaces]

    def _distance(self, beam: Beam, number: int, leaving: bool) -> np.ndarray:
        """σ (m,) at which each ray first meets surface ``number``; infinite where it does not."""
        turning, levels = self._known[number]
        level, slope, bend, _ = levels(len(beam), beam.position, beam.momentum).T
        with np.errstate(all="ignore"):
            return first_ahead(_parameter(quadratic_ahead(level, slope, bend - turning * level / 2, leaving), turning))


def _parameter(tangent: np.ndarray, turning: float) -> np.ndarray:
    """The first σ > 0 with tan(wσ/2)/(w/2) = ``tangent``, w² = -``turning``, or its like where that is positive."""
    if turning == 0:
        return tangent
    w = np.sqrt(abs(turning))
    if turning > 0:
        return 2 / w * np.arctanh(w * tangent / 2)
    sigma = 2 / w * np.arctan(w * tangent / 2)
    return np.where(tangent < 0, sigma + 2 * np.pi / w, sigma)


def _least(terms: Sequence[tuple[float, np.ndarray, np.ndarray]], sigma: np.ndarray) -> np.ndarray:
    """The least sum (m,) of ae^{2wσ} + be^{-2wσ}, of terms w, a and b (m,), between 0 and ``sigma`` (m,)."""
    farthest = np.zeros(len(sigma))
    for w, grows, decays in terms:
        with np.errstate(divide="ignore"):
            turn = np.where(decays > 0, np.log(decays / grows) / (4 * w), 0.0)
        farthest = np.fmax(farthest, np.fmin(turn, FARTHEST_DARK / w))
    high = np.clip(farthest, 0.0, sigma)

    def sums(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The sum at σ (m,), and its first two derivatives."""
        parts = [(w, a * np.exp(2 * w * at), b * np.exp(-2 * w * at)) for w, a, b in terms]
        return (
            np.sum([up + down for _, up, down in parts], axis=0),
            np.sum([2 * w * (up - down) for w, up, down in parts], axis=0),
            np.sum([4 * w**2 * (up + down) for w, up, down in parts], axis=0),
        )

    def falling(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _, slope, bend = sums(at)
        return -slope, -bend  # the sum is convex

    return sums(bracketed_newton(falling, np.zeros_like(high), high, high / 2, absolute=TOLD_DARK)[0])[0]


class _Paths:
    """The rays of ``beam`` as functions of σ."""

    def __init__(self, model: LinearRays, beam: Beam) -> None:
        self.beam = beam
        self.curvatures, self.directions, pull = model.principal
        self.momentum = beam.momentum @ self.directions
        self.position = beam.position @ self.directions
        self.pull = self.position * self.curvatures + pull @ self.directions

    def at(self, sigma: np.ndarray) -> Beam:
        """The rays after ``sigma`` (m,)."""
        beam, position, momentum = self.beam, self.position.copy(), np.empty_like(self.momentum)
        moved, turned = beam.moved @ self.directions, beam.turned @ self.directions
        path, known = beam.optical_path.copy(), self._motions(sigma)
        with np.errstate(over="ignore", invalid="ignore"):  # see _motions
            for k, curvature in enumerate(self.curvatures):
                f = known[curvature]
                far, momentum[:, k], grown = f.gone(self.momentum[:, k], self.pull[:, k])
                position[:, k] += far
                path += grown
                here, ahead = moved[:, :, k].copy(), turned[:, :, k].copy()
                moved[:, :, k] = here * f.zeroth[:, None] + ahead * f.first[:, None]
                turned[:, :, k] = ahead * f.zeroth[:, None] + curvature * here * f.first[:, None]
        parts = position, momentum, path, moved, turned
        finite = np.all([np.isfinite(part).all(axis=tuple(range(1, part.ndim))) for part in parts], axis=0)
        for part in parts:  # what has gone too far out for numbers is none
            part[~finite] = np.nan
        back = self.directions.T
        return Beam(position @ back, momentum @ back, path, moved @ back, turned @ back)

    def _motions(self, sigma: np.ndarray) -> dict[float, Motions]:
        with np.errstate(over="ignore", invalid="ignore"):  # rays that go too far out for numbers
            return {float(curvature): motions(float(curvature), sigma) for curvature in set(self.curvatures)}

    def darkened(self, sigma: np.ndarray) -> np.ndarray:
        """True (m,) for rays that come within ``sigma`` (m,) to where n² vanishes with its slope, to round-off.

        What is looked at is |p|² and, with it, the square of the pull over the curvature, in each principal direction:
        constant in one in which rays swing, 2(α²e^{2wσ} + β²e^{-2wσ}) in one in which they part.
        """
        still, terms = np.zeros(len(sigma)), []
        for k, curvature in enumerate(self.curvatures):
            p, pull = self.momentum[:, k], self.pull[:, k]
            if curvature == 0:
                still += np.where(pull == 0, p**2, np.inf)
            elif curvature < 0:
                still += p**2 - pull**2 / curvature
            else:
                w = np.sqrt(curvature)
                terms.append((w, (p + pull / w) ** 2 / 2, (p - pull / w) ** 2 / 2))
        limit = DARK * np.sum(self.momentum**2, axis=1)
        out = still + sum(2 * np.sqrt(grows * decays) for _, grows, decays in terms) <= limit
        rows = np.flatnonzero(out)
        if len(rows):
            least = _least([(w, up[rows], down[rows]) for w, up, down in terms], sigma[rows])
            out[rows] = still[rows] + least <= limit[rows]
        return out

    def path(self, sigma: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The optical path ∫ |p|² dσ (k,) from the start to ``sigma`` (k,), and its derivative, of the ``rows``."""
        total, rate, known = np.zeros(len(rows)), np.zeros(len(rows)), self._motions(sigma)
        for k, curvature in enumerate(self.curvatures):
            _, momentum, path = known[curvature].gone(self.momentum[rows, k], self.pull[rows, k])
            total += path
            rate += momentum**2
        return total, rate

    def reaching(self, length: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """σ (k,) at which the ``rows`` have gone the optical path ``length`` (m,), which never shrinks."""
        wanted = length[rows]

        def beyond(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            path, rate = self.path(sigma, rows)
            return path - wanted, rate

        return growing(beyond, np.maximum(wanted / np.sum(self.momentum[rows] ** 2, axis=1), 0.0), LAST_STEP)
