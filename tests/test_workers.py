"""Processes that work for another: they end with it, whatever ends it, and leave the interrupt key to it."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor
from contextlib import suppress

import pytest

from varcalc.workers import Workers

LONG = 300.0
"""Seconds of work that nobody waits for."""
SOON = 60.0
"""Seconds within which what has ended is seen to have."""

BUSY = """
import pathlib, time
import varcalc as vc
def slow(k):
    pathlib.Path("begun").touch()
    time.sleep(%s)
    return vc.Problem(lambda x, y, dy: dy**2 + k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
"""
PAGE = """
import multiprocessing
import varcalc as vc
from slow import slow
if multiprocessing.parent_process() is not None:
    slow(1.0)
problem = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
"""
HEARD = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
"""A process that a shell has put into the background ignores the key, and so do those that it starts."""
SWEEP = "import slow, varcalc as vc\nif __name__ == '__main__':\n    vc.sweep(slow.slow, {'k': range(1000)}, cores=2)\n"
REPORT = "from varcalc.cli import main\nif __name__ == '__main__':\n    main(['report', 'page.py', '--cores', '1'])\n"


@pytest.fixture
def script(tmp_path):
    """Starts a script in a folder and gives it back when a worker is at work; whatever it leaves is ended."""
    started = []

    def start(text, seconds):
        (tmp_path / "slow.py").write_text(BUSY % seconds, encoding="utf-8")
        (tmp_path / "page.py").write_text('"""Slow."""' + PAGE, encoding="utf-8")
        (tmp_path / "script.py").write_text(text, encoding="utf-8")
        command, pipe = [sys.executable, "script.py"], subprocess.PIPE
        started.append(
            subprocess.Popen(command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True, start_new_session=True)
        )
        until = time.monotonic() + SOON
        while started[0].poll() is None and not (tmp_path / "begun").exists() and time.monotonic() < until:
            time.sleep(0.01)
        return started[0]

    yield start
    for process in started:
        process.kill()
        if sys.platform != "win32":
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize(
    ("text", "seconds"), [(SWEEP, 0.01), (SWEEP, LONG), (REPORT, LONG)], ids=["short tasks", "long tasks", "pages"]
)
def test_workers_end_with_a_process_that_is_killed(script, text, seconds):
    killed = script(text, seconds)
    assert killed.poll() is None
    killed.kill()
    # the workers hold the pipes open that the process was given: there is no end to be read before they have ended
    killed.communicate(timeout=SOON)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT to send to another process")
@pytest.mark.parametrize("seconds", [0.0, 0.02, 0.1, 0.5])
def test_workers_do_not_hear_the_interrupt_key_while_they_start(seconds):
    with Workers(1) as workers:
        future = workers.submit(os.getpid)
        [worker] = multiprocessing.active_children()
        time.sleep(seconds)
        os.kill(worker.pid, signal.SIGINT)
        assert future.result() == worker.pid


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT to send to another process")
def test_a_sweep_that_is_interrupted_waits_for_no_worker(script):
    interrupted = script(HEARD + SWEEP, LONG)
    interrupted.send_signal(signal.SIGINT)
    _, said = interrupted.communicate(timeout=SOON)
    assert said.rstrip().endswith("varcalc.progress.Interrupted: stopped; what was known by then is in `known`")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT to send to another process")
def test_the_interrupt_key_is_left_to_the_process_that_started_the_workers():
    with Workers(1) as workers:
        os.kill(workers.submit(os.getpid).result(), signal.SIGINT)  # a terminal sends it to everyone
        assert workers.submit(abs, -1).result() == 1


def test_workers_that_are_dismissed_leave_their_work():
    workers = Workers(1)
    task = workers.submit(time.sleep, LONG)
    workers.dismiss()
    assert isinstance(task.exception(timeout=SOON), BrokenExecutor)
    assert not multiprocessing.active_children()
