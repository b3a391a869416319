//! What clients hear without asking, and how they change that (client checklist E34 to E53).
//!
//! 285 is the device's own: that it is right is shown with the simulated device, behind the core as a client hears it.

use std::time::Duration;

use gimbald::gimbals::mavlink_v2::sim::{self, Device, DeviceSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_ACK_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage,
};

use super::{COMPANION, SECOND, assert_near, run_looking, told_control, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, autopilot_state, configure, ids, pitch_yaw_deg, pitchyaw, px4_heartbeat, set_interval,
    take_control,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, Places, World, three_links};

type Status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA;

const NOBODY: MavId = MavId::new(0, 0);
const ROLL_PITCH_LOCK: u16 = 4 | 8;
const YAW_LOCK: u16 = 16;
const IN_VEHICLE_FRAME: u16 = 32;
const IN_EARTH_FRAME: u16 = 64;

/// Client checklist E34: "281 flows without having been asked for, ≥ 0.5 Hz, to every client heard (target 1–5 Hz)."
#[test]
fn client_item_e34_every_client_hears_the_status_unasked() {
    let (mut world, places) = with_gimbal();
    let second = world.open(2);
    run_looking(&mut world, places, Duration::from_secs(60), 0.0, 0.0);
    for place in [places.ground, second] {
        let times = times_of_status(&mut world, place);
        assert_eq!(times.len(), 300);
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] == Duration::from_millis(200)));
    }
}

/// Client checklist E35: "281 is sent within 200 ms of each change of owner, whatever the interval."
/// Client checklist E37: "511 for 281 with p2 = 5,000,000: ACCEPTED; 281 still comes at least every 5.5 s and on change."
#[test]
fn client_items_e35_and_e37_a_change_of_control_is_told_whatever_the_interval() {
    for (interval_us, regular) in [(0.0, 20), (5_000_000.0, 0), (60_000_000.0, 0), (-1.0, 0)] {
        let (mut world, places) = with_gimbal();
        run_looking(&mut world, places, SECOND, 0.0, 0.0);
        let asked = set_interval(MANAGER, 281, interval_us);
        assert_eq!(world.result_of(places.ground, GCS, &asked), Some(ACCEPTED));
        world.forget();
        run_looking(&mut world, places, Duration::from_secs(4), 0.0, 0.0);
        assert_eq!(times_of_status(&mut world, places.ground).len(), regular);

        for (sender, command, expected) in [
            (GCS, take_control(), (GCS, NOBODY)),
            (COMPANION, configure([-1.0, -1.0], [-2.0, -2.0]), (GCS, COMPANION)),
            (COMPANION, take_control(), (COMPANION, COMPANION)),
            (COMPANION, configure([-3.0, -3.0], [-3.0, -3.0]), (NOBODY, NOBODY)),
        ] {
            world.forget();
            world.send(places.ground, sender, &command);
            let heard = world.take(places.ground);
            assert_eq!(told_control(&heard), Some(expected), "at once, at {interval_us} µs");
            assert_eq!(heard.iter().filter(|arrival| arrival.id() == 281).count(), 1);
        }
    }

    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &set_interval(MANAGER, 281, 5_000_000.0));
    world.forget();
    run_looking(&mut world, places, Duration::from_secs(60), 0.0, 0.0);
    let times = times_of_status(&mut world, places.ground);
    assert!(times.len() >= 11 && times.windows(2).all(|pair| pair[1] - pair[0] <= Duration::from_millis(5_500)));
}

/// Client checklist E36: "511 for 281 with p2 = 0: ACCEPTED; rate afterwards is the default, not zero."
/// Client checklist E39: "511 with p2 = −1 stops; p2 < −1 refused with DENIED; for an unknown message UNSUPPORTED" — here
/// DENIED, as for 512.
/// Client checklist E40: "Repeated 511 (6 within 6 s) has no harmful effect and each gets its ACK."
#[test]
fn client_items_e36_e39_and_e40_the_interval_is_the_clients_choice() {
    let (mut world, places) = with_gimbal();
    for (message_id, interval_us, result, in_six_seconds) in [
        (281, 0.0, ACCEPTED, 30),
        (281, 2_000_000.0, ACCEPTED, 3),
        (281, -2.0, DENIED, 3),
        (281, f32::INFINITY, DENIED, 3),
        (281, -1.0, ACCEPTED, 0),
        (281, -100_000.0, DENIED, 0),
        (281, 0.0, ACCEPTED, 30),
        (285, 100_000.0, DENIED, 30),
        (30, 100_000.0, DENIED, 30),
        (9_999_999, 0.0, DENIED, 30),
    ] {
        let asked = set_interval(MANAGER, message_id, interval_us);
        assert_eq!(world.result_of(places.ground, GCS, &asked), Some(result), "{message_id}: {interval_us}");
        world.forget();
        run_looking(&mut world, places, Duration::from_secs(6), 0.0, 0.0);
        let told = times_of_status(&mut world, places.ground).len();
        assert_eq!(told, in_six_seconds, "{message_id}: {interval_us}");
    }
    for (interval_us, in_six_seconds) in [(0.0, 30), (5_000_000.0, 1), (500_000.0, 12)] {
        let mut told = 0;
        for _ in 0..6 {
            let asked = set_interval(MANAGER, 281, interval_us);
            assert_eq!(world.result_of(places.ground, GCS, &asked), Some(ACCEPTED));
            run_looking(&mut world, places, SECOND, 0.0, 0.0);
            told += times_of_status(&mut world, places.ground).len();
        }
        assert_eq!(told, in_six_seconds, "asked six times for {interval_us} µs");
    }
}

