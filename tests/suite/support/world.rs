//! The core between simulated or scripted peers, in simulated time.
//!
//! Every link end is a [`Place`]. What the core sends there is recorded, and handed to the peer that lives there if
//! one does. Wires have no delay of their own; a line of transport serial is paced by the core.

use std::time::Duration;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::bridge::snapshot::Snapshot;
use gimbald::bridge::{Bridge, ChannelId, Input, Output};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::gimbals::operation::OperationId;
use gimbald::manager::asked::{Answer, Asked};
use gimbald::sim::peer::{Peer, PlatformMotion};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{HEARTBEAT_DATA, MavMessage, MessageData};
use gimbald::wire::{DatagramFrames, Frame, FrameBuffer, MavId};

/// The usual parties.
pub const GCS: MavId = MavId::new(255, 190);
pub const AUTOPILOT: MavId = MavId::new(1, 1);
pub const GIMBAL: MavId = MavId::new(1, 154);
pub const MANAGER: MavId = MavId::new(1, 191);

/// The far end of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place(usize);

/// One frame as it was received at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    pub at: Timestamp,
    pub bytes: Vec<u8>,
}

impl Arrival {
    pub fn frame(&self) -> Frame<'_> {
        let mut frames = DatagramFrames::new(&self.bytes);
        let frame = frames.next_frame().expect("the core sends whole frames");
        assert_eq!(frame.bytes(), self.bytes, "the core sends one frame at a time");
        frame
    }

    pub fn id(&self) -> u32 {
        self.frame().message_id()
    }

    pub fn source(&self) -> MavId {
        self.frame().source()
    }

    pub fn decode<M: MessageData>(&self) -> M {
        self.frame().decode().unwrap_or_else(|| panic!("{} expected, got {}", M::NAME, self.frame().name()))
    }
}

struct End {
    channel: ChannelId,
    link: usize,
    open: bool,
    peer: Option<Box<dyn Peer>>,
    arrivals: Vec<Arrival>,
    sequence: u8,
}

/// The core and everything around it.
pub struct World {
    pub now: Timestamp,
    pub bridge: Bridge,
    /// While the daemon does not run nobody is heard, and the peers go on.
    is_running: bool,
    ends: Vec<End>,
    pub stored_system_ids: Vec<u8>,
    /// The gimbals that were told to turn, by name.
    pub stored_turning: Vec<String>,
    /// The ids that gimbals without an entry were given, each time that this changed.
    pub stored_gimbal_ids: Vec<Vec<String>>,
    /// What became of what was asked of gimbals by name.
    pub answers: Vec<(OperationId, Answer)>,
    asked_by_name: u64,
}

/// What [`World::ask_by_name`] numbers from: beyond any number that a test gives by itself.
const FIRST_BY_NAME: u64 = 1_000_000;

impl World {
    /// A core whose links are all up, with one open channel each, and nobody there. The places are in the order of
    /// the links.
    pub fn new(settings: Settings) -> (Self, Vec<Place>) {
        let links = settings.links.len();
        let bridge = Bridge::new(Timestamp::ZERO, settings);
        let mut world = Self {
            now: Timestamp::ZERO,
            bridge,
            is_running: true,
            ends: Vec::new(),
            stored_system_ids: Vec::new(),
            stored_turning: Vec::new(),
            stored_gimbal_ids: Vec::new(),
            answers: Vec::new(),
            asked_by_name: 0,
        };
        let mut places = Vec::new();
        for link in 0..links {
            world.input(Input::LinkUp { link });
            places.push(world.open(link));
        }
        (world, places)
    }

    /// One more channel on a link, such as another UDP peer.
    pub fn open(&mut self, link: usize) -> Place {
        let channel = ChannelId::new(self.ends.len()).expect("a test has few channels");
        self.ends.push(End { channel, link, open: true, peer: None, arrivals: Vec::new(), sequence: 0 });
        let address = format!("test:{}", channel.index());
        self.input(Input::ChannelOpened { channel, link, address: &address });
        Place(self.ends.len() - 1)
    }

    /// Asks something of a gimbal by its name; what becomes of it is in `answers` under this number.
    pub fn ask_by_name(&mut self, gimbal: &str, asked: &Asked) -> OperationId {
        let id = OperationId(FIRST_BY_NAME + self.asked_by_name);
        self.asked_by_name += 1;
        self.input(Input::Asked { id, gimbal, asked });
        id
    }

    /// The daemon ends without a word, as after SIGKILL.
    pub fn kill(&mut self) {
        self.is_running = false;
    }

