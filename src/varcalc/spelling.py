"""Names that people write: a near one is suggested, and British and American spellings are taken for each other."""

from __future__ import annotations

import difflib
import inspect
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from importlib import import_module
from types import FunctionType, ModuleType
from typing import Any, TypeVar

T = TypeVar("T", bound=Callable[..., Any])

SPELLINGS = (("imise", "imize"), ("centre", "center"))
"""What is spelt one way in Britain and another in America, among the names of arguments."""
OPPOSITES = ("min", "max")
"""What makes a word that is like another mean the contrary of it."""
LIKENESS = 0.6
"""Likeness of two words (difflib's ratio) from which on one may have been meant by the other."""
HOMES = ("varcalc", "varcalc.optics", "varcalc.mechanics")
"""The modules whose names are public."""
BEGINNING = 3
"""Letters that a name must share with a longer one to be taken for its short form."""
MOST_OWNERS, MOST_LISTED = 4, 16
"""Classes that are named as those whose method a name is; names of a class that are listed."""
ALIKE = (
    ("value", "cost", "fun", "functional", "objective", "minimum", "optimum", "j", "integral"),
    ("optical_path", "length", "path_length", "distance", "value", "minimum"),
    ("status", "arrived", "completed", "verdict", "success", "ok", "passed", "converged", "optimal"),
    ("y", "along", "way", "points", "q", "point", "path", "curve", "trajectory", "position", "x"),
    ("dy", "v", "directions", "tangents", "derivative", "slope", "velocity", "dq", "direction", "p"),
    ("x", "interval", "span", "t", "time", "times"),
    ("travel_time", "time", "t"),
    ("trace", "motion", "solve", "minimise", "minimize", "simulate", "propagate", "trace_rays", "trace_all",
     "integrate", "trajectory", "run"),
    ("rays", "arrivals", "ray", "path", "paths"),
    ("findings", "checks", "results", "tests"),
    ("lagrange", "motion", "lagrangian", "action"),
    ("Through", "waypoint", "point", "via"),
    ("Isoperimetric", "integral", "constraint", "inequality"),
    ("Problem", "functional"),
    ("OnCurve", "boundary"),
    ("Sphere", "circle", "disc", "lens"),
    ("Plane", "line", "mirror"),
    ("Stratified", "layered", "layers"),
    ("Graded", "index"),
)  # fmt: skip
"""Words of which one may be written for another; what is there is looked for in this order."""


