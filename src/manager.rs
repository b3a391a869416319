//! The gimbal manager: who may steer, and what the gimbal is told.

pub mod settings;
