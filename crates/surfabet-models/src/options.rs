//! Options of the methods: each is declared once, with type, default, range, unit and documentation.
//!
//! `options!` makes a struct of such declarations that implements [`Options`]: fields, defaults, the check of all
//! ranges, a setter by name for bindings, and the table [`Options::SPECS`]. The signatures and docstrings in Python, the
//! options of the command line and the tables of the guide are generated from that table.

use std::borrow::Cow;
use std::ops::{Bound, RangeBounds};

use surfabet_base::InvalidParameter;

use crate::error::{Error, Result};

/// The options of a method.
pub trait Options: Default + Clone {
    /// All options, in the order of the guide.
    const SPECS: &'static [OptionSpec];

    /// Sets the option `name`. Ranges are left to [`Options::check`], as far as the type can hold the value.
    ///
    /// # Errors
    /// [`Error::InvalidType`] for a value of another type, [`Error::InvalidParameter`] for one that the type cannot
    /// hold or for an unknown name.
    fn set(&mut self, name: &str, value: &Value) -> Result<()>;

    /// Refuses values outside their range.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the first of them.
    fn check(&self) -> Result<()>;

    /// Refuses a `value` of the option `name` that was found from the data and is outside its range: a cloud whose
    /// coordinates are no metres has such.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`].
    fn check_found(name: &str, value: f64) -> Result<()> {
        match Self::SPECS.iter().find(|spec| spec.name == name) {
            Some(spec) if !spec.range.contains(&Value::Float(value)) => {
                let requirement = format!("{}; is the unit right?", spec.requirement());
                Err(Error::invalid(spec.name, value, requirement))
            }
            _ => Ok(()),
        }
    }
}

/// A value of an option, of any type.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Nothing: the method finds the value itself.
    None,
    /// Yes or no.
    Bool(bool),
    /// An integer.
    Int(i128),
    /// A number.
    Float(f64),
    /// The name of a choice.
    Text(String),
    /// A sequence of numbers.
    Floats(Vec<f64>),
    /// A sequence of names.
    Texts(Vec<String>),
    /// Something that no option takes, as it is shown.
    Other(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::None => write!(f, "None"),
            Self::Bool(true) => write!(f, "True"),
            Self::Bool(false) => write!(f, "False"),
            Self::Int(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Text(value) => write!(f, "'{}'", value.escape_debug()),
            Self::Floats(values) => {
                let shown: Vec<String> = values.iter().map(f64::to_string).collect();
                write!(f, "[{}]", shown.join(", "))
            }
            Self::Texts(names) => {
                let shown: Vec<String> =
                    names.iter().map(|name| format!("'{}'", name.escape_debug())).collect();
                write!(f, "[{}]", shown.join(", "))
            }
            Self::Other(shown) => write!(f, "{shown}"),
        }
    }
}

/// What an option takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// True or false.
    Bool,
    /// An integer.
    Int,
    /// A number.
    Float,
    /// A sequence of numbers.
    Floats,
    /// A sequence of names.
    Texts,
    /// One of these names.
    Choice(&'static [&'static str]),
}

/// The numbers that an option takes; with no upper bound, all finite ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lower bound.
    pub low: Bound<f64>,
    /// Upper bound.
    pub high: Bound<f64>,
    /// Only multiples of this.
    pub step: Option<f64>,
}

impl Range {
    /// Every number, also those that are not finite: for options that are no numbers.
    pub const ANY: Self = Self::new(Bound::Unbounded, Bound::Included(f64::INFINITY));
    /// Finite and above 0.
    pub const POSITIVE: Self = Self::new(Bound::Excluded(0.0), Bound::Unbounded);
    /// Finite and not below 0.
    pub const NOT_NEGATIVE: Self = Self::new(Bound::Included(0.0), Bound::Unbounded);
    /// Metres that a scene, its points or their noise may have: beyond these the unit is another.
    pub const LENGTH: Self = Self::from_to(1e-9, 1e9);
    /// Of these, and 0.
    pub const LENGTH_OR_ZERO: Self = Self::from_to(0.0, 1e9);
    /// All seeds of 64 bits.
    pub const SEED: Self =
        Self::new(Bound::Included(0.0), Bound::Excluded(18_446_744_073_709_551_616.0));

