//! What the autopilot says of the vehicle: attitude, position and heading, each with its age.
//!
//! The order of trust and the age at which a value stops counting follow the Gimbal Protocol v2: the attitude made for
//! gimbals (286) comes first. A value that is malformed, or marked as unknown, is as if it had not been sent.

mod attitudes;
mod autopilot;
mod dated;
mod landed_state;

use std::time::Duration;

use crate::geometry::{AircraftAngles, Angle, AngularRate, Attitude, EarthFrame, Position};
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, EXTENDED_SYS_STATE_DATA,
    GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA,
};
use crate::wire::ids::mav_autopilot;
use attitudes::Attitudes;
pub use autopilot::Autopilot;
use dated::Dated;
pub use landed_state::LandedState;

/// The vehicle as its autopilot tells of it; who that autopilot is, is the caller's business.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vehicle {
    last_heard: Option<Timestamp>,
    autopilot: Option<Autopilot>,
    attitudes: Attitudes,
    /// `GLOBAL_POSITION_INT.hdg`.
    compass: Option<Dated<Angle>>,
    position: Option<Dated<Position>>,
    /// Of home, above mean sea level.
    home_altitude_m: Option<Dated<f64>>,
    /// The same from `HOME_POSITION`, which holds until home is set again.
    home_position_altitude_m: Option<f64>,
    yaw_rate: Option<Dated<AngularRate>>,
    landed_state: Option<Dated<LandedState>>,
}

/// An autopilot that was silent for longer is not alive.
const ALIVE_WITHIN: Duration = Duration::from_secs(5);
/// "Heading is stale after 1 s." So is all that turns with the vehicle.
const ATTITUDE_WITHIN: Duration = Duration::from_secs(1);
const POSITION_WITHIN: Duration = Duration::from_secs(5);
const LANDED_STATE_WITHIN: Duration = Duration::from_secs(5);