/// Client checklist E38: "511 for 285 with p2 = 0, to M (id ≤ 6) or to the device component: ACCEPTED; 285 streams at the
/// default." To the device it is the device's to answer; a manager whose device is a component of its own has no 285.
#[test]
fn client_item_e38_the_interval_of_the_attitude_is_the_devices_business() {
    let (mut world, places) = flying();
    assert_eq!(world.result_of(places.ground, GCS, &set_interval(MANAGER, 285, 0.0)), Some(DENIED));

    let answers = world.ask(places.ground, GCS, &set_interval(GIMBAL, 285, 0.0));

    let acks: Vec<&Arrival> = answers.iter().filter(|answer| answer.id() == 77).collect();
    assert_eq!(acks.iter().map(|ack| ack.source()).collect::<Vec<_>>(), [GIMBAL], "{:?}", ids(&answers));
    let ack: COMMAND_ACK_DATA = acks[0].decode();
    assert_eq!((ack.command, ack.result, ack.target_system, ack.target_component), (511, ACCEPTED, 255, 190));
    assert!(statuses(&mut world, places, Duration::from_secs(5)).len() >= 20);
}

/// Client checklist E41: "285 flows at ≥ 4 Hz (target 10 Hz), source = device component."
/// Client checklist E42: "285's gimbal_device_id: … 0 when the source is a device component."
/// Client checklist E43: "285 has target 0/0."
/// Client checklist E44: "285 has exactly one of bits 32 and 64 set."
/// Client checklist E51: "No gap > 2 s in 285 while the device is alive."
/// Client checklist E53: "285's time_boot_ms increases."
#[test]
fn client_items_e41_to_e44_e51_and_e53_the_attitude_arrives_as_it_should() {
    let (mut world, places) = flying();
    world.run_for(Duration::from_secs(60));
    let heard: Vec<Arrival> = world.take(places.ground).into_iter().filter(|arrival| arrival.id() == 285).collect();

    assert!(heard.len() >= 240, "{} in a minute", heard.len());
    assert!(heard.iter().all(|arrival| arrival.source() == GIMBAL));
    assert!(heard.windows(2).all(|pair| pair[1].at - pair[0].at < Duration::from_millis(500)));
    let statuses: Vec<Status> = heard.iter().map(Arrival::decode).collect();
    for status in &statuses {
        let frame_bits = status.flags & (IN_VEHICLE_FRAME | IN_EARTH_FRAME);
        assert!(frame_bits == IN_VEHICLE_FRAME || frame_bits == IN_EARTH_FRAME, "{}", status.flags);
        assert_eq!((status.target_system, status.target_component, status.gimbal_device_id), (0, 0, 0));
    }
    assert!(statuses.windows(2).all(|pair| pair[1].time_boot_ms > pair[0].time_boot_ms));
    // What the gimbal said is what the ground heard.
    world.forget();
    let sent = device_frame();
    world.send_bytes(places.gimbal, &sent);
    assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == sent));
}

/// Client checklist E45: "delta_yaw is NaN while no autopilot heading is known or it is older than its limit; else the
/// heading in radians, −π..π."
#[test]
fn client_item_e45_the_gimbals_heading_is_the_vehicles_or_unknown() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    let alone = statuses(&mut world, places, Duration::from_secs(6));
    assert!(alone.len() > 5 && alone.iter().all(|status| status.delta_yaw.is_nan()));

    let told = heading(&mut world, places, -100.0, Duration::from_secs(3));
    for status in &told[told.len() - 5..] {
        assert_near(f64::from(status.delta_yaw).to_degrees(), -100.0, 0.01);
    }

    world.run_for(Duration::from_secs(5));
    let forgotten = statuses(&mut world, places, Duration::from_secs(2));
    assert!(
        forgotten.len() > 5 && forgotten.iter().all(|status| status.delta_yaw.is_nan()),
        "nobody tells it any more"
    );
}

