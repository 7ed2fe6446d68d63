"""What a cloud says about itself: spacing, noise, layers, extent and outliers.

Options that are not given follow from these figures.
"""

from __future__ import annotations

from surfabet import _core
from surfabet._core import PointCloud, Survey
from surfabet._progress import Progress, progress_callback

__all__ = ["Survey", "survey"]


def survey(cloud: PointCloud, *, progress: Progress = None) -> Survey:
    """Measure a cloud, as every learn function does before anything else.

    All figures are medians or quantiles over a sample of the points; they depend on the
    cloud alone.

    Parameters
    ----------
    cloud
        The points.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    Survey
        `spacing`, the median distance of a point to the nearest one at another place, or
        `rounding`, the step that coordinates were rounded to, where that is more; `noise`, the
        median standard deviation of neighbouring points about their plane; `layer_gap`, the
        distance of surfaces that lie close behind one another, or None; `line_spacing`, the
        distance from a point to the next scan line, or None where points are not on lines;
        `tolerance`, two spacings or three times the noise where that is more: how far a decoded
        cloud may be from a point and still show it; `bounds`, the box around all points but the
        outliers, or None without points; all in metres. `has_facings`: whether it is known which
        way surfaces face, by viewpoints or by normals that somebody oriented. `outliers` and
        `strays` are (k,) numbers of points: those of small groups far from all others, and of these
        the ones that would make the scene many times as large as it is.

    Examples
    --------
    >>> import numpy as np
    >>> import surfabet as sb
    >>> side = 0.01 * np.arange(50)
    >>> square = np.stack([*np.meshgrid(side, side), np.zeros((50, 50))], axis=-1)
    >>> found = sb.survey(sb.PointCloud(square.reshape(-1, 3)))
    >>> f"{found.spacing:.3f} {found.tolerance:.3f} {len(found.outliers)}"
    '0.010 0.020 0'
    """
    with progress_callback(progress) as callback:
        return _core.survey(cloud, progress=callback)
