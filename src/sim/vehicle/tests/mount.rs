//! The mount of a simulated ArduPilot against what was observed of ArduCopter 4.7-dev with `MNT1_TYPE` 6.

use super::*;

const DEVICE: MavId = MavId::new(1, 154);

fn heartbeat(mavtype: u8) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype, autopilot: 8, base_mode: 0, system_status: 4, mavlink_version: 3 }
}

fn information() -> GIMBAL_DEVICE_INFORMATION_DATA {
    GIMBAL_DEVICE_INFORMATION_DATA {
        uid: 1,
        time_boot_ms: 1,
        firmware_version: 0x0002_0107,
        hardware_version: 0,
        roll_min: 0.0,
        roll_max: 0.0,
        pitch_min: -1.5,
        pitch_max: 0.5,
        yaw_min: -2.0,
        yaw_max: 2.0,
        custom_cap_flags: 0,
        cap_flags: 0,
        vendor_name: CharArray::from("Acme"),
        model_name: CharArray::from("Pan"),
        custom_name: CharArray::from(""),
        gimbal_device_id: 0,
        cap_flags2: 0,
    }
}

/// With a mount, so long after its start.
fn started(uptime_s: u64) -> Flight {
    let settings = VehicleSettings {
        autopilot: ARDUPILOT,
        gimbal_output: GimbalOutput::Device,
        uptime: Duration::from_secs(uptime_s),
        ..VehicleSettings::default()
    };
    Flight::with(settings)
}

/// With a gimbal that it drives.
fn driving() -> Flight {
    let mut flight = started(10);
    flight.hear(DEVICE, &heartbeat(26));
    flight.hear(DEVICE, &information());
    flight
}

/// What the gimbal is told next: q where it is one, rates about right and down, flags.
fn told(flight: &mut Flight) -> (Option<(i32, i32)>, [f32; 2], u16) {
    flight.sent.clear();
    flight.run_for(20);
    let (_, told) = flight.all::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>().pop().expect("fifty a second");
    assert_eq!((told.target_system, told.target_component), (1, 154));
    let attitude: Option<Attitude<EarthFrame>> = Attitude::from_wxyz(told.q).expect("well formed");
    let angles = attitude.map(|attitude| attitude.gimbal_angles());
    let rounded = |angle: crate::geometry::Angle| angle.degrees().round() as i32;
    let angles = angles.map(|angles| (rounded(angles.pitch), rounded(angles.yaw)));
    (angles, [told.angular_velocity_y, told.angular_velocity_z], told.flags)
}

/// "Waits for HEARTBEAT type 26 from comp 154. Then COMMAND_LONG REQUEST_MESSAGE(512) param1=283, target 1/154, at most
/// once a second; after 283: STATUSTEXT, and at once 286 and 284 at 50 Hz." "It kept sending."
#[test]
fn it_finds_its_gimbal() {
    let mut flight = started(10);
    flight.hear(DEVICE, &heartbeat(30));
    flight.hear(MavId::new(1, 171), &heartbeat(26));
    flight.run_for(5000);
    assert_eq!((flight.all::<COMMAND_LONG_DATA>(), flight.count(284), flight.count(286)), (vec![], 0, 0));

    flight.hear(DEVICE, &heartbeat(26));
    flight.run_for(3500);
    let asked: Vec<_> = flight.all::<COMMAND_LONG_DATA>().into_iter().map(|(_, asked)| asked).collect();
    let request = COMMAND_LONG_DATA { target_component: 154, ..long(512, [283.0, 0.0, 0.0]) };
    assert_eq!(asked, vec![request; 4]);
    assert_eq!(flight.count(284), 0);

    flight.hear(DEVICE, &information());
    flight.sent.clear();
    flight.run_for(2000);
    assert_eq!((flight.count(284), flight.count(286), flight.all::<COMMAND_LONG_DATA>()), (100, 100, vec![]));
    let (angles, rates, flags) = told(&mut flight);
    assert_eq!((angles, rates.map(f32::is_nan), flags), (Some((-30, 0)), [true; 2], 0));
}

/// "It looks for a gimbal after 10 s from boot, and stops looking 60 s after boot once armed."
#[test]
fn it_looks_for_a_gimbal_for_a_minute() {
    for (uptime, found) in [(0, false), (10, true), (59, true), (61, false)] {
        let mut flight = started(uptime);
        flight.hear(DEVICE, &heartbeat(26));
        flight.run_for(1000);
        assert_eq!(!flight.all::<COMMAND_LONG_DATA>().is_empty(), found, "after {uptime} s");
    }
    let mut flight = started(61);
    flight.ask(&long(400, [0.0; 3]));
    flight.hear(DEVICE, &heartbeat(26));
    flight.run_for(1000);
    assert!(!flight.all::<COMMAND_LONG_DATA>().is_empty(), "as long as it is not armed");
}

