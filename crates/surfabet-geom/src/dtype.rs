//! The types that the values of a column can have, and columns whose type is known at run time only.

use std::collections::BTreeSet;

use crate::attribute::Column;

macro_rules! dtypes {
    ($($Integer:ident($i:ident): $about_integer:literal,)*; $($Float:ident($f:ident): $about_float:literal,)*) => {
        /// The type of the values of a [`Column`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Dtype {
            $(#[doc = $about_integer] $Integer,)*
            $(#[doc = $about_float] $Float,)*
        }

        impl Dtype {
            /// All types.
            pub const ALL: &'static [Self] = &[$(Self::$Integer,)* $(Self::$Float,)*];

            /// Its name in Rust.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Integer => stringify!($i),)*
                    $(Self::$Float => stringify!($f),)*
                }
            }

            /// Whether it is a type of integers that has this value.
            pub fn holds(self, value: i64) -> bool {
                match self {
                    $(Self::$Integer => $i::try_from(value).is_ok(),)*
                    $(Self::$Float => false,)*
                }
            }

            /// A column of this type of numbers; integers are rounded, and limited to what the type has.
            pub fn column_of_numbers(self, numbers: impl Iterator<Item = f64>) -> Column {
                match self {
                    $(Self::$Integer => Column::from(numbers.map(|v| v.round() as $i).collect::<Vec<_>>()),)*
                    $(Self::$Float => Column::from(numbers.map(|v| v as $f).collect::<Vec<_>>()),)*
                }
            }

            /// A column of this type of integers that it [holds](Dtype::holds).
            pub fn column_of_integers(self, integers: impl Iterator<Item = i64>) -> Column {
                match self {
                    $(Self::$Integer => Column::from(integers.map(|v| v as $i).collect::<Vec<_>>()),)*
                    $(Self::$Float => Column::from(integers.map(|v| v as $f).collect::<Vec<_>>()),)*
                }
            }
        }

        impl Column {
            /// Type of the values.
            pub fn typed(&self) -> Dtype {
                match self {
                    $(Self::$Integer(_) => Dtype::$Integer,)*
                    $(Self::$Float(_) => Dtype::$Float,)*
                }
            }

            /// Value of a point in double precision.
            ///
            /// # Panics
            /// When there is no such point.
            pub fn number(&self, point: usize) -> f64 {
                match self {
                    $(Self::$Integer(values) => values[point] as f64,)*
                    $(Self::$Float(values) => f64::from(values[point]),)*
                }
            }

            /// Value of a point as an integer; `None` for floating-point numbers, and beyond 63 bits.
            ///
            /// # Panics
            /// When there is no such point.
            pub fn integer(&self, point: usize) -> Option<i64> {
                match self {
                    $(Self::$Integer(values) => i64::try_from(values[point]).ok(),)*
                    $(Self::$Float(_) => None,)*
                }
            }
        }
    };
}

dtypes! {
    U8(u8): "Unsigned, 8 bits.",
    I8(i8): "Signed, 8 bits.",
    U16(u16): "Unsigned, 16 bits.",
    I16(i16): "Signed, 16 bits.",
    U32(u32): "Unsigned, 32 bits.",
    I32(i32): "Signed, 32 bits.",
    U64(u64): "Unsigned, 64 bits.",
    I64(i64): "Signed, 64 bits.",;
    F32(f32): "Floating point, single precision.",
    F64(f64): "Floating point, double precision.",
}

/// Most different values of integers that are taken for labels. The classes of LAS up to its version 1.3 are 32.
const MOST_LABELS: usize = 32;

impl Column {
    /// The different values, growing, of a column of labels: integers of at most 32 different values. `None` for all
    /// others, which are measures.
    pub fn labels(&self) -> Option<Vec<i64>> {
        let mut found = BTreeSet::new();
        for point in 0..self.len() {
            let value = self.integer(point)?;
            if found.insert(value) && found.len() > MOST_LABELS {
                return None;
            }
        }
        Some(found.into_iter().collect())
    }
}

/// Stands for a type that is not read yet.
impl Default for Dtype {
    fn default() -> Self {
        Self::F32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_made_of_any_type_and_read_as_numbers() {
        let values = [0.0, 1.4, 2.6, 100.0];
        for &dtype in Dtype::ALL {
            let column = dtype.column_of_numbers(values.into_iter());
            assert_eq!((column.typed(), column.dtype(), column.len()), (dtype, dtype.name(), 4));
            let is_float = matches!(dtype, Dtype::F32 | Dtype::F64);
            let expected = if is_float { values } else { [0.0, 1.0, 3.0, 100.0] };
            for (i, value) in expected.into_iter().enumerate() {
                assert!((column.number(i) - value).abs() < 1e-6, "{column:?}");
                let integer = (!is_float).then_some(value as i64);
                assert_eq!(column.integer(i), integer);
            }
            assert_eq!(dtype.holds(100), !is_float);
            let exact = dtype.column_of_integers([5, 7].into_iter());
            assert_eq!((exact.number(0), exact.number(1)), (5.0, 7.0));
        }
    }

    #[test]
    fn labels_are_at_most_32_different_integers() {
        assert_eq!(Column::from(vec![7_u16, 2, 7, 300]).labels(), Some(vec![2, 7, 300]));
        assert_eq!(Column::from(vec![1.0_f64, 2.0]).labels(), None);
        let of = |n: i32| Column::from((0..n).map(|i| 5 - i).collect::<Vec<_>>()).labels();
        assert_eq!(of(32).map(|labels| labels.len()), Some(32));
        assert_eq!(of(33), None);
        assert_eq!(Column::from(vec![u64::MAX]).labels(), None);
    }

    #[test]
    fn types_hold_what_they_hold() {
        assert!(Dtype::U8.holds(255) && !Dtype::U8.holds(256) && !Dtype::U8.holds(-1));
        assert!(Dtype::I8.holds(-128) && !Dtype::I8.holds(128));
        assert!(Dtype::U64.holds(i64::MAX) && !Dtype::U64.holds(-1) && Dtype::I64.holds(i64::MIN));
        assert_eq!(Column::from(vec![u64::MAX]).integer(0), None);
        let limited = Dtype::U8.column_of_numbers([-3.0, 300.0, f64::NAN].into_iter());
        assert_eq!(limited, vec![0_u8, 255, 0].into());
    }
}
