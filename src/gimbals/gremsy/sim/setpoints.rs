//! What the device makes of `GIMBAL_DEVICE_SET_ATTITUDE` (v2).

use super::motors::Motors;
use super::{Device, USUAL_INTERVAL};
use crate::geometry::{Angle, GimbalAngles};
use crate::gimbals::gremsy::modes::MAPPING;
use crate::gimbals::mavlink_v2::sim::Strictness;
use crate::gimbals::mavlink_v2::sim::setpoint::{Mode, Setpoint, YawFrame};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use crate::wire::ids::{GimbalFlags, message};

/// What it was told and what had no effect, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    /// RC type is not SYNC.
    pub rc_type: u32,
    /// Motors are off, or on their way.
    pub motors_off: u32,
    /// Sent by somebody who is not the manager (v2).
    pub not_manager: u32,
    /// Both YAW_IN bits, a quaternion that is none, or an infinite rate (v2).
    pub malformed: u32,
    /// Motors were switched off by RETRACT, and only a restart helps (v2).
    pub latched: u32,
}

impl Device {
    pub(super) fn handle_set_attitude(
        &mut self,
        now: Timestamp,
        sender: MavId,
        message: &GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    ) {
        let Ok(setpoint) = Setpoint::read(message, Strictness::Legacy) else {
            self.ignored.malformed += 1;
            return;
        };
        if !self.latch.admit(now, sender) {
            self.ignored.not_manager += 1;
            return;
        }
        if !self.was_steered {
            self.was_steered = true;
            if self.settings.has_usual_streams {
                self.streams.set_usual(now, message::GIMBAL_DEVICE_ATTITUDE_STATUS, USUAL_INTERVAL);
            }
        }
        if self.settings.is_latched_by_retract && self.steering.mode() == Mode::Retract {
            self.ignored.latched += 1;
        } else if !self.takes_setpoints() {
            self.ignored.rc_type += 1;
        } else {
            self.obey(now, setpoint, GimbalFlags::from_bits_retain(message.flags));
        }
    }

    /// RETRACT switches the motors off, and only NEUTRAL switches them on again.
    fn obey(&mut self, now: Timestamp, setpoint: Setpoint, flags: GimbalFlags) {
        match (setpoint.mode, self.motors) {
            (Mode::Retract, _) => {
                self.motors_off();
                self.steering.let_go(&mut self.plant);
                self.is_mapping = false;
            }
            (Mode::Neutral, Motors::Off | Motors::Starting { .. }) => {
                self.motors_on(now);
                self.steering.obey(now, &setpoint, None, None, &mut self.plant);
                // They are not there yet.
                self.plant.release_motors();
                self.is_mapping = false;
            }
            (Mode::Free, Motors::Off | Motors::Starting { .. }) => self.ignored.motors_off += 1,
            (Mode::Neutral | Mode::Free, Motors::On) => {
                let was_mapping = self.is_mapping;
                self.is_mapping = setpoint.mode == Mode::Free && flags.contains(MAPPING);
                let setpoint = match (self.is_mapping, was_mapping) {
                    (true, false) => self.looking_down(setpoint),
                    // Said again it changes nothing.
                    (true, true) if is_still(&setpoint) => return,
                    _ => setpoint,
                };
                let heading = Some(self.own_heading(now));
                self.steering.obey(now, &setpoint, heading, None, &mut self.plant);
            }
        }
    }

    fn looking_down(&self, setpoint: Setpoint) -> Setpoint {
        let angles = GimbalAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(-90.0), yaw: self.plant.pose().yaw };
        Setpoint { yaw_frame: YawFrame::Vehicle, angles: Some(angles), rates: [None; 3], ..setpoint }
    }
}

/// Neither angles nor a rate: only flags.
fn is_still(setpoint: &Setpoint) -> bool {
    setpoint.angles.is_none() && setpoint.rates.iter().flatten().all(|rate| rate.is_zero())
}
