"""What every model promises from Python, each promise tested on every method."""

from __future__ import annotations

import copy
import pickle
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import surfabet as sb
from surfabet._methods import METHODS as REGISTERED
from surfabet.cli._learn_options import ModelName
from surfabet.errors import FormatError, InvalidInputError

GOLDEN = Path(__file__).parents[1] / "golden"


def corner(seed: int = 0, n: int = 3000) -> sb.PointCloud:
    """Floor and two walls of one metre with a bump each, a colour and a class each.

    Their intensities grow along them, and all is seen from one place.
    """
    rng = np.random.default_rng(seed)
    points, colors, intensities = [], [], []
    for axis, color in enumerate([(200, 60, 40), (40, 180, 60), (60, 60, 200)]):
        p = rng.uniform(0, 1, (n, 3))
        away = ((p - 0.4) ** 2).sum(axis=1, where=np.arange(3) != axis)
        p[:, axis] = 0.05 * np.exp(-away / 0.005) + 0.001 * rng.standard_normal(n)
        points.append(p)
        colors.append(np.tile(np.array(color, np.uint8), (n, 1)))
        intensities.append(100 * p[:, (axis + 1) % 3])
    return sb.PointCloud(
        np.concatenate(points) + np.array([1000.0, -500.0, 20.0]),
        colors=np.concatenate(colors),
        intensities=np.concatenate(intensities).astype(np.float32),
        extra={"classification": np.repeat(np.array([2, 6, 9], np.uint8), n)},
        viewpoints=[[1001.5, -498.5, 21.5]],
        viewpoint_index=np.zeros(3 * n, np.uint32),
    )


def dense_box(n: int) -> sb.PointCloud:
    """Points everywhere in a cube: work for every method."""
    return sb.PointCloud(np.random.default_rng(0).random((n, 3)))


@dataclass(frozen=True)
class Method:
    """A method with options for a small scene, and for one that takes minutes."""

    learn: Callable[..., Any]
    of: type
    counted: str
    """What `len` counts, as `repr` calls it."""
    info: str
    """A name of `info` whose value is `len`."""
    small: dict[str, Any] = field(default_factory=dict)
    long: dict[str, Any] = field(default_factory=dict)
    long_points: int = 400_000
    vocabulary: str | None = None
    """Attribute with what its files can share."""

    def model(self, cloud: sb.PointCloud, **more: Any) -> Any:
        return self.learn(cloud, **self.small, **more)


METHODS = {
    "patches": Method(
        sb.learn_patches, sb.PatchModel, "patches", "patches",
        small={"resolution": 0.02, "attributes": ("colors", "intensities", "classification")},
        long={"resolution": 0.003},
    ),
    "hscsm": Method(
        sb.learn_hscsm, sb.HscsmModel, "patches", "patches",
        small={"resolution": 0.02, "iterations": 2},
        long={"resolution": 0.005, "iterations": 1000},
        vocabulary="dictionary",
    ),
    "alphabet": Method(
        sb.learn_alphabet, sb.AlphabetModel, "occurrences", "occurrences",
        small={"angular_resolution": 0.6, "noise": 0.0, "max_words": 4},
        long={"rounds": 64}, vocabulary="alphabet",
    ),
    "bic-alphabet": Method(
        sb.learn_bic_alphabet, sb.BicAlphabetModel, "occurrences", "occurrences",
        small={"radius": 0.15, "iterations": 20, "angular_resolution": 0.8},
        long={"iterations": 10**6, "max_rejections": 10**6, "radius": 0.05},
        vocabulary="alphabet",
    ),
    "planes": Method(sb.learn_planes, sb.PlaneModel, "planes", "planes", long_points=3_000_000),
    "gas": Method(
        sb.learn_gas, sb.GasModel, "neurons", "neurons",
        small={"n_neurons": 100, "patterns": 50},
        long={"n_neurons": 100_000, "patterns": 10_000},
    ),
}  # fmt: skip
SHARING = [name for name, method in METHODS.items() if method.vocabulary]


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return corner()


@pytest.fixture(scope="module")
def models(cloud: sb.PointCloud) -> dict[str, Any]:
    """One small model of every method that was asked for, learned once."""

    class Learned(dict[str, Any]):
        def __missing__(self, name: str) -> Any:
            self[name] = METHODS[name].model(cloud)
            return self[name]

    return Learned()


