"""Rayleigh's quotient: what is proved near an eigenfunction, carried to all curves.

Let L and the one prescribed integrand g be homogeneous of second degree, and what is held at the ends zero. With B(y)
and G(y) the integrals of H = L + lambda g and of g, any admissible curve is y = a y0 + z with a number a and G's form
G(y0, z) = 0. That is what curves near y0 keep to first order, so the inequality of the tube, at w = 0, tells that
B(z) >= 1/2 integral of kappa |z|^2 + mu |u|^2. With half of that B(y) >= a^2 (B(y0) - 2 E), E as for the tube; the
other half exceeds eta G(z) for a small number eta. So B - eta G is nowhere negative where eta = (B(y0) - 2 E)/G(y0),
and the integral of L is at least (eta - lambda) c where G = c. It is Temple's inequality, with the next eigenvalue
bounded from below by the field of extremals (Weinstein and Stenger, "Methods of Intermediate Problems for Eigenvalues",
1972, ch. 5).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from varcalc.certificates.balls import Around, Ball, flint, largest
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet
from varcalc.certificates.levels import meeting
from varcalc.certificates.setting import Setting
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement
from varcalc.certificates.tube import Tube


def lowest_of_all(setting: Setting, tube: Tube, drop: Ball) -> Ball | None:
    """A lower bound, over all curves, of the integral of L, for a tube that is proved; None for no Rayleigh quotient.

    ``drop`` is E.
    """
    stated = setting.statement
    if not (_plain(stated) and stated.levels == 1 and homogeneous(setting)):
        return None
    level, found = flint().arb(stated.along.form.conditions.integrals[0].lower), flint()
    try:
        norm = level + meeting(setting).missed()[0]
    except Unproved:
        return None
    if norm.contains(0):
        return None
    ratio = (setting.along.value - 2 * drop) / norm
    eta = ratio.lower() if norm > 0 else ratio.upper()
    room = found.arb(min(tube.kappa, tube.mu)) / 2
    if not abs(eta) * _size_of_level(setting) <= room:
        return None
    return ((eta - found.arb(float(stated.along.lambdas[0]))) * level).lower()


def _size_of_level(setting: Setting) -> Ball:
    """A bound of g's second derivatives, as a norm, in units of states and controls."""
    stated, found = setting.statement, flint()
    scale = [*setting.sizes[0][: stated.bare].tolist(), *setting.sizes[1].tolist()]
    sums = []
    for k, box in setting.along.boxes:
        around = Around(box, 1, whole=True)
        states, controls = setting.pieces[k].lifted(around)
        total = found.arb(0)
        for (i, j), value in stated.level_jets(around.abscissa(), states, controls, 2)[0].second.items():
            total += abs(head(value) * (scale[i] * scale[j])) * (1 if i == j else 2)
        sums.append(total)
    return largest(sums)


def _plain(stated: Statement) -> bool:
    """Whether curves are graphs between ends that are held, free or one."""
    form = stated.along.form
    if form.coordinates.energetic or form.coordinates.gauged or form.lift is not None:
        return False
    return stated.cost is None and not stated.waypoints and not len(stated.along.numbers)


def homogeneous(setting: Setting) -> bool:
    """Whether H and what is prescribed an integral are of second degree and nothing else, and ends are held at zero."""
    stated = setting.statement
    zero = all(not np.any(values[held]) for held, values in zip(stated.held, stated.values, strict=True))
    return zero and stated.of_second_degree and _vanishes_with_the_curve(setting)


def _vanishes_with_the_curve(setting: Setting) -> bool:
    """Whether H and the prescribed integrand vanish on y = 0 with their slopes: then all they have is of degree two."""
    stated, zero = setting.statement, flint().arb(0)
    states, controls = [zero] * stated.bare, [zero] * stated.n
    try:
        for k, box in setting.along.boxes:
            around = Around(box, 1, whole=True)
            x = around.abscissa()
            own = stated.jet(x, states, controls, 1, setting.pieces[k].switches)
            if not all(_zero(jet) for jet in (own, *stated.level_jets(x, states, controls, 1))):
                return False
    except Undecided:
        return False
    return True


def _zero(jet: Jet) -> bool:
    return all(_all_zero(value) for value in (jet.value, *jet.first.values()))


def _all_zero(value: Any) -> bool:
    if isinstance(value, flint().arb_series):
        return all(bool(c.is_zero()) for c in value.coeffs())
    return bool((flint().arb(0) + value).is_zero())
