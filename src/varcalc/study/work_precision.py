"""Speed against accuracy: what methods cost on problems and what they deliver, at tolerances and as options turn."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from varcalc.methods.labels import checked_method, label
from varcalc.problem.conditions import finite, positive, sequence, whole
from varcalc.problem.problem import Curve, Problem
from varcalc.progress import Interrupted, Progress, telling
from varcalc.solution import Solution
from varcalc.solve.ladder import solve
from varcalc.spelling import spelled
from varcalc.study import naive
from varcalc.study.compare import cold
from varcalc.study.records import MAXIMUM, MINIMUM, Record, WorkPrecision, about
from varcalc.study.reference import Exact, Reference, as_exact
from varcalc.study.routes import Knob, Route
from varcalc.tables import known

LINE_TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 15))
"""The settings of a line: one point each."""
ENOUGH_SECONDS = 1.0
"""Seconds of one solve's repeats after which there are no more: a slow solve is measured well enough by few."""
BRIEFLY = 0.02
"""The same along a curve, which has many points."""
ANY = 1.0
"""The tolerance of a solve whose error is not held to any."""
MOVED = 1e-3
"""Relative change of a parameter between two warm solves."""
CURVE_PLACES = 201
"""Places at which a curve is held against the exact one."""


@spelled
def work_precision(
    problems: Iterable[Reference | Problem | Curve],
    methods: Iterable[Any],
    tolerances: Iterable[float] = LINE_TOLERANCES,
    *,
    exact: Sequence[Exact | float | None] | None = None,
    repeats: int = 5,
    seconds: float = ENOUGH_SECONDS,
    progress: Progress = None,
) -> WorkPrecision:
    """Measure what each of ``methods`` costs on each of ``problems`` at each of ``tolerances``, and what it delivers.

    ``problems`` are References, which bring their closed form, or Problems and
    Curves, with the closed forms in ``exact``, one each. Without one there are
    times and claims, but no error that was delivered: that is never guessed
    from another run, and the pictures say so instead of being drawn.
    ``methods`` are method objects, None for the ladder. Every time is the
    median of ``repeats`` solves, fewer once they took ``seconds``; a first one of
    each method is not counted. A cold solve begins from a problem of which nothing is
    built. A method that finds no answer has a record with its status. ``progress`` is as
    :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which holds the records of the
    lines that are finished.

    Raises TypeError for what is no problem or no method, ValueError when there
    are none, and whatever :func:`varcalc.solve` raises for bad arguments.

    >>> import varcalc as vc
    >>> line = vc.Problem(lambda x, y, dy: (1 + dy**2) ** 0.5, vc.Fixed(0, 0), vc.Fixed(3, 4), name="line")
    >>> measured = work_precision([line], [vc.Ritz()], [1e-6], exact=[5.0], repeats=1)
    >>> [(r.problem, r.method, r.status, abs(r.value_error) < 1e-12) for r in measured.records]
    [('line', 'Ritz', 'solved', True)]
    """
    references = _references(sequence("problems", problems), exact)
    routes = [checked_method(i, method) for i, method in enumerate(sequence("methods", methods))]
    settings = [finite(f"tolerances[{i}]", tol) for i, tol in enumerate(sequence("tolerances", tolerances))]
    for name, given in (("problems", references), ("methods", routes), ("tolerances", settings)):
        if not given:
            raise ValueError(f"{name} is empty; give at least one")
    whole("repeats", repeats)
    positive("seconds", seconds)
    records: list[Record] = []
    lines = [(reference, method) for reference in references for method in routes]
    with telling(progress, "work and precision") as told:
        try:
            for reference, method in told.over(lines, lambda line: line[0].name):
                name = "ladder" if method is None else label(method)
                points = [Record(reference.name, name, tol, "", curve="tolerance") for tol in settings]
                records += _line(reference, points, lambda point, m=method: (m, point.setting), repeats, seconds)
        except KeyboardInterrupt as stop:
            raise Interrupted(WorkPrecision(tuple(records), about())) from stop
    return WorkPrecision(tuple(records), about())


