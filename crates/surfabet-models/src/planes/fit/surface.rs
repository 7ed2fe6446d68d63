//! Patches that are no surface: through the middle of clutter, across a corner, along something bent, between two surfaces.
//!
//! No single figure separates them, and none means the same whatever the others are: a small network weighs them; what it learned from
//! is in docs/benchmarks/planes.md. All are shares, or in units of the noise: none depends on the scale of a scene.

use nalgebra::{SMatrix, SVector};
use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::removal::Removal;
use crate::error::Result;
use crate::planes::constants::{
    BEND_INNER, FIGURES, LEAST_FIGURE, MOST_LENGTH, MOST_POINTS, MOST_WIDTH, NORMAL_KURTOSIS,
    SURFACE_OFFSET, SURFACE_UNITS,
};
use crate::planes::patch::Patch;
use crate::planes::points::Points;
use crate::vector::dot;

/// Figures by which a surface differs from other patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Evidence {
    /// What the likelihood loses without it, per point: something between two surfaces is explained by both.
    gain: f64,
    /// Standard deviation of its points about its plane, in that of the noise: a bent surface has more, one of several thin
    /// layers has less.
    spread: f64,
    /// Fourth moment of these distances by the square of the second: 3 for normal noise, less where a patch cuts a slice
    /// out of something thick, whose sides are sharp.
    kurtosis: f64,
    /// Share of its rectangle that supported tiles cover: most surfaces are rectangles.
    fill: f64,
    /// Mean probability of the points that support it.
    certainty: f64,
    /// Its longer and its shorter side, in standard deviations of the noise.
    length: f64,
    width: f64,
    /// Share of its points in the cubes of supported tiles: of something with a rim of clutter fewer are.
    near: f64,
    /// Standard deviation of its points about the means of their tiles, in that of the noise: less than `spread` where it is bent or stepped.
    within: f64,
    /// Number of its points: what the others are worth.
    points: f64,
    /// Root mean square of the quadratic part of its heights away from its edges, in standard deviations of the noise: spheres and
    /// cylinders are bent beyond chance long before they are thick.
    bend: f64,
    /// Mean sine of the angle to the patches that its points would move to; 1 where there are none: facets of something round
    /// meet at small angles.
    turn: f64,
    /// Points above and below it, one and two grid sizes away, by those on it: in clutter there are as many.
    beside: f64,
    far_beside: f64,
}

/// What all patches of a fit are judged by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judged<'a> {
    pub points: &'a Points,
    pub patches: &'a [Patch],
    pub removals: &'a [Removal],
    /// Standard deviation of the points across each patch at the angle at which it was seen, metres.
    pub noise: &'a [f64],
    /// Grid size G, metres.
    pub grid_size: f64,
}

impl Judged<'_> {
    /// The evidence of each patch.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn evidence(&self, progress: &dyn Progress) -> Result<Vec<Evidence>> {
        parallel::try_map_range(self.patches.len(), |j| {
            progress.check()?;
            Ok(self.evidence_of(j))
        })
    }

    fn evidence_of(&self, j: usize) -> Evidence {
        let (patch, removal, noise) = (&self.patches[j], &self.removals[j], self.noise[j]);
        let n = patch.whole.len() as f64;
        let [x, y] = patch.tiles.size();
        let [beside, far_beside] = self.beside(patch);
        Evidence {
            gain: removal.loss / removal.mass,
            spread: patch.standard_deviation / noise,
            kurtosis: kurtosis(self.points, patch),
            fill: patch.tiles.area() / (x * y),
            certainty: removal.mass / n,
            length: x.max(y) / noise,
            width: x.min(y) / noise,
            near: patch.support.len() as f64 / n,
            within: patch.noise / noise,
            points: n,
            bend: bend(self.points, patch) / noise,
            turn: self.turn(patch, removal),
            beside,
            far_beside,
        }
    }

    /// Mean sine of the angles to the patches that would get the points of `patch`, by how many each would.
    fn turn(&self, patch: &Patch, removal: &Removal) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        for &(k, moved) in &removal.neighbors {
            let cosine = dot(patch.frame.normal, self.patches[k as usize].frame.normal);
            sum += moved * (1.0 - cosine * cosine).max(0.0).sqrt();
            all += moved;
        }
        if all > 0.0 { sum / all } else { 1.0 }
    }

    /// The points over the supported tiles up to G, beyond it up to 2 G, and beyond that up to 3 G from the plane; the latter two by
    /// the first. Points seen from the other side are of another surface.
    fn beside(&self, patch: &Patch) -> [f64; 2] {
        let mut slabs = [0_u32; 3];
        for b in patch.blocks(self.points, slabs.len() as f64 * self.grid_size) {
            for i in self.points.block(b as usize) {
                let [x, y, z] = patch.frame.local(self.points.positions[i]);
                let slab = (z.abs() / self.grid_size - 1.0).max(0.0).ceil() as usize;
                let over = patch.tiles.tile_at([x, y]);
                if slab < slabs.len()
                    && over.is_some_and(|t| patch.tiles.supported()[t])
                    && !self.points.facing.as_ref().is_some_and(|f| patch.turned_away(f[i]))
                {
                    slabs[slab] += 1;
                }
            }
        }
        [1, 2].map(|k| f64::from(slabs[k]) / f64::from(slabs[0].max(1)))
    }
}

