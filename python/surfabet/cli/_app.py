"""The verbs put together, and how each kind of failure leaves the process."""

from __future__ import annotations

import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from cyclopts import App, CycloptsError

import surfabet
from surfabet.cli._format import no_more_output
from surfabet.cli._options import COMMON, UsageError, in_own_words, spelled
from surfabet.cli.append import append
from surfabet.cli.compare import compare
from surfabet.cli.completion import completion
from surfabet.cli.compress import compress
from surfabet.cli.convert import convert
from surfabet.cli.decompress import decompress
from surfabet.cli.diff import diff
from surfabet.cli.evaluate import evaluate
from surfabet.cli.export import export
from surfabet.cli.find import find
from surfabet.cli.info import info
from surfabet.cli.locate import locate
from surfabet.cli.merge import merge
from surfabet.cli.places import places
from surfabet.cli.plan import plan
from surfabet.cli.recurring import recurring
from surfabet.cli.verify import verify
from surfabet.cli.view import view
from surfabet.errors import InvalidInputError

OK, FAILED, USAGE = 0, 1, 2

UNREAD = 141
"""What a shell says of a tool that a broken pipe has ended."""

app = App(
    name="surfabet",
    help="""Compact 3D models of point clouds, learned from what recurs in them.

    A scan goes in (ply, pcd, las, laz, e57, npz, text, KITTI bin, a ROS bag or a folder of RGB-D
    frames), a small `.sfb` file comes out, and from that a cloud again at any point spacing:

        surfabet compress room.ply room.sfb --resolution 0.01
        surfabet decompress room.sfb again.ply
        surfabet evaluate room.ply room.sfb

    `surfabet VERB --help` lists the options of a verb. All lengths are metres.
    """,
    help_format="markdown",
    version=surfabet.__version__,
    suppress_keyboard_interrupt=False,
    print_error=False,
    exit_on_error=False,
    result_action="return_value",
)
for verb in (
    compress,
    decompress,
    view,
    info,
    evaluate,
    compare,
    verify,
    find,
    recurring,
    locate,
    places,
    append,
    merge,
    diff,
    export,
    plan,
    convert,
    completion,
):
    app.command(verb)


def run(argv: Sequence[str]) -> int:
    """Parses and runs one command line; `surfabet.cli.main` says what it returns."""
    common = COMMON
    try:
        command, bound, _ = app.parse_args(argv)
        common = bound.arguments.get("common", COMMON)
        with _one_line_warnings():
            if common.threads is not None:
                surfabet.set_num_threads(common.threads)
            code = command(*bound.args, **bound.kwargs)
        with suppress(BrokenPipeError):
            # The job is done, and its exit code stands, whether or not somebody reads about it.
            _flush()
        # Most verbs either do their job or raise; `verify` answers.
        return OK if code is None else int(code)
    except CycloptsError as error:
        # The library's own formatting would be a frame of several lines.
        chain = " ".join(["surfabet", *(error.command_chain or ()), "--help"])
        _say_error(f"{error} See {chain}.")
        return USAGE
    except UsageError as error:
        _say_error(str(error))
        return USAGE
    except BrokenPipeError:
        # Whoever read the output has left before all of it was written.
        with suppress(BrokenPipeError):
            _flush()
        return UNREAD
    except Exception as error:
        if common.debug:
            traceback.print_exc()
        if (message := _wrong_option(error, argv)) is not None:
            _say_error(message)
            return USAGE
        _say_error(_message(error))
        return FAILED


def _flush() -> None:
    """Writes what is left of the output; where nobody reads it, the interpreter must not try so
    again at exit."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        no_more_output()
        raise


def _wrong_option(error: Exception, argv: Sequence[str]) -> str | None:
    """What is wrong with an option of the command line, in its spelling; None for other errors."""
    if not isinstance(error, InvalidInputError) or error.argument is None:
        return None
    # Of an argument with parts, such as sigma.angular_resolution, the parts have options.
    option = spelled(error.argument.rpartition(".")[2])
    if not any(word == option or word.startswith(f"{option}=") for word in argv):
        return None
    return f"{option} is {error.value}, but must be {error.requirement}"


def _say_error(message: str) -> None:
    print("surfabet: error:", " ".join(in_own_words(message).split()), file=sys.stderr)


def _message(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return f"out of memory {error}".rstrip()
    return str(error) or type(error).__name__


@contextmanager
def _one_line_warnings() -> Iterator[None]:
    def show(message: Warning | str, *_: object, **__: object) -> None:
        text = in_own_words(str(message))
        print("surfabet: warning:", " ".join(text.split()), file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield
