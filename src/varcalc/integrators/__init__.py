"""Integrators of initial-value problems behind one protocol.

:class:`Taylor` (heyoka) is the quicker and the more accurate once a system is
compiled, :class:`Dop853` (SciPy) needs no compilation and takes any system.
:class:`Thrifty` begins with the one and goes over to the other.
"""

from __future__ import annotations

import importlib.util

import casadi as ca

from varcalc.integrators.dop853 import Dop853
from varcalc.integrators.lowering import CannotLower
from varcalc.integrators.metered import Metered
from varcalc.integrators.protocol import NONE, OUTCOMES, Engine, Fleet, Flow, Landing, Outcome, Run, Swarm
from varcalc.integrators.taylor import Taylor
from varcalc.integrators.threads import spread
from varcalc.integrators.thrifty import Thrifty
from varcalc.integrators.variational import Variational, variational
from varcalc.symbolic.derived import Owner, derived

__all__ = [
    "NONE",
    "OUTCOMES",
    "CannotLower",
    "Dop853",
    "Engine",
    "Fleet",
    "Flow",
    "Landing",
    "Metered",
    "Outcome",
    "Run",
    "Swarm",
    "Taylor",
    "Thrifty",
    "Variational",
    "available",
    "compiled",
    "default",
    "flows",
    "spread",
    "variational",
]


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


def available() -> tuple[Engine, ...]:
    """The engines whose packages are installed, the preferred one first."""
    engines: list[Engine] = []
    if importlib.util.find_spec("heyoka") is not None:
        engines.append(Taylor())
    if importlib.util.find_spec("scipy") is not None:
        engines.append(Dop853())
    return tuple(engines)


def default() -> Engine:
    """The engine to use when none is named: what is installed, and both where both are.

    Raises ImportError when none is.
    """
    engines = available()
    if len(engines) == 2:
        return Thrifty()
    if not engines:
        raise ImportError("no engine is installed; install scipy, or heyoka where there is a wheel for it")
    return engines[0]
