//! Where setpoints send the joints of a v2 device.

use std::time::Duration;

use super::setpoint::{Mode, Setpoint, YawFrame};
use crate::geometry::{Angle, AngularRate};
use crate::sim::plant::{Drive, Plant, YawHold};
use crate::timestamp::Timestamp;

/// What a device was told last.
#[derive(Clone, Copy, Debug)]
pub struct Steering {
    mode: Mode,
    rates_until: Option<Timestamp>,
    /// Yaw stays where it was last caught, and does not go to an angle or turn.
    is_yaw_held: bool,
}

impl Default for Steering {
    fn default() -> Self {
        Self { mode: Mode::Free, rates_until: None, is_yaw_held: false }
    }
}

impl Steering {
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// When rates end that nobody repeats.
    pub fn rates_until(&self) -> Option<Timestamp> {
        self.rates_until
    }

    /// Stops rates at the moment they expire.
    pub fn expire(&mut self, now: Timestamp, plant: &mut Plant) {
        if let Some(until) = self.rates_until
            && until <= now
        {
            plant.advance(until);
            plant.hold();
            self.is_yaw_held = true;
            self.rates_until = None;
        }
    }

    /// Retracts with the motors off.
    pub fn let_go(&mut self, plant: &mut Plant) {
        self.mode = Mode::Retract;
        self.rates_until = None;
        plant.release_motors();
    }

    /// Does as told. `heading` is where the device believes the vehicle's nose to be; rates that are not repeated end
    /// after `rate_expiry`, or never.
    pub fn obey(
        &mut self,
        now: Timestamp,
        setpoint: &Setpoint,
        heading: Option<Angle>,
        rate_expiry: Option<Duration>,
        plant: &mut Plant,
    ) {
        self.mode = setpoint.mode;
        self.rates_until = None;
        plant.engage_motors();
        match setpoint.mode {
            Mode::Retract | Mode::Neutral => {
                self.is_yaw_held = false;
                let zero = Drive::To { angle: Angle::ZERO, speed: None };
                plant.set_roll(zero);
                plant.set_pitch(zero);
                plant.set_yaw(YawHold::Vehicle, zero);
            }
            Mode::Free => {
                if setpoint.angles.is_none() && setpoint.rates != [None; 3] {
                    self.rates_until = rate_expiry.map(|expiry| now + expiry);
                }
                self.steer(now, setpoint, heading, plant);
            }
        }
    }

    /// Angles, with rates as the speed to go there; else rates; else only how yaw is held.
    fn steer(&mut self, now: Timestamp, setpoint: &Setpoint, heading: Option<Angle>, plant: &mut Plant) {
        let hold = if setpoint.lock { YawHold::Horizon } else { YawHold::Vehicle };
        let [roll_rate, pitch_rate, yaw_rate] = setpoint.rates;
        // A speed of zero would never arrive; senders who set no speed leave it there.
        let to = |angle: Angle, speed: Option<AngularRate>| Drive::To {
            angle,
            speed: speed.filter(|speed| *speed != AngularRate::ZERO),
        };
        if let Some(angles) = setpoint.angles {
            self.is_yaw_held = false;
            plant.set_roll(to(angles.roll, roll_rate));
            plant.set_pitch(to(angles.pitch, pitch_rate));
            let yaw = yaw_goal(setpoint.yaw_frame, hold, angles.yaw, plant.platform_heading(now), heading);
            plant.set_yaw(hold, to(yaw, yaw_rate));
        } else if setpoint.rates != [None; 3] {
            match roll_rate {
                Some(rate) => plant.set_roll(Drive::Turn(rate)),
                None => plant.hold_roll(),
            }
            match pitch_rate {
                Some(rate) => plant.set_pitch(Drive::Turn(rate)),
                None => plant.hold_pitch(),
            }
            match yaw_rate {
                Some(rate) if rate != AngularRate::ZERO => {
                    self.is_yaw_held = false;
                    plant.set_yaw(hold, Drive::Turn(rate));
                }
                // Catching it again and again would let it creep.
                _ if self.is_yaw_held && plant.yaw_hold() == hold => {}
                _ => {
                    self.is_yaw_held = true;
                    plant.hold_yaw(hold);
                }
            }
        } else if plant.yaw_hold() != hold {
            self.is_yaw_held = true;
            plant.hold_yaw(hold);
        }
    }
}

/// The plant's yaw for one in a setpoint: against the vehicle, or against the plant's own horizon.
fn yaw_goal(frame: YawFrame, hold: YawHold, yaw: Angle, platform: Angle, heading: Option<Angle>) -> Angle {
    let heading = heading.unwrap_or(platform);
    match (frame, hold) {
        (YawFrame::Vehicle, YawHold::Vehicle) => yaw,
        (YawFrame::Vehicle, YawHold::Horizon) => yaw + platform,
        (YawFrame::Earth, YawHold::Vehicle) => yaw - heading,
        (YawFrame::Earth, YawHold::Horizon) => yaw - heading + platform,
    }
}
