"""The field of extremals and the tube of a proof, chosen: as much room as there is, in as wide a tube as holds it."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, TypeAlias

import numpy as np

from varcalc.certificates.balls import Box
from varcalc.certificates.ends import bears, end_bends, fits, prove_ends
from varcalc.certificates.field import JacobiFields, field, parted, turned_dynamics, unresolved
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.setting import Setting, on_halves
from varcalc.certificates.tube import Prover, TooWide, Tube, slopes

Told: TypeAlias = Callable[[str], Any]
"""Who is told what comes next."""
KAPPAS = tuple(10.0 ** (0.5 - 0.5 * k) for k in range(18))
"""Values of kappa that are tried, in units of H_uu, from the greatest."""
FEW_KAPPAS = 3
"""After how many that bear no even field the smallest is tried: where that bears none, none does."""
MARGIN = 1.5
"""How many times kappa and mu Jacobi's equation is lowered by: what is over pays for rounding and for the tube."""
CONVEX_ENOUGH = 0.3
"""Least second derivative of a convex Lagrangian, in units of H_uu, at which Q = 0 serves."""
EVEN = 0.2
"""Evenness of a field that will do: a smaller kappa would make it more even, and the tube narrower."""
NEARLY_AS_EVEN = 0.6
"""Share of that evenness, or of what the smallest kappa has where that is less, that will do then."""
WIDEST = 0.5
"""Widest tube tried, relative to the size of the curve."""
TUBES = 40
"""How many times the tube may be halved."""
SOME_BOXES = 6
"""Boxes at whose middles tubes are tried first."""
DEEPEST = 60
"""How deep boxes are cut for the inequality; at first a narrower tube is tried where ``SHALLOW`` is too little."""
SHALLOW = 5
PIECE_HALVINGS = 5
"""How often pieces are halved on which Q is not resolved."""
LOOSELY_KNOWN, FIELD_RESOLVED = 1e-3, 1e-7
"""Last coefficients of Q, relative to it: beyond the one no proof is tried, below the other none is tried again."""
NARROWINGS = 3
"""Tubes that are tried so."""


def silent(_what: str) -> None:
    """Tell nobody."""


def proved_tube(setting: Setting, told: Told = silent) -> Prover:
    """The inequality proved, in a tube as wide as a few halvings find."""
    stiffness, convex = _convexity(setting)
    if convex >= CONVEX_ENOUGH * stiffness and setting.statement.order == 1:
        try:
            return _in_some_tube(setting, 0.5 * convex, 0.25 * stiffness, None, told)
        except Unproved:
            pass  # between the points where it was looked at H may be less convex
    told("the field of extremals")
    for _ in range(PIECE_HALVINGS):
        kappa, mu, found = _field(setting, stiffness)
        rough, finer = (unresolved(found, share) for share in (LOOSELY_KNOWN, FIELD_RESOLVED))
        if not rough:
            try:
                return _in_some_tube(setting, kappa, mu, found, told)
            except Unproved:
                if not finer:
                    raise
        setting = on_halves(setting, rough or finer)
    return _in_some_tube(setting, *_field(setting, stiffness), told)


