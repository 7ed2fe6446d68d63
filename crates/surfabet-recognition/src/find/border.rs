//! Where an example ends, and whether a place ends there too: a part of a wall is no door, though every point of it looks like one.

use std::f64::consts::TAU;

use surfabet_geom::vector::{cross, dot, least_axis, unit};

use super::motion::Motion;
use super::scene::SearchScene;
use super::template::Template;
use crate::constants::{BEYOND_BORDER, BORDER_DIRECTIONS, BORDER_STEP, FINE_SAMPLES};

/// Positions beyond the border of an example, each with the number of the sample that would be continued there.
pub(super) struct Border(Vec<(u32, [f32; 3])>);

impl Border {
    /// Of the first samples: in the plane of each, [`BORDER_STEP`] spacings away, where no other sample is near.
    pub fn of(template: &Template) -> Self {
        let step = BORDER_STEP * template.spacing;
        let least = (BEYOND_BORDER * step) as f32;
        let mut beyond = Vec::new();
        for i in 0..template.points.len().min(FINE_SAMPLES) {
            let normal = template.normals[i].map(f64::from);
            let right = unit(cross(normal, least_axis(normal)));
            let up = cross(normal, right);
            for k in 0..BORDER_DIRECTIONS {
                let (s, c) = (TAU * f64::from(k) / f64::from(BORDER_DIRECTIONS)).sin_cos();
                let at: [f32; 3] = std::array::from_fn(|a| {
                    template.points[i][a] + (step * (c * right[a] + s * up[a])) as f32
                });
                let nearest = template.tree.nearest(at);
                if nearest.is_none_or(|n| n.squared_distance() > least * least) {
                    beyond.push((i as u32, at));
                }
            }
        }
        Self(beyond)
    }

    /// The share of the border, by weight, at which a place ends as the example does: of the samples that it matches, those that no
    /// surface of their plane and colour continues. 1 where nothing matches.
    pub fn kept(
        &self,
        template: &Template,
        scene: &SearchScene,
        motion: &Motion,
        matches: &[f32],
    ) -> f64 {
        let (mut goes_on, mut all) = (0.0, 0.0);
        for &(i, at) in &self.0 {
            let i = i as usize;
            let weight = template.weights[i] * f64::from(matches[i]);
            if weight <= 0.0 {
                continue;
            }
            all += weight;
            let arm = motion.arm(at);
            let p: [f32; 3] =
                std::array::from_fn(|a| (arm[a] + template.pivot[a] + motion.shift[a]) as f32);
            let Some(near) = scene.tree.nearest(p) else { continue };
            let q = scene.surface.points[near.index()];
            let d: [f32; 3] = std::array::from_fn(|a| p[a] - q[a]);
            // Along the border the nearest sample is within the spacing.
            if f64::from(dot(d, d)) > (2.0 * template.spacing).powi(2) {
                continue;
            }
            let turned = motion.turned(template.normals[i]).map(|c| c as f32);
            let normal = scene.surface.normals[near.index()];
            goes_on += weight
                * template.color_similarity(scene, i, near.index())
                * template.nearness(d, normal, turned, template.tolerance);
        }
        1.0 - goes_on / f64::max(all, f64::MIN_POSITIVE)
    }
}
