//! Which attributes of a cloud are kept, and what each is stored as.

use surfabet_base::rounding::round_f32;
use surfabet_entropy::Price;
use surfabet_geom::{Column, Dtype, PointCloud};

use super::borders::{BorderBlocks, FieldCells};
use super::color::{ColorField, ColorSteps, to_channels};
use super::labels::LabelField;
use super::scalar::ScalarField;
use super::targets::Targets;
use super::{
    AttributeContent, AttributeField, AttributeHeader, INTENSITIES, MAX_ATTRIBUTES, MAX_NAME,
    Values,
};
use crate::error::{Error, Result};
use crate::patches::options::PatchesOptions;
use crate::report::AttributeFigures;
use crate::scalar::ScalarScale;

/// Name of the colours of a cloud among its attributes.
const COLORS: &str = "colors";

/// The attributes of a cloud that are kept.
pub(in crate::patches) struct ChosenAttributes<'a> {
    pub colors: Option<&'a [[u8; 3]]>,
    others: Vec<Source<'a>>,
}

/// An attribute of a cloud beside colour.
struct Source<'a> {
    name: &'a str,
    values: SourceValues<'a>,
}

#[derive(Clone, Copy)]
enum SourceValues<'a> {
    Intensities(&'a [f32]),
    Column(&'a Column),
}

/// Fields of all attributes that are kept, with what they take and miss.
#[derive(Default)]
pub(in crate::patches) struct Fields {
    pub color: Option<ColorField>,
    pub others: Vec<AttributeField>,
    pub figures: Vec<AttributeFigures>,
}

impl<'a> ChosenAttributes<'a> {
    /// Those called `names`; `None` for colours and intensities where there are any.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a name that the cloud does not have or that is given twice, more than 16 names
    /// beside colour, and names longer than 255 bytes.
    pub fn of(cloud: &'a PointCloud, names: Option<&[String]>) -> Result<Self> {
        let mut chosen = Self { colors: None, others: Vec::new() };
        let Some(names) = names else {
            chosen.colors = cloud.colors();
            chosen.others.extend(intensities(cloud));
            return Ok(chosen);
        };
        for (i, name) in names.iter().enumerate() {
            let refuse = |requirement: String| Error::invalid("attributes", name, requirement);
            if names[..i].contains(name) {
                return Err(refuse("a list that names each attribute once".into()));
            }
            if name.len() > MAX_NAME {
                return Err(refuse(format!("a name of at most {MAX_NAME} bytes")));
            }
            if name == COLORS && cloud.colors().is_some() {
                chosen.colors = cloud.colors();
            } else if let Some(source) = source(cloud, name) {
                chosen.others.push(source);
            } else {
                return Err(refuse(present(cloud)));
            }
        }
        if chosen.others.len() > MAX_ATTRIBUTES {
            let given = format!("a list of {} beside colors", chosen.others.len());
            let requirement = format!("of at most {MAX_ATTRIBUTES}");
            return Err(Error::invalid("attributes", given, requirement));
        }
        Ok(chosen)
    }

    /// True when nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.colors.is_none() && self.others.is_empty()
    }

    /// Names of all that is kept.
    pub fn names(&self) -> Vec<&'a str> {
        let colors = self.colors.map(|_| COLORS);
        colors.into_iter().chain(self.others.iter().map(|source| source.name)).collect()
    }

    /// The fields of least cost on the `cells`; `known` are the headers of attributes whose labels or scale follow from
    /// more than this cloud.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for an attribute with values too large for a scalar.
    pub fn fields(
        &self,
        cells: FieldCells<'_>,
        targets: &Targets<'_>,
        options: &PatchesOptions,
        known: &[AttributeHeader],
    ) -> Result<Fields> {
        let mut fields = Fields::default();
        if let Some(colors) = self.colors {
            let (field, figures) = color(colors, cells, targets, options);
            fields.color = Some(field);
            fields.figures.push(figures);
        }
        for source in &self.others {
            let known = known.iter().find(|header| header.name == source.name);
            let known = known.map(|header| &header.content);
            let (field, figures) = source.field(cells, targets, options, known)?;
            fields.others.push(field);
            fields.figures.push(figures);
        }
        Ok(fields)
    }
}

/// The intensities of a cloud.
fn intensities(cloud: &PointCloud) -> Option<Source<'_>> {
    let values = SourceValues::Intensities(cloud.intensities()?);
    Some(Source { name: INTENSITIES, values })
}

/// The attribute of a cloud with this name, beside its colours.
fn source<'a>(cloud: &'a PointCloud, name: &str) -> Option<Source<'a>> {
    if name == INTENSITIES {
        return intensities(cloud);
    }
    let (name, column) = cloud.extra().iter().find(|(other, _)| other == name)?;
    Some(Source { name, values: SourceValues::Column(column) })
}

/// What can be kept of a cloud, for errors.
fn present(cloud: &PointCloud) -> String {
    let colors = cloud.colors().map(|_| COLORS);
    let intensities = cloud.intensities().map(|_| INTENSITIES);
    let extra = cloud.extra().iter().map(|(name, _)| name.as_str());
    let names: Vec<&str> = colors.into_iter().chain(intensities).chain(extra).collect();
    match names.as_slice() {
        [] => "left out: the cloud has no attribute that patches can keep".into(),
        names => format!("among those that the cloud has: {}", names.join(", ")),
    }
}

