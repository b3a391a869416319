//! Finds out what a gimbal speaks, where the configuration leaves that open (`family = "auto"`).
//!
//! Every gimbal is taken for a v2 device at first, and asked who it is for ever, as the Gimbal Protocol v2 has it. One that
//! says it is a Gremsy's is driven as one. One that gives no sign of being a v2 device is asked for parameters that only a
//! Gremsy has, and otherwise taken for a v1 gimbal: soon when it tells where it looks by a message of v1, late when it sends
//! nothing but heartbeats. Nothing of this moves it. Whenever a sign of v2 comes after all, it is a v2 device again, and one
//! that is taken for a v1 gimbal is asked on for what only a Gremsy has. One that was lost is taken for what it was and judged
//! again, for another may have come in its place; so is a v2 device that tells where it looks by v1 alone, for that
//! may have happened before it was called lost. What a v2 device says of itself outweighs the name
//! of a parameter, which anybody may use.

use std::collections::VecDeque;
use std::time::Duration;

use super::details::GimbalDetails;
use super::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use super::families;
use super::gremsy;
use super::mavlink_v2::packet::WhichGimbal;
use super::mavlink_v2::{MavlinkV2Driver, packet};
use super::operation::{Operation, OperationError, OperationId};
use super::parameters::Parameters;
use super::report::Report;
use super::setpoint::{Setpoint, Turning};
use super::settings::{Family, GimbalSettings};
use crate::geometry::{Angle, AngularRate};
use crate::timers::TimerTable;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{COMMAND_LONG_DATA, MavMessage};
use crate::wire::ids::message;
use crate::wire::{Frame, MavId};

/// A gimbal that tells its attitude by messages of v1, and says nothing of v2 for so long, is a v1 gimbal.
pub const V1_BY_ITS_ATTITUDE_AFTER: Duration = Duration::from_secs(5);

/// So is one that sends nothing but heartbeats for so long; a v2 device may take 15 s to start.
pub const V1_BY_ITS_SILENCE_AFTER: Duration = Duration::from_secs(20);

/// A v2 device tells where it looks several times a second. One that does not for so long, but by messages of v1, is asked what
/// it is, and judged again.
const V2_DOUBTED_AFTER: Duration = Duration::from_secs(10);

/// A gimbal that gives no sign of v2 for so long is asked for parameters of certain makes …
const ASK_PARAMETERS_AFTER: Duration = Duration::from_secs(2);
/// … so often …
const PARAMETER_QUESTIONS: u8 = 3;
/// … at this interval.
const ASK_PARAMETERS_EVERY: Duration = Duration::from_secs(1);
/// One that is taken for a v1 gimbal is asked again so often: the answers may all have been lost.
const ASK_PARAMETERS_AGAIN_EVERY: Duration = Duration::from_secs(10);

/// Stands in front of the driver of whatever family it turns out to be.
#[derive(Debug)]
pub struct Detection {
    settings: GimbalSettings,
    device: Option<MavId>,
    /// Asks for 283 also while another family is in use, so that a sign of v2 is not missed.
    v2: MavlinkV2Driver,
    /// The driver in use, where it is not `v2`.
    other: Option<Box<dyn GimbalDriver>>,
    evidence: Evidence,
    /// That it is there was reported, and that it is lost was not.
    is_reported: bool,
    /// When it last gave a sign of v2.
    spoke_v2: Timestamp,
    /// It was lost and has not beaten since: what comes back may be another.
    was_lost: bool,
    /// How it was last told to turn, while it is not told anything else.
    turning: Option<Turning>,
    /// An earlier run found out that these words stop it.
    stops_as: Option<Family>,
    timers: TimerTable<Timer>,
    outputs: VecDeque<DriverOutput>,
}

/// What the device said of its family since it was adopted, or lost.
#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    v2: bool,
    v1_attitude: bool,
    /// How often it was asked for parameters.
    questions: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Timer {
    /// When to ask for parameters.
    AskParameters,
    /// When to do without v2, if it tells its attitude by v1.
    JudgeByAttitude,
    /// When to do without v2 in any case.
    JudgeBySilence,
}

impl Detection {
    pub fn new(settings: GimbalSettings) -> Self {
        Self {
            settings,
            device: None,
            v2: MavlinkV2Driver::new(),
            other: None,
            evidence: Evidence::default(),
            is_reported: false,
            spoke_v2: Timestamp::ZERO,
            was_lost: false,
            turning: None,
            stops_as: None,
            timers: TimerTable::default(),
            outputs: VecDeque::new(),
        }
    }

