//! Angles, attitudes, limits and directions, with units and frames in their types.
//!
//! Frames are those of the Gimbal Protocol v2: *earth* is North, East, Down; *vehicle* is the earth frame turned about
//! Down so that x points along the vehicle's heading, so it stays level when the airframe tilts. Positive is roll to
//! the right, pitch up, yaw to the right.

pub mod aim;
pub mod angle;
pub mod angular_velocity;
pub mod attitude;
pub mod limits;
pub mod yaw;

pub use aim::{Aim, Position};
pub use angle::{Angle, AngularRate};
pub use angular_velocity::{AngularVelocity, BodyFrame};
pub use attitude::{AircraftAngles, Attitude, EarthFrame, GimbalAngles, QuaternionError, VehicleFrame};
pub use limits::{AxisLimits, Limits};
pub use yaw::{Yaw, YawFrame};
