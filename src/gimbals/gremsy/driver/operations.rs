//! What is asked of a Gremsy by its name: which command, mode or parameter that is, and whether it was done.

use super::mode_change::ModeChange;
use super::streams;
use super::writes;
use super::{Generation, GremsyDriver, HandOver};
use crate::geometry::{Angle, Attitude, EarthFrame, GimbalAngles, VehicleFrame, Yaw};
use crate::gimbals::driver::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::gimbals::gremsy::modes::ControlMode;
use crate::gimbals::gremsy::packet::{self, RebootAction};
use crate::gimbals::gremsy::parameters::{Parameter, ParameterTable};
use crate::gimbals::gremsy::status::SystemStatus;
use crate::gimbals::operation::{
    Motors, Operation, OperationError, OperationId, OperationResult, ResetMode, Restart, Stream, StreamRate, YawMode,
};
use crate::gimbals::report::Readiness;
use crate::gimbals::setpoint::{Pointing, RadioControl, Setpoint, Stabilised};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::COMMAND_LONG_DATA;
use crate::wire::ids::{CommandResult, GimbalFlags, message};

/// So many commands are waited for at once.
const CAPACITY: usize = 16;

/// A gimbal that may be turning has stopped by then, with two looks at it beyond the second in which it is watched, or does not
/// hear.
const STOPS_WITHIN: std::time::Duration = std::time::Duration::from_secs(3);

/// Motors that are switched on take 3 s, and the status comes once a second.
pub const MOTORS_SHOW_WITHIN: std::time::Duration = std::time::Duration::from_secs(5);
const MODE_SHOWS_WITHIN: std::time::Duration = std::time::Duration::from_secs(3);

/// A gimbal that was told to start again or to switch itself off, did not answer, and says nothing any more has done it:
/// otherwise it tells where it looks twenty times a second.
const SILENT_WHEN_OFF: std::time::Duration = std::time::Duration::from_millis(300);

/// A setpoint without an answer is said so often, 100 ms apart, when nobody repeats it.
const POINT_SENDS: u8 = 3;
const POINT_EVERY: std::time::Duration = std::time::Duration::from_millis(100);

/// Those that are not done yet.
#[derive(Debug, Default)]
pub struct Operations {
    pending: Vec<Pending>,
    pointing: Option<RepeatedPoint>,
    /// Those that wait until it has stopped.
    held: Vec<Held>,
}

#[derive(Clone, Debug)]
struct Held {
    id: OperationId,
    operation: Operation,
    until: Timestamp,
}

#[derive(Clone, Debug)]
struct Pending {
    id: OperationId,
    stage: Stage,
    goal: Goal,
}

#[derive(Clone, Debug, PartialEq)]
enum Stage {
    /// For the answer to this.
    Answer { command: COMMAND_LONG_DATA, since: Timestamp },
    /// For a status that shows it.
    Shown { until: Timestamp },
}

/// What it is about, beyond the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    Answer,
    Motors { on: bool },
    Mode(YawMode),
    Rate(Stream, StreamRate),
    Restart { comes_back: bool },
}

/// A direction of the driver's own that is said a few times.
#[derive(Clone, Copy, Debug)]
struct RepeatedPoint {
    id: OperationId,
    setpoint: Setpoint,
    left: u8,
    next: Timestamp,
}

impl Operations {
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        let shown = self.pending.iter().filter_map(|pending| match pending.stage {
            Stage::Shown { until } => Some(until),
            Stage::Answer { .. } => None,
        });
        let held = self.held.iter().map(|held| held.until);
        shown.chain(self.pointing.map(|pointing| pointing.next)).chain(held).min()
    }

    /// Whether it was asked to start again or to switch itself off, and that is not settled.
    pub fn restarts(&self) -> bool {
        let is_waited_for = |pending: &Pending| matches!(pending.goal, Goal::Restart { .. });
        self.held.iter().any(|held| matches!(held.operation, Operation::Restart(_)))
            || self.pending.iter().any(is_waited_for)
    }

    /// Gives all of them up.
    pub fn clear(&mut self) -> Vec<OperationId> {
        let pointing = self.pointing.take().map(|pointing| pointing.id);
        let held = self.held.drain(..).map(|held| held.id);
        self.pending.drain(..).map(|pending| pending.id).chain(pointing).chain(held).collect()
    }
}

