//! Weighted moments of a point set up to second order: weight, mean and scatter, and the plane they describe.

use nalgebra::{Matrix3, SymmetricEigen};

/// Most sweeps of the eigenvalue iteration; a symmetric 3x3 matrix takes about ten.
const MAX_ITERATIONS: usize = 100;

/// Weighted moments: sum of weights w, mean m and scatter, the sum of w (p - m)(p - m)^T.
///
/// Kept about the mean and in `f64`, so that far from the origin nothing cancels; two sets are merged with the
/// pairwise update of Chan, Golub and LeVeque (1983).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    weight: f64,
    mean: [f64; 3],
    /// xx, xy, xz, yy, yz, zz.
    scatter: [f64; 6],
}

/// Points on a line spread across it by less than this share of their length.
const NARROWEST: f64 = 1e-6;

/// The least-squares plane of a point set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedPlane {
    /// Weighted mean of the points, metres.
    pub mean: [f64; 3],
    /// Unit normal; its sign carries no meaning.
    pub normal: [f64; 3],
    /// Root of the weighted mean squared distance of the points from the plane, metres.
    pub standard_deviation: f64,
    /// Surface variation, see [`PrincipalAxes::curvature`].
    pub curvature: f64,
}

/// Axes of a point set: standard deviations squared along orthonormal directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalAxes {
    /// Variances in square metres, smallest first, none negative.
    pub variances: [f64; 3],
    /// A unit vector per variance, orthogonal to the others; their signs carry no meaning.
    pub directions: [[f64; 3]; 3],
}

impl PrincipalAxes {
    /// The unit normal of the least-squares plane through the mean.
    pub fn normal(&self) -> [f64; 3] {
        self.directions[0]
    }

    /// Surface variation (Pauly, Gross and Kobbelt 2002): the share of the smallest variance, 0 on a plane and at
    /// most 1/3.
    pub fn curvature(&self) -> f64 {
        let total: f64 = self.variances.iter().sum();
        if total > 0.0 { self.variances[0] / total } else { 0.0 }
    }
}

impl Moments {
    /// Moments of no points.
    pub fn new() -> Self {
        Self::default()
    }

    /// Moments of points with weight one each, summed about `center`: fast, and exact where the points lie
    /// around it. Positions are taken relative to the origin, not to `center`.
    pub fn about(center: [f32; 3], points: impl IntoIterator<Item = [f32; 3]>) -> Self {
        let mut count = 0.0;
        let mut sum = [0.0; 3];
        let mut product = [0.0; 6];
        for p in points {
            let [x, y, z]: [f64; 3] =
                std::array::from_fn(|a| f64::from(p[a]) - f64::from(center[a]));
            count += 1.0;
            sum[0] += x;
            sum[1] += y;
            sum[2] += z;
            product[0] += x * x;
            product[1] += x * y;
            product[2] += x * z;
            product[3] += y * y;
            product[4] += y * z;
            product[5] += z * z;
        }
        if count == 0.0 {
            return Self::default();
        }
        let mean = sum.map(|s| s / count);
        let shift = outer(mean);
        Self {
            weight: count,
            mean: std::array::from_fn(|a| f64::from(center[a]) + mean[a]),
            scatter: std::array::from_fn(|i| product[i] - count * shift[i]),
        }
    }

    /// Moments of weighted points near zero, summed without re-centring: fast, and exact to about
    /// `1e-16 (distance from zero / spread)^2`.
    pub fn of_offsets(points: impl IntoIterator<Item = ([f32; 3], f32)>) -> Self {
        let mut weight = 0.0;
        let mut sum = [0.0; 3];
        let mut product = [0.0; 6];
        for (p, w) in points {
            let [x, y, z] = p.map(f64::from);
            let w = f64::from(w);
            let [wx, wy, wz] = [w * x, w * y, w * z];
            weight += w;
            sum = [sum[0] + wx, sum[1] + wy, sum[2] + wz];
            product[0] += wx * x;
            product[1] += wx * y;
            product[2] += wx * z;
            product[3] += wy * y;
            product[4] += wy * z;
            product[5] += wz * z;
        }
        if weight == 0.0 {
            return Self::default();
        }
        let mean = sum.map(|s| s / weight);
        let shift = outer(mean);
        let scatter = std::array::from_fn(|i| product[i] - weight * shift[i]);
        Self { weight, mean, scatter }
    }

    /// Adds a point with a weight; a weight of zero changes nothing. Weights are finite and not negative.
    pub fn add(&mut self, point: [f64; 3], weight: f64) {
        self.merge(&Self { weight, mean: point, scatter: [0.0; 6] });
    }

