//! What is asked by the values of a row, where that takes more than the row itself.

use super::fields::{Field, Values, Wrong, optional, word};
use crate::geometry::{Angle, AngularRate, YawFrame};
use crate::gimbals::operation::{Axis, AxisMotion, MotorAxis, MotorControl, Operation};
use crate::manager::asked::Asked;
use crate::manager::request::AxisDemand;

/// The names of all values of a kind, in their order.
macro_rules! words {
    ($kind:ty) => {{
        let mut words = [""; <$kind>::ALL.len()];
        let mut at = 0;
        while at < words.len() {
            words[at] = <$kind>::ALL[at].name();
            at += 1;
        }
        words
    }};
}
pub(super) use words;

const AXES: [&str; Axis::ALL.len()] = words!(Axis);

/// Of what has a yaw.
pub const YAW_FRAME: Field = optional(word(
    "yaw_frame",
    "what yaw counts from and is kept to: the nose (the default) or North",
    &["vehicle", "earth"],
));
/// Of what is set for one axis; it stands in the path.
pub const AXIS: Field = word("axis", "pitch is tilt, yaw is pan", &AXES);

#[expect(clippy::unnecessary_wraps, reason = "the rows of the table may fail")]
pub fn operation(operation: Operation) -> Result<Asked, Wrong> {
    Ok(Asked::Operation(operation))
}

fn yaw_frame(values: &Values) -> YawFrame {
    if values.word("yaw_frame") == Some("earth") { YawFrame::Earth } else { YawFrame::Vehicle }
}

pub fn axis(values: &Values) -> Axis {
    values.index("axis", &AXES).map_or(Axis::Tilt, |at| Axis::ALL[at])
}

fn needs_one(values: &Values, names: &[&'static str]) -> Result<(), Wrong> {
    if names.iter().any(|name| values.has(name)) { Ok(()) } else { Err(Wrong::Nothing(names.to_vec())) }
}

pub fn point(values: &Values) -> Result<Asked, Wrong> {
    needs_one(values, &["pitch_deg", "yaw_deg", "roll_deg"])?;
    if !values.has("pitch_deg") && values.has("pitch_rate_dps") || !values.has("yaw_deg") && values.has("yaw_rate_dps")
    {
        return Err(Wrong::Together("a rate without an angle on its axis; to turn there is turn"));
    }
    let demand = |angle, rate| AxisDemand {
        angle: values.number(angle).map(Angle::from_degrees),
        rate: values.number(rate).map(AngularRate::from_degrees_per_second),
    };
    let yaw = demand("yaw_deg", "yaw_rate_dps");
    Ok(Asked::Point {
        roll: demand("roll_deg", ""),
        pitch: demand("pitch_deg", "pitch_rate_dps"),
        yaw: AxisDemand { angle: yaw.angle.map(Angle::wrapped), ..yaw },
        yaw_frame: yaw_frame(values),
    })
}

pub fn turn(values: &Values) -> Result<Asked, Wrong> {
    needs_one(values, &["pitch_dps", "yaw_dps", "roll_dps"])?;
    let rate = |name| values.number(name).map(AngularRate::from_degrees_per_second);
    Ok(Asked::Turn {
        roll: rate("roll_dps"),
        pitch: rate("pitch_dps").unwrap_or(AngularRate::ZERO),
        yaw: rate("yaw_dps").unwrap_or(AngularRate::ZERO),
        yaw_frame: yaw_frame(values),
    })
}

pub fn axis_motion(values: &Values) -> Result<Asked, Wrong> {
    let motion = AxisMotion {
        follow_speed: values.number("follow_speed"),
        follow_smoothing: values.number("follow_smoothing"),
        follow_window_deg: values.number("follow_window_deg"),
        control_speed_dps: values.number("control_speed_dps"),
        control_smoothing: values.number("control_smoothing"),
        reversed: values.flag("reversed"),
    };
    if motion == AxisMotion::default() {
        return Err(Wrong::Nothing(vec![
            "follow_speed",
            "follow_smoothing",
            "follow_window_deg",
            "control_speed_dps",
            "control_smoothing",
            "reversed",
        ]));
    }
    operation(Operation::SetAxisMotion { axis: axis(values), motion })
}

pub fn motor_control(values: &Values) -> Result<Asked, Wrong> {
    let axis = |stiffness, hold_strength| MotorAxis {
        stiffness: values.number(stiffness),
        hold_strength: values.number(hold_strength),
    };
    let motors = MotorControl {
        tilt: axis("tilt_stiffness", "tilt_hold_strength"),
        roll: axis("roll_stiffness", "roll_hold_strength"),
        pan: axis("pan_stiffness", "pan_hold_strength"),
        gyro_filter: values.number("gyro_filter"),
        output_filter: values.number("output_filter"),
        gain: values.number("gain"),
    };
    if motors == MotorControl::default() {
        return Err(Wrong::Nothing(vec!["tilt_stiffness", "gyro_filter", "and the like"]));
    }
    operation(Operation::SetMotorControl(motors))
}
