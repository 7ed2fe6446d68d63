"""Trains the networks whose estimates count beside the models of colours and scalars of patches.

    python benches/papers/color_estimates.py --reset             networks that say nothing; build
    python benches/papers/color_estimates.py --dump out/dumps    decisions of the training scenes
    python benches/papers/color_estimates.py --train out/dumps   weights, and bits per decision
    python benches/papers/color_estimates.py --write out/dumps   weights into the sources; build

`--dump` learns models with the surfabet on PYTHONPATH, and writes their decisions with the inputs
of each estimate by the example `color_decisions` of benches/rust, with cargo. The weights in the
repository are those of this order, from `--reset` on; the same dumps give the same weights.

The training scenes are simulated rooms 0 to 3 and 12 to 15 (frames of a Kinect), laser scans of
simulated rooms 0 to 2 with intensities, and the first 25 frames of the kitchen. Weights are part of
the file format: after a release they change only with a new feature bit.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from paper_bench import DATA

import surfabet as sb
from surfabet import datasets

ROOT = Path(__file__).resolve().parents[2]
RUST = ROOT / "crates/surfabet-models/src/patches/attributes/field/estimate_weights.rs"
SCRIPT = ROOT / "python/surfabet/viewer/decoder/estimate_weights.js"
PAGE = ROOT / "docs/format.md"
BEGIN, END = "<!-- weights begin -->", "<!-- weights end -->"

ROOMS = {0: 15, 1: 15, 2: 25, 3: 15, 12: 10, 13: 20, 14: 30, 15: 18}
"""Simulated rooms, and the side of a pixel in millimetres."""
LASERS = {0: 20, 1: 30, 2: 40}
KITCHEN_FRAMES = 25
COLOR_STEPS = [75, 110, 160]
ATTRIBUTE_STEPS = [0.35, 0.5, 0.75]

RECORD = 34
"""Bytes of a decision: its number, its outcome, and inputs with zeros behind."""
HIDDEN = 12
MOST = 50_000
"""Decisions of a kind that a dump trains with; of more, some by chance, so that no scene counts
much more than others."""
EPOCHS = 10
BATCH = 512
ONE = 4096
WEIGHT = 5909
"""Size of the weights of units: log2(e) in units of 1 / 4096. What a unit says is in its inputs."""


@dataclass(frozen=True)
class Kind:
    """A decision: its number, and how many inputs its units take at first and second."""

    name: str
    number: int
    first: int
    second: int
    types: str
    odd: bool = False


KINDS = [
    Kind("any", 0, 18, 0, "OF_ANY, 0"),
    Kind("nonzero", 1, 16, 16, "OF_CELL, OF_COEFFICIENT"),
    Kind("exponent", 3, 16, 16, "OF_CELL, OF_COEFFICIENT"),
    Kind("negative", 2, 15, 9, "OF_EVEN, OF_ODD", odd=True),
]


def kitchen() -> sb.PointCloud:
    """The first frames of the kitchen, thinned to 5 mm."""
    paths = sorted((DATA / "rgbd_room").iterdir())
    frames = sorted({path.name.split(".")[0] for path in paths if path.name.startswith("frame-")})
    later = set(frames[KITCHEN_FRAMES:])
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            if path.name.split(".")[0] not in later:
                shutil.copy(path, folder)
        return sb.voxel_downsample(sb.read(folder), 0.005)


def models() -> Iterator[tuple[str, Any]]:
    """Models of the training scenes, with their names."""
    rooms = {f"room{seed}": (seed, mm) for seed, mm in ROOMS.items()}
    for name, (seed, mm) in rooms.items():
        cloud = sb.voxel_downsample(datasets.simulated_room(seed=seed).cloud, 0.005)
        yield from steps(name, cloud, mm)
    yield from steps("kitchen", kitchen(), 10)
    for seed, mm in LASERS.items():
        cloud = datasets.scan_lidar(datasets.make_room(seed=seed), random_state=seed).cloud
        for step in ATTRIBUTE_STEPS:
            options = {"resolution": mm / 1000, "attribute_step": step, "completeness": 0}
            yield f"laser{seed}_{step}", sb.learn_patches(cloud, **options)


def steps(name: str, cloud: sb.PointCloud, mm: int) -> Iterator[tuple[str, Any]]:
    """A scene at each step of colour."""
    for step in COLOR_STEPS:
        options = {"resolution": mm / 1000, "color_step": step, "completeness": 0}
        yield f"{name}_{step}", sb.learn_patches(cloud, **options)


def dump(folder: Path) -> None:
    """Writes the models of the training scenes and their decisions."""
    folder.mkdir(parents=True, exist_ok=True)
    files: list[str] = []
    for name, model in models():
        path = folder / f"{name}.sfb"
        path.write_bytes(model.to_bytes())
        files += [str(path.resolve()), str(path.with_suffix(".decisions").resolve())]
        print(name, path.stat().st_size, flush=True)
    command = "cargo run --release -q -p surfabet-benches --features trace"
    command += " --example color_decisions --"
    subprocess.run([*command.split(), *files], cwd=ROOT, check=True)


def decisions(folder: Path, kind: Kind) -> tuple[Any, Any]:
    """Inputs and outcomes of a kind of decision in all dumps."""
    found = []
    for path in sorted(folder.glob("*.decisions")):
        records = np.fromfile(path, np.int8).reshape(-1, RECORD)
        records = records[records[:, 0] == kind.number]
        chosen = np.random.default_rng(0).permutation(len(records))[:MOST]
        found.append(records[np.sort(chosen)])
    records = np.concatenate(found)
    inputs = records[:, 2 : 2 + kind.first + kind.second].astype(np.float32)
    return inputs, records[:, 1].astype(np.float32)


class Network:
    """A network of one layer in floating point: what its units sum up, and their weights."""

    def __init__(self, kind: Kind, inputs: Any) -> None:
        self.kind = kind
        n = inputs.shape[1]
        self.mean, self.deviation = inputs.mean(axis=0), inputs.std(axis=0)
        if kind.odd:
            self.mean[kind.first :] = 0
        self.live = self.deviation > 1e-6
        self.deviation[~self.live] = 1
        rng = np.random.default_rng(1)
        shapes = [(n, HIDDEN), HIDDEN, HIDDEN, 1]
        scales = [n**-0.5, 0, 0.25, 0]
        self.parts = [
            (s * rng.normal(size=shape)).astype(np.float32)
            for s, shape in zip(scales, shapes, strict=True)
        ]

    def gradient(self, x: Any, y: Any) -> list[Any]:
        """Gradient of the mean of nats in all parts, by a batch."""
        weights, bias, of_units, constant = self.parts
        first = self.kind.first
        if not self.kind.odd:
            units = np.maximum(x @ weights + bias, 0)
            error = (sigmoid(units @ of_units + constant[0]) - y) / len(y)
            back = np.outer(error, of_units) * (units > 0)
            of_weights, of_bias = x.T @ back, back.sum(axis=0)
            return [of_weights, of_bias, units.T @ error, error.sum(keepdims=True)]
        even, odd = x[:, :first] @ weights[:first] + bias, x[:, first:] @ weights[first:]
        units = np.maximum(even + odd, 0) - np.maximum(even - odd, 0)
        error = (sigmoid(units @ of_units) - y) / len(y)
        back = np.outer(error, of_units)
        plus, minus = back * (even + odd > 0), back * (even - odd > 0)
        even, odd = plus - minus, plus + minus
        of_weights = np.concatenate([x[:, :first].T @ even, x[:, first:].T @ odd])
        return [of_weights, even.sum(axis=0), units.T @ error, np.zeros(1, np.float32)]

    def train(self, inputs: Any, outcomes: Any) -> None:
        """Adam with a rate that falls to nothing."""
        x = ((inputs - self.mean) / self.deviation).astype(np.float32)
        rng = np.random.default_rng(2)
        means = [np.zeros_like(part) for part in self.parts]
        squares = [np.zeros_like(part) for part in self.parts]
        total = EPOCHS * (len(x) // BATCH)
        for t in range(1, total + 1):
            at = (t - 1) * BATCH % (len(x) - BATCH + 1)
            if t == 1 or at < BATCH:
                order = rng.permutation(len(x))
            batch = order[at : at + BATCH]
            rate = 5e-3 * (1 - t / total) + 1e-5
            for k, of in enumerate(self.gradient(x[batch], outcomes[batch])):
                means[k] = 0.9 * means[k] + 0.1 * of
                squares[k] = 0.999 * squares[k] + 0.001 * of**2
                step = means[k] / (1 - 0.9**t) / (np.sqrt(squares[k] / (1 - 0.999**t)) + 1e-8)
                self.parts[k] = (self.parts[k] - rate * step).astype(np.float32)

    def whole(self) -> dict[str, Any]:
        """In whole numbers, on inputs as they are; a unit's size stands in what it sums up."""
        weights, bias, of_units, constant = (part.astype(float) for part in self.parts)
        weights = weights / self.deviation[:, None]
        bias = bias - self.mean @ weights
        weights[~self.live] = 0
        size = np.abs(of_units)
        rows = np.vstack([weights * size, bias * size])
        rows = np.rint(rows * ONE).astype(int).T.tolist()
        signs = np.where(of_units < 0, -WEIGHT, WEIGHT).tolist()
        shift = round(float(constant[0]) * np.log2(np.e) * ONE * ONE)
        units = [[*row, sign] for row, sign in zip(rows, signs, strict=True)]
        assert all(abs(w) < 2**15 for unit in units for w in unit[:-2]), "weights of 16 bits"
        return {"units": units, "bias": shift}


