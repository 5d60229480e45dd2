"""Reference problems: a functional, its source and its closed form; finding and loading them.

A problem file is an ordinary Python file. It defines either ``references``, a
tuple of :class:`Reference` whose first entry is the default, or ``problem``,
with the closed form in ``exact`` where there is one.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.problem.conditions import finite, function, text, told, truth, whole
from varcalc.problem.functional import UNNAMED
from varcalc.problem.problem import Curve, Problem
from varcalc.showing import Brief, Fact, Shown, brief, line
from varcalc.spelling import near, spelled
from varcalc.study.user_file import BROKEN, SUFFIX, ProblemFileError, catalogued, failed, instead_of, listed, run_file

if TYPE_CHECKING:
    from varcalc.study.digits import ClosedForm, ExactDigits

PROBLEMS_PACKAGE = "varcalc.problems"
"""The package the reference problems are installed as."""

TRIED_PLACES = 3
"""Places at which a person's closed form is tried out before anything is solved."""


@spelled
@dataclass(frozen=True, repr=False)
class Exact(Brief):
    """A closed form: the ``value`` of the functional, and the curve where it is known.

    ``y(x)`` takes an array of abscissae and returns an array of x's shape, or
    of shape ``(n,) + x.shape`` for n unknown functions; for a
    :class:`varcalc.Curve` it is ``q(t)``, t in [0, 1], of shape ``(n,) + t.shape``.
    Raises TypeError or ValueError for a value that is not a finite number and
    for a ``y`` that cannot be called. Made by :meth:`of`, it can be called for more digits than a double has.
    """

    value: float
    y: Callable[[np.ndarray], Any] | None = None
    description: str = ""
    form: ClosedForm | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, form: ClosedForm, description: str = "") -> Exact:
        """A closed form that is written once for doubles and for any number of digits.

        ``form(number)`` returns the value and the curve (or None); ``number`` takes the doubles of the statement into
        the arithmetic, as ``float`` does. Its functions must take what that makes, as those of
        ``varcalc.problems._arithmetic`` do.
        """
        value, y = form(float)
        return cls(float(value), y, description, form)

    def __call__(self, digits: int) -> ExactDigits:
        """The closed form to so many digits, for the problem as its doubles state it.

        Raises ValueError where it is known in doubles alone, and for a number of digits that is none;
        ModuleNotFoundError without mpmath (``pip install 'varcalc[digits]'``).

        >>> from varcalc.study.reference import load
        >>> print(load("cylinder")[0].exact(digits=40))
        2.236067977499789696409173668731276235441
        """
        whole("digits", digits)
        if self.form is None:
            raise ValueError("this closed form is known in double precision alone; take its value and y as they are")
        from varcalc.study.digits import to_digits  # with mpmath

        return to_digits(self.form, digits)

    def __post_init__(self) -> None:
        value = finite("exact.value", self.value)
        if self.y is not None and not callable(self.y):
            raise TypeError(f"exact.y must be a function of the abscissa, not {self.y!r}")
        if self.form is not None:
            function("exact.form", self.form)
        text("exact.description", self.description)
        object.__setattr__(self, "value", value)


