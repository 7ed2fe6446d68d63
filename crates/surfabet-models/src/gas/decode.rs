//! Back to a cloud: the neurons alone, or their discs filled at any spacing, and edges where discs do not meet.

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, KdTree, PointCloud, Progress};

use super::constants::{
    BLEND_WIDTH, DISC_REACH, DISCS_PER_CHECK, LEAST_BLEND_COSINE, POINTS_PER_EDGE,
};
use super::distance;
use super::model::GasModel;
use crate::color::rounded;
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};
use crate::spread::across;
use crate::vector::{cross, dot, least_axis};

/// A decoded point.
#[derive(Debug, Clone, Copy)]
struct Point {
    position: [f32; 3],
    normal: [f32; 3],
    color: [u8; 3],
    intensity: f32,
}

/// The surface about a neuron.
struct Blended {
    /// Above the neuron's plane, metres.
    height: f64,
    color: [f32; 3],
    intensity: f32,
}

impl GasModel {
    /// The model as a cloud about its origin.
    ///
    /// Without a spacing the neurons are the points, or, as measured, the spacing is a third of the mean edge. With one, every
    /// neuron's disc is filled with a square lattice,
    /// as far as no other neuron is nearer, at the height to which its own plane and those of its neighbours
    /// agree; where neighbours' discs do not meet, or have no plane, the edge between them is filled. Colours
    /// and intensities blend from neuron to neuron.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`],
    /// [`crate::Error::Cancelled`].
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        progress.check()?;
        let points = match options.resolution {
            None if !options.as_measured => {
                check_points(self.mean_error(), self.len() as f64, options.max_points)?;
                (0..self.len()).map(|i| self.neuron_point(i)).collect()
            }
            _ => self.fill(&options, progress)?,
        };
        let parts = CloudParts {
            origin: self.origin(),
            positions: points.iter().map(|p| p.position).collect(),
            colors: self.has_color().then(|| points.iter().map(|p| p.color).collect()),
            intensities: self.has_intensity().then(|| points.iter().map(|p| p.intensity).collect()),
            normals: options.normals.then(|| points.iter().map(|p| p.normal).collect()),
            ..CloudParts::default()
        };
        Ok(PointCloud::from_parts(parts)?.0)
    }

    /// Spacing of filled discs where none is given: a third of the mean edge, metres.
    fn own_spacing(&self) -> f64 {
        let sum: f64 = self.edges.iter().map(|&edge| self.edge_length(edge)).sum();
        let mean = sum / self.edges.len() as f64;
        // Without edges there is a disc or none, and any spacing will do.
        if mean > 0.0 { POINTS_PER_EDGE * mean } else { self.position_step() }
    }

    /// The point at a neuron.
    fn neuron_point(&self, i: usize) -> Point {
        Point {
            position: self.position(i),
            normal: self.normal(i),
            color: rounded(self.color(i)),
            intensity: self.intensity(i),
        }
    }

    /// Radius of a decoded disc, metres; zero where the plane is unknown.
    fn reach(&self, i: usize) -> f64 {
        if self.neurons[i].normal.is_some() { DISC_REACH * self.radius(i) } else { 0.0 }
    }

    /// Points of all discs and of the edges between them.
    fn fill(&self, options: &DecodeOptions, progress: &dyn Progress) -> Result<Vec<Point>> {
        let spacing = options.spacing(self.own_spacing())?;
        let squares = |i: usize| (2.0 * self.reach(i) / spacing + 1.0).powi(2);
        let links = |e: &[u32; 2]| self.edge_length(*e) / spacing;
        let most =
            (0..self.len()).map(squares).sum::<f64>() + self.edges.iter().map(links).sum::<f64>();
        check_points(spacing, most, options.max_points)?;
        let tree = KdTree::new(&self.positions())?;
        let discs = parallel::try_map_range(self.len(), |i| -> Result<Vec<Point>> {
            if i % DISCS_PER_CHECK == 0 {
                progress.check()?;
            }
            Ok(self.disc(i, spacing, options.as_measured, &tree))
        })?;
        progress.update("decoding", 0.9);
        let links = parallel::map(&self.edges, |&edge| self.link(edge, spacing));
        progress.check()?;
        Ok(discs.into_iter().chain(links).flatten().collect())
    }

    /// Length of an edge, metres.
    pub(super) fn edge_length(&self, [a, b]: [u32; 2]) -> f64 {
        distance(self.position(a as usize), self.position(b as usize))
    }

    /// The points of a neuron's disc; its own position where it has none.
    fn disc(&self, i: usize, spacing: f64, as_measured: bool, tree: &KdTree) -> Vec<Point> {
        let reach = self.reach(i);
        if reach < 0.5 * spacing {
            return vec![self.neuron_point(i)];
        }
        let normal = self.normal(i).map(f64::from);
        let [u, v] = tangents(normal);
        let center = self.position(i).map(f64::from);
        let thickness = if as_measured { self.thickness(i) } else { 0.0 };
        let n = (reach / spacing).floor() as i64;
        let mut points = Vec::new();
        for row in -n..=n {
            for column in -n..=n {
                let (a, b) = (column as f64 * spacing, row as f64 * spacing);
                if a * a + b * b > reach * reach {
                    continue;
                }
                let on: [f64; 3] = std::array::from_fn(|c| center[c] + a * u[c] + b * v[c]);
                if tree.nearest(on.map(|c| c as f32)).is_none_or(|n| n.index() != i) {
                    continue;
                }
                let Blended { height, color, intensity } = self.blend(i, on, normal);
                let depth = height + across(thickness, points.len());
                points.push(Point {
                    position: std::array::from_fn(|c| (on[c] + depth * normal[c]) as f32),
                    normal: normal.map(|c| c as f32),
                    color: rounded(color),
                    intensity,
                });
            }
        }
        if points.is_empty() { vec![self.neuron_point(i)] } else { points }
    }

    /// Height of the surface above the place x on the plane of neuron `i` with normal n, its colour and its intensity: weighted
    /// means over the neuron and its neighbours.
    ///
    /// Neuron j at p_j with normal n_j has the weight `exp(-2 |p_j - x|^2 / r_i^2)`, and its plane is at the height
    /// `(p_j - x) n_j / (n_j n)` above x along n.
    fn blend(&self, i: usize, on: [f64; 3], normal: [f64; 3]) -> Blended {
        let width = BLEND_WIDTH / self.radius(i).powi(2);
        let (mut height, mut planes, mut total) = (0.0, 0.0, 0.0);
        let (mut color, mut intensity) = ([0.0; 3], 0.0);
        for j in std::iter::once(i).chain(self.adjacency.of(i).iter().map(|&j| j as usize)) {
            let p = self.position(j);
            let off: [f64; 3] = std::array::from_fn(|c| f64::from(p[c]) - on[c]);
            let weight = (-width * dot(off, off)).exp();
            let own = self.color(j);
            (0..3).for_each(|c| color[c] += weight * f64::from(own[c]));
            intensity += weight * f64::from(self.intensity(j));
            total += weight;
            let plane = self.normal(j).map(f64::from);
            let cosine = dot(plane, normal);
            if cosine > LEAST_BLEND_COSINE {
                height += weight * dot(off, plane) / cosine;
                planes += weight;
            }
        }
        let height = if planes > 0.0 { height / planes } else { 0.0 };
        if total > 0.0 {
            let color = color.map(|c| (c / total) as f32);
            return Blended { height, color, intensity: (intensity / total) as f32 };
        }
        Blended { height, color: self.color(i), intensity: self.intensity(i) }
    }

    /// The points on the edge between neighbours whose discs do not meet.
    fn link(&self, [a, b]: [u32; 2], spacing: f64) -> Vec<Point> {
        let (i, j) = (a as usize, b as usize);
        let length = self.edge_length([a, b]);
        let (from, to) = (self.reach(i), length - self.reach(j));
        let n = ((to - from) / spacing).ceil() - 1.0;
        if n.is_nan() || n < 1.0 {
            return Vec::new();
        }
        let (p, q) = (self.position(i).map(f64::from), self.position(j).map(f64::from));
        let (c, d) = (self.color(i), self.color(j));
        let [e, f] = [i, j].map(|k| self.intensity(k));
        (1..=n as u64)
            .map(|k| {
                let share = (from + (to - from) * k as f64 / (n + 1.0)) / length;
                let near = if share < 0.5 { i } else { j };
                Point {
                    position: std::array::from_fn(|x| (p[x] + share * (q[x] - p[x])) as f32),
                    normal: self.normal(near),
                    color: rounded(std::array::from_fn(|x| c[x] + share as f32 * (d[x] - c[x]))),
                    intensity: e + share as f32 * (f - e),
                }
            })
            .collect()
    }
}

/// Two unit vectors at right angles to a unit normal and each other.
pub(super) fn tangents(n: [f64; 3]) -> [[f64; 3]; 2] {
    let axis = least_axis(n);
    let u = cross(n, axis);
    let length = dot(u, u).sqrt();
    let u = if length > 0.0 { u.map(|c| c / length) } else { axis };
    [u, cross(n, u)]
}
