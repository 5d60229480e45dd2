"""A ray of straight parts between surfaces: its optical path proved, and whether it is the least.

Between A and B the path n_0 |P_1 - A| + n_1 |P_2 - P_1| + ... + n_K |B - P_K| is stationary in the points P_k of the
surfaces where the ray is refracted or reflected (Fermat; Born and Wolf, "Principles of Optics", sect. 3.3.2). In how
many directions it falls is the number of conjugate points between A and B (Morse's index theorem; Milnor, "Morse
Theory", sect. 15): the parts themselves have none.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, above, below, flint, working
from varcalc.certificates.certificate import Hypothesis, Means, ProvedInterval, decimals
from varcalc.certificates.integrals import Unproved, check_enclosed
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.stationary import LagrangeFunction
from varcalc.optics.media.medium import Medium
from varcalc.optics.rays.fermat import SAME_PATH, by_its_own, stated_index
from varcalc.optics.surfaces import Surface
from varcalc.optics.validation import point
from varcalc.showing import line
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import as_written

if TYPE_CHECKING:
    from varcalc.optics.rays.ray import Ray

BITS, TERMS = 160, 2
"""Precision of the balls, and the length of series, of which there are none."""
MOST_HALVINGS = 50
"""How often a part is halved at most where it is proved to meet no surface between its ends."""

ONE = "in boxes about the ray's own points the surfaces have one point each at which the path is stationary"
SIDES = "it passes through every refracting surface and stays on its side of every mirror"
CLEAR = "its straight parts meet no surface of the scene between their ends"
SIGNS = "the second derivatives of the path along the surfaces have their signs"
CONVEX = "with multipliers of the surfaces the path is convex in boxes of this half-width, so that none there is less"


@dataclass(frozen=True, repr=False, kw_only=True)
class RayCertificate(ProvedInterval):
    """A proof that a ray's optical path lies between ``lower`` and ``upper``.

    Attributes
    ----------
    hits : tuple of tuple of (float, float)
        For each surface the coordinates of the ray's point on it, each between two doubles.
    index : int
        The proved number of conjugate points between A and B: in so many directions the path falls.
    tube : float
        Where ``index`` is 0: of all curves from A to B by way of the surfaces, each part counted with the index of its
        medium, none is shorter that meets them within this of the ray's own points in each coordinate. Else 0.
    """

    hits: tuple[tuple[tuple[float, float], ...], ...]
    index: int
    tube: float

    def __repr__(self) -> str:
        return line("RayCertificate", [f"{self.digits} digits", *self.enclosure[:1]])

    def _headline(self) -> str:
        return f"Theorem: the optical path of the ray lies between two numbers; {self._kind()}."

    def _kind(self) -> str:
        if self.index:
            return f"it falls in {self.index} direction{'s' if self.index > 1 else ''}, so it is no minimum"
        return f"no curve is shorter that meets the surfaces within {self.tube:.3g} of where the ray does"

    def __str__(self) -> str:
        return self._theorem("optical path of the ray", f"Of this path {self._kind()}.")


@dataclass
class _Constants:
    """Numbers that enter expressions as symbols, so that nothing is rounded among them."""

    symbols: list[Any] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def __call__(self, value: float) -> Any:
        self.symbols.append(ca.SX.sym("c"))
        self.values.append(float(value))
        return self.symbols[-1]

    def column(self, values: np.ndarray) -> Any:
        """A point as a column of symbols."""
        return ca.vertcat(*map(self, values.tolist()))

    def balls(self) -> list[Ball]:
        """The values."""
        return [flint().arb(v) for v in self.values]


@dataclass(frozen=True)
class _Chain:
    """The ends, the media and the surfaces of a ray, as expressions of symbols and the numbers these stand for."""

    ends: tuple[np.ndarray, np.ndarray]
    media: Sequence[Medium]
    surfaces: Sequence[Surface]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.ends[0])

    def level(self, number: int) -> tuple[Program, list[Ball]]:
        """Level of a surface at a point, whether the point belongs to it, and the numbers of the level."""
        constants, position = _Constants(), ca.SX.sym("r", self.dimension)
        surface = self.surfaces[number]
        results = [_level(surface, position, constants), ca.SX(surface.belongs(position))]
        return _program("level", [position, ca.vertcat(*constants.symbols)], results), constants.balls()

    def lagrange(self, hits: np.ndarray) -> LagrangeFunction:
        """The optical path with multipliers of the surfaces' levels, about points (K, d) on these."""
        constants, d, count = _Constants(), self.dimension, len(self.surfaces)
        z, multipliers = ca.SX.sym("z", d * count), ca.SX.sym("lambda", count)
        inner = [z[d * k : d * (k + 1)] for k in range(count)]
        points = [constants.column(self.ends[0]), *inner, constants.column(self.ends[1])]
        path = ca.SX(0)
        for medium, p, q in zip(self.media, points[:-1], points[1:], strict=True):
            numbers = {name: constants(value) for name, value in medium.parameters.items()}
            path += stated_index(medium, points[0], numbers) * ca.sqrt(ca.sumsqr(q - p))
        for k, surface in enumerate(self.surfaces):
            path += multipliers[k] * _level(surface, inner[k], constants)
        program = _program("path", [ca.vertcat(z, multipliers), ca.vertcat(*constants.symbols)], [path])
        whole = np.vstack([self.ends[0], hits, self.ends[1]])
        length = float(np.linalg.norm(np.diff(whole, axis=0), axis=1).sum())
        return LagrangeFunction(
            program, d * count, constants.balls(), np.r_[np.full(d * count, length), np.ones(count)]
        )


