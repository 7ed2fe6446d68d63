//! What is written is read again, and reading garbage ends in a value or an error.

use proptest::prelude::*;

use surfabet_entropy::{Bit, Coder};

use super::{CodingParams, code_channels, code_occurrences, code_words};
use crate::alphabet::lattice::SigmaRule;
use crate::alphabet::placement::Placement;
use crate::alphabet::word::Word;

/// Decisions as they are, to be read again.
#[derive(Default)]
struct Tape {
    bits: Vec<bool>,
    /// Where reading is; `None` while writing.
    at: Option<usize>,
}

impl Tape {
    fn one(&mut self, value: bool) -> Result<bool, String> {
        let Some(at) = &mut self.at else {
            self.bits.push(value);
            return Ok(value);
        };
        let read = self.bits.get(*at).copied().ok_or("the tape is over")?;
        *at += 1;
        Ok(read)
    }

    fn rewound(self) -> Self {
        Self { at: Some(0), ..self }
    }

    fn is_read(&self) -> bool {
        self.at == Some(self.bits.len())
    }
}

impl Coder for Tape {
    type Error = String;

    fn bit(&mut self, _: &mut Bit, value: bool) -> Result<bool, String> {
        self.one(value)
    }

    fn bypass(&mut self, value: u64, n_bits: u32) -> Result<u64, String> {
        (0..n_bits).try_fold(0, |read, k| Ok(read | u64::from(self.one(value >> k & 1 != 0)?) << k))
    }

    fn corrupt(&self, what: String) -> String {
        what
    }
}

const SCALES: u32 = 4;
const N_WORDS: u32 = 5;

fn any_placement() -> impl Strategy<Value = Placement> {
    let cell = prop::array::uniform3(0_i32..20);
    let slopes = prop::array::uniform2(-20_i16..=20);
    (0..SCALES as u8, cell, 0_u8..3, slopes, -300_i32..300, 0..N_WORDS as u16, 0_u16..3).prop_map(
        |(scale, cell, axis, slopes, offset, word, view)| Placement {
            scale,
            cell,
            axis,
            slopes,
            offset,
            word,
            view,
        },
    )
}

fn params(n_sensors: usize) -> CodingParams {
    let sensors = (0..n_sensors as i64).map(|k| [k * 900, 700, 300]).collect();
    CodingParams {
        scales: SCALES,
        rule: SigmaRule::new(0.02, 0.01, 0.1 / 256.0),
        sensors,
        n_words: N_WORDS,
    }
}

proptest! {
    #[test]
    fn occurrences_come_back(
        mut given in prop::collection::vec(any_placement(), 0..40),
        n_sensors in 0_usize..=3,
    ) {
        given.iter_mut().for_each(|p| p.view = p.view.min(n_sensors.saturating_sub(1) as u16));
        given.sort_unstable();
        let params = params(n_sensors);
        let mut tape = Tape::default();
        let n = given.len();
        let written = code_occurrences(&mut tape, &params, &given, n, &mut |_, _| {}).unwrap();
        let mut tape = tape.rewound();
        let read = code_occurrences(&mut tape, &params, &[], n, &mut |_, _| {}).unwrap();
        prop_assert!(tape.is_read());
        prop_assert_eq!(&read, &written);
        let mut sorted = read;
        sorted.sort_unstable();
        prop_assert_eq!(sorted, given);
    }

    #[test]
    fn channels_come_back(
        given in prop::collection::vec((any_placement(), -99_i32..99, 0_i32..63), 0..40),
    ) {
        let places: Vec<Placement> = given.iter().map(|g| g.0).collect();
        let values: Vec<Vec<i32>> = given.iter().map(|g| vec![g.1, g.2]).collect();
        let mut tape = Tape::default();
        code_channels(&mut tape, &places, SCALES, 2, &values).unwrap();
        let mut tape = tape.rewound();
        let read = code_channels(&mut tape, &places, SCALES, 2, &[]).unwrap();
        prop_assert!(tape.is_read());
        prop_assert_eq!(read, values);
    }

    #[test]
    fn words_come_back(
        given in prop::collection::vec(
            (1_u64.., prop::array::uniform32(-16_i8..=16), any::<bool>()),
            0..6,
        ),
    ) {
        let word = |&(mask, heights, flat): &(u64, [i8; 32], bool)| {
            let height = |k: usize| if flat || mask >> k & 1 == 0 { 0 } else { heights[k / 2] };
            Word { mask, heights: std::array::from_fn(height) }
        };
        let words: Vec<Word> = given.iter().map(word).collect();
        let mut tape = Tape::default();
        code_words(&mut tape, words.len(), &words).unwrap();
        let mut tape = tape.rewound();
        prop_assert_eq!(code_words(&mut tape, words.len(), &[]).unwrap(), words);
        prop_assert!(tape.is_read());
    }

    #[test]
    fn any_tape_ends_in_an_answer_or_an_error(
        bits in prop::collection::vec(any::<bool>(), 0..2000),
    ) {
        let read = |bits: &Vec<bool>| Tape { bits: bits.clone(), at: Some(0) };
        let _ = code_occurrences(&mut read(&bits), &params(2), &[], 500, &mut |_, _| {});
        let _ = code_words(&mut read(&bits), 5, &[]);
    }
}
