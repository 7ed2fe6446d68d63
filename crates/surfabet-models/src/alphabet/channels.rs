//! Colour and intensity of occurrences: the mean of the points that each explains, rounded.

use crate::color::{rounded, to_rgb};
use crate::scans::Scene;

/// Steps between the least and the largest intensity of a scene.
pub const INTENSITY_STEPS: i32 = 63;

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

    /// The channels that a scene has.
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

    /// The channels of an occurrence that explains `points` of `scene`, rounded: luma `(r + 2g + b) / 4`, orange chroma
    /// `r - b` and green chroma `g - (r + b) / 2` in steps of colour, and the intensity in steps of its range.
    pub(super) fn means(&self, scene: &Scene, points: &[u32]) -> Vec<i32> {
        let n = points.len().max(1) as f64;
        let mut values = Vec::with_capacity(self.count());
        if let (Some(step), Some(colors)) = (self.color_step, &scene.colors) {
            let mean = |c: usize| {
                points.iter().map(|&i| f64::from(colors[i as usize][c])).sum::<f64>() / n
            };
            let [r, g, b] = [mean(0), mean(1), mean(2)];
            let (orange, middle) = (r - b, 0.5 * (r + b));
            let (green, luma) = (g - middle, 0.5 * (g + middle));
            values.extend([luma, orange, green].map(|v| (v / f64::from(step)).round() as i32));
        }
        if let (Some([low, high]), Some(intensities)) = (self.intensities, &scene.intensities) {
            let mean = points.iter().map(|&i| f64::from(intensities[i as usize])).sum::<f64>() / n;
            let share = (mean - f64::from(low)) / f64::from(high - low).max(f64::MIN_POSITIVE);
            values.push((share * f64::from(INTENSITY_STEPS)).round() as i32);
        }
        values
    }

    /// Red, green and blue of an occurrence with these channels.
    pub(super) fn color(&self, values: &[i32]) -> Option<[u8; 3]> {
        let step = self.color_step? as f32;
        Some(rounded(to_rgb([0, 1, 2].map(|c| values[c] as f32 * step))))
    }

    /// Intensity of an occurrence with these channels.
    pub(super) fn intensity(&self, values: &[i32]) -> Option<f32> {
        let [low, high] = self.intensities?;
        let share = *values.last()? as f32 / INTENSITY_STEPS as f32;
        Some(low + share * (high - low))
    }
}
