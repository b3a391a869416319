//! What the manager never does, whatever is asked of it, by whomever, in whatever order.

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::Takeover;
use gimbald::manager::settings::ControlSettings;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA,
    MavMessage,
};
use gimbald::wire::target::message_shape;
use proptest::prelude::*;

use crate::support::control_rule::Rule;
use crate::support::script::{
    NAN, command_int, command_long, device_information, device_status, gimbal_heartbeat, global_position,
    ground_heartbeat, in_frame, mount_configure, mount_control, of, px4_heartbeat, set_attitude, set_manual_control,
    set_pitchyaw, usual_capabilities,
};
use crate::support::wire::checksum;
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Places, World, three_links};

/// Those who ask, the last of them from a system that nobody knows.
const SENDERS: [MavId; 5] = [GCS, MavId::new(255, 191), MavId::new(1, 192), AUTOPILOT, MavId::new(77, 191)];

/// One thing that happens.
#[derive(Clone, Debug)]
enum Step {
    Say {
        sender: usize,
        message: Box<MavMessage>,
    },
    /// A frame of the right length and checksum whose payload is anything.
    Babble {
        sender: usize,
        id: u32,
        payload: Vec<u8>,
    },
    /// The gimbal says where it looks and what it takes.
    Look {
        pitch_deg: f64,
        yaw_deg: f64,
        flags: u16,
        failure_flags: u32,
    },
    Turn {
        heading_deg: f64,
    },
    /// The vehicle is somewhere.
    Fly {
        latitude_deg: f64,
        altitude_m: f64,
    },
    Wait {
        millis: u64,
    },
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn no_order_of_requests_breaks_the_manager(
        steps in proptest::collection::vec(step(), 1..60),
        open_when_unclaimed in any::<bool>(),
        takeover in takeover(),
        accept_centidegrees in any::<bool>(),
    ) {
        let control = ControlSettings { open_when_unclaimed, accept_centidegrees, ..ControlSettings::default() };
        let mut settings = Settings { control, ..three_links() };
        settings.gimbals.push(gimbald::gimbals::settings::GimbalSettings {
            takeover,
            ..gimbald::gimbals::settings::GimbalSettings::found("camera".to_owned())
        });
        let (mut world, places) = World::empty(settings);
        introduce(&mut world, places);
        let mut rule = Rule::new(takeover, AUTOPILOT, &[GCS]);

        let mut flags = 44;
        for step in steps {
            flags = match &step {
                Step::Look { flags, .. } => *flags,
                Step::Wait { .. } => 44,
                Step::Say { .. } | Step::Babble { .. } | Step::Turn { .. } | Step::Fly { .. } => flags,
            };
            let speaker = step.speaker();
            if let Some(id) = speaker {
                rule.hear(world.now, id);
            }
            let (before, has_a_say) = (rule.holders(), speaker.is_none_or(|id| rule.has_a_say(id, open_when_unclaimed)));
            let answer = step.configure().map(|(sender, params)| rule.configure(world.now, sender, params));
            let is_client = matches!(step, Step::Say { .. } | Step::Babble { .. });

            let acked = take_step(&mut world, places, step);

            prop_assert!(acked.len() <= 1, "one command, answers {acked:?}");
            prop_assert!(answer.is_none_or(|answer| acked == [answer]), "{acked:?} where {answer:?} is right");
            rule.pass(world.now);
            let setpoints = check_what_was_said(&mut world, places)?;
            let gimbal = &world.snapshot().gimbals[0];
            let holders = rule.holders().map(|holder| holder.map(|id| id.to_string()));
            prop_assert_eq!([&gimbal.primary, &gimbal.secondary], [&holders[0], &holders[1]], "who is in control");
            if is_client && !has_a_say {
                // "Only who passed the gate changes what 284 says", but for the zero rates of a change of control.
                let stopped = rule.holders() != before && setpoints.iter().all(|setpoint| !is_moved(setpoint));
                prop_assert!(setpoints.is_empty() || stopped, "{:?} by one who has no say", setpoints);
            }
        }

        // Everybody falls silent but the gimbal, which takes its yaw as it did last: in another frame a rotation goes on in
        // angles, from the next setpoint on.
        look_on(&mut world, places, flags, Duration::from_millis(100));
        check_what_was_said(&mut world, places)?;
        // What the secondary adds goes on after the primary's rate has ended, and the rest of it in angles.
        let was_turning = is_turning(&world) && !is_nudged(&world);
        let mut stopped = false;
        for _ in 0..120 {
            look_on(&mut world, places, flags, Duration::from_millis(100));
            let setpoints = check_what_was_said(&mut world, places)?;
            stopped |= setpoints.iter().any(|setpoint| rates(setpoint).iter().all(|rate| rate.is_nan() || *rate == 0.0)
                && setpoint.angular_velocity_y == 0.0);
        }
        prop_assert!(!was_turning || stopped, "a rate ended without zero rates");
        prop_assert!(!is_turning(&world), "a rate outlived its sender");
        let snapshot = world.snapshot();
        prop_assert_eq!((&snapshot.gimbals[0].primary, &snapshot.gimbals[0].secondary), (&None, &None), "leases end");
    }

