//! The gimbal manager: who may steer, and what the gimbal is told.
//!
//! Implements the manager side of the MAVLink Gimbal Protocol v2 for one gimbal. The rules stand in files of their own
//! ([`control`], [`tracking`], [`intervals`]); this machine puts them in order.

pub mod asked;
pub mod control;
pub mod events;
pub mod intervals;
mod manual;
pub mod messages;
pub mod rank;
pub mod request;
pub mod settings;
pub mod tracking;
pub mod voice;

mod autopilot_client;
mod commands;
mod demands;
mod device;
mod elsewhere;
mod given;
mod heading;
mod inquiries;
mod mount;
mod mount_reports;
mod output;
mod ownership;
mod readiness;
mod restarts;
pub mod roi;
pub mod rotation;
mod telling;
mod vendor_commands;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::channel::{ChannelId, ChannelSet};
use crate::geometry::{Angle, Position};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::report::{GimbalStatus, Identity};
use crate::gimbals::settings::{Family, GimbalSettings};
use crate::timestamp::Timestamp;
use crate::vehicle::Vehicle;
use crate::wire::ids::GimbalFlags;
use crate::wire::{MavId, Target};
use autopilot_client::AutopilotClient;
use commands::LastCommand;
use control::Control;
use events::{Event, RatesEnd};
use heading::HeadingBias;
use intervals::{DEFAULT_STATUS_INTERVAL, Schedule};
use messages::Interval;
use mount::MountSenders;
use mount_reports::MountReports;
pub use output::ManagerOutput;
use rank::Ranks;
use readiness::ReadinessWatch;
use request::Request;
use restarts::Restarts;
use rotation::Rotation;
use settings::ControlSettings;
use telling::can_aim;
use tracking::{RateTimeouts, Situation, Tracking};
pub use vendor_commands::Commander;
use voice::DeviceVoice;

/// An attitude older than this is not where the gimbal looks now.
const ATTITUDE_STALE: Duration = Duration::from_secs(1);

/// Where a request came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender {
    pub id: MavId,
    pub channel: ChannelId,
}

/// Who else is there while a manager decides.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    pub vehicle: &'a Vehicle,
    /// The autopilot of our system, once it was heard.
    pub autopilot: Option<MavId>,
    pub ranks: &'a Ranks,
    /// Whether a request of another component reached us by listening in: it is never answered.
    pub overheard: bool,
    /// Whether the sender belongs to another vehicle, which never has a say.
    pub other_vehicle: bool,
}

/// How the gimbal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceState {
    Searching,
    Alive,
    Lost,
}

impl DeviceState {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Searching => "searching",
            Self::Alive => "alive",
            Self::Lost => "lost",
        }
    }
}

/// The manager of one gimbal.
#[derive(Debug)]
pub struct GimbalManager {
    settings: GimbalSettings,
    rules: ControlSettings,
    device: Option<MavId>,
    state: DeviceState,
    /// It is lost because it was told to shut down.
    is_shut_down: bool,
    /// Its driver holds back what it is told.
    is_held_back: bool,
    identity: Identity,
    capabilities: Option<Capabilities>,
    readiness: ReadinessWatch,
    restarts: Restarts,
    /// Whether it is a v2 device is known, and so the device id that it has to clients.
    has_settled_id: bool,
    status: Option<(Timestamp, GimbalStatus)>,
    /// A sign of the device was heard, and it was not lost since.
    is_heard: bool,
    rotation: Option<Rotation>,
    /// When a gimbal that is not known is told again to stop.
    stop_unknown: Option<Timestamp>,
    /// When its device last told an attitude, also after it was lost.
    told_attitude: Option<Timestamp>,
    control: Control,
    tracking: Tracking,
    status_schedule: Schedule,
    information_schedule: Schedule,
    mount_reports: MountReports,
    /// What it says for a gimbal that is no v2 device.
    voice: Option<DeviceVoice>,
    /// The device id of the gimbal if it is none.
    number: Option<u8>,
    /// When whose demand is being carried out was last heard.
    source_heard: Timestamp,
    heading_bias: HeadingBias,
    /// When the primary last made a demand.
    primary_demand: Option<Timestamp>,
    /// The flags that the last 281 carried.
    told_flags: GimbalFlags,
    /// Where the gimbal was last told to look, of which an event told.
    told_roi: Option<Position>,
    /// What the last 280 said of pointing at places.
    told_can_aim: bool,
    last_command: Option<LastCommand>,
    /// The autopilot as far as it drives the gimbal as a device of its own.
    autopilot_client: AutopilotClient,
    mount_senders: MountSenders,
    /// Those under way; it is paused while there are any. Few, because few things are done at once.
    pauses: Vec<asked::Pause>,
    /// Of which the events tell.
    given: Vec<given::Given>,
    /// Whose commands of which number are being done by the gimbal.
    commanded: Vec<(MavId, u16)>,
    next_command: u64,
    rejected: BTreeMap<MavId, BTreeMap<&'static str, u64>>,
    outputs: VecDeque<ManagerOutput>,
}

