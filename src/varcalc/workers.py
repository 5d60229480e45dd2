"""Processes that work for this one, and end with it."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess


class _Deaf(SpawnProcess):
    """A process that does not hear the interrupt key from its birth on: it loads packages for a second or two."""

    def start(self) -> None:
        """Start it with the signal blocked, as it is for this thread for the time being."""
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            super().start()
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Spawning(SpawnContext):
    """How workers are started: a forked process would inherit the locks of threads that are not there."""

    Process = _Deaf


class Workers(ProcessPoolExecutor):
    """``count`` processes that end when they are dismissed, or with the process that started them, whatever ends it.

    A worker of a plain pool waits for its next task for ever: each has both ends of the queue open, so that none is
    told when nobody is left to fill it. Here each listens besides to a pipe of which only the process that started
    it holds the other end. The interrupt key is left to that process too.
    """

    def __init__(self, count: int) -> None:
        context = _Spawning()
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
