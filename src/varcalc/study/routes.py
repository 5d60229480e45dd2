"""The one list of methods: what is compared, held to the contract, offered on the command line and charted.

A package of one's own adds to it by an entry point of the group :data:`METHODS_GROUP`
that names a :class:`Route`; docs/extending.md walks through one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Any

from varcalc.extensions import offered
from varcalc.methods.labels import label
from varcalc.problem.conditions import Isoperimetric, Through
from varcalc.problem.functional import Functional

METHODS_GROUP = "varcalc.methods"
"""The group of entry points under which other packages offer a :class:`Route`."""
CHARTED_ELEMENTS = (1, 2, 3, 4, 6, 8, 16, 32, 64)
CHARTED_DEGREES = (1, 2, 3, 4, 6, 8, 12, 16)
INTEGRATOR_TOLERANCES = (1e-1, 1e-3, 1e-5, 1e-8, 1e-12)


class Knob(StrEnum):
    """What is turned along a curve of measurements."""

    TOLERANCE = "tol"
    ELEMENT = "h"
    DEGREE = "p"
    INTEGRATOR = "integrator"


@dataclass(frozen=True)
class Dial:
    """One option of a method, turned from coarse to fine.

    ``turned(setting)`` is the method at a setting: the length of an element as
    a share of the whole for ``Knob.ELEMENT``, else the degree or tolerance.
    ``method`` is what a curve is called by, the method with the option left
    out; ``name`` says in words what is turned. The errors are not held to a
    tolerance.
    """

    name: str
    knob: Knob
    method: Any
    settings: tuple[float, ...]
    turned: Callable[[float], Any]


def _always(_problem: Functional) -> bool:
    return True


@dataclass(frozen=True)
class Route:
    """A method with what has to be known to compare, to check and to chart it.

    ``direct`` is True where the value is the functional on a trial curve, which
    never lies below the minimum. ``dials`` are the options that are charted.
    ``offered`` tells whether the method is a route of its own for a problem.
    """

    method: Any
    direct: bool = False
    dials: tuple[Dial, ...] = ()
    offered: Callable[[Functional], bool] = _always

    @property
    def name(self) -> str:
        """What the method is called in tables, such as ``Ritz(optimiser=Ipopt())``."""
        return label(self.method)


def _with_elements(method: Any, length: float) -> Any:
    return replace(method, elements=round(1 / length))


def _with_degree(method: Any, degree: float) -> Any:
    return replace(method, degree=round(degree))


def mesh_dials(
    method: Any, kept_degrees: Sequence[int], elements: Sequence[int], degrees: Sequence[int]
) -> tuple[Dial, ...]:
    """Dials of a method with the options ``elements``, ``degree`` and ``refine``: meshes that are kept as they are.

    One of the length of the elements for each of ``kept_degrees``, on the given
    numbers of ``elements``, and one of the degree on one element.
    """
    kept = replace(method, refine=False)
    lengths = tuple(1 / n for n in elements)
    by_length = [
        Dial(f"h, degree {m.degree}", Knob.ELEMENT, m, lengths, partial(_with_elements, m))
        for m in (replace(kept, degree=degree) for degree in kept_degrees)
    ]
    settings = tuple(map(float, degrees))
    return (*by_length, Dial("p, one element", Knob.DEGREE, kept, settings, partial(_with_degree, kept)))


def _prescribed(problem: Functional) -> bool:
    """Whether ``Ritz()`` is not handed to IPOPT of itself: no inequalities, no pathwise conditions."""
    return all(isinstance(c, Through) or (isinstance(c, Isoperimetric) and c.equality) for c in problem.constraints)


def _own() -> tuple[Route, ...]:
    """The methods of this package. A new one is added here, and nowhere else."""
    from varcalc.integrators import available
    from varcalc.methods.collocation.method import Collocation
    from varcalc.methods.first_integral.method import FirstIntegral
    from varcalc.methods.ritz.ipopt import Ipopt
    from varcalc.methods.ritz.method import Ritz
    from varcalc.methods.shooting.method import Shooting

    ritz, ipopt, collocation = Ritz(), Ritz(optimiser=Ipopt()), Collocation()
    engine: Any = available()[0]
    integrator = Dial(
        "tolerance of the integrator", Knob.INTEGRATOR, Shooting(engine=engine), INTEGRATOR_TOLERANCES,
        lambda tolerance: Shooting(engine=replace(engine, tolerance=tolerance)),
    )  # fmt: skip
    return (
        Route(
            ritz, direct=True, dials=mesh_dials(ritz, (1, 2, 4), CHARTED_ELEMENTS, CHARTED_DEGREES), offered=_prescribed
        ),
        Route(ipopt, direct=True, dials=mesh_dials(ipopt, (1, 2, 4), CHARTED_ELEMENTS[1::2], CHARTED_DEGREES)),
        Route(collocation, dials=mesh_dials(collocation, (3, 5), CHARTED_ELEMENTS, CHARTED_DEGREES[2:])),
        Route(Shooting(), dials=(integrator,)),
        Route(FirstIntegral()),
    )


def routes(problem: Functional | None = None) -> tuple[Route, ...]:
    """The methods of this package, then those of entry points by their names; those offered for ``problem`` if given.

    Raises TypeError for an entry point that names anything but a :class:`Route`.
    """
    found = (*_own(), *offered(METHODS_GROUP, Route))
    return tuple(r for r in found if problem is None or r.offered(problem))


def methods_for(problem: Functional) -> list[Any]:
    """Every method offered for a problem, and last None for the ladder, which chooses for itself."""
    return [*(route.method for route in routes(problem)), None]


def peers() -> tuple[Route, ...]:
    """Solvers of others that are charted beside the methods: SciPy's ``solve_bvp``."""
    from varcalc.methods.collocation.scipy_bvp import SciPyBvp

    return (Route(SciPyBvp()),)
