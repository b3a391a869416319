//! Every step of MAVSDK's `gimbal_device_tester` with its times and tolerances (Client notes B8), noise included.
//!
//! The tester plays an autopilot with system id 33. It sends 286 and 284 twenty times a second to everybody, without
//! frame bits, and looks at the last 285 whenever the time of a step is over. It reads the quaternion in the order of
//! aviation, as counted from North, whatever the flags say.

use super::*;
use crate::wire::ids::CapFlags;

const TESTER: MavId = MavId::new(33, 1);
const TOLERANCE: f64 = 5.0;
/// From an angle of yaw to the opposite one that the tester goes to when yaw has no limits.
const WITHIN_NO_LIMITS: f64 = 60.0;
/// The quaternion is not looked at beyond, for fear of its singularity.
const STEEP: f64 = 80.0;
const LOCKED: GimbalFlags = LEVEL.union(GimbalFlags::YAW_LOCK);

#[test]
fn the_device_as_it_comes_passes() {
    assert_eq!(failed_steps(DeviceSettings::default()), Vec::<String>::new());
}

/// Such as `gimbald sim gimbal --system-id 33`: it need not wait for the autopilot to know its system.
#[test]
fn a_device_that_is_told_its_system_passes() {
    let settings = DeviceSettings {
        component_id: 175,
        system_id: SystemId::Fixed(33),
        listens_first: Some(Duration::ZERO),
        ..DeviceSettings::default()
    };
    assert_eq!(failed_steps(settings), Vec::<String>::new());
}

/// "slew above 64 °/s by option": from one end stop to the other within the time of a step, 5 s.
#[test]
fn a_device_with_end_stops_passes_when_it_is_fast_enough() {
    let limited = |slew: f64| {
        let mut settings = DeviceSettings::default();
        settings.capabilities.remove(CapFlags::SUPPORTS_INFINITE_YAW);
        settings.plant.limits.yaw = AxisLimits::new(Angle::from_degrees(-160.0), Angle::from_degrees(160.0));
        settings.plant = settings.plant.with_max_rate(AngularRate::from_degrees_per_second(slew));
        settings
    };
    assert_eq!(failed_steps(limited(80.0)), Vec::<String>::new());
    assert_eq!(failed_steps(limited(60.0)), ["follow: pan left", "follow: tilted, pan left"]);
}

/// The tester sends no frame bits, and looks for a heartbeat so soon after its first setpoint that it finds one only
/// where a setpoint that is obeyed is answered with it.
#[test]
fn a_device_that_insists_on_frame_bits_stays_where_it_is() {
    let failed = failed_steps(DeviceSettings { strictness: Strictness::Strict, ..DeviceSettings::default() });
    assert_eq!(failed[..2], ["ids and type", "tilt 45° down"]);
}

/// The gimbal need not look ahead when it is found; its yaw has 20 s to get there.
#[test]
fn a_device_that_looks_elsewhere_at_first_passes() {
    let mut settings = DeviceSettings::default();
    settings.plant.initial.yaw = Angle::from_degrees(120.0);
    settings.plant.initial.pitch = Angle::from_degrees(-60.0);
    assert_eq!(failed_steps(settings), Vec::<String>::new());
}

/// The steps that a device does not pass. The real tester ends at the first.
fn failed_steps(settings: DeviceSettings) -> Vec<String> {
    let mut tester = Tester::new(settings);
    tester.discover();
    tester.tilt();
    tester.follow();
    tester.lock();
    tester.pitch_rates();
    tester.yaw_rates();
    tester.angle_and_rate();
    tester.failed
}

struct Tester {
    bench: Bench,
    next_beat: Timestamp,
    /// When 286 and 284 go out again; never before the device is found.
    next_setpoint: Option<Timestamp>,
    setpoint: GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    vehicle_yaw: f64,
    /// The device's heartbeat, since the tester asked who it is.
    beat: Option<HEARTBEAT_DATA>,
    answer: Option<COMMAND_ACK_DATA>,
    information: Option<GIMBAL_DEVICE_INFORMATION_DATA>,
    status: Option<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>,
    failed: Vec<String>,
}

