//! How the sides of surfaces are known, and decoded points that carry it in the same way as those of a scan.

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, PointCloud, Survey, Viewpoints};

use crate::error::{Error, Result};

/// How far before a decoded point its viewpoint is put, metres: the direction alone counts.
const ARM: f64 = 1.0;

/// What of a scan gives the sides of its surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Views {
    /// Nothing.
    #[default]
    None,
    /// Where points were measured from.
    Viewpoints,
    /// Normals, where surfaces lie close behind one another.
    Normals,
}

impl Views {
    /// What gives them in a cloud of which the survey is known.
    pub(super) fn of(cloud: &PointCloud, survey: &Survey) -> Self {
        if cloud.viewpoints().is_some() {
            return Self::Viewpoints;
        }
        let by_normals = survey.has_facings && survey.layer_gap.is_some();
        if by_normals && cloud.normals().is_some() { Self::Normals } else { Self::None }
    }

    /// The cloud with what gives the sides, and without what does not: decoded points and those of a scan alike.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a cloud that does not know the sides of its surfaces where a map does.
    pub fn unified(self, cloud: &PointCloud) -> Result<PointCloud> {
        let mut parts = cloud.clone().into_parts();
        match self {
            Self::None => (parts.viewpoints, parts.normals) = (None, None),
            Self::Viewpoints => {
                if parts.viewpoints.is_none() {
                    let normals = parts.normals.take().ok_or_else(no_sides)?;
                    parts.viewpoints = Some(before(&parts, &normals));
                }
                parts.normals = None;
            }
            Self::Normals => {
                parts.normals = Some(cloud.facing().ok_or_else(no_sides)?);
                parts.viewpoints = None;
            }
        }
        Ok(PointCloud::from_parts(parts)?.0)
    }
}

fn no_sides() -> Error {
    let requirement = "with viewpoints or normals, as the scans that the map was learned from: they give the sides of surfaces";
    Error::invalid("cloud", "one without", requirement)
}

/// A viewpoint for each point, in the direction of its normal.
fn before(parts: &CloudParts, normals: &[[f32; 3]]) -> Viewpoints {
    let origins = parallel::map_range(normals.len(), |i| {
        let world = |a: usize| {
            let local = f64::from(parts.positions[i][a]) + ARM * f64::from(normals[i][a]);
            parts.origin[a] + local
        };
        [world(0), world(1), world(2)]
    });
    Viewpoints { index: (0..origins.len() as u32).collect(), origins }
}
