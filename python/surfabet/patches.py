"""Learning surface patches: the front door of both methods.

`surfabet.lattice` holds the models of "rate-distortion", `surfabet.hscsm` those of "hscsm".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, overload

from surfabet import hscsm, lattice
from surfabet._core import PointCloud
from surfabet._progress import Progress
from surfabet.errors import InvalidInputError
from surfabet.hscsm import HscsmModel
from surfabet.lattice import PatchModel

__all__ = ["learn_patches"]


@overload
def learn_patches(
    cloud: PointCloud,
    *,
    method: Literal["rate-distortion"] = ...,
    resolution: float = ...,
    levels: int = ...,
    max_error: float | None = ...,
    rate: float = ...,
    depth_step: float = ...,
    rounds: int = ...,
    color_step: int = ...,
    chroma_ratio: float = ...,
    color_rate: float = ...,
    sensor: Literal["structured-light", "constant"] = ...,
    random_state: int = ...,
    progress: Progress = ...,
) -> PatchModel: ...
@overload
def learn_patches(
    cloud: PointCloud,
    *,
    method: Literal["hscsm"],
    resolution: float = ...,
    patch_pixels: int = ...,
    levels: int = ...,
    max_depth_deviation: float | None = ...,
    max_color_deviation: float = ...,
    min_coverage: float = ...,
    placement: Literal["greedy", "subsampled"] = ...,
    depth_atoms: int = ...,
    color_atoms: int = ...,
    depth_sparsity: int = ...,
    color_sparsity: int = ...,
    depth_tolerance: float | None = ...,
    color_tolerance: float = ...,
    iterations: int = ...,
    sensor: Literal["structured-light", "constant"] = ...,
    random_state: int = ...,
    progress: Progress = ...,
) -> HscsmModel: ...
def learn_patches(
    cloud: PointCloud,
    *,
    method: Literal["rate-distortion", "hscsm"] = "rate-distortion",
    progress: Progress = None,
    **options: Any,
) -> PatchModel | HscsmModel:
    """Learns a model of surface patches from a cloud.

    Two methods share the idea of patches with depth, colour and bitmask on several levels:

    "rate-distortion", the default, lays patches along the scene's own axes on one lattice and says
    of each what costs least, bits against squared error. It keeps the thickness of the scan, and
    makes files that are many times smaller.

    "hscsm" is the published method: free poses, fixed thresholds between levels, codes over
    learned dictionaries; one level is SCSM. Its dictionaries can describe other clouds.

    Parameters
    ----------
    cloud
        What to describe. Colours are kept when present; ranges weight the points by the depth
        error of their sensor; viewpoints tell the two sides of a thin wall apart.
    method
        "rate-distortion" or "hscsm".
    resolution
        Side of a pixel of the finest level, metres, by default 0.01: smaller detail is lost. The
        one knob between size and error; all else follows it.
    levels
        Levels of the hierarchy; above the finest, pixels and patches double in size from level to
        level. 1 to 4, by default 2, for "rate-distortion"; 1 to 8, by default 1, for "hscsm".
    sensor
        How the error of a range measurement grows: "structured-light" (with the square of the
        distance, as Kinects do) or "constant". Without ranges all points weigh the same.
    random_state
        Seed of the dictionaries' first entries. "rate-distortion" leaves nothing to chance, so that
        every seed gives the same.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Of "rate-distortion":

    max_error
        No input point is further than this from the cloud decoded as measured at
        the default spacing, metres; points that would be are kept beside the patches.
    rate
        What a bit of geometry must save (lambda): squared error in squared pixels, summed over
        pixels; by default 1.4. Larger makes smaller files.
    depth_step
        Rounding of depths, pixels of the finest level, by default 0.75.
    rounds
        How often patches are chosen, each time with the prices that the round
        before taught, 1 to 10, by default 3.
    color_step
        Rounding of luma, grey levels of a single cell, by default 90; means over n cells are
        rounded about sqrt(n) times finer.
    chroma_ratio
        Rounding of chroma as a multiple of luma's, by default 1.5.
    color_rate
        What a bit of colour must save, squared colour steps, by default 0.15.

    Of "hscsm":

    patch_pixels
        Pixels per side of a patch, 2 to 32.
    max_depth_deviation
        Largest standard deviation of depth in a pixel, metres (rho_max_depth); by default
        `resolution` / sqrt(3). What deviates more goes to the level below; the lowest level takes
        all.
    max_color_deviation
        Largest standard deviation of colour in a pixel, root mean square over channels, 0..255
        (rho_max_rgb).
    min_coverage
        Fraction of its pixels that a patch must cover, or the level below describes its surface.
    placement
        "greedy": best coverage first, then aligned neighbours; "subsampled": a patch per cube, as
        SCSM does, to compare with.
    depth_atoms, color_atoms
        Most entries of the dictionaries of each level; those that no patch uses are dropped.
    depth_sparsity, color_sparsity
        Most dictionary entries that describe one patch (k of eq. 1), 1 to 64.
    depth_tolerance
        Coding of a patch's depth ends at this root mean square error on the lowest level, metres;
        by default a fifth of `resolution`. Each level above has half the tolerance of the one
        below, since its errors spread over larger patches.
    color_tolerance
        As `depth_tolerance` for colour, 0..255.
    iterations
        Most iterations of weighted K-SVD per dictionary.

    Returns
    -------
    PatchModel or HscsmModel
        The same for the same cloud, options and seed, whatever the number of threads.

    Raises
    ------
    InvalidInputError
        For an empty cloud, options outside their domain or of the other method, or a scene too
        large for its resolution.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> u, v = np.meshgrid(np.arange(0, 1, 0.005), np.arange(0, 1, 0.005))
    >>> wall = sb.PointCloud(np.stack([u.ravel(), np.zeros(u.size), v.ravel()], axis=1))
    >>> model = sb.learn_patches(wall, resolution=0.01)
    >>> bool(np.abs(model.decode().points[:, 1]).max() < 0.002)
    True
    >>> len(model.to_bytes()) < 300
    True
    """
    check_options(method, options)
    return LEARNERS[method](cloud, progress=progress, **options)


LEARNERS: dict[str, Callable[..., PatchModel | HscsmModel]] = {
    "rate-distortion": lattice.learn,
    "hscsm": hscsm.learn,
}


def check_options(method: str, options: dict[str, Any]) -> None:
    """Refuses options that the method does not have, naming the one that has them."""
    if method not in LEARNERS:
        known = " or ".join(f'"{name}"' for name in LEARNERS)
        raise InvalidInputError(f"method is {method!r}, but must be {known}")
    for name, value in options.items():
        if name not in _options(LEARNERS[method]) | {"progress"}:
            owner = next((m for m, f in LEARNERS.items() if name in _options(f)), None)
            hint = f'; method="{owner}" has' if owner else ""
            raise InvalidInputError(f'method="{method}" has no option {name!r}{hint}')
        if isinstance(value, int | float) and value < 0:
            raise InvalidInputError(f"{name} is {value}, but must not be negative")


def _options(learner: Callable[..., Any]) -> set[str]:
    """Names of the options that users may give."""
    return {*(learner.__kwdefaults__ or {})} - {"dictionary", "progress"}
