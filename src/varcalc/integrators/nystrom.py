"""Nyström's method of order 12 for systems of second order in which no rate depends on a velocity.

Dormand, El-Mikkawy, Prince, "High-order embedded Runge-Kutta-Nyström formulae", IMA Journal of Numerical Analysis 7
(1987) 423: 17 stages, with a solution of order 10 beside it. Of dq/ds = v, dv/ds = f(s, q) the stages are places only:
with rays in a graded medium each takes a quarter of the steps of a method of order 8 that knows nothing of this, and
little more for each. What else has a rate that depends on places alone, such as the optical path, goes like a velocity.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import CannotLower, scalar_function
from varcalc.integrators.side_by_side import combined
from varcalc.integrators.stops import Interpolant
from varcalc.integrators.written import FEW_RUNS, WrittenStep, WrittenStepper, weighted, worth_writing
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

STAGE_PLACES = (
    (0.0002,),
    (0.0002666666666666667, 0.0005333333333333334),
    (0.002916666666666667, -0.004166666666666667, 0.00625),
    (0.0016460905349794238, 0, 0.0054869684499314125, 0.0017558299039780521),
    (0.0019456, 0, 0.007151746031746032, 0.0029127111111111113, 0.0007899428571428571),
    (0.00056640625, 0, 0.0008809730489417989, -0.0004369212962962963, 0.00033900669642857143, -9.946469907407407e-05),
    (0.0030833333333333333, 0, 0, 0.0017777777777777779, 0.0027, 0.0015782828282828283, 0.01086060606060606),
    (0.00365183937480113, 0, 0.003965171714072343, 0.0031972582629306284, 0.008221467306855435, -0.0013130926959572379,
     0.009771586968064868, 0.003755769069232834),
    (0.003707241068718501, 0, 0.005082045854555286, 0.001174708002175412, -0.021147629915126993, 0.06010463698107881,
     0.02010573476850619, -0.02835075012293358, 0.014879568918581932),
    (0.03512537656073344, 0, -0.008615749195138479, -0.005791448051007917, 1.945554823782616, -3.4351238674565137,
     -0.10930701107475221, 2.3496383118995166, -0.7560094086870229, 0.10952897222156927),
    (0.020527792537482496, 0, -0.00728644676448018, -0.0021153556079618403, 0.9275807968723522, -1.6522824844257367,
     -0.02107956300568657, 1.2065364326207872, -0.4137144770010661, 0.09079873982809654, 0.005355552600533985),
    (-0.14324078875545515, 0, 0.012528703773091817, 0.006826019163969827, -4.799555395574387, 5.6986250439519415,
     0.7553430369523645, -0.12755487858281084, -1.9605926051117384, 0.9185609056635262, -0.23880085505284432,
     0.15911081357234216),
    (0.8045019205520489, 0, -0.016658527067011247, -0.021415834042629735, 16.827235928962466, -11.172835357176098,
     -3.377159297226324, -15.243326655360846, 17.179835738215417, -5.437719239823995, 1.3878671618364655,
     -0.5925827732652812, 0.029603873171297354),
    (-0.913296766697358, 0, 0.0024112725757805178, 0.01765812269386174, -14.851649779720384, 2.1589708670045757,
     3.99791558311788, 28.434151800232232, -25.2593643549416, 7.733878542362238, -1.8913028948478674,
     1.0014845070224718, 0.004641199599109052, 0.011218755022148957),
    (-0.27519629720559396, 0, 0.03661188877915492, 0.009789519688231562, -12.293062345886211, 14.207226453937903,
     1.5866476906789537, 2.4577735327595946, -8.935193694403273, 4.373672731613407, -1.8347181765449492,
     1.1592085289061491, -0.017290253165383924, 0.019325977904460768, 0.005204442937554993),
    (1.3076391847404059, 0, 0.017364109189745843, -0.018544456454265796, 14.811522032867726, 9.38317630848247,
     -5.2284261999445425, -48.95128052584765, 38.297096034337926, -10.58738133697598, 2.4332304376226275,
     -1.0453406042575444, 0.0717732095086726, 0.0021622109708082783, 0.007009595759602514, 0),
)  # fmt: skip
"""The place of each stage after the first, by the rates of those before it."""
VELOCITY = (
    0.012127868517185414, 0, 0, 0, 0, 0, 0.09083943422704079, 0.3156836976483934, -0.2632249065769097,
    0.3047803786184589, -0.041551616155429835, 0.2467756096762953, 0.15226053010586602, 0.08143848163026961,
    0.08502571193890811, -0.009155189630077963, 0.025,
)  # fmt: skip
"""The velocity after the step."""
VELOCITY_ERROR = (
    -0.004880833389821577, 0, 0, 0, 0, 0, 0.014776975352481408, -0.1493490240100479, 0.2725366201021616,
    -0.19840222383356862, 0.22106138599523378, -0.17944618020981415, 0.04489732194574983, -0.03270117761115586,
    0.015662325288859434, -0.029155189630077964, 0.025,
)  # fmt: skip
"""By how much that of order 10 differs from it."""
FIRST, UNUSED = 1, 0
"""Where the rates of the first stage are kept, and of the second: only the two after it need those."""
NODES = range(6, 15)
"""Stages between the ends of a step that its outcome is made of."""
NODES_WITHIN, PLACE_NODES = (6, 7, 8, 9, 10, 11, 12, 13), (6, 7, 9, 11, 12, 13)
"""Those whose rates the solution within a step has: velocities, and places with the rates at both ends."""
LEAST = 1e-12
"""Relative error of the solution of order 10 with which that of order 12 has as many digits as there are."""


@dataclass(frozen=True)
class SecondOrder:
    """A system as dq/ds = v, dw/ds = f(s, q), du/ds = g(s, q, v), where w are the velocities v and more like them.

    ``places`` (d,), ``velocities`` (d,), ``moved`` (n,), which are w with v first, and ``followed``, which are u, are
    numbers of its states. ``rates`` (s, q, constants) and ``following`` (s, q, v, constants) are f and g. Within a step
    places are known as well as they need be for those after it, velocities are not: u tells of the step, and is worth
    a few digits less.
    """

    rates: ca.Function
    following: ca.Function
    places: list[int]
    velocities: list[int]
    moved: list[int]
    followed: list[int]


def second_order(system: ca.Function, watching: int = 0) -> SecondOrder | None:
    """The ``system`` as one of second order whose forces are free of velocities; None where it is none.

    Of its states only the last ones, which are ``watching``, may be followed.
    """
    try:
        formula = scalar_function(system)
    except CannotLower:
        return None
    s, state, constants = (ca.SX.sym(name, formula.numel_in(k)) for k, name in enumerate("sYc"))
    rates, states = ca.densify(ca.SX(formula(s, state, constants))), ca.vertsplit(state)
    number = {one.element_hash(): k for k, one in enumerate(states)}
    velocity_of = {
        k: number[rate.element_hash()]
        for k, rate in enumerate(ca.vertsplit(rates))
        if rate.is_symbolic() and rate.element_hash() in number
    }
    places, velocities = list(velocity_of), list(velocity_of.values())
    if not places or len({*places, *velocities}) < 2 * len(places):
        return None
    moved, followed = list(velocities), list[int]()
    for k in range(len(states)):
        if k not in places and k not in velocities:
            (followed if ca.depends_on(rates[k], state[velocities]) else moved).append(k)
    q, v = state[places], state[velocities]
    if min(followed, default=len(states)) < len(states) - watching:
        return None
    if ca.depends_on(rates[moved], state[moved + followed]) or ca.depends_on(
        rates[followed], state[moved[len(places) :] + followed]
    ):
        return None
    force = ca.Function("force", [s, q, constants], [rates[moved]], {"cse": True})
    following = ca.Function("following", [s, q, v, constants], [rates[followed]], {"cse": True})
    return SecondOrder(force, following, places, velocities, moved, followed)


@dataclass(frozen=True)
class Nystrom:
    """The method for one system; see :class:`varcalc.integrators.side_by_side.EmbeddedMethod`."""

    system: SecondOrder
    spare: dict[int, NystromStepper | WrittenStepper] = field(default_factory=dict, repr=False, compare=False)
    power, safety, least = 11.0, 0.8, LEAST

    def __reduce__(self) -> tuple[Any, ...]:
        return Nystrom, (self.system,)

    @cached_property
    def rates(self) -> PointEvaluator:
        """dw/ds at many points."""
        return PointEvaluator(self.system.rates)

    @cached_property
    def following(self) -> PointEvaluator:
        """du/ds at many points."""
        return PointEvaluator(self.system.following)

    def room(self, m: int) -> NystromStepper | WrittenStepper:
        """See :meth:`varcalc.integrators.side_by_side.EmbeddedMethod.room`."""
        kept = self.spare.pop(m, None)
        if kept is not None:
            return kept
        if m <= FEW_RUNS and (written := self._written) is not None:
            return WrittenStepper(written, m)
        return NystromStepper(self, m)

    @cached_property
    def _written(self) -> WrittenStep | None:
        system = self.system
        return _WrittenNystrom(system).written() if all(map(worth_writing, (system.rates, system.following))) else None


class _WrittenNystrom:
    """The step of :class:`NystromStepper` in symbols."""

    def __init__(self, system: SecondOrder) -> None:
        self.system = system
        self.size = len(system.places) + len(system.moved) + len(system.followed)
        self.constants = ca.SX.sym("c", system.rates.numel_in(2))
        self.time, self.end = ca.SX.sym("t"), ca.SX.sym("e")
        self.state, self.slope = ca.SX.sym("Y", self.size), ca.SX.sym("f", self.size)
        self.length = self.end - self.time

    def written(self) -> WrittenStep:
        """The step, and what is known within it."""
        begun = [self.time, self.end, self.state, self.slope, self.constants]
        result, stages, followed = self._step()
        within = [*(stages[k] for k in NODES_WITHIN), *(followed[k] for k in NODES_WITHIN)]
        step = ca.Function("step", begun, [ca.densify(ca.vertcat(*result, *within))])
        known = ca.SX.sym("known", step.numel_out(0))
        between = ca.Function("between", [*begun, known], [ca.densify(self._between(known))])
        slope = ca.Function("slope", [self.time, self.state, self.constants], [ca.densify(self._slope())])
        return WrittenStep(PointEvaluator(slope), PointEvaluator(step), PointEvaluator(between), 1, _root_mean_square)

    def _whole(self, place: Expression, moved: Expression, followed: Expression) -> Expression:
        whole, system = ca.SX.zeros(self.size), self.system
        whole[system.places], whole[system.moved], whole[system.followed] = place, moved, followed
        return whole

    def _slope(self) -> Expression:
        system, state = self.system, self.state
        place, velocity = state[system.places], state[system.velocities]
        rates = system.rates(self.time, place, self.constants)
        return self._whole(velocity, rates, system.following(self.time, place, velocity, self.constants))

    def _step(self) -> tuple[list[Expression], dict[int, Expression], dict[int, Expression]]:
        """State, slope and error after the step, and the rates of the stages of what is moved and what follows."""
        at, used, places, outcome = _tables()
        system, h, d = self.system, self.length, len(self.system.places)
        begin, moved, followed = (self.state[which] for which in (system.places, system.moved, system.followed))
        velocity = moved[:d]
        k: dict[int, Expression] = {FIRST: self.slope[system.moved]}
        there: dict[int, Expression] = {}

        def bent(part: float, weights: np.ndarray) -> Expression:
            return begin + part * h * velocity + h**2 * weighted(weights, k)[:d]

        for s in range(1, 17):
            weights = np.zeros(17)
            weights[used[s]] = places[s, used[s]]
            there[s] = bent(at[s], weights)
            k[s if s > 1 else UNUSED] = ca.densify(system.rates(self.time + at[s] * h, there[s], self.constants))
        of_use = np.where(np.arange(17) == UNUSED, 0.0, outcome)
        place = bent(1.0, of_use[0])
        rates = ca.densify(system.rates(self.end, place, self.constants))
        after = moved + h * weighted(of_use[1], k)
        last = ca.densify(system.following(self.end, place, after[:d], self.constants))
        f = self._followed(k, there, last)
        new = self._whole(place, after, followed + h * weighted(of_use[1], f))
        error = self._whole(h**2 * weighted(of_use[2], k)[:d], h * weighted(of_use[3], k), h * weighted(of_use[3], f))
        return [new, self._whole(after[:d], rates, last), error], k, f

    def _followed(
        self, k: dict[int, Expression], there: dict[int, Expression], last: Expression
    ) -> dict[int, Expression]:
        """du/ds at the stages, with the velocities there by all rates of the step."""
        system, h, at, weights = self.system, self.length, _tables()[0], _velocities()
        f = {FIRST: self.slope[system.followed], 15: last, 16: last}
        for s in NODES:
            row = np.where(np.arange(17) == UNUSED, 0.0, weights[s])
            velocity = self.state[system.velocities] + h * weighted(row, k)[: len(system.places)]
            f[s] = ca.densify(system.following(self.time + at[s] * h, there[s], velocity, self.constants))
        return f

    def _between(self, known: Expression) -> Expression:
        """The shape of the interpolant, place by place; of what :meth:`NystromStepper.interpolant` calls dense."""
        system, h, size, count = self.system, self.length, self.size, len(NODES_WITHIN)
        before, after = h * self.slope, h * known[size : 2 * size]
        rise = known[:size] - self.state
        shape = ca.SX.zeros(size, 3 + count)
        shape[:, 0], shape[:, 1], shape[:, 2] = rise, before - rise, 2 * rise - after - before
        n, m = len(system.moved), len(system.followed)
        stages = ca.reshape(known[3 * size : 3 * size + count * n], n, count)
        self._bend(shape, before, after, stages)
        if m:
            follow = ca.reshape(known[3 * size + count * n :], m, count)
            shape[system.followed, 3:] = self._shaped(_within()[0], shape[system.followed, :3], h * follow)
        nodes = _tables()[0][list(NODES_WITHIN)]
        turns = np.arange(3 + count) % 2 == 0
        weights = np.cumprod(np.where(turns, nodes[:, None], 1 - nodes[:, None]), axis=1)
        places = self.state[system.places] + shape[system.places, :] @ weights.T
        again = [
            ca.densify(system.rates(self.time + part * h, places[:, j], self.constants)) for j, part in enumerate(nodes)
        ]
        self._bend(shape, before, after, ca.horzcat(*again))
        return ca.vec(shape)

    def _bend(self, shape: Expression, before: Expression, after: Expression, rates: Expression) -> None:
        """See :meth:`NystromStepper._bend`."""
        system, h, own = self.system, self.length, self.length * rates
        shape[system.moved, 3:] = self._shaped(_within()[0], shape[system.moved, :3], own)
        columns = [k for k, node in enumerate(NODES_WITHIN) if node in PLACE_NODES]
        ends = [h * end[system.velocities] for end in (before, after)]
        bent = ca.horzcat(*ends, h * own[: len(system.places), columns])
        shape[system.places, 3:] = self._shaped(_within()[1], shape[system.places, :3], bent)

    def _shaped(self, table: np.ndarray, begun: Expression, rates: Expression) -> Expression:
        return ca.horzcat(begun, rates) @ table.T


def _root_mean_square(error: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("mn,mn->m", error, error) / error.shape[1])


class NystromStepper:
    """Memory for a step of ``m`` runs; see :class:`varcalc.integrators.side_by_side.Stepper`."""

    def __init__(self, method: Nystrom, m: int) -> None:
        self.method, system = method, method.system
        d, constants = len(system.places), system.rates.numel_in(2)
        self.order: Literal["C", "F"] = method.rates.order(m)
        self.length, self.time = np.zeros(m), np.zeros(m)
        self.constants = np.zeros((m, constants), order=self.order)
        self.place, self.velocity, self.sum, self.square = (np.zeros((m, d), order=self.order) for _ in range(4))
        self.rates = np.zeros((m, len(system.moved)), order=self.order)
        self.call = method.rates.bound([self.time[:, None], self.place, self.constants], self.rates)
        self.stages = self._room(17, len(system.moved))
        self.places = self._room(17 if system.followed else 0, d)
        self.following = self._room(17, len(system.followed))

    def _room(self, count: int, size: int) -> np.ndarray:
        m = len(self.time)
        return np.zeros((count, m, size)) if self.order == "C" else np.zeros((count, size, m)).transpose(0, 2, 1)

    def _parts(self, state: np.ndarray, which: list[int]) -> np.ndarray:
        return np.asarray(state[:, which], order=self.order)

    def _whole(self, place: np.ndarray, moved: np.ndarray, followed: np.ndarray) -> np.ndarray:
        """Whole states, or rates, of the parts of them."""
        system, m = self.method.system, len(place)
        whole = np.empty((m, place.shape[1] + moved.shape[1] + followed.shape[1]), order=self.order)
        whole[:, system.places], whole[:, system.moved], whole[:, system.followed] = place, moved, followed
        return whole

    def _followed_at(self, time: np.ndarray, place: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """du/ds (m, k)."""
        if not self.method.system.followed:
            return np.zeros((len(time), 0))
        return self.method.following(len(time), time[:, None], place, velocity, self.constants)

    def slope(self, time: np.ndarray, state: np.ndarray) -> np.ndarray:
        """dY/ds (m, N)."""
        system = self.method.system
        velocity = self._parts(state, system.velocities)
        self.time[:], self.place[:] = time, state[:, system.places]
        self.call()
        return self._whole(velocity, self.rates, self._followed_at(time, self.place, velocity))

    def step(
        self, time: np.ndarray, end: np.ndarray, state: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`varcalc.integrators.side_by_side.Stepper.step`."""
        at, used, places, outcome = _tables()
        system, d, k = self.method.system, self.place.shape[1], self.stages
        self.length = end - time
        column = self.length[:, None]
        begin, moved = self._parts(state, system.places), self._parts(state, system.moved)
        velocity = moved[:, :d].copy("K")
        straight = velocity * column
        np.multiply(column, column, out=self.square)
        k[FIRST] = slope[:, system.moved]
        for s in range(1, 17):
            combined(places[s, used[s]], k[used[s], :, :d], self.sum)
            self._bent(begin, straight, at[s])
            np.multiply(self.length, at[s], out=self.time)
            self.time += time
            self.call()
            k[s if s > 1 else UNUSED] = self.rates
            if len(self.places):
                self.places[s] = self.place
        combined(outcome[0, 1:], k[1:, :, :d], self.sum)
        self._bent(begin, straight, 1.0)
        self.time[:] = end
        self.call()
        moved += column * combined(outcome[1, 1:], k[1:])
        followed = self._parts(state, system.followed)
        rates = self._followed_at(end, self.place, moved[:, :d])
        if system.followed:
            self._follow(time, velocity, slope[:, system.followed], rates)
            followed = followed + column * combined(outcome[1, 1:], self.following[1:])
        return self._whole(self.place, moved, followed), self._whole(moved[:, :d], self.rates, rates)

    def _bent(self, begin: np.ndarray, straight: np.ndarray, part: float) -> None:
        """Put into ``place`` where runs are after a ``part`` of the step, bent by the ``sum`` of their rates."""
        np.multiply(self.sum, self.square, out=self.sum)
        np.multiply(straight, part, out=self.place)
        self.place += begin
        self.place += self.sum

    def _follow(self, time: np.ndarray, velocity: np.ndarray, first: np.ndarray, last: np.ndarray) -> None:
        """Put into ``following`` du/ds at the stages, with the velocities there by all rates of the step."""
        at, weights, d = _tables()[0], _velocities(), self.place.shape[1]
        self.following[FIRST], self.following[-2:] = first, last
        for s in NODES:
            there = velocity + self.length[:, None] * combined(weights[s, 1:], self.stages[1:, :, :d])
            self.following[s] = self._followed_at(time + at[s] * self.length, self.places[s], there)

    def error(self, size: np.ndarray) -> np.ndarray:
        """See :meth:`varcalc.integrators.side_by_side.Stepper.error`."""
        system, (*_, outcome) = self.method.system, _tables()
        column, d = self.length[:, None], self.place.shape[1]
        combined(outcome[2, 1:], self.stages[1:, :, :d], self.sum)
        off = [self.sum * self.square / size[:, system.places]]
        for rates, which in ((self.stages, system.moved), (self.following, system.followed)):
            off.append(combined(outcome[3, 1:], rates[1:]) * column / size[:, which])
        return np.sqrt(sum(np.einsum("mn,mn->m", part, part) for part in off) / size.shape[1])

    def interpolant(
        self, at: np.ndarray, time: np.ndarray, length: np.ndarray, ends: tuple[np.ndarray, np.ndarray],
        slopes: tuple[np.ndarray, np.ndarray], *, dense: bool,
    ) -> Interpolant:  # fmt: skip
        """See :meth:`varcalc.integrators.side_by_side.Stepper.interpolant`; of degree 11.

        The rates of the stages leave its places some digits more than its velocities: rates at those places mend these.
        """
        system, h = self.method.system, length[at, None]
        first, last, before, after = ends[0][at], ends[1][at], h * slopes[0][at], h * slopes[1][at]
        rise = last - first
        shape = np.empty((3 + len(NODES_WITHIN), *first.T.shape)).transpose(0, 2, 1)
        shape[0], shape[1], shape[2] = rise, before - rise, 2 * rise - after - before
        step, bent = Interpolant(time[at], length[at], first, shape), (before, after)
        self._bend(step, bent, [self.stages[k, at] for k in NODES_WITHIN])
        followed = [h * self.following[k, at] for k in NODES_WITHIN]
        shape[3:, :, system.followed] = _shaped(_within()[0], shape[:3, :, system.followed], followed)
        if dense:
            parts, m = _tables()[0][list(NODES_WITHIN)], len(at)
            places = step.at(parts, system.places).reshape(len(parts) * m, -1)
            times = (step.time + parts[:, None] * step.length).reshape(-1, 1)
            rates = self.method.rates(len(places), times, places, np.tile(self.constants[at], (len(parts), 1)))
            self._bend(step, bent, list(rates.reshape(len(parts), m, -1)))
        return step

    def _bend(self, step: Interpolant, ends: tuple[np.ndarray, np.ndarray], rates: list[np.ndarray]) -> None:
        """Give a ``step`` its shape by the ``rates`` at the nodes, and the slopes at its ``ends`` times its length."""
        system, h, shape = self.method.system, step.length[:, None], step.shape
        own = [h * rate for rate in rates]
        shape[3:, :, system.moved] = _shaped(_within()[0], shape[:3, :, system.moved], own)
        d = len(system.places)
        bent = [h * end[:, system.velocities] for end in ends] + [
            h * rate[:, :d] for node, rate in zip(NODES_WITHIN, own, strict=True) if node in PLACE_NODES
        ]
        shape[3:, :, system.places] = _shaped(_within()[1], shape[:3, :, system.places], bent)


