"""diagnose: everything there is to say of a problem, and of one without a minimum above all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from varcalc.methods.arguments import check_arguments
from varcalc.problem.functional import Functional
from varcalc.progress import Interrupted, Progress, telling
from varcalc.showing import Fact, Shown
from varcalc.solution import Finding, Verdict
from varcalc.spelling import spelled
from varcalc.verify.verification import first_held

if TYPE_CHECKING:
    from varcalc.solve.examination import ProblemExamination


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """What can be said of a problem, with the evidence.

    ``verdict`` is the first in the order of :class:`varcalc.Verdict` of all
    that hold, None where nothing could be shown; ``findings`` has every
    statement with its numbers, and ``evidence`` what they rest on, by name: ``solution`` (what
    :func:`varcalc.solve` gave, whatever its status), ``extremals``, ``fall``
    (values along a line of curves on which the functional has no bound),
    ``polygons`` (least values on finer and finer meshes), ``relaxed`` (the
    convexified problem), ``broken`` (the best curve that jumps at its ends);
    only what was looked at is there. ``relaxed_value`` is the infimum that
    convexification in the slope shows, None where L is convex in it or the
    relaxed problem was not solved.
    """

    name: str
    verdict: Verdict | None
    findings: tuple[Finding, ...]
    evidence: Mapping[str, Any]
    relaxed_value: float | None

    def _headline(self) -> str:
        return f"{self.name}: {'nothing could be shown' if self.verdict is None else self.verdict.value}"

    def _facts(self) -> Iterator[Fact]:
        yield from (Fact("" if k else "findings", finding.sentence) for k, finding in enumerate(self.findings))
        if self.relaxed_value is not None:
            yield Fact("relaxed value", f"{self.relaxed_value:.12g}")

    def __str__(self) -> str:
        return "\n".join([self._headline(), *(f"- {finding.sentence}" for finding in self.findings)])


@spelled
def diagnose(problem: Functional, *, progress: Progress = None) -> Diagnosis:
    """Say whether a problem has a minimum (a maximum with ``maximise``), and what stands in its way.

    Looked at are: ends and levels that cannot be met, functionals without a
    bound, Lavrentiev gaps, Lagrangians that fix no curve, extremals and what
    kind each of them is, minimising sequences that concentrate or alternate
    between slopes, and curves that jump at their ends. Nothing that is not
    shown by numbers is claimed; what was searched is said. ``progress`` is as :data:`varcalc.progress.Progress` says;
    Ctrl-C raises :class:`varcalc.Interrupted`, which holds what could be said by then.

    Raises TypeError when ``problem`` is none.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.7, 1), vc.Fixed(0.7, 1))
    >>> diagnose(film).verdict
    <Verdict.NO_EXTREMAL: 'there is no extremal between these ends'>
    >>> teeth = vc.Problem(lambda x, y, dy: (1 - dy**2) ** 2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 0))
    >>> check = diagnose(teeth)
    >>> check.verdict, round(check.relaxed_value, 9)
    (<Verdict.NOT_ATTAINED: 'the infimum is not attained'>, 0.0)
    """
    check_arguments(problem, None, 1.0)
    # with every check and the search: more than most people need
    from varcalc.solve.examination import ProblemExamination

    examination = ProblemExamination(problem)
    findings: list[Finding] = []
    with telling(progress, problem.name) as told:
        try:
            for finding in examination.findings():
                findings.append(finding)
                told(len(findings), None, "statements found")
        except KeyboardInterrupt as stop:
            raise Interrupted(_diagnosis(examination, findings)) from stop
    return _diagnosis(examination, findings)


def _diagnosis(examination: ProblemExamination, findings: Sequence[Finding]) -> Diagnosis:
    """What an examination has found."""
    relaxed = examination.evidence.get("relaxed")
    value = None if relaxed is None else relaxed.value
    return Diagnosis(
        examination.problem.name, first_held(tuple(findings)), tuple(findings), examination.evidence, value
    )
