//! What the device makes of setpoints: whose it takes, and where they send its joints.

use super::setpoint::{Mode, Refusal, Setpoint, YawFrame};
use super::{ACTIVE_INTERVAL, Device, Retract};
use crate::geometry::{Angle, AngularRate};
use crate::sim::plant::{Drive, YawHold};
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
        if self.mode == Mode::Retract && self.settings.retract == Retract::MotorsOffUntilReboot {
            self.refused.retracted += 1;
            return;
        }
        let needs_heading = setpoint.mode == Mode::Free && setpoint.angles.is_some();
        if needs_heading && setpoint.yaw_frame == YawFrame::Earth && self.heading.at(now).is_none() {
            self.refused.no_heading += 1;
            return;
        }
        self.mode = setpoint.mode;
        self.rates_until = None;
        if setpoint.mode == Mode::Retract && self.settings.retract != Retract::Stow {
            self.plant.release_motors();
            return;
        }
        self.plant.engage_motors();
        match setpoint.mode {
            Mode::Retract | Mode::Neutral => {
                self.is_yaw_held = false;
                let zero = Drive::To { angle: Angle::ZERO, speed: None };
                self.plant.set_roll(zero);
                self.plant.set_pitch(zero);
                self.plant.set_yaw(YawHold::Vehicle, zero);
            }
            Mode::Free => self.steer(now, &setpoint),
        }
    }

    /// Angles, with rates as the speed to go there; else rates; else only how yaw is held.
    fn steer(&mut self, now: Timestamp, setpoint: &Setpoint) {
        let hold = if setpoint.lock { YawHold::Horizon } else { YawHold::Vehicle };
        let [roll_rate, pitch_rate, yaw_rate] = setpoint.rates;
        // A speed of zero would never arrive; senders who set no speed leave it there.
        let to = |angle: Angle, speed: Option<AngularRate>| Drive::To {
            angle,
            speed: speed.filter(|speed| *speed != AngularRate::ZERO),
        };
        if let Some(angles) = setpoint.angles {
            self.is_yaw_held = false;
            self.plant.set_roll(to(angles.roll, roll_rate));
            self.plant.set_pitch(to(angles.pitch, pitch_rate));
            let yaw = self.yaw_goal(now, setpoint.yaw_frame, hold, angles.yaw);
            self.plant.set_yaw(hold, to(yaw, yaw_rate));
        } else if setpoint.rates != [None; 3] {
            self.rates_until = self.settings.rate_expiry.map(|expiry| now + expiry);
            match roll_rate {
                Some(rate) => self.plant.set_roll(Drive::Turn(rate)),
                None => self.plant.hold_roll(),
            }
            match pitch_rate {
                Some(rate) => self.plant.set_pitch(Drive::Turn(rate)),
                None => self.plant.hold_pitch(),
            }
            match yaw_rate {
                Some(rate) if rate != AngularRate::ZERO => {
                    self.is_yaw_held = false;
                    self.plant.set_yaw(hold, Drive::Turn(rate));
                }
                // Catching it again and again would let it creep.
                _ if self.is_yaw_held && self.plant.yaw_hold() == hold => {}
                _ => {
                    self.is_yaw_held = true;
                    self.plant.hold_yaw(hold);
                }
            }
        } else if self.plant.yaw_hold() != hold {
            self.is_yaw_held = true;
            self.plant.hold_yaw(hold);
        }
    }

    /// The plant's yaw for one in a setpoint: against the vehicle, or against the plant's own horizon.
    fn yaw_goal(&self, now: Timestamp, frame: YawFrame, hold: YawHold, yaw: Angle) -> Angle {
        let platform = self.plant.platform_heading(now);
        let heading = self.heading.at(now).map_or(platform, |(heading, _)| heading);
        match (frame, hold) {
            (YawFrame::Vehicle, YawHold::Vehicle) => yaw,
            (YawFrame::Vehicle, YawHold::Horizon) => yaw + platform,
            (YawFrame::Earth, YawHold::Vehicle) => yaw - heading,
            (YawFrame::Earth, YawHold::Horizon) => yaw - heading + platform,
        }
    }
}
