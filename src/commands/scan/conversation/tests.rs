use super::*;
use crate::gimbals::gremsy;
use crate::gimbals::mavlink_v1::sim as v1;
use crate::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use crate::sim::peer::Peer;
use crate::sim::vehicle::{Vehicle, VehicleSettings};
use crate::wire::DatagramFrames;
use crate::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA};
use crate::wire::ids::command;

/// Frames with the time when they were sent.
type Sent = Vec<(Timestamp, Vec<u8>)>;

/// Runs a conversation with `peer` to its end: when that was, who was there, and what was sent when.
fn run(peer: impl Peer) -> (Timestamp, BTreeMap<MavId, Party>, Sent) {
    run_from(Timestamp::ZERO, peer)
}

fn run_from(mut now: Timestamp, mut peer: impl Peer) -> (Timestamp, BTreeMap<MavId, Party>, Sent) {
    let mut conversation = Conversation::new(now, 115_200);
    let mut sent = Sent::new();
    loop {
        peer.handle_timeout(now);
        conversation.handle_timeout(now);
        loop {
            let (asked, answered) = (conversation.poll_output(), peer.poll_output());
            if asked.is_none() && answered.is_none() {
                break;
            }
            if let Some(bytes) = asked {
                peer.handle_received(now, &bytes);
                sent.push((now, bytes));
            }
            if let Some(bytes) = answered {
                conversation.handle_received(now, &bytes);
            }
        }
        if conversation.is_over(now) {
            return (now, conversation.into_parties(), sent);
        }
        let next = peer.poll_timeout().map_or(conversation.poll_timeout(), |at| at.min(conversation.poll_timeout()));
        now = next.max(now);
    }
}

/// Says nothing.
struct Nobody;

impl Peer for Nobody {
    fn handle_received(&mut self, _now: Timestamp, _bytes: &[u8]) {}
    fn handle_timeout(&mut self, _now: Timestamp) {}
    fn poll_output(&mut self) -> Option<Vec<u8>> {
        None
    }
    fn poll_timeout(&self) -> Option<Timestamp> {
        None
    }
    fn handle_reboot(&mut self, _now: Timestamp) {}
}

/// Gives back everything, as a login prompt does.
#[derive(Default)]
struct Echo(VecDeque<Vec<u8>>);

impl Peer for Echo {
    fn handle_received(&mut self, _now: Timestamp, bytes: &[u8]) {
        self.0.push_back(bytes.to_vec());
    }
    fn handle_timeout(&mut self, _now: Timestamp) {}
    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.0.pop_front()
    }
    fn poll_timeout(&self) -> Option<Timestamp> {
        None
    }
    fn handle_reboot(&mut self, _now: Timestamp) {}
}

fn ids(sent: &[(Timestamp, Vec<u8>)]) -> Vec<u32> {
    let id = |bytes: &[u8]| DatagramFrames::new(bytes).next_frame().expect("whole frames").message_id();
    sent.iter().map(|(_, bytes)| id(bytes)).collect()
}

/// A gimbal may be silent until it hears a heartbeat.
#[test]
fn a_gimbal_that_listens_first_is_found() {
    let settings = DeviceSettings { listens_first: None, ..DeviceSettings::default() };
    let (end, parties, _) = run(Device::new(Timestamp::ZERO, settings));

    let party = &parties[&MavId::new(1, component::GIMBAL)];
    assert!(party.is_gimbal_device && !party.is_autopilot());
    assert_eq!(party.identity.as_ref().map(|identity| identity.model.as_str()), Some("Simulated v2"));
    assert_eq!(parties.len(), 1);
    assert!(end < Timestamp::ZERO + SILENCE, "{end:?}");
}

/// "Wait for a HEARTBEAT. Ignore type 6 (GCS); accept 1, 2 and other vehicle types": it is woken, and known by what it
/// says of its attitude.
#[test]
fn a_v1_gimbal_that_waits_for_a_vehicle_is_found() {
    for (feedback, doubtful) in [(v1::Feedback::Orientation, false), (v1::Feedback::Nothing, true)] {
        let settings = v1::DeviceSettings { feedback, ..v1::DeviceSettings::default() };
        let (end, parties, _) = run(v1::Device::new(Timestamp::ZERO, settings));

        let party = &parties[&MavId::new(1, component::GIMBAL)];
        assert!(party.is_gimbal() && !party.is_gimbal_device);
        assert_eq!((party.speaks(), party.is_doubtful()), ("mavlink_v1", doubtful));
        assert!(end <= Timestamp::ZERO + SILENCE + INTRODUCTION, "{end:?}");
    }
}

