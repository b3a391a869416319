//! Everything that is tested from outside the crate, as one binary.

mod allocations;
mod boot_orders;
mod captures;
mod configuration;
mod conformance;
mod daemon;
mod daemon_pacing;
mod demo;
mod dialect_oracle;
mod families_document;
mod gimbal_manager_document;
mod gimbald;
mod interface_document;
mod pacing;
mod properties;
mod restart;
mod routing;
mod shipped_files;
mod structure;
mod support;
mod topologies;
mod turning;
mod whole_path;
