//! A daemon that is killed in flight, and the one that takes its place.

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage};
use nix::sys::signal::Signal;

use super::simulated_gimbal;
use crate::support::daemon::{Heard, Site, Station, link, wait_for};
use crate::support::world::{GCS, heartbeat};

const AUTOPILOT: MavId = MavId::new(42, 1);
const MANAGER: MavId = MavId::new(42, 191);
const NAN: f32 = f32::NAN;

/// "After kill -9 the gimbal is re-acquired in under 2 s without a jump", with the stored system id (D19), over a real
/// line and a real network: it is known, obeys, and is told nothing before the first demand. `suite::restart` has the
/// times of the core; the limit here leaves room for a busy machine.
#[test]
fn after_a_kill_the_gimbal_is_there_again_and_has_not_moved() {
    kill_and_restart(false);
}

/// The same while a rate runs: the next life stops it, and tells it nothing else.
#[test]
fn after_a_kill_a_gimbal_that_turned_is_stopped() {
    kill_and_restart(true);
}

fn kill_and_restart(turning: bool) {
    let site = Site::new();
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));
    let config = [
        link("autopilot", "autopilot", "udpin:{ip}:14540"),
        link("gimbal", "gimbal", "serial:{dir}/gimbal:115200"),
        link("ground", "ground", "udpin:{ip}:14550"),
    ]
    .concat();
    let variables = [("STATE_DIRECTORY", "{dir}"), ("RUNTIME_DIRECTORY", "{dir}")];
    if turning {
        // Not the first flight: there is no window to wait for.
        std::fs::write(site.path("system-id"), "42\n").expect("a writable folder");
    }
    let mut daemon = site.start(&config, &variables);
    daemon.wait_until_up();
    let mut autopilot = Station::new(AUTOPILOT, site.port(14_540));
    let mut ground = Station::new(GCS, site.port(14_550));
    wait_for("the system id to be stored, and the gimbal on it", || {
        autopilot.send(&heartbeat(2, 12));
        ground.send(&heartbeat(6, 8));
        autopilot.hear_for(Duration::from_millis(100));
        let stored = std::fs::read_to_string(site.path("system-id")).ok();
        let is_followed = gimbal.with(|device, _| device.id().system == 42);
        (stored.as_deref() == Some("42\n") && is_followed).then_some(())
    });
    daemon.wait_for_gimbal();
    let pose = || {
        gimbal.with(|device, _| {
            let pose = device.plant().pose();
            (pose.pitch.degrees(), pose.yaw.degrees())
        })
    };
    let demand = if turning { [NAN, NAN, 0.0, 10.0] } else { [-30.0, 20.0, NAN, NAN] };
    wait_for("the gimbal to be where it is wanted", || {
        ground.send(&pitchyaw(demand));
        ground.hear_for(Duration::from_millis(100));
        let (pitch, yaw) = pose();
        let is_there = if turning { yaw > 3.0 } else { (pitch + 30.0).abs() < 0.1 && (yaw - 20.0).abs() < 0.1 };
        is_there.then_some(())
    });

    assert_eq!(site.path("turning").exists(), turning);
    daemon.signal(Signal::SIGKILL);
    daemon.wait();
    ground.hear_now();
    // What was still on the line is heard; a rate that nobody renews ends by itself after a second.
    ground.hear_for(Duration::from_millis(if turning { 1_300 } else { 200 }));
    let before = pose();
    gimbal.take_heard();
    let clock = ground.clock;
    let started = clock.now();
    let daemon = site.start(&config, &variables);
    let known = daemon.wait_for_gimbal();
    let took = clock.now().since(started);

    assert!(took < Duration::from_secs(5), "{took:?}");
    assert_eq!((known.system_id, known.gimbals[0].device.as_deref()), (Some(42), Some("42/154")));
    ground.send(&heartbeat(6, 8));
    // One that turned is known to have stopped when it was told for a second.
    ground.hear_for(Duration::from_millis(if turning { 2_000 } else { 500 }));
    let told = gimbal.take_heard();
    assert!(told.iter().any(|heard| heard.source == MANAGER), "it hears us");
    let rates: Vec<[f32; 2]> = told
        .iter()
        .filter_map(Heard::decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>)
        .map(|told| [told.angular_velocity_y, told.angular_velocity_z])
        .collect();
    // Once at rest it is kept there.
    assert!(rates.iter().all(|rates| rates.iter().all(|rate| *rate == 0.0 || rate.is_nan())), "{rates:?}");
    assert_eq!(rates.first(), turning.then_some(&[0.0, 0.0]), "stopped if it turned");
    assert!(!site.path("turning").exists(), "and that is not to be done again");
    let after = pose();
    assert!((after.0 - before.0).abs() < 0.1 && (after.1 - before.1).abs() < 0.1, "{before:?} {after:?}");

    ground.send(&pitchyaw([-10.0, NAN, NAN, NAN]));
    let accepted = ground.wait_for("the answer", |heard: &Heard| {
        heard.decode::<COMMAND_ACK_DATA>().filter(|ack| ack.command == 1000).map(|ack| ack.result)
    });
    assert_eq!(accepted, 0);
    wait_for("the gimbal to obey", || ((pose().0 + 10.0).abs() < 0.1).then_some(()));
    assert!((pose().1 - before.1).abs() < 0.3, "the other axis stays: {before:?} {:?}", pose());
}

/// `DO_GIMBAL_MANAGER_PITCHYAW`: pitch, yaw, pitch rate, yaw rate, in the vehicle's frame.
fn pitchyaw([pitch, yaw, pitch_rate, yaw_rate]: [f32; 4]) -> MavMessage {
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: pitch,
        param2: yaw,
        param3: pitch_rate,
        param4: yaw_rate,
        param5: 44.0,
        param6: 0.0,
        param7: 0.0,
        command: 1000,
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        confirmation: 0,
    })
}
