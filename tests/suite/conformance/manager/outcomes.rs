//! What becomes of every demand: message or command, flags, which numbers are NaN, who sends it, who is in control.
//!
//! [`RULES`] is the rule, in the order in which it is applied; the tests put every combination to it and to a manager
//! that stands alone, without links around it, so that there is time for all of them.

use std::time::Duration;

use gimbald::channel::ChannelId;
use gimbald::geometry::{Angle, Attitude, AxisLimits, GimbalAngles, Limits, VehicleFrame};
use gimbald::gimbals::capabilities::Capabilities;
use gimbald::gimbals::mavlink_v2::packet;
use gimbald::gimbals::report::{GimbalAttitude, GimbalStatus, Identity, Report};
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::manager::rank::Ranks;
use gimbald::manager::request::read_request;
use gimbald::manager::settings::ControlSettings;
use gimbald::manager::{GimbalManager, ManagerOutput, Sender, Surroundings};
use gimbald::timestamp::Timestamp;
use gimbald::vehicle::Vehicle;
use gimbald::wire::dialect::MavMessage;
use gimbald::wire::ids::{CapFlags, FailureFlags, GimbalFlags};
use gimbald::wire::{DatagramFrames, FrameBuffer, MavId};

use super::{COMPANION, Setpoint};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, command_int, command_long, configure, pitch_yaw_deg, pitchyaw,
    quaternion, set_attitude, set_manual_control, set_pitchyaw, take_control,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER};

use self::Outcome::{Angles, Neutral, Nudge, Rates, Refused, Retract};
use self::Standing::{AnotherHolds, IsPrimary, IsSecond, IsSecondOfSilent, NobodyHolds, OfAnotherVehicle};

const RETRACT: u32 = 1;
const NEUTRAL: u32 = 2;
const ROLL_LOCK: u32 = 4;
const PITCH_LOCK: u32 = 8;
const YAW_LOCK: u32 = 16;
const IN_VEHICLE_FRAME: u32 = 32;
const IN_EARTH_FRAME: u32 = 64;
const BOTH_FRAMES: u32 = IN_VEHICLE_FRAME | IN_EARTH_FRAME;
const RC_EXCLUSIVE: u32 = 256;
const RC_MIXED: u32 = 512;

