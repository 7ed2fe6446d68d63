//! How words and their occurrences are said in binary decisions: one function for writing, reading and pricing.

use surfabet_entropy::{Bit, Coder, Octree, SInt, Symbols, UInt};

use crate::alphabet::coding::plane_prediction::{MAX_SUGGESTED, Neighbors};
use crate::alphabet::lattice::{MAX_SCALE, MAX_SLOPE, SigmaRule, cell_center};
use crate::alphabet::placement::Placement;
use crate::alphabet::word::{MAX_HEIGHT, PIXELS, Word};

const SCALES: usize = MAX_SCALE as usize + 1;

/// Bits of the height of the octree over the cells.
const HEIGHT_BITS: u32 = 5;

/// Largest height of the octree: cells have 24 bits.
const MAX_TREE: u32 = 24;

/// What both ends know before the first occurrence.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct Setting {
    pub scales: u32,
    pub rule: SigmaRule,
    pub sensors: Vec<[i64; 3]>,
    pub n_words: u32,
}

impl Setting {
    pub fn sensor(&self, view: u16) -> Option<[i64; 3]> {
        self.sensors.get(usize::from(view)).copied()
    }

    pub fn level(&self, placement: &Placement) -> u32 {
        let middle = cell_center(placement.cell, u32::from(placement.scale));
        self.rule.level(middle, self.sensor(placement.view))
    }
}

/// Every adaptive model of the occurrences.
pub(in crate::alphabet) struct OccurrenceModels {
    count: [UInt; SCALES],
    children: [Bit; 2 * SCALES],
    cells: Octree,
    same_view: Bit,
    view: Symbols,
    suggested: [Symbols; MAX_SUGGESTED + 1],
    axis: Symbols,
    slope: [SInt; 2],
    offset: SInt,
    slope_change: [SInt; 2],
    offset_change: [SInt; 2],
    plane: [Bit; SCALES],
    word: Symbols,
}

impl OccurrenceModels {
    pub fn new(setting: &Setting) -> Self {
        let symbols = |n: usize| {
            let size = n.clamp(1, 1 << 16) as u32;
            Symbols::new(size).expect("1 to 2^16 symbols are possible")
        };
        Self {
            count: [const { UInt::new() }; SCALES],
            children: [Bit::new(); 2 * SCALES],
            // Above the largest words, nodes of all sizes are alike.
            cells: Octree::new(setting.scales),
            same_view: Bit::new(),
            view: symbols(setting.sensors.len()),
            suggested: std::array::from_fn(|n| symbols(n + 1)),
            axis: symbols(3),
            slope: [const { SInt::new() }; 2],
            offset: SInt::new(),
            slope_change: [const { SInt::new() }; 2],
            offset_change: [const { SInt::new() }; 2],
            plane: [Bit::new(); SCALES],
            word: symbols(setting.n_words as usize - 1),
        }
    }
}

/// Writes, reads or prices all occurrences; when reading, `given` is empty. They come back in the file's order, no
/// more than `most` of them. Returns how many bits each took when priced, through `mark`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::alphabet) fn code_occurrences<C: Coder>(
    coder: &mut C,
    setting: &Setting,
    given: &[Placement],
    most: usize,
    mark: &mut dyn FnMut(&C, &Placement),
) -> Result<Vec<Placement>, C::Error> {
    let reach = given.iter().flat_map(|p| p.cell.map(|c| (c + 1) << p.scale)).max();
    let height = u32::BITS - (reach.unwrap_or(1) - 1).leading_zeros();
    let height = coder.bypass(u64::from(height), HEIGHT_BITS)? as u32;
    if height > MAX_TREE {
        return Err(coder.corrupt(format!("cells of {height} bits are out of range")));
    }
    let mut sorted = given.to_vec();
    sorted.sort_unstable();
    let mut state = Occurrences {
        coder,
        setting,
        models: OccurrenceModels::new(setting),
        around: Neighbors::new(setting.scales),
        said: Vec::with_capacity(sorted.len()),
        most,
        mark,
    };
    if most > 0 {
        state.node([0; 3], height.max(setting.scales - 1), &sorted)?;
    }
    Ok(state.said)
}

struct Occurrences<'a, C> {
    coder: &'a mut C,
    setting: &'a Setting,
    models: OccurrenceModels,
    around: Neighbors,
    said: Vec<Placement>,
    most: usize,
    mark: &'a mut dyn FnMut(&C, &Placement),
}

