//! Which points change from kept to dropped or back (eq. 3) when occurrences get another word, or none.
//!
//! Occurrences are decided in their turns. Those that change are due from the start; where the kept points of one come out
//! different, the neighbours after it are due too.

use super::NO_WORD;
use super::sparsify::{Places, Sparsified, thin_place};
use super::stamp::Stamp;
use super::thin::{KeptPoint, Thinner};

/// A point that is no longer kept, or newly kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::bic_alphabet) struct Flip {
    pub position: [f32; 3],
    pub place: u32,
    /// Newly kept.
    pub is_kept: bool,
}

/// An occurrence whose kept points came out anew: a part of [`Change::kept`].
#[derive(Debug, Clone, Copy)]
struct Decided {
    place: u32,
    from: u32,
    until: u32,
}

/// What a change of a few occurrences does to the kept points. Applied or forgotten; reused for the next.
#[derive(Debug, Clone, Default)]
pub(in crate::bic_alphabet) struct Change {
    /// Places that get another word.
    pub(super) places: Vec<u32>,
    /// The word that they get; none where they lose theirs.
    pub(super) stamp: Option<Stamp>,
    /// Points whose decision flips, place after place.
    pub flips: Vec<Flip>,
    decided: Vec<Decided>,
    kept: Vec<KeptPoint>,
    /// By place: one more than its number in `decided`, 0 where it is as before.
    slots: Vec<u32>,
    /// By place.
    has_new_word: Vec<bool>,
    /// Turns that are due, a bit each.
    due: Vec<u64>,
    thinner: Thinner,
}

impl Change {
    /// Number of newly kept points less that of points no longer kept.
    pub fn balance(&self) -> i64 {
        self.flips.iter().map(|flip| if flip.is_kept { 1 } else { -1 }).sum()
    }

    /// Whether all points of the occurrence at `place` go, because it gets another word or loses its own.
    pub fn replaces(&self, place: u32) -> bool {
        self.has_new_word[place as usize]
    }

    /// The occurrences whose kept points came out anew.
    pub fn decided(&self) -> impl Iterator<Item = (u32, &[KeptPoint])> {
        self.decided.iter().map(|d| (d.place, &self.kept[d.from as usize..d.until as usize]))
    }

    /// Forgets the change before.
    fn reset(&mut self, n_places: usize, places: &[u32], stamp: Option<Stamp>) {
        for d in self.decided.drain(..) {
            self.slots[d.place as usize] = 0;
        }
        for place in self.places.drain(..) {
            self.has_new_word[place as usize] = false;
        }
        self.kept.clear();
        self.flips.clear();
        self.slots.resize(n_places, 0);
        self.has_new_word.resize(n_places, false);
        self.due.clear();
        self.due.resize(n_places.div_ceil(64), 0);
        self.places.extend_from_slice(places);
        self.stamp = stamp;
    }

    fn set_due(&mut self, turn: u32) {
        self.due[turn as usize / 64] |= 1 << (turn % 64);
    }
}

impl Sparsified {
    /// Computes in `change` what happens to the kept points when the occurrences at `changed` get the word `stamp`, or
    /// lose theirs.
    pub fn change(
        &self,
        places: Places<'_>,
        changed: &[u32],
        stamp: Option<Stamp>,
        change: &mut Change,
    ) {
        change.reset(self.words.len(), changed, stamp);
        for &place in changed {
            change.has_new_word[place as usize] = true;
            change.set_due(places.neighbors.turns[place as usize]);
        }
        for word in 0..change.due.len() {
            // Those that become due are after the one that is decided.
            while change.due[word] != 0 {
                let bit = change.due[word].trailing_zeros();
                change.due[word] &= change.due[word] - 1;
                let place = places.neighbors.order[64 * word + bit as usize];
                if self.decide(places, place, change) {
                    for &after in places.neighbors.after(place) {
                        if self.has_word(after, change) {
                            change.set_due(places.neighbors.turns[after as usize]);
                        }
                    }
                }
            }
        }
    }

    /// Whether a place has a word after the change.
    fn has_word(&self, place: u32, change: &Change) -> bool {
        if change.has_new_word[place as usize] {
            change.stamp.is_some()
        } else {
            self.words[place as usize] != NO_WORD
        }
    }

