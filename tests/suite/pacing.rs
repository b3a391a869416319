//! What a serial line carries when more is offered than fits on it.

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::bridge::{Bridge, ChannelId, Input, Output};
use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use gimbald::wire::ids::message;
use gimbald::wire::{FrameBuffer, MavId, StreamDecoder};

use crate::support::line::{Line, Offer, RECEIVER, control, control_waits, percentile, traffic};
use crate::support::script::{pitchyaw, set_interval};
use crate::support::wire::Random;
use crate::support::world::{Arrival, GCS, GIMBAL, MANAGER, World, heartbeat, link, three_links};

/// How late the core is woken at most; a machine that flies is busy.
const WORST_WAKE_UP_US: u64 = 300;

/// "age of control frames at the gimbal, beyond their own wire time and what is left of the frame on the wire, with 400
/// broadcasts/s of 20 to 100 bytes offered to a line that drains 11,520 B/s: p99 under 15 ms; no broken frame".
#[test]
fn control_waits_for_little_more_than_the_frame_in_progress() {
    for seed in 0..3 {
        let mut rig = Rig::new(115_200);
        let offers = traffic(seed, Duration::from_secs(60));
        rig.run(&offers, seed);

        let waits = control_waits(&offers, &rig.line.passages);
        assert_eq!(waits.len(), 3_000, "every control frame arrives");
        let p99 = percentile(&waits, 0.99);
        assert!(p99 < Duration::from_millis(15), "{p99:?}");
        // At worst a whole frame was given out ahead, which the line had not begun.
        assert!(waits[2_999] < Duration::from_millis(15), "{:?}", waits[2_999]);
        let filled = rig.bytes_until(Timestamp::from_secs(60)) as f64 / (60.0 * 11_520.0);
        assert!(filled > 0.9, "{filled}");
        rig.check_whole_frames();
        rig.check_accounts(&offers);
    }
}

/// The same on a line of half the speed, and on one that has room for everything.
#[test]
fn slower_and_faster_lines_keep_the_same_order() {
    let mut rig = Rig::new(57_600);
    let offers = traffic(1, Duration::from_secs(60));
    rig.run(&offers, 1);
    let waits = control_waits(&offers, &rig.line.passages);
    assert_eq!(waits.len(), 3_000);
    // A frame of 100 bytes takes 17.4 ms.
    assert!(percentile(&waits, 0.99) < Duration::from_millis(19), "{:?}", percentile(&waits, 0.99));
    assert!(rig.bytes_until(Timestamp::from_secs(60)) as f64 > 0.9 * 60.0 * 5_760.0);
    rig.check_whole_frames();
    rig.check_accounts(&offers);

    let mut rig = Rig::new(921_600);
    rig.run(&offers, 1);
    assert_eq!(rig.arrived(), offers.len(), "nothing is dropped");
    let waits = control_waits(&offers, &rig.line.passages);
    assert!(waits[waits.len() - 1] < Duration::from_millis(3), "{:?}", waits[waits.len() - 1]);
    rig.check_whole_frames();
    rig.check_accounts(&offers);
}

/// A hundred commands at once, in front of waiting telemetry: all arrive, in order, as fast as the line allows.
#[test]
fn a_burst_of_a_hundred_commands_arrives() {
    let mut rig = Rig::new(115_200);
    let mut offers = traffic(5, Duration::from_secs(2));
    offers.retain(|offer| !offer.is_control);
    let at = Timestamp::from_secs(1);
    let burst = (0..100).map(|number| Offer { at, bytes: control(number), is_control: true });
    let place = offers.partition_point(|offer| offer.at <= at);
    offers.splice(place..place, burst);
    rig.run(&offers, 5);

    let commands: Vec<_> =
        rig.line.passages.iter().filter(|passage| passage.bytes.len() == 45 && passage.bytes[7] == 76).collect();
    let numbers: Vec<Vec<u8>> = commands.iter().map(|passage| passage.bytes.clone()).collect();
    assert_eq!(numbers, (0..100).map(control).collect::<Vec<_>>());
    // 4,500 bytes take 391 ms; 4 % is left free, and the frame in progress comes first.
    let last = commands[99].end.since(at);
    assert!(last < Duration::from_millis(391 * 104 / 100 + 20), "{last:?}");
    rig.check_accounts(&offers);
}

