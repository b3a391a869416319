//! The fields of what is asked: what each may be, and the strict reading of them.

use std::fmt;

use serde::Deserializer;
use serde::de::{MapAccess, Visitor};
use serde_json::Value;

use super::danger::Danger;

/// One field.
pub struct Field {
    pub name: &'static str,
    pub about: &'static str,
    pub kind: Kind,
    pub required: bool,
}

/// A word of these, which must be there.
pub const fn word(name: &'static str, about: &'static str, words: &'static [&'static str]) -> Field {
    Field { name, about, kind: Kind::Word(words), required: true }
}

/// A number that may be left out, of either sign.
pub const fn number(name: &'static str, about: &'static str, largest: f64) -> Field {
    Field { name, about, kind: Kind::Number { min: -largest, max: largest }, required: false }
}

/// The same from 0.
pub const fn positive(name: &'static str, about: &'static str, largest: f64) -> Field {
    Field { name, about, kind: Kind::Number { min: 0.0, max: largest }, required: false }
}

/// A number on a scale of the gimbal's own, which is what its parameters can hold: 16 bits.
pub const fn scale(name: &'static str, about: &'static str) -> Field {
    positive(name, about, 32_767.0)
}

pub const fn required(field: Field) -> Field {
    Field { required: true, ..field }
}

pub const fn optional(field: Field) -> Field {
    Field { required: false, ..field }
}

/// What a field may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Number {
        min: f64,
        max: f64,
    },
    Word(&'static [&'static str]),
    /// A whole number, or one of a few words in its place.
    WholeOrWord {
        min: u8,
        max: u8,
        words: &'static [&'static str],
    },
    Flag,
    /// A word of so many printable ASCII characters.
    Name {
        longest: usize,
    },
}

/// What is wrong with what is asked; finishes as a sentence that says what was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Wrong {
    #[error("the body is no JSON object: {0}")]
    NotJson(String),
    #[error("{name} is there twice")]
    Twice { name: String },
    #[error("{name}: unknown field; expected {}", listed(known))]
    UnknownField { name: String, known: Vec<&'static str> },
    #[error("{name} is missing; expected {expected}")]
    Missing { name: &'static str, expected: String },
    #[error("{name}: found {found}; expected {expected}")]
    Value { name: &'static str, found: String, expected: String },
    #[error("nothing is asked for; expected at least one of {}", .0.join(", "))]
    Nothing(Vec<&'static str>),
    #[error("{0}")]
    Together(&'static str),
    #[error("this is dangerous: {}; it is done when the body says \"confirm\": \"{}\"", .0.cost, .0.word)]
    Unconfirmed(&'static Danger),
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

impl Kind {
    pub fn expected(self) -> String {
        match self {
            Self::Number { min, max } => format!("a number from {min} to {max}"),
            Self::Word(words) => one_of(words),
            Self::WholeOrWord { min, max, words } => {
                format!("a whole number from {min} to {max}, or {}", one_of(words))
            }
            Self::Flag => "true or false".to_owned(),
            Self::Name { longest } => format!("a name of 1 to {longest} printable ASCII characters"),
        }
    }

    fn accepts(self, value: &Value) -> bool {
        match (self, value) {
            (Self::Number { min, max }, Value::Number(number)) => {
                number.as_f64().is_some_and(|number| (min..=max).contains(&number))
            }
            (Self::WholeOrWord { min, max, .. }, Value::Number(number)) => {
                number.as_u64().is_some_and(|number| (u64::from(min)..=u64::from(max)).contains(&number))
            }
            (Self::Word(words) | Self::WholeOrWord { words, .. }, Value::String(text)) => {
                words.contains(&text.as_str())
            }
            (Self::Flag, Value::Bool(_)) => true,
            (Self::Name { longest }, Value::String(text)) => {
                (1..=longest).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic())
            }
            _ => false,
        }
    }

    /// A word of the command line as it would stand in a body.
    pub fn of_text(self, text: &str) -> Value {
        match self {
            Self::Flag => match text {
                "on" | "true" => Value::Bool(true),
                "off" | "false" => Value::Bool(false),
                _ => Value::String(text.to_owned()),
            },
            Self::Number { .. } | Self::WholeOrWord { .. } => text
                .parse::<u64>()
                .map(Value::from)
                .or_else(|_| text.parse::<f64>().map(Value::from))
                .ok()
                // What is no number, or not finite, is refused as the text that it is.
                .filter(|value| !value.is_null())
                .unwrap_or_else(|| Value::String(text.to_owned())),
            Self::Word(_) | Self::Name { .. } => Value::String(text.to_owned()),
        }
    }
}

fn one_of(words: &[&str]) -> String {
    match words {
        [] => "nothing".to_owned(),
        [only] => (*only).to_owned(),
        [others @ .., last] => format!("{} or {last}", others.join(", ")),
    }
}

/// What was given, each right by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Values {
    fields: Vec<(&'static str, Value)>,
    is_confirmed: bool,
}

impl Values {
    pub(super) fn confirm(&mut self) {
        self.is_confirmed = true;
    }

    /// The word of what is dangerous was said.
    pub fn is_confirmed(&self) -> bool {
        self.is_confirmed
    }

    pub(super) fn take(&mut self, field: &Field, value: Value) -> Result<(), Wrong> {
        if !field.kind.accepts(&value) {
            let found = shortened(&value);
            return Err(Wrong::Value { name: field.name, found, expected: field.kind.expected() });
        }
        self.fields.push((field.name, value));
        Ok(())
    }

    pub fn has(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    pub fn number(&self, name: &str) -> Option<f64> {
        self.find(name)?.as_f64()
    }

    pub fn word(&self, name: &str) -> Option<&str> {
        self.find(name)?.as_str()
    }

    /// Which of `words` it is.
    pub fn index(&self, name: &str, words: &[&str]) -> Option<usize> {
        let given = self.word(name)?;
        words.iter().position(|word| *word == given)
    }

    pub fn flag(&self, name: &str) -> Option<bool> {
        self.find(name)?.as_bool()
    }

    fn find(&self, name: &str) -> Option<&Value> {
        self.fields.iter().find(|(given, _)| *given == name).map(|(_, value)| value)
    }
}

/// A value as it was sent, or its beginning.
fn shortened(value: &Value) -> String {
    const ENOUGH: usize = 60;
    let text = value.to_string();
    if text.chars().count() <= ENOUGH { text } else { text.chars().take(ENOUGH).chain(['…']).collect() }
}

/// The fields of a JSON object, none of them twice; an empty body is an empty object.
pub(super) fn object(body: &[u8]) -> Result<Vec<(String, Value)>, Wrong> {
    if body.trim_ascii().is_empty() {
        return Ok(Vec::new());
    }
    let not_json = |error: serde_json::Error| Wrong::NotJson(error.to_string());
    let mut reader = serde_json::Deserializer::from_slice(body);
    let fields = reader.deserialize_map(Fields).map_err(not_json)?;
    reader.end().map_err(not_json)?;
    let twice = fields.iter().enumerate().find(|(at, (name, _))| fields[..*at].iter().any(|(other, _)| other == name));
    match twice {
        Some((_, (name, _))) => Err(Wrong::Twice { name: name.clone() }),
        None => Ok(fields),
    }
}

struct Fields;

impl<'de> Visitor<'de> for Fields {
    type Value = Vec<(String, Value)>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut fields = Vec::new();
        while let Some(field) = map.next_entry()? {
            fields.push(field);
        }
        Ok(fields)
    }
}
