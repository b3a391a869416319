//! Steering a Gremsy that speaks v1: first its mode, then where to look.
//!
//! Angles are kept to the vehicle's nose in its mode FOLLOW and to North in LOCK, so a mode is asked for once and waited
//! for before the first angle in it. It goes on turning at a rate until it is told otherwise: rates are repeated, and end
//! with zeros, which wait for nothing. Whatever else is wanted of a gimbal that may be turning waits for the answer to one
//! of these, except an angle that can be said at once.

mod order;

use std::collections::VecDeque;
use std::time::Duration;

pub use self::order::Order;

use super::rotation::Rotation;
use crate::geometry::AngularRate;
use crate::gimbals::driver::CommandOutcome;
use crate::gimbals::gremsy::packet;
use crate::gimbals::operation::YawMode;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::COMMAND_LONG_DATA;
use crate::wire::ids::CommandResult;

/// Another order is sent at most so soon after one: 25 times a second.
const LEAST_INTERVAL: Duration = Duration::from_millis(40);
/// The same order is repeated so often while the gimbal moves …
const REPEAT_MOVING: Duration = Duration::from_millis(100);
/// … and so often at rest.
const REPEAT_IDLE: Duration = Duration::from_secs(1);
/// It is taken to move at least so long after an order …
const MOVES_AT_LEAST: Duration = Duration::from_secs(1);
/// … and at most so long, wherever it looks.
const MOVES_AT_MOST: Duration = Duration::from_secs(10);

/// A rate is stopped when whoever steers has not repeated it for so long.
pub const DEAD_MAN: Duration = Duration::from_millis(500);

/// Zeros to one that is not heard are repeated so often.
const REPEAT_UNHEARD: Duration = Duration::from_secs(1);

/// And no order is carried on with that was not said for so long: whoever steers has let go of it.
const LET_GO: Duration = Duration::from_secs(1);

/// A mode that it refused is not asked for again sooner.
const REFUSED_FOR: Duration = Duration::from_secs(2);

/// Motors that are switched on take 3 s.
const MOTORS_START: Duration = Duration::from_secs(6);

/// So many orders without one answer, and for so long, mean that it does not hear.
const UNANSWERED: u32 = 5;
const UNANSWERED_FOR: Duration = Duration::from_secs(3);

/// How the gimbal is at this moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    pub is_heard: bool,
    /// It may be told where to look.
    pub is_ready: bool,
    /// It looks where it was told to.
    pub is_there: bool,
    pub motors_on: bool,
    /// Whether it has stopped turning is being watched, beyond its answers.
    pub is_watched: bool,
}

/// What is to be sent.
#[derive(Clone, Debug, PartialEq)]
pub enum MountOutput {
    /// Again and again, so it needs no care of its own.
    Send(COMMAND_LONG_DATA),
    /// Once, until it is answered.
    Command(COMMAND_LONG_DATA),
    /// It does not change its mode.
    ModeRefused,
    /// It does, after all.
    ModeTaken,
    /// Its motors do not come back after they were switched off by an order.
    StaysRetracted,
    /// It does not answer a command that has to be answered before it is told where to look.
    Unanswered,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Unknown,
    Asked(YawMode),
    Is(YawMode),
    Refused(YawMode, Timestamp),
}

/// Whether the motors are off because an order wanted it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Retraction {
    No,
    Off,
    Returning { since: Timestamp },
}

#[derive(Debug)]
pub struct Mount {
    wanted: Option<Order>,
    /// When it became another one.
    changed: Timestamp,
    /// When it was last said.
    refreshed: Timestamp,
    sent: Option<(Timestamp, Order)>,
    rotation: Rotation,
    /// When it was last told to stop, since it was told to turn.
    stopped: Option<Timestamp>,
    /// An order that is given out once was.
    is_given: bool,
    mode: Mode,
    retraction: Retraction,
    unanswered: u32,
    unanswered_since: Timestamp,
    outputs: VecDeque<MountOutput>,
}

impl Default for Mount {
    fn default() -> Self {
        Self {
            wanted: None,
            changed: Timestamp::ZERO,
            refreshed: Timestamp::ZERO,
            sent: None,
            rotation: Rotation::default(),
            stopped: None,
            is_given: false,
            mode: Mode::Unknown,
            retraction: Retraction::No,
            unanswered: 0,
            unanswered_since: Timestamp::ZERO,
            outputs: VecDeque::new(),
        }
    }
}

