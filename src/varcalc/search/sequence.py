"""What a search gives back: the extremals, best first, and what was searched."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any, overload

import numpy as np

from varcalc.showing import Fact, Plotted, counted, figure_of
from varcalc.solution import Solution
from varcalc.verify import Verification, verify

MOST_SHOWN = 6
"""Extremals that are told one by one."""


class FoundExtremal(Solution):
    """A Solution as the search found it: a stationary curve of any kind, verified when that is asked.

    ``verification`` is what :func:`varcalc.verify` says of it, carried out once.
    """

    @classmethod
    def of(cls, solution: Solution) -> FoundExtremal:
        """The same solution, with its verification at hand."""
        return cls(**{field.name: getattr(solution, field.name) for field in fields(Solution)})

    @cached_property
    def verification(self) -> Verification:
        """Every classical condition checked along the curve."""
        return verify(self)

    @property
    def index(self) -> float:
        """The Morse index: 0 for a minimum; infinite where Legendre's condition fails."""
        return self.verification.index

    @property
    def conjugate_points(self) -> np.ndarray:
        """Abscissae (t for a Curve) conjugate to the start, or focal to what it slides on; shape (k,)."""
        return self.verification.conjugate_points


class Extremals(Plotted, Sequence[FoundExtremal]):
    """Extremals of one problem, best first: the lowest value first, the greatest where the problem is maximised.

    ``searched`` says what range was covered, ``windings`` by how many periods
    the end of each was moved: a number, or one for each coordinate that has a
    period where there are several (0 when no period was given). ``complete``
    is True when a scan of all initial slopes in the range told was resolved and
    every zero of it confirmed, so that within that range there are no others.
    """

    def __init__(self, solutions: Sequence[Solution], searched: str, windings: Sequence[Any], complete: bool) -> None:
        kept: tuple[Any, ...] = tuple(windings) or (0,) * len(solutions)
        order = sorted(range(len(solutions)), key=lambda i: solutions[i].problem.sign * solutions[i].value)
        self._solutions = tuple(FoundExtremal.of(solutions[i]) for i in order)
        self.windings: tuple[Any, ...] = tuple(kept[i] for i in order)
        self.searched: str = searched
        self.complete: bool = complete

    def __len__(self) -> int:
        return len(self._solutions)

    @overload
    def __getitem__(self, index: int) -> FoundExtremal: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[FoundExtremal, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self._solutions[index]

    def __repr__(self) -> str:
        values = ", ".join(f"{s.value:.12g}" for s in self._solutions[:MOST_SHOWN])
        return f"Extremals([{values}{', ...' if len(self) > MOST_SHOWN else ''}])"

    def _headline(self) -> str:
        return f"{counted(len(self), 'extremal')}, best first"

    def _facts(self) -> Iterator[Fact]:
        for number, (solution, winding) in enumerate(zip(self._solutions[:MOST_SHOWN], self.windings, strict=False)):
            wound = f", wound by {winding}" if np.any(winding) else ""
            yield Fact(str(number), figure_of(solution.value, solution.error.value) + wound)
        if len(self) > MOST_SHOWN:
            yield Fact("", f"and {len(self) - MOST_SHOWN} more")
        yield Fact("searched", self.searched)