    fn in_use(&mut self) -> &mut dyn GimbalDriver {
        match &mut self.other {
            Some(other) => other.as_mut(),
            None => &mut self.v2,
        }
    }

    /// From now on the gimbal is of `family`.
    fn take(&mut self, now: Timestamp, family: Family) {
        let Some(device) = self.device.filter(|_| self.family() != family) else { return };
        tracing::info!(%device, family = family.name(), "the gimbal's family is known");
        // What is only taken for a v1 gimbal may turn out to be what it was.
        if family != Family::MavlinkV1 {
            self.stops_as = None;
        }
        self.stop_judging();
        self.take_leave(now);
        let parameters = self.in_use().hand_over_parameters();
        self.end_operations();
        // A Gremsy may be either, and says which.
        if family != Family::Gremsy {
            self.outputs.push_back(DriverOutput::Report(Report::SpeaksForItself(family == Family::MavlinkV2)));
        }
        if family == Family::MavlinkV2 {
            // What it told meanwhile went nowhere.
            self.v2 = MavlinkV2Driver::new();
            self.v2.adopt(now, device);
            self.other = None;
        } else {
            let mut other = families::driver(family, &self.settings);
            other.adopt(now, device);
            self.other = Some(other);
        }
        if let Some(parameters) = parameters {
            self.hand_over(parameters);
        }
        if family == Family::MavlinkV1 {
            self.timers.set(Timer::AskParameters, now + ASK_PARAMETERS_AGAIN_EVERY);
        }
    }

    /// What was asked of a driver that is given up, and is not done, is not done any more.
    fn end_operations(&mut self) {
        let Some(other) = &mut self.other else { return };
        other.handle_link_lost();
        while let Some(output) = other.poll_output() {
            if let DriverOutput::Operated { .. } = output {
                self.outputs.push_back(output);
            }
        }
    }

    /// The driver that comes into use goes on with what another has read and was asked for; a Gremsy's reads by names of its
    /// own, and begins by that.
    fn hand_over(&mut self, mut parameters: Parameters) {
        if self.family() == Family::Gremsy {
            parameters.abandon(&OperationError::NotReady);
            parameters.drain_into(&mut self.outputs);
        } else {
            self.in_use().take_over_parameters(parameters);
        }
    }

    /// The driver in use ends a rotation in its own words: in those of another the gimbal may not understand it.
    fn take_leave(&mut self, now: Timestamp) {
        if let Some(turning) = self.turning.take() {
            self.in_use().handle_setpoint(now, Setpoint::Turn(turning.stopped()));
            self.collect();
        }
        if self.is_reported {
            self.outputs.push_back(DriverOutput::Report(Report::AnotherFamily));
        }
    }

    /// Notes what a frame of the device says of its family.
    fn weigh(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if matches!(frame.message_id(), message::GIMBAL_DEVICE_INFORMATION | message::GIMBAL_DEVICE_ATTITUDE_STATUS) {
            self.spoke_v2 = now;
        }
        // One of these speaks both v1 and v2, and says by 283 that it is one.
        if self.family() == Family::Gremsy {
            match frame.message_id() {
                message::GIMBAL_DEVICE_INFORMATION if gremsy::is_denied_by(frame) => {
                    self.evidence.v2 = true;
                    self.take(now, Family::MavlinkV2);
                }
                message::GIMBAL_DEVICE_INFORMATION | message::PARAM_VALUE if gremsy::is_known_by(frame) => {
                    self.was_lost = false;
                    self.stop_judging();
                }
                // It has time to say that it is one still.
                message::HEARTBEAT if std::mem::take(&mut self.was_lost) => {
                    self.evidence.questions = 0;
                    self.timers.set(Timer::AskParameters, now + ASK_PARAMETERS_AFTER);
                    self.timers.set(Timer::JudgeBySilence, now + V1_BY_ITS_SILENCE_AFTER);
                }
                _ => {}
            }
            return;
        }
        match frame.message_id() {
            message::HEARTBEAT if !self.is_reported && self.other.is_none() && !self.evidence.v2 => {
                self.begin_judging(now);
            }
            message::MOUNT_ORIENTATION | message::MOUNT_STATUS
                if self.evidence.v2 && now.since(self.spoke_v2) >= V2_DOUBTED_AFTER =>
            {
                self.evidence = Evidence { v1_attitude: true, ..Evidence::default() };
                self.v2.ask_information_anew(now);
                self.begin_judging(now);
            }
            message::HEARTBEAT if self.family() == Family::MavlinkV1 => {
                self.timers.set_no_later(Timer::AskParameters, now + ASK_PARAMETERS_AGAIN_EVERY);
            }
            message::PARAM_VALUE if !self.evidence.v2 && gremsy::is_known_by(frame) => self.take(now, Family::Gremsy),
            message::GIMBAL_DEVICE_INFORMATION if gremsy::is_known_by(frame) => self.take(now, Family::Gremsy),
            message::GIMBAL_DEVICE_INFORMATION | message::GIMBAL_DEVICE_ATTITUDE_STATUS
                if (!self.evidence.v2 || self.other.is_some()) && is_of_v2(frame) =>
            {
                self.evidence.v2 = true;
                self.stops_as = None;
                self.stop_judging();
                if self.family() == Family::MavlinkV2 {
                    self.outputs.push_back(DriverOutput::Report(Report::SpeaksForItself(true)));
                }
                self.take(now, Family::MavlinkV2);
            }
            message::MOUNT_ORIENTATION | message::MOUNT_STATUS => self.evidence.v1_attitude = true,
            _ => {}
        }
    }

