"""Points shared among the workers of an executor: in chunks along a path, none lost with a worker that dies."""

from __future__ import annotations

import pickle
import sys
import threading
import time
import uuid
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from varcalc.problem.problem import Curve, Problem
from varcalc.solve.point import SweepPoint
from varcalc.solve.row import Source, SweepRow, Values
from varcalc.workers import Workers

CHUNKS_A_WORKER = 2
"""Chunks for each worker: the second evens out what the first cost."""
LARGEST_CHUNK = 4096
"""Points of a chunk at most: what is sent at once, and lost with a worker."""
REPORT = 2.0
"""Seconds after which a worker reports what it has, be its chunk done or not; what is left is shared anew."""
USUAL_WORKERS = 16
"""Workers that an executor is taken to have when nobody says how many."""
UNGUARDED = (
    "the worker processes of cores= do not start: each runs the script anew for its names, so what starts them must "
    "stand under if __name__ == '__main__':"
)
DIED = "the process that solved this point died each time it was tried; there may be too little memory for it"


@dataclass(frozen=True)
class _Sent:
    """A problem as bytes, which a worker turns into one once, not with every chunk."""

    pickled: bytes

    def __call__(self) -> Problem | Curve:
        return pickle.loads(self.pickled)


@dataclass(frozen=True)
class Job:
    """What the chunks of one sweep have in common; two are one where they have the same ``token``."""

    token: str
    source: Source = field(compare=False)
    method: Any = field(compare=False)
    tol: float = field(compare=False)
    count: int = field(compare=False)

    @classmethod
    def of(cls, source: Source, method: Any, tol: float, count: int) -> Job:
        """A sweep of ``count`` points, as it is sent."""
        if isinstance(source, Problem | Curve):
            source = _Sent(pickle.dumps(source))
        return cls(uuid.uuid4().hex, source, method, tol, count)


@lru_cache(maxsize=1)
def _row(job: Job) -> SweepRow:
    """What a worker knows of the sweep it last worked on: the problem, and the solutions found so far."""
    return SweepRow(job.source, job.method, job.tol, job.count)


_ONE_AT_A_TIME = threading.Lock()
"""CasADi's expressions are not made for threads: a process with several works at one chunk after the other."""


def _begun() -> None:
    """What a worker does first: it has begun, whatever it dies of later."""


def chunk(job: Job, points: bytes) -> bytes:
    """The first of the points, as many as a worker may take its time for; pickled, and so are the points.

    Dask looks into lists, and sends each of their members by itself.
    """
    began, found = time.perf_counter(), []
    with _ONE_AT_A_TIME:
        for together in _row(job).groups(pickle.loads(points)):
            found += together
            if time.perf_counter() - began > REPORT:
                break
    return pickle.dumps(found)


def shared(
    job: Job, points: list[Values], executor: Executor | None, cores: int
) -> Iterator[tuple[slice, list[SweepPoint]]]:
    """What is found at the points, chunk by chunk as the workers report: where they stand among all, and they.

    ``cores`` is the number of workers. Raises what a worker raised, but for a worker that died: its chunk is tried
    again alone, in halves, until the point is known that it dies of.
    """
    sharing = _Sharing(job, points, executor, cores)
    try:
        yield from sharing.reports()
    finally:
        sharing.end()


class _Sharing:
    """The chunks of a sweep that wait, those that run, and those during which a worker died."""

    def __init__(self, job: Job, points: list[Values], executor: Executor | None, cores: int) -> None:
        size = max(1, min(LARGEST_CHUNK, -(-len(points) // (CHUNKS_A_WORKER * cores))))
        self.job, self.points, self.cores = job, points, cores
        self.waiting = deque(range(k, min(k + size, len(points))) for k in range(0, len(points), size))
        self.suspects: deque[range] = deque()
        self.running: dict[Future[bytes], range] = {}
        self.on_trial = False
        self.broken: BrokenExecutor | None = None
        self.executor = Workers(cores) if executor is None else executor
        self.first = self.executor.submit(_begun) if executor is None else None
        # no more are sent to workers of our own than they work at, so that few are suspect when one dies
        self.at_once = cores + 1 if executor is None else len(points)

    def reports(self) -> Iterator[tuple[slice, list[SweepPoint]]]:
        """What the workers report, until all is done."""
        while self.waiting or self.suspects or self.running:
            if self.broken is None:
                self._send()
            for future in wait(self.running, return_when=FIRST_COMPLETED).done:
                yield from self._reported(self.running.pop(future), future)
            if self.broken is not None and not self.running:
                self._renew(self.broken)

    def _send(self) -> None:
        """Send what waits; when all of that is done the suspects, one at a time, so that what dies is known."""
        while self.waiting and len(self.running) < self.at_once:
            self._submit(self.waiting.popleft())
        self.on_trial = bool(self.suspects) and not self.running
        if self.on_trial:
            self._submit(self.suspects.popleft())

    def _submit(self, piece: range) -> None:
        points = self.points[piece.start : piece.stop]
        self.running[self.executor.submit(chunk, self.job, pickle.dumps(points))] = piece

    def _reported(self, piece: range, future: Future[bytes]) -> Iterator[tuple[slice, list[SweepPoint]]]:
        """What came of a chunk; what is left of it waits again."""
        error = future.exception()
        if error is None:
            found: list[SweepPoint] = pickle.loads(future.result())
            done = piece.start + len(found)
            yield slice(piece.start, done), found
            self.waiting.extend(_halves(range(done, piece.stop)))
            return
        if not _of_a_death(error):
            raise error
        self.broken = error if isinstance(error, BrokenExecutor) else self.broken
        if self.on_trial and len(piece) == 1:
            yield slice(piece.start, piece.stop), [SweepPoint.failed(self.points[piece.start], DIED)]
        else:
            self.suspects.extend(_halves(piece) if self.on_trial else [piece])

    def _renew(self, error: BrokenExecutor) -> None:
        """Take new workers for those of whom one died; what broke the executor is raised where it is another's.

        Raises RuntimeError where no worker ever began, since no other one will.
        """
        if not isinstance(self.executor, Workers):
            raise error
        if self.first is not None and self.first.exception() is not None:
            raise RuntimeError(UNGUARDED) from error
        self.executor.dismiss()
        self.executor, self.broken = Workers(self.cores), None

    def end(self) -> None:
        """Leave nothing behind that runs; what is still running is not waited for."""
        for future in self.running:
            future.cancel()
        if isinstance(self.executor, Workers):
            if self.running:
                self.executor.dismiss()
            self.executor.shutdown()


def _halves(piece: range) -> list[range]:
    """A range in two, or in as many as it has members."""
    middle = (piece.start + piece.stop + 1) // 2
    return [half for half in (range(piece.start, middle), range(middle, piece.stop)) if half]


def _of_a_death(error: BaseException) -> bool:
    """Whether an error says that a worker died, and not that its work cannot be done."""
    distributed = sys.modules.get("distributed")
    return isinstance(error, BrokenExecutor) or (
        distributed is not None and isinstance(error, distributed.KilledWorker)
    )