impl GremsyDriver {
    pub(super) fn operate(&mut self, now: Timestamp, id: OperationId, operation: &Operation) {
        let Some(device) = self.device.filter(|_| self.is_alive) else {
            return self.operated(id, Err(OperationError::NotThere));
        };
        if operation.ends_demand() {
            self.drop_demand(now, device);
            if self.may_be_turning() {
                if self.operations.held.len() >= CAPACITY {
                    return self.operated(id, Err(OperationError::Busy));
                }
                let (operation, until) = (operation.clone(), now + STOPS_WITHIN);
                return self.operations.held.push(Held { id, operation, until });
            }
        }
        self.begin_operation(now, id, device, operation);
    }

    /// Goes on with what waited for it to stop. What would switch its motors off is done in any case.
    fn release_held(&mut self, now: Timestamp, device: MavId) {
        let is_stopped = !self.may_be_turning();
        let (due, rest) = self.operations.held.drain(..).partition(|held| is_stopped || held.until <= now);
        self.operations.held = rest;
        for Held { id, operation, .. } in due {
            if is_stopped || matches!(operation, Operation::Motors(_) | Operation::Restart(_)) {
                self.begin_operation(now, id, device, &operation);
            } else {
                // Only one that speaks v1 answers what it is told.
                let is_deaf = self.search.decided() == Some(Generation::V1) && self.mount.leaves_unanswered();
                self.operated(id, Err(if is_deaf { OperationError::NoAnswer } else { OperationError::StillTurning }));
            }
        }
    }

    fn begin_operation(&mut self, now: Timestamp, id: OperationId, device: MavId, operation: &Operation) {
        let moves = matches!(
            operation,
            Operation::SetYawMode(_) | Operation::Mapping | Operation::Reset(_) | Operation::RadioControl
        );
        // One that is off hears nothing, and one that starts would do it when it has started.
        if self.off.is_some() || moves && self.readiness() != Readiness::Ready {
            return self.operated(id, Err(OperationError::NotReady));
        }
        match operation {
            Operation::RefreshParameters => self.parameters.refresh_for(now, id),
            Operation::SetParameter { name, value } => self.set_parameters(now, id, &[(name, *value)]),
            Operation::RequestInformation => {
                let command = packet::request_message(device, message::GIMBAL_DEVICE_INFORMATION);
                self.ask(now, id, command, Goal::Answer);
            }
            Operation::SetStreamRate { stream, rate } => match rate {
                StreamRate::Hertz(0 | 201..) => {
                    self.operated(id, Err(OperationError::Invalid("a rate is 1 to 200 times a second".to_owned())));
                }
                _ => self.ask(now, id, streams::command(device, *stream, *rate), Goal::Rate(*stream, *rate)),
            },
            Operation::RadioControl => {
                self.mount.forget_mode();
                self.hand_over = HandOver::Asked;
                self.ask(now, id, packet::hand_to_rc(device), Goal::Answer);
            }
            Operation::Restart(Restart::Reboot) => {
                self.ask(now, id, packet::reboot(device), Goal::Restart { comes_back: true });
            }
            Operation::Restart(Restart::Shutdown) => {
                let command = packet::reboot_or_shutdown(device, RebootAction::Shutdown);
                self.ask(now, id, command, Goal::Restart { comes_back: false });
            }
            Operation::Motors(_) | Operation::SetYawMode(_) | Operation::Mapping | Operation::Reset(_) => {
                match self.search.decided() {
                    None => self.operated(id, Err(OperationError::NotReady)),
                    Some(Generation::V1) => self.operate_v1(now, id, device, operation),
                    Some(Generation::V2) => self.operate_v2(now, id, operation),
                }
            }
            _ => self.write_settings(now, id, operation),
        }
        self.drain_parameters();
    }