    /// A Gremsy of the first generation hears no zeros of v2. To a plain v1 gimbal its own are angles, so they are only for
    /// what is known to have been one.
    fn stop_as_before(&mut self) {
        if let (Some(device), Some(Family::Gremsy)) = (self.device, self.stops_as) {
            let zeros = gremsy::packet::turn_at(device, [AngularRate::ZERO; 3]);
            self.outputs.push_back(DriverOutput::Message(Box::new(MavMessage::COMMAND_LONG(zeros))));
        }
    }

    fn begin_judging(&mut self, now: Timestamp) {
        self.evidence.questions = 0;
        self.timers.set(Timer::AskParameters, now + ASK_PARAMETERS_AFTER);
        self.timers.set(Timer::JudgeByAttitude, now + V1_BY_ITS_ATTITUDE_AFTER);
        self.timers.set(Timer::JudgeBySilence, now + V1_BY_ITS_SILENCE_AFTER);
    }

    fn stop_judging(&mut self) {
        for timer in [Timer::AskParameters, Timer::JudgeByAttitude, Timer::JudgeBySilence] {
            self.timers.cancel(timer);
        }
    }

    fn ask_parameters(&mut self, now: Timestamp) {
        let Some(device) = self.device else { return };
        let questions = gremsy::telling_questions(device);
        self.outputs.extend(questions.map(|question| DriverOutput::Message(Box::new(question))));
        self.evidence.questions = self.evidence.questions.saturating_add(1);
        if self.family() == Family::MavlinkV1 {
            self.timers.set(Timer::AskParameters, now + ASK_PARAMETERS_AGAIN_EVERY);
        } else if self.evidence.questions < PARAMETER_QUESTIONS {
            self.timers.set(Timer::AskParameters, now + ASK_PARAMETERS_EVERY);
        }
    }

    /// Takes over what the drivers want done; beside another driver in use, v2 only asks.
    fn collect(&mut self) {
        while let Some(output) = self.in_use().poll_output() {
            match output {
                // A driver that took the place of another hears the gimbal for the first time, the manager does not.
                DriverOutput::Report(Report::Alive { .. }) if self.is_reported => {}
                DriverOutput::Report(Report::Alive { .. }) => {
                    self.is_reported = true;
                    self.outputs.push_back(output);
                }
                DriverOutput::Report(Report::Lost | Report::ShutDown) => {
                    self.is_reported = false;
                    self.was_lost = true;
                    // What it said speaks for none that comes in its place.
                    self.evidence = Evidence::default();
                    self.stop_judging();
                    self.outputs.push_back(output);
                }
                output => self.outputs.push_back(output),
            }
        }
        if self.other.is_some() {
            while let Some(output) = self.v2.poll_output() {
                if let DriverOutput::Message(_) = output {
                    self.outputs.push_back(output);
                }
            }
        }
    }
}

