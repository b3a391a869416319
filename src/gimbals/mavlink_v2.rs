//! Gimbal devices that speak Gimbal Protocol v2.

pub mod sim;