    /// Whatever turns, by whichever message and with whatever on the other axis, stands still some time after its sender
    /// fell silent; a rotation by rates ends with zero rates.
    #[test]
    fn every_rate_ends_when_its_sender_falls_silent(
        demand in rate_demand(), repeats in 1_usize..4, heading_deg in 0.0..360.0, accepts_north in any::<bool>(),
    ) {
        let (mut world, places) = World::empty(three_links());
        introduce(&mut world, places);
        let flags = if accepts_north { 44 | 128 } else { 44 };
        for _ in 0..repeats {
            take_step(&mut world, places, Step::Turn { heading_deg });
            take_step(&mut world, places, Step::Look { pitch_deg: 0.0, yaw_deg: 0.0, flags, failure_flags: 0 });
            take_step(&mut world, places, Step::Say { sender: 0, message: Box::new(demand.clone()) });
            world.run_for(Duration::from_millis(400));
        }
        prop_assert!(world.snapshot().gimbals[0].setpoint.is_some(), "it was accepted");

        let spoken = check_what_was_said(&mut world, places)?;
        let by_rates = spoken.iter().any(|setpoint| rates(setpoint).iter().any(|rate| rate.abs() > 0.0));
        let mut stopped = false;
        for _ in 0..110 {
            take_step(&mut world, places, Step::Turn { heading_deg });
            look_on(&mut world, places, flags, Duration::from_millis(100));
            for setpoint in check_what_was_said(&mut world, places)? {
                let [_, pitch, yaw] = rates(&setpoint);
                stopped |= (pitch, yaw) == (0.0, 0.0);
                prop_assert!(!stopped || !(pitch.abs() > 0.0 || yaw.abs() > 0.0), "it turns again");
            }
        }
        prop_assert!(stopped == by_rates, "by rates: {by_rates}, zero rates: {stopped}");
        for _ in 0..5 {
            take_step(&mut world, places, Step::Turn { heading_deg });
            look_on(&mut world, places, flags, Duration::from_millis(200));
        }
        let held = check_what_was_said(&mut world, places)?;
        prop_assert!(held.len() >= 15, "it is held");
        prop_assert!(held.windows(2).all(|pair| same(&pair[0], &pair[1])), "it is still being moved");
    }
}

impl Step {
    /// Who is heard, if anybody.
    fn speaker(&self) -> Option<MavId> {
        match self {
            Self::Say { sender, .. } | Self::Babble { sender, .. } => Some(SENDERS[*sender]),
            Self::Turn { .. } | Self::Fly { .. } => Some(AUTOPILOT),
            Self::Look { .. } => Some(GIMBAL),
            Self::Wait { .. } => None,
        }
    }

