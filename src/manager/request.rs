//! What others ask of a gimbal manager, read once: NaN, −1 and 0 as "not set" end here.

use crate::geometry::{Angle, AngularRate, Attitude, EarthFrame, GimbalAngles};
use crate::wire::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_SET_ATTITUDE_DATA,
    GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA, MOUNT_CONFIGURE_DATA, MOUNT_CONTROL_DATA,
};
use crate::wire::ids::{CommandResult, GimbalFlags, command, message};
use crate::wire::{Frame, MavId, Target};

/// Something asked of a manager.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// A demand on the gimbal by message: no answer is due.
    Demand {
        target: Target,
        gimbal: u8,
        demand: Demand,
    },
    Command(Command),
    /// A v1 message to a mount: no answer is due.
    Mount {
        target: Target,
        message: MountMessage,
    },
}

/// `MOUNT_CONFIGURE` (156) or `MOUNT_CONTROL` (157).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MountMessage {
    /// A `MAV_MOUNT_MODE`.
    Configure { mode: u8 },
    /// Pitch, roll and yaw in hundredths of a degree; or latitude and longitude in units of 1e-7 degrees and the altitude
    /// above home in centimetres, as the mode has it.
    Control { inputs: [i32; 3] },
}

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

/// Where one would have the gimbal look, or how it is to turn. `None` makes no demand on that axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    pub flags: GimbalFlags,
    pub roll: AxisDemand,
    /// Up is positive.
    pub pitch: AxisDemand,
    /// Right is positive; from the vehicle's nose or from North as `flags` say.
    pub yaw: AxisDemand,
    pub kind: DemandKind,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDemand {
    pub angle: Option<Angle>,
    pub rate: Option<AngularRate>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemandKind {
    /// Repeated by its sender; a rate that is not refreshed stops soon.
    #[default]
    Streamed,
    /// Sent once.
    Commanded,
    /// −1 to 1 of what the gimbal can do (288); angles and rates are fractions until the manager scales them.
    Manual,
}

/// Why a request is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    pub result: CommandResult,
    /// A word for the counters and the person looking.
    pub reason: &'static str,
}

impl Refusal {
    pub const fn denied(reason: &'static str) -> Self {
        Self { result: CommandResult::Denied, reason }
    }

    pub const fn later(reason: &'static str) -> Self {
        Self { result: CommandResult::TemporarilyRejected, reason }
    }
}

/// Reads a message that a manager has to do with: `None` for any other, an error for one that is malformed.
pub fn read_request(frame: &Frame<'_>) -> Option<Result<Request, Refusal>> {
    let request = match frame.message_id() {
        message::COMMAND_LONG => frame.decode().map(|message| Ok(Request::Command(command_long(frame, &message)))),
        message::COMMAND_INT => frame.decode().map(|message| Ok(Request::Command(command_int(frame, &message)))),
        message::GIMBAL_MANAGER_SET_ATTITUDE => frame.decode().map(|message| set_attitude(frame.target(), &message)),
        message::GIMBAL_MANAGER_SET_PITCHYAW => frame.decode().map(|message| set_pitchyaw(frame.target(), &message)),
        message::GIMBAL_MANAGER_SET_MANUAL_CONTROL => {
            frame.decode().map(|message| set_manual_control(frame.target(), &message))
        }
        message::MOUNT_CONFIGURE => frame.decode::<MOUNT_CONFIGURE_DATA>().map(|message| {
            let message = MountMessage::Configure { mode: message.mount_mode };
            Ok(Request::Mount { target: frame.target(), message })
        }),
        message::MOUNT_CONTROL => frame.decode::<MOUNT_CONTROL_DATA>().map(|message| {
            let message = MountMessage::Control { inputs: [message.input_a, message.input_b, message.input_c] };
            Ok(Request::Mount { target: frame.target(), message })
        }),
        _ => None,
    };
    request.map(|request| {
        request.and_then(|request| match request {
            Request::Demand { demand, .. } => check(&demand).map(|()| request),
            Request::Command(_) | Request::Mount { .. } => Ok(request),
        })
    })
}