/// "Control (observed at the device, Gremsy)", and what a request for each message is answered.
/// Gimbal statement 48: "ArduPilot-as-manager: command 1000 with only pitch finite is reported FAILED by the ArduPilot
/// emulation."
#[test]
#[rustfmt::skip]
fn it_obeys_as_observed() {
    const NAN: f32 = f32::NAN;
    let mut flight = driving();
    let pitchyaw = |p: [f32; 5]| {
        let [param1, param2, param3, param4, param5] = p;
        COMMAND_LONG_DATA { param4, param5, ..long(1000, [param1, param2, param3]) }
    };
    let rate = 5.0_f32.to_radians();
    for (asked, result, expected) in [
        (pitchyaw([-20.0, NAN, NAN, NAN, 0.0]),                           4, (Some((-30, 0)), None, 0)),
        (pitchyaw([-30.0, 15.0, NAN, NAN, 0.0]),                          0, (Some((-30, 15)), None, 0)),
        (pitchyaw([-10.0, 20.0, NAN, NAN, 16.0]),                         0, (Some((-10, 20)), None, 28)),
        (pitchyaw([NAN, NAN, 5.0, -5.0, 16.0]),                           0, (None, Some([rate, -rate]), 28)),
        (COMMAND_LONG_DATA { param7: 2.0, ..long(205, [-45.0, 0.0, 30.0]) }, 0, (Some((-45, 30)), None, 0)),
        (long(197, [0.0; 3]),                                             0, (Some((-30, 0)), None, 0)),
        (long(512, [280.0, 0.0, 0.0]),                                    0, (Some((-30, 0)), None, 0)),
        (long(512, [283.0, 0.0, 0.0]),                                    4, (Some((-30, 0)), None, 0)),
        (long(512, [284.0, 0.0, 0.0]),                                    4, (Some((-30, 0)), None, 0)),
        (long(511, [281.0, 100_000.0, 0.0]),                              0, (Some((-30, 0)), None, 0)),
    ] {
        let answers = flight.ask(&asked);
        let acks: Vec<COMMAND_ACK_DATA> = answers.iter().filter_map(|bytes| read(bytes)).collect();
        assert_eq!((acks.len(), acks[0].result), (1, result), "{asked:?}");
        let (angles, rates, flags) = told(&mut flight);
        let rates = Some(rates).filter(|rates| rates.iter().all(|rate| rate.is_finite()));
        assert_eq!((angles, rates, flags), expected, "{asked:?}");
    }
    // Refused in words, as every message that it has no stream for.
    assert_eq!(names(&flight.ask(&long(511, [284.0, 100_000.0, 0.0]))), ["STATUSTEXT", "COMMAND_ACK"]);
    let interval = flight.ask(&long(511, [284.0, 100_000.0, 0.0]));
    assert_eq!(interval.iter().find_map(|bytes| read::<COMMAND_ACK_DATA>(bytes)).map(|ack| ack.result), Some(2));
}

/// "280, 281 and its own 285 are never streamed unasked; 281 is broadcast once when the owner changes. `gimbal_device_id` is
/// 1, never 154." "Ownership is recorded, never enforced."
#[test]
fn it_is_a_manager_of_its_own() {
    let mut flight = driving();
    flight.hear(DEVICE, &attitude());
    flight.sent.clear();
    flight.run_for(3000);
    assert_eq!([280, 281, 285].map(|id| flight.count(id)), [0; 3]);

    flight.hear(GCS, &COMMAND_LONG_DATA { param1: 12.0, param2: 34.0, ..long(1001, [0.0; 3]) });
    let owners = flight.all::<GIMBAL_MANAGER_STATUS_DATA>();
    let owner = owners.iter().map(|(_, status)| (status.gimbal_device_id, status.primary_control_sysid));
    assert_eq!(owner.collect::<Vec<_>>(), [(1, 12)]);
    let demand = GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 0,
        pitch: -0.5,
        yaw: 0.0,
        pitch_rate: f32::NAN,
        yaw_rate: f32::NAN,
        target_system: 1,
        target_component: 1,
        gimbal_device_id: 0,
    };
    flight.hear(GCS, &demand);
    assert_eq!(told(&mut flight).0, Some((-29, 0)));

    flight.sent.clear();
    for id in [280.0, 285.0] {
        flight.hear(GCS, &long(512, [id, 0.0, 0.0]));
    }
    let information = flight.all::<GIMBAL_MANAGER_INFORMATION_DATA>();
    assert_eq!(information.iter().map(|(_, it)| (it.gimbal_device_id, it.pitch_min)).collect::<Vec<_>>(), [(1, -1.5)]);
    let told = flight.all::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
    assert_eq!(told.len(), 1);
    assert_eq!((told[0].1.gimbal_device_id, told[0].1.flags, told[0].1.q), (1, 44, attitude().q));
    assert!(told[0].1.delta_yaw.is_nan() && told[0].1.angular_velocity_x.is_nan());
}

fn attitude() -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        time_boot_ms: 1,
        q: [0.5, 0.5, 0.5, 0.5],
        angular_velocity_x: 0.0,
        angular_velocity_y: 0.0,
        angular_velocity_z: 0.0,
        failure_flags: 4,
        flags: 28,
        target_system: 0,
        target_component: 0,
        delta_yaw: 1.0,
        delta_yaw_velocity: 0.0,
        gimbal_device_id: 0,
    }
}
