"""One problem solved over a grid of parameter values or end points, each from its neighbour's curve.

Points are stored as they come, one line of JSON each, so that whatever ends a
sweep early costs no point that was reported; the same call goes on from there.
"""

from __future__ import annotations

import inspect
import json
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from varcalc.methods.labels import checked_method, label
from varcalc.methods.ritz.family import Answers
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Solution
from varcalc.solve.grid import Grid, Paired, Place
from varcalc.solve.ladder import solve
from varcalc.solve.warm_start import Neighbours
from varcalc.tables import shown, table

POINTS_PER_TASK = 16
"""Points that a core solves in a row before it reports: each begins from the last, and few are lost with it."""
LONG_CHUNK = 4096
"""The same where each core makes one problem and moves its parameters: what is built for it serves many points."""
REPORT = 5.0
"""Seconds after which a core reports what it has, be its points done or not."""
BATCH = 512
"""Points solved together at most."""

Source = Problem | Curve | Callable[..., Problem | Curve]
"""A problem with parameters, or a function that makes it, from their values or once for all of them."""


@dataclass(frozen=True)
class SweepPoint:
    """One point of a grid: its ``values`` in the order of the names, and what :func:`varcalc.solve` found there.

    ``value`` and ``claimed_error`` are None where there is no answer, and
    ``reason`` says why; ``seconds`` is the wall clock of the solve.
    """

    values: tuple[float, ...]
    status: str
    value: float | None
    claimed_error: float | None
    iterations: int
    seconds: float
    reason: str = ""

    @property
    def ok(self) -> bool:
        """True for an answer that stands."""
        return self.value is not None


@dataclass(frozen=True)
class Sweep:
    """What :func:`sweep` found: ``points``, one for each combination of the ``grid``, the last name fastest.

    With ``paired`` the values of the names were taken together, one point each.
    """

    grid: Mapping[str, tuple[float, ...]]
    points: tuple[SweepPoint, ...]
    paired: bool = False

    @property
    def failures(self) -> tuple[SweepPoint, ...]:
        """The points without an answer."""
        return tuple(p for p in self.points if not p.ok)

    @property
    def values(self) -> np.ndarray:
        """The functional at the points, shaped as the grid (one axis a name, one in all where they are paired).

        NaN where there is no answer.
        """
        return self._shaped([p.value for p in self.points])

    @property
    def claimed_errors(self) -> np.ndarray:
        """The claimed errors of :attr:`values`, shaped as they are."""
        return self._shaped([p.claimed_error for p in self.points])

    def _shaped(self, flat: list[float | None]) -> np.ndarray:
        return np.array(flat, dtype=float).reshape(Grid(self.grid, self.paired).shape)

    def table(self) -> str:
        """The points as text for a monospaced page, with the reasons of failures beneath."""
        rows = [
            (
                *(shown(v, ".9g") for v in p.values), p.status, shown(p.value, ".15g"),
                shown(p.claimed_error, ".1e"), shown(1e3 * p.seconds, ".2f"),
            )
            for p in self.points
        ]  # fmt: skip
        reasons = dict.fromkeys(p.reason for p in self.failures)
        return table((*self.grid, "status"), ("value", "claimed", "ms"), rows, notes=reasons)

    def document(self) -> dict[str, Any]:
        """The sweep as plain numbers, strings, lists and dicts, ready for JSON."""
        grid = Grid(self.grid, self.paired).document()
        return {"grid": grid, "paired": self.paired, "points": [asdict(p) for p in self.points]}


