"""What other packages offer: the objects that their entry points name."""

from __future__ import annotations

from importlib.metadata import entry_points
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
