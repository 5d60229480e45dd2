"""Bundles of 5,000 rays and single motions with heyoka and without it, side by side: seconds of the processor.

For bundles it is told how far apart they end, for motions what is claimed of each. The first call of a scene or a
system compiles where heyoka is there; "later" is the quickest of those that follow, of which the first few are needed
before all that may be compiled is.

Run: OMP_NUM_THREADS=1 python benchmarks/without_heyoka.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from unittest import mock

import casadi as ca
import numpy as np

from varcalc import integrators, mechanics, optics

RAYS = 5000
CALLS = 5
SEED = 1786
"""The year of Laplace's memoir on refraction."""


def lump(*x: Any) -> Any:
    """An index that is greatest at the origin."""
    return 1 + ca.exp(-sum(v**2 for v in x)) / 2


def waves(x: Any, y: Any) -> Any:
    """An index that goes up and down for ever."""
    return 1 + ca.sin(x) * ca.cos(y) / 10


def fish_eye(x: Any, y: Any, z: Any) -> Any:
    """Maxwell's, written as a function of the place."""
    return 2 / (1 + x**2 + y**2 + z**2)


@dataclass(frozen=True)
class Task:
    """Rays through an index, in so many coordinates, as far as ``options`` of a trace say."""

    name: str
    index: Callable[..., Any]
    dimension: int
    options: dict[str, Any]
    size: float = 3.0


PLANE = optics.Plane((3, 0), (1, 0))
TASKS = (
    Task("a lump 1 + exp(-r²)/2, to a plane", lump, 2, {"until": PLANE}),
    Task("the same with spreading", lump, 2, {"until": PLANE, "with_spreading": True}),
    Task("the same to a circle about it", lump, 2, {"until": optics.Sphere((0, 0), 4.0)}),
    Task("the same in space, to a sphere about it", lump, 3, {"until": optics.Sphere((0, 0, 0), 4.0)}),
    Task("the same in the plane, optical path 6", lump, 2, {"optical_path": 6.0}),
    Task("waves 1 + sin x cos y / 10, to a plane", waves, 2, {"until": PLANE}),
    Task("the same, optical path 30", waves, 2, {"optical_path": 30.0}),
    Task("fish-eye in space, to a plane", fish_eye, 3, {"until": optics.Plane((0.5, 0, 0), (1, 0, 0))}, size=0.5),
)


@dataclass(frozen=True)
class Single:
    """A motion of a Lagrangian from coordinates and rates over the times from 0 on."""

    name: str
    lagrangian: Callable[..., Any]
    q0: tuple[float, ...]
    v0: tuple[float, ...]
    last: float


SINGLE = (
    Single("pendulum, t = 100", lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), (1.0,), (0.0,), 100.0),
    Single(
        "Kepler's ellipse in polar coordinates, t = 100",
        lambda t, q, v: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0],
        (1.0, 0.0), (0.0, 1.2), 100.0,
    ),
    Single(
        "double pendulum, t = 20",
        lambda t, q, v: (
            v[0] ** 2 + v[1] ** 2 / 2 + v[0] * v[1] * ca.cos(q[0] - q[1]) + 9.81 * (2 * ca.cos(q[0]) + ca.cos(q[1]))
        ),
        (1.0, 0.5), (0.0, 0.0), 20.0,
    ),
    Single(
        "charge in a field that varies, t = 100",
        lambda t, q, v: ca.sumsqr(v) / 2 + (q[0] * v[1] - q[1] * v[0]) * (1 + 0.3 * ca.sin(q[2])),
        (1.0, 0.0, 0.0), (0.0, 1.0, 0.1), 100.0,
    ),
)  # fmt: skip


def starts(dimension: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Points left of the origin, as far as ``size``, and directions that go to the right, more or less."""
    rng = np.random.default_rng(SEED)
    points, directions = np.full((RAYS, dimension), -size), np.ones((RAYS, dimension))
    points[:, 1:] = rng.uniform(-size / 2, size / 2, (RAYS, dimension - 1))
    directions[:, 1:] = rng.uniform(-0.3, 0.3, (RAYS, dimension - 1))
    return points, directions


def measured(task: Task) -> tuple[float, float, optics.Bundle]:
    """Seconds of the first call of a scene and of the quickest later one, and the bundle."""
    scene, (points, directions) = optics.Scene(optics.Graded(task.index)), starts(task.dimension, task.size)
    spent: list[float] = []
    bundle = None
    for _ in range(CALLS):
        began = time.process_time()
        bundle = scene.trace(points, directions, progress=False, **task.options)
        spent.append(time.process_time() - began)
    assert bundle is not None
    return spent[0], min(spent[1:]), bundle


def moved(single: Single) -> tuple[float, float, float]:
    """Seconds of the first motion of a system and of the quickest later one, and the error that is claimed."""
    system = mechanics.System(single.lagrangian, tuple(f"q{k}" for k in range(len(single.q0))))
    spent: list[float] = []
    error = np.nan
    for _ in range(CALLS):
        began = time.process_time()
        error = system.motion(single.q0, single.v0, (0.0, single.last)).error
        spent.append(time.process_time() - began)
    return spent[0], min(spent[1:]), error


def main() -> None:
    """Print both tables."""
    bundles()
    motions()


def motions() -> None:
    """Print the table of motions."""
    print("| one motion | heyoka, first | later | claimed | without it, first | later | claimed | times |")
    print("|---|---|---|---|---|---|---|---|")
    for single in SINGLE:
        first, later, error = moved(single)
        with mock.patch.object(integrators, "available", return_value=(integrators.Dop853(),)):
            without_first, without_later, other = moved(single)
        print(
            f"| {single.name} | {first:.2f} | {later:.4f} | {error:.0e} | {without_first:.2f} | {without_later:.3f} "
            f"| {other:.0e} | {without_later / later:.0f} |",
            flush=True,
        )


def bundles() -> None:
    """Print the table of bundles."""
    print(
        "| 5,000 rays | heyoka, first call | later | without it, first call | later | times | apart | arrived alike |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for task in TASKS:
        first, later, bundle = measured(task)
        with mock.patch.object(integrators, "available", return_value=(integrators.Dop853(),)):
            without_first, without_later, other = measured(task)
        apart = float(np.nanmax(np.abs(bundle.points - other.points)))
        alike = float(np.mean(bundle.status == other.status))
        print(
            f"| {task.name} | {first:.2f} | {later:.3f} | {without_first:.2f} | {without_later:.3f} "
            f"| {without_later / later:.1f} | {apart:.0e} | {alike:.2%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