    /// Adds all points of `other`.
    pub fn merge(&mut self, other: &Self) {
        if other.weight == 0.0 {
            return;
        }
        if self.weight == 0.0 {
            *self = *other;
            return;
        }
        let weight = self.weight + other.weight;
        let share = other.weight / weight;
        let delta: [f64; 3] = std::array::from_fn(|a| other.mean[a] - self.mean[a]);
        let shift = outer(delta);
        for (i, s) in self.scatter.iter_mut().enumerate() {
            *s += other.scatter[i] + self.weight * share * shift[i];
        }
        for (a, m) in self.mean.iter_mut().enumerate() {
            *m += share * delta[a];
        }
        self.weight = weight;
    }

    /// The moments of the same points moved by `offset`.
    pub fn shifted(self, offset: [f64; 3]) -> Self {
        Self { mean: std::array::from_fn(|a| self.mean[a] + offset[a]), ..self }
    }

    /// Sum of the weights; the number of points where all are one.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Weighted mean, metres; zero without points.
    pub fn mean(&self) -> [f64; 3] {
        self.mean
    }

    /// Sum of w (p - mean)(p - mean)^T, square metres.
    pub fn scatter(&self) -> [[f64; 3]; 3] {
        let [xx, xy, xz, yy, yz, zz] = self.scatter;
        [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    }

    /// Scatter per weight, square metres; zero without points.
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        if self.weight == 0.0 {
            return [[0.0; 3]; 3];
        }
        self.scatter().map(|row| row.map(|s| s / self.weight))
    }

    /// The plane through the mean with the least weighted sum of squared distances, in metres.
    ///
    /// `None` when the points span none: a single place or a line, as closely as coordinates with a rounding error
    /// of `rounding` metres can tell (zero for exact ones), or when [`Moments::principal_axes`] is `None`. Two
    /// points are on a line always.
    pub fn plane(&self, rounding: f64) -> Option<FittedPlane> {
        let axes = self.principal_axes()?;
        let narrow = (NARROWEST * NARROWEST * axes.variances[2]).max(rounding * rounding);
        (axes.variances[1] > narrow).then(|| FittedPlane {
            mean: self.mean,
            normal: axes.normal(),
            standard_deviation: axes.variances[0].sqrt(),
            curvature: axes.curvature(),
        })
    }

    /// Eigenvalues and eigenvectors of the covariance.
    ///
    /// `None` without points, where a moment is not finite, or where the iteration does not converge within its
    /// bound.
    pub fn principal_axes(&self) -> Option<PrincipalAxes> {
        let covariance = self.covariance();
        let largest = covariance.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        if self.weight <= 0.0 || !covariance.iter().flatten().all(|c| c.is_finite()) {
            return None;
        }
        // Scaled, so that the iteration's idea of zero is relative to the set's own size.
        let scale = if largest > 0.0 { largest } else { 1.0 };
        let matrix = Matrix3::from_fn(|r, c| covariance[r][c] / scale);
        let eigen = SymmetricEigen::try_new(matrix, f64::EPSILON, MAX_ITERATIONS)?;
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        Some(PrincipalAxes {
            variances: order.map(|i| eigen.eigenvalues[i].max(0.0) * scale),
            directions: order.map(|i| eigen.eigenvectors.column(i).into_owned().into()),
        })
    }
}

