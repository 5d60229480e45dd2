"""The names and units of axes: declared once, and written as text and as LaTeX wherever they stand."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

GREEK = re.compile(
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi|"
    "omega|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Upsilon|Phi|Psi|Omega"
)
SPECIAL = str.maketrans({sign: f"\\{sign}" for sign in "#$%&{}"} | {"\\": "/", "~": r"\sim ", "^": " ", " ": r"\ "})
"""What LaTeX takes for its own signs."""
UPRIGHT = r"\mathrm"


def latex_name(name: str) -> str:
    r"""A name in formulas: Greek letters as such, an index beneath, words upright; primes stay.

    >>> print(latex_name("theta_1''"), latex_name("x2"), latex_name("depth"))
    \theta_{1}'' x_{2} \mathrm{depth}
    """
    if place := re.fullmatch(r"(.+)\((.+)\)", name):
        return f"{latex_name(place[1])}({latex_name(place[2])})"
    base, primes = name.rstrip("'"), "'" * (len(name) - len(name.rstrip("'")))
    stem, _, index = base.partition("_")
    match = re.fullmatch(r"([A-Za-z]+)(\d+)", stem)
    if match and not index:
        stem, index = match.group(1), match.group(2)
    if GREEK.fullmatch(stem):
        stem = "\\" + stem
    elif len(stem) > 1:
        stem = f"{UPRIGHT}{{{stem.translate(SPECIAL)}}}"
    else:
        stem = stem.translate(SPECIAL)
    below = index.translate(SPECIAL).replace("_", r"\_")
    return stem + (f"_{{{below}}}" if index else "") + primes


@dataclass(frozen=True)
class Axis:
    r"""The name of a coordinate, its unit where it has one, and its name as LaTeX where that is not plain to see.

    >>> height = Axis("y", "m")
    >>> print(height, height.over(Axis("t", "s")), Axis("theta", "rad").label)
    y (m) dy/dt (m/s) $\theta$ (rad)
    """

    name: str
    unit: str = ""
    formula: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def latex(self) -> str:
        """The name as LaTeX, without the unit."""
        return self.formula or latex_name(self.name)

    @property
    def label(self) -> str:
        """What stands at the axis of a picture: Greek letters and indices as in formulas, the unit behind."""
        plain = not self.formula and not any(sign in self.latex.removeprefix(UPRIGHT) for sign in "\\_")
        name = self.name.replace("$", r"\$") if plain else f"${self.latex}$"
        unit = self.unit.replace("$", r"\$")
        return f"{name} ({unit})" if unit else name

    def at(self, places: Iterable[float], digits: int) -> str:
        """Where on the axis, in words, with so many digits.

        >>> Axis("t", "s").at([1.0, 2.5], 6)
        't = 1, 2.5 s'
        """
        return measured(f"{self.name} = " + ", ".join(f"{place:.{digits}g}" for place in places), self.unit)

    def over(self, other: Axis) -> Axis:
        """The rate of this coordinate over another."""
        unit = f"{self.unit or 1}/{other.unit}" if other.unit else self.unit
        return Axis(f"d{self.name}/d{other.name}", unit, rf"d{self.latex}/d{other.latex}")


def measured(number: str, unit: str) -> str:
    """A number with its unit, where it has one."""
    return f"{number} {unit}" if unit else number


def unit_of_length(axes: Sequence[Axis]) -> str:
    """The unit of lengths in the space of some coordinates: theirs, where all have the same; else none."""
    return axes[0].unit if len({axis.unit for axis in axes}) == 1 else ""


def declared_axes(names: Sequence[str], units: Sequence[str], default: Sequence[str]) -> tuple[Axis, ...]:
    """The axes of a problem or a scene: ``names`` for the ``default`` ones, and ``units``, each wholly or not at all.

    Raises TypeError or ValueError, naming the argument and the remedy.
    """
    for label, given in (("names", names), ("units", units)):
        if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(v, str) for v in given):
            raise TypeError(f"{label} must be texts, one for each of {', '.join(default)}, not {given!r}")
        if given and len(given) != len(default):
            raise ValueError(f"{label} must be {len(default)}, one for each of {', '.join(default)}, not {given!r}")
    if names and (not all(name.strip() for name in names) or len(set(names)) < len(names)):
        raise ValueError(f"names must differ, and none may be empty, not {names!r}")
    return tuple(map(Axis, names or default, units or [""] * len(default)))


def numbered(letter: str, n: int) -> tuple[str, ...]:
    """The names of ``n`` unknown functions: the letter where it is one, else with the numbers from 1 on beneath.

    >>> numbered("y", 1), numbered("y", 2)
    (('y',), ('y_1', 'y_2'))
    """
    return (letter,) if n == 1 else tuple(f"{letter}_{k + 1}" for k in range(n))


def coordinates(n: int) -> tuple[str, ...]:
    """The names of ``n`` coordinates of a place: x, y, z, and q with a number where there are more."""
    return ("x", "y", "z")[:n] if n <= 3 else numbered("q", n)
