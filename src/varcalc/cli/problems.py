"""``varcalc list`` and ``varcalc run``: the catalogue, and one problem solved by every method."""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from varcalc.cli.groups import end, kept
from varcalc.cli.options import (
    DISAGREE,
    PICTURE_TEXT,
    JsonCommand,
    loaded,
    picture_option,
    save_figure,
    tolerance_option,
)
from varcalc.progress import telling
from varcalc.spelling import near
from varcalc.study.user_file import SUFFIX

if TYPE_CHECKING:
    from varcalc.study.compare import Comparison
    from varcalc.study.reference import Reference


SHORTEST_WORD = 3
"""Letters of a word that is looked for in names and sentences."""


@click.command("list")
@click.argument("name", required=False)
@click.option("--scenes", is_flag=True, help="List the scenes of ray optics instead, for `varcalc trace`.")
@click.option("--systems", is_flag=True, help="Move every system of mechanics, and list the largest error of each.")
@click.option("--figures", is_flag=True, help="List the figures of the literature, for `varcalc figure`.")
@click.option("--certified", is_flag=True, help="Certify every reference problem, and list the digits proved of each.")
def list_(name: str | None, scenes: bool, systems: bool, figures: bool, certified: bool) -> None:
    """List the reference problems, or the cases of problem NAME.

    NAME may also be a scene, a system or a figure, or a word that names or describes some of them.
    """
    from varcalc.study.figures import figure_catalogue
    from varcalc.study.reference import catalogue
    from varcalc.study.scenes import scene_catalogue

    without_cases = scenes + systems + figures
    if without_cases + (name is not None or certified) > 1:
        raise click.UsageError("--scenes, --systems and --figures list what has no cases; give one of them, or NAME")
    if certified:
        entries = _certified([name] if name is not None else list(catalogue()))
    elif name is None:
        lists = ((scenes, scene_catalogue), (systems, _systems), (figures, figure_catalogue), (True, catalogue))
        entries = next(listed for asked, listed in lists if asked)()
    else:
        entries = _of_name(name)
    indent = max(map(len, entries), default=0) + 2
    # a program that reads the list gets one line an entry, a person whole words
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    for entry, line in entries.items():
        text = textwrap.fill(
            line, max(columns, indent + 20), initial_indent=" " * indent, subsequent_indent=" " * indent
        )
        click.echo(f"{entry:{indent}}{text[indent:]}".rstrip())
    if name is None and sys.stdout.isatty():
        way = "run NAME solves one; varcalc list NAME shows its cases."
        way = "trace NAME traces one." if scenes else "move NAME moves one." if systems else way
        way = "figure NUMBER draws one." if figures else way
        click.echo(f"\nvarcalc {way}")


def _of_name(name: str) -> dict[str, str]:
    """The cases of a problem; the scene, system or figure of that name; or all whose names or sentences hold it."""
    from varcalc.study.experiments import experiment_catalogue
    from varcalc.study.figures import figure_catalogue
    from varcalc.study.reference import catalogue
    from varcalc.study.scenes import scene_catalogue

    if name in catalogue() or "/" in name or name.endswith(SUFFIX):
        return {reference.name: reference.statement.partition("\n")[0] for reference in loaded(name)}
    lists = {
        "run": catalogue(),
        "trace": scene_catalogue(),
        "move": experiment_catalogue(),
        "figure": figure_catalogue(),
    }
    sought = name.casefold()
    found = {
        entry: f"{line} (varcalc {command} {entry})"
        for command, entries in lists.items()
        for entry, line in entries.items()
        if sought == entry or (len(sought) >= SHORTEST_WORD and sought in f"{entry} {line}".casefold())
    }
    if not found:
        remedy = near(name, [entry for entries in lists.values() for entry in entries])
        advice = "; varcalc list, list --scenes, --systems and --figures say what there is"
        raise click.UsageError(
            f"{name!r} is no problem of the catalogue, nor a scene, system or figure{remedy or advice}"
        )
    return found


def _systems() -> dict[str, str]:
    """The experiments of mechanics, each with its largest error."""
    from varcalc.study.experiments import experiment_catalogue, load_experiment

    listed = experiment_catalogue()
    with telling(None, "systems") as told:
        return {
            name: f"{load_experiment(name).run().largest:.1e}  {listed[name]}" for name in told.over(list(listed), str)
        }


def _certified(names: list[str]) -> dict[str, str]:
    """Every case of some problems, with the digits of its value that are proved or the reason why none are."""
    from varcalc.study.certified import proved_digits

    with telling(None, "certificates") as told:
        each = (reference for name in told.over(names, str) for reference in loaded(name))
        return {reference.name: proved_digits(reference.problem) for reference in each}


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@picture_option("-o", "--output", text=PICTURE_TEXT)
@tolerance_option
@click.option("--certify", "certified", is_flag=True, help="Say how many digits are proved as well.")
def run(name_or_file: str, as_json: bool, output: Path | None, tol: float, certified: bool) -> None:
    """Solve a problem by every method and compare the answers.

    NAME_OR_FILE is a reference problem (see `varcalc list`), one case of it
    such as brachistochrone/beyond, or a Python file of your own that defines
    `problem`, and `exact` where the closed form is known.

    The exit status is 0 when the routes agree and the ladder's answer stands, 1 when not, 2 when there was nothing
    to solve: a wrong option, or a file that does not work.
    """
    from varcalc.study.compare import compare

    # what a person's own file prints must not end up in the JSON document
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        reference = loaded(name_or_file)[0]
        problem = reference.problem
        comparison, stopped = kept(
            lambda: compare(problem, None, reference.exact, tol=tol, inapplicable=reference.inapplicable)
        )
    if as_json:
        told = _document(reference, comparison) | ({"certificate": comparison.certified()} if certified else {})
        click.echo(json.dumps(told, indent=2, allow_nan=False))
    else:
        click.echo(_page(reference, comparison))
        if certified:
            click.echo(f"certificate: {comparison.certified()}")
    if output is not None:
        _write_picture(comparison, reference, output)
    failed = not (comparison.agree and comparison.rows[-1].ok)
    end(stopped=stopped, failed=failed, status=DISAGREE)


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
    save_figure(lambda: comparison.chart(title=reference.name, downward=reference.downward), path)
