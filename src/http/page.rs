//! The page that a pilot looks at.

use axum::http::header::CONTENT_SECURITY_POLICY;
use axum::response::{Html, IntoResponse};

const PAGE: &str = include_str!("page.html");

/// Only the page's own style and script, each known by its SHA-256, and only its own origin may be asked: even if a
/// name that a gimbal reports became markup, it could neither run nor load anything.
const POLICY: &str = "default-src 'none'; \
    style-src 'sha256-qktgxO7X3SOGDQ7Tmtw4zR4SqhIYleK/DYmiXfhYbQE='; \
    script-src 'sha256-tjgR5vIoMxN5xO9Gt7j6/jka9CoONB3H2C0SM0SpOc0='; \
    connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

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
        for (element, directive) in [("style", "style-src"), ("script", "script-src")] {
            let content = content_of(element);
            let expected = format!("{directive} 'sha256-{}';", base64(&Sha256::digest(content)));
            assert!(POLICY.contains(&expected), "the policy wants {expected}");
        }
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

    fn base64(bytes: &[u8]) -> String {
        const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut text = String::new();
        for group in bytes.chunks(3) {
            let bits = group.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
            for place in 0..4 {
                let six = (bits >> (18 - 6 * place)) & 63;
                text.push(if place <= group.len() { char::from(ALPHABET[six as usize]) } else { '=' });
            }
        }
        text
    }
}
