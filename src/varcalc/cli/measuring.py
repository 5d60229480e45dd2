"""``varcalc chart`` and ``varcalc sweep``: speed against accuracy, and grids of parameter values."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from varcalc.cli.groups import end, kept
from varcalc.cli.options import (
    DISAGREE,
    PICTURE_TEXT,
    TOLERANCE,
    JsonCommand,
    check_tolerances,
    loaded,
    picture_option,
    save,
    save_figure,
    store_option,
    tolerance_option,
)
from varcalc.progress import Interrupted, telling
from varcalc.study.user_file import SUFFIX

if TYPE_CHECKING:
    from varcalc.problem.problem import Curve, Problem
    from varcalc.solve.sweep import Sweep
    from varcalc.study.records import WorkPrecision
    from varcalc.study.reference import Reference

STORED = ".json"
"""The suffix of a file of measurements."""
HARD = ("brachistochrone", "regulator/layer", "soap_film/fold", "regulator/signal")
"""The problems that are charted when none is named."""
CHART_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""The tolerances at which a chart is measured when none is given."""


@click.command(cls=JsonCommand)
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@picture_option("-o", "--output", text=PICTURE_TEXT)
@picture_option("--claims", text="Write a picture of claimed against delivered errors here.")
@store_option(f"Write the measurements here ({STORED}); the file can be given as NAME later.")
@click.option(
    "--tol", "tolerances", type=TOLERANCE, callback=check_tolerances, multiple=True,
    help="A tolerance to measure at; may be given several times.  [default: 1e-3, 1e-6, 1e-9, 1e-12]",
)  # fmt: skip
@click.option(
    "--repeats", type=click.IntRange(1), default=3, show_default=True,
    help="Solves of which a time is the median; slow ones are fewer.",
)  # fmt: skip
def chart(
    names: tuple[str, ...],
    as_json: bool,
    output: Path | None,
    claims: Path | None,
    store: Path | None,
    tolerances: tuple[float, ...],
    repeats: int,
) -> None:
    """Measure speed against accuracy by every method, and draw it.

    Each method is measured at the tolerances, and as its own options turn from coarse to fine: elements, degree,
    the integrator's tolerance. Without NAME four hard problems are taken: a singular end, a boundary layer, the
    neighbourhood of a fold, many oscillations.

    NAME is a reference problem, one case of it, a Python file of your own (see `varcalc run`), or a .json file that
    --store wrote, which is drawn again and not measured.

    The exit status is 0 when some method answered and no answer lies further from the closed form than its claimed
    error allows, 1 when not, 2 when there was nothing to measure.
    """
    from varcalc.charts import claims_picture, work_precision_picture

    if store is not None and store.suffix != STORED:
        raise click.BadParameter(f"{store} must end in {STORED}", param_hint="--store")
    if output is not None or claims is not None:
        _check_drawable(names)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        measured, stopped = kept(lambda: _gathered(names, tolerances, repeats))
    if store is not None:
        save(measured.save, store)
    click.echo(json.dumps(measured.document(), indent=2, allow_nan=False) if as_json else measured.table())
    for draw, path in ((work_precision_picture, output), (claims_picture, claims)):
        if path is not None:
            save_figure(partial(draw, measured.records), path)
    for record in measured.astray:
        click.echo(f"{record.problem} by {record.method} at {record.turned} is wrong by more than it claims", err=True)
    wrong = bool(measured.astray) or not any(r.ok for r in measured.records)
    end(stopped=stopped, failed=wrong, status=DISAGREE)


def _check_drawable(names: Sequence[str]) -> None:
    """Refuse a picture of errors that nobody can know, before anything is measured for it."""
    own = [name for name in names if name.endswith(SUFFIX)]
    if own and len(own) == len(names) and all(loaded(name)[0].exact is None for name in own):
        raise click.UsageError(
            f"no picture: no closed form is given in {', '.join(own)}, so that errors are not known; "
            "add exact = varcalc.Exact(value) to the file, or leave the picture out"
        )


