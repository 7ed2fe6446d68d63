"""Arguments of a wrong type: what is expected is said, whichever function is asked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb

POINTS = np.random.default_rng(0).random((2000, 3)) * [1, 1, 0]
CLOUD = sb.PointCloud(POINTS)


@pytest.fixture(scope="module")
def model() -> sb.PatchModel:
    return sb.learn_patches(CLOUD, resolution=0.05)


CALLS: list[tuple[Callable[[sb.PatchModel, Path], Any], str]] = [
    (lambda _, p: sb.write(CLOUD, p), "path is a PointCloud, but must be a path"),
    (lambda _, p: sb.write(p / "a.ply", POINTS), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.read(3), "path is an int, but must be a path"),
    (lambda *_: sb.load(3), "path is an int, but must be a path, a URL, or a binary file"),
    (lambda m, _: m.save(None), "path is a NoneType, but must be a path"),
    (lambda m, _: m.export(3), "path is an int, but must be a path"),
    (lambda *_: sb.learn_gas(POINTS), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.VoxelGrid(POINTS, 0.1), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.evaluate(CLOUD, POINTS), "decoded is a ndarray, but must be a PointCloud"),
    (lambda m, _: m.locate(POINTS), "scan is a ndarray, but must be a PointCloud"),
    (lambda m, _: sb.diff(m, CLOUD), "b is a PointCloud, but must be a model"),
    (lambda *_: sb.view(CLOUD), "model is a PointCloud, but must be a model or the path"),
    (lambda m, _: sb.place_similarity(m, m), "a is a PatchModel, but must be an AlphabetModel"),
    (lambda m, _: sb.recurring(m), "scene is a PatchModel, but must be an AlphabetModel"),
    (lambda *_: sb.place_index([POINTS]), "a place is a ndarray, but must be a PointCloud or"),
    (lambda m, _: sb.merge_tiles([m]), "an item of models is a PatchModel, but must be a Tiled"),
]


@pytest.mark.parametrize(("call", "message"), CALLS, ids=[message for _, message in CALLS])
def test_wrong_types_are_named(
    model: sb.PatchModel,
    tmp_path: Path,
    call: Callable[[sb.PatchModel, Path], Any],
    message: str,
) -> None:
    with pytest.raises(sb.InvalidTypeError, match=message) as caught:
        call(model, tmp_path)
    error = caught.value
    assert isinstance(error, TypeError)
    assert isinstance(error, sb.InvalidInputError)
    assert str(error) == f"{error.argument} is {error.value}, but must be {error.requirement}"
    assert not list(tmp_path.iterdir())
