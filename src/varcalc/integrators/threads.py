"""Many like things, spread over the cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext

SMALLEST_SHARE = 256
"""Fewer than this are not worth another thread."""
LARGEST_SHARE = 16384
"""More than this do not stay near the processor."""


def threads_for(runs: int, smallest: int = SMALLEST_SHARE) -> int:
    """Threads for so many runs: at most one a core, at least one, of shares that are not under the ``smallest``."""
    return max(1, min(os.cpu_count() or 1, runs // smallest))


def spread(
    work: Callable[[slice], None], count: int, smallest: int = SMALLEST_SHARE,
    stoppable: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> None:  # fmt: skip
    """Call ``work`` with slices of ``range(count)`` that together are all of it, on as many threads as there are cores.

    What one of them raises is raised. Threads are waited for within ``stoppable``, which may keep Ctrl-C from ending
    the call before they are done.
    """
    threads = threads_for(count, smallest)
    rounds = -(-count // (threads * LARGEST_SHARE))
    size = max(1, -(-count // (threads * max(1, rounds))))  # all of one size: a small rest may be carried another way
    parts = [slice(first, min(first + size, count)) for first in range(0, count, size)]
    if threads == 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work, part) for part in parts]
        with stoppable():
            wait(futures)
        for future in futures:
            future.result()
