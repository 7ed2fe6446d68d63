//! Encoding of the occurrences: one function for writing, reading and pricing.
//!
//! Occurrences follow an octree over the cells, whose lower levels are the scales. Each is coded after those around it:
//! a symbol selects the plane of an earlier occurrence that goes on here, residuals follow.

use surfabet_entropy::{Bit, Coder, Octree, SInt, Symbols, UInt};

use super::plane_prediction::{MAX_PREDICTIONS, PlanePredictor, PredictedPlane};
use crate::alphabet::constants::MAX_PREDICTION_CHANGE;
use crate::alphabet::lattice::{MAX_OFFSET, MAX_SCALE, MAX_SLOPE, SigmaRule, cell_center};
use crate::alphabet::placement::Placement;

const SCALES: usize = MAX_SCALE as usize + 1;

/// Bits of the height of the octree over the cells.
const HEIGHT_BITS: u32 = 5;

/// Largest height of the octree: cells have 24 bits.
const MAX_TREE: u32 = 24;

/// What writer and reader both know before the first occurrence.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct CodingParams {
    pub scales: u32,
    pub rule: SigmaRule,
    pub sensors: Vec<[i64; 3]>,
    pub n_words: u32,
}

impl CodingParams {
    /// Where the sensor of a view stood, units.
    pub fn sensor(&self, view: u16) -> Option<[i64; 3]> {
        self.sensors.get(usize::from(view)).copied()
    }

    /// Level of sigma at the middle of the cell of an occurrence.
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
    /// Which predicted plane, by how many there are.
    prediction: [Symbols; MAX_PREDICTIONS + 1],
    axis: Symbols,
    slope: [SInt; 2],
    offset: SInt,
    slope_change: [SInt; 2],
    offset_change: [SInt; 2],
    plane: [Bit; SCALES],
    word: Symbols,
}

impl OccurrenceModels {
    pub fn new(params: &CodingParams) -> Self {
        let symbols = |n: usize| {
            let size = n.clamp(1, 1 << 16) as u32;
            Symbols::new(size).expect("1 to 2^16 symbols are possible")
        };
        Self {
            count: [const { UInt::new() }; SCALES],
            children: [Bit::new(); 2 * SCALES],
            // Nodes above the largest words share their models.
            cells: Octree::new(params.scales),
            same_view: Bit::new(),
            view: symbols(params.sensors.len()),
            prediction: std::array::from_fn(|n| symbols(n + 1)),
            axis: symbols(3),
            slope: [const { SInt::new() }; 2],
            offset: SInt::new(),
            slope_change: [const { SInt::new() }; 2],
            offset_change: [const { SInt::new() }; 2],
            plane: [Bit::new(); SCALES],
            word: symbols(params.n_words as usize - 1),
        }
    }
}

/// Writes, reads or prices all occurrences; when reading, `given` is empty. Returns them in the order of the file, at
/// most `most` of them. `mark` is called after each, with the coder: from its state follows what each occurrence took.
///
/// # Errors
/// Those of the coder; when reading, also for more than `most` occurrences and for values out of range.
pub(in crate::alphabet) fn code_occurrences<C: Coder>(
    coder: &mut C,
    params: &CodingParams,
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
        params,
        models: OccurrenceModels::new(params),
        predictor: PlanePredictor::new(params.scales),
        coded: Vec::with_capacity(sorted.len()),
        most,
        mark,
    };
    if most > 0 {
        state.node([0; 3], height.max(params.scales - 1), &sorted)?;
    }
    Ok(state.coded)
}

/// The coder in the middle of its work.
struct Occurrences<'a, C> {
    coder: &'a mut C,
    params: &'a CodingParams,
    models: OccurrenceModels,
    predictor: PlanePredictor,
    coded: Vec<Placement>,
    most: usize,
    mark: &'a mut dyn FnMut(&C, &Placement),
}

