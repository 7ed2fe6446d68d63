//! Columns of another scan: which layers of a patch's thickness they still show.
//!
//! A patch has one thickness, that of its most uneven part, and decodes to it everywhere. Learned again from that, patches would
//! grow thicker with each scan. Where a scan has points in the column of a pixel within the patch, these show where in the
//! thickness the surface lies; where it has none the patch is all that is known.

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f32;
use surfabet_geom::PointCloud;

use crate::patches::constants::{SHOWN_MARGIN, SHOWN_REACH};
use crate::patches::model::Lattice;
use crate::patches::samples::{rotate, rows_of};
use crate::patches::sheets::axes_of;
use crate::sensor::to_sensor;

/// A point in the column of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ColumnPoint {
    /// Row and column, finest pixels.
    column: [i32; 2],
    /// Along the axis, finest pixels.
    depth: f32,
    /// How much of it faces up the axis; zero where that is not known.
    facing: f32,
}

/// Points of a scan in the columns of finest pixels, along each axis of the lattice.
pub struct ScanColumns {
    /// By column and depth.
    of_axes: [Vec<ColumnPoint>; 3],
}

impl ScanColumns {
    /// Of points about the origin of the lattice.
    pub fn new(lattice: &Lattice, scan: &PointCloud) -> Self {
        let rows = rows_of(lattice);
        let pixel = lattice.pixel_size as f32;
        let view = |i: usize| match (scan.viewpoints(), scan.normals()) {
            (None, Some(normals)) => normals[i],
            _ => to_sensor(scan, i),
        };
        let of_axis = |axis: usize| {
            let [d, u, v] = axes_of(2 * axis as u8);
            let mut entries = parallel::map_range(scan.len(), |i| {
                let p = rotate(&rows, scan.positions()[i]).map(|c| c / pixel);
                let column = [p[v], p[u]].map(floor_f32);
                ColumnPoint { column, depth: p[d], facing: rotate(&rows, view(i))[d] }
            });
            entries.sort_unstable_by(|a, b| {
                let by_depth = a.depth.total_cmp(&b.depth);
                a.column.cmp(&b.column).then(by_depth).then(a.facing.total_cmp(&b.facing))
            });
            entries
        };
        Self { of_axes: std::array::from_fn(of_axis) }
    }

    /// What the scan shows of a patch of a side in the column of a pixel: of the surface at `depth` with this half thickness.
    pub(super) fn shown(&self, side: u8, [u, v]: [i32; 2], depth: f32, half: f32) -> Shown<'_> {
        let all = &self.of_axes[usize::from(side / 2)];
        let is_before = |entry: &ColumnPoint, to: f32| {
            entry.column.cmp(&[v, u]).then(entry.depth.total_cmp(&to)).is_lt()
        };
        let from = all.partition_point(|entry| is_before(entry, depth - half - SHOWN_MARGIN));
        let to = all.partition_point(|entry| is_before(entry, depth + half + SHOWN_MARGIN));
        let up = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
        let shown = Shown { entries: &all[from..to.max(from)], up };
        Shown { entries: if shown.depths().next().is_some() { shown.entries } else { &[] }, up }
    }
}

/// The points of a scan that lie in the thickness of a patch, in one column.
pub(super) struct Shown<'a> {
    entries: &'a [ColumnPoint],
    /// 1 for a patch that faces up its axis, -1 for one that faces down.
    up: f32,
}

impl Shown<'_> {
    /// Depths of those that may be of a surface that faces as the patch does.
    fn depths(&self) -> impl Iterator<Item = f32> {
        self.entries.iter().filter(|entry| entry.facing * self.up >= 0.0).map(|entry| entry.depth)
    }

    /// True for a layer at a depth that the scan shows, or does not cover.
    pub fn has(&self, depth: f32) -> bool {
        self.entries.is_empty() || self.depths().any(|at| (at - depth).abs() <= SHOWN_REACH)
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{CloudParts, Viewpoints};

    use super::*;

    /// One point at a depth in the column of pixel (3, 5) across z, seen from above or from below where that is known.
    fn scan(depths: &[f32], from: Option<f64>) -> PointCloud {
        let at = |&z: &f32| [0.1 * 3.5, 0.1 * 5.5, 0.1 * z];
        let viewpoints = from
            .map(|z| Viewpoints { index: vec![0; depths.len()], origins: vec![[0.35, 0.55, z]] });
        let positions = depths.iter().map(at).collect();
        PointCloud::from_parts(CloudParts { positions, viewpoints, ..CloudParts::default() })
            .unwrap()
            .0
    }

    /// Whether layers at -2, -1, 0, 1 and 2 pixels of a patch of that half thickness are still there.
    fn left(scan: &PointCloud, side: u8, column: [i32; 2]) -> [bool; 5] {
        let lattice = Lattice { pixel_size: 0.1, levels: 1, depth_step: 1, ..Lattice::default() };
        let columns = ScanColumns::new(&lattice, scan);
        let shown = columns.shown(side, column, 0.0, 2.0);
        [-2.0, -1.0, 0.0, 1.0, 2.0].map(|depth| shown.has(depth))
    }

    #[test]
    fn layers_that_a_scan_shows_stay() {
        let reach = SHOWN_REACH;
        assert_eq!(left(&scan(&[1.0], None), 4, [3, 5]), [false, false, false, true, false]);
        let off = |more: f32| left(&scan(&[1.0 - reach - more], None), 4, [3, 5])[3];
        assert!(off(-0.01) && !off(0.01));
        // Of a surface that is thicker than a layer several do.
        assert_eq!(left(&scan(&[-2.0, -1.0, 0.0], None), 4, [3, 5])[..3], [true; 3]);
    }

    #[test]
    fn a_scan_without_points_in_the_patch_says_nothing() {
        assert_eq!(left(&scan(&[1.0], None), 4, [3, 6]), [true; 5]);
        let beyond = |more: f32| left(&scan(&[2.0 + SHOWN_MARGIN + more], None), 4, [3, 5]);
        assert_eq!(beyond(0.01), [true; 5]);
        assert!(!beyond(-0.01)[0]);
    }

    #[test]
    fn points_seen_from_the_other_side_say_nothing() {
        let above = scan(&[1.0], Some(10.0));
        assert_eq!(left(&above, 4, [3, 5]), [false, false, false, true, false]);
        assert_eq!(left(&above, 5, [3, 5]), [true; 5]);
    }
}
