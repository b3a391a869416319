//! Everything that is tested from outside the crate, as one binary.

mod captures;
mod configuration;
mod conformance;
mod demo;
mod dialect_oracle;
mod gimbald;
mod properties;
mod shipped_files;
mod structure;
mod support;
mod whole_path;