impl<C: Coder> Occurrences<'_, C> {
    /// The occurrences in a cell, and in the eight cells of half its side.
    fn node(&mut self, cell: [i32; 3], scale: u32, given: &[Placement]) -> Result<(), C::Error> {
        // Above the largest words, the tree has one more kind of node.
        let s = scale.min(self.setting.scales) as usize;
        let mut n = 0;
        let own: Vec<&Placement> = given.iter().filter(|p| u32::from(p.scale) == scale).collect();
        if scale < self.setting.scales {
            // A cell that holds nothing at all is not said to be there; on the finest scale it holds something.
            let least = u32::from(scale == 0);
            let more = (own.len() as u32).saturating_sub(least);
            n = self.coder.uint(&mut self.models.count[s], more)? as usize + least as usize;
            if n > self.most - self.said.len() {
                return Err(self
                    .coder
                    .corrupt(format!("{n} occurrences in one cell are too many")));
            }
        }
        for i in 0..n {
            self.occurrence(cell, scale, own.get(i).copied())?;
        }
        if scale == 0 {
            return Ok(());
        }
        let below: Vec<Placement> =
            given.iter().filter(|p| u32::from(p.scale) < scale).copied().collect();
        if n > 0 && !self.coder.bit(&mut self.models.children[s * 2], !below.is_empty())? {
            return Ok(());
        }
        let mut occupied = 0;
        for child in 0..8 {
            let at: [i32; 3] = std::array::from_fn(|a| cell[a] * 2 + (child >> a & 1));
            let inside: Vec<Placement> = below
                .iter()
                .filter(|p| p.cell.map(|c| c >> (scale - 1 - u32::from(p.scale))) == at)
                .copied()
                .collect();
            let cells = &mut self.models.cells;
            if cells.child(self.coder, scale, child as usize, occupied, !inside.is_empty())? {
                occupied += 1;
                self.node(at, scale - 1, &inside)?;
            }
        }
        Ok(())
    }

    fn occurrence(
        &mut self,
        cell: [i32; 3],
        scale: u32,
        given: Option<&Placement>,
    ) -> Result<(), C::Error> {
        let blank = Placement {
            scale: scale as u8,
            cell,
            axis: 0,
            slopes: [0; 2],
            offset: 0,
            word: 0,
            view: 0,
        };
        let given = given.copied().unwrap_or(blank);
        let mut p = blank;
        if self.setting.sensors.len() > 1 {
            let last = self.said.last().map_or(0, |p| p.view);
            p.view = last;
            if !self.coder.bit(&mut self.models.same_view, given.view == last)? {
                p.view = self.coder.symbol(&mut self.models.view, u32::from(given.view))? as u16;
            }
        }
        let level = self.setting.level(&p);
        let suggested = self.around.suggested(cell, scale, level);
        let changes = |k: usize| {
            let s = suggested[k].slopes(scale, level);
            let d = [0, 1].map(|a| i32::from(given.slopes[a]) - i32::from(s[a]));
            (d, given.offset - suggested[k].offset(&given, level))
        };
        // The plane that goes on best; the last symbol is none of them.
        let best = (0..suggested.len())
            .filter(|&k| suggested[k].placement.axis == given.axis)
            .map(|k| {
                let (d, o) = changes(k);
                (d[0].abs() + d[1].abs() + o.abs(), k)
            })
            .min()
            .filter(|(size, _)| *size <= 12)
            .map_or(suggested.len(), |(_, k)| k);
        let models = &mut self.models.suggested[suggested.len()];
        let k = self.coder.symbol(models, best as u32)? as usize;
        if let Some(plane) = suggested.get(k) {
            p.axis = plane.placement.axis;
            let base = plane.slopes(scale, level);
            for (a, base) in base.map(i32::from).into_iter().enumerate() {
                let change = i32::from(given.slopes[a]) - base;
                let change = self.coder.sint(&mut self.models.slope_change[a], change)?;
                p.slopes[a] = self.slope(base.saturating_add(change))?;
            }
            let base = plane.offset(&p, level);
            let same = usize::from(p.slopes == plane.slopes(scale, level));
            let change = given.offset.saturating_sub(base);
            let change = self.coder.sint(&mut self.models.offset_change[same], change)?;
            p.offset = base.saturating_add(change);
        } else {
            p.axis = self.coder.symbol(&mut self.models.axis, u32::from(given.axis))? as u8;
            for a in 0..2 {
                let slope = self.coder.sint(&mut self.models.slope[a], given.slopes[a].into())?;
                p.slopes[a] = self.slope(slope)?;
            }
            p.offset = self.coder.sint(&mut self.models.offset, given.offset)?;
        }
        let plane = &mut self.models.plane[scale as usize];
        if self.setting.n_words > 1 && self.coder.bit(plane, given.word != 0)? {
            let word = u32::from(given.word.saturating_sub(1));
            p.word = self.coder.symbol(&mut self.models.word, word)? as u16 + 1;
        }
        if p.offset.abs() > 1 << 20 {
            return Err(self.coder.corrupt(format!("an offset of {} steps", p.offset)));
        }
        self.around.add(p, level);
        self.said.push(p);
        (self.mark)(self.coder, &p);
        Ok(())
    }

    fn slope(&self, slope: i32) -> Result<i16, C::Error> {
        if slope.abs() > MAX_SLOPE {
            return Err(self.coder.corrupt(format!("a slope of {slope} steps")));
        }
        Ok(slope as i16)
    }
}

