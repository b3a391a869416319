//! `docs/families/` against the tests that it names: statements about gimbals, each a row with its number.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use crate::support::documented::{self, Row, Rule, assert_none, wrongly_named_tests};

/// Each document, and the statements that must be there; others may.
const DOCUMENTS: [(&str, RangeInclusive<u32>); 1] = [("docs/families/mavlink_v1.md", 33..=48)];

/// The statements that are there, each once, with nothing left empty.
#[test]
fn every_statement_is_there_once() {
    for (document, required) in DOCUMENTS {
        let mut problems = Vec::new();
        let mut seen = BTreeMap::new();
        for row in rows(document) {
            if let Some(first) = seen.insert(row.rule, row.line) {
                problems.push(format!("line {}: {} stands in line {first} already", row.line, row.rule));
            }
            if !row.is_whole(3) {
                problems.push(format!("line {}: {} has not 3 cells with something in each", row.line, row.rule));
            }
        }
        let missing = required.map(Rule::Statement).filter(|rule| !seen.contains_key(rule));
        problems.extend(missing.map(|rule| format!("no {rule}")));
        assert_none(document, &problems);
    }
}

/// Every test that a document names exists and names the statement itself.
#[test]
fn every_named_test_is_there_and_says_what_it_shows() {
    for (document, _) in DOCUMENTS {
        assert_none(document, &wrongly_named_tests(&rows(document)));
    }
}

fn rows(document: &str) -> Vec<Row> {
    documented::rows(document, |text| text.parse().ok().map(Rule::Statement))
}
