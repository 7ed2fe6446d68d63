//! Translations by branch and bound: boxes of them, the most promising first.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{UnitQuaternion, Vector3};
use surfabet_geom::vector;

use super::constants::{
    BOUND_PER_LEVEL, FACES_AXIS, HOPEFUL, HYPOTHESES, LEAST_SHARE, LEVELS, MAX_NODES,
    SAME_ROTATION, SAME_TRANSLATION, SEARCH_SAMPLES, THOROUGH,
};
use super::map::{Localizer, evenly};
use super::placement::Placement;
use super::samples::Sample;

/// A box of translations under one rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct SearchBox {
    /// What its leaves are likely to explain.
    promise: i32,
    /// Samples that some translation of the box can explain, at most.
    bound: u32,
    level: u8,
    rotation: u16,
    /// Lowest corner, in leaves from the lowest corner of the domain.
    corner: [i32; 3],
}

impl Ord for SearchBox {
    /// The larger promise first, then the finer level, then the order of rotations and corners.
    fn cmp(&self, other: &Self) -> Ordering {
        let rest = |n: &Self| (n.level, n.rotation, n.corner);
        self.promise.cmp(&other.promise).then_with(|| rest(other).cmp(&rest(self)))
    }
}

impl PartialOrd for SearchBox {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Samples that are looked up before it is asked whether enough can still be explained.
const CHUNK: usize = 32;

/// The samples of the scan under one rotation, about the sensor.
struct Turned {
    points: Vec<[f32; 3]>,
    bits: Vec<u8>,
}

/// The search of one scan.
pub(super) struct Search<'a> {
    map: &'a Localizer,
    rotations: &'a [UnitQuaternion<f64>],
    turned: Vec<Turned>,
    /// Lowest corner and size of the domain of sensor positions, metres.
    low: [f32; 3],
    extent: [f32; 3],
}

impl<'a> Search<'a> {
    /// Over sensor positions in `domain`, a lowest and a highest corner.
    pub fn new(
        map: &'a Localizer,
        samples: &[Sample],
        rotations: &'a [UnitQuaternion<f64>],
        domain: [[f32; 3]; 2],
    ) -> Self {
        let chosen = choose(samples);
        let turned = rotations.iter().map(|rotation| {
            let matrix = rotation.to_rotation_matrix();
            let turn = |v: [f32; 3]| -> [f32; 3] {
                let turned = matrix * Vector3::from(v.map(f64::from));
                std::array::from_fn(|a| turned[a] as f32)
            };
            let points = chosen.iter().map(|s| turn(vector::minus(s.point, s.viewpoint))).collect();
            let bits = chosen.iter().map(|s| main_bit(turn(s.normal), &map.axes)).collect();
            Turned { points, bits }
        });
        let [low, high] = domain;
        let extent = vector::minus(high, low).map(|c| c.max(0.0));
        Self { map, rotations, turned: turned.collect(), low, extent }
    }

    /// Distinct poses with the share of samples that they explain, the best first; those with at least `share` of the best. A
    /// `thorough` search goes on beyond its limits while what is left is about as promising as the best.
    pub fn run(&self, share: f64, thorough: bool) -> Vec<(f64, Placement)> {
        let n = self.turned.first().map_or(0, |t| t.points.len());
        let mut least = (LEAST_SHARE * n as f64).ceil() as u32;
        let mut heap = self.roots(least);
        let mut found: Vec<(u32, SearchBox)> = Vec::new();
        let mut opened = 0;
        let mut hopeful: Option<i32> = None;
        while let Some(node) = heap.pop() {
            let is_hopeful = thorough && hopeful.is_some_and(|least| node.promise >= least);
            let times = if is_hopeful { THOROUGH } else { 1 };
            if found.len() >= times * HYPOTHESES || opened >= times * MAX_NODES {
                break;
            }
            if node.bound < least || self.is_near_found(&node, &found) {
                continue;
            }
            if node.level == 0 {
                let of_best = (share * f64::from(node.bound)).ceil() as u32;
                least = least.max(of_best);
                hopeful = hopeful.max(Some((HOPEFUL * f64::from(node.bound)).ceil() as i32));
                found.push((node.bound, node));
                continue;
            }
            opened += 1;
            let half = 1 << (node.level - 1);
            for k in 0..8 {
                let corner = std::array::from_fn(|a| node.corner[a] + half * (k >> a & 1));
                if !self.is_in_domain(corner) {
                    continue;
                }
                let node = self.node(node.level - 1, node.rotation, corner, least);
                if node.bound >= least {
                    heap.push(node);
                }
            }
        }
        found.retain(|(bound, _)| *bound >= least);
        found.sort_by_key(|b| std::cmp::Reverse(b.1));
        found.iter().map(|(bound, node)| (f64::from(*bound) / n as f64, self.pose(node))).collect()
    }

    /// Side of a leaf: two cells.
    fn leaf(&self) -> f32 {
        2.0 * self.map.cell as f32
    }

