//! Points spread over the exposed surface.

use surfabet_base::parallel;
use surfabet_geom::{Error, Result};

use super::{Scene, SurfaceSamples, to_array};
use crate::solid::Shape;

impl Scene {
    /// Points of the exposed surface, about one per `spacing` x `spacing`, each the middle of a cell of at most
    /// that size; cells whose middle is covered by another solid are left out.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `spacing` is at least 0.5 mm.
    pub fn sample_surface(&self, spacing: f64) -> Result<SurfaceSamples> {
        if !(spacing >= 5e-4 && spacing.is_finite()) {
            return Err(Error::invalid("spacing", spacing, "finite and at least 0.0005 m"));
        }
        let mut samples = SurfaceSamples::default();
        for (s, solid) in self.solids.iter().enumerate() {
            for face in (0..solid.shape.faces()).filter(|f| solid.hidden & (1 << f) == 0) {
                let parameters = sample_face(&solid.shape, face, spacing);
                let found = parallel::gather(parameters.len(), |i, found| {
                    let on = solid.shape.at(face, parameters[i]);
                    let place = self.to_world(s, &on);
                    if !self.is_covered(s, &place) {
                        found.push((place, self.surface(s, &on)));
                    }
                });
                samples.instances.extend(found.iter().map(|_| solid.instance));
                samples.surfaces.extend(found.iter().map(|(_, surface)| surface));
                samples.points.extend(found.iter().map(|((point, _), _)| to_array(point)));
                let normal = |((_, normal), _): &(_, _)| to_array(normal).map(|c| c as f32);
                samples.normals.extend(found.iter().map(normal));
            }
        }
        Ok(samples)
    }
}

/// Parameters of cell middles over a face, cells of about `spacing` in both directions.
fn sample_face(shape: &Shape, face: u8, spacing: f64) -> Vec<[f64; 2]> {
    let steps = |length: f64| ((length / spacing).ceil()).max(1.0) as usize;
    let middle =
        |low: f64, high: f64, i: usize, n: usize| low + (high - low) * (i as f64 + 0.5) / n as f64;
    let turn = std::f64::consts::TAU;
    let mut parameters = Vec::new();
    match *shape {
        Shape::Cuboid(_) => {
            for cell in shape.cells(face) {
                let (n, m) = (steps(cell.high[0] - cell.low[0]), steps(cell.high[1] - cell.low[1]));
                for i in 0..n {
                    let u = middle(cell.low[0], cell.high[0], i, n);
                    parameters.extend((0..m).map(|j| [u, middle(cell.low[1], cell.high[1], j, m)]));
                }
            }
        }
        Shape::Cylinder(radius, half) if face == 0 => {
            let (n, m) = (steps(turn * radius), steps(2.0 * half));
            for i in 0..n {
                let angle = middle(0.0, turn, i, n);
                parameters.extend((0..m).map(|j| [angle, middle(-half, half, j, m)]));
            }
        }
        Shape::Cylinder(radius, _) => {
            let m = steps(radius);
            for j in 0..m {
                let r = middle(0.0, radius, j, m);
                let n = steps(turn * r);
                parameters.extend((0..n).map(|i| [middle(0.0, turn, i, n), r]));
            }
        }
        Shape::Sphere(radius) => {
            let m = steps(0.5 * turn * radius);
            for j in 0..m {
                let latitude = middle(-0.25 * turn, 0.25 * turn, j, m);
                let n = steps(turn * radius * latitude.cos());
                parameters.extend((0..n).map(|i| [middle(0.0, turn, i, n), latitude]));
            }
        }
    }
    parameters
}