/// Upper triangle of v v^T.
fn outer([x, y, z]: [f64; 3]) -> [f64; 6] {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of(points: &[([f64; 3], f64)]) -> Moments {
        let mut moments = Moments::new();
        for &(p, w) in points {
            moments.add(p, w);
        }
        moments
    }

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance
    }

    #[test]
    fn a_small_case_by_hand() {
        let m = of(&[([0.0, 0.0, 0.0], 1.0), ([4.0, 0.0, 2.0], 3.0)]);
        assert_eq!(m.weight(), 4.0);
        assert_eq!(m.mean(), [3.0, 0.0, 1.5]);
        // 1 * 9 + 3 * 1 and so on.
        assert_eq!(m.scatter(), [[12.0, 0.0, 6.0], [0.0; 3], [6.0, 0.0, 3.0]]);
        let axes = m.principal_axes().unwrap();
        assert!(close(axes.variances[2], 15.0 / 4.0, 1e-14));
        assert!(close(axes.variances[1], 0.0, 1e-14));
    }

    #[test]
    fn offsets_have_the_moments_of_their_points() {
        let points = [([0.5, 0.25, -1.0], 2.0), ([0.0, 1.5, 0.75], 1.0), ([-0.5, 0.0, 0.0], 4.0)];
        let one_by_one = of(&points);
        let points = points.map(|(p, w)| (p.map(|c| c as f32), w as f32));
        let at_once = Moments::of_offsets(points);
        assert_eq!(at_once.weight(), one_by_one.weight());
        for (a, b) in at_once.mean().iter().zip(one_by_one.mean()) {
            assert!(close(*a, b, 1e-15));
        }
        for (a, b) in at_once.scatter().iter().flatten().zip(one_by_one.scatter().as_flattened()) {
            assert!(close(*a, *b, 1e-14));
        }
        assert_eq!(Moments::of_offsets([]), Moments::new());
    }

    #[test]
    fn utm_coordinates_lose_nothing() {
        let far = |x: f64, y: f64, z: f64| ([500_000.0 + x, 5_400_000.0 + y, 300.0 + z], 1.0);
        let m = of(&[far(0.0, 0.0, 0.0), far(0.001, 0.0, 0.0), far(0.0, 0.002, 0.0)]);
        let axes = m.principal_axes().unwrap();
        assert!(axes.normal()[2].abs() > 1.0 - 1e-9);
        assert!(close(m.scatter()[0][0], 2.0 / 3.0 * 1e-6, 1e-9));
    }

    #[test]
    fn a_plane_by_hand() {
        // Two layers, 0.2 apart, of a square.
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let points: Vec<_> =
            square.iter().flat_map(|&[x, y]| [([x, y, 2.9], 1.0), ([x, y, 3.1], 1.0)]).collect();
        let plane = of(&points).plane(0.0).unwrap();
        assert!(plane.normal[2].abs() > 1.0 - 1e-12);
        assert!(close(plane.standard_deviation, 0.1, 1e-12));
        for (m, e) in plane.mean.iter().zip([0.5, 0.5, 3.0]) {
            assert!(close(*m, e, 1e-12));
        }
        assert!(of(&points[..2]).plane(0.0).is_none());
        let line: Vec<_> =
            (0..9).map(|i| ([0.1, 0.2, 0.3].map(|c| c * f64::from(i)), 1.0)).collect();
        assert!(of(&line).plane(0.0).is_none());
    }

    #[test]
    fn nothing_and_one_point() {
        assert_eq!(Moments::new().principal_axes(), None);
        assert_eq!(Moments::new().covariance(), [[0.0; 3]; 3]);
        let axes = of(&[([1.0, 2.0, 3.0], 2.0)]).principal_axes().unwrap();
        assert_eq!(axes.variances, [0.0; 3]);
        assert_eq!(axes.curvature(), 0.0);
    }

    fn weighted() -> impl Strategy<Value = Vec<([f64; 3], f64)>> {
        prop::collection::vec((prop::array::uniform3(-10.0..10.0), 0.0..5.0), 1..60)
    }

    proptest! {
        #[test]
        fn merging_parts_equals_adding_all(points in weighted(), cut in 0_usize..60) {
            let cut = cut.min(points.len());
            let mut merged = of(&points[..cut]);
            merged.merge(&of(&points[cut..]));
            let all = of(&points);
            prop_assert!(close(merged.weight(), all.weight(), 1e-9));
            for a in 0..3 {
                prop_assert!(close(merged.mean()[a], all.mean()[a], 1e-9));
                for b in 0..3 {
                    prop_assert!(close(merged.scatter()[a][b], all.scatter()[a][b], 1e-8));
                }
            }
        }

        #[test]
        fn axes_rebuild_the_covariance(points in weighted()) {
            let m = of(&points);
            prop_assume!(m.weight() > 1e-3);
            let axes = m.principal_axes().unwrap();
            prop_assert!(axes.variances[0] <= axes.variances[1]);
            prop_assert!(axes.variances[1] <= axes.variances[2]);
            for r in 0..3 {
                for c in 0..3 {
                    let sum: f64 = (0..3)
                        .map(|i| axes.variances[i] * axes.directions[i][r] * axes.directions[i][c])
                        .sum();
                    prop_assert!(close(sum, m.covariance()[r][c], 1e-10));
                    let dot: f64 =
                        (0..3).map(|a| axes.directions[r][a] * axes.directions[c][a]).sum();
                    prop_assert!(close(dot, f64::from(u8::from(r == c)), 1e-12));
                }
            }
            prop_assert!((0.0..=1.0 / 3.0 + 1e-12).contains(&axes.curvature()));
        }

        #[test]
        fn summing_about_a_center_equals_adding(
            points in prop::collection::vec(prop::array::uniform3(-10.0_f32..10.0), 1..60)
        ) {
            let fast = Moments::about(points[0], points.iter().copied());
            let slow = of(&points.iter().map(|p| (p.map(f64::from), 1.0)).collect::<Vec<_>>());
            for a in 0..3 {
                prop_assert!(close(fast.mean()[a], slow.mean()[a], 1e-10));
                for b in 0..3 {
                    prop_assert!(close(fast.scatter()[a][b], slow.scatter()[a][b], 1e-8));
                }
            }
        }
    }
}
