"""Bytes, error and seconds at the defaults on lidar scans, beside G-PCC, Draco and LAZ.

    python benches/peers/lidar_defaults.py [--tmc3 PATH] [--scans street hall] [--json FILE]

Ours are `learn_patches` with nothing but the cloud, decoded as measured at half a pixel. Every peer
codes the same points, geometry alone, at its coarsest step at which the error from the input to
what it decodes, 99th percentile, is at most ours: our default promises that very measure
(`completeness`). Ours fills surfaces, so its other direction is larger than a grid's; a second
table has the peers at the coarsest step at which the larger of both directions is at most ours.
G-PCC needs `tmc3` on the PATH or given.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import peer_codecs as peers
from peer_bench import load
from peer_codecs import GPCC_GEOMETRY, Coded, cpu_seconds, number

import surfabet as sb

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SCANS = {
    "room": ["indoor_scan/room_scan1.pcd", "indoor_scan/room_scan2.pcd"],
    "street": ["outdoor_360"],
    "hall": [f"multi_scan/full{k}.pcd" for k in (0, 40, 100)],
    "airborne, feet": ["georeferenced/autzen_trim.laz"],
}
_FINENESS = 1.01
"""Steps are found to this factor."""
_OCTREE = {**GPCC_GEOMETRY, "trisoupNodeSizeLog2": 0, "disableAttributeCoding": 1}
# Those of the common test conditions for clouds of several scans, and for frames of a lidar; and
# the predictive tree over points in the order of the scan, and sorted along a curve.
_CONDITIONS: tuple[dict[str, object], ...] = (
    {"maxNumQtBtBeforeOt": 4, "planarModeIdcmUse": 0},
    {"maxNumQtBtBeforeOt": 6, "planarModeIdcmUse": 32},
    {"geomTreeType": 1, "predGeomSort": 0},
    {"geomTreeType": 1, "predGeomSort": 1},
)

Coder = Callable[[sb.PointCloud, float], Coded]


@dataclass(frozen=True)
class Row:
    """What one tool made of one scan; errors in metres, or the scan's own unit."""

    scan: str
    points: int
    tool: str
    setting: str
    bytes: int
    encode_seconds: float | None
    decode_seconds: float | None
    decoded_points: int
    forward: list[float]
    """Decoded to input: mean, 95th and 99th percentile, largest."""
    backward: list[float]
    """Input to decoded: the same."""


def read(path: Path) -> sb.PointCloud:
    """Points and viewpoints of a scan; its attributes would cost ours alone bytes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cloud = sb.read(path)
    seen = {"viewpoints": cloud.viewpoints, "viewpoint_index": cloud.viewpoint_index}
    return sb.PointCloud(cloud.points, **seen)


def scans(names: list[str]) -> Iterator[tuple[str, sb.PointCloud]]:
    """The chosen scans by name."""
    for name in names:
        for entry in SCANS[name]:
            path = DATA / entry
            for file in sorted(path.iterdir()) if path.is_dir() else [path]:
                yield f"{name}, {file.stem}", read(file)


def surfabet_defaults(cloud: sb.PointCloud) -> tuple[Coded, str]:
    """Ours with nothing but the cloud, through the bytes of a file."""
    began = cpu_seconds()
    model = sb.learn_patches(cloud)
    data = model.to_bytes()
    encoded = cpu_seconds()
    decoded = sb.from_bytes(data).decode(as_measured=True)
    seconds = cpu_seconds() - encoded
    pixel, _ = model.report.chosen["resolution"]
    return Coded(len(data), len(data), encoded - began, seconds, decoded), f"pixel {pixel:.3g}"


def cells_of(cloud: sb.PointCloud, step: float) -> np.ndarray:
    """Cells (n, 3) of a grid that hold points, each once, in the order of their first points."""
    cells = np.floor(cloud.points / step).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return cells[np.sort(first)]


def draco(cloud: sb.PointCloud, step: float) -> Coded:
    """Draco's kd-tree coder at its best level; its quantiser's grid holds the cells' centres."""
    peer = load("DracoPy")
    began = cpu_seconds()
    cells = cells_of(cloud, step)
    low = cells.min(axis=0)
    # Relative to the corner: what the file holds are single-precision numbers.
    points = ((cells - low) * step).astype(np.float32)
    bits = int(np.ceil(np.log2(int((cells - low).max()) + 1)))
    data = peer.encode(
        points,
        quantization_bits=bits,
        quantization_range=((1 << bits) - 1) * step,
        quantization_origin=np.zeros(3),
        compression_level=10,
    )
    encoded = cpu_seconds()
    back = np.asarray(peer.decode(data).points, np.float64)
    seconds = cpu_seconds() - encoded
    decoded = sb.PointCloud(back + (low + 0.5) * step)
    return Coded(len(data), len(data), encoded - began, seconds, decoded)


