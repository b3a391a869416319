//! Lays `GIMBALD__SECTION__KEY` and `GIMBALD__LINK__NAME__KEY` over what the file says.

use ::config::{Environment, Map, Source};

use super::document::{Raw, Table, Value};
use super::problem::{Place, Problem};
use super::reader::bare;
use super::suggestion;

pub(super) const PREFIX: &str = "GIMBALD__";
const SEPARATOR: &str = "__";

/// Sections that there is one of.
const SINGLE: [&str; 5] = ["vehicle", "autopilot", "control", "roi", "http"];
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
        for (path, text) in collect(name, text) {
            let value = Value { place: place.clone(), raw: Raw::Variable(text) };
            if let Err((found, expected)) = lay_over(root, &path, value) {
                problems.push(Problem { place: place.clone(), key: String::new(), found, expected });
            }
        }
    }
}

/// One variable as path (`link.ground.endpoint`) and text. One by one, because only paths come out.
fn collect(name: String, text: String) -> impl Iterator<Item = (String, String)> {
    let variable = Map::from_iter([(name, text)]);
    let source = Environment::default().prefix("GIMBALD").separator(SEPARATOR).source(Some(variable));
    let values = source.collect().expect("only bytes that are no UTF-8 are an error");
    values.into_iter().map(|(path, value)| (path, value.into_string().expect("it stays the text that it is")))
}

/// Finds what `path` stands for; the error is what was found and what is expected.
fn lay_over(root: &mut Table, path: &str, value: Value) -> Result<(), (String, String)> {
    let (section, rest) = path.split_once('.').unwrap_or((path, ""));
    let rest = rest.replace('.', SEPARATOR);
    if SINGLE.contains(&section) && !rest.is_empty() {
        let empty = Value { place: value.place.clone(), raw: Raw::Table(Table::new()) };
        // A section of the wrong kind is reported when it is read.
        if let Raw::Table(table) = &mut root.entry(section.to_owned()).or_insert(empty).raw {
            table.insert(rest, value);
        }
        return Ok(());
    }
    // A name may hold `__` itself, and `_` beside it: the key is what stands behind the last.
    let Some((entry, key)) = rest.rsplit_once(SEPARATOR).filter(|_| NAMED.contains(&section)) else {
        let sections = SINGLE.into_iter().chain(NAMED).filter(|known| *known != section);
        let hint = suggestion::closest(section, sections)
            .map(|meant| format!("; did you mean {PREFIX}{}__?", meant.to_uppercase()))
            .unwrap_or_default();
        let expected = "GIMBALD__SECTION__KEY with VEHICLE, AUTOPILOT, CONTROL, ROI or HTTP, or \
                        GIMBALD__LINK__NAME__KEY, or GIMBALD__GIMBAL__NAME__KEY";
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
    let (found, known) = (Raw::Text(entry.to_owned()), names.iter().map(|name| bare(name)).collect::<Vec<_>>());
    Err((format!("no {section} named {found} in the file"), format!("one of {}{hint}", known.join(", "))))
}
