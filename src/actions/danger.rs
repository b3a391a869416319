//! What is done only when its word is said: it can cost the camera or the flight.

use crate::gimbals::operation::{Motors, Operation, Restart};
use crate::manager::asked::Asked;

#[derive(Debug, PartialEq, Eq)]
pub struct Danger {
    /// The word.
    pub word: &'static str,
    /// What may come of it, to be read before the word is said.
    pub cost: &'static str,
}

/// "RETRACT in v2 cuts motors; on some firmware only a reboot re-enables" (gimbals 1.9, by ArduPilot's page on Gremsy).
pub(super) static MOTORS_OFF: Danger = Danger {
    word: "motors off",
    cost: "the camera falls to where its weight takes it; to a Gremsy that speaks v2 it is RETRACT, and some firmware \
           switches the motors on again only after a restart",
};

pub(super) static REBOOT: Danger =
    Danger { word: "reboot", cost: "the camera is not held until the gimbal has started" };

pub(super) static SHUTDOWN: Danger =
    Danger { word: "shutdown", cost: "the camera is not held any more, and the gimbal must be switched on by hand" };

/// What `asked` may cost; `None` where it needs no word.
pub fn danger_of(asked: &Asked) -> Option<&'static Danger> {
    match asked {
        Asked::Operation(Operation::Motors(Motors::Off)) => Some(&MOTORS_OFF),
        Asked::Operation(Operation::Restart(Restart::Reboot)) => Some(&REBOOT),
        Asked::Operation(Operation::Restart(Restart::Shutdown)) => Some(&SHUTDOWN),
        _ => None,
    }
}
