"""Arguments of a wrong type: what is expected is said, whichever function is asked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surfabet as sb
import surfabet.io

POINTS = np.random.default_rng(0).random((2000, 3)) * [1, 1, 0]
CLOUD = sb.PointCloud(POINTS)


@pytest.fixture(scope="module")
def model() -> sb.PatchModel:
    return sb.learn_patches(CLOUD, resolution=0.05)


CALLS: list[tuple[Callable[[sb.PatchModel, Path], Any], str]] = [
    (lambda _, p: sb.write(CLOUD, p), "path is a PointCloud, but must be a path"),
    (lambda _, p: sb.write(p / "a.ply", POINTS), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.read(3), "path is 3, but must be a path"),
    (lambda *_: sb.load(3), "path is 3, but must be a path, a URL, or a binary file"),
    (lambda m, _: m.save(None), "path is None, but must be a path"),
    (lambda m, _: m.export(3), "path is 3, but must be a path"),
    (lambda *_: sb.learn_gas(POINTS), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.VoxelGrid(POINTS, 0.1), "cloud is a ndarray, but must be a PointCloud"),
    (lambda *_: sb.evaluate(CLOUD, POINTS), "decoded is a ndarray, but must be a PointCloud"),
    (lambda m, _: m.locate(POINTS), "scan is a ndarray, but must be a PointCloud"),
    (lambda m, _: sb.diff(m, CLOUD), "b is a PointCloud, but must be a model"),
    (lambda *_: sb.view(CLOUD), "model is a PointCloud, but must be a model or the path"),
    (lambda m, _: sb.place_similarity(m, m), "a is a PatchModel, but must be an AlphabetModel"),
    (lambda m, _: sb.recurring(m), "scene is a PatchModel, but must be an AlphabetModel"),
    (lambda *_: sb.place_index([POINTS]), r"places\[0\] is a ndarray, but must be a PointCloud or"),
    (lambda m, _: sb.merge_tiles([m]), r"models\[0\] is a PatchModel, but must be a Tiled"),
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


def test_missing_files_are_errors_of_the_system(tmp_path: Path) -> None:
    path = tmp_path / "missing.ply"
    calls: list[Callable[[], Any]] = [
        lambda: sb.read(path),
        lambda: sb.load(path),
        lambda: sb.inspect(path),
        lambda: sb.view(path),
        lambda: sb.io.detect(path),
        lambda: sb.learn_patches_tiled(path, tmp_path / "a.sfb"),
    ]
    for call in calls:
        with pytest.raises(FileNotFoundError) as caught:
            call()
        assert str(caught.value.filename) == str(path)
        assert caught.value.strerror == "No such file or directory"


def test_limits_of_a_prior_need_one(model: sb.PatchModel) -> None:
    for limit in ({"radius": 2.0}, {"angle": 10.0}):
        with pytest.raises(sb.InvalidInputError, match="left out without a prior"):
            model.locate(CLOUD, **limit)
    with pytest.raises(sb.InvalidInputError, match=r"angle is -1, .* degrees"):
        model.locate(CLOUD, prior=np.eye(4), angle=-1)
    with pytest.raises(sb.InvalidInputError, match=r"prior is .*rotation"):
        model.locate(CLOUD, prior=2 * np.eye(4))


def test_an_example_without_words_says_where_words_are() -> None:
    words = sb.learn_alphabet(CLOUD, radius=0.1, scales=1)
    with pytest.raises(
        sb.InvalidInputError, match=r"point is .* the nearest is at \(0\."
    ) as caught:
        words.find(point=(0.5, 0.5, 3.0), radius=0.5)
    assert caught.value.argument == "point"
    for given, argument in (
        ({"point": (0, 0, 0)}, "radius"),
        ({"radius": 1.0}, "point"),
        ({"point": (0, 0, 0), "radius": 1.0, "box": ((0, 0, 0), (1, 1, 1))}, "box"),
    ):
        with pytest.raises(sb.InvalidInputError) as caught:
            words.find(**given)
        assert caught.value.argument == argument


def test_numbers_of_numpy_are_numbers(model: sb.PatchModel, tmp_path: Path) -> None:
    again = model.decode(np.float32(0.25), normals=np.bool_(True), max_points=np.int64(1_000_000))
    plain = model.decode(0.25, normals=True, max_points=1_000_000)
    np.testing.assert_array_equal(again.points, plain.points)
    report = sb.learn_patches_tiled(
        CLOUD, tmp_path / "a.sfb", tile=np.float32(4), details=np.int64(1), workers=np.uint8(1)
    )
    assert report.n_tiles >= 1
