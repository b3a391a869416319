//! What is made of somebody on the line from what it says: whether it is a gimbal, and which family drives it.

use std::fmt;

use crate::commands::client::printable_text;
use crate::gimbals::gremsy;
use crate::gimbals::gremsy::parameters::ParameterTable;
use crate::gimbals::mavlink_v2::packet::{self, WhichGimbal};
use crate::gimbals::report::Identity;
use crate::gimbals::settings::Family;
use crate::wire::dialect::{HEARTBEAT_DATA, PARAM_VALUE_DATA};
use crate::wire::ids::{mav_autopilot, mav_type, message};
use crate::wire::{Frame, Version};

/// Somebody on the line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Party {
    frames: u32,
    sends_mavlink_2: bool,
    /// `MAV_TYPE` and `MAV_AUTOPILOT`.
    heartbeat: Option<(u8, u8)>,
    /// 283 or 285 about itself was heard from it.
    pub is_gimbal_device: bool,
    pub identity: Option<Identity>,
    /// It told where it looks by 285.
    tells_v2_attitude: bool,
    /// It told where it looks by a message of v1.
    tells_v1_attitude: bool,
    /// Which of the parameters it has that only Gremsy gimbals have.
    table: Option<ParameterTable>,
}

impl Party {
    pub fn handle_frame(&mut self, frame: &Frame<'_>) {
        self.frames = self.frames.saturating_add(1);
        self.sends_mavlink_2 |= frame.version() == Version::V2;
        if let Some(heartbeat) = frame.decode::<HEARTBEAT_DATA>() {
            self.heartbeat = Some((heartbeat.mavtype, heartbeat.autopilot));
        }
        // With another id it is said for a gimbal without MAVLink, by its manager.
        let information = packet::read_information(frame).filter(|information| information.of == WhichGimbal::Sender);
        let tells_attitude = packet::read_status(frame).is_some_and(|status| status.of == WhichGimbal::Sender);
        self.is_gimbal_device |= information.is_some() || tells_attitude;
        self.tells_v2_attitude |= tells_attitude;
        if let Some(information) = information {
            self.identity = Some(information.identity);
        }
        match frame.message_id() {
            message::MOUNT_ORIENTATION | message::MOUNT_STATUS => self.tells_v1_attitude = true,
            message::PARAM_VALUE => {
                let value = frame.decode::<PARAM_VALUE_DATA>();
                let name = value.as_ref().and_then(|value| value.param_id.to_str().ok());
                self.table = self.table.or(ParameterTable::recognised_by(name));
            }
            _ => {}
        }
    }

    /// One frame of noise has a right checksum now and then, two from the same source do not.
    pub fn is_real(&self) -> bool {
        self.heartbeat.is_some() || self.frames >= 2
    }