impl GimbalManager {
    /// `number`: the device id that is kept for the gimbal in case that it is no v2 device, 1 to 6.
    pub fn new(settings: GimbalSettings, rules: ControlSettings, number: Option<u8>) -> Self {
        let always_spoken_for = settings.family.speaks_through_manager();
        let has_settled_id = matches!(settings.family, Family::MavlinkV2 | Family::MavlinkV1);
        let mount_reports = MountReports::new(settings.v1_status);
        Self {
            tracking: Tracking::new(settings.setpoint_rate_hz),
            settings,
            rules,
            device: None,
            state: DeviceState::Searching,
            is_shut_down: false,
            is_held_back: false,
            identity: Identity::default(),
            capabilities: None,
            readiness: ReadinessWatch::default(),
            restarts: Restarts::default(),
            has_settled_id,
            status: None,
            is_heard: false,
            rotation: None,
            stop_unknown: None,
            told_attitude: None,
            control: Control::default(),
            status_schedule: Schedule::new(Interval::Every(DEFAULT_STATUS_INTERVAL)),
            information_schedule: Schedule::new(Interval::Off),
            mount_reports,
            voice: number.filter(|_| always_spoken_for).map(DeviceVoice::new),
            number,
            source_heard: Timestamp::ZERO,
            heading_bias: HeadingBias::default(),
            primary_demand: None,
            told_flags: GimbalFlags::empty(),
            told_roi: None,
            told_can_aim: false,
            last_command: None,
            autopilot_client: AutopilotClient::default(),
            mount_senders: MountSenders::default(),
            pauses: Vec::new(),
            given: Vec::new(),
            commanded: Vec::new(),
            next_command: 0,
            rejected: BTreeMap::new(),
            outputs: VecDeque::new(),
        }
    }

    pub fn open_channel(&mut self, now: Timestamp, channel: ChannelId) {
        self.status_schedule.open(now, channel);
        self.information_schedule.open(now, channel);
        self.mount_reports.open(now, channel);
        if let Some(voice) = &mut self.voice {
            voice.schedule.open(now, channel);
        }
    }

    pub fn close_channel(&mut self, channel: ChannelId) {
        self.status_schedule.close(channel);
        self.information_schedule.close(channel);
        self.mount_reports.close(channel);
        if let Some(voice) = &mut self.voice {
            voice.schedule.close(channel);
        }
    }

