//! What an E-step gives: the probabilities p_ij by point and by patch, and the support sets.

use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::e_step::NONE;
use super::grouped::Grouped;
use crate::error::Result;
use crate::planes::points::{BLOCK, Points};

/// Blocks of points per unit of parallel work, and their points.
pub(super) const CHUNK: usize = 64;
const CHUNK_POINTS: usize = CHUNK * BLOCK;

/// The probabilities p_ij that are not zero, by patch, and the patch that each point supports.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Responsibilities {
    /// For each patch points and their probabilities, points ascending.
    entries: Vec<Vec<(u32, f32)>>,
    /// For each patch the points for which it has the largest probability, ascending.
    sets: Vec<Vec<u32>>,
    /// The same by point.
    chunks: Vec<Chunk>,
}

/// What an E-step gives for the points of some blocks, in the order of the points.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Chunk {
    /// Patches with a probability above zero, and this probability.
    pub entries: Vec<(u32, f32)>,
    /// Where the entries of each point end.
    ends: Vec<u32>,
    /// The patch with the largest probability.
    pub supports: Vec<u32>,
    /// Distance to that patch, metres; zero for points that support none.
    distances: Vec<f32>,
}

impl Chunk {
    /// Of no points yet, with memory for so many, each of which is mostly on one patch.
    fn with_capacity(n: usize) -> Self {
        Self {
            entries: Vec::with_capacity(n),
            ends: Vec::with_capacity(n),
            supports: Vec::with_capacity(n),
            distances: Vec::with_capacity(n),
        }
    }

    /// Ends the entries of a point.
    pub fn end_point(&mut self, support: u32, distance: f64) {
        self.ends.push(self.entries.len() as u32);
        self.supports.push(support);
        self.distances.push(distance as f32);
    }
}

impl Responsibilities {
    /// The points with a probability above zero for a patch, and this probability p_ij.
    pub fn of(&self, patch: usize) -> &[(u32, f32)] {
        &self.entries[patch]
    }

    /// The patches for which a point has a probability above zero, and this probability p_ij.
    pub(super) fn of_point(&self, point: usize) -> &[(u32, f32)] {
        let chunk = &self.chunks[point / CHUNK_POINTS];
        let at = point % CHUNK_POINTS;
        let start = at.checked_sub(1).map_or(0, |before| chunk.ends[before]);
        &chunk.entries[start as usize..chunk.ends[at] as usize]
    }

    /// The support set of each patch, points ascending: `S(s_j) = {a_i : p_ij = max_k p_ik}`.
    pub(super) fn support_sets(&self) -> &[Vec<u32>] {
        &self.sets
    }

    /// For each distinct point the distance to the patch that it supports, metres; zero where it supports none.
    pub(super) fn distances(&self) -> impl Iterator<Item = f64> {
        self.chunks.iter().flat_map(|chunk| &chunk.distances).map(|&d| f64::from(d))
    }

    /// Mean distance of the points that support a patch, and the share of all points that do.
    pub(super) fn fit(&self) -> (f64, f64) {
        let near: usize = self.sets.iter().map(Vec::len).sum();
        let all: usize = self.chunks.iter().map(|chunk| chunk.supports.len()).sum();
        (self.distances().sum::<f64>() / near.max(1) as f64, near as f64 / all.max(1) as f64)
    }

    /// The probabilities and supports of the chunks of all points, sorted by patch, of `n`.
    pub(super) fn new(n: usize, chunks: Vec<Chunk>) -> Self {
        let parts: Vec<ChunkSupports> = parallel::map_range_with(
            chunks.len(),
            || vec![[0; 2]; n],
            |counts, c| ChunkSupports::new(&chunks[c], c * CHUNK_POINTS, counts),
        );
        let all = || {
            (0..)
                .zip(&parts)
                .flat_map(|(c, part)| part.runs.iter().map(move |r| (r.patch, (c, *r))))
        };
        let runs = Grouped::new(n, all);
        let sorted = parallel::map_range(n, |j| {
            let of_patch = || runs.of(j).iter().map(|(c, run)| (&parts[*c as usize], run));
            let entries: Vec<&[(u32, f32)]> =
                of_patch().map(|(part, run)| &part.entries[run.entries()]).collect();
            let set: Vec<&[u32]> =
                of_patch().map(|(part, run)| &part.members[run.members()]).collect();
            (entries.concat(), set.concat())
        });
        let (entries, sets) = sorted.into_iter().unzip();
        Self { entries, sets, chunks }
    }
}