    fn operate_v1(&mut self, now: Timestamp, id: OperationId, device: MavId, operation: &Operation) {
        let (command, goal) = match operation {
            Operation::Motors(motors) => {
                let on = *motors == Motors::On;
                self.motors_asked = on.then_some(now);
                (packet::set_motors(device, on), Goal::Motors { on })
            }
            Operation::SetYawMode(YawMode::Lock) => (packet::lock(device), Goal::Mode(YawMode::Lock)),
            Operation::SetYawMode(YawMode::Follow) => (packet::follow(device), Goal::Mode(YawMode::Follow)),
            Operation::Mapping => (packet::reset(device, ResetMode::PitchMapping), Goal::Answer),
            Operation::Reset(mode) => (packet::reset(device, *mode), Goal::Answer),
            _ => return self.operated(id, Err(OperationError::Unsupported)),
        };
        self.ask(now, id, command, goal);
    }

    fn operate_v2(&mut self, now: Timestamp, id: OperationId, operation: &Operation) {
        let mode = match operation {
            Operation::Motors(Motors::Off) => ControlMode::Off,
            Operation::Motors(Motors::On) => ControlMode::Reset,
            Operation::SetYawMode(YawMode::Lock) => ControlMode::Lock,
            Operation::SetYawMode(YawMode::Follow) => ControlMode::Follow,
            Operation::Mapping => ControlMode::Mapping,
            Operation::Reset(mode) => return self.point_by_reset(now, id, *mode),
            _ => return self.operated(id, Err(OperationError::Unsupported)),
        };
        if self.mode_change.is_some_and(|change| change.asker().is_some()) {
            return self.operated(id, Err(OperationError::Busy));
        }
        // What switches them on takes it home as well.
        if mode == ControlMode::Reset && self.motors_run() {
            return self.operated(id, Ok(()));
        }
        self.mode_change = Some(ModeChange::new(now, mode, Some(id)));
    }

    /// In v2: nothing says that they are off, or are to be.
    fn motors_run(&self) -> bool {
        let are_on = self.heard.status.is_some_and(|(_, status)| status.motors_on());
        let is_retracted = self.heard.attitude.is_none_or(|(_, status)| status.flags.contains(GimbalFlags::RETRACT));
        let are_switched = self.operations.pending.iter().any(|pending| matches!(pending.goal, Goal::Motors { .. }));
        are_on && !is_retracted && !are_switched && self.mode_change.is_none()
    }

    /// In v2 its flags say that it has taken the mode; the motors follow, and the status tells when.
    pub(super) fn handle_mode_taken(&mut self, now: Timestamp, id: OperationId, mode: ControlMode) {
        let on = match mode {
            ControlMode::Reset => true,
            ControlMode::Off => false,
            ControlMode::Lock | ControlMode::Follow | ControlMode::Mapping => return self.operated(id, Ok(())),
        };
        let stage = Stage::Shown { until: now + MOTORS_SHOW_WITHIN };
        self.operations.pending.push(Pending { id, stage, goal: Goal::Motors { on } });
    }

    /// In v2 a reset is a direction, made of where the gimbal looks. What it keeps is kept in the frame in which it was
    /// told.
    fn point_by_reset(&mut self, now: Timestamp, id: OperationId, mode: ResetMode) {
        let Some((_, status)) = self.heard.attitude else { return self.operated(id, Err(OperationError::NotReady)) };
        let angles = status.attitude.angles();
        let (ahead, down) = (Yaw::InVehicleFrame(Angle::ZERO), Angle::from_degrees(-90.0));
        let (roll, pitch, yaw) = match mode {
            ResetMode::Yaw => (angles.roll, angles.pitch, ahead),
            ResetMode::PitchAndYaw => (Angle::ZERO, Angle::ZERO, ahead),
            ResetMode::PitchDownUpAndYaw => (Angle::ZERO, down, ahead),
            ResetMode::PitchDownUp | ResetMode::PitchMapping => (angles.roll, down, status.attitude.yaw()),
        };
        let setpoint = Setpoint::Point(Pointing {
            roll,
            pitch,
            yaw,
            stabilised: Stabilised::BOTH,
            radio_control: RadioControl::Off,
        });
        if let Some(before) = self.operations.pointing.take() {
            self.operated(before.id, Ok(()));
        }
        self.operations.pointing = Some(RepeatedPoint { id, setpoint, left: POINT_SENDS, next: now });
    }

