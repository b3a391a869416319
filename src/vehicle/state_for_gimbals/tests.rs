//! "Made from ATTITUDE_QUATERNION or ATTITUDE, LOCAL_POSITION_NED or GLOBAL_POSITION_INT, EXTENDED_SYS_STATE,
//! ESTIMATOR_STATUS or EKF_STATUS_REPORT and the yaw target …, with true delays; clock wraps handled."

use super::*;
use crate::geometry::{AircraftAngles, Angle, Attitude, EarthFrame};
use crate::wire::dialect::*;
use crate::wire::{FrameBuffer, MavId};

const OWN_SYSTEM: Target = Target::System(1);

/// When the autopilot's clock read zero, and how long its fastest message takes: neither can be told from the other.
const STARTED_MS: u64 = 5_000;

/// A vehicle, and an autopilot whose clock started at [`STARTED_MS`].
struct Flight {
    vehicle: Vehicle,
    uptime_ms: u64,
}

impl Flight {
    fn new() -> Self {
        Self::with_clock_at(1_000)
    }

    /// The autopilot's clock reads `uptime_ms` at [`STARTED_MS`]; a first message has been heard then.
    fn with_clock_at(uptime_ms: u64) -> Self {
        let mut flight = Self { vehicle: Vehicle::new(), uptime_ms };
        flight.hear(0, &SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms: flight.boot_ms(0) });
        flight
    }

    /// The autopilot's clock `ms` after the start of the test.
    fn boot_ms(&self, ms: u64) -> u32 {
        (self.uptime_ms + ms) as u32
    }

    fn hear<M: MessageData>(&mut self, ms: u64, message: &M) {
        let mut buffer = FrameBuffer::default();
        let frame = buffer.encode(MavId::new(1, 1), 0, message);
        self.vehicle.handle_frame(at(ms), &frame);
    }

    /// The attitude at `measured_ms`, which arrives at `ms`.
    fn hear_attitude(&mut self, measured_ms: u64, ms: u64, angles: [f32; 3], rates: [f32; 3]) {
        let ([roll, pitch, yaw], [rollspeed, pitchspeed, yawspeed]) = (angles.map(f32::to_radians), rates);
        let time_boot_ms = self.boot_ms(measured_ms);
        self.hear(ms, &ATTITUDE_DATA { time_boot_ms, roll, pitch, yaw, rollspeed, pitchspeed, yawspeed });
    }

    fn hear_quaternion(&mut self, measured_ms: u64, ms: u64, q: [f32; 4], rates: [f32; 3], repr_offset_q: [f32; 4]) {
        let ([q1, q2, q3, q4], [rollspeed, pitchspeed, yawspeed]) = (q, rates);
        let time_boot_ms = self.boot_ms(measured_ms);
        let message =
            ATTITUDE_QUATERNION_DATA { time_boot_ms, q1, q2, q3, q4, rollspeed, pitchspeed, yawspeed, repr_offset_q };
        self.hear(ms, &message);
    }

    fn state(&self, ms: u64) -> Option<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA> {
        self.vehicle.state_for_gimbals(at(ms), OWN_SYSTEM)
    }

    #[track_caller]
    fn heading_deg(&self, ms: u64) -> f64 {
        let q = self.state(ms).expect("an attitude is known").q;
        let attitude: Attitude<EarthFrame> = Attitude::from_wxyz(q).expect("well formed").expect("set");
        (attitude.heading().degrees() * 1e4).round() / 1e4
    }
}

fn at(ms: u64) -> Timestamp {
    Timestamp::from_millis(STARTED_MS + ms)
}

fn q(roll: f64, pitch: f64, yaw: f64) -> [f32; 4] {
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
    Attitude::<EarthFrame>::from_aircraft_angles(AircraftAngles { roll, pitch, yaw }).to_wxyz()
}

/// All that is not NaN compares as it is, NaN as its place.
fn with_nan_named(
    state: &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
) -> (AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, [bool; 4]) {
    let mut state = state.clone();
    let floats = [&mut state.vx, &mut state.vy, &mut state.vz, &mut state.feed_forward_angular_velocity_z];
    let unknown = floats.map(|float| {
        let unknown = float.is_nan();
        if unknown {
            *float = 0.0;
        }
        unknown
    });
    (state, unknown)
}

