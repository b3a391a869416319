//! `REQUEST_DATA_STREAM`: what a v1 gimbal asks of the vehicle, and what we ask of an autopilot that knows nothing newer.

use gimbald::gimbals::mavlink_v1::sim::{Device, DeviceSettings};
use gimbald::sim::vehicle::{Autopilot, Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{ATTITUDE_DATA, COMMAND_LONG_DATA, GLOBAL_POSITION_INT_DATA, REQUEST_DATA_STREAM_DATA};

use super::*;
use crate::support::script::{DENIED, UNSUPPORTED, ardupilot_heartbeat, global_position};
use crate::support::world::Place;

const EXTRA1: u8 = 10;
const POSITION: u8 = 6;

/// Gimbal statement 45: "REQUEST_DATA_STREAM EXTRA1 10 Hz from the gimbal yields ATTITUDE at 10 ± 1 Hz on that link, addressed
/// passthrough unchanged", with an autopilot that knows the message (ArduPilot) and with one that does not (PX4), which is
/// asked by 511 in its place where it is too slow.
#[test]
fn statement_45_a_v1_gimbal_has_the_streams_that_it_asks_for() {
    for autopilot in [Autopilot::ArduPilot, Autopilot::Px4] {
        let (mut world, places) = World::empty(Settings { gimbals: vec![v1_gimbal()], ..three_links() });
        let vehicle = VehicleSettings { autopilot, ..VehicleSettings::default() };
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle));
        let gimbal = DeviceSettings { asks_for_streams: true, ..DeviceSettings::default() };
        world.install(places.gimbal, Device::new(Timestamp::ZERO, gimbal));
        world.run_for(3 * SECOND);

        let asked: Vec<_> =
            world.take(places.autopilot).into_iter().filter(|arrival| arrival.source() == GIMBAL).collect();
        let requests: Vec<REQUEST_DATA_STREAM_DATA> = of(&asked);
        let requests: Vec<_> = requests
            .iter()
            .map(|asked| (asked.req_stream_id, asked.req_message_rate, asked.target_system, asked.target_component))
            .collect();
        assert_eq!(requests, [(EXTRA1, 10, 1, 1), (POSITION, 2, 1, 1)], "{autopilot:?}");

        world.forget();
        world.run_for(10 * SECOND);
        let heard = world.take(places.gimbal);
        assert!(heard.iter().filter(|arrival| [30, 33].contains(&arrival.id())).all(|at| at.source() == AUTOPILOT));
        let (attitudes, positions) = (of::<ATTITUDE_DATA>(&heard).len(), of::<GLOBAL_POSITION_INT_DATA>(&heard).len());
        assert!((90..=110).contains(&attitudes), "{autopilot:?}: {attitudes} in 10 s");
        assert!((18..=22).contains(&positions), "{autopilot:?}: {positions} in 10 s");
    }
}

