"""Motions beside others': a chain from its Lagrangian, many double pendula, the figure eight.

    python benchmarks/motions.py [--links N] [--pendula M]

Processor time. SymPy with SciPy, diffrax and numba are measured where they are installed.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import varcalc as vc
from varcalc import mechanics
from varcalc.study.experiments import load_experiment

GRAVITY, SECONDS, TOLERANCE = 9.81, 10.0, 1e-12


def spent(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of processor time, and what came of them."""
    began = time.process_time()
    result = work()
    return time.process_time() - began, result


def chain(links: int) -> mechanics.System:
    """Rods of length 1 with a bob of mass 1 at the end of each."""

    def lagrangian(t: Any, q: Any, v: Any) -> Any:
        x = y = total = 0
        for k in range(links):
            x, y = x + ca.cos(q[k]) * v[k], y + ca.sin(q[k]) * v[k]
            total += (x**2 + y**2) / 2 + GRAVITY * sum(ca.cos(q[j]) for j in range(k + 1))
        return total

    return mechanics.System(lagrangian, [f"theta{k + 1}" for k in range(links)])


def chain_by_sympy(links: int) -> Callable[[float, np.ndarray], np.ndarray]:
    """The same as a right-hand side for SciPy: L_vv and the rest by SymPy, solved at every call."""
    import sympy as sp

    q, v = sp.symbols(f"q:{links}"), sp.symbols(f"v:{links}")
    x = y = total = 0
    for k in range(links):
        x, y = x + sp.cos(q[k]) * v[k], y + sp.sin(q[k]) * v[k]
        total += (x**2 + y**2) / 2 + GRAVITY * sum(sp.cos(q[j]) for j in range(k + 1))
    momenta = [sp.diff(total, one) for one in v]
    mass = sp.Matrix(links, links, lambda i, j: sp.diff(momenta[i], v[j]))
    pull = sp.Matrix(
        [sp.diff(total, q[i]) - sum(sp.diff(momenta[i], q[j]) * v[j] for j in range(links)) for i in range(links)]
    )
    both = sp.lambdify([q, v], [mass, pull], cse=True)

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        matrix, right = both(state[:links], state[links:])
        return np.concatenate([state[links:], np.linalg.solve(matrix, right).ravel()])

    return rates


def one_chain(links: int) -> None:
    """Derived, and in motion for the first time."""
    start = np.linspace(0.5, 1.0, links)
    derived, system = spent(lambda: chain(links))
    first, motion = spent(lambda: system.motion(start.tolist(), [0.0] * links, (0.0, SECONDS)))
    again, _ = spent(lambda: system.motion((start + 0.01).tolist(), [0.0] * links, (0.0, SECONDS)))
    drift = motion.drift["energy"] / (GRAVITY * links * (links + 1) / 2)
    print(f"varcalc: {links} links derived in {1e3 * derived:.1f} ms, in motion for the first time in {first:.2f} s, "
          f"again {again:.2f} s; energy to {drift:.1e}")  # fmt: skip
    if importlib.util.find_spec("sympy") is None:
        print("SymPy: not installed")
        return
    derived, rates = spent(lambda: chain_by_sympy(links))
    state = np.concatenate([start, np.zeros(links)])
    moved, run = spent(lambda: solve_ivp(rates, (0.0, SECONDS), state, "DOP853", rtol=TOLERANCE, atol=TOLERANCE))
    ends = np.array([[*run.y[:links, -1]], [*motion.q(SECONDS)]])
    print(f"SymPy and SciPy: derived in {1e3 * derived:.0f} ms, in motion in {moved:.2f} s; "
          f"{np.abs(ends[0] - ends[1]).max():.1e} from varcalc's end")  # fmt: skip