    const fn new(low: Bound<f64>, high: Bound<f64>) -> Self {
        Self { low, high, step: None }
    }

    /// `low` and above, infinity too.
    pub const fn at_least(low: f64) -> Self {
        Self::new(Bound::Included(low), Bound::Included(f64::INFINITY))
    }

    /// `low` and above, of what is counted in 32 bits.
    pub const fn count_from(low: f64) -> Self {
        Self::from_below(low, 4_294_967_296.0)
    }

    /// Both ends included.
    pub const fn from_to(low: f64, high: f64) -> Self {
        Self::new(Bound::Included(low), Bound::Included(high))
    }

    /// Without `low`, with `high`.
    pub const fn above_to(low: f64, high: f64) -> Self {
        Self::new(Bound::Excluded(low), Bound::Included(high))
    }

    /// With `low`, without `high`.
    pub const fn from_below(low: f64, high: f64) -> Self {
        Self::new(Bound::Included(low), Bound::Excluded(high))
    }

    /// Neither end included.
    pub const fn between(low: f64, high: f64) -> Self {
        Self::new(Bound::Excluded(low), Bound::Excluded(high))
    }

    /// Of these only the multiples of `step`.
    pub const fn in_steps_of(self, step: f64) -> Self {
        Self { step: Some(step), ..self }
    }

    /// Whether all numbers of `value` are within.
    pub fn contains(&self, value: &Value) -> bool {
        match value {
            // Integers exactly: a seed may need all its 64 bits.
            Value::Int(value) => {
                (self.low.map(|b| b as i128), self.high.map(|b| b as i128)).contains(value)
            }
            Value::Float(value) => self.contains_float(*value),
            Value::Floats(values) => values.iter().all(|&value| self.contains_float(value)),
            Value::None | Value::Bool(_) | Value::Text(_) | Value::Texts(_) | Value::Other(_) => {
                true
            }
        }
    }

    fn contains_float(&self, value: f64) -> bool {
        (self.low, self.high).contains(&value)
            && !value.is_nan()
            && (value.is_finite() || self.high != Bound::Unbounded)
            && self.step.is_none_or(|step| (value / step).fract() == 0.0)
    }

    /// The range in words, as "a positive number of metres" with the noun "number" and the unit "metres".
    fn in_words(&self, noun: &str, unit: Option<&str>) -> String {
        let article = if noun.starts_with('i') { "an" } else { "a" };
        let (of_unit, unit) = match unit {
            Some(unit) => (format!(" of {unit}"), format!(" {unit}")),
            None => Default::default(),
        };
        let mut words = match (self.low, self.high) {
            (Bound::Excluded(0.0), Bound::Unbounded) => format!("a positive {noun}{of_unit}"),
            (Bound::Included(0.0), Bound::Unbounded) => format!("0 or a positive {noun}{of_unit}"),
            (Bound::Unbounded, _) => format!("{article} {noun}{of_unit}"),
            (low, high) => {
                let low = match low {
                    Bound::Excluded(low) => format!("above {}", in_digits(low)),
                    Bound::Included(low) if is_number(high) => format!("from {}", in_digits(low)),
                    Bound::Included(low) => format!("of at least {}", in_digits(low)),
                    Bound::Unbounded => String::new(),
                };
                let high = match high {
                    Bound::Included(high) if high.is_infinite() => String::new(),
                    Bound::Included(high) if low.starts_with("from") => {
                        format!(" to {}", in_digits(high))
                    }
                    Bound::Included(high) => format!(" and at most {}", in_digits(high)),
                    Bound::Excluded(high) if low.starts_with("from") => {
                        format!(" to below {}", in_digits(high))
                    }
                    Bound::Excluded(high) => format!(" and below {}", in_digits(high)),
                    Bound::Unbounded => String::new(),
                };
                format!("{article} {noun} {low}{high}{unit}")
            }
        };
        if let Some(step) = self.step {
            words += &format!(" in steps of {}", in_digits(step));
        }
        words
    }
}

