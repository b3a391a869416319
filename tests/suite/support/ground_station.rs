//! A ground station that finds gimbals as QGroundControl does.
//!
//! "512 for 280 to the component of each heartbeat, 6 per component, one per heartbeat, ends when any 280 came from that
//! component; 511 for 281 to the manager, 6 times at least 1 s apart, tries 1 to 4 with 0, then 5 000 000 µs; 511 for 285 to
//! the device, 3 times; again 512 for 280, 3 times, if 281 or 285 came but not 280" (client notes A3). What comes under
//! another system id than the vehicle's is not looked at, and a vehicle is only made from a heartbeat of component 1 (A1).

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use gimbald::sim::peer::Peer;
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA,
    HEARTBEAT_DATA, MavMessage,
};
use gimbald::wire::{DatagramFrames, Frame, FrameBuffer, MavId};

use super::script::{NAN, command_long, ground_heartbeat, request_message, set_interval};
use super::world::GCS;

const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
const SPACING: Duration = Duration::from_secs(1);
const INFORMATION_TRIES: u32 = 6;
const STATUS_TRIES: u32 = 6;
const ATTITUDE_TRIES: u32 = 3;
const MORE_INFORMATION_TRIES: u32 = 3;

/// `MAV_TYPE` of what is no vehicle.
const NO_VEHICLES: [u8; 4] = [6, 18, 26, 27];

/// A scripted ground station.
pub struct GroundStation {
    id: MavId,
    next_heartbeat: Timestamp,
    sequence: u8,
    outgoing: VecDeque<Vec<u8>>,
    vehicles: BTreeMap<u8, Vehicle>,
    /// Command, result, and who answered.
    acks: Vec<(u16, u8, MavId)>,
}

#[derive(Default)]
struct Vehicle {
    /// How often each component was asked for 280; those that answered are at an end.
    asked: BTreeMap<u8, u32>,
    /// By manager and device id.
    gimbals: BTreeMap<(u8, u8), Gimbal>,
    /// By device id of components, whose manager is not known yet.
    attitudes: BTreeMap<u8, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>,
}

/// What the station knows of one gimbal.
#[derive(Clone, Default)]
pub struct Gimbal {
    pub information: Option<GIMBAL_MANAGER_INFORMATION_DATA>,
    pub status: Option<GIMBAL_MANAGER_STATUS_DATA>,
    pub attitude: Option<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>,
    status_tries: u32,
    status_asked: Option<Timestamp>,
    attitude_tries: u32,
    information_tries: u32,
}

impl Gimbal {
    fn is_complete(&self) -> bool {
        self.information.is_some() && self.status.is_some() && self.attitude.is_some()
    }
}

impl GroundStation {
    pub fn new(now: Timestamp) -> Self {
        Self {
            id: GCS,
            next_heartbeat: now,
            sequence: 0,
            outgoing: VecDeque::new(),
            vehicles: BTreeMap::new(),
            acks: Vec::new(),
        }
    }

    /// The gimbals that it shows: system, manager, device id.
    pub fn gimbals(&self) -> Vec<(u8, u8, u8)> {
        let of_vehicle = |(system, vehicle): (&u8, &Vehicle)| {
            let complete = vehicle.gimbals.iter().filter(|(_, gimbal)| gimbal.is_complete());
            complete.map(|((manager, device), _)| (*system, *manager, *device)).collect::<Vec<_>>()
        };
        self.vehicles.iter().flat_map(of_vehicle).collect()
    }

    pub fn gimbal(&self, system: u8, manager: u8, device: u8) -> Option<&Gimbal> {
        self.vehicles.get(&system)?.gimbals.get(&(manager, device))
    }

    /// Takes control of a gimbal.
    pub fn acquire(&mut self, (system, manager, device): (u8, u8, u8)) {
        let (own, device) = (self.id, f32::from(device));
        let params = [f32::from(own.system), f32::from(own.component), -1.0, -1.0, NAN, NAN, device];
        self.say(&command_long(MavId::new(system, manager), 1001, &params));
    }

    /// Gives control of a gimbal back.
    pub fn release(&mut self, (system, manager, device): (u8, u8, u8)) {
        let params = [-3.0, -3.0, -1.0, -1.0, NAN, NAN, f32::from(device)];
        self.say(&command_long(MavId::new(system, manager), 1001, &params));
    }

    /// Turns a gimbal to a pitch, in degrees.
    pub fn tilt(&mut self, (system, manager, device): (u8, u8, u8), pitch: f32) {
        let params = [pitch, 0.0, NAN, NAN, 44.0, 0.0, f32::from(device)];
        self.say(&command_long(MavId::new(system, manager), 1000, &params));
    }

