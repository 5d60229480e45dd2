"""Figures as SVG within a page, whose colours follow the reader's theme, light or dark.

matplotlib writes colours as numbers: they are made variables of the page's style afterwards, each dark one with the
contrast that it has in the light.
"""

from __future__ import annotations

import base64
import colorsys
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.image import imread

LIGHT, DARK = "#ffffff", "#14171c"
"""The grounds of the two themes."""
INK_IN_THE_DARK = "#e8eaed"
READABLE, VISIBLE = 4.5, 3.0
"""The least contrasts of words and of lines with their ground (Web Content Accessibility Guidelines 2.2)."""
GREY = 0.08
"""Saturation below which a colour is a shade of grey, which is ink or grid."""
STEP = 0.04
DOTS = 130
"""To an inch, of what is drawn as an image within a picture."""
COLOUR = re.compile(r"(fill|stroke): (#[0-9a-f]{6})")
IMAGE = re.compile(r'<image\b[^>]*?href="data:image/png;base64,([^"]+)"')


@dataclass(frozen=True)
class ThemedSvg:
    """An ``<svg>`` element without a size of its own; ``colours`` are its variables: name, light and dark value."""

    svg: str
    colours: tuple[tuple[str, str, str], ...]


def themed_svg(figure: Figure, name: str) -> ThemedSvg:
    """A figure as SVG for a page: words as words, colours as variables; ``name`` is its own within the page."""
    out = io.StringIO()
    figure.set_dpi(DOTS)
    # words that stay words can be searched and spoken; the salt keeps what is named in one picture from another's;
    # savefig would draw everything twice, to find out what it covers
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None, "Creator": None})
    return _themed(_bare(out.getvalue()))


def _bare(document: str) -> str:
    """The ``<svg>`` element alone, without what describes the file, and without names that nothing refers to."""
    svg = document[document.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg)
    svg = re.sub(r"\*\{[^}]*\}", "", svg)  # a rule for all of the page, of no use within it
    svg = re.sub(r'<defs>\s*<style type="text/css"></style>\s*</defs>', "", svg)
    svg = IMAGE.sub(_shade, svg)
    return re.sub(r"\n\s*", "\n", svg)


def _shade(found: re.Match[str]) -> str:
    """An image of greys alone is told from one of colours: it is turned to its negative in the dark."""
    pixels = imread(io.BytesIO(base64.b64decode(found[1])), format="png")[..., :3]
    greys = np.ptp(pixels, axis=-1).max() < GREY
    return found[0].replace("<image", '<image class="greys"', 1) if greys else found[0]


def _themed(svg: str) -> ThemedSvg:
    """The SVG with variables in the place of its colours, and their values in the light and in the dark."""
    used: dict[str, tuple[str, str, str]] = {}

    def variable(colour: str, words: bool) -> str:
        """A reference to the variable of a colour, noted on its first use; ``words`` are to be readable in it."""
        name = f"--{'w' if words else 'c'}{colour[1:]}"
        if name not in used:
            least, dark = (READABLE, READABLE) if words else (1.0, VISIBLE)
            used[name] = (name, readable(colour, LIGHT, least), in_the_dark(colour, dark))
        return f"var({name})"

    def element(found: re.Match[str]) -> str:
        words = found[0].startswith(("<text", "<tspan", "<g"))  # a group has a colour where it holds a formula
        return COLOUR.sub(lambda c: f"{c[1]}: {variable(c[2], words)}", found[0])

    themed = re.sub(r"<[a-z]+ [^>]*>", element, svg)
    ink = variable("#000000", True)
    return ThemedSvg(
        themed.replace("<svg ", f'<svg style="fill: {ink}" ', 1), tuple(used[name] for name in sorted(used))
    )


def contrast(one: str, other: str) -> float:
    """The ratio of luminances of two colours, from 1 to 21 (Web Content Accessibility Guidelines 2.2)."""
    high, low = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def readable(colour: str, ground: str, least: float) -> str:
    """The colour, moved away from the ground's lightness until it has the ``least`` contrast with it."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*_rgb(colour))
    away = STEP if _luminance(ground) < 0.5 else -STEP
    while contrast(colour, ground) < least and 0.0 < lightness < 1.0:
        lightness = min(max(lightness + away, 0.0), 1.0)
        colour = _hex(colorsys.hls_to_rgb(hue, lightness, saturation))
    return colour


def in_the_dark(colour: str, least: float) -> str:
    """What a colour is on the dark ground: greys run from the ground to light ink, others are lightened."""
    rgb = np.array(_rgb(colour))
    if np.ptp(rgb) < GREY:
        ground, ink = np.array(_rgb(DARK)), np.array(_rgb(INK_IN_THE_DARK))
        return _hex(tuple(ground + (1.0 - rgb.mean()) * (ink - ground)))
    return readable(colour, DARK, least)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _hex(rgb: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255 * min(max(float(part), 0.0), 1.0)):02x}" for part in rgb)


def _luminance(colour: str) -> float:
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in _rgb(colour)]
    return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))
