"""Files behind a URL, read in parts through fsspec."""

from __future__ import annotations

import io
import os
from typing import Any

from surfabet.errors import FormatError, MissingDependencyError

__all__ = ["RemoteFile", "is_url"]


def is_url(source: object) -> bool:
    """True for text like `https://host/map.sfb` or `s3://bucket/map.sfb`."""
    return isinstance(source, str) and "://" in source


class RemoteFile(io.RawIOBase):
    """A file behind a URL as a seekable object that fetches exactly the bytes that are read."""

    def __init__(self, url: str) -> None:
        try:
            import fsspec
        except ImportError:
            raise MissingDependencyError(
                f"reading {url} needs the package fsspec: pip install 'surfabet[remote]'"
            ) from None
        self._url = url
        try:
            self._system, self._path = fsspec.core.url_to_fs(url)
        except ImportError as error:
            raise MissingDependencyError(f"reading {url} needs another package: {error}") from None
        try:
            size = self._system.size(self._path)
        except FileNotFoundError as error:
            # Of a server that is not reached fsspec says so, too.
            cause = error.__cause__
            if not isinstance(cause, OSError) or isinstance(cause, FileNotFoundError):
                raise
            raise ConnectionError(f"{url}: {cause}") from error
        if size is None:
            raise FormatError(f"{url}: the server does not give the size of the file")
        self._size: int = size
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        self._at = max(0, start + offset)
        return self._at

    def read(self, size: int = -1) -> bytes:
        end = self._size if size < 0 else min(self._at + size, self._size)
        if end <= self._at:
            return b""
        data: Any = self._system.cat_file(self._path, start=self._at, end=end)
        if len(data) != end - self._at:
            raise FormatError(
                f"{self._url}: the server gave {len(data):,} bytes in the place of the "
                f"{end - self._at:,} that were asked for; it must support ranges"
            )
        self._at = end
        return bytes(data)
