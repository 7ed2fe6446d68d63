"""Ways of a robot on maps of simulated rooms: the graph of a gas beside a voxel planner.

    python benches/papers/gas_navigation.py [--rooms 0 1 2 3] [--neurons 2000 5000] [--pairs 50]

Each room is seen by a laser from six places. The map is the file of a gas, or an octree of occupied
voxels in the binary format of OctoMap (two bytes per inner node) with voxels as small as the bytes
of that file allow. The voxel planner stands on occupied voxels with free room above, and goes to
the 26 neighbours; what is occupied within the radius of the robot and a half voxel is in the way.

Starts and goals are drawn at random at least 2 m apart, such that a planner on a grid of 5 cm in
the exact scene finds a path for a robot that is `--spare` metres wider on all sides. A path fails
when there is none, or when the robot, an upright capsule above the step that it climbs, meets the
exact surface by more than `--slack` anywhere on it. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from numpy.typing import NDArray
from paper_bench import print_header, print_row
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet import datasets

RADIUS, HEIGHT, STEP = 0.25, 1.0, 0.05
GRID = 0.05
LEAST_DISTANCE = 2.0


def room_for(
    scene: datasets.Scene, feet: NDArray[np.float64], radius: float = RADIUS
) -> NDArray[np.float64]:
    """Distance of the robot's surface to the scene, metres; negative where they meet."""
    heights = np.arange(STEP + radius, HEIGHT - radius + 1e-9, 0.05)
    balls = feet[:, None, :] + heights[None, :, None] * np.array([0, 0, 1.0])
    return scene.distance(balls.reshape(-1, 3)).reshape(balls.shape[:2]).min(axis=1) - radius


class Grid:
    """Nodes joined to those near them; shortest paths between the nodes nearest to two points."""

    def __init__(self, nodes: NDArray[np.float64], reach: float, climb: float) -> None:
        self.nodes, self.tree = nodes, cKDTree(nodes) if len(nodes) else None
        if self.tree is None:
            return
        pairs = self.tree.query_pairs(reach, output_type="ndarray")
        pairs = pairs[np.abs(nodes[pairs[:, 0], 2] - nodes[pairs[:, 1], 2]) <= climb]
        lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        n = len(nodes)
        self.graph = coo_matrix((lengths, (pairs[:, 0], pairs[:, 1])), (n, n)).tocsr()
        self.component = connected_components(self.graph, directed=False)[1]

    def path(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray | None:
        if self.tree is None:
            return None
        distances, (a, b) = self.tree.query([start, goal])
        if distances.max() > HEIGHT or self.component[a] != self.component[b]:
            return None
        _, before = dijkstra(self.graph, directed=False, indices=a, return_predecessors=True)
        nodes = [b]
        while nodes[-1] != a:
            nodes.append(before[nodes[-1]])
        return self.nodes[nodes[::-1]]


def exact_grid(scene: datasets.Scene, cloud: sb.PointCloud, spare: float) -> Grid:
    """The floor of the scene where the robot fits with room to spare, every `GRID`."""
    points = cloud.points
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (np.arange(low[a], high[a], GRID) for a in (0, 1))
    feet = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1)
    feet = feet.reshape(-1, 3)
    on_floor = scene.distance(feet) < 0.01
    feet = feet[on_floor]
    return Grid(feet[room_for(scene, feet, RADIUS + spare) > 0], 1.5 * GRID, STEP)


def octree_bytes(points: NDArray[np.float64], side: float) -> int:
    """Bytes of an octree of occupied voxels: two per inner node, two bits per child."""
    keys = np.unique(np.floor(points / side).astype(np.int64) + 2**15, axis=0)
    inner = 0
    for _ in range(16):
        keys = np.unique(keys >> 1, axis=0)
        inner += len(keys)
    return 2 * inner


