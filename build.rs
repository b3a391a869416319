//! Turns `dialect/gimbald.xml` into message types (`src/wire/dialect.rs` includes the result), and hashes what of
//! `src/http/page.html` may be applied and run (`src/http/page.rs` has it in its policy).

use std::path::Path;
use std::{env, fs};

use mavlink_bindgen::XmlDefinitions;
use sha2::{Digest, Sha256};

fn main() {
    let manifest = env::var("CARGO_MANIFEST_DIR").expect("cargo sets it for build scripts");
    let out = env::var("OUT_DIR").expect("cargo sets it for build scripts");
    println!("cargo:rerun-if-changed=build.rs");
    generate_dialect(&Path::new(&manifest).join("dialect/gimbald.xml"), &out);
    hash_page(&Path::new(&manifest).join("src/http/page.html"));
}

fn generate_dialect(xml: &Path, out: &str) {
    println!("cargo:rerun-if-changed={}", xml.display());
    // The generated module is gated on a feature of the dialect's name; ours is always on.
    println!("cargo:rustc-cfg=feature=\"dialect-gimbald\"");
    if let Err(error) = mavlink_bindgen::generate(XmlDefinitions::Files(vec![xml.to_owned()]), out) {
        panic!("dialect/gimbald.xml: {error}");
    }
}

/// `PAGE_STYLE_SHA256` and `PAGE_SCRIPT_SHA256`: the digests of the page's one style and one script, in Base64.
fn hash_page(html: &Path) {
    println!("cargo:rerun-if-changed={}", html.display());
    let page = fs::read_to_string(html).unwrap_or_else(|error| panic!("{}: {error}", html.display()));
    for element in ["style", "script"] {
        let content = content_of(&page, element)
            .unwrap_or_else(|| panic!("{}: expected exactly one <{element}> without attributes", html.display()));
        println!("cargo:rustc-env=PAGE_{}_SHA256={}", element.to_uppercase(), base64(&Sha256::digest(content)));
    }
}

fn content_of<'a>(page: &'a str, element: &str) -> Option<&'a str> {
    let (_, rest) = page.split_once(&format!("<{element}>"))?;
    let (content, rest) = rest.split_once(&format!("</{element}>"))?;
    (!rest.contains(&format!("<{element}"))).then_some(content)
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
