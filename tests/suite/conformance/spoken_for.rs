//! Client checklist section E by its letter: the manager is component 154, its gimbal is no v2 device and has id 1.
//!
//! The gimbal is a simulated v1 one; what a client sees must not tell it from any other.

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::geometry::Angle;
use gimbald::gimbals::mavlink_v1::sim::{Device, DeviceSettings, Feedback};
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::sim::plant::PlantSettings;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA,
    MavMessage,
};

use crate::support::script::{
    ACCEPTED, DENIED, NAN, ack, command_int, command_long, ground_heartbeat, ids, of, request_message, set_interval,
};
use crate::support::world::{Arrival, GCS, Places, World, three_links};

/// M of the checklist.
const M: MavId = MavId::new(1, 154);
/// The gimbal's own component, which clients need not know.
const DEVICE: u8 = 171;
const SECOND: Duration = Duration::from_secs(1);

/// A flying vehicle and a v1 gimbal that is known, and a ground station that was heard.
fn with_v1_gimbal(reports: Feedback) -> (World, Places) {
    let gimbal = GimbalSettings {
        family: Family::MavlinkV1,
        manager_component_id: Some(M.component),
        ..GimbalSettings::found("camera".to_owned())
    };
    let (mut world, places) = World::empty(Settings { gimbals: vec![gimbal], ..three_links() });
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    let plant = PlantSettings { noise: Angle::ZERO, ..DeviceSettings::default().plant };
    let settings = DeviceSettings { component_id: DEVICE, feedback: reports, plant, ..DeviceSettings::default() };
    world.install(places.gimbal, Device::new(Timestamp::ZERO, settings));
    run(&mut world, places, 6 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].state, "alive");
    world.forget();
    (world, places)
}

fn run(world: &mut World, places: Places, duration: Duration) {
    world.run_with(duration, &[(SECOND, places.ground, GCS, ground_heartbeat())]);
}

fn from_m(arrivals: &[Arrival]) -> Vec<Arrival> {
    arrivals.iter().filter(|arrival| arrival.source() == M).cloned().collect()
}

/// The latest 285 of M that reached the ground station.
fn latest_status(world: &mut World, places: Places) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
    let heard = from_m(&world.take(places.ground));
    of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard).pop().expect("285 is streamed")
}

/// Pitch and yaw from the nose, degrees.
fn looks(world: &mut World, places: Places) -> (f64, f64) {
    crate::support::script::pitch_yaw_deg(latest_status(world, places).q)
}

fn assert_near(looks: (f64, f64), wanted: (f64, f64), tolerance: f64) {
    let off = (looks.0 - wanted.0).abs().max((looks.1 - wanted.1).abs());
    assert!(off <= tolerance, "{looks:?} instead of {wanted:?}");
}

/// Client checklist E4: "HEARTBEAT fields: type 26, autopilot 8, base_mode 0, custom_mode 0, mavlink_version 3."
/// Client checklist E6: "Default M is one of 154, 171–175", here by configuration.
#[test]
fn client_items_e4_and_e6_the_manager_is_a_gimbal_to_clients() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);

    run(&mut world, places, 3 * SECOND);

    let heard = from_m(&world.take(places.ground));
    let beats: Vec<HEARTBEAT_DATA> = of(&heard);
    assert_eq!(beats.len(), 3);
    for beat in beats {
        let HEARTBEAT_DATA { custom_mode, mavtype, autopilot, base_mode, system_status, mavlink_version } = beat;
        assert_eq!((mavtype, autopilot, base_mode, custom_mode, system_status, mavlink_version), (26, 8, 0, 0, 4, 3));
    }
}