fn command_long(frame: &Frame<'_>, message: &COMMAND_LONG_DATA) -> Command {
    Command {
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

fn command_int(frame: &Frame<'_>, message: &COMMAND_INT_DATA) -> Command {
    Command {
        number: message.command,
        target: frame.target(),
        params: [message.param1, message.param2, message.param3, message.param4, f32::NAN, f32::NAN, message.z],
        form: Form::Int { frame: message.frame, x: message.x, y: message.y },
        confirmation: 0,
    }
}

/// What the bits of a NaN become in `x` and `y` where a sender casts them through the wrong type; PX4 refuses it too.
const NAN_AS_INTEGER: i32 = 0x7ff8_0000;

/// `GIMBAL_MANAGER_SET_ATTITUDE` (282): a quaternion of four NaN states no angle.
fn set_attitude(target: Target, message: &GIMBAL_MANAGER_SET_ATTITUDE_DATA) -> Result<Request, Refusal> {
    // The frame of the quaternion follows from the flags; the angles are the same numbers in either.
    let attitude: Option<Attitude<EarthFrame>> =
        Attitude::from_wxyz(message.q).map_err(|_| Refusal::denied("malformed_quaternion"))?;
    let angles = attitude.map(Attitude::gimbal_angles);
    let angle = |of: fn(GimbalAngles) -> Angle| angles.map(of);
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand { angle: angle(|angles| angles.roll), rate: rate(message.angular_velocity_x)? },
            pitch: AxisDemand { angle: angle(|angles| angles.pitch), rate: rate(message.angular_velocity_y)? },
            yaw: AxisDemand { angle: angle(|angles| angles.yaw), rate: rate(message.angular_velocity_z)? },
            kind: DemandKind::Streamed,
        },
    })
}

/// `GIMBAL_DEVICE_SET_ATTITUDE` (284): what an autopilot tells a device. `None` where it demands nothing.
///
/// Whoever states an angle means no rate, except that PX4 sends the identity beside one.
pub fn device_set_attitude(message: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> Result<Option<Demand>, Refusal> {
    let attitude: Option<Attitude<EarthFrame>> =
        Attitude::from_wxyz(message.q).map_err(|_| Refusal::denied("malformed_quaternion"))?;
    let [roll_rate, pitch_rate, yaw_rate] =
        [rate(message.angular_velocity_x)?, rate(message.angular_velocity_y)?, rate(message.angular_velocity_z)?];
    let turns = [roll_rate, pitch_rate, yaw_rate].iter().flatten().any(|rate| !rate.is_zero());
    let angles = attitude.filter(|_| !(turns && message.q == [1.0, 0.0, 0.0, 0.0])).map(Attitude::gimbal_angles);
    let axis = |of: fn(GimbalAngles) -> Angle, rate: Option<AngularRate>| match angles {
        Some(angles) => AxisDemand { angle: Some(of(angles)), rate: None },
        None => AxisDemand { angle: None, rate },
    };
    let demand = Demand {
        flags: GimbalFlags::from_bits_retain(message.flags),
        roll: axis(|angles| angles.roll, roll_rate),
        pitch: axis(|angles| angles.pitch, pitch_rate),
        yaw: axis(|angles| angles.yaw, yaw_rate),
        kind: DemandKind::Streamed,
    };
    check(&demand)?;
    let poses = demand.flags.intersects(GimbalFlags::RETRACT | GimbalFlags::NEUTRAL);
    let is_empty = [demand.roll, demand.pitch, demand.yaw].iter().all(|axis| *axis == AxisDemand::default());
    Ok(Some(demand).filter(|_| poses || !is_empty))
}

/// `GIMBAL_MANAGER_SET_PITCHYAW` (287), in radians.
fn set_pitchyaw(target: Target, message: &GIMBAL_MANAGER_SET_PITCHYAW_DATA) -> Result<Request, Refusal> {
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand::default(),
            pitch: AxisDemand { angle: angle(message.pitch, PITCH_RANGE)?, rate: rate(message.pitch_rate)? },
            yaw: AxisDemand {
                angle: angle(message.yaw, YAW_RANGE)?.map(Angle::wrapped),
                rate: rate(message.yaw_rate)?,
            },
            kind: DemandKind::Streamed,
        },
    })
}

