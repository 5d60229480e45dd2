"""Scattering by a central potential: deflections, cross-sections, rainbows, glories and orbiting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.mechanics.scattering.branches import Branches, Interval, Rainbow, branches
from varcalc.mechanics.scattering.deflection import (
    Approach,
    Deflections,
    Inwards,
    Orbiting,
    ScatteringOutcome,
    orbits_round,
)
from varcalc.mechanics.scattering.pieces import radial_pieces
from varcalc.problem.conditions import finite, positive, reals
from varcalc.showing import Brief, Fact, Plotted, line
from varcalc.spelling import spelled

VANISHED = 1e-12
"""Of the energy: what may be left of a potential far away."""
ONE_IMPACT = 1e-14
"""Of an impact parameter: two critical ones that are so near are one."""
HEAD_ON = 1e-8
"""Radians: an orbit that is deflected by π whether or not it is a little aside is no glory."""
LARGEST_IMPACT = 1e100
"""Impact parameters beyond it have no square to speak of."""


@dataclass(frozen=True, repr=False)
class Glory(Brief):
    """An orbit with an ``impact`` parameter other than 0 that leaves forwards or, ``backward``, the way it came.

    The ``angle`` is a whole multiple of π, and the cross-section diverges as 1/sin of it.
    """

    impact: float
    angle: float
    backward: bool


@spelled
class Scattering(Plotted):
    """Particles of one energy, or one of two about their centre of mass, scattered by a central potential.

    What is deflected by what angle depends on the potential in units of the energy alone (Brizard, "An Introduction
    to Lagrangian Mechanics", eq. 5.14; Landau and Lifshitz, "Mechanics", sect. 18): for two bodies the energy is that
    of their relative motion, and :class:`Collision` leads to the laboratory.

    Raises TypeError or ValueError naming the argument: for what is no function of a radius, does not vanish far away or
    switches at more radii than can be placed; an energy that is not positive; a hard core that is negative.

    Parameters
    ----------
    potential : callable
        ``U(r)``, written with CasADi or NumPy functions, vanishing far away. Kinks and jumps (``ca.if_else``,
        ``ca.fmin``) are read from it and kept exactly; where it is ``ca.inf`` orbits are thrown back.
    energy : float
        The kinetic energy far away, in the units of the potential.
    hard_core : float
        A radius at which orbits are thrown back, if they come so far; 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> coulomb = Scattering(lambda r: 1 / r, 2.0)
    >>> bool(abs(coulomb.deflection(0.25).angle - np.pi / 2) < 1e-15)
    True
    """

    def __init__(self, potential: Callable[..., Any], energy: float, *, hard_core: float = 0.0) -> None:
        self.energy: float = positive("energy", energy)
        self.hard_core: float = finite("hard_core", hard_core)
        if self.hard_core < 0:
            raise ValueError(f"hard_core must not be negative, not {self.hard_core:g}; it is a radius")
        self._approaches = tuple(Approach(piece, self.energy) for piece in radial_pieces(potential, self.hard_core))
        self._check_far_away()

    def __repr__(self) -> str:
        core = [f"hard_core={self.hard_core:g}"] if self.hard_core else []
        return line("Scattering", [f"energy={self.energy:.9g}", *core])

    def _headline(self) -> str:
        return f"Scattering by a central potential, at the energy {self.energy:.9g}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("pieces", f"{len(self._approaches)}, between which the potential has kinks or jumps")
        yield Fact("hard core", f"radius {self.hard_core:g}" if self.hard_core else "none")

    def _check_far_away(self) -> None:
        outermost = self._approaches[0]
        value, _ = outermost.piece.values(np.exp(-outermost.nodes.u[0]))
        if not abs(float(value)) <= VANISHED * self.energy:
            raise ValueError(
                f"potential must vanish far away, where the energy is kinetic alone; it is {float(value):.6g} there: "
                "take what it is at infinity from it and from the energy"
            )

    def deflection(self, impact: Any) -> Deflections:
        """The deflections of orbits with ``impact`` parameters of any shape.

        Raises ValueError for an impact parameter that is negative or no number.
        """
        b = reals("impact", impact)
        if not np.all((b >= 0) & (b <= LARGEST_IMPACT)):
            raise ValueError(f"impact must be numbers from 0 to {LARGEST_IMPACT:g}, not {impact!r}")
        found = Inwards(self._approaches, self.orbiting, b.ravel()).followed()
        arrays = found.angle, found.slope, found.closest, found.outcomes
        return Deflections(b, *(array.reshape(b.shape)[()] for array in arrays))

    @cached_property
    def orbiting(self) -> tuple[Orbiting, ...]:
        """The orbits that go round for ever, the outermost first; the logarithm by which the angle diverges."""
        return orbits_round(self._approaches)

    @property
    def rainbows(self) -> tuple[Rainbow, ...]:
        """Where the angle is stationary, by impact parameter: next to its angle the cross-section diverges as 1/√.

        They are zeros of the derivative between places at which a cubic foretells the angle to a few thousandths of a
        radian: narrower ones are not seen.
        """
        return self._branches.extrema

    @cached_property
    def glories(self) -> tuple[Glory, ...]:
        """The glories, by impact parameter: all that lie between the places that :attr:`rainbows` tells of.

        Next to an orbiting impact parameter they are without number, and those that double precision tells apart are
        given.
        """
        angles = self._branches.angle
        if len(angles) == 0:
            return ()
        whole = np.arange(np.ceil(angles.min() / np.pi), np.floor(angles.max() / np.pi) + 1)
        number, impact, slope = self._branches.meeting(whole * np.pi)
        order = [k for k in np.argsort(impact) if abs(impact[k] * slope[k]) > HEAD_ON]
        return tuple(
            Glory(float(impact[k]), float(whole[number[k]] * np.pi), bool(whole[number[k]] % 2)) for k in order
        )

    def cross_section(self, angle: Any) -> np.ndarray:
        """The differential cross-section dσ/dΩ at scattering angles between 0 and π, of any shape.

        The sum of b/(sin Θ abs(dχ/db)) over all impact parameters that are deflected by ±Θ, and whole turns more
        (Landau and Lifshitz, "Mechanics", sect. 18). Infinite at a rainbow, 0 where nothing goes.

        Raises ValueError for angles beyond, and for those less than what was looked at far away (1e-12).
        """
        wanted = reals("angle", angle)
        if not np.all((wanted > 0) & (wanted < np.pi)):
            raise ValueError(f"angle must lie between 0 and pi, where the cross-section is a number, not {angle!r}")
        if np.any(wanted <= self._branches.least):
            raise ValueError(f"angle must be more than {self._branches.least:.3g}: nothing farther out was looked at")
        flat = wanted.ravel()
        reach = np.abs(self._branches.angle).max(initial=0.0)
        turns = 2 * np.pi * np.arange(-np.ceil(reach / (2 * np.pi)), np.ceil(reach / (2 * np.pi)) + 1)
        targets = (turns[:, None, None] + np.stack([flat, -flat])).ravel()
        whose = np.tile(np.arange(len(flat)), 2 * len(turns))
        order = np.argsort(targets)
        number, impact, slope = self._branches.meeting(targets[order])
        mine = whose[order][number]
        with np.errstate(divide="ignore"):
            parts = impact / (np.sin(flat[mine]) * np.abs(slope))
        # of nothing at all bincount makes whole numbers
        return np.bincount(mine, parts, minlength=len(flat)).astype(float).reshape(wanted.shape)[()]

    @cached_property
    def total_cross_section(self) -> float:
        """The area π b² of all that is deflected, however little, or captured: infinite unless the potential ends."""
        outermost = self._approaches[0].piece
        return np.inf if not outermost.constant else float(np.pi * outermost.inner**2)

    @cached_property
    def capture_cross_section(self) -> float:
        """The area of the impact parameters from which orbits fall into the centre."""
        edges = [0.0, *self._critical]
        area = 0.0
        for low, high in pairwise(edges):
            if self.deflection((low + high) / 2).outcomes is ScatteringOutcome.CAPTURED:
                area += np.pi * (high - low) * (high + low)
        return area

    @cached_property
    def _critical(self) -> list[float]:
        """Impact parameters, ascending, at which the angle jumps, diverges or has a kink."""
        found = [one.impact for one in self.orbiting]
        for outer, inner in pairwise([*self._approaches, None]):
            if outer is None or outer.piece.inner == 0:
                continue
            edge = outer.piece.inner
            for side in (outer, inner):
                share = side.medium.values(edge)[0] if side is not None else 0.0
                if 0 < share < np.inf:
                    found.append(float(edge * np.sqrt(share)))
        found = np.sort(found).tolist()
        return [b for a, b in pairwise([0.0, *found]) if b - a > ONE_IMPACT * b]

    @cached_property
    def _branches(self) -> Branches:
        edges = [0.0, *self._critical]
        if not self._approaches[0].piece.constant:
            edges.append(np.inf)
        intervals = tuple(Interval(low, high) for low, high in pairwise(edges))
        return branches(lambda impact: Inwards(self._approaches, self.orbiting, impact).followed(), intervals)
