//! Turns `dialect/gimbald.xml` into message types (`src/wire/dialect.rs` includes the result).

use std::env;
use std::path::Path;

use mavlink_bindgen::XmlDefinitions;

fn main() {
    let manifest = env::var("CARGO_MANIFEST_DIR").expect("cargo sets it for build scripts");
    let out = env::var("OUT_DIR").expect("cargo sets it for build scripts");
    let xml = Path::new(&manifest).join("dialect/gimbald.xml");
    println!("cargo:rerun-if-changed={}", xml.display());
    println!("cargo:rerun-if-changed=build.rs");
    // The generated module is gated on a feature of the dialect's name; ours is always on.
    println!("cargo:rustc-cfg=feature=\"dialect-gimbald\"");
    if let Err(error) = mavlink_bindgen::generate(XmlDefinitions::Files(vec![xml]), &out) {
        panic!("dialect/gimbald.xml: {error}");
    }
}