#[track_caller]
fn assert_state(
    found: Option<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>,
    expected: &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
) {
    assert_eq!(with_nan_named(&found.expect("a state")), with_nan_named(expected));
}

/// As PX4 tells it when nothing but the attitude is known.
fn bare(ms: u64, q: [f32; 4]) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: (1_000 + ms) * 1_000,
        q,
        q_estimated_delay_us: 1,
        vx: f32::NAN,
        vy: f32::NAN,
        vz: f32::NAN,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: f32::NAN,
        estimator_status: 0,
        target_system: 1,
        target_component: 0,
        landed_state: 0,
        angular_velocity_z: 0.0,
    }
}

/// Everything, as PX4 sends it: with all digits.
#[test]
fn it_is_made_of_what_px4_tells_others() {
    let mut flight = Flight::new();
    flight.hear_quaternion(100, 100, q(10.0, -5.0, 30.0), [0.0, 0.0, 0.25], [0.0; 4]);
    let time_boot_ms = flight.boot_ms(80);
    let local =
        LOCAL_POSITION_NED_DATA { time_boot_ms, vx: 1.5, vy: -2.5, vz: 0.125, ..LOCAL_POSITION_NED_DATA::DEFAULT };
    flight.hear(100, &local);
    flight.hear(100, &EXTENDED_SYS_STATE_DATA { vtol_state: 0, landed_state: 2 });
    flight.hear(100, &ESTIMATOR_STATUS_DATA { flags: 831, ..ESTIMATOR_STATUS_DATA::DEFAULT });
    let target = POSITION_TARGET_LOCAL_NED_DATA { yaw_rate: 0.5, ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT };
    flight.hear(100, &target);

    let down = 0.25 * (10_f64.to_radians().cos() * 5_f64.to_radians().cos());
    let expected = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        vx: 1.5,
        vy: -2.5,
        vz: 0.125,
        v_estimated_delay_us: 20_000,
        feed_forward_angular_velocity_z: 0.5,
        estimator_status: 831,
        landed_state: 2,
        angular_velocity_z: down as f32,
        ..bare(100, q(10.0, -5.0, 30.0))
    };
    assert_state(flight.state(100), &expected);
}

/// Everything, as ArduPilot sends it: angles, centimetres, an EKF.
#[test]
fn it_is_made_of_what_ardupilot_tells_others() {
    let mut flight = Flight::new();
    flight.hear_attitude(100, 100, [0.0, 0.0, -90.0], [0.0, 0.0, -0.25]);
    let time_boot_ms = flight.boot_ms(100);
    let (lat, lon, alt) = (473_977_420, 85_455_940, 488_250);
    let global = GLOBAL_POSITION_INT_DATA {
        time_boot_ms,
        lat,
        lon,
        alt,
        vx: 150,
        vy: -250,
        vz: 12,
        ..GLOBAL_POSITION_INT_DATA::DEFAULT
    };
    flight.hear(100, &global);
    flight.hear(100, &EXTENDED_SYS_STATE_DATA { vtol_state: 0, landed_state: 4 });
    flight.hear(100, &EKF_STATUS_REPORT_DATA { flags: 831 | 32_768, ..EKF_STATUS_REPORT_DATA::DEFAULT });
    let [q1, q2, q3, q4] = q(0.0, 0.0, -90.0);
    let target = ATTITUDE_TARGET_DATA {
        time_boot_ms,
        q: [q1, q2, q3, q4],
        body_roll_rate: 0.0,
        body_pitch_rate: 0.0,
        body_yaw_rate: -0.75,
        thrust: 0.5,
        type_mask: 0,
    };
    flight.hear(100, &target);

    let expected = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        vx: 1.5,
        vy: -2.5,
        vz: 0.12,
        v_estimated_delay_us: 1,
        feed_forward_angular_velocity_z: -0.75,
        estimator_status: 831 | 1_024,
        landed_state: 4,
        angular_velocity_z: -0.25,
        ..bare(100, q(0.0, 0.0, -90.0))
    };
    assert_state(flight.state(100), &expected);
}

