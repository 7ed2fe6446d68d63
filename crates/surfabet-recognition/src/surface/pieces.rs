//! The smooth pieces of a surface.

use surfabet_base::parallel;
use surfabet_geom::disjoint::root;
use surfabet_geom::vector::dot;
use surfabet_geom::{KdTree, Neighbor, Progress};
use surfabet_models::Result;

use super::SurfaceSamples;
use crate::constants::{PIECE_COSINE, PIECE_REACH, PIECE_STEP};

impl SurfaceSamples {
    /// The smooth piece that each sample belongs to, by the number of its first sample; and, at that sample, how many
    /// samples the piece has. Two samples are linked when they are near, their normals agree and each lies near the
    /// plane of the other; pieces are what links connect.
    ///
    /// # Errors
    /// [`surfabet_models::Error::Cancelled`].
    pub fn pieces(&self, tree: &KdTree, progress: &dyn Progress) -> Result<(Vec<u32>, Vec<u32>)> {
        let reach = (PIECE_REACH * self.spacing) as f32;
        let step = (PIECE_STEP * self.spacing) as f32;
        let links = parallel::try_map_range_with(
            self.len(),
            Vec::new,
            |near: &mut Vec<Neighbor>, i| -> Result<Vec<[u32; 2]>> {
                if i % 1024 == 0 {
                    progress.check()?;
                }
                tree.within(self.points[i], reach, near);
                let smooth = |j: usize| {
                    let [a, b] = [self.normals[i], self.normals[j]];
                    let d: [f32; 3] =
                        std::array::from_fn(|k| self.points[j][k] - self.points[i][k]);
                    let [cosine, up, down] = [dot(a, b), dot(a, d), dot(b, d)];
                    cosine.abs() > PIECE_COSINE && up.abs().max(down.abs()) < step
                };
                let later = near.iter().map(|n| n.index()).filter(|&j| j > i && smooth(j));
                Ok(later.map(|j| [i as u32, j as u32]).collect())
            },
        )?;
        let mut parent: Vec<u32> = (0..self.len() as u32).collect();
        for [i, j] in links.into_iter().flatten() {
            let [a, b] = [root(&mut parent, i), root(&mut parent, j)];
            // The first sample stands for the piece, whatever the order of the links.
            parent[a.max(b) as usize] = a.min(b);
        }
        let piece: Vec<u32> = (0..self.len() as u32).map(|i| root(&mut parent, i)).collect();
        let mut size = vec![0; self.len()];
        piece.iter().for_each(|&p| size[p as usize] += 1);
        Ok((piece, size))
    }
}
