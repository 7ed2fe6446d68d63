"""Growing neural gas from Python: arrays, files, topology against scipy, reducers, command line."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

import surfabet as sb
from generated import DATA, WITHOUT_DATA, kinect_frame, write_organised_pcd
from surfabet.cli import main
from surfabet.errors import InvalidInputError


def corner(n: int = 30_000, noise: float = 0.004) -> sb.PointCloud:
    """Floor and two walls of one metre, a colour each, and a ball apart from them."""
    rng = np.random.default_rng(3)
    points, colors = [], []
    for axis, color in enumerate([(200, 60, 40), (40, 180, 60), (60, 60, 200)]):
        p = np.empty((n // 4, 3))
        p[:, axis] = noise * rng.standard_normal(n // 4)
        p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = rng.random((2, n // 4))
        points.append(p)
        colors.append(np.tile(np.array(color, np.uint8), (n // 4, 1)))
    ball = rng.standard_normal((n // 4, 3))
    points.append(3 + 0.3 * ball / np.linalg.norm(ball, axis=1)[:, None])
    colors.append(np.full((n // 4, 3), 128, np.uint8))
    return sb.PointCloud(np.concatenate(points), colors=np.concatenate(colors))


@pytest.fixture(scope="module")
def cloud() -> sb.PointCloud:
    return corner()


@pytest.fixture(scope="module")
def model(cloud: sb.PointCloud) -> sb.GasModel:
    return sb.learn_gas(cloud, n_neurons=600, patterns=200)


def graph(model: sb.GasModel) -> coo_matrix:
    (a, b), p = model.edges.T.astype(np.int64), model.neurons.positions
    lengths = np.linalg.norm(p[a] - p[b], axis=1)
    return coo_matrix((lengths, (a, b)), shape=(len(model), len(model)))


def test_neurons_and_edges_as_arrays(model, cloud):
    neurons = model.neurons
    assert len(neurons) == len(model) == 600
    assert neurons.positions.shape == (600, 3)
    assert neurons.normals.shape == (600, 3)
    assert neurons.colors is not None
    assert neurons.colors.shape == (600, 3)
    for column in (neurons.counts, neurons.radii, neurons.thicknesses, neurons.densities):
        assert column.shape == (600,)
        assert (column >= 0).all()
    edges = model.edges
    assert (edges[:, 0] < edges[:, 1]).all()
    assert edges.max() < 600
    assert len(np.unique(edges, axis=0)) == len(edges)
    # Every neuron has a neighbour, else it would have been removed.
    assert set(edges.ravel()) == set(range(600))
    lengths = np.linalg.norm(neurons.normals, axis=1)
    np.testing.assert_allclose(lengths[lengths > 0], 1, atol=1e-5)
    assert "600 neurons" in repr(model)
    assert f"{len(edges)} edges" in repr(model)


def test_mean_error_and_statistics_are_those_of_the_nearest_points(model, cloud):
    neurons = model.neurons
    distances, nearest = cKDTree(neurons.positions).query(cloud.points)
    assert model.mean_error == pytest.approx(distances.mean(), rel=1e-4)
    counts = np.bincount(nearest, minlength=600)
    some = counts > 0
    # Rounded to a quarter of a doubling.
    np.testing.assert_allclose(np.log2(neurons.counts[some] / counts[some]), 0, atol=0.126)
    # Colours of walls away from the corner, rounded to steps of 8.
    p = neurons.positions
    floor = (p[:, 2] < 0.05) & (p[:, 0] > 0.15) & (p[:, 1] > 0.15) & (p[:, 0] < 1.5)
    assert floor.sum() > 50
    np.testing.assert_allclose(neurons.colors[floor], [[60, 60, 200]] * floor.sum(), atol=9)
    assert (np.abs(neurons.normals[floor, 2]) > 0.97).all()
    assert 0.003 < np.median(neurons.thicknesses[floor]) < 0.005


def test_it_is_nearer_to_the_scan_than_grids_and_samples_of_as_many(cloud, model):
    def error(points):
        return cKDTree(points).query(cloud.points)[0].mean()

    ours = error(model.neurons.positions)
    assert ours < error(sb.voxel_downsample(cloud, count=600).points)
    assert ours < error(sb.octree_downsample(cloud, count=600).points)
    assert ours < error(sb.octree_downsample(cloud, count=600, representative="center").points)
    assert ours < error(sb.random_downsample(cloud, 600).points)
    assert ours < error(sb.farthest_point_downsample(cloud, 600).points)


def test_components_and_ways_agree_with_scipy(model):
    expected_n, expected = connected_components(graph(model), directed=False)
    found = model.components()
    assert found.max() + 1 == expected_n >= 2
    assert len(set(zip(found, expected, strict=True))) == expected_n
    ways = dijkstra(graph(model), directed=False, indices=17)
    np.testing.assert_allclose(model.geodesic_distances(17), ways, rtol=1e-5)
    assert model.geodesic_distance(17, 300) == pytest.approx(ways[300], rel=1e-5)
    with pytest.raises(InvalidInputError, match="source"):
        model.geodesic_distances(600)


def test_the_mesh_is_of_the_graph_and_oriented_by_normals(model):
    mesh, neurons = model.mesh().triangles, model.neurons
    sides = np.concatenate([mesh[:, [0, 1]], mesh[:, [1, 2]], mesh[:, [2, 0]]])
    assert len(np.unique(sides, axis=0)) == len(sides)
    p, q, r = (neurons.positions[mesh[:, i]] for i in range(3))
    cross = np.cross(q - p, r - p)
    agree = np.einsum("ij,ij->i", cross, neurons.normals[mesh].sum(axis=1))
    assert (agree > 0).all()
    # Three squares of a metre and a ball of radius 0.3.
    area = np.linalg.norm(cross, axis=1).sum() / 2
    exact, rims = 3 + 4 * np.pi * 0.09, 12 * 0.045
    # Rims of 12 m lose half an edge (0.09 m), an eighth of all; up to a fifth stays open.
    assert 0.68 < area / exact < 1 - rims / exact


def test_decoding_at_a_spacing(model, cloud):
    assert len(model.decode()) == len(model)
    decoded = model.decode(0.01)
    forward = cKDTree(cloud.points).query(decoded.points)[0]
    backward = cKDTree(decoded.points).query(cloud.points)[0]
    assert np.sqrt((forward**2).mean()) < 0.012
    assert np.sqrt((backward**2).mean()) < 0.012
    # Decoded points are as far apart as asked for, by far most of them.
    apart = cKDTree(decoded.points).query(decoded.points, 2)[0][:, 1]
    assert 0.006 < np.median(apart) <= 0.0101


def test_update_keeps_the_old_and_learns_the_new(model, cloud):
    moved = sb.PointCloud(cloud.points + np.array([0.8, 0, 0]), colors=cloud.colors)
    larger = model.update(moved, 1000)
    assert len(larger) == 1000
    assert len(model) == 600
    assert larger.n_points == 2 * len(cloud)

    def error(m, c):
        return cKDTree(m.neurons.positions).query(c.points)[0].mean()

    # Floor, walls and balls of both scans are 7.86 m2, of one 4.13. Errors go with the root of the
    # area that a neuron has.
    expected = error(model, cloud) * np.sqrt(7.86 / 1000 / (4.13 / 600))
    for scan in (cloud, moved):
        assert error(larger, scan) == pytest.approx(expected, rel=0.05)
    assert error(model, moved) > 3 * error(larger, moved)
    # Left to itself it grows about as much as there is new space: by 6 to 7 percent less, with each
    # of eight random states.
    assert len(model.update(moved)) == pytest.approx(600 * 7.86 / 4.13, rel=0.1)


def test_both_searches_give_the_same_bytes(cloud):
    def learn(**options):
        return sb.learn_gas(cloud, n_neurons=200, patterns=50, random_state=5, **options).to_bytes()

    expected = learn()
    assert learn(search="brute-force") == expected
    assert sb.learn_gas(cloud, n_neurons=200, patterns=50, random_state=6).to_bytes() != expected


def test_published(cloud):
    published = sb.learn_gas(cloud, n_neurons=300, published=True)
    grown = sb.learn_gas(cloud, n_neurons=300, patterns=300, beta=0.005, polish=0)
    assert published.to_bytes() == grown.to_bytes()
    polished = sb.learn_gas(cloud, n_neurons=300)
    assert len(polished) == 300
    assert polished.mean_error < published.mean_error
    assert len(polished.report.objectives["mean distance in the polish"]) == 10
    # Every neuron is joined, and most of those that are the two nearest to a point are so.
    pairs = np.sort(cKDTree(polished.neurons.positions).query(cloud.points, 2)[1], axis=1)
    edges = {tuple(edge) for edge in polished.edges.tolist()}
    assert np.mean([tuple(pair) in edges for pair in pairs.tolist()]) > 0.95
    assert len(np.unique(polished.edges)) == 300


def test_stops(cloud):
    # Without the polish, which comes after growth.
    by_error = sb.learn_gas(cloud, n_neurons=5000, target_error=0.08, polish=0)
    # It ends with the first 4096 signals whose mean is small enough. Meanwhile 14 neurons came, and
    # errors go with the root of the area that a neuron has: the network is half of these signals
    # further than their mean, which the one before was not small enough for. The mean of so many is
    # off by half a percent.
    n = len(by_error)
    least, most = (0.08 * np.sqrt((n - k * 4096 / 300) / n) for k in (1.5, 0.5))
    assert 0.98 * least < by_error.mean_error < 1.02 * most
    assert by_error.report.stop_reason == "mean distance reached"
    by_passes = sb.learn_gas(cloud, n_neurons=5000, passes=1, patterns=300)
    assert by_passes.report.iterations == len(cloud)
    assert len(by_passes) <= len(cloud) / 300 + 2


def test_input_that_cannot_be(cloud):
    same = np.ones((100, 3))
    with pytest.raises(InvalidInputError, match="the cloud has 1"):
        sb.learn_gas(sb.PointCloud(same), n_neurons=2)
    assert len(sb.learn_gas(sb.PointCloud(np.concatenate([same, 2 * same])), n_neurons=3)) == 2
    with pytest.warns(sb.DroppedPointsWarning):
        holed = sb.PointCloud(np.concatenate([cloud.points, [[np.nan, 0, 0]]]))
    assert len(sb.learn_gas(holed, n_neurons=20, patterns=20)) == 20


def test_reducers(cloud):
    for reduced in (
        sb.voxel_downsample(cloud, count=500),
        sb.octree_downsample(cloud, count=500),
        sb.octree_downsample(cloud, count=500, representative="center"),
    ):
        assert 480 <= len(reduced) <= 500
    chosen = sb.farthest_point_downsample(cloud, 50, start=3).points
    np.testing.assert_allclose(chosen[0], cloud.points[3])
    distances = np.full(len(cloud), np.inf)
    for point, following in itertools.pairwise(chosen):
        distances = np.minimum(distances, np.linalg.norm(cloud.points - point, axis=1))
        # The farthest point from all before it: no point is farther, and this one is as far.
        found = np.linalg.norm(cloud.points - following, axis=1).argmin()
        np.testing.assert_allclose(following, cloud.points[found])
        assert distances[found] == pytest.approx(distances.max(), rel=1e-5)
        assert distances[found] > 0
    drawn = sb.random_downsample(cloud, 100, random_state=1)
    assert len(drawn) == 100
    assert drawn.colors is not None
    assert (cKDTree(cloud.points).query(drawn.points)[0] == 0).all()
    for wrong in ({}, {"size": 0.1, "count": 5}, {"count": 0}):
        with pytest.raises(InvalidInputError):
            sb.voxel_downsample(cloud, **wrong)
        with pytest.raises(InvalidInputError):
            sb.octree_downsample(cloud, **wrong)
    with pytest.raises(InvalidInputError, match="representative"):
        sb.octree_downsample(cloud, 0.1, representative="corner")
    with pytest.raises(InvalidInputError, match="count"):
        sb.random_downsample(cloud, len(cloud) + 1)
    with pytest.raises(InvalidInputError, match="start"):
        sb.farthest_point_downsample(cloud, 5, start=len(cloud))


def test_command_line(cloud, tmp_path, capsys):
    scan, model, again = (tmp_path / name for name in ("scan.ply", "gas.sfb", "again.ply"))
    sb.write(scan, cloud)
    arguments = ["compress", str(scan), str(model), "--model", "gas", "--n-neurons", "300"]
    assert main([*arguments, "--patterns", "50", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["output"]["bytes"] == model.stat().st_size
    assert told["report"]["figures"]["neurons"] == 300
    assert main(["info", str(model), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["method"] == "gas"
    assert main(["decompress", str(model), str(again), "--resolution", "0.02"]) == 0
    assert len(sb.read(again)) > 5000
    assert main(["evaluate", str(scan), str(model)]) == 0
    capsys.readouterr()
    assert main([*arguments, "--rate", "1"]) == 2
    assert "--rate: not an option of --model gas, but of patches" in capsys.readouterr().err
    assert main(["compress", str(scan), str(model), "--n-neurons", "30"]) == 2
    assert "--n-neurons: not an option of --model patches, but of gas" in capsys.readouterr().err
    assert main(["verify", str(scan), str(model)]) == 2


def nearer_than_a_voxel_grid(frame: sb.PointCloud, n: int) -> float:
    """Mean distance to the neurons of a gas, by that to as many means of a voxel grid."""
    model = sb.learn_gas(frame, n_neurons=n)
    grid = sb.voxel_downsample(frame, count=n)
    return model.mean_error / cKDTree(grid.points).query(frame.points)[0].mean()


def test_nearer_than_a_voxel_grid_on_a_frame_of_structured_light(tmp_path):
    """Twin of the test below."""
    write_organised_pcd(tmp_path / "frame.pcd", kinect_frame(), width=240)
    with pytest.warns(sb.DroppedPointsWarning, match="of 43200 points"):
        frame = sb.read(tmp_path / "frame.pcd")
    assert nearer_than_a_voxel_grid(frame, 2000) < 0.95


@pytest.mark.skipif(not DATA.is_dir(), reason=WITHOUT_DATA)
def test_five_percent_nearer_than_a_voxel_grid_on_a_kinect_frame():
    with pytest.warns(sb.DroppedPointsWarning):
        frame = sb.read(DATA / "rgbd_frame" / "table.pcd")
    assert nearer_than_a_voxel_grid(frame, 2000) < 0.95