def laz(cloud: sb.PointCloud, step: float) -> Coded:
    """LAZ with coordinates in steps, in the order of the scan or of the grid, whichever is less."""
    laspy = load("laspy")
    began = cpu_seconds()
    scanned = cells_of(cloud, step)
    found: list[bytes] = []
    for cells in (scanned, scanned[np.lexsort(scanned.T)]):
        header = laspy.LasHeader(version="1.2", point_format=0)
        header.scales, header.offsets = np.full(3, step), np.full(3, step / 2)
        las = laspy.LasData(header)
        las.X, las.Y, las.Z = cells.T.astype(np.int32)
        file = io.BytesIO()
        las.write(file, do_compress=True)
        found.append(file.getvalue())
    encoded = cpu_seconds()
    data = min(found, key=len)
    points = np.asarray(laspy.read(io.BytesIO(data)).xyz)
    seconds = cpu_seconds() - encoded
    # Both orders were tried; a user writes one.
    return Coded(len(data), len(data), (encoded - began) / 2, seconds, sb.PointCloud(points))


def version(tmc3: Path) -> str:
    """What G-PCC's program calls itself."""
    told = subprocess.run([tmc3, "--help"], capture_output=True, text=True, check=False).stdout
    return next((line for line in told.splitlines() if "version" in line), "unknown version")


def gpcc(tmc3: Path) -> Coder:
    """G-PCC under the best of its conditions; points in thousandths of the unit."""

    def code(cloud: sb.PointCloud, step: float) -> Coded:
        whole = np.rint(cloud.points * 1e3).astype(np.int64)
        low = whole.min(axis=0)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            source, back = folder / "in.ply", folder / "out.ply"
            sb.write(source, sb.PointCloud((whole - low).astype(np.float32), origin=(0, 0, 0)))
            streams = [folder / f"{k}.bin" for k in range(len(_CONDITIONS))]
            began = cpu_seconds()
            for stream, condition in zip(streams, _CONDITIONS, strict=True):
                settings = {"positionQuantizationScale": f"{1e-3 / step:.17g}"}
                settings |= _OCTREE | condition
                peers.run(
                    tmc3,
                    "--mode=0",
                    f"--uncompressedDataPath={source}",
                    f"--compressedStreamPath={stream}",
                    *(f"--{option}={value}" for option, value in settings.items()),
                )
            encoded = cpu_seconds()
            stream = min(streams, key=lambda path: path.stat().st_size)
            peers.run(
                tmc3,
                "--mode=1",
                f"--compressedStreamPath={stream}",
                f"--reconstructedDataPath={back}",
            )
            seconds = cpu_seconds() - encoded
            size, again = stream.stat().st_size, sb.read(back)
        decoded = sb.PointCloud((again.points + low) / 1e3)
        # A user encodes once.
        return Coded(size, size, (encoded - began) / len(streams), seconds, decoded)

    return code


