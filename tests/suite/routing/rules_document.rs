//! `docs/routing.md` against the code and the tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The files whose comments carry the numbers of rules.
const NUMBERED: [&str; 8] = [
    "src/router/routes.rs",
    "src/router/rules.rs",
    "src/bridge/channels.rs",
    "src/bridge/delivery.rs",
    "src/bridge/firewall.rs",
    "src/bridge/pacing.rs",
    "src/bridge/presenting.rs",
    "src/bridge/rates.rs",
];

/// Every rule in the code is a section of the document, and the other way round.
#[test]
fn the_document_has_the_rules_of_the_code() {
    let in_code: BTreeSet<u32> =
        NUMBERED.iter().flat_map(|file| comments(&read(file)).flat_map(rules).collect::<Vec<_>>()).collect();
    let in_document: BTreeSet<u32> =
        read("docs/routing.md").lines().filter(|line| line.starts_with("## R")).flat_map(rules).collect();
    assert_eq!(in_document, in_code);
    assert_eq!(in_code, (1..=in_code.len() as u32).collect(), "they are numbered without gaps");
}

/// Every section names the test that shows its rule, and that test exists.
#[test]
fn the_document_names_tests_that_exist() {
    let code: String =
        sources(Path::new("src")).chain(sources(Path::new("tests/suite"))).map(|file| read(&file)).collect();
    let document = read("docs/routing.md");
    for section in document.split("\n## R").skip(1) {
        let title = section.lines().next().unwrap_or_default();
        let section = section.split("\n## ").next().unwrap_or_default();
        let (_, named) = section.split_once("Shown by:").unwrap_or_else(|| panic!("R{title} names no test"));
        let tests: Vec<&str> = named.split('`').skip(1).step_by(2).collect();
        assert!(!tests.is_empty(), "R{title} names no test");
        for test in tests {
            assert!(code.contains(&format!("fn {test}(")), "R{title}: there is no test {test}");
        }
    }
}

fn comments(code: &str) -> impl Iterator<Item = &str> {
    code.lines().filter_map(|line| line.split_once("//").map(|(_, comment)| comment))
}

/// The numbers of the rules that a line names.
fn rules(line: &str) -> Vec<u32> {
    let words = line.split(|letter: char| !letter.is_ascii_alphanumeric());
    words.filter_map(|word| word.strip_prefix('R')?.parse().ok()).collect()
}

fn sources(folder: &Path) -> impl Iterator<Item = String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut waiting, mut files) = (vec![folder.to_owned()], Vec::<PathBuf>::new());
    while let Some(path) = waiting.pop() {
        match fs::read_dir(root.join(&path)) {
            Ok(entries) => {
                waiting.extend(entries.map(|entry| path.join(entry.expect("a readable folder").file_name())))
            }
            Err(_) => files.push(path),
        }
    }
    files.sort();
    files
        .into_iter()
        .filter(|file| file.extension().is_some_and(|end| end == "rs"))
        .map(|file| file.display().to_string())
}

fn read(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