impl<C: Coder> Occurrences<'_, C> {
    /// The occurrences in a cell, and in the eight cells of half its side.
    fn node(&mut self, cell: [i32; 3], scale: u32, given: &[Placement]) -> Result<(), C::Error> {
        // Above the largest words, the tree has one more kind of node.
        let s = scale.min(self.params.scales) as usize;
        let mut n = 0;
        let own: Vec<&Placement> = given.iter().filter(|p| u32::from(p.scale) == scale).collect();
        if scale < self.params.scales {
            // A cell is coded only if an occurrence is in it; on the finest scale, that is one of its own.
            let least = u32::from(scale == 0);
            let more = (own.len() as u32).saturating_sub(least);
            n = self.coder.uint(&mut self.models.count[s], more)? as usize + least as usize;
            if n > self.most - self.coded.len() {
                return Err(self.coder.corrupt(format!(
                    "{n} occurrences in one cell are more than the header counts"
                )));
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

    /// One occurrence in `cell`: view, predicted plane, pose, word.
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
        p.view = self.view(given.view)?;
        let level = self.params.level(&p);
        let predictions = self.predictor.predict(cell, scale, level);
        let best = best_prediction(&predictions, &given, level);
        let model = &mut self.models.prediction[predictions.len()];
        let k = self.coder.symbol(model, best as u32)? as usize;
        match predictions.get(k) {
            Some(plane) => self.pose_from_plane(&mut p, &given, plane, level)?,
            None => self.pose(&mut p, &given)?,
        }
        p.word = self.word(scale, given.word)?;
        if p.offset.abs() > MAX_OFFSET {
            return Err(self.coder.corrupt(format!(
                "an offset of {} steps is out of range: at most {MAX_OFFSET} either way",
                p.offset
            )));
        }
        self.predictor.insert(p, level);
        self.coded.push(p);
        (self.mark)(self.coder, &p);
        Ok(())
    }

    /// Which sensor saw the occurrence: that of the one before, or another.
    fn view(&mut self, given: u16) -> Result<u16, C::Error> {
        if self.params.sensors.len() < 2 {
            return Ok(0);
        }
        let last = self.coded.last().map_or(0, |p| p.view);
        if self.coder.bit(&mut self.models.same_view, given == last)? {
            return Ok(last);
        }
        Ok(self.coder.symbol(&mut self.models.view, u32::from(given))? as u16)
    }

    /// The pose as residuals to a predicted plane: slopes first, since the offset follows from them.
    fn pose_from_plane(
        &mut self,
        p: &mut Placement,
        given: &Placement,
        plane: &PredictedPlane,
        level: u32,
    ) -> Result<(), C::Error> {
        p.axis = plane.axis();
        let predicted = plane.slopes(u32::from(p.scale), level);
        for (a, predicted) in predicted.map(i32::from).into_iter().enumerate() {
            let residual = i32::from(given.slopes[a]) - predicted;
            let residual = self.coder.sint(&mut self.models.slope_change[a], residual)?;
            p.slopes[a] = self.checked_slope(predicted.saturating_add(residual))?;
        }
        let same_slopes = usize::from(p.slopes == predicted);
        let predicted = plane.offset(p, level);
        let residual = given.offset.saturating_sub(predicted);
        let residual = self.coder.sint(&mut self.models.offset_change[same_slopes], residual)?;
        p.offset = predicted.saturating_add(residual);
        Ok(())
    }

    /// The pose itself: axis, slopes, offset.
    fn pose(&mut self, p: &mut Placement, given: &Placement) -> Result<(), C::Error> {
        p.axis = self.coder.symbol(&mut self.models.axis, u32::from(given.axis))? as u8;
        for a in 0..2 {
            let slope = self.coder.sint(&mut self.models.slope[a], given.slopes[a].into())?;
            p.slopes[a] = self.checked_slope(slope)?;
        }
        p.offset = self.coder.sint(&mut self.models.offset, given.offset)?;
        Ok(())
    }

    /// Which word: the plane, or one of the others.
    fn word(&mut self, scale: u32, given: u16) -> Result<u16, C::Error> {
        let other = &mut self.models.plane[scale as usize];
        if self.params.n_words < 2 || !self.coder.bit(other, given != 0)? {
            return Ok(0);
        }
        let word = u32::from(given.saturating_sub(1));
        Ok(self.coder.symbol(&mut self.models.word, word)? as u16 + 1)
    }

    fn checked_slope(&self, slope: i32) -> Result<i16, C::Error> {
        if slope.abs() > MAX_SLOPE {
            return Err(self.coder.corrupt(format!(
                "a slope of {slope} steps is out of range: at most {MAX_SLOPE} either way"
            )));
        }
        Ok(slope as i16)
    }
}

/// The prediction with the smallest sum of absolute residuals among those with the axis of `given`, the first of equal
/// ones; their number where none is near enough.
fn best_prediction(predictions: &[PredictedPlane], given: &Placement, level: u32) -> usize {
    let size = |plane: &PredictedPlane| {
        let predicted = plane.slopes(u32::from(given.scale), level);
        let d = [0, 1].map(|a| i32::from(given.slopes[a]) - i32::from(predicted[a]));
        let offset = given.offset - plane.offset(given, level);
        d[0].abs() + d[1].abs() + offset.abs()
    };
    predictions
        .iter()
        .enumerate()
        .filter(|(_, plane)| plane.axis() == given.axis)
        .map(|(k, plane)| (size(plane), k))
        .min()
        .filter(|(size, _)| *size <= MAX_PREDICTION_CHANGE)
        .map_or(predictions.len(), |(_, k)| k)
}
