"""The files that define problems and scenes: those of a catalogue, and a person's own.

A person's file is run for what it defines; what is wrong with it is said with the line.
"""

from __future__ import annotations

import ast
import importlib.util
import pkgutil
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import is_dataclass, replace
from pathlib import Path
from textwrap import shorten
from types import ModuleType
from typing import TypeVar

from varcalc.solution import VariationalError
from varcalc.spelling import near

T = TypeVar("T")
SUFFIX = ".py"
"""What tells a person's own file from a name in a catalogue."""

CATALOGUES = (
    ("varcalc.problems", "a problem", "run", "problem"),
    ("varcalc.problems.optics", "a scene", "trace", "study"),
    ("varcalc.problems.mechanics", "a system", "move", "experiment"),
)
"""The packages of the catalogues, what each holds, the command that takes it, and what its files define."""
MOST_NAMED = 400
"""Characters of the names of a catalogue that a message holds."""

BROKEN = (
    SyntaxError, ImportError, NameError, AttributeError, TypeError, ValueError, RuntimeError, ArithmeticError,
    LookupError, AssertionError, OSError, EOFError, SystemExit, VariationalError,
)  # fmt: skip
"""What a file that does not work raises when it is run (CasADi raises RuntimeError)."""


class ProblemFileError(ValueError):
    """A problem or scene file, or name, that cannot be used; the message names it and the remedy."""


def run_file(path: Path, wanted: str) -> ModuleType:
    """The module that the file at ``path`` is, run; ``wanted`` names what it is to define.

    Raises :class:`ProblemFileError` where there is no such file or where it fails.
    """
    if not path.is_file():
        beside = [other.name for other in path.parent.glob(f"*{SUFFIX}")] if path.parent.is_dir() else []
        remedy = near(path.name, beside) or f"; give the path of a Python file that defines {wanted}"
        raise ProblemFileError(f"there is no file {path}{remedy}")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ProblemFileError(f"{path} cannot be read as Python; give a file ending in {SUFFIX}")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BrokenPipeError:  # whoever read what it prints has gone, as head does
        raise
    except BROKEN as error:
        raise failed(path, "", error) from error
    return module


def listed(package: str) -> dict[str, str]:
    """The names of a catalogue's files with the first line of each one's docstring; they are read, not run."""
    return {name: _first_line(f"{package}.{name}") for name in names_in(package)}


def names_in(package: str) -> list[str]:
    """The names of a catalogue's files; none is read."""
    found = pkgutil.iter_modules(importlib.import_module(package).__path__)
    return [module.name for module in found if not module.ispkg and not module.name.startswith("_")]


def catalogued(package: str, name: str, text: str, kind: str) -> ModuleType:
    """The file of a catalogue that is called ``name``, run; ProblemFileError where none is, with the ``text`` given."""
    known = names_in(package)
    if name not in known:
        suggested = _elsewhere(package, name) or file_called(text) or near(name, known)
        remedy = suggested or f", which holds {shorten(', '.join(known) or 'none', MOST_NAMED, placeholder=' ...')}"
        raise ProblemFileError(
            f"{text!r} is no {kind} of the catalogue{remedy}"
            + ("" if suggested else f"; a file of your own is given by its path, ending in {SUFFIX}")
        )
    return importlib.import_module(f"{package}.{name}")


def _elsewhere(package: str, name: str) -> str:
    """What another catalogue holds by this ``name``, and the command that takes it; nothing where none does."""
    held = ((kind, way) for other, kind, way, _ in CATALOGUES if other != package and name in names_in(other))
    return next((f"; it is {kind}: varcalc {way} {name}" for kind, way in held), "")


def file_called(text: str) -> str:
    """What there is where somebody left the ending of a file's name out; nothing where there is no such file."""
    return f"; for the file give {text}{SUFFIX}" if Path(text + SUFFIX).is_file() else ""


def instead_of(name: str, module: ModuleType, where: str) -> str:
    """What a file without ``name`` defines that another command takes; nothing where it is nothing."""
    held = ((other, way) for _, _, way, other in CATALOGUES if other != name and hasattr(module, other))
    return next((f"; it defines `{other}`: varcalc {way} {where}" for other, way in held), "")


def defined(
    package: str,
    path_or_name: str | Path,
    kind: str,
    name: str,
    wanted: type[T] | tuple[type[T], ...],
    called: str,
    example: str,
) -> T:
    """What a file of a catalogue, or of one's own, defines as ``name``; the docstring is the title of what has none.

    ``kind`` says what such files are, ``called`` what people call the class or classes ``wanted``, ``example`` how one
    ends.
    Raises :class:`ProblemFileError`, naming the file and the remedy.
    """
    text = str(path_or_name)
    module = run_file(Path(text), f"`{name}`") if text.endswith(SUFFIX) else catalogued(package, text, text, kind)
    value = getattr(module, name, None)
    if isinstance(value, wanted):
        return _titled(value, module)
    if value is not None:
        raise ProblemFileError(f"`{name}` in {text} must be a {called}, not {value!r}")
    remedy = instead_of(name, module, text) or f"; end it with {example}"
    raise ProblemFileError(f"{text} defines no `{name}`{remedy}")


def _titled(value: T, module: ModuleType) -> T:
    line = _opening(module.__doc__)
    if line and is_dataclass(value) and not isinstance(value, type) and getattr(value, "title", None) == "":
        return replace(value, title=line)
    return value


@contextmanager
def said_with_its_line(path_or_name: str | Path) -> Generator[None]:
    """What functions of a person's own file raise within is raised as :class:`ProblemFileError`, with the line."""
    path = Path(path_or_name)
    try:
        yield
    except BROKEN as error:
        if path.suffix == SUFFIX and _line_of(error, path):
            raise failed(path, "", error) from error
        raise


def _first_line(module_name: str) -> str:
    spec = importlib.util.find_spec(module_name)
    if spec is None or spec.origin is None:
        raise ProblemFileError(f"{module_name} is no file that can be read; reinstall varcalc")
    return _opening(ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))))


def _opening(docstring: str | None) -> str:
    """Its first line, as a title."""
    return (docstring or "").strip().partition("\n")[0].rstrip(".")


def failed(path: Path, part: str, error: BaseException) -> ProblemFileError:
    """The error that says which line of the file at ``path`` failed, and how."""
    what = f"{part} in {path}" if part else str(path)
    return ProblemFileError(f"{what}{_line_of(error, path)} failed with {type(error).__name__}: {error}; mend the file")


def _line_of(error: BaseException, path: Path) -> str:
    """`, line N` for the last line of ``path`` that ``error`` came through."""
    if isinstance(error, SyntaxError) and error.lineno is not None:
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).resolve() == path.resolve()]
    return f", line {lines[-1]}" if lines else ""
