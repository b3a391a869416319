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
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA { q, angular_velocity_z, ..AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA::DEFAULT }
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

/// An autopilot may tell its attitude once a second, and turn all the time.
#[test]
fn the_heading_goes_on_with_the_vehicle_until_it_is_told_again() {
    let mut vehicle = Vehicle::new();
    assert_eq!(vehicle.heading_by_now(Timestamp::ZERO), None);
    let (yaw, yawspeed) = (179.0_f32.to_radians(), 10.0_f32.to_radians());
    vehicle.hear(0, &ATTITUDE_DATA { yaw, yawspeed, ..ATTITUDE_DATA::DEFAULT });
    for (ms, expected) in [(0, 179.0), (300, -178.0), (1_000, -171.0)] {
        let heading = vehicle.heading_by_now(Timestamp::from_millis(ms)).expect("it is fresh").degrees();
        assert!((heading - expected).abs() < 0.01, "{ms}: {heading}");
    }
    assert_eq!(vehicle.heading_by_now(Timestamp::from_millis(1_001)), None);
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

    for broken in
        [[f32::NAN; 4], [1.0, f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0, 0.0], [0.0; 4], [0.5; 4].map(|x| x * 1.5)]
    {
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
