//! Documents whose tables name tests: each row a rule by its number, in words, and the tests that show it.
//!
//! A test says which rules it is for by its name (`item_59_…`, `items_60_to_69_…`, `client_item_e54_…`, `statement_34_…`) or
//! in the comment above it ("Protocol checklist 59", "Client checklist E54 to E58", "Gimbal statements 34 and 46").

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// `59`: a rule of the protocol.
    Item(u32),
    /// `E54`: a rule from how clients behave.
    ClientItem(u32),
    /// `34` in the document of a family: a statement about gimbals.
    Statement(u32),
    /// `A-01`: a question that the protocol leaves open.
    Question(u32),
}

impl Rule {
    /// As the document of the protocol numbers them.
    pub fn parse(text: &str) -> Option<Self> {
        let number = |digits: &str| digits.parse().ok();
        if let Some(digits) = text.strip_prefix("A-") {
            return number(digits).map(Self::Question);
        }
        match text.strip_prefix('E') {
            Some(digits) => number(digits).map(Self::ClientItem),
            None => number(text).map(Self::Item),
        }
    }

    /// A bare number where statements are meant.
    fn as_statement(self) -> Option<Self> {
        match self {
            Self::Item(number) => Some(Self::Statement(number)),
            Self::ClientItem(_) | Self::Statement(_) | Self::Question(_) => None,
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Item(number) => write!(f, "item {number}"),
            Self::ClientItem(number) => write!(f, "item E{number}"),
            Self::Statement(number) => write!(f, "statement {number}"),
            Self::Question(number) => write!(f, "A-{number:02}"),
        }
    }
}

/// One row of a document's tables.
pub struct Row {
    pub line: usize,
    pub rule: Rule,
    pub cells: Vec<String>,
}

impl Row {
    /// Whether it has so many cells, and something in each.
    pub fn is_whole(&self, columns: usize) -> bool {
        self.cells.len() == columns && !self.cells.iter().any(String::is_empty)
    }
}

/// What is wrong with the tests that the rows name in their last cell: none named, not there, or not for that rule.
pub fn wrongly_named_tests(rows: &[Row]) -> Vec<String> {
    let tests = tests();
    let mut problems = Vec::new();
    for row in rows {
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
    problems
}

/// The rows of a document's tables that begin with a number, as `parse` reads it.
pub fn rows(document: &str, parse: impl Fn(&str) -> Option<Rule>) -> Vec<Row> {
    let document = read(&root().join(document));
    let lines = document.lines().enumerate().filter(|(_, line)| line.starts_with("| "));
    let rows = lines.filter_map(|(at, line)| {
        let cells: Vec<String> =
            line.trim_matches('|').replace("\\|", "\u{1}").split('|').map(|cell| cell.trim().to_owned()).collect();
        parse(cells.first()?).map(|rule| Row { line: at + 1, rule, cells })
    });
    rows.collect()
}

/// Every test of the suite and of the library by the path that `cargo test` knows it by, with the rules that it names.
pub fn tests() -> BTreeMap<String, BTreeSet<Rule>> {
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
pub fn client_script(path: &str) -> Option<BTreeSet<Rule>> {
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

pub fn rules_in_name(name: &str) -> BTreeSet<Rule> {
    let numbers = |singular: &str, plural: &str| {
        name.strip_prefix(plural)
            .or_else(|| name.strip_prefix(singular))
            .map(|list| list.to_uppercase().replace("_AND_", " and ").replace("_TO_", " to ").replace('_', ", "))
    };
    if let Some(list) = numbers("statement_", "statements_") {
        return leading_rules(&list).into_iter().filter_map(Rule::as_statement).collect();
    }
    let name = name.strip_prefix("client_").unwrap_or(name);
    let items = name.strip_prefix("items_").or_else(|| name.strip_prefix("item_")).unwrap_or(name);
    let is_item = items != name || items.starts_with('e');
    let list = items.to_uppercase().replace("_AND_", " and ").replace("_TO_", " to ").replace('_', ", ");
    if is_item { leading_rules(&list) } else { BTreeSet::new() }
}

pub fn rules_in_comment(comment: &str) -> BTreeSet<Rule> {
    let lists = |before: &'static str| comment.split(before).skip(1).flat_map(leading_rules);
    let items = lists("Protocol checklist ").chain(lists("Client checklist "));
    let statements = ["Gimbal statement ", "Gimbal statements ", "gimbal statement ", "gimbal statements "]
        .into_iter()
        .flat_map(lists);
    items.chain(statements.filter_map(Rule::as_statement)).collect()
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
pub fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

pub fn without_quoted(cell: &str) -> String {
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

pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

pub fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Fails with all of the problems of a document.
pub fn assert_none(document: &str, problems: &[String]) {
    assert!(problems.is_empty(), "{document}:\n{}", problems.join("\n"));
}
