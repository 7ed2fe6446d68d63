//! The point cloud: local `f32` positions about an `f64` origin, and what the scanner knew of each point.

use surfabet_base::parallel;

use crate::attribute::{self, Column, Extra, pick, retain_by};
use crate::error::{Error, Result};
use crate::vector::{distance, length, minus};

/// Largest absolute coordinate, in metres, that is stored without an origin of its own. An `f32` of this size
/// still resolves 0.06 mm, and clouds below it (rooms, buildings, single scans) keep their `f32` bits exactly.
pub const LARGEST_UNSHIFTED: f64 = 1000.0;

/// Largest distance from the middle of the bounding box, metres, at which it is a good origin: an `f32` of this size
/// resolves 0.5 mm.
const LARGEST_ABOUT_MIDDLE: f64 = 8000.0;

/// Where each point was measured from: a short table of sensor origins and one index into it per point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Viewpoints {
    /// Sensor origins in world coordinates, metres.
    pub origins: Vec<[f64; 3]>,
    /// For each point, its row in `origins`.
    pub index: Vec<u32>,
}

/// The columns of a cloud before they are checked. All but `positions` may be absent.
#[derive(Debug, Clone, Default)]
pub struct CloudParts {
    /// World position of the local origin, metres.
    pub origin: [f64; 3],
    /// Positions relative to `origin`, metres.
    pub positions: Vec<[f32; 3]>,
    /// Red, green, blue, 0 to 255.
    pub colors: Option<Vec<[u8; 3]>>,
    /// Return strength in the sensor's own unit.
    pub intensities: Option<Vec<f32>>,
    /// Unit normals; zero where unknown.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Distance from the sensor that measured the point, metres; zero where unknown.
    pub ranges: Option<Vec<f32>>,
    /// Where the sensor stood.
    pub viewpoints: Option<Viewpoints>,
    /// Any other attribute by name, in the order of the file.
    pub extra: Extra,
    /// The coordinate reference system, as WKT or as a code like `EPSG:25832`; nothing here interprets it.
    pub crs: Option<String>,
}

/// What construction left out of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DroppedValues {
    /// Points with a NaN or infinite coordinate, left out.
    pub points: usize,
    /// Normals, ranges and intensities that were not finite, set to zero ("unknown").
    pub attributes: usize,
}

/// An unordered set of measured points with optional attributes.
///
/// Invariants: every coordinate is finite; every attribute has one value per point; every viewpoint index has
/// its origin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointCloud {
    origin: [f64; 3],
    positions: Vec<[f32; 3]>,
    colors: Option<Vec<[u8; 3]>>,
    intensities: Option<Vec<f32>>,
    normals: Option<Vec<[f32; 3]>>,
    ranges: Option<Vec<f32>>,
    viewpoints: Option<Viewpoints>,
    extra: Extra,
    crs: Option<String>,
}

fn check_len(attribute: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::LengthMismatch { attribute: attribute.into(), found, expected })
    }
}

/// The median of each coordinate, rounded to whole metres; zero where all three are within [`LARGEST_UNSHIFTED`].
fn origin_of_most(world: &[[f64; 3]]) -> [f64; 3] {
    let median = |axis: usize| {
        let finite = world.iter().filter(|p| p.iter().all(|c| c.is_finite()));
        let mut values: Vec<f64> = finite.map(|p| p[axis]).collect();
        let middle = values.len() / 2;
        let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
        median.round()
    };
    let middle = [median(0), median(1), median(2)];
    if middle.iter().all(|c| c.abs() <= LARGEST_UNSHIFTED) { [0.0; 3] } else { middle }
}

fn zero_unless_finite<const N: usize>(values: &mut [[f32; N]]) -> usize {
    let mut changed = 0;
    for value in values.iter_mut().filter(|v| v.iter().any(|c| !c.is_finite())) {
        *value = [0.0; N];
        changed += 1;
    }
    changed
}

