//! What the autopilot says of the vehicle: attitude, position and heading, each with its age.
//!
//! The order of trust and the age at which a value stops counting follow the Gimbal Protocol v2: the attitude made for
//! gimbals (286) comes first. A value that is malformed, or marked as unknown, is as if it had not been sent.

mod attitudes;
mod autopilot;
mod clock;
mod dated;
mod estimator;
mod landed_state;
mod round_trips;
mod state_for_gimbals;
mod velocities;
mod yaw_targets;

use std::time::Duration;

use crate::geometry::{AircraftAngles, Angle, AngularRate, AngularVelocity, Attitude, BodyFrame, EarthFrame, Position};
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, ATTITUDE_TARGET_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
    EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA,
    HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MessageData, POSITION_TARGET_GLOBAL_INT_DATA,
    POSITION_TARGET_LOCAL_NED_DATA, SYSTEM_TIME_DATA, TIMESYNC_DATA,
};
use crate::wire::ids::mav_autopilot;
use attitudes::{Attitudes, Orientation};
pub use autopilot::Autopilot;
use clock::{BootClock, Stamp};
use dated::Dated;
pub use landed_state::LandedState;
use round_trips::RoundTrips;
use velocities::Velocities;
use yaw_targets::YawTargets;

/// The vehicle as its autopilot tells of it; who that autopilot is, is the caller's business.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vehicle {
    last_heard: Option<Timestamp>,
    autopilot: Option<Autopilot>,
    clock: BootClock,
    round_trips: RoundTrips,
    attitudes: Attitudes,
    /// `GLOBAL_POSITION_INT.hdg`.
    compass: Option<Dated<Angle>>,
    position: Option<Dated<Position>>,
    velocities: Velocities,
    yaw_targets: YawTargets,
    /// `ESTIMATOR_STATUS_FLAGS`.
    estimator_status: Option<Dated<u16>>,
    /// Of home, above mean sea level.
    home_altitude_m: Option<Dated<f64>>,
    /// `HOME_POSITION`, which holds until home is set again.
    home_position: Option<Position>,
    yaw_rate: Option<Dated<AngularRate>>,
    landed_state: Option<Dated<LandedState>>,
}

