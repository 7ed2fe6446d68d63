//! The neighbours of the points that are looked at: searched once for all that is measured of them.

use super::sample::Sample;
use crate::kdtree::Neighbor;
use crate::moments::{Moments, PrincipalAxes};
use crate::vector::dot;

/// Numbers of nearest points, the one in the middle included, whose shape is known, the smallest first.
pub(super) const NEIGHBORS: [usize; 4] = [7, 16, 48, 192];

/// The most of them.
const MOST: usize = NEIGHBORS[NEIGHBORS.len() - 1];

/// The shape of some neighbours of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub axes: PrincipalAxes,
    /// Number of neighbours: fewer than asked for, where fewer face the same way.
    pub count: usize,
}

/// What is known of the neighbours of a point.
#[derive(Debug, Clone)]
pub(super) struct Around {
    /// The number of the point in the sample.
    pub point: usize,
    /// Distance of the nearest other point, metres.
    pub nearest: Option<f64>,
    /// Of each number of [`NEIGHBORS`] that face the same way.
    pub shapes: [Option<Shape>; NEIGHBORS.len()],
    /// The same whichever way they face, but for the most; `None` where nobody knows, or the point has the same ones.
    of_all: Option<[Option<Shape>; NEIGHBORS.len() - 1]>,
}

impl Around {
    /// What is about a point of the sample.
    pub fn new(sample: &Sample, point: usize) -> Self {
        let mut near = Vec::new();
        // Of points that face the same way half of those around may face the other one.
        let searched = if sample.facings.is_some() { 2 * MOST } else { MOST };
        sample.tree.k_nearest(sample.positions[point], searched, &mut near);
        let nearest = near.get(1).map(|n| f64::from(n.squared_distance()).sqrt());
        let shape = |near: &[Neighbor]| {
            let positions = near.iter().map(|n| sample.positions[n.index()]);
            let axes = Moments::about(sample.positions[point], positions).principal_axes()?;
            Some(Shape { axes, count: near.len() })
        };
        let first = |k: usize| &near[..k.min(near.len())];
        let Some(facings) = &sample.facings else {
            let shapes = NEIGHBORS.map(|k| shape(first(k)));
            return Self { point, nearest, shapes, of_all: None };
        };
        let of_all = std::array::from_fn(|i| shape(first(NEIGHBORS[i])));
        let shapes = NEIGHBORS.map(|k| {
            let is_same = |n: &&Neighbor| dot(facings[n.index()], facings[point]) > 0.0;
            let same: Vec<Neighbor> =
                first(2 * k).iter().filter(is_same).take(k).copied().collect();
            shape(&same)
        });
        Self { point, nearest, shapes, of_all: Some(of_all) }
    }

    /// The shapes of the neighbours whichever way they face, of each number of [`NEIGHBORS`] but the most.
    pub fn shapes_of_all(&self) -> &[Option<Shape>] {
        self.of_all.as_ref().map_or(&self.shapes[..NEIGHBORS.len() - 1], |of_all| of_all)
    }
}