impl CloudParts {
    /// Refuses columns of different lengths, and indices of viewpoints that do not exist.
    fn check(&self) -> Result<()> {
        let n = self.positions.len();
        if self.origin.iter().any(|c| !c.is_finite()) {
            return Err(Error::invalid("origin", format!("{:?}", self.origin), "finite"));
        }
        if let Some(colors) = &self.colors {
            check_len("colors", colors.len(), n)?;
        }
        if let Some(intensities) = &self.intensities {
            check_len("intensities", intensities.len(), n)?;
        }
        if let Some(normals) = &self.normals {
            check_len("normals", normals.len(), n)?;
        }
        if let Some(ranges) = &self.ranges {
            check_len("ranges", ranges.len(), n)?;
        }
        if let Some(viewpoints) = &self.viewpoints {
            check_len("viewpoint index", viewpoints.index.len(), n)?;
            let len = viewpoints.origins.len();
            if let Some(&index) = viewpoints.index.iter().find(|&&i| i as usize >= len) {
                return Err(Error::IndexOutOfRange {
                    name: "viewpoint",
                    index: index as usize,
                    len,
                });
            }
            if let Some(o) = viewpoints.origins.iter().find(|o| o.iter().any(|c| !c.is_finite())) {
                return Err(Error::invalid("viewpoint", format!("{o:?}"), "finite"));
            }
        }
        attribute::check(&self.extra, n)
    }

    /// Drops points whose position is not finite; other values that are not finite become zero.
    fn drop_what_is_not_finite(&mut self) -> DroppedValues {
        let mut dropped = DroppedValues::default();
        let keep: Vec<bool> =
            self.positions.iter().map(|p| p.iter().all(|c| c.is_finite())).collect();
        dropped.points = keep.iter().filter(|&&k| !k).count();
        if dropped.points > 0 {
            retain_by(&mut self.positions, &keep);
            if let Some(v) = &mut self.colors {
                retain_by(v, &keep);
            }
            if let Some(v) = &mut self.intensities {
                retain_by(v, &keep);
            }
            if let Some(v) = &mut self.normals {
                retain_by(v, &keep);
            }
            if let Some(v) = &mut self.ranges {
                retain_by(v, &keep);
            }
            if let Some(v) = &mut self.viewpoints {
                retain_by(&mut v.index, &keep);
            }
            for (_, column) in &mut self.extra {
                column.retain(&keep);
            }
        }
        if let Some(v) = &mut self.normals {
            dropped.attributes += zero_unless_finite(v);
        }
        for column in [&mut self.ranges, &mut self.intensities].into_iter().flatten() {
            dropped.attributes += zero_unless_finite(column.as_chunks_mut::<1>().0);
        }
        dropped
    }
}

impl PointCloud {
    /// Checks the columns, drops points that are not finite and counts what it dropped.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] when a column does not have one value per point,
    /// [`Error::IndexOutOfRange`] for a viewpoint index without origin, and [`Error::InvalidParameter`] when
    /// the origin or a viewpoint is not finite, or the name of an extra column is empty, given twice or one of
    /// [`RESERVED_NAMES`](crate::RESERVED_NAMES).
    pub fn from_parts(mut parts: CloudParts) -> Result<(Self, DroppedValues)> {
        parts.check()?;
        let dropped = parts.drop_what_is_not_finite();
        let CloudParts {
            origin,
            positions,
            colors,
            intensities,
            normals,
            ranges,
            viewpoints,
            extra,
            crs,
        } = parts;
        let cloud = Self {
            origin,
            positions,
            colors,
            intensities,
            normals,
            ranges,
            viewpoints,
            extra,
            crs,
        };
        Ok((cloud, dropped))
    }

    /// The columns, to build another cloud from.
    pub fn into_parts(self) -> CloudParts {
        CloudParts {
            origin: self.origin,
            positions: self.positions,
            colors: self.colors,
            intensities: self.intensities,
            normals: self.normals,
            ranges: self.ranges,
            viewpoints: self.viewpoints,
            extra: self.extra,
            crs: self.crs,
        }
    }

    /// A cloud of bare `f32` positions in metres; the origin is zero.
    pub fn from_positions(positions: Vec<[f32; 3]>) -> (Self, DroppedValues) {
        let parts = CloudParts { positions, ..CloudParts::default() };
        // A lone column has nothing to disagree with, and the default origin is finite.
        Self::from_parts(parts).unwrap_or_default()
    }

