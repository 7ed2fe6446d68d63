"""PCD files made by hand, as the Point Cloud Library writes them, and broken ones."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from case_files import Reader, strict_reader
from surfabet._core import lzf_compress, lzf_decompress

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -6.75], [10.0, 0.0, 0.125]])


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    return strict_reader(tmp_path / "a.pcd")


def header(
    fields: str = "x y z",
    size: str = "4 4 4",
    type: str = "F F F",
    count: str | None = "1 1 1",
    width: int | str = 3,
    height: int | str = 1,
    viewpoint: str = "0 0 0 1 0 0 0",
    points: int | str | None = 3,
    data: str = "ascii",
    end: str = "\n",
) -> bytes:
    lines = ["# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7"]
    lines += [f"FIELDS {fields}", f"SIZE {size}", f"TYPE {type}"]
    lines += [] if count is None else [f"COUNT {count}"]
    lines += [f"WIDTH {width}", f"HEIGHT {height}", f"VIEWPOINT {viewpoint}"]
    lines += [] if points is None else [f"POINTS {points}"]
    return end.join([*lines, f"DATA {data}", ""]).encode()


ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS.tolist()).encode()
PACKED = POINTS.astype("<f4").tobytes()


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("count", ["1 1 1", None])
@pytest.mark.parametrize("points", [3, None])
def test_ascii(read: Reader, end: str, count: str | None, points: int | None) -> None:
    cloud = read(header(end=end, count=count, points=points) + ROWS.replace(b"\n", end.encode()))
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.attributes == []


def test_binary(read: Reader) -> None:
    np.testing.assert_array_equal(read(header(data="binary") + PACKED).points, POINTS)


def test_padding_and_fields_of_several_values(read: Reader) -> None:
    head = header(
        "x _ y z _ histogram intensity",
        "4 1 8 4 1 2 1",
        "F U F F U I U",
        "1 3 1 1 4 5 1",
        data="binary",
    )
    body = b"".join(
        struct.pack("<f3xdf4x5hB", x, y, z, *range(5), 40 + i) for i, (x, y, z) in enumerate(POINTS)
    )
    cloud = read(head + body)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_array_equal(cloud.intensities, [40, 41, 42])


def color_bits(colors: Sequence[tuple[int, int, int]], alpha: int) -> list[int]:
    return [alpha << 24 | r << 16 | g << 8 | b for r, g, b in colors]


COLORS = [(1, 2, 3), (255, 128, 0), (0, 0, 0)]


@pytest.mark.parametrize("name", ["rgb", "rgba"])
@pytest.mark.parametrize("type", ["F", "U", "I"])
@pytest.mark.parametrize("alpha", [0, 255])
def test_packed_colors_in_binary(read: Reader, name: str, type: str, alpha: int) -> None:
    # An alpha of 255 makes a float a NaN, whose bits must survive.
    body = b"".join(
        struct.pack("<3fI", *p, bits)
        for p, bits in zip(POINTS, color_bits(COLORS, alpha), strict=True)
    )
    cloud = read(
        header(f"x y z {name}", "4 4 4 4", f"F F F {type}", "1 1 1 1", data="binary") + body
    )
    np.testing.assert_array_equal(cloud.colors, COLORS)


@pytest.mark.parametrize("type", ["F", "U"])
def test_packed_colors_in_ascii(read: Reader, type: str) -> None:
    bits = color_bits(COLORS, 0)
    words = (
        [repr(float(b)) for b in np.array(bits, np.uint32).view(np.float32)]
        if type == "F"
        else list(map(str, bits))
    )
    body = "".join(f"{x} {y} {z} {w}\n" for (x, y, z), w in zip(POINTS, words, strict=True))
    cloud = read(header("x y z rgb", "4 4 4 4", f"F F F {type}", "1 1 1 1") + body.encode())
    np.testing.assert_array_equal(cloud.colors, COLORS)


def test_normals_and_curvature(read: Reader) -> None:
    head = header(
        "x y z intensity normal_x normal_y normal_z curvature",
        "4 " * 8,
        "F " * 8,
        "1 " * 8,
        data="binary",
    )
    body = b"".join(
        struct.pack("<8f", *p, 0.5, *n, 0.1) for p, n in zip(POINTS, np.eye(3), strict=True)
    )
    cloud = read(head + body)
    np.testing.assert_array_equal(cloud.normals, np.eye(3))
    np.testing.assert_array_equal(cloud.intensities, [0.5] * 3)


def test_viewpoint_unless_it_is_the_default(read: Reader) -> None:
    cloud = read(header(viewpoint="1.5 -2 3 1 0 0 0") + ROWS)
    np.testing.assert_array_equal(cloud.viewpoints, [[1.5, -2, 3]])
    np.testing.assert_array_equal(cloud.viewpoint_index, [0, 0, 0])
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert read(header() + ROWS).viewpoints is None


def test_organised_clouds_lose_their_gaps(tmp_path: Path) -> None:
    path = tmp_path / "a.pcd"
    rows = "1 2 3 7\nnan nan nan nan\n4 5 6 8\nnan nan nan 0\n"
    head = header("x y z rgb", "4 4 4 4", "F F F U", "1 1 1 1", 2, 2, points=4)
    path.write_bytes(head + rows.encode())
    with pytest.warns(sb.DroppedPointsWarning, match="dropped 2 of 4 points"):
        cloud = sb.read(path)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.colors, [[0, 0, 7], [0, 0, 8]])


def test_ranges_only_where_they_are_metres(read: Reader) -> None:
    body = b"".join(struct.pack("<3fI", *p, 1234) for p in POINTS)
    for type, expected in (("U", None), ("F", [np.uint32(1234).view(np.float32)] * 3)):
        head = header("x y z range", "4 4 4 4", f"F F F {type}", "1 1 1 1", data="binary")
        ranges = read(head + body).ranges
        assert (ranges is None) == (expected is None)
        if expected is not None:
            np.testing.assert_array_equal(ranges, expected)


def literal_runs(data: bytes) -> bytes:
    """LZF without any back reference."""
    runs = [data[i : i + 32] for i in range(0, len(data), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def test_compressed_by_field(read: Reader) -> None:
    columns = np.ascontiguousarray(POINTS.astype("<f4").T).tobytes()
    packed = literal_runs(columns)
    sizes = struct.pack("<II", len(packed), len(columns))
    cloud = read(header(data="binary_compressed") + sizes + packed)
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_lzf_back_references() -> None:
    # A literal "ab", then 2 + 2 bytes from two back, then 7 + 2 + 1 bytes from one back.
    packed = bytes([1]) + b"ab" + bytes([2 << 5, 1]) + bytes([7 << 5, 1, 0])
    assert lzf_decompress(packed, 16) == b"ab" + b"abab" + b"b" * 10


@pytest.mark.parametrize("n", [0, 1, 2, 3, 31, 32, 33, 1000, 100_000])
@pytest.mark.parametrize("kind", ["zeros", "noise", "ramp"])
def test_lzf_round_trip(n: int, kind: str) -> None:
    noise = np.random.default_rng(3).integers(0, 256, n, dtype=np.uint8)
    data = {"zeros": bytes(n), "noise": noise.tobytes(), "ramp": bytes(i % 251 for i in range(n))}
    packed = lzf_compress(data[kind])
    assert lzf_decompress(packed, n) == data[kind]
    assert len(packed) <= n + (n + 31) // 32


@pytest.mark.parametrize(
    ("packed", "size", "message"),
    [
        (b"", 1, "0 bytes of LZF data cannot expand to 1 bytes"),
        (bytes(10), 10**12, "10 bytes of LZF data cannot expand"),
        (bytes([31]) + b"ab", 32, "corrupt"),
        (bytes([1 << 5, 5]), 3, "corrupt"),
        (bytes([0]) + b"a" + bytes([7 << 5]), 10, "corrupt"),
        (bytes([0]) + b"a" + bytes([7 << 5, 255, 0]), 10, "more than 10 bytes"),
        (bytes([0]) + b"a", 5, "expands to 1 bytes instead of 5"),
    ],
)
def test_lzf_refuses_what_does_not_fit(packed: bytes, size: int, message: str) -> None:
    with pytest.raises(sb.InvalidInputError, match=message):
        lzf_decompress(packed, size)


COMPRESSED = header(data="binary_compressed")
BROKEN = {
    "no entries": (b"hello world\n", "line 1: not a PCD header: unknown entry 'hello'"),
    "ends early": (b"# .PCD\nVERSION 0.7\n", "line 2: the file ends inside the header"),
    "no fields": (b"VERSION 0.7\nWIDTH 1\nPOINTS 1\nTYPE\nSIZE\nDATA ascii\n", "names no fields"),
    "sizes": (header(size="4 4"), "SIZE has 2 values where 3 are due"),
    "no size": (b"FIELDS x y z\nTYPE F F F\nDATA ascii\n", "the header has no SIZE"),
    "half": (header(size="2 4 4") + ROWS, "line 5: no type 'F' of size 2"),
    "type": (header(type="F F Q") + ROWS, "line 5: no type 'Q' of size 4"),
    "negative": (header(width=-3) + ROWS, "WIDTH is '-3'"),
    "mismatch": (header(width=2) + ROWS, "POINTS is 3, but WIDTH x HEIGHT is 2 x 1"),
    "encoding": (header(data="zip") + ROWS, "line 11: DATA is 'zip'; known are ascii, binary"),
    "viewpoint": (header(viewpoint="1 2 3") + ROWS, "VIEWPOINT must be seven numbers"),
    "no z": (header("x y w") + ROWS, "no columns x, y and z"),
    "billions": (
        header(width=10**12, points=10**12, data="binary") + PACKED,
        "1000000000000 points take 12000000000000 bytes, but the file has 36 left",
    ),
    "billions of text": (header(width=10**12, points=10**12) + ROWS, "points take at least"),
    "billions of values": (header(count="1 1 999999999") + ROWS, "COUNT is '999999999'"),
    "truncated": (header(data="binary") + PACKED[:-1], "3 points take 36 bytes, but"),
    "too few rows": (header() + ROWS[:-16] + b"1234567890123456", "line 1[34]: "),
    "not a number": (header() + b"1 2 3\n4 five 6\n7 8 9\n", "line 13: cannot read a row"),
    "no sizes": (COMPRESSED + bytes(7), "sizes of compressed data take 8 bytes"),
    "wrong size": (COMPRESSED + struct.pack("<II", 5, 35) + bytes(5), "3 points take 36"),
    "packed truncated": (COMPRESSED + struct.pack("<II", 50, 36) + bytes(5), "takes 50 bytes"),
    "bomb": (
        header(width=10**8, points=10**8, data="binary_compressed")
        + struct.pack("<II", 100, 1_200_000_000)
        + bytes(100),
        r"byte \d+: 100 bytes of LZF data cannot expand to 1200000000 bytes",
    ),
    "corrupt": (COMPRESSED + struct.pack("<II", 4, 36) + b"\x20\x05" * 2, "LZF data is corrupt"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_named_with_the_place(tmp_path: Path, case: str) -> None:
    data, message = BROKEN[case]
    path = tmp_path / "broken.pcd"
    path.write_bytes(data)
    with pytest.raises(sb.FormatError, match=message) as raised:
        sb.read(path)
    assert str(path) in str(raised.value)