def _in_some_tube(setting: Setting, kappa: float, mu: float, found: JacobiFields | None, told: Told) -> Prover:
    """The inequality with one field proved, in a tube as wide as a few halvings find."""
    jumps = parted(setting.statement, setting.samples)
    Q = slopes(found, len(setting.pieces), setting.statement.states, jumps)
    boxes, reason = setting.along.boxes, ""

    @lru_cache(maxsize=TUBES)
    def prover(delta: float) -> Prover:
        return Prover(setting, Q, _tube(setting, found, kappa, mu, delta))

    if setting.statement.quadratic:
        told("the inequality")
        prover(math.inf).prove(boxes, DEEPEST)
        return prover(math.inf)
    widths = [WIDEST * 0.5**k for k in range(TUBES)]
    some = boxes[:: max(1, len(boxes) // SOME_BOXES)]

    # what holds in a tube holds in any that is narrower, so that one box after another narrows it
    on_boxes = [partial(_seems, prover, box) for box in some]
    first = 0
    for holds in (*on_boxes, lambda delta: fits(prover(delta))):
        if first < TUBES and not holds(widths[first]):
            first = bisect.bisect_left(widths, True, lo=first + 1, key=holds)
    if first == TUBES and not prover(widths[-1]).wide(some):
        prove_ends(prover(widths[-1]))
    # half of what holds at the middles of boxes: between them it takes a little more; then a quarter of that at a time
    for k, delta in enumerate(widths[first + 1 :: 2]):
        told(f"a tube of {delta:.1g} times the curve's size")
        try:
            prover(delta).prove(boxes, DEEPEST if k >= NARROWINGS else SHALLOW)
        except TooWide as failed:
            reason = str(failed)
            if k >= NARROWINGS:
                break
            # where it failed it fails first, if again
            boxes = [boxes[failed.number], *boxes[: failed.number], *boxes[failed.number + 1 :]]
        else:
            return prover(delta)
    raise Unproved(reason or "the inequality holds in no tube, however narrow")


def _seems(prover: Callable[[float], Prover], box: tuple[int, Box], delta: float) -> bool:
    """Whether the inequality seems to hold in the tube of a width, on one box."""
    return not prover(delta).wide([box])


def _convexity(setting: Setting) -> tuple[float, float]:
    """The least second derivative in the slope, and of the rest of H, at the nodes; Unproved where it is none."""
    m = setting.statement.states
    hessians = np.concatenate(setting.scaled)
    zz, zu, uu = hessians[:, :m, :m], hessians[:, :m, m:], hessians[:, m:, m:]
    stiffness = float(np.linalg.eigvalsh(uu).min())
    if not stiffness > 0:
        at = np.concatenate([s.x for s in setting.samples])[int(np.linalg.eigvalsh(uu)[:, 0].argmin())]
        raise Unproved(
            f"Legendre's condition fails: the least second derivative in the slope is {stiffness:.3g} near {at:.6g}"
        )
    schur = zz - zu @ np.linalg.solve(0.6 * uu, zu.transpose(0, 2, 1))
    return stiffness, float(np.linalg.eigvalsh(schur).min())


def _field(setting: Setting, stiffness: float) -> tuple[float, float, JacobiFields]:
    """kappa, mu and the field, with kappa as great as the field allows."""
    for bends in end_bends(setting.statement, setting.joints):
        found = _greatest(setting, stiffness, bends)
        if found is not None:
            return found
    raise Unproved(
        "Jacobi's equation has no field of extremals around the curve: there is a conjugate point, or nearly one"
    )


def _greatest(
    setting: Setting, stiffness: float, bends: tuple[np.ndarray, np.ndarray]
) -> tuple[float, float, JacobiFields] | None:
    """The field of the greatest kappa that is even enough."""
    for share in KAPPAS[:FEW_KAPPAS]:
        found = _bearing(setting, stiffness, bends, share)
        if found is not None and found[2].evenness > EVEN:
            return found
    smallest = _bearing(setting, stiffness, bends, KAPPAS[-1])
    if smallest is None:
        return None  # what bears a field with a greater kappa bears one with a smaller, and a more even one
    tried: dict[float, tuple[float, float, JacobiFields]] = {KAPPAS[-1]: smallest}
    enough = NEARLY_AS_EVEN * min(EVEN, smallest[2].evenness)

    def serves(share: float) -> bool:
        """Whether the field of this kappa is even enough; it is kept in ``tried``."""
        found = _bearing(setting, stiffness, bends, share)
        if found is not None:
            tried[share] = found
        return found is not None and found[2].evenness >= enough

    return tried[KAPPAS[bisect.bisect_left(KAPPAS[:-1], True, key=serves)]]


def _bearing(
    setting: Setting, stiffness: float, bends: tuple[np.ndarray, np.ndarray], share: float
) -> tuple[float, float, JacobiFields] | None:
    """The field of one kappa, where there is one that leaves the terms of the ends positive."""
    m, scales = setting.statement.states, np.concatenate(setting.sizes)
    kappa, mu = share * stiffness, min(0.1 * share, 0.25) * stiffness
    lowered = MARGIN * np.r_[np.full(m, kappa), np.full(len(scales) - m, mu)] / scales**2
    found = field(setting.statement, setting.samples, lowered, bends)
    return (kappa, mu, found) if found is not None and bears(setting.statement, setting.joints, found) else None


def _tube(setting: Setting, found: JacobiFields | None, kappa: float, mu: float, delta: float) -> Tube:
    """The tube of half-width ``delta``, with bounds that the curve's own second derivatives suggest."""
    stated, (states, controls) = setting.statement, setting.sizes
    m = stated.states
    stiff, tilts, rho = [], [], []
    for k, (hessian, s) in enumerate(zip(setting.scaled, setting.samples, strict=True)):
        least = float(np.linalg.eigvalsh(hessian[:, m:, m:]).min())
        B, mixed = turned_dynamics(stated, s)[1], s.hessian[:, :m, m:]
        if found is not None:
            mixed = (
                mixed
                - np.linalg.solve(found.U[k].transpose(0, 2, 1), found.M[k].transpose(0, 2, 1)).transpose(0, 2, 1) @ B
            )
        tilt = float(np.sqrt(((mixed * states[:, None] * controls) ** 2).sum(axis=(1, 2))).max())
        stiff.append(0.7 * least)
        tilts.append(1.3 * tilt + 0.1 * least)
        rho.append(math.inf if delta == math.inf else 1.05 * tilts[-1] * delta / (stiff[-1] - mu))
    return Tube(delta, tuple(rho), kappa, mu, tuple(stiff), tuple(tilts), setting.sizes)
