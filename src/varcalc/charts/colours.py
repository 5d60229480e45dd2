"""The colour of each method, the same in every picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from matplotlib.colors import to_hex, to_rgb

from varcalc.methods.labels import label
from varcalc.study.compare import Row

LADDER_TYPE = "NoneType"

COLOURS: dict[str, tuple[str, ...]] = {
    "Ritz": ("#0072b2", "#d55e00"),
    "Collocation": ("#009e73",),
    "Shooting": ("#cc79a7",),
    "FirstIntegral": ("#e69f00",),
    "SciPyBvp": ("#56b4e9",),
    LADDER_TYPE: ("#7a5195",),
}
"""The colours of methods, the same in every picture: first as they come, then with other options.

They are the colours of Okabe and Ito, told apart by every kind of eye, and one more."""

OTHER_COLOURS = ("#882255", "#999933", "#44aa99", "#661100", "#332288", "#cc6677", "#aa4499", "#777777")
"""For methods that are not the library's, in the order in which they appear (Tol's muted scheme)."""

DARKER = 0.65
"""Factor of brightness from one variant of a colour to the next."""

EXACT_COLOUR = "0.80"

INK = "0.20"

GRID_COLOUR = "0.90"


def colours_of(rows: Sequence[Row]) -> list[str]:
    """The colour of each row: its method's own, and a variant of it for every further set of options."""
    names = [type(row.method).__name__ for row in rows]
    return _colours([(n, row.method is None or label(row.method) == n) for n, row in zip(names, rows, strict=True)])


def colours_by_label(labels: Sequence[str]) -> dict[str, str]:
    """The same for methods of which only the label is known, as in a stored file; "ladder" is the ladder's."""
    heads = [LADDER_TYPE if text == "ladder" else text.partition("(")[0] for text in labels]
    pairs = [(head, "(" not in text) for head, text in zip(heads, labels, strict=True)]
    return dict(zip(labels, _colours(pairs), strict=True))


def _colours(methods: Sequence[tuple[str, bool]]) -> list[str]:
    """The colours of methods by their names, and whether their options are the default."""
    used: set[tuple[str, int]] = set()
    strangers = dict.fromkeys(name for name, _ in methods if name not in COLOURS)
    hues = COLOURS | {s: (OTHER_COLOURS[i % len(OTHER_COLOURS)],) for i, s in enumerate(strangers)}
    colours = []
    for name, plain in methods:
        variant = next(i for i in count(0 if plain else 1) if (name, i) not in used)
        used.add((name, variant))
        known = hues[name]
        darker = DARKER ** max(0, variant - len(known) + 1)
        red, green, blue = to_rgb(known[min(variant, len(known) - 1)])
        colours.append(to_hex((darker * red, darker * green, darker * blue)))
    return colours
