//! Refinement: every occurrence is replaced by the best of its variants.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::Choice;
use super::cover::CoverCounts;
use crate::alphabet::candidates::{Candidate, Descriptor, WordSamples, nearest_words};
use crate::alphabet::constants::WORDS_PER_PLACE;
use crate::alphabet::placement::Placement;
use crate::alphabet::scene::{LocalPoint, Rows, local_points};
use crate::error::Result;

/// Buffers for the points about an occurrence.
#[derive(Default)]
struct RefinementBuffers {
    rows: Rows,
    around: Vec<u32>,
    local: Vec<LocalPoint>,
}

impl Choice<'_> {
    /// Takes every occurrence out in turn and puts the variant with the largest gain in its place, or itself. `known` are
    /// the variants of each where an earlier pass made them; they are gone where it was replaced.
    pub(super) fn refine(
        &self,
        chosen: &mut [Candidate],
        known: &mut [Option<Vec<Candidate>>],
        counts: &mut CoverCounts,
        progress: &dyn Progress,
    ) -> Result<()> {
        self.add_variants(chosen, known, progress)?;
        for (c, known) in chosen.iter_mut().zip(known) {
            progress.check()?;
            counts.remove(&c.coverage.points);
            let gain = |c: &Candidate| {
                self.prices.inlier * counts.n_open(&c.coverage.points) - self.prices.cost(c)
            };
            let mut best = (gain(c), None);
            for (k, variant) in known.iter().flatten().enumerate() {
                let gain = gain(variant);
                if gain > best.0 {
                    best = (gain, Some(k));
                }
            }
            if let Some(variant) = best.1.and_then(|k| Some(known.take()?.swap_remove(k))) {
                *c = variant;
            }
            counts.add(&c.coverage.points);
        }
        Ok(())
    }

    /// Makes the variants of each occurrence that are not known.
    fn add_variants(
        &self,
        chosen: &[Candidate],
        known: &mut [Option<Vec<Candidate>>],
        progress: &dyn Progress,
    ) -> Result<()> {
        let descriptors: Vec<Descriptor> = self.words.iter().map(Descriptor::of_word).collect();
        let missing: Vec<usize> = (0..chosen.len()).filter(|&k| known[k].is_none()).collect();
        let made = parallel::try_map_range_with(
            missing.len(),
            || (RefinementBuffers::default(), WordSamples::new(&self.words)),
            |(buffers, samples), k| -> Result<_> {
                progress.check()?;
                Ok(self.variants(&chosen[missing[k]], &descriptors, buffers, samples))
            },
        )?;
        for (k, variants) in missing.into_iter().zip(made) {
            known[k] = Some(variants);
        }
        Ok(())
    }

    /// The occurrence one step of its offset or of a slope away, and with the other words nearest to the surface there.
    fn variants(
        &self,
        c: &Candidate,
        descriptors: &[Descriptor],
        buffers: &mut RefinementBuffers,
        samples: &mut WordSamples<'_>,
    ) -> Vec<Candidate> {
        let RefinementBuffers { rows, around, local } = buffers;
        let p = c.placement;
        let mut variants = Vec::new();
        for step in [-1, 1] {
            variants.push(Placement { offset: p.offset + step, ..p });
            for a in 0..2 {
                let mut slopes = p.slopes;
                slopes[a] += step as i16;
                variants.push(Placement { slopes, ..p });
            }
        }
        variants.retain(|p| p.slopes_fit(c.pose.level));
        let cells = &self.cells[usize::from(p.scale)];
        cells.around(p.cell, rows);
        cells.touched(rows, &c.pose, around);
        local_points(self.scene, &c.pose, around, local);
        // A step moves the pose by less than sigma: the points about it serve all variants.
        around.clear();
        around.extend(local.iter().map(|p| p.index));
        let descriptor = Descriptor::of_points(&c.pose, local);
        let fitting = nearest_words(&descriptor, descriptors, WORDS_PER_PLACE);
        let words = fitting.into_iter().map(|word| word as u16).filter(|&word| word != p.word);
        variants.extend(words.map(|word| Placement { word, ..p }));
        variants
            .into_iter()
            .map(|placement| {
                let pose = placement.pose(c.pose.level, self.scene.sensor(placement.view));
                local_points(self.scene, &pose, around, local);
                let word = usize::from(placement.word);
                samples.cover(word, &pose, self.spacing, local);
                Candidate { placement, pose, coverage: samples.coverage() }
            })
            .collect()
    }
}
