"""``varcalc verify``, ``extremals`` and ``diagnose``: what the answer of one problem is, and what others there are."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from typing import TYPE_CHECKING, Any

import click

from varcalc.cli.groups import end, kept
from varcalc.cli.options import JsonCommand, loaded, tolerance_option
from varcalc.tables import known, shown, table

if TYPE_CHECKING:
    from varcalc.search import Extremals
    from varcalc.solution import Finding
    from varcalc.solve.diagnose import Diagnosis
    from varcalc.verify import Verification

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")


def _print(told: Mapping[str, Any], page: str, *, as_json: bool) -> None:
    click.echo(json.dumps(told, indent=2, allow_nan=False) if as_json else page)


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@json_option
@tolerance_option
def verify(name_or_file: str, as_json: bool, tol: float) -> None:
    """Solve a problem, and say what kind of stationary curve its answer is.

    NAME_OR_FILE is as for `varcalc run`. The exit status is 0 when the answer is a minimum (a maximum where that is
    sought), 1 when it is none or there is no answer, 2 when there was nothing to solve.
    """
    import varcalc as vc

    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        problem = loaded(name_or_file)[0].problem
        solution, stopped = kept(lambda: vc.solve(problem, tol=tol, throw=False))
        check = vc.verify(solution) if solution.curve is not None and solution.status.ok else None
    if check is None:
        _print({"error": solution.message or solution.status.value}, str(solution), as_json=as_json)
    else:
        told = {"value": solution.value, "claimed_error": known(solution.error.value), **_verified(check)}
        _print(told, str(check), as_json=as_json)
    sought = {vc.Verdict.MINIMUM, vc.Verdict.MAXIMUM}
    end(stopped=stopped, failed=check is None or check.verdict not in sought)


def _verified(check: Verification) -> dict[str, Any]:
    """A verification as plain numbers and strings; None for what is no number."""
    return {
        "verdict": check.verdict.value,
        "index": known(check.index),
        "conjugate_points": check.conjugate_points.tolist(),
        "residual": known(check.residual),
        "legendre": known(check.legendre),
        "weierstrass": known(check.weierstrass),
        "invariants": {name: known(drift) for name, drift in check.invariants.items()},
        "findings": _sentences(check.findings),
    }


def _sentences(findings: Sequence[Finding]) -> list[str]:
    return [finding.sentence for finding in findings]


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@json_option
@tolerance_option
def extremals(name_or_file: str, as_json: bool, tol: float) -> None:
    """Find every extremal of a problem that a systematic search finds, best first.

    NAME_OR_FILE is as for `varcalc run`. The exit status is 0 when there is one, 1 when none was found, 2 when there
    was nothing to search.
    """
    import varcalc as vc

    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        problem = loaded(name_or_file)[0].problem
        found, stopped = kept(lambda: vc.extremals(problem, tol=tol))
        told = {"extremals": [_extremal(one) for one in found], "searched": found.searched, "complete": found.complete}
    _print(told, _listed(found), as_json=as_json)
    end(stopped=stopped, failed=not len(found))


def _extremal(one: Any) -> dict[str, Any]:
    check = one.verification
    return {
        "value": one.value,
        "claimed_error": known(one.error.value),
        "index": known(check.index),
        "verdict": check.verdict.value,
        "conjugate_points": check.conjugate_points.tolist(),
    }


def _listed(found: Extremals) -> str:
    rows = [
        (s.verification.verdict.value, f"{s.value:.15g}", shown(s.error.value, ".1e"), shown(float(s.index), "g"))
        for s in found
    ]
    notes = [f"searched: {found.searched}"]
    return table(("kind",), ("value", "claimed", "index"), rows, notes=notes) if rows else "\n".join(["none", *notes])


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@json_option
def diagnose(name_or_file: str, as_json: bool) -> None:
    """Say all there is to say of a problem, and of one without a minimum above all.

    NAME_OR_FILE is as for `varcalc run`. The exit status is 0 when there is a minimum (a maximum where that is
    sought), 1 when not, 2 when there was nothing to examine.
    """
    import varcalc as vc

    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        problem = loaded(name_or_file)[0].problem
        found, stopped = kept(lambda: vc.diagnose(problem))
    _print(_diagnosed(found), str(found), as_json=as_json)
    end(stopped=stopped, failed=found.verdict not in {vc.Verdict.MINIMUM, vc.Verdict.MAXIMUM})


def _diagnosed(found: Diagnosis) -> dict[str, Any]:
    return {
        "name": found.name,
        "verdict": None if found.verdict is None else found.verdict.value,
        "findings": _sentences(found.findings),
        "relaxed_value": known(found.relaxed_value),
    }