@pytest.fixture(params=METHODS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def method(name: str) -> Method:
    return METHODS[name]


@pytest.fixture
def model(name: str, models: dict[str, Any]) -> Any:
    return models[name]


@pytest.fixture
def all_threads() -> Iterator[None]:
    before = sb.get_num_threads()
    yield
    sb.set_num_threads(before)


def same_cloud(a: sb.PointCloud, b: sb.PointCloud) -> None:
    np.testing.assert_array_equal(a.points, b.points)
    assert a.attributes == b.attributes
    for attribute in a.attributes:
        np.testing.assert_array_equal(a[attribute], b[attribute])


def test_every_method_is_tested() -> None:
    assert {name: method.of for name, method in METHODS.items()} == {
        name: method.model for name, method in REGISTERED.items()
    }
    assert get_args(ModelName) == tuple(REGISTERED)
    golden = {path.stem.removesuffix("_0_1") for path in GOLDEN.glob("*_0_1.sfb")}
    assert golden == {name.replace("-", "_") for name in METHODS}


def test_what_a_model_says_of_itself(
    name: str, method: Method, model: Any, cloud: sb.PointCloud
) -> None:
    assert type(model) is method.of
    assert model.method == name
    assert model.n_points == len(cloud)
    assert model.origin.shape == (3,)
    assert model.origin.dtype == np.float64
    assert len(model) > 0
    shown = repr(model)
    assert shown.startswith(f"{method.of.__name__}({len(cloud)} points as ")
    assert method.counted in shown
    assert ("colour" in shown) == model.has_color
    assert model.info[method.info] == len(model)
    assert model.info["colour"] == model.has_color
    assert all(type(value) in (bool, int, float, str) for value in model.info.values())


def test_a_file_gives_the_model_back(name: str, method: Method, model: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.sfb"
    data = model.to_bytes()
    assert model.save(path) == path.stat().st_size == len(data)
    assert model.save(str(path)) == len(data)
    assert path.read_bytes() == data
    assert [p.name for p in tmp_path.iterdir()] == ["a.sfb"]
    for again in (sb.load(path), sb.load(str(path)), sb.from_bytes(data)):
        assert type(again) is method.of
        assert again == model
        assert hash(again) == hash(model)
        assert again.to_bytes() == data
        assert again.info == model.info
        assert repr(again) == repr(model)
        assert len(again) == len(model)
        same_cloud(again.decode(), model.decode())
    info = sb.inspect(path)
    assert info.method == name
    assert info.version == "0.1"
    assert info.vocabulary is None
    assert "header" in info.sections
    assert 0 < len(data) - sum(info.sections.values()) < 200
    assert info.as_dict()["sections"] == info.sections


def test_a_note_stays_with_its_model(model: Any, tmp_path: Path) -> None:
    path, again = tmp_path / "a.sfb", tmp_path / "b.sfb"
    plain = model.to_bytes()
    assert model.note == ""
    # Also a note of more than 127 bytes, whose length takes two.
    for note in ("CRS: EPSG:2994; lengths in ft", "\u00e4 " * 200, "two\nlines"):
        model.save(path, note=note)
        data = path.read_bytes()
        assert model.to_bytes(note=note) == data
        for read in (sb.load(path), sb.from_bytes(data)):
            assert read.note == sb.inspect(path).note
            assert read.to_bytes() == data
            assert read.save(again) == len(data)
            assert again.read_bytes() == data
            assert read.to_bytes(note="") == plain
            read.save(again, note="another")
            assert sb.load(again).note == "another"
            assert read == model == sb.load(again)
            assert hash(read) == hash(model)
    with pytest.raises(InvalidInputError, match="note is a text of 1025 bytes"):
        model.to_bytes(note="x" * 1025)


def test_models_are_equal_when_their_files_are(
    method: Method, model: Any, models: dict[str, Any], cloud: sb.PointCloud
) -> None:
    again = sb.from_bytes(model.to_bytes())
    assert model == again
    assert again.report != model.report
    other = method.model(corner(seed=1))
    assert other != model
    assert model != "a model"
    for name, of_another in models.items():
        assert (of_another == model) == (METHODS[name] is method)


def test_the_report_says_how_it_was_learned(model: Any, cloud: sb.PointCloud) -> None:
    report = model.report
    assert report.stages
    assert all(seconds >= 0 for seconds in report.stages.values())
    assert report.iterations > 0
    assert report.stop_reason
    # A colour that the model does not carry is told.
    assert ("colors" in report.not_kept) == (not model.has_color)
    told = report.as_dict()
    assert told["stages"] == report.stages
    empty = sb.from_bytes(model.to_bytes()).report
    assert (empty.stages, empty.figures, empty.iterations, empty.not_kept) == ({}, {}, 0, ())


def test_what_the_model_does_not_keep_is_told(method: Method) -> None:
    plain = corner()
    cloud = sb.PointCloud(
        plain.points,
        intensities=np.ones(len(plain), np.float32),
        extra={"classification": plain["classification"]},
        viewpoints=plain.viewpoints,
        viewpoint_index=plain.viewpoint_index,
    )
    more = {"attributes": ("intensities", "classification")} if method.of is sb.PatchModel else {}
    model = method.learn(cloud, **{**method.small, **more})
    assert not model.has_color
    kept = model.decode().attributes
    for name in ("intensities", "classification"):
        assert (name in model.report.not_kept) == (name not in kept)
        figures = [figures.name for figures in model.report.attributes]
        # Alphabets code colour and intensity in one stream.
        if method.of is not sb.AlphabetModel:
            assert (name in figures) == (name in kept)
    assert "colors" not in model.report.not_kept


def test_decode_takes_the_same_options_everywhere(model: Any) -> None:
    own = model.decode()
    assert len(own) > 0
    assert ("colors" in own.attributes) == model.has_color
    assert own.normals is None
    fine = model.decode(0.02, normals=True)
    assert fine.normals is not None
    lengths = np.linalg.norm(fine.normals, axis=1)
    # Zero where nothing is known of the surface.
    np.testing.assert_allclose(lengths[lengths > 0], 1, atol=1e-5)
    assert (lengths > 0).mean() > 0.9
    same_cloud(model.decode(resolution=0.02, normals=True, as_measured=False), fine)
    stages: list[tuple[str, float]] = []
    same_cloud(model.decode(progress=lambda *at: stages.append(at)), own)
    assert all(isinstance(stage, str) and 0 <= fraction <= 1 for stage, fraction in stages)
    if model.keeps_thickness:
        assert len(model.decode(0.02, as_measured=True)) > 0
    else:
        with pytest.raises(InvalidInputError, match="as_measured"):
            model.decode(as_measured=True)


@pytest.mark.parametrize("resolution", [0, -0.01, np.nan, np.inf])
def test_decode_refuses_impossible_spacings(model: Any, resolution: float) -> None:
    with pytest.raises(InvalidInputError, match="resolution"):
        model.decode(resolution)


def test_decode_refuses_more_points_than_allowed(model: Any) -> None:
    n = len(model.decode())
    for limit in (0, n - 1):
        with pytest.raises(InvalidInputError, match=f"limit of {limit}"):
            model.decode(max_points=limit)
    assert len(model.decode(max_points=100 * n)) == n


def test_an_empty_cloud_is_refused(method: Method) -> None:
    with pytest.raises(InvalidInputError, match="empty"):
        method.model(sb.PointCloud(np.empty((0, 3))))


def test_files_that_are_none_are_named(model: Any, tmp_path: Path) -> None:
    missing = tmp_path / "nothing.sfb"
    with pytest.raises(OSError, match="nothing"):
        sb.load(missing)
    data = model.to_bytes()
    for file, content in [("cut.sfb", data[:-5]), ("long.sfb", data + b"x"), ("text.sfb", b"some")]:
        path = tmp_path / file
        path.write_bytes(content)
        for read in (sb.load, sb.inspect):
            with pytest.raises(FormatError, match=file):
                read(path)
        with pytest.raises(FormatError):
            sb.from_bytes(content)
    with pytest.raises(FormatError, match="limit"):
        sb.from_bytes(data, max_bytes=10)


def test_any_number_of_threads_gives_the_same(
    method: Method, model: Any, cloud: sb.PointCloud, all_threads: None
) -> None:
    own = model.decode(0.02)
    for threads in (1, 2, 8):
        sb.set_num_threads(threads)
        again = method.model(cloud)
        assert again.to_bytes() == model.to_bytes()
        same_cloud(again.decode(0.02), own)


def test_points_come_in_any_order_where_promised(
    name: str, method: Method, model: Any, cloud: sb.PointCloud
) -> None:
    if name in ("patches", "hscsm", "gas"):
        pytest.skip(f"{name} does not promise it")
    order = np.random.default_rng(7).permutation(len(cloud))
    assert method.model(cloud.select(order)).to_bytes() == model.to_bytes()


def test_progress_is_told_while_learning(method: Method) -> None:
    told: list[tuple[str, float]] = []
    method.model(corner(), progress=lambda *at: told.append(at))
    assert all(isinstance(stage, str) and 0 <= fraction <= 1 for stage, fraction in told)


def test_an_exception_of_the_callback_ends_the_work(method: Method) -> None:
    def fail(stage: str, fraction: float) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        method.learn(dense_box(method.long_points), **method.long, progress=fail)


def test_an_interrupt_ends_the_work(method: Method) -> None:
    """Ctrl-C while Rust works: sent by another thread once learning has begun."""
    cloud = dense_box(method.long_points)
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.process_time())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    sender = threading.Thread(target=interrupt)

    def begun(stage: str, fraction: float) -> None:
        if not sender.ident:
            sender.start()

    # Python leaves SIGINT ignored where the parent process ignores it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            method.learn(cloud, **method.long, progress=begun)
    finally:
        signal.signal(signal.SIGINT, before)
    sender.join()
    # Promised within a second, twice which is left to every thread; left alone the work takes
    # minutes. In time of the processor, which other programs do not take.
    assert time.process_time() - sent[0] < 2 * (sb.get_num_threads() + 1)


def test_other_threads_run_meanwhile(method: Method) -> None:
    """The interpreter is free while Rust works: another thread ends that work."""
    enough = threading.Event()

    def stop(stage: str, fraction: float) -> None:
        if enough.is_set():
            raise RuntimeError("enough")

    def count() -> None:
        for _ in range(100):
            time.sleep(0)
        enough.set()

    counting = threading.Thread(target=count)
    counting.start()
    with pytest.raises(RuntimeError, match="enough"):
        method.learn(dense_box(method.long_points), **method.long, progress=stop)
    counting.join()


def test_a_pickle_is_the_file_with_its_note(model: Any, tmp_path: Path) -> None:
    model.save(tmp_path / "a.sfb", note="by hand")
    noted = sb.load(tmp_path / "a.sfb")
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(noted, protocol))
        assert type(again) is type(model)
        assert again == model
        assert again.to_bytes() == noted.to_bytes()
        assert again.note == "by hand"
    # Nothing of a model changes, so that one is as good as a copy.
    assert copy.copy(model) is model
    assert copy.deepcopy([model])[0] is model


