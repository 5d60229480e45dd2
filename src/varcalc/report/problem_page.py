"""The page of a problem: each of its cases solved by every route, verified, certified and measured."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from varcalc.certificates.certificate import Certificate
from varcalc.charts import claims_picture, cold_picture, comparison_picture, convergence_picture
from varcalc.problem.problem import Curve
from varcalc.report.evidence import (
    answered,
    certificate_section,
    diagnosis_section,
    mark_of,
    routes_section,
    unseen_section,
    verdict_section,
)
from varcalc.report.page import (
    Cell,
    Facts,
    Folded,
    Listed,
    Mark,
    Page,
    PageSection,
    Paragraph,
    Part,
    Picture,
    Pictures,
    Table,
    number_cell,
    table,
)
from varcalc.report.pictures import picture, sketch
from varcalc.report.question import asked_of_problem
from varcalc.report.subjects import Subject
from varcalc.report.words import about_sections, source_section
from varcalc.solution import Solution, VariationalError
from varcalc.solve.diagnose import diagnose
from varcalc.study.compare import Comparison, compare
from varcalc.study.records import Record
from varcalc.study.reference import Reference, load
from varcalc.study.routes import Knob, methods_for, peers, routes
from varcalc.study.work_precision import BRIEFLY, convergence, naively, work_precision
from varcalc.verify import verify
from varcalc.verify.verification import Verification

MEASURED = 9.0
"""Seconds of processor time that a page's measurements take; what they do not come to is named on it."""
TOLERANCE_SHARE = 0.6
"""Of that, for answers at tolerances."""
TIME_SHARE = 3.0
"""By how much more than its equal part of the time that is left a line of convergence may take."""
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
DRAWN = 201
CURVES_HEIGHT = 5.6
"""Of the picture of one function's curves, in inches."""


class Depth(Enum):
    """How much of a problem is looked at."""

    QUICK = "its routes, its verdict and its certificate"
    FULL = "the same of its other cases as well, and how the errors fall and what they cost"


@dataclass(frozen=True)
class Case:
    """One case of a problem, and what was found of it."""

    reference: Reference
    comparison: Comparison
    check: Verification | None
    certificate: Certificate | None
    unproved: str

    @property
    def solution(self) -> Solution:
        """The ladder's."""
        solution = self.comparison.rows[-1].solution
        assert solution is not None  # it is always tried
        return solution

    @property
    def mark(self) -> Mark:
        """How its answer stands."""
        return mark_of(self.comparison, self.check)

    @property
    def answer(self) -> str:
        """The answer in a line."""
        if not self.solution.status.ok:
            return self.solution.message or self.solution.status.value
        return f"{self.solution.value:.12g}"

    @property
    def known(self) -> str:
        """How well it is known, in a line."""
        if not self.solution.status.ok:
            return self.solution.status.words
        parts = [] if self.check is None else [self.check.verdict.value]
        parts.append(f"claimed to {self.solution.error.value:.1g}")
        if self.certificate is not None:
            parts.append(f"{self.certificate.digits} digits proved")
        return ", ".join(parts)


def problem_page(subject: Subject, depth: Depth) -> Page:
    """What is known of a problem and of its other cases.

    Raises :class:`varcalc.study.user_file.ProblemFileError` for a file that cannot be used.
    """
    began = time.process_time()
    references = load(subject.given)
    first = _looked_at(references[0])
    sections = [*about_sections(subject), *_case_sections(first, level=2)]
    if depth is Depth.FULL:
        sections += [_measured_section(first.reference), *_other_cases(first, references[1:])]
    elif len(references) > 1:
        named = tuple(f"{r.name}: {r.statement}" for r in references[1:])
        sections.append(PageSection("Its other cases", (Listed(named),)))
    solved = first.solution.status.ok
    return Page(
        subject.name, subject.kind.singular, subject.line or first.reference.name, first.answer, first.known,
        first.mark, (*sections, source_section(subject)), _sketch(first),
        first.solution.value if solved else None, first.solution.error.value if solved else None,
        time.process_time() - began,
    )  # fmt: skip