def row(scan: str, cloud: sb.PointCloud, tool: str, setting: str, coded: Coded) -> Row:
    """Bytes, seconds and errors of what a tool made."""
    q = sb.evaluate(cloud, coded.decoded, normal_neighbors=None)
    return Row(
        scan, len(cloud), tool, setting, coded.bytes, coded.encode_seconds, coded.decode_seconds,
        len(coded.decoded),
        [q.mean_forward, q.p95_forward, q.p99_forward, q.max_forward],
        [q.mean_backward, q.p95_backward, q.p99_backward, q.max_backward],
    )  # fmt: skip


def to_decoded(found: Row) -> float:
    """99th percentile from the input to what was decoded."""
    return found.backward[2]


def larger(found: Row) -> float:
    """The larger 99th percentile of both directions."""
    return max(found.backward[2], found.forward[2])


CRITERIA = {
    "input to decoded, 99 %, at most ours": to_decoded,
    "the larger direction, 99 %, at most ours": larger,
}


def coarsest(
    cloud: sb.PointCloud,
    scan: str,
    tool: str,
    code: Coder,
    criterion: Callable[[Row], float],
    allowed: float,
) -> Row:
    """The tool at its coarsest step at which the criterion is at most what is allowed."""
    # A cell of 0.9 of it has no larger error, and one of four times has.
    low, high = allowed / 0.9, allowed * 4
    best = row(scan, cloud, tool, f"step {low:.3g}", code(cloud, low))
    while high > low * _FINENESS:
        step = float(np.sqrt(low * high))
        tried = row(scan, cloud, tool, f"step {step:.3g}", code(cloud, step))
        if criterion(tried) <= allowed:
            low, best = step, tried
        else:
            high = step
    return best


def coders(tmc3: Path | None) -> dict[str, Coder]:
    """The peers that are installed."""
    found: dict[str, Coder] = {}
    if tmc3 is not None:
        found["G-PCC"] = gpcc(tmc3)
    if load("DracoPy"):
        found["Draco, level 10"] = draco
    if load("laspy") and load("lazrs"):
        found["LAZ"] = laz
    return found


def cells(found: Row, ours: Row) -> list[str]:
    """A row of the table; lengths in thousandths of the scan's unit."""
    ratio = found.bytes / ours.bytes
    errors = (
        " / ".join(number(error, 1, 1e3) for error in errors)
        for errors in (found.forward, found.backward)
    )
    return [
        found.scan, found.tool, found.setting, number(found.bytes), f"{ratio:.2f}", *errors,
        number(found.encode_seconds, 2), number(found.decode_seconds, 2),
        number(found.decoded_points),
    ]  # fmt: skip


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", nargs="+", choices=SCANS, default=list(SCANS))
    parser.add_argument("--tmc3", type=Path, help="G-PCC's program, where it is not on the PATH")
    parser.add_argument("--json", type=Path, help="write the rows here, too")
    return parser.parse_args()


def main() -> None:
    """Prints the table."""
    options = parse()
    tmc3 = peers.find_tmc3(options.tmc3)
    tools = coders(tmc3)
    if tmc3 is not None:
        print(version(tmc3))
    header = ["scan", "tool", "setting", "bytes", "of ours", "decoded to input", "input to decoded"]
    header += ["encode CPU s", "decode CPU s", "points out"]
    print("errors: mean / 95 % / 99 % / largest, in thousandths of the scan's unit")
    tables: dict[str, list[list[str]]] = {name: [] for name in CRITERIA}
    rows: list[dict[str, object]] = []
    for scan, cloud in scans(options.scans):
        coded, setting = surfabet_defaults(cloud)
        ours = row(f"{scan} ({len(cloud):,})", cloud, "surfabet, defaults", setting, coded)
        for name, criterion in CRITERIA.items():
            allowed = criterion(ours)
            found = [coarsest(cloud, ours.scan, t, c, criterion, allowed) for t, c in tools.items()]
            tables[name] += [cells(one, ours) for one in (ours, *found)]
            rows += [{"criterion": name, **asdict(one)} for one in (ours, *found)]
    for name, table in tables.items():
        print(f"\nPeers with {name}:\n\n{peers.table(header, table)}")
    if options.json:
        peers.write_json(options.json, rows)


if __name__ == "__main__":
    main()
