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

use super::party::Party;
use crate::gimbals::gremsy::parameters::ParameterTable;
use crate::gimbals::mavlink_v2::packet;
use crate::timestamp::Timestamp;
use crate::wire::decoder::Patience;
use crate::wire::dialect::{CharArray, HEARTBEAT_DATA, MavMessage, PARAM_REQUEST_READ_DATA};
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
        for device in self.parties_that(Party::only_beats_as_gimbal) {
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
        for device in self.parties_that(Party::is_of_unknown_generation) {
            let status = message::GIMBAL_DEVICE_ATTITUDE_STATUS;
            self.send(&MavMessage::COMMAND_LONG(packet::set_message_interval(device, status, STATUS_INTERVAL)));
        }
    }

    fn parties_that(&self, is: fn(&Party) -> bool) -> Vec<MavId> {
        self.parties.iter().filter(|(_, party)| is(party)).map(|(id, _)| *id).collect()
    }

    fn note(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if self.request_at.is_none() {
            self.request_at = Some(now);
            self.ends_at = now + INTRODUCTION;
        }
        let party = self.parties.entry(frame.source()).or_default();
        let was_known = party.identity.is_some();
        party.handle_frame(frame);
        let is_introduced = !was_known && party.identity.is_some();
        if is_introduced && !party.is_of_unknown_generation() {
            self.ends_at = self.ends_at.min(now + OTHERS);
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
mod tests;
