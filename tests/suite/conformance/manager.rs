//! The gimbal manager as its clients see it (protocol checklist 8.4 to 8.7, 8.9, 8.14).

mod angles;
mod answers;
mod asked;
mod bad_days;
mod client_control;
mod commands;
mod control;
mod control_matrix;
mod control_nudge;
mod control_takeover;
mod control_war;
mod events;
mod frames;
mod mount;
mod mount_messages;
mod mount_reports;
mod mount_traps;
mod outcomes;
mod presence;
mod radio_control;
mod rates;
mod repeats;
mod roi;
mod setpoints;
mod snooping;
mod status;
mod streams;

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage,
};
use gimbald::wire::ids::CapFlags;

use crate::support::script::{
    NAN, device_information, device_status, gimbal_heartbeat, global_position, ground_heartbeat, of, px4_heartbeat,
    usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const COMPANION: MavId = MavId::new(1, 192);

/// A world with a scripted gimbal that looks straight ahead, and a ground station that was heard.
fn with_gimbal() -> (World, Places) {
    with_gimbal_that(usual_capabilities(), three_links())
}

fn with_gimbal_that(capabilities: CapFlags, settings: gimbald::bridge::settings::Settings) -> (World, Places) {
    let (mut world, places) = World::empty(settings);
    world.run_for(SECOND / 2);
    world.send(places.ground, GCS, &ground_heartbeat());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(world.now, capabilities);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    look(&mut world, places, 0.0, 0.0);
    world.run_for(SECOND / 10);
    world.forget();
    (world, places)
}

/// The gimbal says where it looks, yaw from the nose.
fn look(world: &mut World, places: Places, pitch_deg: f64, yaw_deg: f64) {
    let status = device_status(world.now, 44, pitch_deg, yaw_deg);
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
}

/// Time passes while the gimbal goes on saying where it looks and the ground station that it is there.
fn run_looking(world: &mut World, places: Places, duration: Duration, pitch_deg: f64, yaw_deg: f64) {
    let status = device_status(world.now, 44, pitch_deg, yaw_deg);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: 1 << 30, ..status };
    let repeated = [
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND, places.ground, GCS, ground_heartbeat()),
    ];
    world.run_with(duration, &repeated);
}

/// Degrees and metres above mean sea level.
const FIELD: [f64; 3] = [47.397_742, 8.545_594, 488.0];

/// The autopilot says where the vehicle is, 88 m above home, and that it looks to `heading_deg`.
fn fly(world: &mut World, places: Places, at: [f64; 3], heading_deg: f64) {
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    let position = global_position(world.now, at, 88.0);
    world.send(places.autopilot, AUTOPILOT, &position);
    frames::turn_vehicle(world, places, heading_deg);
}

/// Time passes while the gimbal and the ground station are there, and the vehicle is where it is.
fn run_flying(world: &mut World, places: Places, duration: Duration, at: [f64; 3], heading_deg: f64) {
    let end = world.now + duration;
    while world.now < end {
        fly(world, places, at, heading_deg);
        run_looking(world, places, (SECOND / 10).min(end - world.now), 0.0, 0.0);
    }
}

/// The setpoints that reached the gimbal; each must be well formed, and nobody else must have got one.
fn setpoints(world: &mut World, places: Places) -> Vec<(gimbald::timestamp::Timestamp, Setpoint)> {
    for elsewhere in [places.autopilot, places.ground] {
        assert!(world.take(elsewhere).iter().all(|arrival| arrival.id() != 284), "a setpoint is for the gimbal only");
    }
    let heard = world.take(places.gimbal);
    let setpoints = heard.iter().filter(|arrival| arrival.id() == 284);
    setpoints
        .map(|arrival| {
            assert_eq!(arrival.source(), MANAGER);
            let setpoint: Setpoint = arrival.decode();
            assert_eq!((setpoint.target_system, setpoint.target_component), (1, 154));
            (arrival.at, setpoint)
        })
        .collect()
}

type Setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA;

/// The one setpoint that reached the gimbal.
fn only_setpoint(world: &mut World, places: Places) -> Setpoint {
    let setpoints = setpoints(world, places);
    assert_eq!(setpoints.len(), 1, "{setpoints:?}");
    setpoints[0].1.clone()
}

/// Who 281 says is in control: primary and secondary, as told in the latest one.
fn told_control(arrivals: &[Arrival]) -> Option<(MavId, MavId)> {
    let told: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(arrivals);
    told.last().map(|told| {
        (
            MavId::new(told.primary_control_sysid, told.primary_control_compid),
            MavId::new(told.secondary_control_sysid, told.secondary_control_compid),
        )
    })
}

fn assert_near(value: f64, wanted: f64, tolerance: f64) {
    assert!((value - wanted).abs() <= tolerance, "{value} instead of {wanted}");
}

fn is_nan(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_nan())
}

/// An angle on neither axis.
const NO_ANGLES: [f32; 2] = [NAN, NAN];
