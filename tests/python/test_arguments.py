"""Every argument of the public functions: a wrong value is refused by an error that names it."""

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import surfabet as sb
import surfabet.plan
import surfabet.sparse
from surfabet import comparison, datasets, io

MODULES: tuple[ModuleType, ...] = (sb, surfabet.plan, surfabet.sparse, datasets, comparison, io)

VALUES: list[tuple[Any, set[str]]] = [
    (None, {"None", "Progress"}),
    (True, {"bool", "Progress"}),
    ("nonsense", {"str", "os.PathLike[str]", "Any"}),
    (1.5, {"float"}),
    (-1, {"negative"}),
    (math.nan, set()),
    ([1.0, "x"], set()),
    (object(), set()),
    (np.ones((2, 2, 2)), set()),
]
"""What arguments are given, and the kinds of arguments that may take it."""

NEGATIVE = {
    "RangeImage.pinhole": {"cx", "cy"},
    "floor_plan": {"floor"},
    "FoundOccurrence.mask": {"margin"},
}
"""Numbers that may be below zero."""


class Things:
    """What functions are called with, small; learned once."""

    def __init__(self, folder: Path) -> None:
        side = 0.02 * np.arange(50)
        flat = np.stack([*np.meshgrid(side, side), np.zeros((50, 50))], axis=-1).reshape(-1, 3)
        self.points = np.concatenate([flat, flat[:, [0, 2, 1]]])
        self.folder = folder
        self.cloud = sb.PointCloud(self.points)
        self.scan = folder / "scan.ply"
        sb.write(self.scan, self.cloud)
        self.patches = sb.learn_patches(self.cloud, resolution=0.05)
        self.file = folder / "model.sfb"
        self.patches.save(self.file)
        self.map = folder / "map.sfb"
        sb.learn_patches_tiled(self.cloud, self.map, tile=3.2, resolution=0.05)
        self.tiled = sb.load(self.map)
        self.hscsm = sb.learn_hscsm(self.cloud, resolution=0.05, levels=1)
        self.words = sb.learn_alphabet(self.cloud, radius=0.1, scales=1)
        self.bic = sb.learn_bic_alphabet(self.cloud, radius=0.2)
        self.planes = sb.learn_planes(self.cloud)
        self.gas = sb.learn_gas(self.cloud, n_neurons=50)
        self.index = sb.place_index([self.words])
        self.grid, self.tree = sb.VoxelGrid(self.cloud, 0.1), sb.Octree(self.cloud, 0.1)
        self.neighbours = sb.KdTree(self.cloud)
        self.view: dict[str, Any] = {"azimuth_step": 0.1, "elevation_step": 0.1}
        self.view |= {"elevations": (-1.0, 1.0)}
        self.camera = {"fx": 50.0, "fy": 50.0, "cx": 20.0, "cy": 20.0, "width": 40, "height": 40}
        self.image = sb.RangeImage.spherical(self.cloud, **self.view)
        self.found = sb.FoundOccurrence(
            np.eye(4), 1.0, np.zeros(3), region=(np.zeros(3), np.ones(3))
        )
        self.codes = surfabet.sparse.omp(np.eye(3), self.points[:5])
        self.room = datasets.make_room()
        self.frames = datasets.scan_rgbd(self.room, n_frames=1, width=32, height=24).frames
        self.rgbd = folder / "rgbd"
        datasets.write_rgbd_folder(self.rgbd, self.frames)
        self.plan = surfabet.plan.FloorPlan((), (), 0.0, None, np.eye(3))


Call = tuple[Callable[..., Any], dict[str, Any]]

