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

impl InvalidParameter {
    /// The parameter `name` with its value spelled out; `requirement` goes on after "must be".
    pub fn new(
        name: &'static str,
        value: impl Display,
        requirement: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self { name, value: value.to_string(), requirement: requirement.into() }
    }
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
}
