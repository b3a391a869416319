//! What is done only when its word is said: it can cost the camera or the flight.

use crate::gimbals::operation::{Motors, Operation, Restart};
use crate::manager::asked::Asked;

#[derive(Debug, PartialEq, Eq)]
pub struct Danger {
    /// The word.
    pub word: &'static str,
    /// What alone makes it dangerous; `None` where it always is.
    pub when: Option<&'static str>,
    /// What may come of it, to be read before the word is said.
    pub cost: &'static str,
}

/// "RETRACT in v2 cuts motors; on some firmware only a reboot re-enables" (gimbals 1.9, by ArduPilot's page on Gremsy).
pub(super) static MOTORS_OFF: Danger = Danger {
    word: "motors off",
    when: Some("for `off`"),
    cost: "the camera falls to where its weight takes it; to a Gremsy that speaks v2 it is RETRACT, and some firmware \
           switches the motors on again only after a restart",
};

/// The same where "retract" is allowed to do it; which gimbal that is the core knows, and asks for the word there.
pub(super) static RETRACT_CUTS_MOTORS: Danger = Danger {
    word: "motors off",
    when: Some("for a Gremsy with `retract_allowed`"),
    cost: "with retract_allowed a Gremsy's motors are switched off; the camera falls to where its weight takes it, and some \
           firmware switches the motors on again only after a restart",
};

pub(super) static REBOOT: Danger =
    Danger { word: "reboot", when: None, cost: "the camera is not held until the gimbal has started" };

pub(super) static SHUTDOWN: Danger = Danger {
    word: "shutdown",
    when: None,
    cost: "the camera is not held any more, and the gimbal must be switched on by hand",
};

/// What `asked` may cost whichever gimbal it is; `None` where it needs no word before it is known which.
pub fn danger_of(asked: &Asked) -> Option<&'static Danger> {
    match asked {
        Asked::Operation(Operation::Motors(Motors::Off)) => Some(&MOTORS_OFF),
        Asked::Operation(Operation::Restart(Restart::Reboot)) => Some(&REBOOT),
        Asked::Operation(Operation::Restart(Restart::Shutdown)) => Some(&SHUTDOWN),
        _ => None,
    }
}
