"""Ctrl-C while the command line imports the package: a line and an exit code, not a traceback.

Importing takes up to a second, and is done before `surfabet.cli.main` can catch anything. So it is
the first module that the package imports. Nothing is done in processes that only use the package.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

__all__ = ["INTERRUPTED", "MESSAGE", "restore"]

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

MESSAGE = "surfabet: interrupted"
"""What is said then."""


def _is_command() -> bool:
    """Whether this process is `surfabet` or `python -m surfabet`."""
    started = getattr(sys, "argv", [])[:1]
    if started == ["-m"]:
        # So it is while the module of -m is sought, for which its package is imported.
        words = sys.orig_argv
        after = (words[i + 1] for i, word in enumerate(words[:-1]) if word == "-m")
        return next(after, "").split(".")[0] == __package__
    return [os.path.basename(path) for path in started] in (["surfabet"], ["surfabet.exe"])


def _end(number: int, frame: FrameType | None) -> None:
    """Ends the process; nothing has begun that would be left unfinished."""
    if sys.stderr is not None:
        print(MESSAGE, file=sys.stderr, flush=True)
    os._exit(INTERRUPTED)


def _install() -> None:
    # Where the parent ignores interrupts, so do we; and a handler is set by the main thread only.
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_default and _is_command() and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, _end)


def restore() -> None:
    """Has Ctrl-C raise `KeyboardInterrupt` again, for whoever is ready to catch it."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


_install()
