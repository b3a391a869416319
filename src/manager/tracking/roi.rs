//! Looking at a place while the vehicle moves.

use super::motion::{Axis, Point};
use crate::geometry::{Angle, Position, YawFrame};
use crate::gimbals::setpoint::{RadioControl, Stabilised};

/// A place, and how it was last seen from the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Roi {
    pub(super) place: Position,
    /// Above the horizon.
    elevation: Option<Angle>,
    /// From North.
    azimuth: Option<Angle>,
}

impl Roi {
    pub(super) const fn new(place: Position) -> Self {
        Self { place, elevation: None, azimuth: None }
    }

    /// Looks from where the vehicle is.
    ///
    /// Straight above or below the place the azimuth stays as it was, and at the place itself the elevation too. Without
    /// a position nothing changes: the last direction is the best guess.
    pub(super) fn look_from(&mut self, position: Option<Position>) {
        let Some(aim) = position.and_then(|position| position.aim_at(self.place)) else { return };
        self.elevation = Some(aim.elevation);
        self.azimuth = aim.azimuth.or(self.azimuth);
    }

    /// The direction as angles; `yaw_now`, from North, is kept where any azimuth is right. `None` where none is known.
    pub(super) fn direction(&self, yaw_now: impl FnOnce() -> Option<Angle>) -> Option<Point> {
        let azimuth = self.azimuth.or_else(yaw_now)?;
        Some(Point {
            roll: Axis::still(Angle::ZERO),
            pitch: Axis::still(self.elevation?),
            yaw: Axis::still(azimuth),
            frame: YawFrame::Earth,
            stabilised: Stabilised::BOTH,
            radio_control: RadioControl::Off,
        })
    }
}