impl Mount {
    /// What it is to do from now on.
    pub fn order(&mut self, now: Timestamp, order: Order) {
        self.refreshed = now;
        if self.wanted != Some(order) {
            self.wanted = Some(order);
            self.changed = now;
            self.is_given = false;
        }
    }

    /// It is to do something else than it was ordered, or nothing: a rotation is stopped first.
    pub fn drop_order(&mut self, now: Timestamp, device: MavId, condition: Condition) {
        self.wanted = None;
        self.stop_when_due(now, device, condition);
    }

    /// It was restarted or not heard for long: it does not know its mode any more, nor what it was told.
    pub fn handle_restart(&mut self) {
        self.mode = Mode::Unknown;
        self.retraction = Retraction::No;
        self.is_given = false;
        self.unanswered = 0;
        if self.wanted.is_some_and(Order::turns) {
            self.wanted = None;
        }
        self.sent = None;
    }

    /// It was lost: what it was told is not told again when it is back.
    pub fn handle_lost(&mut self) {
        self.handle_restart();
        self.wanted = None;
    }

    /// Whether it was told to turn, and that it has stopped is not known.
    pub fn may_be_turning(&self) -> bool {
        self.rotation.may_turn()
    }

    /// What it was told before is not known: it is stopped.
    pub fn assume_turning(&mut self) {
        self.rotation.assume();
    }

    /// It stands without its motors, or is told by other means.
    pub fn forget_rotation(&mut self) {
        self.rotation = Rotation::default();
    }

    /// Whether an order has switched the motors off.
    pub fn is_retracted(&self) -> bool {
        self.retraction != Retraction::No
    }

    pub fn wanted(&self) -> Option<Order> {
        self.wanted
    }

    /// The mode that it was last told and took.
    pub fn mode(&self) -> Option<YawMode> {
        match self.mode {
            Mode::Is(mode) => Some(mode),
            Mode::Unknown | Mode::Asked(_) | Mode::Refused(..) => None,
        }
    }

    /// Its status shows the mode; another one than it was told long ago means that somebody else has changed it.
    pub fn handle_shown_mode(&mut self, shown: YawMode) {
        if matches!(self.mode, Mode::Is(mode) if mode != shown) {
            self.mode = Mode::Unknown;
        }
    }

    /// A mode was changed without an order of this kind.
    pub fn note_mode(&mut self, mode: YawMode) {
        self.mode = Mode::Is(mode);
    }

    /// It was handed to its radio receiver, or let go on its own way: before the next angle its mode is said again.
    pub fn forget_mode(&mut self) {
        self.mode = Mode::Unknown;
    }

    /// It answered an order.
    pub fn handle_answer(&mut self, is_accepted: bool) {
        self.rotation.handle_answer(is_accepted);
        self.unanswered = 0;
    }

    /// It answered none of the latest orders.
    pub fn leaves_unanswered(&self) -> bool {
        self.unanswered >= UNANSWERED
    }

    /// It was sent orders, and answered none for long.
    pub fn is_unanswered(&self, now: Timestamp) -> bool {
        self.leaves_unanswered() && now.since(self.unanswered_since) >= UNANSWERED_FOR
    }

    /// It is told where to look, and does not leave what it is told unanswered. A target that changes all the time is told as
    /// often as anything is.
    pub fn has_heard(&self, now: Timestamp) -> bool {
        let is_told = match (self.sent, self.wanted) {
            (Some((_, sent)), Some(wanted)) if sent == wanted => true,
            (Some((at, Order::Point { mode: sent, .. })), Some(Order::Point { mode: wanted, .. })) => {
                sent == wanted && now.since(at) <= REPEAT_MOVING
            }
            _ => false,
        };
        is_told && !self.leaves_unanswered()
    }

    /// What became of a command of [`MountOutput::Command`]; false for one that is none of these.
    pub fn handle_outcome(
        &mut self,
        now: Timestamp,
        device: MavId,
        command: &COMMAND_LONG_DATA,
        outcome: CommandOutcome,
    ) -> bool {
        let is = |of: &COMMAND_LONG_DATA| {
            (of.command, of.param1, of.param6, of.param7)
                == (command.command, command.param1, command.param6, command.param7)
        };
        let is_done = outcome == CommandOutcome::Answered(CommandResult::Accepted as u8);
        let or_unanswered = |output: MountOutput| match outcome {
            CommandOutcome::Unanswered => Some(MountOutput::Unanswered),
            CommandOutcome::GivenUp => None,
            CommandOutcome::Answered(_) => Some(output),
        };
        if let Mode::Asked(mode) = self.mode
            && is(&mode_command(device, mode))
        {
            let output = if is_done { Some(MountOutput::ModeTaken) } else { or_unanswered(MountOutput::ModeRefused) };
            self.mode = if is_done { Mode::Is(mode) } else { Mode::Refused(mode, now) };
            self.outputs.extend(output);
            return true;
        }
        if matches!(self.retraction, Retraction::Returning { .. }) && is(&packet::set_motors(device, true)) {
            if !is_done {
                self.retraction = Retraction::Off;
                self.outputs.extend(or_unanswered(MountOutput::StaysRetracted));
            }
            return true;
        }
        self.is_given && self.wanted.and_then(|wanted| wanted.given_once(device)).is_some_and(|given| is(&given))
    }

