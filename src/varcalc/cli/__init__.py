"""The command line: ``varcalc list``, ``run``, ``certify``, ``chart``, ``sweep``, ``trace``, ``move`` and the others.

What a command needs is imported when it runs, so that help and the list come at once.
"""

from __future__ import annotations

import click

from varcalc.cli.certifying import certify
from varcalc.cli.examining import diagnose, extremals, verify
from varcalc.cli.figures import figure
from varcalc.cli.groups import Commands
from varcalc.cli.measuring import chart, sweep
from varcalc.cli.moving import move
from varcalc.cli.problems import list_, run
from varcalc.cli.reporting import report
from varcalc.cli.tracing import trace


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="varcalc")
def main() -> None:
    """The calculus of variations as a solver: extremals by independent routes, with honest errors."""


for command in (list_, run, verify, extremals, diagnose, certify, chart, sweep, trace, move, figure, report):
    main.add_command(command)
