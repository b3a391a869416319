//! Takes values out of a table: those that are asked for, each with what it must be; the rest are unknown keys.

use std::fmt;
use std::ops::RangeInclusive;

use super::document::{Raw, Table, Value};
use super::problem::{Place, Problem, shortened};
use super::suggestion;

/// A value with the place it was read from, to report what is only wrong together with others.
#[derive(Clone, Debug)]
pub struct Located<T> {
    pub value: T,
    pub place: Place,
    /// The setting, such as `link.ground.endpoint`.
    pub key: String,
    /// The value as it is shown to the operator.
    pub shown: String,
}

impl<T> Located<T> {
    pub(super) fn problem(&self, found: impl fmt::Display, expected: impl Into<String>) -> Problem {
        Problem {
            place: self.place.clone(),
            key: self.key.clone(),
            found: found.to_string(),
            expected: expected.into(),
        }
    }
}

/// What a value should have been; finishes "expected …".
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Expected(pub String);

impl Expected {
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }
}

/// One table that is being read.
pub(super) struct Section<'a> {
    path: String,
    place: Place,
    values: Table,
    asked: Vec<&'static str>,
    problems: &'a mut Vec<Problem>,
}

impl<'a> Section<'a> {
    pub fn new(path: String, place: Place, values: Table, problems: &'a mut Vec<Problem>) -> Self {
        Self { path, place, values, asked: Vec::new(), problems }
    }

    /// The value at `key` as `read` understands it; `None` when there is none, or when it is wrong and reported.
    pub fn read<T>(&mut self, key: &'static str, read: impl FnOnce(&Raw) -> Result<T, Expected>) -> Option<Located<T>> {
        self.asked.push(key);
        let Value { place, raw } = self.values.remove(key)?;
        let key = format!("{}.{key}", self.path);
        match read(&raw) {
            Ok(value) => Some(Located { value, place, key, shown: raw.to_string() }),
            Err(Expected(expected)) => {
                self.problems.push(Problem { place, key, found: format!("found {raw}"), expected });
                None
            }
        }
    }

    /// As [`Self::read`]; a missing key is a problem too.
    pub fn required<T>(
        &mut self,
        key: &'static str,
        example: &str,
        read: impl FnOnce(&Raw) -> Result<T, Expected>,
    ) -> Option<Located<T>> {
        if !self.values.contains_key(key) {
            self.problems.push(Problem {
                place: self.place.clone(),
                key: format!("{}.{key}", self.path),
                found: "missing".to_owned(),
                expected: example.to_owned(),
            });
        }
        self.read(key, read)
    }

    /// The table at `key`, every entry of it as `read` understands its key and value. Wrong entries are reported and
    /// left out; variables cannot set it.
    pub fn entries<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        read: impl Fn(&str, &Raw) -> Result<T, Expected>,
    ) -> Vec<T> {
        self.asked.push(key);
        let Some(Value { place, raw }) = self.values.remove(key) else { return Vec::new() };
        let key = format!("{}.{key}", self.path);
        let table = match raw {
            Raw::Table(table) => table,
            Raw::Variable(_) => {
                let (found, expected) = ("a variable for a table".to_owned(), "it to be set in the file".to_owned());
                self.problems.push(Problem { place, key, found, expected });
                return Vec::new();
            }
            other => {
                let found = format!("found {other}");
                self.problems.push(Problem { place, key, found, expected: expected.to_owned() });
                return Vec::new();
            }
        };
        let mut entries = Vec::new();
        for (name, Value { place, raw }) in table {
            match read(&name, &raw) {
                Ok(entry) => entries.push(entry),
                Err(Expected(expected)) => {
                    let found = format!("found {raw}");
                    self.problems.push(Problem { place, key: format!("{key}.{}", bare(&name)), found, expected });
                }
            }
        }
        entries
    }

    /// Reports every key that was not asked for, and gives those that were.
    pub fn finish(self) -> Vec<&'static str> {
        for (key, Value { place, .. }) in self.values {
            let hint = suggestion::hint(&key, self.asked.iter().copied());
            self.problems.push(Problem {
                place,
                key: format!("{}.{}", self.path, bare(&key)),
                found: "unknown key".to_owned(),
                expected: format!("one of {}{hint}", self.asked.join(", ")),
            });
        }
        self.asked
    }
}

/// A key as TOML would have it, quoted when it holds anything unusual; the beginning of a long one.
pub(super) fn bare(key: &str) -> String {
    shortened(if is_name(key) { key.to_owned() } else { format!("{key:?}") })
}

/// `[A-Za-z0-9_-]+`, which is what TOML takes for a bare key.
pub(super) fn is_name(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'))
}

/// `a, b or c`.
pub(super) fn listed(words: &[&str]) -> String {
    match words {
        [] => String::new(),
        [only] => (*only).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// Any text.
pub(super) fn text(raw: &Raw) -> Option<&str> {
    match raw {
        Raw::Text(text) | Raw::Variable(text) => Some(text),
        _ => None,
    }
}

/// One of the words of a list.
pub(super) fn word<T: Copy>(raw: &Raw, words: &[(&'static str, T)]) -> Result<T, Expected> {
    let names: Vec<&str> = words.iter().map(|(name, _)| *name).collect();
    let given = text(raw);
    match words.iter().find(|(name, _)| given == Some(*name)) {
        Some((_, value)) => Ok(*value),
        None => Err(Expected(format!("{}{}", listed(&names), suggestion::hint(given.unwrap_or_default(), names)))),
    }
}

/// A whole number in `range`.
pub(super) fn whole<T: TryFrom<i64> + Into<i64> + Copy>(raw: &Raw, range: RangeInclusive<T>) -> Result<T, Expected> {
    let (least, most): (i64, i64) = ((*range.start()).into(), (*range.end()).into());
    let number = match raw {
        Raw::Integer(number) => Some(*number),
        Raw::Variable(text) => text.parse().ok(), // text that is no number is reported below
        _ => None,
    };
    number
        .filter(|number| (least..=most).contains(number))
        .and_then(|number| T::try_from(number).ok()) // the range is one of T's own values
        .ok_or_else(|| Expected(format!("a whole number from {least} to {most}")))
}

/// A number in `range`, with or without a decimal point.
pub(super) fn number(raw: &Raw, range: &RangeInclusive<f64>) -> Option<f64> {
    let number = match raw {
        Raw::Integer(number) => *number as f64,
        Raw::Float(number) => *number,
        Raw::Variable(text) => text.parse().ok()?, // text that is no number is reported by the caller
        _ => return None,
    };
    range.contains(&number).then_some(number)
}

/// `true` or `false`.
pub(super) fn flag(raw: &Raw) -> Result<bool, Expected> {
    match raw {
        Raw::Flag(flag) => Ok(*flag),
        Raw::Variable(text) if text == "true" => Ok(true),
        Raw::Variable(text) if text == "false" => Ok(false),
        _ => Err(Expected::new("true or false")),
    }
}
