//! What a model holds, as named facts for people.

use std::fmt;

/// One fact about a model.
#[derive(Debug, Clone, PartialEq)]
pub enum Fact {
    /// A number of things.
    Count(u64),
    /// A measure, in the unit that its name gives.
    Number(f64),
    /// Yes or no.
    Flag(bool),
    /// A name or a list.
    Text(String),
}

impl From<usize> for Fact {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl From<u64> for Fact {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<f64> for Fact {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<bool> for Fact {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<String> for Fact {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl fmt::Display for Fact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => count.fmt(f),
            Self::Number(number) => number.fmt(f),
            Self::Flag(flag) => f.write_str(if *flag { "yes" } else { "no" }),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Facts about a model by name, in the order in which they are shown.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Names, with the unit in brackets, and values.
    pub facts: Vec<(String, Fact)>,
}

impl Summary {
    /// With one more fact.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, fact: impl Into<Fact>) -> Self {
        self.facts.push((name.into(), fact.into()));
        self
    }
}
