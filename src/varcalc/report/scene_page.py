"""The page of a scene: its rays, every ray to its receiver, and how far each is known."""

from __future__ import annotations

import time
from collections import Counter

import numpy as np

from varcalc.axes import Axis, measured, unit_of_length
from varcalc.charts import range_picture, rays_picture
from varcalc.optics.rays.ray import Rays
from varcalc.optics.rays.sources import PointSource
from varcalc.optics.results.range_chart import range_chart
from varcalc.optics.results.study import FLAT_SIDES, Seen, Study
from varcalc.report.evidence import WELL, errors_table
from varcalc.report.page import (
    Cell,
    Facts,
    Listed,
    Mark,
    Page,
    PageSection,
    Paragraph,
    Part,
    Pictures,
    number_cell,
    table,
)
from varcalc.report.pictures import picture, sketch
from varcalc.report.question import asked_of_scene
from varcalc.report.subjects import Subject
from varcalc.report.words import about_sections, capital, source_section
from varcalc.showing import Fact, counted
from varcalc.study.scenes import load_study

SKETCHED = 15
"""Rays of a sketch, at the most."""


def scene_page(subject: Subject) -> Page:
    """What is seen of a scene.

    Raises :class:`varcalc.study.user_file.ProblemFileError` for a file that cannot be used, ValueError for a study
    that cannot be carried out.
    """
    began = time.process_time()
    study = load_study(subject.given)
    seen = study.run()
    arrivals = seen.arrivals
    answer = _ended(seen) if arrivals is None else _arrived(arrivals, study)
    sections = [
        *about_sections(subject),
        PageSection("The question", (Facts(tuple(asked_of_scene(study))),)),
        PageSection("The answer", (Facts(tuple(_answered(seen, answer))), *_pictures(seen))),
        *([] if arrivals is None else [_arrivals_section(arrivals)]),
        *([PageSection("How well it is known", (errors_table(seen.errors),))] if seen.errors else []),
        _unseen_section(seen),
        source_section(subject),
    ]
    errors = [ray.error for ray in arrivals or ()]
    known = (
        f"optical paths known to {max(errors):.1g}" if errors else "no receiver is named, so no optical path is told"
    )
    first = arrivals[0].optical_path if arrivals else None
    stands = max(seen.errors.values(), default=0.0) < WELL
    mark = Mark.BAD if not (seen.tracks or arrivals) else Mark.GOOD if stands else Mark.DOUBTFUL
    return Page(
        subject.name, subject.kind.singular, study.title or subject.line, answer, known, mark, tuple(sections),
        _sketch(seen),
        first, max(errors) if errors else None, time.process_time() - began,
    )  # fmt: skip


def _sketch(seen: Seen) -> str:
    chosen = seen.tracks[:: max(1, len(seen.tracks) // SKETCHED)]
    lines = [track.points[:, [0, -1]].T for track in chosen]
    extent = np.ptp(np.concatenate(lines, axis=1), axis=1) if lines else np.ones(2)
    return sketch(lines, equal=bool(FLAT_SIDES <= extent[1] / extent[0] <= 1 / FLAT_SIDES), alike=True)


def _ended(seen: Seen) -> str:
    """How the rays of the source ended."""
    counts = Counter(track.status.name.lower().replace("_", " ") for track in seen.tracks)
    ended = ", ".join(f"{count} {status}" for status, count in counts.items())
    path = measured(f"{seen.study.optical_path:g}", seen.unit)
    return f"{counted(len(seen.tracks), 'ray')} up to an optical path of {path}: {ended or 'none followed'}"


def _arrived(arrivals: Rays, study: Study) -> str:
    where = "(" + ", ".join(f"{x:g}" for x in study.receiver or ()) + ")"
    if not len(arrivals):
        return f"no ray to {where}: {arrivals.reason}"
    return f"{len(arrivals)} ray{'s' * (len(arrivals) > 1)} to {where}"


def _answered(seen: Seen, answer: str) -> list[Fact]:
    facts = [Fact("Rays", capital(answer))]
    if seen.arrivals is not None:
        facts.append(Fact("From the source", capital(_ended(seen))))
    if len(seen.caustic):
        facts.append(Fact("Caustic", f"{len(seen.caustic)} conjugate points on the rays"))
    return facts


def _pictures(seen: Seen) -> list[Part]:
    study = seen.study
    try:
        figure = rays_picture(seen)
    except ValueError as reason:
        return [Paragraph(f"No picture: {reason}.")]
    alt = "The rays over the index of their medium, with wavefronts, conjugate points and the rays to the receiver."
    drawn = [picture(figure, alt, f"{study.title}: the rays")]
    if study.receiver is not None and isinstance(study.source, PointSource) and study.source.dimension == 2:
        try:
            chart = range_chart(study.scene, study.source.point, study.receiver, within=study.within)
        except ValueError:  # a receiver that rays do not cross at a height of its own; the rays to it are listed
            return [Pictures(tuple(drawn))]
        reach = "Where rays cross the receiver's height, over the angle at which they leave; each arrival is marked."
        drawn.append(picture(range_picture(chart), reach, f"{study.title}: the range of rays", height=4.2))
    return [Pictures(tuple(drawn))]


def _arrivals_section(arrivals: Rays) -> PageSection:
    path = Axis("optical path", unit_of_length(arrivals.axes))
    columns = (
        (str(path), True), ("error", True), ("caustics passed", True), ("spreading", True), ("model", False),
        ("direction", False),
    )  # fmt: skip
    rows = [
        (
            number_cell(ray.optical_path, ".14g"), number_cell(ray.error, ".1e"), number_cell(ray.index, "d"),
            number_cell(ray.spreading, ".6g"), Cell(str(ray.model)),
            Cell("(" + ", ".join(f"{x:.6f}" for x in ray.tangents[0]) + ")"),
        )
        for ray in arrivals
    ]  # fmt: skip
    if not rows:
        return PageSection("Every ray to the receiver", (Paragraph(f"None: {arrivals.reason}."),))
    return PageSection("Every ray to the receiver", (table("Shortest optical path first", columns, rows),))


def _unseen_section(seen: Seen) -> PageSection:
    path = measured(f"{seen.study.optical_path:g}", seen.unit)
    found = [f"rays beyond an optical path of {path}", "directions between those that were traced"]
    if seen.arrivals is None:
        found.append("rays to a receiver: the study names none")
    searched = "" if seen.arrivals is None else f"Searched: {seen.arrivals.searched}."
    return PageSection(
        "What was not looked at", (*([Paragraph(searched)] if searched else []), Listed(tuple(map(capital, found))))
    )