    /// The ids of a CONFIGURE that is for our gimbal.
    fn configure(&self) -> Option<(MavId, [f32; 4])> {
        let Self::Say { sender, message } = self else { return None };
        let MavMessage::COMMAND_LONG(command) = &**message else { return None };
        let for_us = [(1, 191), (1, 0), (0, 0)].contains(&(command.target_system, command.target_component));
        let gimbal = command.param7;
        if command.command != 1001 || !for_us || !(gimbal.is_nan() || gimbal == 0.0 || gimbal == 154.0) {
            return None;
        }
        Some((SENDERS[*sender], [command.param1, command.param2, command.param3, command.param4]))
    }
}

/// Whether the gimbal is told to turn.
fn is_moved(setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> bool {
    rates(setpoint).iter().any(|rate| rate.abs() > 0.0)
}

/// Does one step; the results with which we answered it.
fn take_step(world: &mut World, places: Places, step: Step) -> Vec<u8> {
    let place_of = |sender: MavId| if sender.system == 1 { places.autopilot } else { places.ground };
    match step {
        Step::Say { sender, message } => {
            let is_command = matches!(*message, MavMessage::COMMAND_LONG(_) | MavMessage::COMMAND_INT(_));
            let sender = SENDERS[sender];
            let before = world.arrivals(place_of(sender)).len();
            world.send(place_of(sender), sender, &message);
            let answers = &world.arrivals(place_of(sender))[before..];
            let answers = answers.iter().filter(|answer| answer.id() == 77 && answer.source() == MANAGER);
            let answers: Vec<u8> = answers.map(|answer| answer.decode::<COMMAND_ACK_DATA>().result).collect();
            assert!(is_command || answers.is_empty(), "a message is not answered");
            answers
        }
        Step::Babble { sender, id, payload } => {
            let sender = SENDERS[sender];
            world.send_bytes(place_of(sender), &frame(sender, id, &payload));
            Vec::new()
        }
        Step::Look { pitch_deg, yaw_deg, flags, failure_flags } => {
            let status = device_status(world.now, flags, pitch_deg, yaw_deg);
            let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: u32::MAX, failure_flags, ..status };
            world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
            Vec::new()
        }
        Step::Turn { heading_deg } => {
            let state = crate::support::script::autopilot_state(world.now, MavId::new(0, 0), heading_deg);
            world.send(places.autopilot, AUTOPILOT, &MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(state));
            Vec::new()
        }
        Step::Fly { latitude_deg, altitude_m } => {
            let position = global_position(world.now, [latitude_deg, 8.5, altitude_m], 50.0);
            world.send(places.autopilot, AUTOPILOT, &position);
            Vec::new()
        }
        Step::Wait { millis } => {
            look_on(world, places, 44, Duration::from_millis(millis));
            Vec::new()
        }
    }
}

