//! Columns of one number per point, of any type: the attributes of a cloud that have only a name.

use std::collections::HashSet;

use crate::error::{Error, Result};

/// Names of what every cloud has or may have beside its named columns; no named column can be called so.
pub const RESERVED_NAMES: [&str; 10] = [
    "points",
    "local_points",
    "origin",
    "colors",
    "intensities",
    "normals",
    "ranges",
    "viewpoints",
    "viewpoint_index",
    "crs",
];

/// A number that a column can hold.
pub trait Scalar: Copy + Send + Sync {
    /// What stands for the values of `members` together: of integers, which count or label, the one with the largest
    /// sum of weights (the smaller one of equals); of floating-point numbers their weighted mean.
    fn merged(values: &[Self], members: &[u32], weight: impl Fn(usize) -> f64) -> Self;
}

/// The label with the largest sum of weights, the smaller one of equals.
pub(crate) fn heaviest<T: Copy + Ord + Default>(
    labels: &[T],
    members: &[u32],
    weight: impl Fn(usize) -> f64,
) -> T {
    let mut weighted: Vec<(T, f64)> =
        members.iter().map(|&i| (labels[i as usize], weight(i as usize))).collect();
    weighted.sort_by_key(|&(label, _)| label);
    let mut best: Option<(T, f64)> = None;
    for run in weighted.chunk_by(|a, b| a.0 == b.0) {
        let sum: f64 = run.iter().map(|(_, weight)| weight).sum();
        if best.is_none_or(|(_, largest)| sum > largest) {
            best = run.first().map(|&(label, _)| (label, sum));
        }
    }
    best.map(|(label, _)| label).unwrap_or_default()
}

macro_rules! scalars {
    ($($Label:ident)*; $($Measure:ident)*) => {
        $(impl Scalar for $Label {
            fn merged(values: &[Self], members: &[u32], weight: impl Fn(usize) -> f64) -> Self {
                heaviest(values, members, weight)
            }
        })*
        $(impl Scalar for $Measure {
            fn merged(values: &[Self], members: &[u32], weight: impl Fn(usize) -> f64) -> Self {
                let (sum, total) = members.iter().map(|&i| i as usize).fold(
                    (0.0, 0.0),
                    |(sum, total), i| {
                        let w = weight(i);
                        (sum + w * f64::from(values[i]), total + w)
                    },
                );
                (sum / total) as $Measure
            }
        })*
    };
}
scalars!(u8 i8 u16 i16 u32 i32 u64 i64; f32 f64);

macro_rules! columns {
    ($($Variant:ident($T:ident),)*) => {
        /// One number per point.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Column {
            $(#[doc = concat!("Of the type ", stringify!($T), ".")] $Variant(Vec<$T>),)*
        }

        /// Evaluates an expression with the values of a column, whatever their type.
        macro_rules! with_column {
            ($column:expr, $values:ident => $result:expr) => {
                match $column {
                    $($crate::attribute::Column::$Variant($values) => $result,)*
                }
            };
        }
        pub(crate) use with_column;

        impl Column {
            /// Name of the type of the values, as Rust has it: `u8`, `f64`, ...
            pub fn dtype(&self) -> &'static str {
                match self {
                    $(Self::$Variant(_) => stringify!($T),)*
                }
            }

            /// Adds the values of `other` at the end; false, and nothing added, where their type is another.
            fn append(&mut self, other: &Self) -> bool {
                match (self, other) {
                    $((Self::$Variant(all), Self::$Variant(more)) => {
                        all.extend_from_slice(more);
                        true
                    })*
                    _ => false,
                }
            }
        }

        $(impl From<Vec<$T>> for Column {
            fn from(values: Vec<$T>) -> Self {
                Self::$Variant(values)
            }
        })*
    };
}

columns! {
    U8(u8),
    I8(i8),
    U16(u16),
    I16(i16),
    U32(u32),
    I32(i32),
    U64(u64),
    I64(i64),
    F32(f32),
    F64(f64),
}

impl Column {
    /// Number of values.
    pub fn len(&self) -> usize {
        with_column!(self, values => values.len())
    }

    /// True when there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Leaves the values out whose flag is false; one flag per value.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        with_column!(self, values => retain_by(values, keep));
    }

    /// The values at `indices`, all of which there must be.
    pub(crate) fn select(&self, indices: &[usize]) -> Self {
        with_column!(self, values => pick(values, indices).into())
    }
}

/// Leaves the values out whose flag is false; both lengths were checked against the number of points.
pub(crate) fn retain_by<T: Copy>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