/// Protocol checklist 155: "When a link's output queue is full, stream frames are dropped before COMMAND_* and the other
/// links are not delayed by more than 5 ms."
#[test]
fn item_155_telemetry_gives_way_to_commands() {
    let mut rig = Rig::new(57_600);
    let mut offers = traffic(9, Duration::from_secs(1));
    offers.retain(|offer| !offer.is_control);
    let at = Timestamp::from_secs(1);
    offers.extend((0..120).map(|number| Offer { at, bytes: control(number), is_control: true }));
    rig.run(&offers, 9);

    let commands = rig.line.passages.iter().filter(|passage| passage.bytes[7] == 76).count();
    assert_eq!(commands, 120, "no command is dropped");
    assert!(rig.dropped()["queue_full"] > 0, "telemetry is");
    let telemetry = offers.iter().filter(|offer| !offer.is_control);
    let offered_at: Vec<Timestamp> = telemetry.map(|offer| offer.at).collect();
    assert_eq!(rig.elsewhere, offered_at, "the other link gets all of it at once");
    rig.check_accounts(&offers);
}

/// R20: "so that a gimbal is stopped however much others send it": with 3000 commands a second offered to a gimbal's line, ours
/// wait for little more than the frame in progress, and the gimbal still hears its manager's heartbeat.
#[test]
fn our_stop_passes_a_flood_of_commands() {
    let mut settings = three_links();
    settings.links[1].transport = Transport::Serial { baud: 115_200 };
    let (mut world, places) = World::with_one_gimbal(settings);
    let flooder = MavId::new(253, 190);
    let flood = set_interval(GIMBAL, 27, 100_000.0);
    let every = Duration::from_micros(333);
    let turn = |rate: f32| pitchyaw(f32::NAN, f32::NAN, 0.0, rate, 44.0);
    world.send(places.ground, GCS, &turn(5.0));
    world.run_with(Duration::from_millis(2_100), &[(every, places.ground, flooder, flood.clone())]);
    let arrivals = world.take(places.gimbal);
    let beats = arrivals.iter().filter(|arrival| arrival.source() == MANAGER && arrival.id() == message::HEARTBEAT);
    assert_eq!(beats.count(), 2, "one a second");

    let asked_at = world.now;
    world.send(places.ground, GCS, &turn(0.0));
    world.run_with(Duration::from_millis(100), &[(every, places.ground, flooder, flood)]);
    let arrivals = world.take(places.gimbal);
    let is_stop = |arrival: &&Arrival| {
        arrival.id() == message::GIMBAL_DEVICE_SET_ATTITUDE
            && arrival.decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>().angular_velocity_z == 0.0
    };
    let stop = arrivals.iter().find(is_stop).expect("the gimbal is stopped");
    assert!(stop.at.since(asked_at) < Duration::from_millis(10), "after {:?}", stop.at.since(asked_at));
    let foreign = arrivals.iter().filter(|arrival| arrival.source() == flooder).count();
    assert!(foreign > 10, "others have their share: {foreign}");
}

/// "old frames discarded on reopening": what waited when the line went down is counted and not sent later.
#[test]
fn nothing_old_is_sent_on_a_line_that_came_back() {
    let mut rig = Rig::new(57_600);
    let offers = traffic(3, Duration::from_secs(4));
    let (before, rest) = offers.split_at(offers.partition_point(|offer| offer.at < Timestamp::from_secs(1)));
    let (during, after) = rest.split_at(rest.partition_point(|offer| offer.at < Timestamp::from_secs(2)));
    let mut random = Random::new(3);
    rig.offer(before, &mut random);
    rig.run_until(Timestamp::from_secs(1), &mut random);
    let sent_before = rig.line.passages.len();
    rig.input(Timestamp::from_secs(1), Input::ChannelClosed { channel: channel(SERIAL) });
    rig.input(Timestamp::from_secs(1), Input::LinkDown { link: SERIAL, reason: "unplugged" });
    rig.offer(during, &mut random);
    assert_eq!(rig.line.passages.len(), sent_before, "nothing is sent on a line that is down");
    assert!(rig.dropped()["link_down"] > 0);

    rig.open(Timestamp::from_secs(2));
    rig.offer(after, &mut random);
    rig.run_until(Timestamp::from_secs(6), &mut random);

    let old: Vec<&[u8]> = before.iter().chain(during).map(|offer| &offer.bytes[..]).collect();
    let resent = rig.line.passages[sent_before..].iter().filter(|passage| old.contains(&&passage.bytes[..])).count();
    assert_eq!(resent, 0);
    // While it was down nothing was offered to the line.
    let offered = before.len() + after.len();
    assert_eq!(rig.arrived() + rig.dropped().values().sum::<u64>() as usize, offered, "{:?}", rig.dropped());
    rig.check_whole_frames();
}

/// The places of the links and of their channels.
const SERIAL: usize = 0;
const GROUND: usize = 1;
const ELSEWHERE: usize = 2;

fn channel(index: usize) -> ChannelId {
    ChannelId::new(index).expect("below the bound")
}

/// A core between a ground station, a serial line with somebody at its far end, and one more link.
struct Rig {
    bridge: Bridge,
    line: Line,
    /// When anything was sent on the third link.
    elsewhere: Vec<Timestamp>,
}