def checked_reasons(name: str, given: Any) -> Mapping[type, str]:
    """Classes of methods with the reasons why each does not apply; TypeError naming ``name`` for anything else."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{name} must map method classes to reasons, not {told(given)}; write {{Shooting: 'a reason'}}")
    for method in given:
        if not isinstance(method, type):
            raise TypeError(
                f"{name} maps method classes to reasons; write {type(method).__name__} rather than {told(method)}"
            )
    return given


@spelled
@dataclass(frozen=True, repr=False)
class Reference(Shown):
    """One reference problem, or one case of it.

    ``name`` is the file's name for the default case and ``file/case`` for the
    others; a problem that has no name of its own takes it. ``source`` cites
    where the problem comes from, ``statement`` says it in a sentence.
    ``inapplicable`` maps a method class to the reason why that method does not
    apply. ``downward`` is True where y is counted downward, so
    that pictures show it so.

    Raises TypeError or ValueError where one of these is of another kind, or ``name`` is empty.
    """

    name: str
    problem: Problem | Curve
    exact: Exact | None = None
    source: str = ""
    statement: str = ""
    inapplicable: Mapping[type, str] = field(default_factory=dict)
    downward: bool = False

    def __post_init__(self) -> None:
        if not text("name", self.name):
            raise ValueError("name is empty; a reference is found by its name")
        if not isinstance(self.problem, Problem | Curve):
            raise TypeError(f"problem of {self.name!r} must be a Problem or a Curve, not {self.problem!r}")
        if self.exact is not None and not isinstance(self.exact, Exact):
            raise TypeError(f"exact of {self.name!r} must be an Exact, not {self.exact!r}; write Exact(value)")
        checked_reasons(f"inapplicable of {self.name!r}", self.inapplicable)
        text("source", self.source)
        text("statement", self.statement)
        truth("downward", self.downward)
        if self.problem.name == UNNAMED:
            named = copy.copy(self.problem)
            named.name = self.name
            object.__setattr__(self, "problem", named)

    def __repr__(self) -> str:
        return line("Reference", [brief(self.name)])

    def _headline(self) -> str:
        return f"{self.name}: {self.statement}" if self.statement else self.name

    def _facts(self) -> Iterator[Fact]:
        if self.source:
            yield Fact("source", self.source)
        yield from self.problem._facts()  # noqa: SLF001  what is said of a problem is said of its reference
        if self.exact is not None:
            yield Fact("closed form", f"{self.exact.value:.15g}  {self.exact.description}".rstrip())


def as_exact(exact: Exact | float | None) -> Exact | None:
    """A closed form given as a number, as an :class:`Exact`, or not at all.

    Raises TypeError or ValueError as :class:`Exact` does.
    """
    return exact if exact is None or isinstance(exact, Exact) else Exact(exact)


def catalogue() -> dict[str, str]:
    """The names of the reference problems with the first line of each file's docstring.

    The files are read, not run: no problem is built.
    """
    return listed(PROBLEMS_PACKAGE)


def load(path_or_name: str | Path) -> tuple[Reference, ...]:
    """The references of a problem file; the first is the default.

    ``path_or_name`` is a name of the catalogue (``"brachistochrone"``), one
    case of it (``"brachistochrone/beyond"``, then the tuple holds that case
    alone), or the path of a file of one's own, ending in ``.py``, again with
    ``/case`` behind it if wanted. Raises :class:`ProblemFileError`, a
    ValueError, naming the file and the remedy.
    """
    text = str(path_or_name)
    file, case = _split_path(text)
    if file is not None:
        return _select(_from_file(file), case, str(file))
    name, _, case = text.partition("/")
    module = catalogued(PROBLEMS_PACKAGE, name, text, "problem")
    return _select(_references(module, name, module.__file__ or name), f"{name}/{case}" if case else "", name)


def _split_path(text: str) -> tuple[Path | None, str]:
    """The file and the case in ``text``; no file when it is a name of the catalogue."""
    if text.endswith(SUFFIX):
        return Path(text), ""
    head, separator, case = text.partition(f"{SUFFIX}/")
    return (Path(head + SUFFIX), case) if separator else (None, "")


def _select(references: tuple[Reference, ...], case: str, where: str) -> tuple[Reference, ...]:
    if not case:
        return references
    chosen = tuple(r for r in references if case in (r.name, r.name.partition("/")[2]))
    if not chosen:
        names = [r.name for r in references]
        shorter = [name.partition("/")[2] for name in names if "/" in name]
        remedy = near(case.rpartition("/")[2], shorter) or f"; it defines {', '.join(names)}"
        raise ProblemFileError(f"{where} has no case {case!r}{remedy}")
    return chosen


def _from_file(path: Path) -> tuple[Reference, ...]:
    module = run_file(path, "`problem`")
    references = _references(module, path.stem, str(path))
    for reference in references:
        _try_out(reference, path)
    return references


def _try_out(reference: Reference, path: Path) -> None:
    """Call the closed form of a person's own file once, so that it fails before anything is solved."""
    exact, problem = reference.exact, reference.problem
    if exact is None or exact.y is None:
        return
    at = np.linspace(*problem.span, TRIED_PLACES + 2)[1:-1]
    try:
        values = np.asarray(exact.y(at), dtype=float)
    except BROKEN as error:
        raise failed(path, f"exact.y of {reference.name!r}", error) from error
    wanted = [(problem.n, TRIED_PLACES), *([(TRIED_PLACES,), ()] if problem.n == 1 else [])]
    if values.shape not in wanted:
        raise ProblemFileError(
            f"exact.y of {reference.name!r} in {path} must return an array of shape {wanted[0]} for {TRIED_PLACES} "
            f"abscissae, not {values.shape}"
        )


def _references(module: ModuleType, name: str, where: str) -> tuple[Reference, ...]:
    """What a problem file that has been run defines."""
    references = getattr(module, "references", None)
    if references is not None:
        return _checked(references, where)
    problem = getattr(module, "problem", None)
    if problem is None:
        raise ProblemFileError(f"{where} defines {_instead(module, where)}")
    if not isinstance(problem, Problem | Curve):
        raise ProblemFileError(f"`problem` in {where} must be a varcalc.Problem or a varcalc.Curve, not {problem!r}")
    try:
        exact = as_exact(getattr(module, "exact", None))
    except (TypeError, ValueError) as error:
        raise ProblemFileError(f"`exact` in {where} must be a number or a varcalc.Exact: {error}") from error
    return (Reference(name, problem, exact, statement=(module.__doc__ or "").strip()),)


def _instead(module: ModuleType, where: str) -> str:
    """What a module without `problem` and `references` holds, and the remedy."""
    others = [name for name, value in vars(module).items() if isinstance(value, Problem | Curve)]
    if not others:
        remedy = instead_of("problem", module, where) or "; end it with problem = varcalc.Problem(...)"
        return f"neither `problem` nor `references`{remedy}"
    if len(others) == 1:
        return f"the problem `{others[0]}` and none called `problem`; rename it"
    return (
        f"{len(others)} problems, {', '.join(others)}, and none called `problem`; rename the one that is meant, "
        "or list them all: references = (varcalc.Reference('name', ...), ...)"
    )


def _checked(references: object, where: str) -> tuple[Reference, ...]:
    if not isinstance(references, tuple) or not references:
        raise ProblemFileError(f"`references` in {where} must be a tuple of at least one Reference, not {references!r}")
    names = set()
    for reference in references:
        if not isinstance(reference, Reference):
            raise ProblemFileError(f"`references` in {where} holds {reference!r}; every entry must be a Reference")
        if reference.name in names:
            raise ProblemFileError(f"`references` in {where} holds {reference.name!r} twice; give each its own name")
        names.add(reference.name)
    return references