def sweep(
    problem: Source,
    grid: Mapping[str, Iterable[float]] | Paired,
    method: Any = None,
    *,
    tol: float = 1e-10,
    cores: int = 1,
    store: str | Path | None = None,
) -> Sweep:
    """Solve ``problem`` for every combination of the values in ``grid``, or for those that are :class:`Paired`.

    ``problem`` is a Problem or Curve whose parameters are named in ``grid``
    (end points among them, see :class:`varcalc.Parameter`), a function without
    arguments that makes such a problem, or one that takes the values as keywords
    and makes a problem for each point. On several ``cores`` it must be a
    function, and one that can be pickled (defined at the top of a module). The
    grid is walked from neighbour to neighbour; each solve begins from the
    nearest answer, and afresh where that leads nowhere. By Ritz and Collocation the
    points of one problem are solved many at a time, each held to what a solve
    asks of an answer. A point without an answer keeps its status.

    With ``store``, the name of a file, every point is written as it comes, and points
    that are in it already are not solved again: an interrupted sweep goes on
    when the same call is made again.

    Raises TypeError and ValueError for what cannot be swept, and whatever
    :func:`varcalc.solve` raises for bad arguments.

    >>> import varcalc as vc
    >>> spring = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1})
    >>> sweep(spring, {"k": [0, 1, 4]}).values.round(6).tolist()
    [1.0, 1.313035, 2.074629]
    """
    wanted = Grid.of(grid)
    checked_method(0, method)
    if not isinstance(cores, int) or isinstance(cores, bool) or cores < 1:
        raise ValueError(f"cores must be a whole number from 1 on, not {cores!r}")
    built = isinstance(problem, Problem | Curve)
    if not (built or callable(problem)):
        raise TypeError(f"problem must be a Problem, a Curve or a function that makes one, not {problem!r}")
    if built and cores > 1:
        raise ValueError(
            "a problem that is built stays in its process; for several cores give a function that makes it from "
            f"{', '.join(wanted.axes)}, or cores=1; a function without arguments makes it once for each"
        )
    header = {"sweep": wanted.document(), "method": label(method), "tol": tol}
    header |= {"paired": True} if wanted.paired else {}
    known = {} if store is None else _begun(Path(store), header)
    missing = [at for at in wanted.places() if at not in known]
    for at, point in _solved(problem, wanted, missing, method, tol, cores):
        known[at] = point
        if store is not None:
            _append(Path(store), {"at": at, **asdict(point)})
    return Sweep(wanted.axes, tuple(known[at] for at in sorted(known)), wanted.paired)