fn is_number(bound: Bound<f64>) -> bool {
    matches!(bound, Bound::Included(value) | Bound::Excluded(value) if value.is_finite())
}

/// A bound as text; powers of two from 2^20 on as such, other numbers of many zeros with an exponent.
fn in_digits(value: f64) -> String {
    let exponent = value.log2();
    if exponent >= 20.0 && exponent.fract() == 0.0 {
        format!("2^{exponent}")
    } else if value >= 1e5 || (value > 0.0 && value < 1e-4) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// All that is known of an option.
#[derive(Debug, Clone, Copy)]
pub struct OptionSpec {
    /// Its name, the same everywhere.
    pub name: &'static str,
    /// What it takes.
    pub kind: Kind,
    /// Whether it takes [`Value::None`].
    pub optional: bool,
    /// What the method does with [`Value::None`].
    pub none: &'static str,
    /// The value when it is not given.
    pub default: fn() -> Value,
    /// Which numbers it takes.
    pub range: Range,
    /// Unit of these numbers, where they have one.
    pub unit: Option<&'static str>,
    /// What it does; the first sentence alone is the help of the command line.
    pub documentation: &'static str,
    /// Whether it applies too when a model that is there describes, or takes in, another scene.
    pub another_scene: bool,
}

impl OptionSpec {
    /// What a value must be, for errors and documentation.
    pub fn requirement(&self) -> String {
        self.in_words(self.unit)
    }

    /// As [`Self::requirement`], without the unit.
    pub fn range_in_words(&self) -> String {
        self.in_words(None)
    }

    fn in_words(&self, unit: Option<&str>) -> String {
        match self.kind {
            Kind::Bool => "True or False".to_owned(),
            Kind::Int => self.range.in_words("integer", unit),
            Kind::Float => self.range.in_words("number", unit),
            Kind::Floats => {
                format!("a sequence with each {}", self.range.in_words("number", unit))
            }
            Kind::Texts => "a sequence of names".to_owned(),
            Kind::Choice(names) => {
                let quoted: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
                match quoted.split_last() {
                    Some((last, [])) => last.clone(),
                    Some((last, others)) => format!("{} or {last}", others.join(", ")),
                    None => String::new(),
                }
            }
        }
    }

    /// [`Self::documentation`] as one paragraph.
    pub fn paragraph(&self) -> String {
        self.documentation.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Refuses a value outside of the range.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`].
    pub fn check(&self, value: &Value) -> Result<()> {
        if self.range.contains(value) {
            return Ok(());
        }
        Err(self.refuse(Mismatch::Range, value))
    }

    /// The error for `value`.
    pub fn refuse(&self, mismatch: Mismatch, value: &Value) -> Error {
        let (name, requirement) = (self.name, Cow::Owned(self.requirement()));
        match (mismatch, value) {
            // 2.0 and not 2, where an integer was expected.
            (Mismatch::Type, Value::Float(value)) => {
                Error::InvalidType { name, value: format!("{value:?}"), requirement }
            }
            (Mismatch::Type, value) => {
                Error::InvalidType { name, value: value.to_string(), requirement }
            }
            (Mismatch::Range, value) => InvalidParameter::new(name, value, requirement).into(),
        }
    }
}

/// In what way a value does not fit an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mismatch {
    /// It is of another type.
    Type,
    /// The type is right.
    Range,
}

/// A type that options have.
pub trait OptionValue: Sized {
    /// What it takes.
    const KIND: Kind;
    /// Whether it takes [`Value::None`].
    const OPTIONAL: bool = false;

    /// The field's value for `value`.
    ///
    /// # Errors
    /// In what way it does not fit.
    fn of(value: &Value) -> Result<Self, Mismatch>;

    /// The field's value for anyone.
    fn to_value(&self) -> Value;
}

impl OptionValue for bool {
    const KIND: Kind = Kind::Bool;

    fn of(value: &Value) -> Result<Self, Mismatch> {
        match value {
            Value::Bool(value) => Ok(*value),
            _ => Err(Mismatch::Type),
        }
    }

    fn to_value(&self) -> Value {
        Value::Bool(*self)
    }
}

impl OptionValue for f64 {
    const KIND: Kind = Kind::Float;

    fn of(value: &Value) -> Result<Self, Mismatch> {
        match value {
            Value::Float(value) => Ok(*value),
            Value::Int(value) => Ok(*value as Self),
            _ => Err(Mismatch::Type),
        }
    }

    fn to_value(&self) -> Value {
        Value::Float(*self)
    }
}

impl OptionValue for Vec<f64> {
    const KIND: Kind = Kind::Floats;

    fn of(value: &Value) -> Result<Self, Mismatch> {
        match value {
            Value::Floats(values) => Ok(values.clone()),
            _ => Err(Mismatch::Type),
        }
    }

    fn to_value(&self) -> Value {
        Value::Floats(self.clone())
    }
}

impl OptionValue for Vec<String> {
    const KIND: Kind = Kind::Texts;

    fn of(value: &Value) -> Result<Self, Mismatch> {
        match value {
            Value::Texts(names) => Ok(names.clone()),
            // No name or number is in an empty sequence.
            Value::Floats(numbers) if numbers.is_empty() => Ok(Self::new()),
            _ => Err(Mismatch::Type),
        }
    }

    fn to_value(&self) -> Value {
        Value::Texts(self.clone())
    }
}

macro_rules! integers {
    ($($type:ty),+) => {$(
        impl OptionValue for $type {
            const KIND: Kind = Kind::Int;

            fn of(value: &Value) -> Result<Self, Mismatch> {
                match value {
                    Value::Int(value) => Self::try_from(*value).map_err(|_| Mismatch::Range),
                    _ => Err(Mismatch::Type),
                }
            }

            fn to_value(&self) -> Value {
                // No integer here has more than 64 bits.
                Value::Int(*self as i128)
            }
        }
    )+};
}
integers!(u32, u64, usize);

impl<T: OptionValue> OptionValue for Option<T> {
    const KIND: Kind = T::KIND;
    const OPTIONAL: bool = true;

    fn of(value: &Value) -> Result<Self, Mismatch> {
        match value {
            Value::None => Ok(None),
            value => T::of(value).map(Some),
        }
    }

    fn to_value(&self) -> Value {
        self.as_ref().map_or(Value::None, T::to_value)
    }
}

/// Names the variants of an enum, so that an option can be of it.
macro_rules! choices {
    ($type:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $type {
            /// Its name in options.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }

        impl $crate::options::OptionValue for $type {
            const KIND: $crate::options::Kind = $crate::options::Kind::Choice(&[$($name),+]);

            fn of(
                value: &$crate::options::Value,
            ) -> std::result::Result<Self, $crate::options::Mismatch> {
                match value {
                    $crate::options::Value::Text(name) => match name.as_str() {
                        $($name => Ok(Self::$variant),)+
                        _ => Err($crate::options::Mismatch::Range),
                    },
                    _ => Err($crate::options::Mismatch::Type),
                }
            }

            fn to_value(&self) -> $crate::options::Value {
                $crate::options::Value::Text(self.name().to_owned())
            }
        }
    };
}

/// Makes a struct that implements [`Options`] of declarations
/// `name: Type = default, range = ..., unit = "...", none = "...", another_scene = true;`, in which everything after
/// the default may be left out. `none` is what the method does without a value, for types `Option<_>`.
#[macro_export]
macro_rules! options {
    (
        $(#[$attribute:meta])*
        pub struct $struct:ident {
            $(
                $(#[doc = $line:literal])+
                $name:ident: $type:ty = $default:expr
                $(, range = $range:expr)?
                $(, unit = $unit:literal)?
                $(, none = $none:literal)?
                $(, another_scene = $another_scene:literal)?;
            )+
        }
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $struct {
            $(
                $(#[doc = $line])+
                $(#[doc = concat!("\n\nUnit: ", $unit, ".")])?
                $(#[doc = concat!("\n\n`None`: ", $none, ".")])?
                pub $name: $type,
            )+
        }

        impl Default for $struct {
            fn default() -> Self {
                Self { $($name: $default),+ }
            }
        }

        impl $crate::options::Options for $struct {
            const SPECS: &'static [$crate::options::OptionSpec] = &[$(
                $crate::options::OptionSpec {
                    name: stringify!($name),
                    kind: <$type as $crate::options::OptionValue>::KIND,
                    optional: <$type as $crate::options::OptionValue>::OPTIONAL,
                    none: concat!($($none)?),
                    default: || {
                        let default: $type = $default;
                        $crate::options::OptionValue::to_value(&default)
                    },
                    range: $crate::options!(@first $($range,)? $crate::options::Range::ANY),
                    unit: $crate::options!(@first $(Some($unit),)? None),
                    documentation: concat!($($line, "\n"),+),
                    another_scene: $crate::options!(@first $($another_scene,)? false),
                },
            )+];

            fn set(&mut self, name: &str, value: &$crate::options::Value) -> $crate::Result<()> {
                let mut specs = Self::SPECS.iter();
                $(
                    // One entry per option, in this order.
                    if let Some(spec) = specs.next()
                        && name == spec.name
                    {
                        self.$name = <$type as $crate::options::OptionValue>::of(value)
                            .map_err(|mismatch| spec.refuse(mismatch, value))?;
                        return Ok(());
                    }
                )+
                Err($crate::Error::invalid("option", name, concat!("one of", $(" ", stringify!($name)),+)))
            }

            fn check(&self) -> $crate::Result<()> {
                let mut specs = Self::SPECS.iter();
                $(
                    if let Some(spec) = specs.next() {
                        spec.check(&$crate::options::OptionValue::to_value(&self.$name))?;
                    }
                )+
                Ok(())
            }
        }
    };
    (@first $first:expr $(, $rest:expr)*) => { $first };
}

pub(crate) use choices;
pub use options;

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum Side {
        Left,
        Right,
    }
    choices!(Side { Left = "left", Right = "right" });

    options! {
        /// Options to test with.
        pub struct Sample {
            /// A length. It is
            /// long.
            length: Option<f64> = None, range = Range::POSITIVE, unit = "metres", none = "any length",
                another_scene = true;
            /// A count.
            count: u32 = 3, range = Range::from_to(1.0, 10.0);
            /// A side.
            side: Side = Side::Left;
            /// A seed.
            seed: u64 = 0, range = Range::SEED;
            /// A depth.
            depth: f64 = 0.75, range = Range::from_to(0.0625, 16.0).in_steps_of(0.0625), unit = "pixels";
            /// Factors.
            factors: Vec<f64> = vec![1.0, 2.0], range = Range::at_least(1.0);
        }
    }

    fn refusal(name: &str, value: &Value) -> Error {
        let mut options = Sample::default();
        let set = options.set(name, value);
        set.and_then(|()| options.check()).expect_err("out of range")
    }

    #[test]
    fn a_record_has_what_was_declared() {
        assert_eq!(Sample::default().check(), Ok(()));
        let [length, count, side, ..] = Sample::SPECS else { panic!("options are missing") };
        assert_eq!(length.paragraph(), "A length. It is long.");
        assert_eq!((length.none, length.unit), ("any length", Some("metres")));
        assert!(length.another_scene && !count.another_scene);
        assert_eq!((length.default)(), Value::None);
        assert_eq!((count.default)(), Value::Int(3));
        assert_eq!(side.kind, Kind::Choice(&["left", "right"]));
        assert_eq!((side.default)(), Value::Text("left".to_owned()));
    }

    #[test]
    fn values_are_set_by_name() {
        let mut options = Sample::default();
        options.set("length", &Value::Int(2)).unwrap();
        options.set("side", &Value::Text("right".to_owned())).unwrap();
        options.set("seed", &Value::Int(i128::from(u64::MAX))).unwrap();
        assert_eq!(options.check(), Ok(()));
        let expected =
            Sample { length: Some(2.0), side: Side::Right, seed: u64::MAX, ..Sample::default() };
        assert_eq!(options, expected);
        options.set("length", &Value::None).unwrap();
        assert_eq!(options.length, None);
    }

    #[test]
    fn refusals_name_option_value_and_range() {
        for (name, value, message) in [
            ("length", Value::Float(-1.0), "length is -1, but must be a positive number of metres"),
            (
                "length",
                Value::Float(f64::NAN),
                "length is NaN, but must be a positive number of metres",
            ),
            (
                "length",
                Value::Float(f64::INFINITY),
                "length is inf, but must be a positive number of metres",
            ),
            ("count", Value::Int(-1), "count is -1, but must be an integer from 1 to 10"),
            ("count", Value::Int(11), "count is 11, but must be an integer from 1 to 10"),
            ("side", Value::Text("up".to_owned()), "side is 'up', but must be 'left' or 'right'"),
            (
                "seed",
                Value::Int(1 << 64),
                "seed is 18446744073709551616, but must be an integer from 0 to below 2^64",
            ),
            (
                "depth",
                Value::Float(0.7),
                "depth is 0.7, but must be a number from 0.0625 to 16 pixels in steps of 0.0625",
            ),
            (
                "factors",
                Value::Floats(vec![2.0, 0.5]),
                "factors is [2, 0.5], but must be a sequence with each a number of at least 1",
            ),
            (
                "height",
                Value::None,
                "option is height, but must be one of length count side seed depth factors",
            ),
        ] {
            let error = refusal(name, &value);
            assert!(matches!(error, Error::InvalidParameter { .. }), "{error}");
            assert_eq!(error.to_string(), message);
        }
    }

    #[test]
    fn wrong_types_are_told_apart() {
        for (name, value, message) in [
            (
                "length",
                Value::Text("abc".to_owned()),
                "length is 'abc', but must be a positive number of metres",
            ),
            ("count", Value::Float(2.0), "count is 2.0, but must be an integer from 1 to 10"),
            ("count", Value::Bool(true), "count is True, but must be an integer from 1 to 10"),
            ("count", Value::None, "count is None, but must be an integer from 1 to 10"),
            ("side", Value::Int(1), "side is 1, but must be 'left' or 'right'"),
            (
                "factors",
                Value::Float(2.0),
                "factors is 2.0, but must be a sequence with each a number of at least 1",
            ),
        ] {
            let error = refusal(name, &value);
            assert!(matches!(error, Error::InvalidType { .. }), "{error}");
            assert_eq!(error.to_string(), message);
        }
    }

    #[test]
    fn ranges_are_told_in_words() {
        let words = |range: Range| range.in_words("number", None);
        assert_eq!(words(Range::NOT_NEGATIVE), "0 or a positive number");
        assert_eq!(words(Range::at_least(1.0)), "a number of at least 1");
        assert_eq!(words(Range::above_to(0.0, 1.0)), "a number above 0 and at most 1");
        assert_eq!(words(Range::from_below(0.0, 1.0)), "a number from 0 to below 1");
        assert_eq!(words(Range::between(0.0, 180.0)), "a number above 0 and below 180");
        assert_eq!(words(Range::from_to(1.0, 1_048_576.0)), "a number from 1 to 2^20");
        assert_eq!(words(Range::LENGTH), "a number from 1e-9 to 1e9");
    }

    #[test]
    fn ranges_have_their_ends() {
        let contains = |range: Range, value| range.contains(&Value::Float(value));
        assert!(
            contains(Range::at_least(1.0), f64::INFINITY) && !contains(Range::at_least(1.0), 0.99)
        );
        assert!(contains(Range::from_to(0.0, 1.0), 0.0) && contains(Range::from_to(0.0, 1.0), 1.0));
        assert!(
            !contains(Range::above_to(0.0, 1.0), 0.0) && contains(Range::above_to(0.0, 1.0), 1.0)
        );
        assert!(
            contains(Range::from_below(0.0, 1.0), 0.0)
                && !contains(Range::from_below(0.0, 1.0), 1.0)
        );
        assert!(
            !contains(Range::between(0.0, 1.0), 0.0) && !contains(Range::between(0.0, 1.0), 1.0)
        );
        assert!(!contains(Range::NOT_NEGATIVE, f64::INFINITY) && !contains(Range::ANY, f64::NAN));
    }
}
