//! Where patches go, and which patch owns which sample (section III-A).
//!
//! Greedy: the candidate whose patch would cover most pixels comes first. It then proposes the four
//! positions next to it along its own x- and y-axes, these propose their neighbours in turn, and a surface is tiled with
//! aligned patches before the next candidate is looked at. Coverage falls only as patches are placed, so a
//! candidate is scored again only when it is the best left and something near it has changed.
//!
//! Every sample ends up in exactly one patch of one level: at the lowest level placement goes on until all are
//! owned, so coverage is full by construction, and no surface is stored twice.
//!
//! Trials run in parallel, in batches whose size does not depend on the number of threads, and are
//! committed in their order; what an earlier one has taken by then is lost to a later one.
//!
//! | file | what |
//! |---|---|
//! | `field` | the samples and points of a level, who owns them, approximate coverage |
//! | `pixels` | the pixel grid, and the pixels that a level accepts |
//! | `plane` | the plane of a patch |
//! | `trial` | the patch that a seed would give |
//! | `subsampled` | SCSM's placement |

mod field;
mod pixels;
mod plane;
mod subsampled;
mod trial;

use std::collections::{HashSet, VecDeque};

use surfabet_base::parallel;
use surfabet_geom::Progress;

use crate::error::Result;
use crate::hscsm::constants::{
    ALIGNED_COVERAGE, BATCH, CHANGED_RADIUS, CHUNK, KEPT_PIXELS, PROMISING_COVERAGE, TILING_CHUNK,
    TILING_COVERAGE,
};
use crate::hscsm::frame::{Frame, PatchPose};
use crate::hscsm::options::{HscsmOptions, Placement};
use crate::hscsm::samples::Samples;
use crate::vector::{add_scaled, dot, minus};
use field::{Field, Ownership, Scratch};
pub(in crate::hscsm) use pixels::{PixelGrid, Rules};
use trial::Trial;

/// One placed patch and the samples it owns.
#[derive(Debug, Clone)]
pub(in crate::hscsm) struct OwnedPatch {
    pub pose: PatchPose,
    /// Samples that it shows.
    pub members: Vec<u32>,
    /// How many of them it owns: all, unless patches overlap.
    pub owned: usize,
}

/// A position next to a placed patch.
struct Proposal {
    center: [f32; 3],
    normal: [f32; 3],
}

/// What happened to a trial.
enum Outcome {
    Placed,
    /// Too few pixels now, though it had enough when it was tried.
    Overtaken,
    Refused,
}

/// The state of placing the patches of a level.
struct Placer<'a> {
    field: Field<'a>,
    ownership: Ownership,
    placed: Vec<OwnedPatch>,
    proposals: VecDeque<Proposal>,
    /// Proposed positions, to a quarter of a patch: one nearby would only repeat it.
    tried: HashSet<[i32; 3]>,
    /// Normals of the points that were scored.
    normals: Vec<Option<[f32; 3]>>,
    /// Points without a score, or whose score may have changed.
    stale: Vec<bool>,
    /// Samples that patches of this level own.
    done: usize,
    /// Samples that were free at the start.
    to_do: usize,
    /// Whether placed patches propose aligned neighbours.
    aligned: bool,
}

/// Places patches on the samples that are not `owned` yet, and marks those as owned: as many as satisfy the rules,
/// which at the lowest level means until every sample is owned.
pub(in crate::hscsm) fn place(
    samples: &Samples,
    owned: &mut Vec<bool>,
    doublings: u32,
    grid: PixelGrid,
    rules: Rules,
    options: &HscsmOptions,
    progress: &dyn Progress,
) -> Result<Vec<OwnedPatch>> {
    let placement = options.placement;
    let field = Field::new(samples, doublings, grid, rules);
    progress.check()?;
    let ownership = field.ownership(std::mem::take(owned), options.disjoint);
    let stale = vec![true; field.points.len()];
    let to_do = ownership.owned.iter().filter(|o| !**o).count();
    let normals = vec![None; field.points.len()];
    let mut placer = Placer {
        field,
        ownership,
        placed: Vec::new(),
        proposals: VecDeque::new(),
        tried: HashSet::new(),
        normals,
        stale,
        done: 0,
        to_do,
        aligned: placement == Placement::Greedy,
    };
    match placement {
        Placement::Greedy => placer.greedy(progress)?,
        Placement::Subsampled => placer.subsampled(progress)?,
    }
    *owned = placer.ownership.owned;
    Ok(placer.placed)
}

