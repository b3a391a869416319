//! The attitudes that an autopilot tells, and which of them is believed.

use super::ATTITUDE_WITHIN;
use super::dated::Dated;
use crate::geometry::{Attitude, EarthFrame};
use crate::timestamp::Timestamp;

/// The last attitude out of each message that carries one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Attitudes {
    /// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`
    pub for_gimbals: Option<Dated<Attitude<EarthFrame>>>,
    /// `ATTITUDE_QUATERNION`
    pub from_quaternion: Option<Dated<Attitude<EarthFrame>>>,
    /// `ATTITUDE`
    pub from_angles: Option<Dated<Attitude<EarthFrame>>>,
}

impl Attitudes {
    /// The first fresh one in order of trust; when none is fresh, the youngest.
    pub fn best(&self, now: Timestamp) -> Option<Dated<Attitude<EarthFrame>>> {
        let by_trust = || [self.for_gimbals, self.from_quaternion, self.from_angles].into_iter().flatten();
        by_trust()
            .find(|attitude| attitude.age(now) <= ATTITUDE_WITHIN)
            .or_else(|| by_trust().min_by_key(|attitude| attitude.age(now)))
    }
}