impl Tester {
    fn new(settings: DeviceSettings) -> Self {
        let device = Device::new(Timestamp::ZERO, settings);
        Self {
            bench: Bench { device, now: Timestamp::ZERO, sent: Vec::new(), heading: None },
            next_beat: Timestamp::ZERO,
            next_setpoint: None,
            setpoint: rates_only(LEVEL, [NAN; 3]),
            vehicle_yaw: 0.0,
            beat: None,
            answer: None,
            information: None,
            status: None,
            failed: Vec::new(),
        }
    }

    fn sleep(&mut self, millis: u64) {
        let until = self.bench.now + Duration::from_millis(millis);
        loop {
            let now = self.bench.now;
            if self.next_beat <= now {
                self.bench.hear(TESTER, &heartbeat(0, 0));
                self.next_beat = now + Duration::from_secs(1);
            }
            if self.next_setpoint.is_some_and(|at| at <= now) {
                self.bench.hear(TESTER, &autopilot_state(self.vehicle_yaw));
                self.bench.hear(TESTER, &self.setpoint);
                self.next_setpoint = Some(now + Duration::from_millis(50));
            }
            self.listen();
            if now == until {
                return;
            }
            let next = [until, self.next_beat].into_iter().chain(self.next_setpoint).min().expect("two at least");
            self.bench.run_until(next);
        }
    }

    fn listen(&mut self) {
        for (_, bytes) in std::mem::take(&mut self.bench.sent) {
            let frame = DatagramFrames::new(&bytes).next_frame().expect("the device sends frames");
            assert_eq!((frame.source().system, frame.source()), (TESTER.system, self.bench.device.id()));
            self.beat = frame.decode().or(self.beat.take());
            self.answer = frame.decode().or(self.answer.take());
            self.information = frame.decode().or(self.information.take());
            self.status = frame.decode().or(self.status.take());
        }
    }

    fn step(&mut self, name: impl Into<String>, passed: bool) {
        if !passed {
            self.failed.push(name.into());
        }
    }

    /// Roll, pitch and yaw of the last 285.
    fn attitude(&self) -> AircraftAngles {
        let q = self.status.as_ref().expect("it came several times a second").q;
        Attitude::<EarthFrame>::from_wxyz(q).expect("valid").expect("known").aircraft_angles()
    }

