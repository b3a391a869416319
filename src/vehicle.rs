//! What the autopilot says of the vehicle: attitude, position and heading, each with its age.
//!
//! The order of trust and the age at which a value stops counting follow the Gimbal Protocol v2: the attitude made for
//! gimbals (286) comes first. A value that is malformed, or marked as unknown, is as if it had not been sent.

use std::borrow::Cow;
use std::time::Duration;

use crate::geometry::{AircraftAngles, Angle, AngularRate, Attitude, EarthFrame, Position};
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, EXTENDED_SYS_STATE_DATA,
    GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA,
};
use crate::wire::ids::mav_autopilot;

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

/// The family of an autopilot (`MAV_AUTOPILOT`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    ArduPilot,
    Px4,
    Other(u8),
}

/// `MAV_LANDED_STATE` where it is defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LandedState {
    OnGround,
    InAir,
    TakingOff,
    Landing,
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

impl Autopilot {
    fn from_number(number: u8) -> Self {
        match number {
            mav_autopilot::ARDUPILOTMEGA => Self::ArduPilot,
            mav_autopilot::PX4 => Self::Px4,
            other => Self::Other(other),
        }
    }

    /// `ardupilot`, `px4`, or the number of another `MAV_AUTOPILOT`.
    pub fn name(self) -> Cow<'static, str> {
        match self {
            Self::ArduPilot => Cow::Borrowed("ardupilot"),
            Self::Px4 => Cow::Borrowed("px4"),
            Self::Other(number) => Cow::Owned(number.to_string()),
        }
    }
}

impl LandedState {
    fn from_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::OnGround),
            2 => Some(Self::InAir),
            3 => Some(Self::TakingOff),
            4 => Some(Self::Landing),
            _ => None,
        }
    }
}

/// The last attitude out of each message that carries one.
#[derive(Clone, Debug, Default, PartialEq)]
struct Attitudes {
    /// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`
    for_gimbals: Option<Dated<Attitude<EarthFrame>>>,
    /// `ATTITUDE_QUATERNION`
    from_quaternion: Option<Dated<Attitude<EarthFrame>>>,
    /// `ATTITUDE`
    from_angles: Option<Dated<Attitude<EarthFrame>>>,
}

impl Attitudes {
    /// The first fresh one in order of trust; when none is fresh, the youngest.
    fn best(&self, now: Timestamp) -> Option<Dated<Attitude<EarthFrame>>> {
        let by_trust = || [self.for_gimbals, self.from_quaternion, self.from_angles].into_iter().flatten();
        by_trust()
            .find(|attitude| attitude.age(now) <= ATTITUDE_WITHIN)
            .or_else(|| by_trust().min_by_key(|attitude| attitude.age(now)))
    }
}

/// A value and when it arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Dated<T> {
    at: Timestamp,
    value: T,
}

impl<T> Dated<T> {
    fn new(at: Timestamp, value: T) -> Self {
        Self { at, value }
    }

    fn age(&self, now: Timestamp) -> Duration {
        now.since(self.at)
    }

    /// The value unless it is older than `limit`.
    fn within(self, now: Timestamp, limit: Duration) -> Option<T> {
        (self.age(now) <= limit).then_some(self.value)
    }
}

