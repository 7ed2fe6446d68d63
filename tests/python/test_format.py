"""A second reader of the family "patches", written from docs/format.md, against surfabet's own."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest

import surfabet as sb

MASK64 = 2**64 - 1


class Bit:
    """2.3"""

    def __init__(self, memory: int = 255) -> None:
        self.one, self.updates, self.memory = 2**31, 0, memory


class Stream:
    """2.1 to 2.6"""

    def __init__(self, data: bytes) -> None:
        self.data, self.next = data, 8
        self.lower, self.range = 0, MASK64
        self.point = int.from_bytes(data[:8].ljust(8, b"\0"), "big")

    def quantile(self) -> int:
        value = int((self.point - self.lower) & MASK64) // (self.range >> 16)
        assert value < 2**16
        return value

    def take(self, left: int, width: int) -> None:
        scale = self.range >> 16
        self.lower = (self.lower + scale * left) & MASK64
        self.range = scale * width
        if self.range < 2**32:
            word = int.from_bytes(self.data[self.next : self.next + 4].ljust(4, b"\0"), "big")
            self.next += 4
            self.lower = (self.lower << 32) & MASK64
            self.range <<= 32
            self.point = ((self.point << 32) | word) & MASK64

    def bypass(self, n: int) -> int:
        value = 0
        while n > 0:
            m = min(n, 16)
            x = self.quantile() >> (16 - m)
            self.take(x << (16 - m), 1 << (16 - m))
            value, n = (value << m) | x, n - m
        return value

    def bit(self, model: Bit) -> int:
        w = min(max(model.one >> 16, 16), 2**16 - 16)
        bit = int(self.quantile() >= 2**16 - w)
        self.take(2**16 - w if bit else 0, w if bit else 2**16 - w)
        rate = 2**24 // (model.updates + 2)
        target = 2**32 - 1 if bit else 0
        model.one += ((target - model.one) * rate) >> 24
        model.updates = min(model.updates + 1, model.memory)
        return bit

    def unsigned(self, model: Unsigned) -> int:
        e = 0
        while e < 32 and self.bit(model.exponent[e]):
            e += 1
        if e == 32:
            return 2**32 - 1
        m = 0
        if e >= 1:
            m = self.bit(model.mantissa[e][0])
        if e >= 2:
            m = 2 * m + self.bit(model.mantissa[e][1 + m])
            m = (m << (e - 2)) | self.bypass(e - 2)
        return 2**e + m - 1

    def signed(self, model: Signed) -> int:
        if not self.bit(model.nonzero):
            return 0
        negative = self.bit(model.negative)
        value = self.unsigned(model.magnitude) + 1
        return -value if negative else value

    def symbol(self, model: Symbol) -> int:
        d = (model.size - 1).bit_length()
        prefix, node = 0, 1
        for done in range(d):
            bit = 0
            if (2 * prefix + 1) << (d - 1 - done) < model.size:
                bit = self.bit(model.nodes[node])
            prefix, node = 2 * prefix + bit, 2 * node + bit
        return prefix


class Unsigned:
    def __init__(self) -> None:
        self.exponent = [Bit() for _ in range(32)]
        self.mantissa = [[Bit(), Bit(), Bit()] for _ in range(32)]


class Signed:
    def __init__(self) -> None:
        self.nonzero, self.negative, self.magnitude = Bit(), Bit(), Unsigned()


class Symbol:
    def __init__(self, size: int) -> None:
        self.size = size
        self.nodes = [Bit() for _ in range(1 << (size - 1).bit_length())]


class Fields:
    """Plain fields of the header and of META."""

    def __init__(self, data: bytes, at: int = 0) -> None:
        self.data, self.at = data, at

    def bytes(self, n: int) -> bytes:
        self.at += n
        return self.data[self.at - n : self.at]

    def f64(self) -> float:
        return float(struct.unpack("<d", self.bytes(8))[0])

    def varint(self) -> int:
        value = shift = 0
        while True:
            (byte,) = self.bytes(1)
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value


ATTRIBUTES = 1 << 3
HIERARCHY = 1 << 5


def sections(data: bytes, features: int = 0) -> dict[str, bytes]:
    """1"""
    assert data[:5] == b"\x89SFB\x01"
    assert data[7] == 2
    fields = Fields(data, 8)
    assert fields.varint() == features
    table = []
    for _ in range(fields.varint()):
        tag = fields.bytes(4).decode()
        table.append((tag, fields.varint()))
        fields.bytes(4)
    fields.bytes(4)
    found = {tag: fields.bytes(length) for tag, length in table}
    assert fields.at == len(data)
    return found


def read_meta(
    data: bytes, features: int = 0
) -> tuple[list[float], int, list[dict[str, Any]], int, tuple[float, ...]]:
    """4.1"""
    fields = Fields(data)
    origin = [fields.f64() for _ in range(3)]
    n_points = fields.varint()
    levels = []
    for _ in range(fields.varint()):
        level: dict[str, Any] = {"pixel": fields.f64(), "n": fields.varint()}
        level["steps"] = [fields.f64() for _ in range(5)]
        level["m"], level["depth"] = fields.varint(), fields.varint()
        level["color"] = fields.varint() - 1
        level["g"] = 0
        levels.append(level)
    kind = 0
    if features & HIERARCHY:
        kind = fields.varint()
        for level in levels:
            level["g"] = fields.varint()
            assert fields.varint() == level["m"] * (level["n"] << level["g"]) ** 2
    limits = tuple(fields.f64() for _ in range(2 if features & ATTRIBUTES else 0))
    assert fields.at == len(data)
    return origin, n_points, levels, kind, limits


def read_cells(stream: Stream, octree: Any, height: int) -> list[tuple[int, int, int]]:
    """4.2, step 3"""
    if height == 0:
        return [(0, 0, 0)]
    cells: list[tuple[int, int, int]] = []
    k = 0
    for c in range(8):
        certain = c == 7 and k == 0
        if certain or stream.bit(octree[min(height, 3) - 1][c][k]):
            k += 1
            corner = [(c >> axis & 1) << (height - 1) for axis in range(3)]
            for x, y, z in read_cells(stream, octree, height - 1):
                cells.append((x + corner[0], y + corner[1], z + corner[2]))
    return cells


def read_poses(stream: Stream, level: dict[str, Any]) -> list[tuple[list[int], list[int]]]:
    """4.2"""
    if level["m"] == 0:
        return []
    ratio = level["pixel"] * level["n"] / level["steps"][0]
    side = min(max(math.floor(ratio + 0.5), 1), 4096)
    corner = Signed()
    low = [stream.signed(corner) for _ in range(3)]
    height = stream.bypass(6)
    octree = [[[Bit() for _ in range(8)] for _ in range(8)] for _ in range(3)]
    cells = read_cells(stream, octree, height)
    count = Unsigned()
    offset, normal = [Symbol(side) for _ in range(3)], [Signed(), Signed()]
    poses = []
    position, code = [0, 0, 0], [0, 0]
    for cell in cells:
        for _ in range(stream.unsigned(count) + 1):
            o = [(position[a] + stream.symbol(offset[a])) % side for a in range(3)]
            position = [(low[a] + cell[a]) * side + o[a] for a in range(3)]
            code = [code[a] + stream.signed(normal[a]) for a in range(2)]
            poses.append((position, code))
    assert len(poses) == level["m"]
    return poses


def frame(pose: tuple[list[int], list[int]], step: float) -> tuple[Any, Any]:
    """4.2, centre and axes"""
    (u, v), half = pose[1], 63
    z = half - abs(u) - abs(v)
    if z < 0:
        x, y = half - abs(v), half - abs(u)
        u, v = (-x if u < 0 else x), (-y if v < 0 else y)
    normal = np.array([u, v, z], np.float64)
    normal /= np.linalg.norm(normal)
    nearest = int(np.argmax(np.abs(normal)))
    g = np.eye(3)[1 if nearest == 0 else 0]
    along = g - (g @ normal) * normal
    along /= np.linalg.norm(along)
    center = np.array(pose[0]) * float(np.float32(step))
    return center, np.stack([along, np.cross(normal, along), normal])


def read_masks(stream: Stream, level: dict[str, Any]) -> Any:
    """4.3"""
    g = level["g"]
    n = level["n"] << g
    full, pixels = Bit(), [Bit(1023) for _ in range(256)]
    some, all_ = [Bit() for _ in range(9)], [Bit() for _ in range(9)]
    masks = np.zeros((level["m"], n, n), bool)
    near = [(0, -1), (-1, 0), (-1, -1), (-1, 1), (0, -2), (-2, 0)]
    for mask in masks:
        if stream.bit(full):
            mask[:] = True
            continue
        blocks = np.full((level["n"], level["n"]), 1)
        for row, column in np.ndindex(blocks.shape if g else (0, 0)):
            left = blocks[row, column - 1] if column else 0
            above = blocks[row - 1, column] if row else 0
            k = 3 * left + above
            blocks[row, column] = stream.bit(some[k]) and 1 + stream.bit(all_[k])
        for row in range(n):
            for column in range(n):
                block = blocks[row >> g, column >> g]
                if block != 1:
                    mask[row, column] = block == 2
                    continue
                index = 2 * (column == 0) + (row == 0)
                for dy, dx in near:
                    y, x = row + dy, column + dx
                    index = 2 * index + bool(y >= 0 and 0 <= x < n and mask[y, x])
                mask[row, column] = stream.bit(pixels[index])
    return masks


def read_dictionary(stream: Stream, n_entries: int, planes: int, n: int) -> Any:
    """4.4"""
    models = [Signed() for _ in range(25)]
    entries = np.zeros((n_entries, planes, n, n))
    for plane in entries.reshape(-1, n, n):
        for row in range(n):
            for column in range(n):
                left = plane[row, column - 1] if column else 0
                above = plane[row - 1, column] if row else 0
                index = int(min(max(left + above, -12), 12)) + 12
                plane[row, column] = stream.signed(models[index])
    flat = entries.reshape(n_entries, planes * n * n)
    return flat / np.linalg.norm(flat, axis=1, keepdims=True)


def read_channel(
    stream: Stream, m: int, n_entries: int, planes: int
) -> tuple[Any, list[int], list[int], list[int]]:
    """4.5"""
    mean_models = [Signed() for _ in range(planes)]
    count = [Unsigned() for _ in range(4)]
    atom, coefficient = Symbol(max(n_entries, 1)), [Signed() for _ in range(4)]
    mean, size = [0] * planes, 0
    means, offsets = [], [0]
    atoms: list[int] = []
    values: list[int] = []
    for _ in range(m):
        mean = [mean[p] + stream.signed(mean_models[p]) for p in range(planes)]
        means.append(mean)
        size = stream.unsigned(count[min(size, 3)])
        for _ in range(size):
            atoms.append(stream.symbol(atom))
            values.append(stream.signed(coefficient[min(size - 1, 3)]))
        offsets.append(len(atoms))
    return np.array(means), offsets, atoms, values


def bumpy_cloud(shades: str) -> sb.PointCloud:
    """A wavy wall and a sphere, coarse enough to read in Python."""
    rng = np.random.default_rng(5)
    u, v = rng.uniform(-1, 1, (2, 8000))
    wall = np.stack([u, v, 0.04 * np.sin(16 * u) * np.cos(13 * v)], axis=1)
    ball = rng.normal(size=(4000, 3))
    ball = 0.3 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + [0.1, 0.2, 0.8]
    points = np.concatenate([wall, ball]) + np.array([500_000.0, 5_000_000.0, 100.0])
    rgb = np.clip(128 + 90 * np.sin(15 * (points - points[0])), 0, 255).astype(np.uint8)
    if shades == "intensities":
        return sb.PointCloud(points, intensities=rgb[:, 1] / np.float32(100) - 2)
    return sb.PointCloud(points, colors=rgb if shades == "colors" else None)


@pytest.mark.parametrize(("shades", "n"), [("colors", 8), ("nothing", 5), ("intensities", 6)])
def test_a_reader_written_from_the_page_finds_the_same_model(shades: str, n: int) -> None:
    cloud = bumpy_cloud(shades)
    model = sb.learn_hscsm(
        cloud,
        resolution=0.03,
        levels=1,
        patch_pixels=n,
        depth_atoms=20,
        depth_tolerance=0.002,
    )
    features = ATTRIBUTES | HIERARCHY if shades == "intensities" else 0
    found = sections(model.to_bytes(), features)
    assert list(found) == ["META", "POSE", "MASK", "DICT", "DPTH", "COLR"]
    origin, n_points, levels, kind, limits = read_meta(found["META"], features)
    assert kind == (4 if shades == "intensities" else 0)
    if cloud.intensities is None:
        assert model.intensity_limits is None
    else:
        assert limits == model.intensity_limits
        values = np.sort(cloud.intensities.astype(np.float64))
        aside = len(values) // 1000
        assert limits == (values[aside], values[-1 - aside])
    assert n_points == model.n_points
    np.testing.assert_array_equal(origin, model.origin)
    (level,) = levels
    assert (level["n"], level["m"], level["pixel"]) == (n, len(model), 0.03)
    steps = level["steps"]

    stream = Stream(found["POSE"])
    frames = [frame(pose, steps[0]) for pose in read_poses(stream, level)]
    assert stream.next >= len(stream.data)
    np.testing.assert_allclose([f[0] for f in frames] + model.origin, model.centers, atol=1e-6)
    np.testing.assert_allclose([f[1] for f in frames], model.axes, atol=1e-6)
    np.testing.assert_array_equal(read_masks(Stream(found["MASK"]), level), model.masks())

    dictionaries = Stream(found["DICT"])
    channels = [("depth", "DPTH", 1, level["depth"], steps[1], steps[2])]
    if shades != "nothing":
        planes = 1 if shades == "intensities" else 3
        channels.append(("color", "COLR", planes, level["color"], steps[3], steps[4]))
    else:
        assert level["color"] == -1
        assert found["COLR"] == b""
    for name, tag, planes, n_entries, mean_step, code_step in channels:
        entries = read_dictionary(dictionaries, n_entries, planes, n)
        np.testing.assert_allclose(entries, getattr(model.dictionary, name)[0], atol=1e-6)
        read = read_channel(Stream(found[tag]), level["m"], n_entries, planes)
        means, offsets, atoms, values = read
        np.testing.assert_allclose(means * mean_step, model.means(0, name), rtol=1e-9)
        own = model.codes(0, name)
        np.testing.assert_array_equal(offsets, own[0])
        np.testing.assert_array_equal(atoms, own[1])
        np.testing.assert_allclose(np.array(values) * code_step, own[2], rtol=1e-9)
        assert len(set(atoms)) > 10


def test_a_reader_written_from_the_page_finds_the_levels_of_a_hierarchy() -> None:
    cloud = bumpy_cloud("colors")
    model = sb.learn_hscsm(cloud, resolution=0.02, levels=3, depth_atoms=8, color_atoms=8)
    found = sections(model.to_bytes(), HIERARCHY)
    _, _, levels, kind, _ = read_meta(found["META"], HIERARCHY)
    assert kind == 1
    assert [level["g"] for level in levels] == [2, 1, 0]
    assert sum(level["m"] > 0 for level in levels) > 1
    poses, masks, depth = (Stream(found[tag]) for tag in ("POSE", "MASK", "DPTH"))
    dictionaries = Stream(found["DICT"])
    entries = read_dictionary(dictionaries, levels[0]["depth"], 1, 8)
    for j, level in enumerate(levels):
        frames = [frame(pose, level["steps"][0]) for pose in read_poses(poses, level)]
        centers = model.patches.poses[model.patches.level == j, :3, 3]
        np.testing.assert_allclose([f[0] for f in frames] + model.origin, centers, atol=1e-6)
        np.testing.assert_array_equal(read_masks(masks, level), model.masks(j))
        np.testing.assert_allclose(entries, model.dictionary.depth[j], atol=1e-6)
        means, _, atoms, _ = read_channel(depth, level["m"], len(entries), 1)
        np.testing.assert_allclose(means * level["steps"][1], model.means(j), rtol=1e-9)
        np.testing.assert_array_equal(atoms, model.codes(j)[1])
    # What follows in the stream is the one dictionary of colours, and then nothing.
    read_dictionary(dictionaries, levels[0]["color"], 3, 8)
    assert dictionaries.next >= len(dictionaries.data)


@pytest.mark.parametrize("shades", ["colors", "intensities"])
def test_pixels_become_points_as_the_page_says(shades: str) -> None:
    model = sb.learn_hscsm(bumpy_cloud(shades), resolution=0.03, levels=1)
    decoded = model.decode(resolution=0.03, normals=False)
    n, mask = 8, model.masks().reshape(len(model), -1)

    def images(channel: sb.patches.Channel, image: Any) -> Any:
        offsets, atoms, values = model.codes(0, channel)
        entries = getattr(model.dictionary, channel)[0]
        for i in range(len(model)):
            for k in range(offsets[i], offsets[i + 1]):
                image[i] += values[k] * entries[atoms[k]]
        return image

    depth = images("depth", np.repeat(model.means(), n * n, axis=1))
    means = model.means(0, "color")
    if shades == "colors":
        y, co, cg = means.T
        t = y - cg / 2
        means = np.stack([t - co / 2 + co, cg + t, t - co / 2], axis=1)
    color = images("color", np.repeat(means, n * n, axis=1)).reshape(len(model), -1, n * n)
    row, column = np.divmod(np.arange(n * n), n)
    offset = np.stack([column - 3.5, row - 3.5]) * 0.03
    x, yy, z = model.axes[:, None, 0], model.axes[:, None, 1], model.axes[:, None, 2]
    points = model.centers[:, None] + offset[0][:, None] * x + offset[1][:, None] * yy
    points = points + depth[:, :, None] * z
    np.testing.assert_allclose(decoded.points, points[mask], atol=1e-5)
    expected = color.transpose(0, 2, 1)[mask]
    if model.intensity_limits is not None:
        low, high = model.intensity_limits
        grey = np.clip(expected.mean(axis=1), 0, 255)
        np.testing.assert_allclose(
            decoded.intensities, low + (high - low) * grey / 255, atol=1e-5 * (high - low)
        )
        assert decoded.colors is None
        return
    assert decoded.colors is not None
    assert np.abs(np.clip(np.rint(expected), 0, 255) - decoded.colors).max() <= 1