/// An autopilot that was silent for longer is not alive.
const ALIVE_WITHIN: Duration = Duration::from_secs(5);
/// "Heading is stale after 1 s." So is all that turns with the vehicle.
const ATTITUDE_WITHIN: Duration = Duration::from_secs(1);
const POSITION_WITHIN: Duration = Duration::from_secs(5);
const LANDED_STATE_WITHIN: Duration = Duration::from_secs(5);
const ESTIMATOR_STATUS_WITHIN: Duration = Duration::from_secs(5);

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
            let late = self.handle_boot_ms(now, frame, message.time_boot_ms);
            self.handle_attitude(now, &message, late);
        } else if let Some(message) = frame.decode::<ATTITUDE_QUATERNION_DATA>() {
            let late = self.handle_boot_ms(now, frame, message.time_boot_ms);
            self.handle_attitude_quaternion(now, &message, late);
        } else if let Some(message) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            let late = self.handle_boot_ms(now, frame, message.time_boot_ms);
            self.handle_global_position_int(now, &message, late);
        } else if let Some(message) = frame.decode::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>() {
            self.handle_autopilot_state_for_gimbal_device(now, &message);
        } else if let Some(message) = frame.decode::<HOME_POSITION_DATA>() {
            self.home_position = Some(Position {
                latitude_deg: f64::from(message.latitude) / 1e7,
                longitude_deg: f64::from(message.longitude) / 1e7,
                altitude_m: metres(message.altitude),
            });
        } else if let Some(message) = frame.decode::<EXTENDED_SYS_STATE_DATA>() {
            self.set_landed_state(now, message.landed_state);
        } else if let Some(message) = frame.decode::<LOCAL_POSITION_NED_DATA>() {
            let late = self.handle_boot_ms(now, frame, message.time_boot_ms);
            self.velocities.handle_local(now, &message, late);
        } else if let Some(message) = frame.decode::<POSITION_TARGET_LOCAL_NED_DATA>() {
            self.yaw_targets.handle_position_target_local_ned(now, &message);
        } else if let Some(message) = frame.decode::<POSITION_TARGET_GLOBAL_INT_DATA>() {
            self.yaw_targets.handle_position_target_global_int(now, &message);
        } else if let Some(message) = frame.decode::<ATTITUDE_TARGET_DATA>() {
            self.yaw_targets.handle_attitude_target(now, &message, self.attitude(now));
        } else if let Some(message) = frame.decode::<ESTIMATOR_STATUS_DATA>() {
            self.estimator_status = Some(Dated::new(now, estimator::from_estimator_status(&message)));
        } else if let Some(message) = frame.decode::<EKF_STATUS_REPORT_DATA>() {
            self.estimator_status = Some(Dated::new(now, estimator::from_ekf_status_report(&message)));
        } else if let Some(message) = frame.decode::<SYSTEM_TIME_DATA>() {
            self.handle_boot_ms(now, frame, message.time_boot_ms);
        } else if let Some(message) = frame.decode::<TIMESYNC_DATA>() {
            self.round_trips.handle_timesync(now, &message);
        }
    }

    /// When the next `TIMESYNC` is due, by which the way from the autopilot is measured.
    pub fn timesync_due(&self) -> Timestamp {
        self.round_trips.due()
    }

    /// A request to be sent to the autopilot at once.
    pub fn timesync_request(&mut self, now: Timestamp) -> TIMESYNC_DATA {
        self.round_trips.request(now)
    }

    /// How often the autopilot was started anew while it was listened to.
    pub fn restarts(&self) -> u32 {
        self.clock.restarts()
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

    /// [`heading`](Self::heading) as it is now if the vehicle has turned on since it was told, which may be once a second.
    pub fn heading_by_now(&self, now: Timestamp) -> Option<Angle> {
        let told = self.attitude(now).and(self.attitude_age(now)).or(self.compass.map(|heading| heading.age(now)));
        let turned =
            self.yaw_rate(now).zip(told).map_or(0.0, |(rate, age)| rate.radians_per_second() * age.as_secs_f64());
        Some((self.heading(now)? + Angle::from_radians(turned)).wrapped())
    }

    /// What was known and is too old to act on: `heading`, `position`.
    pub fn stale(&self, now: Timestamp) -> impl Iterator<Item = &'static str> {
        let had_heading = self.compass.is_some() || self.attitudes.best(now).is_some();
        let heading = (had_heading && self.heading(now).is_none()).then_some("heading");
        let position = (self.position.is_some() && self.position(now).is_none()).then_some("position");
        [heading, position].into_iter().flatten()
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
        told_by_position.or(self.home_position.map(|home| home.altitude_m))
    }

    /// Where home is, as `HOME_POSITION` tells it; altitude above mean sea level.
    pub fn home_position(&self) -> Option<Position> {
        self.home_position.filter(|home| {
            let Position { latitude_deg, longitude_deg, altitude_m } = *home;
            let on_earth = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0;
            on_earth && (latitude_deg, longitude_deg, altitude_m) != (0.0, 0.0, 0.0)
        })
    }

    /// How fast the vehicle turns about Down, to the right; not older than 1 s.
    ///
    /// As 286 tells it, or else as the attitude's own rates do.
    pub fn yaw_rate(&self, now: Timestamp) -> Option<AngularRate> {
        let of_attitude = || Some(self.attitudes.orientation(now)?.value.turn?.about_down());
        self.yaw_rate.and_then(|rate| rate.within(now, ATTITUDE_WITHIN)).or_else(of_attitude)
    }

    /// Which estimates the autopilot trusts (`ESTIMATOR_STATUS_FLAGS`); not older than 5 s.
    pub fn estimator_status(&self, now: Timestamp) -> Option<u16> {
        self.estimator_status.and_then(|status| status.within(now, ESTIMATOR_STATUS_WITHIN))
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

    /// Takes the time stamp of a frame; how late the frame is. After a restart nothing moves as it did before.
    fn handle_boot_ms(&mut self, now: Timestamp, frame: &Frame<'_>, boot_ms: u32) -> Option<Duration> {
        let before = self.clock.restarts();
        let late = self.clock.handle_stamp(now, frame.message_id(), Stamp::Millis(boot_ms));
        if self.clock.restarts() != before {
            self.attitudes = Attitudes::default();
            self.velocities = Velocities::default();
            self.yaw_targets = YawTargets::default();
            self.yaw_rate = None;
            self.estimator_status = None;
        }
        late
    }

    fn handle_attitude(&mut self, now: Timestamp, message: &ATTITUDE_DATA, late: Option<Duration>) {
        let [roll, pitch, yaw] =
            [message.roll, message.pitch, message.yaw].map(|radians| Angle::from_radians(f64::from(radians)));
        if roll.is_finite() && pitch.is_finite() && yaw.is_finite() {
            let attitude = Attitude::from_aircraft_angles(AircraftAngles { roll, pitch, yaw });
            let turn = turn(attitude, [message.rollspeed, message.pitchspeed, message.yawspeed]);
            self.attitudes.from_angles = Some(Dated::new(now, Orientation { attitude, turn, late }));
        }
    }

    fn handle_attitude_quaternion(
        &mut self,
        now: Timestamp,
        message: &ATTITUDE_QUATERNION_DATA,
        late: Option<Duration>,
    ) {
        let Ok(Some(of_body)) = Attitude::from_wxyz([message.q1, message.q2, message.q3, message.q4]) else { return };
        let turn = turn(of_body, [message.rollspeed, message.pitchspeed, message.yawspeed]);
        // "Rotation offset by which the attitude quaternion … should be rotated for user display", all zeros when there
        // is none: a tail-sitter that flies like an aeroplane tells here which way is forward.
        let offset = Attitude::<BodyFrame>::from_wxyz(message.repr_offset_q).ok().flatten();
        self.attitudes.is_reoriented = offset.is_some_and(|offset| offset != Attitude::identity());
        let attitude = offset.map_or(of_body, |offset| of_body.of_mounted(offset));
        self.attitudes.from_quaternion = Some(Dated::new(now, Orientation { attitude, turn, late }));
    }

    fn handle_global_position_int(
        &mut self,
        now: Timestamp,
        message: &GLOBAL_POSITION_INT_DATA,
        late: Option<Duration>,
    ) {
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
        self.velocities.handle_global(now, message, late);
        self.home_altitude_m = Some(Dated::new(now, metres(message.alt) - metres(message.relative_alt)));
    }

    fn handle_autopilot_state_for_gimbal_device(
        &mut self,
        now: Timestamp,
        message: &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
    ) {
        self.clock.handle_stamp(now, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA::ID, Stamp::Micros(message.time_boot_us));
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

/// Rates about the body's axes as one turn in earth's; `None` unless all are numbers.
fn turn(attitude: Attitude<EarthFrame>, body_rates: [f32; 3]) -> Option<AngularVelocity<EarthFrame>> {
    AngularVelocity::from_radians_per_second(body_rates.map(f64::from)).map(|turn| attitude.turn_in_frame(turn))
}

fn metres(millimetres: i32) -> f64 {
    f64::from(millimetres) / 1e3
}

#[cfg(test)]
mod tests;
