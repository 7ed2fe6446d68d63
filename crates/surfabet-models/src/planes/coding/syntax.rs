//! The patches as entropy-coded symbols: one function writes, reads and prices.
//!
//! Patches come one after the other, those that most points support first.

use surfabet_entropy::{Coder, SInt};

use super::masks::{MaskModels, code_mask};
use super::poses::{PoseModels, code_pose};
use super::sizes::{SizeModels, code_sizes};
use super::stored::StoredPatch;
use super::tiles::{TileModels, code_tiles};
use crate::color::MAX_COLOR_CODE;
use crate::planes::model::{MAX_MODEL_TILES, PlaneModel, PlanesHeader};
use crate::scalar::MAX_CODE;

/// The streams of a model of planes.
#[derive(Debug)]
pub(in crate::planes) struct Streams<'a, C> {
    /// Positions, normals and directions.
    pub poses: &'a mut C,
    /// Which tiles are supported.
    pub masks: &'a mut C,
    /// Numbers and sizes of tiles, standard deviations, numbers of points.
    pub sizes: &'a mut C,
    /// Colours of supported tiles.
    pub colors: &'a mut C,
    /// Intensities of supported tiles.
    pub intensities: &'a mut C,
}

impl PlaneModel {
    /// Writes the streams.
    ///
    /// # Errors
    /// Those of the coders.
    pub(in crate::planes) fn write<C: Coder>(
        &self,
        streams: &mut Streams<'_, C>,
    ) -> Result<(), C::Error> {
        let given = Some(self.stored());
        code_patches(streams, self.header(), MAX_MODEL_TILES, given, |_| ())
    }

    /// Reads the streams that [`PlaneModel::write`] wrote, of at most `max_tiles` tiles in all.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(in crate::planes) fn read<C: Coder>(
        header: &PlanesHeader,
        max_tiles: u64,
        streams: &mut Streams<'_, C>,
    ) -> Result<Self, C::Error> {
        header.check().map_err(|e| streams.poses.corrupt(e.to_string()))?;
        let mut stored = Vec::new();
        code_patches(streams, header, max_tiles, None, |patch| stored.push(patch))?;
        Self::from_stored(header.clone(), stored).map_err(|e| streams.masks.corrupt(e.to_string()))
    }
}

/// Writes, reads or prices patches. `given` are those to write; `take` gets each patch that was written or read.
fn code_patches<C: Coder>(
    streams: &mut Streams<'_, C>,
    header: &PlanesHeader,
    max_tiles: u64,
    given: Option<&[StoredPatch]>,
    mut take: impl FnMut(StoredPatch),
) -> Result<(), C::Error> {
    let mut poses = PoseModels::new();
    let mut sizes = SizeModels::new(max_tiles);
    let mut masks = MaskModels::new();
    let mut colors = TileModels::<3>::new(i32::from(MAX_COLOR_CODE), "a colour");
    let mut intensities = TileModels::<1>::new(MAX_CODE, "an intensity");
    let nothing = StoredPatch::default();
    for i in 0..header.n_patches as usize {
        let wanted = given.map_or(&nothing, |patches| &patches[i]);
        let mut patch = StoredPatch::default();
        code_pose(streams.poses, &mut poses, wanted, &mut patch)?;
        code_sizes(streams.sizes, &mut sizes, wanted, &mut patch)?;
        patch.supported = code_mask(streams.masks, &mut masks, wanted, patch.shape)?;
        if header.color_step.is_some() {
            let given = |tile: usize| wanted.colors.get(tile).map(|c| c.map(i32::from));
            let coded = code_tiles(streams.colors, &mut colors, given, &patch)?;
            // Within the largest code, which has 16 bits.
            patch.colors = coded.into_iter().map(|c| c.map(|c| c as i16)).collect();
        }
        if header.intensity.is_some() {
            let given = |tile: usize| wanted.intensities.get(tile).map(|&q| [q]);
            let coded = code_tiles(streams.intensities, &mut intensities, given, &patch)?;
            patch.intensities = coded.into_iter().map(|[q]| q).collect();
        }
        take(patch);
    }
    Ok(())
}

/// Codes an integer as its residual from a prediction, and checks it against its domain; `what` is its name in errors.
pub(super) fn code_residual<C: Coder>(
    coder: &mut C,
    model: &mut SInt,
    predicted: i32,
    wanted: i32,
    domain: std::ops::RangeInclusive<i32>,
    what: &str,
) -> Result<i32, C::Error> {
    let residual = coder.sint(model, wanted - predicted)?;
    let value = i64::from(predicted) + i64::from(residual);
    match i32::try_from(value) {
        Ok(value) if domain.contains(&value) => Ok(value),
        _ => Err(coder.corrupt(format!("{what} of {value}, not {domain:?}"))),
    }
}
