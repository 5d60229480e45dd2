"""How far a long call has come: told to a function, or shown as a bar; how it is stopped, and what is known then.

Ctrl-C is put off until CasADi has answered: what is raised while it runs is lost, or comes out as another error.
"""

from __future__ import annotations

import html
import inspect
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sized
from contextlib import contextmanager
from functools import cache
from types import FrameType
from typing import Any, Protocol, TypeVar

import numpy as np

T = TypeVar("T")

Progress = Callable[[int, int | None, str], Any] | bool | None
"""What a long call takes as ``progress``.

A function is called as ``progress(done, total, what)``: steps done, their number (None where it is not known), and
what comes next, in words. None shows a bar to whoever is watching, on a terminal or in a notebook, once the call has
taken a second, and nothing to a script; True shows it at once and anywhere, False never.
"""
SECONDS_WITHOUT_BAR = 1.0
"""Seconds for which nobody wants to see a bar."""
SECONDS_BETWEEN = 0.05
"""Between two pictures of a bar, which take up to a millisecond."""


class Interrupted(KeyboardInterrupt):
    """A call that was stopped by Ctrl-C; ``known`` is what it would have given back, as far as it had come."""

    def __init__(self, known: Any) -> None:
        super().__init__("stopped; what was known by then is in `known`")
        self.known = known


class Telling:
    """The one who is told, for the time of one call: a person's function, a bar, or nobody."""

    def __init__(self, progress: Progress, title: str) -> None:
        if not (progress is None or isinstance(progress, bool) or callable(progress)):
            raise TypeError(
                f"progress must be a function of (done, total, what), True, False or None, not {progress!r}"
            )
        self._function = _told(progress) if callable(progress) else None
        shown = _watched() if progress is None else progress is True
        self._from = time.perf_counter() + (0.0 if progress is True else SECONDS_WITHOUT_BAR) if shown else float("inf")
        self._title = title
        self._bar: _Bar | None = None
        self._closed = self._awaited = False
        self._last: tuple[int, int | None, str] = 0, None, ""
        self._one_at_a_time = threading.Lock()

    def __call__(self, done: int, total: int | None, what: str = "") -> None:
        """Tell that ``done`` steps of ``total`` lie behind, and that ``what`` comes next."""
        if self._function is not None:
            self._function(done, total, what)
            return
        now, self._last = time.perf_counter(), (done, total, what)
        if now >= self._from or (self._bar is not None and done == total):
            self._from = now + SECONDS_BETWEEN
            self._show()
        elif not self._awaited and self._from < float("inf"):  # what is about to begin may take long, and tell nothing
            self._awaited = True
            _late_bars().show_after(self._from - now, self._show)

    def over(self, steps: Iterable[T], what: Callable[[T], str] = lambda _: "") -> Iterator[T]:
        """``steps`` one after the other, each told before it is given; ``what`` says what one is."""
        total, done = len(steps) if isinstance(steps, Sized) else None, 0
        for done, step in enumerate(steps):
            self(done, total, what(step))
            yield step
        self(done + 1 if total != 0 else 0, total)

    def close(self) -> None:
        """Take the bar away."""
        with self._one_at_a_time:
            self._closed = True
            if self._awaited:
                _late_bars().forget(self._show)
            if self._bar is not None:
                self._bar.stop()
                self._bar = None

    def _show(self) -> None:
        """Show what was told last."""
        with self._one_at_a_time:
            if self._closed:
                return
            if self._bar is None:
                self._bar = _InNotebook(self._title) if _in_notebook() else _OnTerminal(self._title)
            done, total, what = self._last
            count = f"{done} of {total}" if total else ""
            self._bar.show(done, total, ", ".join(filter(None, (count, what))))


class _LateBars:
    """Shows the bars of calls that tell of nothing when their time has come; its thread ends when no call is left."""

    def __init__(self) -> None:
        self._waiting: dict[Callable[[], None], float] = {}
        self._thread: threading.Thread | None = None
        self._one_at_a_time = threading.Lock()

    def show_after(self, seconds: float, show: Callable[[], None]) -> None:
        """Call ``show`` when so many seconds have gone by."""
        with self._one_at_a_time:
            self._waiting[show] = time.monotonic() + seconds
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._wait, daemon=True)
                self._thread.start()

    def forget(self, show: Callable[[], None]) -> None:
        """The call is over."""
        with self._one_at_a_time:
            self._waiting.pop(show, None)

    def _wait(self) -> None:
        while True:
            with self._one_at_a_time:
                now = time.monotonic()
                due = [show for show, moment in self._waiting.items() if moment <= now]
                for show in due:
                    del self._waiting[show]
                following = min(self._waiting.values(), default=None)
                if following is None:
                    self._thread = None
            for show in due:
                show()
            if following is None:
                return
            time.sleep(following - now)


@cache
def _late_bars() -> _LateBars:
    """One for all calls: a thread of its own would cost a short call a twentieth of its time."""
    return _LateBars()


