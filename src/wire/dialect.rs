//! The messages that gimbald reads and writes, as generated from `dialect/gimbald.xml`.
//!
//! Every enumeration and flag field is a plain number (see [`super::ids`] for their values), so a value that is
//! newer than our definitions never costs a message.

#[allow(
    dead_code,
    unused_imports,
    unexpected_cfgs,
    missing_docs,
    non_camel_case_types,
    clippy::all,
    clippy::pedantic,
    reason = "generated code"
)]
mod generated {
    include!(concat!(env!("OUT_DIR"), "/mod.rs"));
}

pub use generated::gimbald::*;
pub use mavlink_core::MessageData;
pub use mavlink_core::types::CharArray;