/// The golden request of a gimbal goes to the autopilot byte for byte, and opens its link to that one message of the
/// autopilot; nobody else's attitude passes, nor any to a gimbal that did not ask.
#[test]
fn statement_45_only_what_was_asked_for_passes_to_the_gimbal() {
    const GOLDEN: [u8; 18] =
        [0xFD, 0x06, 0x00, 0x00, 0x15, 0x01, 0x9A, 0x42, 0x00, 0x00, 0x0A, 0x00, 0x01, 0x01, 0x0A, 0x01, 0xDD, 0x1B];
    let (mut world, places) = with_gimbal(v1_gimbal());
    turn_vehicle(&mut world, places, 0.0);
    world.forget();
    let attitude = |at: Timestamp| {
        MavMessage::ATTITUDE(ATTITUDE_DATA {
            time_boot_ms: at.boot_ms(),
            roll: 0.0,
            pitch: 0.0,
            yaw: 0.0,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: 0.0,
        })
    };
    let passes = |world: &mut World, source: MavId, message: &MavMessage| {
        world.forget();
        let bytes = world.send(places.autopilot, source, message);
        let heard = world.take(places.gimbal);
        heard.iter().any(|arrival| arrival.bytes == bytes)
    };
    let now = world.now;
    assert!(!passes(&mut world, AUTOPILOT, &attitude(now)), "nobody has asked");
    world.forget();
    world.send_bytes(places.gimbal, &GOLDEN);
    let at_autopilot: Vec<_> = world.take(places.autopilot).into_iter().map(|arrival| arrival.bytes).collect();
    assert_eq!(at_autopilot, [GOLDEN.to_vec()]);

    world.run_for(SECOND / 10);
    let now = world.now;
    assert!(passes(&mut world, AUTOPILOT, &attitude(now)));
    assert!(!passes(&mut world, AUTOPILOT, &attitude(now)), "too soon after the other");
    world.run_for(SECOND / 10);
    let now = world.now;
    assert!(!passes(&mut world, MavId::new(1, 2), &attitude(now)), "not of another component");
    assert!(!passes(&mut world, AUTOPILOT, &global_position(now, [47.0, 8.0, 500.0], 10.0)), "not asked for");
    assert!(passes(&mut world, AUTOPILOT, &attitude(now)));
    // What a client asks does not open it, nor what it asks itself of another than the autopilot.
    for (asker, [target_system, target_component], opens) in [
        (GCS, [1, 1], false),
        (GIMBAL, [1, 2], false),
        (GIMBAL, [2, 1], false),
        (GIMBAL, [1, 0], true),
        (GIMBAL, [0, 0], true),
    ] {
        let (mut world, places) = with_gimbal(v1_gimbal());
        turn_vehicle(&mut world, places, 0.0);
        let (req_message_rate, req_stream_id) = (10, EXTRA1);
        let request = REQUEST_DATA_STREAM_DATA {
            req_message_rate,
            target_system,
            target_component,
            req_stream_id,
            start_stop: 1,
        };
        let from = if asker == GCS { places.ground } else { places.gimbal };
        world.send(from, asker, &MavMessage::REQUEST_DATA_STREAM(request));
        world.forget();
        let bytes = world.send(places.autopilot, AUTOPILOT, &attitude(world.now));
        let passed = world.take(places.gimbal).iter().any(|arrival| arrival.bytes == bytes);
        assert_eq!(passed, opens, "{asker} asks {target_system}/{target_component}");
    }
}

/// An autopilot that does not know the request (PX4) is asked in the gimbal's place, for what comes too slowly; what a ground
/// station asks for is its own affair, and the gimbal does not get it.
#[test]
fn what_a_gimbal_asks_for_is_asked_again_where_the_autopilot_does_not_know_how() {
    for (asker, expected) in [(Some(GIMBAL), vec![(30, 100_000.0)]), (None, vec![]), (Some(GCS), vec![])] {
        let (mut world, places) = with_gimbal(v1_gimbal());
        let (mut asked, end) = (Vec::new(), world.now + 4 * SECOND);
        while world.now < end {
            turn_vehicle(&mut world, places, 0.0);
            let time_boot_ms = world.now.boot_ms();
            let attitude = ATTITUDE_DATA {
                time_boot_ms,
                roll: 0.0,
                pitch: 0.0,
                yaw: 0.0,
                rollspeed: 0.0,
                pitchspeed: 0.0,
                yawspeed: 0.0,
            };
            world.send(places.autopilot, AUTOPILOT, &MavMessage::ATTITUDE(attitude));
            world.send(places.autopilot, AUTOPILOT, &global_position(world.now, [47.0, 8.0, 500.0], 10.0));
            if let Some(asker) = asker.filter(|_| asked.is_empty()) {
                let request = REQUEST_DATA_STREAM_DATA {
                    req_message_rate: 10,
                    target_system: 1,
                    target_component: 1,
                    req_stream_id: EXTRA1,
                    start_stop: 1,
                };
                let from = if asker == GCS { places.ground } else { places.gimbal };
                world.send(from, asker, &MavMessage::REQUEST_DATA_STREAM(request));
            }
            world.send(places.gimbal, GIMBAL, &heartbeat(26, 0));
            world.run_for(SECOND / 4);
            let commands: Vec<COMMAND_LONG_DATA> = world.take_messages(places.autopilot);
            let commands = commands.iter().filter(|command| command.command == 511 && command.confirmation == 0);
            asked.extend(commands.map(|command| (command.param1 as u32, command.param2)));
        }
        asked.dedup();
        assert_eq!(asked, expected, "{asker:?}");
        let told: Vec<ATTITUDE_DATA> = world.take_messages(places.gimbal);
        assert_eq!(told.is_empty(), asker != Some(GIMBAL), "{asker:?}");
    }
}

