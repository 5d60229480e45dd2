"""The command line: ``varcalc list``, ``run``, ``chart`` and ``sweep``.

What a command needs is imported when it runs, so that help and the list come at once.
"""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from varcalc.compare import Comparison
    from varcalc.problem import Curve, Problem
    from varcalc.reference import Reference
    from varcalc.sweep import Sweep
    from varcalc.work_precision import WorkPrecision

PICTURES = (".png", ".pdf", ".svg")
"""What a picture may be written as; the suffix of its name decides."""

STORED = ".json"
"""The suffix of a file of measurements."""

DISAGREE = 1
"""Exit status when routes disagree, or the ladder has no answer that stands."""


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="varcalc")
def main() -> None:
    """The calculus of variations as a solver: extremals by independent routes, with honest errors."""


@main.command("list")
@click.argument("name", required=False)
def list_(name: str | None) -> None:
    """List the reference problems, or the cases of problem NAME."""
    from varcalc.reference import catalogue

    if name is None:
        entries = catalogue()
    else:
        entries = {reference.name: reference.statement.partition("\n")[0] for reference in _load(name)}
    indent = max(map(len, entries), default=0) + 2
    # a program that reads the list gets one line an entry, a person whole words
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    for entry, line in entries.items():
        text = textwrap.fill(
            line, max(columns, indent + 20), initial_indent=" " * indent, subsequent_indent=" " * indent
        )
        click.echo(f"{entry:{indent}}{text[indent:]}".rstrip())
    if name is None and sys.stdout.isatty():
        click.echo("\nvarcalc run NAME solves one; varcalc list NAME shows its cases.")


def _written_path(_context: click.Context, _parameter: click.Parameter, value: Path | None) -> Path | None:
    """Refuse a file that could not be written before anything is solved for it."""
    if value is not None and not value.absolute().parent.is_dir():
        raise click.BadParameter(f"the folder {value.absolute().parent} does not exist; make it first")
    return value


def _picture_path(context: click.Context, parameter: click.Parameter, value: Path | None) -> Path | None:
    """The same for a picture, whose suffix says what it is written as."""
    if value is not None and value.suffix.lower() not in PICTURES:
        raise click.BadParameter(f"{value} must end in {', '.join(PICTURES[:-1])} or {PICTURES[-1]}")
    return _written_path(context, parameter, value)


def _picture_option(*names: str, text: str) -> Any:
    return click.option(*names, type=click.Path(dir_okay=False, path_type=Path), callback=_picture_path, help=text)


def _store_option(text: str) -> Any:
    return click.option(
        "--store", type=click.Path(dir_okay=False, path_type=Path), callback=_written_path, help=text
    )  # fmt: skip


PICTURE_TEXT = "Write the picture here (.png, .pdf or .svg)."


class JsonCommand(click.Command):
    """A command whose ``--json`` prints a document on failure too: ``{"error": the sentence}``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; where that fails after ``--json``, say so as JSON as well."""
        as_json = "--json" in args
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            _document_failure(error, as_json)
            raise

    def invoke(self, ctx: click.Context) -> Any:
        """Carry the command out; the same."""
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            _document_failure(error, ctx.params["as_json"])
            raise


def _document_failure(error: click.UsageError, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps({"error": error.format_message()}, indent=2))