    /// The daemon starts anew, on the links and with the channels that there were.
    pub fn start(&mut self, settings: Settings) {
        let links = settings.links.len();
        self.bridge = Bridge::new(self.now, settings);
        self.is_running = true;
        for link in 0..links {
            self.input(Input::LinkUp { link });
        }
        for at in 0..self.ends.len() {
            let End { channel, link, open, .. } = self.ends[at];
            if open {
                self.input(Input::ChannelOpened { channel, link, address: "test" });
            }
        }
    }

    /// Unplugs a place: its peer hears and says nothing more.
    pub fn unplug(&mut self, place: Place) {
        self.ends[place.0].open = false;
        let (channel, link) = (self.ends[place.0].channel, self.ends[place.0].link);
        self.input(Input::ChannelClosed { channel });
        self.input(Input::LinkDown { link, reason: "unplugged" });
    }

    /// Plugs it in again.
    pub fn plug_in(&mut self, place: Place) {
        self.ends[place.0].open = true;
        let (channel, link) = (self.ends[place.0].channel, self.ends[place.0].link);
        self.input(Input::LinkUp { link });
        self.input(Input::ChannelOpened { channel, link, address: "test" });
    }

    /// Lets a simulated peer live at a place.
    pub fn install(&mut self, place: Place, mut peer: impl Peer + 'static) {
        peer.handle_timeout(self.now);
        self.ends[place.0].peer = Some(Box::new(peer));
        self.settle();
    }

    /// Ends the peer at a place.
    pub fn remove(&mut self, place: Place) {
        self.ends[place.0].peer = None;
    }

    /// Starts the peer at a place over, as after a power-on.
    pub fn reboot(&mut self, place: Place) {
        let now = self.now;
        self.peer(place).handle_reboot(now);
    }

    /// The peer at a place is moved as the vehicle moves that carries it.
    pub fn disturb(&mut self, place: Place, motion: PlatformMotion) {
        let now = self.now;
        self.peer(place).handle_disturbance(now, motion);
        self.settle();
    }

    fn peer(&mut self, place: Place) -> &mut dyn Peer {
        self.ends[place.0].peer.as_deref_mut().expect("somebody lives there")
    }

    /// Somebody beside us on the line of the peer at a place says something to it.
    pub fn tell_peer(&mut self, place: Place, bytes: &[u8]) {
        let now = self.now;
        self.peer(place).handle_received(now, bytes);
        self.settle();
    }

    /// Bytes from a place, as one read.
    pub fn send_bytes(&mut self, from: Place, bytes: &[u8]) {
        let channel = self.ends[from.0].channel;
        assert!(self.ends[from.0].open, "an unplugged place sends nothing");
        self.input(Input::Received { channel, bytes });
    }

    /// A message from a component at a place, with the place's next sequence number; its bytes are returned.
    pub fn send(&mut self, from: Place, source: MavId, message: &MavMessage) -> Vec<u8> {
        let sequence = self.ends[from.0].sequence;
        self.ends[from.0].sequence = sequence.wrapping_add(1);
        let bytes = FrameBuffer::default().encode_any(source, sequence, message).bytes().to_vec();
        self.send_bytes(from, &bytes);
        bytes
    }

    pub fn input(&mut self, input: Input<'_>) {
        if self.is_running {
            self.bridge.handle_input(self.now, input);
        }
        self.settle();
    }

    /// Lets time pass, event by event.
    pub fn run_for(&mut self, duration: Duration) {
        let end = self.now + duration;
        let mut at_once = 0;
        while let Some(next) = self.next_event().filter(|next| *next <= end) {
            at_once = if next > self.now { 0 } else { at_once + 1 };
            assert!(at_once < 1_000, "a timeout that never passes, at {}", self.now);
            self.step_to(next);
        }
        self.now = end;
    }

    /// What has arrived at a place so far.
    pub fn arrivals(&self, place: Place) -> &[Arrival] {
        &self.ends[place.0].arrivals
    }

    /// What has arrived at a place so far; it is forgotten.
    pub fn take(&mut self, place: Place) -> Vec<Arrival> {
        std::mem::take(&mut self.ends[place.0].arrivals)
    }

    /// The same, of one message only; the others are forgotten too.
    pub fn take_messages<M: MessageData>(&mut self, place: Place) -> Vec<M> {
        self.take(place).iter().filter(|arrival| arrival.id() == M::ID).map(Arrival::decode).collect()
    }

    /// Forgets what has arrived anywhere.
    pub fn forget(&mut self) {
        for end in &mut self.ends {
            end.arrivals.clear();
        }
    }

    pub fn snapshot(&self) -> Snapshot {
        self.bridge.snapshot(self.now)
    }

