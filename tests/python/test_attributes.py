"""Attributes that models keep: from the cloud into the file and back, with their measures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import surfabet as sb
from surfabet.cli import main
from surfabet.errors import InvalidInputError, InvalidTypeError

NAMES = ("intensities", "classification", "gps_time", "scan_angle", "user_data")


def scan(n: int = 20_000) -> sb.PointCloud:
    """A square of two metres whose intensity grows along x, with classes by y and other columns."""
    rng = np.random.default_rng(5)
    p = rng.uniform(0, 2, (n, 3))
    p[:, 2] = 0.002 * rng.standard_normal(n)
    return sb.PointCloud(
        p,
        intensities=(100 + 50 * p[:, 0]).astype(np.float32),
        extra={
            "classification": np.where(p[:, 1] < 1, 2, 6).astype(np.uint8),
            "gps_time": 3e8 + p[:, 1],
            "scan_angle": np.round(1000 * (p[:, 0] - 1)).astype(np.int16),
            "user_data": np.full(n, -7, np.int8),
        },
    )


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return scan()


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.PatchModel:
    return sb.learn_patches(cloud, resolution=0.02, attributes=NAMES)


def test_decoded_attributes_are_those_of_the_cloud_by_name_and_type(cloud, model) -> None:
    again = sb.from_bytes(model.to_bytes()).decode()
    assert model.attributes == NAMES
    assert model.report.not_kept == ()
    assert set(again.attributes) == set(NAMES)
    x, y = again.points[:, 0], again.points[:, 1]
    for name in NAMES:
        assert again[name].dtype == cloud[name].dtype
    # Within a step of half a standard deviation, which of uniform values over a length L is
    # L / sqrt(12).
    assert np.abs(again.intensities - (100 + 50 * x)).max() < 100 / np.sqrt(12)
    assert np.sqrt(np.mean((again.intensities - (100 + 50 * x)) ** 2)) < 0.25 * 100 / np.sqrt(12)
    assert np.sqrt(np.mean((again["gps_time"] - 3e8 - y) ** 2)) < 0.25 * 2 / np.sqrt(12)
    assert again["gps_time"].min() >= 3e8
    assert np.sqrt(np.mean((again["scan_angle"] - 1000 * (x - 1)) ** 2)) < 0.25 * 2000 / np.sqrt(12)
    assert (again["user_data"] == -7).all()
    inside = np.abs(y - 1) > 0.04
    assert (again["classification"] == np.where(y < 1, 2, 6))[inside].all()


def test_finer_steps_give_smaller_errors_and_larger_streams(cloud, model) -> None:
    fine = sb.learn_patches(cloud, resolution=0.02, attributes=NAMES, attribute_step=0.05)
    for coarse, better in zip(model.report.attributes, fine.report.attributes, strict=True):
        assert coarse.name == better.name
        if coarse.rmse:
            assert better.rmse < coarse.rmse
            assert better.bytes > coarse.bytes
        else:
            # Labels are exact whatever the step, and so is what is the same everywhere.
            assert better == coarse


def test_bytes_by_attribute_are_those_of_the_file(model, tmp_path: Path) -> None:
    model.save(tmp_path / "a.sfb")
    sections = sb.inspect(tmp_path / "a.sfb").sections
    figures = {figures.name: figures for figures in model.report.attributes}
    assert list(figures) == list(NAMES)
    for name, of in figures.items():
        assert abs(sections[f"attribute {name}"] - of.bytes) < 2 + 0.005 * of.bytes
        labels = name in ("classification", "user_data")
        assert (of.rmse is None, of.equal is None) == (labels, not labels)
    assert figures["classification"].equal > 0.98
    assert figures["user_data"].equal == 1
    assert "attribute classification" in model.info


def test_the_default_keeps_colours_and_intensities(cloud) -> None:
    model = sb.learn_patches(cloud, resolution=0.05)
    assert model.attributes == ("intensities",)
    assert model.report.not_kept == NAMES[1:]
    bare = sb.learn_patches(cloud, resolution=0.05, attributes=())
    assert bare.attributes == ()
    assert bare.decode().attributes == []
    plain = sb.learn_patches(sb.PointCloud(cloud.points), resolution=0.05)
    assert bare.to_bytes() == plain.to_bytes()


def test_wrong_names_are_refused(cloud) -> None:
    has = "intensities, classification, gps_time, scan_angle, user_data"
    for names, message in (
        (["colors"], f"attributes is colors, but must be among those that the cloud has: {has}"),
        (["normals"], f"attributes is normals, but must be among those that the cloud has: {has}"),
        (["gps_time"] * 2, "names each attribute once"),
        (["a" * 256], "a name of at most 255 bytes"),
    ):
        with pytest.raises(InvalidInputError, match="attributes") as error:
            sb.learn_patches(cloud, attributes=names)
        assert message in str(error.value)
    with pytest.raises(InvalidTypeError, match="a sequence of names"):
        sb.learn_patches(cloud, attributes="intensities")
    with pytest.raises(InvalidInputError, match="the cloud has no attribute"):
        sb.learn_patches(sb.PointCloud(cloud.points), attributes=["intensities"])
    extra = {f"a{i}": np.zeros(len(cloud)) for i in range(17)}
    many = sb.PointCloud(cloud.points, extra=extra)
    with pytest.raises(InvalidInputError, match="of at most 16"):
        sb.learn_patches(many, attributes=list(extra))
    huge = sb.PointCloud(cloud.points, extra={"a": np.linspace(0, 1e300, len(cloud))})
    with pytest.raises(InvalidInputError, match="a from 0e0 to 1e300"):
        sb.learn_patches(huge, attributes=["a"])
    unknown = np.full(len(cloud), np.nan)
    nothing = sb.PointCloud(cloud.points, extra={"a": unknown})
    assert np.isfinite(sb.learn_patches(nothing, attributes=["a"]).decode()["a"]).all()


def test_points_beside_the_patches_have_attributes_and_a_normal(cloud) -> None:
    # Too near to the surface to be worth a patch of its own, too far for the bound.
    stray = np.array([[1.0, 1.5, 0.08]])
    parts = sb.PointCloud(
        np.concatenate([cloud.points, stray]),
        extra={"classification": np.append(cloud["classification"], np.uint8(18))},
        viewpoints=[[1.0, 1.0, 5.0]],
        viewpoint_index=np.zeros(len(cloud) + 1, np.uint32),
    )
    model = sb.learn_patches(parts, resolution=0.02, max_error=0.04, attributes=["classification"])
    assert model.n_extra_points == 1
    decoded = model.decode(normals=True)
    assert np.linalg.norm(decoded.points[-1] - stray) < 0.04
    np.testing.assert_allclose(decoded.normals[-1], [0, 0, 1], atol=0.1)
    assert decoded["classification"][-1] == 6


@pytest.mark.parametrize("learn", [sb.learn_gas, sb.learn_planes])
def test_gas_and_planes_keep_the_mean_intensity(cloud, learn) -> None:
    options = {"n_neurons": 200, "patterns": 100} if learn is sb.learn_gas else {}
    model = learn(cloud, **options)
    assert set(model.report.not_kept) == set(NAMES[1:])
    again = sb.from_bytes(model.to_bytes()).decode(0.05)
    x = again.points[:, 0]
    error = again.intensities - (100 + 50 * x)
    # A neuron stands for about (2 m)^2 / 200, tiles are smaller.
    assert np.sqrt(np.mean(error**2)) < 50 * 0.14
    (figures,) = model.report.attributes
    assert figures.name == "intensities"
    coarse = learn(cloud, **options, attribute_step=2.0)
    assert coarse.report.attributes[0].bytes < figures.bytes
    plain = sb.PointCloud(cloud.points)
    assert learn(plain, **options).decode().intensities is None


def test_an_updated_gas_keeps_intensities(cloud) -> None:
    model = sb.learn_gas(cloud, n_neurons=100, patterns=50)
    moved = sb.PointCloud(cloud.points + np.array([2.0, 0, 0]), intensities=cloud.intensities + 100)
    updated = model.update(moved)
    neurons = updated.neurons
    error = neurons.intensities - (100 + 50 * neurons.positions[:, 0])
    assert np.sqrt(np.mean(error**2)) < 20


def test_evaluate_measures_what_both_clouds_have(cloud) -> None:
    n = len(cloud)
    shifted = sb.PointCloud(
        cloud.points,
        intensities=cloud.intensities + 3,
        extra={
            "classification": np.where(np.arange(n) % 4 == 0, 9, cloud["classification"]),
            "gps_time": cloud["gps_time"] - 0.5,
            "only here": np.zeros(n),
        },
    )
    quality = sb.evaluate(cloud, shifted, normal_neighbors=None)
    found = quality.attributes
    assert list(found) == ["intensities", "classification", "gps_time"]
    for name, expected in (("intensities", 3), ("classification", 0.75), ("gps_time", 0.5)):
        of = found[name]
        assert of.labels == (name == "classification")
        for value in (of.forward, of.backward, of.pooled):
            assert value == pytest.approx(expected, rel=1e-4)
    assert "classification 75.00% equal" in repr(quality)
    assert quality.as_dict()["attributes"]["gps_time"]["labels"] is False


def test_the_command_line_names_attributes(cloud, tmp_path: Path, capsys) -> None:
    sb.write(tmp_path / "scan.npz", cloud)
    scan_file, file = str(tmp_path / "scan.npz"), str(tmp_path / "a.sfb")
    names = "intensities,classification"
    given = ["--resolution", "0.05", "--attributes", names]
    assert main(["compress", scan_file, file, "--json", *given]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [of["name"] for of in told["report"]["attributes"]] == names.split(",")
    assert told["quality"]["attributes"]["classification"]["labels"] is True
    assert main(["evaluate", scan_file, file]) == 0
    assert "classification equal" in capsys.readouterr().out
    assert main(["compress", scan_file, file, "--attributes", "colors", "-q"]) != 0
    assert "--attributes" in capsys.readouterr().err