impl Placer<'_> {
    /// Number of pixels that make up this fraction of a patch.
    fn needed(&self, fraction: f32) -> usize {
        (fraction * self.field.grid.area() as f32).ceil() as usize
    }

    /// Reports the share of samples that are owned by now.
    fn notify(&self, progress: &dyn Progress) -> Result<()> {
        progress.check()?;
        let total = self.to_do.max(1);
        progress.update("placing patches", self.done as f32 / total as f32);
        Ok(())
    }

    /// Scores candidates that have none yet or may have another by now, in parallel.
    fn score(&mut self, candidates: &[u32]) -> Vec<usize> {
        let scored: Vec<(usize, [f32; 3])> =
            parallel::map_range_with(candidates.len(), Scratch::default, |scratch, c| {
                let k = candidates[c] as usize;
                let normal =
                    self.normals[k].unwrap_or_else(|| self.field.candidate_normal(k, scratch));
                let center = self.field.points.all[k].position;
                (self.field.score(&self.ownership, center, normal, scratch), normal)
            });
        for (&k, &(_, normal)) in candidates.iter().zip(&scored) {
            self.normals[k as usize] = Some(normal);
            self.stale[k as usize] = false;
        }
        scored.into_iter().map(|(score, _)| score).collect()
    }

    /// Greedy placement, best first. No candidate scores more than a full patch, so all begin as if they did, and are scored when
    /// nothing better is left; most are covered by then.
    fn greedy(&mut self, progress: &dyn Progress) -> Result<()> {
        let area = self.field.grid.area();
        let lowest = self.field.rules.min_pixels;
        let tiling = self.needed(TILING_COVERAGE);
        let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); area + 1];
        buckets[area] = self.field.candidates();
        for score in (lowest..=area).rev() {
            let (chunk, batch) = if score >= tiling { (TILING_CHUNK, 1) } else { (CHUNK, BATCH) };
            while !buckets[score].is_empty() {
                for candidates in std::mem::take(&mut buckets[score]).chunks(chunk) {
                    self.notify(progress)?;
                    let ready = self.refresh(candidates, score, &mut buckets);
                    let mut ready = ready.into_iter().peekable();
                    while ready.peek().is_some() {
                        let chosen = self.choose(&mut ready, batch, &mut buckets[score]);
                        self.seed(&chosen, lowest, &mut buckets[score]);
                        self.tile(progress)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Those of `candidates` that still have this score; others move to lower buckets.
    fn refresh(&mut self, candidates: &[u32], score: usize, buckets: &mut [Vec<u32>]) -> Vec<u32> {
        let (stale, mut ready): (Vec<u32>, Vec<u32>) = candidates
            .iter()
            .filter(|&&k| self.ownership.free[k as usize] > 0)
            .partition(|&&k| self.stale[k as usize]);
        for (k, now) in stale.iter().zip(self.score(&stale)) {
            // A score can only fall; where rounding says otherwise it stays.
            if now < score {
                buckets[now].push(*k);
            } else {
                ready.push(*k);
            }
        }
        ready
    }

    /// The next candidates that do not touch one another; those beside them wait in `later`.
    fn choose(
        &mut self,
        ready: &mut impl Iterator<Item = u32>,
        batch: usize,
        later: &mut Vec<u32>,
    ) -> Vec<u32> {
        let mut chosen = Vec::with_capacity(batch);
        for k in ready {
            if self.ownership.free[k as usize] == 0 {
                continue;
            }
            if self.stale[k as usize] {
                later.push(k);
                continue;
            }
            self.disturb(self.field.points.all[k as usize].position);
            chosen.push(k);
            if chosen.len() == batch {
                break;
            }
        }
        chosen
    }

    /// Tries patches about the candidates `chosen` of one score.
    fn seed(&mut self, chosen: &[u32], lowest: usize, later: &mut Vec<u32>) {
        let trials: Vec<Option<Trial>> =
            self.trials(chosen, |k| (k as usize, self.field.points.all[k as usize].position, None));
        for (&k, trial) in chosen.iter().zip(trials) {
            let Some(trial) = trial else { continue };
            let outcome = self.commit(trial, lowest);
            let again = match outcome {
                Outcome::Placed => self.ownership.free[k as usize] > 0,
                Outcome::Overtaken => true,
                Outcome::Refused => false,
            };
            if again {
                self.stale[k as usize] = true;
                later.push(k);
            }
        }
    }

    /// Follows the proposals of placed patches until there are none.
    fn tile(&mut self, progress: &dyn Progress) -> Result<()> {
        let needed = self.needed(ALIGNED_COVERAGE).max(self.field.rules.min_pixels);
        while !self.proposals.is_empty() {
            self.notify(progress)?;
            let batch: Vec<Proposal> =
                self.proposals.drain(..BATCH.min(self.proposals.len())).collect();
            let trials: Vec<Option<Trial>> =
                parallel::map_range_with(batch.len(), Scratch::default, |scratch, k| {
                    let proposal = &batch[k];
                    let Proposal { center, normal } = *proposal;
                    let seed = self.nearest_free(proposal)?;
                    // Moved along the normal to the surface, as the trial does.
                    let off = dot(minus(self.field.points.all[seed].position, center), normal);
                    let near = add_scaled(center, off, normal);
                    let hint = self.field.score(&self.ownership, near, normal, scratch);
                    if (hint as f32) < PROMISING_COVERAGE * needed as f32 {
                        return None;
                    }
                    let known = Some(proposal.normal);
                    self.field.trial(&self.ownership, seed, proposal.center, known, scratch)
                });
            for trial in trials.into_iter().flatten() {
                self.commit(trial, needed);
            }
        }
        Ok(())
    }

    /// The patches that some seeds would give. `what` gives the point of a seed, the centre wanted and the normal known.
    fn trials<T: Copy + Sync>(
        &self,
        chosen: &[T],
        what: impl Fn(T) -> (usize, [f32; 3], Option<[f32; 3]>) + Sync,
    ) -> Vec<Option<Trial>> {
        parallel::map_range_with(chosen.len(), Scratch::default, |scratch, k| {
            let (seed, wanted, known) = what(chosen[k]);
            self.field.trial(&self.ownership, seed, wanted, known, scratch)
        })
    }

    /// The point with free samples nearest to a proposed centre, within half a patch.
    fn nearest_free(&self, proposal: &Proposal) -> Option<usize> {
        let radius = 0.5 * self.field.grid.size();
        let mut best = (radius * radius, usize::MAX);
        self.field.near(proposal.center, radius, |k, p| {
            if self.ownership.free[k] > 0 {
                let d = minus(p, proposal.center);
                let squared = dot(d, d);
                if squared < best.0 || (squared == best.0 && k < best.1) {
                    best = (squared, k);
                }
            }
        });
        (best.1 != usize::MAX).then_some(best.1)
    }

    /// Places a trial if at least `needed` of its pixels are still free, and proposes its neighbours.
    fn commit(&mut self, mut trial: Trial, needed: usize) -> Outcome {
        let rules = self.field.rules;
        if trial.set_pixels < needed.max(1) || trial.covered < rules.min_covered {
            return Outcome::Refused;
        }
        let owned = &self.ownership.owned;
        let shown: Vec<u32> = trial.members.iter().map(|m| m.0).collect();
        trial.members.retain(|m| !owned[m.0 as usize]);
        if trial.members.len() < shown.len() {
            let mut pixels: Vec<u16> = trial.members.iter().map(|m| m.1).collect();
            pixels.dedup();
            let left = pixels.len();
            let enough = left >= needed.max(1);
            // A patch that overlaps others was tried with what they own: another trial would be the same.
            if self.ownership.above.is_some() {
                if !enough {
                    return Outcome::Refused;
                }
            } else if !enough || (left as f32) < KEPT_PIXELS * trial.set_pixels as f32 {
                return Outcome::Overtaken;
            }
        }
        for &(i, _) in &trial.members {
            self.ownership.owned[i as usize] = true;
            self.ownership.free[self.field.parents[i as usize] as usize] -= 1;
        }
        self.done += trial.members.len();
        let Frame { center, x, y, z } = trial.frame;
        self.disturb(center);
        if self.aligned {
            let size = self.field.grid.size();
            for (direction, sign) in [(x, 1.0), (x, -1.0), (y, 1.0), (y, -1.0)] {
                let next = add_scaled(center, sign * size, direction);
                if self.tried.insert(next.map(|c| (4.0 * c / size).round() as i32)) {
                    self.proposals.push_back(Proposal { center: next, normal: z });
                }
            }
        }
        let owned = trial.members.len();
        let members = match self.ownership.above {
            Some(_) => shown,
            None => trial.members.iter().map(|m| m.0).collect(),
        };
        self.placed.push(OwnedPatch { pose: trial.pose, members, owned });
        Outcome::Placed
    }

    /// Marks the candidates about `center` as changed.
    fn disturb(&mut self, center: [f32; 3]) {
        let stale = &mut self.stale;
        self.field.near(center, CHANGED_RADIUS * self.field.grid.size(), |k, _| stale[k] = true);
    }
}

/// Position of point `k`.
fn point_of(field: &Field<'_>, k: u32) -> [f32; 3] {
    field.points.all[k as usize].position
}