def convergence(
    reference: Reference, route: Route, *, repeats: int = 3, seconds: float = BRIEFLY, within: float = math.inf,
    warm: bool = True,
) -> WorkPrecision:  # fmt: skip
    """Measure what a route costs and delivers as each of its options turns from coarse to fine.

    The records are those of :func:`work_precision`, one for each setting of each :class:`Dial`. The errors are not
    held to a tolerance, so that coarse settings have theirs. Solves from the last curve, which cost twice as much as
    the first, are left out unless ``warm``. Once a dial took ``within`` seconds of processor time its finer settings
    are left out.
    """
    records: list[Record] = []
    for dial in route.dials:
        point = Record(reference.name, label(dial.method), 0.0, "", knob=dial.knob, curve=dial.name, route=route.name)
        points = [replace(point, setting=setting) for setting in dial.settings]
        records += _line(
            reference, points, lambda point, d=dial: (d.turned(point.setting), ANY), repeats, seconds, within,
            warm=warm,
        )  # fmt: skip
    return WorkPrecision(tuple(records), about())


def naively(reference: Reference) -> WorkPrecision:
    """The same for the midpoint rule of :mod:`varcalc.study.naive`; no records where it teaches nothing."""
    exact = reference.exact
    if exact is None or not naive.applies(reference.problem):
        return WorkPrecision((), about())
    return WorkPrecision(tuple(_naive_record(reference, exact, pieces) for pieces in naive.PIECES), about())


def _naive_record(reference: Reference, exact: Exact, pieces: int) -> Record:
    rule = naive.MidpointRule(reference.problem, pieces)
    first = rule.minimised()
    again = rule.minimised(first.ordinates)
    error, reason = (first.value - exact.value, "") if first.success else (None, "IPOPT claims no success")
    return Record(
        reference.name, naive.NAIVE_NAME, 1 / pieces, "solved" if first.success else "not converged", 1e3 * first.build,
        1e3 * first.solve, 1e3 * again.solve, first.ordinates.size - 2 * len(first.ordinates), first.iterations, error,
        size=max(1.0, abs(exact.value)), reason=reason, knob=Knob.ELEMENT, curve="h, degree 1",
    )  # fmt: skip


def _references(
    problems: Iterable[Reference | Problem | Curve], exact: Sequence[Exact | float | None] | None
) -> list[Reference]:
    given = list(problems)
    forms = [None] * len(given) if exact is None else [as_exact(e) for e in sequence("exact", exact)]
    if len(forms) != len(given):
        raise ValueError(f"exact must have one entry a problem, {len(given)} of them, not {len(forms)}")
    found = []
    for i, (problem, form) in enumerate(zip(given, forms, strict=True)):
        if isinstance(problem, Reference):
            found.append(problem)
        elif isinstance(problem, Problem | Curve):
            found.append(Reference(problem.name, problem, form))
        else:
            raise TypeError(f"problems[{i}] must be a Reference, a Problem or a Curve, not {problem!r}")
    return found


def _line(
    reference: Reference,
    points: Sequence[Record],
    asked: Callable[[Record], tuple[Any, float]],
    repeats: int,
    seconds: float,
    within: float = math.inf,
    *,
    warm: bool = True,
) -> list[Record]:
    """The measured records of one method: ``asked`` gives method and tolerance of each of ``points``.

    One solve at the last of them is not counted: it loads plug-ins and fills tables. Once the points took ``within``
    seconds the rest are left out.
    """
    points = [replace(point, sought=MAXIMUM if reference.problem.maximise else MINIMUM) for point in points]
    reason = reference.inapplicable.get(type(asked(points[-1])[0]))
    if reason is not None:
        return [replace(point, status="not applicable", reason=reason) for point in points]
    method, tol = asked(points[-1])
    solve(cold(reference.problem), method, tol=tol, throw=False)
    began, found = time.process_time(), list[Record]()
    for point in points:
        if time.process_time() - began > within:
            break
        found.append(_measured(reference, point, *asked(point), repeats, seconds, warm=warm))
    return found