/// What is not told, or was told too long ago, reads as unknown: NaN for a velocity and a target, 0 for the rest.
#[test]
fn what_is_not_known_is_told_as_unknown() {
    let mut flight = Flight::new();
    assert_eq!(flight.state(0), None, "without an attitude there is nothing to tell");

    let time_boot_ms = flight.boot_ms(0);
    flight
        .hear(0, &LOCAL_POSITION_NED_DATA { time_boot_ms, vx: 1.0, vy: f32::NAN, ..LOCAL_POSITION_NED_DATA::DEFAULT });
    flight.hear(0, &POSITION_TARGET_LOCAL_NED_DATA { yaw_rate: 0.5, ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT });
    flight.hear(0, &EXTENDED_SYS_STATE_DATA { vtol_state: 0, landed_state: 1 });
    flight.hear(0, &ESTIMATOR_STATUS_DATA { flags: 831, ..ESTIMATOR_STATUS_DATA::DEFAULT });
    assert_eq!(flight.state(0), None);

    let nan = [f32::NAN; 3];
    let with_rest = |ms| AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        estimator_status: 831,
        landed_state: 1,
        ..bare(ms, q(0.0, 0.0, 0.0))
    };
    flight.hear_attitude(1_000, 1_000, [0.0; 3], nan);
    let moving = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        vx: 1.0,
        vz: 0.0,
        v_estimated_delay_us: 1_000_000,
        feed_forward_angular_velocity_z: 0.5,
        ..with_rest(1_000)
    };
    assert_state(flight.state(1_000), &moving);
    flight.hear_attitude(1_001, 1_001, [0.0; 3], nan);
    assert_state(flight.state(1_001), &with_rest(1_001));
    flight.hear_attitude(5_000, 5_000, [0.0; 3], nan);
    assert_state(flight.state(5_000), &with_rest(5_000));
    flight.hear_attitude(5_001, 5_001, [0.0; 3], nan);
    assert_state(flight.state(5_001), &bare(5_001, q(0.0, 0.0, 0.0)));
}

/// `LOCAL_POSITION_NED` comes before `GLOBAL_POSITION_INT` while it is fresh.
#[test]
fn the_finer_velocity_comes_first() {
    let mut flight = Flight::new();
    let (lat, lon) = (473_977_420, 85_455_940);
    for ms in [0, 500] {
        let time_boot_ms = flight.boot_ms(ms);
        if ms == 0 {
            flight.hear(ms, &LOCAL_POSITION_NED_DATA { time_boot_ms, vx: 1.001, ..LOCAL_POSITION_NED_DATA::DEFAULT });
        }
        let global = GLOBAL_POSITION_INT_DATA {
            time_boot_ms,
            lat,
            lon,
            alt: 1,
            vx: 100,
            vy: i16::MAX,
            ..GLOBAL_POSITION_INT_DATA::DEFAULT
        };
        flight.hear(ms, &global);
    }
    flight.hear_attitude(500, 500, [0.0; 3], [0.0; 3]);

    let north = |ms| flight.state(ms).map(|state| (state.vx, state.vy.is_nan(), state.v_estimated_delay_us));
    assert_eq!(north(1_000), Some((1.001, false, 1_000_000)));
    assert_eq!(north(1_001), Some((1.0, true, 501_000)));
}

/// "0 = unknown … 1e-5 stands for a measured zero" (mav#2495).
#[test]
fn a_measured_rate_of_zero_is_not_told_as_unknown() {
    for (rate, expected) in
        [(0.0, 1e-5), (-0.0, 1e-5), (0.3, 0.3), (-1e-6, -1e-6), (f32::NAN, 0.0), (f32::INFINITY, 0.0)]
    {
        let mut flight = Flight::new();
        flight.hear_attitude(10, 10, [0.0; 3], [0.0, 0.0, rate]);
        assert_eq!(flight.state(10).expect("a state").angular_velocity_z, expected, "{rate}");
    }
}

