//! What is said to find out who is at the other end of a line, and what is made of the answers.
//!
//! A plain value: bytes and the time go in, frames come out. Sends HEARTBEAT and, to those that were heard, a request
//! for `GIMBAL_DEVICE_INFORMATION`; a gimbal that does not answer it is asked for parameters that only certain makes
//! have. Nothing is sent that moves anything.
//!
//! A v1 gimbal waits for the heartbeat of a vehicle, so every other heartbeat has `MAV_TYPE_GENERIC`, with
//! `MAV_AUTOPILOT_INVALID` as the others: nobody takes it for an autopilot.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::gimbals::gremsy;
use crate::gimbals::gremsy::parameters::ParameterTable;
use crate::gimbals::mavlink_v2::packet;
use crate::gimbals::report::Identity;
use crate::gimbals::settings::Family;
use crate::timestamp::Timestamp;
use crate::wire::decoder::Patience;
use crate::wire::dialect::{CharArray, HEARTBEAT_DATA, MavMessage, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use crate::wire::ids::{component, mav_autopilot, mav_state, mav_type, message};
use crate::wire::{Frame, FrameBuffer, MavId, StreamDecoder, Target};

/// Who asks.
pub const SCANNER: MavId = MavId::new(1, component::ONBOARD_COMPUTER);

/// Whoever lives beats once a second; after this nobody is expected at this baud rate any more.
pub const SILENCE: Duration = Duration::from_millis(2_500);
/// How long the parties on a line have to show themselves, and to answer, from the first frame on.
const INTRODUCTION: Duration = Duration::from_millis(2_500);
/// How long others on the line have to show themselves when a gimbal has told what it is.
const OTHERS: Duration = Duration::from_millis(1_100);
/// How often a Gremsy is asked to tell where it looks, until it is switched off.
const STATUS_INTERVAL: Duration = Duration::from_millis(100);
/// Each kind of heartbeat once a second.
const HEARTBEAT_INTERVAL: Duration = Duration::from_millis(500);
const REQUEST_INTERVAL: Duration = Duration::from_millis(500);

/// One attempt at one baud rate.
#[derive(Debug)]
pub struct Conversation {
    decoder: StreamDecoder,
    ends_at: Timestamp,
    heartbeat_at: Timestamp,
    /// Nothing is asked before somebody was heard.
    request_at: Option<Timestamp>,
    /// The next heartbeat is that of a vehicle.
    as_vehicle: bool,
    sequence: u8,
    unsent: VecDeque<Vec<u8>>,
    /// To know an echo.
    sent: Vec<Vec<u8>>,
    parties: BTreeMap<MavId, Party>,
}

/// Somebody on the line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Party {
    frames: u32,
    /// `MAV_TYPE` and `MAV_AUTOPILOT`.
    heartbeat: Option<(u8, u8)>,
    /// 283 or 285 about itself was heard from it.
    pub is_gimbal_device: bool,
    pub identity: Option<Identity>,
    /// It told where it looks by 285.
    tells_v2_attitude: bool,
    /// It told where it looks by a message of v1.
    tells_v1_attitude: bool,
    /// Which of the parameters it has that only Gremsy gimbals have.
    table: Option<ParameterTable>,
}

impl Party {
    /// One frame of noise has a right checksum now and then, two from the same source do not.
    fn is_real(&self) -> bool {
        self.heartbeat.is_some() || self.frames >= 2
    }

    pub fn is_autopilot(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, autopilot)| {
            autopilot != mav_autopilot::INVALID && !mav_type::NOT_A_VEHICLE.contains(&kind)
        })
    }

    /// Whether it is a gimbal, whatever it speaks.
    pub fn is_gimbal(&self) -> bool {
        self.is_gimbal_device || self.table.is_some() || self.beats_as_gimbal()
    }

    fn beats_as_gimbal(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, _)| kind == mav_type::GIMBAL)
    }

    fn is_gremsy(&self) -> bool {
        self.table.is_some() || self.identity.as_ref().is_some_and(|identity| gremsy::is_vendor(&identity.vendor))
    }

    /// What it speaks, and which generation of that.
    pub fn speaks(&self) -> &'static str {
        match (self.is_gremsy(), self.is_gimbal_device) {
            // Both generations say who they are.
            (true, _) if self.tells_v2_attitude => "gremsy v2",
            (true, _) => "gremsy v1",
            (false, true) => Family::MavlinkV2.name(),
            (false, false) => Family::MavlinkV1.name(),
        }
    }

    /// What its entry in the configuration says; `None` in doubt.
    pub fn family(&self) -> Option<Family> {
        match (self.is_gremsy(), self.is_gimbal_device) {
            _ if self.is_doubtful() => None,
            (true, _) => Some(Family::Gremsy),
            (false, true) => Some(Family::MavlinkV2),
            (false, false) => Some(Family::MavlinkV1),
        }
    }

    #[cfg(test)]
    pub fn beating_as_gimbal() -> Self {
        Self { heartbeat: Some((mav_type::GIMBAL, mav_autopilot::INVALID)), ..Self::default() }
    }

    /// Nothing that it said tells a v1 gimbal from a v2 device that has not answered yet.
    pub fn is_doubtful(&self) -> bool {
        self.beats_as_gimbal() && !self.is_gimbal_device && self.table.is_none() && !self.tells_v1_attitude
    }

    pub fn is_ground_station(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, _)| kind == mav_type::GCS)
    }
}

