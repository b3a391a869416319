//! Everything that is tested from outside the crate, as one binary.

mod configuration;
mod gimbald;
mod shipped_files;
mod structure;
