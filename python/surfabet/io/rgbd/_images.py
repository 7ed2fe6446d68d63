"""Images of depth and colour: PNG, TIFF and JPEG by Pillow, PFM and NPY here."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surfabet.errors import FormatError
from surfabet.io._files import format_error

DEPTH_SUFFIXES = (".png", ".tif", ".tiff", ".pgm", ".pfm", ".npy")
_COLOR_SUFFIXES = (".jpg", ".jpeg", ".png")
# Images larger than this on a side are no depth cameras'.
_LARGEST_SIDE = 1 << 13
_DEPTH_MODES = ("I;16", "I;16L", "I;16B", "I", "L", "F")
_COLOR_MODES = ("RGB", "RGBA", "L", "P")
_DEEP_GREY_MODES = ("I;16", "I;16B")
# A PNG file: signature, length and name of the first chunk, width, height; bits per channel.
_PNG_SIGNATURE, _PNG_BITS_AT = b"\x89PNG\r\n\x1a\n", 24
_PFM_HEADER = re.compile(rb"Pf\s+(\d{1,5})\s+(\d{1,5})\s+(-?[0-9.eE+-]{1,20})\s")


def depth_images(folder: Path) -> list[Path]:
    """The depth images in a folder."""
    return [path for path in folder.iterdir() if path.suffix.lower() in DEPTH_SUFFIXES]


def color_images(folder: Path) -> list[Path]:
    """The colour images in a folder, which need not exist."""
    if not folder.is_dir():
        return []
    return [path for path in folder.iterdir() if path.suffix.lower() in _COLOR_SUFFIXES]


def _check_size(path: Path, width: int, height: int) -> None:
    if max(width, height) > _LARGEST_SIDE:
        raise format_error(path, f"an image of {(width, height)} pixels is too large")


def _by_pillow(
    pillow: Any, path: Path, modes: tuple[str, ...], convert: Callable[[Any], NDArray[Any]]
) -> NDArray[Any]:
    with pillow.open(path) as image:
        _check_size(path, *image.size)
        if image.mode not in modes:
            raise format_error(
                path, f"the image has mode {image.mode}; expected {' or '.join(modes)}"
            )
        return convert(image)


def _from_pfm(path: Path) -> NDArray[Any]:
    """A portable float map: rows from the bottom up, the sign of the scale tells the byte order."""
    with path.open("rb") as file:
        head = _PFM_HEADER.match(file.read(64))
        if head is None:
            raise format_error(path, "no header of a PFM image of one channel", byte=0)
        width, height, scale = int(head[1]), int(head[2]), float(head[3])
        _check_size(path, width, height)
        expected, found = head.end() + 4 * width * height, path.stat().st_size
        if found != expected:
            raise format_error(
                path, f"{width} x {height} pixels take {expected} bytes, not {found}"
            )
        file.seek(head.end())
        values = np.fromfile(file, "<f4" if scale < 0 else ">f4", width * height)
    return values.reshape(height, width)[::-1].astype(np.float32)


def _from_npy(path: Path) -> NDArray[Any]:
    # A map of the file cannot be larger than the file.
    image = np.load(path, mmap_mode="r", allow_pickle=False)
    if image.ndim != 2 or image.dtype.kind not in "fiu":
        raise format_error(path, f"an array of shape {image.shape} and {image.dtype} is no image")
    _check_size(path, image.shape[1], image.shape[0])
    return np.array(image, np.float32 if image.dtype.kind == "f" else image.dtype)


def _decoded(path: Path, decode: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    try:
        return decode()
    except FileNotFoundError:
        raise format_error(path, "the image is missing") from None
    except FormatError:
        raise
    except Exception as error:
        # Pillow raises OSError, SyntaxError, ValueError and more for broken images.
        raise format_error(path, f"cannot decode the image: {error}") from error


def load_depth(pillow: Any, path: Path) -> NDArray[Any]:
    """A depth image, (height, width): integers, or float32."""
    match path.suffix.lower():
        case ".pfm":
            return _decoded(path, lambda: _from_pfm(path))
        case ".npy":
            return _decoded(path, lambda: _from_npy(path))
    return _decoded(path, lambda: _by_pillow(pillow, path, _DEPTH_MODES, np.asarray))


def load_color(pillow: Any, path: Path) -> NDArray[np.uint8]:
    """A colour image, (height, width, 3); of more than 8 bits per channel the highest 8."""
    modes = _COLOR_MODES + _DEEP_GREY_MODES
    return _decoded(path, lambda: _by_pillow(pillow, path, modes, _rgb))


def _rgb(image: Any) -> NDArray[np.uint8]:
    """Red, green and blue of an image that is open."""
    if image.mode in _DEEP_GREY_MODES:
        grey = np.asarray(image) >> 8
        return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)
    return np.asarray(image.convert("RGB"))


def has_deep_colors(path: Path) -> bool:
    """Whether a colour image is a PNG file of more than 8 bits per channel."""
    try:
        with path.open("rb") as file:
            head = file.read(_PNG_BITS_AT + 1)
    except OSError:
        return False
    return head.startswith(_PNG_SIGNATURE) and len(head) > _PNG_BITS_AT and head[-1] > 8
