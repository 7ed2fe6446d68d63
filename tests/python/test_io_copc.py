"""COPC files, made here cell by cell from the layout of the format; queries against all points."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import surfabet as sb

laspy = pytest.importorskip("laspy")
lazrs = pytest.importorskip("lazrs")

SCALE = 0.001
SHIFT = np.array([500_000.0, 5_400_000.0, 100.0])
# A cube of 8 m with its octree of two levels below the root.
POINTS: NDArray[np.float64] = np.random.default_rng(1).integers(0, 8000, (3000, 3)) * SCALE + SHIFT
LEVEL = np.random.default_rng(2).choice(3, 3000, p=[0.1, 0.3, 0.6])
CLASSES = np.arange(3000) % 4 + 1


def records(rows: NDArray[np.intp]) -> bytes:
    """These points in point format 6."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.offsets, header.scales = SHIFT, np.full(3, SCALE)
    points = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
    for axis, name in enumerate("XYZ"):
        points[name] = np.rint((POINTS[rows, axis] - SHIFT[axis]) / SCALE).astype(np.int32)
    points["return_number"] = points["number_of_returns"] = np.ones(len(rows), np.uint8)
    points["classification"] = CLASSES[rows].astype(np.uint8)
    points["intensity"] = rows.astype(np.uint16)
    return bytes(points.memoryview())


def variable(user: bytes, number: int, data: bytes) -> bytes:
    return struct.pack("<H16sHH32s", 0, user, number, len(data), b"") + data


def octree(entries: list[bytes], root_at: int, edit: Any = None) -> tuple[bytes, int]:
    """The pages of the octree, and the bytes of the first; `edit` changes all."""
    # The second cell, of level 1, and what is below it are on a page of their own.
    key = struct.unpack("<4i", entries[1][:16])
    assert key[0] == 1
    below = [
        entry
        for entry in entries
        if (cell := struct.unpack("<4i", entry[:16]))[0] == 2
        and all(c >> 1 == k for c, k in zip(cell[1:], key[1:], strict=True))
    ]
    page = [entries[1], *below]
    rest = [entry for entry in entries if entry not in page]
    root_size = 32 * (len(rest) + 1)
    link = struct.pack("<4iQ2i", *key, root_at + root_size, 32 * len(page), -1)
    data = b"".join([rest[0], link, *rest[1:], *page])
    return (data if edit is None else edit(data, root_at)), root_size


def write_chunks(file: io.BytesIO, vlr: Any) -> list[bytes]:
    """Compresses each cell on its own; gives back the entries of the octree."""
    start_of_points = file.tell()
    compressor = lazrs.LasZipCompressor(file, vlr)
    compressor.reserve_offset_to_chunk_table()
    cells = np.floor((POINTS - SHIFT) / 8 * 2.0 ** LEVEL[:, None]).astype(int)
    keys = sorted({(int(k), *map(int, c)) for k, c in zip(LEVEL, cells, strict=True)})
    chunks = []
    for key in keys:
        rows = np.flatnonzero((key[0] == LEVEL) & (cells == key[1:]).all(axis=1))
        start = file.tell()
        compressor.compress_many(records(rows))
        if key != keys[-1]:
            compressor.finish_current_chunk()
        chunks.append((key, start, len(rows)))
    compressor.done()
    # The last chunk ends where the table of chunks begins.
    ends = [start for _, start, _ in chunks[1:]]
    ends += struct.unpack_from("<q", file.getvalue(), start_of_points)
    return [
        struct.pack("<4iQ2i", *key, start, end - start, count)
        for (key, start, count), end in zip(chunks, ends, strict=True)
    ]


def write_copc(path: Path, edit: Any = None) -> Path:
    """The file; `edit` changes the data of the octree."""
    vlr = lazrs.LazVlr.new_for_compression(6, 0, True)
    laszip = variable(b"laszip encoded", 22204, bytes(vlr.record_data()))
    points_at = 375 + 54 + 160 + len(laszip)
    file = io.BytesIO(bytes(points_at))
    file.seek(points_at)
    entries = write_chunks(file, vlr)
    file.seek(0, io.SEEK_END)
    extended_at = file.tell()
    root_at = extended_at + 60
    data, root_size = octree(entries, root_at, edit)
    file.write(struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(data), b"") + data)
    header = struct.pack("<4sHH16sBB32s32s", b"LASF", 0, 16, b"", 1, 4, b"", b"")
    header += struct.pack("<HHHIIBHI5I", 1, 2026, 375, points_at, 2, 6 | 0x80, 30, *[0] * 6)
    header += struct.pack("<6d", *[SCALE] * 3, *SHIFT)
    header += struct.pack("<6d", *np.ravel([POINTS.max(axis=0), POINTS.min(axis=0)], "F"))
    header += struct.pack("<QQIQ15Q", 0, extended_at, 1, len(POINTS), len(POINTS), *[0] * 14)
    middle = SHIFT + 4
    info = struct.pack("<5dQQ2d11Q", *middle, 4.0, 1.0, root_at, root_size, 0.0, 0.0, *[0] * 11)
    file.seek(0)
    file.write(header + variable(b"copc", 1, info) + laszip)
    path.write_bytes(file.getvalue())
    return path


