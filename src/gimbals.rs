//! Gimbals behind one driver trait, a folder per family.

pub mod mavlink_v2;
pub mod settings;