    /// Splits world coordinates into an origin and local `f32` positions, for [`CloudParts`].
    ///
    /// The origin is zero while no coordinate is beyond [`LARGEST_UNSHIFTED`], so that `f32` input keeps its bits; else it
    /// is the centre of the bounding box rounded to whole metres. Local coordinates up to 8 km from it are
    /// then exact to 0.5 mm. Of a larger box, as a single wrong point makes it, the origin is the median of each
    /// coordinate, or zero where that is within the same limit.
    pub fn split_origin(world: &[[f64; 3]]) -> ([f64; 3], Vec<[f32; 3]>) {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for p in world.iter().filter(|p| p.iter().all(|c| c.is_finite())) {
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        let largest = (0..3).map(|a| low[a].abs().max(high[a].abs())).fold(0.0, f64::max);
        let origin = if largest.is_finite() && largest > LARGEST_UNSHIFTED {
            let half = (0..3).map(|a| 0.5 * (high[a] - low[a])).fold(0.0, f64::max);
            if half <= LARGEST_ABOUT_MIDDLE {
                std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round())
            } else {
                origin_of_most(world)
            }
        } else {
            [0.0; 3]
        };
        let local =
            world.iter().map(|p| std::array::from_fn(|a| (p[a] - origin[a]) as f32)).collect();
        (origin, local)
    }

    /// As [`PointCloud::split_origin`] for world coordinates in single precision, which keep their bits where the
    /// origin is zero.
    pub fn split_origin_single(world: Vec<[f32; 3]>) -> ([f64; 3], Vec<[f32; 3]>) {
        let is_far = |c: &f32| c.is_finite() && f64::from(c.abs()) > LARGEST_UNSHIFTED;
        if !world.iter().flatten().any(is_far) {
            return ([0.0; 3], world);
        }
        let world: Vec<[f64; 3]> = world.into_iter().map(|p| p.map(f64::from)).collect();
        Self::split_origin(&world)
    }

    /// The cloud as measured from one place, in world coordinates: where it has no viewpoints, it gets this one, and
    /// the distances to it where it has no ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a viewpoint that is not finite.
    pub fn seen_from(mut self, viewpoint: [f64; 3]) -> Result<Self> {
        if viewpoint.iter().any(|c| !c.is_finite()) {
            let given = format!("{viewpoint:?}");
            return Err(Error::invalid("viewpoint", given, "three finite coordinates"));
        }
        if self.viewpoints.is_some() {
            return Ok(self);
        }
        if self.ranges.is_none() {
            let range = |i: usize| distance(self.world(i), viewpoint) as f32;
            self.ranges = Some((0..self.len()).map(range).collect());
        }
        self.viewpoints = Some(Viewpoints { origins: vec![viewpoint], index: vec![0; self.len()] });
        Ok(self)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True when there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// World position of the local origin, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Positions relative to [`PointCloud::origin`], metres.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// World position of point `i`, metres.
    pub fn world(&self, i: usize) -> [f64; 3] {
        let p = self.positions[i];
        std::array::from_fn(|a| self.origin[a] + f64::from(p[a]))
    }

    /// Red, green, blue per point.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// Return strength per point, in the sensor's own unit.
    pub fn intensities(&self) -> Option<&[f32]> {
        self.intensities.as_deref()
    }

    /// Unit normal per point; zero where unknown.
    pub fn normals(&self) -> Option<&[[f32; 3]]> {
        self.normals.as_deref()
    }

    /// Distance from the sensor per point, metres; zero where unknown.
    pub fn ranges(&self) -> Option<&[f32]> {
        self.ranges.as_deref()
    }

    /// Where each point was measured from.
    pub fn viewpoints(&self) -> Option<&Viewpoints> {
        self.viewpoints.as_ref()
    }

    /// The other attributes by name, in the order of the file.
    pub fn extra(&self) -> &[(String, Column)] {
        &self.extra
    }

    /// The coordinate reference system, as WKT or as a code like `EPSG:25832`.
    pub fn crs(&self) -> Option<&str> {
        self.crs.as_deref()
    }

    /// Names of the attributes that there are beside the positions.
    pub fn attributes(&self) -> Vec<&str> {
        let present = [
            ("colors", self.colors.is_some()),
            ("intensities", self.intensities.is_some()),
            ("normals", self.normals.is_some()),
            ("ranges", self.ranges.is_some()),
            ("viewpoints", self.viewpoints.is_some()),
        ];
        let builtin = present.into_iter().filter_map(|(name, is)| is.then_some(name));
        builtin.chain(self.extra.iter().map(|(name, _)| name.as_str())).collect()
    }

    /// Where point `i` was measured from, relative to [`PointCloud::origin`].
    pub fn local_viewpoint(&self, i: usize) -> Option<[f32; 3]> {
        let viewpoints = self.viewpoints.as_ref()?;
        let o = viewpoints.origins[viewpoints.index[i] as usize];
        Some(std::array::from_fn(|a| (o[a] - self.origin[a]) as f32))
    }

    /// Unit vectors towards the side that each point was seen from, by its viewpoint or else its normal; zero where
    /// unknown, `None` where the cloud knows of no sides.
    pub fn facing(&self) -> Option<Vec<[f32; 3]>> {
        if self.viewpoints.is_none() {
            return self.normals.clone();
        }
        Some(parallel::map_range(self.len(), |i| self.facing_of(i)))
    }

    /// Unit vector towards the side that point `i` was seen from, as [`PointCloud::facing`]; zero where unknown.
    pub fn facing_of(&self, i: usize) -> [f32; 3] {
        match (self.local_viewpoint(i), &self.normals) {
            (Some(viewpoint), _) => {
                let towards = minus(viewpoint, self.positions[i]);
                let length = length(towards);
                if length > 0.0 { towards.map(|c| c / length) } else { [0.0; 3] }
            }
            (None, Some(normals)) => normals[i],
            (None, None) => [0.0; 3],
        }
    }

    /// Lower and upper corner of the bounding box in world coordinates, metres; `None` without points.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let first = *self.positions.first()?;
        let (low, high) = self.positions.iter().fold((first, first), |(low, high), p| {
            (std::array::from_fn(|a| low[a].min(p[a])), std::array::from_fn(|a| high[a].max(p[a])))
        });
        let world = |p: [f32; 3]| std::array::from_fn(|a| self.origin[a] + f64::from(p[a]));
        Some((world(low), world(high)))
    }