    /// The answers so far; they are forgotten.
    pub fn take_acks(&mut self) -> Vec<(u16, u8, MavId)> {
        std::mem::take(&mut self.acks)
    }

    fn say(&mut self, message: &MavMessage) {
        let frame = FrameBuffer::default().encode_any(self.id, self.sequence, message).bytes().to_vec();
        self.sequence = self.sequence.wrapping_add(1);
        self.outgoing.push_back(frame);
    }

    fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let source = frame.source();
        if let Some(beat) = frame.decode::<HEARTBEAT_DATA>() {
            let is_vehicle = source.component == 1 && !NO_VEHICLES.contains(&beat.mavtype);
            if is_vehicle {
                self.vehicles.entry(source.system).or_default();
            }
            self.handle_heartbeat(source);
            return;
        }
        if !frame.target().includes(self.id) {
            return;
        }
        if let Some(ack) = frame.decode::<COMMAND_ACK_DATA>() {
            self.acks.push((ack.command, ack.result, source));
        }
        let Some(vehicle) = self.vehicles.get_mut(&source.system) else { return };
        if let Some(information) = frame.decode::<GIMBAL_MANAGER_INFORMATION_DATA>() {
            if information.gimbal_device_id == 0 {
                return;
            }
            vehicle.asked.insert(source.component, INFORMATION_TRIES);
            let key = (source.component, information.gimbal_device_id);
            let attitude = vehicle.attitudes.get(&information.gimbal_device_id).cloned();
            let gimbal = vehicle.gimbals.entry(key).or_default();
            gimbal.information = Some(information);
            gimbal.attitude = gimbal.attitude.take().or(attitude);
            self.complete(now, source.system, key);
        } else if let Some(status) = frame.decode::<GIMBAL_MANAGER_STATUS_DATA>() {
            if status.gimbal_device_id == 0 {
                return;
            }
            let key = (source.component, status.gimbal_device_id);
            vehicle.gimbals.entry(key).or_default().status = Some(status);
            self.complete(now, source.system, key);
        } else if let Some(attitude) = frame.decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>() {
            let (device, manager) = match attitude.gimbal_device_id {
                0 => (source.component, None),
                id @ 1..=6 => (id, Some(source.component)),
                _ => return,
            };
            vehicle.attitudes.insert(device, attitude.clone());
            let mut touched = Vec::new();
            for (key, gimbal) in &mut vehicle.gimbals {
                if key.1 == device && manager.is_none_or(|manager| key.0 == manager) {
                    gimbal.attitude = Some(attitude.clone());
                    touched.push(*key);
                }
            }
            for key in touched {
                self.complete(now, source.system, key);
            }
        }
    }

    fn handle_heartbeat(&mut self, source: MavId) {
        let Some(vehicle) = self.vehicles.get_mut(&source.system) else { return };
        let asked = vehicle.asked.entry(source.component).or_default();
        if *asked < INFORMATION_TRIES {
            *asked += 1;
            self.say(&request_message(source, 280));
        }
    }

    /// Asks for what is missing of a gimbal.
    fn complete(&mut self, now: Timestamp, system: u8, key: (u8, u8)) {
        let Some(gimbal) = self.vehicles.get_mut(&system).and_then(|vehicle| vehicle.gimbals.get_mut(&key)) else {
            return;
        };
        let (manager, device) = (MavId::new(system, key.0), MavId::new(system, key.1));
        let mut said = Vec::new();
        if gimbal.information.is_none() && gimbal.information_tries < MORE_INFORMATION_TRIES {
            gimbal.information_tries += 1;
            said.push(request_message(manager, 280));
        }
        let is_time = gimbal.status_asked.is_none_or(|asked| now.since(asked) >= SPACING);
        if gimbal.information.is_some() && gimbal.status.is_none() && gimbal.status_tries < STATUS_TRIES && is_time {
            gimbal.status_tries += 1;
            gimbal.status_asked = Some(now);
            said.push(set_interval(manager, 281, if gimbal.status_tries <= 4 { 0.0 } else { 5_000_000.0 }));
        }
        if gimbal.information.is_some() && gimbal.attitude.is_none() && gimbal.attitude_tries < ATTITUDE_TRIES {
            gimbal.attitude_tries += 1;
            said.push(set_interval(if key.1 > 6 { device } else { manager }, 285, 0.0));
        }
        for message in said {
            self.say(&message);
        }
    }
}

impl Peer for GroundStation {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        let mut frames = DatagramFrames::new(bytes);
        while let Some(frame) = frames.next_frame() {
            self.handle_frame(now, &frame);
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        while self.next_heartbeat <= now {
            self.next_heartbeat += HEARTBEAT_INTERVAL;
            self.say(&ground_heartbeat());
        }
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.outgoing.pop_front()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        Some(self.next_heartbeat)
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        *self = Self::new(now);
    }
}