impl Conversation {
    pub fn new(now: Timestamp, baud: u32) -> Self {
        Self {
            decoder: StreamDecoder::new(Patience::Serial { baud }),
            ends_at: now + SILENCE,
            heartbeat_at: now,
            request_at: None,
            as_vehicle: false,
            sequence: 0,
            unsent: VecDeque::new(),
            sent: Vec::new(),
            parties: BTreeMap::new(),
        }
    }

    pub fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        self.decoder.push(now, bytes);
        self.read_frames(now);
    }

    pub fn handle_timeout(&mut self, now: Timestamp) {
        self.decoder.handle_timeout(now);
        self.read_frames(now);
        if now >= self.heartbeat_at {
            self.heartbeat_at = now + HEARTBEAT_INTERVAL;
            self.send(&MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: if self.as_vehicle { mav_type::GENERIC } else { mav_type::ONBOARD_CONTROLLER },
                autopilot: mav_autopilot::INVALID,
                base_mode: 0,
                system_status: mav_state::ACTIVE,
                mavlink_version: 3,
            }));
            self.as_vehicle = !self.as_vehicle;
        }
        if self.request_at.is_some_and(|at| now >= at) {
            self.request_at = Some(now + REQUEST_INTERVAL);
            self.send(&packet::request_message(Target::Everyone, message::GIMBAL_DEVICE_INFORMATION));
            self.ask_parameters();
            self.ask_generation();
        }
    }

    /// The next frame to send.
    pub fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.unsent.pop_front()
    }

    pub fn poll_timeout(&self) -> Timestamp {
        let timers = [self.decoder.poll_timeout(), self.request_at, Some(self.heartbeat_at), Some(self.ends_at)];
        timers.into_iter().flatten().min().unwrap_or(self.ends_at)
    }

    pub fn is_over(&self, now: Timestamp) -> bool {
        now >= self.ends_at
    }

    /// Who was there; empty when nobody speaks MAVLink at this baud rate.
    pub fn into_parties(self) -> BTreeMap<MavId, Party> {
        self.parties.into_iter().filter(|(_, party)| party.is_real()).collect()
    }

    fn read_frames(&mut self, now: Timestamp) {
        let mut decoder = std::mem::take(&mut self.decoder);
        while let Some(frame) = decoder.next_frame() {
            // A frame that no definition describes has no checksum to tell it from noise.
            if frame.is_known() && !self.sent.iter().any(|sent| sent == frame.bytes()) {
                self.note(now, &frame);
            }
        }
        self.decoder = decoder;
    }

    /// Asks those that beat as gimbals and have not said more for the parameters by which their make is known.
    fn ask_parameters(&mut self) {
        let silent = |party: &Party| party.beats_as_gimbal() && !party.is_gimbal_device && party.table.is_none();
        let asked: Vec<MavId> = self.parties.iter().filter(|(_, party)| silent(party)).map(|(id, _)| *id).collect();
        for device in asked {
            for name in ParameterTable::TELLING_NAMES {
                self.send(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
                    param_index: -1,
                    target_system: device.system,
                    target_component: device.component,
                    param_id: CharArray::from(name),
                }));
            }
        }
    }

    /// Asks a Gremsy for 285, which only the second generation has and which some models send only when asked.
    fn ask_generation(&mut self) {
        let unknown = |party: &Party| party.is_gremsy() && !party.tells_v2_attitude;
        let asked: Vec<MavId> = self.parties.iter().filter(|(_, party)| unknown(party)).map(|(id, _)| *id).collect();
        for device in asked {
            let status = message::GIMBAL_DEVICE_ATTITUDE_STATUS;
            self.send(&MavMessage::COMMAND_LONG(packet::set_message_interval(device, status, STATUS_INTERVAL)));
        }
    }

    fn note(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if self.request_at.is_none() {
            self.request_at = Some(now);
            self.ends_at = now + INTRODUCTION;
        }
        let party = self.parties.entry(frame.source()).or_default();
        party.frames = party.frames.saturating_add(1);
        if let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() {
            party.heartbeat = Some((heartbeat.mavtype, heartbeat.autopilot));
        }
        // With another id it is said for a gimbal without MAVLink, by its manager.
        let information = packet::read_information(frame).filter(|information| information.gimbal_device_id == 0);
        let tells_attitude = packet::read_status(frame).is_some_and(|status| status.gimbal_device_id == 0);
        party.is_gimbal_device |= information.is_some() || tells_attitude;
        party.tells_v2_attitude |= tells_attitude;
        if let Some(information) = information {
            let is_first = party.identity.is_none();
            party.identity = Some(information.identity);
            if is_first && (!party.is_gremsy() || party.tells_v2_attitude) {
                self.ends_at = self.ends_at.min(now + OTHERS);
            }
        }
        match frame.message_id() {
            message::MOUNT_ORIENTATION | message::MOUNT_STATUS => party.tells_v1_attitude = true,
            message::PARAM_VALUE => {
                let value = frame.decode::<PARAM_VALUE_DATA>();
                let name = value.as_ref().and_then(|value| value.param_id.to_str().ok());
                party.table = party.table.or(ParameterTable::recognised_by(name));
            }
            _ => {}
        }
    }

    fn send(&mut self, message: &MavMessage) {
        let frame = FrameBuffer::default().encode_any(SCANNER, self.sequence, message).bytes().to_vec();
        self.sequence = self.sequence.wrapping_add(1);
        self.sent.push(frame.clone());
        self.unsent.push_back(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let next =
                peer.poll_timeout().map_or(conversation.poll_timeout(), |at| at.min(conversation.poll_timeout()));
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
}
