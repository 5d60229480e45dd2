"""Numbers of mechanics that are no motion, held against what is known of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from varcalc.problem.conditions import functions, real, text
from varcalc.showing import Shown
from varcalc.spelling import spelled


@dataclass(frozen=True, repr=False)
class Examined(Shown):
    """An examination carried out: by how much each thing that is known is missed."""

    title: str
    errors: Mapping[str, float]

    @property
    def largest(self) -> float:
        """The largest of the errors."""
        return max(self.errors.values())

    @property
    def completed(self) -> bool:
        """Whether it came to its end: always, since nothing moves."""
        return True

    def document(self) -> dict[str, Any]:
        """What `varcalc move --json` prints."""
        return {"title": self.title, "errors": dict(self.errors)}

    def table(self) -> str:
        """What `varcalc move` prints."""
        return "\n".join(f"{name}: off by {error:.1g}" for name, error in self.errors.items())


@spelled
@dataclass(frozen=True, repr=False)
class Examination(Shown):
    """What is computed of systems beside their motions: angles, periods, frequencies, bounds of stability.

    ``checks`` are functions, by name, that give zero where what is computed is right.

    Raises ValueError where ``checks`` is empty.

    >>> import math
    >>> Examination("A circle", {"half a turn": lambda: abs(math.atan2(0.0, -1.0) - math.pi)}).run().largest
    0.0
    """

    title: str
    checks: Mapping[str, Callable[[], float]]

    def __post_init__(self) -> None:
        text("title", self.title)
        functions("checks", self.checks)
        if not self.checks:
            raise ValueError("checks must name at least one thing that is known")

    def run(self) -> Examined:
        """What is computed, held against what is known of it; TypeError where one of ``checks`` gives no number."""
        return Examined(self.title, {name: real(f"checks[{name!r}]", check()) for name, check in self.checks.items()})