/// "apply repr_offset_q only if finite and non-zero": the rates are the airframe's either way.
#[test]
fn a_tail_sitter_is_told_as_it_flies() {
    let nose_up = q(0.0, 90.0, 0.0);
    let offset = q(0.0, -90.0, 0.0);
    for (repr_offset_q, expected_deg) in [(offset, 0.0), ([0.0; 4], 90.0), ([f32::NAN; 4], 90.0), ([2.0; 4], 90.0)] {
        let mut flight = Flight::new();
        // Rolling about its long axis, which points up: a turn about Down the other way round.
        flight.hear_quaternion(10, 10, nose_up, [0.25, 0.0, 0.0], repr_offset_q);

        let state = flight.state(10).expect("a state");
        let attitude: Attitude<EarthFrame> = Attitude::from_wxyz(state.q).expect("well formed").expect("set");
        assert!((attitude.aircraft_angles().pitch.degrees() - expected_deg).abs() < 0.1, "{repr_offset_q:?}");
        assert!((state.angular_velocity_z + 0.25).abs() < 1e-6, "{repr_offset_q:?}");
        if expected_deg == 0.0 {
            // ATTITUDE knows nothing of it, so a later one is not taken between.
            flight.hear_attitude(100, 100, [0.0, 90.0, 0.0], [0.0; 3]);
            assert_eq!(flight.state(100).expect("a state").angular_velocity_z, state.angular_velocity_z);
        }
    }
}

/// Both come from one estimate: the newer one is told, when the quaternion is not about as new.
#[test]
fn the_newer_attitude_is_told() {
    let mut flight = Flight::new();
    flight.hear_quaternion(100, 100, q(0.0, 0.0, 10.0), [f32::NAN; 3], [0.0; 4]);
    flight.hear_attitude(120, 120, [0.0, 0.0, 20.0], [f32::NAN; 3]);

    assert_eq!(flight.heading_deg(150), 10.0);
    assert_eq!(flight.heading_deg(151), 20.0);
    flight.hear_quaternion(160, 160, q(0.0, 0.0, 30.0), [f32::NAN; 3], [0.0; 4]);
    assert_eq!(flight.heading_deg(160), 30.0);
}

/// "q extrapolated by the body rates …, capped to 250 ms age; stop when the attitude is older than 1 s". What is
/// extrapolated is as new as it was when it came, what is not is older by so much.
#[test]
fn an_attitude_is_turned_on_for_a_quarter_of_a_second_and_told_for_a_second() {
    let mut flight = Flight::new();
    let ten_degrees_per_second = 10_f32.to_radians();
    flight.hear_attitude(100, 110, [0.0; 3], [0.0, 0.0, ten_degrees_per_second]);

    let told = |ms| {
        let delay = flight.state(ms).expect("a state").q_estimated_delay_us;
        (flight.heading_deg(ms), delay)
    };
    assert_eq!(told(110), (0.0, 10_000));
    assert_eq!(told(210), (1.0, 10_000));
    assert_eq!(told(360), (2.5, 10_000));
    assert_eq!(told(460), (2.5, 110_000));
    assert_eq!(told(1_110), (2.5, 760_000));
    assert_eq!(flight.state(1_111), None);

    // Without rates there is nothing to turn it on by.
    flight.hear_attitude(1_200, 1_200, [0.0, 0.0, 5.0], [f32::NAN; 3]);
    assert_eq!(flight.heading_deg(1_300), 5.0);
    assert_eq!(flight.state(1_300).expect("a state").q_estimated_delay_us, 100_000);
}

/// "true delays": of a message that was held up on its way, whatever came in between.
#[test]
fn a_delay_is_the_time_since_the_measurement() {
    let mut flight = Flight::new();
    for ms in (0..500).step_by(20) {
        let held_up = if ms % 100 == 0 { 15 } else { 0 };
        flight.hear_attitude(ms + 1, ms + 1 + held_up, [0.0; 3], [0.0; 3]);
        let delay = flight.state(ms + 1 + held_up).expect("a state").q_estimated_delay_us;
        assert_eq!(delay, u32::try_from(held_up * 1_000).expect("small").max(1), "at {ms}");
    }
}