impl Rig {
    fn new(baud: u32) -> Self {
        let settings = Settings {
            system_id: SystemId::Fixed(1),
            links: vec![
                link("serial", Role::Peer, Transport::Serial { baud }),
                link("ground", Role::Ground, Transport::Datagrams),
                link("elsewhere", Role::Ground, Transport::Datagrams),
            ],
            ..Settings::default()
        };
        let bridge = Bridge::new(Timestamp::ZERO, settings);
        let mut rig = Self { bridge, line: Line::new(u64::from(baud) / 10), elsewhere: Vec::new() };
        for link in [GROUND, ELSEWHERE] {
            rig.input(Timestamp::ZERO, Input::LinkUp { link });
            rig.input(Timestamp::ZERO, Input::ChannelOpened { channel: channel(link), link, address: "test" });
        }
        rig.open(Timestamp::ZERO);
        rig
    }

    /// The line comes up, and its far end speaks.
    fn open(&mut self, now: Timestamp) {
        self.input(now, Input::LinkUp { link: SERIAL });
        self.input(now, Input::ChannelOpened { channel: channel(SERIAL), link: SERIAL, address: "test" });
        let mut buffer = FrameBuffer::default();
        let hello = buffer.encode_any(RECEIVER, 0, &heartbeat(18, 8));
        self.bridge.handle_input(now, Input::Received { channel: channel(SERIAL), bytes: hello.bytes() });
        while self.bridge.poll_output().is_some() {}
    }

    fn input(&mut self, now: Timestamp, input: Input<'_>) {
        self.bridge.handle_input(now, input);
        self.carry(now);
    }

    /// Takes what is sent; our own messages are of no interest, but they use the line.
    fn carry(&mut self, now: Timestamp) {
        while let Some(output) = self.bridge.poll_output() {
            let Output::Transmit { channels, bytes } = output else { panic!("nothing else is done") };
            if channels.contains(channel(SERIAL)) {
                self.line.write(now, bytes);
            }
            if channels.contains(channel(ELSEWHERE)) && !is_ours(bytes) {
                self.elsewhere.push(now);
            }
        }
    }

    /// Lets the core's timers run; each wakes it a little late.
    fn run_until(&mut self, end: Timestamp, random: &mut Random) {
        while let Some(due) = self.bridge.poll_timeout() {
            let woken = due + Duration::from_micros(random.next() % WORST_WAKE_UP_US);
            if woken > end {
                return;
            }
            self.bridge.handle_timeout(woken);
            self.carry(woken);
        }
    }

    fn offer(&mut self, offers: &[Offer], random: &mut Random) {
        for offer in offers {
            self.run_until(offer.at, random);
            self.input(offer.at, Input::Received { channel: channel(GROUND), bytes: &offer.bytes });
        }
    }

    /// Offers everything, and lets the line finish.
    fn run(&mut self, offers: &[Offer], seed: u64) {
        let mut random = Random::new(seed);
        self.offer(offers, &mut random);
        let last = offers.last().expect("something is offered").at;
        self.run_until(last + Duration::from_secs(3), &mut random);
    }

    fn dropped(&self) -> BTreeMap<String, u64> {
        self.bridge.snapshot(Timestamp::ZERO).links[0].dropped.clone()
    }

    /// How many of the offered frames arrived.
    fn arrived(&self) -> usize {
        self.line.passages.iter().filter(|passage| !is_ours(&passage.bytes)).count()
    }

    fn bytes_until(&self, end: Timestamp) -> usize {
        let passages = self.line.passages.iter().filter(|passage| passage.end <= end);
        passages.map(|passage| passage.bytes.len()).sum()
    }

    /// "every drop counted with its reason": what was offered arrived or was counted.
    fn check_accounts(&self, offers: &[Offer]) {
        let dropped = self.dropped();
        assert!(dropped.keys().all(|reason| ["queue_full", "stale"].contains(&&reason[..])), "{dropped:?}");
        let counted = dropped.values().sum::<u64>() as usize;
        // Our own heartbeats replace each other or arrive; no other frame of ours is sent here.
        assert_eq!(self.arrived() + counted, offers.len(), "{dropped:?}");
    }

    /// "no broken frame": the far end finds whole frames and nothing between them.
    fn check_whole_frames(&self) {
        let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
        for passage in &self.line.passages {
            decoder.push(passage.end, &passage.bytes);
            assert_eq!(decoder.next_frame().map(|frame| frame.bytes().to_vec()), Some(passage.bytes.clone()));
        }
        assert_eq!(decoder.counters().resync_bytes, 0);
    }
}

fn is_ours(bytes: &[u8]) -> bool {
    bytes[5..7] == [1, 191]
}