def order(cloud: sb.PointCloud) -> NDArray[np.intp]:
    """The points' numbers, which their intensities are."""
    assert cloud.intensities is not None
    return np.sort(cloud.intensities.astype(int))


@pytest.fixture(scope="module", params=["copc.laz", "laz"])
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_copc(tmp_path_factory.mktemp("copc") / f"a.{request.param}")


def test_all_of_it(path: Path) -> None:
    cloud = sb.read(path)
    rows = cloud.intensities.astype(int)  # type: ignore[union-attr]
    np.testing.assert_array_equal(order(cloud), np.arange(3000))
    np.testing.assert_allclose(cloud.points, POINTS[rows], rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((1, 1, 1), (3, 4, 5)),
        ((-1e12, 0, 0), (1e12, 8, 1.5)),
        ((7.9, 7.9, 7.9), (9, 9, 9)),
        ((20, 20, 20), (30, 30, 30)),
    ],
)
@pytest.mark.parametrize("level", [None, 0, 1, 9])
def test_a_region_and_levels(path: Path, low: Any, high: Any, level: int | None) -> None:
    low, high = SHIFT + low, SHIFT + high
    inside = ((low - SCALE / 2 <= POINTS) & (high + SCALE / 2 >= POINTS)).all(axis=1)
    if level is not None:
        inside &= level >= LEVEL
    cloud = sb.read(path, box=(low, high), level=level)
    if inside.any():
        rows = cloud.intensities.astype(int)  # type: ignore[union-attr]
        np.testing.assert_allclose(cloud.points, POINTS[rows], rtol=0, atol=1e-4)
        np.testing.assert_array_equal(order(cloud), np.flatnonzero(inside))
    assert len(cloud) == inside.sum()


def test_levels_alone_with_classes(path: Path) -> None:
    with pytest.warns(sb.DroppedPointsWarning, match="left out"):
        cloud = sb.read(path, level=1, keep_class=[2])
    np.testing.assert_array_equal(order(cloud), np.flatnonzero((LEVEL <= 1) & (CLASSES == 2)))


def test_other_files_have_no_regions(tmp_path: Path) -> None:
    sb.write(tmp_path / "a.laz", sb.PointCloud(POINTS))
    box = (SHIFT, SHIFT + 1)
    with pytest.raises(sb.InvalidInputError, match=r"unknown option 'box' for las; .* copc has it"):
        sb.read(tmp_path / "a.laz", box=box)
    with pytest.raises(sb.FormatError, match="not a COPC file, of which box and level could be"):
        sb.read(tmp_path / "a.laz", "copc", box=box)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"box": (1, 2)}, "box is .* but must be two corners"),
        ({"box": ((1, 1, 1), (0, 2, 2))}, "box is .* but must be two corners"),
        ({"box": ((np.nan, 1, 1), (0, 2, 2))}, "box is .* but must be two corners"),
        ({"level": -1}, "level is -1, but must be an integer of at least 0"),
    ],
)
def test_wrong_options(path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(sb.InvalidInputError, match=message):
        sb.read(path, **options)


def replaced(at: int, form: str, *values: Any) -> Any:
    """An edit of the octree's data."""

    def edit(data: bytes, root_at: int) -> bytes:
        found = [root_at if value == "itself" else value for value in values]
        new = struct.pack(form, *found)
        return data[:at] + new + data[at + len(new) :]

    return edit


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (replaced(28, "<i", 2**31 - 1), "the octree has more points than the file"),
        (replaced(28, "<i", -5), "a cell of the octree has a negative size"),
        (replaced(16, "<Q", 2**63), "the octree has more points than the file"),
        (replaced(16, "<Q2i", "itself", 32, -1), "is no page"),
        (replaced(16, "<Q2i", 2**40, 32, -1), "is no page"),
        (replaced(32 + 16, "<Q", 600), "a page of the octree lacks its first cell|is no page|more"),
    ],
)
def test_octrees_that_lie(tmp_path: Path, edit: Any, message: str) -> None:
    lying = write_copc(tmp_path / "a.copc.laz", edit=edit)
    with pytest.raises(sb.FormatError, match=message):
        sb.read(lying, level=1)