@main.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@_picture_option("-o", "--output", text=PICTURE_TEXT)
@click.option(
    "--tol", type=click.FloatRange(0, min_open=True), default=1e-10, show_default=True,
    help="Error of the value to stay below, relative to max(1, |value|).",
)  # fmt: skip
def run(name_or_file: str, as_json: bool, output: Path | None, tol: float) -> None:
    """Solve a problem by every method and compare the answers.

    NAME_OR_FILE is a reference problem (see `varcalc list`), one case of it
    such as brachistochrone/beyond, or a Python file of your own that defines
    `problem`, and `exact` where the closed form is known.

    The exit status is 0 when the routes agree and the ladder's answer stands, 1 when not, 2 when there was nothing
    to solve: a wrong option, or a file that does not work.
    """
    from varcalc.compare import compare

    # what a person's own file prints must not end up in the JSON document
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        reference = _load(name_or_file)[0]
        routes = _with_progress(_routes(reference.problem), reference.name)
        comparison = compare(reference.problem, routes, reference.exact, tol=tol, inapplicable=reference.inapplicable)
    if as_json:
        click.echo(json.dumps(_document(reference, comparison), indent=2, allow_nan=False))
    else:
        click.echo(_page(reference, comparison))
    if output is not None:
        _write_picture(comparison, reference, output)
    if not (comparison.agree and comparison.rows[-1].ok):
        raise SystemExit(DISAGREE)


def _load(name_or_file: str) -> tuple[Reference, ...]:
    from varcalc.reference import ProblemFileError, load

    try:
        return load(name_or_file)
    except ProblemFileError as error:
        raise click.UsageError(str(error)) from error


def _routes(problem: Problem | Curve) -> list[Any]:
    """Every method, and last the ladder, which chooses for itself; Ritz once where it always goes to IPOPT."""
    from varcalc import Collocation, FirstIntegral, Ipopt, Isoperimetric, Ritz, Shooting, Through

    prescribed = all(
        isinstance(c, Through) or (isinstance(c, Isoperimetric) and c.equality) for c in problem.constraints
    )
    newton = [Ritz()] if prescribed else []
    return [*newton, Ritz(optimiser=Ipopt()), Collocation(), Shooting(), FirstIntegral(), None]


def _with_progress(routes: Sequence[Any], name: str) -> Iterable[Any]:
    """``routes``, with a bar on standard error while they are worked through, if a person is watching."""
    if not sys.stderr.isatty():
        return routes
    from rich.console import Console
    from rich.progress import track

    return track(routes, description=name, console=Console(stderr=True), transient=True)


def _page(reference: Reference, comparison: Comparison) -> str:
    heading = [reference.name, reference.statement, f"source: {reference.source}" if reference.source else ""]
    return "\n".join([*filter(None, heading), "", comparison.table()])


def _document(reference: Reference, comparison: Comparison) -> dict[str, Any]:
    return {
        "name": reference.name,
        "statement": reference.statement,
        "source": reference.source,
        **comparison.record(),
    }


def _write_picture(comparison: Comparison, reference: Reference, path: Path) -> None:
    _save_figure(lambda: comparison.chart(title=reference.name, downward=reference.downward), path)


def _save_figure(draw: Callable[[], Figure], path: Path) -> None:
    """Draw and write; what cannot be drawn is said, what cannot be written fails."""
    try:
        figure = draw()
    except ValueError as error:
        click.echo(f"no picture: {error}", err=True)
        return
    try:
        figure.savefig(path, dpi=160)
    except OSError as error:
        raise click.ClickException(f"the picture could not be written to {path}: {error.strerror}") from error


