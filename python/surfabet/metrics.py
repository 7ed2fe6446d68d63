"""How close a decoded cloud is to the one it was made from."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

from surfabet import _core
from surfabet._checks import check_cloud, check_integer, check_number
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.io._crs import unit_of
from surfabet.io._units import small_lengths

__all__ = ["AttributeErrors", "Quality", "RangeSigma", "evaluate"]

BYTES_PER_POINT = 12
BYTES_PER_COLORED_POINT = 15


@dataclass(frozen=True, slots=True)
class RangeSigma:
    """A tolerance that grows with the distance from the sensor.

    It is sigma_scale * tan(angular_resolution / 2) * range: eq. 13 of the alphabet paper.
    """

    sigma_scale: float
    """The factor lambda."""
    angular_resolution: float
    """The angle alpha between neighbouring beams, degrees."""


@dataclass(frozen=True, slots=True)
class AttributeErrors:
    """How far an attribute is off, over the same pairs as the distances.

    Labels, which are integers of at most 32 different values in the reference, have the share of
    pairs that agree; all others the root mean square difference in their own unit.
    """

    labels: bool
    """Whether the numbers are shares of equal labels."""
    forward: float
    """Over the decoded points."""
    backward: float
    """Over the reference points."""
    pooled: float
    """Over the pairs of both directions."""


@dataclass(frozen=True, slots=True)
class Quality:
    """All measures of one comparison; lengths in `unit`, and 0 to 255 for colours.

    "forward" takes every decoded point to its nearest reference point, "backward" every reference
    point to its nearest decoded point, "pooled" is over the pairs of both. What does not apply is
    None.
    """

    reference_points: int
    """Number of points of the reference."""
    decoded_points: int
    """Number of decoded points."""
    rmse: float
    """The larger of `rmse_forward` and `rmse_backward`: the figure for comparisons."""
    rmse_forward: float
    """Root mean square distance of decoded points."""
    rmse_backward: float
    """Root mean square distance of reference points."""
    rmse_pooled: float
    """Root mean square distance over both: the papers' figure. Decoding more points lowers it."""
    mean_forward: float
    """Mean distance of decoded points."""
    mean_backward: float
    """Mean distance of reference points."""
    p95_forward: float
    """The smallest distance that 95 percent of the decoded points do not exceed."""
    p95_backward: float
    """The smallest distance that 95 percent of the reference points do not exceed."""
    p99_forward: float
    """The smallest distance that 99 percent of the decoded points do not exceed."""
    p99_backward: float
    """The smallest distance that 99 percent of the reference points do not exceed."""
    max_forward: float
    """Largest distance of a decoded point."""
    max_backward: float
    """Largest distance of a reference point."""
    plane_rmse_forward: float | None
    """As `rmse_forward`, along the reference's normals."""
    plane_rmse_backward: float | None
    """As `rmse_backward`, along the reference's normals."""
    plane_rmse_pooled: float | None
    """As `rmse_pooled`, along the reference's normals."""
    color_rmse_forward: float | None
    """Root mean square colour difference of decoded points over the three channels."""
    color_rmse_backward: float | None
    """Root mean square colour difference of reference points over the three channels."""
    color_rmse_pooled: float | None
    """Root mean square colour difference over both."""
    psnr_peak: float
    """Peak of both PSNRs: the diagonal of the reference's bounding box if not given."""
    d1_psnr: float
    """Point-to-point PSNR in dB, 20 log10(psnr_peak / rmse)."""
    d2_psnr: float | None
    """Point-to-plane PSNR in dB, of the worse direction."""
    inliers: float | None
    """Share of the reference points with a decoded point within sigma."""
    outliers: float | None
    """Share of the decoded points without a reference point within sigma."""
    attributes: dict[str, AttributeErrors] = field(default_factory=dict)
    """Errors by name of intensities and further attributes that both clouds have. Pairs with a
    value that is not finite are left out."""
    bytes: int | None = None
    """Size of the file that was decoded."""
    unit: str = "m"
    """Unit of all lengths: metres, unless the reference has a coordinate reference system of
    another, such as `us-ft`."""

    @property
    def bits_per_point(self) -> float | None:
        """Bits of the file per reference point."""
        return None if self.bytes is None else 8 * self.bytes / self.reference_points

    @property
    def ratio(self) -> float | None:
        """How many times smaller than the raw reference the file is.

        Raw are 12 bytes per point, or 15 where both clouds have colours.
        """
        if not self.bytes:
            return None
        colored = self.color_rmse_pooled is not None
        raw = BYTES_PER_COLORED_POINT if colored else BYTES_PER_POINT
        return raw * self.reference_points / self.bytes

    def as_dict(self) -> dict[str, Any]:
        """All measures by name, for JSON and tables."""
        derived = {"bits_per_point": self.bits_per_point, "ratio": self.ratio}
        return dataclasses.asdict(self) | derived

    def __repr__(self) -> str:
        factor, unit = small_lengths(self.unit)

        def in_unit(length: float) -> str:
            return f"{factor * length:.2f} {unit}"

        parts = [
            f"rmse {in_unit(self.rmse)} (forward {in_unit(self.rmse_forward)}, "
            f"backward {in_unit(self.rmse_backward)}, pooled {in_unit(self.rmse_pooled)})",
            f"p95 {in_unit(self.p95_forward)} / {in_unit(self.p95_backward)}",
            f"max {in_unit(self.max_forward)} / {in_unit(self.max_backward)}",
        ]
        if self.color_rmse_pooled is not None:
            parts.append(f"colour rmse {self.color_rmse_pooled:.1f}")
        for name, errors in self.attributes.items():
            error = f"{errors.pooled:.2%} equal" if errors.labels else f"rmse {errors.pooled:.4g}"
            parts.append(f"{name} {error}")
        if self.inliers is not None:
            parts.append(f"inliers {self.inliers:.2%}")
        if self.outliers is not None:
            parts.append(f"outliers {self.outliers:.2%}")
        if self.bytes is not None:
            parts.append(f"{self.bytes} bytes, {self.bits_per_point:.3f} bits per point")
        points = f"{self.decoded_points} of {self.reference_points} points"
        return f"Quality({points}; {'; '.join(parts)})"


