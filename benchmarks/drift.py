"""What long motions keep: energy and momenta over 1000 periods and 100,000, constraints over 10,000.

    python benchmarks/drift.py [--quick]

A drift is held against 20 ε √steps of the size of what is kept, the largest sum of the terms of the energy or 1; a
constraint against 1e-14. ``--quick`` takes a hundredth of the periods. The exit status is 1 where one is missed.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.special import ellipk

from varcalc import mechanics
from varcalc.study.experiments import load_experiment

EPS = float(np.finfo(float).eps)
TIMES = 20.0
"""The drift that is allowed, in units of ε √steps."""
CONSTRAINT = 1e-14
LOOKED_AT = 3001


@dataclass(frozen=True)
class Long:
    """A motion of a ``system`` over so many ``periods``; ``limit`` of its drift, where that is not ε √steps'."""

    name: str
    system: mechanics.System
    q0: tuple[float, ...]
    v0: tuple[float, ...]
    period: float
    periods: int
    limit: float | None = None


def catalogued(name: str, period: float, periods: int = 1000, limit: float | None = None) -> Long:
    """The motion of the catalogue's experiment."""
    found = load_experiment(name)
    assert isinstance(found, mechanics.Experiment)
    return Long(name, found.system, tuple(found.q0), tuple(found.v0), period, periods, limit)


def rods(count: int) -> mechanics.System:
    """So many bobs on rods of length 1, one below the other, in Cartesian coordinates."""

    def held(k: int) -> mechanics.Holonomic:
        def rod(t, q):
            above = q[2 * k - 2 : 2 * k] if k else 0
            return (ca.sumsqr(q[2 * k : 2 * k + 2] - above) - 1) / 2

        return mechanics.Holonomic(rod)

    names = [f"{axis}{k + 1}" for k in range(count) for axis in "xy"]
    return mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - 9.81 * sum(q[2 * k + 1] for k in range(count)),
        names, constraints=[held(k) for k in range(count)],
    )  # fmt: skip


def free() -> list[Long]:
    """Motions without constraints."""
    swing = 4 * ellipk(math.sin(0.5) ** 2) / math.sqrt(9.81)
    double = load_experiment("double_pendulum")
    assert isinstance(double, mechanics.Experiment)
    return [
        catalogued("pendulum", swing),
        # both rods aside: chaotic, but no rod goes over the top, as the round-off of an angle grows with its turns
        Long("double pendulum", double.system, (1.2, 1.2), (0.0, 0.0), 2.0, 1000),
        catalogued("kepler", 2 * math.pi),
        catalogued("cone", 2.0),
        catalogued("charge_in_a_field", 2 * math.pi * 0.9 / (1.1 * 1.7)),
        catalogued("pendulum", swing, 100_000, 1e-12),
    ]


def held() -> list[Long]:
    """Motions under constraints."""
    swing = 4 * ellipk((1 - 0.8) / 2) / math.sqrt(9.81)
    sphere = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - 9.81 * q[2], ("x", "y", "z"),
        constraints=[mechanics.Holonomic(lambda t, q: (ca.sumsqr(q) - 1) / 2)],
    )  # fmt: skip
    return [
        Long("rod in the plane", rods(1), (0.6, -0.8), (0.0, 0.0), swing, 10_000),
        Long("rod in space", sphere, (0.6, 0.0, -0.8), (0.0, 1.0, 0.0), swing, 10_000),
        Long("two rods", rods(2), (0.6, -0.8, 0.6, -1.8), (0.0,) * 4, swing, 10_000),
    ]


def size(one: Long, motion: mechanics.Motion) -> float:
    """The largest sum of the terms of the energy on the way, or 1."""
    t = np.linspace(*motion.span, LOOKED_AT)
    q, v = motion.q(t), motion.v(t)
    rest = one.system.energies(q, np.zeros_like(v))
    return max(1.0, float((np.abs(rest) + np.abs(one.system.energies(q, v) - rest)).max()))


def kept(one: Long, share: float) -> bool:
    """Whether the invariants are, printed."""
    began = time.process_time()
    motion = one.system.motion(one.q0, one.v0, (0.0, one.period * one.periods * share))
    spent = time.process_time() - began
    allowed = one.limit or TIMES * EPS * math.sqrt(motion.steps)
    drift = max(motion.drift.values()) / size(one, motion)
    print(f"{one.name:20} {one.periods * share:9g} {motion.steps:9} {spent:8.2f} {drift:9.1e} {allowed:9.1e}")
    return drift <= allowed


def held_together(one: Long, share: float) -> bool:
    """Whether the constraints are, printed."""
    began = time.process_time()
    motion = one.system.motion(one.q0, one.v0, (0.0, one.period * one.periods * share))
    spent = time.process_time() - began
    t = np.linspace(*motion.span, LOOKED_AT)
    broken = np.array(
        [[float(c.phi(s, ca.DM(q))) for c in one.system.constraints] for s, q in zip(t, motion.q(t).T, strict=True)]
    )
    off = float(np.abs(broken).max())
    print(f"{one.name:20} {one.periods * share:9g} {motion.steps:9} {spent:8.2f} {off:9.1e} {CONSTRAINT:9.1e}")
    return off <= CONSTRAINT


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a hundredth of the periods")
    share = 0.01 if parser.parse_args().quick else 1.0
    print(f"{'':20} {'periods':>9} {'steps':>9} {'seconds':>8} {'drift':>9} {'allowed':>9}")
    well = [kept(one, share) for one in free()] + [held_together(one, share) for one in held()]
    sys.exit(0 if all(well) else 1)


if __name__ == "__main__":
    main()