    fn write_settings(&mut self, now: Timestamp, id: OperationId, operation: &Operation) {
        let Some(table) = self.table() else {
            let error =
                if self.parameters.is_settled() { OperationError::Unsupported } else { OperationError::NotReady };
            return self.operated(id, Err(error));
        };
        let value = |name: &str| self.parameters.value(name).map(|value| value as i16);
        match writes::writes(operation, table, value) {
            None => self.operated(id, Err(OperationError::Unsupported)),
            Some(Err(error)) => self.operated(id, Err(error)),
            Some(Ok(writes)) => {
                let writes: Vec<(&str, f64)> =
                    writes.iter().map(|write| (write.name, f64::from(write.value))).collect();
                self.set_parameters(now, id, &writes);
            }
        }
    }

    fn set_parameters(&mut self, now: Timestamp, id: OperationId, writes: &[(&str, f64)]) {
        let unit = self.table().and_then(|table| table.name(Parameter::EncoderType));
        if writes.iter().any(|(name, _)| Some(*name) == unit) {
            self.unit_change = Some(id);
        }
        self.parameters.set(now, id, writes);
    }

    pub(super) fn table(&self) -> Option<ParameterTable> {
        ParameterTable::recognised_by(self.parameters.values().map(|(name, _)| name))
    }

    fn ask(&mut self, now: Timestamp, id: OperationId, command: COMMAND_LONG_DATA, goal: Goal) {
        if self.operations.pending.len() >= CAPACITY {
            return self.operated(id, Err(OperationError::Busy));
        }
        let stage = Stage::Answer { command: command.clone(), since: now };
        self.operations.pending.push(Pending { id, stage, goal });
        self.outputs.push_back(DriverOutput::Command(Box::new(command)));
    }

    pub(super) fn operated(&mut self, id: OperationId, result: OperationResult) {
        self.outputs.push_back(DriverOutput::Operated { id, result });
    }

    /// What became of a command that an operation wanted.
    pub(super) fn handle_operation_outcome(
        &mut self,
        now: Timestamp,
        command: &COMMAND_LONG_DATA,
        outcome: CommandOutcome,
    ) {
        let is_its = |pending: &Pending| {
            matches!(&pending.stage, Stage::Answer { command: asked, .. }
                if *asked == COMMAND_LONG_DATA { confirmation: 0, ..command.clone() })
        };
        // Said twice, it is sent once and answered for both.
        let (answered, rest) = self.operations.pending.drain(..).partition(is_its);
        self.operations.pending = rest;
        for Pending { id, goal, .. } in answered {
            let result = match (goal, outcome) {
                (Goal::Restart { .. }, CommandOutcome::Unanswered)
                    if now.since(self.heard.latest) >= SILENT_WHEN_OFF =>
                {
                    Ok(())
                }
                (_, outcome) => of_outcome(outcome),
            };
            self.handle_answered(now, id, goal, result);
        }
    }

    fn handle_answered(&mut self, now: Timestamp, id: OperationId, goal: Goal, result: OperationResult) {
        match (goal, &result) {
            (Goal::Motors { on }, Ok(())) => {
                self.motors_asked = on.then_some(now);
                let stage = Stage::Shown { until: now + MOTORS_SHOW_WITHIN };
                self.operations.pending.push(Pending { id, stage, goal });
                return;
            }
            (Goal::Mode(mode), Ok(())) => {
                self.mount.note_mode(mode);
                let stage = Stage::Shown { until: now + MODE_SHOWS_WITHIN };
                self.operations.pending.push(Pending { id, stage, goal });
                return;
            }
            (Goal::Rate(stream, rate), Ok(())) => self.streams.choose(stream, rate),
            (Goal::Motors { .. }, Err(_)) => self.motors_asked = None,
            (Goal::Restart { comes_back }, Ok(())) => self.switch_off(now, comes_back),
            (Goal::Answer | Goal::Mode(_) | Goal::Rate(..) | Goal::Restart { .. }, _) => {}
        }
        self.operated(id, result);
    }