/// "time_boot_us: the autopilot's time base, monotonic, unwrapped across the 32-bit wrap": 49.7 days in milliseconds, and
/// 71.6 minutes in microseconds.
#[test]
fn the_time_told_goes_on_where_the_autopilots_clock_wraps() {
    for wrap_ms in [1_u64 << 32, (1 << 32) / 1_000] {
        let mut flight = Flight::with_clock_at(wrap_ms - 101);
        let mut told = Vec::new();
        for ms in (20..=400).step_by(20) {
            flight.hear_attitude(ms, ms, [0.0; 3], [0.0; 3]);
            // What wraps at 32 bits of microseconds is heard beside it, and does no harm.
            let boot_us = (flight.uptime_ms + ms) * 1_000;
            let wrapped = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
                time_boot_us: u64::from(boot_us as u32),
                q: [f32::NAN; 4],
                ..bare(ms, [f32::NAN; 4])
            };
            flight.hear(ms, &wrapped);
            let state = flight.state(ms).expect("a state");
            assert_eq!((state.time_boot_us, state.q_estimated_delay_us), (boot_us, 1));
            told.push(state.time_boot_us);
        }
        assert!(told.last() > Some(&(wrap_ms * 1_000)) && told.windows(2).all(|pair| pair[1] > pair[0]));
        assert_eq!(flight.vehicle.restarts(), 0);
    }
}

/// "reboot backwards jumps": nothing of before is told any more, and the time is that of the new start.
#[test]
fn after_a_restart_nothing_of_before_is_told() {
    let mut flight = Flight::with_clock_at(3_000_000_000);
    flight.hear_quaternion(0, 0, q(0.0, 0.0, 10.0), [0.0; 3], [0.0; 4]);
    let time_boot_ms = flight.boot_ms(0);
    flight.hear(0, &LOCAL_POSITION_NED_DATA { time_boot_ms, vx: 1.0, ..LOCAL_POSITION_NED_DATA::DEFAULT });
    flight.hear(0, &POSITION_TARGET_LOCAL_NED_DATA { yaw_rate: 0.5, ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT });

    flight.uptime_ms = 0;
    flight.hear(100, &SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms: 100 });

    assert_eq!((flight.vehicle.restarts(), flight.state(100)), (1, None));
    flight.hear_quaternion(150, 150, q(0.0, 0.0, 40.0), [f32::NAN; 3], [0.0; 4]);
    let expected = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA { time_boot_us: 150_000, ..bare(150, q(0.0, 0.0, 40.0)) };
    assert_state(flight.state(150), &expected);
}

/// An autopilot that does not stamp its messages: the time is ours, and of delays only what we can see ourselves.
#[test]
fn without_time_stamps_the_time_is_ours() {
    let mut flight = Flight { vehicle: Vehicle::new(), uptime_ms: 0 };
    flight.hear_attitude(0, 100, [0.0; 3], [f32::NAN; 3]);

    let state = |ms: u64, delay| AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: at(ms).as_micros(),
        q_estimated_delay_us: delay,
        ..bare(0, q(0.0, 0.0, 0.0))
    };
    assert_state(flight.state(100), &state(100, 0));
    assert_state(flight.state(140), &state(140, 40_000));
}

#[test]
fn a_delay_that_does_not_fit_is_as_long_as_fits() {
    assert_eq!(delay_us(Duration::from_secs(4_294), Some(Duration::from_micros(967_295))), u32::MAX);
    assert_eq!(delay_us(Duration::from_secs(5_000), Some(Duration::ZERO)), u32::MAX);
    assert_eq!(delay_us(Duration::from_secs(5_000), None), u32::MAX);
    assert_eq!(delay_us(Duration::ZERO, None), 0);
    assert_eq!(delay_us(Duration::ZERO, Some(Duration::ZERO)), 1);
}
