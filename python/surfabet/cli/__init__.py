"""The command `surfabet`; a file per verb."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from surfabet import _interrupt

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line `argv`, by default that of the process.

    Returns
    -------
    int
        0: done; 1: the job failed, as with a corrupt file; 2: the command line makes no sense;
        130: interrupted by Ctrl-C; 141: whoever read the output left in its middle.
    """
    _open_streams()
    try:
        _interrupt.restore()
        return _run(argv)
    except KeyboardInterrupt:
        # Also while the modules of the command line are imported.
        print(_interrupt.MESSAGE, file=sys.stderr)
        return _interrupt.INTERRUPTED


def _open_streams() -> None:
    """Gives the process the streams that it was started without, as by `>&-`; what is said goes
    nowhere then."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115


def _run(argv: Sequence[str] | None) -> int:
    try:
        import cyclopts  # noqa: F401
        import rich  # noqa: F401
    except ImportError as error:
        print(
            f"surfabet: error: the command line needs the package {error.name}: "
            "pip install 'surfabet[cli]'",
            file=sys.stderr,
        )
        return 1
    from surfabet.cli._app import run

    return run(sys.argv[1:] if argv is None else list(argv))
