use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use super::*;
use crate::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use crate::bridge::{ChannelId, Input, Output};
use crate::geometry::{Angle, Attitude, GimbalAngles, Yaw, YawFrame};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::details::GimbalDetails;
use crate::gimbals::operation::{Operation, ResetMode};
use crate::gimbals::report::{GimbalAttitude, GimbalStatus, Identity, Report};
use crate::gimbals::setpoint::{Pointing, Setpoint};
use crate::gimbals::settings::{Family, GimbalSettings};
use crate::gimbals::{CommandOutcome, DriverOutput, GimbalDriver};
use crate::manager::request::AxisDemand;
use crate::wire::Frame;
use crate::wire::dialect::COMMAND_LONG_DATA;
use crate::wire::ids::{CapFlags, FailureFlags, GimbalFlags};

const SECOND: Duration = Duration::from_secs(1);
const REFRESH: Asked = Asked::Operation(Operation::RefreshParameters);
const RESET: Asked = Asked::Operation(Operation::Reset(ResetMode::PitchAndYaw));

/// "Each is answered by exactly one `Operated`, at once or when the gimbal has done it": and only that one counts.
#[test]
fn what_is_under_way_is_answered_once() {
    let mut core = Core::new();
    core.ask(1, &REFRESH);
    core.ask(2, &REFRESH);
    assert_eq!(core.answers, []);

    core.say(DriverOutput::Operated { id: OperationId(2), result: Ok(()) });
    core.say(DriverOutput::Operated { id: OperationId(2), result: Err(OperationError::Failed) });
    core.say(DriverOutput::Operated { id: OperationId(1), result: Err(OperationError::Denied) });
    core.say(DriverOutput::Operated { id: OperationId(99), result: Ok(()) });

    assert_eq!(core.answers, [(2, Ok(())), (1, Err(NotDone::Operation(OperationError::Denied)))]);
    assert_eq!(core.bridge.asked.poll_timeout(), None);
}

/// "Bounded number under way", and "no unbounded waiting": a driver that never answers is answered for after 20 s.
#[test]
fn a_driver_that_never_answers_is_answered_for() {
    let mut core = Core::new();
    for id in 0..MAX_UNDER_WAY as u64 {
        core.ask(id, &REFRESH);
    }
    core.ask(100, &REFRESH);
    assert_eq!(core.answers, [(100, Err(NotDone::TooMuch))]);
    core.ask(101, &Asked::TakeControl);
    assert_eq!(core.answers.pop(), Some((101, Ok(()))), "what is done at once needs no room");
    core.answers.clear();

    core.run_to(core.begun + (DEADLINE - Duration::from_millis(1)));
    assert_eq!(core.answers, []);
    core.run_to(core.begun + DEADLINE);
    let no_answer = Err(NotDone::Operation(OperationError::NoAnswer));
    let expected: Vec<_> = (0..MAX_UNDER_WAY as u64).map(|id| (id, no_answer.clone())).collect();
    core.answers.sort_by_key(|(id, _)| *id);
    assert_eq!(core.answers, expected);
}

/// "A gimbal that is lost answers at once"; and at the end of the process nobody is left waiting.
#[test]
fn nobody_waits_for_who_is_gone() {
    let mut core = Core::new();
    core.ask(1, &REFRESH);
    core.say(DriverOutput::Report(Report::Lost));
    assert_eq!(core.answers, [(1, Err(NotDone::Operation(OperationError::NotThere)))]);

    let mut core = Core::new();
    core.ask(1, &REFRESH);
    core.input(Input::Shutdown);
    assert_eq!(core.answers, [(1, Err(NotDone::Ending))]);
}

/// A reset takes the place of where the gimbal was told to look: while it is done that is not said again, and afterwards
/// neither; when it is not done, it is.
#[test]
fn a_reset_takes_the_place_of_the_setpoint() {
    for (result, told_after) in [(Ok(()), 0), (Err(OperationError::Failed), 20)] {
        let mut core = Core::new();
        core.ask(1, &point(-30.0));
        assert_eq!(core.take_setpoints(), 1);

        core.ask(2, &RESET);
        core.run_to(core.now + SECOND);
        assert_eq!(core.take_setpoints(), 0, "while it is done");
        core.say(DriverOutput::Operated { id: OperationId(2), result: result.clone() });
        core.run_to(core.now + SECOND);
        let told = core.take_setpoints();
        assert!((told_after..=told_after + 1).contains(&told), "{result:?}: {told}");
    }
}

/// Who asks for something else meanwhile is obeyed at once.
#[test]
fn a_new_demand_does_not_wait_for_a_reset() {
    let mut core = Core::new();
    core.ask(1, &point(-30.0));
    core.ask(2, &RESET);
    core.take_setpoints();

    core.ask(3, &point(10.0));
    core.say(DriverOutput::Operated { id: OperationId(2), result: Ok(()) });
    core.run_to(core.now + SECOND);

    assert_eq!(core.take_setpoints(), 21);
    let wanted = Angle::from_degrees(10.0);
    assert!(matches!(core.last_setpoint, Some(Setpoint::Point(Pointing { pitch, .. })) if pitch == wanted));
}