/// The rule in words, whom it fits, and what becomes of the demand.
type Row = (&'static str, fn(&Case) -> bool, Outcome);

/// A demand is dealt with by the first row that fits.
#[rustfmt::skip]
const RULES: &[Row] = &[
    ("a message with a quaternion that is NaN in part is dropped (§3.7)",
        |case| case.form.is_message() && case.numbers.broken,           Refused(DENIED, "malformed_quaternion")),
    ("a message that names both frames is dropped (A-03)",
        |case| case.form.is_message() && case.has_all(BOTH_FRAMES),     Refused(DENIED, "both_yaw_frames")),
    ("another vehicle has no say (D5)",
        |case| case.sender == OfAnotherVehicle,                         Refused(DENIED, "other_vehicle")),
    ("while somebody is in control nobody else has a say (D4)",
        |case| case.sender == AnotherHolds,                             Refused(DENIED, "not_in_control")),
    ("while nobody is, whoever does not take control first has none, if `unclaimed` is closed (D3)",
        |case| case.sender == NobodyHolds && !case.open,                Refused(DENIED, "nobody_in_control")),
    ("a command that names both frames is refused (A-03)",
        |case| case.has_all(BOTH_FRAMES),                               Refused(DENIED, "both_yaw_frames")),
    ("rates of the secondary are added to what the primary demands (A-20)",
        |case| case.is_second() && case.is_rates_only() && !case.asks_for_more(), Nudge),
    ("anything else of the secondary waits for the primary to be silent (A-20)",
        |case| case.sender == IsSecond,                                 Refused(DENIED, "primary_is_active")),
    ("radio control needs inputs (A-54)",
        |case| case.has(RC_EXCLUSIVE | RC_MIXED) && !case.gimbal.full(), Refused(DENIED, "no_rc_inputs")),
    ("RETRACT wins over all else, where the gimbal can (A-14)",
        |case| case.has(RETRACT) && case.gimbal.full(),                 Retract),
    ("and is refused where it cannot (A-14)",
        |case| case.has(RETRACT),                                       Refused(DENIED, "cannot_retract")),
    ("NEUTRAL is next, or straight ahead where the gimbal knows no neutral (A-15)",
        |case| case.has(NEUTRAL),                                       Neutral),
    ("North cannot be held without a heading, by a gimbal that does not know North itself (§2.2)",
        |case| case.holds_north() && case.gimbal == Gimbal::Lost,       Refused(TEMPORARILY_REJECTED, "no_heading")),
    ("radio control alone has the gimbal where it looks (A-54)",
        |case| case.has(RC_EXCLUSIVE),                                  Angles),
    ("rates alone are given on as rates, if the gimbal takes the frame in which they are held",
        |case| case.is_rates_only() && (case.gimbal.full() || !case.holds_north()), Rates),
    ("all else is angles: those named, those approached at a rate, those kept (A-09 to A-12)",
        |_| true,                                                       Angles),
];

/// Every message and command that demands angles and rates.
#[test]
fn every_demand_comes_out_as_the_rule_says() {
    let flags =
        [0, 1, 2, 3, 4, 8, 12, 16, 28, 32, 44, 60, 64, 76, 92, 96, 124, 46, 45, 128 | 44, 256 | 44, 512 | 92, 2_092];
    let mut seen = vec![0_u32; RULES.len()];
    for form in [Form::Pitchyaw, Form::Attitude, Form::Manual, Form::Long, Form::Int] {
        for (flags, numbers) in flags.into_iter().flat_map(|flags| patterns(form).map(move |numbers| (flags, numbers)))
        {
            for gimbal in [Gimbal::Full, Gimbal::Plain, Gimbal::Lost] {
                for sender in [NobodyHolds, IsPrimary, IsSecond, IsSecondOfSilent, AnotherHolds, OfAnotherVehicle] {
                    // Whether a gimbal that nobody holds is free matters to nobody else.
                    let opens: &[bool] = if sender == NobodyHolds { &[true, false] } else { &[true] };
                    for &open in opens {
                        let case = Case { form, flags, numbers, gimbal, sender, open };
                        let rule = RULES.iter().position(|(_, fits, _)| fits(&case)).expect("the last row fits all");
                        seen[rule] += 1;
                        check(&case, rule);
                    }
                }
            }
        }
    }
    for ((name, _, _), seen) in RULES.iter().zip(seen) {
        assert!(seen > 0, "no case shows that {name}");
    }
}

/// The commands that look at places and those of gimbal protocol v1 pass the same gate (D5, A-23): the secondary waits for
/// the primary to be silent, as with everything that is absolute.
#[test]
#[rustfmt::skip]
fn every_other_command_passes_the_same_gate() {
    let long = |number, params: &[f32]| command_long(MANAGER, number, params);
    for (name, says) in [
        ("195, which ends it", command_int(MANAGER, 195, [NAN; 4], 0, 0, 0.0)),
        ("195 as COMMAND_LONG", long(195, &[NAN, NAN, NAN, NAN, 0.0, 0.0, 0.0])),
        ("197",                 long(197, &[0.0])),
        ("204, neutral",        long(204, &[1.0])),
        ("205, neutral",        long(205, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])),
        ("205, angles",         long(205, &[-20.0, 0.0, 10.0, 0.0, 0.0, 0.0, 2.0])),
    ] {
        for (sender,            open,  result,   reason) in [
            (NobodyHolds,       true,  ACCEPTED, None),
            (NobodyHolds,       false, DENIED,   Some("nobody_in_control")),
            (IsPrimary,         true,  ACCEPTED, None),
            (IsPrimary,         false, ACCEPTED, None),
            (IsSecond,          true,  DENIED,   Some("primary_is_active")),
            (IsSecondOfSilent,  true,  ACCEPTED, None),
            (AnotherHolds,      true,  DENIED,   Some("not_in_control")),
            (OfAnotherVehicle,  true,  DENIED,   Some("other_vehicle")),
        ] {
            let mut court = Court::new(Gimbal::Full, sender, open);
            let (acks, told) = court.say(sender.id(), &says);
            assert_eq!(acks, [result], "{name}, {sender:?}");
            assert_eq!(court.refused_for(sender.id()), reason, "{name}, {sender:?}");
            assert!(reason.is_none() || told.is_empty(), "{name}, {sender:?}: {told:?}");
        }
    }
}