    fn next_event(&self) -> Option<Timestamp> {
        let peers = self.ends.iter().filter_map(|end| end.peer.as_ref()?.poll_timeout());
        peers.chain(self.bridge_timeout()).min().map(|at| at.max(self.now))
    }

    fn step_to(&mut self, at: Timestamp) {
        self.now = at;
        for end in &mut self.ends {
            if let Some(peer) = &mut end.peer
                && peer.poll_timeout().is_some_and(|due| due <= at)
            {
                peer.handle_timeout(at);
            }
        }
        if self.bridge_timeout().is_some_and(|due| due <= at) {
            self.bridge.handle_timeout(at);
        }
        self.settle();
    }

    fn bridge_timeout(&self) -> Option<Timestamp> {
        self.bridge.poll_timeout().filter(|_| self.is_running)
    }

    /// Carries everything that is on its way, until nothing is.
    fn settle(&mut self) {
        for _ in 0..10_000 {
            let mut busy = self.carry_outputs();
            let mut said: Vec<(ChannelId, Vec<u8>)> = Vec::new();
            for end in &mut self.ends {
                while let Some(bytes) = end.peer.as_mut().and_then(|peer| peer.poll_output()) {
                    if end.open && self.is_running {
                        said.push((end.channel, bytes));
                    }
                }
            }
            for (channel, bytes) in said {
                busy = true;
                self.bridge.handle_input(self.now, Input::Received { channel, bytes: &bytes });
                self.carry_outputs();
            }
            if !busy {
                return;
            }
        }
        panic!("the peers never come to rest");
    }

    /// Drains the core; true when there was anything.
    fn carry_outputs(&mut self) -> bool {
        let mut any = false;
        if !self.is_running {
            return any;
        }
        while let Some(output) = self.bridge.poll_output() {
            any = true;
            let (channels, bytes) = match output {
                Output::Transmit { channels, bytes } => (channels, bytes.to_vec()),
                Output::StoreSystemId(system) => {
                    self.stored_system_ids.push(system);
                    continue;
                }
                Output::StoreTurning(names) => {
                    self.stored_turning = names.lines().map(str::to_owned).collect();
                    continue;
                }
                Output::StoreGimbalIds(lines) => {
                    self.stored_gimbal_ids.push(lines.lines().map(str::to_owned).collect());
                    continue;
                }
                Output::Answered { id, answer } => {
                    self.answers.push((id, answer.clone()));
                    continue;
                }
            };
            for channel in channels {
                let end = self.ends.iter_mut().find(|end| end.channel == channel).expect("a known channel");
                assert!(end.open, "sent on a closed channel");
                if let Some(peer) = &mut end.peer {
                    peer.handle_received(self.now, &bytes);
                }
                end.arrivals.push(Arrival { at: self.now, bytes: bytes.clone() });
            }
        }
        any
    }
}

/// A link for a test.
pub fn link(name: &str, role: Role, transport: Transport) -> LinkSettings {
    LinkSettings {
        name: name.to_owned(),
        role,
        endpoint: format!("test:{name}"),
        transport,
        speaks_first: false,
        max_rates: Default::default(),
    }
}

/// Links of an autopilot, a gimbal and a ground station, in this order, all by datagrams; system id fixed to 1.
pub fn three_links() -> Settings {
    Settings {
        system_id: SystemId::Fixed(1),
        links: vec![
            link("autopilot", Role::Autopilot, Transport::Datagrams),
            link("gimbal", Role::Gimbal, Transport::Datagrams),
            link("ground", Role::Ground, Transport::Datagrams),
        ],
        ..Settings::default()
    }
}

/// The usual places.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    pub autopilot: Place,
    pub gimbal: Place,
    pub ground: Place,
}

impl World {
    /// [`three_links`] with nobody there.
    pub fn empty(settings: Settings) -> (Self, Places) {
        let (world, places) = Self::new(settings);
        (world, Places { autopilot: places[0], gimbal: places[1], ground: places[2] })
    }

    /// A simulated vehicle and gimbal; the gimbal is known, nothing that arrived on the way there is kept.
    pub fn with_one_gimbal(settings: Settings) -> (Self, Places) {
        let (mut world, places) = Self::empty(settings);
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
        world.run_for(Duration::from_secs(3));
        assert_eq!(world.snapshot().gimbals.first().map(|gimbal| gimbal.state.clone()), Some("alive".to_owned()));
        world.forget();
        (world, places)
    }
}

/// A heartbeat of `kind` (`MAV_TYPE`) and `autopilot` (`MAV_AUTOPILOT`).
pub fn heartbeat(kind: u8, autopilot: u8) -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: kind,
        autopilot,
        base_mode: 0,
        system_status: 4,
        mavlink_version: 3,
    })
}
