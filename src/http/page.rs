//! The page that a pilot looks at.

use axum::http::header::CONTENT_SECURITY_POLICY;
use axum::response::{Html, IntoResponse};

const PAGE: &str = include_str!("page.html");

/// Only the page's own style and script, each known by its SHA-256 (`build.rs`), and only its own origin may be asked: even
/// if a name that a gimbal reports became markup, it could neither run nor load anything.
const POLICY: &str = concat!(
    "default-src 'none'; style-src 'sha256-",
    env!("PAGE_STYLE_SHA256"),
    "'; script-src 'sha256-",
    env!("PAGE_SCRIPT_SHA256"),
    "'; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
);

pub async fn page() -> impl IntoResponse {
    ([(CONTENT_SECURITY_POLICY, POLICY)], Html(PAGE))
}

#[cfg(test)]
mod tests {
    use sha2::{Digest, Sha256};

    use super::*;

    /// CSP 3, 6.7.2.4: a source expression with a hash matches the element whose content has that digest.
    #[test]
    fn the_policy_admits_exactly_the_style_and_script_of_the_page() {
        let [style, script] = ["style", "script"].map(|element| digest_of(content_of(element)));
        let expected = format!(
            "default-src 'none'; style-src 'sha256-{style}'; script-src 'sha256-{script}'; connect-src 'self'; \
             img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        );
        assert_eq!(POLICY, expected);
    }

    /// "No external resources; all text inserted with textContent (vendor names are hostile input)."
    #[test]
    fn the_page_loads_nothing_and_makes_no_markup_of_text() {
        let without_names = PAGE.replace("http://www.w3.org/2000/svg", "").replace("url(#", "");
        for forbidden in [
            "http://",
            "https://",
            "//cdn",
            "src=",
            "@import",
            "url(",
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
            "new Function",
            "setAttribute('style'",
            " style=",
            "onclick=",
        ] {
            assert!(!without_names.contains(forbidden), "the page contains {forbidden}");
        }
    }

    #[test]
    fn without_javascript_the_page_says_where_the_json_is() {
        let (_, rest) = PAGE.split_once("<noscript>").expect("a noscript element");
        let (text, _) = rest.split_once("</noscript>").expect("it ends");
        assert!(text.contains(r#"<a href="/api/v1/status">"#), "{text}");
    }

    fn content_of(element: &str) -> &'static str {
        let (start, end) = (format!("<{element}>"), format!("</{element}>"));
        assert_eq!(PAGE.matches(&start).count(), 1);
        let (_, rest) = PAGE.split_once(&start).expect("the element");
        rest.split_once(&end).expect("it ends").0
    }

    /// In Base64, whose digits are six bits each.
    fn digest_of(content: &str) -> String {
        const ALPHABET: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        // 256 bits are 42 digits and four bits, filled up with zeros; one `=` makes it whole groups of four.
        let bits: String = Sha256::digest(content).iter().map(|byte| format!("{byte:08b}")).collect::<String>() + "00";
        let digits = (0..43).map(|at| usize::from_str_radix(&bits[6 * at..6 * at + 6], 2).expect("six bits"));
        digits.map(|digit| &ALPHABET[digit..=digit]).chain(["="]).collect()
    }
}
