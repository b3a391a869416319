//! `docs/gimbal-manager.md` against the tests that it names.
//!
//! Each rule of the document is a row of a table: its number, the rule in words, the tests that show it. A test says
//! which rules it is for by its name (`item_59_…`, `items_60_to_69_…`, `client_item_e54_…`) or in the comment above it
//! ("Protocol checklist 59", "Client checklist E54 to E58").

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

const DOCUMENT: &str = "docs/gimbal-manager.md";

/// The rules that must be there; others may.
const ITEMS: [RangeInclusive<u32>; 5] = [40..=78, 80..=124, 127..=136, 139..=141, 177..=180];
const CLIENT_ITEMS: RangeInclusive<u32> = 1..=140;
const QUESTIONS: RangeInclusive<u32> = 1..=67;

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rule {
    /// `59`: a rule of the protocol.
    Item(u32),
    /// `E54`: a rule from how clients behave.
    ClientItem(u32),
    /// `A-01`: a question that the protocol leaves open.
    Question(u32),
}

impl Rule {
    fn parse(text: &str) -> Option<Self> {
        let number = |digits: &str| digits.parse().ok();
        if let Some(digits) = text.strip_prefix("A-") {
            return number(digits).map(Self::Question);
        }
        match text.strip_prefix('E') {
            Some(digits) => number(digits).map(Self::ClientItem),
            None => number(text).map(Self::Item),
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Item(number) => write!(f, "item {number}"),
            Self::ClientItem(number) => write!(f, "item E{number}"),
            Self::Question(number) => write!(f, "A-{number:02}"),
        }
    }
}

/// One row of the document's tables.
struct Row {
    line: usize,
    rule: Rule,
    cells: Vec<String>,
}

/// The rules that are there, each once, with nothing left empty.
#[test]
fn every_rule_is_there_once() {
    let mut problems = Vec::new();
    let mut seen = BTreeMap::new();
    for row in rows() {
        if let Some(first) = seen.insert(row.rule, row.line) {
            problems.push(format!("line {}: {} stands in line {first} already", row.line, row.rule));
        }
        let columns = if matches!(row.rule, Rule::Question(_)) { 5 } else { 3 };
        if row.cells.len() != columns || row.cells.iter().any(String::is_empty) {
            problems.push(format!("line {}: {} has not {columns} cells with something in each", row.line, row.rule));
        }
    }
    problems.extend(required().filter(|rule| !seen.contains_key(rule)).map(|rule| format!("no {rule}")));
    assert_none(&problems);
}

/// Every test that the document names exists and names the rule itself.
#[test]
fn every_named_test_is_there_and_says_what_it_shows() {
    let tests = tests();
    let mut problems = Vec::new();
    for row in rows().iter().filter(|row| !matches!(row.rule, Rule::Question(_))) {
        let at = format!("line {}: {}", row.line, row.rule);
        let named = quoted(row.cells.last().map_or("", String::as_str));
        if named.is_empty() {
            problems.push(format!("{at} names no test"));
        }
        for name in named {
            let shows = if name.ends_with(".py") { client_script(&name) } else { tests.get(&name).cloned() };
            match shows {
                None => problems.push(format!("{at}: there is no test {name}")),
                Some(shows) if !shows.contains(&row.rule) => {
                    problems.push(format!("{at}: {name} does not say that it is for {}", row.rule));
                }
                Some(_) => {}
            }
        }
    }
    assert_none(&problems);
}

/// Every open question names files that exist, and items that are rows, or tests.
#[test]
fn every_question_is_answered_in_code_and_by_a_test() {
    let rows = rows();
    let present: BTreeSet<Rule> = rows.iter().map(|row| row.rule).collect();
    let tests = tests();
    let mut problems = Vec::new();
    for row in rows.iter().filter(|row| matches!(row.rule, Rule::Question(_))) {
        let at = format!("line {}: {}", row.line, row.rule);
        let [_, _, _, code, shown_by] = &row.cells[..] else { continue };
        for file in quoted(code) {
            if !root().join(&file).is_file() {
                problems.push(format!("{at}: there is no {file}"));
            }
        }
        let named = quoted(shown_by);
        let items: Vec<Rule> = without_quoted(shown_by).split([' ', ',']).filter_map(Rule::parse).collect();
        if named.is_empty() && items.is_empty() {
            problems.push(format!("{at} names neither an item nor a test"));
        }
        problems.extend(items.iter().filter(|item| !present.contains(item)).map(|item| format!("{at}: no {item}")));
        let unknown = named.iter().filter(|name| !tests.contains_key(*name));
        problems.extend(unknown.map(|name| format!("{at}: there is no test {name}")));
    }
    assert_none(&problems);
}