/// `GIMBAL_MANAGER_SET_MANUAL_CONTROL` (288), −1 to 1; beyond that is taken for the end.
fn set_manual_control(target: Target, message: &GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA) -> Result<Request, Refusal> {
    let axis = |stick: f32, rate_stick: f32| -> Result<AxisDemand, Refusal> {
        let fraction = |stick: f32| Ok(number(stick)?.map(|stick| stick.clamp(-1.0, 1.0)));
        let rate = fraction(rate_stick)?.map(AngularRate::from_radians_per_second);
        // A rate that is given wins over an angle on the same axis.
        let angle = fraction(stick)?.filter(|_| rate.is_none()).map(Angle::from_radians);
        Ok(AxisDemand { angle, rate })
    };
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand::default(),
            pitch: axis(message.pitch, message.pitch_rate)?,
            yaw: axis(message.yaw, message.yaw_rate)?,
            kind: DemandKind::Manual,
        },
    })
}

/// Degrees: beyond half a turn of pitch, or a turn of yaw, is no angle of a gimbal.
const PITCH_RANGE: f64 = 180.0;
const YAW_RANGE: f64 = 360.0;

/// Degrees; an angle in radians may be rounded to beyond its range.
const ROUNDING: f64 = 0.01;

/// Radians per second; no gimbal turns a hundredth as fast for long.
const LARGEST_RATE: f64 = 100.0;

fn angle(radians: f32, range: f64) -> Result<Option<Angle>, Refusal> {
    let degrees = number(radians)?.map(f64::to_degrees);
    let angle = within(degrees, range + ROUNDING, "angle_out_of_range")?;
    Ok(angle.map(Angle::from_degrees))
}

fn rate(radians_per_second: f32) -> Result<Option<AngularRate>, Refusal> {
    let rate = within(number(radians_per_second)?, LARGEST_RATE, "rate_out_of_range")?;
    Ok(rate.map(AngularRate::from_radians_per_second))
}

fn within(value: Option<f64>, largest: f64, reason: &'static str) -> Result<Option<f64>, Refusal> {
    if value.is_some_and(|value| value.abs() > largest) { Err(Refusal::denied(reason)) } else { Ok(value) }
}

/// NaN is no demand; an infinite number is a fault.
fn number(value: f32) -> Result<Option<f64>, Refusal> {
    match value {
        value if value.is_nan() => Ok(None),
        value if value.is_infinite() => Err(Refusal::denied("infinite_number")),
        value => Ok(Some(f64::from(value))),
    }
}

/// What no gimbal can do, whatever its capabilities.
fn check(demand: &Demand) -> Result<(), Refusal> {
    if demand.flags.contains(GimbalFlags::YAW_IN_VEHICLE_FRAME | GimbalFlags::YAW_IN_EARTH_FRAME) {
        return Err(Refusal::denied("both_yaw_frames"));
    }
    Ok(())
}

impl Demand {
    /// Whether it asks the gimbal to turn on and on.
    pub fn turns(&self) -> bool {
        let axes = [self.roll, self.pitch, self.yaw];
        axes.iter().any(|axis| axis.angle.is_none() && axis.rate.is_some_and(|rate| !rate.is_zero()))
    }
}

impl Command {
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
        check(&demand)?;
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

/// The four parameters of `DO_GIMBAL_MANAGER_CONFIGURE` (1001) that name who is to be in control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configure {
    pub primary: Claim,
    pub secondary: Claim,
}

/// What is asked for one of the two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// −1: leave unchanged.
    Keep,
    /// −2: the sender takes it.
    Take,
    /// −3: the sender gives it up, if it has it.
    Release,
    /// 0: nobody.
    Clear,
    Assign(MavId),
}

impl Configure {
    /// Reads the parameters: "0: no one in control, -1: leave unchanged, -2: set itself in control, -3: remove
    /// control if currently in control". System and component make one claim; half of one is refused.
    pub fn read(command: &Command) -> Result<Self, Refusal> {
        debug_assert_eq!(command.number, command::DO_GIMBAL_MANAGER_CONFIGURE);
        Ok(Self { primary: claim(command, 1)?, secondary: claim(command, 3)? })
    }
}