/// Client checklist E7: "512/p1=280 to M: ACCEPTED then 280."
/// Client checklist E18: "512/p1=283 to M (device in the same component): ACCEPTED, then 283 with gimbal_device_id = D
/// (1–6)."
/// Client checklist E21: "512/p1=283 with zero params to 154 while it is M: answered; to 171–175 while they are nobody:
/// total silence." Here 171 is the gimbal itself, which is no v2 device and answers for itself.
/// Client checklist E22: "512/p1=283 to system 0, component 0: 283 sent; not more than one ACK per component of ours."
#[test]
fn client_items_e7_e18_e21_and_e22_the_manager_answers_for_its_gimbal() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    for target in [M, MavId::new(1, 0), MavId::new(0, 0)] {
        let answers = from_m(&world.ask(places.ground, GCS, &request_message(target, 280)));
        assert_eq!(ids(&answers), [77, 280]);
        let information: GIMBAL_MANAGER_INFORMATION_DATA = answers[1].decode();
        assert_eq!(information.gimbal_device_id, 1);
        assert_eq!(information.cap_flags & 0x2_0000, 0x2_0000, "a place can be pointed at");

        let answers = from_m(&world.ask(places.ground, GCS, &request_message(target, 283)));
        assert_eq!(ids(&answers), [77, 283]);
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, 512, ACCEPTED)]);
        let information: GIMBAL_DEVICE_INFORMATION_DATA = answers[1].decode();
        assert_eq!((information.gimbal_device_id, information.cap_flags & 0x120), (1, 0x120));
    }
    let others = world.ask(places.ground, GCS, &request_message(MavId::new(1, 172), 283));
    assert_eq!(others, []);
}

/// Client checklist E15: "280, 281 never carry gimbal_device_id 0; both carry the same id for the same gimbal."
/// Client checklist E41: "285 flows at ≥ 4 Hz (target 10 Hz)", by the manager, in place of a v2 device.
/// Client checklist E42: "285's gimbal_device_id: D when the source is M; never > 6."
/// Client checklist E43: "285 has target 0/0." E44: "285 has exactly one of bits 32 and 64 set."
/// Client checklist E45: "delta_yaw is NaN while no autopilot heading is known; else the heading in radians."
/// Client checklist E53: "285's time_boot_ms increases."
#[test]
fn client_items_e15_e41_to_e45_and_e53_the_manager_streams_what_its_gimbal_says() {
    for reports in [Feedback::Orientation, Feedback::Status, Feedback::Nothing] {
        let (mut world, places) = with_v1_gimbal(reports);

        run(&mut world, places, 2 * SECOND);

        let heard = from_m(&world.take(places.ground));
        let statuses: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&heard);
        assert_eq!(statuses.len(), 20, "{reports:?}");
        let snapshot = world.snapshot();
        assert_eq!(snapshot.gimbals[0].attitude.assumed, reports == Feedback::Nothing, "{reports:?}");
        let heading = snapshot.vehicle.heading_deg.expect("it flies").to_radians();
        let last = statuses.last().expect("there are twenty");
        assert!((f64::from(last.delta_yaw) - heading).sin().abs() < 0.05, "{} and {heading}", last.delta_yaw);
        for status in &statuses {
            assert_eq!((status.gimbal_device_id, status.target_system, status.target_component), (1, 0, 0));
            assert_eq!(status.flags & 0x60, 0x20, "in the vehicle frame");
            assert_eq!(status.failure_flags, 0);
        }
        assert!(statuses.windows(2).all(|pair| pair[1].time_boot_ms > pair[0].time_boot_ms));
        let managed: Vec<u8> =
            of::<GIMBAL_MANAGER_STATUS_DATA>(&heard).iter().map(|status| status.gimbal_device_id).collect();
        assert_eq!(managed, [1; 10]);
        assert!(world.take(places.gimbal).iter().all(|at| at.id() != 285 && at.id() != 283), "it knows where it looks");
    }
}

