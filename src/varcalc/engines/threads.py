"""How many threads a number of runs is worth."""

from __future__ import annotations

import os

SMALLEST_SHARE = 256
"""Fewer runs than this are not worth another thread."""


def threads_for(runs: int) -> int:
    """Threads for so many runs: at most one a core, at least one."""
    return max(1, min(os.cpu_count() or 1, runs // SMALLEST_SHARE))
