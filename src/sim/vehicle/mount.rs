//! A simulated ArduPilot's mount: it drives a MAVLink gimbal device as with `MNT1_TYPE` 6.
//!
//! As observed on ArduPilot's own simulator: it waits for the heartbeat of a gimbal, asks that for 283 once a second, and
//! from then on sends 286 and 284 fifty times a second for ever, changed or not. It is also a gimbal manager, which obeys
//! everybody and calls the gimbal 1.

use std::time::Duration;

use super::{HOME, Vehicle};
use crate::geometry::{Angle, AngularRate, Attitude, GimbalAngles, Position, VehicleFrame};
use crate::sim::command::Command;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    COMMAND_LONG_DATA, CharArray, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA,
    GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, STATUSTEXT_DATA,
};
use crate::wire::ids::{
    CapFlags, CommandResult, GimbalFlags, command, component, mav_type, message, mount_mode, severity,
};
use crate::wire::{Frame, MavId};

/// It looks for a gimbal from so long after its start …
const SEARCH_FROM: Duration = Duration::from_secs(10);
/// … and to here, once it is armed.
const SEARCH_UNTIL: Duration = Duration::from_secs(60);

const ASK_EVERY: Duration = Duration::from_secs(1);

/// Of 284, and of 286 once there is a gimbal.
const STREAM_EVERY: Duration = Duration::from_millis(20);

/// The number of the gimbal in what it says as a manager.
const INSTANCE: u8 = 1;

/// What it sends as a manager, on request.
pub(super) const REPORTS: [u32; 3] =
    [message::GIMBAL_MANAGER_INFORMATION, message::GIMBAL_MANAGER_STATUS, message::GIMBAL_DEVICE_ATTITUDE_STATUS];

/// Where it looks when nobody has asked for anything, in degrees.
const DEFAULT_PITCH: f64 = -30.0;

/// Where it tells the gimbal to look.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    Angles { pitch: Angle, yaw: Angle, locked: bool },
    Rates { pitch: AngularRate, yaw: AngularRate, locked: bool },
    Place(Position),
}

const DEFAULT_AIM: Aim = Aim::Angles { pitch: Angle::from_degrees(DEFAULT_PITCH), yaw: Angle::ZERO, locked: false };

/// The mount and what it knows of its gimbal.
#[derive(Debug)]
pub(super) struct Mount {
    device: Option<MavId>,
    next_request: Option<Timestamp>,
    information: Option<GIMBAL_DEVICE_INFORMATION_DATA>,
    attitude: Option<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>,
    aim: Aim,
    /// Who said last that it is in control; nobody minds.
    owner: MavId,
}

impl Mount {
    pub fn new() -> Self {
        Self {
            device: None,
            next_request: None,
            information: None,
            attitude: None,
            aim: DEFAULT_AIM,
            owner: MavId::new(0, 0),
        }
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.next_request
    }
}

impl Vehicle {
    /// What a gimbal device says.
    pub(super) fn hear_for_mount(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let is_searching = self.clock(now) >= Timestamp::ZERO + SEARCH_FROM
            && (!self.is_armed || self.clock(now) <= Timestamp::ZERO + SEARCH_UNTIL);
        let system = self.id().system;
        let Some(mount) = &mut self.mount else { return };
        let source = frame.source();
        if source != MavId::new(system, component::GIMBAL) {
            return;
        }
        match frame.message_id() {
            message::HEARTBEAT if mount.device.is_none() && is_searching => {
                let is_gimbal = frame.decode::<HEARTBEAT_DATA>().is_some_and(|beat| beat.mavtype == mav_type::GIMBAL);
                if is_gimbal {
                    mount.device = Some(source);
                    mount.next_request = Some(now);
                }
            }
            message::GIMBAL_DEVICE_INFORMATION if mount.device.is_some() && mount.information.is_none() => {
                let Some(information) = frame.decode::<GIMBAL_DEVICE_INFORMATION_DATA>() else { return };
                let name = |text: &CharArray<32>| text.to_str().unwrap_or("").to_owned();
                let [major, minor, patch, _] = information.firmware_version.to_le_bytes();
                let (vendor, model) = (name(&information.vendor_name), name(&information.model_name));
                mount.next_request = None;
                mount.information = Some(information);
                self.say(&format!("Mount: {vendor} {model} fw:{major}.{minor}.{patch}"));
                self.streams.add(message::GIMBAL_DEVICE_SET_ATTITUDE, Some(STREAM_EVERY), now);
                self.streams.set_usual(now, message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, STREAM_EVERY);
            }
            // Taken from whom it comes, of whatever frame.
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => mount.attitude = frame.decode(),
            _ => {}
        }
    }

