//! What can be set of a gimbal: how its axes move, how its motors hold, and what it listens to.

use std::fmt;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// Pitch.
    Tilt,
    Roll,
    /// Yaw.
    Pan,
}

impl Axis {
    pub const ALL: [Self; 3] = [Self::Tilt, Self::Roll, Self::Pan];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Tilt => "tilt",
            Self::Roll => "roll",
            Self::Pan => "pan",
        }
    }
}

/// How one axis moves; what is `None` stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisMotion {
    /// How fast it follows the vehicle; the gimbal's own scale.
    pub follow_speed: Option<f64>,
    /// How smoothly it follows the vehicle; the gimbal's own scale.
    pub follow_smoothing: Option<f64>,
    /// How far the vehicle may turn before it follows, degrees.
    pub follow_window_deg: Option<f64>,
    /// The highest speed under control, degrees per second.
    pub control_speed_dps: Option<f64>,
    /// How smoothly it starts and stops under control; the gimbal's own scale.
    pub control_smoothing: Option<f64>,
    /// Turns the other way under radio control.
    pub reversed: Option<bool>,
}

impl fmt::Display for AxisMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = [
            ("follow_speed", self.follow_speed),
            ("follow_smoothing", self.follow_smoothing),
            ("follow_window_deg", self.follow_window_deg),
            ("control_speed_dps", self.control_speed_dps),
            ("control_smoothing", self.control_smoothing),
        ];
        let reversed = self.reversed.map(|reversed| format!("reversed {reversed}"));
        f.write_str(&given(&numbers).chain(reversed).collect::<Vec<_>>().join(", "))
    }
}

/// How the motors hold the camera; the gimbal's own scales. What is `None` stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorControl {
    pub tilt: MotorAxis,
    pub roll: MotorAxis,
    pub pan: MotorAxis,
    pub gyro_filter: Option<f64>,
    pub output_filter: Option<f64>,
    /// Only older gimbals have it.
    pub gain: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorAxis {
    pub stiffness: Option<f64>,
    pub hold_strength: Option<f64>,
}

impl fmt::Display for MotorControl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = [
            ("tilt_stiffness", self.tilt.stiffness),
            ("tilt_hold_strength", self.tilt.hold_strength),
            ("roll_stiffness", self.roll.stiffness),
            ("roll_hold_strength", self.roll.hold_strength),
            ("pan_stiffness", self.pan.stiffness),
            ("pan_hold_strength", self.pan.hold_strength),
            ("gyro_filter", self.gyro_filter),
            ("output_filter", self.output_filter),
            ("gain", self.gain),
        ];
        f.write_str(&given(&numbers).collect::<Vec<_>>().join(", "))
    }
}

/// Those that do not stay as they are.
fn given(numbers: &[(&str, Option<f64>)]) -> impl Iterator<Item = String> {
    numbers.iter().filter_map(|(name, value)| value.map(|value| format!("{name} {value}")))
}

/// The kind of radio receiver that the gimbal listens to; [`Sync`](Self::Sync) is control by MAVLink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioType {
    SbusFasst,
    Joystick,
    Jr11Bit,
    Jr10Bit,
    Ppm,
    Sync,
    Lb2Single,
    Lb2Normal,
    Sync2,
    SbusSfhss,
    Herelink,
}

impl RadioType {
    pub const ALL: [Self; 11] = [
        Self::SbusFasst,
        Self::Joystick,
        Self::Jr11Bit,
        Self::Jr10Bit,
        Self::Ppm,
        Self::Sync,
        Self::Lb2Single,
        Self::Lb2Normal,
        Self::Sync2,
        Self::SbusSfhss,
        Self::Herelink,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::SbusFasst => "sbus_fasst",
            Self::Joystick => "joystick",
            Self::Jr11Bit => "jr_11bit",
            Self::Jr10Bit => "jr_10bit",
            Self::Ppm => "ppm",
            Self::Sync => "sync",
            Self::Lb2Single => "lb2_single",
            Self::Lb2Normal => "lb2_normal",
            Self::Sync2 => "sync2",
            Self::SbusSfhss => "sbus_sfhss",
            Self::Herelink => "herelink",
        }
    }
}

/// What `MOUNT_STATUS` carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderUnit {
    /// 65536 to the turn.
    Counts,
    Angles,
}
