"""Packed files are read under any name, and those that grow beyond all measure are refused."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import struct
import tarfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import case_files as made
import surfabet as sb
from case_files import Room, peak_memory
from surfabet.cli import main
from surfabet.io import _packed

ROOM = Room()
PLY = made.ply(ROOM.columns() | ROOM.rgb())
Pack = Callable[[bytes], bytes]


def zstd(data: bytes) -> bytes:
    return bytes(pytest.importorskip("backports.zstd").compress(data))


PACKERS: dict[str, Pack] = {
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
    "zst": zstd,
}


def assert_room(cloud: sb.PointCloud) -> None:
    np.testing.assert_allclose(cloud.points, ROOM.points, rtol=0, atol=1e-5)


@pytest.mark.parametrize("suffix", PACKERS)
@pytest.mark.parametrize("name", ["scan.ply", "scan.ply.{}", "SCAN.{}", "scan.PLY.{}"])
def test_any_name(suffix: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / name.format(suffix)
    path.write_bytes(PACKERS[suffix](PLY))
    cloud = sb.read(path)
    assert_room(cloud)
    np.testing.assert_array_equal(cloud.colors, ROOM.colors)


@pytest.mark.parametrize(
    "suffix", [".ply", ".pcd", ".las", ".laz", ".e57", ".npz", ".npy", ".xyz", ".csv", ".mcap"]
)
def test_every_format(suffix: str, tmp_path: Path) -> None:
    plain = tmp_path / f"a{suffix}"
    if suffix == ".npy":
        np.save(plain, ROOM.points)
    else:
        for module in {".las": ["laspy", "lazrs"], ".e57": ["pye57"], ".mcap": ["rosbags"]}.get(
            suffix.replace("laz", "las"), []
        ):
            pytest.importorskip(module)
        sb.write(plain, sb.PointCloud(ROOM.points))
    packed = tmp_path / f"b{suffix}.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    # The packed bytes under the format's own name, too.
    named = tmp_path / f"c{suffix}"
    named.write_bytes(packed.read_bytes())
    for path in (packed, named):
        np.testing.assert_array_equal(sb.read(path).points, sb.read(plain).points)


def test_texts_without_a_suffix_need_a_format(tmp_path: Path) -> None:
    path = tmp_path / "points.gz"
    path.write_bytes(gzip.compress(b"1 2 3\n4 5 6\n"))
    with pytest.raises(sb.FormatError, match="unknown suffix ''"):
        sb.read(path)
    assert len(sb.read(path, "xyz")) == 2


def test_several_streams_follow_each_other(tmp_path: Path) -> None:
    rows = [f"{i} {i * 7 % 5} {i * 3 % 7}\n".encode() for i in range(100)]
    for suffix, pack in PACKERS.items():
        path = tmp_path / f"a.xyz.{suffix}"
        path.write_bytes(pack(b"".join(rows[:50])) + pack(b"".join(rows[50:])))
        assert len(sb.read(path)) == 100


def test_messages_name_the_packed_file(tmp_path: Path) -> None:
    columns = ROOM.columns()
    columns["x"] = columns["x"].copy()
    columns["x"][0] = np.nan
    path = tmp_path / "scan.ply.gz"
    path.write_bytes(gzip.compress(made.ply(columns)))
    with pytest.warns(sb.DroppedPointsWarning) as caught:
        sb.read(path)
    assert str(caught[0].message).startswith(f"{path}: ")
    path.write_bytes(gzip.compress(PLY[:-1]))
    with pytest.raises(sb.FormatError) as error:
        sb.read(path)
    assert str(error.value).startswith(f"{path}, byte ")


@pytest.mark.parametrize("suffix", PACKERS)
def test_damage_is_told(suffix: str, tmp_path: Path) -> None:
    data = PACKERS[suffix](PLY)
    path = tmp_path / "scan.ply"
    for broken in (data[: len(data) // 2], data[:-9] + b"\xaa" * 9):
        path.write_bytes(broken)
        with pytest.raises(sb.FormatError, match=r"scan\.ply"):
            sb.read(path)


def _many(pack: Callable[[], Any], megabytes: int) -> bytes:
    """That many megabytes of spaces, packed part by part."""
    compressor = pack()
    part = b" " * (1 << 20)
    return b"".join(compressor.compress(part) for _ in range(megabytes)) + compressor.flush()


BOMBS: dict[str, Callable[[int], bytes]] = {
    "gz": lambda n: _many(lambda: zlib.compressobj(9, zlib.DEFLATED, 31), n),
    "bz2": lambda n: _many(bz2.BZ2Compressor, n),
    "xz": lambda n: _many(lambda: lzma.LZMACompressor(preset=0), n),
    "zst": lambda n: zstd(b" " * (n << 20)),
}


@pytest.mark.parametrize("suffix", BOMBS)
def test_a_bomb_is_refused_before_it_is_unpacked(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.xyz"
    path.write_bytes(BOMBS[suffix](80))
    written: list[int] = []
    parts = _packed._unpacked_parts
    before = peak_memory()

    def counted(path: Path, file: io.BufferedReader) -> Iterator[bytes]:
        for part in parts(path, file):
            written.append(len(part))
            yield part

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_packed, "_unpacked_parts", counted)
        with pytest.raises(sb.FormatError, match="as those of no scan do; if it is one, unpack it"):
            sb.read(path)
    assert max(written) <= 1 << 20
    assert sum(written) <= (1 << 26) + (2 << 20)
    assert peak_memory() - before < 200_000


@pytest.mark.parametrize(("packed", "unpacked", "refused"), [
    (1, 1 << 26, False),
    (1, (1 << 26) + 1, True),
    (1 << 20, 200 << 20, False),
    (1 << 20, (200 << 20) + 1, True),
])  # fmt: skip
def test_both_sides_of_the_limit(packed: int, unpacked: int, refused: bool) -> None:
    assert _packed.is_bomb(packed, unpacked) == refused


def test_a_dictionary_larger_than_any_level_needs_is_refused(tmp_path: Path) -> None:
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 28}]
    path = tmp_path / "scan.ply"
    path.write_bytes(lzma.compress(PLY, filters=filters))
    with pytest.raises(sb.FormatError, match="damaged xz"):
        sb.read(path)


def test_archives_and_packed_packs_are_named(tmp_path: Path) -> None:
    inner = io.BytesIO()
    with tarfile.open(fileobj=inner, mode="w") as archive:
        archive.addfile(tarfile.TarInfo("scan.ply"), io.BytesIO())
    path = tmp_path / "scan.tgz"
    path.write_bytes(gzip.compress(inner.getvalue()))
    with pytest.raises(sb.FormatError, match="is a packed tar archive: unpack it"):
        sb.read(path)
    path.write_bytes(gzip.compress(bz2.compress(PLY)))
    with pytest.raises(sb.FormatError, match="is packed twice, and bzip2 within"):
        sb.read(path)


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scan.ply.gz"
    path.write_bytes(gzip.compress(PLY))
    assert main(["info", str(path)]) == 0
    assert "ply" in capsys.readouterr().out
    assert main(["convert", str(path), str(tmp_path / "a.laz"), "--quiet"]) == 0
    assert len(sb.read(tmp_path / "a.laz")) == len(ROOM.points)


def test_topics_of_a_packed_bag(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    sb.write(tmp_path / "a.mcap", sb.PointCloud(ROOM.points))
    path = tmp_path / "b.mcap.zst"
    path.write_bytes(zstd((tmp_path / "a.mcap").read_bytes()))
    assert sb.io.list_topics(path) == sb.io.list_topics(tmp_path / "a.mcap")
    assert len(sb.io.read_bag(path, fused=False)) == 1


def test_floats_that_begin_like_gzip_are_not_taken_for_it(tmp_path: Path) -> None:
    """Two of the three bytes of the mark are a small float's."""
    path = tmp_path / "scan.bin"
    points = np.zeros((40, 4), np.float32)
    points[:, :3] = ROOM.points[:40]
    points[:, 3] = ROOM.intensities[:40]
    data = bytearray(points.astype("<f4").tobytes())
    data[:2] = b"\x1f\x8b"
    path.write_bytes(bytes(data))
    assert struct.unpack_from("<H", data)[0] == 0x8B1F
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(sb.read(path)) == 40