def _program(name: str, arguments: list[Any], results: list[Any]) -> Program:
    function = ca.Function(name, arguments, [ca.densify(ca.SX(r)) for r in results])
    check_enclosed(function, "a surface or an index")
    return Program(function)


def _level(surface: Surface, position: Any, constant: _Constants) -> Any:
    if by_its_own(surface, "level", "formula"):
        return surface.level(position)
    return surface.formula(position, constant)


def certified_straight_path(ray: Ray, end: Sequence[float] | None) -> RayCertificate:
    """The certificate of a ray through surfaces between uniform media; ArithmeticError where there is none."""
    curved = [type(medium).__name__ for medium in ray.media if not medium.is_uniform]
    if curved:
        raise ValueError(f"a certificate of a ray through surfaces is for uniform media; one of these is {curved[0]}")
    flint()
    began = time.perf_counter()
    ends = [leg.at(np.array([0.0, leg.length])).position for leg in ray.legs]
    start, hits = ends[0][0], np.array([pair[-1] for pair in ends[:-1]])
    last = ends[-1][-1] if end is None else np.array(point("end", end))
    if len(last) != len(start):
        raise ValueError(f"end has {len(last)} coordinates, and the ray {len(start)}")
    try:
        with working(BITS, TERMS), as_written():
            found = _proof(_Chain((start, last), ray.media, ray.surfaces), hits, ray.optical_path)
    except (Unproved, Undecided) as unproved:
        raise ArithmeticError(f"no certificate: {unproved}") from None
    return replace(found, seconds=time.perf_counter() - began)


def _proof(chain: _Chain, hits: np.ndarray, near: float) -> RayCertificate:
    """The certificate of the ray that meets the surfaces near points (K, d), of an optical path ``near`` a number."""
    lagrange = chain.lagrange(hits)
    levels = [chain.level(k) for k in range(len(chain.surfaces))]
    at = lagrange.enclosed([*hits.ravel(), *_multipliers(lagrange, hits)])
    points = [_ball_point(chain.ends[0]), *_rows(at, chain), _ball_point(chain.ends[1])]
    _prove_sides(chain, levels, points)
    _prove_clear(chain, levels, points)
    path = lagrange.jet(at, 0).value
    low, high = path.lower(), path.upper()
    if not abs(float(path.mid()) - near) <= SAME_PATH * near:
        raise Unproved(f"near the ray a path of {float(path.mid()):.9g} was found, its own is {near:.9g}")
    index = lagrange.falling(at)
    hypotheses = (ONE, SIDES, CLEAR, SIGNS) if index else (ONE, SIDES, CLEAR, CONVEX)
    return RayCertificate(
        lower=below(low),
        upper=above(high),
        enclosure=decimals(low, high),
        proved=tuple(Hypothesis(sentence, Means.BALLS) for sentence in hypotheses),
        seconds=0.0,
        hits=tuple(tuple((below(v), above(v)) for v in each) for each in points[1:-1]),
        index=index,
        tube=0.0 if index else lagrange.room(at) * float(lagrange.scales[0]),
    )


def _ball_point(point: np.ndarray) -> list[Ball]:
    return [flint().arb(float(v)) for v in point]


def _rows(at: Sequence[Ball], chain: _Chain) -> list[list[Ball]]:
    d = chain.dimension
    return [list(at[d * k : d * (k + 1)]) for k in range(len(chain.surfaces))]