/// Fourth moment of the heights of the points of a patch by the square of the second.
fn kurtosis(points: &Points, patch: &Patch) -> f64 {
    let (mut second, mut fourth) = (0.0, 0.0);
    for &i in &patch.whole {
        let square = patch.frame.local(points.positions[i as usize])[2].powi(2);
        second += square;
        fourth += square * square;
    }
    let n = patch.whole.len() as f64;
    if second > 0.0 { n * fourth / (second * second) } else { NORMAL_KURTOSIS }
}

/// Root mean square of what `x^2`, `x y` and `y^2` explain of the heights of a patch's points, beyond what a plane does, over the middle
/// of its rectangle, metres: at the edges of a box points of the next face bend it too.
fn bend(points: &Points, patch: &Patch) -> f64 {
    let (low, size) = (patch.tiles.low(), patch.tiles.size());
    let mut products = SMatrix::<f64, 6, 6>::zeros();
    let mut heights = SVector::<f64, 6>::zeros();
    let mut n = 0.0;
    for &i in &patch.whole {
        let [x, y, z] = patch.frame.local(points.positions[i as usize]);
        let [x, y] = [(x - low[0]) / size[0], (y - low[1]) / size[1]].map(|c| 2.0 * c - 1.0);
        if x.abs() <= BEND_INNER && y.abs() <= BEND_INNER {
            let terms = SVector::from([1.0, x, y, x * x, x * y, y * y]);
            products += terms * terms.transpose();
            heights += terms * z;
            n += 1.0;
        }
    }
    // With fewer points any surface goes through them.
    if n < 12.0 {
        return 0.0;
    }
    let plane: SMatrix<f64, 3, 3> = products.fixed_view::<3, 3>(0, 0).into_owned();
    let of_plane: SVector<f64, 3> = heights.fixed_rows::<3>(0).into_owned();
    let explained = products.cholesky().map_or(0.0, |c| heights.dot(&c.solve(&heights)));
    let by_plane = plane.cholesky().map_or(0.0, |c| of_plane.dot(&c.solve(&of_plane)));
    ((explained - by_plane).max(0.0) / n).sqrt()
}

impl Evidence {
    /// What the network gets: the logarithms of the figures. Sizes and numbers beyond which more says nothing count as these.
    pub fn inputs(&self) -> [f64; FIGURES] {
        [
            self.gain,
            self.spread,
            self.kurtosis,
            self.fill,
            self.certainty,
            self.length.min(MOST_LENGTH),
            self.width.min(MOST_WIDTH),
            self.near,
            self.within,
            self.points.min(MOST_POINTS),
            self.bend,
            self.turn,
            self.beside,
            self.far_beside,
        ]
        .map(|x| x.max(LEAST_FIGURE).ln())
    }

    /// The probability that a patch with this evidence is one surface: `1 / (1 + exp(-b - sum_u v_u tanh(b_u + sum_k c_uk ln x_k)))`.
    pub fn probability(&self) -> f64 {
        let x = self.inputs();
        let out = SURFACE_UNITS.iter().map(|unit| {
            let sum: f64 = unit.weights.iter().zip(&x).map(|(c, x)| c * x).sum();
            unit.output * (unit.offset + sum).tanh()
        });
        1.0 / (1.0 + (-SURFACE_OFFSET - out.sum::<f64>()).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of normal noise, a filled rectangle, its points on nothing else.
    const SURFACE: Evidence = Evidence {
        gain: 3.0,
        spread: 1.0,
        kurtosis: 3.0,
        fill: 0.8,
        certainty: 0.95,
        length: 100.0,
        width: 60.0,
        near: 0.88,
        within: 1.0,
        points: 1000.0,
        bend: 0.05,
        turn: 1.0,
        beside: 0.05,
        far_beside: 0.05,
    };

    #[test]
    fn what_looks_like_a_surface_is_probably_one() {
        assert!(SURFACE.probability() > 0.8);
    }

    #[test]
    fn each_sign_of_something_else_lowers_the_probability() {
        let signs = [
            Evidence { gain: 0.5, ..SURFACE },
            Evidence { spread: 1.5, ..SURFACE },
            Evidence { kurtosis: 1.8, ..SURFACE },
            Evidence { fill: 0.3, ..SURFACE },
            Evidence { length: 5.0, width: 5.0, ..SURFACE },
            Evidence { near: 0.6, ..SURFACE },
        ];
        for sign in signs {
            assert!(sign.probability() < SURFACE.probability(), "{sign:?}");
        }
        // A facet of something round.
        assert!(Evidence { bend: 0.6, turn: 0.5, ..SURFACE }.probability() < 0.1);
    }

    #[test]
    fn exact_surfaces_of_any_size_are_surfaces() {
        for length in [10.0, 30.0, 100.0, 1000.0] {
            let exact = Evidence { spread: 0.0, within: 0.0, near: 1.0, length, ..SURFACE };
            let exact = Evidence { width: 0.6 * length, certainty: 1.0, fill: 1.0, ..exact };
            assert!(exact.probability() > 0.9, "{exact:?}");
        }
    }
}