/// Client checklist E38: "511 for 285 with p2 = 0, to M (id ≤ 6): ACCEPTED; 285 streams at the default."
#[test]
fn client_item_e38_the_stream_of_285_is_set_at_the_manager() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    for (interval, expected) in [(500_000.0, 4), (-1.0, 0), (0.0, 20)] {
        assert_eq!(world.result_of(places.ground, GCS, &set_interval(M, 285, interval)), Some(ACCEPTED));
        world.forget();
        run(&mut world, places, 2 * SECOND);
        let heard = from_m(&world.take(places.ground));
        assert_eq!(of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard).len(), expected, "{interval}");
    }
}

/// Client checklist E54: "1001 with 255,190,−1,−1,NaN,NaN,1: ACCEPTED; 281 has primary 255/190."
/// Client checklist E66: "1001 for an unknown device id: DENIED." The gimbal's component id is no device id here.
/// Client checklist E75: "1000: −90, 0, NaN, NaN, 44, 0, 1: pitch −90, vehicle yaw 0."
#[test]
fn client_items_e54_e66_and_e75_control_and_angles_by_the_id_of_the_gimbal() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    let take = |gimbal: f32| command_long(M, 1001, &[255.0, 190.0, -1.0, -1.0, NAN, NAN, gimbal]);
    assert_eq!(world.result_of(places.ground, GCS, &take(f32::from(DEVICE))), Some(DENIED));
    assert_eq!(world.result_of(places.ground, GCS, &take(154.0)), Some(DENIED));
    assert_eq!(world.result_of(places.ground, GCS, &take(1.0)), Some(ACCEPTED));
    assert_eq!(world.snapshot().gimbals[0].primary, Some(GCS.to_string()));

    let tilt = command_long(M, 1000, &[-90.0, 0.0, NAN, NAN, 44.0, 0.0, 1.0]);
    world.forget();
    assert_eq!(world.result_of(places.ground, GCS, &tilt), Some(ACCEPTED));
    let told: Vec<COMMAND_LONG_DATA> = of(&from_m(&world.take(places.gimbal)));
    assert_eq!(told.len(), 1, "once, at once");
    assert_eq!((told[0].command, told[0].param1, told[0].param3, told[0].param7), (205, -90.0, 0.0, 2.0));
    run(&mut world, places, 4 * SECOND);
    assert_near(looks(&mut world, places), (-90.0, 0.0), 0.5);
}

/// Client checklist E48: "The YAW_LOCK bit in 285 is set within 500 ms of a lock command and cleared within 500 ms of a
/// follow command."
/// Client checklist E76, E77: flags 92 and 28 are yaw from North.
/// Gimbal statement 35: "Earth yaw … follows the heading without a new client command."
#[test]
fn client_items_e48_e76_and_e77_yaw_from_north_is_turned_for_the_gimbal() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    for (flags, locked) in [(92.0, true), (44.0, false), (28.0, true)] {
        let heading = world.snapshot().vehicle.heading_deg.expect("it flies");
        let yaw = if locked { (heading + 30.0) as f32 } else { 30.0 };
        let point = command_long(M, 1000, &[-20.0, yaw, NAN, NAN, flags, 0.0, 1.0]);
        assert_eq!(world.result_of(places.ground, GCS, &point), Some(ACCEPTED));
        run(&mut world, places, SECOND / 2);
        assert_eq!(latest_status(&mut world, places).flags & 16 != 0, locked, "flags {flags}");

        run(&mut world, places, 5 * SECOND);

        let heading_now = world.snapshot().vehicle.heading_deg.expect("it flies");
        let turned = Angle::from_degrees(heading_now - heading).wrapped().degrees();
        assert!(turned.abs() > 5.0, "the vehicle turns");
        let expected = if locked { 30.0 - turned } else { 30.0 };
        // It has no rates to lead by, so it lags while the vehicle turns: 7 degrees a second and a third of one.
        assert_near(looks(&mut world, places), (-20.0, expected), 2.5);
    }
}

