//! Gives bytes their meaning: frames, routes, gimbals; the core of the daemon as one plain value.
//!
//! **One input, then [`Bridge::poll_output`] until it is `None`, then the next input.** Time never goes backwards and
//! only comes in as `now`.

mod allowance;
mod announcements;
mod asked;
mod autopilot;
mod carrying_out;
mod channels;
mod conflicts;
mod delivery;
mod devices;
mod ending;
mod events;
mod firewall;
mod gimbal_streams;
mod heartbeat;
mod identity;
mod noise;
mod outbox;
mod own_commands;
mod own_system;
pub mod pacing;
mod picture;
mod presented_device;
mod presenting;
mod rates;
mod receiving;
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
use crate::gimbals::operation::OperationId;
use crate::manager::Surroundings;
use crate::manager::asked::{Answer, Asked};
use crate::manager::rank::Ranks;
use crate::router::Router;
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::vehicle::Vehicle;
use crate::wire::{FrameBuffer, MavId};
use announcements::Announcements;
use asked::UnderWay;
use carrying_out::NotedTurning;
use channels::Channels;
use conflicts::Conflicts;
use ending::Stopping;
use events::Events;
use gimbal_streams::GimbalStreams;
use identity::Identity;
use outbox::Outbox;
use presenting::Presented;
use rivals::RivalWatch;
use roster::{LeftTurning, Roster};
use settings::{Role, Settings};
use state_for_gimbals::StateForGimbals;
use stations::Stations;
use streams::AutopilotStreams;
use transactions::Transactions;

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
    /// Somebody outside MAVLink who may asks something of the gimbal of that name; each is answered by exactly one
    /// [`Output::Answered`].
    Asked {
        id: OperationId,
        gimbal: &'a str,
        asked: &'a Asked,
    },
    /// The process is to end: stop what moves, say goodbye.
    Shutdown,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output<'a> {
    /// Send one whole frame to each of `channels`.
    Transmit { channels: ChannelSet, bytes: &'a [u8] },
    /// Keep the adopted system id for the next start.
    StoreSystemId(u8),
    /// Keep which gimbals are told to turn, one to a line, for a start after we were killed; empty when none is.
    StoreTurning(&'a str),
    /// Keep which ids gimbals without an entry were given, one to a line, for the next start.
    StoreGimbalIds(&'a str),
    /// What became of something asked.
    Answered { id: OperationId, answer: &'a Answer },
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
    gimbal_streams: GimbalStreams,
    state_for_gimbals: StateForGimbals,
    transactions: Transactions,
    conflicts: Conflicts,
    events: Events,
    announcements: Announcements,
    stations: Stations,
    watch: RivalWatch,
    asked: UnderWay,
    presented: Presented,
    outbox: Outbox,
    buffer: FrameBuffer,
    timers: TimerTable<Timer>,
    shutting_down: bool,
    stopping: Option<Stopping>,
    /// Kept outside when it changes.
    turning: NotedTurning,
    /// The revision of the ids of gimbals that was given out to be kept.
    kept_ids: u32,
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
        // A gimbal that an earlier run left turning may listen to the system alone that told it to.
        let left_turning = settings.left_turning.iter().rev().find_map(|line| LeftTurning::read(line)?.device);
        let listens_to = left_turning.map(|device| device.system);
        let identity = Identity::new(now, settings.system_id, settings.stored_system_id, listens_to);
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
            gimbal_streams: GimbalStreams::default(),
            state_for_gimbals: StateForGimbals::default(),
            transactions: Transactions::default(),
            events: Events::default(),
            announcements: Announcements::default(),
            conflicts: Conflicts::new(settings.links.iter().map(|link| link.name.clone()).collect()),
            stations: Stations::default(),
            watch: RivalWatch::default(),
            asked: UnderWay::default(),
            presented: Presented::new(settings.present_device),
            outbox: Outbox::default(),
            buffer: FrameBuffer::default(),
            timers: TimerTable::default(),
            shutting_down: false,
            stopping: None,
            turning: NotedTurning::default(),
            kept_ids: 0,
            identity,
            settings,
        };
        bridge.router.set_own_system(bridge.identity.system());
        bridge.ranks.set_own_system(bridge.identity.system());
        bridge.timers.set(Timer::Heartbeat, now);
        bridge.present_new(now);
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
            Input::Asked { id, gimbal, asked } => self.handle_asked(now, id, gimbal, asked),
            Input::Shutdown => self.shut_down(now),
        }
        self.carry_out(now);
    }

    /// Does what is due at `now`; drain [`poll_output`](Self::poll_output) afterwards.
    pub fn handle_timeout(&mut self, now: Timestamp) {
        if self.shutting_down {
            self.handle_ending(now);
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
        self.give_up_asked(now);
        self.ask_autopilot(now);
        self.tell_gimbals_state(now);
        self.measure_round_trip(now);
        self.tell_as_presented(now);
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
            return self.ending_due();
        }
        let timers = [
            self.timers.next().map(|(at, _)| at),
            self.identity.poll_timeout(),
            self.channels.poll_timeout(),
            self.streams.poll_timeout().filter(|_| self.may_ask_autopilot()),
            self.transactions.poll_timeout(),
            self.asked.poll_timeout(),
            self.state_for_gimbals.poll_timeout(),
            self.timesync_due(),
            self.presented_due(),
        ];
        let gimbals = self.roster.iter().filter_map(|gimbal| gimbal.poll_timeout());
        let gimbals = gimbals.filter(|_| self.identity.system().is_some());
        timers.into_iter().flatten().chain(gimbals).min()
    }

    fn open_channel(&mut self, now: Timestamp, channel: ChannelId, link: LinkIndex, address: &str) {
        if !self.channels.open(channel, link, address) {
            return;
        }
        self.router.close_channel(channel);
        self.router.open_channel(channel);
        self.roster.open_channel(now, channel);
        if self.channels.role(channel) == Some(Role::Autopilot) {
            self.presented.open_channel(now, channel);
        }
        // A gimbal takes the system id of the first heartbeat it hears, so ours is the first there.
        if self.channels.role(channel) == Some(Role::Gimbal) && self.identity.system().is_some() {
            self.beat(now, channel.into());
        }
    }

    fn close_channel(&mut self, channel: ChannelId) {
        self.channels.close(channel);
        self.router.close_channel(channel);
        self.roster.close_channel(channel);
        self.gimbal_streams.close_channel(channel);
        self.presented.close_channel(channel);
    }

    /// The managers are shown what is known of the vehicle, also when nothing new was heard of it.
    fn handle_vehicle(&mut self, now: Timestamp) {
        let around = surroundings(&self.vehicle, self.autopilot, &self.ranks);
        for gimbal in self.roster.iter_mut() {
            gimbal.manager.handle_vehicle(now, around);
        }
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
