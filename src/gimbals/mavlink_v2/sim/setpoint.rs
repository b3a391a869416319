//! What a `GIMBAL_DEVICE_SET_ATTITUDE` asks for.

use super::settings::Strictness;
use crate::geometry::{AngularRate, Attitude, EarthFrame, GimbalAngles};
use crate::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use crate::wire::ids::GimbalFlags;

/// A setpoint that made sense.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    pub mode: Mode,
    pub yaw_frame: YawFrame,
    /// Whether yaw is to be held against North.
    pub lock: bool,
    /// Yaw in `yaw_frame`.
    pub angles: Option<GimbalAngles>,
    /// About roll, pitch and yaw.
    pub rates: [Option<AngularRate>; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Retract,
    Neutral,
    Free,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YawFrame {
    Vehicle,
    Earth,
}

/// Why a setpoint has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Both YAW_IN bits, a quaternion that is none, or an infinite rate.
    Malformed,
    /// Frame flags that this device does not take.
    Frame,
}

impl Setpoint {
    pub fn read(message: &GIMBAL_DEVICE_SET_ATTITUDE_DATA, strictness: Strictness) -> Result<Self, Refusal> {
        let flags = GimbalFlags::from_bits_retain(message.flags);
        let lock = flags.contains(GimbalFlags::YAW_LOCK);
        let in_vehicle = flags.contains(GimbalFlags::YAW_IN_VEHICLE_FRAME);
        let in_earth = flags.contains(GimbalFlags::YAW_IN_EARTH_FRAME);
        let yaw_frame = match (in_vehicle, in_earth) {
            (true, true) => return Err(Refusal::Malformed),
            (false, false) if strictness == Strictness::Strict => return Err(Refusal::Frame),
            (true, false) => YawFrame::Vehicle,
            (false, true) => YawFrame::Earth,
            (false, false) if lock => YawFrame::Earth,
            (false, false) => YawFrame::Vehicle,
        };
        if yaw_frame == YawFrame::Earth && strictness == Strictness::VehicleOnly {
            return Err(Refusal::Frame);
        }
        // The frame is told by the flags, so the type's frame is a formality here.
        let attitude = Attitude::<EarthFrame>::from_wxyz(message.q).map_err(|_| Refusal::Malformed)?;
        let mut rates = [None; 3];
        let sent = [message.angular_velocity_x, message.angular_velocity_y, message.angular_velocity_z];
        for (rate, sent) in rates.iter_mut().zip(sent) {
            if sent.is_infinite() {
                return Err(Refusal::Malformed);
            }
            *rate = (!sent.is_nan()).then(|| AngularRate::from_radians_per_second(f64::from(sent)));
        }
        let mode = if flags.contains(GimbalFlags::RETRACT) {
            Mode::Retract
        } else if flags.contains(GimbalFlags::NEUTRAL) {
            Mode::Neutral
        } else {
            Mode::Free
        };
        let lock = lock || yaw_frame == YawFrame::Earth;
        Ok(Self { mode, yaw_frame, lock, angles: attitude.map(Attitude::gimbal_angles), rates })
    }
}
