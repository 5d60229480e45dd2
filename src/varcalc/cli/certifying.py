"""``varcalc certify``: a proof of the value of one problem."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext, redirect_stdout
from typing import TYPE_CHECKING, Any

import click

from varcalc.cli.options import JsonCommand, loaded

if TYPE_CHECKING:
    from varcalc.certificates import Certificate

UNPROVED = 1
"""Exit status when there is no proof."""


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@click.option("--digits", type=click.IntRange(min=1), help="Digits of the value that the interval must tell.")
def certify(name_or_file: str, as_json: bool, digits: int | None) -> None:
    """Prove by ball arithmetic between which two numbers the infimum lies.

    NAME_OR_FILE is as for `varcalc run`. The exit status is 0 when it is proved, 1 when not (the inequality that
    failed is printed), 2 when there was nothing to prove: a wrong option, or a file that does not work.
    """
    import varcalc as vc

    certificate, reason = None, ""
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        reference = loaded(name_or_file)[0]
        try:
            certificate = vc.certify(vc.solve(reference.problem), digits=digits)
        except vc.VariationalError as error:
            reason = str(error)
        except ImportError as error:
            raise click.ClickException(str(error)) from error
    told = {"error": reason} if certificate is None else document(certificate)
    click.echo(json.dumps(told, indent=2) if as_json else reason or str(certificate))
    if certificate is None:
        raise SystemExit(UNPROVED)


def document(certificate: Certificate) -> dict[str, Any]:
    """A certificate as plain numbers, strings and lists; None for what is infinite."""

    def finite(numbers: dict[str, float]) -> dict[str, float | None]:
        return {name: number if number < float("inf") else None for name, number in numbers.items()}

    distance = {"mean": certificate.distance.mean, "largest": certificate.distance.largest}
    return {
        "lower": certificate.lower,
        "upper": certificate.upper,
        "enclosure": list(certificate.enclosure),
        "scope": certificate.scope.value,
        **finite({"tube": certificate.tube, "slopes": certificate.slopes}),
        "distance": finite(distance),
        "proved": [{"sentence": h.sentence, "by": h.means.value} for h in certificate.proved],
        "seconds": certificate.seconds,
    }
