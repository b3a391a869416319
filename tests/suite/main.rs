//! Everything that is tested from outside the crate, as one binary.

mod captures;
mod conformance;
mod dialect_oracle;
mod properties;
mod support;
