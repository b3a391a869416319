//! `docs/gimbal-manager.md` against the tests that it names.
//!
//! Each rule of the document is a row of a table: its number, the rule in words, the tests that show it. A test says
//! which rules it is for ([`documented`]).

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use crate::support::documented::{
    self, Row, Rule, assert_none, quoted, read, root, rules_in_comment, rules_in_name, tests, without_quoted,
    wrongly_named_tests,
};

const DOCUMENT: &str = "docs/gimbal-manager.md";

/// The rules that must be there; others may.
const ITEMS: [RangeInclusive<u32>; 4] = [40..=78, 80..=124, 127..=141, 175..=180];
const CLIENT_ITEMS: RangeInclusive<u32> = 1..=140;
const QUESTIONS: RangeInclusive<u32> = 1..=67;

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
        if !row.is_whole(columns) {
            problems.push(format!("line {}: {} has not {columns} cells with something in each", row.line, row.rule));
        }
    }
    problems.extend(required().filter(|rule| !seen.contains_key(rule)).map(|rule| format!("no {rule}")));
    assert_none(DOCUMENT, &problems);
}

/// Every test that the document names exists and names the rule itself.
#[test]
fn every_named_test_is_there_and_says_what_it_shows() {
    let rules: Vec<Row> = rows().into_iter().filter(|row| !matches!(row.rule, Rule::Question(_))).collect();
    assert_none(DOCUMENT, &wrongly_named_tests(&rules));
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
    assert_none(DOCUMENT, &problems);
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
    assert_none(DOCUMENT, &problems);
}

/// What the tests above go by.
#[test]
fn names_and_comments_say_what_a_test_is_for() {
    use Rule::{ClientItem, Item, Statement};

    for (name, expected) in [
        ("item_59_a_ground_station_takes_control", vec![Item(59)]),
        ("items_40_and_41_the_information", vec![Item(40), Item(41)]),
        ("items_60_to_62_configure", vec![Item(60), Item(61), Item(62)]),
        ("items_93_96_and_99_flags", vec![Item(93), Item(96), Item(99)]),
        ("client_item_e54_a_ground_station", vec![ClientItem(54)]),
        ("client_items_e7_and_e8_requests", vec![ClientItem(7), ClientItem(8)]),
        ("e41_to_e43_the_attitude", vec![ClientItem(41), ClientItem(42), ClientItem(43)]),
        ("statement_34_angles_go_out", vec![Statement(34)]),
        ("statements_35_and_36_yaw_from_north", vec![Statement(35), Statement(36)]),
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
        (
            "Gimbal statements 34 and 46: what. \"v1\" (gimbal statement 33).",
            vec![Statement(33), Statement(34), Statement(46)],
        ),
        ("Gimbal statement 45. Protocol checklist 175", vec![Item(175), Statement(45)]),
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
    assert!(!tests.contains_key("support::documented::assert_none"));
}

fn required() -> impl Iterator<Item = Rule> {
    let items = ITEMS.into_iter().flatten().map(Rule::Item);
    items.chain(CLIENT_ITEMS.map(Rule::ClientItem)).chain(QUESTIONS.map(Rule::Question))
}

fn rows() -> Vec<Row> {
    documented::rows(DOCUMENT, Rule::parse)
}