impl GimbalDriver for Detection {
    fn family(&self) -> Family {
        self.other.as_ref().map_or(Family::MavlinkV2, |other| other.family())
    }

    fn adopt(&mut self, now: Timestamp, device: MavId) {
        let (outputs, stops_as) = (std::mem::take(&mut self.outputs), self.stops_as);
        *self = Self { outputs, stops_as, ..Self::new(self.settings.clone()) };
        self.device = Some(device);
        self.v2.adopt(now, device);
        self.collect();
    }

    fn handle_received(&mut self, now: Timestamp, frame: &Frame<'_>) {
        if Some(frame.source()) != self.device {
            return;
        }
        self.weigh(now, frame);
        if self.family() != Family::Gremsy {
            self.v2.handle_received(now, frame);
        }
        if let Some(other) = &mut self.other {
            other.handle_received(now, frame);
        }
        self.collect();
    }

    fn handle_vehicle_heading(&mut self, heading: Option<Angle>) {
        if let Some(other) = &mut self.other {
            other.handle_vehicle_heading(heading);
        }
    }

    fn words_that_stop(&self, turning: Turning) -> Vec<MavMessage> {
        self.other.as_ref().map_or_else(|| self.v2.words_that_stop(turning), |other| other.words_that_stop(turning))
    }

    fn handle_link_lost(&mut self) {
        self.v2.handle_link_lost();
        if let Some(other) = &mut self.other {
            other.handle_link_lost();
        }
        self.collect();
    }

    fn handle_setpoint(&mut self, now: Timestamp, setpoint: Setpoint) {
        self.turning = match setpoint {
            Setpoint::Turn(turning) if !turning.is_zero() => Some(turning),
            _ => None,
        };
        self.in_use().handle_setpoint(now, setpoint);
        self.collect();
        if matches!(setpoint, Setpoint::Turn(turning) if turning.is_zero()) {
            self.stop_as_before();
        }
    }

    fn handle_command_outcome(&mut self, now: Timestamp, command: &COMMAND_LONG_DATA, outcome: CommandOutcome) {
        self.in_use().handle_command_outcome(now, command, outcome);
        self.collect();
    }

    fn handle_operation(&mut self, now: Timestamp, id: OperationId, operation: Operation) {
        self.in_use().handle_operation(now, id, operation);
        self.collect();
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if self.family() != Family::Gremsy {
            self.v2.handle_timeout(now);
        }
        if let Some(other) = &mut self.other {
            other.handle_timeout(now);
        }
        while let Some(timer) = self.timers.pop_due(now) {
            match timer {
                Timer::AskParameters => self.ask_parameters(now),
                Timer::JudgeByAttitude if self.evidence.v1_attitude => self.take(now, Family::MavlinkV1),
                Timer::JudgeByAttitude => {}
                Timer::JudgeBySilence => self.take(now, Family::MavlinkV1),
            }
        }
        self.collect();
    }

    fn stops_as(&self) -> Option<Family> {
        Some(self.family()).filter(|family| *family == Family::Gremsy).or(self.stops_as)
    }

    fn stop_as(&mut self, family: Family) {
        self.stops_as = Some(family);
    }

    fn leans_on_attitude(&self) -> bool {
        self.other.as_ref().is_some_and(|other| other.leans_on_attitude())
    }

    fn may_be_turning(&self) -> bool {
        self.other.as_ref().map_or_else(|| self.v2.may_be_turning(), |other| other.may_be_turning())
    }

    fn poll_output(&mut self) -> Option<DriverOutput> {
        self.outputs.pop_front()
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        let other = self.other.as_ref().and_then(|other| other.poll_timeout());
        let timer = self.timers.next().map(|(at, _)| at);
        let v2 = self.v2.poll_timeout().filter(|_| self.family() != Family::Gremsy);
        [v2, other, timer].into_iter().flatten().min()
    }

    fn details(&self, now: Timestamp) -> GimbalDetails {
        self.other.as_ref().map_or_else(|| self.v2.details(now), |other| other.details(now))
    }
}

/// Whether only a v2 device says that of itself. One that names an id that nobody has is no v1 gimbal either.
fn is_of_v2(frame: &Frame<'_>) -> bool {
    let information = packet::read_information(frame).map(|information| information.of);
    let of = information.or_else(|| packet::read_status(frame).map(|status| status.of));
    matches!(of, Some(WhichGimbal::Sender | WhichGimbal::Nobody(_)))
}