/// Nor does the text around the tables name tests that are not there.
#[test]
fn every_path_is_that_of_a_test_or_of_a_module_of_tests() {
    let tests = tests();
    let document = read(&root().join(DOCUMENT));
    let mut problems = Vec::new();
    for (at, line) in document.lines().enumerate() {
        for path in quoted(line).into_iter().filter(|quoted| quoted.contains("::")) {
            let module = format!("{path}::");
            if !tests.keys().any(|test| *test == path || test.starts_with(&module)) {
                problems.push(format!("line {}: there is no test {path}", at + 1));
            }
        }
    }
    assert_none(&problems);
}

/// What the tests above go by.
#[test]
fn names_and_comments_say_what_a_test_is_for() {
    use Rule::{ClientItem, Item};

    for (name, expected) in [
        ("item_59_a_ground_station_takes_control", vec![Item(59)]),
        ("items_40_and_41_the_information", vec![Item(40), Item(41)]),
        ("items_60_to_62_configure", vec![Item(60), Item(61), Item(62)]),
        ("items_93_96_and_99_flags", vec![Item(93), Item(96), Item(99)]),
        ("client_item_e54_a_ground_station", vec![ClientItem(54)]),
        ("client_items_e7_and_e8_requests", vec![ClientItem(7), ClientItem(8)]),
        ("e41_to_e43_the_attitude", vec![ClientItem(41), ClientItem(42), ClientItem(43)]),
        ("no_item_5_here", vec![]),
        ("everything_is_answered", vec![]),
    ] {
        assert_eq!(rules_in_name(name), BTreeSet::from_iter(expected), "{name}");
    }
    for (comment, expected) in [
        ("Protocol checklist 62: \"When\". Protocol checklist 64: \"1\"", vec![Item(62), Item(64)]),
        ("Protocol checklist 67 and 68, and no more", vec![Item(67), Item(68)]),
        ("Client checklist E54 to E56: told", vec![ClientItem(54), ClientItem(55), ClientItem(56)]),
        ("Client checklist E7, E8 and E11.", vec![ClientItem(7), ClientItem(8), ClientItem(11)]),
        ("The checklist 5.", vec![]),
    ] {
        assert_eq!(rules_in_comment(comment), BTreeSet::from_iter(expected), "{comment}");
    }
    let tests = tests();
    for known in [
        "gimbal_manager_document::names_and_comments_say_what_a_test_is_for",
        "manager::control::tests::a_silent_holder_loses_control",
        "properties::manager::no_order_of_requests_breaks_the_manager",
    ] {
        assert!(tests.contains_key(known), "{known} of {}", tests.len());
    }
    assert!(!tests.contains_key("gimbal_manager_document::assert_none"));
}

fn required() -> impl Iterator<Item = Rule> {
    let items = ITEMS.into_iter().flatten().map(Rule::Item);
    items.chain(CLIENT_ITEMS.map(Rule::ClientItem)).chain(QUESTIONS.map(Rule::Question))
}

/// The rows of all tables that begin with a number.
fn rows() -> Vec<Row> {
    let document = read(&root().join(DOCUMENT));
    let lines = document.lines().enumerate().filter(|(_, line)| line.starts_with("| "));
    let rows = lines.filter_map(|(at, line)| {
        let cells: Vec<String> =
            line.trim_matches('|').replace("\\|", "\u{1}").split('|').map(|cell| cell.trim().to_owned()).collect();
        Rule::parse(cells.first()?).map(|rule| Row { line: at + 1, rule, cells })
    });
    rows.collect()
}

/// Every test of the suite and of the library by the path that `cargo test` knows it by, with the rules that it names.
fn tests() -> BTreeMap<String, BTreeSet<Rule>> {
    let mut tests = BTreeMap::new();
    for folder in ["tests/suite", "src"] {
        for file in sources(&root().join(folder)) {
            let module = file.strip_prefix(root().join(folder)).expect("it was found there").with_extension("");
            let module: Vec<&str> = module.iter().filter_map(|part| part.to_str()).collect();
            read_tests(&module.join("::"), &read(&file), &mut tests);
        }
    }
    tests
}

