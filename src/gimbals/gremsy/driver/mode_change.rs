//! Changing the mode of a Gremsy that speaks v2: its flags are said until its status shows them.

use std::time::Duration;

use crate::gimbals::gremsy::modes::{ControlMode, MAPPING};
use crate::gimbals::operation::{OperationError, OperationId, OperationResult};
use crate::timestamp::Timestamp;
use crate::wire::ids::GimbalFlags;

/// So often, "resend every 100 ms, up to 5 sends, success when the flag appears in 285.flags, else TIMEOUT" (gSDK).
const EVERY: Duration = Duration::from_millis(100);
const SENDS: u8 = 5;

/// A mode that is being asked for.
#[derive(Clone, Copy, Debug)]
pub struct ModeChange {
    mode: ControlMode,
    /// Who asked; nobody where a setpoint needs the motors.
    asker: Option<OperationId>,
    sends: u8,
    next: Timestamp,
}

/// What is next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    Send(ControlMode),
    Done(Option<OperationId>, OperationResult),
}

impl ModeChange {
    pub const fn new(now: Timestamp, mode: ControlMode, asker: Option<OperationId>) -> Self {
        Self { mode, asker, sends: 0, next: now }
    }

    pub const fn mode(&self) -> ControlMode {
        self.mode
    }

    pub const fn asker(&self) -> Option<OperationId> {
        self.asker
    }

    /// A status came.
    pub fn handle_flags(&self, flags: GimbalFlags) -> Option<Step> {
        (self.sends > 0 && shows(self.mode, flags)).then_some(Step::Done(self.asker, Ok(())))
    }

    pub fn handle_timeout(&mut self, now: Timestamp) -> Option<Step> {
        if now < self.next {
            return None;
        }
        if self.sends >= SENDS {
            return Some(Step::Done(self.asker, Err(OperationError::NoAnswer)));
        }
        self.sends += 1;
        self.next = now + EVERY;
        Some(Step::Send(self.mode))
    }

    pub const fn poll_timeout(&self) -> Timestamp {
        self.next
    }
}

fn shows(mode: ControlMode, flags: GimbalFlags) -> bool {
    match mode {
        ControlMode::Off => flags.contains(GimbalFlags::RETRACT),
        ControlMode::Lock => flags.contains(GimbalFlags::YAW_LOCK),
        ControlMode::Follow => !flags.intersects(GimbalFlags::YAW_LOCK | GimbalFlags::RETRACT | MAPPING),
        ControlMode::Mapping => flags.contains(MAPPING),
        ControlMode::Reset => flags.contains(GimbalFlags::NEUTRAL) && !flags.contains(GimbalFlags::RETRACT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: Option<OperationId> = Some(OperationId(3));

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    /// Gimbal statement 26: "v2 lock with a silent gimbal returns TIMEOUT after 5 sends within 0.5 ± 0.1 s; with a flag
    /// echo it returns SUCCESS."
    #[test]
    fn statement_26_five_sends_or_the_flag() {
        let mut change = ModeChange::new(at(0), ControlMode::Lock, ID);
        let mut steps = Vec::new();
        while steps.len() < 6 {
            let due = change.poll_timeout();
            steps.extend(change.handle_timeout(due).map(|step| (due.as_micros() / 1_000, step)));
        }
        let send = |millis| (millis, Step::Send(ControlMode::Lock));
        let timeout = (500, Step::Done(ID, Err(OperationError::NoAnswer)));
        assert_eq!(steps, [send(0), send(100), send(200), send(300), send(400), timeout]);

        let mut change = ModeChange::new(at(0), ControlMode::Lock, ID);
        assert_eq!(change.handle_flags(GimbalFlags::YAW_LOCK), None, "it was not asked yet");
        change.handle_timeout(at(0));
        assert_eq!(change.handle_flags(GimbalFlags::ROLL_LOCK), None);
        assert_eq!(change.handle_flags(GimbalFlags::YAW_LOCK), Some(Step::Done(ID, Ok(()))));
    }

    #[test]
    #[rustfmt::skip]
    fn each_mode_is_known_by_its_flag() {
        let level = GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK;
        for (mode,                 shown,                               other) in [
            (ControlMode::Off,     level | GimbalFlags::RETRACT,        level),
            (ControlMode::Reset,   level | GimbalFlags::NEUTRAL,        level | GimbalFlags::RETRACT),
            (ControlMode::Lock,    level | GimbalFlags::YAW_LOCK,       level),
            (ControlMode::Follow,  level,                               level | GimbalFlags::YAW_LOCK),
            (ControlMode::Mapping, level | MAPPING,                     level),
        ] {
            assert!(shows(mode, shown), "{mode:?}");
            assert!(!shows(mode, other), "{mode:?}");
        }
    }
}