/// The values at `indices`, all of which there must be.
pub(crate) fn pick<T: Copy>(values: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().map(|&i| values[i]).collect()
}

/// Named columns in the order of their file.
pub type Extra = Vec<(String, Column)>;

/// Refuses named columns that are not as long as the cloud, or whose names are empty, given twice or taken.
pub(crate) fn check(extra: &[(String, Column)], n_points: usize) -> Result<()> {
    let mut taken: HashSet<&str> = RESERVED_NAMES.into_iter().collect();
    for (name, column) in extra {
        if name.is_empty() || !taken.insert(name) {
            let requirement = format!(
                "a name that is not empty, given once, and none of {}",
                RESERVED_NAMES.join(", ")
            );
            return Err(Error::invalid("extra", format!("{name:?}"), requirement));
        }
        if column.len() != n_points {
            return Err(Error::LengthMismatch {
                attribute: format!("extra {name:?}").into(),
                found: column.len(),
                expected: n_points,
            });
        }
    }
    Ok(())
}

/// The columns that all of `parts` have by the same name and type, joined in the order of the first; the names of
/// all others go to `lost`.
pub(crate) fn joined(parts: &[&[(String, Column)]], lost: &mut Vec<String>) -> Extra {
    let Some((first, others)) = parts.split_first() else {
        return Extra::new();
    };
    let mut all = Extra::new();
    for (name, column) in *first {
        let mut whole = column.clone();
        let found = others.iter().all(|extra| {
            let same = extra.iter().find(|(other, _)| other == name);
            same.is_some_and(|(_, more)| whole.append(more))
        });
        if found {
            all.push((name.clone(), whole));
        }
    }
    for (name, _) in parts.iter().copied().flatten() {
        if !all.iter().any(|(kept, _)| kept == name) && !lost.contains(name) {
            lost.push(name.clone());
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extra(columns: &[(&str, Column)]) -> Extra {
        columns.iter().map(|(name, column)| ((*name).to_owned(), column.clone())).collect()
    }

    #[test]
    fn columns_know_their_type_and_keep_their_values() {
        let mut column = Column::from(vec![1_u64 << 60, 2, u64::MAX]);
        assert_eq!((column.dtype(), column.len(), column.is_empty()), ("u64", 3, false));
        assert_eq!(column.select(&[2, 0, 2]), vec![u64::MAX, 1 << 60, u64::MAX].into());
        column.retain(&[false, true, true]);
        assert_eq!(column, vec![2_u64, u64::MAX].into());
    }

    #[test]
    fn names_are_given_once_and_are_not_those_of_the_cloud() {
        let one = || Column::from(vec![1_u8]);
        assert!(check(&extra(&[("a", one()), ("A", one()), ("Scan angle", one())]), 1).is_ok());
        for names in [["a", "a"], ["a", ""], ["colors", "a"]] {
            let columns = extra(&names.map(|name| (name, one())));
            assert!(matches!(check(&columns, 1), Err(Error::InvalidParameter(_))), "{names:?}");
        }
        let error = check(&extra(&[("label", one())]), 2).unwrap_err();
        let message = "extra \"label\" has 1 values for 2 points; give one per point";
        assert_eq!(error.to_string(), message);
    }

    #[test]
    fn joined_are_the_columns_that_all_have_with_the_same_type() {
        let first = extra(&[
            ("label", vec![1_u8].into()),
            ("time", vec![1.5_f64].into()),
            ("ring", vec![7_u16].into()),
        ]);
        let second = extra(&[
            ("time", vec![2.5_f64].into()),
            ("ring", vec![8_i16].into()),
            ("label", vec![2_u8].into()),
            ("angle", vec![0.5_f32].into()),
        ]);
        let mut lost = Vec::new();
        let all = joined(&[&first, &second], &mut lost);
        let both = extra(&[("label", vec![1_u8, 2].into()), ("time", vec![1.5_f64, 2.5].into())]);
        assert_eq!(all, both);
        assert_eq!(lost, ["ring", "angle"]);
        assert_eq!(joined(&[], &mut lost), Extra::new());
    }

    #[test]
    fn labels_merge_to_the_heaviest_and_measures_to_their_mean() {
        let weight = |i: usize| [1.0, 2.0, 1.5, 1.5][i];
        assert_eq!(u8::merged(&[9, 6, 2, 2], &[0, 1, 2, 3], weight), 2);
        // Of equals the smaller one.
        assert_eq!(i32::merged(&[3, -6, -7, 4], &[2, 3], weight), -7);
        assert_eq!(f64::merged(&[9.0, 6.0, 2.0, 2.0], &[0, 1], weight), 7.0);
    }
}
