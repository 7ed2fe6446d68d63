"""Options of learning, for all models; written by scripts/generate_options.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from surfabet.cli._numbers import WHOLE

__all__ = ["LEARN_OPTIONS", "LearnOptions", "ModelName"]

ModelName = Literal["patches", "hscsm", "alphabet", "bic-alphabet", "planes", "gas"]
"""What `--model` takes."""

SHARED = Group("Options of several models", sort_key=1)
PATCHES = Group("Options of --model patches", sort_key=2)
HSCSM = Group("Options of --model hscsm", sort_key=3)
ALPHABET = Group("Options of --model alphabet", sort_key=4)
BIC_ALPHABET = Group("Options of --model bic-alphabet", sort_key=5)
PLANES = Group("Options of --model planes", sort_key=6)
GAS = Group("Options of --model gas", sort_key=7)

NAMES = frozenset({"attributes"})
"""Options that take names with commas between them."""


@Parameter(name="*")
@dataclass(frozen=True)
class LearnOptions:
    """Options of learning; None leaves them to the model."""

    quality: Annotated[Literal["small", "balanced", "fine"] | None, Parameter(group=SHARED)] = None
    """patches, hscsm, alphabet, bic-alphabet, planes, gas: Small files or fine detail. 'small',
    'balanced' or 'fine'; by default balanced."""

    resolution: Annotated[float | None, Parameter(group=SHARED)] = None
    """patches: Side of a pixel of the finest level. hscsm: Side of a pixel of the lowest level (pr,
    the patch resolution). For patches a number from 1e-8 to 1e5 metres; by default from the data:
    2.25 spacings of the points, 3 on scan lines and of rounded coordinates, 1.25 standard
    deviations of their noise or half of max_error (with max_error_forward all of it, or of that
    where it is less), whichever is most. For hscsm a number from 1e-9 to 1e9 metres; by default
    from the data: two and a half spacings of the points, or 1.25 standard deviations of their noise
    where that is more."""

    levels: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """patches: Levels of the hierarchy. hscsm: Levels of the hierarchy; one is SCSM. For patches an
    integer from 1 to 4; by default 2. For hscsm an integer from 1 to 8; by default 3."""

    rounds: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """patches: Rounds of choosing patches. alphabet: Rounds of covering the scene. For patches an
    integer from 1 to 10; by default 3. For alphabet an integer from 1 to 64; by default 4."""

    color_step: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """patches: Rounding of luma of a single cell. alphabet: Rounding of the mean colours of
    occurrences. planes: Rounding of the colours of tiles. gas: Rounding of colours. For patches an
    integer from 1 to 1024 grey levels; by default 115. For alphabet an integer from 1 to 255 grey
    levels; by default 8. For planes, gas an integer from 1 to 64 grey levels; by default 8."""

    attribute_step: Annotated[float | None, Parameter(group=SHARED)] = None
    """patches: Rounding of intensities and other scalars of a single cell, as a share of their
    standard deviation. planes: Rounding of the mean intensities of tiles, as a share of their
    standard deviation. gas: Rounding of the mean intensities of neurons, as a share of their
    standard deviation. For patches a number from 0.001 to 100 standard deviations; by default 0.5.
    For planes, gas a number from 0.001 to 100 standard deviations; by default 0.125."""

    sensor: Annotated[Literal["structured-light", "constant"] | None, Parameter(group=SHARED)] = (
        None
    )
    """patches, hscsm: How the error of a range measurement grows with the range. 'structured-light'
    or 'constant'; by default structured-light."""

    keep_outliers: Annotated[bool | None, Parameter(group=SHARED)] = None
    """patches, hscsm, alphabet, bic-alphabet, planes, gas: Keeps points that are far from all
    others. True or False; by default False."""

    published: Annotated[bool | None, Parameter(group=SHARED)] = None
    """hscsm: The method as printed in the paper, without what was added to it: the options from
    `fine_masks` to `max_training_signals` do not count then, and the dictionaries have the paper's
    sizes where none are given. planes: The method as printed in the paper, from random patches (10
    where `initial_patches` is 0), without what was added to it. gas: The method as printed, without
    what was added to it: 300 `patterns` and a `beta` of 0.005 where they are not given, and no
    `polish`. True or False; by default False."""

    iterations: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """hscsm: Most iterations of weighted K-SVD per dictionary. bic-alphabet: Most candidate words
    that are tried. For hscsm an integer from 1 to 1000; by default 8. For bic-alphabet an integer
    from 1 to below 2^32; by default 500."""

    random_state: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """hscsm: Seed of the first entries of the dictionaries. bic-alphabet: Seed of the order in
    which candidates are tried and features are spread. planes: Seed of the patches that are placed
    at random. gas: Seed of the signals. An integer from 0 to below 2^64; by default 0."""

    radius: Annotated[float | None, Parameter(group=SHARED)] = None
    """alphabet: Smallest radius of a word (delta). bic-alphabet: Radius of a word (delta, eq. 1).
    For alphabet a number from 1e-9 to 1e9 metres; by default from the data: three spacings of the
    points, or one and a half times the median sigma where that is more. For bic-alphabet a number
    from 1e-6 to 1e5 metres; by default from the data: four spacings of the points, or a 300th of
    the scene where that is more."""

    sigma_scale: Annotated[float | None, Parameter(group=SHARED)] = None
    """alphabet, bic-alphabet: Factor of the deviation sigma within which a point is explained
    (lambda, eq. 13). A number above 0 and at most 1e6; by default 3."""

    angular_resolution: Annotated[float | None, Parameter(group=SHARED)] = None
    """alphabet, bic-alphabet: Angle between neighbouring beams (alpha, eq. 13). A number above 0
    and below 180 degrees; by default estimated from the spacing of the points."""

    noise: Annotated[float | None, Parameter(group=SHARED)] = None
    """alphabet, bic-alphabet: Standard deviation of a measured point about its surface. For
    alphabet a number from 0 to 1e9 metres; by default estimated as the median deviation of
    neighbouring points from their plane. For bic-alphabet a number from 0 to 1e9 metres; by default
    0."""

    min_range: Annotated[float | None, Parameter(group=SHARED)] = None
    """alphabet, bic-alphabet: Points nearer to the sensor are left out, such as the robot's own
    body. A number from 0 to 1e9 metres; by default 0."""

    min_points: Annotated[int | None, Parameter(group=SHARED), WHOLE] = None
    """bic-alphabet: Least number of points of a word. planes: Points that a patch needs. For
    bic-alphabet an integer from 1 to below 2^32; by default 8. For planes an integer from 3 to
    below 2^32; by default one in 4000 of all points, at least 30."""

    max_error: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Largest distance of any input point to the cloud that is decoded as measured at the default
    spacing. A number from 1e-8 to 1e5 metres; by default no bound."""

    max_error_forward: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Largest distance of any decoded point to the input, as measured or as a surface at the
    default spacing: no surface is filled in where nothing was measured. A number from 1e-8 to 1e5
    metres; by default no bound."""

    completeness: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Least share of the points that are within the tolerance of the cloud decoded as measured: two
    spacings, three standard deviations of the noise, or two thirds of a given `resolution`,
    whichever is most; twice as much for 'small'. A number from 0 to 1; by default 0.99."""

    rate: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Squared error that a bit of geometry must save (lambda), summed over pixels and both
    directions. A positive number of squared pixels; by default 1.4."""

    depth_step: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Rounding of depths, in pixels of the finest level. A number from 0.0625 to 16 pixels in steps
    of 0.0625; by default 0.75, or an eighth of the gap where surfaces lie close behind one another
    and that is less."""

    recurrence: Annotated[bool | None, Parameter(group=PATCHES)] = None
    """Looks for what recurs in the scene: patches are left out where others, moved, give the same
    surface, if that makes the file smaller. True or False; by default False."""

    chroma_ratio: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Rounding of chroma as a multiple of that of luma. A number from 0.25 to 4; by default 1."""

    color_rate: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Squared error that a bit of colour must save. A positive number of squared colour steps; by
    default 0.15."""

    attributes: Annotated[str | None, Parameter(group=PATCHES)] = None
    """Attributes to keep, by name: 'colors', 'intensities', or any that the cloud has beside them.
    Names with commas between them; by default colours and intensities, where the cloud has them."""

    attribute_rate: Annotated[float | None, Parameter(group=PATCHES)] = None
    """Squared error that a bit of a scalar must save. A positive number of squared steps; by
    default 0.15."""

    patch_pixels: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Pixels per side of a patch. An integer from 2 to 32; by default 8."""

    max_depth_deviation: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Largest standard deviation of depth in a pixel (rho_max_depth). A number from 1e-9 to 1e9
    metres; by default `resolution` / sqrt(3), at which every level accepts sheets as thick as those
    of the lowest."""

    max_color_deviation: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Largest standard deviation of colour in a pixel (rho_max_rgb), root mean square of the
    channels. A positive number of grey levels; by default 20."""

    min_coverage: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Least fraction of its pixels that a patch covers. A number above 0 and at most 1; by default
    0.9."""

    placement: Annotated[Literal["greedy", "subsampled"] | None, Parameter(group=HSCSM)] = None
    """How places of patches are chosen. 'greedy' or 'subsampled'; by default greedy."""

    depth_atoms: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Most entries of a depth dictionary. An integer from 1 to 65535; by default one for each 80
    patches, 16 to 128; 500 with `published`."""

    color_atoms: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Most entries of a colour dictionary. An integer from 1 to 65535; by default one for each 40
    patches, 32 to 256; 3500 with `published`."""

    depth_sparsity: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Most dictionary entries that describe the depth of one patch (k, eq. 1). An integer from 1 to
    64; by default 6."""

    color_sparsity: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Most dictionary entries that describe the colour of one patch (k, eq. 1). An integer from 1
    to 64; by default 12."""

    depth_tolerance: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Root mean square error at which coding of a patch's depth ends, on the lowest level. A number
    from 1e-9 to 1e9 metres; by default a fifth of `resolution`."""

    color_tolerance: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Root mean square error at which coding of a patch's colour ends, on the lowest level. A
    number from 0.001 to 255 grey levels; by default 7."""

    fine_masks: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """Bitmasks of all levels have pixels of the lowest one: coarse patches then have the gaps and
    rims of the scan. True or False; by default True."""

    one_dictionary: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """All levels have one dictionary per channel, learned from what all of them have to code, in
    tolerances of their level. True or False; by default True."""

    growth_gate: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """A patch takes the samples that growth from its middle reaches in steps of depth up to a gate:
    a pixel at the lowest level. True or False; by default True."""

    max_pixel_offset: Annotated[float | None, Parameter(group=HSCSM)] = None
    """Pixels that the mean place of a pixel's samples may be off its centre above the lowest level,
    where bitmasks are not fine. A number above 0 pixels; by default 0.2."""

    means_apart: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """Means of each patch are coded apart, those of colour as luma and chroma. True or False; by
    default True."""

    small_atoms: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """Entries of dictionaries are rounded to 8 bits. True or False; by default True."""

    disjoint: Annotated[bool | None, Parameter(group=HSCSM)] = None
    """A sample belongs to one patch. True or False; by default True."""

    max_training_signals: Annotated[int | None, Parameter(group=HSCSM), WHOLE] = None
    """Most patches that a dictionary is learned from, those with most energy. An integer from 1 to
    below 2^32; by default 6000."""

    scales: Annotated[int | None, Parameter(group=ALPHABET), WHOLE] = None
    """Number of radii, each twice the one before. An integer from 1 to 8; by default 4."""

    max_words: Annotated[int | None, Parameter(group=ALPHABET), WHOLE] = None
    """Most words beside the plane. An integer from 0 to 4095; by default 24."""

    inlier_bits: Annotated[float | None, Parameter(group=ALPHABET)] = None
    """What explaining a point is worth. A positive number of bits; by default by `quality`."""

    outlier_bits: Annotated[float | None, Parameter(group=ALPHABET)] = None
    """What a decoded point that explains nothing costs. 0 or a positive number of bits; by default
    as `inlier_bits`."""

    spacing: Annotated[float | None, Parameter(group=ALPHABET)] = None
    """Distance of decoded points. A number from 0.25 to 4 sigma; by default 1."""

    epsilon: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """Least distance of decoded points (epsilon, eq. 3). A number from 1e-9 to 1e5 metres; by
    default a fifth of the radius."""

    feature_spacing: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """Largest distance of a point of the scene to a feature. A number from 1e-9 to 1e9 metres; by
    default the radius."""

    interest_scales: Annotated[
        Sequence[float] | None, Parameter(group=BIC_ALPHABET, consume_multiple=True, negative=())
    ] = None
    """Scales of the Laplacian of Gaussian that finds interest points in the range image. A sequence
    with each a number from 0.5 to 32 pixels; by default 1, 2, 4."""

    interest_threshold: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """Least response of an interest point: squared scale times the Laplacian of the logarithm of
    the range. A positive number; by default 0.05."""

    normal_neighbors: Annotated[int | None, Parameter(group=BIC_ALPHABET), WHOLE] = None
    """Least number of neighbours that a feature's normal is fitted to, where fewer lie within the
    radius. An integer from 3 to 1000; by default 12."""

    upright: Annotated[Literal["x", "z", "view"] | None, Parameter(group=BIC_ALPHABET)] = None
    """What is up where the normal is vertical. 'x', 'z' or 'view'; by default x."""

    descriptor_pixels: Annotated[int | None, Parameter(group=BIC_ALPHABET), WHOLE] = None
    """Pixels per side of a descriptor; those within the inscribed circle count. An integer from 2
    to 32; by default 8."""

    empty_penalty: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """Part of the distance of two descriptors for a pixel that is empty in only one of them, as a
    share of the radius. A number from 0 to 1; by default 0.5."""

    floor: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """Distance at which a point without a decoded one nearby counts as having one. A number from 3
    to 40 sigma; by default 3."""

    max_rejections: Annotated[int | None, Parameter(group=BIC_ALPHABET), WHOLE] = None
    """Learning ends after this many candidates in a row that did not lower the BIC. An integer from
    1 to below 2^32; by default 100."""

    reduce: Annotated[bool | None, Parameter(group=BIC_ALPHABET)] = None
    """Removes occurrences without which the likelihood does not fall (section III-D). True or
    False; by default True."""

    reduce_tolerance: Annotated[float | None, Parameter(group=BIC_ALPHABET)] = None
    """How far the logarithm of the likelihood may fall with each occurrence that is removed
    (section III-D). 0 or a positive number of nats; by default 3."""

    initial_patches: Annotated[int | None, Parameter(group=PLANES), WHOLE] = None
    """Number of patches to start from, placed at random. An integer from 0 to 2^20; by default
    0."""

    min_grid_size: Annotated[float | None, Parameter(group=PLANES)] = None
    """Grid size (G, section II-E) that the learned one does not fall below. A number from 1e-9 to
    1e9 metres; by default the median spacing of the points, or three times their noise where that
    is more."""

    weight_at_grid_size: Annotated[float | None, Parameter(group=PLANES)] = None
    """Weight of a point at distance G before normalisation (W, eq. 2). A number above 0 and below
    1; by default 0.01."""

    split_threshold: Annotated[float | None, Parameter(group=PLANES)] = None
    """A patch is split where its density falls below this share of the mean (section II-C). A
    number from 0 to below 1; by default 0.6667."""

    merge_tolerance: Annotated[float | None, Parameter(group=PLANES)] = None
    """Factor by which points of either of two patches may be further from their common plane than
    from their own for the two to merge (section II-D). A number of at least 1; by default 1.25."""

    em_steps: Annotated[int | None, Parameter(group=PLANES), WHOLE] = None
    """Passes of E-step, M-step and trimming before each split and each merge (EMPF, section II-A).
    An integer from 1 to 10000; by default 2."""

    new_patches_every: Annotated[int | None, Parameter(group=PLANES), WHOLE] = None
    """Iterations after which patches are added where many points support none (section II-B). An
    integer from 1 to 10000; by default 5."""

    max_iterations: Annotated[int | None, Parameter(group=PLANES), WHOLE] = None
    """Most iterations of EMPF, split, EMPF, merge. An integer from 1 to 10000; by default 30."""

    tolerance: Annotated[float | None, Parameter(group=PLANES)] = None
    """Learning ends when the mean distance of points to their patches and the share of points that
    support one change by less than this share. A positive number; by default 0.01."""

    min_probability: Annotated[float | None, Parameter(group=PLANES)] = None
    """Least probability that a patch is one surface, from what the likelihood loses without it, how
    its points spread about its plane, whether it is bent, how much of its rectangle is filled, what
    is beside it, and its size. A number from 0 to 1; by default 0.6."""

    n_neurons: Annotated[int | None, Parameter(group=GAS), WHOLE] = None
    """Number of neurons at which the network stops growing. An integer from 2 to 2^26; by default
    one for each cell that holds points, its side twice the tolerance: two spacings, or three
    standard deviations of the noise."""

    patterns: Annotated[int | None, Parameter(group=GAS), WHOLE] = None
    """Signals per inserted neuron (lambda, the paper's patterns). An integer from 1 to below 2^32;
    by default 20, or 300 where no `polish` follows or growth ends by `target_error`."""

    polish: Annotated[int | None, Parameter(group=GAS), WHOLE] = None
    """Rounds of k-means over all points after growth (none of the published steps). An integer from
    0 to 10000; by default 10."""

    epsilon_w: Annotated[float | None, Parameter(group=GAS)] = None
    """Share of the way to the signal that the winner moves (epsilon_w, also epsilon_b). A number
    above 0 and at most 1; by default 0.2."""

    epsilon_n: Annotated[float | None, Parameter(group=GAS)] = None
    """Share of the way to the signal that the winner's neighbours move (epsilon_n). A number from 0
    to 1; by default 0.006."""

    alpha: Annotated[float | None, Parameter(group=GAS)] = None
    """Factor of the errors of the two neurons that a new one is put between (alpha). A number above
    0 and below 1; by default 0.5."""

    beta: Annotated[float | None, Parameter(group=GAS)] = None
    """Share of every error that is forgotten with each signal (beta, 1 - d). A number from 0 to
    0.5; by default 0.5 divided by the number of neurons, the same memory per neuron for any number;
    0.005 in the published method."""

    max_age: Annotated[int | None, Parameter(group=GAS), WHOLE] = None
    """Age above which an edge is removed (a_max). An integer from 1 to 2^30; by default 50."""

    target_error: Annotated[float | None, Parameter(group=GAS)] = None
    """Mean distance of signals to their winners at which the network stops growing before it has
    all its neurons. A number from 1e-9 to 1e9 metres; by default it grows until it has all its
    neurons."""

    passes: Annotated[float | None, Parameter(group=GAS)] = None
    """Number of signals as a multiple of the number of points. A number above 0 and at most 1e6; by
    default `patterns` signals per neuron."""

    position_step: Annotated[float | None, Parameter(group=GAS)] = None
    """Rounding of positions, taken to the next power of two below. A number from 1e-9 to 1e9
    metres; by default a sixteenth of the mean edge."""

    search: Annotated[Literal["indexed", "brute-force"] | None, Parameter(group=GAS)] = None
    """How winners are found. 'indexed' or 'brute-force'; by default indexed."""

    def given(self) -> dict[str, Any]:
        """The options that were given; names with commas between them as lists."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        for name in NAMES.intersection(given):
            given[name] = [part.strip() for part in given[name].split(",") if part.strip()]
        return given


LEARN_OPTIONS = LearnOptions()
