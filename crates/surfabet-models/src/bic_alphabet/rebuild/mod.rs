//! The scene rebuilt from occurrences: every word at its poses (eq. 2), thinned so that points keep a distance of
//! epsilon (eq. 3).
//!
//! | file | computes | paper |
//! |---|---|---|
//! | `stamp` | the points of a word at its poses, each with a rank | eq. 2 |
//! | `sparsify` | which points are kept | eq. 3 |
//! | `change` | which of them change when occurrences are added or removed | eq. 3 |
//! | `grid` | the points within epsilon of a position | |

mod change;
mod grid;
mod sparsify;
mod stamp;

pub(super) use change::Change;
pub(super) use sparsify::Sparsified;
pub(super) use stamp::Stamp;

use super::pose::Frame;

/// Eq. 2 and 3: the points of all occurrences, given the frame of each and the number of its stamp, and which of them
/// are kept. Occurrences whose number no stamp has are left out.
pub(super) fn rebuild(
    frames: &[Frame],
    words: &[u32],
    stamps: &[Stamp],
    epsilon: f32,
) -> Sparsified {
    let mut owners: Vec<Vec<u32>> = vec![Vec::new(); stamps.len()];
    for (o, &word) in (0..).zip(words) {
        if let Some(owners) = owners.get_mut(word as usize) {
            owners.push(o);
        }
    }
    let mut points = Vec::new();
    for (stamp, owners) in stamps.iter().zip(&owners) {
        stamp.place(frames, owners, &mut points);
    }
    Sparsified::new(&points, words.len(), epsilon)
}
