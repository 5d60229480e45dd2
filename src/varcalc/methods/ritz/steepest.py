"""Curves of first order whose slope is at a bound on stretches: where these end is found by Newton's method.

Along such a stretch the curve is a known line, and the functional hardly says where it is left: an end that is moved
changes it by the third power of the way. That the slope leaves its bound continuously says it (Gelfand and Fomin,
"Calculus of Variations", sect. 16). An end that is moved along the line is away from the extremal beside it by the
square of the way alone, so that the slope there changes as it does along that extremal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Contact, Form, Sampled
from varcalc.methods.ritz.touching import touched_stretches
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.conditions import Bound
from varcalc.problem.functional import arguments_at
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import Cache

MIXED = 6
"""Shifts at most that are taken in view at once."""
LEARNT_FROM, LED_BACK = 2, 0.25
"""Shifts from which on something is learnt, and the share of a shift by which the next leads back to say so."""
BESIDE_END = 1e-5
"""Distance from the end of a stretch, in units of the piece beside it, at which its rate is told."""
STEPS_TO_ORDINATE = 8
"""Of Newton's method, from zero, to the ordinate of a point at which a curve is held."""
FOUND, NEARLY_FOUND = 1e-8, 1e-4
"""Shifts of the ends, in units of the interval, with which they are found, and from which on they nearly are.

The next shift goes by the square of the last, and the functional by the third power.
"""
NEARER = 0.15
"""Share of the room beside a point by which it is moved at once at most."""
SHORTENED = 0.4
"""Share of a stretch by which either end comes nearer to the other at once at most."""
UNCHANGED = 1e-3
"""Change over the room beside an end, of what it misses there, that is none."""
PLACES_BESIDE = (np.arange(16) + 0.5) / 16
"""Where it is seen, in units of that room, what it does mostly."""
FAR_OFF = 1e3
"""How far beside a stretch at a bound of the place, in units of its length, nothing tells of its end, as on a tip."""
LEAST_LENGTH, LEAST_ON_TIP = 1e-6, 1e-10
"""Length of a stretch, in units of the interval, that is none; the same of one at a bound of the place."""


def steep(form: Form) -> bool:
    """Whether a graph of one function of first order is under bounds of its slope alone."""
    problem, bounds = form.problem, form.conditions.pathwise
    plain = isinstance(problem, Problem) and form.n == form.order == 1 and not form.stated.is_lifted
    slopes = all(ca.depends_on(c.expression, form.symbols.dy) for c in bounds)
    numbers = range(len(problem.constraints))  # what else a form has asked for has none of these
    stated = all(c.index in numbers and isinstance(problem.constraints[c.index], Bound) for c in bounds)
    return bool(bounds) and plain and slopes and stated and not any(c.equality for c in bounds)


def steepest(form: Form, coarse: Solution) -> list[Contact]:
    """The stretches along which a coarse solution's slope is at a bound; none where they overlap."""
    contacts = sorted(touched_stretches(form, coarse), key=lambda c: c.start)
    return contacts if all(a.end < b.start for a, b in pairwise(contacts)) else []


def at_bounds(form: Form, contacts: Sequence[Contact], vertices: Iterable[float] = ()) -> Form:
    """The form with its bounds as equations on ``contacts``, and not at all elsewhere, on a mesh with ``vertices``.

    Contacts that are points hold the curve there.
    """
    bounds = {c.index: c for c in form.conditions.pathwise}
    pathwise = tuple(
        replace(bounds[c.index], lower=c.level, upper=c.level, where=(c.start, c.end))
        for c in contacts
        if c.start < c.end
    )
    ends = {e for c in contacts for e in (c.start, c.end) if form.span[0] < e < form.span[1]}
    knots = tuple(sorted({*form.conditions.knots, *ends, *vertices}))
    points = {c.start: ordinate_at(form, bounds[c.index].expression, c) for c in contacts if c.start == c.end}
    given = [side.copy() for side in (form.ends.start, form.ends.end)]
    for side, x in zip(given, form.span, strict=True):
        side[0, 0] = points.pop(x, side[0, 0])
    inside = tuple(sorted((*form.conditions.waypoints, *((x, (y,)) for x, y in points.items()))))
    conditions = replace(form.conditions, pathwise=pathwise, knots=knots, waypoints=inside)
    return replace(form, ends=replace(form.ends, start=given[0], end=given[1]), conditions=conditions, cache=Cache())