def voxels_of(points: NDArray[np.float64], n_bytes: int) -> tuple[Grid, float]:
    """The planner on voxels of so many bytes, and their side, metres."""
    sides = np.geomspace(0.02, 0.5, 60)
    side = float(next((s for s in sides if octree_bytes(points, s) <= n_bytes), sides[-1]))
    keys = np.unique(np.floor(points / side).astype(np.int64), axis=0)
    middles = (keys + 0.5) * side
    up = np.array([0, 0, 1.0])
    tops = middles + 0.5 * side * up
    tree = cKDTree(middles)
    reach = RADIUS + 0.5 * side
    near = tree.query_ball_point(tops + 0.5 * HEIGHT * up, np.hypot(reach, 0.5 * HEIGHT + side))
    free = [
        not any(
            np.hypot(*(middles[j] - top)[:2]) < reach
            and max(STEP, 0.5 * side) < middles[j, 2] - top[2] < HEIGHT
            for j in others
        )
        for top, others in zip(tops, near, strict=True)
    ]
    return Grid(tops[np.array(free, bool)], 1.8 * side, max(STEP, 1.01 * side)), side


def outcome(
    scene: datasets.Scene, path: NDArray[np.float64] | None, shortest: float, slack: float
) -> tuple[str, float]:
    """Whether a path is safe, and its length over that of the shortest one."""
    if path is None:
        return "none", np.nan
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    parts = [
        a + (b - a) * np.linspace(0, 1, max(2, int(step / 0.02)))[:, None]
        for a, b, step in zip(path[:-1], path[1:], steps, strict=True)
    ]
    feet = np.concatenate([*parts, path[-1:]])
    # On the true floor: the map's may be a little above or below.
    feet[:, 2] = 0
    if room_for(scene, feet).min() < -slack:
        return "collides", np.nan
    return "safe", steps.sum() / shortest


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rooms", type=int, nargs="+", default=[0, 1, 2, 3])
    parser.add_argument("--neurons", type=int, nargs="+", default=[2000, 5000])
    parser.add_argument("--pairs", type=int, default=50)
    parser.add_argument("--spare", type=float, default=0.05)
    parser.add_argument("--slack", type=float, default=0.02)
    options = parser.parse_args()
    print_header(
        "room", "neurons", "bytes", "planner", "safe", "no path", "collides", "length over shortest"
    )
    for seed in options.rooms:
        scan = datasets.scan_lidar(datasets.make_room(seed=seed), n_scans=6)
        scene, cloud = scan.scene, scan.cloud
        exact = exact_grid(scene, cloud, options.spare)
        rng = np.random.default_rng(seed)
        pairs = []
        while len(pairs) < options.pairs:
            a, b = rng.integers(0, len(exact.nodes), 2)
            apart = np.linalg.norm(exact.nodes[a] - exact.nodes[b]) >= LEAST_DISTANCE
            if apart and (path := exact.path(exact.nodes[a], exact.nodes[b])) is not None:
                length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
                pairs.append((exact.nodes[a], exact.nodes[b], length))
        for n_neurons in options.neurons:
            model = sb.learn_gas(cloud, n_neurons=n_neurons)
            n_bytes = len(model.to_bytes())
            graph = model.navigation(radius=RADIUS, height=HEIGHT, max_step=STEP)
            voxels, side = voxels_of(cloud.points, n_bytes)

            def of_graph(a: NDArray, b: NDArray, graph: sb.NavigationGraph = graph):
                try:
                    return graph.path(a, b)
                except sb.InvalidInputError:
                    return None

            for name, find in (("gas", of_graph), (f"voxels, {side:.2f} m", voxels.path)):
                found = [outcome(scene, find(a, b), c, options.slack) for a, b, c in pairs]
                count = Counter(what for what, _ in found)
                ratio = np.nanmedian([r for _, r in found]) if count["safe"] else np.nan
                share = {
                    k: f"{100 * count[k] / len(pairs):.0f} %" for k in ("safe", "none", "collides")
                }
                print_row(
                    seed, f"{n_neurons:,}", f"{n_bytes:,}", name, *share.values(), f"{ratio:.2f}"
                )


if __name__ == "__main__":
    main()