impl Vehicle {
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in a frame of the vehicle's autopilot; a frame of anybody else must not come here.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        self.last_heard = Some(now);
        if let Some(message) = frame.decode::<HEARTBEAT_DATA>() {
            self.handle_heartbeat(&message);
        } else if let Some(message) = frame.decode::<ATTITUDE_DATA>() {
            self.handle_attitude(now, &message);
        } else if let Some(message) = frame.decode::<ATTITUDE_QUATERNION_DATA>() {
            self.handle_attitude_quaternion(now, &message);
        } else if let Some(message) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            self.handle_global_position_int(now, &message);
        } else if let Some(message) = frame.decode::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>() {
            self.handle_autopilot_state_for_gimbal_device(now, &message);
        } else if let Some(message) = frame.decode::<HOME_POSITION_DATA>() {
            self.home_position_altitude_m = Some(metres(message.altitude));
        } else if let Some(message) = frame.decode::<EXTENDED_SYS_STATE_DATA>() {
            self.set_landed_state(now, message.landed_state);
        }
    }

    /// Whether the autopilot was heard within the last 5 s.
    pub fn alive(&self, now: Timestamp) -> bool {
        self.last_heard.is_some_and(|at| now.since(at) <= ALIVE_WITHIN)
    }

    /// `None` until its first heartbeat.
    pub fn autopilot(&self) -> Option<Autopilot> {
        self.autopilot
    }

    /// The airframe's attitude, tilt included; not older than 1 s.
    pub fn attitude(&self, now: Timestamp) -> Option<Attitude<EarthFrame>> {
        self.attitudes.best(now).and_then(|attitude| attitude.within(now, ATTITUDE_WITHIN))
    }

    /// How old the attitude is that [`attitude`](Self::attitude) gives, or else the last one there was.
    pub fn attitude_age(&self, now: Timestamp) -> Option<Duration> {
        self.attitudes.best(now).map(|attitude| attitude.age(now))
    }

    /// Where the nose points, from North, within (−180°, 180°]; not older than 1 s.
    pub fn heading(&self, now: Timestamp) -> Option<Angle> {
        let compass = || self.compass.and_then(|heading| heading.within(now, ATTITUDE_WITHIN));
        self.attitude(now).map(Attitude::heading).or_else(compass)
    }

    /// Altitude above mean sea level; not older than 5 s.
    pub fn position(&self, now: Timestamp) -> Option<Position> {
        self.position.and_then(|position| position.within(now, POSITION_WITHIN))
    }

    /// How old the last position is, however old.
    pub fn position_age(&self, now: Timestamp) -> Option<Duration> {
        self.position.map(|position| position.age(now))
    }

    /// Altitude of home above mean sea level in metres: what altitudes relative to home count from.
    ///
    /// As the position tells it (`alt` − `relative_alt`), or else as `HOME_POSITION` does.
    pub fn home_altitude_amsl(&self, now: Timestamp) -> Option<f64> {
        let told_by_position = self.home_altitude_m.and_then(|altitude| altitude.within(now, POSITION_WITHIN));
        told_by_position.or(self.home_position_altitude_m)
    }

    /// How fast the vehicle turns about Down, to the right; not older than 1 s.
    pub fn yaw_rate(&self, now: Timestamp) -> Option<AngularRate> {
        self.yaw_rate.and_then(|rate| rate.within(now, ATTITUDE_WITHIN))
    }

    /// Not older than 5 s.
    pub fn landed_state(&self, now: Timestamp) -> Option<LandedState> {
        self.landed_state.and_then(|state| state.within(now, LANDED_STATE_WITHIN))
    }

    fn handle_heartbeat(&mut self, message: &HEARTBEAT_DATA) {
        if message.autopilot != mav_autopilot::INVALID {
            self.autopilot = Some(Autopilot::from_number(message.autopilot));
        }
    }

    fn handle_attitude(&mut self, now: Timestamp, message: &ATTITUDE_DATA) {
        let [roll, pitch, yaw] =
            [message.roll, message.pitch, message.yaw].map(|radians| Angle::from_radians(f64::from(radians)));
        if roll.is_finite() && pitch.is_finite() && yaw.is_finite() {
            let attitude = Attitude::from_aircraft_angles(AircraftAngles { roll, pitch, yaw });
            self.attitudes.from_angles = Some(Dated::new(now, attitude));
        }
    }

    fn handle_attitude_quaternion(&mut self, now: Timestamp, message: &ATTITUDE_QUATERNION_DATA) {
        if let Ok(Some(attitude)) = Attitude::from_wxyz([message.q1, message.q2, message.q3, message.q4]) {
            self.attitudes.from_quaternion = Some(Dated::new(now, attitude));
        }
    }

    fn handle_global_position_int(&mut self, now: Timestamp, message: &GLOBAL_POSITION_INT_DATA) {
        if message.hdg <= 36_000 {
            let heading = Angle::from_degrees(f64::from(message.hdg) / 100.0).wrapped();
            self.compass = Some(Dated::new(now, heading));
        }
        // An autopilot without a fix says 0, 0 at altitude 0, and INT32_MAX where it follows the rule for unknown values.
        let without_fix = (message.lat, message.lon, message.alt) == (0, 0, 0);
        let on_earth = message.lat.unsigned_abs() <= 900_000_000 && message.lon.unsigned_abs() <= 1_800_000_000;
        if without_fix || !on_earth {
            return;
        }
        let position = Position {
            latitude_deg: f64::from(message.lat) / 1e7,
            longitude_deg: f64::from(message.lon) / 1e7,
            altitude_m: metres(message.alt),
        };
        self.position = Some(Dated::new(now, position));
        self.home_altitude_m = Some(Dated::new(now, metres(message.alt) - metres(message.relative_alt)));
    }

    fn handle_autopilot_state_for_gimbal_device(
        &mut self,
        now: Timestamp,
        message: &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
    ) {
        if let Ok(Some(attitude)) = Attitude::from_wxyz(message.q) {
            self.attitudes.for_gimbals = Some(Dated::new(now, attitude));
        }
        // Older definitions mark an unknown rate with NaN, newer ones with 0 (and send 1e-5 for a measured zero).
        let rate = f64::from(message.angular_velocity_z);
        let known = rate.is_finite() && rate != 0.0;
        self.yaw_rate = known.then(|| Dated::new(now, AngularRate::from_radians_per_second(rate)));
        self.set_landed_state(now, message.landed_state);
    }

    /// Several messages carry the state, and some senders never fill it in, so an undefined one changes nothing.
    fn set_landed_state(&mut self, now: Timestamp, number: u8) {
        if let Some(state) = LandedState::from_number(number) {
            self.landed_state = Some(Dated::new(now, state));
        }
    }
}

fn metres(millimetres: i32) -> f64 {
    f64::from(millimetres) / 1e3
}

#[cfg(test)]
mod tests;
