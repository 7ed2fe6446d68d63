//! Encoding of the words of an alphabet.

use surfabet_entropy::{Bit, Coder, SInt};

use crate::alphabet::word::{MAX_HEIGHT, PIXELS, Word};

/// Contexts of a pixel of the mask: which of four neighbours are set.
const CONTEXTS: usize = 16;

/// Writes, reads or prices `n` words, the plane not among them. When reading, `given` is empty.
///
/// # Errors
/// Those of the coder; when reading, also for a word without a surface or a height out of range.
pub(in crate::alphabet) fn code_words<C: Coder>(
    coder: &mut C,
    n: usize,
    given: &[Word],
) -> Result<Vec<Word>, C::Error> {
    let mut models = WordModels::default();
    let mut words = Vec::with_capacity(n);
    for i in 0..n {
        let given = given.get(i).cloned().unwrap_or_else(Word::plane);
        let word = models.code(coder, &given)?;
        if word.mask == 0 {
            return Err(coder.corrupt(format!("word {} has no surface", i + 1)));
        }
        words.push(word);
    }
    Ok(words)
}

/// The adaptive models of the words.
#[derive(Default)]
struct WordModels {
    flat: Bit,
    /// By context.
    pixel: [Bit; CONTEXTS],
    /// Beside a pixel with a height, and without one.
    height: [SInt; 2],
}

impl WordModels {
    /// One word, row by row: for each pixel whether it is set and, unless the word is flat, its height as residual to
    /// the mean of the set pixels to the left and below.
    fn code<C: Coder>(&mut self, coder: &mut C, given: &Word) -> Result<Word, C::Error> {
        let mut word = Word { mask: 0, heights: [0; PIXELS * PIXELS] };
        let is_flat = coder.bit(&mut self.flat, given.is_flat())?;
        for k in 0..PIXELS * PIXELS {
            let neighbors = coded_neighbors(word.mask, k);
            let context = neighbors.iter().fold(0, |c, &set| c * 2 + usize::from(set));
            if !coder.bit(&mut self.pixel[context], given.mask >> k & 1 != 0)? {
                continue;
            }
            word.mask |= 1 << k;
            if is_flat {
                continue;
            }
            let before: Vec<i32> = [(neighbors[0], 1), (neighbors[1], PIXELS)]
                .iter()
                .filter(|(set, _)| *set)
                .map(|(_, back)| i32::from(word.heights[k - back]))
                .collect();
            let predicted = before.iter().sum::<i32>().div_euclid(before.len().max(1) as i32);
            let model = &mut self.height[usize::from(before.is_empty())];
            let residual = coder.sint(model, i32::from(given.heights[k]) - predicted)?;
            let height = predicted.saturating_add(residual);
            if height.abs() > i32::from(MAX_HEIGHT) {
                return Err(coder.corrupt(format!(
                    "a height of {height} 32nds of the radius is out of range: at most {MAX_HEIGHT} either way"
                )));
            }
            word.heights[k] = height as i8;
        }
        Ok(word)
    }
}

/// Which neighbours of pixel `k` that come before it are set: left, below, below left, below right. There are none
/// beyond the rim.
fn coded_neighbors(mask: u64, k: usize) -> [bool; 4] {
    let [row, column] = [k / PIXELS, k % PIXELS];
    let [left, below, right] = [column > 0, row > 0, column + 1 < PIXELS];
    let set = |exists: bool, back: usize| exists && mask >> (k - back) & 1 != 0;
    [
        set(left, 1),
        set(below, PIXELS),
        set(left && below, PIXELS + 1),
        set(below && right, PIXELS - 1),
    ]
}