    /// A status may show what was asked for.
    pub(super) fn handle_shown(&mut self, status: SystemStatus) {
        let shows = |pending: &Pending| {
            matches!(pending.stage, Stage::Shown { .. })
                && match pending.goal {
                    Goal::Motors { on } => status.motors_on() == on,
                    Goal::Mode(mode) => shown_mode(status) == mode,
                    _ => true,
                }
        };
        let (done, rest) = self.operations.pending.drain(..).partition(shows);
        self.operations.pending = rest;
        for Pending { id, .. } in done {
            self.operated(id, Ok(()));
        }
    }

    pub(super) fn handle_operations_timeout(&mut self, now: Timestamp, device: MavId) {
        self.release_held(now, device);
        let is_late = |pending: &Pending| matches!(pending.stage, Stage::Shown { until } if until <= now);
        let (late, rest) = self.operations.pending.drain(..).partition(is_late);
        self.operations.pending = rest;
        for Pending { id, goal, .. } in late {
            let text = match goal {
                Goal::Motors { on: true } => "its motors are off",
                Goal::Motors { on: false } => "its motors are on",
                Goal::Mode(YawMode::Lock) => "it still follows",
                Goal::Mode(YawMode::Follow) => "it is still locked",
                _ => "it does not show",
            };
            self.operated(id, Err(OperationError::NoEffect(text.to_owned())));
        }
        if let Some(pointing) = &mut self.operations.pointing
            && pointing.next <= now
        {
            pointing.left -= 1;
            pointing.next = now + POINT_EVERY;
            let RepeatedPoint { id, setpoint, left, .. } = *pointing;
            self.send_setpoint(now, setpoint);
            if left == 0 {
                self.operations.pointing = None;
                self.operated(id, Ok(()));
            }
        }
    }

    /// It starts again, or is lost: what moves it is not gone on with.
    pub(super) fn end_moves(&mut self) {
        self.is_retracted = false;
        self.hand_over_waits = false;
        let pointing = self.operations.pointing.take().map(|pointing| pointing.id);
        let changing = self.mode_change.take().and_then(|change| change.asker());
        for id in pointing.into_iter().chain(changing) {
            self.operated(id, Err(OperationError::NoEffect("it has started again".to_owned())));
        }
    }

    /// A new demand takes the place of a direction that is being said.
    pub(super) fn end_pointing(&mut self) {
        if let Some(pointing) = self.operations.pointing.take() {
            self.operated(pointing.id, Ok(()));
        }
    }
}

/// Gimbal statement 9: each refusal is told apart.
fn of_outcome(outcome: CommandOutcome) -> OperationResult {
    const ACCEPTED: u8 = CommandResult::Accepted as u8;
    const REJECTED: u8 = CommandResult::TemporarilyRejected as u8;
    const DENIED: u8 = CommandResult::Denied as u8;
    const UNSUPPORTED: u8 = CommandResult::Unsupported as u8;
    match outcome {
        CommandOutcome::Answered(ACCEPTED) => Ok(()),
        CommandOutcome::Answered(REJECTED) => Err(OperationError::Rejected),
        CommandOutcome::Answered(DENIED) => Err(OperationError::Denied),
        CommandOutcome::Answered(UNSUPPORTED) => Err(OperationError::UnsupportedByDevice),
        CommandOutcome::Answered(_) => Err(OperationError::Failed),
        CommandOutcome::Unanswered | CommandOutcome::GivenUp => Err(OperationError::NoAnswer),
    }
}

/// Lock or follow, as the status shows it.
pub(super) fn shown_mode(status: SystemStatus) -> YawMode {
    use crate::gimbals::gremsy::status::Activity;
    if status.activity.contains(Activity::FOLLOW) { YawMode::Follow } else { YawMode::Lock }
}

/// The attitude of a gimbal with `angles`, yaw in its frame.
pub(super) fn attitude_of(angles: GimbalAngles, yaw: Yaw) -> crate::gimbals::report::GimbalAttitude {
    use crate::gimbals::report::GimbalAttitude;
    let angles = GimbalAngles { yaw: yaw.angle(), ..angles };
    match yaw {
        Yaw::InVehicleFrame(_) => GimbalAttitude::InVehicleFrame(Attitude::<VehicleFrame>::from_gimbal_angles(angles)),
        Yaw::InEarthFrame(_) => GimbalAttitude::InEarthFrame(Attitude::<EarthFrame>::from_gimbal_angles(angles)),
    }
}