def ordinate_at(form: Form, expression: ca.SX, contact: Contact) -> float:
    """The ordinate at which an expression of the place has the level of a contact that is a point."""
    s, y = form.symbols, 0.0
    newton = s.y - (expression - contact.level) / ca.gradient(expression, s.y)
    onto = ca.Function("onto", s.all, [ca.densify(newton)])
    for _ in range(STEPS_TO_ORDINATE):
        y = float(onto(contact.start, y, 0.0, [], form.problem.parameter_values, []))
    return y


def moved(form: Form, contacts: Sequence[Contact], solution: Solution) -> list[Contact]:
    """The contacts with their ends nearer to where the curve sets out smoothly, but those that vanish.

    There a bound of the slope is one of the curve beside it, and one of the place moves as the curve does. Points at
    which the curve is held are moved to where it goes through as it would by itself.
    """
    assert solution.curve is not None
    asked = {c.index: c.expression for c in form.conditions.pathwise}
    places = [form.span[0], *(e for c in contacts for e in (c.start, c.end)), form.span[1]]
    ends = []
    for k, contact in enumerate(contacts):
        before, after = contact.start - places[2 * k], places[2 * k + 3] - contact.end
        expression, level = asked[contact.index], contact.level
        if contact.start == contact.end and contact.start in form.conditions.knots:
            # what holds the curve, or L, has a kink there whatever the curve
            ends.append((contact.start, contact.end))
            continue
        if contact.start == contact.end:
            ends.append((_refracted(form, expression, contact.start, before, after, solution.curve),) * 2)
            continue
        curve, length = solution.curve, contact.end - contact.start
        far = math.inf
        if not ca.depends_on(expression, form.symbols.dy):
            expression, level, far = _pace(form, expression), 0.0, FAR_OFF * length
        along, moves = _along(form, expression), list[float]()
        sides = ((contact.start, -before, (before, length)), (contact.end, after, (length, after)))
        free_sides = (True, False), (False, True)
        for (end, room, rooms), through, free in zip(sides, contact.through, free_sides, strict=True):
            if through:
                moves.append(_refracted(form, asked[contact.index], end, *rooms, curve, free) - end)
            else:
                near = math.copysign(min(abs(room), far), room)
                moves.append(_set_out(form, along, level, end, near, length, curve) if room else 0.0)
        # what is far too long is seen less well than where it should be
        most = SHORTENED * (contact.end - contact.start)
        ends.append((contact.start + min(moves[0], most), contact.end + max(moves[1], -most)))
    # along the tip of a narrow spike a stretch is far shorter than any that friction holds
    narrow = [not ca.depends_on(asked[c.index], form.symbols.dy) for c in contacts]
    least = [(LEAST_ON_TIP if tip else LEAST_LENGTH) * (form.span[1] - form.span[0]) for tip in narrow]
    clipped = [(max(a, form.span[0]), min(b, form.span[1])) for a, b in ends]
    return [
        replace(c, start=a, end=b)
        for c, (a, b), shortest in zip(contacts, clipped, least, strict=True)
        if b - a > shortest or c.start == c.end
    ]