    /// Eq. 3 for one occurrence, whose neighbours before it are decided. True where its kept points come out different.
    fn decide(&self, places: Places<'_>, place: u32, change: &mut Change) -> bool {
        let Change { stamp, has_new_word, decided, kept, slots, thinner, flips, .. } = change;
        let is_new = has_new_word[place as usize];
        let stamp = if is_new {
            stamp.as_ref()
        } else {
            self.stamps.get(self.words[place as usize] as usize)
        };
        let from = kept.len();
        if let Some(stamp) = stamp {
            // What is kept here goes to the end of the list that its neighbours' points are read from.
            let mut own = std::mem::take(&mut thinner.kept);
            own.clear();
            let of = |n: u32| match slots[n as usize]
                .checked_sub(1)
                .map(|slot| decided[slot as usize])
            {
                Some(d) => &kept[d.from as usize..d.until as usize],
                None => self.kept[n as usize].as_slice(),
            };
            thin_place(places, place, stamp, of, thinner, &mut own);
            kept.extend_from_slice(&own);
            thinner.kept = own;
        }
        let (old, new) = (self.kept[place as usize].as_slice(), &kept[from..]);
        let n_flips = flips.len();
        if is_new {
            flips.extend(old.iter().map(|p| flip(p, place, false)));
            flips.extend(new.iter().map(|p| flip(p, place, true)));
        } else {
            add_flips(old, new, place, flips);
        }
        if flips.len() == n_flips {
            kept.truncate(from);
            return false;
        }
        slots[place as usize] = decided.len() as u32 + 1;
        decided.push(Decided { place, from: from as u32, until: kept.len() as u32 });
        true
    }
}

fn flip(point: &KeptPoint, place: u32, is_kept: bool) -> Flip {
    Flip { position: point.position, place, is_kept }
}

/// The points of one word that are in only one of two lists, both in the order of their numbers.
fn add_flips(old: &[KeptPoint], new: &[KeptPoint], place: u32, flips: &mut Vec<Flip>) {
    let number = |p: Option<&KeptPoint>| p.map_or(u32::MAX, |p| u32::from(p.number));
    let (mut i, mut j) = (0, 0);
    while i < old.len() || j < new.len() {
        let (was, is) = (number(old.get(i)), number(new.get(j)));
        if was < is {
            flips.push(flip(&old[i], place, false));
        } else if is < was {
            flips.push(flip(&new[j], place, true));
        }
        i += usize::from(was <= is);
        j += usize::from(is <= was);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::sparsify::tests::{EPSILON, neighbors, poses, stamp, words};
    use super::*;

    proptest! {
        #[test]
        fn a_change_gives_what_starting_over_gives(
            (poses, frames) in poses(),
            words in words(),
            chosen in prop::collection::vec(any::<prop::sample::Index>(), 60),
            steps in prop::collection::vec(
                (prop::collection::vec(any::<prop::sample::Index>(), 0..12), any::<bool>()),
                1..4,
            ),
        ) {
            let neighbors = neighbors(&poses, &frames);
            let places = Places { frames: &frames, neighbors: &neighbors, epsilon: EPSILON };
            let mut stamps: Vec<Stamp> = words.iter().map(stamp).collect();
            let mut ids: Vec<u32> = (0..poses.len())
                .map(|p| match chosen[p].index(words.len() + 1) {
                    word if word < words.len() => word as u32,
                    _ => NO_WORD,
                })
                .collect();
            let mut sparsified = Sparsified::new(places, &ids, stamps.clone());
            let mut change = Change::default();
            for (changed, has_word) in steps {
                let mut changed: Vec<u32> =
                    changed.iter().map(|i| i.index(poses.len()) as u32).collect();
                changed.sort_unstable();
                changed.dedup();
                // One that is forgotten leaves nothing behind.
                sparsified.change(places, &[0], None, &mut change);
                let new = has_word.then(|| stamp(&words[0]));
                sparsified.change(places, &changed, new.clone(), &mut change);
                let balance = change.balance();
                let before = sparsified.count() as i64;
                sparsified.apply(&mut change);
                for &place in &changed {
                    ids[place as usize] = if has_word { stamps.len() as u32 } else { NO_WORD };
                }
                stamps.extend(new);
                let expected = Sparsified::new(places, &ids, stamps.clone());
                prop_assert_eq!(&sparsified.kept, &expected.kept);
                prop_assert_eq!(&sparsified.words, &expected.words);
                prop_assert_eq!(sparsified.count(), expected.count());
                prop_assert_eq!(sparsified.count() as i64, before + balance);
            }
        }
    }
}
