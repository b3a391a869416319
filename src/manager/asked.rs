//! What is asked of a gimbal by its name, from outside MAVLink: over HTTP, with the token.
//!
//! "One gate for v2 messages, v2 commands, v1 commands, ROI, RC and HTTP … In 281, HTTP and RC appear as the manager's own
//! ids" (D5). Whoever asks this way is one party, which takes, holds, lends and loses control as a component does; it is
//! heard whenever it asks for something.

use super::control::Voice;
use super::request::{AxisDemand, Claim, Configure, Demand, DemandKind, Refusal};
use super::roi::{Datum, position};
use super::{DeviceState, GimbalManager, Surroundings, control};
use crate::geometry::{AngularRate, YawFrame};
use crate::gimbals::operation::{Motors, Operation, OperationError, OperationId, Restart};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::GimbalFlags;

/// Why something dangerous is refused whose word was not said.
pub const UNCONFIRMED: &str = "unconfirmed";

/// Something asked of a gimbal.
#[derive(Clone, Debug, PartialEq)]
pub enum Asked {
    /// Primary control; asked again by its holder it keeps it.
    TakeControl,
    /// Every place that it has is given up.
    ReleaseControl,
    /// Angles to take and keep; an axis that is left out stays as it is.
    Point {
        roll: AxisDemand,
        pitch: AxisDemand,
        yaw: AxisDemand,
        yaw_frame: YawFrame,
    },
    /// To turn until it is not asked for again.
    Turn {
        roll: Option<AngularRate>,
        pitch: AngularRate,
        yaw: AngularRate,
        yaw_frame: YawFrame,
    },
    /// Stays where it looks at this moment.
    Stop,
    /// Keeps its direction, yaw to North however the vehicle turns …
    Lock,
    /// … or to the nose of the vehicle.
    Follow,
    Neutral,
    Retract {
        /// The word that motors off needs was said, for a gimbal that switches them off to retract.
        may_cut_motors: bool,
    },
    LookAt {
        latitude_deg: f64,
        longitude_deg: f64,
        altitude_m: f64,
        datum: Datum,
    },
    /// Looks at no place any more.
    EndRoi,
    Operation(Operation),
}

/// Why something was not done.
#[derive(Clone, Debug, PartialEq)]
pub enum NotDone {
    /// No gimbal has that name.
    UnknownGimbal,
    /// `holder` is named where that is why.
    Refused {
        refusal: Refusal,
        holder: Option<MavId>,
    },
    Operation(OperationError),
    /// So much is being done already that no more is begun.
    TooMuch,
    /// The system id is not settled yet.
    Starting,
    /// The process is to end.
    Ending,
}

/// What became of something asked.
pub type Answer = Result<(), NotDone>;

/// What is being done in the place of where the gimbal was told to look: it is not told that again meanwhile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pause {
    id: OperationId,
    /// It leaves the gimbal to its radio control.
    hands_over: bool,
}

/// Whether it is done, or its answer comes later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    Done,
    UnderWay,
}

impl Asked {
    /// Whether only the holder of primary control may ask for it, also where nobody has control and everybody may steer:
    /// it can cost the camera or the flight.
    pub const fn is_dangerous(&self) -> bool {
        matches!(
            self,
            Self::Operation(Operation::Motors(Motors::Off) | Operation::Restart(Restart::Reboot | Restart::Shutdown))
        )
    }
}

impl GimbalManager {
    /// What `who`, the manager's own ids, asks for in the name of those outside.
    pub fn handle_asked(
        &mut self,
        now: Timestamp,
        who: MavId,
        id: OperationId,
        asked: &Asked,
        around: Surroundings<'_>,
    ) -> Result<Progress, NotDone> {
        self.end_leases(now);
        self.handle_heard(now, who);
        let result = self.do_asked(now, who, id, asked, around);
        if let Err(NotDone::Refused { refusal, .. }) = &result {
            self.count_refusal(who, refusal.reason);
        }
        self.carry_out(now, around);
        result
    }

    fn do_asked(
        &mut self,
        now: Timestamp,
        who: MavId,
        id: OperationId,
        asked: &Asked,
        around: Surroundings<'_>,
    ) -> Result<Progress, NotDone> {
        let done = match asked {
            Asked::TakeControl => {
                self.configure(now, who, Configure { primary: Claim::Take, secondary: Claim::Keep }, around)
            }
            Asked::ReleaseControl => {
                self.configure(now, who, Configure { primary: Claim::Release, secondary: Claim::Release }, around)
            }
            Asked::Operation(operation) => return self.do_operation(now, who, id, asked, operation, around),
            _ => self.do_asked_aim(now, who, asked, around),
        };
        done.map(|()| Progress::Done).map_err(|refusal| self.not_done(refusal))
    }

