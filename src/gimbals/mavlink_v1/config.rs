//! What the user may say of a v1 gimbal.

use crate::gimbals::signs::Signs;

/// The keys of the family.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct V1Settings {
    /// How it counts in what it is told.
    pub sign: Signs,
    /// How it counts in what it reports.
    pub report_sign: Signs,
    /// It is sent `DO_MOUNT_CONFIGURE` before each change of mode, as `PX4` does and `ArduPilot` never.
    pub configures: bool,
    pub radio_control: V1RadioControl,
}

/// How its own radio control gets it, if it has one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum V1RadioControl {
    /// It has none.
    #[default]
    None,
    /// It has the gimbal whenever the gimbal is told nothing.
    Silence,
    /// It is given the gimbal by `DO_MOUNT_CONTROL` in `MAV_MOUNT_MODE_RC_TARGETING`.
    Mode,
}

/// What is answered to who wants a gimbal to follow its radio control where that is `None`.
pub const NO_RADIO_CONTROL: &str = "v1_radio_control is \"none\", so this gimbal is taken to have no radio control of its own. \
    If it has one, say in its [[gimbal]] entry how that gets the gimbal: v1_radio_control = \"silence\" (whenever the gimbal is \
    told nothing) or \"mode\" (by DO_MOUNT_CONTROL in mode 3), and restart gimbald";

impl V1RadioControl {
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Silence => "silence",
            Self::Mode => "mode",
        }
    }
}