/// Client checklist E46: "vehicle-frame yaw reported + heading = earth-frame yaw commanded, ±1°, for headings 0, 90, 179,
/// −179."
#[test]
fn client_item_e46_yaw_and_heading_add_up_to_the_direction_asked_for() {
    for status_frame in [sim::StatusFrame::EarthWhenKnown, sim::StatusFrame::FollowsLock, sim::StatusFrame::Legacy] {
        for vehicle in [0.0, 90.0, 179.0, -179.0] {
            let (mut world, places) = World::empty(three_links());
            let settings = DeviceSettings { status_frame, ..DeviceSettings::default() };
            world.install(places.gimbal, Device::new(Timestamp::ZERO, settings));
            heading(&mut world, places, vehicle, Duration::from_secs(5));
            for wanted in [0.0, 100.0, 180.0, -60.0] {
                let command = pitchyaw(-20.0, wanted, NAN, NAN, 92.0);
                assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
                let heard = heading(&mut world, places, vehicle, Duration::from_secs(8));

                let status = heard.last().expect("it says where it looks");
                let (pitch, yaw) = pitch_yaw_deg(status.q);
                let in_earth = match status.flags & (IN_VEHICLE_FRAME | IN_EARTH_FRAME) {
                    IN_VEHICLE_FRAME => yaw + f64::from(status.delta_yaw).to_degrees(),
                    // Where no frame is named, the lock that was asked for means North.
                    0 if status.flags & YAW_LOCK == 0 => yaw + vehicle,
                    _ => yaw,
                };
                assert_near(turn(in_earth - f64::from(wanted)), 0.0, 1.0);
                assert_near(pitch, -20.0, 1.0);
                let shown = world.snapshot().gimbals[0].attitude.clone();
                let (by_nose, by_north) = (shown.yaw_vehicle_deg.unwrap(), shown.yaw_earth_deg.unwrap());
                assert_near(turn(by_north - f64::from(wanted)), 0.0, 1.0);
                assert_near(turn(by_nose + vehicle - f64::from(wanted)), 0.0, 1.0);
            }
        }
    }
}

/// Client checklist E47: "At pitch −90 exactly the quaternion is unit and yaw does not jump by more than 5° between frames
/// of a still gimbal."
#[test]
fn client_item_e47_straight_down_the_attitude_is_steady() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    heading(&mut world, places, 30.0, Duration::from_secs(5));
    for (yaw, flags) in [(0.0, 44.0), (70.0, 44.0), (-120.0, 92.0)] {
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-90.0, yaw, NAN, NAN, flags)), Some(ACCEPTED));
        heading(&mut world, places, 30.0, Duration::from_secs(8));

        let still = heading(&mut world, places, 30.0, Duration::from_secs(5));

        assert!(still.len() > 20);
        let yaws: Vec<f64> = still.iter().map(|status| pitch_yaw_deg(status.q).1).collect();
        assert!(yaws.windows(2).all(|pair| turn(pair[1] - pair[0]).abs() < 5.0), "{yaws:?}");
        for status in &still {
            let norm: f64 = status.q.iter().map(|part| f64::from(*part).powi(2)).sum();
            assert_near(norm, 1.0, 1e-5);
            assert_near(pitch_yaw_deg(status.q).0, -90.0, 0.5);
        }
        let shown = world.snapshot().gimbals[0].attitude.clone();
        let shown = if flags == 44.0 { shown.yaw_vehicle_deg } else { shown.yaw_earth_deg };
        assert_near(turn(shown.expect("it is known") - f64::from(yaw)), 0.0, 1.0);
    }
}

/// Client checklist E48: "The YAW_LOCK bit in 285 is set within 500 ms of a lock command and cleared within 500 ms of a
/// follow command."
#[test]
fn client_item_e48_the_lock_is_seen_within_half_a_second() {
    let (mut world, places) = flying();
    for (flags, expected) in [(92.0, YAW_LOCK), (44.0, 0), (28.0, YAW_LOCK), (12.0, 0), (16.0, YAW_LOCK), (0.0, 0)] {
        // With angles, and as QGroundControl's button of the lock sends it: with nothing but flags.
        for angles in [[-10.0, 20.0], [NAN, NAN]] {
            let command = pitchyaw(angles[0], angles[1], NAN, NAN, flags);
            assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "{flags}");
            let heard = statuses(&mut world, places, SECOND / 2);
            let told = heard.last().expect("two and more within that").flags;
            assert_eq!(told & (YAW_LOCK | ROLL_PITCH_LOCK), expected | ROLL_PITCH_LOCK, "after {flags}");
        }
    }
}

