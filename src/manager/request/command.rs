//! A command as it was sent, and the reading of its parameters.

use super::Refusal;
use super::demand::{AxisDemand, Demand, DemandKind, LARGEST_RATE, PITCH_RANGE, YAW_RANGE, within};
use crate::geometry::{Angle, AngularRate};
use crate::wire::dialect::{COMMAND_INT_DATA, COMMAND_LONG_DATA};
use crate::wire::ids::{GimbalFlags, command};
use crate::wire::{Frame, Target};

/// What the bits of a NaN become in `x` and `y` where a sender casts them through the wrong type; PX4 refuses it too.
const NAN_AS_INTEGER: i32 = 0x7ff8_0000;

/// `COMMAND_LONG` or `COMMAND_INT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    pub number: u16,
    pub target: Target,
    /// Parameters 1 to 7 as sent; 5 and 6 of a `COMMAND_INT` are in `x` and `y`.
    pub params: [f32; 7],
    pub form: Form,
    /// How often it was sent before (`confirmation`); `COMMAND_INT` does not count, and has 0.
    pub confirmation: u8,
}

/// How the location parameters were sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Long,
    Int { frame: u8, x: i32, y: i32 },
}

impl Command {
    pub(super) fn long(frame: &Frame<'_>, message: &COMMAND_LONG_DATA) -> Self {
        Self {
            number: message.command,
            target: frame.target(),
            params: [
                message.param1,
                message.param2,
                message.param3,
                message.param4,
                message.param5,
                message.param6,
                message.param7,
            ],
            form: Form::Long,
            confirmation: message.confirmation,
        }
    }

    pub(super) fn int(frame: &Frame<'_>, message: &COMMAND_INT_DATA) -> Self {
        Self {
            number: message.command,
            target: frame.target(),
            params: [message.param1, message.param2, message.param3, message.param4, f32::NAN, f32::NAN, message.z],
            form: Form::Int { frame: message.frame, x: message.x, y: message.y },
            confirmation: 0,
        }
    }

    /// Parameter `number`, 1 to 7, `None` when it is NaN.
    pub fn param(&self, number: usize) -> Option<f32> {
        Some(self.params[number - 1]).filter(|value| !value.is_nan())
    }

    /// Whether the command names exactly one component.
    pub fn is_directed(&self) -> bool {
        matches!(self.target, Target::Component(_))
    }

    /// A parameter that is a message id; `None` where it can be none.
    pub fn message_id(&self, number: usize) -> Option<u32> {
        let id = self.param(number)?;
        (id.fract() == 0.0 && (0.0..16_777_216.0).contains(&id)).then_some(id as u32)
    }

    /// A parameter that is a device id: NaN and 0 mean every gimbal of the component.
    pub fn gimbal(&self, number: usize) -> Result<u8, Refusal> {
        match self.param(number) {
            None => Ok(0),
            Some(id) if (0.0..=255.0).contains(&id) && id.fract() == 0.0 => Ok(id as u8),
            Some(_) => Err(Refusal::denied("unknown_gimbal")),
        }
    }

    /// Whether it is `earlier` again, sent anew because its answer did not come.
    pub fn is_repeat_of(&self, earlier: &Self) -> bool {
        self.confirmation > earlier.confirmation && self.says_what(earlier)
    }

    /// Whether it is `earlier` again, and meant again: not the first of its kind, and not for want of an answer. Of a
    /// `COMMAND_INT`, which counts no confirmations, nobody can tell.
    pub fn is_meant_again_after(&self, earlier: &Self) -> bool {
        self.form == Form::Long && self.confirmation == 0 && self.says_what(earlier)
    }

    /// Whether both name the same place in the same way.
    pub fn names_the_place_of(&self, other: &Self) -> bool {
        let place = |command: &Self| [command.params[4], command.params[5], command.params[6]].map(f32::to_bits);
        (self.number, self.form) == (other.number, other.form) && place(self) == place(other)
    }

    fn says_what(&self, other: &Self) -> bool {
        let bits = |command: &Self| command.params.map(f32::to_bits);
        (self.number, self.target, self.form) == (other.number, other.target, other.form) && bits(self) == bits(other)
    }

    /// Refuses `x` and `y` that are no numbers.
    pub fn check_integers(&self) -> Result<(), Refusal> {
        match self.form {
            Form::Int { x: NAN_AS_INTEGER, y: NAN_AS_INTEGER, .. } => Err(Refusal::denied("nan_as_integer")),
            Form::Int { .. } | Form::Long => Ok(()),
        }
    }

    /// `GIMBAL_MANAGER_FLAGS` in parameter 5, which a `COMMAND_INT` carries unscaled in `x`. What stands above the 16
    /// bits that the definitions share with devices is ignored.
    fn flags(&self) -> Result<GimbalFlags, Refusal> {
        self.check_integers()?;
        let bits = match self.form {
            Form::Int { x: i32::MAX, .. } => 0,
            Form::Int { x, .. } => u32::try_from(x).map_err(|_| Refusal::denied("malformed_flags"))?,
            Form::Long => match self.param(5) {
                None => 0,
                Some(flags) if (0.0..=4_294_967_040.0).contains(&flags) && flags.fract() == 0.0 => flags as u32,
                Some(_) => return Err(Refusal::denied("malformed_flags")),
            },
        };
        Ok(GimbalFlags::from_bits_retain(bits as u16))
    }

    /// `DO_GIMBAL_MANAGER_PITCHYAW` (1000), in degrees.
    pub fn pitchyaw(&self) -> Result<Demand, Refusal> {
        debug_assert_eq!(self.number, command::DO_GIMBAL_MANAGER_PITCHYAW);
        let degrees = |number| Ok(self.finite(number)?.map(f64::from));
        let (pitch, yaw) = (degrees(1)?, degrees(2)?);
        let pitch = within(pitch, PITCH_RANGE, "angle_out_of_range")?;
        let yaw = within(yaw, YAW_RANGE, "angle_out_of_range")?;
        let (pitch_rate, yaw_rate) = (self.degrees_per_second(3)?, self.degrees_per_second(4)?);
        let demand = Demand {
            flags: self.flags()?,
            roll: AxisDemand::default(),
            // Straight back over the head is not straight back under the feet, so only yaw goes round.
            pitch: AxisDemand { angle: pitch.map(Angle::from_degrees), rate: pitch_rate },
            yaw: AxisDemand { angle: yaw.map(|yaw| Angle::from_degrees(yaw).wrapped()), rate: yaw_rate },
            kind: DemandKind::Commanded,
        };
        demand.check()?;
        Ok(demand)
    }

    /// A parameter that is a rate.
    pub fn degrees_per_second(&self, number: usize) -> Result<Option<AngularRate>, Refusal> {
        self.finite(number)?.map_or(Ok(None), |rate| Self::checked_rate(f64::from(rate)))
    }

    /// A rate in degrees per second that a gimbal can have.
    pub fn checked_rate(degrees_per_second: f64) -> Result<Option<AngularRate>, Refusal> {
        let rate = within(Some(degrees_per_second), LARGEST_RATE.to_degrees(), "rate_out_of_range")?;
        Ok(rate.map(AngularRate::from_degrees_per_second))
    }

    /// A parameter that must not be infinite.
    pub fn finite(&self, number: usize) -> Result<Option<f32>, Refusal> {
        match self.param(number) {
            Some(value) if value.is_infinite() => Err(Refusal::denied("infinite_number")),
            value => Ok(value),
        }
    }
}