CALLS: dict[str, Callable[[Things], Call]] = {
    "PointCloud": lambda t: (sb.PointCloud, {"points": t.points}),
    "PointCloud.checked": lambda t: (sb.PointCloud.checked, {"points": t.points}),
    "PointCloud.concat": lambda t: (sb.PointCloud.concat, {}),
    "PointCloud.seen_from": lambda t: (t.cloud.seen_from, {}),
    "PointCloud.select": lambda t: (t.cloud.select, {}),
    "KdTree": lambda t: (sb.KdTree, {}),
    "KdTree.query": lambda t: (t.neighbours.query, {"points": t.cloud}),
    "KdTree.query_radius": lambda t: (
        t.neighbours.query_radius,
        {"points": t.cloud, "radius": 1.0},
    ),
    "VoxelGrid": lambda t: (sb.VoxelGrid, {"cloud": t.cloud, "size": 0.1}),
    "VoxelGrid.with_at_most": lambda t: (
        sb.VoxelGrid.with_at_most,
        {"cloud": t.cloud, "count": 10},
    ),
    "VoxelGrid.means": lambda t: (t.grid.means, {}),
    "Octree": lambda t: (sb.Octree, {"cloud": t.cloud, "leaf_size": 0.1}),
    "Octree.with_at_most": lambda t: (sb.Octree.with_at_most, {"cloud": t.cloud, "count": 10}),
    "Octree.level_with_at_most": lambda t: (t.tree.level_with_at_most, {}),
    "Octree.node_size": lambda t: (t.tree.node_size, {}),
    "Octree.counts": lambda t: (t.tree.counts, {}),
    "Octree.centers": lambda t: (t.tree.centers, {}),
    "Octree.centroids": lambda t: (t.tree.centroids, {}),
    "RangeImage.spherical": lambda t: (sb.RangeImage.spherical, {"cloud": t.cloud, **t.view}),
    "RangeImage.pinhole": lambda t: (sb.RangeImage.pinhole, {"cloud": t.cloud, **t.camera}),
    "RangeImage.project": lambda t: (t.image.project, {}),
    "RangeImage.unproject": lambda t: (
        t.image.unproject,
        {"rows": [1], "columns": [1], "ranges": [1.0]},
    ),
    "set_num_threads": lambda t: (sb.set_num_threads, {}),
    "estimate_normals": lambda t: (sb.estimate_normals, {"cloud": t.cloud}),
    "voxel_downsample": lambda t: (sb.voxel_downsample, {"cloud": t.cloud, "size": 0.1}),
    "octree_downsample": lambda t: (sb.octree_downsample, {"cloud": t.cloud, "size": 0.1}),
    "random_downsample": lambda t: (sb.random_downsample, {"cloud": t.cloud, "count": 10}),
    "farthest_point_downsample": lambda t: (
        sb.farthest_point_downsample,
        {"cloud": t.cloud, "count": 10},
    ),
    "survey": lambda t: (sb.survey, {"cloud": t.cloud}),
    "read": lambda t: (sb.read, {"path": t.scan}),
    "write": lambda t: (sb.write, {"path": t.folder / "a.ply", "cloud": t.cloud}),
    "load": lambda t: (sb.load, {"path": t.map}),
    "from_bytes": lambda t: (sb.from_bytes, {"data": t.patches.to_bytes()}),
    "inspect": lambda t: (sb.inspect, {}),
    "evaluate": lambda t: (sb.evaluate, {"reference": t.cloud, "decoded": t.cloud}),
    "Model.decode": lambda t: (t.patches.decode, {}),
    "Model.localizer": lambda t: (t.planes.localizer, {}),
    "Model.locate": lambda t: (t.patches.locate, {"scan": t.cloud, "prior": np.eye(4)}),
    "Localizer.locate": lambda t: (
        t.patches.localizer().locate,
        {"scan": t.cloud, "prior": np.eye(4)},
    ),
    "Model.to_bytes": lambda t: (t.patches.to_bytes, {}),
    "Model.save": lambda t: (t.patches.save, {"path": t.folder / "a.sfb"}),
    "LatticeModel.export": lambda t: (t.patches.export, {}),
    "Mesh.export": lambda t: (t.patches.mesh().export, {}),
    "learn_patches": lambda t: (sb.learn_patches, {"cloud": t.cloud}),
    "learn_patches_tiled": lambda t: (
        sb.learn_patches_tiled,
        {"source": t.cloud, "path": t.folder / "b.sfb"},
    ),
    "TiledPatchModel.decode": lambda t: (t.tiled.decode, {}),
    "TiledPatchModel.update": lambda t: (t.tiled.update, {"cloud": t.cloud}),
    "TiledPatchModel.save": lambda t: (t.tiled.save, {"path": t.folder / "a.sfb"}),
    "merge_tiles": lambda t: (sb.merge_tiles, {"models": [t.tiled]}),
    "diff": lambda t: (sb.diff, {"a": t.patches, "b": t.patches}),
    "view": lambda t: (sb.view, {"model": t.file, "path": t.folder / "a.html", "open": False}),
    "learn_hscsm": lambda t: (sb.learn_hscsm, {"cloud": t.cloud}),
    "HscsmDictionary.describe": lambda t: (t.hscsm.dictionary.describe, {"cloud": t.cloud}),
    "HscsmDictionary.concatenated": lambda t: (t.hscsm.dictionary.concatenated, {}),
    "HscsmModel.masks": lambda t: (t.hscsm.masks, {}),
    "HscsmModel.means": lambda t: (t.hscsm.means, {}),
    "HscsmModel.codes": lambda t: (t.hscsm.codes, {}),
    "learn_alphabet": lambda t: (sb.learn_alphabet, {"cloud": t.cloud}),
    "Alphabet.describe": lambda t: (t.words.alphabet.describe, {"cloud": t.cloud}),
    "AlphabetModel.find": lambda t: (t.words.find, {"point": (0.0, 0.0, 0.0), "radius": 0.3}),
    "FoundOccurrence.mask": lambda t: (t.found.mask, {"points": t.points}),
    "place_similarity": lambda t: (sb.place_similarity, {"a": t.words, "b": t.words}),
    "recurring": lambda t: (sb.recurring, {"scene": t.words}),
    "RecurringClasses.draw": lambda t: (
        sb.RecurringClasses(t.words, []).draw,
        {"path": t.folder / "a.png"},
    ),
    "place_index": lambda t: (sb.place_index, {"places": [t.words]}),
    "label_places": lambda t: (sb.label_places, {"places": [t.words]}),
    "PlaceIndex.query": lambda t: (t.index.query, {"place": t.words}),
    "learn_bic_alphabet": lambda t: (sb.learn_bic_alphabet, {"cloud": t.cloud}),
    "BicAlphabet.describe": lambda t: (t.bic.alphabet.describe, {"cloud": t.cloud}),
    "BicAlphabet.first": lambda t: (t.bic.alphabet.first, {}),
    "learn_planes": lambda t: (sb.learn_planes, {"cloud": t.cloud}),
    "random_planes": lambda t: (sb.random_planes, {"cloud": t.cloud, "n_planes": 2}),
    "fit_planes_em": lambda t: (
        sb.fit_planes_em,
        {"cloud": t.cloud, "centers": [[0.0, 0.0, 0.0]], "normals": [[0.0, 0.0, 1.0]]},
    ),
    "PlaneModel.segment": lambda t: (t.planes.segment, {"cloud": t.cloud}),
    "PlaneModel.project": lambda t: (t.planes.project, {"cloud": t.cloud}),
    "PlaneModel.polygons": lambda t: (t.planes.polygons, {}),
    "PlaneModel.export": lambda t: (t.planes.export, {}),
    "floor_plan": lambda t: (surfabet.plan.floor_plan, {"model": t.planes}),
    "FloorPlan.draw": lambda t: (t.plan.draw, {}),
    "FloorPlan.save": lambda t: (t.plan.save, {}),
    "learn_gas": lambda t: (sb.learn_gas, {"cloud": t.cloud}),
    "GasModel.update": lambda t: (t.gas.update, {"cloud": t.cloud}),
    "GasModel.export": lambda t: (t.gas.export, {}),
    "GasModel.geodesic_distance": lambda t: (t.gas.geodesic_distance, {"source": 0, "target": 0}),
    "GasModel.geodesic_distances": lambda t: (t.gas.geodesic_distances, {}),
    "GasModel.navigation": lambda t: (t.gas.navigation, {}),
    "NavigationGraph.path": lambda t: (
        t.gas.navigation().path,
        {"start": (0.0, 0.0, 0.0), "goal": (0.0, 0.0, 0.0)},
    ),
    "omp": lambda t: (surfabet.sparse.omp, {"dictionary": np.eye(3), "signals": t.points[:5]}),
    "ksvd": lambda t: (surfabet.sparse.ksvd, {"signals": t.points[:5], "n_atoms": 2}),
    "reconstruct": lambda t: (
        surfabet.sparse.reconstruct,
        {"dictionary": np.eye(3), "codes": t.codes},
    ),
    "squared_errors": lambda t: (
        surfabet.sparse.squared_errors,
        {"dictionary": np.eye(3), "signals": t.points[:5], "codes": t.codes},
    ),
    "SparseCodes": lambda t: (
        surfabet.sparse.SparseCodes,
        {"offsets": [0, 1], "atoms": [0], "coefficients": [1.0]},
    ),
    "SparseCodes.to_dense": lambda t: (t.codes.to_dense, {}),
    "detect": lambda t: (io.detect, {}),
    "list_topics": lambda t: (io.list_topics, {}),
    "read_bag": lambda t: (io.read_bag, {"path": t.scan}),
    "read_rgbd": lambda t: (io.read_rgbd, {"path": t.rgbd}),
    "compare": lambda t: (comparison.compare, {"cloud": t.cloud, "tools": ["planes"]}),
    "make_room": lambda t: (datasets.make_room, {}),
    "scan_rgbd": lambda t: (datasets.scan_rgbd, {"scene": t.room}),
    "scan_lidar": lambda t: (datasets.scan_lidar, {"scene": t.room}),
    "simulated_room": lambda t: (datasets.simulated_room, {}),
    "load_demo": lambda t: (datasets.load_demo, {}),
    "write_rgbd_folder": lambda t: (
        datasets.write_rgbd_folder,
        {"path": t.folder / "frames", "frames": t.frames},
    ),
    "Scene.default_poses": lambda t: (t.room.default_poses, {}),
    "Scene.default_lidar_poses": lambda t: (t.room.default_lidar_poses, {}),
    "Scene.distance": lambda t: (t.room.distance, {}),
    "Scene.closest_points": lambda t: (t.room.closest_points, {}),
    "Scene.sample_surface": lambda t: (t.room.sample_surface, {}),
    "Scene.rearranged": lambda t: (t.room.rearranged, {}),
    "Scene.visible": lambda t: (
        t.room.visible,
        {"points": t.points, "normals": t.points, "viewpoints": t.points[:1]},
    ),
}
"""What is called, and its other arguments, by qualified name."""

