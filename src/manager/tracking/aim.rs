//! What a gimbal is to do at present, of whatever kind.

use super::motion::{Motion, Point, Turn};
use super::roi::Roi;
use super::situation::{Pose, Situation};
use crate::geometry::{Angle, Position, YawFrame};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::setpoint::Stabilised;
use crate::timestamp::Timestamp;
use crate::wire::ids::CapFlags;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Aim {
    Idle,
    Retract,
    Neutral,
    Turn(Turn),
    Point(Point),
    Roi(Roi),
}

impl Aim {
    /// Neutral where the gimbal knows such, straight ahead otherwise.
    pub(super) fn neutral(capabilities: &Capabilities) -> Self {
        if capabilities.flags.contains(CapFlags::HAS_NEUTRAL) {
            return Self::Neutral;
        }
        let ahead = Pose { roll: Angle::ZERO, pitch: Angle::ZERO, yaw: Angle::ZERO };
        Self::Point(Point::still(ahead, YawFrame::Vehicle, Stabilised::BOTH))
    }

    /// Stops every rotation, keeping the angles; true when there was one.
    pub(super) fn stop_rates(&mut self, now: Timestamp) -> bool {
        match self {
            Self::Turn(turn) if !turn.turning.is_zero() => {
                turn.stop(now);
                true
            }
            Self::Point(point) => {
                let mut stopped = false;
                for axis in [&mut point.roll, &mut point.pitch, &mut point.yaw] {
                    if let Motion::Turning { rate, .. } = axis.motion {
                        axis.motion = Motion::Stopping { rate };
                        stopped = true;
                    }
                }
                stopped
            }
            _ => false,
        }
    }

    /// Whether the gimbal is told to turn on and on.
    pub(super) fn is_rotating(&self) -> bool {
        match self {
            Self::Turn(turn) => !turn.turning.is_zero(),
            Self::Point(point) => {
                [point.roll, point.pitch, point.yaw].iter().any(|axis| matches!(axis.motion, Motion::Turning { .. }))
            }
            Self::Idle | Self::Retract | Self::Neutral | Self::Roi(_) => false,
        }
    }

    /// Whether its setpoint turns with the vehicle.
    pub(super) fn follows_vehicle(&self, situation: &Situation<'_>) -> bool {
        match self {
            Self::Roi(_) => situation.device_frame(YawFrame::Earth) != YawFrame::Earth,
            Self::Point(point) => situation.device_frame(point.frame) != point.frame,
            Self::Idle | Self::Retract | Self::Neutral | Self::Turn(_) => false,
        }
    }

    /// Whether yaw is held to North.
    pub(super) fn is_locked(&self) -> bool {
        match self {
            Self::Idle | Self::Retract | Self::Neutral => false,
            Self::Turn(turn) => turn.turning.yaw_frame == YawFrame::Earth,
            Self::Point(point) => point.frame == YawFrame::Earth,
            Self::Roi(_) => true,
        }
    }

    pub(super) fn place(&self) -> Option<Position> {
        match self {
            Self::Roi(roi) => Some(roi.place),
            _ => None,
        }
    }

    /// A word for people; `None` while nothing was demanded.
    pub(super) fn name(&self) -> Option<&'static str> {
        match self {
            Self::Idle => None,
            Self::Retract => Some("retract"),
            Self::Neutral => Some("neutral"),
            Self::Turn(turn) if turn.turning.is_zero() => Some("hold"),
            Self::Turn(_) => Some("rate"),
            Self::Point(_) => Some("angle"),
            Self::Roi(_) => Some("roi"),
        }
    }
}