/// How a demand is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// 287
    Pitchyaw,
    /// 282
    Attitude,
    /// 288
    Manual,
    /// 1000 in `COMMAND_LONG`
    Long,
    /// 1000 in `COMMAND_INT`
    Int,
}

/// Which numbers a demand has; the others are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Numbers {
    pitch: bool,
    yaw: bool,
    pitch_rate: bool,
    yaw_rate: bool,
    roll_rate: bool,
    /// The quaternion has numbers and NaN.
    broken: bool,
}

/// Who sends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    NobodyHolds,
    IsPrimary,
    /// Secondary, and the primary has just demanded an angle.
    IsSecond,
    /// Secondary, and the primary has demanded nothing for more than two seconds.
    IsSecondOfSilent,
    AnotherHolds,
    OfAnotherVehicle,
}

/// To what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gimbal {
    /// It can do everything, takes yaw from North, and the heading is 30°.
    Full,
    /// It can do little, takes yaw from the nose, and the heading is 30°.
    Plain,
    /// The same, and nobody knows the heading.
    Lost,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Outcome {
    /// The result of a command, and the reason that is counted; a message is dropped in silence.
    Refused(u8, &'static str),
    Retract,
    Neutral,
    /// A 284 with rates and no angles.
    Rates,
    /// A 284 with angles and no rates.
    Angles,
    /// The primary's angles, which then move.
    Nudge,
}

#[derive(Clone, Copy, Debug)]
struct Case {
    form: Form,
    flags: u32,
    numbers: Numbers,
    gimbal: Gimbal,
    sender: Standing,
    /// `unclaimed = "open"`.
    open: bool,
}

/// What is demanded where it is, in degrees and degrees per second.
const PITCH: f64 = -20.0;
const YAW: f64 = 40.0;
const PITCH_RATE: f64 = 3.0;
const YAW_RATE: f64 = -4.0;
const ROLL_RATE: f64 = 2.0;

/// Where the gimbal looks, yaw from the nose, and what the primary of a secondary has demanded.
const LOOKS: (f64, f64) = (-5.0, 7.0);
const PRIMARYS: (f64, f64) = (-10.0, 5.0);

const HEADING: f64 = 30.0;

/// Full deflection of manual control, and the end stops.
const MANUAL_DPS: f64 = 30.0;
const PITCH_STOPS: (f64, f64) = (-80.0, 40.0);
const YAW_STOPS: (f64, f64) = (-160.0, 160.0);

impl Form {
    fn is_message(self) -> bool {
        matches!(self, Self::Pitchyaw | Self::Attitude | Self::Manual)
    }
}

impl Gimbal {
    fn full(self) -> bool {
        self == Self::Full
    }
}

impl Standing {
    fn id(self) -> MavId {
        match self {
            Self::IsPrimary => GCS,
            Self::NobodyHolds | Self::IsSecond | Self::IsSecondOfSilent | Self::AnotherHolds => COMPANION,
            Self::OfAnotherVehicle => MavId::new(9, 1),
        }
    }
}

impl Case {
    fn has(&self, flags: u32) -> bool {
        self.flags & flags != 0
    }

    fn has_all(&self, flags: u32) -> bool {
        self.flags & flags == flags
    }

    fn is_second(&self) -> bool {
        matches!(self.sender, IsSecond | IsSecondOfSilent)
    }

    /// Rates and no angles.
    fn is_rates_only(&self) -> bool {
        let Numbers { pitch, yaw, pitch_rate, yaw_rate, roll_rate, .. } = self.numbers;
        let any_rate = pitch_rate || yaw_rate || roll_rate;
        any_rate && !pitch && !yaw
    }

    /// A position of the gimbal's own, or radio control.
    fn asks_for_more(&self) -> bool {
        self.has(RETRACT | NEUTRAL | RC_EXCLUSIVE | RC_MIXED)
    }

    /// "YAW_LOCK or the earth frame: North is held" (§3.5).
    fn holds_north(&self) -> bool {
        self.has(YAW_LOCK | IN_EARTH_FRAME)
    }

    /// "Frame bits first, then YAW_LOCK" (§3.5): what a yaw that is sent counts from.
    fn is_from_north(&self) -> bool {
        self.has(IN_EARTH_FRAME) || (self.has(YAW_LOCK) && !self.has(IN_VEHICLE_FRAME))
    }

    fn message(&self) -> MavMessage {
        let Numbers { pitch, yaw, pitch_rate, yaw_rate, roll_rate, broken } = self.numbers;
        let some = |is_there: bool, number: f64| if is_there { number as f32 } else { NAN };
        let degrees = [some(pitch, PITCH), some(yaw, YAW), some(pitch_rate, PITCH_RATE), some(yaw_rate, YAW_RATE)];
        let [p, y, dp, dy] = degrees.map(f32::to_radians);
        match self.form {
            Form::Pitchyaw => set_pitchyaw(p, y, dp, dy, self.flags),
            Form::Attitude => {
                let mut q = if pitch { quaternion(PITCH, YAW) } else { [NAN; 4] };
                if broken {
                    q[2] = if pitch { NAN } else { 0.5 };
                }
                set_attitude(q, [some(roll_rate, ROLL_RATE).to_radians(), dp, dy], self.flags)
            }
            Form::Manual => {
                let of_reach = |degrees: f32, stops: (f64, f64)| {
                    degrees / if degrees < 0.0 { -stops.0 as f32 } else { stops.1 as f32 }
                };
                let rate = |degrees: f32| degrees / MANUAL_DPS as f32;
                let [p, y, dp, dy] = degrees;
                let sticks = set_manual_control(of_reach(p, PITCH_STOPS), of_reach(y, YAW_STOPS), rate(dp), rate(dy));
                let MavMessage::GIMBAL_MANAGER_SET_MANUAL_CONTROL(mut sticks) = sticks else { unreachable!() };
                sticks.flags = self.flags;
                MavMessage::GIMBAL_MANAGER_SET_MANUAL_CONTROL(sticks)
            }
            Form::Long => pitchyaw(degrees[0], degrees[1], degrees[2], degrees[3], self.flags as f32),
            Form::Int => command_int(MANAGER, 1000, degrees, self.flags as i32, 0, 154.0),
        }
    }

    /// The flags of a 284: locks where they are wanted or cannot be had otherwise, exactly one frame, `YAW_LOCK`
    /// exactly with North, and the part of radio control.
    fn flags_to_gimbal(&self) -> u32 {
        let north = self.holds_north() && self.gimbal.full();
        let frame = if north { IN_EARTH_FRAME | YAW_LOCK } else { IN_VEHICLE_FRAME };
        let locks = if self.gimbal.full() { self.flags } else { ROLL_LOCK | PITCH_LOCK } & (ROLL_LOCK | PITCH_LOCK);
        let radio = if self.has(RC_EXCLUSIVE) { RC_EXCLUSIVE } else { self.flags & RC_MIXED };
        frame | locks | radio
    }

    /// Pitch and yaw of a 284, yaw in the frame that its flags name.
    fn angles_to_gimbal(&self) -> (f64, f64) {
        let kept = if self.sender == IsSecondOfSilent { PRIMARYS } else { LOOKS };
        let north = self.holds_north() && self.gimbal.full();
        let from_nose = |yaw: f64| if north { yaw + HEADING } else { yaw };
        let named = if self.is_from_north() { YAW - HEADING } else { YAW };
        let Numbers { pitch, yaw, pitch_rate, yaw_rate, .. } = self.numbers;
        // At first an axis with a rate is where the gimbal looks, one without a number where it was.
        let axis = |angle: bool, rate: bool, named: f64, looks: f64, kept: f64| match (angle, rate) {
            _ if self.has(RC_EXCLUSIVE) => kept,
            (true, false) => named,
            (_, true) => looks,
            (false, false) => kept,
        };
        let yaw = axis(yaw, yaw_rate, named, LOOKS.1, kept.1);
        (axis(pitch, pitch_rate, PITCH, LOOKS.0, kept.0), from_nose(yaw))
    }

    /// Roll, pitch and yaw rate of a 284; an axis without one stands still.
    fn rates_to_gimbal(&self) -> [Option<f64>; 3] {
        let Numbers { pitch_rate, yaw_rate, roll_rate, .. } = self.numbers;
        let rate = |is_there: bool, rate: f64| Some(if is_there { rate } else { 0.0 });
        let roll = (roll_rate && self.gimbal.full()).then_some(ROLL_RATE);
        [roll, rate(pitch_rate, PITCH_RATE), rate(yaw_rate, YAW_RATE)]
    }
}

/// Every way in which numbers can be left out of a message or command.
fn patterns(form: Form) -> impl Iterator<Item = Numbers> {
    (0..64_u8).filter_map(move |bits| {
        let bit = |number: u8| bits & (1 << number) != 0;
        let all = Numbers {
            pitch: bit(0),
            yaw: bit(1),
            pitch_rate: bit(2),
            yaw_rate: bit(3),
            roll_rate: bit(4),
            broken: bit(5),
        };
        let is_one = match form {
            // A quaternion states both angles or none.
            Form::Attitude => all.pitch == all.yaw,
            // "Finite rate wins over angle on the same axis".
            Form::Manual => !(all.pitch && all.pitch_rate || all.yaw && all.yaw_rate || all.roll_rate || all.broken),
            Form::Pitchyaw | Form::Long | Form::Int => !all.roll_rate && !all.broken,
        };
        is_one.then_some(all)
    })
}

#[track_caller]
fn check(case: &Case, rule: usize) {
    let (name, _, outcome) = &RULES[rule];
    let name = || format!("{name}\n{case:?}");
    let mut court = Court::new(case.gimbal, case.sender, case.open);

    let (acks, told) = court.say(case.sender.id(), &case.message());

    let (result, reason) = match outcome {
        Refused(result, reason) => (*result, Some(*reason)),
        Retract | Neutral | Rates | Angles | Nudge => (ACCEPTED, None),
    };
    assert_eq!(acks, if case.form.is_message() { vec![] } else { vec![result] }, "{}", name());
    assert_eq!(court.refused_for(case.sender.id()), reason, "{}", name());
    let expected = match outcome {
        Refused(..) => return assert_eq!(told, [], "{}", name()),
        Retract => Told { flags: RETRACT | IN_VEHICLE_FRAME | ROLL_LOCK | PITCH_LOCK, angles: None, rates: [None; 3] },
        Neutral if case.gimbal.full() => {
            Told { flags: NEUTRAL | IN_VEHICLE_FRAME | ROLL_LOCK | PITCH_LOCK, angles: None, rates: [None; 3] }
        }
        Neutral => {
            let flags = IN_VEHICLE_FRAME | ROLL_LOCK | PITCH_LOCK;
            Told { flags, angles: Some((0.0, 0.0)), rates: [None; 3] }
        }
        Rates => Told { flags: case.flags_to_gimbal(), angles: None, rates: case.rates_to_gimbal() },
        Angles => Told { flags: case.flags_to_gimbal(), angles: Some(case.angles_to_gimbal()), rates: [None; 3] },
        Nudge => Told { flags: 44, angles: Some(PRIMARYS), rates: [None; 3] },
    };
    assert_eq!(told.len(), 1, "{}", name());
    assert!(told[0].is_near(&expected), "{:?} instead of {expected:?}: {}", told[0], name());
    if *outcome == Nudge {
        let moved = court.after(Duration::from_secs(1));
        let Numbers { pitch_rate, yaw_rate, .. } = case.numbers;
        let pitch = PRIMARYS.0 + if pitch_rate { PITCH_RATE } else { 0.0 };
        let yaw = PRIMARYS.1 + if yaw_rate { YAW_RATE } else { 0.0 };
        let expected = Told { angles: Some((pitch, yaw)), ..expected };
        assert!(moved.is_near(&expected), "{moved:?} instead of {expected:?}: {}", name());
    }
}

/// What the gimbal is told, as far as it is looked at here; the angles are open where it goes to a position of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Told {
    flags: u32,
    angles: Option<(f64, f64)>,
    rates: [Option<f64>; 3],
}