def evaluate(
    reference: PointCloud,
    decoded: PointCloud,
    *,
    sigma: float | RangeSigma | None = None,
    bytes: int | None = None,
    peak: float | None = None,
    normal_neighbors: int | None = 16,
    progress: Progress = None,
) -> Quality:
    """Compare `decoded` with `reference`, which it was made from.

    Every point of both clouds is queried, none is sampled; clouds with different origins meet in
    double precision.

    Parameters
    ----------
    reference
        The input of the compression. Its unit is that of all lengths, and of the decoded cloud.
    decoded
        What came back.
    sigma
        Reports inliers and outliers: a distance, or a `RangeSigma` where the reference
        knows its ranges or viewpoints.
    bytes
        Size of the file, for bits per point and ratio.
    peak
        Peak of the PSNR, a length; the diagonal of the reference's bounding box if not given.
        MPEG's `pc_error` computes 10 log10(3 p^2 / mse): give sqrt(3) p for its figure.
    normal_neighbors
        Where the reference has no normals, planes are fitted to this number of its points around
        each decoded point. None leaves point-to-plane out then, which is faster.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        When a cloud is empty or an option makes no sense.
    """
    check_cloud("reference", reference)
    check_cloud("decoded", decoded)
    if bytes is not None:
        check_integer("bytes", bytes, 0)
    if normal_neighbors is not None:
        check_integer("normal_neighbors", normal_neighbors, 3)
    if peak is not None:
        check_number("peak", peak, "a positive number of metres", above=0.0)
    distance: float | None = None
    by_range: tuple[float, float] | None = None
    if isinstance(sigma, RangeSigma):
        scale, angle = sigma.sigma_scale, sigma.angular_resolution
        below = math.nextafter(180.0, 0.0)
        requirement = "a number above 0 and below 180 degrees"
        by_range = (
            check_number("sigma.sigma_scale", scale, "a positive number", above=0.0),
            check_number("sigma.angular_resolution", angle, requirement, above=0.0, most=below),
        )
    elif sigma is not None:
        requirement = "a positive number of metres, or a RangeSigma"
        distance = check_number("sigma", sigma, requirement, above=0.0)
    with progress_callback(progress) as callback:
        measures = _core.evaluate(
            reference, decoded, distance, by_range, peak, normal_neighbors, callback
        )
    attributes = {name: AttributeErrors(*of) for name, *of in measures.pop("attributes")}
    return Quality(**measures, attributes=attributes, bytes=bytes, unit=unit_of(reference))