def _other_cases(first: Case, references: Sequence[Reference]) -> list[PageSection]:
    """All cases in one table, and each of the others by itself."""
    if not references:
        return []
    others = [_looked_at(reference) for reference in references]
    sections = [PageSection("Its other cases", (_cases_table([first, *others]),))]
    for case in others:
        sections.append(PageSection(case.reference.name, (Paragraph(case.reference.statement),), level=3))
        sections += _case_sections(case, level=4)
    return sections


def _looked_at(reference: Reference) -> Case:
    """A case by every route, verified and certified as far as that goes."""
    comparison = compare(reference.problem, None, reference.exact, inapplicable=reference.inapplicable)
    solution = comparison.rows[-1].solution
    if solution is None or not solution.status.ok:
        return Case(reference, comparison, None, None, "there is no answer to certify")
    check = verify(solution)
    try:
        from varcalc.certificates import certify

        return Case(reference, comparison, check, certify(solution), "")
    except (VariationalError, ImportError) as reason:
        return Case(reference, comparison, check, None, str(reason).rstrip("."))


def _case_sections(case: Case, level: int) -> list[PageSection]:
    question = PageSection("The question", (Facts(tuple(asked_of_problem(case.reference.problem))),), level)
    if not case.solution.status.ok:
        diagnosis = diagnose(case.reference.problem)
        return [question, diagnosis_section(diagnosis, level), routes_section(case.comparison, level)]
    parts: list[Part] = [Facts(tuple(answered(case.solution, case.certificate, case.comparison)))]
    drawn = _curves(case)
    if drawn is not None:
        parts.append(Pictures((drawn,)))
    more = () if case.reference.exact is not None else ("no closed form was given to hold the answer against",)
    return [
        question,
        PageSection("The answer", tuple(parts), level),
        routes_section(case.comparison, level),
        *([] if case.check is None else [verdict_section(case.check, level)]),
        certificate_section(case.certificate, case.unproved, level),
        unseen_section(case.solution, case.check, case.certificate, more, level),
    ]


def _curves(case: Case) -> Picture | None:
    """The curves of all routes, and how far each lies from the closed form or from the surest."""
    try:
        figure = comparison_picture(
            case.comparison, title=case.reference.name, downward=case.reference.downward, legend_beneath=True
        )
    except ValueError:  # no route and no closed form gives a curve; the table says why
        return None
    exact = case.comparison.exact
    known = exact is not None and exact.y is not None
    measure = "the closed form" if known else "the route that claims the least error"
    count = sum(row.ok for row in case.comparison.rows)
    alt = (
        f"Above, the curves of the {count} routes that answered, over each other; below, how far they lie from "
        f"{measure}, on a logarithmic scale."
    )
    return picture(
        figure,
        alt,
        f"{case.reference.name}: the curves, and their distances from {measure}",
        height=CURVES_HEIGHT + 1.4 * (len(figure.axes) - 2),
    )


def _cases_table(cases: Sequence[Case]) -> Table:
    columns = (
        ("case", False), ("what it is", False), ("value", True), ("claimed", True), ("verdict", False),
        ("digits proved", True), ("routes", False),
    )  # fmt: skip
    rows = [
        (
            Cell(case.reference.name), Cell(case.reference.statement.partition("\n")[0]),
            number_cell(case.solution.value, ".12g", shown=case.solution.status.ok),
            number_cell(case.solution.error.value, ".1e", shown=case.solution.status.ok),
            Cell(case.check.verdict.value if case.check else case.solution.status.words),
            number_cell(case.certificate.digits if case.certificate else None, "d"),
            Cell("agree" if case.comparison.agree else "disagree"),
        )
        for case in cases
    ]  # fmt: skip
    return table("All cases of this problem", columns, rows)


