//! Axis-aligned boxes.

use nalgebra::RealField;

use crate::vector::{largest, length, minus};

/// An axis-aligned box, its faces included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb<T = f32> {
    /// Least coordinates.
    pub low: [T; 3],
    /// Largest coordinates.
    pub high: [T; 3],
}

impl Aabb<f32> {
    /// The box that holds nothing: its union with any other is the other.
    pub const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// All of space.
    pub const ALL: Self = Self { low: [f32::NEG_INFINITY; 3], high: [f32::INFINITY; 3] };

    /// Middle, and half the side along each axis.
    pub fn middle(&self) -> ([f64; 3], [f64; 3]) {
        let [low, high] = [self.low, self.high].map(|p| p.map(f64::from));
        (
            std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            std::array::from_fn(|a| 0.5 * (high[a] - low[a])),
        )
    }
}

impl<T: RealField + Copy> Aabb<T> {
    /// The box of a point.
    #[inline]
    pub fn point(p: [T; 3]) -> Self {
        Self { low: p, high: p }
    }

    /// The smallest box around some points; `None` for no points.
    pub fn of(points: impl IntoIterator<Item = [T; 3]>) -> Option<Self> {
        points.into_iter().map(Self::point).reduce(Self::union)
    }

    /// The smallest box around both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|a| self.low[a].min(other.low[a])),
            high: std::array::from_fn(|a| self.high[a].max(other.high[a])),
        }
    }

    /// Lengths of the sides.
    #[inline]
    pub fn sides(&self) -> [T; 3] {
        minus(self.high, self.low)
    }

    /// Number of the axis along the longest side; the first of equal ones.
    #[inline]
    pub fn longest_axis(&self) -> usize {
        largest(self.sides())
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> T {
        length(self.sides())
    }

    /// True when the point is inside or on a face.
    #[inline]
    pub fn contains(&self, p: [T; 3]) -> bool {
        (0..3).all(|a| self.low[a] <= p[a] && p[a] <= self.high[a])
    }

    /// Squared distance from a point to the box; zero inside.
    ///
    /// Computed as [`squared_distance`](crate::vector::squared_distance) of points is. Every rounding on the way is
    /// monotone, so that no box is farther away than a point or a box in it.
    #[inline(always)]
    pub fn squared_distance(&self, p: [T; 3]) -> T {
        // Plain comparisons: `max` also sees to NaN, which takes three instructions instead of one.
        let larger = |a: T, b: T| if a > b { a } else { b };
        let outside = |a: usize| larger(larger(self.low[a] - p[a], p[a] - self.high[a]), T::zero());
        let d: [T; 3] = std::array::from_fn(outside);
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }

    /// Both parts of the box on either side of a plane across an axis.
    #[must_use]
    pub fn split(self, axis: usize, at: T) -> [Self; 2] {
        let mut halves = [self; 2];
        halves[0].high[axis] = at;
        halves[1].low[axis] = at;
        halves
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::vector::squared_distance;

    fn any_point() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(prop_oneof![(-3_i8..3).prop_map(f32::from), -5.0_f32..5.0])
    }

    fn any_points() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(any_point(), 1..20)
    }

    proptest! {
        #[test]
        fn a_box_of_points_holds_them_and_is_tight(points in any_points()) {
            let b = Aabb::of(points.iter().copied()).unwrap();
            prop_assert!(points.iter().all(|&p| b.contains(p)));
            for a in 0..3 {
                prop_assert!(points.iter().any(|p| p[a] == b.low[a]));
                prop_assert!(points.iter().any(|p| p[a] == b.high[a]));
            }
            prop_assert_eq!(Aabb::EMPTY.union(b), b);
            prop_assert_eq!(b.union(Aabb::EMPTY), b);
            let longest = b.sides()[b.longest_axis()];
            prop_assert!(b.sides().iter().all(|&s| s <= longest));
            prop_assert!(b.diagonal() >= longest && b.diagonal() <= 1.7321 * longest);
            let (middle, half) = b.middle();
            for a in 0..3 {
                prop_assert!((middle[a] - half[a] - f64::from(b.low[a])).abs() < 1e-12);
                prop_assert!((middle[a] + half[a] - f64::from(b.high[a])).abs() < 1e-12);
            }
        }

        #[test]
        fn a_box_is_never_farther_than_what_is_in_it(points in any_points(), q in any_point()) {
            let b = Aabb::of(points.iter().copied()).unwrap();
            let to_box = b.squared_distance(q);
            prop_assert!(points.iter().all(|&p| to_box <= squared_distance(p, q)));
            prop_assert!(b.union(Aabb::point([9.0; 3])).squared_distance(q) <= to_box);
            // The point of the box that is nearest.
            let nearest = std::array::from_fn(|a| q[a].clamp(b.low[a], b.high[a]));
            prop_assert_eq!(to_box, squared_distance(nearest, q));
            prop_assert_eq!(b.contains(q), to_box == 0.0);
        }

        #[test]
        fn halves_make_up_the_box(points in any_points(), axis in 0_usize..3, share in 0.0_f32..1.0) {
            let b = Aabb::of(points.iter().copied()).unwrap();
            let at = b.low[axis] + share * (b.high[axis] - b.low[axis]);
            let [left, right] = b.split(axis, at);
            prop_assert!(points.iter().all(|&p| left.contains(p) || right.contains(p)));
            prop_assert_eq!(left.high[axis], right.low[axis]);
        }
    }

    #[test]
    fn the_empty_box_is_infinitely_far_from_everything() {
        assert_eq!(Aabb::of(std::iter::empty::<[f32; 3]>()), None);
        assert_eq!(Aabb::EMPTY.squared_distance([0.0; 3]), f32::INFINITY);
        assert!(!Aabb::EMPTY.contains([0.0; 3]));
        assert_eq!(Aabb::ALL.squared_distance([1e30; 3]), 0.0);
    }
}
