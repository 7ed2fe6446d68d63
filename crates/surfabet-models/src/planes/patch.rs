//! A patch: a plane, a rectangle in it, and the tiles of the rectangle (section II-A).

use surfabet_geom::{Aabb, Moments};

use super::points::Points;
use super::tiles::Tiles;
use crate::vector::{cross, dot, least_axis, minus, unit};

/// Axes of a plane: a point on it, two orthonormal directions in it and its unit normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// A point on the plane about the points' origin, metres.
    pub center: [f64; 3],
    /// Direction of the first axis.
    pub u: [f64; 3],
    /// Direction of the second axis.
    pub v: [f64; 3],
    /// Unit normal, u x v; towards the side that the points were seen from, where that is known.
    pub normal: [f64; 3],
}

impl Frame {
    /// A frame with this normal, which has length one; the direction of its axes in the plane is arbitrary.
    pub(super) fn with_normal(center: [f64; 3], normal: [f64; 3]) -> Self {
        let u = unit(cross(least_axis(normal), normal));
        Self { center, u, v: cross(normal, u), normal }
    }

    /// The same plane with its axes turned by an angle given by its cosine and sine.
    pub(super) fn turned(&self, [cosine, sine]: [f64; 2]) -> Self {
        let u = std::array::from_fn(|a| cosine * self.u[a] + sine * self.v[a]);
        Self { u, v: cross(self.normal, u), ..*self }
    }

    /// The same plane seen from its other side.
    pub(super) fn flipped(&self) -> Self {
        let normal = self.normal.map(|c| -c);
        Self { normal, v: cross(normal, self.u), ..*self }
    }

    /// Coordinates in the plane, and height above it.
    pub(super) fn local(&self, p: [f32; 3]) -> [f64; 3] {
        let d = minus(p.map(f64::from), self.center);
        [dot(d, self.u), dot(d, self.v), dot(d, self.normal)]
    }

    /// Position of a point of the plane.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        std::array::from_fn(|a| self.center[a] + x * self.u[a] + y * self.v[a])
    }
}

/// Largest distance of a point from a patch.
///
/// Tiles may be larger than the reach where points are sparse; distances beside them count in proportion:
/// `scale = min(reach / edge, 1)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// Above the plane, metres.
    pub height: f64,
    /// Beside the supported tiles, in the plane, metres.
    pub beside: f64,
    scale: f64,
}

/// A planar rectangle of tiles with the points that support it.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Its plane and axes.
    pub frame: Frame,
    /// Its rectangle and tiles.
    pub tiles: Tiles,
    /// Standard deviation of the distances of its support (S, all of it) from the plane, metres: the measure of how
    /// planar it is (the end of section III).
    pub standard_deviation: f64,
    /// The reduced support set (S^r): distinct points, ascending.
    pub(super) support: Vec<u32>,
    /// The whole support set (S): distinct points, ascending.
    pub(super) whole: Vec<u32>,
    /// Moments of the whole support set.
    pub(super) moments: Moments,
    /// Sum of the sides that its points were seen from.
    pub(super) facing: [f64; 3],
    /// Expected number of points per area of the supported tiles; zero for a patch that no points support yet.
    pub(super) density: f64,
    /// Standard deviation of the points about their tiles' own means: noise without the surface's shape, metres.
    pub(super) noise: f64,
}

impl Patch {
    /// A patch that no points support yet.
    pub(super) fn bare(frame: Frame, tiles: Tiles) -> Self {
        Self {
            frame,
            tiles,
            standard_deviation: 0.0,
            support: Vec::new(),
            whole: Vec::new(),
            moments: Moments::new(),
            facing: [0.0; 3],
            density: 0.0,
            noise: 0.0,
        }
    }

    /// Number of distinct points that support it.
    pub fn n_supporting(&self) -> usize {
        self.whole.len()
    }

    /// Distance of a point to the closest supported tile, where it is within `reach` (d(a, s) of eq. 1):
    /// `sqrt(z^2 + scale^2 beside^2)`, with the height `z` above the plane and the distance `beside` the tile in it.
    pub(super) fn distance(&self, p: [f32; 3], reach: f64) -> Option<f64> {
        self.distance_within(p, &self.reach(reach))
    }

    /// As [`Patch::distance`].
    #[inline]
    pub(super) fn distance_within(&self, p: [f32; 3], reach: &Reach) -> Option<f64> {
        self.distance_where(p, reach, |_| true)
    }

    /// As [`Patch::distance_within`], where the squared height above the plane is also wanted.
    #[inline]
    pub(super) fn distance_where(
        &self,
        p: [f32; 3],
        reach: &Reach,
        is_wanted: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        let d = minus(p.map(f64::from), self.frame.center);
        let z = dot(d, self.frame.normal);
        if z.abs() > reach.height || !is_wanted(z * z) {
            return None;
        }
        let at = [dot(d, self.frame.u), dot(d, self.frame.v)];
        let beside = self.tiles.squared_distance(at, reach.beside)?;
        let squared = z * z + reach.scale * reach.scale * beside;
        (squared <= reach.height * reach.height).then(|| squared.sqrt())
    }

    /// How far points reach beside this patch that reach `height` above it.
    pub(super) fn reach(&self, height: f64) -> Reach {
        let scale = (height / self.tiles.edge()).min(1.0);
        Reach { height, scale, beside: height / scale }
    }

    /// Squared distance of a point to the patch's whole rectangle.
    pub(super) fn least(&self, p: [f32; 3]) -> f64 {
        let [x, y, z] = self.frame.local(p);
        let (low, size) = (self.tiles.low(), self.tiles.size());
        let beside = |a: usize, c: f64| (low[a] - c).max(c - low[a] - size[a]).max(0.0);
        beside(0, x).powi(2) + beside(1, y).powi(2) + z * z
    }

    /// Squared distance of a point to the closest supported tile, where it is within `reach`.
    pub(super) fn squared_distance(&self, p: [f32; 3], reach: f64) -> Option<f64> {
        let [x, y, z] = self.frame.local(p);
        Some(self.tiles.squared_distance([x, y], reach)? + z * z)
    }

    /// True when the point was seen from the patch's other side.
    #[inline]
    pub(super) fn turned_away(&self, facing: [f32; 3]) -> bool {
        dot(facing.map(f64::from), self.frame.normal) < 0.0
    }

    /// False only if no point of the box is within `reach` of a supported tile; true also for some boxes that are
    /// beside them.
    pub(super) fn reaches(&self, aabb: &Aabb, reach: f64) -> bool {
        let (middle, half) = aabb.middle();
        let d = minus(middle, self.frame.center);
        let extent = |axis: [f64; 3]| (0..3).map(|a| half[a] * axis[a].abs()).sum::<f64>();
        let frame = &self.frame;
        if dot(d, frame.normal).abs() > reach + extent(frame.normal) {
            return false;
        }
        let beside = reach.max(self.tiles.edge());
        let at = [dot(d, frame.u), dot(d, frame.v)];
        let margin = [extent(frame.u) + beside, extent(frame.v) + beside];
        self.tiles.any_in(
            std::array::from_fn(|a| at[a] - margin[a]),
            std::array::from_fn(|a| at[a] + margin[a]),
        )
    }

    /// The blocks of points that may have points within `reach`: a few more than have.
    pub(super) fn blocks(&self, points: &Points, reach: f64) -> Vec<u32> {
        let mut found = Vec::new();
        points.blocks_where(|aabb| self.reaches(aabb, reach), &mut found);
        found
    }
}
