"""Sparse-coded surface patches from Python: arrays, files, errors, threads and interrupts."""

from __future__ import annotations

import numpy as np
import pytest

import surfabet as sb
from generated import DATA, WITHOUT_DATA, kinect_frame, write_organised_pcd
from surfabet.errors import InvalidInputError

PIXEL = 0.01


def scene(n: int = 20_000) -> sb.PointCloud:
    """A striped dome of one metre."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1, (2, n))
    points = np.stack([x, y, 0.1 * np.sin(9 * x) * np.cos(7 * y)], axis=1)
    colors = (127.5 + 127.5 * np.sin(40 * points)).astype(np.uint8)
    return sb.PointCloud(points, colors=colors)


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return scene()


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.HscsmModel:
    return sb.learn_hscsm(cloud, resolution=PIXEL, levels=1, iterations=3)


def test_arrays_have_their_shapes(cloud, model):
    (level,) = model.levels
    m, n = len(model), level.pixels
    assert (level.patches, n, level.pixel_size) == (m, 8, PIXEL)
    assert model.n_points == len(cloud)
    assert model.has_color
    assert model.centers.shape == (m, 3)
    assert model.centers.dtype == np.float64
    assert model.axes.shape == (m, 3, 3)
    assert model.masks().shape == (m, n, n)
    assert model.masks().dtype == np.bool_
    assert model.masks().any(axis=(1, 2)).all()
    identity = np.broadcast_to(np.eye(3), (m, 3, 3))
    np.testing.assert_allclose(model.axes @ model.axes.transpose(0, 2, 1), identity, atol=1e-5)
    for channel, planes, entries in [
        ("depth", 1, level.depth_entries),
        ("color", 3, level.color_entries),
    ]:
        dictionary = model.dictionary.concatenated(channel)[0]
        assert dictionary.shape == (entries, planes * n * n)
        assert dictionary.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(dictionary, axis=1), 1, atol=1e-5)
        assert model.means(channel=channel).shape == (m, planes)
        offsets, used, coefficients = model.codes(channel=channel)
        assert offsets.shape == (m + 1,)
        assert offsets[-1] == len(used) == len(coefficients) > 0
        assert set(used) == set(range(entries))
        assert (coefficients != 0).all()


def test_decoding_is_what_the_equations_say(model):
    """Eq. 2 and 3 in numpy, at one point per pixel, where nothing is interpolated."""
    masks, n = model.masks(), model.levels[0].pixels
    area = n * n

    def images(channel, planes, means):
        dictionary = model.dictionary.concatenated(channel)[0]
        offsets, used, coefficients = model.codes(channel=channel)
        out = np.repeat(means, area, axis=1)
        for i in range(len(model)):
            part = slice(offsets[i], offsets[i + 1])
            out[i] += coefficients[part] @ dictionary[used[part]]
        return out.reshape(len(model), planes, area)

    depth = images("depth", 1, model.means())[:, 0]
    luma, orange, green = model.means(channel="color").T
    base = luma - green / 2
    blue = base - orange / 2
    rgb = np.stack([blue + orange, green + base, blue], axis=1)
    color = images("color", 3, rgb)
    grid = (np.arange(n) - (n - 1) / 2) * PIXEL
    rows, columns = np.meshgrid(grid, grid, indexing="ij")
    x, y, normal = (model.axes[:, None, i] for i in range(3))
    points = model.centers[:, None] + columns.reshape(1, -1, 1) * x
    points = points + rows.reshape(1, -1, 1) * y + depth[:, :, None] * normal
    kept = masks.reshape(len(model), area)

    decoded = model.decode(PIXEL)
    np.testing.assert_allclose(decoded.points, points[kept], atol=1e-5)
    expected = np.clip(color.transpose(0, 2, 1)[kept], 0, 255)
    np.testing.assert_allclose(decoded.colors.astype(float), expected, atol=0.51)


def test_the_report_accounts_for_the_cloud(cloud, model):
    with pytest.raises(InvalidInputError, match="level is 3"):
        model.masks(3)
    report = model.report
    assert report.figures["points"] == len(cloud)
    assert report.figures["samples"] == report.figures["samples covered"]
    assert report.figures["patches"] == len(model)
    assert report.figures["set pixels"] == model.masks().sum()


def learn_hierarchy(cloud: sb.PointCloud) -> sb.HscsmModel:
    return sb.learn_hscsm(
        cloud,
        resolution=PIXEL,
        levels=3,
        patch_pixels=4,
        max_color_deviation=60,
        iterations=3,
    )


@pytest.fixture(scope="module")
def levelled(cloud: sb.PointCloud) -> sb.HscsmModel:
    return learn_hierarchy(cloud)


def test_a_hierarchy_owns_every_sample_once(cloud, levelled):
    report = levelled.report
    assert [level.pixel_size for level in levelled.levels] == [0.04, 0.02, 0.01]
    assert report.figures["samples"] == report.figures["samples covered"]
    assert sum(level.patches for level in levelled.levels) == len(levelled)
    assert levelled.levels[1].patches > 0
    for level, figures in zip(levelled.levels, report.levels, strict=True):
        assert figures["patches"] == level.patches
        assert figures["set pixels"] == level.set_pixels
        assert figures["area"] == pytest.approx(level.area)
        # Masks of all levels have the pixels of the lowest.
        assert level.area == pytest.approx(level.set_pixels * PIXEL**2)
        assert figures["depth dictionary entries"] == level.depth_entries
    again = sb.from_bytes(levelled.to_bytes())
    np.testing.assert_array_equal(again.decode().points, levelled.decode().points)
    far = sb.KdTree(again.decode()).query(cloud.points)[0]
    # Every point lies in a set mask pixel, half a diagonal from its middle at most, and no further
    # from its sheet than growth, coding and the slope within a coarse pixel allow.
    assert far.max() < 0.04


def test_patches_are_arrays_over_all_levels(levelled):
    patches = levelled.patches
    m = len(levelled)
    assert len(patches) == m
    assert patches.poses.shape == (m, 4, 4)
    np.testing.assert_array_equal(patches.poses[:, :3, 3], levelled.centers)
    np.testing.assert_allclose(np.linalg.det(patches.poses[:, :3, :3]), 1, atol=1e-5)
    assert np.bincount(patches.level).tolist() == [x.patches for x in levelled.levels]
    np.testing.assert_allclose(patches.size, 4 * patches.pixel_size)
    assert [len(masks) for masks in patches.masks] == [x.patches for x in levelled.levels]
    for channel, codes, width in [("depth", patches.depth, 1), ("color", patches.color, 3)]:
        entries, starts = levelled.dictionary.concatenated(channel)
        assert entries.shape == (starts[-1], width * 16)
        assert codes.offsets.shape == (m + 1,)
        assert codes.offsets[-1] == len(codes.atoms) == len(codes.coefficients)
        # Indices are moved: each level uses its own part of the concatenated dictionary.
        level_of_code = np.repeat(patches.level, np.diff(codes.offsets))
        assert (codes.atoms >= starts[level_of_code]).all()
        assert (codes.atoms < starts[level_of_code + 1]).all()
        # All levels have one dictionary, and each entry is used by one of them.
        assert set(codes.atoms % starts[1]) == set(range(starts[1]))


def test_a_second_scene_needs_no_dictionary(levelled):
    other = scene(19_000)
    dictionary = levelled.dictionary
    own = learn_hierarchy(other)
    shared = dictionary.describe(other, max_color_deviation=60)
    assert shared.shares_vocabulary
    assert not own.shares_vocabulary
    assert shared.dictionary == dictionary != own.dictionary
    assert len(shared.to_bytes()) < len(own.to_bytes())
    assert [level.pixel_size for level in shared.levels] == [0.04, 0.02, 0.01]
    with pytest.raises(TypeError, match="levels"):
        dictionary.describe(other, levels=2)
    colorless = sb.learn_hscsm(sb.PointCloud(other.points), resolution=0.02)
    with pytest.raises(InvalidInputError, match="dictionary has none"):
        colorless.dictionary.describe(other)


def test_a_cloud_without_colours_is_read_with_the_dictionary_that_it_was_described_in(
    levelled, tmp_path
):
    plain = sb.PointCloud(scene(19_000).points)
    shared = levelled.dictionary.describe(plain)
    assert not shared.has_color
    path = tmp_path / "plain.sfb"
    shared.save(path)
    for dictionary in (levelled.dictionary, shared.dictionary):
        assert sb.load(path, vocabulary=dictionary) == shared
    other = learn_hierarchy(scene(19_000)).dictionary
    with pytest.raises(sb.FormatError, match="give the former"):
        sb.load(path, vocabulary=other)


GREY_TOLERANCE = 7.0


def wave(x: np.ndarray) -> np.ndarray:
    """Intensities of a unit of their own: 4000 from least to largest, one wave of 0.4 m."""
    return (1500 + 2000 * np.sin(2 * np.pi * x / 0.4)).astype(np.float32)


@pytest.fixture(scope="module")
def grey_cloud() -> sb.PointCloud:
    points = scene(40_000).points
    return sb.PointCloud(points, intensities=wave(points[:, 0]), extra={"ring": points[:, 1]})


@pytest.fixture(scope="module")
def grey_model(grey_cloud: sb.PointCloud) -> sb.HscsmModel:
    return sb.learn_hscsm(grey_cloud, resolution=PIXEL, levels=1, iterations=3)


def test_intensities_take_the_place_of_colours(grey_cloud, grey_model):
    assert not grey_model.has_color
    assert grey_model.has_intensity
    assert grey_model.info["intensity"] is True
    assert grey_model.info["colour"] is False
    assert "intensity entries" in repr(grey_model)
    assert grey_model.report.not_kept == ("ring",)
    low, high = grey_model.intensity_limits
    values = np.sort(grey_cloud.intensities)
    assert (low, high) == (values[40], values[-41])
    again = sb.from_bytes(grey_model.to_bytes())
    assert again == grey_model
    assert again.intensity_limits == (low, high)
    decoded = again.decode()
    assert decoded.attributes == ["intensities"]
    assert decoded.intensities.dtype == np.float32
    assert decoded.intensities.min() >= low
    assert decoded.intensities.max() <= high
    patches = grey_model.patches
    # Grey has one plane, not three of the same.
    assert patches.color_means.shape == (len(grey_model), 1)
    n = grey_model.levels[0].pixels
    assert grey_model.dictionary.color[0].shape[1] == n * n


def test_the_error_of_intensities_is_that_of_rounding_pixels_and_atoms(grey_cloud, grey_model):
    decoded = grey_model.decode()
    low, high = grey_model.intensity_limits
    # Codes end at the tolerance, and their rounding adds half of it at most. A pixel shows the mean
    # of its points, which is half a pixel from its middle at most, where a wave is this steep.
    coded = GREY_TOLERANCE * np.sqrt(1.25) / 255 * (high - low)
    per_pixel = 2000 * 2 * np.pi / 0.4 * PIXEL
    error = decoded.intensities - wave(decoded.points[:, 0])
    bound = coded + per_pixel * 0.5
    assert np.sqrt(np.mean(error**2)) < bound < 0.4 * np.std(grey_cloud.intensities)
    (figures,) = grey_model.report.attributes
    assert (figures.name, figures.equal) == ("intensities", None)
    assert 0 < figures.rmse < bound
    options = {"resolution": PIXEL, "levels": 1, "iterations": 3}
    fine = sb.learn_hscsm(grey_cloud, **options, color_tolerance=1.0)
    (better,) = fine.report.attributes
    assert better.rmse < figures.rmse
    assert better.bytes > figures.bytes


def test_intensities_take_fewer_bytes_than_they_have(grey_cloud, grey_model):
    plain = sb.PointCloud(grey_cloud.points)
    without = sb.learn_hscsm(plain, resolution=PIXEL, levels=1, iterations=3)
    assert without.intensity_limits is None
    assert without.report.attributes == ()
    added = len(grey_model.to_bytes()) - len(without.to_bytes())
    (figures,) = grey_model.report.attributes
    # A byte per point is what grey levels take without a model.
    assert figures.bytes < added < len(grey_cloud)


def test_the_section_of_intensities_is_named(grey_model, tmp_path):
    grey_model.save(tmp_path / "a.sfb")
    sections = sb.inspect(tmp_path / "a.sfb").sections
    (figures,) = grey_model.report.attributes
    assert abs(sections["intensity"] - figures.bytes) < 2 + 0.005 * figures.bytes
    assert "colour" not in sections


def test_colours_go_before_intensities(cloud):
    both = sb.PointCloud(cloud.points, colors=cloud.colors, intensities=np.ones(len(cloud)))
    model = sb.learn_hscsm(both, resolution=0.03, iterations=1)
    assert model.has_color
    assert not model.has_intensity
    assert model.report.not_kept == ("intensities",)
    assert [of.name for of in model.report.attributes] == ["colors"]
    coloured = sb.PointCloud(cloud.points, colors=cloud.colors)
    assert model == sb.learn_hscsm(coloured, resolution=0.03, iterations=1)


def test_a_dictionary_describes_other_intensities(grey_cloud, grey_model):
    n = 10_000
    other = sb.PointCloud(grey_cloud.points[:n], intensities=grey_cloud.intensities[:n] / 4000)
    shared = grey_model.dictionary.describe(other)
    low, high = shared.intensity_limits
    assert shared.dictionary == grey_model.dictionary
    assert (low, high) == tuple(np.sort(other.intensities)[[10, -11]])
    again = sb.from_bytes(shared.to_bytes(), vocabulary=grey_model.dictionary)
    error = again.decode().intensities - wave(again.decode().points[:, 0]) / 4000
    assert np.sqrt(np.mean(error**2)) < 0.1
    plain = sb.learn_hscsm(sb.PointCloud(other.points), resolution=0.02, iterations=1)
    with pytest.raises(InvalidInputError, match="the cloud has intensities, the dictionary has"):
        plain.dictionary.describe(other)


def test_a_frame_of_structured_light_is_kept_within_its_resolution(tmp_path):
    """Twin of the test below."""
    write_organised_pcd(tmp_path / "frame.pcd", kinect_frame(), width=240)
    with pytest.warns(sb.DroppedPointsWarning, match="of 43200 points"):
        frame = sb.read(tmp_path / "frame.pcd")
    model = sb.learn_hscsm(frame, resolution=0.015)
    quality = sb.evaluate(frame, model.decode(), normal_neighbors=None)
    assert quality.rmse_pooled < 0.015


@pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)
@pytest.mark.filterwarnings("ignore::surfabet.DroppedPointsWarning")
def test_a_real_frame_is_kept_within_its_resolution():
    frame = sb.read(DATA / "rgbd_frame" / "table.pcd")
    model = sb.learn_hscsm(frame, resolution=0.006)
    quality = sb.evaluate(frame, model.decode())
    assert quality.rmse_pooled < 0.006
