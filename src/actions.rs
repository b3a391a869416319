//! What can be asked of a gimbal by its name: the one table from which the window has its paths, `gimbald gimbal` its
//! commands, and both what they take.

mod danger;
mod fields;
mod reading;
mod table;

use std::fmt;

use serde_json::{Map, Value};

use crate::manager::asked::Asked;
pub use danger::{Danger, danger_of};
pub use fields::{Field, Kind, Values, Wrong};
pub use table::ACTIONS;

/// The field that holds the word of what is dangerous.
pub const CONFIRM: &str = "confirm";

/// One thing that can be asked.
pub struct Action {
    /// Where, below the gimbal; a part in braces is the field of that name.
    pub path: &'static str,
    /// On the command line.
    pub command: &'static str,
    pub about: &'static str,
    pub fields: &'static [Field],
    /// Where it can cost the camera or the flight.
    pub danger: Option<&'static Danger>,
    read: fn(&Values) -> Result<Asked, Wrong>,
}

impl fmt::Debug for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Action({})", self.command)
    }
}

impl Action {
    pub fn of_command(command: &str) -> Option<&'static Self> {
        ACTIONS.iter().find(|action| action.command == command)
    }

    /// The word without which it is not done, where it is dangerous.
    pub fn word(&self) -> Option<&'static str> {
        self.danger.map(|danger| danger.word)
    }

    /// The field that stands in the path.
    pub fn path_field(&self) -> Option<&'static Field> {
        let (_, rest) = self.path.split_once('{')?;
        let (name, _) = rest.split_once('}')?;
        self.fields.iter().find(|field| field.name == name)
    }

    /// Those that stand in the body.
    pub fn body_fields(&self) -> impl Iterator<Item = &'static Field> {
        let in_path = self.path_field().map(|field| field.name);
        self.fields.iter().filter(move |field| Some(field.name) != in_path)
    }

    /// Reads what is asked: `in_path` is the value that stands in the path, decoded.
    pub fn read(&self, in_path: Option<&str>, body: &[u8]) -> Result<Asked, Wrong> {
        let mut values = Values::default();
        if let (Some(field), Some(text)) = (self.path_field(), in_path) {
            values.take(field, Value::String(text.to_owned()))?;
        }
        for (name, value) in fields::object(body)? {
            if let Some(danger) = self.danger.filter(|_| name == CONFIRM) {
                if value.as_str() == Some(danger.word) {
                    values.confirm();
                }
                continue;
            }
            match self.body_fields().find(|field| field.name == name) {
                Some(field) => values.take(field, value)?,
                None => return Err(Wrong::UnknownField { name, known: self.names_in_body() }),
            }
        }
        if let Some(field) = self.fields.iter().find(|field| field.required && !values.has(field.name)) {
            return Err(Wrong::Missing { name: field.name, expected: field.kind.expected() });
        }
        let asked = (self.read)(&values)?;
        match danger_of(&asked) {
            Some(danger) if !values.is_confirmed() => Err(Wrong::Unconfirmed(danger)),
            Some(_) | None => Ok(asked),
        }
    }

    fn names_in_body(&self) -> Vec<&'static str> {
        self.body_fields().map(|field| field.name).chain(self.danger.map(|_| CONFIRM)).collect()
    }

    /// The path with `in_path` in its place, percent-encoded.
    pub fn path_with(&self, in_path: Option<&str>) -> String {
        match (self.path_field(), in_path) {
            (Some(field), Some(value)) => self.path.replace(&format!("{{{}}}", field.name), &percent_encoded(value)),
            _ => self.path.to_owned(),
        }
    }
}

/// A part of a path as it is sent.
pub fn percent_encoded(part: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    let encode = |byte: u8| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") };
    part.bytes().map(encode).collect()
}

/// A body of these fields.
pub fn body(fields: impl IntoIterator<Item = (String, Value)>) -> Vec<u8> {
    Value::Object(Map::from_iter(fields)).to_string().into_bytes()
}

#[cfg(test)]
mod tests;
