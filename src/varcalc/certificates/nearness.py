"""How near the certified curve all others lie that are as good."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.certificates.balls import Around, Ball, above, flint, largest, most
from varcalc.certificates.certificate import Distance
from varcalc.certificates.curve import Piece
from varcalc.certificates.field import dynamics
from varcalc.certificates.integrals import Unproved, total, worst
from varcalc.certificates.levels import grown, meeting
from varcalc.certificates.setting import Setting
from varcalc.certificates.smooth import head
from varcalc.certificates.tube import Tube


@dataclass(frozen=True)
class Nearness:
    """How near curves of no greater value are, in units of states and controls.

    ``square`` bounds the root of the integral of |w|^2, ``slope`` the integral of |u|, and ``pointwise`` |w| at each
    point, of what is integrated to levels apart.
    """

    square: Ball
    slope: Ball
    pointwise: Ball

    def distance(self, setting: Setting) -> Distance:
        """The same of the functions themselves."""
        unit = flint().arb(float(setting.sizes[0][0]))
        return Distance(above(self.square / setting.length.sqrt() * unit), above(self.pointwise * unit))

    def of_levels(self, setting: Setting) -> Ball:
        """A bound of what is integrated to levels, up to any x, where that is of first degree."""
        stated, found = setting.statement, flint()
        states, controls = ([float(v) for v in sizes] for sizes in setting.sizes)
        reach = found.arb(0)
        for j, missed in enumerate(meeting(setting).missed() if stated.levels else []):
            by_states, by_controls = found.arb(0), found.arb(0)
            for k, box in setting.along.boxes:
                around = Around(box, 1, whole=True)
                jet = stated.level_jets(around.abscissa(), *setting.pieces[k].lifted(around), 1)[j]
                by_states = largest([by_states, *(head(jet.first.get(i, 0) * c + found.arb(0))
                                                  for i, c in enumerate(states[: stated.bare]))])  # fmt: skip
                by_controls = largest([by_controls, *(head(jet.first.get(stated.bare + i, 0) * c + found.arb(0))
                                                      for i, c in enumerate(controls))])  # fmt: skip
            w, u = stated.bare * by_states * setting.length.sqrt() * self.square, stated.n * by_controls * self.slope
            reach += (w + u + abs(missed)) / states[stated.bare + j]
        return reach


def nearness(setting: Setting, tube: Tube, excess: Ball) -> Nearness:
    """How near curves of no greater value lie; Unproved where the curve is too far from stationary for the tube.

    From kappa |w|^2/4 + mu H(|u|)/2, H Huber's function, integrated, being no more than twice ``total`` and the
    ``excess`` of what is compared with over the value on the curve.
    """
    found = flint()
    r, q = worst(setting.along)
    energy, length = total(setting.along, tube.kappa, tube.mu) + excess / 2, setting.length
    rho = min(tube.rho)
    # of r nothing is asked: r w + kappa |w|^2/2 is a square less |r|^2/(2 kappa) whatever w is
    if tube.delta < math.inf and not q * 2 <= found.arb(tube.mu) * rho:
        raise Unproved(
            f"the curve is not stationary enough for the tube: the residuals are {float(r):.1g} and {float(q):.1g}"
        )
    for stiff, tilt, radius in zip(tube.stiffness, tube.tilt, tube.rho, strict=True):
        if radius < math.inf and not (found.arb(stiff) - tube.mu) * radius >= found.arb(tilt) * tube.delta:
            raise Unproved("the slopes of the tube are not wide enough")
    square = (8 * energy / tube.kappa).sqrt()
    slope = (8 * energy * length / tube.mu).sqrt()
    if rho < math.inf and not (8 * energy / (length * tube.mu)).sqrt() <= rho:
        raise Unproved("the curve is not stationary enough for the slopes of the tube")
    A, _ = dynamics(setting.statement.n, setting.statement.order, setting.statement.states)
    # z' = A z + B u in units of the states, which are powers of two
    states, controls = setting.sizes
    turning = float(np.abs(A * states / states[:, None]).max())
    rate = float((controls / states[(setting.statement.order - 1) * setting.statement.n]).max())
    pointwise = square * (1 / length.sqrt() + turning * length.sqrt()) + slope * rate
    if not pointwise.upper() < tube.delta:
        raise Unproved(f"curves of the same value are only known to lie within {float(pointwise):.1g}, beyond the tube")
    return Nearness(square, slope, pointwise)


@dataclass(frozen=True)
class Attained:
    """A value that is attained: by a curve of which ``pieces`` and how far it is ``moved`` from these are known.

    ``moved`` has an entry for each state and, after them, each control; none where the pieces are the curve.
    """

    value: Ball
    pieces: Sequence[Piece]
    moved: Sequence[Ball] = ()

    def stays(self, setting: Setting, tube: Tube, *, slopes: bool) -> bool:
        """Whether the curve is proved to lie in the tube of a setting, with ``slopes`` its controls too."""
        stated = setting.statement
        n, m = stated.n, stated.states
        far = self._far(setting)
        if far is None:
            return False
        moved = [a + b for a, b in zip(far, self.moved or [flint().arb(0)] * (m + n), strict=True)]
        widths = [*(tube.delta * tube.sizes[0]).tolist(), *(min(tube.rho) * tube.sizes[1]).tolist()]
        return all(moved[place] < widths[place] for place in range(m + n if slopes else m))

    def _far(self, setting: Setting) -> list[Ball] | None:
        """How far the pieces are from the curve of a setting, each state and control; None if that is not known."""
        stated, k = setting.statement, 0
        n, order, m = stated.n, stated.order, stated.states
        far = [flint().arb(0)] * (m + n)
        if self.pieces is setting.pieces:
            return far
        for piece in self.pieces:
            while not piece.centre < setting.pieces[k].centre + setting.pieces[k].half:
                k += 1
            rows = _apart(piece, setting.pieces[k])
            if rows is None:
                return None
            for i, row in enumerate(rows):
                places = [*(i + d * n for d in range(order)), m + i] if i < n else [n * (order - 1) + i]
                for place, size in zip(places, row, strict=True):
                    far[place] = largest([far[place], size])
        if stated.levels:
            missed = [abs(miss) for miss in meeting(setting).missed()]
            far[stated.bare : m] = [a + b for a, b in zip(grown(setting, far), missed, strict=True)]
        return far


def _apart(piece: Piece, other: Piece) -> list[list[Ball]] | None:
    """How far functions, with their derivatives, and numbers are from those of a piece around; None if it is not."""
    if not (
        other.centre - other.half <= piece.centre - piece.half
        and piece.centre + piece.half <= other.centre + other.half
    ):
        return None
    place = flint().arb_poly([(piece.centre - other.centre) / other.half, piece.half / other.half])
    rows = []
    for given, middle in zip(piece.functions, other.functions, strict=True):
        polys = [given - middle(place)]
        for _ in range(piece.order):
            polys.append(polys[-1].derivative() * (1 / piece.half))
        rows.append(list(map(most, polys)))
    return rows + [[most(a - b)] for a, b in zip(piece.numbers, other.numbers, strict=True)]
