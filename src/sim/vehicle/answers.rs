//! What a simulated autopilot answers to those who ask.

use super::telemetry::{
    BATTERY_STATUS, EKF_STATUS_REPORT, EXTENDED_SYS_STATE, GPS_RAW_INT, LOCAL_POSITION_NED, MISSION_CURRENT,
    PROTOCOL_VERSION, RC_CHANNELS, VFR_HUD,
};
use super::{Autopilot, Vehicle};
use crate::sim::command::Command;
use crate::timestamp::Timestamp;
use crate::wire::dialect::{
    AUTOPILOT_VERSION_REQUEST_DATA, FILE_TRANSFER_PROTOCOL_DATA, MESSAGE_INTERVAL_DATA, MISSION_ACK_DATA,
    MISSION_CLEAR_ALL_DATA, MISSION_COUNT_DATA, MISSION_REQUEST_LIST_DATA, PING_DATA, REQUEST_DATA_STREAM_DATA,
    SET_MODE_DATA, TIMESYNC_DATA,
};
use crate::wire::ids::{CommandResult, command, message};
use crate::wire::{Frame, MavId};

/// `MAV_CMD` numbers that only an autopilot carries out.
const DO_SET_MODE: u16 = 176;
const COMPONENT_ARM_DISARM: u16 = 400;

/// `MAV_MISSION_RESULT`.
const MISSION_ACCEPTED: u8 = 0;
const MISSION_UNSUPPORTED: u8 = 3;

/// Places in the payload of `FILE_TRANSFER_PROTOCOL`, opcodes, and an error.
mod ftp {
    pub const SEQUENCE: usize = 0;
    pub const OPCODE: usize = 3;
    pub const SIZE: usize = 4;
    pub const REQUEST_OPCODE: usize = 5;
    pub const DATA: usize = 12;

    pub const TERMINATE_SESSION: u8 = 1;
    pub const RESET_SESSIONS: u8 = 2;
    pub const ACK: u8 = 128;
    pub const NAK: u8 = 129;

    pub const FILE_NOT_FOUND: u8 = 10;
}

impl Vehicle {
    /// Takes a frame that addresses this autopilot.
    pub(super) fn handle_request(&mut self, now: Timestamp, frame: &Frame<'_>) {
        let sender = frame.source();
        if let Some(command) = Command::read(frame) {
            self.handle_command(now, &command);
        } else if self.parameters.handle_frame(now, frame, &mut self.line.outbox) {
            // It has answered.
        } else if let Some(request) = frame.decode() {
            self.handle_mission_request_list(sender, &request);
        } else if let Some(clear) = frame.decode::<MISSION_CLEAR_ALL_DATA>() {
            self.acknowledge_mission(sender, MISSION_ACCEPTED, clear.mission_type);
        } else if let Some(count) = frame.decode::<MISSION_COUNT_DATA>() {
            // An empty mission is as good as none; there is no place to keep another.
            let result = if count.count == 0 { MISSION_ACCEPTED } else { MISSION_UNSUPPORTED };
            self.acknowledge_mission(sender, result, count.mission_type);
        } else if let Some(request) = frame.decode() {
            self.handle_file_transfer(sender, &request);
        } else if let Some(timesync) = frame.decode() {
            self.handle_timesync(now, sender, &timesync);
        } else if let Some(ping) = frame.decode() {
            self.handle_ping(sender, &ping);
        } else if let Some(demand) = frame.decode() {
            self.set_pitchyaw_for_mount(&demand);
        } else if let Some(request) = frame.decode() {
            self.handle_request_data_stream(now, &request);
        } else if let Some(mode) = frame.decode::<SET_MODE_DATA>() {
            self.custom_mode = mode.custom_mode;
            self.report(now, message::HEARTBEAT);
        } else if frame.decode::<AUTOPILOT_VERSION_REQUEST_DATA>().is_some() {
            self.report(now, message::AUTOPILOT_VERSION);
        }
    }

    fn handle_command(&mut self, now: Timestamp, command: &Command) {
        let driven = self.command_mount(now, command).or_else(|| self.command_client(now, command));
        if let Some(result) = driven {
            command.acknowledge(&mut self.line.outbox, result);
            return;
        }
        let asks_for_message = matches!(command.number, command::REQUEST_MESSAGE | command::SET_MESSAGE_INTERVAL);
        if asks_for_message && self.ignores(command.message_id()) {
            return;
        }
        let result = match command.number {
            command::REQUEST_MESSAGE => return self.handle_request_message(now, command, command.message_id()),
            command::REQUEST_AUTOPILOT_CAPABILITIES => {
                return self.handle_request_message(now, command, message::AUTOPILOT_VERSION);
            }
            command::REQUEST_PROTOCOL_VERSION => return self.handle_request_message(now, command, PROTOCOL_VERSION),
            command::SET_MESSAGE_INTERVAL => self.handle_set_message_interval(now, command),
            command::GET_MESSAGE_INTERVAL => {
                command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
                let id = command.message_id();
                let interval_us = self.streams.interval_us(id);
                self.line.outbox.send(&MESSAGE_INTERVAL_DATA { interval_us, message_id: id as u16 });
                return;
            }
            COMPONENT_ARM_DISARM => {
                self.is_armed = command.params[0] == 1.0;
                CommandResult::Accepted
            }
            DO_SET_MODE => {
                self.custom_mode = match self.settings.autopilot {
                    // Main mode and sub mode have a byte each.
                    Autopilot::Px4 => (command.params[1] as u32) << 16 | (command.params[2] as u32) << 24,
                    Autopilot::ArduPilot => command.params[1] as u32,
                };
                CommandResult::Accepted
            }
            _ if command.is_directed() => CommandResult::Unsupported,
            _ => return,
        };
        command.acknowledge(&mut self.line.outbox, result);
        if matches!(command.number, COMPONENT_ARM_DISARM | DO_SET_MODE) {
            self.report(now, message::HEARTBEAT);
        }
    }