    /// A request addressed to this manager, or to everybody.
    pub fn handle_request(&mut self, now: Timestamp, sender: Sender, request: &Request, around: Surroundings<'_>) {
        // A place whose lease ran out is free from that moment on, not only when the timer came round to it.
        self.end_leases(now);
        match request {
            Request::Demand { target, gimbal, .. } if *gimbal != 0 && Some(*gimbal) != self.device_id() => {
                // To everybody it was for the gimbal of another manager, perhaps.
                if matches!(target, Target::Component(_)) {
                    self.count_refusal(sender.id, "unknown_gimbal");
                }
            }
            Request::Demand { demand, .. } => match self.handle_demand(now, sender.id, demand, around) {
                // A command that comes after it is none of the past.
                Ok(()) => self.last_command = None,
                Err(refusal) => self.count_refusal(sender.id, refusal.reason),
            },
            Request::Command(command) => self.handle_command(now, sender, command, around),
            Request::Mount { target, message } => {
                match self.handle_mount_message(now, sender.id, *target, *message, around) {
                    Ok(()) => self.last_command = None,
                    Err(refusal) => self.count_refusal(sender.id, refusal.reason),
                }
            }
        }
        self.carry_out(now, around);
    }

    /// More, or less, may be known of the vehicle.
    pub fn handle_vehicle(&mut self, now: Timestamp, around: Surroundings<'_>) {
        self.carry_out(now, around);
    }

    /// The autopilot told how the vehicle is turned; a setpoint that turns with it follows at once.
    ///
    /// Its position does not have that effect: it changes slowly, and would use up the moment of the attitude that often
    /// comes in the same datagram.
    pub fn handle_turned(&mut self, now: Timestamp, around: Surroundings<'_>) {
        if let Some(capabilities) = self.capabilities {
            let situation = self.situation(now, &capabilities, around);
            self.tracking.handle_turned(now, &situation);
        }
        self.carry_out(now, around);
    }

    /// Something was heard from `id`, which keeps its control alive.
    pub fn handle_heard(&mut self, now: Timestamp, id: MavId) {
        self.control.handle_heard(now, id);
        if self.tracking.source() == Some(id) {
            self.source_heard = now;
        }
    }

    pub fn handle_timeout(&mut self, now: Timestamp, around: Surroundings<'_>) {
        self.end_leases(now);
        self.give_back_for_autopilot(now, around);
        if self.source_lost_at().is_some_and(|at| at <= now) {
            self.tracking.stop_rates(now);
            if let Some(who) = self.tracking.source() {
                self.tell(Event::RatesEnded { who, end: RatesEnd::SenderSilent });
            }
        }
        let due = self.status_schedule.take_due(now);
        if !due.is_empty()
            && let Some(message) = self.status_message(now)
        {
            self.outputs.push_back(ManagerOutput::Broadcast { channels: Some(due), message });
        }
        let due = self.information_schedule.take_due(now);
        if !due.is_empty()
            && let Some(message) = self.information(now, around)
        {
            self.outputs.push_back(ManagerOutput::Broadcast { channels: Some(due), message });
        }
        let due = self.voice.as_mut().map_or(ChannelSet::EMPTY, |voice| voice.schedule.take_due(now));
        if !due.is_empty()
            && let Some(message) = self.device_attitude_status(now, around)
        {
            self.outputs.push_back(ManagerOutput::Broadcast { channels: Some(due), message });
        }
        self.tell_mount_reports(now, around);
        self.handle_rotation_timeout(now);
        self.tracking.handle_timeout(now);
        self.carry_out(now, around);
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let voice = self.voice.as_ref().and_then(|voice| voice.schedule.poll_timeout());
        let schedules = [
            self.status_schedule.poll_timeout(),
            self.information_schedule.poll_timeout(),
            self.mount_reports.poll_timeout(),
            voice,
        ];
        // Without a device there is nothing to tell of.
        let schedules = schedules.into_iter().flatten().filter(|_| self.device.is_some());
        let lease = self.rules.lease_timeout;
        let tracking = self.tracking.poll_timeout().filter(|_| self.pauses.is_empty() && self.readiness.is_ready());
        let control = self.control.poll_timeout(lease);
        let rest =
            [tracking, control, self.source_lost_at(), self.rotation_due(), self.autopilot_client.poll_timeout()];
        schedules.chain(rest.into_iter().flatten()).min()
    }

