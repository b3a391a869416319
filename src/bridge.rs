//! Gives bytes their meaning: frames, routes, gimbals; the core of the daemon as one plain value.
//!
//! **One input, then [`Bridge::poll_output`] until it is `None`, then the next input.** Time never goes backwards and
//! only comes in as `now`.

mod allowance;
mod announcements;
mod autopilot;
mod channels;
mod conflicts;
mod delivery;
mod devices;
mod events;
mod firewall;
mod heartbeat;
mod identity;
mod outbox;
mod own_commands;
pub mod pacing;
mod picture;
mod rates;
mod rivals;
mod roster;
mod sent;
pub mod settings;
pub mod snapshot;
mod state_for_gimbals;
mod stations;
mod streams;
mod transactions;

pub use crate::channel::{ChannelId, ChannelSet};
use crate::gimbals::DriverOutput;
use crate::gimbals::operation::{OperationId, OperationResult};
use crate::gimbals::report::Report;
use crate::manager::rank::Ranks;
use crate::manager::{ManagerOutput, Surroundings};
use crate::router::Router;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::vehicle::Vehicle;
use crate::wire::dialect::MavMessage;
use crate::wire::{DatagramFrames, FrameBuffer, MavId, StreamDecoder};
use announcements::Announcements;
use channels::Channels;
use conflicts::Conflicts;
use events::Events;
use identity::{Identity, Ties};
use outbox::Outbox;
use rivals::RivalWatch;
use roster::{GimbalOutput, Roster};
use settings::{Role, Settings};
use state_for_gimbals::StateForGimbals;
use stations::Stations;
use streams::AutopilotStreams;
use transactions::{Asker, Order, Transactions};

/// Position of a link in [`settings::Settings::links`].
pub type LinkIndex = usize;

