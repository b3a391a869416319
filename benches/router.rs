//! What the core costs per forwarded frame, from the bytes of a datagram to the bytes to be sent.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input, Output};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{ATTITUDE_DATA, COMMAND_ACK_DATA, HEARTBEAT_DATA};
use gimbald::wire::{MavId, encode_to_vec};

const AUTOPILOT: MavId = MavId::new(1, 1);
const GROUND: MavId = MavId::new(255, 190);
const NOW: Timestamp = Timestamp::from_secs(1);

fn forwarding(criterion: &mut Criterion) {
    let broadcast = vec![encode_to_vec(AUTOPILOT, 9, &attitude())];
    let targeted = vec![encode_to_vec(AUTOPILOT, 9, &answer())];
    let recorded = recorded_frames();
    for channels in [2, 9] {
        let mut group = criterion.benchmark_group(format!("per frame, {channels} channels"));
        for (name, frames) in
            [("broadcast", &broadcast), ("to one component", &targeted), ("recorded flights", &recorded)]
        {
            let mut bridge = bridge(channels);
            group.throughput(Throughput::Elements(frames.len() as u64));
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    for frame in frames {
                        forward(&mut bridge, frame);
                    }
                });
            });
        }
        group.finish();
    }
}

fn forward(bridge: &mut Bridge, frame: &[u8]) {
    bridge.handle_input(NOW, Input::Received { channel: channel(0), bytes: black_box(frame) });
    while let Some(output) = bridge.poll_output() {
        match output {
            Output::Transmit { channels, bytes } => {
                black_box((channels, bytes));
            }
            Output::StoreSystemId(_)
            | Output::StoreTurning(_)
            | Output::StoreGimbalIds(_)
            | Output::Answered { .. } => {}
        }
    }
}

/// An autopilot on the first channel, a ground station on the second, nobody on the others.
fn bridge(channels: usize) -> Bridge {
    let settings = Settings {
        system_id: SystemId::Fixed(1),
        links: vec![link("autopilot", Role::Autopilot), link("ground", Role::Ground)],
        ..Settings::default()
    };
    let mut bridge = Bridge::new(Timestamp::ZERO, settings);
    for at in 0..channels {
        let link = at.min(1);
        bridge.handle_input(NOW, Input::ChannelOpened { channel: channel(at), link, address: "bench" });
    }
    for (at, source, kind, autopilot) in [(0, AUTOPILOT, 2, 12), (1, GROUND, 6, 8)] {
        let bytes = encode_to_vec(source, 0, &heartbeat(kind, autopilot));
        bridge.handle_input(NOW, Input::Received { channel: channel(at), bytes: &bytes });
    }
    while bridge.poll_output().is_some() {}
    bridge
}

fn link(name: &str, role: Role) -> LinkSettings {
    LinkSettings {
        name: name.to_owned(),
        role,
        endpoint: name.to_owned(),
        transport: Transport::Datagrams,
        speaks_first: false,
        max_rates: Default::default(),
    }
}

fn channel(index: usize) -> ChannelId {
    ChannelId::new(index).expect("below the bound")
}

fn heartbeat(kind: u8, autopilot: u8) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype: kind, autopilot, base_mode: 0, system_status: 4, mavlink_version: 3 }
}

fn attitude() -> ATTITUDE_DATA {
    ATTITUDE_DATA {
        time_boot_ms: 5_000,
        roll: 0.1,
        pitch: -0.05,
        yaw: 1.5,
        rollspeed: 0.01,
        pitchspeed: 0.02,
        yawspeed: 0.03,
    }
}

fn answer() -> COMMAND_ACK_DATA {
    COMMAND_ACK_DATA {
        command: 400,
        result: 0,
        progress: 0,
        result_param2: 0,
        target_system: GROUND.system,
        target_component: GROUND.component,
    }
}

/// What ground stations received in the recorded flights.
fn recorded_frames() -> Vec<Vec<u8>> {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/captures");
    let mut frames = Vec::new();
    for recording in ["ap_gremsy_a", "ap_none", "ap_storm32", "px4_dev", "px4_nodev"] {
        let path = captures.join(recording).join("ground.tlog");
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut rest = &bytes[..];
        while let Some((_, after)) = rest.split_first_chunk::<8>() {
            // The recordings hold MAVLink 2 only.
            let len = usize::from(after[1]) + if after[2] & 1 == 0 { 12 } else { 25 };
            frames.push(after[..len].to_vec());
            rest = &after[len..];
        }
    }
    frames
}

criterion_group!(benches, forwarding);
criterion_main!(benches);