/// "Finds … family, generation": both say who they are, and one of them only when it is asked.
#[test]
fn the_generations_of_a_gremsy_are_told_apart() {
    use gremsy::sim::{Device, DeviceSettings, Generation};
    for (generation, quiet, expected) in [
        (Generation::V1, false, "gremsy v1"),
        (Generation::V1, true, "gremsy v1"),
        (Generation::V2, false, "gremsy v2"),
        (Generation::V2, true, "gremsy v2"),
    ] {
        let settings = DeviceSettings { has_usual_streams: !quiet, ..DeviceSettings::of(generation) };
        let mut gimbal = Device::new(Timestamp::ZERO, settings);
        // It listens when it has started.
        let on = Timestamp::ZERO + Duration::from_secs(10);
        gimbal.handle_timeout(on);
        let (_, parties, _) = run_from(on, gimbal);

        assert_eq!(parties[&MavId::new(1, component::GIMBAL)].speaks(), expected, "{generation:?} {quiet}");
    }
}

#[test]
fn an_autopilot_is_no_gimbal() {
    let (end, parties, _) = run(Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));

    let party = &parties[&MavId::new(1, component::AUTOPILOT1)];
    assert!(party.is_autopilot() && !party.is_gimbal_device);
    assert!(end <= Timestamp::ZERO + SILENCE + INTRODUCTION);
}

/// "about 2.5 s silence".
#[test]
fn silence_ends_it_and_only_heartbeats_were_sent() {
    let (end, parties, sent) = run(Nobody);

    assert_eq!((end, parties), (Timestamp::ZERO + SILENCE, BTreeMap::new()));
    assert_eq!(ids(&sent), [message::HEARTBEAT; 6]);
}

#[test]
fn our_own_echo_is_nobody() {
    let (end, parties, sent) = run(Echo::default());

    assert_eq!((end, parties), (Timestamp::ZERO + SILENCE, BTreeMap::new()));
    assert_eq!(ids(&sent), [message::HEARTBEAT; 6]);
}

/// "Nothing that moves anything is ever sent."
#[test]
fn a_gimbal_is_asked_what_it_is_and_nothing_else() {
    let (_, _, sent) = run(Device::new(Timestamp::ZERO, DeviceSettings::default()));
    let mut requests = 0;
    for (_, bytes) in &sent {
        let frame = DatagramFrames::new(bytes).next_frame().expect("whole frames");
        assert_eq!(frame.source(), SCANNER);
        if let Some(request) = frame.decode::<COMMAND_LONG_DATA>() {
            assert_eq!((request.command, request.param1), (command::REQUEST_MESSAGE, 283.0));
            assert_eq!((request.target_system, request.target_component), (0, 0));
            requests += 1;
        } else {
            let heartbeat: HEARTBEAT_DATA = frame.decode().expect("a heartbeat or a request");
            assert!(matches!(heartbeat.mavtype, 18 | 0), "{heartbeat:?}");
            assert_eq!((heartbeat.autopilot, heartbeat.base_mode), (8, 0));
        }
    }
    assert!(requests > 0);
}

/// "Gimbal device id: 1 to 6 for gimbals without MAVLink": of those a manager speaks, such as an autopilot's own, which is no
/// gimbal itself.
#[test]
fn who_speaks_for_a_gimbal_is_none() {
    for (gimbal_device_id, is_gimbal) in [(0, true), (1, false)] {
        let mut conversation = Conversation::new(Timestamp::ZERO, 57_600);
        let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: 1,
            q: [1.0, 0.0, 0.0, 0.0],
            angular_velocity_x: f32::NAN,
            angular_velocity_y: f32::NAN,
            angular_velocity_z: f32::NAN,
            failure_flags: 0,
            flags: 44,
            target_system: 0,
            target_component: 0,
            delta_yaw: f32::NAN,
            delta_yaw_velocity: f32::NAN,
            gimbal_device_id,
        });
        for sequence in 0..2 {
            let frame = FrameBuffer::default().encode_any(MavId::new(1, 1), sequence, &status).bytes().to_vec();
            conversation.handle_received(Timestamp::ZERO, &frame);
        }
        let parties = conversation.into_parties();
        assert_eq!(parties[&MavId::new(1, 1)].is_gimbal(), is_gimbal, "{gimbal_device_id}");
    }
}

/// A checksum of 16 bits is right by chance now and then.
#[test]
fn one_frame_that_is_no_heartbeat_is_not_an_answer() {
    let mut conversation = Conversation::new(Timestamp::ZERO, 57_600);
    let request = packet::request_message(Target::Everyone, 1);
    let chance = FrameBuffer::default().encode_any(MavId::new(77, 99), 0, &request).bytes().to_vec();
    conversation.handle_received(Timestamp::ZERO, &chance);
    assert_eq!(conversation.into_parties(), BTreeMap::new());
}