    /// Sends what is due, or says in [`poll_timeout`](Self::poll_timeout) when it is.
    pub fn advance(&mut self, now: Timestamp, device: MavId, condition: Condition) {
        if self.wanted.is_some_and(Order::turns) && now.since(self.refreshed) >= DEAD_MAN {
            tracing::warn!(%device, "a rotation that nobody repeats is stopped");
            self.stop(now, device);
        }
        if self.wanted.is_some() && now.since(self.refreshed) >= LET_GO {
            self.wanted = None;
            self.sent = None;
        }
        if !self.is_sayable(condition) && (self.may_be_turning() || condition.is_watched) {
            self.stop_when_due(now, device, condition);
            return;
        }
        let Some(wanted) = self.wanted else { return };
        if wanted.is_stop() {
            self.send_when_due(now, device, condition);
            return;
        }
        if !condition.is_ready {
            return;
        }
        match wanted {
            // In LOCK it would go there once, and turn away from the nose with the vehicle.
            Order::Home => {
                if self.has_motors(now, device, condition) && self.is_in_mode(now, device, YawMode::Follow) {
                    self.give(device);
                } else {
                    self.is_given = false;
                }
            }
            Order::Retract | Order::RadioControl => self.give(device),
            Order::Point { mode, .. } | Order::Turn { mode, .. } => {
                if self.has_motors(now, device, condition) && self.is_in_mode(now, device, mode) {
                    self.send_when_due(now, device, condition);
                }
            }
        }
    }

    /// When [`advance`](Self::advance) is due. `None` while it waits for the gimbal.
    pub fn poll_timeout(&self, condition: Condition) -> Option<Timestamp> {
        let stops = (self.may_be_turning() || condition.is_watched) && !self.is_sayable(condition);
        let stop = stops.then(|| self.stop_due(condition));
        let Some(wanted) = self.wanted else { return stop };
        let dead_man = Some(self.refreshed + if wanted.turns() { DEAD_MAN } else { LET_GO });
        if stops {
            return stop.min(dead_man);
        }
        let waits = match (wanted, self.mode, self.retraction) {
            _ if wanted.is_stop() => None,
            _ if !condition.is_ready => return dead_man,
            (Order::Retract | Order::RadioControl, ..) => return dead_man,
            (_, _, Retraction::Returning { since }) => Some(since + MOTORS_START),
            (_, Mode::Refused(_, at), _) => Some(at + REFUSED_FOR),
            (Order::Point { mode: wanted, .. } | Order::Turn { mode: wanted, .. }, Mode::Is(mode), _)
                if mode == wanted =>
            {
                None
            }
            // For the answer.
            _ => return dead_man,
        };
        let due = self.sent.map(|(at, sent)| at + self.interval(at, sent, wanted, condition));
        [dead_man, waits.or(due)].into_iter().flatten().min()
    }

    pub fn poll_output(&mut self) -> Option<MountOutput> {
        self.outputs.pop_front()
    }

    fn stop(&mut self, now: Timestamp, device: MavId) {
        let mode = match self.wanted {
            Some(Order::Turn { mode, .. }) => mode,
            _ => YawMode::Follow,
        };
        self.wanted = Some(Order::Turn { rates: [AngularRate::ZERO; 3], mode });
        self.changed = now;
        self.sent = None;
        self.say(now, device, Order::Turn { rates: [AngularRate::ZERO; 3], mode });
    }

    /// Whether what is wanted can be said at this moment, and so ends a rotation itself.
    fn is_sayable(&self, condition: Condition) -> bool {
        match self.wanted {
            Some(wanted) if wanted.is_stop() => true,
            Some(Order::Point { mode, .. } | Order::Turn { mode, .. }) => {
                condition.is_ready && self.retraction == Retraction::No && self.mode == Mode::Is(mode)
            }
            Some(Order::Home | Order::Retract | Order::RadioControl) | None => false,
        }
    }

