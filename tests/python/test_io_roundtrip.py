"""What is written is read again: every attribute that a format holds, in every encoding."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb


def make_cloud(*, utm: bool = False, n_viewpoints: int = 3, n: int = 50, **left_out: bool) -> Any:
    """A cloud with every attribute, or all but those given as False."""
    rng = np.random.default_rng(7)
    points = rng.normal(scale=20, size=(n, 3))
    if utm:
        points += [448_262.123, 5_411_932.678, 512.345]
    else:
        points = points.astype(np.float32)
    normals = rng.normal(size=(n, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    attributes: dict[str, Any] = {
        "colors": rng.integers(0, 256, (n, 3), dtype=np.uint8),
        "intensities": rng.uniform(0, 3000, n).astype(np.float32),
        "normals": normals,
        "ranges": rng.uniform(0.5, 90, n).astype(np.float32),
    }
    viewpoints = points.mean(axis=0) + rng.normal(scale=5, size=(n_viewpoints, 3))
    attributes["viewpoints"] = viewpoints.astype(np.float64)
    index = rng.integers(0, n_viewpoints, n)
    # Tables come back in order of first use.
    _, first = np.unique(index, return_index=True)
    order = index[np.sort(first)]
    rank = np.argsort(order)
    attributes["viewpoints"] = attributes["viewpoints"][order]
    attributes["viewpoint_index"] = rank[index]
    for name in left_out:
        attributes.pop(name)
        if name == "viewpoints":
            attributes.pop("viewpoint_index")
    return sb.PointCloud(points, **attributes)


def assert_same(found: sb.PointCloud, expected: sb.PointCloud) -> None:
    """Attributes equal to the bit; far out, world coordinates to a tenth of a millimetre."""
    assert found.attributes == expected.attributes
    assert len(found) == len(expected)
    if any(expected.origin):
        np.testing.assert_allclose(found.points, expected.points, rtol=0, atol=1e-4)
    else:
        np.testing.assert_array_equal(found.points, expected.points)
    for name in expected.attributes:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    if expected.viewpoint_index is not None:
        np.testing.assert_array_equal(found.viewpoint_index, expected.viewpoint_index)


ENCODINGS: list[tuple[str, dict[str, Any]]] = [
    (".ply", {}),
    (".ply", {"ascii": True}),
    (".pcd", {}),
    (".pcd", {"encoding": "ascii"}),
    (".pcd", {"encoding": "binary_compressed"}),
]


@pytest.fixture(params=ENCODINGS, ids=lambda p: p[0] + "".join(f"-{v}" for v in p[1].values()))
def encoding(request: pytest.FixtureRequest) -> tuple[str, dict[str, Any]]:
    found: tuple[str, dict[str, Any]] = request.param
    return found


def again(path: Path, cloud: sb.PointCloud, **options: Any) -> sb.PointCloud:
    """The cloud written and read, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sb.write(path, cloud, **options)
        return sb.read(path)


@pytest.mark.parametrize("utm", [False, True])
def test_keeps_every_attribute(
    tmp_path: Path, encoding: tuple[str, dict[str, Any]], utm: bool
) -> None:
    suffix, options = encoding
    cloud = make_cloud(utm=utm)
    assert_same(again(tmp_path / f"a{suffix}", cloud, **options), cloud)