def _measured(
    reference: Reference, point: Record, method: Any, tol: float, repeats: int, seconds: float, *, warm: bool
) -> Record:
    answer = partial(solve, method=method, tol=tol, throw=False)
    solution, calls = _timed(lambda _: answer(cold(reference.problem)), repeats, seconds)
    spent = 1e3 * statistics.median(spent for spent, _ in calls)
    build = spent * statistics.median(_share_of_building(found) for _, found in calls)
    record = replace(
        point, status=solution.status.words, build_ms=build, solve_ms=spent - build,
        unknowns=solution.stats.unknowns or None, iterations=solution.stats.iterations,
    )  # fmt: skip
    if not solution.status.ok:
        return replace(record, reason=solution.message or solution.status.value)
    resolve_ms = _warm(solution, answer, repeats, seconds) if warm else None
    return replace(record, resolve_ms=resolve_ms, **_delivered(reference, solution))


def _share_of_building(solution: Solution) -> float:
    """What part of its time a solve spent on building its functions, as the method says."""
    stats = solution.stats
    return stats.build / (stats.build + stats.solve) if stats.build > 0 else 0.0


def _timed(call: Any, repeats: int, enough: float) -> tuple[Solution, list[tuple[float, Solution]]]:
    """The last answer of ``call(number)``, and the seconds and answer of each, up to ``repeats`` of them."""
    calls: list[tuple[float, Solution]] = []
    while len(calls) < repeats and sum(seconds for seconds, _ in calls) < enough:
        began = time.process_time()
        found = call(len(calls))
        calls.append((time.process_time() - began, found))
    return calls[-1][1], calls


def _warm(solution: Solution, answer: Any, repeats: int, seconds: float) -> float | None:
    """Milliseconds of a solve with everything built from the last curve; None where one finds no answer."""
    problem, last = solution.problem, solution
    first = next(iter(problem.parameters.items()), None)
    try:
        variants = [problem.with_parameters({first[0]: first[1] * (1 + m)} if first else {}) for m in (0.0, MOVED)]
    except ValueError:  # the ends hold at these values only
        variants = [problem, problem]

    def again(number: int) -> Solution:
        """Solve again, with the parameter a little off and back, from the last answer."""
        nonlocal last
        last = answer(variants[number % 2], guess=last) if last.status.ok else last
        return last

    again(1)  # builds what a moved parameter needs, and is not counted

    _, calls = _timed(again, repeats, seconds)
    return 1e3 * statistics.median(spent for spent, _ in calls) if last.status.ok else None


def _delivered(reference: Reference, solution: Solution) -> dict[str, Any]:
    """The errors of an answer: those it claims and those it has."""
    exact = reference.exact
    found: dict[str, Any] = {"claimed_error": known(solution.error.value)}
    if exact is None:
        return found | {"size": max(1.0, abs(solution.value))}
    value_error, curve_error = solution.value - exact.value, _curve_error(reference.problem, solution, exact)
    return found | {"value_error": value_error, "curve_error": curve_error, "size": max(1.0, abs(exact.value))}


def _curve_error(problem: Problem | Curve, solution: Solution, exact: Exact) -> float | None:
    """The largest distance from the exact curve; None where it is not known, or may begin at any of its points."""
    if exact.y is None or problem.start.periodic:
        return None
    first, last = solution.interval
    # clustered at the ends, where curves may be steep
    at = first + (last - first) * (0.5 - 0.5 * np.cos(np.linspace(0, math.pi, CURVE_PLACES)))
    shape = (problem.n, len(at))
    wanted = np.broadcast_to(np.asarray(exact.y(at), dtype=float), shape)
    return known(float(np.linalg.norm(np.asarray(solution.y(at)).reshape(shape) - wanted, axis=0).max()))
