//! From the numbers of v1 mount commands to demands and places, and which of them cannot be meant as they were sent.
//!
//! Pitch and roll are held to the horizon. Yaw is from the nose unless its sender configured it as absolute.

use super::senders::{Habits, Input, Inputs};
use crate::geometry::{Angle, Attitude, EarthFrame};
use crate::manager::request::{AxisDemand, Command, Demand, DemandKind, Form, Refusal};
use crate::manager::roi::degrees_of_integer;
use crate::wire::ids::{CommandResult, GimbalFlags, mount_mode};

/// Degrees either way, as ArduPilot checks them.
const PITCH_RANGE: f64 = 90.0;
const ROLL_RANGE: f64 = 180.0;
const YAW_RANGE: f64 = 360.0;

/// Degrees; a number beyond that is in units of 1e-7 degrees.
const COORDINATE_RANGE: f64 = 360.0;

/// Degrees; beyond this a number in hundredths of a degree is the latitude or longitude of a place.
const PLACE_RATHER_THAN_ANGLE: f64 = 3_600.0;

/// A `MAV_MOUNT_MODE` that we carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Retract,
    Neutral,
    Angles,
    RadioControl,
    Place,
    Home,
}

impl Mode {
    /// The mode that `number` names, if it names one.
    pub fn read(number: Option<f32>) -> Result<Self, Refusal> {
        let number = number.filter(|number| number.fract() == 0.0 && (0.0..=255.0).contains(number));
        let Some(number) = number else { return Err(Refusal::denied("unknown_mount_mode")) };
        let reason = match number as u8 {
            mount_mode::RETRACT => return Ok(Self::Retract),
            mount_mode::NEUTRAL => return Ok(Self::Neutral),
            mount_mode::MAVLINK_TARGETING => return Ok(Self::Angles),
            mount_mode::RC_TARGETING => return Ok(Self::RadioControl),
            mount_mode::GPS_POINT => return Ok(Self::Place),
            mount_mode::HOME_LOCATION => return Ok(Self::Home),
            mount_mode::SYSID_TARGET => "mount_mode_sysid_target_unsupported",
            mount_mode::WPNEXT_OFFSET => "mount_mode_wpnext_offset_unsupported",
            _ => return Err(Refusal::denied("unknown_mount_mode")),
        };
        Err(Refusal { result: CommandResult::Unsupported, reason })
    }

    pub const fn number(self) -> u8 {
        match self {
            Self::Retract => mount_mode::RETRACT,
            Self::Neutral => mount_mode::NEUTRAL,
            Self::Angles => mount_mode::MAVLINK_TARGETING,
            Self::RadioControl => mount_mode::RC_TARGETING,
            Self::Place => mount_mode::GPS_POINT,
            Self::Home => mount_mode::HOME_LOCATION,
        }
    }
}

/// The last three parameters of 204, in the order roll, pitch, yaw; a `COMMAND_INT` has plain numbers there.
pub fn inputs(command: &Command) -> Inputs {
    let [roll, pitch] = match command.form {
        Form::Int { x, y, .. } => [x, y].map(|number| Some(number as f32)),
        Form::Long => [command.param(5), command.param(6)],
    };
    let input = |number: Option<f32>| match number {
        Some(1.0) => Input::Rate,
        Some(2.0) => Input::AbsoluteAngle,
        _ => Input::Angle,
    };
    Inputs { roll: input(roll), pitch: input(pitch), yaw: input(command.param(7)) }
}

/// Retract, neutral, or radio control.
pub fn pose(flags: GimbalFlags) -> Demand {
    Demand { flags: flags | held(Input::Angle), kind: DemandKind::Commanded, ..Demand::default() }
}

/// Pitch, roll and yaw in degrees or degrees per second, `None` on an axis without a demand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    pitch: Option<f64>,
    roll: Option<f64>,
    yaw: Option<f64>,
}

impl Numbers {
    /// The first three parameters of 205.
    pub fn of_command(command: &Command) -> Result<Self, Refusal> {
        let number = |number: usize| Ok(command.finite(number)?.map(f64::from));
        Ok(Self { pitch: number(1)?, roll: number(2)?, yaw: number(3)? })
    }

    /// `MOUNT_CONTROL`, hundredths of a degree.
    pub fn of_message([pitch, roll, yaw]: [i32; 3]) -> Self {
        let [pitch, roll, yaw] = [pitch, roll, yaw].map(|hundredths| Some(f64::from(hundredths) / 100.0));
        Self { pitch, roll, yaw }
    }

    /// The same if they were sent in hundredths.
    pub fn hundredths(self) -> Self {
        let Self { pitch, roll, yaw } = self;
        let [pitch, roll, yaw] = [pitch, roll, yaw].map(|number| number.map(|number| number / 100.0));
        Self { pitch, roll, yaw }
    }

    /// Whether an angle among them is one that no gimbal has.
    pub fn are_beyond_angles(self, inputs: Inputs) -> bool {
        let beyond = |number: Option<f64>, input: Input, range: f64| {
            input != Input::Rate && number.is_some_and(|degrees| degrees.abs() > range)
        };
        beyond(self.pitch, inputs.pitch, PITCH_RANGE)
            || beyond(self.roll, inputs.roll, ROLL_RANGE)
            || beyond(self.yaw, inputs.yaw, YAW_RANGE)
    }

