//! Where the joints go when the device is steered by mount commands (v1).

use super::Device;
use crate::geometry::{Angle, AngularRate};
use crate::gimbals::gremsy::parameters::AxisFlags;
use crate::gimbals::operation::ResetMode;
use crate::sim::plant::{Drive, YawHold};
use crate::timestamp::Timestamp;

const DOWN: Angle = Angle::from_degrees(-90.0);

fn to(angle: Angle) -> Drive {
    Drive::To { angle, speed: None }
}

impl Device {
    fn yaw_hold(&self) -> YawHold {
        if self.is_locked { YawHold::Horizon } else { YawHold::Vehicle }
    }

    /// Roll, pitch and yaw in degrees; yaw against its own North when it is locked, else against the vehicle.
    pub(super) fn rotate_to(&mut self, now: Timestamp, roll_pitch_yaw: [f64; 3]) {
        let [roll, pitch, yaw] = roll_pitch_yaw.map(Angle::from_degrees);
        self.plant.set_roll(to(roll));
        self.plant.set_pitch(to(pitch));
        let hold = self.yaw_hold();
        let goal = match hold {
            YawHold::Vehicle => yaw,
            YawHold::Horizon => yaw - self.own_heading(now) + self.plant.horizon(now),
        };
        self.plant.set_yaw(hold, to(goal));
    }

    /// Roll, pitch and yaw in degrees per second, against the horizon in either mode; at rest the mode holds yaw.
    pub(super) fn turn(&mut self, roll_pitch_yaw: [f64; 3]) {
        let [roll, pitch, yaw] = roll_pitch_yaw.map(AngularRate::from_degrees_per_second);
        if roll.is_zero() {
            self.plant.hold_roll();
        } else {
            self.plant.set_roll(Drive::Turn(roll));
        }
        if pitch.is_zero() {
            self.plant.hold_pitch();
        } else {
            self.plant.set_pitch(Drive::Turn(pitch));
        }
        if yaw.is_zero() {
            self.plant.hold_yaw(self.yaw_hold());
        } else {
            self.plant.set_yaw(YawHold::Horizon, Drive::Turn(yaw));
        }
    }

    /// Yaw stays where it is; from then on it is held to something else.
    pub(super) fn set_locked(&mut self, locked: bool) {
        if self.is_locked == locked {
            return;
        }
        self.is_locked = locked;
        if self.axis_flags().contains(AxisFlags::HOME_ON_MODE_CHANGE) {
            self.go_ahead();
        } else {
            self.plant.hold_yaw(self.yaw_hold());
        }
    }

    /// Level, and ahead of the vehicle.
    pub(super) fn go_ahead(&mut self) {
        self.plant.set_roll(to(Angle::ZERO));
        self.plant.set_pitch(to(Angle::ZERO));
        self.plant.set_yaw(YawHold::Vehicle, to(Angle::ZERO));
    }

    pub(super) fn reset(&mut self, now: Timestamp, mode: ResetMode) {
        let (turns_yaw, levels_roll, pitch) = match mode {
            ResetMode::Yaw => (true, false, None),
            ResetMode::PitchAndYaw => (true, true, Some(Angle::ZERO)),
            ResetMode::PitchDownUpAndYaw => (true, true, Some(DOWN)),
            ResetMode::PitchDownUp | ResetMode::PitchMapping => (false, false, Some(DOWN)),
        };
        if let Some(pitch) = pitch {
            self.plant.set_pitch(to(pitch));
        }
        if levels_roll {
            self.plant.set_roll(to(Angle::ZERO));
        }
        if turns_yaw {
            let hold = self.yaw_hold();
            let ahead = match hold {
                YawHold::Vehicle => Angle::ZERO,
                YawHold::Horizon => self.plant.horizon(now),
            };
            self.plant.set_yaw(hold, to(ahead));
        }
    }
}