    /// The points at `indices`, in that order, with all their attributes.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`] for an index past the last point.
    pub fn select(&self, indices: &[usize]) -> Result<Self> {
        if let Some(&index) = indices.iter().find(|&&i| i >= self.len()) {
            return Err(Error::IndexOutOfRange { name: "point", index, len: self.len() });
        }
        Ok(Self {
            origin: self.origin,
            positions: pick(&self.positions, indices),
            colors: self.colors().map(|v| pick(v, indices)),
            intensities: self.intensities().map(|v| pick(v, indices)),
            normals: self.normals().map(|v| pick(v, indices)),
            ranges: self.ranges().map(|v| pick(v, indices)),
            viewpoints: self
                .viewpoints
                .as_ref()
                .map(|v| Viewpoints { origins: v.origins.clone(), index: pick(&v.index, indices) }),
            extra: self.extra.iter().map(|(name, c)| (name.clone(), c.select(indices))).collect(),
            crs: self.crs.clone(),
        })
    }

    /// Local positions expressed about another origin.
    ///
    /// Points of two clouds are compared after bringing one to the other's origin with this.
    pub fn positions_about(&self, origin: [f64; 3]) -> Vec<[f32; 3]> {
        let shift: [f64; 3] = std::array::from_fn(|a| self.origin[a] - origin[a]);
        if shift == [0.0; 3] {
            return self.positions.clone();
        }
        self.positions
            .iter()
            .map(|p| std::array::from_fn(|a| (f64::from(p[a]) + shift[a]) as f32))
            .collect()
    }

