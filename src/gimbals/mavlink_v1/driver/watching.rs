//! Whether the gimbal goes where it is told to look, and what is said of one that does not.

use super::MavlinkV1Driver;
use crate::geometry::{Attitude, GimbalAngles, VehicleFrame};
use crate::gimbals::mavlink_v1::obedience::Finding;
use crate::gimbals::report::Report;
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::MOUNT_STATUS_DATA;
use crate::wire::ids::mount_mode;

/// Whether it is known not to go where it is told to look; the pilot is told once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DoesNotMove {
    pub is_so: bool,
    is_told: bool,
}

/// What the pilot is told of it.
const DOES_NOT_MOVE: &str = "is told angles but does not move";

/// What may be the reason, for whoever looks into it.
const WHAT_TO_CHECK: &str = "that its motors are on and that nothing blocks the camera; that no radio control of its own \
    has it; that v1_configure is true if it wants DO_MOUNT_CONFIGURE first; the wire towards it; and its family";

impl MavlinkV1Driver {
    /// That it does not move, and what to do about it. Everything that it is told is MAVLink 2.
    pub(super) fn why_it_may_not_move(&self) -> String {
        if self.sends_mavlink_2 {
            format!("it is told where to look and does not move. Check {WHAT_TO_CHECK}")
        } else {
            format!(
                "it sends MAVLink 1 frames only and may not understand MAVLink 2; it is told where to look in that and does \
                 not move. Set it to MAVLink 2, and the autopilot's ports on the way to it (SERIALn_PROTOCOL = 2), or give it \
                 firmware that speaks it; if it does not move then, check {WHAT_TO_CHECK}"
            )
        }
    }

    /// Looks whether it goes where it was told to look.
    pub(super) fn watch_obedience(&mut self, now: Timestamp, frame: &Frame<'_>, attitude: Attitude<VehicleFrame>) {
        let mode = frame.decode::<MOUNT_STATUS_DATA>().map(|status| status.mount_mode);
        if mode == Some(mount_mode::RC_TARGETING) || !self.ready {
            return self.obedience.pause();
        }
        let GimbalAngles { pitch, yaw, .. } = attitude.gimbal_angles();
        match self.obedience.handle_report(now, [pitch, yaw]) {
            Some(Finding::Moves) => self.does_not_move.is_so = false,
            Some(Finding::DoesNotMove) => {
                self.does_not_move.is_so = true;
                if !std::mem::replace(&mut self.does_not_move.is_told, true) {
                    self.report(Report::Fault(DOES_NOT_MOVE));
                }
            }
            None => {}
        }
    }
}
