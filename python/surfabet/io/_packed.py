"""Files that are packed for transport, by gzip, bzip2, xz or zstd, under any name.

They are unpacked part by part into a temporary file, so memory is bounded. One that grows beyond
all that scans do is refused while it is read.
"""

from __future__ import annotations

import bz2
import gzip
import importlib
import lzma
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from surfabet.errors import FormatError, InvalidInputError
from surfabet.io._files import called, format_error, optional_module

LARGEST_RATIO = 200
"""Text with most cells empty packs to a fiftieth; what packs to less than this holds no scan."""
FREE_BYTES = 1 << 26
"""What anything may grow to: small files of equal points pack better."""
_PART = 1 << 20
# Enough for the marks of all formats, of COPC and of tar.
_START = 512
_TAR_AT, _TAR = 257, b"ustar"
# Of dictionaries: what the highest level of xz takes, and twice that.
_LARGEST_MEMORY = 1 << 27
_SUFFIXES = {".gz": "", ".bz2": "", ".xz": "", ".zst": "", ".zstd": "", ".tgz": ".tar"}


def zstd_module() -> Any:
    """Python's own module, or the one for older versions, which reading ROS bags needs too."""
    try:
        return importlib.import_module("compression.zstd")
    except ImportError:
        return optional_module("backports.zstd", "backports.zstd", "unpacking zstd")


def is_bomb(packed: int, unpacked: int) -> bool:
    """Whether so many bytes made of so many are more than any scan packs to."""
    return unpacked > max(FREE_BYTES, LARGEST_RATIO * packed)


def _gzip_parts(file: BinaryIO) -> Iterator[bytes]:
    with gzip.GzipFile(fileobj=file) as unpacked:
        while part := unpacked.read(_PART):
            yield part


def parts_of(file: BinaryIO, new: Callable[[], Any]) -> Iterator[bytes]:
    """The contents of all streams in a file, with a new decoder for each."""
    decoder = new()
    while True:
        data = b""
        if decoder.eof:
            # Zeros may fill the space between streams.
            data = (decoder.unused_data or file.read(_PART)).lstrip(b"\0")
            if not data:
                return
            decoder = new()
        elif decoder.needs_input and not (data := file.read(_PART)):
            raise EOFError("the file ends inside the packed data")
        yield decoder.decompress(data, _PART)


def _xz_decoder() -> lzma.LZMADecompressor:
    return lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=_LARGEST_MEMORY)


_KINDS: dict[bytes, tuple[str, str, Callable[[BinaryIO], Iterator[bytes]]]] = {
    b"\x1f\x8b\x08": ("gzip", "gunzip", _gzip_parts),
    b"BZh": ("bzip2", "bunzip2", lambda file: parts_of(file, bz2.BZ2Decompressor)),
    b"\xfd7zXZ\x00": ("xz", "unxz", lambda file: parts_of(file, _xz_decoder)),
    b"\x28\xb5\x2f\xfd": (
        "zstd",
        "unzstd",
        lambda file: parts_of(file, zstd_module().ZstdDecompressor),
    ),
}


def _kind(start: bytes) -> tuple[str, str, Callable[[BinaryIO], Iterator[bytes]]] | None:
    return next((kind for magic, kind in _KINDS.items() if start.startswith(magic)), None)


def _unpacked_parts(path: Path, file: BinaryIO) -> Iterator[bytes]:
    """What a packed file holds, as long as it is not too much."""
    kind = _kind(file.read(_START))
    file.seek(0)
    assert kind is not None
    name, tool, parts = kind
    total = 0
    try:
        for part in parts(file):
            total += len(part)
            if is_bomb(file.tell(), total):
                raise format_error(
                    path,
                    f"{file.tell():,} bytes of {name} grow to more than {total:,}, as those of no "
                    f"scan do; if it is one, unpack it with {tool}",
                    byte=file.tell(),
                )
            yield part
    except (FormatError, ImportError, MemoryError):
        raise
    except Exception as error:
        # gzip raises OSError, EOFError and zlib.error, and each of the others one of its own.
        raise format_error(path, f"damaged {name}: {error}", byte=file.tell()) from error


def is_packed(path: Path) -> bool:
    """Whether a file is packed, by its first bytes."""
    with path.open("rb") as file:
        return _kind(file.read(_START)) is not None


def unpacked_name(path: Path) -> str:
    """The name of a packed file without the suffix that says so."""
    if (other := _SUFFIXES.get(path.suffix.lower())) is None:
        return path.name
    return path.stem + other


def first_bytes(path: Path) -> bytes:
    """The first bytes of a file, unpacked if it is packed."""
    with path.open("rb") as file:
        start = file.read(_START)
        if _kind(start) is None:
            return start
        file.seek(0)
        start = b""
        for part in _unpacked_parts(path, file):
            start += part
            if len(start) >= _START:
                break
    start = start[:_START]
    if (kind := _kind(start)) is not None:
        raise format_error(path, f"is packed twice, and {kind[0]} within: unpack it", byte=0)
    if start[_TAR_AT:].startswith(_TAR):
        raise format_error(path, "is a packed tar archive: unpack it, as with tar xf", byte=0)
    return start


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """The file itself, or a temporary one with its contents, which messages call by its name."""
    if path.is_dir() or not is_packed(path):
        yield path
        return
    first_bytes(path)
    with tempfile.TemporaryDirectory(prefix="surfabet-") as folder:
        temporary = Path(folder) / unpacked_name(path)
        with path.open("rb") as file, temporary.open("xb") as target:
            for part in _unpacked_parts(path, file):
                target.write(part)
        with called(temporary, path) as in_own_words:
            try:
                yield temporary
            except (FormatError, InvalidInputError) as error:
                error.args = tuple(map(in_own_words, error.args))
                raise