    /// All points of `clouds` about the first one's origin. An attribute is kept when every cloud that has
    /// points has it, extra columns with the same type, the coordinate reference system where it is the same; the
    /// names of those that had to go are returned beside the cloud.
    pub fn concat(clouds: &[Self]) -> (Self, Vec<String>) {
        let filled: Vec<&Self> = clouds.iter().filter(|c| !c.is_empty()).collect();
        let Some(first) = filled.first() else {
            return (clouds.first().cloned().unwrap_or_default(), Vec::new());
        };
        let mut lost = Vec::new();
        fn join<T: Copy>(
            name: &'static str,
            columns: &[Option<&[T]>],
            lost: &mut Vec<String>,
        ) -> Option<Vec<T>> {
            let present: Vec<&[T]> = columns.iter().flatten().copied().collect();
            if present.len() == columns.len() {
                return Some(present.concat());
            }
            if !present.is_empty() {
                lost.push(name.to_owned());
            }
            None
        }
        let colors =
            join("colors", &filled.iter().map(|c| c.colors()).collect::<Vec<_>>(), &mut lost);
        let intensities = join(
            "intensities",
            &filled.iter().map(|c| c.intensities()).collect::<Vec<_>>(),
            &mut lost,
        );
        let normals =
            join("normals", &filled.iter().map(|c| c.normals()).collect::<Vec<_>>(), &mut lost);
        let ranges =
            join("ranges", &filled.iter().map(|c| c.ranges()).collect::<Vec<_>>(), &mut lost);
        let known: Vec<&Viewpoints> = filled.iter().filter_map(|c| c.viewpoints()).collect();
        let viewpoints = if known.len() == filled.len() {
            let mut all = Viewpoints::default();
            for v in known {
                let base = all.origins.len() as u32;
                all.origins.extend_from_slice(&v.origins);
                all.index.extend(v.index.iter().map(|i| i + base));
            }
            Some(all)
        } else {
            if !known.is_empty() {
                lost.push("viewpoints".to_owned());
            }
            None
        };
        let extras: Vec<_> = filled.iter().map(|c| c.extra()).collect();
        let extra = attribute::joined(&extras, &mut lost);
        let crs = first.crs.clone().filter(|_| filled.iter().all(|c| c.crs == first.crs));
        if crs.is_none() && filled.iter().any(|c| c.crs.is_some()) {
            lost.push("crs".to_owned());
        }
        let positions = filled.iter().flat_map(|c| c.positions_about(first.origin)).collect();
        let cloud = Self {
            origin: first.origin,
            positions,
            colors,
            intensities,
            normals,
            ranges,
            viewpoints,
            extra,
            crs,
        };
        (cloud, lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_and_counts_points_that_are_not_finite() {
        let parts = CloudParts {
            positions: vec![[0.0; 3], [f32::NAN, 0.0, 0.0], [1.0, 2.0, f32::INFINITY], [1.0; 3]],
            colors: Some(vec![[1; 3], [2; 3], [3; 3], [4; 3]]),
            normals: Some(vec![[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [f32::NAN; 3]]),
            ..CloudParts::default()
        };
        let (cloud, dropped) = PointCloud::from_parts(parts).unwrap();
        assert_eq!(dropped, DroppedValues { points: 2, attributes: 1 });
        assert_eq!(cloud.positions(), [[0.0; 3], [1.0; 3]]);
        assert_eq!(cloud.colors().unwrap(), [[1; 3], [4; 3]]);
        assert_eq!(cloud.normals().unwrap(), [[0.0, 0.0, 1.0], [0.0; 3]]);
    }

    #[test]
    fn single_precision_keeps_its_bits_up_to_the_limit() {
        let near = vec![[1000.0, -1000.0, 0.1], [f32::INFINITY, 2.0, 3.0]];
        let (origin, positions) = PointCloud::split_origin_single(near.clone());
        assert_eq!((origin, positions), ([0.0; 3], near));
        let (origin, positions) =
            PointCloud::split_origin_single(vec![[1000.5, 0.0, 0.0], [1002.5, 0.0, 4.0]]);
        assert_eq!(origin, [1002.0, 0.0, 2.0]);
        assert_eq!(positions, [[-1.5, 0.0, -2.0], [0.5, 0.0, 2.0]]);
    }

    #[test]
    fn a_viewpoint_is_given_where_there_is_none() {
        let parts = CloudParts {
            origin: [2000.0, 0.0, 0.0],
            positions: vec![[0.0, 3.0, 4.0], [1.0, 0.0, 0.0]],
            ..CloudParts::default()
        };
        let (cloud, _) = PointCloud::from_parts(parts.clone()).unwrap();
        let seen = cloud.clone().seen_from([2000.0, 0.0, 0.0]).unwrap();
        assert_eq!(seen.ranges().unwrap(), [5.0, 1.0]);
        let viewpoints = seen.viewpoints().unwrap();
        assert_eq!(viewpoints.origins, [[2000.0, 0.0, 0.0]]);
        assert_eq!(viewpoints.index, [0, 0]);
        // What the cloud knows already stays.
        assert_eq!(seen.clone().seen_from([0.0; 3]).unwrap(), seen);
        let ranges = Some(vec![7.0, 8.0]);
        let (cloud, _) = PointCloud::from_parts(CloudParts { ranges, ..parts }).unwrap();
        assert_eq!(cloud.seen_from([0.0; 3]).unwrap().ranges().unwrap(), [7.0, 8.0]);
        assert!(seen.seen_from([f64::NAN, 0.0, 0.0]).is_err());
    }

    #[test]
    fn refuses_columns_of_another_length() {
        let parts = CloudParts {
            positions: vec![[0.0; 3]; 3],
            ranges: Some(vec![1.0; 2]),
            ..CloudParts::default()
        };
        let error = PointCloud::from_parts(parts).unwrap_err();
        assert_eq!(error.to_string(), "ranges has 2 values for 3 points; give one per point");
    }

    #[test]
    fn refuses_a_viewpoint_index_without_origin() {
        let parts = CloudParts {
            positions: vec![[0.0; 3]; 2],
            viewpoints: Some(Viewpoints { origins: vec![[0.0; 3]], index: vec![0, 1] }),
            ..CloudParts::default()
        };
        assert!(matches!(
            PointCloud::from_parts(parts),
            Err(Error::IndexOutOfRange { name: "viewpoint", index: 1, len: 1 })
        ));
    }

    #[test]
    fn utm_coordinates_survive_to_the_millimetre() {
        let world = [[448_262.123, 5_411_932.678, 512.345], [448_905.987, 5_412_100.001, 498.0]];
        let (origin, positions) = PointCloud::split_origin(&world);
        let (cloud, _) =
            PointCloud::from_parts(CloudParts { origin, positions, ..CloudParts::default() })
                .unwrap();
        for (i, expected) in world.iter().enumerate() {
            for (found, expected) in cloud.world(i).iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn small_coordinates_keep_their_bits() {
        let world = [[0.1_f32 as f64, -999.9_f32 as f64, 1e-30_f32 as f64]];
        let (origin, positions) = PointCloud::split_origin(&world);
        assert_eq!(origin, [0.0; 3]);
        assert_eq!(positions, [[0.1, -999.9, 1e-30]]);
    }

    #[test]
    fn concat_brings_clouds_to_one_origin_and_names_what_it_loses() {
        let cloud = |x: f64, colors| {
            PointCloud::from_parts(CloudParts {
                origin: [x, 0.0, 0.0],
                positions: vec![[1.0, 2.0, 3.0]],
                colors,
                ..CloudParts::default()
            })
            .unwrap()
            .0
        };
        let (joined, lost) =
            PointCloud::concat(&[cloud(10.0, Some(vec![[9; 3]])), cloud(30.0, None)]);
        assert_eq!(joined.positions(), [[1.0, 2.0, 3.0], [21.0, 2.0, 3.0]]);
        assert_eq!(lost, ["colors"]);
    }

    #[test]
    fn extra_columns_and_the_reference_system_go_with_their_points() {
        let parts = |crs: &str| CloudParts {
            positions: vec![[0.0; 3], [f32::NAN; 3], [1.0; 3], [2.0; 3]],
            extra: vec![
                ("label".to_owned(), vec![1_u8, 2, 3, 4].into()),
                ("gps_time".to_owned(), vec![0.5, f64::NAN, 1.5, f64::INFINITY].into()),
            ],
            crs: Some(crs.to_owned()),
            ..CloudParts::default()
        };
        let (cloud, dropped) = PointCloud::from_parts(parts("EPSG:25832")).unwrap();
        // Only the cloud's own columns have a value for "unknown".
        assert_eq!(dropped, DroppedValues { points: 1, attributes: 0 });
        assert_eq!(cloud.attributes(), ["label", "gps_time"]);
        let chosen = cloud.select(&[2, 0]).unwrap().seen_from([0.0; 3]).unwrap();
        assert_eq!(chosen.extra()[0], ("label".to_owned(), vec![4_u8, 1].into()));
        assert_eq!(chosen.extra()[1], ("gps_time".to_owned(), vec![f64::INFINITY, 0.5].into()));
        assert_eq!(chosen.crs(), Some("EPSG:25832"));
        assert_eq!(chosen.attributes(), ["ranges", "viewpoints", "label", "gps_time"]);
        let parts_again = cloud.clone().into_parts();
        assert_eq!(PointCloud::from_parts(parts_again).unwrap().0, cloud);

        let (twice, lost) = PointCloud::concat(&[cloud.clone(), cloud.clone()]);
        assert_eq!((twice.crs(), lost), (Some("EPSG:25832"), Vec::new()));
        assert_eq!(twice.extra()[0].1, vec![1_u8, 3, 4, 1, 3, 4].into());
        let (other, _) = PointCloud::from_parts(parts("EPSG:4978")).unwrap();
        let (joined, lost) = PointCloud::concat(&[cloud, other]);
        assert_eq!((joined.crs(), lost), (None, vec!["crs".to_owned()]));
    }

    #[test]
    fn an_empty_cloud_has_no_bounds() {
        assert_eq!(PointCloud::default().bounds(), None);
        assert_eq!(PointCloud::concat(&[]).0.len(), 0);
    }
}