    fn handle_request_message(&mut self, now: Timestamp, command: &Command, id: u32) {
        let is_known = self.streams.contains(id) || matches!(id, message::AUTOPILOT_VERSION | PROTOCOL_VERSION);
        if is_known {
            command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
            self.report(now, id);
        } else if self.is_mount_message(id) || self.promises(id) {
            // Without a mount ArduPilot accepts, and sends nothing (observed on its simulator).
            command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
        } else if command.is_directed() {
            let result = match self.settings.autopilot {
                Autopilot::Px4 => CommandResult::Denied,
                Autopilot::ArduPilot => CommandResult::Failed,
            };
            command.acknowledge(&mut self.line.outbox, result);
        }
    }

    fn handle_set_message_interval(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        let id = command.message_id();
        if self.is_mount_message(id) || self.promises(id) || self.streams.set_interval(now, id, command.params[1]) {
            CommandResult::Accepted
        } else {
            CommandResult::Denied
        }
    }

    /// Messages that ArduPilot knows how to send once it has a mount, which it has not.
    fn is_mount_message(&self, id: u32) -> bool {
        let known = [
            message::GIMBAL_MANAGER_INFORMATION,
            message::GIMBAL_MANAGER_STATUS,
            message::GIMBAL_DEVICE_ATTITUDE_STATUS,
        ];
        self.settings.autopilot == Autopilot::ArduPilot && self.mount.is_none() && known.contains(&id)
    }

    fn handle_mission_request_list(&mut self, sender: MavId, request: &MISSION_REQUEST_LIST_DATA) {
        self.line.outbox.send(&MISSION_COUNT_DATA {
            count: 0,
            target_system: sender.system,
            target_component: sender.component,
            mission_type: request.mission_type,
            opaque_id: 0,
        });
    }

    fn acknowledge_mission(&mut self, sender: MavId, result: u8, mission_type: u8) {
        self.line.outbox.send(&MISSION_ACK_DATA {
            target_system: sender.system,
            target_component: sender.component,
            mavtype: result,
            mission_type,
            opaque_id: 0,
        });
    }

    /// There is no file; sessions, which nobody has, can be closed.
    fn handle_file_transfer(&mut self, sender: MavId, request: &FILE_TRANSFER_PROTOCOL_DATA) {
        let mut payload = [0; 251];
        payload[..ftp::DATA].copy_from_slice(&request.payload[..ftp::DATA]);
        let sequence = u16::from_le_bytes([request.payload[ftp::SEQUENCE], request.payload[ftp::SEQUENCE + 1]]);
        payload[..2].copy_from_slice(&sequence.wrapping_add(1).to_le_bytes());
        let opcode = request.payload[ftp::OPCODE];
        payload[ftp::REQUEST_OPCODE] = opcode;
        if matches!(opcode, ftp::TERMINATE_SESSION | ftp::RESET_SESSIONS) {
            payload[ftp::OPCODE] = ftp::ACK;
            payload[ftp::SIZE] = 0;
        } else {
            payload[ftp::OPCODE] = ftp::NAK;
            payload[ftp::SIZE] = 1;
            payload[ftp::DATA] = ftp::FILE_NOT_FOUND;
        }
        self.line.outbox.send(&FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: sender.system,
            target_component: sender.component,
            payload,
        });
    }

    fn handle_timesync(&mut self, now: Timestamp, sender: MavId, request: &TIMESYNC_DATA) {
        if request.tc1 != 0 {
            // An answer, and it did not ask.
            return;
        }
        let nanoseconds = i64::try_from(self.clock(now).as_micros() * 1_000).unwrap_or(i64::MAX);
        self.line.outbox.send(&TIMESYNC_DATA {
            tc1: nanoseconds,
            ts1: request.ts1,
            target_system: sender.system,
            target_component: sender.component,
        });
    }

    fn handle_ping(&mut self, sender: MavId, ping: &PING_DATA) {
        if ping.target_system != 0 {
            // "If the target is not zero this is an answer."
            return;
        }
        self.line.outbox.send(&PING_DATA {
            time_usec: ping.time_usec,
            seq: ping.seq,
            target_system: sender.system,
            target_component: sender.component,
        });
    }

    /// ArduPilot's groups of streams; PX4 does not listen to it.
    fn handle_request_data_stream(&mut self, now: Timestamp, request: &REQUEST_DATA_STREAM_DATA) {
        if self.settings.autopilot == Autopilot::Px4 {
            return;
        }
        let interval_us = if request.start_stop == 1 && request.req_message_rate > 0 {
            1e6 / f64::from(request.req_message_rate)
        } else {
            -1.0
        };
        let groups: [(u8, &[u32]); 6] = [
            (2, &[message::SYS_STATUS, GPS_RAW_INT, MISSION_CURRENT]),
            (3, &[RC_CHANNELS]),
            (6, &[LOCAL_POSITION_NED, message::GLOBAL_POSITION_INT]),
            (10, &[message::ATTITUDE, message::ATTITUDE_QUATERNION]),
            (11, &[VFR_HUD]),
            (12, &[message::SYSTEM_TIME, BATTERY_STATUS, EKF_STATUS_REPORT, EXTENDED_SYS_STATE]),
        ];
        for (group, ids) in groups {
            if request.req_stream_id == 0 || request.req_stream_id == group {
                for id in ids {
                    self.streams.set_interval(now, *id, interval_us);
                }
            }
        }
    }
}