@lru_cache(maxsize=1)
def _tables() -> tuple[np.ndarray, list[slice], np.ndarray, np.ndarray]:
    """When the stages are, where the rates that each needs are kept, its place by them, and what is made of all.

    That is the place (0) and the velocity (1) after the step, and their errors (2 and 3). Where a stage is after a part
    c of the step, its place has the weights c²/2, and what a velocity has by it a place has 1 - c times.
    """
    places = np.zeros((17, 17))
    for s, row in enumerate(STAGE_PLACES, start=1):
        places[s, :s] = row
    at = np.sqrt(2 * places.sum(axis=1))
    at[-2:] = 1.0
    moved = np.array([VELOCITY, VELOCITY_ERROR])
    outcome = np.stack([moved[0] * (1 - at), moved[0], moved[1] * (1 - at), moved[1]])
    for table in (places, outcome):
        table[:, [UNUSED, FIRST]] = table[:, [1, 0]]
    used = [slice(0), slice(FIRST, 2), *(slice(UNUSED if s < 4 else FIRST, s) for s in range(2, 17))]
    return at, used, places, outcome


@lru_cache(maxsize=1)
def _velocities() -> np.ndarray:
    """By how much (17, 17) each stage's velocity grows by the rates at the nodes and ends: by their polynomial."""
    at, weights = _tables()[0], np.zeros((17, 17))
    kept = [FIRST, *NODES, 15]
    when = np.array([0.0, *at[list(NODES)], 1.0])
    powers = np.arange(len(kept))
    grown = at[:, None] ** (powers + 1) / (powers + 1)
    weights[:, kept] = np.linalg.solve(np.vander(when, increasing=True).T, grown.T).T
    return weights


