"""What each part of the patches is worth, on and off: bytes and errors on a room and a frame.

    python benches/papers/patches_ablation.py [--only room|frame] [--rows TEXT] [--json]

Models are learned from the raw points. The reference of the room is its fused cloud thinned to
5 mm by voxel means, that of the Kinect frame the frame itself. Where a row says nothing else, the
model is decoded as measured at half of its finest pixel; the paper's method has no thickness and
is decoded as a surface. Errors take all points of both clouds: forward is decoded to reference,
backward the other way, pooled over both. A row with fewer bytes and a larger error has won nothing
yet, so the last column sets its geometry beside what the default needs for the same pooled error
with other pixels (interpolated; a dash beyond the measured pixels and for other ways of decoding).
Seconds are those of learning and writing, wall clock.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from paper_bench import check_data, kinect_frame, print_header, print_row, room

import surfabet as sb

Options = dict[str, Any]
Curve = list[tuple[float, int]]
"""Pooled error and bytes of geometry."""


@dataclass(frozen=True)
class Scene:
    name: str
    options: Options
    """Of every row."""
    plain_color_step: int
    """Step at which colour without the choice of coefficients is about as wrong as with it."""
    published: Options
    """Of the rows of the paper's method."""


ROOM = Scene(
    "room",
    {"resolution": 0.011},
    plain_color_step=140,
    published={"resolution": 0.015, "iterations": 4},
)
FRAME = Scene(
    "frame",
    {"resolution": 0.003, "rate": 0.05},
    plain_color_step=150,
    published={"resolution": 0.003},
)


@dataclass(frozen=True)
class Decode:
    """A way back to points."""

    suffix: str = ""
    as_measured: bool = True
    pixels: float = 0.5
    """Spacing of the points, finest pixels."""


@dataclass(frozen=True)
class Row:
    name: str
    options: Options = field(default_factory=dict)
    decodes: tuple[Decode, ...] = (Decode(),)
    is_default: bool = False
    """But for the size of pixels."""
    learn: Callable[..., sb.PatchModel | sb.HscsmModel] = sb.learn_patches


THIN = Decode(", decoded thin", as_measured=False)
PIXELS = Decode(", one point per pixel and layer", pixels=1.0)
THIN_PIXELS = Decode(", decoded thin, one point per pixel", as_measured=False, pixels=1.0)


def rows(scene: Scene) -> Iterator[Row]:
    """What is measured; ratios are to the default's options."""
    rate = scene.options.get("rate", 1.4)
    yield Row("default", {}, (Decode(), THIN, PIXELS, THIN_PIXELS), is_default=True)
    # Bytes and error move together: what the default makes of other pixels is what to judge by.
    for ratio in (0.85, 1.25, 1.6):
        resolution = round(ratio * scene.options["resolution"], 5)
        yield Row(
            f"default, pixels of {1e3 * resolution:g} mm",
            {"resolution": resolution},
            is_default=True,
        )
    yield Row("1 level", {"levels": 1})
    yield Row("3 levels", {"levels": 3})
    yield Row("4 levels", {"levels": 4})
    yield Row("1 round: no learned prices", {"rounds": 1})
    yield Row("rate / 4", {"rate": rate / 4})
    yield Row("rate x 4", {"rate": rate * 4})
    yield Row("depth step of 0.25 pixels", {"depth_step": 0.25})
    yield Row("depth step of 1.5 pixels", {"depth_step": 1.5})
    yield Row("chroma coarser than luma", {"chroma_ratio": 1.5})
    yield Row(
        f"no choice of colour coefficients, step {scene.plain_color_step}",
        {"color_rate": 1e-6, "color_step": scene.plain_color_step},
    )
    yield Row("no sensor weights", {"sensor": "constant"})
    yield Row("bound on the error: 5 cm", {"max_error": 0.05})
    surface = (Decode(as_measured=False),)
    pixel = f"{1e3 * scene.published['resolution']:g} mm"
    for name, options in [
        ("1 level", {"levels": 1}),
        ("3 levels", {"levels": 3}),
        ("1 level, subsampled placement", {"levels": 1, "placement": "subsampled"}),
    ]:
        published = scene.published | options
        name = f"paper's method, pixels of {pixel}, {name}"
        yield Row(name, published, surface, learn=sb.learn_hscsm)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", choices=["room", "frame"])
    parser.add_argument("--rows", default="", help="only rows whose name contains this")
    parser.add_argument("--json", action="store_true", help="a JSON object per line instead")
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