/// What happened outside.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// Port open, socket bound, or TCP connected.
    LinkUp {
        link: LinkIndex,
    },
    LinkDown {
        link: LinkIndex,
        reason: &'a str,
    },
    /// A peer was heard or may be spoken to; `address` is shown to people.
    ChannelOpened {
        channel: ChannelId,
        link: LinkIndex,
        address: &'a str,
    },
    ChannelClosed {
        channel: ChannelId,
    },
    /// One read: a whole datagram, or a piece of a stream.
    Received {
        channel: ChannelId,
        bytes: &'a [u8],
    },
    /// Bytes given out before could not be sent.
    SendFailed {
        channel: ChannelId,
        frames: u32,
        reason: &'static str,
    },
    /// The process is to end: stop what moves, say goodbye.
    Shutdown,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send one whole frame to each of `channels`.
    Transmit { channels: ChannelSet, bytes: &'a [u8] },
    /// Keep the adopted system id for the next start.
    StoreSystemId(u8),
    /// What became of an operation.
    Operated { id: OperationId, result: &'a OperationResult },
}

/// The core.
#[derive(Debug)]
pub struct Bridge {
    settings: Settings,
    started: Timestamp,
    channels: Channels,
    router: Router,
    identity: Identity,
    vehicle: Vehicle,
    /// The autopilot of our system, once it was heard.
    autopilot: Option<MavId>,
    /// When it was last heard on a link that is not a ground link.
    autopilot_heard: Option<Timestamp>,
    /// By system, whose autopilot was heard.
    vehicles: Vec<Option<KnownVehicle>>,
    ranks: Ranks,
    roster: Roster,
    streams: AutopilotStreams,
    state_for_gimbals: StateForGimbals,
    transactions: Transactions,
    conflicts: Conflicts,
    events: Events,
    announcements: Announcements,
    stations: Stations,
    watch: RivalWatch,
    outbox: Outbox,
    buffer: FrameBuffer,
    timers: TimerTable<Timer>,
    shutting_down: bool,
}

/// A system that has an autopilot.
#[derive(Clone, Copy, Debug)]
struct KnownVehicle {
    /// The component that beats as its autopilot.
    component: u8,
    heard: Timestamp,
    /// It was never heard but where ground stations are.
    is_on_ground_only: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When the managers beat next, and what is looked after once a second.
    Heartbeat,
}

impl Bridge {
    pub fn new(now: Timestamp, settings: Settings) -> Self {
        let identity = Identity::new(now, settings.system_id, settings.stored_system_id);
        let mut bridge = Self {
            started: now,
            channels: Channels::new(settings.links.clone()),
            router: Router::default(),
            vehicle: Vehicle::new(),
            autopilot: None,
            autopilot_heard: None,
            vehicles: vec![None; 256],
            ranks: Ranks::default(),
            roster: Roster::new(&settings),
            streams: AutopilotStreams::default(),
            state_for_gimbals: StateForGimbals::default(),
            transactions: Transactions::default(),
            events: Events::default(),
            announcements: Announcements::default(),
            conflicts: Conflicts::new(settings.links.iter().map(|link| link.name.clone()).collect()),
            stations: Stations::default(),
            watch: RivalWatch::default(),
            outbox: Outbox::default(),
            buffer: FrameBuffer::default(),
            timers: TimerTable::default(),
            shutting_down: false,
            identity,
            settings,
        };
        bridge.router.set_own_system(bridge.identity.system());
        bridge.ranks.set_own_system(bridge.identity.system());
        bridge.timers.set(Timer::Heartbeat, now);
        bridge
    }

    /// Takes one input; drain [`poll_output`](Self::poll_output) afterwards.
    pub fn handle_input(&mut self, now: Timestamp, input: Input<'_>) {
        match input {
            Input::LinkUp { link } => {
                if let Some(link) = self.channels.link_mut(link) {
                    link.up = true;
                    link.reason = None;
                }
            }
            Input::LinkDown { link, reason } => {
                if let Some(link) = self.channels.link_mut(link) {
                    link.up = false;
                    link.reason = Some(reason.to_owned());
                }
            }
            Input::ChannelOpened { channel, link, address } => self.open_channel(now, channel, link, address),
            Input::ChannelClosed { channel } => self.close_channel(channel),
            // At the end nobody is listened to any more: no demand may follow the one that stops the gimbal.
            Input::Received { .. } if self.shutting_down => {}
            Input::Received { channel, bytes } => self.handle_received(now, channel, bytes),
            Input::SendFailed { channel, frames, reason } => {
                for _ in 0..frames {
                    self.count_dropped_towards(channel, reason);
                }
            }
            Input::Shutdown => self.shut_down(now),
        }
        self.carry_out(now);
    }

    /// Does what is due at `now`; drain [`poll_output`](Self::poll_output) afterwards.
    pub fn handle_timeout(&mut self, now: Timestamp) {
        if self.shutting_down {
            self.channels.pump_all(now, &mut self.outbox);
            return;
        }
        self.settle_identity(now);
        for channel in self.channels.stalled(now) {
            self.decode_stream(now, channel, |decoder| decoder.handle_timeout(now));
        }
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::Heartbeat => self.handle_heartbeat_timer(now),
            }
        }
        self.transactions.handle_timeout(now);
        self.ask_autopilot(now);
        self.tell_gimbals_state(now);
        self.measure_round_trip(now);
        for at in 0..self.roster.len() {
            let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
            let gimbal = self.roster.get_mut(at);
            gimbal.driver.handle_timeout(now);
            if gimbal.manager.poll_timeout().is_some_and(|due| due <= now) && self.identity.system().is_some() {
                gimbal.manager.handle_timeout(now, around);
            }
        }
        self.carry_out(now);
        self.channels.release_held(now, &mut self.outbox);
        self.channels.pump_all(now, &mut self.outbox);
    }

    /// The next thing to be done, `None` when the last input is dealt with.
    pub fn poll_output(&mut self) -> Option<Output<'_>> {
        self.outbox.pop()
    }

    /// When [`handle_timeout`](Self::handle_timeout) is due.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        if self.shutting_down {
            return self.channels.poll_output_timeout();
        }
        let timers = [
            self.timers.next().map(|(at, _)| at),
            self.identity.poll_timeout(),
            self.channels.poll_timeout(),
            self.streams.poll_timeout().filter(|_| self.may_ask_autopilot()),
            self.transactions.poll_timeout(),
            self.state_for_gimbals.poll_timeout(),
            self.timesync_due(),
        ];
        let gimbals = self.roster.iter().filter_map(|gimbal| gimbal.poll_timeout());
        let gimbals = gimbals.filter(|_| self.identity.system().is_some());
        timers.into_iter().flatten().chain(gimbals).min()
    }

    /// Whether everything due before the end has been given out.
    pub fn is_finished(&self) -> bool {
        self.shutting_down && self.channels.is_drained()
    }

    fn open_channel(&mut self, now: Timestamp, channel: ChannelId, link: LinkIndex, address: &str) {
        if !self.channels.open(channel, link, address) {
            return;
        }
        self.router.close_channel(channel);
        self.router.open_channel(channel);
        self.roster.open_channel(now, channel);
        // A gimbal takes the system id of the first heartbeat it hears, so ours is the first there.
        if self.channels.role(channel) == Some(Role::Gimbal) && self.identity.system().is_some() {
            self.beat(now, channel.into());
        }
    }

    fn close_channel(&mut self, channel: ChannelId) {
        self.channels.close(channel);
        self.router.close_channel(channel);
        self.roster.close_channel(channel);
    }

    fn handle_received(&mut self, now: Timestamp, channel: ChannelId, bytes: &[u8]) {
        let Some(state) = self.channels.channel_mut(channel) else { return };
        state.last_heard = Some(now);
        let (link, is_stream) = (state.link, state.decoder.is_some());
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_bytes += bytes.len() as u64;
        }
        if is_stream {
            self.decode_stream(now, channel, |decoder| decoder.push(now, bytes));
            return;
        }
        let mut frames = DatagramFrames::new(bytes);
        while let Some(frame) = frames.next_frame() {
            self.handle_frame(now, channel, &frame);
        }
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_frames += frames.counters().frames;
            link.wire.add(frames.counters());
        }
    }

    fn decode_stream(&mut self, now: Timestamp, channel: ChannelId, feed: impl FnOnce(&mut StreamDecoder)) {
        // The decoder is taken out while its frames are dealt with, and put back behind them.
        let Some(state) = self.channels.channel_mut(channel) else { return };
        let link = state.link;
        let Some(mut decoder) = state.decoder.take() else { return };
        feed(&mut decoder);
        let mut frames = 0;
        while let Some(frame) = decoder.next_frame() {
            frames += 1;
            self.handle_frame(now, channel, &frame);
        }
        if let Some(state) = self.channels.channel_mut(channel) {
            state.decoder = Some(decoder);
        }
        if let Some(link) = self.channels.link_mut(link) {
            link.rx_frames += frames;
        }
    }

    /// Takes the system id that the heartbeats of autopilots amount to.
    fn settle_identity(&mut self, now: Timestamp) {
        let before = self.identity.system();
        let ties = Ties {
            is_held: self.roster.iter().any(|gimbal| gimbal.manager.is_held()),
            fallback_is_taken: self.is_fallback_taken(now),
        };
        let was_bootstrap = self.identity.is_bootstrap();
        let is_changed = self.identity.update(now, ties);
        let system = self.identity.system();
        if !is_changed {
            // The fallback id turned out to be right.
            if let Some(system) = system.filter(|_| was_bootstrap && !self.identity.is_bootstrap()) {
                self.outbox.push_system_id(system);
            }
            return;
        }
        tracing::info!(system_id = system, fallback = self.identity.is_bootstrap(), "system id");
        self.router.set_own_system(system);
        self.channels.forget_held();
        self.ranks.set_own_system(system);
        if let Some(before) = before {
            self.router.forget_system(before);
            let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
            for gimbal in self.roster.iter_mut() {
                gimbal.manager.forget_system(now, before, around);
            }
        }
        self.autopilot = None;
        self.autopilot_heard = None;
        self.vehicle = Vehicle::new();
        self.transactions.clear();
        self.state_for_gimbals.stop();
        if let Some(system) = system
            && let Some(known) = self.vehicles[usize::from(system)]
            && (!known.is_on_ground_only || self.is_believed(Role::Ground, system))
        {
            self.take_autopilot(now, MavId::new(system, known.component));
        }
        if let Some(system) = system
            && !self.identity.is_bootstrap()
        {
            self.outbox.push_system_id(system);
        }
        // Our first frame under a new id is a heartbeat, everywhere, and before the frame that settled it goes on: a
        // gimbal takes the system id of the first heartbeat it hears.
        self.handle_heartbeat_timer(now);
    }

    fn take_autopilot(&mut self, now: Timestamp, autopilot: MavId) {
        tracing::info!(%autopilot, "autopilot found");
        if self.autopilot != Some(autopilot) {
            self.state_for_gimbals.stop();
        }
        self.autopilot = Some(autopilot);
        self.streams.handle_autopilot_found(now);
    }

    /// The managers are shown what is known of the vehicle, also when nothing new was heard of it.
    fn handle_vehicle(&mut self, now: Timestamp) {
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        for gimbal in self.roster.iter_mut() {
            gimbal.manager.handle_vehicle(now, around);
        }
    }

    fn shut_down(&mut self, now: Timestamp) {
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        for gimbal in self.roster.iter_mut() {
            gimbal.manager.handle_shutdown(now, around);
        }
        self.carry_out(now);
        // The goodbye is the last word.
        self.channels.keep_control();
        self.channels.lift_limits();
        if self.identity.system().is_some() {
            for at in 0..self.roster.len() {
                let gimbal = self.roster.get_mut(at);
                if gimbal.beats() {
                    let (component, goodbye) = (gimbal.component, heartbeat::goodbye(gimbal));
                    self.send(now, self.channels.open_set(), component, &goodbye);
                }
            }
        }
        self.shutting_down = true;
    }

    /// Does what the gimbals' drivers and managers want done, and what is to be done about our own commands.
    fn carry_out(&mut self, now: Timestamp) {
        if self.identity.system().is_none() {
            return;
        }
        self.carry_out_for_gimbals(now);
        self.carry_out_own_commands(now);
    }

    fn carry_out_for_gimbals(&mut self, now: Timestamp) {
        for at in 0..self.roster.len() {
            while let Some(output) = self.roster.get_mut(at).poll_output() {
                let component = self.roster.get_mut(at).component;
                match output {
                    GimbalOutput::Driver(DriverOutput::Message(message)) => {
                        let device = self.roster.get_mut(at).manager.device();
                        let channels = device.map_or(ChannelSet::EMPTY, |device| self.channels_of_device(device));
                        self.send(now, channels, component, &message);
                    }
                    GimbalOutput::Driver(DriverOutput::Command(command)) => {
                        let order = Order { asker: Asker::Driver, manager: component, command: *command };
                        self.transactions.send(now, order);
                    }
                    GimbalOutput::Driver(DriverOutput::Report(report)) => {
                        if report == Report::SpeaksForItself(false) {
                            self.roster.keep_number(at);
                        }
                        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
                        self.roster.get_mut(at).manager.handle_report(now, report, around);
                    }
                    GimbalOutput::Driver(DriverOutput::Operated { id, result }) => {
                        self.outbox.push_operated(id, result)
                    }
                    GimbalOutput::Manager(output) => self.carry_out_for_manager(now, at, component, output),
                }
            }
        }
    }

    fn carry_out_for_manager(&mut self, now: Timestamp, at: usize, component: u8, output: ManagerOutput) {
        match output {
            ManagerOutput::Reply { to, channel, message } => {
                // Who cannot be learned, such as a component 0, is where it spoke.
                let known = self.router.route_known(now, to);
                let channels = if known.is_empty() { channel.into() } else { known };
                self.answer(now, channels, component, &message);
            }
            ManagerOutput::Answer { channel, message } => self.answer(now, channel.into(), component, &message),
            ManagerOutput::Broadcast { channels, message } => {
                let mut channels = channels.unwrap_or(self.channels.open_set());
                if !matches!(*message, MavMessage::GIMBAL_MANAGER_STATUS(_)) {
                    // A gimbal has no use for what a manager tells its clients.
                    channels = channels.without(self.channels.with_role(Role::Gimbal));
                }
                self.send(now, channels, component, &message);
            }
            ManagerOutput::Heartbeat { channels } => {
                let message = heartbeat::heartbeat(self.roster.get_mut(at), self.identity.is_bootstrap());
                self.answer(now, channels.unwrap_or(self.channels.open_set()), component, &message);
            }
            ManagerOutput::Steer(setpoint) => self.roster.get_mut(at).driver.handle_setpoint(now, setpoint),
            ManagerOutput::Event(event) => self.handle_event(now, at, event),
        }
    }

    fn channels_of_device(&self, device: MavId) -> ChannelSet {
        self.roster.channel_of(device).map_or(ChannelSet::EMPTY, ChannelSet::from)
    }

    /// Sends a message of our own, numbered for each channel.
    fn send(&mut self, now: Timestamp, channels: ChannelSet, component: u8, message: &MavMessage) {
        if let Some(system) = self.identity.system() {
            self.send_as(now, system, channels, component, message);
        }
    }

    /// Sends what was asked for, numbered for each channel.
    fn answer(&mut self, now: Timestamp, channels: ChannelSet, component: u8, message: &MavMessage) {
        if let Some(system) = self.identity.system() {
            let frame = self.buffer.encode_any(MavId::new(system, component), 0, message);
            self.channels.transmit_answer(now, channels, &frame, &mut self.outbox);
        }
    }

    fn send_as(&mut self, now: Timestamp, system: u8, channels: ChannelSet, component: u8, message: &MavMessage) {
        // The number is given where the frame leaves.
        let frame = self.buffer.encode_any(MavId::new(system, component), 0, message);
        self.channels.transmit_own(now, channels, &frame, &mut self.outbox);
    }

    fn is_own_id(&self, id: MavId) -> bool {
        Some(id.system) == self.identity.system() && self.roster.has_manager(id.component)
    }

    fn count_dropped(&mut self, link: LinkIndex, reason: &'static str) {
        if let Some(link) = self.channels.link_mut(link) {
            link.count_dropped(reason);
        }
    }

    fn count_dropped_towards(&mut self, channel: ChannelId, reason: &'static str) {
        if let Some(link) = self.channels.channel(channel).map(|channel| channel.link) {
            self.count_dropped(link, reason);
        }
    }
}

fn surroundings<'a>(vehicle: &'a Vehicle, autopilot: Option<MavId>, ranks: &'a Ranks) -> Surroundings<'a> {
    Surroundings { vehicle, autopilot, ranks, overheard: false, other_vehicle: false }
}
