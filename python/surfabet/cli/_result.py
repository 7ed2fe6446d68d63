"""What `surfabet compress` prints at the end."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import surfabet
from surfabet.cli._files import size_on_disk
from surfabet.cli._format import bytes_text, length_text, peak_memory, points_text, raw_bytes
from surfabet.io._crs import unit_of
from surfabet.learning import LearningReport, note_of


@dataclass
class Result:
    """Sizes, error and seconds of one compression."""

    input: Path
    output: Path
    unit: str = "m"
    n_points: int = 0
    raw_bytes: int = 0
    n_bytes: int = 0
    quality: surfabet.Quality | None = None
    within: float | None = None
    """Distance of inliers; None where it grows with the range, or was not asked for."""
    report: LearningReport | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def of(self, cloud: surfabet.PointCloud) -> None:
        """Notes the size of the cloud, and the unit of its lengths."""
        self.unit = unit_of(cloud)
        self.n_points = len(cloud)
        self.raw_bytes = raw_bytes(len(cloud), cloud.colors is not None)

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "unit": self.unit,
            "input": {
                "path": str(self.input),
                "points": self.n_points,
                "raw_bytes": self.raw_bytes,
                "bytes_on_disk": size_on_disk(self.input),
            },
            "output": {"path": str(self.output), "bytes": self.n_bytes},
            "ratio": self.raw_bytes / self.n_bytes,
            "bits_per_point": 8 * self.n_bytes / self.n_points,
            "quality": self.quality and self.quality.as_dict(),
            "seconds": self.seconds,
            "peak_memory_bytes": peak_memory(),
            "report": self.report and self.report.as_dict(),
        }

    def chosen(self) -> str | None:
        """The options that follow from the data, and why, for people."""
        has_chosen = self.report is not None and bool(self.report.chosen)
        return f"{self.input}: by the data: {self.note()}" if has_chosen else None

    def note(self) -> str:
        """The options that follow from the data, and why, as the file keeps them."""
        return note_of({} if self.report is None else self.report.chosen, self.unit)

    def line(self) -> str:
        """For people."""
        parts = [
            points_text(self.n_points),
            f"{bytes_text(self.raw_bytes)} -> {bytes_text(self.n_bytes)}",
            f"ratio {self.raw_bytes / self.n_bytes:.3g}",
        ]
        if (quality := self.quality) is not None:
            rmse, pooled = (
                length_text(error, self.unit) for error in (quality.rmse, quality.rmse_pooled)
            )
            parts.append(f"rmse {rmse} (pooled {pooled})")
            if quality.inliers is not None and quality.outliers is not None:
                within = "sigma" if self.within is None else length_text(self.within, self.unit)
                parts.append(
                    f"inliers {quality.inliers:.2%}, outliers {quality.outliers:.2%} "
                    f"(within {within})"
                )
            if quality.color_rmse_pooled is not None:
                parts.append(f"colour rmse {quality.color_rmse_pooled:.3g}")
            for name, errors in quality.attributes.items():
                value = errors.pooled
                error = f"{value:.2%} equal" if errors.labels else f"rmse {value:.3g}"
                parts.append(f"{name} {error}")
        encoding = sum(self.seconds[stage] for stage in ("read", "learn", "write"))
        return f"{self.output}: {', '.join(parts)}, {encoding:.1f} s"
