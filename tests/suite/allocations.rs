//! Forwarding allocates nothing once it has begun: a companion computer must not stall in the allocator.

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage};
use gimbald::wire::{FrameBuffer, MavId};

use crate::support::script::{NAN, device_information, quaternion, set_pitchyaw, take_control, usual_capabilities};
use crate::support::tlog;
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, heartbeat, link};

/// The traffic of recorded flights, with a gimbal's attitude behind each frame, from and to links of every transport.
/// The first round may allocate; the next does not. What we say ourselves, such as asking a gimbal for its name, is no
/// forwarding, so the gimbal of this test has told everything before.
#[test]
fn forwarding_in_the_steady_state_allocates_nothing() {
    let recorded: Vec<Vec<u8>> = ["ap_gremsy_a", "ap_storm32", "px4_dev", "px4_nodev"]
        .iter()
        .flat_map(|name| tlog::read(&tlog::capture(name).join("ground.tlog")))
        .map(|record| record.bytes)
        .collect();
    let of_gimbal = |id: u32| {
        let mut frames = recorded.iter().filter(|bytes| source(bytes) == GIMBAL);
        frames.find(|bytes| bytes[7..10] == id.to_le_bytes()[..3]).expect("it was recorded").clone()
    };
    let (information, attitude) = (of_gimbal(283), of_gimbal(285));
    let others: Vec<&Vec<u8>> = recorded.iter().filter(|bytes| source(bytes) != GIMBAL).collect();
    let mut bridge = bridge();
    let mut now = Timestamp::ZERO;
    receive(&mut bridge, now, 1, &information);
    let mut round = || {
        let mut forwarded = 0;
        for bytes in &others {
            now += Duration::from_millis(1);
            forwarded += receive(&mut bridge, now, 0, bytes);
            forwarded += receive(&mut bridge, now, 1, &attitude);
        }
        forwarded
    };
    round();

    let mut forwarded = 0;
    let counted = allocation_counter::measure(|| forwarded = round());

    assert_eq!((counted.count_total, counted.bytes_total), (0, 0));
    assert!(forwarded > 2 * others.len(), "{forwarded} outputs of {} frames", 2 * others.len());
}

/// "Ignoring must be silent and cheap" (peers notes 2.2): PX4 as our client streams `GIMBAL_MANAGER_SET_PITCHYAW` while another
/// is in control, and each is refused without an allocation and without a word.
#[test]
fn refusing_a_stream_allocates_nothing_and_says_nothing() {
    let mut bridge = bridge();
    let mut now = Timestamp::ZERO;
    let mut buffer = FrameBuffer::default();
    let capabilities = usual_capabilities();
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(now, capabilities));
    let information = buffer.encode_any(GIMBAL, 1, &information).bytes().to_vec();
    receive(&mut bridge, now, 1, &information);
    let claim = buffer.encode_any(GCS, 1, &take_control()).bytes().to_vec();
    receive(&mut bridge, now, 2, &claim);
    let demand = buffer.encode_any(AUTOPILOT, 1, &set_pitchyaw(-0.5, 0.5, NAN, NAN, 8)).bytes().to_vec();
    let mut refuse = |times: u32| {
        let mut said = 0;
        for _ in 0..times {
            now += Duration::from_millis(10);
            said += receive(&mut bridge, now, 0, &demand);
        }
        said
    };
    // The first, second, fourth … is written to the journal at level debug: so the count is not to double meanwhile.
    refuse(300);

    let mut said = 0;
    let counted = allocation_counter::measure(|| said = refuse(200));

    assert_eq!((counted.count_total, counted.bytes_total, said), (0, 0, 0));
    let rejected = &bridge.snapshot(now).gimbals[0].rejected["1/1"];
    assert_eq!(rejected["not_in_control"], 500, "{rejected:?}");
}

/// ArduPilot repeats its setpoint for the device that we present to it fifty times a second for ever: that costs nothing while
/// it asks for nothing new, nobody is told, and nothing goes to the gimbal.
#[test]
fn a_constant_stream_to_the_presented_device_allocates_nothing() {
    let mut bridge = bridge_with(true);
    let mut now = Timestamp::ZERO;
    let mut buffer = FrameBuffer::default();
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(now, usual_capabilities()));
    let information = buffer.encode_any(GIMBAL, 1, &information).bytes().to_vec();
    receive(&mut bridge, now, 1, &information);
    let setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q: quaternion(-30.0, 10.0),
        angular_velocity_x: NAN,
        angular_velocity_y: NAN,
        angular_velocity_z: NAN,
        flags: 0,
        target_system: 1,
        target_component: 154,
    };
    let setpoint = MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint);
    let setpoint = buffer.encode_any(AUTOPILOT, 1, &setpoint).bytes().to_vec();
    let mut repeat = |times: u32| {
        let mut said = 0;
        for _ in 0..times {
            now += Duration::from_millis(20);
            said += receive(&mut bridge, now, 0, &setpoint);
        }
        said
    };
    repeat(10);

    let mut said = 0;
    let counted = allocation_counter::measure(|| said = repeat(200));

    assert_eq!((counted.count_total, counted.bytes_total, said), (0, 0, 0));
    let presented = bridge.snapshot(now).gimbals[0].presented.clone().expect("it is presented");
    assert_eq!(presented.stream, "steady");
}

/// Hands one read to the core and takes what is sent; how often anything was.
fn receive(bridge: &mut Bridge, now: Timestamp, from: usize, bytes: &[u8]) -> usize {
    bridge.handle_input(now, Input::Received { channel: channel(from), bytes });
    let mut sent = 0;
    while bridge.poll_output().is_some() {
        sent += 1;
    }
    sent
}

fn source(frame: &[u8]) -> MavId {
    MavId::new(frame[5], frame[6])
}

fn bridge() -> Bridge {
    bridge_with(false)
}

fn bridge_with(present_device: bool) -> Bridge {
    let settings = Settings {
        present_device,
        system_id: SystemId::Fixed(1),
        links: vec![
            link("autopilot", Role::Autopilot, Transport::Stream),
            link("gimbal", Role::Gimbal, Transport::Serial { baud: 115_200 }),
            link("ground", Role::Ground, Transport::Datagrams),
            link("peer", Role::Peer, Transport::Serial { baud: 57_600 }),
        ],
        ..Settings::default()
    };
    let mut bridge = Bridge::new(Timestamp::ZERO, settings);
    let mut buffer = FrameBuffer::default();
    for (at, (link, source, kind, autopilot)) in [
        (0, AUTOPILOT, 2, 12),
        (1, GIMBAL, 26, 8),
        (2, GCS, 6, 8),
        (2, MavId::new(254, 190), 6, 8),
        (3, MavId::new(1, 100), 30, 8),
    ]
    .into_iter()
    .enumerate()
    {
        let opened = Input::ChannelOpened { channel: channel(at), link, address: "test" };
        bridge.handle_input(Timestamp::ZERO, opened);
        let hello = buffer.encode_any(source, 0, &heartbeat(kind, autopilot));
        bridge.handle_input(Timestamp::ZERO, Input::Received { channel: channel(at), bytes: hello.bytes() });
    }
    while bridge.poll_output().is_some() {}
    bridge
}

fn channel(index: usize) -> ChannelId {
    ChannelId::new(index).expect("below the bound")
}