class Stage:
    """The one who is told, by a search of many questions: how many are done, and what comes next, in words.

    Nobody where ``tell`` is None; ``before`` is how many were done before those that are counted. Ctrl-C ends what is
    done within :meth:`stoppable` and nothing else, so that what is known by then can be given back. Several threads may
    tell.
    """

    def __init__(self, tell: Callable[[int, str], None] | None = None, before: int = 0) -> None:
        self._tell = tell
        self._before = before
        self._whole = self
        self._stopped = False
        self._one_at_a_time = threading.Lock()

    def __call__(self, done: int, what: str) -> None:
        """Tell that ``done`` more questions lie behind, and ``what`` comes next."""
        if self._tell is not None:
            with self._whole._one_at_a_time:  # noqa: SLF001  of this class
                self._tell(self._before + done, what)

    def later(self, before: int) -> Stage:
        """The stages of a part of the questions, ``before`` which as many were done; it stops with the others."""
        part = Stage(self._tell, self._before + before)
        part._whole = self._whole
        return part

    @property
    def stopped(self) -> bool:
        """Whether Ctrl-C came."""
        return self._whole._stopped  # noqa: SLF001  of this class

    @contextmanager
    def stoppable(self) -> Generator[None]:
        """What is done within ends at Ctrl-C, and the search goes on with what is known."""
        try:
            yield
        except KeyboardInterrupt:
            self._whole._stopped = True  # noqa: SLF001  of this class


def _told(function: Callable[..., Any]) -> Callable[..., Any]:
    """A person's function; TypeError for one that cannot be called as ``progress`` is."""
    try:
        inspect.signature(function).bind(0, None, "")
    except TypeError:
        written = inspect.signature(function)
        raise TypeError(f"progress is called with (done, total, what), but its signature is {written}") from None
    except ValueError:  # a function of C's, which does not tell
        pass
    return function


class _Bar(Protocol):
    """A bar that somebody sees."""

    def show(self, done: int, total: int | None, words: str) -> None:
        """Show how far it has come."""

    def stop(self) -> None:
        """Take it away."""


class _OnTerminal:
    """A bar of rich's, on standard error; where that is no terminal what it last said stays."""

    def __init__(self, title: str) -> None:
        from rich.console import Console  # few calls take a second
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[what]}")
        console = Console(stderr=True)
        self._bar = Progress(*columns, TimeElapsedColumn(), console=console, transient=console.is_terminal)
        self._bar.add_task(title, what="")
        self._bar.start()

    def show(self, done: int, total: int | None, words: str) -> None:
        """Show that so much is done of a ``total``, where that is known, and the ``words``."""
        self._bar.update(self._bar.task_ids[0], completed=done, total=total, what=words)

    def stop(self) -> None:
        """Take the bar away."""
        self._bar.stop()


class _InNotebook:
    """A bar under a notebook's cell: rich would want ipywidgets for one, and warn of it."""

    def __init__(self, title: str) -> None:
        from IPython.display import display

        self._title = title
        self._place: Any = display({"text/plain": ""}, raw=True, display_id=True)

    def show(self, done: int, total: int | None, words: str) -> None:
        """Show that so much is done of a ``total``, where that is known, and the ``words``."""
        course = f' value="{done}" max="{total}"' if total else ""
        bar = f"{html.escape(self._title)} <progress{course}></progress> {html.escape(words)}"
        self._place.update({"text/plain": f"{self._title} {words}", "text/html": bar}, raw=True)

    def stop(self) -> None:
        """Take the bar away."""
        # as HTML too: empty text is shown as an empty box
        self._place.update({"text/plain": "", "text/html": ""}, raw=True)


@contextmanager
def telling(progress: Progress, title: str) -> Generator[Telling]:
    """The one who is told of a call called ``title``, until it is over, and may be stopped by Ctrl-C.

    NumPy warns of nothing meanwhile: what overflows, or is no number, is looked for in what comes out.
    """
    one = Telling(progress, title)
    try:
        with np.errstate(all="ignore"), heard():
            yield one
    finally:
        one.close()


@contextmanager
def heard() -> Generator[None]:
    """Ctrl-C raises KeyboardInterrupt in what is done within, whatever CasADi is about.

    CasADi asks Python about each argument, and takes whatever is raised meanwhile for the answer that it does not fit;
    IPOPT is ended by it, and reported as failed. So it is raised where the call of CasADi comes back, or, for those
    who press twice, at once besides. Handlers that a person has set stay; threads other than the main one have none.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _PutOff())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class _PutOff:
    """A handler of the signal; it lets the call of CasADi that it comes into go on to its end."""

    def __init__(self) -> None:
        self._caller: FrameType | None = None

    def __call__(self, _number: int, frame: FrameType | None) -> None:
        caller = _caller_of_casadi(frame)
        # one trace at a time: debuggers and what measures coverage have theirs
        if caller is None or self._caller is not None or sys.gettrace() is not None:
            raise KeyboardInterrupt
        self._caller = caller
        caller.f_trace = self._traced
        sys.settrace(self._traced)

    def _traced(self, frame: FrameType, _event: str, _what: object) -> None:
        """Raise in the frame that called CasADi, as soon as it does anything; others are not traced."""
        if frame is self._caller:
            self._caller = frame.f_trace = None
            sys.settrace(None)
            raise KeyboardInterrupt


def _caller_of_casadi(frame: FrameType | None) -> FrameType | None:
    """The frame of those below ``frame`` that called CasADi first; None where none did."""
    caller = None
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] == "casadi":
            caller = frame.f_back
        frame = frame.f_back
    return caller


def _watched() -> bool:
    """Whether a person sees what is written: on a terminal or in a notebook."""
    return _in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


def _in_notebook() -> bool:
    return "ipykernel" in sys.modules
