//! What the senders of v1 mount commands mean by their numbers, as each of them has configured it.

use crate::wire::MavId;
use crate::wire::ids::mount_mode;

/// So many senders can have configured something; the one who did so first is forgotten first.
const MAX_SENDERS: usize = 16;

/// What the number of an axis means ("0 = angle body frame, 1 = angular rate, 2 = angle absolute frame").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Input {
    #[default]
    Angle,
    Rate,
    AbsoluteAngle,
}

/// The inputs of the three axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    pub roll: Input,
    pub pitch: Input,
    pub yaw: Input,
}

/// What one sender means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Habits {
    pub inputs: Inputs,
    /// `MAV_MOUNT_MODE` of its `MOUNT_CONTROL` messages, which do not name one.
    pub mode: u8,
    /// It was found out to send hundredths of a degree, and may be meant by a number that could be degrees.
    pub sends_centidegrees: bool,
}

impl Default for Habits {
    fn default() -> Self {
        Self { inputs: Inputs::default(), mode: mount_mode::MAVLINK_TARGETING, sends_centidegrees: false }
    }
}

/// The habits of all senders; of those who have configured nothing, the usual ones.
#[derive(Debug, Default)]
pub struct MountSenders {
    by_sender: Vec<(MavId, Habits)>,
}

impl MountSenders {
    pub fn of(&self, sender: MavId) -> Habits {
        self.by_sender.iter().find(|(known, _)| *known == sender).map_or_else(Habits::default, |(_, habits)| *habits)
    }

    pub fn change(&mut self, sender: MavId, change: impl FnOnce(&mut Habits)) {
        let mut habits = self.of(sender);
        change(&mut habits);
        self.by_sender.retain(|(known, _)| *known != sender);
        if self.by_sender.len() == MAX_SENDERS {
            self.by_sender.remove(0);
        }
        self.by_sender.push((sender, habits));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However many configure something, so many are remembered.
    #[test]
    fn the_first_of_too_many_senders_is_forgotten() {
        let mut senders = MountSenders::default();
        for component in 1..=17 {
            senders.change(MavId::new(1, component), |habits| habits.inputs.yaw = Input::Rate);
        }

        assert_eq!(senders.of(MavId::new(1, 1)), Habits::default());
        assert_eq!(senders.of(MavId::new(1, 2)).inputs.yaw, Input::Rate);
        assert_eq!(senders.by_sender.len(), MAX_SENDERS);
    }
}