def sigmoid(x: Any) -> Any:
    return 1 / (1 + np.exp(-x))


def bits(network: dict[str, Any], kind: Kind, inputs: Any, outcomes: Any) -> float:
    """Mean bits of decisions by a network in whole numbers alone."""
    units = np.array(network["units"])
    x = inputs.astype(int)
    even = x[:, : kind.first] @ units[:, : kind.first].T + units[:, -2]
    odd = x[:, kind.first :] @ units[:, kind.first : -2].T
    values = np.maximum(even + odd, 0) - (np.maximum(even - odd, 0) if kind.odd else 0)
    odds = np.clip((values @ units[:, -1] + network["bias"]) / 2**24, -12, 12)
    of_true = 1 / (1 + np.exp2(-odds))
    return float(-np.log2(np.where(outcomes > 0, of_true, 1 - of_true)).mean())


def train(folder: Path) -> None:
    """Trains a network for each kind of decision, into weights.json."""
    found = {}
    for kind in KINDS:
        inputs, outcomes = decisions(folder, kind)
        network = Network(kind, inputs)
        network.train(inputs, outcomes)
        found[kind.name] = network.whole()
        mean = bits(found[kind.name], kind, inputs, outcomes)
        print(f"{kind.name}: {len(inputs)} decisions, {mean:.4f} bits each", flush=True)
    (folder / "weights.json").write_text(json.dumps(found))


