//! Where an example ends, and whether a place ends there too: a part of a wall is no door, though every point of it looks like one.

use std::f64::consts::TAU;

use surfabet_geom::KdTree;
use surfabet_geom::vector::{cross, dot, largest, length, minus, unit};
use surfabet_models::Result;

use super::motion::Motion;
use super::scene::SearchScene;
use super::template::Template;
use crate::constants::{
    BEYOND_BORDER, BORDER_DIRECTIONS, BORDER_REACH, BORDER_STEP, FINE_SAMPLES, LEAST_SIDE,
};
use crate::surface::color_similarity;

/// Positions beyond the border of an example.
pub(super) struct Border(Vec<Beyond>);

/// A position beyond the border.
struct Beyond {
    /// The sample that would be continued there.
    sample: u32,
    at: [f32; 3],
    /// Which of [`BORDER_DIRECTIONS`] it lies in.
    side: usize,
}

impl Border {
    /// Of the first samples: in the plane of each, [`BORDER_STEP`] spacings away, where no other sample is near.
    pub fn of(template: &Template) -> Self {
        Self(beyond(template, FINE_SAMPLES))
    }

    /// The share of the border, by weight, at which a place ends, of the side that ends least: of the samples that it matches, those that
    /// no surface of their plane continues in one colour. Colours of the scene are compared with one another, from inside to
    /// outside as far as its words mix them, since those of the example may differ from both by as much. Sides with few of the
    /// samples do not count. 1 where nothing matches.
    pub fn kept(
        &self,
        template: &Template,
        scene: &SearchScene,
        motion: &Motion,
        matches: &[f32],
    ) -> f64 {
        let mut sides = [(0.0, 0.0); BORDER_DIRECTIONS as usize];
        for beyond in &self.0 {
            let i = beyond.sample as usize;
            let weight = template.weights[i] * f64::from(matches[i]);
            if weight > 0.0 {
                let (goes_on, all) = &mut sides[beyond.side];
                *all += weight;
                *goes_on += weight * continued(template, scene, motion, beyond);
            }
        }
        let all: f64 = sides.iter().map(|s| s.1).sum();
        let counts = sides.iter().filter(|s| s.1 > LEAST_SIDE * all);
        let most = counts.map(|(goes_on, all)| goes_on / all).fold(0.0, f64::max);
        1.0 - most
    }
}

/// How much a place goes on beyond a sample, 0 to 1.
fn continued(template: &Template, scene: &SearchScene, motion: &Motion, beyond: &Beyond) -> f64 {
    let i = beyond.sample as usize;
    let (Some(tolerance), Some(colors)) = (scene.color_tolerance, &scene.surface.colors) else {
        return 0.0;
    };
    let at = template.points[i];
    let Some(nearest) = scene.tree.nearest(template.moved(motion, i)) else { return 0.0 };
    let way = minus(beyond.at, at);
    let reach = BORDER_REACH as f32 * scene.surface.color_radii[nearest.index()];
    let reach = reach.max(length(way));
    let outside = |times: f32| -> Option<(usize, f64)> {
        let step = way.map(|c| times * reach * c / length(way));
        let arm = motion.arm(std::array::from_fn(|a| at[a] + step[a]));
        let p: [f32; 3] =
            std::array::from_fn(|a| (arm[a] + template.pivot[a] + motion.shift[a]) as f32);
        let near = scene.tree.nearest(p)?;
        let d = minus(p, scene.surface.points[near.index()]);
        // Along the border the nearest sample is within the spacing.
        if f64::from(dot(d, d)) > (2.0 * template.spacing).powi(2) {
            return None;
        }
        let turned = motion.turned(template.normals[i]).map(|c| c as f32);
        let normal = scene.surface.normals[near.index()];
        Some((near.index(), template.nearness(d, normal, turned, template.tolerance)))
    };
    let (Some((out, nearness)), Some((inner, _))) = (outside(1.0), outside(-1.0)) else {
        return 0.0;
    };
    nearness * color_similarity(colors[inner], colors[out], tolerance)
}

/// Positions beyond the border of the first `n` samples.
fn beyond(template: &Template, n: usize) -> Vec<Beyond> {
    let step = BORDER_STEP * template.spacing;
    let least = (BEYOND_BORDER * step) as f32;
    let mut beyond = Vec::new();
    for i in 0..template.points.len().min(n) {
        let [right, up] = plane_of(template.normals[i].map(f64::from));
        for k in 0..BORDER_DIRECTIONS {
            let (s, c) = (TAU * f64::from(k) / f64::from(BORDER_DIRECTIONS)).sin_cos();
            let at: [f32; 3] = std::array::from_fn(|a| {
                template.points[i][a] + (step * (c * right[a] + s * up[a])) as f32
            });
            let nearest = template.tree.nearest(at);
            if nearest.is_none_or(|n| n.squared_distance() > least * least) {
                beyond.push(Beyond { sample: i as u32, at, side: k as usize });
            }
        }
    }
    beyond
}

/// Two directions in the plane of a normal: level and uphill, or on a level plane any. They are the same for a normal and its opposite.
fn plane_of(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let main = largest(normal.map(f64::abs));
    let normal = normal.map(|c| c * normal[main].signum());
    let towards = if main == 2 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let right = unit(cross(towards, normal));
    [right, cross(normal, right)]
}

/// How far each sample is from the border, metres; nothing for an example without border.
pub(super) fn depths(template: &Template) -> Result<Vec<f32>> {
    let beyond: Vec<[f32; 3]> =
        beyond(template, template.points.len()).into_iter().map(|b| b.at).collect();
    if beyond.is_empty() {
        return Ok(Vec::new());
    }
    let tree = KdTree::new(&beyond)?;
    // Positions beyond the border are at least so far from it.
    let least = (BEYOND_BORDER * BORDER_STEP * template.spacing) as f32;
    let depth = |&p: &[f32; 3]| {
        let away = tree.nearest(p).map_or(f32::INFINITY, |n| n.squared_distance().sqrt());
        (away - least).max(0.0)
    };
    Ok(template.points.iter().map(depth).collect())
}
