"""What the commands share: options, how a failure is told, what is written."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from varcalc.study.reference import Reference

PICTURES = (".png", ".pdf", ".svg")
"""What a picture may be written as; the suffix of its name decides."""


DISAGREE = 1
"""Exit status when routes disagree, or the ladder has no answer that stands."""


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


def check_tolerances(_context: click.Context, _parameter: click.Parameter, value: Any) -> Any:
    """Refuse what is no number: it lies in no range, and outside of none."""
    if any(map(math.isnan, value if isinstance(value, tuple) else (value,))):
        raise click.BadParameter("nan is no tolerance; give a positive number")
    return value


def picture_option(*names: str, text: str) -> Any:
    """An option that names a picture to write."""
    return click.option(*names, type=click.Path(dir_okay=False, path_type=Path), callback=_picture_path, help=text)


def store_option(text: str) -> Any:
    """``--store``, which names a file of results."""
    return click.option(
        "--store", type=click.Path(dir_okay=False, path_type=Path), callback=_written_path, help=text
    )  # fmt: skip


TOLERANCE = click.FloatRange(0, math.inf, min_open=True, max_open=True)

tolerance_option = click.option(
    "--tol", type=TOLERANCE, callback=check_tolerances, default=1e-10, show_default=True,
    help="Error of the value to stay below, relative to max(1, |value|).",
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


def loaded(name_or_file: str) -> tuple[Reference, ...]:
    """The references of a problem; a usage error, with its sentence, where there are none."""
    from varcalc.study.reference import ProblemFileError, load

    try:
        return load(name_or_file)
    except ProblemFileError as error:
        raise click.UsageError(str(error)) from error


def save_figure(draw: Callable[[], Figure], path: Path) -> None:
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


def save(write: Callable[[Path], None], path: Path) -> None:
    """Write a file; what cannot be written fails with the reason."""
    try:
        write(path)
    except OSError as error:
        raise click.ClickException(f"{path} could not be written: {error.strerror}") from error
