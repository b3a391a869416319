//! How fast the vehicle flies, and where.

use std::time::Duration;

use super::dated::Dated;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{GLOBAL_POSITION_INT_DATA, LOCAL_POSITION_NED_DATA};

/// "X Speed in NED … NaN if unknown": a velocity not told for so long is not known any more.
const VELOCITY_WITHIN: Duration = Duration::from_secs(1);

/// As one message told it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Velocity {
    /// Metres per second to North, East and Down; NaN where the message does not tell.
    pub ned: [f32; 3],
    /// See [`Orientation::late`](super::attitudes::Orientation::late).
    pub late: Option<Duration>,
}

/// The last velocity out of each message that carries one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Velocities {
    /// `LOCAL_POSITION_NED`, with all its digits.
    local: Option<Dated<Velocity>>,
    /// `GLOBAL_POSITION_INT`, in centimetres per second.
    global: Option<Dated<Velocity>>,
}

impl Velocities {
    pub fn handle_local(&mut self, now: Timestamp, message: &LOCAL_POSITION_NED_DATA, late: Option<Duration>) {
        let ned = [message.vx, message.vy, message.vz].map(|speed| if speed.is_finite() { speed } else { f32::NAN });
        if ned.iter().any(|speed| speed.is_finite()) {
            self.local = Some(Dated::new(now, Velocity { ned, late }));
        }
    }

    pub fn handle_global(&mut self, now: Timestamp, message: &GLOBAL_POSITION_INT_DATA, late: Option<Duration>) {
        let metres_per_second = |centimetres: i16| match centimetres {
            i16::MAX => f32::NAN,
            centimetres => f32::from(centimetres) / 100.0,
        };
        let ned = [message.vx, message.vy, message.vz].map(metres_per_second);
        self.global = Some(Dated::new(now, Velocity { ned, late }));
    }

    /// The best one that is fresh.
    pub fn velocity(&self, now: Timestamp) -> Option<Dated<Velocity>> {
        [self.local, self.global].into_iter().flatten().find(|told| told.age(now) <= VELOCITY_WITHIN)
    }
}