/// "REQUEST_DATA_STREAM towards old autopilots when a message interval is refused", or ignored: the group in which the
/// message comes, at the same rate, every 5 s until it comes.
#[test]
fn an_autopilot_without_message_intervals_is_asked_for_groups() {
    for answer in [Some(UNSUPPORTED), Some(DENIED), None] {
        let mut asked = Asked::new(answer);
        asked.run_for(30 * SECOND);
        let groups: Vec<_> = asked.groups.clone();
        for group in [(EXTRA1, 10), (POSITION, 5)] {
            let times = groups.iter().filter(|(_, asked)| *asked == group).count();
            let expected = if answer.is_some() { 4..=6 } else { 2..=4 };
            assert!(expected.contains(&times), "{answer:?}: {group:?} was asked for {times} times in {groups:?}");
        }
        assert!(groups.iter().all(|(_, group)| [(EXTRA1, 10), (POSITION, 5)].contains(group)), "{groups:?}");
        // Once refused, no command is sent again; one that ignores it may have lost it.
        let intervals = asked.intervals.iter().filter(|message_id| [30, 33].contains(*message_id)).count();
        match answer {
            Some(_) => assert_eq!(intervals, 2, "{:?}", asked.intervals),
            None => assert!(intervals > 6, "{:?}", asked.intervals),
        }

        // What comes is asked for no more.
        asked.sends = true;
        asked.run_for(6 * SECOND);
        asked.groups.clear();
        asked.run_for(20 * SECOND);
        assert_eq!(asked.groups, [], "{answer:?}");
    }
}

/// An autopilot that knows message intervals is asked by nothing else.
#[test]
fn an_autopilot_with_message_intervals_is_not_asked_for_groups() {
    let mut asked = Asked::new(Some(ACCEPTED));
    asked.sends = true;
    asked.run_for(20 * SECOND);
    assert_eq!(asked.groups, []);
}

/// An autopilot that beats, and answers every 511 alike.
struct Asked {
    world: World,
    autopilot: Place,
    answer: Option<u8>,
    /// It sends attitude and position.
    sends: bool,
    /// Group and rate of each 66 of ours, and when it came.
    groups: Vec<(Timestamp, (u8, u16))>,
    /// The message of each 511 of ours.
    intervals: Vec<u32>,
}

impl Asked {
    fn new(answer: Option<u8>) -> Self {
        let (world, places) = World::empty(three_links());
        Self { world, autopilot: places.autopilot, answer, sends: false, groups: Vec::new(), intervals: Vec::new() }
    }

    fn run_for(&mut self, duration: Duration) {
        let end = self.world.now + duration;
        while self.world.now < end {
            let now = self.world.now;
            self.world.send(self.autopilot, AUTOPILOT, &ardupilot_heartbeat());
            if self.sends {
                let attitude = ATTITUDE_DATA {
                    time_boot_ms: now.boot_ms(),
                    roll: 0.0,
                    pitch: 0.0,
                    yaw: 0.0,
                    rollspeed: 0.0,
                    pitchspeed: 0.0,
                    yawspeed: 0.0,
                };
                self.world.send(self.autopilot, AUTOPILOT, &MavMessage::ATTITUDE(attitude));
                self.world.send(self.autopilot, AUTOPILOT, &global_position(now, [47.0, 8.0, 500.0], 10.0));
            }
            self.world.run_for(SECOND / 5);
            for arrival in self.world.take(self.autopilot) {
                match arrival.id() {
                    66 => {
                        let request: REQUEST_DATA_STREAM_DATA = arrival.decode();
                        assert_eq!((request.target_system, request.target_component, request.start_stop), (1, 1, 1));
                        self.groups.push((arrival.at, (request.req_stream_id, request.req_message_rate)));
                    }
                    76 => {
                        let command: COMMAND_LONG_DATA = arrival.decode();
                        if command.command == 511 {
                            self.intervals.push(command.param1 as u32);
                        }
                        if let Some(answer) = self.answer {
                            let ack = MavMessage::COMMAND_ACK(ack(arrival.source(), command.command, answer));
                            self.world.send(self.autopilot, AUTOPILOT, &ack);
                        }
                    }
                    _ => {}
                }
            }
        }
    }
}