impl Told {
    fn of(setpoint: &Setpoint) -> Self {
        let rate = |rate: f32| Some(f64::from(rate).to_degrees()).filter(|rate| !rate.is_nan());
        let [x, y, z] = [setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z];
        let is_own = u32::from(setpoint.flags) & (RETRACT | NEUTRAL) != 0;
        let angles = (!is_own && !setpoint.q[0].is_nan()).then(|| pitch_yaw_deg(setpoint.q));
        Self { flags: setpoint.flags.into(), angles, rates: [rate(x), rate(y), rate(z)] }
    }

    fn is_near(&self, other: &Self) -> bool {
        let near = |one: f64, other: f64| (one - other).abs() < 0.001;
        let rates = self.rates.iter().zip(other.rates).all(|(one, other)| match (one, other) {
            (Some(one), Some(other)) => near(*one, other),
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        });
        let angles = match (self.angles, other.angles) {
            (Some(one), Some(other)) => near(one.0, other.0) && near(one.1, other.1),
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        };
        self.flags == other.flags && rates && angles
    }
}

/// A manager with its gimbal, and somebody in control or nobody.
struct Court {
    now: Timestamp,
    manager: GimbalManager,
    vehicle: Vehicle,
    ranks: Ranks,
}

impl Court {
    fn new(gimbal: Gimbal, sender: Standing, open: bool) -> Self {
        let rules = ControlSettings { open_when_unclaimed: open, ..ControlSettings::default() };
        let manager = GimbalManager::new(GimbalSettings::found("camera".to_owned()), rules, None);
        let mut court =
            Self { now: Timestamp::from_secs(1), manager, vehicle: Vehicle::new(), ranks: Ranks::default() };
        court.report(Report::Alive { device: GIMBAL });
        court.report(Report::Known(Identity::default(), capabilities(gimbal)));
        court.look(gimbal);
        match sender {
            NobodyHolds | OfAnotherVehicle => {}
            IsPrimary | AnotherHolds => drop(court.say(GCS, &take_control())),
            IsSecond | IsSecondOfSilent => {
                court.say(GCS, &configure([255.0, 190.0], [1.0, 192.0]));
                let (pitch, yaw) = (PRIMARYS.0.to_radians() as f32, PRIMARYS.1.to_radians() as f32);
                court.say(GCS, &set_pitchyaw(pitch, yaw, NAN, NAN, 44));
            }
        }
        if sender == IsSecondOfSilent {
            court.after(Duration::from_millis(2_100));
            court.look(gimbal);
        }
        court
    }

