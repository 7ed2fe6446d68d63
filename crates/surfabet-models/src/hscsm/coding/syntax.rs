//! The streams of a model, and what is coded in which.

use surfabet_entropy::Coder;

use super::channels::{code_channel, code_dictionary};
use super::masks::code_masks;
use super::poses::code_poses;
use crate::hscsm::channels::dictionary::{HscsmDictionary, QuantizedDictionary};
use crate::hscsm::model::{Channel, HscsmHeader, Level};

/// The streams of a hierarchy of surface patches.
#[derive(Debug)]
pub(in crate::hscsm) struct Streams<'a, C> {
    /// Poses T of the patches.
    pub poses: &'a mut C,
    /// Their bitmasks b.
    pub masks: &'a mut C,
    /// Entries of the dictionaries; empty for a model that shares those of another.
    pub dictionaries: &'a mut C,
    /// Means and sparse codes of depth.
    pub depth: &'a mut C,
    /// Means and sparse codes of colour.
    pub color: &'a mut C,
}

/// Writes, reads or prices all levels, the coarsest first. `given` is what to write; in any case all of it comes
/// back. With `shared` dictionaries none are coded.
///
/// # Errors
/// Whatever the coders find wrong with what they read, and shared dictionaries of other sizes than the header's.
pub(in crate::hscsm) fn code_hscsm<C: Coder>(
    streams: &mut Streams<'_, C>,
    header: &HscsmHeader,
    shared: Option<&HscsmDictionary>,
    given: Option<&[Level]>,
) -> Result<Vec<Level>, C::Error> {
    let mut levels: Vec<Level> = Vec::with_capacity(header.levels.len());
    for (j, of) in header.levels.iter().enumerate() {
        let given = given.map(|levels| &levels[j]);
        let shared = shared.map(|dictionary| dictionary.levels.get(j));
        let first = if header.one_dictionary { levels.first() } else { None };
        // The dictionary of a channel: that of the same level of the shared one, or of the first level where all have
        // the same, or one of the stream.
        let mut dictionary = |shared: Option<Option<&QuantizedDictionary>>,
                              first: Option<&QuantizedDictionary>,
                              n_features: usize,
                              n_atoms: usize,
                              given: Option<&Channel>| {
            let Some(shared) = shared else {
                if let Some(first) = first {
                    return Ok(first.clone());
                }
                let given = given.map(|channel| channel.dictionary.values());
                return code_dictionary(
                    streams.dictionaries,
                    n_features,
                    n_atoms,
                    header.wide_atoms,
                    given,
                );
            };
            let fits =
                |d: &&QuantizedDictionary| d.n_features() == n_features && d.n_atoms() == n_atoms;
            shared.filter(fits).cloned().ok_or_else(|| {
                let what = format!("level {j} is not one of the dictionary that the file names");
                streams.dictionaries.corrupt(what)
            })
        };
        let (area, n, planes) = (of.area(), of.n_patches, header.color_planes());

        let given_depth = given.map(|level| &level.depth);
        let shared_depth = shared.map(|level| level.map(|l| &l.depth));
        let first_depth = first.map(|level| &level.depth.dictionary);
        let entries = dictionary(shared_depth, first_depth, area, of.depth_atoms, given_depth)?;
        let depth = code_channel(streams.depth, entries, n, 1, given_depth)?;

        let mut color = None;
        if let Some(n_atoms) = of.color_atoms {
            let given_color = given.and_then(|level| level.color.as_ref());
            let shared_color = shared.map(|level| level.and_then(|l| l.color.as_ref()));
            let first = first.and_then(|level| level.color.as_ref()).map(|c| &c.dictionary);
            let entries = dictionary(shared_color, first, planes * area, n_atoms, given_color)?;
            color = Some(code_channel(streams.color, entries, n, planes, given_color)?);
        }

        let given_poses = given.map_or(&[][..], |level| &level.poses);
        let given_masks = given.map_or(&[][..], |level| &level.masks);
        levels.push(Level {
            pixel_size: of.pixel_size,
            pixels: of.pixels,
            steps: of.steps,
            mask_scale: of.mask_scale,
            poses: code_poses(streams.poses, of, given_poses)?,
            masks: code_masks(streams.masks, of, given_masks)?,
            depth,
            color,
        });
    }
    Ok(levels)
}
