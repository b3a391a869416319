//! Forwarding allocates nothing once it has begun: a companion computer must not stall in the allocator.

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input};
use gimbald::timestamp::Timestamp;
use gimbald::wire::{FrameBuffer, MavId};

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
    let settings = Settings {
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
