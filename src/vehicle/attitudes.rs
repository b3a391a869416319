//! The attitudes that an autopilot tells, and which of them is believed.

use std::time::Duration;

use super::ATTITUDE_WITHIN;
use super::dated::Dated;
use crate::geometry::{AngularVelocity, Attitude, EarthFrame};
use crate::timestamp::Timestamp;

/// How the airframe lies and turns, as one message told it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Orientation {
    pub attitude: Attitude<EarthFrame>,
    /// `None` where the message tells no rates.
    pub turn: Option<AngularVelocity<EarthFrame>>,
    /// How much longer it took to get here than the autopilot's fastest message, where its time stamp tells.
    pub late: Option<Duration>,
}

/// The last attitude out of each message that carries one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Attitudes {
    /// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`
    pub for_gimbals: Option<Dated<Attitude<EarthFrame>>>,
    /// `ATTITUDE_QUATERNION`
    pub from_quaternion: Option<Dated<Orientation>>,
    /// It is that of an axis system other than the airframe's (`repr_offset_q`), which `ATTITUDE` knows nothing of.
    pub is_reoriented: bool,
    /// `ATTITUDE`
    pub from_angles: Option<Dated<Orientation>>,
}

/// The quaternion has so long the better claim. It has more digits, but both come from one estimate, and of that the
/// newest is the best.
const PREFERENCE: Duration = Duration::from_millis(50);

impl Attitudes {
    /// The first fresh one in order of trust; when none is fresh, the youngest.
    pub fn best(&self, now: Timestamp) -> Option<Dated<Attitude<EarthFrame>>> {
        let bare = |told: Dated<Orientation>| Dated::new(told.at, told.value.attitude);
        let sources = [self.for_gimbals, self.from_quaternion.map(bare), self.from_angles.map(bare)];
        let by_trust = || sources.into_iter().flatten();
        by_trust()
            .find(|attitude| attitude.age(now) <= ATTITUDE_WITHIN)
            .or_else(|| by_trust().min_by_key(|attitude| attitude.age(now)))
    }

    /// The one that what is told to gimbals is made of, when the autopilot does not tell them itself.
    pub fn orientation(&self, now: Timestamp) -> Option<Dated<Orientation>> {
        let fresh = |told: Option<Dated<Orientation>>| told.filter(|told| told.age(now) <= ATTITUDE_WITHIN);
        let (quaternion, angles) = (fresh(self.from_quaternion), fresh(self.from_angles));
        match (quaternion, angles) {
            (Some(quaternion), Some(angles))
                if !self.is_reoriented && quaternion.age(now) > PREFERENCE && angles.at > quaternion.at =>
            {
                Some(angles)
            }
            _ => quaternion.or(angles),
        }
    }
}
