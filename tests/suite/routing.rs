//! Where frames go: the routing items of the protocol checklist and the numbered rules of `docs/routing.md`.

mod answers;
mod firewall;
mod forwarding;
mod gimbal_links;
mod known_routes;
mod narrow_links;
mod own_ids;
mod rules_document;

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::wire::MavId;
use gimbald::wire::target::message_shape;

use crate::support::wire::checksum;
use crate::support::world::{MANAGER, Place, World, heartbeat, link};

const GROUND: MavId = MavId::new(255, 190);
const CAMERA: MavId = MavId::new(1, 100);
/// The autopilot of another vehicle.
const OTHER_AUTOPILOT: MavId = MavId::new(9, 1);

const HEARTBEAT: u32 = 0;
const SYSTEM_TIME: u32 = 2;
const ATTITUDE: u32 = 30;
const MISSION_REQUEST_LIST: u32 = 43;
const MANUAL_CONTROL: u32 = 69;
const COMMAND_INT: u32 = 75;
const COMMAND_LONG: u32 = 76;
const COMMAND_ACK: u32 = 77;

/// A world of named links, most of them with nobody there.
struct Rig {
    world: World,
    places: Vec<(&'static str, Place)>,
}

impl Rig {
    /// One link of each role and a second ground link, `radio`.
    fn new() -> Self {
        Self::with(Settings { system_id: SystemId::Fixed(1), ..Settings::default() })
    }

    fn with(settings: Settings) -> Self {
        let links = [
            ("autopilot", Role::Autopilot),
            ("gimbal", Role::Gimbal),
            ("ground", Role::Ground),
            ("radio", Role::Ground),
            ("peer", Role::Peer),
        ];
        let links: Vec<_> =
            links.into_iter().map(|(name, role)| (name, link(name, role, Transport::Datagrams))).collect();
        let names = links.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        let mut settings = settings;
        if settings.links.is_empty() {
            settings.links = links.into_iter().map(|(_, link)| link).collect();
        }
        let (world, places) = World::new(settings);
        let mut rig = Self { world, places: names.into_iter().zip(places).collect() };
        rig.world.forget();
        rig
    }

    fn place(&self, name: &str) -> Place {
        self.places.iter().find(|(known, _)| *known == name).expect("a place of that name").1
    }

    /// Another UDP peer of the link on which `beside` is.
    fn open_beside(&mut self, beside: &str, name: &'static str) {
        let link = self.places.iter().position(|(known, _)| *known == beside).expect("a place of that name");
        let place = self.world.open(link);
        self.places.push((name, place));
        self.world.forget();
    }

    /// Lets `source` be heard at a place by a heartbeat.
    fn introduce(&mut self, at: &str, source: MavId) {
        let (kind, autopilot) = match source.component {
            1 => (2, 12),
            154 | 171 => (26, 8),
            100 => (30, 8),
            _ => (6, 8),
        };
        let place = self.place(at);
        self.world.send(place, source, &heartbeat(kind, autopilot));
        self.world.forget();
    }

    /// Sends `bytes` as one read and tells who got exactly these, in the order of the links. Nothing else may be sent.
    fn deliver(&mut self, from: &str, bytes: &[u8]) -> Vec<&'static str> {
        self.world.forget();
        let place = self.place(from);
        self.world.send_bytes(place, bytes);
        let mut receivers = Vec::new();
        for (name, place) in &self.places {
            let arrived: Vec<Vec<u8>> = self.world.take(*place).into_iter().map(|arrival| arrival.bytes).collect();
            if !arrived.is_empty() {
                assert_eq!(arrived, [bytes], "at {name}");
                receivers.push(*name);
            }
        }
        receivers
    }

    /// The same where we may have something to say as well.
    fn deliver_amid_ours(&mut self, from: &str, bytes: &[u8]) -> Vec<&'static str> {
        self.world.forget();
        let place = self.place(from);
        self.world.send_bytes(place, bytes);
        let got = |(name, place): &(&'static str, Place)| {
            let arrived = self.world.take(*place);
            let foreign: Vec<_> = arrived.iter().filter(|arrival| arrival.source() != MANAGER).collect();
            assert!(foreign.iter().all(|arrival| arrival.bytes == bytes), "at {name}");
            assert!(foreign.len() < 2, "{name} got it more than once");
            (!foreign.is_empty()).then_some(*name)
        };
        self.places.iter().filter_map(got).collect()
    }

    fn run_for(&mut self, duration: Duration) {
        self.world.run_for(duration);
        self.world.forget();
    }

    /// How often frames towards a link, or from it, were dropped for `reason`.
    fn dropped(&self, link: &str, reason: &str) -> u64 {
        let links = self.world.snapshot().links;
        let link = links.iter().find(|known| known.name == link).expect("a link of that name");
        link.dropped.get(reason).copied().unwrap_or(0)
    }
}

/// A MAVLink 2 frame of a known message with these payload bytes, neither cut nor filled up.
fn frame(source: MavId, id: u32, payload: &[u8]) -> Vec<u8> {
    let shape = message_shape(id).expect("a known message");
    unchecked_frame(source, id, shape.crc_extra, payload)
}

fn unchecked_frame(source: MavId, id: u32, crc_extra: u8, payload: &[u8]) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let len = u8::try_from(payload.len()).expect("a payload has at most 255 bytes");
    let mut frame = vec![0xfd, len, 0, 0, 77, source.system, source.component, low, middle, high];
    frame.extend_from_slice(payload);
    let sum = checksum(&frame[1..], crc_extra);
    frame.extend_from_slice(&sum.to_le_bytes());
    frame
}

/// A whole message of arbitrary content.
fn broadcast(source: MavId, id: u32) -> Vec<u8> {
    let shape = message_shape(id).expect("a known message");
    frame(source, id, &vec![0x11; usize::from(shape.base_len)])
}

/// A whole message of arbitrary content for `target`, given as system and component.
fn addressed(source: MavId, id: u32, target: (u8, u8)) -> Vec<u8> {
    let shape = message_shape(id).expect("a known message");
    let system_at = shape.system_offset.expect("a message with a target");
    // Of some messages the target is an extension field.
    let len = shape.base_len.max(1 + shape.component_offset.unwrap_or(system_at));
    let mut payload = vec![0x11; usize::from(len)];
    payload[usize::from(system_at)] = target.0;
    if let Some(at) = shape.component_offset {
        payload[usize::from(at)] = target.1;
    }
    frame(source, id, &payload)
}

/// `COMMAND_LONG` or `COMMAND_INT` (`id`) with that number, its parameters zero.
fn command(source: MavId, id: u32, number: u16, target: (u8, u8)) -> Vec<u8> {
    let mut payload = vec![0; usize::from(message_shape(id).expect("a known message").base_len)];
    payload[28..30].copy_from_slice(&number.to_le_bytes());
    payload[30..32].copy_from_slice(&[target.0, target.1]);
    payload[32] = 1;
    frame(source, id, &payload)
}
