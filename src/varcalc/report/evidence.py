"""What is known of an answer: the checks of its verification, the proof of its value, and what nobody looked at."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from varcalc.certificates.certificate import Certificate, Scope
from varcalc.report.page import Cell, Facts, Folded, Listed, Mark, PageSection, Paragraph, Part, Table, table
from varcalc.report.page import number_cell as number
from varcalc.report.words import capital
from varcalc.showing import Fact
from varcalc.solution import Solution, Verdict
from varcalc.solve.diagnose import Diagnosis
from varcalc.study.compare import Comparison
from varcalc.verify.verification import Verification

WELL = 1e-6
"""Off by less than this, what is held against something known stands."""
SURE = {Verdict.MINIMUM, Verdict.MAXIMUM}


def mark_of(comparison: Comparison, check: Verification | None) -> Mark:
    """How the answer of a comparison stands."""
    ladder = comparison.rows[-1]
    if not ladder.ok or ladder.solution is None:
        return Mark.BAD
    certain = comparison.agree and not ladder.solution.local
    return Mark.GOOD if certain and (check is None or check.verdict in SURE) else Mark.DOUBTFUL


def answered(solution: Solution, certificate: Certificate | None, comparison: Comparison) -> Iterator[Fact]:
    """The value, by how much it may be wrong, and what it was held against."""
    yield Fact("Value", f"{solution.value:.15g}")
    yield Fact("Claimed error", f"{solution.error.value:.1e} of the value, {solution.error.curve:.1e} of the curve")
    exact = comparison.exact
    if exact is not None:
        yield Fact("Closed form", f"{exact.value:.15g}" + (f", {exact.description}" if exact.description else ""))
        yield Fact("Difference", f"{solution.value - exact.value:+.1e}")
    if certificate is not None:
        low, high = certificate.enclosure
        yield Fact("Proved", f"between {low} and {high}: {certificate.digits} digits, over {certificate.scope.value}")
    yield Fact("Status", solution.status.value)
    yield Fact("Route", f"{solution.rung}, {solution.stats.unknowns} unknowns")
    if solution.local:
        better = "a better value" if solution.lower is None else f"{solution.lower:.12g}"
        yield Fact("Only local", solution.message or f"{better} is reached elsewhere")
    for name, value in solution.unknowns.items():
        yield Fact(f"Unknown {name}", f"{value:.12g}")
    for name, value in solution.sensitivities.items():
        if math.isfinite(value):
            yield Fact(f"dJ/d{name}", f"{value:.9g}")
    levels = [f"{m:.12g}" for m in solution.multipliers if isinstance(m, float)]
    if levels:
        yield Fact("Multipliers", ", ".join(levels))


def routes_table(comparison: Comparison) -> Table:
    """Every method with its answer, as ``varcalc run`` prints them."""
    columns = (
        ("method", False), ("status", False), ("value", True), ("error", True), ("claimed", True), ("build ms", True),
        ("solve ms", True), ("unknowns", True),
    )  # fmt: skip
    rows = [
        (
            Cell(row.label), Cell(row.outcome), number(row.value, ".15g", shown=row.ok),
            _sized(row.deviation), number(row.claimed, ".1e"), number(1e3 * row.build, ".2f"),
            number(1e3 * row.solve, ".2f"), number(row.unknowns, "d"),
        )
        for row in comparison.rows
    ]  # fmt: skip
    return table("What each route answers", columns, rows)


def _sized(deviation: float) -> Cell:
    """A signed error, sorted by its size."""
    return Cell("") if math.isnan(deviation) else Cell(f"{deviation:+.1e}", abs(deviation))


def routes_section(comparison: Comparison, level: int) -> PageSection:
    """The table of routes, whether they agree, and why some have no answer."""
    reasons = tuple(f"{row.label}: {row.reason}" for row in comparison.rows if row.reason)
    parts: list[Part] = [
        routes_table(comparison),
        Paragraph(capital(". ".join(line.strip() for line in comparison.conclusion)) + "."),
    ]
    if reasons:
        parts.append(Listed(reasons))
    return PageSection("By which routes", tuple(parts), level)


def checks_table(check: Verification) -> Table:
    """Each classical condition with its number."""
    rows = [
        ("Euler-Lagrange", f"residual {check.residual:.1e} of the terms"),
        ("Legendre", check.legendre_in_words()),
        ("Weierstrass", _weierstrass(check)),
        ("Jacobi", check.points_in_words(9)),
        ("Index", _index(check)),
        *((f"First integral: {name}", f"constant to {drift:.1e}") for name, drift in check.invariants.items()),
        ("Functional on this curve", f"{check.bound:.15g}"),
    ]
    return table(
        "The classical conditions", (("condition", False), ("found", False)), [(Cell(a), Cell(b)) for a, b in rows]
    )


def _weierstrass(check: Verification) -> str:
    if math.isnan(check.weierstrass):
        return "not tested"
    return f"least excess {float(check.weierstrass):.1e} of its terms"


def _index(check: Verification) -> str:
    if not math.isfinite(check.index):
        return "infinite" if math.isinf(check.index) else "unknown"
    found = [f"{name} {index}" for name, index in check.routes.items() if index is not None]
    return f"{check.index:.0f}" + (f" ({', '.join(found)})" if found else "")


def verdict_section(check: Verification, level: int) -> PageSection:
    """What kind of curve it is, and every statement that holds of it."""
    parts: list[Part] = [Paragraph(f"Verdict: {check.verdict.value}."), checks_table(check)]
    if check.findings:
        parts.append(Listed(tuple(capital(finding.sentence) for finding in check.findings)))
    return PageSection("What kind of curve it is", tuple(parts), level)


def certificate_section(certificate: Certificate | None, reason: str, level: int) -> PageSection:
    """The theorem and how each of its hypotheses was proved; or why there is no proof."""
    heading = "What is proved"
    if certificate is None:
        return PageSection(heading, (Paragraph(f"{capital(reason)}."),), level)
    what = "supremum" if certificate.solution.problem.maximise else "infimum"
    low, high = certificate.enclosure
    facts = [
        Fact("Lower bound", low), Fact("Upper bound", high),
        Fact("Of", f"the {what} over {certificate.curves}".rstrip(",")), Fact("Width", f"{certificate.width:.1g}"),
    ]  # fmt: skip
    if math.isfinite(certificate.distance.largest):
        facts.append(Fact("Whatever is as good lies within", f"{certificate.distance.largest:.1g} of the curve"))
    hypotheses = Folded(
        "The hypotheses, and how each was proved", (Listed(tuple(capital(str(one)) for one in certificate.proved)),)
    )
    return PageSection(heading, (Facts(tuple(facts)), hypotheses), level)


def unseen_section(
    solution: Solution, check: Verification | None, certificate: Certificate | None, more: tuple[str, ...], level: int
) -> PageSection:
    """What was searched, and what was not looked at."""
    found = list(more)
    if not solution.searched:
        found.append("no other curves were looked for")
    if check is not None:
        found += [f"the index by {name}: its route is closed" for name, index in check.routes.items() if index is None]
        if math.isnan(check.weierstrass):
            found.append("Weierstrass's excess")
    if certificate is not None and certificate.scope is not Scope.ALL:
        found.append(f"the proof does not speak of curves outside its scope: {certificate.scope.value}")
    if certificate is None:
        found.append("the value is an estimate with its claim, and no theorem")
    parts: list[Part] = [Paragraph(f"Searched: {solution.searched or 'nothing beyond the curve itself'}.")]
    parts.append(
        Listed(tuple(map(capital, found))) if found else Paragraph("Nothing is left open that is usually looked at.")
    )
    return PageSection("What was not looked at", tuple(parts), level)


def diagnosis_section(diagnosis: Diagnosis, level: int) -> PageSection:
    """Why there is no answer."""
    headline = "nothing could be shown" if diagnosis.verdict is None else diagnosis.verdict.value
    sentences = tuple(capital(finding.sentence) for finding in diagnosis.findings)
    return PageSection("Why there is no answer", (Paragraph(f"{capital(headline)}."), Listed(sentences)), level)


def errors_table(errors: Mapping[str, float]) -> Table:
    """By how much each thing that is known is missed."""
    rows = [(Cell(name), number(error, ".1e")) for name, error in errors.items()]
    return table("Held against what is known", (("what", False), ("off by", True)), rows)