/// Looks at everything that was sent since the last time; the setpoints among it.
fn check_what_was_said(
    world: &mut World,
    places: Places,
) -> Result<Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA>, TestCaseError> {
    let snapshot = world.snapshot();
    let gimbal = &snapshot.gimbals[0];
    let mut setpoints = Vec::new();
    for place in [places.autopilot, places.gimbal, places.ground] {
        let heard = world.take(place);
        let own: Vec<Arrival> = heard.iter().filter(|arrival| arrival.source() == MANAGER).cloned().collect();
        for told in of::<GIMBAL_MANAGER_STATUS_DATA>(&own) {
            for (system, component) in [
                (told.primary_control_sysid, told.primary_control_compid),
                (told.secondary_control_sysid, told.secondary_control_compid),
            ] {
                prop_assert_eq!(system == 0, component == 0, "half a pair: {:?}", told);
            }
        }
        if let Some(told) = of::<GIMBAL_MANAGER_STATUS_DATA>(&own).last() {
            let id = |system, component| Some(MavId::new(system, component).to_string()).filter(|id| id != "0/0");
            prop_assert_eq!(&gimbal.primary, &id(told.primary_control_sysid, told.primary_control_compid));
            prop_assert_eq!(&gimbal.secondary, &id(told.secondary_control_sysid, told.secondary_control_compid));
        }
        for ack in of::<COMMAND_ACK_DATA>(&own) {
            prop_assert!(ack.result <= 4 || ack.result == 9, "{:?}", ack);
        }
        // Setpoints of others may go where no gimbal of ours is.
        let relevant = |arrival: &&Arrival| place == places.gimbal || arrival.source() == MANAGER;
        for arrival in heard.iter().filter(|arrival| arrival.id() == 284).filter(relevant) {
            prop_assert!(place == places.gimbal, "a setpoint where the gimbal is not");
            prop_assert_eq!(arrival.source(), MANAGER);
            let setpoint: GIMBAL_DEVICE_SET_ATTITUDE_DATA = arrival.decode();
            prop_assert_eq!((setpoint.target_system, setpoint.target_component), (1, 154));
            let frames = setpoint.flags & (32 | 64);
            prop_assert!(frames == 32 || frames == 64, "flags {}", setpoint.flags);
            prop_assert_eq!(setpoint.flags & 16 != 0, frames == 64, "flags {}", setpoint.flags);
            let square: f32 = setpoint.q.iter().map(|number| number * number).sum();
            let no_angles = setpoint.q.iter().all(|number| number.is_nan());
            prop_assert!(no_angles || (square - 1.0).abs() < 1e-4, "{:?}", setpoint);
            prop_assert!(rates(&setpoint).iter().all(|rate| !rate.is_infinite()), "{:?}", setpoint);
            setpoints.push(setpoint);
        }
    }
    Ok(setpoints)
}

fn rates(setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> [f32; 3] {
    [setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]
}

/// The same to the last bit, NaN included.
fn same(one: &GIMBAL_DEVICE_SET_ATTITUDE_DATA, other: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> bool {
    let bits = |setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA| {
        (setpoint.q.map(f32::to_bits), rates(setpoint).map(f32::to_bits), setpoint.flags)
    };
    bits(one) == bits(other)
}

fn is_turning(world: &World) -> bool {
    let setpoint = &world.snapshot().gimbals[0].setpoint;
    setpoint.as_ref().is_some_and(|setpoint| setpoint.mode == "rate")
}

fn is_nudged(world: &World) -> bool {
    let setpoint = &world.snapshot().gimbals[0].setpoint;
    setpoint.as_ref().is_some_and(|setpoint| (setpoint.nudge_pitch_deg, setpoint.nudge_yaw_deg) != (0.0, 0.0))
}

fn introduce(world: &mut World, places: Places) {
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.ground, GCS, &ground_heartbeat());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(Timestamp::ZERO, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    look_on(world, places, 44, Duration::from_millis(100));
}

/// Time passes while the gimbal says that it is well and looks ahead.
fn look_on(world: &mut World, places: Places, flags: u16, duration: Duration) {
    let status = device_status(world.now, flags, 0.0, 0.0);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { time_boot_ms: u32::MAX, ..status };
    let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status);
    world.run_with(duration, &[(Duration::from_millis(250), places.gimbal, GIMBAL, status)]);
}

/// A whole frame with any payload.
fn frame(source: MavId, id: u32, payload: &[u8]) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let len = u8::try_from(payload.len()).expect("a payload has at most 255 bytes");
    let mut frame = vec![0xfd, len, 0, 0, 0, source.system, source.component, low, middle, high];
    frame.extend_from_slice(payload);
    let crc_extra = message_shape(id).expect("a known message").crc_extra;
    let sum = checksum(&frame[1..], crc_extra).to_le_bytes();
    frame.extend_from_slice(&sum);
    frame
}