def _multipliers(lagrange: LagrangeFunction, hits: np.ndarray) -> np.ndarray:
    """The multipliers of the surfaces at points (K, d), in numbers: what is across each of the pull there."""
    z, count = hits.ravel(), lagrange.equations
    zero = [flint().arb(float(v)) for v in z] + [flint().arb(0)] * count
    matrix = np.array([[float(v.mid()) for v in row] for row in lagrange.hessian(zero)])
    pull = np.array([float(v.mid()) for v in lagrange.gradient(zero)[: len(z)]])
    return np.linalg.lstsq(matrix[: len(z), len(z) :], -pull, rcond=None)[0]


def _along(level: tuple[Program, list[Ball]], start: list[Ball], way: list[Ball], t: Ball) -> tuple[Jet, Jet]:
    """A level, and whether its zeros belong to the surface, at start + t way, with their derivatives by t."""
    program, numbers = level
    moved = [Jet(p + t * w, {0: w}) for p, w in zip(start, way, strict=True)]
    (value,), (belongs,) = jets(program, [moved, [Jet(n) for n in numbers]], 1)
    return value, belongs


def _way(p: list[Ball], q: list[Ball]) -> list[Ball]:
    return [b - a for a, b in zip(p, q, strict=True)]


def _slope(jet: Jet) -> Ball:
    return flint().arb(0) + jet.first.get(0, 0)


def _prove_sides(chain: _Chain, levels: Sequence[tuple[Program, list[Ball]]], points: list[list[Ball]]) -> None:
    """Prove that each point belongs to its surface, and that the ray passes through it or stays on its side."""
    found = flint()
    for k, (surface, level) in enumerate(zip(chain.surfaces, levels, strict=True)):
        before, at, after = points[k : k + 3]
        arriving, belongs = _along(level, at, _way(before, at), found.arb(0))
        leaving, _ = _along(level, at, _way(at, after), found.arb(0))
        product = _slope(arriving) * _slope(leaving)
        passed = product < 0 if surface.mirror else product > 0
        if not (bool(passed) and bool(belongs.value > 0)):
            what = "be reflected by" if surface.mirror else "pass through"
            raise Unproved(f"the ray is not proved to {what} surface {k}")


def _prove_clear(chain: _Chain, levels: Sequence[tuple[Program, list[Ball]]], points: list[list[Ball]]) -> None:
    """Prove that no part of the ray meets a surface but where it begins and ends."""
    shapes = [_shape(surface, numbers) for surface, (_, numbers) in zip(chain.surfaces, levels, strict=True)]
    for part, (p, q) in enumerate(pairwise(points)):
        for k, level in enumerate(levels):
            if shapes.index(shapes[k]) < k:
                continue  # the same shape again
            begins = part > 0 and shapes[part - 1] == shapes[k]
            ends = part < len(levels) and shapes[part] == shapes[k]
            if not _clear(level, p, _way(p, q), (begins, ends)):
                raise Unproved(f"part {part} of the ray is not proved to be clear of surface {k} between its ends")


def _shape(surface: Any, numbers: Sequence[Ball]) -> tuple[Surface, list[float]]:
    """What two surfaces share that are one, whatever they do to light."""
    return replace(surface, mirror=False) if surface.mirror else surface, [float(v) for v in numbers]


def _clear(level: tuple[Program, list[Ball]], start: list[Ball], way: list[Ball], zeros: tuple[bool, bool]) -> bool:
    """Whether a part meets no zero of a level that belongs to the surface, but the simple ones at its ends."""
    found = flint()
    waiting = [(found.arb(0), found.arb(1), 0)]
    while waiting:
        low, high, depth = waiting.pop()
        if _free(level, start, way, (low, high), (zeros[0] and bool(low == 0), zeros[1] and bool(high == 1))):
            continue
        if depth == MOST_HALVINGS:
            return False
        middle = ((low + high) / 2).mid()
        waiting += [(low, middle, depth + 1), (middle, high, depth + 1)]
    return True


def _free(
    level: tuple[Program, list[Ball]],
    start: list[Ball],
    way: list[Ball],
    between: tuple[Ball, Ball],
    zeros: tuple[bool, bool],
) -> bool:
    """Whether a level is proved to have no zero between two t, but those at the ends that are known."""
    low, high = between
    t = low.union(high)
    try:
        whole, belongs = _along(level, start, way, t)
        if belongs.value < 0:
            return True
        if zeros[0] or zeros[1]:
            # one zero at most, where the slope keeps its sign: at both ends there cannot be one
            return zeros[0] != zeros[1] and not _slope(whole).contains(0)
        middle = (low + high) / 2
        value = _along(level, start, way, middle)[0].value + _slope(whole) * (t - middle)
        return not value.contains(0) or not (flint().arb(0) + whole.value).contains(0)
    except Undecided:
        return False
