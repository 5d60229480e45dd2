"""A motion to look at: a system, how it begins, and what is known of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from varcalc.mechanics.arguments import ascending_span, finite_column
from varcalc.mechanics.motion import Event, Motion
from varcalc.mechanics.passages import Passages
from varcalc.mechanics.system import System, check_system
from varcalc.problem.conditions import function, functions, numbers, real, reals, sequence, text, told, whole
from varcalc.showing import Brief, Fact, Plotted, Shown
from varcalc.spelling import spelled

LOOKED_AT = 1001
"""Times at which a motion is held against what is known of it, and drawn."""
PORTRAIT_MARGIN = 1.2
"""By how much a phase portrait goes beyond its motion, in units of that."""
GRID = 201
SAME_CREST = 1e-4
"""Of the range of energies at rest: crests that differ by less are of one height."""


@dataclass(frozen=True, eq=False)
class Portrait:
    """Energies (r, c) over coordinates (c,) and rates (r,), and those of the ``separatrices``."""

    q: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    separatrices: tuple[float, ...]


def _check_event(name: str, given: Any) -> None:
    if not isinstance(given, Event):
        raise TypeError(f"{name} must be a mechanics.Event, not {told(given)}")


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Section(Brief):
    """Poincaré's section to draw: the first ``most`` passages through an ``event`` of motions from many states.

    ``q0`` and ``v0`` are (m, n); coordinate number ``shown`` and its rate are drawn. Raises TypeError or ValueError
    for arguments of another kind, and times that do not ascend.
    """

    event: Event
    q0: np.ndarray
    v0: np.ndarray
    span: tuple[float, float]
    most: int
    shown: int = 1

    def __post_init__(self) -> None:
        _check_event("Section.event", self.event)
        numbers("Section.q0", self.q0)
        numbers("Section.v0", self.v0)
        ascending_span(self.span, "Section.span")
        whole("Section.most", self.most)
        whole("Section.shown", self.shown)


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Flights(Brief):
    """A map to draw: the times to an ``event`` of motions from rest, over values of the first two coordinates.

    ``first`` (k,) and ``second`` (l,) are these values, ``span`` the times between which it is waited for. Raises
    TypeError or ValueError for arguments of another kind, and times that do not ascend.
    """

    event: Event
    first: np.ndarray
    second: np.ndarray
    span: tuple[float, float]

    def __post_init__(self) -> None:
        _check_event("Flights.event", self.event)
        numbers("Flights.first", self.first)
        numbers("Flights.second", self.second)
        ascending_span(self.span, "Flights.span")

    @property
    def starts(self) -> np.ndarray:
        """Coordinates (m, n) of all pairs, the first coordinate changing fastest."""
        return np.column_stack([values.ravel() for values in np.meshgrid(self.first, self.second)])


@dataclass(frozen=True, repr=False)
class Moved(Plotted):
    """An experiment carried out: its motion, and by how much each thing that is known of it is missed."""

    experiment: Experiment
    motion: Motion
    errors: Mapping[str, float]

    @property
    def largest(self) -> float:
        """The largest of the errors."""
        return max(self.errors.values())

    @property
    def completed(self) -> bool:
        """Whether the motion came to its end."""
        return self.motion.completed

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates'."""
        return self.experiment.system.coordinates

    @property
    def axes(self) -> tuple[str, list[str], list[str]]:
        """What stands at the axes of pictures: the time, the coordinates and their rates, with their units."""
        time, *coordinates = self.experiment.system.axes
        return time.label, [axis.label for axis in coordinates], [axis.over(time).label for axis in coordinates]

    def _headline(self) -> str:
        return self.title or "A motion, held against what is known of it"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("largest error", f"{self.largest:.1g}")
        yield from self.motion._facts()  # noqa: SLF001  what is said of the motion is said of what it was

    @property
    def title(self) -> str:
        """What a picture is called."""
        return self.experiment.title or self.experiment.system.name

    @cached_property
    def drawn(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (m,), coordinates and rates (n, m)."""
        times = np.linspace(*self.motion.span, LOOKED_AT)
        return times, self.motion.q(times), self.motion.v(times)

    @cached_property
    def portrait(self) -> Portrait | None:
        """The level curves of the energy about the motion, where there is one coordinate and the energy is kept."""
        system = self.experiment.system
        if system.n != 1 or "energy" not in self.motion.drift:
            return None
        _, q, v = self.drawn
        q_line, v_line = (_widened(values[0]) for values in (q, v))
        grid = np.meshgrid(q_line, v_line)
        energy = system.energies(grid[0].ravel()[None], grid[1].ravel()[None]).reshape(grid[0].shape)
        rest = system.energies(q_line[None], np.zeros((1, GRID)))
        tops = np.flatnonzero((rest[1:-1] > rest[:-2]) & (rest[1:-1] >= rest[2:])) + 1
        before, top, after = rest[tops - 1], rest[tops], rest[tops + 1]
        crests = np.sort(
            top - (after - before) ** 2 / (8 * (before - 2 * top + after))
        )  # of the parabolas through them
        apart = np.diff(crests, prepend=-np.inf) > SAME_CREST * np.ptp(rest)
        return Portrait(q_line, v_line, energy, tuple(crests[apart].tolist()))

    @cached_property
    def many(self) -> Passages | None:
        """What many motions of the system do, where the experiment asks for a section or a map."""
        system, asked = self.experiment.system, self.experiment.beside
        if isinstance(asked, Section):
            return system.passages(asked.q0, asked.v0, asked.event, asked.span, most=asked.most)
        if isinstance(asked, Flights):
            return system.passages(asked.starts, np.zeros_like(asked.starts), asked.event, asked.span)
        return None

    def document(self) -> dict[str, Any]:
        """What `varcalc move --json` prints."""
        motion = self.motion
        return {
            "title": self.title,
            "coordinates": list(self.names),
            "span": list(motion.span),
            "outcome": motion.outcome.value,
            "steps": motion.steps,
            "error": motion.error,
            "drift": dict(motion.drift),
            "errors": dict(self.errors),
            "events": [
                {"name": e.name, "t": e.t, "q": e.q.tolist(), "v": e.v.tolist()} for e in motion.events
            ],
            "end": {"q": motion.q(motion.span[1]).tolist(), "v": motion.v(motion.span[1]).tolist()},
        }  # fmt: skip

    def table(self) -> str:
        """What `varcalc move` prints."""
        motion = self.motion
        lines = [f"from t = {motion.span[0]:g} to {motion.span[1]:g}: {motion.outcome.value}, {motion.steps} steps"]
        lines.append(f"coordinates known to {motion.error:.1g}")
        lines += [f"{name} kept to {drift:.1g}" for name, drift in motion.drift.items()]
        lines += [f"{name}: off by {error:.1g}" for name, error in self.errors.items()]
        lines += [f"t = {e.t:.12g}: {e.name} at {np.array2string(e.q, precision=9)}" for e in motion.events]
        return "\n".join(lines)


def _widened(values: np.ndarray) -> np.ndarray:
    low, high = float(values.min()), float(values.max())
    room = PORTRAIT_MARGIN * max(high - low, 1e-3)
    return np.linspace(low - room, high + room, GRID)


@spelled
@dataclass(frozen=True, repr=False)
class Experiment(Shown):
    """A motion of a ``system`` from coordinates ``q0`` and rates ``v0`` (n,) over the times ``span``.

    ``exact`` gives the coordinates (n, m) at times (m,) in closed form, where there is one; ``checks`` are functions of
    the motion, by name, that are zero where it is right. ``beside`` is what a picture shows beside the motion, in the
    place of its phase portrait or orbit.

    Raises TypeError or ValueError for arguments of another kind, numbers that are not n, and times that do not ascend.
    """

    system: System
    q0: Sequence[float]
    v0: Sequence[float]
    span: tuple[float, float]
    exact: Callable[[np.ndarray], np.ndarray] | None = None
    checks: Mapping[str, Callable[[Motion], float]] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    title: str = ""
    beside: Section | Flights | None = None

    def __post_init__(self) -> None:
        check_system(self.system)
        finite_column("Experiment.q0", self.q0, self.system.n)
        finite_column("Experiment.v0", self.v0, self.system.n)
        ascending_span(self.span, "Experiment.span")
        functions("Experiment.checks", self.checks)
        if self.exact is not None:
            function("Experiment.exact", self.exact)
        for number, event in enumerate(sequence("Experiment.events", self.events)):
            _check_event(f"Experiment.events[{number}]", event)
        text("Experiment.title", self.title)
        if not isinstance(self.beside, Section | Flights | None):
            raise TypeError(f"Experiment.beside must be a Section or Flights, not {told(self.beside)}")

    def run(self) -> Moved:
        """The motion, held against what is known of it.

        Raises TypeError and ValueError where ``exact`` or one of ``checks`` gives what it should not.
        """
        motion = self.system.motion(self.q0, self.v0, self.span, events=self.events)
        errors: dict[str, float] = {}
        if self.exact is not None:
            times = np.linspace(*motion.span, LOOKED_AT)
            known = reals("what Experiment.exact gives", self.exact(times))
            wanted = [(self.system.n, len(times)), *([times.shape] if self.system.n == 1 else [])]
            if known.shape not in wanted:
                given = f"for {len(times)} times, not {known.shape}"
                raise ValueError(f"Experiment.exact must return an array of shape {wanted[0]} {given}")
            errors["closed form"] = float(np.abs(motion.q(times) - known).max() / max(1.0, np.abs(known).max()))
        errors |= {name: real(f"Experiment.checks[{name!r}]", check(motion)) for name, check in self.checks.items()}
        return Moved(self, motion, errors or {"claimed": motion.error})
