"""Files: errors that say where, writing in one piece, packages asked for only when needed."""

from __future__ import annotations

import errno
import importlib
import inspect
import os
import re
import secrets
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from surfabet.errors import FormatError, MissingDependencyError, wrong_type, wrong_value

# No line of a header or of a table of numbers comes near this.
LONGEST_LINE = 1 << 16
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_CONTROL_BYTES = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
# A temporary path, and the path that the user knows it by.
_CALLED: ContextVar[tuple[str, str] | None] = ContextVar("called", default=None)

T = TypeVar("T")


def format_error(
    path: Path, problem: str, *, byte: int | None = None, line: int | None = None
) -> FormatError:
    """The error for a file that is not what it claims to be, with the place where that shows."""
    place = f", byte {byte}" if byte is not None else f", line {line}" if line is not None else ""
    return FormatError(f"{path}{place}: {problem}")


def _in_own_words(message: Any) -> Any:
    """A message with the path that the user knows in place of a temporary one."""
    names = _CALLED.get()
    return message.replace(*names) if names and isinstance(message, str) else message


@contextmanager
def called(temporary: Path, path: Path) -> Iterator[Callable[[Any], Any]]:
    """Warnings about the temporary file name `path`; gives what does so to other messages."""
    token = _CALLED.set((os.fspath(temporary), os.fspath(path)))
    try:
        yield _in_own_words
    finally:
        _CALLED.reset(token)


def warn(message: str, category: type[Warning]) -> None:
    """Warns at the line of the caller outside this package."""
    level = 1
    frame = inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").startswith("surfabet.io"):
        frame = frame.f_back
        level += 1
    warnings.warn(_in_own_words(message), category, stacklevel=level)


def optional_module(name: str, requirement: str, purpose: str) -> Any:
    """Imports `name`, or says which package to install for `purpose`."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingDependencyError(
            f"{purpose} needs the package {name}: pip install '{requirement}' "
            "(or all formats at once: pip install 'surfabet[io,ros]')"
        ) from error


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place if the block succeeds, else goes."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(f"{path} is a directory; give the name of a file")
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(6)}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def existing(path: Path) -> Path:
    """The path of a file or folder that is there.

    Raises
    ------
    FileNotFoundError
        In the words of the system, as by the functions that open files.
    """
    if not path.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return path


def path_of(argument: str, value: str | os.PathLike[str]) -> Path:
    """The path that an argument gives.

    Raises
    ------
    InvalidTypeError
        It is none.
    """
    if not isinstance(value, str | os.PathLike):
        raise wrong_type(argument, value, "a path")
    return Path(value)


def is_same_file(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> bool:
    """Whether both paths are of one file that is there, by whatever names."""
    first, second = Path(a), Path(b)
    return first.exists() and second.exists() and first.samefile(second)


def export(
    path: str | os.PathLike[str], thing: T, writers: Mapping[str, Callable[[Path, T], None]]
) -> int:
    """Writes a thing by the one of its writers that has the ending of the path; its size in bytes.

    Raises
    ------
    InvalidInputError
        No writer has that ending.
    """
    target = path_of("path", path)
    write = writers.get(target.suffix.lower())
    if write is None:
        known = ", ".join(sorted(writers))
        raise wrong_value("path", str(target), f"a name that ends in one of {known}")
    write(target, thing)
    return target.stat().st_size


class Lines:
    """The lines of an open file from its position on, numbered and bounded in length."""

    def __init__(self, path: Path, file: BinaryIO, number: int = 0) -> None:
        self.path = path
        self.file = file
        self.number = number

    def next(self) -> bytes | None:
        """The next line without its end, or `None` at the end of the file."""
        line = self.file.readline(LONGEST_LINE + 1)
        if not line:
            return None
        self.number += 1
        if len(line) > LONGEST_LINE:
            raise format_error(
                self.path, f"the line is longer than {LONGEST_LINE} bytes", line=self.number
            )
        return line.rstrip(b"\r\n")

    def text(self) -> str | None:
        """The next line as text, for headers: UTF-8, else Latin-1 as old exporters write it."""
        line = self.next()
        if line is None:
            return None
        if self.number == 1:
            line = line.removeprefix(_BYTE_ORDER_MARK)
        if _CONTROL_BYTES.search(line):
            raise format_error(
                self.path, "the header holds bytes that are not text", line=self.number
            )
        try:
            return line.decode("utf-8")
        except UnicodeDecodeError:
            return line.decode("latin-1")

    def filled(self, count: int) -> Iterator[str]:
        """The next `count` lines that are not blank."""
        while count > 0:
            line = self.next()
            if line is None:
                return
            if not line.isspace() and line:
                count -= 1
                yield line.decode("latin-1")


def remaining(file: BinaryIO) -> int:
    """Bytes between the position of an open file and its end."""
    return os.fstat(file.fileno()).st_size - file.tell()
