//! Regions of interest: `DO_SET_ROI_LOCATION` (195), `DO_SET_ROI_NONE` (197), and
//! `DO_SET_ROI` (201), which came before them.
//!
//! The altitude of a place counts from mean sea level or from home. A `COMMAND_INT` says which by its frame; any frame
//! other than those is refused with result 9 rather than taken for one of them. A `COMMAND_LONG` does not say it, and
//! is read as the autopilot's family does. 0, 0, 0 is no place but the end of the region of interest.

use super::commands::{Outcome, unsupported};
use super::request::{Command, Form, Refusal};
use super::settings::AltitudeReference;
use super::{GimbalManager, Surroundings};
use crate::geometry::Position;
use crate::timestamp::Timestamp;
use crate::vehicle::Autopilot;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, mav_frame, mav_roi};

/// Metres either way of its datum; nothing that a vehicle could look at is further.
const FURTHEST_ALTITUDE: f64 = 100_000.0;

/// What the altitude of a place counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Datum {
    MeanSeaLevel,
    Home,
}

impl GimbalManager {
    pub(super) fn do_set_roi_location(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        match self.read_roi_location(now, command, around)? {
            Some(place) => self.look_at_place(now, sender, place, around),
            None => self.do_set_roi_none(now, sender),
        }
    }

    /// Whether [`do_set_roi_location`](Self::do_set_roi_location) can be done at this moment.
    pub(super) fn check_roi_location(
        &self,
        now: Timestamp,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let place = self.read_roi_location(now, command, around)?;
        let capabilities = self.steerable()?;
        match place {
            Some(_) => self.tracking.check_place(&self.situation(now, capabilities, around)),
            None => Ok(()),
        }
    }

    /// The place that a command names; `None` where it is the end of looking at one.
    fn read_roi_location(
        &self,
        now: Timestamp,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Option<Position>, Refusal> {
        let datum = match command.form {
            Form::Int { frame: mav_frame::GLOBAL | mav_frame::GLOBAL_INT, .. } => Datum::MeanSeaLevel,
            Form::Int { frame: mav_frame::GLOBAL_RELATIVE_ALT | mav_frame::GLOBAL_RELATIVE_ALT_INT, .. } => Datum::Home,
            Form::Int { .. } => {
                return Err(Refusal { result: CommandResult::UnsupportedMavFrame, reason: "unsupported_frame" });
            }
            Form::Long => match self.rules.roi_altitude {
                AltitudeReference::Amsl => Datum::MeanSeaLevel,
                AltitudeReference::Relative => Datum::Home,
                AltitudeReference::Auto if around.vehicle.autopilot() == Some(Autopilot::ArduPilot) => Datum::Home,
                AltitudeReference::Auto => Datum::MeanSeaLevel,
            },
        };
        let coordinates = match command.form {
            Form::Int { x, y, .. } => [Some(x), Some(y)].map(degrees_of_integer),
            Form::Long => [command.finite(5)?, command.finite(6)?].map(|degrees| degrees.map(f64::from)),
        };
        command.check_integers()?;
        place(now, coordinates, command.finite(7)?, datum, around)
    }

    pub(super) fn do_set_roi_none(&mut self, now: Timestamp, sender: MavId) -> Result<(), Refusal> {
        let capabilities = *self.steerable()?;
        self.tracking.end_roi(now, sender, &capabilities);
        Ok(())
    }

    /// `DO_SET_ROI`, whose first parameter is a `MAV_ROI`. What we do not look at is refused to who addressed exactly us.
    pub(super) fn do_set_roi(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<Outcome, Refusal> {
        match command.param(1) {
            Some(kind) if kind == f32::from(mav_roi::NONE) => self.do_set_roi_none(now, sender)?,
            Some(kind) if kind == f32::from(mav_roi::LOCATION) => {
                self.do_set_roi_location(now, sender, command, around)?;
            }
            _ if command.is_directed() && !around.overheard => return Err(unsupported(command.number)),
            _ => return Ok(Outcome::Ignored),
        }
        Ok(Outcome::Accepted)
    }

    /// Looks at latitude and longitude in degrees and an altitude in metres, or at nothing.
    pub(super) fn look_at(
        &mut self,
        now: Timestamp,
        sender: MavId,
        coordinates: [Option<f64>; 2],
        altitude: Option<f32>,
        datum: Datum,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        match place(now, coordinates, altitude, datum, around)? {
            Some(place) => self.look_at_place(now, sender, place, around),
            None => self.do_set_roi_none(now, sender),
        }
    }

    pub(super) fn look_at_place(
        &mut self,
        now: Timestamp,
        sender: MavId,
        place: Position,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let capabilities = *self.steerable()?;
        let situation = self.situation(now, &capabilities, around);
        self.tracking.point_at(now, sender, place, &situation)?;
        self.note_demand(now, sender);
        Ok(())
    }
}

/// The place at these degrees and metres; `None` where they name none, but the end of looking at one.
fn place(
    now: Timestamp,
    coordinates: [Option<f64>; 2],
    altitude: Option<f32>,
    datum: Datum,
    around: Surroundings<'_>,
) -> Result<Option<Position>, Refusal> {
    match (coordinates, altitude.map(f64::from)) {
        ([Some(0.0), Some(0.0)], Some(0.0)) => Ok(None),
        ([Some(latitude_deg), Some(longitude_deg)], Some(altitude)) => {
            position(now, [latitude_deg, longitude_deg], altitude, datum, around).map(Some)
        }
        _ => Err(Refusal::denied("no_such_place")),
    }
}

/// The place at these degrees, so many metres above `datum`.
pub(super) fn position(
    now: Timestamp,
    [latitude_deg, longitude_deg]: [f64; 2],
    altitude: f64,
    datum: Datum,
    around: Surroundings<'_>,
) -> Result<Position, Refusal> {
    if latitude_deg.abs() > 90.0 || longitude_deg.abs() > 180.0 || altitude.abs() > FURTHEST_ALTITUDE {
        return Err(Refusal::denied("no_such_place"));
    }
    let datum_amsl = match datum {
        Datum::MeanSeaLevel => 0.0,
        Datum::Home => around.vehicle.home_altitude_amsl(now).ok_or(Refusal::later("no_home_altitude"))?,
    };
    Ok(Position { latitude_deg, longitude_deg, altitude_m: altitude + datum_amsl })
}

/// A coordinate in units of 1e-7 degrees; the largest number is none.
pub(super) fn degrees_of_integer(coordinate: Option<i32>) -> Option<f64> {
    coordinate.filter(|coordinate| *coordinate != i32::MAX).map(|coordinate| f64::from(coordinate) / 1e7)
}