/// A demand with a rate on one axis at least, and an angle, a rate or nothing on the other.
fn rate_demand() -> BoxedStrategy<MavMessage> {
    let rate = || prop_oneof![0.01_f32..1.0, -1.0_f32..-0.01];
    let other = || {
        prop_oneof![
            Just((NAN, NAN)),
            (-1.0_f32..0.4).prop_map(|angle| (angle, NAN)),
            rate().prop_map(|rate| (NAN, rate))
        ]
    };
    let flags = prop_oneof![Just(44_u32), Just(92), Just(12), Just(28), Just(0)];
    (rate(), other(), any::<bool>(), flags, 0..4_u8)
        .prop_map(|(rate, other, pitch_turns, flags, kind)| {
            let ((pitch, pitch_rate), (yaw, yaw_rate)) =
                if pitch_turns { ((NAN, rate), other) } else { (other, (NAN, rate)) };
            match kind {
                0 => set_pitchyaw(pitch, yaw, pitch_rate, yaw_rate, flags),
                1 => set_attitude([NAN; 4], [NAN, pitch_rate, yaw_rate], flags),
                2 => set_manual_control(pitch, yaw, pitch_rate, yaw_rate),
                _ => {
                    let degrees = [pitch, yaw, pitch_rate, yaw_rate].map(f32::to_degrees);
                    command_int(MANAGER, 1000, degrees, flags as i32, 0, 154.0)
                }
            }
        })
        .boxed()
}

fn takeover() -> BoxedStrategy<Takeover> {
    prop_oneof![Just(Takeover::Open), Just(Takeover::Ask), Just(Takeover::Priority), Just(Takeover::Exclusive)].boxed()
}

fn step() -> BoxedStrategy<Step> {
    let sender = 0..SENDERS.len();
    prop_oneof![
        12 => (sender.clone(), message()).prop_map(|(sender, message)| Step::Say { sender, message: Box::new(message) }),
        3 => (sender, prop_oneof![Just(75_u32), Just(76), Just(156), Just(157), Just(282), Just(284), Just(287), Just(288)], any::<[u8; 40]>(), 1_usize..40)
            .prop_map(|(sender, id, mut payload, len)| {
                // No CONFIGURE by chance: the rule beside it would not hear it.
                payload[29] |= 0x80;
                let len = len.min(message_shape(id).expect("a known message").max_len.into());
                Step::Babble { sender, id, payload: payload[..len].to_vec() }
            }),
        2 => (-90.0..90.0, -180.0..180.0, 0_u16..2048, prop_oneof![4 => Just(0_u32), 1 => 0_u32..1024])
            .prop_map(|(pitch_deg, yaw_deg, flags, failure_flags)| Step::Look { pitch_deg, yaw_deg, flags, failure_flags }),
        2 => (0.0..360.0).prop_map(|heading_deg| Step::Turn { heading_deg }),
        2 => (47.4..47.401, 100.0..103.0)
            .prop_map(|(latitude_deg, altitude_m)| Step::Fly { latitude_deg, altitude_m }),
        4 => prop_oneof![3 => 0_u64..500, 1 => 0_u64..12_000].prop_map(|millis| Step::Wait { millis }),
    ].boxed()
}

