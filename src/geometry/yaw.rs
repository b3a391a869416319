//! Yaw, which means nothing without what it is measured from.

use super::angle::Angle;

/// A yaw angle together with what it is measured from.
///
/// `InVehicleFrame` turns with the vehicle, `InEarthFrame` is measured from North.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Yaw {
    InVehicleFrame(Angle),
    InEarthFrame(Angle),
}

/// What a yaw angle or rate is measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YawFrame {
    /// The vehicle's heading.
    Vehicle,
    /// North.
    Earth,
}

impl Yaw {
    pub const fn new(frame: YawFrame, angle: Angle) -> Self {
        match frame {
            YawFrame::Vehicle => Self::InVehicleFrame(angle),
            YawFrame::Earth => Self::InEarthFrame(angle),
        }
    }

    pub const fn frame(self) -> YawFrame {
        match self {
            Self::InVehicleFrame(_) => YawFrame::Vehicle,
            Self::InEarthFrame(_) => YawFrame::Earth,
        }
    }

    /// The number, in its own frame.
    pub const fn angle(self) -> Angle {
        match self {
            Self::InVehicleFrame(angle) | Self::InEarthFrame(angle) => angle,
        }
    }

    /// The same direction in another frame; `None` when that takes a heading and there is none.
    pub fn in_frame(self, frame: YawFrame, heading: Option<Angle>) -> Option<Self> {
        if self.frame() == frame {
            return Some(self);
        }
        let heading = heading?;
        Some(match frame {
            YawFrame::Vehicle => Self::InVehicleFrame(self.in_vehicle_frame(heading)),
            YawFrame::Earth => Self::InEarthFrame(self.in_earth_frame(heading)),
        })
    }

    /// From North, within (−180°, 180°], when the vehicle has this heading.
    pub fn in_earth_frame(self, heading: Angle) -> Angle {
        match self {
            Self::InVehicleFrame(yaw) => (yaw + heading).wrapped(),
            Self::InEarthFrame(yaw) => yaw.wrapped(),
        }
    }

    /// From the vehicle's nose, within (−180°, 180°], when the vehicle has this heading.
    pub fn in_vehicle_frame(self, heading: Angle) -> Angle {
        match self {
            Self::InVehicleFrame(yaw) => yaw.wrapped(),
            Self::InEarthFrame(yaw) => (yaw - heading).wrapped(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Protocol checklist 103 and 104: with a heading of 100°, vehicle yaw 30° and earth yaw 130° are one direction.
    #[test]
    #[rustfmt::skip]
    fn yaw_is_told_in_either_frame() {
        let heading = Angle::from_degrees(100.0);
        for (yaw,                                              vehicle, earth) in [
            (Yaw::InVehicleFrame(Angle::from_degrees(30.0)),      30.0, 130.0),
            (Yaw::InEarthFrame(Angle::from_degrees(130.0)),       30.0, 130.0),
            (Yaw::InVehicleFrame(Angle::from_degrees(100.0)),    100.0, -160.0),
            (Yaw::InEarthFrame(Angle::from_degrees(-100.0)),     160.0, -100.0),
            (Yaw::InVehicleFrame(Angle::from_degrees(270.0)),    -90.0, 10.0),
            (Yaw::InEarthFrame(Angle::from_degrees(-280.0)),     -20.0, 80.0),
        ] {
            assert!((yaw.in_vehicle_frame(heading).degrees() - vehicle).abs() < 1e-9, "{yaw:?}");
            assert!((yaw.in_earth_frame(heading).degrees() - earth).abs() < 1e-9, "{yaw:?}");
        }
    }
}
