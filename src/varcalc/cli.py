"""The command line: ``varcalc list`` and ``varcalc run``.

What a command needs is imported when it runs, so that help and the list come at once.
"""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from varcalc.compare import Comparison
    from varcalc.problem import Curve, Problem
    from varcalc.reference import Reference

PICTURES = (".png", ".pdf", ".svg")
"""What a picture may be written as; the suffix of its name decides."""

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


def _picture_path(_context: click.Context, _parameter: click.Parameter, value: Path | None) -> Path | None:
    """Refuse a picture that could not be written before anything is solved for it."""
    if value is None:
        return None
    if value.suffix.lower() not in PICTURES:
        raise click.BadParameter(f"{value} must end in {', '.join(PICTURES[:-1])} or {PICTURES[-1]}")
    if not value.absolute().parent.is_dir():
        raise click.BadParameter(f"the folder {value.absolute().parent} does not exist; make it first")
    return value


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
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False, path_type=Path), callback=_picture_path,
    help="Write the picture here (.png, .pdf or .svg).",
)  # fmt: skip
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
    try:
        figure = comparison.chart(title=reference.name, downward=reference.downward)
    except ValueError as error:
        click.echo(f"no picture: {error}", err=True)
        return
    try:
        figure.savefig(path, dpi=160)
    except OSError as error:
        raise click.ClickException(f"the picture could not be written to {path}: {error.strerror}") from error
