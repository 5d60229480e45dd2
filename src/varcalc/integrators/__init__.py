"""Integrators of initial-value problems behind one protocol: one trajectory, several side by side, and an ensemble.

:class:`Taylor` (heyoka) is the quicker and the more accurate once a system is
compiled, :class:`Dop853` (Dormand and Prince, SciPy's coefficients) needs no compilation and takes any system.
:class:`OnDemand` begins with the one and goes over to the other.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

import casadi as ca

from varcalc.integrators.attentive import Attentive
from varcalc.integrators.dop853 import RUNS_TOGETHER, SMALLEST, Dop853, installed
from varcalc.integrators.lowering import CannotLower
from varcalc.integrators.on_demand import STEPS, OnDemand
from varcalc.integrators.piecewise import Continuous, Piecewise
from varcalc.integrators.protocol import NONE, OUTCOMES, Engine, Flow, Landing, Run, RunOutcome
from varcalc.integrators.taylor import Taylor
from varcalc.integrators.threads import SMALLEST_SHARE
from varcalc.integrators.threads import spread as spread_over
from varcalc.integrators.variational import Variational, variational
from varcalc.symbolic.derived import Owner, derived

__all__ = [
    "NONE",
    "OUTCOMES",
    "Attentive",
    "CannotLower",
    "Continuous",
    "Dop853",
    "Engine",
    "Flow",
    "Landing",
    "OnDemand",
    "Piecewise",
    "Run",
    "RunOutcome",
    "Taylor",
    "Variational",
    "available",
    "compiled",
    "compiles",
    "default",
    "flows",
    "for_many",
    "for_one",
    "spread",
    "variational",
]


BELOW_ROUND_OFF = 1e-18
"""Local tolerance of a series that is cut off far below round-off: two terms more, a quarter more time a step.

A long motion keeps what it keeps even where one coordinate grows large, by whose size heyoka measures errors."""


@derived
def flows(owner: Owner) -> dict[tuple[Engine, str], Flow]:
    """The systems compiled for a problem, for other parameter values and later solves."""
    return {}


def compiled(owner: Owner, engine: Engine, system: ca.Function) -> Flow:
    """``system`` compiled by ``engine``, kept with the owner; :class:`CannotLower` as :meth:`Engine.compile` raises."""
    kept, key = flows(owner), (engine, system.serialize())
    if key not in kept:
        kept[key] = engine.compile(system)
    return kept[key]


def available(taylor: Taylor | None = None) -> tuple[Taylor | Dop853, ...]:
    """The engines whose packages are installed, the preferred one first, heyoka's with the settings of ``taylor``."""
    engines: list[Taylor | Dop853] = []
    if installed("heyoka"):
        engines.append(taylor or Taylor())
    if installed("scipy"):
        engines.append(Dop853())
    return tuple(engines)


def default(steps: int = STEPS, most_steps: int | None = None, taylor: Taylor | None = None) -> Engine:
    """The engine to use when none is named: what is installed, and :class:`OnDemand`, after so many ``steps``, of both.

    ``most_steps`` bounds the steps of one run. Raises ImportError when neither is installed.
    """
    engines = available(taylor)
    if most_steps is not None:
        engines = tuple(replace(engine, most_steps=most_steps) for engine in engines)
    match engines:
        case (Taylor() as taylor, Dop853() as dop853):
            return OnDemand(dop853, taylor, steps)
        case (engine,):
            return engine
    raise ImportError("no engine is installed; install scipy, or heyoka where there is a wheel for it")


def for_one(most_steps: int, *, quick: bool) -> Engine:
    """The engine for one motion, whose series are cut off below round-off, compiled ``quick``ly where steps are few."""
    return _to_all_digits(default(0, most_steps, Taylor(tolerance=BELOW_ROUND_OFF, quick=quick)))


def for_many(most_steps: int | None = None) -> Engine:
    """The engine for a system that is run very often: compiled at once where it can be, and past nothing narrow."""
    return _to_all_digits(default(0, most_steps))


def compiles() -> bool:
    """Whether many runs go by machine code, which takes any system alike."""
    return any(isinstance(engine, Taylor) for engine in available())


def spread(
    work: Callable[[slice], None], count: int, stoppable: Callable[[], AbstractContextManager[None]] = nullcontext
) -> None:
    """Call ``work``, which runs an ensemble, with slices of ``range(count)``, on as many threads as are worth it.

    They are waited for within ``stoppable``. DOP853 is NumPy's calls, which take turns: for it a second thread is worth
    only many runs.
    """
    spread_over(work, count, SMALLEST_SHARE if compiles() else RUNS_TOGETHER, stoppable)


def _to_all_digits(engine: Engine) -> Engine:
    """Past nothing narrow; DOP853 alone has to give the digits that the series would."""
    return Attentive(replace(engine, tolerance=SMALLEST) if isinstance(engine, Dop853) else engine)
