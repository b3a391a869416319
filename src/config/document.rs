//! A TOML file as values that know the line they stand on.

use std::collections::BTreeMap;
use std::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::{Place, Problem, shortened};

/// Keys and values, by key.
pub(super) type Table = BTreeMap<String, Value>;

#[derive(Clone, Debug)]
pub(super) struct Value {
    /// Of a table or array, its header.
    pub place: Place,
    pub raw: Raw,
}

#[derive(Clone, Debug)]
pub(super) enum Raw {
    Text(String),
    Integer(i64),
    /// An integer that does not fit 64 bits, as written.
    HugeInteger(String),
    Float(f64),
    Flag(bool),
    Date,
    Array(Vec<Value>),
    Table(Table),
    /// Text of an environment variable; may stand for any scalar.
    Variable(String),
}

/// As it is shown to the operator; the beginning of what is long.
impl fmt::Display for Raw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) | Self::Variable(text) => f.write_str(&shortened(format!("{text:?}"))),
            Self::Integer(value) => write!(f, "{value}"),
            Self::HugeInteger(digits) => f.write_str(&shortened(digits.clone())),
            Self::Float(value) => write!(f, "{value:?}"),
            Self::Flag(value) => write!(f, "{value}"),
            Self::Date => write!(f, "a date"),
            Self::Array(_) => write!(f, "an array"),
            Self::Table(_) => write!(f, "a table"),
        }
    }
}

/// The file's top level. A file that is no TOML has this one problem.
pub(super) fn parse(text: &str) -> Result<Table, Problem> {
    let lines = Lines::of(text);
    let root = DeTable::parse(text).map_err(|error| Problem {
        place: error.span().map_or(Place::File, |span| Place::Line(lines.at(span.start))),
        key: String::new(),
        found: "not TOML".to_owned(),
        expected: format!("a TOML file, but: {}", error.message().lines().collect::<Vec<_>>().join(" ")),
    })?;
    Ok(table(&lines, root.get_ref()))
}

fn table(lines: &Lines, source: &DeTable<'_>) -> Table {
    source.iter().map(|(key, item)| (key.get_ref().to_string(), value(lines, item))).collect()
}

fn value(lines: &Lines, source: &Spanned<DeValue<'_>>) -> Value {
    let raw = match source.get_ref() {
        DeValue::String(string) => Raw::Text(string.to_string()),
        DeValue::Integer(integer) => match i64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(number) => Raw::Integer(number),
            Err(_) => Raw::HugeInteger(integer.to_string()),
        },
        // What TOML calls a float is one to Rust too; what is too large becomes infinite, which no range holds.
        DeValue::Float(float) => Raw::Float(float.as_str().parse().unwrap_or(f64::INFINITY)),
        DeValue::Boolean(flag) => Raw::Flag(*flag),
        DeValue::Datetime(_) => Raw::Date,
        DeValue::Array(items) => Raw::Array(items.iter().map(|item| value(lines, item)).collect()),
        DeValue::Table(items) => Raw::Table(table(lines, items)),
    };
    Value { place: Place::Line(lines.at(source.span().start)), raw }
}

/// Where the lines of a text end, so that a position's line is found without counting from the beginning.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(position, _)| position).collect())
    }

    /// Counted from one.
    fn at(&self, position: usize) -> usize {
        1 + self.0.partition_point(|end| *end < position)
    }
}
