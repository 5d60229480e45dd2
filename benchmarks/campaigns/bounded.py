"""Calls that take no longer than they may, in processes that can be ended; several at a time.

What is limited is the processor time, so that a busy machine makes nothing too
slow: a timer of the operating system (POSIX) ends the process.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from enum import Enum
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

STARTING = 300.0
"""Seconds a process may take to begin: it imports the package anew."""
WAITING = 20.0
"""Times the limit after which a process is ended that hardly gets, or uses, the processor."""
# a fresh interpreter, since a copy of one that runs threads may hang
_CONTEXT = multiprocessing.get_context("spawn")
# linear algebra on several cores waits for them, and waiting counts as processor time
for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # processes to come have it before NumPy is loaded


class Failed(Enum):
    """Why a call gave nothing back."""

    TOO_SLOW = "too slow"
    CRASHED = "crashed"


def _serve(pipe: Connection, function: Callable[[Any], Any], seconds: float) -> None:
    """Answer calls, one after the other, until the other end hangs up or one takes too long."""
    pipe.send(None)
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_PROF, seconds)
        result = function(task)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        pipe.send(result)


class Worker:
    """A process that calls one function; it is replaced when a call ends it, as one of more than ``seconds`` does."""

    def __init__(self, function: Callable[[Any], Any], seconds: float) -> None:
        self.function, self.seconds = function, seconds
        self._begin()

    def _begin(self) -> None:
        self.pipe, theirs = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=_serve, args=(theirs, self.function, self.seconds), daemon=True)
        self.process.start()
        theirs.close()
        if not self.pipe.poll(STARTING):
            raise RuntimeError("a process did not begin: the machine is too busy to measure anything on it")
        self.pipe.recv()

    def call(self, task: Any) -> Any:
        """What the function gives for ``task``, or why it gave nothing."""
        self.pipe.send(task)
        failure = Failed.TOO_SLOW
        if self.pipe.poll(WAITING * self.seconds):
            try:
                return self.pipe.recv()
            except EOFError:  # the timer or an exception ended it; what was raised is on standard error
                self.process.join()
                failure = Failed.TOO_SLOW if self.process.exitcode == -signal.SIGPROF else Failed.CRASHED
        self._replace()
        return failure

    def _replace(self) -> None:
        self.end()
        self._begin()

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def results(
    function: Callable[[Any], Any], tasks: Sequence[Any], seconds: float, workers: int
) -> Iterator[tuple[Any, Any]]:
    """Each task with its result or a :class:`Failed`, in the order in which they are done.

    ``function`` must be importable by name; ``seconds`` of processor time is what a
    call may take. Leaving the loop ends the processes.
    """
    idle: SimpleQueue[Worker] = SimpleQueue()
    everyone = [Worker(function, seconds) for _ in range(workers)]
    for worker in everyone:
        idle.put(worker)

    def done(task: Any) -> tuple[Any, Any]:
        worker = idle.get()
        try:
            return task, worker.call(task)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(workers)
    try:
        for future in as_completed([pool.submit(done, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for worker in everyone:
            worker.end()