def nothing() -> dict[str, Any]:
    """Networks that say nothing."""
    units = {kind.name: [[0] * (kind.first + kind.second + 2)] * HIDDEN for kind in KINDS}
    return {name: {"units": rows, "bias": 0} for name, rows in units.items()}


def write(networks: dict[str, Any]) -> None:
    """Weights into the coder, the viewer's decoder, and the page of the format."""
    rust = """//! Weights of the networks of `estimates`, part of the file format.
//!
//! Written by benches/papers/color_estimates.py, which says on what they were trained.

use super::estimate_inputs::{OF_ANY, OF_CELL, OF_COEFFICIENT, OF_EVEN, OF_ODD};
use super::estimates::{Network, Unit};
"""
    script = """// Weights of the networks of section 5.4 of docs/format.md (feature bit 15).
//
// Per unit its inputs, bias and weight; then the bias. By benches/papers/color_estimates.py.
"""
    page = ""
    for kind in KINDS:
        rows, bias = networks[kind.name]["units"], networks[kind.name]["bias"]
        name = kind.name.upper()
        rust += f"\n/// Of `{kind.name}`.\npub(super) static {name}: "
        rust += f"Network<{kind.types}> = Network {{\n    units: [\n"
        for row in rows:
            first, second = row[: kind.first], row[kind.first : -2]
            rust += f"        Unit {{ first: {first}, second: {second}, "
            rust += f"bias: {row[-2]}, weight: {row[-1]} }},\n"
        rust += f"    ],\n    bias: {bias},\n}};\n"
        lines = "".join(f"    {row},\n" for row in rows)
        script += f"\nexport const {name} = {{\n  units: [\n{lines}  ],\n  bias: {bias},\n}};\n"
        lines = "".join(" ".join(map(str, row)) + "\n" for row in rows)
        page += f"`{kind.name}`, bias {bias}:\n\n```\n{lines}```\n\n"
    RUST.write_text(rust)
    subprocess.run(["rustfmt", "--edition", "2024", str(RUST)], check=True)
    SCRIPT.write_text(script)
    text = PAGE.read_text()
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    PAGE.write_text(f"{before}{BEGIN}\n\n{page}{after}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reset", action="store_true", help="networks that say nothing")
    parser.add_argument("--dump", type=Path, metavar="DIR", help="decisions of the training scenes")
    parser.add_argument("--train", type=Path, metavar="DIR", help="weights from these")
    parser.add_argument("--write", type=Path, metavar="DIR", help="weights into the sources")
    given = parser.parse_args()
    if given.reset:
        write(nothing())
    if given.dump:
        dump(given.dump)
    if given.train:
        train(given.train)
    if given.write:
        write(json.loads((given.write / "weights.json").read_text()))


if __name__ == "__main__":
    main()
