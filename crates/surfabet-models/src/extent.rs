//! How large a scene may be.

use surfabet_geom::PointCloud;

use crate::error::{Error, Result};

/// Largest distance of any point from the cloud's origin along each axis, metres.
///
/// # Errors
/// [`Error::EmptyCloud`].
pub(crate) fn reach(cloud: &PointCloud) -> Result<[f64; 3]> {
    let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
    let origin = cloud.origin();
    Ok(std::array::from_fn(|a| (low[a] - origin[a]).abs().max((high[a] - origin[a]).abs())))
}

/// Refuses an `extent` beyond what single precision or `cells`, the largest extent in pixels of the integers that
/// places are stored in, leave exact.
///
/// # Errors
/// [`Error::TooLarge`].
pub(crate) fn check_extent(extent: f64, resolution: f64, cells: f64) -> Result<()> {
    // Single precision must still resolve a twentieth of a pixel at the far end, which also bounds the number of
    // half-pixel cells along an axis by 2^21.
    let limit = resolution * cells.min(0.05 * f64::from(1 << 23));
    if extent > limit {
        return Err(Error::TooLarge { extent, limit, resolution });
    }
    Ok(())
}
