"""What an adapter is: a package, its settings from loose to tight, and how it builds and solves a task."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tasks import Task

IPOPT = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-13, "ipopt.acceptable_iter": 0,
         "ipopt.mu_strategy": "adaptive", "ipopt.max_cpu_time": 10.0}  # fmt: skip
"""IPOPT as it does best on these tasks: its default barrier strategy leaves the value 2e-9 off."""


class NotSolvedError(Exception):
    """The peer says itself that it found no answer."""


@dataclass(frozen=True)
class Adapter:
    """One package.

    ``package`` is what is imported, ``build(task, setting)`` makes what the
    package solves, ``solve`` returns the value. ``tasks`` names those the
    package has been written for; None is all. ``settings`` run from loose to tight; the
    fastest that meets an error is the one that counts.
    """

    name: str
    package: str
    settings: tuple[Any, ...]
    build: Callable[[Task, Any], Any]
    solve: Callable[[Any], float]
    tasks: tuple[str, ...] | None = None
    refuses: dict[str, str] = field(default_factory=dict)


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing that a package prints, from Python or from C."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