def _refracted(
    form: Form, expression: ca.SX, x: float, before: float, after: float,
    curve: CurveOrSlope, free: Sequence[bool] = (True, True),
) -> float:  # fmt: skip
    """Nearly where a curve that is held on a surface at x has the same energy on both sides, with so much room there.

    On a surface that moves it is the energy as seen from that. On a side that is not ``free`` it stays on the surface.

    Then the functional is stationary in where it goes through (Weierstrass and Erdmann's second condition; Gelfand and
    Fomin, "Calculus of Variations", sect. 15). To first order it goes straight to what it is held by next. An end of
    the interval stays.
    """
    if before <= 0 or after <= 0:
        return x
    s, room = form.symbols, np.array([-before, after])
    momentum = ca.gradient(form.integrand, s.dy)
    pace = s.dy + ca.gradient(expression, s.x) / ca.gradient(expression, s.y)
    energy = _along(form, pace * momentum - form.integrand)
    bend = _along(form, pace**2 * ca.gradient(momentum, s.dy))
    near, far = x + BESIDE_END * room, x + 2 * BESIDE_END * room
    energies = 2 * energy(near, curve(near, 0), curve(near, 1)) - energy(far, curve(far, 0), curve(far, 1))
    rate = float(bend(near, curve(near, 0), curve(near, 1)) @ (np.array(free) / np.abs(room)))
    step = -(energies[1] - energies[0]) / rate if rate else math.inf
    return x + float(np.clip(step, -NEARER * before, NEARER * after)) if np.isfinite(step) else x


def _pace(form: Form, expression: ca.SX) -> ca.SX:
    """How fast an expression of the place changes along a curve."""
    s = form.symbols
    return ca.gradient(expression, s.x) + ca.gradient(expression, s.y) * s.dy


def carried(form: Form, before: Sequence[Contact], after: Sequence[Contact], curve: CurveOrSlope) -> Sampled:
    """A curve as a guess, its corners carried from the ends of contacts to where these are afterwards."""
    old, new = ([form.span[0], *(e for c in each for e in (c.start, c.end)), form.span[1]] for each in (before, after))
    if len(old) != len(new) or np.any(np.diff(new) < 0):
        return lambda x: curve(x, 0)
    return lambda x: curve(np.interp(x, new, old), 0)


class Shifted:
    """Where the ends of contacts were, and where they were to go from there: what is taught by it.

    Points at which a curve is held feel each other (Anderson's mixing; Walker and Ni, SIAM Journal on Numerical
    Analysis 49, 2011). Ends of stretches are found quadratically as it is, but where they were led too far, and are
    led back.
    """

    def __init__(self) -> None:
        self._known: list[tuple[np.ndarray, np.ndarray]] = []

    def mixed(self, before: Sequence[Contact], after: Sequence[Contact]) -> list[Contact]:
        """The contacts that follow, in view of all shifts that are known, or those ``after`` as they are."""
        plainly = list(after)
        points = [c.start == c.end for c in after]
        if [c.index for c in before] != [c.index for c in after] or points != [c.start == c.end for c in before]:
            self._known.clear()
            return plainly
        old, new = (np.array([(c.start, c.end) for c in each]).ravel() for each in (before, after))
        self._known.append((new - old, new))
        if len(self._known) < LEARNT_FROM:
            return plainly
        ends = (self._in_view_of_all() if any(points) else self._led_back()).reshape(-1, 2)
        ends[points, 1] = ends[points, 0]
        edges = np.delete(ends.ravel(), 1 + 2 * np.flatnonzero(points))
        if not np.isfinite(ends).all() or np.any(np.diff(edges) <= 0):
            return plainly
        return [replace(c, start=float(a), end=float(b)) for c, (a, b) in zip(after, ends, strict=True)]

    def _in_view_of_all(self) -> np.ndarray:
        """Where all ends go together by the last shifts."""
        shifts, places = (np.array(column[-MIXED:]).T for column in zip(*self._known, strict=True))
        weights = np.linalg.lstsq(np.diff(shifts), shifts[:, -1], rcond=None)[0]
        return places[:, -1] - np.diff(places) @ weights

    def _led_back(self) -> np.ndarray:
        """Where each end goes: between its last two places where it is led back as far, by the secant."""
        (first, at), (last, new) = self._known[-2:]
        before, old = at - first, new - last
        back = (first * last < 0) & (np.abs(last) > LED_BACK * np.abs(first))
        return np.where(back, old - last * (old - before) / np.where(back, last - first, 1.0), new)


