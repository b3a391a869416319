//! The mount commands of gimbal protocol v1: `DO_MOUNT_CONFIGURE` (204) and `DO_MOUNT_CONTROL` (205).
//!
//! Old clients send them to the autopilot, to us or to everybody; they pass the same gate as `DO_GIMBAL_MANAGER_PITCHYAW`
//! (D5). Pitch and roll are held to the horizon. Yaw is from the nose unless its sender configured it as absolute.
//! Angles no gimbal has are refused, since the likeliest reason is a sender of the old centidegrees.

use super::request::{AxisDemand, Command, Demand, DemandKind, Form, Refusal};
use super::roi::{Datum, degrees_of_integer};
use super::{GimbalManager, Surroundings};
use crate::geometry::Angle;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{CommandResult, GimbalFlags, mount_mode};

/// So many senders can have configured their inputs; the one who did so first is forgotten first.
const MAX_CONFIGURED_SENDERS: usize = 16;

/// Degrees either way, as ArduPilot checks them.
const PITCH_RANGE: f64 = 90.0;
const ROLL_RANGE: f64 = 180.0;
const YAW_RANGE: f64 = 360.0;

/// Degrees; a number beyond that is in units of 1e-7 degrees.
const COORDINATE_RANGE: f64 = 360.0;

/// A `MAV_MOUNT_MODE` that we carry out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Retract,
    Neutral,
    Angles,
    Place,
}

/// What the number of an axis means ("0 = angle body frame, 1 = angular rate, 2 = angle absolute frame").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Input {
    #[default]
    Angle,
    Rate,
    AbsoluteAngle,
}

/// The inputs of the three axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Inputs {
    roll: Input,
    pitch: Input,
    yaw: Input,
}

/// What each sender of 204 means by its numbers in 205; those who never sent it mean angles.
#[derive(Debug, Default)]
pub(super) struct ConfiguredInputs {
    by_sender: Vec<(MavId, Inputs)>,
}

impl ConfiguredInputs {
    fn set(&mut self, sender: MavId, inputs: Inputs) {
        self.by_sender.retain(|(known, _)| *known != sender);
        if self.by_sender.len() == MAX_CONFIGURED_SENDERS {
            self.by_sender.remove(0);
        }
        self.by_sender.push((sender, inputs));
    }

    fn of(&self, sender: MavId) -> Inputs {
        self.by_sender.iter().find(|(known, _)| *known == sender).map_or_else(Inputs::default, |(_, inputs)| *inputs)
    }
}

impl GimbalManager {
    pub(super) fn do_mount_configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        match mode(command.param(1))? {
            Mode::Retract => self.handle_demand(now, sender, &pose(GimbalFlags::RETRACT), around),
            Mode::Neutral => self.handle_demand(now, sender, &pose(GimbalFlags::NEUTRAL), around),
            Mode::Angles => {
                self.configured_inputs.set(sender, inputs(command));
                Ok(())
            }
            // The place comes with 205.
            Mode::Place if around.vehicle.position(now).is_some() => Ok(()),
            Mode::Place => Err(Refusal::later("no_vehicle_position")),
        }
    }

    pub(super) fn do_mount_control(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        match mode(command.param(7))? {
            Mode::Retract => self.handle_demand(now, sender, &pose(GimbalFlags::RETRACT), around),
            Mode::Neutral => self.handle_demand(now, sender, &pose(GimbalFlags::NEUTRAL), around),
            Mode::Angles => {
                let demand = angles(command, self.configured_inputs.of(sender))?;
                self.handle_demand(now, sender, &demand, around)
            }
            Mode::Place => {
                self.gate(now, sender, around)?.needs_whole()?;
                command.check_integers()?;
                self.look_at(now, sender, coordinates(command)?, command.finite(4)?, Datum::Home, around)
            }
        }
    }
}

fn mode(number: Option<f32>) -> Result<Mode, Refusal> {
    let number = number.filter(|number| number.fract() == 0.0 && (0.0..=255.0).contains(number));
    let Some(number) = number else { return Err(Refusal::denied("unknown_mount_mode")) };
    let reason = match number as u8 {
        mount_mode::RETRACT => return Ok(Mode::Retract),
        mount_mode::NEUTRAL => return Ok(Mode::Neutral),
        mount_mode::MAVLINK_TARGETING => return Ok(Mode::Angles),
        mount_mode::GPS_POINT => return Ok(Mode::Place),
        mount_mode::RC_TARGETING => "mount_mode_rc_targeting_unsupported",
        mount_mode::SYSID_TARGET => "mount_mode_sysid_target_unsupported",
        mount_mode::HOME_LOCATION => "mount_mode_home_location_unsupported",
        mount_mode::WPNEXT_OFFSET => "mount_mode_wpnext_offset_unsupported",
        _ => return Err(Refusal::denied("unknown_mount_mode")),
    };
    Err(Refusal { result: CommandResult::Unsupported, reason })
}

/// The last three parameters of 204, in the order roll, pitch, yaw; a `COMMAND_INT` has plain numbers there.
fn inputs(command: &Command) -> Inputs {
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

/// Retract or neutral.
fn pose(flags: GimbalFlags) -> Demand {
    Demand { flags: flags | held(Input::Angle), kind: DemandKind::Commanded, ..Demand::default() }
}

/// The first three parameters of 205, in the order pitch, roll, yaw: degrees, or degrees per second.
fn angles(command: &Command, inputs: Inputs) -> Result<Demand, Refusal> {
    let axis = |number: usize, input: Input, range: f64| -> Result<AxisDemand, Refusal> {
        if input == Input::Rate {
            return Ok(AxisDemand { rate: command.degrees_per_second(number)?, ..AxisDemand::default() });
        }
        let degrees = command.finite(number)?.map(f64::from);
        if degrees.is_some_and(|degrees| degrees.abs() > range) {
            return Err(Refusal::denied("looks_like_centidegrees"));
        }
        Ok(AxisDemand { angle: degrees.map(Angle::from_degrees), ..AxisDemand::default() })
    };
    let yaw = axis(3, inputs.yaw, YAW_RANGE)?;
    Ok(Demand {
        flags: held(inputs.yaw),
        pitch: axis(1, inputs.pitch, PITCH_RANGE)?,
        roll: axis(2, inputs.roll, ROLL_RANGE)?,
        yaw: AxisDemand { angle: yaw.angle.map(Angle::wrapped), ..yaw },
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
fn coordinates(command: &Command) -> Result<[Option<f64>; 2], Refusal> {
    let numbers = match command.form {
        Form::Int { x, y, .. } => return Ok([Some(x), Some(y)].map(degrees_of_integer)),
        Form::Long => [command.finite(5)?, command.finite(6)?].map(|number| number.map(f64::from)),
    };
    let scaled = numbers.iter().flatten().any(|number| number.abs() > COORDINATE_RANGE);
    Ok(numbers.map(|number| number.map(|number| if scaled { number / 1e7 } else { number })))
}