    /// Asks for 283 once a second while it may still look for a gimbal.
    pub(super) fn ask_for_mount(&mut self, now: Timestamp) {
        let gave_up = self.is_armed && self.clock(now) > Timestamp::ZERO + SEARCH_UNTIL;
        let Some(mount) = &mut self.mount else { return };
        let (Some(device), Some(due)) = (mount.device, mount.next_request) else { return };
        if due > now {
            return;
        }
        mount.next_request = (!gave_up).then(|| now + ASK_EVERY);
        if gave_up {
            return;
        }
        // Written out: what an autopilot says is not made by what the daemon says it with.
        self.line.outbox.send(&COMMAND_LONG_DATA {
            param1: message::GIMBAL_DEVICE_INFORMATION as f32,
            param2: 0.0,
            param3: 0.0,
            param4: 0.0,
            param5: 0.0,
            param6: 0.0,
            param7: 0.0,
            command: command::REQUEST_MESSAGE,
            target_system: device.system,
            target_component: device.component,
            confirmation: 0,
        });
    }

    /// Obeys whoever asks; `None` for what is no business of a mount.
    pub(super) fn command_mount(&mut self, now: Timestamp, asked: &Command) -> Option<CommandResult> {
        self.mount.as_ref()?;
        let [p1, p2, p3, p4, p5, p6, p7] = asked.params;
        let locked = |flags: f64| flags as u32 & u32::from(GimbalFlags::YAW_LOCK.bits()) != 0;
        let aim = match asked.number {
            command::REQUEST_MESSAGE
                if matches!(
                    asked.message_id(),
                    message::GIMBAL_DEVICE_INFORMATION | message::GIMBAL_DEVICE_SET_ATTITUDE
                ) =>
            {
                return Some(CommandResult::Failed);
            }
            command::SET_MESSAGE_INTERVAL if asked.message_id() == message::GIMBAL_DEVICE_SET_ATTITUDE => {
                self.say("No ap_message for mavlink id (284)");
                return Some(CommandResult::Denied);
            }
            // Both angles or both rates, or nothing is done.
            command::DO_GIMBAL_MANAGER_PITCHYAW if p1.is_finite() && p2.is_finite() => {
                Aim::Angles { pitch: Angle::from_degrees(p1), yaw: Angle::from_degrees(p2), locked: locked(p5) }
            }
            command::DO_GIMBAL_MANAGER_PITCHYAW if p3.is_finite() && p4.is_finite() => Aim::Rates {
                pitch: AngularRate::from_degrees_per_second(p3),
                yaw: AngularRate::from_degrees_per_second(p4),
                locked: locked(p5),
            },
            command::DO_GIMBAL_MANAGER_PITCHYAW => return Some(CommandResult::Failed),
            command::DO_GIMBAL_MANAGER_CONFIGURE => {
                self.note_owner(now, asked);
                return Some(CommandResult::Accepted);
            }
            command::DO_MOUNT_CONTROL if p7 == f64::from(mount_mode::MAVLINK_TARGETING) => {
                Aim::Angles { pitch: Angle::from_degrees(p1), yaw: Angle::from_degrees(p3), locked: false }
            }
            // The altitude of a COMMAND_LONG, which names no frame, counts from home.
            command::DO_SET_ROI_LOCATION => {
                let altitude_m = HOME.altitude_m + p7;
                Aim::Place(match asked.is_int {
                    true => Position { latitude_deg: p5 / 1e7, longitude_deg: p6 / 1e7, altitude_m },
                    false => Position { latitude_deg: p5, longitude_deg: p6, altitude_m },
                })
            }
            command::DO_SET_ROI_NONE => DEFAULT_AIM,
            _ => return None,
        };
        if let Some(mount) = &mut self.mount {
            mount.aim = aim;
        }
        Some(CommandResult::Accepted)
    }

    /// 287, from anybody.
    pub(super) fn set_pitchyaw_for_mount(&mut self, demand: &GIMBAL_MANAGER_SET_PITCHYAW_DATA) {
        let Some(mount) = &mut self.mount else { return };
        let locked = demand.flags & u32::from(GimbalFlags::YAW_LOCK.bits()) != 0;
        let [pitch, yaw, pitch_rate, yaw_rate] =
            [demand.pitch, demand.yaw, demand.pitch_rate, demand.yaw_rate].map(f64::from);
        // Angles or rates; both at once are dropped.
        if pitch.is_finite() && yaw.is_finite() && pitch_rate.is_nan() && yaw_rate.is_nan() {
            mount.aim = Aim::Angles { pitch: Angle::from_radians(pitch), yaw: Angle::from_radians(yaw), locked };
        } else if pitch.is_nan() && yaw.is_nan() && pitch_rate.is_finite() && yaw_rate.is_finite() {
            let rate = AngularRate::from_radians_per_second;
            mount.aim = Aim::Rates { pitch: rate(pitch_rate), yaw: rate(yaw_rate), locked };
        }
    }

