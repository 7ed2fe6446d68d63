"""Maps that go on from session to session, beside learning all at once.

    python benches/papers/sessions.py [--part building|kitchen|again|same] [--rooms 12]

The building has twelve simulated rooms in a row; session k scans rooms k and k + 1 with noise of
its own, so that all but the first and the last are scanned twice. The kitchen is the 50 frames of
`rgbd_room`, every third pixel, in five sessions of ten frames. `again` is a second pass: other
noise in the same rooms, and the odd frames of the kitchen after the even ones. `same` scans all of
a room four times, sampled every 4 cm.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gas_scans import cpu_seconds
from paper_bench import DATA, check_data, print_header, print_row

import surfabet as sb
from surfabet import datasets
from surfabet.io import read_rgbd

ROOMS = 12
SPACING = 0.025


def rooms(numbers: Sequence[int], seed: int, spacing: float = SPACING) -> sb.PointCloud:
    """Points of simulated rooms in a row, with noise of 3 mm; the noise has the seed."""
    rng = np.random.default_rng(seed)
    parts = []
    for number in numbers:
        points, _ = datasets.make_room(seed=number).sample_surface(spacing)
        shifted = points + np.array([7.0 * number, 0.0, 0.0])
        parts.append(shifted + rng.normal(scale=0.003, size=points.shape))
    return sb.PointCloud(np.concatenate(parts))


def building() -> list[sb.PointCloud]:
    return [rooms((k, k + 1), seed=k) for k in range(ROOMS - 1)]


def frames() -> list[sb.PointCloud]:
    return read_rgbd(DATA / "rgbd_room", fused=False, pixel_stride=3)


def kitchen() -> list[sb.PointCloud]:
    all_frames = frames()
    return [joined(all_frames[i : i + 10]) for i in range(0, len(all_frames), 10)]


def joined(clouds: Sequence[sb.PointCloud]) -> sb.PointCloud:
    """Clouds as one, with colours and viewpoints where they have them."""
    first = clouds[0]
    given = {
        name: np.concatenate([getattr(cloud, name) for cloud in clouds])
        for name in ("colors", "ranges")
        if getattr(first, name) is not None
    }
    if first.viewpoints is not None:
        given["viewpoints"] = np.concatenate([cloud.viewpoints for cloud in clouds])
        starts = np.cumsum([0] + [len(cloud.viewpoints) for cloud in clouds[:-1]])
        given["viewpoint_index"] = np.concatenate(
            [cloud.viewpoint_index + start for cloud, start in zip(clouds, starts, strict=True)]
        )
    return sb.PointCloud(np.concatenate([cloud.points for cloud in clouds]), **given)


def learned(cloud: sb.PointCloud, **options: object) -> sb.TiledPatchModel:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.sfb"
        sb.learn_patches_tiled(cloud, path, note=" ", **options)
        return sb.load(path)


def row(name: str, clouds: sb.PointCloud, model: sb.TiledPatchModel, seconds: float) -> None:
    measured = sb.evaluate(clouds, model.decode(as_measured=True), normal_neighbors=None)
    surface = sb.evaluate(clouds, model.decode(), normal_neighbors=None)
    color = "" if measured.color_rmse_pooled is None else f"{measured.color_rmse_pooled:.2f}"
    cells = (f"{1e3 * measured.rmse:.2f}", f"{1e3 * surface.rmse:.2f}", color)
    n = len(model.tiles)
    print_row(name, f"{model.n_points:,}", n, f"{size(model):,}", *cells, f"{seconds:.0f}")


def size(model: sb.TiledPatchModel) -> int:
    return len(model.to_bytes())


def in_sessions(name: str, sessions: list[sb.PointCloud], tile: float) -> None:
    """A map that goes on, and one of all sessions at once by the same plan."""
    print_header(
        f"{name}",
        "points",
        "tiles",
        "bytes",
        "rmse, as measured (mm)",
        "surface (mm)",
        "colour",
        "CPU s",
    )
    everything = joined(sessions)
    began = cpu_seconds()
    model = learned(sessions[0], tile=tile)
    for session in sessions[1:]:
        model = model.update(session)
    row(f"{len(sessions)} sessions", everything, model, cpu_seconds() - began)
    began = cpu_seconds()
    whole = model.update(everything, alone=True)
    row("at once, same plan", everything, whole, cpu_seconds() - began)
    began = cpu_seconds()
    pixel = model.pixel_sizes[-1]
    row(
        "at once",
        everything,
        learned(everything, tile=tile, resolution=pixel),
        cpu_seconds() - began,
    )


def again(name: str, first: sb.PointCloud, second: sb.PointCloud, tile: float) -> None:
    """What a second pass adds, as a share of the bytes that it takes alone."""
    model = learned(first, tile=tile)
    alone = model.update(second, alone=True)
    both = model.update(second)
    added = size(both) - size(model)
    share = f"{added / size(alone):+.1%}"
    print_row(name, f"{size(model):,}", f"{size(alone):,}", f"{size(both):,}", share)


def same(numbers: Sequence[int]) -> None:
    """Scans of all of a room one after another, beside learning them at once by the same plan."""
    print_header(
        "room",
        "scans",
        "bytes",
        "at once",
        "rmse, as measured (mm)",
        "at once",
        "surface",
        "at once",
    )
    for number in numbers:
        scans = [rooms((number,), seed=1000 * number + k, spacing=0.04) for k in range(4)]
        model = learned(scans[0], tile=8.0)
        for n in range(2, len(scans) + 1):
            model = model.update(scans[n - 1])
            cloud = joined(scans[:n])
            whole = model.update(cloud, alone=True)
            pair = (model, whole)
            sizes = [f"{size(m):,}" for m in pair]
            errors = [rmse(cloud, m, as_measured=True) for m in pair]
            surfaces = [rmse(cloud, m, as_measured=False) for m in pair]
            print_row(number, n, *sizes, *errors, *surfaces)


def rmse(cloud: sb.PointCloud, model: sb.TiledPatchModel, as_measured: bool) -> str:
    decoded = model.decode(as_measured=as_measured)
    return f"{1e3 * sb.evaluate(cloud, decoded, normal_neighbors=None).rmse:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parts = ("building", "kitchen", "again", "same")
    parser.add_argument("--part", choices=parts, default="building")
    parser.add_argument("--rooms", nargs="+", type=int, default=[12], help="for same")
    options = parser.parse_args()
    if options.part == "building":
        in_sessions("building", building(), tile=8.0)
        return
    if options.part == "same":
        same(options.rooms)
        return
    check_data()
    if options.part == "kitchen":
        in_sessions("kitchen", kitchen(), tile=4.0)
        return
    print_header("second pass", "bytes before", "of the pass alone", "bytes after", "added")
    again("rooms", rooms((0, 1, 2), seed=0), rooms((0, 1, 2), seed=1), tile=8.0)
    all_frames = frames()
    again("kitchen", joined(all_frames[0::2]), joined(all_frames[1::2]), tile=4.0)


if __name__ == "__main__":
    main()
