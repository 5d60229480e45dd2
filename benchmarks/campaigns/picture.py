"""The stability chart: shares of the outcomes of each method, parameter by parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from campaigns.families import Family
from campaigns.records import Record
from campaigns.truth import Outcome

COLOURS = {
    Outcome.RIGHT: "#0072b2",
    Outcome.OTHER: "#56b4e9",
    Outcome.REFUSED: "#cfd8dc",
    Outcome.MISREASONED: "#8d6e63",
    Outcome.MISSED: "#f0c419",
    Outcome.SLOW: "#cc79a7",
    Outcome.INAPPLICABLE: "#ffffff",
    Outcome.FALSE: "#d00000",
}
"""After Okabe and Ito: answers blue, refusals grey, shortcomings warm, and red for what must not be."""
INK = "0.20"
ROW, GAP = 0.82, 0.18
"""Height of a method's row and of what parts it from the next."""
WIDTH = 0.94
"""Of a bar, in units of the distance of two parameters."""


def stability_picture(
    families: Mapping[str, Family], routes: Sequence[str], records: Sequence[Record], pairs: Sequence[Record]
) -> Figure:
    """One panel a family: parameters across, a row for each method, the shares of its outcomes stacked."""
    figure = Figure(figsize=(10.4, 11.2), layout="constrained")
    panels = figure.subplots(3, 2).ravel()
    for panel, (name, family) in zip(panels, families.items(), strict=False):
        mine = [record for record in records if record.family == name]
        cells = {(str(i), route): [] for i in range(len(family.grid)) for route in routes}
        for record in mine:
            cells[record.case, record.route].append(record.outcome)
        _rows(panel, [str(i) for i in range(len(family.grid))], family.labels, routes, cells)
        panel.set_title(family.title, fontsize=10, color=INK, loc="left")
    tried = {record.route for record in pairs}
    _random(panels[-1], [route for route in routes if route in tried], pairs)
    _legend(figure, [*records, *pairs])
    return figure


def adversarial_picture(titles: Mapping[str, str], routes: Sequence[str], records: Sequence[Record]) -> Figure:
    """One column a family, named by its title, a row for each route, the shares of its outcomes stacked."""
    figure = Figure(figsize=(10.4, 6.2), layout="constrained")
    panel = figure.subplots()
    cells = {(family, route): [] for family in titles for route in routes}
    for record in records:
        if (record.family, record.route) in cells:
            cells[record.family, record.route].append(record.outcome)
    _rows(panel, list(titles), list(titles.values()), routes, cells)
    count = len({(record.family, record.case) for record in records})
    panel.set_title(f"{count} problems made to mislead, and {len(records)} solves", fontsize=10, color=INK, loc="left")
    _legend(figure, records)
    return figure


def _legend(figure: Figure, records: Sequence[Record]) -> None:
    """The colours of what the records hold, and red, which must not be."""
    shown = {record.outcome for record in records} | {Outcome.FALSE.name}
    handles = [Patch(fc=COLOURS[o], ec="0.6", lw=0.5, label=o.value) for o in Outcome if o.name in shown]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=10)


def _random(panel: Axes, routes: Sequence[str], pairs: Sequence[Record]) -> None:
    """The panel of random problems: one column for each kind of them."""
    kinds = list(dict.fromkeys(record.family for record in pairs))
    cells = {(kind, route): [] for kind in kinds for route in routes}
    for record in pairs:
        if (record.family, record.route) in cells:
            cells[record.family, record.route].append(record.outcome)
    _rows(panel, kinds, kinds, routes, cells)
    panel.tick_params(axis="x", rotation=0, labelsize=8)
    count = len({(record.family, record.case) for record in pairs})
    panel.set_title(f"{count} random problems, each with a random start", fontsize=10, color=INK, loc="left")


def _rows(
    panel: Axes, cases: Sequence[str], labels: Sequence[str], routes: Sequence[str],
    cells: Mapping[tuple[str, str], Sequence[str]],
) -> None:  # fmt: skip
    """A row of stacked bars for each method, as high as they were often."""
    for row, route in enumerate(routes):
        bottom = [float(len(routes) - 1 - row)] * len(cases)
        for outcome in Outcome:
            found = [cells[case, route] for case in cases]
            heights = [ROW * f.count(outcome.name) / max(1, len(f)) for f in found]
            panel.bar(range(len(cases)), heights, WIDTH, bottom=bottom, color=COLOURS[outcome], linewidth=0)
            bottom = [b + h for b, h in zip(bottom, heights, strict=True)]
    panel.set_xticks(range(len(cases)), labels, rotation=90, fontsize=7.5, color=INK)
    middles = [len(routes) - 1 - i + ROW / 2 for i in range(len(routes))]
    panel.set_yticks(middles, routes, fontsize=8, color=INK)
    panel.set_xlim(-0.55, len(cases) - 0.45)
    panel.set_ylim(-GAP, len(routes))
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
