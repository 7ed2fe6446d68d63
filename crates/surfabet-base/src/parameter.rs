//! A parameter outside its domain.

use std::borrow::Cow;
use std::fmt::Display;

/// A parameter is outside its domain.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} is {value}, but must be {requirement}")]
pub struct InvalidParameter {
    /// Name of the parameter.
    pub name: &'static str,
    /// The value given, as text.
    pub value: String,
    /// What it has to satisfy.
    pub requirement: Cow<'static, str>,
}

/// Characters of a number that a message shows; longer ones get an exponent.
const LONGEST_NUMBER: usize = 24;

impl InvalidParameter {
    /// The parameter `name` with its value spelled out; `requirement` goes on after "must be".
    pub fn new(
        name: &'static str,
        value: impl Display,
        requirement: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self { name, value: shown(value), requirement: requirement.into() }
    }
}

/// A value as text: of 1e300 not all the digits, of integers all.
fn shown(value: impl Display) -> String {
    let text = value.to_string();
    if text.len() <= LONGEST_NUMBER || text.parse::<i128>().is_ok() {
        return text;
    }
    text.parse::<f64>().map_or(text, |number| format!("{number:e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_says_name_value_and_requirement() {
        let fixed = InvalidParameter::new("radius", -0.5, "a distance of at least 0");
        assert_eq!(fixed.to_string(), "radius is -0.5, but must be a distance of at least 0");
        let computed = InvalidParameter::new("count", 7, format!("at most {}", 5));
        assert_eq!(computed.to_string(), "count is 7, but must be at most 5");
        assert_eq!((computed.name, computed.value.as_str()), ("count", "7"));
    }

    #[test]
    fn numbers_of_many_digits_have_an_exponent() {
        let shown = |value| InvalidParameter::new("size", value, "less").value;
        assert_eq!([1e300, -1e300, 5e-324].map(shown), ["1e300", "-1e300", "5e-324"]);
        assert_eq!([0.001, 1e15, -0.1].map(shown), ["0.001", "1000000000000000", "-0.1"]);
        assert_eq!([f64::NAN, f64::INFINITY].map(shown), ["NaN", "inf"]);
        assert_eq!(InvalidParameter::new("seed", i128::MAX, "less").value, i128::MAX.to_string());
        let text = "a text of more than 24 characters";
        assert_eq!(InvalidParameter::new("name", text, "shorter").value, text);
    }
}
