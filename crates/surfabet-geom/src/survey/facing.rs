//! Which way surfaces face: towards the sensor, or along normals that somebody oriented.

use super::sample::SampledCloud;
use crate::cloud::PointCloud;
use crate::error::Result;
use crate::kdtree::KdTree;
use crate::vector::{dot, minus};

/// Share of the points whose normal is consistent with that of the nearest point, from which on normals count as oriented: of
/// random signs half point to the same side and half of the others stand back to back by chance, of oriented ones nearly all
/// that are not at an edge are consistent; this is the middle. Of 40 clouds the same are oriented with 0.75 and 0.95
/// (`docs/benchmarks/constants.md`), and with half and double of the points below.
const ORIENTED_SHARE: f64 = 0.875;

/// Points that are compared, at most: the share of random signs then deviates by less than a percent, far less than the
/// eighth it is told apart by.
const MAX_COMPARED: usize = 4096;

/// Whether it is known which way the surfaces of a cloud face, as [`Survey::has_facings`](super::Survey::has_facings).
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for a coordinate that is not finite.
pub fn has_facings(cloud: &PointCloud) -> Result<bool> {
    if cloud.viewpoints().is_some() || cloud.normals().is_none() || cloud.is_empty() {
        return Ok(cloud.viewpoints().is_some());
    }
    Ok(SampledCloud::of(cloud)?.facings.is_some())
}

/// The direction that the surface faces at the `chosen` points, whose `positions` are in `tree`: to where they were seen
/// from, else their normal; `None` where neither is known or normals have random signs.
pub(super) fn facings(
    cloud: &PointCloud,
    chosen: &[usize],
    positions: &[[f32; 3]],
    tree: &KdTree,
) -> Option<Vec<[f32; 3]>> {
    if cloud.viewpoints().is_none() && cloud.normals().is_none() {
        return None;
    }
    let facings: Vec<[f32; 3]> = chosen.iter().map(|&i| cloud.facing_of(i)).collect();
    (cloud.viewpoints().is_some() || are_oriented(&facings, positions, tree)).then_some(facings)
}

/// True when enough normals point to the side of their nearest neighbour's, or away from each other where the neighbour lies
/// behind, as on both sides of a thin wall.
fn are_oriented(normals: &[[f32; 3]], positions: &[[f32; 3]], tree: &KdTree) -> bool {
    let back_to_back = |i: usize, j: usize| {
        let to = minus(positions[j], positions[i]);
        dot(to, normals[i]) < 0.0 && dot(to, normals[j]) > 0.0
    };
    let (mut agree, mut compared) = (0_usize, 0_usize);
    let mut near = Vec::new();
    for i in (0..normals.len()).step_by(normals.len().div_ceil(MAX_COMPARED).max(1)) {
        tree.k_nearest(positions[i], 2, &mut near);
        let Some(other) = near.iter().map(|n| n.index()).find(|&j| j != i) else { continue };
        let product = dot(normals[i], normals[other]);
        // Neither across an edge nor of length zero.
        if product.abs() > 0.5 {
            compared += 1;
            agree += usize::from(product > 0.0 || back_to_back(i, other));
        }
    }
    compared > 0 && agree as f64 >= ORIENTED_SHARE * compared as f64
}
