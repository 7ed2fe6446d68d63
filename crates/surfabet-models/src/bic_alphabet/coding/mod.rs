//! Words and occurrences as binary decisions: one function each writes, reads and prices. When reading, what is given is
//! empty.
//!
//! | file | codes |
//! |---|---|
//! | `words` | the points and the descriptor of every word |
//! | `occurrences` | the cells that hold occurrences, then word and pose of each |

mod occurrences;
mod words;

pub(super) use occurrences::code_occurrences;
pub(super) use words::code_words;

use surfabet_entropy::{Coder, SInt};

/// A value by its difference to a known one.
fn code_difference<C: Coder>(
    coder: &mut C,
    model: &mut SInt,
    value: i8,
    known: i8,
) -> Result<i8, C::Error> {
    let difference = coder.sint(model, i32::from(value) - i32::from(known))?;
    let read = i64::from(difference) + i64::from(known);
    i8::try_from(read).map_err(|_| coder.corrupt(format!("{read} does not fit 8 bits")))
}
