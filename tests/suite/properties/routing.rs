//! What routing never does, for any traffic between any links.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input, Output};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::target::message_shape;
use proptest::prelude::*;

use crate::support::wire::checksum;
use crate::support::world::link;

const ATTITUDE: u32 = 30;
/// Its target is a system and a component.
const MISSION_REQUEST_LIST: u32 = 43;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_frame_never_goes_back_nor_to_where_its_source_is(links in links(), traffic in traffic()) {
        for passage in pass(&links, &traffic) {
            prop_assert!(!passage.receivers.contains(&passage.from), "{passage:?}");
            prop_assert!(passage.receivers.is_disjoint(&passage.source_known), "{passage:?}");
        }
    }

    #[test]
    fn a_targeted_frame_never_goes_where_its_system_was_never_heard(links in links(), traffic in traffic()) {
        for passage in pass(&links, &traffic) {
            if let Some(heard) = &passage.target_system_ever_heard {
                prop_assert!(passage.receivers.is_subset(heard), "{passage:?}");
            }
        }
    }

    #[test]
    fn a_broadcast_reaches_every_other_channel(links in links(), traffic in traffic()) {
        for passage in pass(&links, &traffic) {
            if passage.target_system_ever_heard.is_none() {
                let others: BTreeSet<usize> = (0..links.len())
                    .filter(|to| *to != passage.from && !passage.source_known.contains(to))
                    .collect();
                prop_assert_eq!(&passage.receivers, &others, "{:?}", passage);
            }
        }
    }

    /// A component that was heard is reached wherever it was heard within the last five seconds.
    #[test]
    fn a_targeted_frame_reaches_its_component(links in links(), traffic in traffic()) {
        for passage in pass(&links, &traffic) {
            let reached: BTreeSet<usize> = passage
                .target_known
                .iter()
                .copied()
                .filter(|to| *to != passage.from && !passage.source_known.contains(to))
                .collect();
            prop_assert!(passage.receivers.is_superset(&reached), "{passage:?}");
        }
    }
}

/// One frame of the traffic.
#[derive(Clone, Debug)]
struct Said {
    after: Duration,
    from: usize,
    source: MavId,
    /// `None` for a message without a target.
    target: Option<(u8, u8)>,
    signed: bool,
}

/// What became of it.
#[derive(Debug)]
struct Passage {
    from: usize,
    receivers: BTreeSet<usize>,
    /// Where its source was heard within the last five seconds, this time included.
    source_known: BTreeSet<usize>,
    /// Where its target component was heard within the last five seconds.
    target_known: BTreeSet<usize>,
    /// Where anything of its target's system was ever heard; `None` for a broadcast.
    target_system_ever_heard: Option<BTreeSet<usize>>,
}

/// Carries the traffic through a core. What comes out is what went in, byte for byte, once for each receiver.
fn pass(links: &[LinkSettings], traffic: &[Said]) -> Vec<Passage> {
    let settings = Settings { system_id: SystemId::Fixed(1), links: links.to_vec(), ..Settings::default() };
    let mut bridge = Bridge::new(Timestamp::ZERO, settings);
    for link in 0..links.len() {
        bridge.handle_input(Timestamp::ZERO, Input::LinkUp { link });
        let opened = Input::ChannelOpened { channel: channel(link), link, address: "test" };
        bridge.handle_input(Timestamp::ZERO, opened);
        assert_eq!(bridge.poll_output(), None);
    }
    let mut now = Timestamp::ZERO;
    let mut heard: BTreeMap<MavId, BTreeMap<usize, Timestamp>> = BTreeMap::new();
    let mut passages = Vec::new();
    for (number, said) in traffic.iter().enumerate() {
        now += said.after;
        let from = said.from % links.len();
        heard.entry(said.source).or_default().insert(from, now);
        let bytes = said.bytes(number);
        bridge.handle_input(now, Input::Received { channel: channel(from), bytes: &bytes });
        let mut receivers = BTreeSet::new();
        while let Some(output) = bridge.poll_output() {
            let Output::Transmit { channels, bytes: sent } = output else { panic!("nothing else is done") };
            assert_eq!(sent, bytes);
            for channel in channels {
                assert!(receivers.insert(channel.index()), "sent twice to one channel");
            }
        }
        let lately = |id: MavId| -> BTreeSet<usize> {
            let on = heard.get(&id).into_iter().flatten();
            on.filter(|(_, at)| now.since(**at) <= Duration::from_secs(5)).map(|(channel, _)| *channel).collect()
        };
        let system = said.target.map(|(system, _)| system).filter(|system| *system != 0);
        let target = said.target.filter(|(system, component)| *system != 0 && *component != 0);
        passages.push(Passage {
            from,
            receivers,
            source_known: lately(said.source),
            target_known: target.map_or(BTreeSet::new(), |(system, component)| lately(MavId::new(system, component))),
            target_system_ever_heard: system.map(|system| {
                let of_system = heard.iter().filter(|(id, _)| id.system == system);
                of_system.flat_map(|(_, on)| on.keys().copied()).collect()
            }),
        });
    }
    passages
}

impl Said {
    fn bytes(&self, number: usize) -> Vec<u8> {
        let id = if self.target.is_some() { MISSION_REQUEST_LIST } else { ATTITUDE };
        let shape = message_shape(id).expect("a known message");
        let payload = match self.target {
            // With the zeros that other senders cut off.
            Some((system, component)) => vec![system, component, 0],
            None => vec![number as u8; usize::from(shape.base_len)],
        };
        let flags = u8::from(self.signed);
        let mut frame =
            vec![0xfd, payload.len() as u8, flags, 0, number as u8, self.source.system, self.source.component];
        frame.extend([id as u8, 0, 0]);
        frame.extend(payload);
        let sum = checksum(&frame[1..], shape.crc_extra);
        frame.extend(sum.to_le_bytes());
        if self.signed {
            frame.extend([9; 13]);
        }
        frame
    }
}

fn channel(link: usize) -> ChannelId {
    ChannelId::new(link).expect("below the bound")
}

/// Links of every role but `gimbal`, which gets less.
fn links() -> impl Strategy<Value = Vec<LinkSettings>> {
    let role = prop::sample::select(vec![Role::Autopilot, Role::Ground, Role::Peer]);
    let transport = prop::sample::select(vec![Transport::Datagrams, Transport::Stream]);
    prop::collection::vec((role, transport).prop_map(|(role, transport)| link("some", role, transport)), 1..6)
}

fn traffic() -> impl Strategy<Value = Vec<Said>> {
    let id = || (prop::sample::select(vec![1u8, 2, 255]), prop::sample::select(vec![1u8, 50, 190]));
    let source = id().prop_map(|(system, component)| MavId::new(system, component));
    let target = prop_oneof![
        2 => Just(None),
        1 => Just(Some((0, 0))),
        1 => id().prop_map(|(system, _)| Some((system, 0))),
        4 => id().prop_map(Some),
    ];
    // Mostly at once, and now and then long enough that routes move or expire.
    let after = prop_oneof![8 => 0u64..500, 1 => 4_000u64..70_000].prop_map(Duration::from_millis);
    let said = (after, 0usize..6, source, target, any::<bool>())
        .prop_map(|(after, from, source, target, signed)| Said { after, from, source, target, signed });
    prop::collection::vec(said, 1..60)
}