/// Client checklist E49: "RETRACT bit in 285 while retracted; cleared by the next angle command."
#[test]
fn client_item_e49_a_retracted_gimbal_says_so() {
    let (mut world, places) = flying();
    for _ in 0..2 {
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, NAN, NAN, 1.0)), Some(ACCEPTED));
        assert!(statuses(&mut world, places, SECOND).last().is_some_and(|status| status.flags & 1 == 1));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        assert!(statuses(&mut world, places, SECOND).last().is_some_and(|status| status.flags & 1 == 0));
    }
}

/// Client checklist E50: "Angular velocity fields are finite when known, NaN when not; sign positive = pitch up, yaw
/// right."
#[test]
fn client_item_e50_rates_are_numbers_with_their_sign() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    heading(&mut world, places, 0.0, Duration::from_secs(5));
    for (pitch_dps, yaw_dps) in [(10.0, 0.0), (-10.0, 5.0), (5.0, -5.0)] {
        world.send(places.ground, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0));
        heading(&mut world, places, 0.0, Duration::from_secs(5));
        world.send(places.ground, GCS, &pitchyaw(NAN, NAN, pitch_dps, yaw_dps, 44.0));

        let heard = heading(&mut world, places, 0.0, Duration::from_secs(2));

        let last = heard.last().expect("it speaks");
        assert_near(f64::from(last.angular_velocity_x).to_degrees(), 0.0, 0.5);
        assert_near(f64::from(last.angular_velocity_y).to_degrees(), f64::from(pitch_dps), 0.5);
        assert_near(f64::from(last.angular_velocity_z).to_degrees(), f64::from(yaw_dps), 0.5);
    }
    // A device that does not know them says NaN, and that is not taken for a number.
    let unknown = Status { angular_velocity_x: NAN, angular_velocity_y: NAN, angular_velocity_z: NAN, ..still() };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(unknown));
    assert_eq!(world.snapshot().gimbals[0].state, "alive");
}

/// Client checklist E52: "Two gimbals never share a source component in 285 in the default layout."
#[test]
fn client_item_e52_each_gimbal_speaks_for_itself() {
    let mut settings = three_links();
    settings.links.push(crate::support::world::link(
        "second",
        gimbald::bridge::settings::Role::Gimbal,
        gimbald::bridge::settings::Transport::Datagrams,
    ));
    let (mut world, places) = World::new(settings);
    for (place, component_id) in [(places[1], 154), (places[3], 171)] {
        let settings = DeviceSettings { component_id, ..DeviceSettings::default() };
        world.install(place, Device::new(Timestamp::ZERO, settings));
    }
    world.run_for(Duration::from_secs(5));
    world.forget();

    world.run_for(Duration::from_secs(5));

    let heard = world.take(places[2]);
    for component in [154, 171] {
        let of_it = heard.iter().filter(|at| at.id() == 285 && at.source() == MavId::new(1, component));
        assert!(of_it.count() >= 20);
    }
    let others = heard.iter().filter(|at| at.id() == 285 && ![154, 171].contains(&at.source().component));
    assert_eq!(others.count(), 0);
}

/// A simulated vehicle on its circle and its gimbal.
fn flying() -> (World, Places) {
    let (mut world, places) = World::with_one_gimbal(three_links());
    world.run_for(Duration::from_secs(2));
    world.forget();
    (world, places)
}

/// The statuses of the gimbal that the ground hears in the time that passes.
fn statuses(world: &mut World, places: Places, duration: Duration) -> Vec<Status> {
    world.forget();
    world.run_for(duration);
    world.take_messages(places.ground)
}

/// The same while an autopilot tells that the vehicle stands and looks to `heading_deg`.
fn heading(world: &mut World, places: Places, heading_deg: f64, duration: Duration) -> Vec<Status> {
    world.forget();
    // 0 would be "unknown".
    let state = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        angular_velocity_z: 1e-5,
        ..autopilot_state(Timestamp::ZERO, NOBODY, heading_deg)
    };
    let repeated = [
        (SECOND / 20, places.autopilot, AUTOPILOT, MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state)),
        (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()),
    ];
    world.run_with(duration, &repeated);
    world.take_messages(places.ground)
}

fn times_of_status(world: &mut World, place: Place) -> Vec<Timestamp> {
    world.take(place).iter().filter(|arrival| arrival.id() == 281).map(|arrival| arrival.at).collect()
}

/// The shorter way round, in degrees.
fn turn(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

fn still() -> Status {
    crate::support::script::device_status(Timestamp::ZERO, 44, 0.0, 0.0)
}

/// A 285 with its zeros, and a sequence number of its own.
fn device_frame() -> Vec<u8> {
    let mut payload = [0; 49];
    payload[4..8].copy_from_slice(&1.0_f32.to_le_bytes());
    payload[36] = 44;
    crate::support::wire::frame_v2(285, 137, 77, &payload, None)
}