fn metres(millimetres: i32) -> f64 {
    f64::from(millimetres) / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::dialect::MessageData;
    use crate::wire::{FrameBuffer, MavId};

    impl Vehicle {
        fn hear<M: MessageData>(&mut self, at_ms: u64, message: &M) {
            let mut buffer = FrameBuffer::default();
            let frame = buffer.encode(MavId::new(1, 1), 0, message);
            self.handle_frame(Timestamp::from_millis(at_ms), &frame);
        }

        fn heading_deg(&self, at_ms: u64) -> Option<f64> {
            // A hundredth of a degree is what the coarsest source, the compass, resolves.
            self.heading(Timestamp::from_millis(at_ms)).map(|heading| (heading.degrees() * 100.0).round() / 100.0)
        }
    }

    fn heartbeat(autopilot: u8) -> HEARTBEAT_DATA {
        HEARTBEAT_DATA { autopilot, mavtype: 2, mavlink_version: 3, ..HEARTBEAT_DATA::DEFAULT }
    }

    fn attitude(roll_deg: f32, pitch_deg: f32, yaw_deg: f32) -> ATTITUDE_DATA {
        ATTITUDE_DATA {
            roll: roll_deg.to_radians(),
            pitch: pitch_deg.to_radians(),
            yaw: yaw_deg.to_radians(),
            ..ATTITUDE_DATA::DEFAULT
        }
    }

    fn facing(yaw_deg: f64) -> [f32; 4] {
        let yaw = Angle::from_degrees(yaw_deg);
        Attitude::<EarthFrame>::from_aircraft_angles(AircraftAngles { yaw, ..AircraftAngles::default() }).to_wxyz()
    }

    fn attitude_quaternion(q: [f32; 4]) -> ATTITUDE_QUATERNION_DATA {
        let [q1, q2, q3, q4] = q;
        ATTITUDE_QUATERNION_DATA { q1, q2, q3, q4, ..ATTITUDE_QUATERNION_DATA::DEFAULT }
    }

    fn for_gimbals(q: [f32; 4], angular_velocity_z: f32) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
            q,
            angular_velocity_z,
            ..AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA::DEFAULT
        }
    }

    fn in_the_field() -> GLOBAL_POSITION_INT_DATA {
        GLOBAL_POSITION_INT_DATA {
            lat: 473_977_420,
            lon: 85_455_940,
            alt: 488_250,
            relative_alt: 100_000,
            hdg: 27_050,
            ..GLOBAL_POSITION_INT_DATA::DEFAULT
        }
    }

    const FIELD: Position = Position { latitude_deg: 47.397_742, longitude_deg: 8.545_594, altitude_m: 488.25 };

    #[test]
    fn nothing_is_known_of_a_vehicle_not_heard() {
        let vehicle = Vehicle::new();
        let now = Timestamp::ZERO;

        assert!(!vehicle.alive(now));
        assert_eq!(vehicle.autopilot(), None);
        assert_eq!(vehicle.attitude(now), None);
        assert_eq!(vehicle.attitude_age(now), None);
        assert_eq!(vehicle.heading(now), None);
        assert_eq!(vehicle.position(now), None);
        assert_eq!(vehicle.position_age(now), None);
        assert_eq!(vehicle.home_altitude_amsl(now), None);
        assert_eq!(vehicle.yaw_rate(now), None);
        assert_eq!(vehicle.landed_state(now), None);
    }

    #[test]
    fn any_frame_keeps_the_vehicle_alive_for_five_seconds() {
        let mut vehicle = Vehicle::new();

        vehicle.hear(0, &heartbeat(mav_autopilot::PX4));
        assert!(vehicle.alive(Timestamp::from_millis(5_000)));
        assert!(!vehicle.alive(Timestamp::from_millis(5_001)));

        vehicle.hear(6_000, &crate::wire::dialect::SYS_STATUS_DATA::DEFAULT);
        assert!(vehicle.alive(Timestamp::from_millis(11_000)));
        assert!(!vehicle.alive(Timestamp::from_millis(11_001)));
    }

    #[test]
    #[rustfmt::skip]
    fn the_heartbeat_names_the_autopilot() {
        for (number,                       autopilot,                   name) in [
            (mav_autopilot::ARDUPILOTMEGA, Some(Autopilot::ArduPilot),  Some("ardupilot")),
            (mav_autopilot::PX4,           Some(Autopilot::Px4),        Some("px4")),
            (mav_autopilot::GENERIC,       Some(Autopilot::Other(0)),   Some("0")),
            (200,                          Some(Autopilot::Other(200)), Some("200")),
            (mav_autopilot::INVALID,       None,                        None),
        ] {
            let mut vehicle = Vehicle::new();

            vehicle.hear(0, &heartbeat(number));

            assert_eq!(vehicle.autopilot(), autopilot);
            assert_eq!(vehicle.autopilot().map(Autopilot::name).as_deref(), name);
        }
    }

    /// "Use its `q` as the preferred vehicle heading source (yaw of q), else ATTITUDE_QUATERNION (31), ATTITUDE (30), else
    /// GLOBAL_POSITION_INT.hdg (33, cdeg, 65535 unknown). Heading is stale after 1 s." (protocol notes 1.8)
    #[test]
    fn heading_comes_from_the_most_trusted_source_that_is_fresh() {
        let mut vehicle = Vehicle::new();

        vehicle.hear(400, &for_gimbals(facing(10.0), 0.0));
        vehicle.hear(600, &attitude_quaternion(facing(20.0)));
        vehicle.hear(800, &attitude(0.0, 0.0, 30.0));
        vehicle.hear(1_000, &in_the_field());

        assert_eq!(vehicle.heading_deg(1_400), Some(10.0));
        assert_eq!(vehicle.heading_deg(1_401), Some(20.0));
        assert_eq!(vehicle.heading_deg(1_600), Some(20.0));
        assert_eq!(vehicle.heading_deg(1_601), Some(30.0));
        assert_eq!(vehicle.heading_deg(1_800), Some(30.0));
        assert_eq!(vehicle.heading_deg(1_801), Some(-89.5));
        assert_eq!(vehicle.heading_deg(2_000), Some(-89.5));
        assert_eq!(vehicle.heading_deg(2_001), None);
    }

    #[test]
    fn an_unknown_compass_heading_is_no_heading() {
        let mut vehicle = Vehicle::new();

        for hdg in [u16::MAX, 36_001] {
            vehicle.hear(0, &GLOBAL_POSITION_INT_DATA { hdg, ..in_the_field() });
            assert_eq!(vehicle.heading_deg(0), None);
        }
        vehicle.hear(0, &GLOBAL_POSITION_INT_DATA { hdg: 36_000, ..in_the_field() });
        assert_eq!(vehicle.heading_deg(0), Some(0.0));
    }

    #[test]
    fn attitude_tells_tilt_and_its_own_age() {
        let mut vehicle = Vehicle::new();
        vehicle.hear(0, &for_gimbals(facing(10.0), 0.0));
        vehicle.hear(500, &attitude(20.0, -30.0, 120.0));

        assert_eq!(vehicle.attitude_age(Timestamp::from_millis(700)), Some(Duration::from_millis(700)));
        let angles = vehicle.attitude(Timestamp::from_millis(1_200)).expect("ATTITUDE is fresh").aircraft_angles();
        assert!((angles.roll.degrees() - 20.0).abs() < 1e-4);
        assert!((angles.pitch.degrees() + 30.0).abs() < 1e-4);
        assert!((angles.yaw.degrees() - 120.0).abs() < 1e-4);
        assert_eq!(vehicle.attitude_age(Timestamp::from_millis(1_200)), Some(Duration::from_millis(700)));
        assert_eq!(vehicle.attitude(Timestamp::from_millis(1_501)), None);
        assert_eq!(vehicle.attitude_age(Timestamp::from_millis(1_501)), Some(Duration::from_millis(1_001)));
    }

    /// "Some NaN → malformed. Any Inf → malformed. |q|² outside 0.9..1.1 → malformed." (protocol notes 3.7)
    #[test]
    fn malformed_attitudes_leave_the_last_good_one() {
        let mut vehicle = Vehicle::new();
        vehicle.hear(0, &for_gimbals(facing(10.0), 0.0));
        vehicle.hear(0, &attitude_quaternion(facing(20.0)));
        vehicle.hear(0, &attitude(0.0, 0.0, 30.0));
        let before = vehicle.attitudes.clone();

        for broken in [
            [f32::NAN; 4],
            [1.0, f32::NAN, 0.0, 0.0],
            [f32::INFINITY, 0.0, 0.0, 0.0],
            [0.0; 4],
            [0.5; 4].map(|x| x * 1.5),
        ] {
            vehicle.hear(100, &for_gimbals(broken, 0.0));
            vehicle.hear(100, &attitude_quaternion(broken));
        }
        vehicle.hear(100, &attitude(f32::NAN, 0.0, 40.0));
        vehicle.hear(100, &attitude(0.0, f32::INFINITY, 40.0));

        assert_eq!(vehicle.attitudes, before);
    }

    #[test]
    fn position_is_above_sea_level_and_lasts_five_seconds() {
        let mut vehicle = Vehicle::new();

        vehicle.hear(1_000, &in_the_field());

        assert_eq!(vehicle.position(Timestamp::from_millis(6_000)), Some(FIELD));
        assert_eq!(vehicle.position(Timestamp::from_millis(6_001)), None);
        assert_eq!(vehicle.position_age(Timestamp::from_millis(6_001)), Some(Duration::from_millis(5_001)));
    }

    #[test]
    fn a_place_that_is_not_on_earth_is_no_position() {
        for (lat, lon, alt) in [
            (0, 0, 0),
            (i32::MAX, i32::MAX, 488_250),
            (i32::MIN, 85_455_940, 488_250),
            (900_000_001, 85_455_940, 488_250),
            (473_977_420, -1_800_000_001, 488_250),
        ] {
            let mut vehicle = Vehicle::new();

            vehicle.hear(0, &GLOBAL_POSITION_INT_DATA { lat, lon, alt, ..in_the_field() });

            assert_eq!(vehicle.position(Timestamp::ZERO), None, "{lat} {lon} {alt}");
            assert_eq!(vehicle.home_altitude_amsl(Timestamp::ZERO), None);
            assert_eq!(vehicle.heading_deg(0), Some(-89.5));
        }
        let mut vehicle = Vehicle::new();
        vehicle.hear(0, &GLOBAL_POSITION_INT_DATA { lat: -900_000_000, lon: -1_800_000_000, ..in_the_field() });
        assert_eq!(
            vehicle.position(Timestamp::ZERO),
            Some(Position { latitude_deg: -90.0, longitude_deg: -180.0, altitude_m: 488.25 })
        );
    }

    /// Protocol checklist 116: "altitude = z + (alt − relative_alt) of GLOBAL_POSITION_INT."
    #[test]
    fn home_altitude_follows_the_position_and_falls_back_on_the_home_position() {
        let mut vehicle = Vehicle::new();

        vehicle.hear(0, &HOME_POSITION_DATA { altitude: 390_500, ..HOME_POSITION_DATA::DEFAULT });
        assert_eq!(vehicle.home_altitude_amsl(Timestamp::from_millis(60_000)), Some(390.5));

        vehicle.hear(60_000, &in_the_field());
        assert_eq!(vehicle.home_altitude_amsl(Timestamp::from_millis(65_000)), Some(388.25));
        assert_eq!(vehicle.home_altitude_amsl(Timestamp::from_millis(65_001)), Some(390.5));
    }

    /// Protocol checklist 141: "When 286.angular_velocity_z is 0.0, HTTP reports unknown."
    #[test]
    #[rustfmt::skip]
    fn a_yaw_rate_of_zero_or_nan_is_unknown() {
        for (sent,        known) in [
            (0.25_f32,    true),
            (-0.25,       true),
            (1e-5,        true),
            (0.0,         false),
            (-0.0,        false),
            (f32::NAN,    false),
            (f32::INFINITY, false),
        ] {
            let mut vehicle = Vehicle::new();
            vehicle.hear(0, &for_gimbals(facing(0.0), 0.5));

            vehicle.hear(100, &for_gimbals(facing(0.0), sent));

            let expected = known.then(|| AngularRate::from_radians_per_second(f64::from(sent)));
            assert_eq!(vehicle.yaw_rate(Timestamp::from_millis(1_100)), expected, "{sent}");
            assert_eq!(vehicle.yaw_rate(Timestamp::from_millis(1_101)), None);
        }
    }

    #[test]
    #[rustfmt::skip]
    fn the_landed_state_comes_from_whoever_knows_it() {
        for (number, expected) in [
            (0,      Some(LandedState::OnGround)),
            (1,      Some(LandedState::OnGround)),
            (2,      Some(LandedState::InAir)),
            (3,      Some(LandedState::TakingOff)),
            (4,      Some(LandedState::Landing)),
            (77,     Some(LandedState::OnGround)),
        ] {
            let mut vehicle = Vehicle::new();
            vehicle.hear(0, &EXTENDED_SYS_STATE_DATA { vtol_state: 0, landed_state: 1 });

            vehicle.hear(1_000, &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
                landed_state: number,
                ..for_gimbals(facing(0.0), 0.0)
            });

            assert_eq!(vehicle.landed_state(Timestamp::from_millis(5_000)), expected, "{number}");
            assert_eq!(vehicle.landed_state(Timestamp::from_millis(6_001)), None, "{number}");
        }
    }
}