/// Probabilities and supports of a chunk, sorted by patch.
struct ChunkSupports {
    /// The patches of which it has entries, ascending.
    runs: Vec<PatchRange>,
    entries: Vec<(u32, f32)>,
    members: Vec<u32>,
}

/// Where in a part the entries and the supporting points of a patch start and end.
#[derive(Debug, Clone, Copy, Default)]
struct PatchRange {
    patch: u32,
    starts: [u32; 2],
    ends: [u32; 2],
}

impl PatchRange {
    fn entries(&self) -> Range<usize> {
        self.starts[0] as usize..self.ends[0] as usize
    }

    fn members(&self) -> Range<usize> {
        self.starts[1] as usize..self.ends[1] as usize
    }
}

impl ChunkSupports {
    /// Counting sort of a chunk of the points from `first` on. `places` is zero for all patches, before and after.
    fn new(chunk: &Chunk, first: usize, places: &mut [[u32; 2]]) -> Self {
        let patches = counted(chunk, places);
        let mut next = [0; 2];
        let mut runs = Vec::with_capacity(patches.len());
        for &patch in &patches {
            let starts = next;
            let counts = std::mem::replace(&mut places[patch as usize], starts);
            next = std::array::from_fn(|k| starts[k] + counts[k]);
            runs.push(PatchRange { patch, starts, ends: next });
        }
        let mut entries = vec![(0, 0.0); next[0] as usize];
        let mut members = vec![0; next[1] as usize];
        // The places of the patch at hand: mostly that of the point before.
        let (mut at, mut place) = (0, places.first().copied().unwrap_or_default());
        let mut start = 0;
        for (k, (&end, &support)) in chunk.ends.iter().zip(&chunk.supports).enumerate() {
            let i = (first + k) as u32;
            for &(patch, p) in &chunk.entries[start..end as usize] {
                if patch != at {
                    places[at as usize] = place;
                    (at, place) = (patch, places[patch as usize]);
                }
                entries[place[0] as usize] = (i, p);
                place[0] += 1;
                if patch == support {
                    members[place[1] as usize] = i;
                    place[1] += 1;
                }
            }
            start = end as usize;
        }
        patches.iter().for_each(|&patch| places[patch as usize] = [0; 2]);
        Self { runs, entries, members }
    }
}

/// The patches of a chunk, ascending; `places` gets the number of entries of each, and of points that support it.
fn counted(chunk: &Chunk, places: &mut [[u32; 2]]) -> Vec<u32> {
    let mut patches = Vec::new();
    for run in chunk.entries.chunk_by(|a, b| a.0 == b.0) {
        let (patch, _) = run[0];
        let [entries, _] = &mut places[patch as usize];
        if *entries == 0 {
            patches.push(patch);
        }
        *entries += run.len() as u32;
    }
    for run in chunk.supports.chunk_by(|a, b| a == b).filter(|run| run[0] != NONE) {
        places[run[0] as usize][1] += run.len() as u32;
    }
    patches.sort_unstable();
    patches
}

/// Weighs all blocks of points, some to a chunk, in parallel. `weigh` adds the points of a block; it is lent a list.
pub(super) fn in_chunks(
    points: &Points,
    progress: &dyn Progress,
    weigh: impl Fn(usize, &mut Vec<(u32, f64)>, &mut Chunk) + Sync,
) -> Result<Vec<Chunk>> {
    let n_blocks = points.n_blocks();
    parallel::try_map_range(n_blocks.div_ceil(CHUNK), |c| {
        progress.check()?;
        let mut chunk = Chunk::with_capacity(CHUNK_POINTS);
        let mut costs = Vec::new();
        for b in c * CHUNK..((c + 1) * CHUNK).min(n_blocks) {
            weigh(b, &mut costs, &mut chunk);
        }
        Ok(chunk)
    })
}
