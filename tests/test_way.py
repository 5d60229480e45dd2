"""The way through the house: which modules of the package are entered, in which order, by what users ask for.

`pytest -s tests/test_way.py` prints it.
"""

import sys
from itertools import groupby
from pathlib import Path

import casadi as ca
import pytest

import varcalc as vc
from varcalc import optics

PACKAGE = Path(vc.__file__).parent


def way_of(call):
    """The modules in which functions are entered while ``call`` runs, in order, none twice in a row."""
    entered = []

    def hook(frame, event, _):
        if event == "call":
            entered.append(frame.f_code.co_filename)

    before = sys.getprofile()
    sys.setprofile(hook)
    try:
        call()
    finally:
        sys.setprofile(before)
    inside = (Path(name) for name in entered if name.startswith(str(PACKAGE)))
    return [name for name, _ in groupby(str(path.relative_to(PACKAGE)) for path in inside)]


def descent():
    return vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81}
    )


def film():
    return vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))


def lens():
    return optics.Scene(optics.Radial(lambda r: 2 / (1 + r**2)))


def rays():
    scene = lens()
    return lambda: scene.rays((1.0, 0.0), (0.0, 0.7))


def solved(problem):
    return lambda: vc.solve(problem)


def verified(problem):
    solution = vc.solve(problem)
    return lambda: vc.verify(solution)


@pytest.mark.parametrize(
    ("name", "prepared", "most"),
    [
        ("solve, a plain problem", lambda: solved(film()), 40),
        ("solve, a singular end", lambda: solved(descent()), 36),
        ("verify", lambda: verified(film()), 42),
        ("rays", rays, 42),
    ],
)
def test_the_way_is_short(name, prepared, most):
    prepared()()  # imports and fills what is loaded once
    way = way_of(prepared())
    modules = list(dict.fromkeys(way))
    lines = [f"{name}: {len(modules)} modules, {len(way) - len(modules)} returns", *modules]
    sys.stdout.write("\n  ".join(lines) + "\n")
    assert len(modules) <= most