fn point(pitch: f64) -> Asked {
    let angle = |degrees| AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None };
    Asked::Point { roll: angle(0.0), pitch: angle(pitch), yaw: angle(0.0), yaw_frame: YawFrame::Vehicle }
}

/// A core with one gimbal, whose driver says what the test wants.
struct Core {
    bridge: Bridge,
    now: Timestamp,
    begun: Timestamp,
    answers: Vec<(u64, Answer)>,
    last_setpoint: Option<Setpoint>,
    script: Rc<RefCell<Script>>,
}

#[derive(Debug, Default)]
struct Script {
    to_say: VecDeque<DriverOutput>,
    setpoints: Vec<Setpoint>,
}

#[derive(Debug)]
struct Scripted(Rc<RefCell<Script>>);

impl GimbalDriver for Scripted {
    fn family(&self) -> Family {
        Family::MavlinkV2
    }
    fn adopt(&mut self, _now: Timestamp, _device: MavId) {}
    fn handle_received(&mut self, _now: Timestamp, _frame: &Frame<'_>) {}
    fn handle_link_lost(&mut self) {}
    fn handle_setpoint(&mut self, _now: Timestamp, setpoint: Setpoint) {
        self.0.borrow_mut().setpoints.push(setpoint);
    }
    fn handle_command_outcome(&mut self, _: Timestamp, _: &COMMAND_LONG_DATA, _: CommandOutcome) {}
    fn handle_operation(&mut self, _now: Timestamp, _id: OperationId, _operation: Operation) {}
    fn handle_timeout(&mut self, _now: Timestamp) {}
    fn poll_output(&mut self) -> Option<DriverOutput> {
        self.0.borrow_mut().to_say.pop_front()
    }
    fn poll_timeout(&self) -> Option<Timestamp> {
        None
    }
    fn details(&self, _now: Timestamp) -> GimbalDetails {
        GimbalDetails::default()
    }
}

impl Core {
    fn new() -> Self {
        let link = LinkSettings {
            name: "gimbal".to_owned(),
            role: Role::Gimbal,
            endpoint: "test".to_owned(),
            transport: Transport::Datagrams,
            speaks_first: false,
            max_rates: Default::default(),
        };
        let settings = Settings {
            system_id: SystemId::Fixed(1),
            links: vec![link],
            gimbals: vec![GimbalSettings::found("camera".to_owned())],
            ..Settings::default()
        };
        let script = Rc::<RefCell<Script>>::default();
        let now = Timestamp::from_secs(1);
        let mut bridge = Bridge::new(Timestamp::ZERO, settings);
        bridge.roster.get_mut(0).driver = Box::new(Scripted(script.clone()));
        let mut core = Self { bridge, now, begun: now, answers: Vec::new(), last_setpoint: None, script };
        core.input(Input::LinkUp { link: 0 });
        let channel = ChannelId::new(0).expect("below the bound");
        core.input(Input::ChannelOpened { channel, link: 0, address: "test" });
        core.say(DriverOutput::Report(Report::Alive { device: MavId::new(1, 154) }));
        let capabilities = Capabilities {
            flags: CapFlags::HAS_PITCH_AXIS | CapFlags::HAS_YAW_AXIS,
            limits: Default::default(),
            turns: true,
            operates: false,
            retract_cuts_motors: false,
            radio_control_untold: false,
        };
        core.say(DriverOutput::Report(Report::Known(Identity::default(), capabilities)));
        let angles =
            GimbalAngles { roll: Angle::ZERO, pitch: Angle::ZERO, yaw: Yaw::InVehicleFrame(Angle::ZERO).angle() };
        core.say(DriverOutput::Report(Report::Attitude(GimbalStatus {
            is_assumed: false,
            attitude: GimbalAttitude::InVehicleFrame(Attitude::from_gimbal_angles(angles)),
            rates: [None; 3],
            heading: None,
            flags: GimbalFlags::empty(),
            failures: FailureFlags::empty(),
            accepts_earth_yaw: false,
        })));
        core
    }

    fn ask(&mut self, id: u64, asked: &Asked) {
        self.input(Input::Asked { id: OperationId(id), gimbal: "camera", asked });
    }

    /// The driver says something, at the next opportunity.
    fn say(&mut self, output: DriverOutput) {
        self.script.borrow_mut().to_say.push_back(output);
        self.input(Input::LinkUp { link: 0 });
    }

    fn input(&mut self, input: Input<'_>) {
        self.bridge.handle_input(self.now, input);
        self.drain();
    }

    fn run_to(&mut self, end: Timestamp) {
        while let Some(at) = self.bridge.poll_timeout().filter(|at| *at <= end) {
            self.now = at.max(self.now);
            self.bridge.handle_timeout(self.now);
            self.drain();
        }
        self.now = end;
    }

    fn drain(&mut self) {
        while let Some(output) = self.bridge.poll_output() {
            if let Output::Answered { id, answer } = output {
                self.answers.push((id.0, answer.clone()));
            }
        }
    }

    /// How many setpoints the driver got.
    fn take_setpoints(&mut self) -> usize {
        let setpoints = std::mem::take(&mut self.script.borrow_mut().setpoints);
        self.last_setpoint = setpoints.last().copied().or(self.last_setpoint);
        setpoints.len()
    }
}