    /// Whether they are the coordinates of a place, sent by somebody who did not say so.
    pub fn are_a_place(self) -> bool {
        let is_far = |number: Option<f64>| number.is_some_and(|degrees| degrees.abs() > PLACE_RATHER_THAN_ANGLE);
        is_far(self.pitch) && is_far(self.roll)
    }

    /// Whether the yaw, which counts from the nose, is more likely a course over ground: those go from 0 to 360.
    pub fn have_a_yaw_like_a_heading(self, inputs: Inputs) -> bool {
        inputs.yaw == Input::Angle && self.yaw.is_some_and(|degrees| degrees > 180.0)
    }

    pub fn demand(self, inputs: Inputs, kind: DemandKind) -> Result<Demand, Refusal> {
        let axis = |number: Option<f64>, input: Input| -> Result<AxisDemand, Refusal> {
            match (number, input) {
                (None, _) => Ok(AxisDemand::default()),
                (Some(rate), Input::Rate) => {
                    Ok(AxisDemand { rate: Command::checked_rate(rate)?, ..AxisDemand::default() })
                }
                (Some(degrees), Input::Angle | Input::AbsoluteAngle) => {
                    Ok(AxisDemand { angle: Some(Angle::from_degrees(degrees)), ..AxisDemand::default() })
                }
            }
        };
        let yaw = axis(self.yaw, inputs.yaw)?;
        Ok(Demand {
            flags: held(inputs.yaw),
            pitch: axis(self.pitch, inputs.pitch)?,
            roll: axis(self.roll, inputs.roll)?,
            yaw: AxisDemand { angle: yaw.angle.map(Angle::wrapped), ..yaw },
            kind,
        })
    }
}

/// The numbers of a 205 as degrees, and whether its sender is now known to send hundredths of them.
///
/// Who sent a number beyond all angles once means hundredths ever after: its small numbers look like degrees.
pub fn degrees(numbers: Numbers, habits: Habits, accepts_centidegrees: bool) -> Result<(Numbers, bool), Refusal> {
    let beyond = numbers.are_beyond_angles(habits.inputs);
    let in_hundredths = accepts_centidegrees && (beyond || habits.sends_centidegrees);
    let numbers = if in_hundredths { numbers.hundredths() } else { numbers };
    if numbers.are_beyond_angles(habits.inputs) {
        return Err(Refusal::denied("looks_like_centidegrees"));
    }
    Ok((numbers, in_hundredths))
}

/// `DO_MOUNT_CONTROL_QUAT`, w first: as 282 with roll and pitch held to the horizon and yaw from the nose.
pub fn quaternion(command: &Command) -> Result<Demand, Refusal> {
    let malformed = Refusal::denied("malformed_quaternion");
    let [w, x, y, z, ..] = command.params;
    let attitude: Attitude<EarthFrame> = Attitude::from_wxyz([w, x, y, z]).map_err(|_| malformed)?.ok_or(malformed)?;
    let angles = attitude.gimbal_angles();
    let axis = |angle: Angle| AxisDemand { angle: Some(angle), rate: None };
    Ok(Demand {
        flags: held(Input::Angle),
        roll: axis(angles.roll),
        pitch: axis(angles.pitch),
        yaw: axis(angles.yaw),
        kind: DemandKind::Commanded,
    })
}

fn held(yaw: Input) -> GimbalFlags {
    let yaw = match yaw {
        Input::Angle | Input::Rate => GimbalFlags::YAW_IN_VEHICLE_FRAME,
        Input::AbsoluteAngle => GimbalFlags::YAW_LOCK | GimbalFlags::YAW_IN_EARTH_FRAME,
    };
    GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | yaw
}

/// Latitude and longitude in degrees. In a `COMMAND_LONG` ArduPilot's clients send units of 1e-7 degrees and PX4's
/// degrees, always both alike.
pub fn coordinates(command: &Command) -> Result<[Option<f64>; 2], Refusal> {
    command.check_integers()?;
    let numbers = match command.form {
        Form::Int { x, y, .. } => [Some(x), Some(y)].map(degrees_of_integer),
        Form::Long => [command.finite(5)?, command.finite(6)?].map(|number| number.map(f64::from)),
    };
    let is_unset = |number: Option<f64>| number.is_none_or(|number| number == 0.0);
    let is_given = |number: usize| command.param(number).is_some_and(|number| number != 0.0);
    if numbers.into_iter().all(is_unset) && is_given(1) && is_given(2) {
        return Err(Refusal::denied("place_in_the_first_parameters"));
    }
    if matches!(command.form, Form::Int { .. }) {
        return Ok(numbers);
    }
    let scaled = numbers.iter().flatten().any(|number| number.abs() > COORDINATE_RANGE);
    Ok(numbers.map(|number| number.map(|number| if scaled { number / 1e7 } else { number })))
}