    pub fn is_autopilot(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, autopilot)| {
            autopilot != mav_autopilot::INVALID && !mav_type::NOT_A_VEHICLE.contains(&kind)
        })
    }

    /// Whether it is a gimbal, whatever it speaks.
    pub fn is_gimbal(&self) -> bool {
        self.is_gimbal_device || self.table.is_some() || self.beats_as_gimbal()
    }

    fn beats_as_gimbal(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, _)| kind == mav_type::GIMBAL)
    }

    /// A gimbal by its heartbeat and by nothing else that it says.
    pub fn only_beats_as_gimbal(&self) -> bool {
        self.beats_as_gimbal() && !self.is_gimbal_device && self.table.is_none()
    }

    /// A Gremsy that has not shown whether it is of the second generation.
    pub fn is_of_unknown_generation(&self) -> bool {
        self.is_gremsy() && !self.tells_v2_attitude
    }

    fn is_gremsy(&self) -> bool {
        self.table.is_some() || self.identity.as_ref().is_some_and(|identity| gremsy::is_vendor(&identity.vendor))
    }

    /// What it speaks, and which generation of that.
    pub fn speaks(&self) -> &'static str {
        match (self.is_gremsy(), self.is_gimbal_device) {
            // Both generations say who they are.
            (true, _) if self.tells_v2_attitude => "gremsy v2",
            (true, _) => "gremsy v1",
            (false, true) => Family::MavlinkV2.name(),
            (false, false) => Family::MavlinkV1.name(),
        }
    }

    /// What its entry in the configuration says; `None` in doubt.
    pub fn family(&self) -> Option<Family> {
        match (self.is_gremsy(), self.is_gimbal_device) {
            _ if self.is_doubtful() => None,
            (true, _) => Some(Family::Gremsy),
            (false, true) => Some(Family::MavlinkV2),
            (false, false) => Some(Family::MavlinkV1),
        }
    }

    #[cfg(test)]
    pub fn beating_as_gimbal() -> Self {
        Self { heartbeat: Some((mav_type::GIMBAL, mav_autopilot::INVALID)), ..Self::default() }
    }

    /// Nothing that it said tells a v1 gimbal from a v2 device that has not answered yet.
    pub fn is_doubtful(&self) -> bool {
        self.only_beats_as_gimbal() && !self.tells_v1_attitude
    }

    pub fn is_ground_station(&self) -> bool {
        self.heartbeat.is_some_and(|(kind, _)| kind == mav_type::GCS)
    }

    /// What it is, for people.
    fn describe(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_gimbal() {
            return write!(f, "MAVLink, no gimbal");
        }
        if self.is_doubtful() {
            return write!(f, "a gimbal that only beats: mavlink_v1, or a mavlink_v2 that is still starting");
        }
        write!(f, "{}", self.speaks())?;
        let Some(identity) = &self.identity else { return write!(f, ", which does not tell its make") };
        for name in [&identity.vendor, &identity.model, &identity.custom_name] {
            if !name.is_empty() {
                write!(f, ", {}", printable_text(name))?;
            }
        }
        match identity.firmware {
            Some([major, minor, patch, 0]) => write!(f, ", firmware {major}.{minor}.{patch}"),
            Some([major, minor, patch, development]) => write!(f, ", firmware {major}.{minor}.{patch}-{development}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Party {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.describe(f)?;
        // One that may send either version has heard our MAVLink 2 by now.
        if !self.sends_mavlink_2 {
            write!(f, "; it sends MAVLink 1 frames only, and has to understand MAVLink 2")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{DatagramFrames, MavId, encode_to_vec};

    /// Names come from devices.
    #[test]
    fn names_of_gimbals_do_not_command_the_terminal() {
        let identity = crate::gimbals::report::Identity { vendor: "a\u{202e}b".to_owned(), ..Default::default() };
        let mut party = Party { is_gimbal_device: true, sends_mavlink_2: true, ..Party::default() };
        assert_eq!(party.to_string(), "mavlink_v2, which does not tell its make");
        party.identity = Some(identity);
        assert_eq!(party.to_string(), "mavlink_v2, a\u{fffd}b");
    }

    /// What it is told is MAVLink 2, which one that speaks version 1 may not understand.
    #[test]
    fn who_sends_mavlink_1_only_is_named() {
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: mav_type::GIMBAL,
            autopilot: mav_autopilot::INVALID,
            base_mode: 0,
            system_status: 4,
            mavlink_version: 3,
        };
        let version_2 = encode_to_vec(MavId::new(1, 154), 0, &heartbeat);
        let payload = [0, 0, 0, 0, mav_type::GIMBAL, mav_autopilot::INVALID, 0, 4, 3];
        let mut version_1 = vec![0xfe, 9, 0, 1, 154, 0];
        version_1.extend(payload);
        version_1.extend([0xce, 0x06]); // its checksum
        let mut party = Party::default();
        let mut hear = |bytes: &[u8]| {
            party.handle_frame(&DatagramFrames::new(bytes).next_frame().expect("a frame"));
            party.to_string()
        };
        let beats = "a gimbal that only beats: mavlink_v1, or a mavlink_v2 that is still starting";
        let warning = "; it sends MAVLink 1 frames only, and has to understand MAVLink 2";
        assert_eq!(hear(&version_1), format!("{beats}{warning}"));
        assert_eq!(hear(&version_2), beats);
    }
}
