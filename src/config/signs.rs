//! The signs of a gimbal's axes: a word for what is usual, or a table with 1 or −1 for each axis that is named.

use crate::gimbals::signs::{Sign, Signs};

use super::document::{Raw, Table};
use super::reader::{Expected, bare, number, text, word};
use super::suggestion;

const WORDS: &[(&str, Signs)] = &[("normal", Signs::NORMAL), ("reversed", Signs::REVERSED)];

/// A variable can hold a word only.
pub(super) fn signs(raw: &Raw) -> Result<Signs, Expected> {
    match raw {
        Raw::Table(table) => axes(table),
        Raw::Variable(_) => word(raw, WORDS)
            .map_err(|Expected(words)| Expected(format!("{words} (signs of single axes can be set in the file)"))),
        raw => word(raw, WORDS)
            .map_err(|Expected(words)| Expected(format!("{words}, or a table such as {{ pitch = -1, yaw = -1 }}"))),
    }
}

/// The same, or `None` for a gimbal of which it is found out.
pub(super) fn signs_or_auto(raw: &Raw) -> Result<Option<Signs>, Expected> {
    if text(raw) == Some("auto") {
        return Ok(None);
    }
    signs(raw).map(Some).map_err(|Expected(signs)| Expected(format!("auto, {signs}")))
}

fn axes(table: &Table) -> Result<Signs, Expected> {
    let mut signs = Signs::NORMAL;
    let mut wrong = Vec::new();
    for (key, value) in table {
        let axis = match key.as_str() {
            "roll" => &mut signs.roll,
            "pitch" => &mut signs.pitch,
            "yaw" => &mut signs.yaw,
            _ => {
                let hint = suggestion::hint(key, ["roll", "pitch", "yaw"]);
                wrong.push(format!("roll, pitch or yaw in the place of {}{hint}", bare(key)));
                continue;
            }
        };
        match number(&value.raw, &(-1.0..=1.0)) {
            Some(1.0) => *axis = Sign::Same,
            Some(-1.0) => *axis = Sign::Opposite,
            _ => wrong.push(format!("1 or -1 for {key}, not {}", value.raw)),
        }
    }
    if wrong.is_empty() { Ok(signs) } else { Err(Expected(wrong.join("; "))) }
}
