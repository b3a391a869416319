//! The mounts of gimbal protocol v1: `DO_MOUNT_CONFIGURE` (204), `DO_MOUNT_CONTROL` (205), `DO_MOUNT_CONTROL_QUAT` (220),
//! and the messages `MOUNT_CONFIGURE` (156) and `MOUNT_CONTROL` (157), which nobody answers.
//!
//! Old clients send them to the autopilot, to us or to everybody; they pass the same gate as `DO_GIMBAL_MANAGER_PITCHYAW`
//! (D5). Numbers that cannot be meant as they were sent are refused by a name that says what they look like.

mod reading;
mod senders;

use super::events::{Doubt, Event};
use super::request::{Command, DemandKind, Form, MountMessage, Refusal};
use super::roi::{Datum, degrees_of_integer};
use super::{GimbalManager, ManagerOutput, Surroundings};
use crate::timestamp::Timestamp;
use crate::wire::ids::{CapFlags, CommandResult, GimbalFlags, command, message};
use crate::wire::{MavId, Target};
use reading::{Mode, Numbers};
use senders::Habits;
pub(super) use senders::MountSenders;

impl GimbalManager {
    pub(super) fn do_mount_configure(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let mode = Mode::read(command.param(1))?;
        match mode {
            Mode::Angles => self.mount_senders.change(sender, |habits| habits.inputs = reading::inputs(command)),
            // The place comes with 205.
            Mode::Place if around.vehicle.position(now).is_none() => {
                return Err(Refusal::later("no_vehicle_position"));
            }
            Mode::Place => {}
            Mode::Retract | Mode::Neutral | Mode::RadioControl | Mode::Home => {
                self.take_mode(now, sender, mode, around)?;
            }
        }
        self.mount_senders.change(sender, |habits| habits.mode = mode.number());
        Ok(())
    }

    pub(super) fn do_mount_control(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        match Mode::read(command.param(7))? {
            Mode::Angles => {
                let (habits, accepts) = (self.mount_senders.of(sender), self.rules.accept_centidegrees);
                let numbers = Numbers::of_command(command)?;
                let (numbers, sends_centidegrees) = reading::degrees(numbers, habits, accepts)?;
                let kind = self.kind_of(now, sender, command);
                self.turn_mount(now, sender, numbers, kind, around)?;
                if sends_centidegrees && !habits.sends_centidegrees {
                    self.mount_senders.change(sender, |habits| habits.sends_centidegrees = true);
                    self.tell(Event::Doubtful { who: sender, doubt: Doubt::SendsCentidegrees });
                }
                Ok(())
            }
            Mode::Place => {
                self.gate(now, sender, around)?.needs_whole()?;
                let coordinates = reading::coordinates(command)?;
                self.look_at(now, sender, coordinates, command.finite(4)?, Datum::Home, around)
            }
            mode => self.take_mode(now, sender, mode, around),
        }
    }

    pub(super) fn do_mount_control_quat(
        &mut self,
        now: Timestamp,
        sender: MavId,
        command: &Command,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        self.handle_demand(now, sender, &reading::quaternion(command)?, around)
    }

    /// 156 or 157: as 204 and 205, but for the units, and for the mode of 157, which the sender's 156 or 204 named.
    pub(super) fn handle_mount_message(
        &mut self,
        now: Timestamp,
        sender: MavId,
        target: Target,
        message: MountMessage,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let Habits { mode, .. } = self.mount_senders.of(sender);
        let command = match message {
            MountMessage::Configure { mode } => mount_command(command::DO_MOUNT_CONFIGURE, 1, mode, target),
            MountMessage::Control { .. } => mount_command(command::DO_MOUNT_CONTROL, 7, mode, target),
        };
        if !self.concerns_us(sender, &command, around)? {
            return Ok(());
        }
        let voice = self.gate(now, sender, around)?;
        let MountMessage::Control { inputs } = message else {
            return self.do_mount_configure(now, sender, &command, around);
        };
        match Mode::read(command.param(7))? {
            Mode::Angles => {
                let numbers = Numbers::of_message(inputs);
                if numbers.are_beyond_angles(self.mount_senders.of(sender).inputs) {
                    let is_place = numbers.are_a_place();
                    return Err(Refusal::denied(if is_place { "looks_like_a_place" } else { "angle_out_of_range" }));
                }
                self.turn_mount(now, sender, numbers, DemandKind::Streamed, around)
            }
            Mode::Place => {
                voice.needs_whole()?;
                let [latitude, longitude, altitude_cm] = inputs;
                let coordinates = [Some(latitude), Some(longitude)].map(degrees_of_integer);
                self.look_at(now, sender, coordinates, Some(altitude_cm as f32 / 100.0), Datum::Home, around)
            }
            mode => self.take_mode(now, sender, mode, around),
        }
    }

    fn turn_mount(
        &mut self,
        now: Timestamp,
        sender: MavId,
        numbers: Numbers,
        kind: DemandKind,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let inputs = self.mount_senders.of(sender).inputs;
        self.handle_demand(now, sender, &numbers.demand(inputs, kind)?, around)?;
        if numbers.have_a_yaw_like_a_heading(inputs) {
            self.tell(Event::Doubtful { who: sender, doubt: Doubt::YawLikeAHeading });
        }
        Ok(())
    }

    /// A mode that needs no numbers.
    fn take_mode(
        &mut self,
        now: Timestamp,
        sender: MavId,
        mode: Mode,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let flags = match mode {
            Mode::Retract => GimbalFlags::RETRACT,
            Mode::Neutral => GimbalFlags::NEUTRAL,
            Mode::RadioControl => {
                let capabilities = self.steerable()?;
                if !capabilities.flags.contains(CapFlags::HAS_RC_INPUTS) {
                    let reason = capabilities.why_no_radio_control("mount_mode_rc_targeting_unsupported");
                    return Err(Refusal { result: CommandResult::Unsupported, reason });
                }
                GimbalFlags::RC_EXCLUSIVE
            }
            Mode::Home => return self.look_home(now, sender, around),
            // These come with numbers.
            Mode::Angles | Mode::Place => return Ok(()),
        };
        self.handle_demand(now, sender, &reading::pose(flags), around)
    }

    /// Where home is told by the autopilot when it is set, and to who asks.
    fn look_home(&mut self, now: Timestamp, sender: MavId, around: Surroundings<'_>) -> Result<(), Refusal> {
        self.gate(now, sender, around)?.needs_whole()?;
        let Some(home) = around.vehicle.home_position() else {
            self.outputs.push_back(ManagerOutput::AskAutopilot { message_id: message::HOME_POSITION });
            return Err(Refusal::later("no_home_position"));
        };
        let coordinates = [Some(home.latitude_deg), Some(home.longitude_deg)];
        self.look_at(now, sender, coordinates, Some(home.altitude_m as f32), Datum::MeanSeaLevel, around)
    }
}

/// The command that a message stands for, with its mode in parameter `at`.
fn mount_command(number: u16, at: usize, mode: u8, target: Target) -> Command {
    let mut params = [f32::NAN; 7];
    params[at - 1] = f32::from(mode);
    Command { number, target, params, form: Form::Long, confirmation: 0 }
}
