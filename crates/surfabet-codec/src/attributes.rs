//! The headers of attributes, which models of several methods carry.

use surfabet_models::ScalarScale;

use crate::error::Result;
use crate::header::Fields;

/// Writes or reads a scale: its ends, then its step.
pub(crate) fn code_scale<F: Fields>(fields: &mut F, scale: &mut ScalarScale) -> Result<()> {
    fields.f64(&mut scale.low)?;
    fields.f64(&mut scale.high)?;
    fields.f64(&mut scale.step)?;
    scale.check().map_err(|what| fields.corrupt(what))
}