def _gathered(names: Sequence[str], tolerances: Sequence[float], repeats: int) -> WorkPrecision:
    """The measurements in stored files, and new ones of everything else, in the order of the names."""
    parts: list[WorkPrecision] = []
    try:
        for name in names or HARD:
            if name.endswith(STORED):
                parts.append(_stored(Path(name)))
                continue
            reference = loaded(name)[0]
            lines = _lines(reference, tolerances or CHART_TOLERANCES, repeats)
            with telling(None, reference.name) as told:
                for measure in told.over(lines):
                    parts.append(measure())  # noqa: PERF401 - what is finished is kept
    except KeyboardInterrupt as stop:
        raise Interrupted(_joined(parts)) from stop
    return _joined(parts)


def _joined(parts: Sequence[WorkPrecision]) -> WorkPrecision:
    """Measurements in a row; where they were made, if that was one place, and here otherwise."""
    from varcalc.study.records import WorkPrecision, about

    known = [part.about for part in parts if part.about != parts[0].about]
    return WorkPrecision(
        tuple(r for part in parts for r in part.records), parts[0].about if parts and not known else about()
    )


def _lines(reference: Reference, tolerances: Sequence[float], repeats: int) -> list[Callable[[], WorkPrecision]]:
    """What is measured of a problem, in parts between which progress is shown."""
    from varcalc.study.routes import methods_for, peers, routes
    from varcalc.study.work_precision import BRIEFLY, convergence, naively, work_precision

    problem = reference.problem
    methods = [*methods_for(problem), *(peer.method for peer in peers())]
    driven = [partial(work_precision, [reference], [m], tolerances, repeats=repeats, seconds=BRIEFLY) for m in methods]
    turned = [partial(convergence, reference, r, repeats=repeats) for r in routes(problem)]
    return [*turned, partial(naively, reference), *driven]


def _stored(path: Path) -> WorkPrecision:
    from varcalc.study.records import WorkPrecision

    try:
        return WorkPrecision.load(path)
    except OSError as error:
        raise click.UsageError(f"{path} could not be read: {error.strerror}") from error
    except ValueError as error:
        raise click.UsageError(str(error)) from error


@dataclass(frozen=True)
class _Loaded:
    """A reference problem; made anew in every process, where it is loaded once."""

    name: str

    def __call__(self) -> Problem | Curve:
        return _kept(self.name).problem


@lru_cache(maxsize=1)
def _kept(name: str) -> Reference:
    return loaded(name)[0]


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.argument("grid", nargs=-1, required=True, metavar="NAME=FROM:TO:COUNT...")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@store_option("Write every point here as it comes; the same command goes on from there.")
@click.option("--cores", type=click.IntRange(1), default=1, show_default=True, help="Processes to share the points.")
@tolerance_option
@picture_option("-o", "--output", text=PICTURE_TEXT)
def sweep(
    name_or_file: str,
    grid: tuple[str, ...],
    as_json: bool,
    store: Path | None,
    cores: int,
    tol: float,
    output: Path | None,
) -> None:
    """Solve a problem over a grid of parameter values.

    NAME_OR_FILE is as for `varcalc run`; each NAME=FROM:TO:COUNT, or NAME=VALUE,VALUE, varies one of its parameters.

    The exit status is 0 when every point has an answer, 1 when not, 2 when there was nothing to solve.
    """
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        found, stopped = kept(lambda: _swept(name_or_file, grid, store, cores, tol))
    click.echo(json.dumps(found.document(), indent=2, allow_nan=False) if as_json else found.table())
    if output is not None:
        save_figure(found.plot, output)
    end(stopped=stopped, failed=bool(found.failures), status=DISAGREE)


def _swept(name: str, grid: Sequence[str], store: Path | None, cores: int, tol: float) -> Sweep:
    from varcalc.solve.grid import all_spaced
    from varcalc.solve.sweep import sweep as solve_all

    problem = _kept(name).problem
    try:
        axes = all_spaced(grid)
        problem.with_parameters({n: values[0] for n, values in axes.items()})
        return solve_all(_Loaded(name) if cores > 1 else problem, axes, tol=tol, cores=cores, store=store)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.ClickException(f"{store} could not be written: {error.strerror}") from error
