//! How large a scene may be.

use surfabet_geom::PointCloud;

use crate::error::{Error, Result};
use crate::start::rounded;

/// Largest distance of any point from the cloud's origin along each axis, metres.
///
/// # Errors
/// [`Error::EmptyCloud`].
pub(crate) fn reach(cloud: &PointCloud) -> Result<[f64; 3]> {
    let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
    let origin = cloud.origin();
    Ok(std::array::from_fn(|a| (low[a] - origin[a]).abs().max((high[a] - origin[a]).abs())))
}

/// The error for an option whose `value` is too small for a scene that reaches `extent` metres, where it would have to be
/// `least`.
pub(crate) fn too_small(option: &'static str, value: f64, least: f64, extent: f64) -> Error {
    // More by up to a hundredth, so that what is shown with three digits is enough.
    let least = short(1.005 * least);
    let requirement =
        format!("at least {least} metres for a scene of {} m; or split the cloud", short(extent));
    Error::invalid(option, value, requirement)
}

/// A length with three digits, and an exponent where those are not all.
fn short(length: f64) -> String {
    match rounded(length) {
        rounded if (1e-6..1e6).contains(&rounded) => rounded.to_string(),
        rounded => format!("{rounded:e}"),
    }
}

/// Refuses a `resolution` too small for an `extent`: beyond what single precision or `cells`, the largest extent in pixels
/// of the integers that places are stored in, leave exact.
///
/// # Errors
/// [`Error::InvalidParameter`].
pub(crate) fn check_extent(extent: f64, resolution: f64, cells: f64) -> Result<()> {
    // Single precision must still resolve a twentieth of a pixel at the far end, which also bounds the number of
    // half-pixel cells along an axis by 2^21.
    let least = extent / cells.min(0.05 * f64::from(1 << 23));
    if resolution < least {
        return Err(too_small("resolution", resolution, least, extent));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resolution_that_is_as_large_as_the_error_asks_for_is_taken() {
        for (extent, resolution) in [(900.0, 1e-4), (1e9, 0.01), (1e-3, 1e-9), (7.77e5, 0.1)] {
            let Err(Error::InvalidParameter(error)) = check_extent(extent, resolution, 2e5) else {
                panic!("{extent} at {resolution}");
            };
            assert_eq!((error.name, error.value), ("resolution", resolution.to_string()));
            let words = error.requirement.strip_prefix("at least ").unwrap();
            let least: f64 = words.split(' ').next().unwrap().parse().unwrap();
            assert!(check_extent(extent, least, 2e5).is_ok(), "{least}");
            assert!(check_extent(extent, 0.98 * least, 2e5).is_err(), "{least}");
        }
    }
}