def near(word: str, known: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` for the one among the names ``known`` that is like ``word``; empty where none is.

    >>> near("paramters", ["parameters", "start"]), near("bk7", ["N-BK7", "N-F2"]), near("z", ["parameters"])
    ("; did you mean 'parameters'?", "; did you mean 'N-BK7'?", '')
    >>> near("minimize", ["maximise"])  # which is what was not meant
    ''
    """
    sought = word.casefold()
    folded = {name.casefold(): name for name in known if not _contrary(sought, name.casefold())}
    parts = [
        name
        for name in folded
        if min(len(name), len(sought)) >= BEGINNING
        and (name.startswith(sought) or name.endswith(sought) or sought.startswith(name))
    ]
    alike = [sought] if sought in folded else difflib.get_close_matches(sought, folded, 1, LIKENESS) or parts
    return f"; did you mean {folded[alike[0]]!r}?" if alike else ""


def alike(word: str, known: Iterable[str]) -> str:
    """The name among the ``known`` that another word is used for, singular or plural; empty where none is.

    >>> alike("cost", ["error", "value"]), alike("paths", ["q", "y"]), alike("Circle", ["Plane", "Sphere"])
    ('value', 'y', 'Sphere')
    """
    sought, there = word.casefold(), set(known) - {word}
    groups = [group for group in ALIKE if {sought, sought.removesuffix("s")} & {name.casefold() for name in group}]
    return next((name for group in groups for name in group if name in there), "")


def _contrary(word: str, other: str) -> bool:
    return any(a in word and b in other for a, b in (OPPOSITES, OPPOSITES[::-1]))


def listed(names: Sequence[str]) -> str:
    """Names in a row.

    >>> listed(["x", "y", "dy"]), listed([])
    ('x, y and dy', 'none')
    """
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]])) or "none"


def check_names(what: str, given: Iterable[str], known: Iterable[str]) -> None:
    """ValueError where some of the names ``given`` are not ``known``; ``what`` says whose parameters they are.

    >>> check_names("parameters of this problem", ["graviti"], ["length", "gravity"])
    Traceback (most recent call last):
    ValueError: ['graviti'] are no parameters of this problem; it has ['gravity', 'length']; did you mean 'gravity'?
    """
    there = sorted(known)
    strange = sorted(map(str, set(given).difference(there)))
    if strange:
        suggested = next(filter(None, (near(word, there) for word in strange)), "")
        has = there or f"none; declare them: parameters={{{strange[0]!r}: ...}}"
        raise ValueError(f"{strange} are no {what}; it has {has}{suggested}")


class NoAttribute(AttributeError):
    """The error of a ``module`` that has nothing called ``name`` and says what was meant, of what is ``known``.

    That is looked for when the message is read: imports and what inspects modules ask for names that are not there.

    >>> print(NoAttribute("varcalc", "slove", ["solve"]))
    module 'varcalc' has no attribute 'slove'; did you mean 'solve'?
    >>> print(NoAttribute("varcalc", "Scene", ["solve"]))
    module 'varcalc' has no attribute 'Scene'; it is varcalc.optics.Scene
    """

    def __init__(self, module: str, name: str, known: Sequence[str]) -> None:
        super().__init__(module, name, known, name=name)

    def __str__(self) -> str:
        module, name, known = self.args
        return f"module {module!r} has no attribute {name!r}{_meant(module, name, known)}"


def _meant(module: str, name: str, known: Sequence[str]) -> str:
    """What somebody meant who looked for a ``name`` in a module."""
    # imported by name: what is below all others cannot import them, and nothing asks but a mistake
    homes = {home: import_module(home) for home in HOMES}
    others = {home: found.__all__ for home, found in homes.items() if home != module}
    there = next((f"; it is {home}.{name}" for home, public in others.items() if name in public), "")
    classes = [vars(found).get(public) for found in homes.values() for public in found.__all__]
    owners = [one.__name__ for one in classes if inspect.isclass(one) and inspect.isfunction(getattr(one, name, None))]
    method = f"; it is a method of {' or '.join(owners[:MOST_OWNERS])}" if owners else ""
    same = alike(name, known)
    used = f"; did you mean {same!r}?" if same else ""
    elsewhere = ((near(name, public), home) for home, public in others.items())
    return (
        there
        or method
        or used
        or near(name, known)
        or next((f"{one[:-1]} of {home}?" for one, home in elsewhere if one), "")
        or f"; dir({module}) lists what it has"
    )


class NoMember(AttributeError):
    """The error of an object of a class ``kind`` that has nothing called ``name``: what was meant, or what it has."""

    def __init__(self, kind: type, name: str) -> None:
        super().__init__(kind, name, name=name)

    def __str__(self) -> str:
        kind, name = self.args
        known = [n for n in {*dir(kind), *getattr(kind, "__dataclass_fields__", ())} if not n.startswith("_")]
        functions = [n for n in import_module(HOMES[0]).__all__ if n.islower()]
        function = name if name in functions else alike(name, functions)
        same = alike(name, known)
        if same or not function:
            names = f"has {listed(sorted(known))}" if len(known) <= MOST_LISTED else "has what dir(...) of it lists"
            has = f"; it is a sequence, [0] its first, and {names}" if issubclass(kind, Sequence) else f"; it {names}"
            meant = f"; did you mean {same!r}?" if same else near(name, known) or near(name, functions) or has
        else:
            meant = f"; it is a function: varcalc.{function}(...)"
        return f"{kind.__name__} has no attribute {name!r}{meant}"


class Uncalled(ModuleType):
    """A module whose call is refused in a sentence: its name is that of a method, or near that of a class."""

    def __call__(self, *_given: object, **_named: object) -> None:
        """TypeError, with what was meant."""
        home, _, name = self.__name__.rpartition(".")
        known = [public for public in import_module(home).__all__ if public != name]
        raise TypeError(f"{self.__name__} is a module, which cannot be called{_meant(home, name, known)}")


def uncalled(home: str) -> None:
    """Refuse calls of the modules of a package that are there: see :class:`Uncalled`."""
    for found in list(vars(sys.modules[home]).values()):
        if type(found) is ModuleType and found.__name__.startswith(f"{home}."):
            found.__class__ = Uncalled


def spelled(given: T) -> T:
    """The function, or class with its public methods, whose calls are refused in a sentence where they do not fit.

    An argument that it does not have is named with the nearest that it has; one that is spelt the British or the
    American way is taken for the other. Calls that fit are not looked at.

    >>> @spelled
    ... def solve(problem, *, maximise=False, tol=1e-10):
    ...     return maximise
    >>> solve(None, maximize=True)
    True
    >>> solve(None, tolerance=1e-8)
    Traceback (most recent call last):
    TypeError: solve has no argument 'tolerance'; did you mean 'tol'?
    >>> solve()
    Traceback (most recent call last):
    TypeError: solve lacks problem; it is written solve(problem, maximise=False, tol=1e-10)
    """
    if not inspect.isclass(given):
        return _refusing(given)
    owner: Any = given
    for name, member in list(vars(owner).items()):
        plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if not isinstance(plain, FunctionType) or (name.startswith("_") and name != "__init__"):
            continue
        told: Any = _refusing(plain)
        setattr(owner, name, type(member)(told) if plain is not member else told)
    return owner


def _refusing(function: Any) -> Any:
    respelt = _respelt

    def called(*args: Any, **kwargs: Any) -> Any:
        """The function's value, its keywords respelt where they do not fit."""
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            trace = error.__traceback__
            if trace is None or trace.tb_next is not None:  # raised within the function, not by the call of it
                raise
        return function(*args, **respelt(function, args, kwargs))

    # doctest takes functions for those of the module whose globals they have
    home = FunctionType(called.__code__, function.__globals__, function.__name__, None, called.__closure__)
    return wraps(function)(home)


def _respelt(function: Any, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """The keyword arguments by the names that the function has; TypeError, in a sentence, where the call cannot fit."""
    parameters = list(inspect.signature(function).parameters.values())
    name = function.__name__
    if args and parameters and parameters[0].name in {"self", "cls"}:
        owner = args[0] if inspect.isclass(args[0]) else type(args[0])
        name = owner.__name__ if name == "__init__" else f"{owner.__name__}.{name}"
        args, parameters = args[1:], parameters[1:]
    call = _Call(name, args, {p.name: p for p in parameters})
    found: dict[str, Any] = {}
    for word, value in kwargs.items():
        right = next((w for w in _variants(word) if w in call.parameters), None)
        if right is None:
            raise TypeError(call.strange(word, value))
        if right in found or right in call.by_place[: len(args)]:
            raise TypeError(f"{name} is given {right} twice; give it once")
        found[right] = value
    if found.keys() == kwargs.keys():
        raise TypeError(call.misfit(found))
    return found


def _variants(word: str) -> list[str]:
    """A name in all its spellings, its own first."""
    pairs = [pair for one in SPELLINGS for pair in (one, one[::-1])]
    return [word, *(word.replace(a, b) for a, b in pairs if a in word)]


class _Call:
    """A call that does not fit a function of these ``parameters``."""

    def __init__(self, name: str, args: tuple[Any, ...], parameters: Mapping[str, inspect.Parameter]) -> None:
        self.name, self.args, self.parameters = name, args, parameters
        self.by_place = [p.name for p in parameters.values() if p.kind is not p.KEYWORD_ONLY]

    def needed(self, given: Iterable[str]) -> list[str]:
        """The parameters that must be given and are not."""
        there = {*self.by_place[: len(self.args)], *given}
        return [p.name for p in self.parameters.values() if p.default is p.empty and p.name not in there]

    def annotated(self, name: str, kind: str) -> bool:
        """Whether the parameter ``name`` is said to be a ``kind``."""
        return str(self.parameters[name].annotation).startswith(kind)

    def strange(self, word: str, value: Any) -> str:
        """What is said of an argument that the function does not have."""
        sentence = f"{self.name} has no argument {word!r}"
        left = self.needed(())
        if len(left) == 1 and self.annotated(left[0], "Mapping"):
            return f"{sentence}; give a mapping from names to values: {left[0]}={{{word!r}: {value!r}}}"
        return sentence + (near(word, self.parameters) or f"; it takes {listed(list(self.parameters))}")

    def misfit(self, given: Iterable[str]) -> str:
        """What is said of arguments that are too many or too few."""
        written = ", ".join(_written(p) for p in self.parameters.values())
        form = f"it is written {self.name}({written})"
        if len(self.args) <= len(self.by_place):
            return f"{self.name} lacks {listed(self.needed(given))}; {form}"
        if len(self.by_place) == 1 and self.annotated(self.by_place[0], "Sequence"):
            form = f"give them as one sequence: {self.name}([{', '.join(map(repr, self.args))}])"
        named = [name for name in self.parameters if name not in self.by_place]
        if named:
            form = f"give the others by name: {', '.join(f'{name}=...' for name in named)}"
        count = len(self.by_place)
        return f"{self.name} takes {count} argument{'s' * (count != 1)} by place, not {len(self.args)}; {form}"


def _written(parameter: inspect.Parameter) -> str:
    """A parameter as it stands in a call."""
    if parameter.default is parameter.empty:
        return f"{parameter.name}=..." if parameter.kind is parameter.KEYWORD_ONLY else parameter.name
    default = repr(parameter.default)
    return f"{parameter.name}={default if default.isprintable() and '<' not in default else '...'}"