fn claim(command: &Command, first: usize) -> Result<Claim, Refusal> {
    let id = |number: usize| -> Result<i16, Refusal> {
        let value = command.params[number - 1];
        if !value.is_finite() {
            return Ok(-1);
        }
        // Fractions come from clients of 2020, whose command 1001 was "track point".
        if (value - value.round()).abs() > 1e-3 {
            return Err(Refusal::denied("not_an_id"));
        }
        if !(-3.0..=255.0).contains(&value.round()) {
            return Err(Refusal::denied("not_an_id"));
        }
        Ok(value.round() as i16)
    };
    match (id(first)?, id(first + 1)?) {
        (-1, -1) => Ok(Claim::Keep),
        (-2, -2) => Ok(Claim::Take),
        (-3, -3) => Ok(Claim::Release),
        (0, 0..) | (0.., 0) => Ok(Claim::Clear),
        (system @ 1.., component @ 1..) => Ok(Claim::Assign(MavId::new(system as u8, component as u8))),
        _ => Err(Refusal::denied("half_a_pair")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f32 = f32::NAN;
    /// 90° to the right.
    const RIGHT: [f32; 4] = [0.707_106_77, 0.0, 0.0, 0.707_106_77];
    const AHEAD: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
    const NONE: [f32; 4] = [NAN; 4];

    fn read(q: [f32; 4], [x, y, z]: [f32; 3], flags: u16) -> Result<Option<Demand>, Refusal> {
        device_set_attitude(&GIMBAL_DEVICE_SET_ATTITUDE_DATA {
            q,
            angular_velocity_x: x,
            angular_velocity_y: y,
            angular_velocity_z: z,
            flags,
            target_system: 1,
            target_component: 154,
        })
    }

    /// "284 with NaN q (rates, ArduPilot; no input yet, PX4) or identity q (rates, PX4)."
    #[test]
    #[rustfmt::skip]
    fn what_autopilots_tell_a_device_is_read_as_each_means_it() {
        for (q, rates, flags, expected) in [
            // Yaw, and yaw rate; whole degrees.
            (RIGHT, [NAN; 3],        0,  Ok(Some((Some(90), None)))),
            (RIGHT, [0.0, 0.0, 1.0], 28, Ok(Some((Some(90), None)))),
            (AHEAD, [0.0; 3],        32, Ok(Some((Some(0), None)))),
            (AHEAD, [0.0, 0.0, 1.0], 16, Ok(Some((None, Some(57))))),
            (NONE,  [0.0, 0.0, 1.0], 28, Ok(Some((None, Some(57))))),
            (NONE,  [0.0; 3],        28, Ok(Some((None, Some(0))))),
            (NONE,  [NAN; 3],        44, Ok(None)),
            (NONE,  [NAN; 3],        1,  Ok(Some((None, None)))),
            (NONE,  [0.0, 0.0, f32::INFINITY], 0, Err("infinite_number")),
            ([0.0; 4], [NAN; 3],     0,  Err("malformed_quaternion")),
            ([1.2, 0.0, 0.0, 0.0], [NAN; 3], 0, Err("malformed_quaternion")),
            (AHEAD, [NAN; 3],        32 | 64, Err("both_yaw_frames")),
        ] {
            let yaw = |demand: Demand| {
                let angle = demand.yaw.angle.map(|angle| angle.degrees().round() as i32);
                (angle, demand.yaw.rate.map(|rate| rate.degrees_per_second().round() as i32))
            };
            let found = read(q, rates, flags).map(|demand| demand.map(yaw)).map_err(|refusal| refusal.reason);
            assert_eq!(found, expected, "{q:?} {rates:?} {flags}");
        }
        assert!(read(NONE, [0.0, 0.0, 1.0], 28).is_ok_and(|demand| demand.is_some_and(|demand| demand.turns())));
        assert!(read(NONE, [0.0; 3], 28).is_ok_and(|demand| demand.is_some_and(|demand| !demand.turns())));
    }
}