    fn aim(&mut self, flags: GimbalFlags, pitch: f64, yaw: f64, rates: [f32; 3]) {
        let angles =
            AircraftAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(pitch), yaw: Angle::from_degrees(yaw) };
        let q = Attitude::<EarthFrame>::from_aircraft_angles(angles).to_wxyz();
        self.set(GIMBAL_DEVICE_SET_ATTITUDE_DATA { q, ..rates_only(flags, rates) });
    }

    fn set(&mut self, setpoint: GIMBAL_DEVICE_SET_ATTITUDE_DATA) {
        self.setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA { target_system: 0, target_component: 0, ..setpoint };
    }

    /// Finding the device and asking what it is: a system within 5 s, information within 2 s, yaw ahead within 20 s, a
    /// gimbal by its ids and type.
    fn discover(&mut self) {
        self.bench.hear(TESTER, &heartbeat(0, 0));
        self.next_beat = self.bench.now + Duration::from_secs(1);
        for _ in 0..50 {
            self.sleep(100);
            if self.beat.is_some() {
                break;
            }
        }
        assert!(self.beat.take().is_some(), "no system within 5 s");
        self.sleep(300);
        self.beat = None;

        self.bench.hear(TESTER, &request(message::GIMBAL_DEVICE_INFORMATION, 33, 0));
        self.sleep(10);
        let answer = self.answer.take().expect("an answer");
        assert_eq!((answer.command, answer.result), (512, 0));
        assert_eq!((answer.target_system, answer.target_component), (33, 1));
        assert!(self.information.is_some(), "it says what it is");

        self.status = None;
        self.aim(LEVEL, 0.0, 0.0, [NAN; 3]);
        self.next_setpoint = Some(self.bench.now);
        self.sleep(100);
        let is_ahead = |tester: &Self| tester.status.is_some() && tester.attitude().yaw.degrees().abs() < 1.0;
        let looks = (0..200).position(|_| {
            let ahead = is_ahead(self);
            if !ahead {
                self.sleep(100);
            }
            ahead
        });
        assert!(looks.is_some(), "yaw does not get to 0° within 20 s");

        let status = self.status.as_ref().expect("it came");
        let is_for_all = (status.target_system, status.target_component) == (0, 0);
        let is_gimbal = [154, 171, 172, 173, 174, 175].contains(&self.bench.device.id().component);
        let has_type = self.beat.as_ref().is_some_and(|beat| beat.mavtype == 26);
        self.step("ids and type", is_for_all && is_gimbal && has_type);
    }

    fn limits(&self) -> (f64, f64, f64, f64) {
        let information = self.information.as_ref().expect("it was asked for");
        let or = |limit: f32, other: f64| {
            if limit.is_infinite() { other } else { f64::from(limit).to_degrees() }
        };
        (
            or(information.pitch_min, -90.0),
            or(information.pitch_max, 20.0),
            or(information.yaw_min, -WITHIN_NO_LIMITS),
            or(information.yaw_max, WITHIN_NO_LIMITS),
        )
    }

    /// Pitch and yaw are where they should be 5 s after they were set.
    fn angle(&mut self, name: impl Into<String>, flags: GimbalFlags, pitch: f64, yaw: f64) {
        self.aim(flags, pitch, yaw, [NAN; 3]);
        self.sleep(5000);
        let follows = !flags.contains(GimbalFlags::YAW_LOCK);
        let wanted = if follows { yaw + self.vehicle_yaw } else { yaw };
        let at = self.attitude();
        let near = |is: Angle, wanted: f64| (is.degrees() - wanted).abs() <= TOLERANCE;
        self.step(name, pitch.abs() >= STEEP || (near(at.pitch, pitch) && near(at.yaw, wanted)));
    }

    fn tilt(&mut self) {
        let (pitch_min, pitch_max, ..) = self.limits();
        for (name, pitch) in [
            ("look ahead", 0.0),
            ("tilt 45° down", -45.0),
            ("tilt down to the limit", pitch_min),
            ("tilt up to the limit", pitch_max),
            ("look ahead again", 0.0),
        ] {
            self.angle(name, LEVEL, pitch, 0.0);
        }
    }

    /// To either side, level and tilted, as far as the limits less `margin` allow.
    fn pan(&mut self, mode: &str, flags: GimbalFlags, margin: f64) {
        let (_, _, yaw_min, yaw_max) = self.limits();
        let infinite = self.information.as_ref().is_some_and(|information| information.yaw_min.is_infinite());
        let margin = if infinite { 0.0 } else { margin };
        let (left, right) = (yaw_min + margin, yaw_max - margin);
        for (name, pitch, yaw) in [
            ("pan right", 0.0, right),
            ("pan left", 0.0, left),
            ("tilt 45° down", -45.0, 0.0),
            ("tilted, pan right", -45.0, right),
            ("tilted, pan left", -45.0, left),
            ("look ahead again", 0.0, 0.0),
        ] {
            self.angle(format!("{mode}: {name}"), flags, pitch, yaw);
        }
    }

    fn follow(&mut self) {
        self.angle("follow: switch", LEVEL, 0.0, 0.0);
        self.pan("follow", LEVEL, 0.0);
    }

    /// The vehicle turns 30° to the left, all at once, and stays there for the rest of the test.
    fn lock(&mut self) {
        self.angle("lock: switch", LOCKED, 0.0, 0.0);
        self.vehicle_yaw = -30.0;
        self.sleep(2000);
        self.pan("lock", LOCKED, 30.0);
    }

    /// Both axes have turned as far as their rates say, in degrees per second.
    fn rate(&mut self, name: &str, pitch: f32, yaw: f32, millis: u64) {
        let before = self.attitude();
        self.set(rates_only(LEVEL, [0.0, pitch, yaw]));
        self.sleep(millis);
        let after = self.attitude();
        let seconds = millis as f64 / 1000.0;
        let turned = |before: Angle, after: Angle, rate: f32| {
            (after.degrees() - before.degrees() - f64::from(rate) * seconds).abs() <= TOLERANCE
        };
        self.step(name, turned(before.pitch, after.pitch, pitch) && turned(before.yaw, after.yaw, yaw));
    }

    fn stop_rate(&mut self) {
        self.set(rates_only(LEVEL, [0.0; 3]));
        self.sleep(500);
    }

    fn pitch_rates(&mut self) {
        self.angle("pitch rate: look ahead first", LEVEL, 0.0, 0.0);
        self.rate("tilt down with 10°/s", -10.0, 0.0, 5000);
        self.stop_rate();
        self.rate("tilt back up with 20°/s", 20.0, 0.0, 2500);
        self.angle("pitch rate: look ahead again", LEVEL, 0.0, 0.0);
    }

    fn yaw_rates(&mut self) {
        self.angle("yaw rate: look ahead first", LEVEL, 0.0, 0.0);
        self.rate("pan right with 5°/s", 0.0, 5.0, 5000);
        self.stop_rate();
        self.rate("pan left with 10°/s", 0.0, -10.0, 5000);
        self.angle("yaw rate: look ahead again", LEVEL, 0.0, 0.0);
    }

    /// The rate is the speed to the angle: half-way after half the time, there after all of it.
    fn angle_at_rate(&mut self, name: &str, pitch: f64, rate: f64, millis: u64) {
        let before = self.attitude().pitch.degrees();
        self.aim(LEVEL, pitch, 0.0, [0.0, rate as f32, 0.0]);
        let mut near = [false; 2];
        for (half, near) in near.iter_mut().enumerate() {
            self.sleep(millis / 2 + half as u64);
            let wanted = before + rate * (half as f64 + 1.0) * millis as f64 / 2000.0;
            *near = (self.attitude().pitch.degrees() - wanted).abs() <= TOLERANCE;
        }
        self.step(format!("{name}, half-way"), near[0]);
        self.step(format!("{name}, at the end"), near[1]);
    }

    fn angle_and_rate(&mut self) {
        self.angle("angle and rate: look ahead first", LEVEL, 0.0, 0.0);
        self.angle_at_rate("tilt 20° down with 10°/s", -20.0, -10.0, 2000);
        self.stop_rate();
        // The tester divides the angle by the rate, so the way back to zero takes no time: what it then looks at is
        // that the camera has not moved more than the tolerance allows.
        self.angle_at_rate("tilt back up with 5°/s", 0.0, 5.0, 0);
        self.angle("angle and rate: look ahead again", LEVEL, 0.0, 0.0);
    }
}

/// 286 as the tester fills it in: known zeros, and NaN for the turn that it does not tell.
fn autopilot_state(heading: f64) -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        q: Attitude::<EarthFrame>::from_aircraft_angles(AircraftAngles {
            yaw: Angle::from_degrees(heading),
            ..AircraftAngles::default()
        })
        .to_wxyz(),
        vx: 0.0,
        vy: 0.0,
        vz: 0.0,
        feed_forward_angular_velocity_z: 0.0,
        estimator_status: 0b11_0111_1111,
        angular_velocity_z: NAN,
        ..state(heading)
    }
}
