"""Defaults that follow from the data: on generated scenes of known spacing, noise and layers."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import surfabet as sb
from generated import HALL, HALL_WINDOW, ring_scan
from surfabet.cli import main

RNG = np.random.default_rng
COMPLETE: dict[str, Callable[..., sb.PatchModel | sb.HscsmModel | sb.GasModel]] = {
    "patches": sb.learn_patches,
    "hscsm": sb.learn_hscsm,
    "gas": sb.learn_gas,
}


def corner(n: int, noise: float = 0.002, seed: int = 1) -> NDArray[np.float64]:
    """Floor and two walls of 2 m, (n, 3), metres, with noise across each."""
    rng = RNG(seed)
    points = rng.uniform(0, 2, (n, 3))
    axis = np.arange(n) % 3
    points[np.arange(n), axis] = rng.normal(0, noise, n)
    return points


def thin_wall(
    n: int = 30_000,
    gap: float = 0.03,
    noise: float = 0.001,
    seen: str = "normals",
    turned: float = 0.0,
) -> tuple[sb.PointCloud, NDArray[np.float64]]:
    """Both faces of a wall of 2 x 2 m, one red and one blue, and its normal.

    `seen` says how they are told apart: by "normals", by "viewpoints", or by "nothing".
    """
    rng = RNG(2)
    back = np.arange(n) % 2 == 1
    points = np.stack([rng.uniform(0, 2, n), np.zeros(n), rng.uniform(0, 2, n)], axis=1)
    points[:, 1] = np.where(back, gap, 0) + rng.normal(0, noise, n)
    normals = np.zeros((n, 3))
    normals[:, 1] = np.where(back, 1, -1)
    colors = np.where(back[:, None], [20, 40, 220], [220, 40, 20]).astype(np.uint8)
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    known = {"normals": {"normals": normals @ turn.T}, "nothing": {}}
    known["viewpoints"] = {"viewpoints": (points + 2 * normals) @ turn.T}
    return sb.PointCloud(points @ turn.T, colors=colors, **known[seen]), turn[:, 1]


def spacing_of(points: NDArray[np.float64]) -> float:
    """Median distance to the nearest other point, by another implementation."""
    distances, _ = cKDTree(points).query(points, k=2)
    return float(np.median(distances[:, 1]))


def share_within(points: NDArray[np.float64], model: sb.model.Model, tolerance: float) -> float:
    """Share of the points that have a decoded one within the tolerance."""
    decoded = model.decode(as_measured=model.keeps_thickness).points
    distances, _ = cKDTree(decoded).query(points)
    return float((distances <= tolerance).mean())


@pytest.mark.parametrize("unit", [1.0, 1000.0, 0.02])
def test_the_survey_follows_spacing_noise_and_unit(unit: float) -> None:
    points = unit * corner(30_000)
    found = sb.survey(sb.PointCloud(points))
    assert found.spacing == pytest.approx(spacing_of(points), rel=0.05)
    assert found.noise == pytest.approx(0.002 * unit, rel=0.3)
    assert found.tolerance == max(2 * found.spacing, 3 * found.noise)
    assert found.layer_gap is None
    assert len(found.outliers) == 0


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("n", [6_000, 30_000])
def test_models_that_promise_it_are_complete_at_defaults(method: str, n: int) -> None:
    points = corner(n)
    cloud = sb.PointCloud(points)
    model = COMPLETE[method](cloud)
    tolerance = max(2 * spacing_of(points), 3 * 0.002)
    assert share_within(points, model, tolerance) >= 0.99
    (option,) = model.report.chosen
    assert option == ("n_neurons" if method == "gas" else "resolution")
    assert model.report.tolerance == pytest.approx(sb.survey(cloud).tolerance)


def test_pixels_follow_a_bound_where_the_data_do_not_ask_for_finer_ones() -> None:
    points = corner(20_000)
    cloud = sb.PointCloud(points)
    (by_data, _) = sb.learn_patches(cloud).report.chosen["resolution"]
    bound = 8 * by_data
    bounded = sb.learn_patches(cloud, max_error=bound)
    assert bounded.report.chosen["resolution"] == (
        pytest.approx(0.5 * bound, rel=0.005),
        f"0.5 times the bound of {bound:.3g} m",
    )
    distances, _ = cKDTree(bounded.decode(as_measured=True).points).query(points)
    assert distances.max() <= bound
    finer = sb.learn_patches(cloud, max_error=bound, resolution=by_data)
    assert len(bounded) < len(finer) / 4
    assert len(bounded.to_bytes()) < len(finer.to_bytes())
    # All of the smaller of both bounds counts; one below the pixels of the data changes nothing.
    both = sb.learn_patches(cloud, max_error=bound, max_error_forward=0.5 * bound)
    assert both.report.chosen["resolution"][0] == pytest.approx(0.5 * bound, rel=0.005)
    tight = sb.learn_patches(cloud, max_error=0.5 * by_data)
    assert tight.report.chosen["resolution"][0] == by_data


@pytest.mark.parametrize(("n", "sigma"), [(600, 0.05), (1500, 0.05), (600, 0.1)])
def test_patches_use_up_what_completeness_allows(n: int, sigma: float) -> None:
    # Clouds of points that patches can reach: without a price of points they miss too many, with
    # all of it hardly any. Less of it is enough, and leaves out what may be left out.
    middles = RNG(5).uniform(0.3, 1.7, (5, 3))
    clutter = [RNG(i).normal(middle, sigma, (n, 3)) for i, middle in enumerate(middles)]
    points = np.vstack([corner(60_000), *clutter])
    cloud = sb.PointCloud(points)
    free = sb.learn_patches(cloud, resolution=0.03, completeness=0)
    model = sb.learn_patches(cloud, resolution=0.03)
    tolerance = 0.8 * model.report.tolerance
    assert share_within(points, free, tolerance) < 0.985
    # At least half of the allowance.
    assert 0.99 <= share_within(points, model, tolerance) < 0.995
    assert model.n_extra_points == 0


def test_pixels_follow_the_unit() -> None:
    points = corner(20_000)
    metres, millimetres = (
        sb.learn_patches(sb.PointCloud(unit * points)).levels[-1].pixel_size for unit in (1, 1000)
    )
    assert millimetres == pytest.approx(1000 * metres, rel=0.01)


def test_quality_scales_what_follows_from_the_data_and_numbers_win() -> None:
    cloud = sb.PointCloud(corner(20_000))
    sides = [
        sb.learn_patches(cloud, quality=quality).levels[-1].pixel_size
        for quality in ("small", "balanced", "fine")
    ]
    assert sides[0] == pytest.approx(2 * sides[1], rel=0.01)
    assert sides[2] == pytest.approx(sides[1] / 2, rel=0.01)
    given = sb.learn_patches(cloud, quality="fine", resolution=0.05)
    assert given.levels[-1].pixel_size == 0.05
    assert given.report.chosen == {}
    neurons = [len(sb.learn_gas(cloud, quality=quality)) for quality in ("small", "fine")]
    assert neurons[0] < neurons[1]


def test_completeness_is_reached_and_not_overshot_by_much() -> None:
    # Clutter in the room: too sparse for patches, too dense for outliers.
    points = np.vstack([corner(20_000), RNG(5).uniform(0, 2, (1000, 3))])
    cloud = sb.PointCloud(points)
    tolerance = sb.survey(cloud).tolerance
    none = sb.learn_patches(cloud, completeness=0.0)
    assert none.n_extra_points == 0
    without = share_within(points, none, 0.8 * tolerance)
    asked = without + 0.5 * (1 - without)
    some = sb.learn_patches(cloud, completeness=asked)
    found = share_within(points, some, 0.8 * tolerance)
    # Patches that are cheaper than points may reach some more.
    assert asked <= found + 1e-9 < asked + 0.25 * (1 - asked)
    most, all_of_them = (sb.learn_patches(cloud, completeness=share) for share in (0.99, 1.0))
    assert 0.99 <= share_within(points, most, 0.8 * tolerance) + 1e-9 < 0.991
    assert share_within(points, all_of_them, 0.8 * tolerance) == 1.0
    n_extra = [model.n_extra_points for model in (some, most, all_of_them)]
    assert n_extra[0] < n_extra[1] < n_extra[2]
    n_bytes = [len(model.to_bytes()) for model in (none, some, most, all_of_them)]
    assert n_bytes == sorted(n_bytes)
    assert some.max_error is None


@pytest.mark.parametrize("turned", [0.0, 0.4])
@pytest.mark.parametrize(
    ("seen", "n", "gap", "noise"),
    [
        ("normals", 30_000, 0.03, 0.001),
        ("normals", 30_000, 0.03, 0.006),
        ("normals", 120_000, 0.03, 0.001),
        ("viewpoints", 30_000, 0.03, 0.003),
        ("viewpoints", 30_000, 0.05, 0.005),
        ("nothing", 30_000, 0.03, 0.001),
        ("nothing", 120_000, 0.03, 0.003),
    ],
)
def test_nothing_is_decoded_between_the_faces_of_a_thin_wall(
    seen: str, n: int, gap: float, noise: float, turned: float
) -> None:
    cloud, across = thin_wall(n, gap, noise, seen, turned)
    found = sb.survey(cloud)
    assert found.layer_gap == pytest.approx(gap, rel=0.05)
    assert found.has_facings == (seen != "nothing")
    # A fine step, so that what colours miss is what leaks from face to face and not rounding.
    decoded = sb.learn_patches(cloud, color_step=50).decode(as_measured=False)

    def between(points: NDArray[np.float64]) -> float:
        depth = points @ across
        return float(np.mean((depth > 0.3 * gap) & (depth < 0.7 * gap)))

    # Noise puts points there; where sides are not known, it also joins both faces of a pixel.
    joined = 0.03 if seen == "nothing" and noise > 0.05 * gap else 0.002
    assert between(decoded.points) <= max(joined, between(cloud.points))
    assert decoded.colors is not None
    red = decoded.colors[:, 0].astype(int) - decoded.colors[:, 2]
    own = np.where(decoded.points @ across < 0.5 * gap, red, -red)
    assert np.mean(own > 0) > 0.99
    assert np.mean(own > 100) > 0.98


def test_a_mad_point_costs_neither_precision_nor_the_model() -> None:
    points = corner(20_000)
    mad = np.vstack([points, [[1e6, -2e6, 5e4]]])
    cloud = sb.PointCloud(mad)
    assert list(cloud.origin) == [0, 0, 0]
    assert list(sb.survey(cloud).strays) == [20_000]
    for learn in (sb.learn_patches, sb.learn_hscsm, sb.learn_gas, sb.learn_planes):
        with pytest.warns(sb.DroppedPointsWarning, match="1 point is far.*keep_outliers=True"):
            model = learn(cloud)
        assert model.report.left_out == 1
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert len(learn(sb.PointCloud(points))) == pytest.approx(len(model), rel=0.05)


def test_the_gas_does_not_chase_outliers_unless_told_to() -> None:
    points = corner(20_000)
    far = np.vstack([points, RNG(3).uniform(-50, 50, (20, 3))])
    off = lambda model: cKDTree(points).query(model.neurons.positions)[0]  # noqa: E731
    with pytest.warns(sb.DroppedPointsWarning):
        model = sb.learn_gas(sb.PointCloud(far), n_neurons=2000)
    assert np.mean(off(model) > 0.1) < 0.01
    kept = sb.learn_gas(sb.PointCloud(far), n_neurons=2000, keep_outliers=True, published=True)
    assert np.mean(off(kept) > 0.1) > 0.1
    # The polish leaves no neurons in empty air: at most one for each of the far points.
    polished = sb.learn_gas(sb.PointCloud(far), n_neurons=2000, keep_outliers=True)
    assert 0 < np.sum(off(polished) > 0.1) <= 20
    assert kept.report.left_out == 0


def test_labels_of_planes_keep_the_places_of_points_that_are_left_out() -> None:
    points = np.insert(corner(20_000), 7, [1e5, 0, 0], axis=0)
    with pytest.warns(sb.DroppedPointsWarning):
        model = sb.learn_planes(sb.PointCloud(points))
    assert model.labels is not None
    assert len(model.labels) == len(points)
    assert model.labels[7] == -1
    assert model.n_points == len(points)


def test_more_neurons_than_places_are_fewer_neurons() -> None:
    points = RNG(4).uniform(0, 1, (50, 3))
    model = sb.learn_gas(sb.PointCloud(points), n_neurons=10_000)
    assert len(model) <= 50
    value, reason = model.report.chosen["n_neurons"]
    assert value == 50
    assert "50 places" in reason


@pytest.mark.parametrize("learn", [sb.learn_patches, sb.learn_hscsm])
@pytest.mark.parametrize("points", [[[1, 2, 3]], [[1, 2, 3]] * 20, [[i, 0, 0] for i in range(9)]])
def test_clouds_that_are_hardly_any_have_defaults_too(
    learn: Callable[..., sb.PatchModel], points: list[list[float]]
) -> None:
    decoded = learn(sb.PointCloud(np.array(points, float))).decode()
    assert len(decoded) > 0


def compressed(
    cloud: sb.PointCloud, folder: Path, capsys: pytest.CaptureFixture[str], *options: str
) -> tuple[str, str]:
    """What `surfabet compress` prints of a cloud, on stdout and on stderr."""
    source = folder / "scan.ply"
    sb.write(source, cloud)
    assert main(["compress", str(source), str(folder / "scan.sfb"), *options]) == 0
    captured = capsys.readouterr()
    return captured.out, captured.err


def test_the_command_line_says_what_was_chosen_and_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = sb.PointCloud(corner(20_000))
    out, err = compressed(cloud, tmp_path, capsys)
    chosen, result = out.splitlines()
    assert "by the data: resolution 0.0" in chosen
    assert "2.25 spacings of" in chosen
    assert "inliers 9" in result or "inliers 100" in result
    assert err == ""
    out, _ = compressed(cloud, tmp_path, capsys, "--resolution", "0.03")
    assert len(out.splitlines()) == 1


def test_the_command_line_says_what_a_model_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = np.vstack([corner(20_000), RNG(5).uniform(0, 2, (2000, 3))])
    _, err = compressed(sb.PointCloud(points), tmp_path, capsys, "--completeness", "0")
    assert "of the points are further than" in err
    assert "--completeness 0.99" in err


@pytest.mark.parametrize(
    ("unit", "said"), [(1000.0, "--unit mm"), (0.004, "--unit"), (1.0, None), (100.0, None)]
)
def test_the_command_line_doubts_units(
    unit: float, said: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, err = compressed(sb.PointCloud(unit * corner(6000)), tmp_path, capsys)
    assert err == "" if said is None else said in err


def test_the_command_line_counts_outliers_under_its_own_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = sb.PointCloud(np.vstack([corner(20_000), [[1e6, -2e6, 5e4]]]))
    out, err = compressed(cloud, tmp_path, capsys)
    assert "--keep-outliers" in err
    assert "keep_outliers" not in err
    # The error is that of the scene, not of the point.
    assert " m (pooled" not in out.splitlines()[-1].split("rmse")[1].split(",")[0].replace("mm", "")


@pytest.mark.parametrize(("rings", "step"), [(16, 0.3), (32, 0.2), (64, 0.2)])
def test_noise_of_scan_lines_is_that_of_the_ranges(rings: int, step: float):
    for noise in (0.005, 0.02):
        found = sb.survey(sb.PointCloud(ring_scan(rings, step, noise)[0]))
        # Rays meet walls and floor aslant: across these it is less than along the ray.
        assert 0.5 * noise < found.noise < 1.1 * noise
        assert found.layer_gap is None


@pytest.mark.parametrize("learn", [sb.learn_patches, sb.learn_hscsm])
@pytest.mark.parametrize(("rings", "step"), [(16, 0.3), (32, 0.2), (64, 0.2)])
def test_lines_are_bridged_and_real_gaps_are_not(
    learn: Callable[..., sb.PatchModel | sb.HscsmModel], rings: int, step: float
):
    points, turn = ring_scan(rings, step)
    model = learn(sb.PointCloud(points))
    pixel, _ = model.report.chosen["resolution"]
    decoded = model.decode().points @ turn

    on_wall = decoded[np.abs(decoded[:, 0] - HALL[1, 0]) < 0.3][:, 1:]
    # A pixel at the rim of the window reaches into it by less than its side: that of the coarser
    # level for patches; masks of HSCSM have the finest pixels.
    side = pixel if isinstance(model, sb.HscsmModel) else model.levels[0].pixel_size
    in_window = (on_wall > HALL_WINDOW[0] + side) & (on_wall < HALL_WINDOW[1] - side)
    assert not in_window.all(axis=1).any()
    if isinstance(model, sb.HscsmModel):
        return  # has pixels where points are
    # The opposite wall is nearer. Lines are bridged there: points are at most a pixel apart.
    opposite = decoded[(np.abs(decoded[:, 0] - HALL[0, 0]) < 0.3) & (np.abs(decoded[:, 1]) < 1)]
    heights = np.sort(opposite[np.abs(opposite[:, 2]) < 1, 2])
    assert np.diff(heights).max() < 1.01 * pixel
    if rings == 16:
        assert np.radians(30 / (rings - 1)) * -HALL[0, 0] > 2 * pixel


def ball(radius: float, n: int = 3000) -> np.ndarray:
    """Points on a sphere, (n, 3)."""
    at = np.random.default_rng(1).normal(size=(n, 3))
    return radius * at / np.linalg.norm(at, axis=1)[:, None]


@pytest.mark.parametrize("options", [{}, {"max_error_forward": 0.01}, {"completeness": 1.0}])
def test_small_things_far_apart_are_learned(options: dict[str, float]) -> None:
    """The tolerance is no finer than positions in so large a scene."""
    small = ball(0.01)
    places = np.array([[0, 0, 0], [100, 0, 0], [0, 1000, 0]])
    cloud = sb.PointCloud((places[:, None] + small).reshape(-1, 3))
    model = sb.learn_patches(cloud, **options)
    distances = cKDTree(model.decode(as_measured=True).points).query(cloud.points)[0]
    beyond = (distances > model.report.tolerance).mean()
    assert beyond <= 1 - options.get("completeness", 0.99) + 1e-9
    # Twice the extent of 500 m over the 2^20 places of a coordinate, and a fifth that is kept.
    assert 0.001 < model.report.tolerance < 0.0013


@pytest.mark.parametrize("n", [1, 5, 2000])
@pytest.mark.parametrize("options", [{}, {"max_error_forward": 0.01}, {"completeness": 1.0}])
def test_points_in_one_place_are_not_lost(n: int, options: dict[str, float]) -> None:
    cloud = sb.PointCloud(np.tile([1.0, 2.0, 3.0], (n, 1)))
    model = sb.learn_patches(cloud, **options)
    decoded = model.decode(as_measured=True).points
    assert len(decoded) > 0
    away = np.linalg.norm(decoded - [1, 2, 3], axis=1)
    assert away.min() <= model.report.tolerance
    assert 0 < model.report.tolerance <= 0.5 * model.levels[-1].pixel_size
    assert away.max() < options.get("max_error_forward", np.inf)