    fn look(&mut self, gimbal: Gimbal) {
        let angles =
            GimbalAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(LOOKS.0), yaw: Angle::from_degrees(LOOKS.1) };
        let status = GimbalStatus {
            is_assumed: false,
            attitude: GimbalAttitude::InVehicleFrame(Attitude::<VehicleFrame>::from_gimbal_angles(angles)),
            rates: [None; 3],
            heading: (gimbal != Gimbal::Lost).then(|| Angle::from_degrees(HEADING)),
            flags: GimbalFlags::YAW_IN_VEHICLE_FRAME,
            failures: FailureFlags::empty(),
            accepts_earth_yaw: gimbal.full(),
        };
        self.report(Report::Attitude(status));
    }

    fn report(&mut self, report: Report) {
        let around = around(&self.vehicle, &self.ranks, AUTOPILOT);
        self.manager.handle_report(self.now, report, around);
        while self.manager.poll_output().is_some() {}
    }

    /// The results with which we answered, and what the gimbal was told.
    fn say(&mut self, sender: MavId, message: &MavMessage) -> (Vec<u8>, Vec<Told>) {
        let bytes = FrameBuffer::default().encode_any(sender, 0, message).bytes().to_vec();
        let mut frames = DatagramFrames::new(&bytes);
        let frame = frames.next_frame().expect("a whole frame");
        let around = around(&self.vehicle, &self.ranks, sender);
        match read_request(&frame).expect("a request to a manager") {
            Ok(request) => {
                let sender = Sender { id: sender, channel: ChannelId::new(0).expect("below the bound") };
                self.manager.handle_request(self.now, sender, &request, around);
            }
            Err(refusal) => self.manager.count_refusal(sender, refusal.reason),
        }
        let (mut acks, mut told) = (Vec::new(), Vec::new());
        while let Some(output) = self.manager.poll_output() {
            match output {
                ManagerOutput::Reply { message, .. } => {
                    let MavMessage::COMMAND_ACK(ack) = *message else { panic!("{message:?}") };
                    acks.push(ack.result);
                }
                ManagerOutput::Steer(setpoint) => told.push(told_to_gimbal(&setpoint)),
                ManagerOutput::Broadcast { .. } | ManagerOutput::Event(_) => {}
                other => panic!("{other:?}"),
            }
        }
        (acks, told)
    }

    /// Lets time pass; the last that the gimbal was told meanwhile.
    fn after(&mut self, duration: Duration) -> Told {
        let end = self.now + duration;
        let mut last = None;
        while let Some(next) = self.manager.poll_timeout().filter(|next| *next <= end) {
            self.now = self.now.max(next);
            let around = around(&self.vehicle, &self.ranks, AUTOPILOT);
            self.manager.handle_timeout(self.now, around);
            while let Some(output) = self.manager.poll_output() {
                if let ManagerOutput::Steer(setpoint) = output {
                    last = Some(told_to_gimbal(&setpoint));
                }
            }
        }
        self.now = end;
        last.expect("a setpoint is streamed")
    }

    /// Why that one was refused, if at all.
    fn refused_for(&self, sender: MavId) -> Option<&'static str> {
        let reasons = self.manager.rejected().get(&sender)?;
        assert_eq!(reasons.values().sum::<u64>(), 1, "one demand, one refusal: {reasons:?}");
        reasons.keys().next().copied()
    }
}

