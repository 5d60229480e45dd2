"""The soap film between two coaxial rings: the surface of revolution of least area.

    A/(2 pi) = integral of y sqrt(1 + y'^2) dx

is stationary on catenaries y = c cosh((x - b)/c). Between equal rings of
radius 1 at +-a there are two for a < 0.6627..., one stable, the one given
here; they merge there, and beyond is none. From a > 0.5277... on the two discs
(Goldschmidt's solution, A = 2 pi) have less area, and the film is a local
minimum only. The same functional is the optical length in a medium of index y.

Source: Gelfand and Fomin, "Calculus of Variations", sect. 4, example 2;
Bliss, "Calculus of Variations" (1925), ch. IV.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

import varcalc as vc
from varcalc.problems._curves import Catenary


def area(x, y, dy):
    return y * ca.sqrt(1 + dy**2)


def film(start: tuple[float, float], end: tuple[float, float], case: str, statement: str) -> vc.Reference:

    def form(number: Callable[[float], Any]) -> tuple[Any, Any]:
        (x0, y0), (x1, y1) = (map(number, point) for point in (start, end))
        catenary = Catenary.over_axis((x0, y0), (x1, y1))
        return catenary.moment_about_axis, catenary.above_axis

    return vc.Reference(
        name="soap_film" + case,
        problem=vc.Problem(area, vc.Fixed(*start), vc.Fixed(*end), name="soap_film"),
        exact=vc.Exact.of(form, "catenary"),
        source='Gelfand and Fomin, "Calculus of Variations", sect. 4',
        statement=statement,
    )


references = (
    film((-0.5, 1), (0.5, 1), "", "A soap film between equal rings, one radius apart."),
    film((0, 1), (0.8, 1.5), "/unequal", "A soap film between rings of different radius."),
    film((-0.6, 1), (0.6, 1), "/local", "A soap film that is a local minimum: two discs have less area."),
    film((-0.6627, 1), (0.6627, 1), "/fold", "A soap film that is about to burst: near the fold of both catenaries."),
)