CONSTRUCTORS = {"PointCloud", "KdTree", "VoxelGrid", "Octree", "SparseCodes"}
"""Other classes are made by functions, or hold what functions give."""


BEHIND_FUNCTIONS = {"Scene.room", "Scene.scan_rgbd", "Scene.scan_lidar", "named_format"}
"""Called by other functions, whose arguments errors name."""


def public() -> Iterator[str]:
    """Qualified names of the public functions and methods that take arguments."""
    for module in MODULES:
        for name in module.__all__:
            thing = getattr(module, name)
            if not inspect.isclass(thing):
                if callable(thing) and inspect.signature(thing).parameters:
                    yield name
                continue
            yield from [name] if name in CONSTRUCTORS else []
            for method_name, method in inspect.getmembers(thing, callable):
                if method_name.startswith("_") or issubclass(thing, Exception):
                    continue
                owner = method.__qualname__.split(".")[0]
                parameters = set(inspect.signature(method).parameters) - {"self"}
                if parameters and owner in {*module.__all__, "Model", "LatticeModel"}:
                    yield method.__qualname__


def test_no_function_is_left_out() -> None:
    assert set(public()) - BEHIND_FUNCTIONS == set(CALLS)


@cache
def stubs() -> dict[str, dict[str, str]]:
    """The annotations of what is written in Rust, by qualified name."""
    tree = ast.parse((Path(sb.__file__).parent / "_core.pyi").read_text())
    found = {}
    for owner in [tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))]:
        prefix = f"{owner.name}." if isinstance(owner, ast.ClassDef) else ""
        for function in owner.body:
            if isinstance(function, ast.FunctionDef):
                of = [*function.args.args, *function.args.kwonlyargs]
                named = {a.arg: ast.unparse(a.annotation) for a in of if a.annotation}
                found[(prefix + function.name).removesuffix(".__new__")] = named
    return found


