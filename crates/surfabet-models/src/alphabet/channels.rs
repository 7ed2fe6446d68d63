//! Colour and intensity of occurrences: the mean of the points that each explains.

use surfabet_entropy::{Coder, SInt};

use super::coding::coarse_cells::Nearby;
use super::lattice::cell_center;
use super::placement::Placement;
use crate::color::{rounded, to_rgb};
use crate::scans::Scene;

/// Steps between the least and the largest intensity of a scene.
pub const INTENSITY_STEPS: i32 = 63;

/// Largest value of a channel, in its steps.
const MAX_VALUE: i32 = 1 << 10;

/// How the channels are rounded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Channels {
    /// Steps of luma and chroma, 0 to 255; `None` without colour.
    pub color_step: Option<u32>,
    /// Least and largest intensity; `None` without.
    pub intensities: Option<[f32; 2]>,
}

impl Channels {
    /// Numbers per occurrence.
    pub fn count(&self) -> usize {
        3 * usize::from(self.color_step.is_some()) + usize::from(self.intensities.is_some())
    }

    pub(super) fn of(scene: &Scene, color_step: u32) -> Self {
        let range = |values: &Vec<f32>| {
            let low = values.iter().copied().fold(f32::INFINITY, f32::min);
            [low, values.iter().copied().fold(low, f32::max)]
        };
        Self {
            color_step: scene.colors.as_ref().map(|_| color_step),
            intensities: scene.intensities.as_ref().map(range),
        }
    }

    /// What is said of an occurrence that explains `points` of `scene`.
    pub(super) fn means(&self, scene: &Scene, points: &[u32]) -> Vec<i32> {
        let n = points.len().max(1) as f64;
        let mut said = Vec::with_capacity(self.count());
        if let (Some(step), Some(colors)) = (self.color_step, &scene.colors) {
            let mean = |c: usize| {
                points.iter().map(|&i| f64::from(colors[i as usize][c])).sum::<f64>() / n
            };
            let [r, g, b] = [mean(0), mean(1), mean(2)];
            let (orange, middle) = (r - b, 0.5 * (r + b));
            let (green, luma) = (g - middle, 0.5 * (g + middle));
            said.extend([luma, orange, green].map(|v| (v / f64::from(step)).round() as i32));
        }
        if let (Some([low, high]), Some(values)) = (self.intensities, &scene.intensities) {
            let mean = points.iter().map(|&i| f64::from(values[i as usize])).sum::<f64>() / n;
            let share = (mean - f64::from(low)) / f64::from(high - low).max(f64::MIN_POSITIVE);
            said.push((share * f64::from(INTENSITY_STEPS)).round() as i32);
        }
        said
    }

    /// Red, green and blue.
    pub(super) fn color(&self, said: &[i32]) -> Option<[u8; 3]> {
        let step = self.color_step? as f32;
        Some(rounded(to_rgb([0, 1, 2].map(|c| said[c] as f32 * step))))
    }

    pub(super) fn intensity(&self, said: &[i32]) -> Option<f32> {
        let [low, high] = self.intensities?;
        let share = *said.last()? as f32 / INTENSITY_STEPS as f32;
        Some(low + share * (high - low))
    }
}

/// Writes, reads or prices the channels of all occurrences, each about the nearest one said before it.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(super) fn code_channels<C: Coder>(
    coder: &mut C,
    placements: &[Placement],
    scales: u32,
    channels: usize,
    given: &[Vec<i32>],
) -> Result<Vec<Vec<i32>>, C::Error> {
    let mut models = vec![SInt::new(); channels];
    let mut nearby: Nearby<usize> = Nearby::new(scales);
    let middle = |p: &Placement| cell_center(p.cell, u32::from(p.scale));
    let mut said: Vec<Vec<i32>> = Vec::with_capacity(placements.len());
    for (k, p) in placements.iter().enumerate() {
        let apart = |j: usize| -> u64 {
            let [a, b] = [middle(p), middle(&placements[j])];
            (0..3).map(|c| a[c].abs_diff(b[c]).pow(2)).sum()
        };
        let candidates = nearby.about(p.cell, u32::from(p.scale)).copied();
        let nearest = candidates.min_by_key(|&j| (apart(j), j)).or(k.checked_sub(1));
        let mut values = Vec::with_capacity(channels);
        for (c, model) in models.iter_mut().enumerate() {
            let base = nearest.map_or(0, |j| said[j][c]);
            let change = coder.sint(model, given.get(k).map_or(0, |g| g[c] - base))?;
            let value = base.saturating_add(change);
            if value.abs() > MAX_VALUE {
                return Err(coder.corrupt(format!("a channel of {value} steps")));
            }
            values.push(value);
        }
        said.push(values);
        nearby.add(p.cell, u32::from(p.scale), k);
    }
    Ok(said)
}
