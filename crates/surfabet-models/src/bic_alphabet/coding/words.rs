//! The words of an alphabet: points by their difference to the point before, heights of a descriptor by their difference
//! to the height before.

use surfabet_entropy::{Bit, Coder, SInt, UInt};

use super::code_difference;
use crate::bic_alphabet::features::EMPTY;
use crate::bic_alphabet::words::{BicWord, MAX_WORD_POINTS};

/// The adaptive models of words.
struct Models {
    /// Number of points, less one.
    count: UInt,
    /// Differences of each coordinate.
    point: [SInt; 3],
    /// Is a pixel empty: by whether the pixel before is.
    empty: [Bit; 2],
    /// Differences of heights.
    height: SInt,
}

/// `n` words. No more than `max_points` points are read.
pub(in crate::bic_alphabet) fn code_words<C: Coder>(
    coder: &mut C,
    pixels: usize,
    given: &[BicWord],
    n: usize,
    max_points: usize,
) -> Result<Vec<BicWord>, C::Error> {
    let mut models = Models {
        count: UInt::new(),
        point: [const { SInt::new() }; 3],
        empty: [Bit::new(); 2],
        height: SInt::new(),
    };
    let mut words: Vec<BicWord> = Vec::new();
    let mut left = max_points;
    for w in 0..n {
        let given = given.get(w);
        let points = code_points(coder, &mut models, given, left)?;
        left -= points.len();
        let descriptor = code_descriptor(coder, &mut models, given, pixels)?;
        words.push(BicWord { points, descriptor });
    }
    Ok(words)
}

/// The points of a word, at most `most`.
fn code_points<C: Coder>(
    coder: &mut C,
    models: &mut Models,
    given: Option<&BicWord>,
    most: usize,
) -> Result<Vec<[i8; 3]>, C::Error> {
    let wanted = given.map_or(0, |g| g.points.len().saturating_sub(1));
    let size = coder.uint(&mut models.count, wanted as u32)? as usize + 1;
    if size > MAX_WORD_POINTS.min(most) {
        return Err(coder.corrupt(format!("a word of {size} points")));
    }
    let mut points: Vec<[i8; 3]> = Vec::new();
    let mut before = [0; 3];
    for k in 0..size {
        let mut q = given.map_or([0; 3], |g| g.points[k]);
        for a in 0..3 {
            q[a] = code_difference(coder, &mut models.point[a], q[a], before[a])?;
        }
        points.push(q);
        before = q;
    }
    Ok(points)
}

/// The heights of a descriptor's pixels.
fn code_descriptor<C: Coder>(
    coder: &mut C,
    models: &mut Models,
    given: Option<&BicWord>,
    pixels: usize,
) -> Result<Vec<i8>, C::Error> {
    let mut descriptor: Vec<i8> = Vec::new();
    let (mut is_empty, mut last) = (false, 0);
    for k in 0..pixels {
        let value = given.map_or(0, |g| g.descriptor[k]);
        is_empty = coder.bit(&mut models.empty[usize::from(is_empty)], value == EMPTY)?;
        if is_empty {
            descriptor.push(EMPTY);
        } else {
            last = code_difference(coder, &mut models.height, value, last)?;
            if last == EMPTY {
                return Err(coder.corrupt("a height that means an empty pixel".to_owned()));
            }
            descriptor.push(last);
        }
    }
    Ok(descriptor)
}