def many_pendula(count: int) -> None:
    """Chaotic double pendula, a second and core."""
    system = load_experiment("double_pendulum").system
    rng = np.random.default_rng(0)
    q0, v0 = rng.uniform(1.5, 3.0, (count, 2)), np.zeros((count, 2))
    system.ensemble(q0[:100], v0[:100], [0.0, 0.1])  # compiled
    seconds, found = spent(lambda: system.ensemble(q0, v0, [0.0, SECONDS]))
    energies = [system.energies(q.T, v.T) for q, v in ((q0, v0), (found.q[:, :, -1], found.v[:, :, -1]))]
    off = np.abs(energies[1] - energies[0]) / (3 * GRAVITY)
    print(f"varcalc: {count / seconds:.0f} double pendula a second to T = {SECONDS:g}, energy to {np.median(off):.1e} "
          f"in the median, {off.max():.1e} at worst")  # fmt: skip
    for name, others in (("diffrax", _by_diffrax), ("numba", _by_numba)):
        if importlib.util.find_spec(name) is None:
            print(f"{name}: not installed")
        else:
            others(q0[: max(count // 10, 1)])


def _by_numba(q0: np.ndarray) -> None:
    """Runge and Kutta's classical method, with so many steps that its energy is off by less than 1e-10."""
    from numba import njit

    @njit
    def rates(y: Any) -> Any:
        a, b, va, vb = y
        c, s = np.cos(a - b), np.sin(a - b)
        first, second = -(vb**2) * s - 2 * GRAVITY * np.sin(a), va**2 * s - GRAVITY * np.sin(b)
        det = 2 - c**2
        return np.array([va, vb, (first - c * second) / det, (2 * second - c * first) / det])

    @njit
    def carried(states: Any, steps: int) -> Any:
        h, out = SECONDS / steps, states.copy()
        for y in out:
            for _ in range(steps):
                one = rates(y)
                two = rates(y + h / 2 * one)
                three = rates(y + h / 2 * two)
                y[:] += h / 6 * (one + 2 * two + 2 * three + rates(y + h * three))
        return out

    start = np.column_stack([q0, np.zeros_like(q0)])
    system = load_experiment("double_pendulum").system
    carried(start[:1], 10)
    for steps in (4000, 16_000, 64_000):
        seconds, ends = spent(lambda steps=steps: carried(start, steps))
        energies = [system.energies(y[:, :2].T, y[:, 2:].T) for y in (start, ends)]
        off = np.abs(energies[1] - energies[0]) / (3 * GRAVITY)
        if np.median(off) <= 1e-10:
            break
    print(f"numba, Runge and Kutta with {steps} steps: {len(q0) / seconds:.0f} a second, energy to "
          f"{np.median(off):.1e} in the median, {off.max():.1e} at worst")  # fmt: skip


def _by_diffrax(q0: np.ndarray) -> None:
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def field(_: Any, y: Any, __: Any) -> Any:
        a, b, va, vb = y
        c, s = jnp.cos(a - b), jnp.sin(a - b)
        right = -(vb**2) * s - 2 * GRAVITY * jnp.sin(a), va**2 * s - GRAVITY * jnp.sin(b)
        det = 2 - c**2
        return jnp.array([va, vb, (right[0] - c * right[1]) / det, (2 * right[1] - c * right[0]) / det])

    def carried(y: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(field), diffrax.Dopri8(), 0.0, SECONDS, 1e-3, y, max_steps=100_000,
            stepsize_controller=diffrax.PIDController(rtol=TOLERANCE, atol=TOLERANCE),
        ).ys[-1]  # fmt: skip

    together = jax.jit(jax.vmap(carried))
    start = jnp.column_stack([q0, np.zeros_like(q0)])
    together(start).block_until_ready()
    seconds, _ = spent(lambda: together(start).block_until_ready())
    print(f"diffrax: {len(q0) / seconds:.0f} a second at a tolerance of {TOLERANCE:g}")


def eight() -> None:
    """The figure eight, solved for the second time."""
    from varcalc.problems.mechanics import figure_eight as row

    seconds = min(
        spent(lambda: vc.solve(row.orbits.problem, vc.Ritz(), guess=row.orbits.guess(row.guess)))[0] for _ in range(5)
    )
    print(f"varcalc: the figure eight in {1e3 * seconds:.1f} ms, action a body {row.orbit.action / 3:.15f}, "
          f"closing to {row.orbit.closure:.1e}")  # fmt: skip


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, default=10)
    parser.add_argument("--pendula", type=int, default=10_000)
    options = parser.parse_args()
    one_chain(options.links)
    many_pendula(options.pendula)
    eight()


if __name__ == "__main__":
    main()