    /// Zeros for a gimbal that may be turning while something else is wanted, or nothing.
    fn stop_when_due(&mut self, now: Timestamp, device: MavId, condition: Condition) {
        if (self.may_be_turning() || condition.is_watched) && self.stop_due(condition) <= now {
            self.say(now, device, Order::Turn { rates: [AngularRate::ZERO; 3], mode: YawMode::Follow });
        }
    }

    fn stop_due(&self, condition: Condition) -> Timestamp {
        let every = if condition.is_heard { REPEAT_MOVING } else { REPEAT_UNHEARD };
        self.stopped.map_or(Timestamp::ZERO, |at| at + every)
    }

    /// Motors that an order switched off are switched on first; those that somebody else did are not.
    fn has_motors(&mut self, now: Timestamp, device: MavId, condition: Condition) -> bool {
        match self.retraction {
            Retraction::No => true,
            Retraction::Off => {
                self.retraction = Retraction::Returning { since: now };
                self.outputs.push_back(MountOutput::Command(packet::set_motors(device, true)));
                false
            }
            Retraction::Returning { since } if condition.motors_on && now > since => {
                self.retraction = Retraction::No;
                true
            }
            Retraction::Returning { since } if now.since(since) >= MOTORS_START => {
                self.retraction = Retraction::No;
                self.outputs.push_back(MountOutput::StaysRetracted);
                true
            }
            Retraction::Returning { .. } => false,
        }
    }

    fn is_in_mode(&mut self, now: Timestamp, device: MavId, wanted: YawMode) -> bool {
        match self.mode {
            Mode::Is(mode) if mode == wanted => return true,
            // One is outstanding; the newest order waits for it.
            Mode::Asked(_) => return false,
            Mode::Refused(mode, at) if mode == wanted && now.since(at) < REFUSED_FOR => return false,
            Mode::Is(_) | Mode::Refused(..) | Mode::Unknown => {}
        }
        self.mode = Mode::Asked(wanted);
        self.outputs.push_back(MountOutput::Command(mode_command(device, wanted)));
        false
    }

    fn give(&mut self, device: MavId) {
        if self.is_given {
            return;
        }
        let Some(command) = self.wanted.and_then(|wanted| wanted.given_once(device)) else { return };
        self.is_given = true;
        self.sent = None;
        match self.wanted {
            Some(Order::Retract) => self.retraction = Retraction::Off,
            Some(Order::RadioControl) => self.mode = Mode::Unknown,
            _ => {}
        }
        self.outputs.push_back(MountOutput::Command(command));
    }

    fn send_when_due(&mut self, now: Timestamp, device: MavId, condition: Condition) {
        let Some(wanted) = self.wanted else { return };
        let is_due = self.sent.is_none_or(|(at, sent)| at + self.interval(at, sent, wanted, condition) <= now);
        if !is_due {
            return;
        }
        self.say(now, device, wanted);
    }

    fn say(&mut self, now: Timestamp, device: MavId, order: Order) {
        let Some(command) = order.repeated(device) else { return };
        self.sent = Some((now, order));
        self.rotation.handle_sent(now, order.turns());
        if order.turns() {
            self.stopped = None;
        } else if order.is_stop() {
            self.stopped = Some(now);
        }
        if self.unanswered == 0 {
            self.unanswered_since = now;
        }
        self.unanswered = self.unanswered.saturating_add(1);
        self.outputs.push_back(MountOutput::Send(command));
    }

    /// How long after the order sent at `at` the one wanted is to follow.
    fn interval(&self, at: Timestamp, sent: Order, wanted: Order, condition: Condition) -> Duration {
        // Nothing keeps a stop.
        if wanted.is_stop() && sent.turns() {
            return Duration::ZERO;
        }
        if sent != wanted {
            return LEAST_INTERVAL;
        }
        let for_now = at.since(self.changed);
        let moves = match wanted {
            // Until it is known to be heard.
            _ if self.may_be_turning() => true,
            Order::Turn { .. } if wanted.is_stop() => for_now < MOVES_AT_LEAST,
            Order::Turn { .. } => true,
            _ => for_now < MOVES_AT_LEAST || (!condition.is_there && for_now < MOVES_AT_MOST),
        };
        if moves { REPEAT_MOVING } else { REPEAT_IDLE }
    }
}

fn mode_command(device: MavId, mode: YawMode) -> COMMAND_LONG_DATA {
    match mode {
        YawMode::Follow => packet::follow(device),
        YawMode::Lock => packet::lock(device),
    }
}

#[cfg(test)]
mod tests;
