"""The command ``varcalc``, which Ctrl-C ends with one sentence from its first moment on.

It lies beside the package: whatever lies within is read after ``varcalc`` itself, which takes up to a second, and a key
pressed meanwhile would be answered by whatever was being imported. ``python -m varcalc`` reads ``varcalc`` before it
comes here, which therefore calls ``hear`` first of all.
"""

import os
import signal
import sys

EXIT_AFTER_INTERRUPT = 130
"""Exit status after Ctrl-C, as shells have it: 128 and the number of the signal."""


def main() -> None:
    """Carry out what the command line says."""
    hear()
    from varcalc.cli import main as commands

    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    commands()


def hear() -> None:
    """Let Ctrl-C end the process in one sentence, until ``main`` has imported the commands."""
    # one who ignores the key, as a shell does for what it starts in the background, goes on ignoring it
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(_number: int, _frame: object) -> None:
    """End at once: nothing has begun, and an exception would be lost in, or changed by, what is half imported."""
    if sys.stderr is not None:
        os.write(sys.stderr.fileno(), b"stopped before anything had begun\n")
    os._exit(EXIT_AFTER_INTERRUPT)
