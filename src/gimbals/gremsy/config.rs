//! What the user may say of a Gremsy.

use super::driver::Generation;
use super::readings::Negated;
use crate::geometry::Angle;
use crate::gimbals::signs::{Sign, Signs};

/// The keys of the family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GremsySettings {
    /// What it speaks; found out where it is not said.
    pub generation: Option<Generation>,
    /// A client's "retract" switches the motors off. Some firmware takes them back only after a restart, so without it
    /// the gimbal is turned to the stow angles.
    pub retract_allowed: bool,
    pub stow_pitch: Angle,
    /// From the vehicle's nose.
    pub stow_yaw: Angle,
    /// Which way it counts in `MOUNT_ORIENTATION`; found out for pitch where it is not said.
    pub report_sign: Option<Signs>,
}

impl GremsySettings {
    /// What it reports the wrong way round, as far as the user says.
    pub fn negated(&self) -> Negated {
        let signs = self.report_sign.unwrap_or_default();
        let is_negated = |sign| sign == Sign::Opposite;
        Negated { roll: is_negated(signs.roll), pitch: is_negated(signs.pitch), yaw: is_negated(signs.yaw) }
    }
}

impl Default for GremsySettings {
    fn default() -> Self {
        Self {
            generation: None,
            retract_allowed: false,
            stow_pitch: Angle::ZERO,
            stow_yaw: Angle::ZERO,
            report_sign: None,
        }
    }
}
