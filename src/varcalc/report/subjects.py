"""What a page is about: problems, scenes and systems of the catalogues, and a person's own files."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path

from varcalc.spelling import near
from varcalc.study.experiments import EXPERIMENTS_PACKAGE
from varcalc.study.reference import PROBLEMS_PACKAGE
from varcalc.study.scenes import SCENES_PACKAGE
from varcalc.study.user_file import SUFFIX, ProblemFileError, file_called, names_in, run_file


class Kind(Enum):
    """The catalogues, in the order in which an index shows them."""

    PROBLEM = "problems"
    SCENE = "optics"
    SYSTEM = "mechanics"

    @property
    def package(self) -> str:
        """The package that holds the catalogue."""
        return {
            Kind.PROBLEM: PROBLEMS_PACKAGE, Kind.SCENE: SCENES_PACKAGE, Kind.SYSTEM: EXPERIMENTS_PACKAGE
        }[self]  # fmt: skip

    @property
    def plural(self) -> str:
        """What several of a kind are called."""
        return {Kind.PROBLEM: "Problems", Kind.SCENE: "Scenes of optics", Kind.SYSTEM: "Systems of mechanics"}[self]

    @property
    def singular(self) -> str:
        """What one is called."""
        return {Kind.PROBLEM: "problem", Kind.SCENE: "scene", Kind.SYSTEM: "system"}[self]

    @property
    def defined(self) -> tuple[str, ...]:
        """What a file of the kind defines, one of these."""
        return {Kind.PROBLEM: ("references", "problem"), Kind.SCENE: ("study",), Kind.SYSTEM: ("experiment",)}[self]


@dataclass(frozen=True)
class Subject:
    """One page's: its kind, its name, what ``load`` and the like take, and the file that declares it."""

    kind: Kind
    name: str
    given: str
    path: Path
    own: bool = False

    @property
    def file(self) -> str:
        """Where its page lies in the folder of a report."""
        plain = self.name.replace("/", "-")
        return f"{plain}.html" if self.own else f"{self.kind.value}/{plain}.html"

    @cached_property
    def source(self) -> str:
        """The text of the file."""
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def paragraphs(self) -> tuple[str, ...]:
        """Those of the file's docstring, the indented ones with their indentation."""
        docstring = ast.get_docstring(ast.parse(self.source)) or ""
        return tuple(part for part in docstring.split("\n\n") if part.strip())

    @property
    def line(self) -> str:
        """The first line of the docstring."""
        return self.paragraphs[0].partition("\n")[0].strip().rstrip(".") if self.paragraphs else ""


def catalogued_subjects() -> tuple[Subject, ...]:
    """Every problem, scene and system of the catalogues; their files are not run."""
    return tuple(_of_catalogue(kind, name, name) for kind in Kind for name in names_in(kind.package))


def subjects_of(names: Iterable[str]) -> tuple[Subject, ...]:
    """The subjects of some names, each once.

    A name is one of a catalogue (of every catalogue that has it: cone is a problem and a system), one with the
    catalogue before it (``mechanics/cone``), a case (``brachistochrone/beyond``), or the path of a file of one's own.
    Raises :class:`varcalc.study.user_file.ProblemFileError`, naming the remedy.
    """
    found: dict[str, Subject] = {}
    for text in names:
        for subject in [_of_file(text)] if SUFFIX in text else _named(text):
            if found.setdefault(subject.file, subject).path != subject.path:
                raise ProblemFileError(
                    f"{subject.path} and {found[subject.file].path} would both be reported as {subject.file}; "
                    "rename one, or report it into another folder"
                )
    return tuple(found.values())


def _named(text: str) -> list[Subject]:
    head, _, rest = text.partition("/")
    kinds = [kind for kind in Kind if kind.value == head and rest]
    name = (rest if kinds else text).partition("/")[0]
    case = (rest if kinds else text).partition("/")[2]
    # only problems have cases
    having = [k for k in kinds or Kind if name in names_in(k.package) and (k is Kind.PROBLEM or not case)]
    if not having:
        meant = file_called(text) or near(name, [entry for kind in kinds or Kind for entry in names_in(kind.package)])
        advice = (
            "; `varcalc list`, `varcalc list --scenes` and `varcalc list --systems` name them, and a file of your own "
            f"is given by its path, ending in {SUFFIX}"
        )
        raise ProblemFileError(f"{text!r} is no problem, scene or system of the catalogues{meant or advice}")
    return [_of_catalogue(kind, name, f"{name}/{case}" if case else name) for kind in having]


def _of_catalogue(kind: Kind, name: str, given: str) -> Subject:
    spec = importlib.util.find_spec(f"{kind.package}.{name}")
    if spec is None or spec.origin is None:
        raise ProblemFileError(f"{kind.package}.{name} is no file that can be read; reinstall varcalc")
    return Subject(kind, given, given, Path(spec.origin))


def _of_file(text: str) -> Subject:
    """A person's own file, run for what it defines."""
    head, _, case = text.partition(f"{SUFFIX}/")
    path = Path(head + SUFFIX if case else text)
    module = run_file(path, "`problem`, `study` or `experiment`")
    for kind in Kind:
        if any(hasattr(module, name) for name in kind.defined):
            return Subject(kind, f"{path.stem}/{case}" if case else path.stem, text, path, own=True)
    raise ProblemFileError(
        f"{path} defines none of problem, references, study and experiment; end it with one, such as "
        "problem = varcalc.Problem(...)"
    )
