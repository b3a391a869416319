//! The table itself. Angles in degrees, pitch up and yaw to the right positive.

use super::Action;
use super::danger::{MOTORS_OFF, REBOOT, RETRACT_CUTS_MOTORS, SHUTDOWN};
use super::fields::{Field, Kind, Values, Wrong, number, optional, positive, required, scale, word};
use super::reading::{AXIS, YAW_FRAME, axis, axis_motion, motor_control, operation, point, turn, words};
use crate::geometry::{Angle, AxisLimits};
use crate::gimbals::operation::{
    EncoderUnit, Motors, Operation, RadioType, ResetMode, Restart, Stream, StreamRate, YawMode,
};
use crate::manager::asked::Asked;
use crate::manager::roi::Datum;

/// Everything that can be asked.
pub const ACTIONS: &[Action] = &[
    Action {
        path: "control",
        command: "control",
        about: "Take control of the gimbal, or give it up. Who asks for nothing for lease_timeout_s loses it; taking it again keeps it",
        fields: &[word("action", "what to do", &["take", "release"])],
        danger: None,
        read: |values| {
            Ok(if values.word("action") == Some("take") { Asked::TakeControl } else { Asked::ReleaseControl })
        },
    },
    Action {
        path: "point",
        command: "point",
        about: "Look along these angles and keep them; an axis that is left out stays as it is",
        fields: &[
            number("pitch_deg", "up is positive", 180.0),
            number("yaw_deg", "right is positive", 360.0),
            number("roll_deg", "right side down is positive; 0 where it is left out", 180.0),
            YAW_FRAME,
            positive("pitch_rate_dps", "go there no faster than this", 720.0),
            positive("yaw_rate_dps", "go there no faster than this", 720.0),
        ],
        danger: None,
        read: point,
    },
    Action {
        path: "turn",
        command: "turn",
        about: "Turn at these rates; ends rate_timeout_s after it was last asked for",
        fields: &[
            number("pitch_dps", "degrees per second, up is positive", 720.0),
            number("yaw_dps", "degrees per second, right is positive", 720.0),
            number("roll_dps", "degrees per second, right side down is positive", 720.0),
            YAW_FRAME,
        ],
        danger: None,
        read: turn,
    },
    plain("stop", "stop", "Stay where it looks at this moment", |_| Ok(Asked::Stop)),
    plain("lock", "lock", "Keep its direction, yaw to North however the vehicle turns", |_| Ok(Asked::Lock)),
    plain("follow", "follow", "Keep its direction, yaw to the nose of the vehicle", |_| Ok(Asked::Follow)),
    plain("neutral", "neutral", "Go to the neutral position", |_| Ok(Asked::Neutral)),
    Action {
        danger: Some(&RETRACT_CUTS_MOTORS),
        ..plain("retract", "retract", "Go to the retracted position", |values| {
            Ok(Asked::Retract { may_cut_motors: values.is_confirmed() })
        })
    },
    Action {
        path: "roi",
        command: "roi",
        about: "Look at a place until something else is asked for",
        fields: &[
            required(number("latitude_deg", "WGS 84", 90.0)),
            required(number("longitude_deg", "WGS 84", 180.0)),
            required(number("altitude_m", "above altitude_reference", 100_000.0)),
            optional(word("altitude_reference", "mean sea level (the default), or home", &["amsl", "home"])),
        ],
        danger: None,
        read: |values| {
            Ok(Asked::LookAt {
                latitude_deg: values.number("latitude_deg").unwrap_or_default(),
                longitude_deg: values.number("longitude_deg").unwrap_or_default(),
                altitude_m: values.number("altitude_m").unwrap_or_default(),
                datum: if values.word("altitude_reference") == Some("home") {
                    Datum::Home
                } else {
                    Datum::MeanSeaLevel
                },
            })
        },
    },
    plain("roi/end", "roi-end", "Look at no place any more, and go to the neutral position", |_| Ok(Asked::EndRoi)),
    Action {
        path: "motors",
        command: "motors",
        about: "Switch the motors; without them the camera falls to where its weight takes it",
        fields: &[word(
            "state",
            "off is dangerous; to a Gremsy that speaks v2 it is RETRACT, and some firmware switches the motors on again only \
             after a restart",
            &["on", "off"],
        )],
        danger: Some(&MOTORS_OFF),
        read: |values| {
            operation(Operation::Motors(if values.word("state") == Some("off") { Motors::Off } else { Motors::On }))
        },
    },
    Action {
        path: "reboot",
        command: "reboot",
        about: "Start the gimbal again; the camera is not held meanwhile",
        fields: &[],
        danger: Some(&REBOOT),
        read: |_| operation(Operation::Restart(Restart::Reboot)),
    },
    Action {
        path: "shutdown",
        command: "shutdown",
        about: "Shut the gimbal down; it must be switched on by hand",
        fields: &[],
        danger: Some(&SHUTDOWN),
        read: |_| operation(Operation::Restart(Restart::Shutdown)),
    },
    Action {
        path: "yaw-mode",
        command: "yaw-mode",
        about: "Use the gimbal's own lock or follow mode, yaw to what it takes for North or to the nose",
        fields: &[word("mode", "which", &["lock", "follow"])],
        danger: None,
        read: |values| {
            operation(Operation::SetYawMode(if values.word("mode") == Some("lock") {
                YawMode::Lock
            } else {
                YawMode::Follow
            }))
        },
    },
    plain(
        "mapping",
        "mapping",
        "Look straight down as for a survey, by the gimbal's own function; yaw is its affair",
        |_| operation(Operation::Mapping),
    ),
    Action {
        path: "reset",
        command: "reset",
        about: "Turn the camera back by the gimbal's own function",
        fields: &[word(
            "mode",
            "yaw: to the nose; pitch: to the horizon; pitch_down_up: straight down, or up where the gimbal hangs the other \
             way; pitch_mapping: straight down as for a survey; axes that are not named stay",
            &RESET_MODES,
        )],
        danger: None,
        read: |values| {
            let mode = values.index("mode", &RESET_MODES).map(|at| ResetMode::ALL[at]);
            operation(Operation::Reset(mode.unwrap_or(ResetMode::PitchAndYaw)))
        },
    },
    plain(
        "radio-control",
        "radio-control",
        "Leave the gimbal to its own radio receiver until something else is asked for",
        |_| operation(Operation::RadioControl),
    ),
    Action {
        path: "radio-type",
        command: "radio-type",
        about: "Say which radio receiver the gimbal has; sync is control by MAVLink",
        fields: &[word("type", "the kind of receiver", &RADIO_TYPES)],
        danger: None,
        read: |values| {
            let kind = values.index("type", &RADIO_TYPES).map(|at| RadioType::ALL[at]);
            operation(Operation::SetRadioType(kind.unwrap_or(RadioType::Sync)))
        },
    },
    plain("information", "information", "Ask the gimbal once more who it is", |_| {
        operation(Operation::RequestInformation)
    }),
    Action {
        path: "stream-rates",
        command: "stream-rate",
        about: "Set how often the gimbal sends one of its messages",
        fields: &[
            word("stream", "the message; a v1 Gremsy does not send attitude_status", &STREAMS),
            required(Field {
                name: "rate_hz",
                about: "times a second; default is as often as the gimbal does by itself",
                kind: Kind::WholeOrWord { min: 1, max: 200, words: &["off", "default"] },
                required: true,
            }),
        ],
        danger: None,
        read: |values| {
            let stream = values.index("stream", &STREAMS).map_or(Stream::AttitudeStatus, |at| Stream::ALL[at]);
            let rate = match (values.number("rate_hz"), values.word("rate_hz")) {
                (Some(hertz), _) => StreamRate::Hertz(hertz as u8),
                (None, Some("off")) => StreamRate::Off,
                (None, _) => StreamRate::Default,
            };
            operation(Operation::SetStreamRate { stream, rate })
        },
    },
    plain("parameters/refresh", "refresh-parameters", "Read every parameter of the gimbal", |_| {
        operation(Operation::RefreshParameters)
    }),
    Action {
        path: "parameters/{parameter}",
        command: "set-parameter",
        about: "Write a parameter of the gimbal",
        fields: &[
            Field { name: "parameter", about: "its name", kind: Kind::Name { longest: 16 }, required: true },
            required(number("value", "its new value", 16_777_216.0)),
        ],
        danger: None,
        read: |values| {
            let name = values.word("parameter").unwrap_or_default().to_owned();
            operation(Operation::SetParameter { name, value: values.number("value").unwrap_or_default() })
        },
    },
    Action {
        path: "axes/{axis}",
        command: "axis",
        about: "Set how one axis moves; what is left out stays as it is",
        fields: &[
            AXIS,
            scale("follow_speed", "how fast it follows the vehicle; not for roll"),
            scale("follow_smoothing", "how smoothly it follows the vehicle; not for roll"),
            positive(
                "follow_window_deg",
                "how far the vehicle may turn before it follows, degrees; not for roll",
                180.0,
            ),
            positive("control_speed_dps", "its highest speed under control, degrees per second", 720.0),
            scale("control_smoothing", "how smoothly it starts and stops under control"),
            Field {
                name: "reversed",
                about: "whether it turns the other way under radio control",
                kind: Kind::Flag,
                required: false,
            },
        ],
        danger: None,
        read: axis_motion,
    },
    Action {
        path: "motor-control",
        command: "motor-control",
        about: "Set how the motors hold the camera; what is left out stays as it is",
        fields: &[
            scale("tilt_stiffness", "stiffness of tilt"),
            scale("tilt_hold_strength", "hold strength of tilt"),
            scale("roll_stiffness", "stiffness of roll"),
            scale("roll_hold_strength", "hold strength of roll"),
            scale("pan_stiffness", "stiffness of pan"),
            scale("pan_hold_strength", "hold strength of pan"),
            scale("gyro_filter", "filter of the gyroscopes"),
            scale("output_filter", "filter of the output"),
            scale("gain", "gain; only older gimbals have it"),
        ],
        danger: None,
        read: motor_control,
    },
    Action {
        path: "limits/{axis}",
        command: "limits",
        about: "Set the software limits of one axis",
        fields: &[
            AXIS,
            required(number(
                "min_deg",
                "the lower one; down and left are negative; of tilt and roll -180 to 180",
                360.0,
            )),
            required(number("max_deg", "the upper one; of tilt and roll -180 to 180", 360.0)),
        ],
        danger: None,
        read: |values| {
            let degrees = |name| Angle::from_degrees(values.number(name).unwrap_or_default());
            let limits = AxisLimits::new(degrees("min_deg"), degrees("max_deg"));
            let limits = limits.ok_or(Wrong::Together("min_deg must not be above max_deg"))?;
            operation(Operation::SetLimits { axis: axis(values), limits })
        },
    },
    Action {
        path: "encoder-unit",
        command: "encoder-unit",
        about: "Set what the gimbal's encoder message carries",
        fields: &[word("unit", "65536 counts to the turn, or angles", &["counts", "angles"])],
        danger: None,
        read: |values| {
            operation(Operation::SetEncoderUnit(if values.word("unit") == Some("counts") {
                EncoderUnit::Counts
            } else {
                EncoderUnit::Angles
            }))
        },
    },
    switch("combined-attitude", "Let the autopilot's attitude keep the gimbal's yaw from drifting", |values| {
        operation(Operation::SetCombinedAttitude(values.flag("enabled") == Some(true)))
    }),
    switch("home-on-mode-change", "Let the gimbal return home whenever lock and follow are switched", |values| {
        operation(Operation::SetHomeOnModeChange(values.flag("enabled") == Some(true)))
    }),
];

const RESET_MODES: [&str; ResetMode::ALL.len()] = words!(ResetMode);
const RADIO_TYPES: [&str; RadioType::ALL.len()] = words!(RadioType);
const STREAMS: [&str; Stream::ALL.len()] = words!(Stream);

/// One without fields.
const fn plain(
    path: &'static str,
    command: &'static str,
    about: &'static str,
    read: fn(&Values) -> Result<Asked, Wrong>,
) -> Action {
    Action { path, command, about, fields: &[], danger: None, read }
}

/// One that is on or off.
const fn switch(path: &'static str, about: &'static str, read: fn(&Values) -> Result<Asked, Wrong>) -> Action {
    const ENABLED: &[Field] = &[Field { name: "enabled", about: "whether it does", kind: Kind::Flag, required: true }];
    Action { path, command: path, about, fields: ENABLED, danger: None, read }
}
