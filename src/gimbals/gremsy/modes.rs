//! The modes of a Gremsy that speaks v2: flags of `GIMBAL_DEVICE_SET_ATTITUDE`, told back in those of
//! `GIMBAL_DEVICE_ATTITUDE_STATUS`.
//!
//! The vendor's SDK sends such a setpoint every 100 ms, at most five times, until the status shows it.

use crate::geometry::YawFrame;
use crate::wire::MavId;
use crate::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use crate::wire::ids::GimbalFlags;

/// The vendor's own flag: looks down and holds yaw, for taking pictures of the ground.
pub const MAPPING: GimbalFlags = GimbalFlags::from_bits_retain(0x4000);

/// The vendor's `control_mode_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlMode {
    /// Motors off. Some firmware takes them back only after a restart.
    Off,
    Lock,
    Follow,
    Mapping,
    Reset,
}

impl ControlMode {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Lock => "lock",
            Self::Follow => "follow",
            Self::Mapping => "mapping",
            Self::Reset => "reset",
        }
    }

    /// What the flags of a status say, in the order in which the vendor's SDK looks at them.
    pub fn from_status(flags: GimbalFlags) -> Self {
        if flags.contains(GimbalFlags::YAW_LOCK) {
            Self::Lock
        } else if flags.contains(GimbalFlags::RETRACT) {
            Self::Off
        } else if flags.contains(GimbalFlags::NEUTRAL) {
            Self::Reset
        } else if flags.contains(MAPPING) {
            Self::Mapping
        } else {
            Self::Follow
        }
    }

    /// The flags that ask for it, before one that names the frame of yaw.
    pub const fn flags(self) -> GimbalFlags {
        let level = GimbalFlags::ROLL_LOCK.union(GimbalFlags::PITCH_LOCK);
        match self {
            Self::Off => level.union(GimbalFlags::RETRACT),
            Self::Lock => level.union(GimbalFlags::YAW_LOCK),
            Self::Follow => level,
            Self::Mapping => level.union(MAPPING),
            // Also what turns motors on that are off.
            Self::Reset => level.union(GimbalFlags::NEUTRAL),
        }
    }
}

/// Asks for `mode`, with rates of zero and no angles. The vendor's SDK names no frame of yaw; the protocol wants one.
pub fn set_mode(device: MavId, mode: ControlMode, frame: Option<YawFrame>) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    let frame = match frame {
        Some(YawFrame::Vehicle) => GimbalFlags::YAW_IN_VEHICLE_FRAME,
        Some(YawFrame::Earth) => GimbalFlags::YAW_IN_EARTH_FRAME,
        None => GimbalFlags::empty(),
    };
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: [f32::NAN; 4],
        angular_velocity_x: 0.0,
        angular_velocity_y: 0.0,
        angular_velocity_z: 0.0,
        flags: mode.flags().union(frame).bits(),
        target_system: device.system,
        target_component: device.component,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIMBAL: MavId = MavId::new(1, 154);

    /// "284 with zero rates, q NaN; flags 0x0C|RETRACT(1) for OFF, 0x0C|NEUTRAL(2) for ON"; lock "flags 0x1C", follow
    /// "flags 0x0C", mapping "flag 0x4000" (gimbals 1.5).
    #[test]
    #[rustfmt::skip]
    fn modes_are_flags_of_a_setpoint_without_motion() {
        for (mode,                frame,                    flags) in [
            (ControlMode::Off,     None,                    0x000d),
            (ControlMode::Reset,   None,                    0x000e),
            (ControlMode::Lock,    None,                    0x001c),
            (ControlMode::Follow,  None,                    0x000c),
            (ControlMode::Mapping, None,                    0x400c),
            (ControlMode::Lock,    Some(YawFrame::Earth),   0x005c),
            (ControlMode::Follow,  Some(YawFrame::Vehicle), 0x002c),
        ] {
            let message = set_mode(GIMBAL, mode, frame);
            assert_eq!(message.flags, flags, "{mode:?}");
            assert!(message.q.iter().all(|number| number.to_bits() == 0x7fc0_0000));
            let rates = [message.angular_velocity_x, message.angular_velocity_y, message.angular_velocity_z];
            assert_eq!((rates, message.target_system, message.target_component), ([0.0; 3], 1, 154));
        }
    }

    /// "285.flags: YAW_LOCK→LOCK; RETRACT→OFF; NEUTRAL→RESET; 0x4000→MAPPING; else FOLLOW … tested in that order".
    #[test]
    #[rustfmt::skip]
    fn the_status_tells_the_mode() {
        for (flags,  expected) in [
            (0x001d, ControlMode::Lock),
            (0x005c, ControlMode::Lock),
            (0x0003, ControlMode::Off),
            (0x400e, ControlMode::Reset),
            (0x402c, ControlMode::Mapping),
            (0x002c, ControlMode::Follow),
            (0x0000, ControlMode::Follow),
        ] {
            assert_eq!(ControlMode::from_status(GimbalFlags::from_bits_retain(flags)), expected, "{flags:#06x}");
        }
    }
}
