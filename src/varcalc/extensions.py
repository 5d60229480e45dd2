"""What other packages offer: the objects that their entry points name, and packages that need not be there."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def offered(group: str, kind: type[T]) -> tuple[T, ...]:
    """The objects of a class that the entry points of ``group`` name, in the order of the entries' names.

    Raises TypeError for an entry point that names anything else.
    """
    found = []
    for entry in sorted(entry_points(group=group), key=lambda e: e.name):
        named = entry.load()
        if not isinstance(named, kind):
            given = f"{entry.name} = {entry.value} of {group}"
            raise TypeError(f"the entry point {given} must name a {kind.__name__}, not {named!r}")
        found.append(named)
    return tuple(found)


def optional(module: str, extra: str, purpose: str) -> ModuleType:
    """A package that only one of varcalc's extras brings.

    Raises ModuleNotFoundError, with the ``purpose`` that wants it and the command that installs it, where it is absent.

    >>> optional("json", "frames", "tables of points").dumps([1])
    '[1]'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{purpose} take {module}, which is not installed; install it by: python -m pip install 'varcalc[{extra}]'",
            name=error.name,
        ) from None
