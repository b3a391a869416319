//! What MAVSDK 4.1.0 really sends, byte for byte.
//!
//! The frames were recorded between MAVSDK (245/190) and a manager-and-device on 1/154 with device id 1. Here they are
//! addressed to the manager 1/191 of device 154, and their checksum is computed anew.

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA,
};
use gimbald::wire::target::message_shape;

use crate::support::script::{ACCEPTED, ack, ground_heartbeat, ids, of, pitch_yaw_deg};
use crate::support::wire::{checksum, hex};
use crate::support::world::{Arrival, GIMBAL, MANAGER, Places, World, three_links};

const MAVSDK: MavId = MavId::new(245, 190);

const REQUEST_280: &str =
    "fd20000005f5be4c0000 00008c43 0000c07f 0000c07f 0000c07f 0000c07f 0000c07f 0000c07f 0002 01 9a fd27";
const REQUEST_283: &str =
    "fd20000007f5be4c0000 00808d43 0000c07f 0000c07f 0000c07f 0000c07f 0000c07f 0000c07f 0002 01 9a 8f15";
const TAKE_CONTROL: &str =
    "fd2000000bf5be4c0000 00007543 00003e43 00007543 00003e43 0000c07f 0000c07f 0000803f e903 01 9a 1be9";
const ANGLES: &str =
    "fd2000000cf5be4c0000 0000f0c1 0000a041 0000c07f 0000c07f 00004041 0000c07f 0000803f e803 01 9a 9000";
const STREAMED_ANGLES: &str =
    "fd2300000df5be1a0100 0c000000 2f0e7e3f e5e8f83b d3d0b1bd d3d0b13d 0000c07f 0000c07f 0000c07f 01 9a 01 e533";
const RATES: &str =
    "fd21000011f5be4b0000 0000c07f 0000c07f 000020c1 00000000 0c000000 00000000 0000803f e803 01 9a 03 1b10";
const STREAMED_RATES: &str =
    "fd23000018f5be1a0100 0c000000 0000c07f 0000c07f 0000c07f 0000c07f 00000000 c2b8b23d c2b8b23d 01 9a 01 fa46";
const ROI: &str =
    "fd21000020f5be4b0000 0000803f 0000c07f 0000c07f 0000c07f a850401c 80f41705 0000f443 c300 01 9a 03 fc17";
const RELEASE: &str =
    "fd2000002ff5be4c0000 000040c0 000040c0 000040c0 000040c0 0000c07f 0000c07f 0000803f e903 01 9a 3741";

/// "MavlinkCommandSender: an ACK counts if it comes from the addressed component": each command of the trace is answered
/// by the manager, at once and once, with the ACK before what was asked for; IN_PROGRESS, at which MAVSDK aborts, never
/// comes; what it streams is answered with nothing.
#[test]
fn the_trace_of_mavsdk_is_answered_as_it_was() {
    let (mut world, places) = with_mavsdk();

    // It asks who manages a gimbal, and the gimbal who it is.
    let answers = say(&mut world, places, REQUEST_280);
    assert_eq!(ids(&answers), [77, 280]);
    assert_acknowledged(&answers, 512);
    let information: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&answers);
    assert_eq!(information[0].gimbal_device_id, 154);
    let answers = play(&mut world, places, hex(REQUEST_283));
    assert_eq!(
        answers.iter().map(|answer| (answer.id(), answer.source())).collect::<Vec<_>>(),
        [(77, GIMBAL), (283, GIMBAL)]
    );

    // It takes both places.
    let answers = say(&mut world, places, TAKE_CONTROL);
    assert_eq!(ids(&answers), [77, 281]);
    assert_acknowledged(&answers, 1001);
    assert_eq!(control(&answers), [245, 190, 245, 190]);
    assert_eq!(control(&world.take(places.gimbal)), [245, 190, 245, 190], "told everywhere");

    // It points once, then by a stream.
    let answers = say(&mut world, places, ANGLES);
    assert_acknowledged(&answers, 1000);
    assert_eq!(others(&answers, 281), [77]);
    assert_points(&mut world, places, -30.0, 20.0);
    assert!(others(&say(&mut world, places, STREAMED_ANGLES), 281).is_empty());
    assert_points(&mut world, places, -10.0, 10.0);

    // It turns once, by a COMMAND_INT, then by a stream.
    let answers = say(&mut world, places, RATES);
    assert_acknowledged(&answers, 1000);
    assert_eq!(others(&answers, 281), [77]);
    assert_turns(&mut world, places, -10.0, 0.0);
    for _ in 0..10 {
        assert!(others(&say(&mut world, places, STREAMED_RATES), 281).is_empty());
        assert_turns(&mut world, places, 5.0, 5.0);
        world.run_for(Duration::from_millis(100));
    }

    // It points at a place.
    let answers = say(&mut world, places, ROI);
    assert_acknowledged(&answers, 195);
    assert_eq!(others(&answers, 281), [77]);
    let roi = world.snapshot().gimbals[0].roi.clone().expect("it is pointed at");
    assert!((roi.latitude_deg - 47.397_7).abs() < 1e-9 && (roi.longitude_deg - 8.545_6).abs() < 1e-9, "{roi:?}");

    // It lets go of both.
    let answers = say(&mut world, places, RELEASE);
    assert_acknowledged(&answers, 1001);
    assert_eq!(others(&answers, 281), [77]);
    assert_eq!(control(&answers), [0, 0, 0, 0]);
}