fn told_to_gimbal(setpoint: &gimbald::gimbals::setpoint::Setpoint) -> Told {
    let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint) = packet::set_attitude(GIMBAL, setpoint) else {
        unreachable!("284 is what a device is told with")
    };
    Told::of(&setpoint)
}

fn around<'a>(vehicle: &'a Vehicle, ranks: &'a Ranks, sender: MavId) -> Surroundings<'a> {
    let other_vehicle = sender == OfAnotherVehicle.id();
    Surroundings { vehicle, autopilot: Some(AUTOPILOT), ranks, overheard: false, other_vehicle }
}

fn capabilities(gimbal: Gimbal) -> Capabilities {
    let plain = CapFlags::HAS_PITCH_AXIS | CapFlags::HAS_PITCH_LOCK | CapFlags::HAS_YAW_AXIS | CapFlags::HAS_YAW_FOLLOW;
    let rest = CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_ROLL_AXIS
        | CapFlags::HAS_ROLL_FOLLOW
        | CapFlags::HAS_ROLL_LOCK
        | CapFlags::HAS_PITCH_FOLLOW
        | CapFlags::HAS_YAW_LOCK
        | CapFlags::HAS_RC_INPUTS;
    let stops = |(min, max)| AxisLimits::new(Angle::from_degrees(min), Angle::from_degrees(max));
    let limits = Limits { roll: None, pitch: stops(PITCH_STOPS), yaw: stops(YAW_STOPS) };
    Capabilities {
        flags: if gimbal.full() { plain | rest } else { plain },
        limits,
        turns: true,
        operates: false,
        retract_cuts_motors: false,
        radio_control_untold: false,
    }
}
