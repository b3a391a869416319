//! What MAVSDK's `gimbal_device_tester` demands of a device, with the default settings, noise included.
//!
//! The tester plays an autopilot with system id 33. It sends 284 and 286 twenty times a second to everybody, without
//! frame bits, waits two seconds for an angle, and allows five degrees. Yaw it reads as counted from North.

use super::*;
use crate::geometry::AxisLimits;

const TESTER: MavId = MavId::new(33, 1);

struct Tester {
    bench: Bench,
    vehicle_yaw: f64,
}

impl Tester {
    fn new() -> Self {
        let device = Device::new(Timestamp::ZERO, DeviceSettings::default());
        let mut bench = Bench { device, now: Timestamp::ZERO, sent: Vec::new(), heading: None };
        bench.run_for(1000);
        assert!(bench.sent.is_empty(), "it speaks as system 33 from the start");
        bench.hear(TESTER, &heartbeat(0, 0));
        Self { bench, vehicle_yaw: 0.0 }
    }

    /// Holds the setpoint for so long; pitch and yaw in degrees after it.
    fn hold(&mut self, setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA, millis: u64) -> (f64, f64) {
        let setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA { target_system: 0, target_component: 0, ..setpoint.clone() };
        for _ in 0..millis / 50 {
            self.bench.hear(TESTER, &state(self.vehicle_yaw));
            self.bench.hear(TESTER, &setpoint);
            self.bench.run_for(50);
        }
        self.bench.run_for(millis % 50);
        let (_, status) = self.bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().pop().expect("ten a second");
        let status = Status::from(&status);
        (status.pitch, status.yaw)
    }

    #[track_caller]
    fn expect_angle(&mut self, pitch: f64, yaw: f64, flags: GimbalFlags) {
        let (actual_pitch, actual_yaw) = self.hold(&angles(flags, pitch, yaw), 2000);
        let follows = !flags.contains(GimbalFlags::YAW_LOCK);
        let expected_yaw = if follows { yaw + self.vehicle_yaw } else { yaw };
        assert_near(actual_pitch, pitch, 5.0);
        assert_near(actual_yaw, expected_yaw, 5.0);
    }

    #[track_caller]
    fn expect_rate(&mut self, pitch_rate: f32, yaw_rate: f32, millis: u64) {
        let before = self.hold(&rates_only(LEVEL, [0.0; 3]), 500);
        let after = self.hold(&rates_only(LEVEL, [0.0, pitch_rate, yaw_rate]), millis);
        let seconds = millis as f64 / 1000.0;
        assert_near(after.0, before.0 + f64::from(pitch_rate) * seconds, 5.0);
        assert_near(after.1, before.1 + f64::from(yaw_rate) * seconds, 5.0);
    }
}

#[test]
fn it_introduces_itself() {
    let mut tester = Tester::new();
    tester.bench.hear(TESTER, &request(message::GIMBAL_DEVICE_INFORMATION, 33, 154));
    let (_, information) = tester.bench.first::<GIMBAL_DEVICE_INFORMATION_DATA>();
    assert!(information.yaw_min.is_infinite() && information.yaw_max.is_infinite());
    tester.bench.run_for(300);
    assert_eq!(tester.bench.device.id(), MavId::new(33, 154));
    let (_, status) = tester.bench.first::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert_eq!((status.target_system, status.target_component), (0, 0));
    assert_eq!(tester.bench.first::<HEARTBEAT_DATA>().1.mavtype, 26);
}

#[test]
fn angles_are_reached_within_two_seconds() {
    let locked = LEVEL | GimbalFlags::YAW_LOCK;
    let pitch_max = DeviceSettings::default().plant.limits.pitch.map(AxisLimits::max).expect("limits").degrees();
    let mut tester = Tester::new();
    for pitch in [0.0, -45.0] {
        tester.expect_angle(pitch, 0.0, LEVEL);
    }
    // Straight down it does not look.
    tester.hold(&angles(LEVEL, -90.0, 0.0), 2000);
    tester.expect_angle(pitch_max, 0.0, LEVEL);

    for (pitch, yaw) in [(0.0, 0.0), (0.0, 60.0), (0.0, -60.0), (-45.0, 0.0), (-45.0, 60.0), (-45.0, -60.0), (0.0, 0.0)]
    {
        tester.expect_angle(pitch, yaw, LEVEL);
    }

    tester.expect_angle(0.0, 0.0, locked);
    tester.vehicle_yaw = -30.0;
    tester.hold(&angles(locked, 0.0, 0.0), 2000);
    for (pitch, yaw) in [(0.0, 60.0), (0.0, -60.0), (-45.0, 0.0), (-45.0, 60.0), (-45.0, -60.0), (0.0, 0.0)] {
        tester.expect_angle(pitch, yaw, locked);
    }
    tester.expect_angle(0.0, 0.0, LEVEL);
}

#[test]
fn rates_turn_it_as_far_as_they_should() {
    let mut tester = Tester::new();
    tester.vehicle_yaw = -30.0;
    tester.expect_angle(0.0, 0.0, LEVEL);
    tester.expect_rate(-10.0, 0.0, 5000);
    tester.expect_rate(20.0, 0.0, 2500);
    tester.expect_angle(0.0, 0.0, LEVEL);
    tester.expect_rate(0.0, 5.0, 5000);
    tester.expect_rate(0.0, -10.0, 5000);
    tester.expect_angle(0.0, 0.0, LEVEL);

    let halfway = tester.hold(&angles_at(LEVEL, -20.0, 0.0, [0.0, -10.0, 0.0]), 1000);
    assert_near(halfway.0, -10.0, 5.0);
    let arrived = tester.hold(&angles_at(LEVEL, -20.0, 0.0, [0.0, -10.0, 0.0]), 1000);
    assert_near(arrived.0, -20.0, 5.0);
}