    /// All that concerns where the gimbal looks; it passes the gate.
    fn do_asked_aim(
        &mut self,
        now: Timestamp,
        who: MavId,
        asked: &Asked,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        let voice = self.gate(now, who, around)?;
        let done = match asked {
            Asked::Point { roll, pitch, yaw, yaw_frame } => {
                let demand = Demand {
                    roll: *roll,
                    pitch: *pitch,
                    yaw: *yaw,
                    kind: DemandKind::Commanded,
                    ..in_frame(*yaw_frame)
                };
                self.handle_demand(now, who, &demand, around)
            }
            Asked::Turn { roll, pitch, yaw, yaw_frame } => {
                let rate = |rate| AxisDemand { angle: None, rate };
                let demand = Demand {
                    roll: rate(*roll),
                    pitch: rate(Some(*pitch)),
                    yaw: rate(Some(*yaw)),
                    ..in_frame(*yaw_frame)
                };
                self.handle_demand(now, who, &demand, around)
            }
            Asked::Neutral => {
                let flags = GimbalFlags::NEUTRAL;
                self.handle_demand(now, who, &Demand { flags, ..Demand::default() }, around)
            }
            Asked::Retract { may_cut_motors } => {
                if self.steerable()?.retract_cuts_motors {
                    self.check_danger(who, *may_cut_motors)?;
                }
                let flags = GimbalFlags::RETRACT;
                self.handle_demand(now, who, &Demand { flags, ..Demand::default() }, around)
            }
            Asked::Stop => self.stay(now, who, voice, None, around),
            Asked::Lock => self.stay(now, who, voice, Some(YawFrame::Earth), around),
            Asked::Follow => self.stay(now, who, voice, Some(YawFrame::Vehicle), around),
            Asked::LookAt { latitude_deg, longitude_deg, altitude_m, datum } => {
                voice.needs_whole()?;
                let place = position(now, [*latitude_deg, *longitude_deg], *altitude_m, *datum, around)?;
                self.look_at_place(now, who, place, around)
            }
            Asked::EndRoi => {
                voice.needs_whole()?;
                self.do_set_roi_none(now, who)
            }
            Asked::TakeControl | Asked::ReleaseControl | Asked::Operation(_) => Ok(()),
        };
        if done.is_ok() {
            // A command that comes after it is none of the past.
            self.last_command = None;
        }
        done
    }

    /// Keeps where the gimbal looks, yaw in `frame`, or in the one that it is held in. A rotation is stopped first, as
    /// fast as the gimbal can.
    pub(super) fn stay(
        &mut self,
        now: Timestamp,
        who: MavId,
        voice: Voice,
        frame: Option<YawFrame>,
        around: Surroundings<'_>,
    ) -> Result<(), Refusal> {
        voice.needs_whole()?;
        let held = if self.tracking.is_locked() { YawFrame::Earth } else { YawFrame::Vehicle };
        if self.tracking.is_rotating() {
            let zero = AxisDemand { angle: None, rate: Some(AngularRate::ZERO) };
            let demand = Demand { roll: zero, pitch: zero, yaw: zero, ..in_frame(frame.unwrap_or(held)) };
            return self.handle_demand(now, who, &demand, around);
        }
        if frame.is_none() && self.stop_unsteerable(now) {
            return Ok(());
        }
        let capabilities = *self.steerable()?;
        let situation = self.situation(now, &capabilities, around);
        match frame {
            Some(frame) => self.tracking.hold(now, who, frame, &situation)?,
            None => self.tracking.stay(now, who, held, &situation)?,
        }
        self.note_demand(now, who);
        Ok(())
    }

    pub(super) fn do_operation(
        &mut self,
        now: Timestamp,
        who: MavId,
        id: OperationId,
        asked: &Asked,
        operation: &Operation,
        around: Surroundings<'_>,
    ) -> Result<Progress, NotDone> {
        if operation.needs_control() {
            let voice = self.gate(now, who, around).and_then(Voice::needs_whole);
            voice.map_err(|refusal| self.not_done(refusal))?;
            if asked.is_dangerous() {
                // Its word was said where it was read.
                self.check_danger(who, true).map_err(|refusal| self.not_done(refusal))?;
            }
        }
        if self.state != DeviceState::Alive {
            if self.is_shut_down {
                self.steerable().map(drop).map_err(|refusal| self.not_done(refusal))?;
            }
            return Err(NotDone::Operation(OperationError::NotThere));
        }
        if operation.needs_control() {
            self.last_command = None;
        }
        if operation.ends_demand() {
            self.note_obeyed(now, who);
            if self.tracking.stop_rates(now) {
                self.carry_out(now, around);
            }
            self.pauses.push(Pause { id, hands_over: *operation == Operation::RadioControl });
        }
        self.give(who, id, operation);
        Ok(Progress::UnderWay)
    }

    /// What became of an operation. One that was done has taken the place of what the gimbal was told before; after those
    /// that were not it goes on with that.
    pub fn handle_operated(&mut self, now: Timestamp, id: OperationId, answer: &Answer, around: Surroundings<'_>) {
        self.tell_outcome(id, answer);
        let Some(at) = self.pauses.iter().position(|pause| pause.id == id) else { return };
        let pause = self.pauses.swap_remove(at);
        match (answer.is_ok(), pause.hands_over) {
            (true, true) => self.tracking.leave_to_radio_control(),
            (true, false) => self.tracking.leave_to_itself(),
            (false, _) => {}
        }
        self.note_operated(now);
        self.carry_out(now, around);
    }

    /// "Dangerous ones need an explicit word and the holder's right", also where everybody may steer.
    fn check_danger(&self, who: MavId, is_confirmed: bool) -> Result<(), Refusal> {
        if !is_confirmed {
            return Err(Refusal::denied(UNCONFIRMED));
        }
        if self.control.primary() != Some(who) {
            return Err(Refusal::denied("only_for_the_holder"));
        }
        Ok(())
    }

    fn not_done(&self, refusal: Refusal) -> NotDone {
        let holder = self.control.primary().filter(|_| control::STANDS_IN_THE_WAY.contains(&refusal.reason));
        NotDone::Refused { refusal, holder }
    }
}

/// Without a demand on any axis; roll and pitch to the horizon.
fn in_frame(yaw_frame: YawFrame) -> Demand {
    let frame = match yaw_frame {
        YawFrame::Earth => GimbalFlags::YAW_IN_EARTH_FRAME | GimbalFlags::YAW_LOCK,
        YawFrame::Vehicle => GimbalFlags::YAW_IN_VEHICLE_FRAME,
    };
    Demand { flags: GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK | frame, ..Demand::default() }
}