def annotations(name: str, function: Callable[..., Any]) -> dict[str, str]:
    """The annotations of all arguments that a function names."""
    if inspect.isfunction(function) or inspect.ismethod(function):
        return {
            parameter.name: str(parameter.annotation)
            for parameter in inspect.signature(function).parameters.values()
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD
        }
    return stubs()[name]


def complaint(call: Call, argument: str, value: Any) -> str | None:
    """What is wrong with the answer to a wrong value; None where it is as it should be."""
    function, others = call
    given = f"{argument}={value!r:.40}"
    try:
        function(**{**others, argument: value})
    except sb.InvalidInputError as error:
        if not str(error.argument).startswith(argument):
            return f"{given}: about {error.argument}: {error}"
        shown = str(error)
        if not re.match(rf"{re.escape(str(error.argument))} is .*, but must be ", shown, re.DOTALL):
            return f"{given}: {error}"
        return None
    except Exception as error:
        return f"{given}: {type(error).__name__}: {error}"
    return f"{given} is accepted"


@pytest.fixture(scope="module")
def things(tmp_path_factory: pytest.TempPathFactory) -> Things:
    return Things(tmp_path_factory.mktemp("arguments"))


@pytest.mark.parametrize("name", CALLS)
def test_wrong_values_are_named(things: Things, name: str) -> None:
    call = CALLS[name](things)
    complaints = []
    for argument, annotation in annotations(name, call[0]).items():
        kinds = set(annotation.replace("ProgressCallback", "Progress").split(" | "))
        if argument in NEGATIVE.get(name, set()):
            kinds.add("negative")
        for value, taken_by in VALUES:
            if not kinds & taken_by:
                complaints.append(complaint(call, argument, value))
    found = [text for text in complaints if text is not None]
    assert not found, "\n".join(found)