    /// Who is in control is recorded, told, and of no consequence.
    fn note_owner(&mut self, now: Timestamp, asked: &Command) {
        let Some(mount) = &mut self.mount else { return };
        let [system, component, ..] = asked.params;
        let owner = match system {
            -1.0 => mount.owner,
            -2.0 => asked.sender,
            -3.0 if mount.owner == asked.sender => MavId::new(0, 0),
            -3.0 => mount.owner,
            _ => MavId::new(system as u8, component as u8),
        };
        let is_changed = std::mem::replace(&mut mount.owner, owner) != owner;
        if is_changed {
            self.report(now, message::GIMBAL_MANAGER_STATUS);
        }
    }

    /// Sends what a mount sends; false when there is none, or nothing to tell yet.
    pub(super) fn report_of_mount(&mut self, now: Timestamp, id: u32) -> bool {
        let time_boot_ms = self.clock(now).boot_ms();
        let motion = self.motion(now);
        let Some(mount) = &self.mount else { return false };
        let out = &mut self.line.outbox;
        match (id, &mount.information, &mount.attitude) {
            (message::GIMBAL_DEVICE_SET_ATTITUDE, Some(_), _) => {
                let Some(device) = mount.device else { return false };
                out.send(&setpoint(mount.aim, motion.position, device));
            }
            (message::GIMBAL_MANAGER_INFORMATION, Some(device), _) => out.send(&GIMBAL_MANAGER_INFORMATION_DATA {
                time_boot_ms,
                cap_flags: capabilities().bits(),
                roll_min: device.roll_min,
                roll_max: device.roll_max,
                pitch_min: device.pitch_min,
                pitch_max: device.pitch_max,
                yaw_min: device.yaw_min,
                yaw_max: device.yaw_max,
                gimbal_device_id: INSTANCE,
            }),
            (message::GIMBAL_MANAGER_STATUS, ..) => out.send(&GIMBAL_MANAGER_STATUS_DATA {
                time_boot_ms,
                flags: 0,
                gimbal_device_id: INSTANCE,
                primary_control_sysid: mount.owner.system,
                primary_control_compid: mount.owner.component,
                secondary_control_sysid: 0,
                secondary_control_compid: 0,
            }),
            // What the device says under another label: the numbers are not turned into that frame.
            (message::GIMBAL_DEVICE_ATTITUDE_STATUS, _, Some(told)) => {
                out.send(&GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
                    time_boot_ms,
                    angular_velocity_x: f32::NAN,
                    angular_velocity_y: f32::NAN,
                    angular_velocity_z: f32::NAN,
                    failure_flags: 0,
                    flags: (GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | GimbalFlags::YAW_IN_VEHICLE_FRAME)
                        .bits(),
                    delta_yaw: f32::NAN,
                    delta_yaw_velocity: f32::NAN,
                    gimbal_device_id: INSTANCE,
                    ..told.clone()
                });
            }
            _ => return false,
        }
        true
    }

    fn say(&mut self, text: &str) {
        self.line.outbox.send(&STATUSTEXT_DATA {
            severity: severity::INFO,
            text: CharArray::from(text),
            id: 0,
            chunk_seq: 0,
        });
    }
}

fn capabilities() -> CapFlags {
    CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_PITCH_AXIS
        | CapFlags::HAS_PITCH_LOCK
        | CapFlags::HAS_YAW_AXIS
        | CapFlags::HAS_YAW_FOLLOW
        | CapFlags::HAS_YAW_LOCK
        | CapFlags::CAN_POINT_LOCATION_LOCAL
        | CapFlags::CAN_POINT_LOCATION_GLOBAL
}

/// 284: no frame bits; all lock bits or none.
fn setpoint(aim: Aim, position: Position, device: MavId) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    let all = (GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | GimbalFlags::YAW_LOCK).bits();
    let flags = |locked| if locked { all } else { 0 };
    let towards = |pitch, yaw| {
        Attitude::<VehicleFrame>::from_gimbal_angles(GimbalAngles { roll: Angle::ZERO, pitch, yaw }).to_wxyz()
    };
    let none = [f32::NAN; 3];
    let (q, [x, y, z], flags) = match aim {
        Aim::Angles { pitch, yaw, locked } => (towards(pitch, yaw), none, flags(locked)),
        Aim::Rates { pitch, yaw, locked } => {
            let rates = [0.0, pitch.radians_per_second() as f32, yaw.radians_per_second() as f32];
            ([f32::NAN; 4], rates, flags(locked))
        }
        Aim::Place(place) => match position.aim_at(place) {
            Some(aim) => (towards(aim.elevation, aim.azimuth.unwrap_or(Angle::ZERO)), none, all),
            None => ([f32::NAN; 4], none, all),
        },
    };
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q,
        angular_velocity_x: x,
        angular_velocity_y: y,
        angular_velocity_z: z,
        flags,
        target_system: device.system,
        target_component: device.component,
    }
}