@lru_cache(maxsize=1)
def _within() -> tuple[np.ndarray, np.ndarray]:
    """The shape of an interpolant from the fourth number on, of what goes like a velocity and of places.

    It is the combination of the first three, which make the values and the slopes at both ends right, and of the rates
    at the nodes, of places the second ones, at the two ends as well.
    """
    at, count = _tables()[0], len(NODES_WITHIN)
    x, rest = np.polynomial.Polynomial([0, 1]), np.polynomial.Polynomial([1, -1])
    powers = [x ** (k // 2 + 1) * rest ** ((k + 1) // 2) for k in range(3 + count)]

    def solved(nodes: np.ndarray, times: int) -> np.ndarray:
        rows = np.array([power.deriv(times)(nodes) for power in powers]).T
        return np.linalg.solve(rows[:, 3:], np.hstack([-rows[:, :3], np.eye(count)]))

    return solved(at[list(NODES_WITHIN)], 1), solved(np.array([0.0, 1.0, *at[list(PLACE_NODES)]]), 2)


def _shaped(table: np.ndarray, begun: np.ndarray, rates: list[np.ndarray]) -> np.ndarray:
    """The rest of a shape from the first three (3, m, n) and from the ``rates`` (m, n) times the step."""
    return np.einsum("jk,kmn->jmn", table, np.concatenate([begun, rates]))
