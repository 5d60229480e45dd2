"""How far a search for rays has come: how many pairs are done, and what is being done for the next."""

from __future__ import annotations

from collections.abc import Callable

Stage = Callable[[int, str], None]
"""Called with the number of pairs done and what comes next, in words."""


def quietly(done: int, what: str) -> None:
    """Tell nobody."""