def test_files_of_the_first_release_read_as_ever(name: str, method: Method) -> None:
    path = GOLDEN / f"{name.replace('-', '_')}_0_1.sfb"
    model = sb.load(path)
    assert type(model) is method.of
    assert model.to_bytes() == path.read_bytes()
    assert sb.inspect(path).version == "0.1"
    assert len(model.decode()) > 0


@pytest.mark.parametrize("name", SHARING)
def test_a_vocabulary_describes_another_scene(
    name: str, model: Any, method: Method, tmp_path: Path
) -> None:
    words = getattr(model, str(method.vocabulary))
    other = corner(seed=1)
    described = words.describe(other)
    assert type(described) is method.of
    with pytest.raises(TypeError, match="names its vocabulary by hash"):
        pickle.dumps(described)
    assert described.n_points == len(other)
    data = described.to_bytes()
    # A reference, a hash of 16 bytes in a section, stands for the words, of which so small a scene
    # may need only two.
    assert len(data) < len(method.model(other).to_bytes()) + 32
    assert getattr(described, str(method.vocabulary)).hash == words.hash
    path, first = tmp_path / "second.sfb", tmp_path / "first.sfb"
    described.save(path)
    model.save(first)
    known = getattr(sb.load(first), str(method.vocabulary))
    for again in (sb.load(path, vocabulary=known), sb.from_bytes(data, vocabulary=words)):
        assert again == described
        assert again.to_bytes() == data
        same_cloud(again.decode(), described.decode())
    # The file says which words it needs, and that without them.
    info = sb.inspect(path)
    assert (info.method, info.vocabulary) == (name, words.hash)
    with pytest.raises(FormatError, match=words.hash):
        sb.load(path)
    own = getattr(method.model(other), str(method.vocabulary))
    assert own.hash != words.hash
    with pytest.raises(FormatError, match=rf"{words.hash}.*{own.hash}"):
        sb.load(path, vocabulary=own)
    with pytest.raises(InvalidInputError, match="empty"):
        words.describe(sb.PointCloud(np.empty((0, 3))))