def _solved(
    problem: Source, grid: Grid, places: list[Place], method: Any, tol: float, cores: int
) -> Iterator[tuple[Place, SweepPoint]]:
    """The points at ``places`` as they come."""
    points = grid.points(places)
    if cores == 1:
        yield from zip(places, chain.from_iterable(_in_a_row(problem, points, method, tol)), strict=True)
        return
    # each core has something to do, also where there are few points
    size = min(LONG_CHUNK, -(-len(places) // cores)) if _made_once(problem) else POINTS_PER_TASK
    pieces = [slice(i, i + size) for i in range(0, len(places), size)]
    # a forked process would inherit the locks of threads that are not there
    with ProcessPoolExecutor(cores, multiprocessing.get_context("spawn")) as pool:
        running = {pool.submit(_chunk, problem, points[piece], method, tol): piece for piece in pieces}
        try:
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    piece, found = running.pop(future), future.result()
                    yield from zip(places[piece], found)  # noqa: B905 - what is left over is solved next
                    rest = slice(piece.start + len(found), piece.stop)
                    if len(places[rest]):
                        running[pool.submit(_chunk, problem, points[rest], method, tol)] = rest
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _made_once(source: Source) -> bool:
    """Whether a source is a function without arguments."""
    return not isinstance(source, Problem | Curve) and not inspect.signature(source).parameters


def _chunk(problem: Source, points: list[dict[str, float]], method: Any, tol: float) -> list[SweepPoint]:
    """The first of the points, as many as a core may take its time for."""
    began, found = time.perf_counter(), []
    for together in _in_a_row(problem, points, method, tol):
        found += together
        if time.perf_counter() - began > REPORT:
            break
    return found


def _in_a_row(source: Source, points: list[dict[str, float]], method: Any, tol: float) -> Iterator[list[SweepPoint]]:
    """Solve one point after the other, or many together, each from what is known nearby; those that were together."""
    source = source() if callable(source) and _made_once(source) else source
    row = _Row(source, method, tol, len(points))
    size, done = 1, 0
    while done < len(points):
        together = points[done : done + size]
        yield row.solved(together)
        done += len(together)
        # the first of the points are far from what is known
        size = min(2 * size, BATCH) if row.neighbours is not None else 1


class _Row:
    """The points of a sweep that are solved one after the other, and what is known from those before."""

    def __init__(self, source: Source, method: Any, tol: float, count: int) -> None:
        self.source, self.method, self.tol, self.count = source, method, tol, count
        self.last: Solution | None = None
        self.neighbours: Neighbours | None = None

    def solved(self, points: list[dict[str, float]]) -> list[SweepPoint]:
        """What is found at some points, in their order."""
        found = self._together(points)
        return [point or self._alone(values) for values, point in zip(points, found, strict=True)]

    def _together(self, points: list[dict[str, float]]) -> list[SweepPoint | None]:
        """Those of the points that stand when they are solved together."""
        if self.neighbours is None or not isinstance(self.source, Problem | Curve):
            return [None] * len(points)
        began = time.perf_counter()
        everything = [self.source.parameters | values for values in points]
        values = np.array([list(v.values()) for v in everything])
        answers = self.neighbours.solved(values)
        sure = self.neighbours.beyond_doubt(values, answers).tolist()
        value, error = (self.neighbours.form.sign * answers.value).tolist(), answers.error.tolist()
        steps = answers.iterations.tolist()
        each = (time.perf_counter() - began) / len(points)
        found: list[SweepPoint | None] = [None] * len(points)
        for row in np.flatnonzero(answers.stands).tolist():
            at = tuple(points[row].values())
            if sure[row]:
                found[row] = SweepPoint(at, "solved", value[row], error[row], steps[row], each)
            else:
                found[row] = self._examined(points[row], answers, row, each)
        return found

    def _examined(self, values: dict[str, float], answers: Answers, row: int, seconds: float) -> SweepPoint | None:
        """A point that was solved with others, held against other curves; None where it does not stand up to that."""
        assert self.neighbours is not None
        assert isinstance(self.source, Problem | Curve)
        began = time.perf_counter()
        solution = self.neighbours.solution(self.source.with_parameters(values), answers[row], seconds)
        spent = seconds + time.perf_counter() - began
        return _point(tuple(values.values()), solution, spent) if solution.status.ok else None

    def _alone(self, values: dict[str, float]) -> SweepPoint:
        """A point solved for itself, from the last curve if that leads anywhere."""
        began = time.perf_counter()
        source = self.source
        problem = source.with_parameters(values) if isinstance(source, Problem | Curve) else source(**values)
        guess = self.last if self.last is not None and _alike(problem, self.last) else None
        solution = solve(problem, self.method, tol=self.tol, throw=False, guess=guess)
        if guess is not None and not solution.status.ok:
            solution = solve(problem, self.method, tol=self.tol, throw=False)
        if solution.status.ok:
            self.last = solution
            if self.neighbours is not None:
                self.neighbours.add(solution)
            elif isinstance(source, Problem | Curve):
                self.neighbours = Neighbours.of(solution, self.tol, self.count)
        return _point(tuple(values.values()), solution, time.perf_counter() - began)


def _alike(problem: Problem | Curve, last: Solution) -> bool:
    """Whether the last curve is one of this problem's kind, over the same interval."""
    other = last.problem
    if problem.templates is other.templates:
        return True
    return type(problem) is type(other) and (problem.n, problem.span) == (other.n, last.interval)


def _point(values: tuple[float, ...], solution: Solution, seconds: float) -> SweepPoint:
    stands = solution.status.ok
    return SweepPoint(
        values, solution.status.words, solution.value if stands else None,
        solution.error.value if stands else None, solution.stats.iterations, seconds,
        "" if stands else solution.message or solution.status.value,
    )  # fmt: skip


def _begun(path: Path, header: dict[str, Any]) -> dict[Place, SweepPoint]:
    """The points that a stored sweep already has; a file of this one is begun where there is none.

    Raises ValueError when the file belongs to something else, OSError when it cannot be written.
    """
    if not path.exists():
        _append(path, header)
        return {}
    whole = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    try:
        first, *rows = [json.loads(line) for line in whole]
        found = {tuple(row.pop("at")): SweepPoint(**row | {"values": tuple(row["values"])}) for row in rows}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"{path} is no store of this sweep ({error}); give another name, or remove it") from error
    if first != header:
        raise ValueError(
            f"{path} is the store of a sweep with another grid, method or tolerance; give another name, or remove it"
        )
    # what was being written when the sweep ended is written again
    path.write_text("".join(whole), encoding="utf-8")
    return found


def _append(path: Path, row: dict[str, Any]) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row, allow_nan=False) + "\n")