    pub fn poll_output(&mut self) -> Option<ManagerOutput> {
        self.outputs.pop_front()
    }

    pub fn settings(&self) -> &GimbalSettings {
        &self.settings
    }

    pub fn control(&self) -> &Control {
        &self.control
    }

    pub fn tracking(&self) -> &Tracking {
        &self.tracking
    }

    /// By how much the gimbal takes the vehicle's heading for another than the autopilot does, where that is much.
    pub fn heading_apart(&self, now: Timestamp) -> Option<Angle> {
        self.heading_bias.apart(now).filter(|_| self.status.is_some())
    }

    /// Whether two on one line seem to have the id of its device.
    pub fn seems_to_be_two(&self, now: Timestamp) -> bool {
        self.restarts.are_of_two(now)
    }

    /// What was refused, by sender and reason.
    pub fn rejected(&self) -> &BTreeMap<MavId, BTreeMap<&'static str, u64>> {
        &self.rejected
    }

    /// Whether somebody holds primary or secondary control.
    pub fn is_held(&self) -> bool {
        self.control.primary().is_some() || self.control.secondary().is_some()
    }

    fn timeouts(&self) -> RateTimeouts {
        let commanded = Some(self.rules.command_rate_timeout).filter(|timeout| !timeout.is_zero());
        RateTimeouts { streamed: self.rules.rate_timeout, commanded }
    }

    fn situation<'a>(&self, now: Timestamp, capabilities: &'a Capabilities, around: Surroundings<'_>) -> Situation<'a> {
        let status = self.status.filter(|(at, _)| now.since(*at) <= ATTITUDE_STALE).map(|(_, status)| status);
        Situation {
            measured: status,
            heading: self.heading_bias.heading(status.and_then(|status| status.heading), around.vehicle.heading(now)),
            position: around.vehicle.position(now),
            is_held_back: self.is_held_back,
            capabilities,
            accepts_earth_yaw: self.status.is_some_and(|(_, status)| status.accepts_earth_yaw),
            device_yaw_frame: self.settings.device_yaw_frame,
        }
    }

    fn tell(&mut self, event: Event) {
        self.outputs.push_back(ManagerOutput::Event(event));
    }

    /// After each event: a setpoint that is due goes out, and a change of the flags is told.
    fn carry_out(&mut self, now: Timestamp, around: Surroundings<'_>) {
        let roi = self.tracking.roi();
        if roi != self.told_roi {
            self.told_roi = roi;
            let who = self.tracking.source();
            self.tell(if roi.is_some() { Event::RoiStarted { who } } else { Event::RoiEnded { who } });
        }
        if let Some(capabilities) = self.capabilities.filter(|_| self.pauses.is_empty() && self.readiness.is_ready()) {
            let situation = self.situation(now, &capabilities, around);
            let is_steered = self.tracking.mode().is_some();
            if let Some(setpoint) = self.tracking.steer(now, &situation) {
                self.outputs.push_back(ManagerOutput::Steer(setpoint));
            }
            if is_steered && self.tracking.mode().is_none() {
                // Radio control has it now; the rotation may be what it goes on with when that lets go.
                self.leave_turning();
            }
        }
        self.note_rotation(now);
        if let Some(who) = self.tracking.take_timed_out() {
            self.tell(Event::RatesEnded { who, end: RatesEnd::TimedOut });
        }
        let flags = self.flags();
        if flags != self.told_flags {
            self.broadcast_status(now);
        }
        if can_aim(now, around) != self.told_can_aim {
            self.announce(now, around);
        }
    }

    /// When a rotation ends because who asked for it was not heard for the lease, however long its rate may last.
    fn source_lost_at(&self) -> Option<Timestamp> {
        self.tracking.is_rotating().then(|| self.source_heard + self.rules.lease_timeout)
    }
}