    fn roots(&self, least: u32) -> BinaryHeap<SearchBox> {
        let level = LEVELS as u8 - 1;
        let step = 1 << level;
        let side = self.leaf() * step as f32;
        let [nx, ny, nz] = self.extent.map(|e| (e / side) as i32 + 1);
        let mut heap = BinaryHeap::new();
        for rotation in 0..self.rotations.len() as u16 {
            for z in 0..nz {
                for y in 0..ny {
                    for x in 0..nx {
                        let corner = [x, y, z].map(|c| c * step);
                        let node = self.node(level, rotation, corner, least);
                        if node.bound >= least {
                            heap.push(node);
                        }
                    }
                }
            }
        }
        heap
    }

    fn corner(&self, corner: [i32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| self.low[a] + corner[a] as f32 * self.leaf())
    }

    /// Whether a box from this corner on meets the domain: the coarsest boxes are larger than it may be.
    fn is_in_domain(&self, corner: [i32; 3]) -> bool {
        (0..3).all(|a| corner[a] as f32 * self.leaf() <= self.extent[a])
    }

    fn node(&self, level: u8, rotation: u16, corner: [i32; 3], least: u32) -> SearchBox {
        let bound = self.bound(level, rotation, corner, least);
        let n = self.turned[rotation as usize].points.len() as f64;
        let slack = f64::from(level) * BOUND_PER_LEVEL * n;
        SearchBox { promise: bound as i32 - slack as i32, bound, level, rotation, corner }
    }

    /// Samples that meet a surface which faces their axis at some translation of a box; too few, where that cannot be
    /// `least` any more.
    fn bound(&self, level: u8, rotation: u16, corner: [i32; 3], least: u32) -> u32 {
        let level = &self.map.pyramid.levels[level as usize];
        let shift = self.corner(corner);
        let turned = &self.turned[rotation as usize];
        let misses = (turned.points.len() as u32).saturating_sub(least);
        let mut missed = 0;
        let mut hits = 0;
        for (points, bits) in turned.points.chunks(CHUNK).zip(turned.bits.chunks(CHUNK)) {
            for (p, bits) in points.iter().zip(bits) {
                let p = std::array::from_fn(|a| p[a] + shift[a]);
                hits += u32::from(level.at(p) & bits != 0);
            }
            missed += points.len() as u32;
            if missed - hits > misses {
                break;
            }
        }
        hits
    }

    /// Whether all of a node is near a pose that was found already.
    fn is_near_found(&self, node: &SearchBox, found: &[(u32, SearchBox)]) -> bool {
        // In halves of leaves, from middle to middle.
        let middle = |n: &SearchBox| n.corner.map(|c| 2 * c + (1 << n.level));
        let reach = SAME_TRANSLATION as i32;
        let width = (1 << node.level) - 1;
        found.iter().any(|(_, other)| {
            let near = (0..3).all(|a| (middle(node)[a] - middle(other)[a]).abs() + width <= reach);
            let [a, b] = [node.rotation, other.rotation].map(|r| &self.rotations[r as usize]);
            near && (node.rotation == other.rotation || a.angle_to(b) < 2.0 * SAME_ROTATION)
        })
    }

    fn pose(&self, node: &SearchBox) -> Placement {
        let corner = self.corner(node.corner);
        let middle = corner.map(|c| f64::from(c + 0.5 * self.leaf()));
        Placement {
            rotation: self.rotations[node.rotation as usize],
            translation: Vector3::from(middle),
        }
    }
}

/// The bit of the axis that a normal is nearest to; all where there is no normal.
fn main_bit(n: [f32; 3], axes: &[[f32; 3]; 3]) -> u8 {
    if n == [0.0; 3] {
        return 7;
    }
    let along = axes.map(|axis| vector::dot(n, axis).abs());
    let main = vector::largest(along);
    debug_assert!(along[main] >= FACES_AXIS);
    1 << main
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Samples with flat ones of all directions in equal parts, so that a large floor does not outweigh the walls.
fn choose(samples: &[Sample]) -> Vec<Sample> {
    let mut by_axis: [Vec<Sample>; 4] = Default::default();
    for s in samples {
        let axis = if s.is_flat() { vector::largest(s.normal.map(f32::abs)) } else { 3 };
        by_axis[axis].push(*s);
    }
    // What one kind has too few of the others fill up.
    let mut left = SEARCH_SAMPLES;
    let mut chosen = Vec::with_capacity(SEARCH_SAMPLES);
    let mut kinds: Vec<&Vec<Sample>> = by_axis.iter().collect();
    kinds.sort_by_key(|kind| kind.len());
    for (i, kind) in kinds.iter().enumerate() {
        let n = (left / (kinds.len() - i)).min(kind.len());
        chosen.extend(evenly(kind, n));
        left -= n;
    }
    // In an order in which every part is like the whole.
    let n = chosen.len();
    let step = (0..).map(|k| 77 + k).find(|&k| gcd(k, n.max(1)) == 1).unwrap_or(1);
    (0..n).map(|i| chosen[i * step % n]).collect()
}