fn read_tests(module: &str, code: &str, tests: &mut BTreeMap<String, BTreeSet<Rule>>) {
    let (mut inner, mut comment, mut is_test) = (None, String::new(), false);
    for line in code.lines() {
        match line.strip_prefix("mod ").and_then(|rest| rest.strip_suffix(" {")) {
            Some(name) => inner = Some(name),
            None if line == "}" => inner = None,
            None => {}
        }
        let line = line.trim_start();
        if let Some(text) = line.strip_prefix("///") {
            comment.push_str(text);
        } else if line.starts_with("#[") {
            is_test |= line == "#[test]";
        } else {
            if let Some(rest) = line.strip_prefix("fn ")
                && is_test
            {
                let name = rest.split('(').next().unwrap_or_default();
                let mut rules = rules_in_name(name);
                rules.extend(rules_in_comment(&comment));
                let path: Vec<&str> = [Some(module), inner, Some(name)].into_iter().flatten().collect();
                tests.insert(path.join("::"), rules);
            }
            comment.clear();
            is_test = false;
        }
    }
}

/// The rules of a script that drives a real client, and of the modules that it imports, if `tests/run` runs it.
fn client_script(path: &str) -> Option<BTreeSet<Rule>> {
    let path = root().join(path);
    let script = path.file_stem()?.to_str()?;
    let runs_it = read(&root().join("tests/run")).split_whitespace().any(|word| word == script);
    let text = fs::read_to_string(&path).ok().filter(|_| runs_it)?;
    let imported = text.lines().filter_map(|line| line.strip_prefix("from ").or_else(|| line.strip_prefix("import ")));
    let modules = imported.filter_map(|rest| Some(path.with_file_name(rest.split_whitespace().next()?)));
    let mut texts: Vec<String> =
        modules.filter_map(|module| fs::read_to_string(module.with_extension("py")).ok()).collect();
    texts.push(text);
    let comment = |text: &String| text.split_whitespace().filter(|word| *word != "#").collect::<Vec<_>>().join(" ");
    Some(texts.iter().flat_map(|text| rules_in_comment(&comment(text))).collect())
}

fn rules_in_name(name: &str) -> BTreeSet<Rule> {
    let name = name.strip_prefix("client_").unwrap_or(name);
    let numbers = name.strip_prefix("items_").or_else(|| name.strip_prefix("item_")).unwrap_or(name);
    let is_item = numbers != name || numbers.starts_with('e');
    let list = numbers.to_uppercase().replace("_AND_", " and ").replace("_TO_", " to ").replace('_', ", ");
    if is_item { leading_rules(&list) } else { BTreeSet::new() }
}

fn rules_in_comment(comment: &str) -> BTreeSet<Rule> {
    let lists =
        ["Protocol checklist ", "Client checklist "].into_iter().flat_map(|before| comment.split(before).skip(1));
    lists.flat_map(leading_rules).collect()
}

/// The rules of a list such as "59", "E54 to E58" or "60, 61 and 63" that `text` begins with.
fn leading_rules(text: &str) -> BTreeSet<Rule> {
    let (mut rules, mut rest, mut range_from) = (BTreeSet::new(), text, None);
    loop {
        let letter = usize::from(rest.starts_with('E'));
        let digits = rest[letter..].bytes().take_while(u8::is_ascii_digit).count();
        let Some(rule) = Rule::parse(&rest[..letter + digits]) else { return rules };
        match (range_from.take(), rule) {
            (Some(Rule::Item(from)), Rule::Item(to)) => rules.extend((from..=to).map(Rule::Item)),
            (Some(Rule::ClientItem(from)), Rule::ClientItem(to)) => rules.extend((from..=to).map(Rule::ClientItem)),
            _ => _ = rules.insert(rule),
        }
        rest = &rest[letter + digits..];
        let and = [", and ", " and ", ", "].into_iter().find_map(|separator| rest.strip_prefix(separator));
        let to = [" to ", "–"].into_iter().find_map(|separator| rest.strip_prefix(separator));
        match (and, to) {
            (Some(next), _) => rest = next,
            (None, Some(next)) => (rest, range_from) = (next, Some(rule)),
            (None, None) => return rules,
        }
    }
}

/// What stands between backquotes.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn without_quoted(cell: &str) -> String {
    cell.split('`').step_by(2).collect()
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let (mut waiting, mut files) = (vec![folder.to_owned()], Vec::new());
    while let Some(path) = waiting.pop() {
        match fs::read_dir(&path) {
            Ok(entries) => waiting.extend(entries.map(|entry| entry.expect("a readable folder").path())),
            Err(_) => files.push(path),
        }
    }
    files.retain(|file| file.extension().is_some_and(|end| end == "rs"));
    files
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn assert_none(problems: &[String]) {
    assert!(problems.is_empty(), "{DOCUMENT}:\n{}", problems.join("\n"));
}