/// Client checklist E97: "COMMAND_INT 1000, x = 12, y = 0, z = 1, p3 = −10: pitch turns at −10 °/s."
/// Client checklist E102: "Stream ends without a zero: rates stop within the dead-man time and 285 shows standstill."
/// Gimbal statement 37: "v2 rate on a rate-less v1 gimbal is integrated, clamped at the limits, and stops" after
/// `rate_timeout_s`.
#[test]
fn client_items_e97_and_e102_a_gimbal_without_rates_is_turned_by_angles() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    let turn = command_int(M, 1000, [NAN, NAN, -10.0, 0.0], 12, 0, 1.0);
    assert_eq!(world.result_of(places.ground, GCS, &turn), Some(ACCEPTED));
    run(&mut world, places, 2 * SECOND);
    let (pitch, _) = looks(&mut world, places);
    assert!((-21.0..-16.0).contains(&pitch), "{pitch}");
    let stop = command_int(M, 1000, [NAN, NAN, 0.0, 0.0], 12, 0, 1.0);
    assert_eq!(world.result_of(places.ground, GCS, &stop), Some(ACCEPTED));
    run(&mut world, places, SECOND);
    let (stopped, _) = looks(&mut world, places);

    // Streamed once, and not again.
    let streamed = MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 12,
        pitch: NAN,
        yaw: NAN,
        pitch_rate: 10_f32.to_radians(),
        yaw_rate: 0.0,
        target_system: M.system,
        target_component: M.component,
        gimbal_device_id: 1,
    });
    world.send(places.ground, GCS, &streamed);
    run(&mut world, places, 6 * SECOND);
    let (pitch, _) = looks(&mut world, places);
    assert!((pitch - stopped - 20.0).abs() < 2.0, "{stopped} to {pitch} in the two seconds that a rate lasts");

    // To the limit, and not beyond.
    let up = command_long(M, 1000, &[NAN, NAN, -60.0, 0.0, 12.0, 0.0, 1.0]);
    for _ in 0..4 {
        assert_eq!(world.result_of(places.ground, GCS, &up), Some(ACCEPTED));
        run(&mut world, places, SECOND);
    }
    assert_near(looks(&mut world, places), (-90.0, 0.0), 0.5);
}

/// Client checklist E49: "RETRACT bit in 285 while retracted; cleared by the next angle command."
#[test]
fn client_item_e49_a_retracted_gimbal_says_so() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    for (pitch, flags, retracted) in [(NAN, 1.0, true), (-10.0, 44.0, false)] {
        let command = command_long(M, 1000, &[pitch, 0.0, NAN, NAN, flags, 0.0, 1.0]);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        run(&mut world, places, SECOND);
        assert_eq!(latest_status(&mut world, places).flags & 1 != 0, retracted);
    }
}

/// Client checklist E109: "COMMAND_INT 195 frame 3, p1 = 1 to M: ACCEPTED", and the gimbal looks down at the place below.
#[test]
fn client_item_e109_a_v1_gimbal_looks_at_a_place() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    let vehicle = world.snapshot().vehicle;
    let degrees = |value: Option<f64>| (value.expect("it flies") * 1e7).round() as i32;
    let below =
        command_int(M, 195, [1.0, NAN, NAN, NAN], degrees(vehicle.latitude_deg), degrees(vehicle.longitude_deg), 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &below), Some(ACCEPTED));

    run(&mut world, places, 4 * SECOND);

    let (pitch, _) = looks(&mut world, places);
    assert!(pitch < -30.0, "{pitch}");
}

/// "Loss of gimbal … raises COMMS_ERROR in 285 and clears within 1 s of return" (gimbal statement 97), and nothing is
/// frozen in silence: 281 and 285 go on.
#[test]
fn a_lost_gimbal_is_told_with_comms_error() {
    let (mut world, places) = with_v1_gimbal(Feedback::Orientation);
    world.unplug(places.gimbal);
    run(&mut world, places, SECOND);
    assert_eq!(latest_status(&mut world, places).failure_flags, 128);
    world.plug_in(places.gimbal);
    run(&mut world, places, SECOND + SECOND / 5);
    assert_eq!(latest_status(&mut world, places).failure_flags, 0);
}