/// Nobody in control is told of a release that changes nothing, and the trace of a client that never took control is
/// answered in the same way (`unclaimed = "open"`).
#[test]
fn without_taking_control_the_trace_is_answered_the_same() {
    for (frame, command) in [(ANGLES, 1000), (RATES, 1000), (ROI, 195), (RELEASE, 1001)] {
        let (mut world, places) = with_mavsdk();
        let answers = say(&mut world, places, frame);
        assert_acknowledged(&answers, command);
        assert_eq!(others(&answers, 281), [77]);
    }
}

/// The recorded bytes are whole frames: their own checksum is right before it is computed anew.
#[test]
fn the_recorded_frames_are_whole() {
    for frame in [REQUEST_280, REQUEST_283, TAKE_CONTROL, ANGLES, STREAMED_ANGLES, RATES, STREAMED_RATES, ROI, RELEASE]
    {
        let mut bytes = hex(frame);
        let recorded = bytes.clone();
        seal(&mut bytes);
        assert_eq!(bytes, recorded);
    }
}

/// A simulated vehicle and gimbal, and MAVSDK's heartbeat.
fn with_mavsdk() -> (World, Places) {
    let (mut world, places) = World::with_one_gimbal(three_links());
    world.send(places.ground, MAVSDK, &ground_heartbeat());
    world.run_for(Duration::from_millis(430));
    world.forget();
    (world, places)
}

/// Plays a recorded frame in and gives what comes back in the same moment.
fn say(world: &mut World, places: Places, recorded: &str) -> Vec<Arrival> {
    play(world, places, to_us(recorded))
}

fn play(world: &mut World, places: Places, frame: Vec<u8>) -> Vec<Arrival> {
    world.forget();
    world.send_bytes(places.ground, &frame);
    world.take(places.ground)
}

/// The frame with the manager for its target and 154 for its device.
fn to_us(recorded: &str) -> Vec<u8> {
    let mut frame = hex(recorded);
    let message_id = message_id(&frame);
    let payload = &mut frame[10..];
    let id = match message_id {
        // COMMAND_INT carries the id of 1000 in z and that of 195 in parameter 1; COMMAND_LONG in parameter 7.
        75 if payload[28..30] == 195_u16.to_le_bytes() => Some(0..4),
        75 | 76 => Some(24..28),
        _ => None,
    };
    match id {
        Some(at) if payload[at.clone()] == 1.0_f32.to_le_bytes() => {
            payload[at].copy_from_slice(&154.0_f32.to_le_bytes())
        }
        Some(_) => {}
        None => payload[34] = 154,
    }
    let component = if message_id == 282 { 33 } else { 31 };
    assert_eq!(payload[component], 154);
    payload[component] = MANAGER.component;
    seal(&mut frame);
    frame
}

fn message_id(frame: &[u8]) -> u32 {
    u32::from_le_bytes([frame[7], frame[8], frame[9], 0])
}

/// Computes the checksum anew.
fn seal(frame: &mut [u8]) {
    let end = frame.len() - 2;
    let crc_extra = message_shape(message_id(frame)).expect("a known message").crc_extra;
    let sum = checksum(&frame[1..end], crc_extra).to_le_bytes();
    frame[end..].copy_from_slice(&sum);
}

/// Exactly one ACK, from us to MAVSDK, and it is the first answer.
fn assert_acknowledged(answers: &[Arrival], command: u16) {
    assert!(answers.iter().all(|answer| answer.source() == MANAGER), "{answers:?}");
    let acks: Vec<COMMAND_ACK_DATA> = of(answers);
    assert_eq!(acks, [ack(MAVSDK, command, ACCEPTED)]);
    assert_eq!(answers[0].id(), 77);
}

/// The ids of the answers but for one, which may come besides.
fn others(answers: &[Arrival], besides: u32) -> Vec<u32> {
    ids(answers).into_iter().filter(|id| *id != besides).collect()
}

fn control(arrivals: &[Arrival]) -> [u8; 4] {
    let told: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(arrivals);
    let told = told.last().expect("it is told");
    [
        told.primary_control_sysid,
        told.primary_control_compid,
        told.secondary_control_sysid,
        told.secondary_control_compid,
    ]
}

fn only_setpoint(world: &mut World, places: Places) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(setpoints.len(), 1);
    setpoints[0].clone()
}

/// The gimbal was told in the same moment, yaw from the nose: the flags 12 hold no lock.
fn assert_points(world: &mut World, places: Places, pitch_deg: f64, yaw_deg: f64) {
    let setpoint = only_setpoint(world, places);
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    assert!((pitch - pitch_deg).abs() < 0.01 && (yaw - yaw_deg).abs() < 0.01, "{pitch}, {yaw}");
    assert_eq!(setpoint.flags, 44);
    assert!(setpoint.angular_velocity_y.is_nan() && setpoint.angular_velocity_z.is_nan());
}

fn assert_turns(world: &mut World, places: Places, pitch_dps: f64, yaw_dps: f64) {
    let setpoint = only_setpoint(world, places);
    let near = |rate: f32, wanted: f64| (f64::from(rate).to_degrees() - wanted).abs() < 0.01;
    assert!(near(setpoint.angular_velocity_y, pitch_dps) && near(setpoint.angular_velocity_z, yaw_dps), "{setpoint:?}");
    assert!(setpoint.q[0].is_nan());
}
