//! Which setpoints the device obeys: whose, and in which frame.

use super::setpoint::{Mode, Refusal, Setpoint, YawFrame};
use super::{ACTIVE_INTERVAL, Device, Retract};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use crate::wire::ids::message;

impl Device {
    pub(super) fn handle_set_attitude(
        &mut self,
        now: Timestamp,
        sender: MavId,
        message: &GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    ) {
        let setpoint = match Setpoint::read(message, self.settings.strictness) {
            Ok(setpoint) => setpoint,
            Err(Refusal::Malformed) => {
                self.refused.malformed += 1;
                return;
            }
            Err(Refusal::Frame) => {
                self.refused.frame += 1;
                return;
            }
        };
        let is_new = self.latch.manager(now) != Some(sender);
        if !self.latch.admit(now, sender) {
            self.refused.not_manager += 1;
            return;
        }
        if is_new && self.is_speaking {
            // MAVSDK's gimbal_device_tester wants to know the type within 0.1 to 0.3 s of its first setpoint.
            self.report(now, message::HEARTBEAT, 0.0);
        }
        if !self.was_steered {
            self.was_steered = true;
            self.streams.set_usual(now, message::GIMBAL_DEVICE_ATTITUDE_STATUS, ACTIVE_INTERVAL);
        }
        if self.steering.mode() == Mode::Retract && self.settings.retract == Retract::MotorsOffUntilReboot {
            self.refused.retracted += 1;
            return;
        }
        let needs_heading = setpoint.mode == Mode::Free && setpoint.angles.is_some();
        if needs_heading && setpoint.yaw_frame == YawFrame::Earth && self.heading.at(now).is_none() {
            self.refused.no_heading += 1;
            return;
        }
        if setpoint.mode == Mode::Retract && self.settings.retract != Retract::Stow {
            self.steering.let_go(&mut self.plant);
        } else {
            let heading = self.heading.at(now).map(|(heading, _)| heading);
            self.steering.obey(now, &setpoint, heading, self.settings.rate_expiry, &mut self.plant);
        }
    }
}
