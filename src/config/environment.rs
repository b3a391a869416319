//! Lays `GIMBALD__SECTION__KEY` and `GIMBALD__LINK__NAME__KEY` over what the file says.

use super::document::{Raw, Table, Value};
use super::problem::{Place, Problem};
use super::suggestion;

pub(super) const PREFIX: &str = "GIMBALD__";

/// Sections that there is one of.
const SINGLE: [&str; 4] = ["vehicle", "control", "roi", "http"];
/// Sections whose entries are told apart by their name.
const NAMED: [&str; 2] = ["link", "gimbal"];

/// How a name is written in a variable: case does not matter, and `-` is `_`.
pub(super) fn spelling(name: &str) -> String {
    name.to_ascii_lowercase().replace('-', "_")
}

/// Replaces or adds the values that `variables` (name and text, each name with the prefix) stand for.
pub(super) fn apply(root: &mut Table, variables: Vec<(String, String)>, problems: &mut Vec<Problem>) {
    for (name, text) in variables {
        let place = Place::Variable(name.clone());
        if let Err((found, expected)) = apply_one(root, &name, text) {
            problems.push(Problem { place, key: String::new(), found, expected });
        }
    }
}

/// Finds what `name` stands for; the error is what was found and what is expected.
fn apply_one(root: &mut Table, name: &str, text: String) -> Result<(), (String, String)> {
    let path = name.strip_prefix(PREFIX).unwrap_or(name).to_ascii_lowercase();
    let (section, rest) = path.split_once("__").unwrap_or((&path, ""));
    let value = Value { place: Place::Variable(name.to_owned()), raw: Raw::Variable(text) };
    if SINGLE.contains(&section) && !rest.is_empty() {
        let empty = Value { place: value.place.clone(), raw: Raw::Table(Table::new()) };
        // A section of the wrong kind is reported when it is read.
        if let Raw::Table(table) = &mut root.entry(section.to_owned()).or_insert(empty).raw {
            table.insert(rest.to_owned(), value);
        }
        return Ok(());
    }
    let Some((entry, key)) = rest.rsplit_once("__").filter(|_| NAMED.contains(&section)) else {
        let sections = SINGLE.into_iter().chain(NAMED).filter(|known| *known != section);
        let hint = suggestion::closest(section, sections)
            .map(|meant| format!("; did you mean {PREFIX}{}__?", meant.to_uppercase()))
            .unwrap_or_default();
        let expected = "GIMBALD__SECTION__KEY with VEHICLE, CONTROL, ROI or HTTP, or GIMBALD__LINK__NAME__KEY, or \
                        GIMBALD__GIMBAL__NAME__KEY";
        return Err(("an unknown variable".to_owned(), format!("{expected}{hint}")));
    };
    if key == "name" {
        return Err(("a variable for a name".to_owned(), "names to be set in the file".to_owned()));
    }
    let Some(Value { raw: Raw::Array(entries), .. }) = root.get_mut(section) else {
        return Err((format!("no {section} in the file"), format!("a variable of a {section} that the file has")));
    };
    let mut names = Vec::new();
    for item in entries {
        let Raw::Table(table) = &mut item.raw else { continue };
        let Some(Value { raw: Raw::Text(name), .. }) = table.get("name") else { continue };
        if spelling(name) == spelling(entry) {
            table.insert(key.to_owned(), value);
            return Ok(());
        }
        names.push(name.clone());
    }
    let hint = suggestion::hint(entry, names.iter().map(String::as_str));
    Err((format!("no {section} named {entry:?} in the file"), format!("one of {}{hint}", names.join(", "))))
}
