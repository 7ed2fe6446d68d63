"""Bytes and error of intensity and classes, beside LAZ and Draco of the same positions.

Bytes of an attribute are those of its section for surfabet, and for the other formats the bytes of
the file less those of the same file with the attribute zero everywhere. Errors of surfabet are over
the pairs of the nearest points of both directions, as `surfabet.evaluate` has them, of the cloud
decoded as measured; LAZ and Draco keep every point and every value.

    python benches/peers/attributes.py
    python benches/peers/attributes.py --data ../shared/data --json attributes.json
"""

from __future__ import annotations

import argparse
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peer_bench import load

import surfabet as sb

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


@dataclass(frozen=True)
class Scan:
    """A cloud with the attributes that are measured, and how finely its shape is kept."""

    name: str
    cloud: sb.PointCloud
    attributes: tuple[str, ...]
    resolution: float
    laz_step: float
    """Rounding of the coordinates in LAZ, in the unit of the cloud."""


@dataclass(frozen=True)
class Row:
    """What a tool makes of an attribute."""

    scan: str
    points: int
    attribute: str
    deviation: float | None
    """Standard deviation of a scalar."""
    tool: str
    bytes: float
    all_bytes: int
    error: str


def scans(data: Path) -> list[Scan]:
    """The scans that are there."""
    hall = data / "multi_scan" / "full0.pcd"
    street = data / "outdoor_360" / "000000.bin"
    town = data / "georeferenced" / "autzen_trim.laz"
    found = []
    if hall.exists():
        found.append(Scan("hall", sb.read(hall), ("intensities",), 0.05, 0.001))
    if street.exists():
        found.append(Scan("street", sb.read(street), ("intensities",), 0.1, 0.001))
    laspy = load("laspy")
    if town.exists() and laspy is not None:
        las = laspy.read(town)
        cloud = sb.PointCloud(
            las.xyz,
            intensities=np.asarray(las.intensity, np.float32),
            extra={
                "classification": np.asarray(las.classification, np.uint8),
                "return_number": np.asarray(las.return_number, np.uint8),
            },
        )
        names = ("intensities", "classification", "return_number")
        found.append(Scan("town (feet)", cloud, names, 3.0, 0.01))
    return found


def values_of(cloud: sb.PointCloud, name: str) -> NDArray[Any]:
    """An attribute as LAS and Draco can hold it: intensities in 16 bits."""
    values = cloud[name]
    if name != "intensities":
        return values
    # Reflectance from 0 to 1 in hundredths, which is what KITTI has; others are whole numbers.
    scaled = values * 100 if values.max() <= 1 else values
    return np.rint(scaled).astype(np.uint16)


def deviation(scan: Scan, name: str) -> float | None:
    """Standard deviation of an attribute; None for labels."""
    values = scan.cloud[name]
    return float(values.std()) if values.dtype.kind == "f" else None


def told(error: sb.AttributeErrors) -> str:
    """An error in words."""
    if error.labels:
        return f"equal {error.forward:.1%} / {error.backward:.1%}"
    return f"rmse {error.forward:.3g} / {error.backward:.3g}"


def surfabet_rows(scan: Scan, step: float) -> list[Row]:
    """Patches with all attributes of the scan."""
    model = sb.learn_patches(
        scan.cloud,
        resolution=scan.resolution,
        sensor="constant",
        attributes=scan.attributes,
        attribute_step=step,
    )
    data = model.to_bytes()
    decoded = sb.from_bytes(data).decode(as_measured=True)
    quality = sb.evaluate(scan.cloud, decoded, normal_neighbors=None)
    tool = f"surfabet, step {step:g}, rmse of positions {quality.rmse:.3g}"
    return [
        Row(
            scan.name, len(scan.cloud), of.name, deviation(scan, of.name), tool, of.bytes,
            len(data), told(quality.attributes[of.name]),
        )
        for of in model.report.attributes
    ]  # fmt: skip


def laz_bytes(scan: Scan, values: dict[str, NDArray[Any]]) -> int:
    """Bytes of a LAZ file with these attributes."""
    laspy = load("laspy")
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [scan.laz_step] * 3, scan.cloud.points.min(axis=0)
    las = laspy.LasData(header)
    las.x, las.y, las.z = scan.cloud.points.T
    for name, of in values.items():
        las["intensity" if name == "intensities" else name] = of
    file = io.BytesIO()
    las.write(file, do_compress=True)
    return len(file.getvalue())


def draco_bytes(scan: Scan, values: dict[str, NDArray[Any]]) -> int:
    """Bytes of a Draco file with these attributes as generic ones, positions in 16 bits."""
    draco = load("DracoPy")
    return len(
        draco.encode(
            scan.cloud.points - scan.cloud.points.min(axis=0),
            quantization_bits=16,
            compression_level=10,
            generic_attributes={name: of[:, None] for name, of in values.items()},
        )
    )


def peer_rows(scan: Scan) -> list[Row]:
    """LAZ and Draco, where they are installed."""
    values = {name: values_of(scan.cloud, name) for name in scan.attributes}
    rows = []
    for tool, module, size in (
        ("LAZ", "laspy", laz_bytes),
        ("Draco, level 10", "DracoPy", draco_bytes),
    ):
        if load(module) is None:
            continue
        whole = size(scan, values)
        for name in scan.attributes:
            without = size(scan, {**values, name: np.zeros_like(values[name])})
            n = len(scan.cloud)
            spread = deviation(scan, name)
            rows.append(Row(scan.name, n, name, spread, tool, whole - without, whole, "none"))
    return rows


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real scans")
    parser.add_argument("--json", type=Path, help="write the rows here, too")
    arguments = parser.parse_args()
    rows = []
    for scan in scans(arguments.data):
        for step in (0.25, 0.5, 1.0):
            rows += surfabet_rows(scan, step)
        rows += peer_rows(scan)
    print("| scan | points | attribute | tool | bytes | bits per point | error | whole file |")
    print("|---|---|---|---|---|---|---|---|")
    for row in sorted(rows, key=lambda row: (row.scan, row.attribute)):
        bits = 8 * row.bytes / row.points
        spread = "" if row.deviation is None else f" (deviation {row.deviation:.3g})"
        print(
            f"| {row.scan} | {row.points:,} | {row.attribute}{spread} | {row.tool} "
            f"| {row.bytes:,.0f} | {bits:.3f} | {row.error} | {row.all_bytes:,} |"
        )
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
