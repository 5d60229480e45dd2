"""Processes that work for this one, and end with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import Connection, wait


class Workers(ProcessPoolExecutor):
    """``count`` processes that end when they are dismissed, or with the process that started them, whatever ends it.

    A worker of a plain pool waits for its next task for ever: each has both ends of the queue open, so that none is
    told when nobody is left to fill it. Here each listens besides to a pipe of which only the process that started
    it holds the other end. The interrupt key is left to that process too.
    """

    def __init__(self, count: int) -> None:
        # a forked process would inherit the locks of threads that are not there
        context = multiprocessing.get_context("spawn")
        heard, self._told = context.Pipe(duplex=False)
        super().__init__(count, context, initializer=_attached, initargs=(heard,))

    def dismiss(self) -> None:
        """End the workers at once, whatever they are doing."""
        self._told.close()
        self.shutdown(cancel_futures=True)


def _attached(heard: Connection) -> None:
    """What a worker does first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(heard,), daemon=True).start()


def _end_with(heard: Connection) -> None:
    """Nothing is ever said: there is something to read when the other end is closed."""
    wait([heard])
    os._exit(1)