/// The field of colours.
fn color(
    colors: &[[u8; 3]],
    cells: FieldCells<'_>,
    targets: &Targets<'_>,
    options: &PatchesOptions,
) -> (ColorField, AttributeFigures) {
    let steps = ColorSteps {
        luma: options.color_step,
        chroma: (f64::from(options.color_step) * options.chroma_ratio).round().max(1.0) as u32,
    };
    let lambda = options.color_rate * f64::from(options.color_step).powi(2);
    let channels = |i: usize| to_channels(colors[i].map(f32::from)).map(f64::from);
    let wanted = targets.wanted(channels);
    let missed =
        |border: &BorderBlocks, decoded: &[_]| targets.missed_across(border, channels, decoded);
    let field = ColorField::choose(cells, &wanted, steps, lambda as f32, missed);
    let mut price = Price::default();
    let Ok(()) = field.write(&mut price, cells);
    let squared = |i: usize, decoded: [f32; 3]| {
        let difference = |c: usize| f64::from(colors[i][c]) - f64::from(round_f32(decoded[c]));
        (0..3).map(|c| difference(c).powi(2)).sum::<f64>() / 3.0
    };
    let of_cell = |cell: usize| field.colors[cell].map(f32::from);
    let rmse = Some(targets.mean_error(of_cell, squared).sqrt());
    let figures =
        AttributeFigures { name: COLORS.into(), bytes: price.bits / 8.0, rmse, equal: None };
    (field, figures)
}

impl Source<'_> {
    fn dtype(&self) -> Dtype {
        match self.values {
            SourceValues::Intensities(_) => Dtype::F32,
            SourceValues::Column(column) => column.typed(),
        }
    }

    /// Value of a point as a number.
    fn number(&self, i: usize) -> f64 {
        match self.values {
            SourceValues::Intensities(values) => f64::from(values[i]),
            SourceValues::Column(column) => column.number(i),
        }
    }

    /// The different labels, growing, of an attribute of integers that are few.
    fn labels(&self) -> Option<Vec<i64>> {
        match self.values {
            SourceValues::Intensities(_) => None,
            SourceValues::Column(column) => column.labels(),
        }
    }

    /// The field of the attribute: of labels where there are few, else of a scalar.
    fn field(
        &self,
        cells: FieldCells<'_>,
        targets: &Targets<'_>,
        options: &PatchesOptions,
        known: Option<&AttributeContent>,
    ) -> Result<(AttributeField, AttributeFigures)> {
        let (labels, scale) = match known {
            Some(AttributeContent::Labels(labels)) => (Some(labels.clone()), None),
            Some(&AttributeContent::Scalar(scale)) => (None, Some(scale)),
            None => (self.labels(), None),
        };
        let (values, [rmse, equal]) = match (labels, self.values) {
            (Some(labels), SourceValues::Column(column)) => {
                let (field, equal) = label_field(column, labels, targets);
                (Values::Labels(field), [None, Some(equal)])
            }
            _ => {
                let (field, rmse) = self.scalar_field(cells, targets, options, scale)?;
                (Values::Scalar(field), [Some(rmse), None])
            }
        };
        let field = AttributeField { name: self.name.to_owned(), dtype: self.dtype(), values };
        let mut price = Price::default();
        let Ok(()) = field.write(&mut price, cells);
        let bytes = price.bits / 8.0;
        Ok((field, AttributeFigures { name: self.name.to_owned(), bytes, rmse, equal }))
    }

    /// The field of a scalar, and its root mean square error over the points.
    fn scalar_field(
        &self,
        cells: FieldCells<'_>,
        targets: &Targets<'_>,
        options: &PatchesOptions,
        scale: Option<ScalarScale>,
    ) -> Result<(ScalarField, f64)> {
        let n = match self.values {
            SourceValues::Intensities(values) => values.len(),
            SourceValues::Column(column) => column.len(),
        };
        let all = (0..n).map(|i| self.number(i));
        let own = || ScalarScale::of(self.name, all, options.attribute_step);
        let scale = scale.map_or_else(own, Ok)?;
        let in_steps = |i: usize| [scale.in_steps(self.number(i))];
        let wanted = targets.wanted(in_steps);
        let missed =
            |border: &BorderBlocks, decoded: &[_]| targets.missed_across(border, in_steps, decoded);
        let lambda = options.attribute_rate as f32;
        let field = ScalarField::choose(cells, &wanted, scale, lambda, missed);
        let squared = |i: usize, [steps]: [f32; 1]| {
            let value = self.number(i);
            let error = value - scale.value(f64::from(steps));
            if value.is_finite() { error * error } else { 0.0 }
        };
        let rmse = targets.mean_error(|cell| [field.values[cell]], squared).sqrt();
        Ok((field, rmse))
    }
}

/// The field of labels, and the share of the points whose cell has their label.
fn label_field(column: &Column, values: Vec<i64>, targets: &Targets<'_>) -> (LabelField, f64) {
    // Every value of the column is among them.
    let number = |i: usize| {
        column.integer(i).and_then(|v| values.binary_search(&v).ok()).unwrap_or_default() as u8
    };
    let labels = targets.modes(values.len(), number);
    let equal = targets.mean_over_points(|i, cell| f64::from(u8::from(labels[cell] == number(i))));
    (LabelField { values, labels }, equal)
}
