//! What the device does when it is commanded.

use std::time::Duration;

use super::motors::Motors;
use super::{Device, Power};
use crate::gimbals::gremsy::packet::{InputMode, reset_of, user_2};
use crate::sim::command::Command;
use crate::timestamp::Timestamp;
use crate::wire::ids::{CommandResult, command, component, message, mount_mode};

/// From a restart that was asked for until the power is back.
const RESTART: Duration = Duration::from_secs(10);

impl Device {
    pub(super) fn handle_command(&mut self, now: Timestamp, command: &Command) {
        if command.number == command::PREFLIGHT_REBOOT_SHUTDOWN {
            self.reboot_or_shutdown(now, command);
            return;
        }
        let result = match command.number {
            command::DO_MOUNT_CONFIGURE => self.mount_configure(command),
            command::REQUEST_MESSAGE => self.request_message(now, command),
            command::SET_MESSAGE_INTERVAL => self.set_interval(now, command),
            command::DO_MOUNT_CONTROL if !self.is_v2() => self.mount_control(now, command),
            command::USER_1 if !self.is_v2() => self.switch_motors(now, command),
            command::USER_2 if !self.is_v2() => self.change_mode(now, command),
            _ => CommandResult::Unsupported,
        };
        if command.is_directed() || result == CommandResult::Accepted {
            self.answers.give(now, &mut self.random, *command, result);
        }
    }

    /// 246: p4 = 1, or p3 = 1 to start again and 2 to shut down with p4 = 154.
    fn reboot_or_shutdown(&mut self, now: Timestamp, command: &Command) {
        let [_, _, action, gimbal, ..] = command.params;
        let is_for_gimbal = gimbal == f64::from(component::GIMBAL);
        let is_reboot = gimbal == 1.0 || (is_for_gimbal && action == 1.0);
        let is_shutdown = is_for_gimbal && action == 2.0;
        if !is_reboot && !is_shutdown {
            if command.is_directed() {
                self.answers.give(now, &mut self.random, *command, CommandResult::Denied);
            }
            return;
        }
        // It does not live to answer later.
        command.acknowledge(&mut self.line.outbox, CommandResult::Accepted);
        self.zero = self.plant.platform_heading(now);
        self.switch_on(now + RESTART);
        if is_shutdown {
            self.power = Power::off();
            self.motors = Motors::Off;
        }
    }

    fn mount_configure(&mut self, command: &Command) -> CommandResult {
        // A float cast saturates, and turns NaN into 0.
        match command.params[0].round() as u8 {
            mount_mode::RC_TARGETING => self.is_with_rc = true,
            mount_mode::MAVLINK_TARGETING => self.is_with_rc = false,
            _ => return CommandResult::Denied,
        }
        CommandResult::Accepted
    }

    fn request_message(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        match command.message_id() {
            message::GIMBAL_DEVICE_INFORMATION if !self.settings.is_old() => {
                self.report(now, message::GIMBAL_DEVICE_INFORMATION);
                CommandResult::Accepted
            }
            id if self.streams.contains(id) => {
                self.report(now, id);
                CommandResult::Accepted
            }
            _ => CommandResult::Unsupported,
        }
    }

    /// "known ids 27, 158, 265, 285 (v2 only) → ACCEPTED, unknown → UNSUPPORTED".
    fn set_interval(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        let id = command.message_id();
        let is_settable = match id {
            message::RAW_IMU | message::MOUNT_STATUS | message::MOUNT_ORIENTATION => true,
            message::GIMBAL_DEVICE_ATTITUDE_STATUS => self.is_v2(),
            _ => false,
        };
        if is_settable && self.streams.set_interval(now, id, command.params[1]) {
            CommandResult::Accepted
        } else {
            CommandResult::Unsupported
        }
    }

    /// Rates hold until something else is asked for; there is no dead-man's switch.
    fn mount_control(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        let [pitch, roll, yaw, _, _, input, mode] = command.params;
        if mode != f64::from(mount_mode::MAVLINK_TARGETING) {
            return CommandResult::Failed;
        }
        let is = |mode: InputMode| input == f64::from(mode.code());
        let is_speed = is(InputMode::Speed);
        // Firmware of 2020 has 0 for angles against the vehicle.
        let is_known = is_speed || is(InputMode::Angle) || (self.settings.is_old() && input == 0.0);
        if !is_known || ![pitch, roll, yaw].iter().all(|number| number.is_finite()) {
            return CommandResult::Denied;
        }
        self.is_with_rc = false;
        if !self.takes_setpoints() {
            self.ignored.rc_type += 1;
        } else if self.motors != Motors::On {
            self.ignored.motors_off += 1;
        } else if is_speed {
            self.turn([roll, pitch, yaw]);
        } else {
            self.rotate_to(now, [roll, pitch, yaw]);
        }
        CommandResult::Accepted
    }

    fn switch_motors(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        match command.params[6] {
            0.0 => self.motors_off(),
            1.0 => self.motors_on(now),
            _ => return CommandResult::Denied,
        }
        CommandResult::Accepted
    }

    fn change_mode(&mut self, now: Timestamp, command: &Command) -> CommandResult {
        let [.., reset, mode] = command.params;
        let code = |number: f64| if number.fract() == 0.0 { number as u8 } else { 0 };
        match code(mode) {
            user_2::LOCK => self.set_locked(true),
            user_2::FOLLOW => self.set_locked(false),
            user_2::RESET => match reset_of(code(reset)) {
                Some(mode) => self.reset(now, mode),
                None => return CommandResult::Denied,
            },
            _ => return CommandResult::Denied,
        }
        CommandResult::Accepted
    }
}