/// Writes, reads or prices the words beside the plane; when reading, `given` is empty and `n` says how many there are.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::alphabet) fn code_words<C: Coder>(
    coder: &mut C,
    n: usize,
    given: &[Word],
) -> Result<Vec<Word>, C::Error> {
    let mut pixel = [Bit::new(); 16];
    let mut flat = Bit::new();
    let mut height = [const { SInt::new() }; 2];
    let mut said = Vec::with_capacity(n);
    for i in 0..n {
        let given = given.get(i).cloned().unwrap_or_else(Word::plane);
        let mut word = Word { mask: 0, heights: [0; PIXELS * PIXELS] };
        let is_flat = coder.bit(&mut flat, given.is_flat())?;
        for k in 0..PIXELS * PIXELS {
            let [row, column] = [k / PIXELS, k % PIXELS];
            let [left, below] = [column > 0, row > 0];
            let set = |there: bool, back: usize| there && word.mask >> (k - back) & 1 != 0;
            // Left, below, below left and below right; beyond the rim lies nothing.
            let known = [
                set(left, 1),
                set(below, PIXELS),
                set(left && below, PIXELS + 1),
                set(below && column + 1 < PIXELS, PIXELS - 1),
            ];
            let context = known.iter().fold(0, |c, &k| c * 2 + usize::from(k));
            if !coder.bit(&mut pixel[context], given.mask >> k & 1 != 0)? {
                continue;
            }
            word.mask |= 1 << k;
            if is_flat {
                continue;
            }
            let before: Vec<i32> = [(known[0], 1), (known[1], PIXELS)]
                .iter()
                .filter(|(there, _)| *there)
                .map(|(_, back)| i32::from(word.heights[k - back]))
                .collect();
            let base = before.iter().sum::<i32>().div_euclid(before.len().max(1) as i32);
            let models = &mut height[usize::from(before.is_empty())];
            let change = coder.sint(models, i32::from(given.heights[k]) - base)?;
            let h = base.saturating_add(change);
            if h.abs() > i32::from(MAX_HEIGHT) {
                return Err(coder.corrupt(format!("a height of {h} 32nds of the radius")));
            }
            word.heights[k] = h as i8;
        }
        if word.mask == 0 {
            return Err(coder.corrupt(format!("word {} has no surface", i + 1)));
        }
        said.push(word);
    }
    Ok(said)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::alphabet::channels::code_channels;

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
            (0..n_bits)
                .try_fold(0, |read, k| Ok(read | u64::from(self.one(value >> k & 1 != 0)?) << k))
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
        (0..SCALES as u8, cell, 0_u8..3, slopes, -300_i32..300, 0..N_WORDS as u16, 0_u16..3)
            .prop_map(|(scale, cell, axis, slopes, offset, word, view)| Placement {
                scale,
                cell,
                axis,
                slopes,
                offset,
                word,
                view,
            })
    }

    fn setting(n_sensors: usize) -> Setting {
        let sensors = (0..n_sensors as i64).map(|k| [k * 900, 700, 300]).collect();
        Setting {
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
            let setting = setting(n_sensors);
            let mut tape = Tape::default();
            let n = given.len();
            let said = code_occurrences(&mut tape, &setting, &given, n, &mut |_, _| {}).unwrap();
            let mut tape = tape.rewound();
            let read = code_occurrences(&mut tape, &setting, &[], n, &mut |_, _| {}).unwrap();
            prop_assert!(tape.is_read());
            prop_assert_eq!(&read, &said);
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
            let _ = code_occurrences(&mut read(&bits), &setting(2), &[], 500, &mut |_, _| {});
            let _ = code_words(&mut read(&bits), 5, &[]);
        }
    }
}
