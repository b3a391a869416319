//! Whether the vehicle flies.

/// `MAV_LANDED_STATE` where it is defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LandedState {
    OnGround,
    InAir,
    TakingOff,
    Landing,
}

impl LandedState {
    /// `MAV_LANDED_STATE`.
    pub(super) fn number(self) -> u8 {
        match self {
            Self::OnGround => 1,
            Self::InAir => 2,
            Self::TakingOff => 3,
            Self::Landing => 4,
        }
    }

    pub(super) fn from_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::OnGround),
            2 => Some(Self::InAir),
            3 => Some(Self::TakingOff),
            4 => Some(Self::Landing),
            _ => None,
        }
    }
}
