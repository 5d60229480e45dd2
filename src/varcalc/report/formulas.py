r"""Formulas: MathML, which browsers typeset by themselves and screen readers speak, from LaTeX.

The converter is latex2mathml; nothing is fetched when a page is read.
"""

from __future__ import annotations

import re
from functools import lru_cache

DERIVATIVE = re.compile(r"((?:\\mathrm\{[^{}]*\}|\\[A-Za-z]+|[A-Za-z])(?:_\{[^{}]*\}|_\w)?)('{1,4})")
"""A symbol, its index and its primes."""
PRIMES = " ′″‴⁗"
LOW_BRACKETS = re.compile(r"\\left\(((?:[^(){}\\^_]|\\(?!left|right|frac|sqrt|int)[A-Za-z]+)*)\\right\)")
"""Parentheses around what is as high as a line: they need not grow."""
AFTER_FACTOR = re.compile(r"(?<=[\w})] )\\(?=(?:arc)?(?:sin|cos|tan)h?\b|ln\b|exp\b|operatorname\b)")
"""Where a function follows a factor."""
SIGN = re.compile(r"(<mo[^>]*>(?:\(|=|&#x00028;|&#x0003D;|,|&#x0002C;)</mo>)<mo>(-|−|&#x02212;|&#x0002D;)</mo>")
"""A minus that is a sign."""


@lru_cache(maxsize=1024)
def mathml(latex: str, *, display: bool = True) -> str:
    r"""A formula as a ``<math>`` element, on a line of its own or within one.

    A prime stands beside its symbol at full size: as a superscript it is too small to be seen in fonts that are not
    made for mathematics.

    >>> mathml("y'^{2}", display=False).partition("<msup>")[2]
    '<mrow><mi>y</mi><mi>′</mi></mrow><mrow><mn>2</mn></mrow></msup></mrow></math>'
    """
    from latex2mathml.converter import convert

    latex = DERIVATIVE.sub(lambda found: rf"{{{found[1]} {PRIMES[len(found[2])]}}}", latex)
    latex = AFTER_FACTOR.sub(r"\\, \\", LOW_BRACKETS.sub(r"(\1)", latex))
    found = convert(latex, display="block" if display else "inline")
    return SIGN.sub(r'\1<mo form="prefix">\2</mo>', found)
