//! What the core costs from a demand to the setpoint on the gimbal's line: datagram in, bytes of 284 out.

use std::cell::RefCell;
use std::hint::black_box;
use std::time::Duration;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input, Output};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::peer::Peer;
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA};
use gimbald::wire::{MavId, encode_to_vec};

const CLIENT: MavId = MavId::new(255, 190);

/// The frame's id, as it stands in the header.
const SET_ATTITUDE: [u8; 3] = [0x1c, 0x01, 0x00];

fn turn_around(criterion: &mut Criterion) {
    let rig = RefCell::new(Rig::new());
    let mut group = criterion.benchmark_group("demand to setpoint");
    for (name, demand) in [("GIMBAL_MANAGER_SET_PITCHYAW", set_pitchyaw()), ("DO_GIMBAL_MANAGER_PITCHYAW", command())] {
        group.bench_function(name, |bencher| {
            bencher.iter_batched(
                || rig.borrow_mut().pass(Duration::from_millis(1)),
                |()| rig.borrow_mut().demand(black_box(&demand)),
                // The gimbal speaks, and the line empties, between batches.
                BatchSize::NumIterations(16),
            );
        });
    }
    group.finish();
}

/// A core with a simulated gimbal on a fast serial line.
struct Rig {
    now: Timestamp,
    bridge: Bridge,
    gimbal: Device,
}

impl Rig {
    fn new() -> Self {
        let link = |name: &str, role, transport| LinkSettings {
            name: name.to_owned(),
            role,
            endpoint: name.to_owned(),
            transport,
            speaks_first: false,
            max_rates: Default::default(),
        };
        let settings = Settings {
            system_id: SystemId::Fixed(1),
            links: vec![
                link("gimbal", Role::Gimbal, Transport::Serial { baud: 4_000_000 }),
                link("ground", Role::Ground, Transport::Datagrams),
            ],
            ..Settings::default()
        };
        let mut rig = Self {
            now: Timestamp::ZERO,
            bridge: Bridge::new(Timestamp::ZERO, settings),
            gimbal: Device::new(Timestamp::ZERO, DeviceSettings::default()),
        };
        for link in [0, 1] {
            let opened = Input::ChannelOpened { channel: channel(link), link, address: "bench" };
            rig.bridge.handle_input(rig.now, opened);
        }
        for _ in 0..5_000 {
            rig.pass(Duration::from_millis(1));
        }
        rig
    }

    /// Lets time pass for everybody.
    fn pass(&mut self, time: Duration) {
        self.now += time;
        self.gimbal.handle_timeout(self.now);
        self.bridge.handle_timeout(self.now);
        while let Some(output) = self.bridge.poll_output() {
            if let Output::Transmit { channels, bytes } = output
                && channels.contains(channel(0))
            {
                self.gimbal.handle_received(self.now, bytes);
            }
        }
        while let Some(bytes) = self.gimbal.poll_output() {
            self.bridge.handle_input(self.now, Input::Received { channel: channel(0), bytes: &bytes });
            while self.bridge.poll_output().is_some() {}
        }
    }

    /// One demand; its setpoint must come out at once.
    fn demand(&mut self, bytes: &[u8]) {
        self.now += Duration::from_millis(1);
        self.bridge.handle_input(self.now, Input::Received { channel: channel(1), bytes });
        let mut steered = false;
        while let Some(output) = self.bridge.poll_output() {
            if let Output::Transmit { bytes, .. } = output {
                steered |= bytes[7..10] == SET_ATTITUDE;
                black_box(bytes);
            }
        }
        assert!(steered, "a demand is answered with a setpoint");
    }
}

fn channel(index: usize) -> ChannelId {
    ChannelId::new(index).expect("below the bound")
}

fn set_pitchyaw() -> Vec<u8> {
    let message = GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 44,
        pitch: -0.5,
        yaw: 0.7,
        pitch_rate: f32::NAN,
        yaw_rate: f32::NAN,
        target_system: 1,
        target_component: 191,
        gimbal_device_id: 154,
    };
    encode_to_vec(CLIENT, 1, &message)
}

fn command() -> Vec<u8> {
    let message = COMMAND_LONG_DATA {
        param1: -30.0,
        param2: 45.0,
        param3: f32::NAN,
        param4: f32::NAN,
        param5: 44.0,
        param6: 0.0,
        param7: 154.0,
        command: 1000,
        target_system: 1,
        target_component: 191,
        confirmation: 0,
    };
    encode_to_vec(CLIENT, 1, &message)
}

criterion_group!(benches, turn_around);
criterion_main!(benches);