def clouds(scene: Scene) -> tuple[sb.PointCloud, sb.PointCloud]:
    """What is learned from, and the reference of the errors."""
    if scene is ROOM:
        raw = room()
        return raw, sb.voxel_downsample(raw, 0.005)
    frame = kinect_frame()
    return frame, frame


def parts(data: bytes) -> dict[str, int]:
    """Bytes of geometry with the header, of colour, and of dictionaries, which hold both."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.sfb"
        path.write_bytes(data)
        sections = sb.inspect(path).sections
    color = sections.get("colour", 0)
    dictionaries = sections.get("dictionaries", 0)
    return {
        "bytes": len(data),
        "geometry_bytes": len(data) - color - dictionaries,
        "color_bytes": color,
        "dictionary_bytes": dictionaries,
    }


def measure(scene: Scene, named: str, only_json: bool) -> None:
    raw, reference = clouds(scene)
    if not only_json:
        print(f"\n{scene.name}: {len(raw):,} points, reference of {len(reference):,}\n")
        print_header(*HEADER)
    curve: Curve = []
    for row in rows(scene):
        if named not in row.name:
            continue
        is_published = row.learn is sb.learn_hscsm
        options = row.options if is_published else scene.options | row.options
        began = time.perf_counter()
        model = row.learn(raw, **options)
        data = model.to_bytes()
        seconds = time.perf_counter() - began
        sizes = parts(data)
        for way in row.decodes:
            spacing = way.pixels * model.levels[-1].pixel_size
            decoded = model.decode(spacing, as_measured=way.as_measured)
            q = sb.evaluate(reference, decoded, normal_neighbors=None)
            result = {
                "scene": scene.name,
                "row": row.name + way.suffix,
                **sizes,
                "rmse_forward": q.rmse_forward,
                "rmse_backward": q.rmse_backward,
                "rmse_pooled": q.rmse_pooled,
                "color_rmse_pooled": q.color_rmse_pooled,
                "max_backward": q.max_backward,
                "decoded_points": len(decoded),
                "seconds": seconds,
                "options": options,
            }
            if row.is_default and not way.suffix:
                curve = sorted([*curve, (q.rmse_pooled, sizes["geometry_bytes"])])
            if only_json:
                print(json.dumps(result), flush=True)
            else:
                comparable = not (row.is_default or way.suffix or is_published)
                print_row(*cells(result, curve if comparable else []))


SIZES = ("bytes", "geometry_bytes", "color_bytes", "dictionary_bytes")
HEADER = [
    "part",
    "bytes",
    "geometry",
    "colour",
    "dictionaries",
    "error mm, forward / backward (pooled)",
    "colour rmse",
    "seconds",
    "geometry at equal error",
]


def against_default(result: dict[str, Any], curve: Curve) -> str:
    """Geometry beside the default's at the same error, from its points sorted by error."""
    if not curve or not curve[0][0] <= result["rmse_pooled"] <= curve[-1][0]:
        return "-"
    errors, sizes = zip(*curve, strict=True)
    expected = np.exp(np.interp(result["rmse_pooled"], errors, np.log(sizes)))
    # Adding zero drops the sign of a negative one.
    return f"{round(result['geometry_bytes'] / expected - 1, 2) + 0.0:+.0%}"


def cells(result: dict[str, Any], curve: Curve) -> list[str]:
    forward, backward, pooled = (
        f"{1e3 * result[f'rmse_{name}']:.2f}" for name in ("forward", "backward", "pooled")
    )
    return [
        result["row"],
        *(f"{result[name]:,}" for name in SIZES),
        f"{forward} / {backward} ({pooled})",
        f"{result['color_rmse_pooled']:.1f}",
        f"{result['seconds']:.1f}",
        against_default(result, curve),
    ]


def main() -> None:
    options = parse()
    sb.set_num_threads(options.threads)
    check_data()
    for scene in (FRAME, ROOM):
        if options.only in (None, scene.name):
            measure(scene, options.rows, options.json)


if __name__ == "__main__":
    main()
