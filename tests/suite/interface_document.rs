//! `docs/interface.md` says of every action what the table in the code says.

use std::fs;
use std::path::Path;

use gimbald::actions::{ACTIONS, Action, CONFIRM, Field, Kind};

/// "One table in code from which routes, CLI and docs agree". To have a row as it must be, read what this test found missing.
#[test]
fn every_action_has_its_row() {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/interface.md");
    let document = fs::read_to_string(document).expect("it is there");
    let rows = ACTIONS.iter().map(row);
    let missing: Vec<String> = rows.filter(|row| !document.lines().any(|line| line == row)).collect();
    assert!(missing.is_empty(), "missing in docs/interface.md:\n{}", missing.join("\n"));
}

fn row(action: &Action) -> String {
    let fields: Vec<String> = action.body_fields().map(described).collect();
    let mut fields = if fields.is_empty() { "–".to_owned() } else { fields.join("; ") };
    if let Some(danger) = action.danger {
        let when = danger.when.map(|when| format!(" {when}")).unwrap_or_default();
        let confirmed = format!("`{CONFIRM}`: `{}`{when}", danger.word);
        fields = if fields == "–" { confirmed } else { format!("{fields}; {confirmed}") };
    }
    format!("| `{}` | {} | {fields} | `{}` |", action.path, action.about, action.command)
}

fn described(field: &Field) -> String {
    let kind = match field.kind {
        Kind::Number { min, max } => format!("{min} to {max}"),
        Kind::Word(words) => listed(words),
        Kind::WholeOrWord { min, max, words } => format!("{min} to {max}, {}", listed(words)),
        Kind::Flag => "`true`, `false`".to_owned(),
        Kind::Name { longest } => format!("up to {longest} characters"),
    };
    let optional = if field.required { "" } else { "?" };
    format!("`{}`{optional} ({kind}): {}", field.name, field.about)
}

fn listed(words: &[&str]) -> String {
    words.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ")
}

/// `docs/families/gremsy.md` tells how each function of the vendor's SDK is done in three ways; two of them are in the table.
#[test]
fn what_the_page_of_gremsy_names_is_there() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/families/gremsy.md");
    let page = fs::read_to_string(page).expect("it is there");
    let (mut paths, mut commands) = (0, 0);
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split(" | ").collect();
        let [_, _, http, command, ..] = cells[..] else { continue };
        for path in http.strip_prefix("`POST` ").into_iter().flat_map(quoted) {
            assert!(ACTIONS.iter().any(|action| action.path == path), "no path {path}: {row}");
            paths += 1;
            for command in quoted(command) {
                assert!(Action::of_command(command).is_some(), "no command {command}: {row}");
                commands += 1;
            }
        }
    }
    assert!(paths > 20 && commands > 20, "the table was found: {paths} paths, {commands} commands");
}

/// What stands between backticks.
fn quoted(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}
