"""What a search gives back: the extremals, best first, and what was searched."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

from varcalc.solution import Solution


class Extremals(Sequence[Solution]):
    """Extremals of one problem, best first: the lowest value first, the greatest where the problem is maximised.

    ``searched`` says what range was covered, ``windings`` by how many periods
    the end of each was moved: a number, or one for each coordinate that has a
    period where there are several (0 when no period was given).
    """

    def __init__(self, solutions: Sequence[Solution], searched: str, windings: Sequence[Any] = ()) -> None:
        kept = tuple(windings) or (0,) * len(solutions)
        order = sorted(range(len(solutions)), key=lambda i: _rank(solutions[i]))
        self._solutions = tuple(solutions[i] for i in order)
        self.windings = tuple(kept[i] for i in order)
        self.searched = searched

    def __len__(self) -> int:
        return len(self._solutions)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self._solutions[index]

    def __repr__(self) -> str:
        values = ", ".join(f"{s.value:.12g}" for s in self._solutions)
        return f"Extremals([{values}], searched={self.searched!r})"


def _rank(solution: Solution) -> float:
    return -solution.value if solution.problem.maximise else solution.value