def _sketch(case: Case) -> str:
    """The answer's curve as a small drawing."""
    solution = case.solution
    if solution.curve is None:
        return ""
    at = np.linspace(*solution.interval, DRAWN)
    y = solution.curve(at, 0)
    if isinstance(solution.problem, Curve):
        return sketch([y[[0, -1]]], equal=True, downward=case.reference.downward)
    return sketch([np.stack([at, row]) for row in y], downward=case.reference.downward)


def _measured_section(reference: Reference) -> PageSection:
    """How the error falls as each option turns, what answers cost, and what claims are worth."""
    heading = "Speed against accuracy"
    if reference.exact is None:
        return PageSection(
            heading, (Paragraph("Not measured: without a closed form the errors of coarse answers are unknown."),)
        )
    records, left_out = _measured(reference)
    title = reference.name
    drawings = (
        (
            convergence_picture,
            "Error over the number of unknowns, a line for each option that is turned",
            "Convergence",
        ),
        (cold_picture, "Error over the time to build and solve, a point for each tolerance", "Cost"),
        (claims_picture, "Claimed over delivered errors; the shaded corner is where claims are too small", "Claims"),
    )
    pictures = []
    for draw, alt, caption in drawings:
        drawn = [r for r in records if r.knob == Knob.TOLERANCE] if draw is cold_picture else records
        try:
            figure = draw(drawn, title=caption)
            pictures.append(picture(figure, f"{alt}.", f"{title}: {alt[0].lower()}{alt[1:]}", height=5.0))
        except ValueError:  # nothing of the kind was measured, which the table shows
            continue
    parts: list[Part] = [Pictures(tuple(pictures)), Folded("Every measurement", (_records_table(records),))]
    if left_out:
        parts.append(Paragraph(f"Not measured, for want of time: {'; '.join(left_out)}."))
    return PageSection(heading, tuple(parts))


def _measured(reference: Reference) -> tuple[list[Record], list[str]]:
    """The records that come about in a page's time, and the names of those that did not."""
    began, records, left_out = time.process_time(), list[Record](), list[str]()
    methods = [*methods_for(reference.problem), *(peer.method for peer in peers())]
    for method in methods:
        if time.process_time() - began > TOLERANCE_SHARE * MEASURED:
            left_out.append(f"{'the ladder' if method is None else type(method).__name__} at the tolerances")
            continue
        records += work_precision([reference], [method], TOLERANCES, repeats=1, seconds=BRIEFLY).records
    dials = [(route, dial) for route in routes(reference.problem) for dial in route.dials]
    for number, (route, dial) in enumerate(dials):
        left = MEASURED - (time.process_time() - began)
        share = TIME_SHARE * left / (len(dials) - number)
        one = replace(route, dials=(dial,))
        # no picture of a page shows what a solve from the last curve takes at each setting
        found = convergence(reference, one, repeats=1, within=share, warm=False).records if left > 0 else ()
        records += found
        if len(found) < len(dial.settings):
            left_out.append(f"{route.name}, {dial.name}{', the finer settings' if found else ''}")
    return [*records, *naively(reference).records], left_out


def _records_table(records: Sequence[Record]) -> Table:
    columns = (
        ("method", False), ("setting", False), ("status", False), ("error", True), ("claimed", True),
        ("build ms", True), ("solve ms", True), ("re-solve ms", True), ("unknowns", True),
    )  # fmt: skip
    rows = [
        (
            Cell(r.method), Cell(r.turned), Cell(r.status),
            Cell("") if r.value_error is None else Cell(f"{r.value_error:+.1e}", abs(r.value_error)),
            number_cell(r.claimed_error, ".1e"), number_cell(r.build_ms, ".2f"), number_cell(r.solve_ms, ".2f"),
            number_cell(r.resolve_ms, ".2f"), number_cell(r.unknowns, "d"),
        )
        for r in records
    ]  # fmt: skip
    return table("Absolute errors of the value, milliseconds of processor time", columns, rows)
