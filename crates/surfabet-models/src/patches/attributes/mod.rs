//! Attributes on the cells around the surface: colour and scalars as fields of values, labels as symbols.
//!
//! Cells of a cubic grid around the surface carry them. They follow from the geometry, so that a file holds nothing of
//! them.
//!
//! | file | step |
//! |---|---|
//! | `cells` | the cells that carry attributes, from the geometry |
//! | `blending` | the cells that a position takes its attributes from |
//! | `borders` | what is coded once more at the borders of a tile |
//! | `targets` | when learning: the samples that each counts for, and the label that it should have |
//! | `wanted` | when learning: the value that each should have |
//! | `chosen` | when learning: which attributes of the cloud, and what each is stored as |
//! | `color` | luma and two chromas, and their steps |
//! | `scalar` | intensities and other scalars, in steps of a share of their standard deviation |
//! | `labels` | labels, given those of the cells around |
//! | `field` | a field of any number of channels down the pyramid of cells |

pub(in crate::patches) mod blending;
pub(in crate::patches) mod borders;
pub(in crate::patches) mod cells;
pub(in crate::patches) mod chosen;
pub(in crate::patches) mod color;
mod field;
pub(in crate::patches) mod labels;
pub(in crate::patches) mod scalar;
pub(in crate::patches) mod targets;
mod wanted;

use surfabet_entropy::Coder;
use surfabet_geom::Dtype;

use crate::scalar::ScalarScale;
use borders::FieldCells;
pub use field::FieldCoding;
#[cfg(feature = "trace")]
pub use field::decisions as field_decisions;
use labels::LabelField;
pub use labels::MAX_LABELS;
use scalar::ScalarField;

/// Most attributes beside colour.
pub const MAX_ATTRIBUTES: usize = 16;

/// Longest name of an attribute, bytes.
pub const MAX_NAME: usize = 255;

/// Name of the intensities of a cloud among its attributes.
pub const INTENSITIES: &str = "intensities";

/// The header of an attribute in the file, before its stream.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AttributeHeader {
    /// Its name in the cloud; [`INTENSITIES`] for these.
    pub name: String,
    /// Type of its values in the cloud.
    pub dtype: Dtype,
    /// What its values are.
    pub content: AttributeContent,
}

/// What the values of an attribute are.
#[derive(Debug, Clone, PartialEq)]
pub enum AttributeContent {
    /// Numbers, which are averaged.
    Scalar(ScalarScale),
    /// One of these labels per cell, growing.
    Labels(Vec<i64>),
}

impl Default for AttributeContent {
    fn default() -> Self {
        Self::Scalar(ScalarScale::default())
    }
}

impl AttributeHeader {
    /// Type and content, for people.
    pub fn in_words(&self) -> String {
        let dtype = self.dtype.name();
        match &self.content {
            AttributeContent::Scalar(scale) => {
                format!("{dtype}, {} to {} in steps of {:.4e}", scale.low, scale.high, scale.step)
            }
            AttributeContent::Labels(values) => format!("{dtype}, {} labels", values.len()),
        }
    }

    /// What is wrong with the header of an attribute of a file.
    fn check(&self) -> Result<(), String> {
        let Self { name, dtype, content } = self;
        let taken = surfabet_geom::RESERVED_NAMES.contains(&name.as_str()) && name != INTENSITIES;
        if name.is_empty() || name.len() > MAX_NAME || taken {
            return Err(format!("an attribute called {name:?}"));
        }
        match content {
            _ if name == INTENSITIES && *dtype != Dtype::F32 => {
                Err(format!("intensities of type {}", dtype.name()))
            }
            AttributeContent::Scalar(scale) => scale.check(),
            AttributeContent::Labels(_) if name == INTENSITIES => {
                Err("intensities that are labels".into())
            }
            AttributeContent::Labels(values) => match labels::are_labels(values) {
                true if values.iter().all(|&v| dtype.holds(v)) => Ok(()),
                _ => Err(format!("labels {values:?} of type {}", dtype.name())),
            },
        }
    }
}

/// What is wrong with the headers of the attributes of a file.
pub(in crate::patches) fn check(headers: &[AttributeHeader]) -> Result<(), String> {
    if headers.len() > MAX_ATTRIBUTES {
        return Err(format!("{} attributes, more than {MAX_ATTRIBUTES}", headers.len()));
    }
    for (i, header) in headers.iter().enumerate() {
        header.check()?;
        if headers[..i].iter().any(|other| other.name == header.name) {
            return Err(format!("two attributes called {:?}", header.name));
        }
    }
    Ok(())
}

/// Values of an attribute on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) enum Values {
    Scalar(ScalarField),
    Labels(LabelField),
}

/// An attribute on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct AttributeField {
    pub name: String,
    pub dtype: Dtype,
    pub values: Values,
}

impl AttributeField {
    /// The header in the file, before the stream.
    pub fn header(&self) -> AttributeHeader {
        let content = match &self.values {
            Values::Scalar(field) => AttributeContent::Scalar(field.scale),
            Values::Labels(field) => AttributeContent::Labels(field.values.clone()),
        };
        AttributeHeader { name: self.name.clone(), dtype: self.dtype, content }
    }

    /// Writes or prices the attribute of the `cells`.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: FieldCells<'_>) -> Result<(), C::Error> {
        match &self.values {
            Values::Scalar(field) => field.write(coder, cells),
            Values::Labels(field) => field.write(coder, cells.keys),
        }
    }

    /// Reads what [`AttributeField::write`] wrote; the header was checked.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: FieldCells<'_>,
        header: &AttributeHeader,
    ) -> Result<Self, C::Error> {
        let values = match &header.content {
            AttributeContent::Scalar(scale) => {
                Values::Scalar(ScalarField::read(coder, cells, *scale)?)
            }
            AttributeContent::Labels(values) => {
                Values::Labels(LabelField::read(coder, cells.keys, values.clone())?)
            }
        };
        Ok(Self { name: header.name.clone(), dtype: header.dtype, values })
    }
}
