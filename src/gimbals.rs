//! Gimbals behind one driver trait, a folder per family.

pub mod settings;
