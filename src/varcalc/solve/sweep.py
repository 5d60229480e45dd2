"""One problem solved over a grid of parameter values or end points, each from its neighbour's curve.

Points are stored as they come, so that whatever ends a sweep early costs no point that was reported; the same call goes
on from there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.extensions import optional
from varcalc.methods.arguments import check_tolerance
from varcalc.methods.labels import checked_method, label
from varcalc.problem.conditions import file, told, whole
from varcalc.problem.problem import Curve, Problem
from varcalc.progress import Interrupted, Progress, Telling, telling
from varcalc.showing import Fact, Plotted, counted, line
from varcalc.solve.grid import Grid, Paired, Place
from varcalc.solve.identity import identity
from varcalc.solve.point import BROKEN_POINT, MISSING, Measured, SweepPoint
from varcalc.solve.row import Source, SweepRow, Values, made_once
from varcalc.solve.sharing import USUAL_WORKERS, Job, shared
from varcalc.solve.store import Store, read
from varcalc.spelling import spelled
from varcalc.tables import known, shown, table

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
MOST_REASONS = 4
"""Reasons of failures that a print tells."""

POINT_FIELDS = tuple(f.name for f in fields(SweepPoint) if f.name != "values")
"""What there is of every point besides its values."""
VALUE = "value"
"""The name of the result in ``units``."""


@dataclass(frozen=True, repr=False)
class Sweep(Plotted):
    """What :func:`sweep` found: ``points``, one for each combination of the ``grid``, the last name fastest.

    With ``paired`` the values of the names were taken together, one point each. ``units`` are those of the names and of
    the ``"value"``, ``about`` the problem, the method and the tolerance in words, and ``notes`` what was odd about the
    store.
    """

    grid: Mapping[str, tuple[float, ...]]
    points: tuple[SweepPoint, ...]
    paired: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    about: Mapping[str, str] = field(default_factory=dict, compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def load(cls, store: str | Path) -> Sweep:
        """The sweep in a file that ``sweep(..., store=)`` wrote; points that it does not have yet are "missing".

        Raises ValueError for what is no store, OSError where there is no file.
        """
        header, found, notes, _ = read(file("store", store))
        grid = Grid({name: tuple(values) for name, values in header["grid"].items()}, header["paired"])
        return _gathered(grid, found, header, notes)

    def __repr__(self) -> str:
        answered = len(self.points) - len(self.failures)
        return line("Sweep", [f"{answered} of {counted(len(self.points), 'point')} answered", *self.grid])

    def _headline(self) -> str:
        return f"A sweep over {', '.join(self.grid)}: {counted(len(self.points), 'point')}"

    def _facts(self) -> Iterator[Fact]:
        for name, values in self.grid.items():
            yield Fact(name, f"{counted(len(values), 'value')} from {min(values):.9g} to {max(values):.9g}")
        known = [p.value for p in self.points if p.value is not None]
        if known:
            yield Fact("functional", f"from {min(known):.12g} to {max(known):.12g}")
        for reason in list(dict.fromkeys(p.reason for p in self.failures))[:MOST_REASONS]:
            yield Fact(counted(sum(p.reason == reason for p in self.failures), "failure"), reason)

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

    def labelled(self, name: str, called: str = "") -> str:
        """A name of the grid, or ``"value"``, with its unit behind it; ``called`` says it in another word."""
        unit = self.units.get(name, "")
        return f"{called or name} ({unit})" if unit else called or name

    def table(self) -> str:
        """The points as text for a monospaced page, with the reasons of failures beneath; missing ones are counted."""
        there = [p for p in self.points if p.status != MISSING]
        rows = [
            (
                *(shown(v, ".9g") for v in p.values), p.status + (", local" if p.local else ""),
                shown(p.value, ".15g"), shown(p.claimed_error, ".1e"), shown(1e3 * p.seconds, ".2f"),
            )
            for p in there
        ]  # fmt: skip
        missing = len(self.points) - len(there)
        unsolved = [f"{missing} of {counted(len(self.points), 'point')} not solved yet"] if missing else []
        reasons = dict.fromkeys([*(p.reason for p in there if not p.ok), *unsolved, *self.notes])
        names = map(self.labelled, self.grid)
        return table((*names, "status"), (self.labelled(VALUE), "claimed", "ms"), rows, notes=reasons)

    def document(self) -> dict[str, Any]:
        """The sweep as plain numbers, strings, lists and dicts, ready for JSON."""
        grid = Grid(self.grid, self.paired).document()
        points = [p.row() | {"lower": known(p.lower), "reason": p.reason} for p in self.points]
        return {
            "grid": grid, "paired": self.paired, "units": dict(self.units), "about": dict(self.about),
            "notes": list(self.notes), "points": points,
        }  # fmt: skip

    def to_pandas(self) -> pd.DataFrame:
        """One row a point: a column for each name of the grid, and one for each field of :class:`SweepPoint`.

        ``attrs`` holds the units. Raises ModuleNotFoundError without pandas (``pip install 'varcalc[frames]'``).
        """
        pd = optional("pandas", "frames", "tables of points")
        columns = {name: [p.values[k] for p in self.points] for k, name in enumerate(self.grid)}
        columns |= {name: self._column(name) for name in POINT_FIELDS}
        frame = pd.DataFrame(columns)
        frame.attrs = {"units": dict(self.units), **self.about}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """One dimension for each name of the grid, or ``point`` for paired values, which are then its coordinates.

        Every field of :class:`SweepPoint` is a variable, and those with a unit have it as the attribute ``units``, as
        the CF conventions do. Raises ModuleNotFoundError without xarray (``pip install 'varcalc[frames]'``).
        """
        xr = optional("xarray", "frames", "arrays of points")
        dimensions = ("point",) if self.paired else tuple(self.grid)
        coordinates = {name: (dimensions if self.paired else (name,), list(v)) for name, v in self.grid.items()}
        shape = Grid(self.grid, self.paired).shape
        variables = {name: (dimensions, np.array(self._column(name)).reshape(shape)) for name in POINT_FIELDS}
        # a parameter may be called as a field is: the coordinate keeps the name
        variables = {(f"{name}_" if name in coordinates else name): data for name, data in variables.items()}
        data = xr.Dataset(variables, coordinates, dict(self.about))
        result = f"{VALUE}_" if VALUE in coordinates else VALUE
        for name, unit in self.units.items():
            data[result if name == VALUE else name].attrs["units"] = unit
        for name in ("claimed_error", "lower"):
            if VALUE in self.units and name not in coordinates:
                data[name].attrs["units"] = self.units[VALUE]
        data[result].attrs["long_name"] = self.about.get("problem", VALUE)
        return data

    def _column(self, name: str) -> list[Any]:
        column = [getattr(p, name) for p in self.points]
        return [np.nan if v is None else v for v in column]


@spelled
def sweep(
    problem: Source,
    grid: Mapping[str, Iterable[float]] | Paired,
    method: Any = None,
    *,
    tol: float = 1e-10,
    cores: int | None = None,
    executor: Executor | None = None,
    store: str | Path | None = None,
    units: Mapping[str, str] | None = None,
    progress: Progress = None,
) -> Sweep:
    """Solve ``problem`` for every combination of the values in ``grid``, or for those that are :class:`Paired`.

    ``problem`` is a Problem or Curve whose parameters are named in ``grid``
    (end points among them, see :class:`varcalc.Parameter`), a function without
    arguments that makes such a problem, or one that takes the values as keywords
    and makes a problem for each point; such a function may also return a
    :class:`varcalc.Solution`, or :class:`varcalc.Measured` for anything else that depends on
    parameters: a ray's optical path, where a motion has come to. The
    grid is walked from neighbour to neighbour; each solve begins from the
    nearest answer, and afresh where that leads nowhere. By Ritz and Collocation the
    points of one problem are solved many at a time, each held to what a solve
    asks of an answer; at intervals it is looked whether another valley has become the lowest.
    A point without an answer keeps its status, and so does one at which the function raises ValueError,
    ArithmeticError, LookupError or RuntimeError, or of which its process died.

    With ``cores``, one to begin with, the points are shared in chunks among that many processes; with ``executor``
    among its workers, which may be on other machines (:class:`concurrent.futures.Executor`, such as
    ``client.get_executor()`` of Dask); then ``cores`` says how many they are, where that is known. The executor is
    left open. A function must be one that the executor can send: for processes, one that stands at the top of a module.

    With ``store``, the name of a file, the points are written as they come, and points
    that are in it already are not solved again: an interrupted sweep goes on
    when the same call is made again. ``units`` are shown with the names of the grid, and that of ``"value"`` with the
    result; they change no number. ``progress`` is as :data:`varcalc.progress.Progress` says; Ctrl-C raises
    :class:`varcalc.Interrupted`, which holds the sweep of the points that are there.

    Raises TypeError and ValueError for what cannot be swept, among them the store of another sweep, and whatever else
    a function raises.

    >>> import varcalc as vc
    >>> spring = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1})
    >>> sweep(spring, {"k": [0, 1, 4]}).values.round(6).tolist()
    [1.0, 1.313035, 2.074629]
    """
    wanted = Grid.of(grid)
    _check_solves(problem, method, tol)
    _check_workers(cores, executor)
    header = _header(problem, wanted, method, tol, units, stored=store is not None)
    with nullcontext() if store is None else Store(store, header) as kept, telling(progress, "sweep") as tell:
        return _walked(problem, wanted, header, method, tol, cores, executor, kept, tell)


def _walked(
    problem: Source, wanted: Grid, header: dict[str, Any], method: Any, tol: float, cores: int | None,
    executor: Executor | None, kept: Store | None, tell: Telling,
) -> Sweep:  # fmt: skip
    """The sweep of what is ``kept`` and of the points that are not, kept as they come."""
    points = {} if kept is None else kept.known
    missing = [at for at in wanted.places() if at not in points]
    try:
        for found in _solved(problem, wanted, missing, method, tol, cores, executor):
            points.update(found)
            if kept is not None:
                kept.add(found)
            tell(len(points), wanted.count)
    except KeyboardInterrupt as stop:
        raise Interrupted(_gathered(wanted, points, header, () if kept is None else kept.notes)) from stop
    return _gathered(wanted, points, header, () if kept is None else kept.notes)


def _check_solves(problem: Any, method: Any, tol: Any) -> None:
    """Raise TypeError or ValueError for what cannot be solved point by point."""
    checked_method(0, method)
    check_tolerance(tol)
    if not (isinstance(problem, Problem | Curve) or callable(problem)):
        raise TypeError(f"problem must be a Problem, a Curve or a function that makes one, not {told(problem)}")


def _check_workers(cores: int | None, executor: Executor | None) -> None:
    """Raise ValueError or TypeError for workers that there cannot be."""
    if cores is not None:
        whole("cores", cores)
    if executor is not None and not isinstance(executor, Executor):
        raise TypeError(
            f"executor must be a concurrent.futures.Executor, not {executor!r}; of a Dask client give "
            "client.get_executor()"
        )


def _solved(
    problem: Source,
    grid: Grid,
    places: list[Place],
    method: Any,
    tol: float,
    cores: int | None,
    executor: Executor | None,
) -> Iterator[list[tuple[Place, SweepPoint]]]:
    """The points at ``places`` as they come, those of a chunk together."""
    points = grid.points(places)
    if not points:
        return
    if executor is None and cores in (None, 1):
        done = 0
        for group in SweepRow(problem, method, tol, len(points)).groups(points):
            yield list(zip(places[done : done + len(group)], group, strict=True))
            done += len(group)
        return
    job = Job.of(problem, method, tol, len(points))
    for piece, found in shared(job, points, executor, cores or USUAL_WORKERS):
        yield list(zip(places[piece], found, strict=True))


def _header(
    problem: Source, grid: Grid, method: Any, tol: float, units: Mapping[str, str] | None, *, stored: bool
) -> dict[str, Any]:
    """What tells a sweep from others; of one that is ``stored``, the problem is looked at closely."""
    return {
        "grid": grid.document(), "paired": grid.paired, "units": _checked_units(units, grid), "method": label(method),
        "tol": float(tol), "problem": _identity(problem, grid) if stored else {"name": _name(problem)},
    }  # fmt: skip


def _name(problem: Source) -> str:
    """What a source is called."""
    return problem.name if isinstance(problem, Problem | Curve) else getattr(problem, "__qualname__", repr(problem))


def _identity(source: Source, grid: Grid) -> dict[str, Any]:
    """What tells the problem of a store from another: its numbers at the first point, where it has any there."""
    first: Values = grid.points([next(iter(grid.places()))])[0]
    try:
        problem: Any = source
        if not isinstance(source, Problem | Curve):
            problem = source() if made_once(source) else source(**first)
        if isinstance(problem, Problem | Curve):
            moved = first if set(first) <= set(problem.parameters) else {}
            return identity(problem.with_parameters(moved))
        if isinstance(problem, Measured):
            return {"name": _name(source), "numbers": [problem.value if np.isfinite(problem.value) else None]}
        return {"name": _name(source), "numbers": identity(problem.problem)}
    except BROKEN_POINT:
        return {"name": _name(source)}


def _checked_units(units: Mapping[str, str] | None, grid: Grid) -> dict[str, str]:
    """Units by name; ValueError for a name that is neither in the grid nor the value."""
    if units is not None and not isinstance(units, Mapping):
        raise TypeError(f"units must map the names in the grid to texts, not {told(units)}; write {{'k': 'N/m'}}")
    given = dict(units or {})
    strange = given.keys() - {*grid.axes, VALUE}
    if strange:
        raise ValueError(
            f"units names {min(strange)!r}, which is not swept; name one of {', '.join(grid.axes)}, or {VALUE!r}"
        )
    return given


def _gathered(
    grid: Grid, found: Mapping[Place, SweepPoint], header: Mapping[str, Any], notes: tuple[str, ...]
) -> Sweep:
    """The points in the order of the grid; those that are not known yet are missing."""
    places = sorted(grid.places())
    points = [
        found.get(at) or SweepPoint(tuple(values.values()), MISSING, None, None, message="not solved yet")
        for at, values in zip(places, grid.points(places), strict=True)
    ]
    about = {"problem": header["problem"]["name"], "method": header["method"], "tol": str(header["tol"])}
    return Sweep(grid.axes, tuple(points), grid.paired, header["units"], about, notes)