fn message() -> BoxedStrategy<MavMessage> {
    let numbers = || [number(), number(), number(), number()];
    prop_oneof![
        4 => (target(), claims(), device_id())
            .prop_map(|(target, [a, b, c, d], id)| command_long(target, 1001, &[a, b, c, d, NAN, NAN, id])),
        4 => (target(), angle(), angle(), number(), number(), flags(), device_id()).prop_map(
            |(target, pitch, yaw, pitch_rate, yaw_rate, flags, id)| {
                command_long(target, 1000, &[pitch, yaw, pitch_rate, yaw_rate, flags as f32, NAN, id])
            }
        ),
        2 => (target(), numbers(), flags(), device_id())
            .prop_map(|(target, params, flags, id)| command_int(target, 1000, params, flags as i32, 0, id)),
        1 => (target(), prop_oneof![Just(195_u16), Just(197), Just(512), Just(511), Just(510), Just(201), Just(2000)],
              number(), number(), number(), number())
            .prop_map(|(target, command, a, b, c, d)| command_long(target, command, &[a, b, NAN, NAN, c, d, 500.0])),
        2 => (target(), prop_oneof![Just(195_u16), Just(197)], device_id(), prop_oneof![4 => Just(0_u8), 1 => 0_u8..12],
              474_000_000..474_010_000, 100.0_f32..103.0)
            .prop_map(|(target, command, id, frame, x, z)| {
                in_frame(frame, command_int(target, command, [id, NAN, NAN, NAN], x, 85_000_000, z))
            }),
        2 => (target(), prop_oneof![Just(204_u16), Just(205)], number(), angle(), angle(), mount_mode(), number(), mount_mode())
            .prop_map(|(target, command, a, b, c, first, d, last)| {
                let params = if command == 204 { [first, a, b, c, d, d, last] } else { [a, b, c, 100.0, 47.4, 8.5, last] };
                command_long(target, command, &params)
            }),
        1 => (target(), numbers()).prop_map(|(target, q)| command_long(target, 220, &q)),
        1 => (target(), 0_u8..9).prop_map(|(target, mode)| mount_configure(target, mode)),
        2 => (target(), prop_oneof![3 => Just(20_000), 1 => Just(i32::MAX)].prop_flat_map(|most| [-most..most, -most..most, -most..most]))
            .prop_map(|(target, inputs)| mount_control(target, inputs)),
        3 => (angle(), angle(), number(), number(), flags())
            .prop_map(|(pitch, yaw, pitch_rate, yaw_rate, flags)| set_pitchyaw(pitch, yaw, pitch_rate, yaw_rate, flags)),
        2 => (numbers(), number(), number(), number(), flags())
            .prop_map(|(q, x, y, z, flags)| set_attitude(q, [x, y, z], flags)),
        2 => (number(), number(), flags()).prop_map(|(y, z, flags)| set_attitude([NAN; 4], [NAN, y, z], flags)),
        2 => numbers().prop_map(|[a, b, c, d]| set_manual_control(a, b, c, d)),
    ].boxed()
}

fn mount_mode() -> BoxedStrategy<f32> {
    prop_oneof![8 => (0_u8..8).prop_map(f32::from), 1 => number()].boxed()
}

fn target() -> BoxedStrategy<MavId> {
    prop_oneof![8 => Just(MANAGER), 1 => Just(MavId::new(1, 0)), 1 => Just(MavId::new(0, 0)), 1 => Just(GIMBAL)].boxed()
}

fn device_id() -> BoxedStrategy<f32> {
    prop_oneof![6 => Just(154.0_f32), 3 => Just(0.0), 1 => number()].boxed()
}

/// The four ids of CONFIGURE: mostly whole pairs.
fn claims() -> BoxedStrategy<[f32; 4]> {
    let pair = || {
        prop_oneof![
            3 => Just([-1.0_f32, -1.0]),
            4 => Just([-2.0, -2.0]),
            2 => Just([-3.0, -3.0]),
            1 => Just([0.0, 0.0]),
            3 => (0..SENDERS.len()).prop_map(|at| [SENDERS[at].system.into(), SENDERS[at].component.into()]),
            2 => [number(), number()],
        ]
    };
    (pair(), pair()).prop_map(|([a, b], [c, d])| [a, b, c, d]).boxed()
}

fn flags() -> BoxedStrategy<u32> {
    prop_oneof![4 => Just(44_u32), 2 => Just(92), 2 => Just(12), 1 => Just(28), 4 => 0_u32..1024, 1 => any::<u32>()]
        .boxed()
}

fn angle() -> BoxedStrategy<f32> {
    prop_oneof![3 => -3.0_f32..3.0, 2 => -90.0_f32..90.0, 3 => Just(NAN), 1 => number()].boxed()
}

fn number() -> BoxedStrategy<f32> {
    prop_oneof![
        6 => -1.0_f32..1.0,
        4 => Just(NAN),
        2 => Just(0.0),
        1 => prop_oneof![Just(-1.0_f32), Just(-2.0), Just(-3.0), Just(255.0), Just(281.0), Just(0.5)],
        1 => prop_oneof![Just(f32::INFINITY), Just(f32::NEG_INFINITY), Just(f32::MAX), Just(f32::MIN_POSITIVE)],
        1 => any::<f32>(),
    ]
    .boxed()
}