@main.command(cls=JsonCommand)
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@_picture_option("-o", "--output", text=PICTURE_TEXT)
@_picture_option("--claims", text="Write a picture of claimed against delivered errors here.")
@_store_option("Write the measurements here (JSON); the file can be given as NAME later.")
@click.option(
    "--tol", "tolerances", type=click.FloatRange(0, min_open=True), multiple=True,
    help="A tolerance to measure at; may be given several times.  [default: 1e-2, 1e-3, ... 1e-14]",
)  # fmt: skip
@click.option(
    "--repeats", type=click.IntRange(1), default=5, show_default=True,
    help="Solves of which a time is the median, beside one that is not counted.",
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

    NAME is a reference problem, one case of it, a Python file of your own (see `varcalc run`), or a .json file that
    --store wrote, which is drawn again and not measured.

    The exit status is 0 when some method answered and no answer lies further from the closed form than its claimed
    error allows, 1 when not, 2 when there was nothing to measure.
    """
    from varcalc.charts import claims_picture, work_precision_picture

    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        measured = _gathered(names, tolerances, repeats)
    if store is not None:
        _save(measured.save, store)
    click.echo(json.dumps(measured.document(), indent=2, allow_nan=False) if as_json else measured.table())
    for draw, path in ((work_precision_picture, output), (claims_picture, claims)):
        if path is not None:
            _save_figure(partial(draw, measured.records), path)
    for record in measured.astray:
        click.echo(
            f"{record.problem} by {record.method} at {record.setting:g} is wrong by more than it claims", err=True
        )
    if measured.astray or not any(r.ok for r in measured.records):
        raise SystemExit(DISAGREE)


def _gathered(names: Sequence[str], tolerances: Sequence[float], repeats: int) -> WorkPrecision:
    """The measurements in stored files, and new ones of everything else, in the order of the names."""
    from varcalc.work_precision import TOLERANCES, WorkPrecision, about, work_precision

    parts: list[WorkPrecision] = []
    for name in names:
        if name.endswith(STORED):
            parts.append(_stored(Path(name)))
            continue
        reference = _load(name)[0]
        routes = _with_progress(_routes(reference.problem), reference.name)
        parts += [work_precision([reference], [m], tolerances or TOLERANCES, repeats=repeats) for m in routes]
    known = [part.about for part in parts if part.about != parts[0].about]
    return WorkPrecision(tuple(r for part in parts for r in part.records), about() if known else parts[0].about)


def _stored(path: Path) -> WorkPrecision:
    from varcalc.work_precision import WorkPrecision

    try:
        return WorkPrecision.load(path)
    except OSError as error:
        raise click.UsageError(f"{path} could not be read: {error.strerror}") from error
    except ValueError as error:
        raise click.UsageError(str(error)) from error


def _save(write: Callable[[Path], None], path: Path) -> None:
    try:
        write(path)
    except OSError as error:
        raise click.ClickException(f"{path} could not be written: {error.strerror}") from error


@dataclass(frozen=True)
class _Loaded:
    """A reference problem; made anew in every process, where it is loaded once."""

    name: str

    def __call__(self) -> Problem | Curve:
        return _kept(self.name).problem


@lru_cache(maxsize=1)
def _kept(name: str) -> Reference:
    return _load(name)[0]


@main.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.argument("grid", nargs=-1, required=True, metavar="NAME=FROM:TO:COUNT...")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@_store_option("Write every point here as it comes; the same command goes on from there.")
@click.option("--cores", type=click.IntRange(1), default=1, show_default=True, help="Processes to share the points.")
@click.option(
    "--tol", type=click.FloatRange(0, min_open=True), default=1e-10, show_default=True,
    help="Error of the value to stay below, relative to max(1, |value|).",
)  # fmt: skip
def sweep(name_or_file: str, grid: tuple[str, ...], as_json: bool, store: Path | None, cores: int, tol: float) -> None:
    """Solve a problem over a grid of parameter values.

    NAME_OR_FILE is as for `varcalc run`; each NAME=FROM:TO:COUNT, or NAME=VALUE,VALUE, varies one of its parameters.

    The exit status is 0 when every point has an answer, 1 when not, 2 when there was nothing to solve.
    """
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        found = _swept(name_or_file, grid, store, cores, tol)
    click.echo(json.dumps(found.document(), indent=2, allow_nan=False) if as_json else found.table())
    if found.failures:
        raise SystemExit(DISAGREE)


def _swept(name: str, grid: Sequence[str], store: Path | None, cores: int, tol: float) -> Sweep:
    from varcalc.sweep import spaced
    from varcalc.sweep import sweep as solve_all

    problem = _kept(name).problem
    try:
        axes = dict(spaced(text) for text in grid)
        problem.with_parameters({n: values[0] for n, values in axes.items()})
        return solve_all(_Loaded(name) if cores > 1 else problem, axes, tol=tol, cores=cores, store=store)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    except OSError as error:
        raise click.ClickException(f"{store} could not be written: {error.strerror}") from error
