"""Sparse-coded surface patches: local depth and colour images over learned dictionaries.

One level is the Sparse Coded Surface Model (SCSM), several are the hierarchical one (HSCSM). The
method is that of M. Ruhnke, L. Bo, D. Fox, W. Burgard: Hierarchical Sparse Coded Surface Models,
ICRA 2014, section III.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._checks import check_choice, check_integer
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.errors import InvalidInputError
from surfabet.model import Model

__all__ = [
    "HscsmDictionary",
    "HscsmModel",
    "PatchLevel",
    "Patches",
    "SparseColumns",
    "learn_hscsm",
]

Channel = Literal["depth", "color"]

CHANNELS = ("depth", "color")


@dataclass(frozen=True, slots=True)
class PatchLevel:
    """All patches of one size."""

    pixel_size: float
    """Side of a pixel, metres."""
    pixels: int
    """Pixels per side of a patch."""
    patches: int
    """Number of patches."""
    depth_entries: int
    """Entries of the depth dictionary."""
    color_entries: int
    """Entries of the dictionary of colours, or of intensities as grey; 0 without both."""
    set_pixels: int
    """Mask pixels that are set, over all patches."""
    area: float
    """Area of these mask pixels, square metres."""


@dataclass(frozen=True, slots=True)
class SparseColumns:
    """Sparse codes of all patches of a model as compressed rows.

    Patch i is `coefficients[a:b] @ dictionary[atoms[a:b]]` with `a, b = offsets[i:i + 2]` and the
    concatenated dictionary of the channel, beside its mean.
    """

    offsets: NDArray[np.int64]
    """(m + 1,)."""
    atoms: NDArray[np.int64]
    """Entries of the concatenated dictionary (`HscsmDictionary.concatenated`)."""
    coefficients: NDArray[np.float64]
    """Metres for depth, 0..255 for colour and grey."""


@dataclass(frozen=True, slots=True)
class Patches:
    """All m patches of a model as arrays, level by level, coarsest first."""

    poses: NDArray[np.float64]
    """Patch to world, (m, 4, 4): columns are the x-axis, the y-axis, the normal and the centre."""
    level: NDArray[np.int64]
    """Level of each patch, (m,)."""
    size: NDArray[np.float64]
    """Side of each patch, (m,), metres."""
    pixel_size: NDArray[np.float64]
    """Side of its pixels, (m,), metres."""
    masks: tuple[NDArray[np.bool_], ...]
    """Set mask pixels of the patches of each level, (patches, n, n). n is the pixels per side of a
    patch, or with fine masks twice as much per level above the lowest."""
    depth_means: NDArray[np.float64]
    """Mean depth along the normal, (m,), metres."""
    color_means: NDArray[np.float64] | None
    """Mean luma, orange and green chroma of colours, (m, 3), or grey of intensities, (m, 1); None
    without both."""
    depth: SparseColumns
    """Codes of depth."""
    color: SparseColumns | None
    """Codes of colour, or of intensities as grey; None without both."""

    def __len__(self) -> int:
        return len(self.level)


@final
class HscsmDictionary:
    """The dictionaries of a model, for other clouds to be described with; immutable.

    Made by `HscsmModel.dictionary`. A model that `describe` makes holds no dictionary in its file,
    only the hash of this one, and needs it again when it is loaded.
    """

    __slots__ = ("_core",)

    def __init__(self, core: _core.HscsmDictionary) -> None:
        self._core = core

    @property
    def hash(self) -> str:
        """The first 128 bits of the BLAKE3 hash of its content, as hexadecimal digits."""
        return self._core.hash

    @property
    def levels(self) -> tuple[tuple[float, int], ...]:
        """Side of a pixel (m) and pixels per side of a patch, of each level, coarsest first."""
        return tuple(self._core.levels)

    @property
    def depth(self) -> tuple[NDArray[np.float32], ...]:
        """Entries for depth of each level, unit norm, (k, n * n)."""
        return tuple(self._core.entries("depth") or ())

    @property
    def color(self) -> tuple[NDArray[np.float32], ...] | None:
        """Entries for colour of each level, unit norm, (k, 3 * n * n) with planes of red, green and
        blue, or (k, n * n) for intensities; None when learned from a cloud without both."""
        found = self._core.entries("color")
        return None if found is None else tuple(found)

    def concatenated(
        self, channel: Channel = "depth"
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """All entries of a channel in one array, and where the entries of each level start.

        Entries of level j are rows `offsets[j]:offsets[j + 1]`.
        """
        check_choice("channel", channel, CHANNELS)
        found = self._core.entries(channel)
        if found is None:
            raise InvalidInputError("this dictionary has no colour")
        offsets = np.cumsum([0, *map(len, found)], dtype=np.int64)
        return np.concatenate(found), offsets

    def describe(
        self,
        cloud: PointCloud,
        *,
        max_depth_deviation: float | None = None,
        max_color_deviation: float = 20.0,
        min_coverage: float = 0.9,
        placement: Literal["greedy", "subsampled"] = "greedy",
        depth_sparsity: int = 6,
        color_sparsity: int = 12,
        depth_tolerance: float | None = None,
        color_tolerance: float = 7.0,
        fine_masks: bool = True,
        growth_gate: bool = True,
        max_pixel_offset: float = 0.2,
        means_apart: bool = True,
        disjoint: bool = True,
        sensor: Literal["structured-light", "constant"] = "structured-light",
        keep_outliers: bool = False,
        progress: Progress = None,
    ) -> HscsmModel:
        """Describes another cloud in these dictionaries: nothing is learned.

        Resolution, levels and pixels of a patch are those of the dictionary.

        Parameters
        ----------
        cloud
            The scan; with colours or intensities only if the dictionary has colour.
        max_depth_deviation
            Largest standard deviation of depth in a pixel (rho_max_depth). What deviates more goes
            to the level below; the lowest level takes all. A number from 1e-9 to 1e9 metres; by
            default `resolution` / sqrt(3), at which every level accepts sheets as thick as those of
            the lowest.
        max_color_deviation
            Largest standard deviation of colour in a pixel (rho_max_rgb), root mean square of the
            channels. A positive number of grey levels; by default 20.
        min_coverage
            Least fraction of its pixels that a patch covers. The level below describes what covers
            less. A number above 0 and at most 1; by default 0.9.
        placement
            How places of patches are chosen. 'greedy' takes the best coverage first, then aligned
            neighbours; 'subsampled' takes a patch per cube, as SCSM does, to compare with. 'greedy'
            or 'subsampled'; by default greedy.
        depth_sparsity
            Most dictionary entries that describe the depth of one patch (k, eq. 1). An integer from
            1 to 64; by default 6.
        color_sparsity
            Most dictionary entries that describe the colour of one patch (k, eq. 1). An integer
            from 1 to 64; by default 12.
        depth_tolerance
            Root mean square error at which coding of a patch's depth ends, on the lowest level.
            Each level above has half the tolerance of the one below, since its errors spread over
            larger patches. A number from 1e-9 to 1e9 metres; by default a fifth of `resolution`.
        color_tolerance
            Root mean square error at which coding of a patch's colour ends, on the lowest level. It
            is halved from level to level likewise. A number from 0.001 to 255 grey levels; by
            default 7.
        fine_masks
            Bitmasks of all levels have pixels of the lowest one: coarse patches then have the gaps
            and rims of the scan. Otherwise a bitmask has the pixels of its patch, as printed. True
            or False; by default True.
        growth_gate
            A patch takes the samples that growth from its middle reaches in steps of depth up to a
            gate: a pixel at the lowest level. Otherwise it takes all in its cube, as printed. True
            or False; by default True.
        max_pixel_offset
            Pixels that the mean place of a pixel's samples may be off its centre above the lowest
            level, where bitmasks are not fine. With infinity there is no such rule, as printed. A
            number above 0 pixels; by default 0.2.
        means_apart
            Means of each patch are coded apart, those of colour as luma and chroma. Otherwise they
            are part of the sparse codes, as printed. True or False; by default True.
        disjoint
            A sample belongs to one patch. Otherwise a patch shows all samples in its cube that its
            level has to describe, and patches overlap, as printed. True or False; by default True.
        sensor
            How the error of a range measurement grows with the range. 'structured-light' is with
            its square, as for Kinects. Ranges are those of the cloud, or distances to its
            viewpoints; without both all points weigh the same. 'structured-light' or 'constant'; by
            default structured-light.
        keep_outliers
            Keeps points that are far from all others. Otherwise those of which a few would make the
            scene many times as large as it is are left out, and counted in the report. True or
            False; by default False.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            As `learn_hscsm`, and for a cloud with colours or intensities when the dictionary has no
            entries for them.
        """
        options = {
            "max_depth_deviation": max_depth_deviation,
            "max_color_deviation": max_color_deviation,
            "min_coverage": min_coverage,
            "placement": placement,
            "depth_sparsity": depth_sparsity,
            "color_sparsity": color_sparsity,
            "depth_tolerance": depth_tolerance,
            "color_tolerance": color_tolerance,
            "fine_masks": fine_masks,
            "growth_gate": growth_gate,
            "max_pixel_offset": max_pixel_offset,
            "means_apart": means_apart,
            "disjoint": disjoint,
            "sensor": sensor,
            "keep_outliers": keep_outliers,
        }
        with progress_callback(progress) as callback:
            return HscsmModel(self._core.describe(cloud, options, progress=callback))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HscsmDictionary) and self.hash == other.hash

    def __hash__(self) -> int:
        return hash(self.hash)

    def __repr__(self) -> str:
        color = self.color or ()
        return (
            f"HscsmDictionary({' + '.join(str(len(d)) for d in self.depth)} depth"
            + (f" and {' + '.join(str(len(d)) for d in color)} colour" if color else "")
            + f" entries, {self.hash})"
        )


@final
class HscsmModel(Model[_core.HscsmModel]):
    """A cloud as sparse-coded surface patches; immutable.

    Made by `learn_hscsm`, `HscsmDictionary.describe` and `surfabet.load`. It decodes (eq. 2 and 3)
    to a spacing of half a pixel of the finest level by default, patch by patch.
    """

    __slots__ = ()

    @property
    def levels(self) -> tuple[PatchLevel, ...]:
        """The levels of the hierarchy, coarsest first."""
        return tuple(PatchLevel(*level) for level in self._core.levels)

    @property
    def has_intensity(self) -> bool:
        """Whether the model carries intensities, which it does in the place of colours."""
        return self.intensity_limits is not None

    @property
    def intensity_limits(self) -> tuple[float, float] | None:
        """The intensities that grey levels 0 and 255 stand for, in the sensor's own unit; None
        without intensities."""
        return self._core.intensity_limits

    @property
    def centers(self) -> NDArray[np.float64]:
        """World position of every patch, level by level, (m, 3), metres."""
        return self._core.centers

    @property
    def axes(self) -> NDArray[np.float32]:
        """x-axis, y-axis and normal of every patch as rows, (m, 3, 3)."""
        return self._core.axes

    def masks(self, level: int = 0) -> NDArray[np.bool_]:
        """Which mask pixels of the patches of a level are set, (m, n, n).

        n is the pixels per side of a patch, or with fine masks the number of pixels of the lowest
        level along it.
        """
        self._check(level)
        return self._core.masks(level)

    def means(self, level: int = 0, channel: Channel = "depth") -> NDArray[np.float64]:
        """Mean of each patch of a level.

        (m, 1) metres along the normal for depth; (m, 3) luma, orange and green chroma for colour,
        or (m, 1) grey of intensities.
        """
        self._check(level, channel)
        return self._core.means(level, channel)

    def _check(self, level: int, channel: Channel = "depth") -> None:
        check_integer("level", level, 0, len(self.levels) - 1)
        check_choice("channel", channel, CHANNELS)

    @property
    def dictionary(self) -> HscsmDictionary:
        """The dictionaries of all levels, for other clouds to be described with."""
        return HscsmDictionary(self._core.dictionaries())

    @property
    def patches(self) -> Patches:
        """All patches as arrays."""
        levels = self.levels
        counts = [level.patches for level in levels]

        def spread(values: list[float]) -> NDArray[np.float64]:
            return np.repeat(np.array(values, dtype=np.float64), counts)

        poses = np.zeros((len(self), 4, 4))
        poses[:, :3, :3] = self.axes.transpose(0, 2, 1)
        poses[:, :3, 3] = self.centers
        poses[:, 3, 3] = 1
        color = self.has_color or self.has_intensity
        return Patches(
            poses=poses,
            level=np.repeat(np.arange(len(levels)), counts),
            size=spread([level.pixel_size * level.pixels for level in levels]),
            pixel_size=spread([level.pixel_size for level in levels]),
            masks=tuple(self.masks(j) for j in range(len(levels))),
            depth_means=np.concatenate([self.means(j)[:, 0] for j in range(len(levels))]),
            color_means=np.concatenate([self.means(j, "color") for j in range(len(levels))])
            if color
            else None,
            depth=self._columns("depth"),
            color=self._columns("color") if color else None,
        )

    def _columns(self, channel: Channel) -> SparseColumns:
        offsets, atoms, coefficients = [np.zeros(1, np.int64)], [], []
        starts = self.dictionary.concatenated(channel)[1]
        used = 0
        for j, start in enumerate(starts[:-1]):
            of_level = self.codes(j, channel)
            offsets.append(of_level[0][1:].astype(np.int64) + used)
            used += len(of_level[1])
            atoms.append(of_level[1].astype(np.int64) + start)
            coefficients.append(of_level[2])
        return SparseColumns(*map(np.concatenate, (offsets, atoms, coefficients)))

    def codes(
        self, level: int = 0, channel: Channel = "depth"
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint16], NDArray[np.float64]]:
        """Sparse codes of the patches of a level as columns `(offsets, entries, coefficients)`.

        Patch i uses `entries[offsets[i]:offsets[i + 1]]` times the coefficients at the same places;
        metres for depth, 0..255 for colour and grey.
        """
        self._check(level, channel)
        return self._core.codes(level, channel)

    def __repr__(self) -> str:
        shades = "colour" if self.has_color else "intensity"
        levels = "; ".join(
            f"{level.patches} patches of {level.pixels} x {level.pixels} pixels of "
            f"{level.pixel_size:g} m over {level.depth_entries} depth"
            + (f" and {level.color_entries} {shades}" if level.color_entries else "")
            + " entries"
            for level in self.levels
        )
        return f"HscsmModel({self.n_points} points as {levels})"


def learn_hscsm(
    cloud: PointCloud,
    *,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    published: bool = False,
    resolution: float | None = None,
    patch_pixels: int = 8,
    levels: int = 3,
    max_depth_deviation: float | None = None,
    max_color_deviation: float = 20.0,
    min_coverage: float = 0.9,
    placement: Literal["greedy", "subsampled"] = "greedy",
    depth_atoms: int | None = None,
    color_atoms: int | None = None,
    depth_sparsity: int = 6,
    color_sparsity: int = 12,
    depth_tolerance: float | None = None,
    color_tolerance: float = 7.0,
    iterations: int = 8,
    fine_masks: bool = True,
    one_dictionary: bool = True,
    growth_gate: bool = True,
    max_pixel_offset: float = 0.2,
    means_apart: bool = True,
    small_atoms: bool = True,
    disjoint: bool = True,
    max_training_signals: int = 6000,
    sensor: Literal["structured-light", "constant"] = "structured-light",
    keep_outliers: bool = False,
    random_state: int = 0,
    progress: Progress = None,
) -> HscsmModel:
    """Learns hierarchical sparse-coded surface patches, as published; one level is SCSM.

    Patches have free poses, fixed thresholds pass them from level to level, and their depth and
    colour are sparse codes over learned dictionaries, which can describe other clouds. Intensities
    of a cloud without colours take the place of colours.

    Parameters
    ----------
    cloud
        The scan. Colours are kept when present, else intensities: as grey, of which black and white
        are the least and the largest intensity without the outer thousandth of the points at each
        end, which are clamped.
        Ranges weight the points by the depth error of their sensor; viewpoints tell the two sides
        of a thin wall apart.
    quality
        Small files or fine detail. Sets `resolution`, unless that is given: 'small' doubles it,
        'fine' halves it. 'small', 'balanced' or 'fine'; by default balanced.
    published
        The method as printed in the paper, without what was added to it: the options from
        `fine_masks` to `max_training_signals` do not count then, and the dictionaries have the
        paper's sizes where none are given. True or False; by default False.
    resolution
        Side of a pixel of the lowest level (pr, the patch resolution). Smaller detail is lost. A
        number from 1e-9 to 1e9 metres; by default from the data: two and a half spacings of the
        points, or 1.25 standard deviations of their noise where that is more.
    patch_pixels
        Pixels per side of a patch. The patch size (ps) is this times `resolution`. An integer from
        2 to 32; by default 8.
    levels
        Levels of the hierarchy; one is SCSM. Pixels of each are twice as wide as those of the level
        below it. An integer from 1 to 8; by default 3.
    max_depth_deviation
        Largest standard deviation of depth in a pixel (rho_max_depth). What deviates more goes to
        the level below; the lowest level takes all. A number from 1e-9 to 1e9 metres; by default
        `resolution` / sqrt(3), at which every level accepts sheets as thick as those of the lowest.
    max_color_deviation
        Largest standard deviation of colour in a pixel (rho_max_rgb), root mean square of the
        channels. A positive number of grey levels; by default 20.
    min_coverage
        Least fraction of its pixels that a patch covers. The level below describes what covers
        less. A number above 0 and at most 1; by default 0.9.
    placement
        How places of patches are chosen. 'greedy' takes the best coverage first, then aligned
        neighbours; 'subsampled' takes a patch per cube, as SCSM does, to compare with. 'greedy' or
        'subsampled'; by default greedy.
    depth_atoms
        Most entries of a depth dictionary. Those that no patch uses are dropped. An integer from 1
        to 65535; by default one for each 80 patches, 16 to 128; 500 with `published`.
    color_atoms
        Most entries of a colour dictionary. Those that no patch uses are dropped. An integer from 1
        to 65535; by default one for each 40 patches, 32 to 256; 3500 with `published`.
    depth_sparsity
        Most dictionary entries that describe the depth of one patch (k, eq. 1). An integer from 1
        to 64; by default 6.
    color_sparsity
        Most dictionary entries that describe the colour of one patch (k, eq. 1). An integer from 1
        to 64; by default 12.
    depth_tolerance
        Root mean square error at which coding of a patch's depth ends, on the lowest level. Each
        level above has half the tolerance of the one below, since its errors spread over larger
        patches. A number from 1e-9 to 1e9 metres; by default a fifth of `resolution`.
    color_tolerance
        Root mean square error at which coding of a patch's colour ends, on the lowest level. It is
        halved from level to level likewise. A number from 0.001 to 255 grey levels; by default 7.
    iterations
        Most iterations of weighted K-SVD per dictionary. An integer from 1 to 1000; by default 8.
    fine_masks
        Bitmasks of all levels have pixels of the lowest one: coarse patches then have the gaps and
        rims of the scan. Otherwise a bitmask has the pixels of its patch, as printed. True or
        False; by default True.
    one_dictionary
        All levels have one dictionary per channel, learned from what all of them have to code, in
        tolerances of their level. Otherwise each level learns its own, as printed. True or False;
        by default True.
    growth_gate
        A patch takes the samples that growth from its middle reaches in steps of depth up to a
        gate: a pixel at the lowest level. Otherwise it takes all in its cube, as printed. True or
        False; by default True.
    max_pixel_offset
        Pixels that the mean place of a pixel's samples may be off its centre above the lowest
        level, where bitmasks are not fine. With infinity there is no such rule, as printed. A
        number above 0 pixels; by default 0.2.
    means_apart
        Means of each patch are coded apart, those of colour as luma and chroma. Otherwise they are
        part of the sparse codes, as printed. True or False; by default True.
    small_atoms
        Entries of dictionaries are rounded to 8 bits. Otherwise to 16, which stand for the paper's
        real numbers. True or False; by default True.
    disjoint
        A sample belongs to one patch. Otherwise a patch shows all samples in its cube that its
        level has to describe, and patches overlap, as printed. True or False; by default True.
    max_training_signals
        Most patches that a dictionary is learned from, those with most energy. An integer from 1 to
        below 2^32; by default 6000.
    sensor
        How the error of a range measurement grows with the range. 'structured-light' is with its
        square, as for Kinects. Ranges are those of the cloud, or distances to its viewpoints;
        without both all points weigh the same. 'structured-light' or 'constant'; by default
        structured-light.
    keep_outliers
        Keeps points that are far from all others. Otherwise those of which a few would make the
        scene many times as large as it is are left out, and counted in the report. True or False;
        by default False.
    random_state
        Seed of the first entries of the dictionaries. An integer from 0 to below 2^64; by default
        0.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    HscsmModel
        The same for the same cloud, options and seed, whatever the number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, options outside their range, or a scene too large for its resolution.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> u, v = np.meshgrid(np.arange(0, 1, 0.005), np.arange(0, 1, 0.005))
    >>> wall = sb.PointCloud(np.stack([u.ravel(), np.zeros(u.size), v.ravel()], axis=1))
    >>> model = sb.learn_hscsm(wall, resolution=0.02)
    >>> bool(np.abs(model.decode().points[:, 1]).max() < 0.002)
    True
    """
    options = {
        "quality": quality,
        "published": published,
        "resolution": resolution,
        "patch_pixels": patch_pixels,
        "levels": levels,
        "max_depth_deviation": max_depth_deviation,
        "max_color_deviation": max_color_deviation,
        "min_coverage": min_coverage,
        "placement": placement,
        "depth_atoms": depth_atoms,
        "color_atoms": color_atoms,
        "depth_sparsity": depth_sparsity,
        "color_sparsity": color_sparsity,
        "depth_tolerance": depth_tolerance,
        "color_tolerance": color_tolerance,
        "iterations": iterations,
        "fine_masks": fine_masks,
        "one_dictionary": one_dictionary,
        "growth_gate": growth_gate,
        "max_pixel_offset": max_pixel_offset,
        "means_apart": means_apart,
        "small_atoms": small_atoms,
        "disjoint": disjoint,
        "max_training_signals": max_training_signals,
        "sensor": sensor,
        "keep_outliers": keep_outliers,
        "random_state": random_state,
    }
    with progress_callback(progress) as callback:
        return HscsmModel(_core.learn_hscsm(cloud, options, progress=callback))