def kept_vertices(contacts: Sequence[Contact], following: Sequence[Contact], solution: Solution) -> list[float]:
    """The vertices of the mesh on which a solution with ``contacts`` was found that others have use for."""
    old, new = ({e for c in each for e in (c.start, c.end)} for each in (contacts, following))
    shifted = max((min(abs(a - b) for b in old) for a in new), default=0.0)
    return [v for v in solution.x[1:-1].tolist() if all(abs(v - e) > 2 * shifted for e in old | new)]


def shift(form: Form, before: Sequence[Contact], after: Sequence[Contact]) -> float:
    """How far the ends of contacts were moved, in units of the interval; infinite where one vanished or two met.

    Those of a stretch that is far shorter, as beside a tip, in units of what is near it.
    """
    met = any(not a.end < b.start for a, b in pairwise(after))
    if len(before) != len(after) or met:
        return math.inf
    whole = form.span[1] - form.span[0]
    placed = {c.index for c in form.conditions.pathwise if not ca.depends_on(c.expression, form.symbols.dy)}
    narrow = [c.index in placed and c.start < c.end for c in after]
    units = [min(whole, FAR_OFF * (c.end - c.start)) if tip else whole for c, tip in zip(after, narrow, strict=True)]
    moves = [max(abs(a.start - b.start), abs(a.end - b.end)) for a, b in zip(before, after, strict=True)]
    return max((move / unit for move, unit in zip(moves, units, strict=True)), default=0.0)


def _set_out(
    form: Form, along: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray], level: float, end: float,
    room: float, length: float, curve: CurveOrSlope,
) -> float:  # fmt: skip
    """By how much to move the end of a stretch of a ``length`` with ``room`` beside it."""
    s, inside = form.symbols, end - math.copysign(BESIDE_END * length, room)
    momentum = ca.gradient(form.integrand, s.dy)
    beside = np.array([end + BESIDE_END * room])
    bend = _along(form, ca.gradient(momentum, s.dy))(beside, curve(beside, 0), curve(beside, 1))
    if bend[0] != 0.0:
        return _setting_out(along, level, end, room, curve)
    # L that is linear in the slope determines the curve beside the end without it: where the line comes to that it ends
    unmet = ca.gradient(form.integrand, s.y) - _pace(form, momentum)
    rate = _along(form, _pace(form, unmet))
    at = np.array([inside])
    missed, changes = (float(f(at, curve(at, 0), curve(at, 1))[0]) for f in (_along(form, unmet), rate))
    step = -missed / changes - (end - inside) if changes else 0.0
    return float(np.clip(step, -abs(room) / 2, abs(room) / 2))


def _setting_out(
    along: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray], level: float, end: float, room: float,
    curve: CurveOrSlope,
) -> float:  # fmt: skip
    """By how much to move the end of a stretch with ``room`` beside it, where a function should have its ``level``.

    That is Newton's step the other way, as the curve beside the end moves with it. Where the function has another value
    there, and does not change, the curve comes too fast, and the stretch holds nothing: it becomes as short as may be.
    Or it comes back from where it went too far, and should have been held before.
    """
    x = end + BESIDE_END * room * np.array([1.0, 2.0])
    if x[1] == x[0]:  # there is next to no room beside it
        return 0.0
    near, far = along(x, curve(x, 0), curve(x, 1)) - level
    rate, missed = (far - near) / (x[1] - x[0]), 2 * near - far
    if missed == 0.0:
        return 0.0
    if not abs(rate) * abs(room) > UNCHANGED * abs(missed):
        way = end + room * PLACES_BESIDE
        mostly = float((along(way, curve(way, 0), curve(way, 1)) - level).mean())
        return -math.copysign(math.inf, room) if mostly * missed > 0 else 0.5 * room
    return float(np.clip(-missed / rate, -abs(room) / 2, abs(room) / 2))


def _along(form: Form, expression: ca.SX) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """A bound's function at (x, y, slope), (m,) and (1, m) each."""
    function = ca.Function("bound", form.symbols.all, [ca.densify(expression)])

    def along(x: np.ndarray, y: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return np.asarray(function(*arguments_at(form.problem, x, y, slope, unknowns=form.start.unknowns)))[0]

    return along
