"""Truncated and altered files: a cloud or a FormatError, in bounded memory, never anything else."""

from __future__ import annotations

import tracemalloc
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import surfabet as sb

ENCODINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "ply": (".ply", {}),
    "ply-ascii": (".ply", {"ascii": True}),
    "pcd": (".pcd", {}),
    "pcd-ascii": (".pcd", {"encoding": "ascii"}),
    "pcd-compressed": (".pcd", {"encoding": "binary_compressed"}),
    "npz": (".npz", {}),
    "xyz": (".xyz", {}),
    "csv": (".csv", {}),
    "las": (".las", {}),
    "laz": (".laz", {}),
    "e57": (".e57", {}),
}
OWN = [name for name in ENCODINGS if name not in ("las", "laz", "e57")]
PACKAGES = {"las": "laspy", "laz": "lazrs", "e57": "pye57"}
# A file of a few kilobytes; the interpreter and numpy take their share of this.
MOST_MEMORY = 64 << 20


def small_file(folder: Path, name: str) -> Path:
    """A file of three points with every attribute, extra columns and a reference system."""
    pytest.importorskip(PACKAGES.get(name, "numpy"))
    suffix, options = ENCODINGS[name]
    path = folder / f"small{suffix}"
    if not path.exists():
        rng = np.random.default_rng(0)
        cloud = sb.PointCloud(
            rng.normal(size=(3, 3)),
            colors=rng.integers(0, 256, (3, 3), dtype=np.uint8),
            intensities=np.arange(3),
            normals=np.eye(3),
            ranges=rng.uniform(size=3),
            viewpoints=rng.normal(size=(2, 3)),
            viewpoint_index=np.arange(3) % 2,
            extra={
                "classification": np.arange(3, dtype=np.uint8),
                "gps_time": 3e8 + np.arange(3),
                "key": np.arange(3) + 2**62,
            },
            crs='PROJCS["zone",UNIT["metre",1]]' if suffix != ".las" else "EPSG:25832",
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sb.LostAttributeWarning)
            sb.write(path, cloud, **options)
    return path


def attempt(path: Path, data: bytes) -> sb.PointCloud | None:
    """The cloud of altered bytes, or `None` after a FormatError that names the file."""
    path.write_bytes(data)
    tracemalloc.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return sb.read(path)
    except sb.FormatError as error:
        if str(path) not in str(error):
            raise AssertionError(f"{error} does not name the file") from error
        return None
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < MOST_MEMORY


@pytest.mark.parametrize("name", OWN)
def test_truncation_at_every_byte(tmp_path: Path, name: str) -> None:
    path = small_file(tmp_path, name)
    data = path.read_bytes()
    other = path.with_name("cut" + path.suffix)
    for size in range(len(data)):
        cloud = attempt(other, data[:size])
        if name in ("ply", "pcd", "pcd-compressed", "npz"):
            assert cloud is None, f"{size} of {len(data)} bytes were taken for a whole file"
        elif cloud is not None and name not in ("xyz", "csv"):
            # All that text may lack unseen is digits of its last number.
            assert len(cloud) == 3
            assert size > len(data) - 25


@pytest.mark.parametrize("name", PACKAGES)
def test_truncation_in_formats_of_other_packages(tmp_path: Path, name: str) -> None:
    path = small_file(tmp_path, name)
    data = path.read_bytes()
    other = path.with_name("cut" + path.suffix)
    for size in range(0, len(data), 41):
        assert attempt(other, data[:size]) is None


EDITS = st.lists(
    st.tuples(
        st.floats(0, 1, exclude_max=True),
        st.one_of(st.integers(0, 255), st.sampled_from([0, 9, 10, 32, 45, 48, 57, 127, 255])),
        st.sampled_from(["set", "insert", "delete"]),
    ),
    min_size=1,
    max_size=8,
)


def altered(data: bytes, edits: list[tuple[float, int, str]], within: int) -> bytes:
    """The bytes after edits, half of them in the first `within` bytes, where headers are."""
    changed = bytearray(data)
    for place, value, kind in edits:
        reach = within if place < 0.5 else len(data)
        at = int(2 * (place % 0.5) * min(reach, len(changed)))
        if kind == "insert":
            changed.insert(at, value)
        elif at < len(changed):
            if kind == "set":
                changed[at] = value
            else:
                del changed[at]
    return bytes(changed)


COMMON = settings(
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.mark.parametrize("name", OWN)
@settings(COMMON, max_examples=150)
@given(edits=EDITS)
def test_altered_bytes(tmp_path: Path, name: str, edits: list[tuple[float, int, str]]) -> None:
    path = small_file(tmp_path, name)
    attempt(path.with_name("altered" + path.suffix), altered(path.read_bytes(), edits, 200))


@pytest.mark.parametrize("name", PACKAGES)
@settings(COMMON, max_examples=80)
@given(edits=EDITS)
def test_altered_bytes_in_formats_of_other_packages(
    tmp_path: Path, name: str, edits: list[tuple[float, int, str]]
) -> None:
    path = small_file(tmp_path, name)
    attempt(path.with_name("altered" + path.suffix), altered(path.read_bytes(), edits, 375))


@pytest.mark.parametrize(
    "suffix", [".ply", ".pcd", ".npy", ".npz", ".las", ".e57", ".xyz", ".bin", ".obj"]
)
@settings(COMMON, max_examples=60)
@given(data=st.binary(min_size=1, max_size=400))
def test_any_bytes_at_all(tmp_path: Path, suffix: str, data: bytes) -> None:
    marks = {".ply": b"ply\n", ".las": b"LASF", ".e57": b"ASTM-E57", ".obj": b"v 1 2 3\n"}
    marks |= {".npy": b"\x93NUMPY\x01\x00"}
    pytest.importorskip(PACKAGES.get(suffix[1:], "numpy"))
    attempt(tmp_path / f"any{suffix}", marks.get(suffix, b"") + data)


def test_laz_chunks_are_held_against_the_file(tmp_path: Path) -> None:
    data = bytearray(small_file(tmp_path, "laz").read_bytes())
    points_at = int.from_bytes(data[96:100], "little")
    point_size = int.from_bytes(data[105:107], "little")
    # The size of the first layer, after the place of the chunk table, a point and their number.
    at = points_at + 8 + point_size + 4
    data[at : at + 4] = b"\xff\xff\xff\x7f"
    path = tmp_path / "layers.laz"
    path.write_bytes(data)
    with pytest.raises(sb.FormatError, match=r"chunk 0 reaches \d+ bytes into|chunk table"):
        sb.read(path)


def test_npz_cannot_expand_without_bound(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, points=np.zeros((100_000, 3)))
    data = path.read_bytes()
    # The uncompressed size in the central directory, the last entry of the file.
    at = data.rindex(b"PK\x01\x02") + 24
    path.write_bytes(data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :])
    with pytest.raises(sb.FormatError, match="more than the file can hold"):
        sb.read(path)
