//! What is asked of it by its name: every function of the vendor's SDK, in both generations.

use gimbald::geometry::AxisLimits;
use gimbald::gimbals::details::AxisDetails;
use gimbald::gimbals::gremsy::modes::{self, ControlMode};
use gimbald::gimbals::gremsy::packet::{self, MessageRate};
use gimbald::gimbals::operation::{
    Axis, AxisMotion, EncoderUnit, MotorAxis, MotorControl, Motors, OperationError, RadioType, ResetMode, Restart,
    Stream, StreamRate, YawMode,
};
use gimbald::manager::asked::NotDone;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_INFORMATION_DATA, GIMBAL_MANAGER_INFORMATION_DATA, MavMessage,
    PARAM_REQUEST_LIST_DATA,
};

use super::*;
use crate::support::script::{NAN, of, request_message, set_pitchyaw};
use crate::support::world::GIMBAL;

fn controlled(generation: Generation) -> (World, Places) {
    controlled_with(device(generation))
}

fn controlled_with(device: DeviceSettings) -> (World, Places) {
    let (mut world, places) = running_with(device, GremsySettings::default());
    take_control(&mut world);
    world.forget();
    (world, places)
}

fn failed(error: OperationError) -> Option<Answer> {
    Some(Err(NotDone::Operation(error)))
}

/// `set_gimbal_motor`: 31010 in v1; in v2 284 with RETRACT or NEUTRAL until 285 shows it.
#[test]
fn motors_off_and_on() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = controlled(generation);
        for (motors, on, mode) in [(Motors::Off, false, ControlMode::Off), (Motors::On, true, ControlMode::Reset)] {
            world.forget();
            assert_eq!(operate(&mut world, places, Operation::Motors(motors)), Some(Ok(())), "{generation:?} {on}");
            let details = seen(&world).details;
            let shown = match generation {
                _ if !on => "off",
                Generation::V1 => "follow",
                Generation::V2 => "reset",
            };
            assert_eq!((details.motors_on, details.mode.as_deref()), (Some(on), Some(shown)), "{generation:?}");
            let (commands, setpoints) = orders(&mut world, places);
            match generation {
                Generation::V1 => assert_eq!((commands, setpoints), (vec![packet::set_motors(GIMBAL, on)], vec![])),
                Generation::V2 => {
                    assert_eq!(commands, []);
                    assert_eq!(setpoints[0].flags, modes::set_mode(GIMBAL, mode, Some(YawFrame::Vehicle)).flags);
                    assert!(setpoints.len() <= 5);
                }
            }
        }
    }
}

/// The motors stay off whatever else is asked while they are being switched off: a parameter, or the same once more. Where it was told to look before is not said again.
#[test]
fn what_is_asked_meanwhile_does_not_undo_an_operation() {
    let parameter = Operation::SetParameter { name: "GYRO_LPF".to_owned(), value: 6.0 };
    for meanwhile in [parameter, Operation::Motors(Motors::Off), Operation::SetCombinedAttitude(true)] {
        for generation in [Generation::V1, Generation::V2] {
            let (mut world, places) = controlled(generation);
            point(&mut world, -30.0, 20.0);
            run(&mut world, places, 5 * SECOND);
            world.forget();
            let off = Asked::Operation(Operation::Motors(Motors::Off));
            world.ask_by_name("camera", &off);
            let meanwhile = Asked::Operation(meanwhile.clone());
            world.ask_by_name("camera", &meanwhile);

            run(&mut world, places, 8 * SECOND);

            assert_eq!(seen(&world).details.motors_on, Some(false), "{generation:?} {meanwhile:?}");
            assert_eq!(seen(&world).setpoint, None, "{generation:?} {meanwhile:?}");
            let (commands, setpoints) = orders(&mut world, places);
            assert!(commands.iter().all(|command| *command == packet::set_motors(GIMBAL, false)), "{commands:?}");
            let retracts = |setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA| setpoint.flags & 1 != 0;
            assert!(setpoints.iter().all(retracts), "{generation:?} {meanwhile:?}: {setpoints:?}");
        }
    }
}

/// `set_gimbal_lock_mode_sync`, `set_gimbal_follow_mode_sync`: 31011 in v1; in v2 flags until 285 shows them.
#[test]
fn lock_and_follow() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = controlled(generation);
        for (mode, name) in [(YawMode::Lock, "lock"), (YawMode::Follow, "follow")] {
            world.forget();
            assert_eq!(operate(&mut world, places, Operation::SetYawMode(mode)), Some(Ok(())), "{generation:?} {name}");
            assert_eq!(seen(&world).details.mode.as_deref(), Some(name), "{generation:?}");
            let (commands, setpoints) = orders(&mut world, places);
            let command = if mode == YawMode::Lock { packet::lock(GIMBAL) } else { packet::follow(GIMBAL) };
            match generation {
                Generation::V1 => assert_eq!((commands, setpoints), (vec![command], vec![])),
                Generation::V2 => {
                    assert_eq!(commands, []);
                    let lock = if mode == YawMode::Lock { 0x1c | 0x40 } else { 0x0c | 0x20 };
                    assert!(setpoints.iter().all(|setpoint| setpoint.flags == lock), "{setpoints:?}");
                }
            }
        }
    }
}

/// Gimbal statement 26: "v2 lock with a silent gimbal returns TIMEOUT after 5 sends within 0.5 ± 0.1 s."
#[test]
fn statement_26_a_silent_gimbal_is_told_five_times() {
    let (mut world, places) = controlled(Generation::V2);
    world.remove(places.gimbal);
    let asked = Asked::Operation(Operation::SetYawMode(YawMode::Lock));
    let id = world.ask_by_name("camera", &asked);
    run(&mut world, places, Duration::from_millis(499));
    assert_eq!(world.answers.last().map(|(last, _)| *last == id), Some(false));
    run(&mut world, places, Duration::from_millis(1));
    assert_eq!(world.answers.last(), Some(&(id, Err(NotDone::Operation(OperationError::NoAnswer)))));
    assert_eq!(orders(&mut world, places).1.len(), 5);
}

/// `set_gimbal_reset_mode`, and mapping.
#[test]
#[rustfmt::skip]
fn resets_turn_it_where_they_say() {
    for (operation,                                        v1,                           looks) in [
        (Operation::Reset(ResetMode::Yaw),                 ResetMode::Yaw,               (-30.0, 0.0)),
        (Operation::Reset(ResetMode::PitchAndYaw),         ResetMode::PitchAndYaw,       (0.0, 0.0)),
        (Operation::Reset(ResetMode::PitchDownUpAndYaw),   ResetMode::PitchDownUpAndYaw, (-90.0, 0.0)),
        (Operation::Reset(ResetMode::PitchDownUp),         ResetMode::PitchDownUp,       (-90.0, 45.0)),
        (Operation::Reset(ResetMode::PitchMapping),        ResetMode::PitchMapping,      (-90.0, 45.0)),
        (Operation::Mapping,                               ResetMode::PitchMapping,      (-90.0, 45.0)),
    ] {
        for generation in [Generation::V1, Generation::V2] {
            let (mut world, places) = controlled(generation);
            point(&mut world, -30.0, 45.0);
            run(&mut world, places, 5 * SECOND);
            world.forget();
            assert_eq!(operate(&mut world, places, operation.clone()), Some(Ok(())), "{generation:?} {operation:?}");
            let (pitch, yaw) = super::looks(&world);
            let off = (pitch - looks.0).abs().max((yaw - looks.1).abs());
            assert!(off < 2.0, "{generation:?} {operation:?}: {pitch:.1} {yaw:.1}");
            let (commands, setpoints) = orders(&mut world, places);
            match generation {
                Generation::V1 => assert_eq!((commands, setpoints), (vec![packet::reset(GIMBAL, v1)], vec![])),
                Generation::V2 => {
                    assert!(commands.is_empty() && (1..=5).contains(&setpoints.len()), "{setpoints:?}");
                    let is_mapping = operation == Operation::Mapping;
                    let is_as_asked = |told: &GIMBAL_DEVICE_SET_ATTITUDE_DATA| (told.flags & 0x4000 != 0) == is_mapping;
                    assert!(setpoints.iter().all(is_as_asked), "{operation:?}: {setpoints:?}");
                }
            }
        }
    }
}

/// What turns is stopped before anything else takes its place.
#[test]
fn an_operation_stops_what_turns() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = controlled(generation);
        let rate = gimbald::geometry::AngularRate::from_degrees_per_second;
        let turn = Asked::Turn { roll: None, pitch: rate(0.0), yaw: rate(15.0), yaw_frame: YawFrame::Vehicle };
        world.ask_by_name("camera", &turn);
        run(&mut world, places, SECOND);
        assert_eq!(operate(&mut world, places, Operation::Reset(ResetMode::PitchAndYaw)), Some(Ok(())));
        assert_looks(&world, 0.0, 0.0);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, 0.0, 0.0);
    }
}

/// `set_gimbal_rc_input_sync`: 204 with p1 = 3; the next demand takes it back.
#[test]
fn radio_control_has_it_until_the_next_demand() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = controlled(generation);
        assert_eq!(operate(&mut world, places, Operation::RadioControl), Some(Ok(())), "{generation:?}");
        assert_eq!(orders(&mut world, places), (vec![packet::hand_to_rc(GIMBAL)], vec![]));
        // It is steered from then on, for as long as anybody likes.
        for pitch in [-20.0, -30.0] {
            point(&mut world, pitch, 10.0);
            run(&mut world, places, 5 * SECOND);
            assert_looks(&world, pitch, 10.0);
        }
        // Also where the demand names one axis only.
        assert_eq!(operate(&mut world, places, Operation::RadioControl), Some(Ok(())), "{generation:?}");
        for yaw in [20.0, 30.0] {
            turn_to(&mut world, yaw);
            run(&mut world, places, 5 * SECOND);
            assert_looks(&world, -30.0, yaw);
        }
        // And after it was started again while its radio control had it.
        assert_eq!(operate(&mut world, places, Operation::RadioControl), Some(Ok(())), "{generation:?}");
        assert_eq!(operate(&mut world, places, Operation::Restart(Restart::Reboot)), Some(Ok(())), "{generation:?}");
        assert_eq!(seen(&world).details.stage.as_deref(), Some("restarting"));
        run(&mut world, places, 20 * SECOND);
        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"));
        point(&mut world, -20.0, 10.0);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, -20.0, 10.0);
    }
}

/// `set_msg_encoder_rate` and the others; gimbal statement 18: "set_msg rate 50 Hz yields p2 = 20000; −1 and 0 are passed
/// unchanged."
#[test]
#[rustfmt::skip]
fn statement_18_stream_rates() {
    let (mut world, places) = controlled(Generation::V2);
    for (stream,                   rate,                    id,    interval,   vendor) in [
        (Stream::Encoders,         StreamRate::Hertz(50),   158.0, 20_000.0,   MessageRate::Hertz(50)),
        (Stream::MountOrientation, StreamRate::Hertz(10),   265.0, 100_000.0,  MessageRate::Hertz(10)),
        (Stream::AttitudeStatus,   StreamRate::Hertz(30),   285.0, 33_333.0,   MessageRate::Hertz(30)),
        (Stream::RawImu,           StreamRate::Off,         27.0,  -1.0,       MessageRate::Off),
        (Stream::RawImu,           StreamRate::Default,     27.0,  0.0,        MessageRate::Default),
        (Stream::RawImu,           StreamRate::Hertz(20),   27.0,  50_000.0,   MessageRate::Hertz(20)),
    ] {
        world.forget();
        assert_eq!(operate(&mut world, places, Operation::SetStreamRate { stream, rate }), Some(Ok(())), "{stream:?}");
        let sent = told(&mut world, places, command::SET_MESSAGE_INTERVAL).remove(0);
        assert_eq!((sent.param1, sent.param2), (id, interval), "{stream:?}");
        assert_eq!(sent, packet::set_message_rate(GIMBAL, id as u32, vendor));
    }
    let imu = seen(&world).details.imu.expect("it is sent");
    assert!((imu.acceleration_g[2] - 1.0).abs() < 0.01 && imu.age_ms < 100, "{imu:?}");
    let streams = seen(&world).details.streams;
    assert_eq!(streams["raw_imu"].wanted_hz, Some(20.0));
    assert!((streams["attitude_status"].measured_hz.expect("it comes") - 30.0).abs() < 2.0, "{streams:?}");
    let invalid = Operation::SetStreamRate { stream: Stream::RawImu, rate: StreamRate::Hertz(0) };
    assert_eq!(operate(&mut world, places, invalid), failed(OperationError::Invalid("a rate is 1 to 200 times a second".to_owned())));
    // A v1 gimbal has no 285.
    let (mut world, places) = controlled(Generation::V1);
    let attitude = Operation::SetStreamRate { stream: Stream::AttitudeStatus, rate: StreamRate::Hertz(10) };
    assert_eq!(operate(&mut world, places, attitude), failed(OperationError::UnsupportedByDevice));
}

/// `request_gimbal_device_info`, and all parameters once more.
#[test]
fn it_is_asked_once_more() {
    let (mut world, places) = controlled(Generation::V2);
    assert_eq!(operate(&mut world, places, Operation::RequestInformation), Some(Ok(())));
    assert_eq!(told(&mut world, places, command::REQUEST_MESSAGE), [packet::request_message(GIMBAL, 283)]);
    // A ground station asks whoever tells it: a v2 gimbal itself, the manager of a v1 gimbal.
    for (generation, speaker, id) in [(Generation::V1, MANAGER, 1), (Generation::V2, GIMBAL, 0)] {
        let (mut world, places) = running(generation);
        world.send(places.ground, GCS, &ground_heartbeat());
        world.send(places.ground, GCS, &request_message(speaker, 283));
        run(&mut world, places, SECOND);
        let told = world.take(places.ground);
        let told: Vec<_> = told.iter().filter(|told| told.id() == 283).collect();
        assert_eq!(told.iter().map(|told| told.source()).collect::<Vec<_>>(), [speaker], "{generation:?}");
        assert_eq!(told[0].decode::<GIMBAL_DEVICE_INFORMATION_DATA>().gimbal_device_id, id, "{generation:?}");
    }
    assert_eq!(operate(&mut world, places, Operation::RefreshParameters), Some(Ok(())));
    let lists: Vec<PARAM_REQUEST_LIST_DATA> = from_manager(&mut world, places);
    assert_eq!(lists.len(), 1);
}

/// `set_gimbal_config_…_axis`, `set_gimbal_motor_control`, `set_rc_type`, `set_gimbal_encoder_type_send`,
/// `set_gimbal_combine_attitude`, `set_gimbal_return_home_when_change_mode`, `set_limit_angle_…`: written, told back, and seen.
/// Gimbal statements 15 and 16: "reading back gives −90…+45", "un-negated (profile-dependent) and round-trip".
#[test]
#[rustfmt::skip]
fn settings_are_written_and_read_back() {
    let degrees = Angle::from_degrees;
    let limits = |min, max| AxisLimits::new(degrees(min), degrees(max)).expect("in order");
    // Each axis has values of its own, so that none is taken for another's. Roll does not follow.
    let motion = |more: f64, follows: bool, reversed| AxisMotion {
        control_speed_dps: Some(45.0 + more),
        control_smoothing: Some(70.0 + more),
        follow_speed: follows.then_some(50.0 + more),
        follow_smoothing: follows.then_some(30.0 + more),
        follow_window_deg: follows.then_some(8.0 + more),
        reversed: Some(reversed),
    };
    let motors = MotorControl {
        tilt: MotorAxis { stiffness: Some(25.0), hold_strength: Some(35.0) },
        roll: MotorAxis { stiffness: Some(26.0), hold_strength: Some(36.0) },
        pan: MotorAxis { stiffness: Some(27.0), hold_strength: Some(37.0) },
        gyro_filter: Some(3.0),
        output_filter: Some(2.0),
        ..MotorControl::default()
    };
    let settings = [
        Operation::SetLimits { axis: Axis::Tilt, limits: limits(-80.0, 30.0) },
        Operation::SetLimits { axis: Axis::Roll, limits: limits(-20.0, 25.0) },
        Operation::SetLimits { axis: Axis::Pan, limits: limits(-100.0, 120.0) },
        Operation::SetAxisMotion { axis: Axis::Tilt, motion: motion(1.0, true, false) },
        Operation::SetAxisMotion { axis: Axis::Roll, motion: motion(2.0, false, true) },
        Operation::SetAxisMotion { axis: Axis::Pan, motion: motion(3.0, true, true) },
        Operation::SetMotorControl(motors),
        Operation::SetEncoderUnit(EncoderUnit::Angles),
        Operation::SetCombinedAttitude(true),
        Operation::SetHomeOnModeChange(true),
    ];
    for device in [device(Generation::V1), device(Generation::V2), with_firmware(Generation::V1, 7, 5, 6)] {
        let firmware = device.firmware;
        let (mut world, places) = controlled_with(device);
        for operation in &settings {
            assert_eq!(operate(&mut world, places, operation.clone()), Some(Ok(())), "{firmware} {operation:?}");
        }
        let is_old = firmware.y < 7;
        let sets = sets(&mut world, places);
        let written = |name: &str| sets.iter().rev().find(|(written, _)| written == name).map(|(_, value)| *value);
        let (tilt, bits) = if is_old { (["TRAVEL_MIN_PIT", "TRAVEL_MAX_PIT"], "JOY_AXIS") } else { (["RC_LIM_MIN_TILT", "RC_LIM_MAX_TILT"], "RC_REVERSE_AXIS") };
        let expected = if is_old { [-80.0, 30.0] } else { [-30.0, 80.0] };
        assert_eq!(tilt.map(written), expected.map(Some), "{firmware}");
        assert_eq!(written(bits), Some(f32::from(0x02_u8 | 0x04 | 0x08 | 0x10)), "{firmware}");

        let details = seen(&world).details;
        for (axis,   min,    max,   more, follows, reversed, stiffness, hold) in [
            ("tilt", -80.0,  30.0,  1.0,  true,    false,    25.0,      35.0),
            ("roll", -20.0,  25.0,  2.0,  false,   true,     26.0,      36.0),
            ("pan",  -100.0, 120.0, 3.0,  true,    true,     27.0,      37.0),
        ] {
            let motion = motion(more, follows, reversed);
            let expected = AxisDetails {
                min_deg: Some(min),
                max_deg: Some(max),
                control_speed_dps: motion.control_speed_dps,
                control_smoothing: motion.control_smoothing,
                follow_speed: motion.follow_speed,
                follow_smoothing: motion.follow_smoothing,
                follow_window_deg: motion.follow_window_deg,
                reversed: motion.reversed,
                stiffness: Some(stiffness),
                hold_strength: Some(hold),
            };
            assert_eq!(details.axes[axis], expected, "{firmware} {axis}");
        }
        assert_eq!((details.gyro_filter, details.output_filter), (Some(3.0), Some(2.0)));
        assert_eq!((details.combined_attitude, details.home_on_mode_change), (Some(true), Some(true)));
        assert_eq!(details.encoder_unit.as_deref(), Some("angles"));
        // What it is told from then on stays within.
        point(&mut world, -90.0, 0.0);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, -80.0, 0.0);
    }
}

/// `get_limit_angle_…` by MAVLink: 280 of the manager, and 283 of whoever speaks for the gimbal, have the limits that it has.
#[test]
fn its_limits_are_told_to_clients() {
    let limits = |min, max| AxisLimits::new(Angle::from_degrees(min), Angle::from_degrees(max)).expect("in order");
    for (generation, speaker) in [(Generation::V1, MANAGER), (Generation::V2, GIMBAL)] {
        let (mut world, places) = controlled(generation);
        for (axis, limits) in
            [(Axis::Tilt, limits(-80.0, 30.0)), (Axis::Roll, limits(-20.0, 25.0)), (Axis::Pan, limits(-100.0, 120.0))]
        {
            let set = Operation::SetLimits { axis, limits };
            assert_eq!(operate(&mut world, places, set), Some(Ok(())), "{generation:?} {axis:?}");
        }
        let expected = [-20.0, 25.0, -80.0, 30.0, -100.0, 120.0];
        let degrees = |limits: [f32; 6]| limits.map(|limit| (f64::from(limit).to_degrees() * 100.0).round() / 100.0);

        world.forget();
        world.send(places.ground, GCS, &request_message(speaker, 283));
        run(&mut world, places, SECOND);
        let told: Vec<GIMBAL_DEVICE_INFORMATION_DATA> = of(&world.take(places.ground));
        let [told] = &told[..] else { panic!("{generation:?}: {told:?}") };
        let limits = [told.roll_min, told.roll_max, told.pitch_min, told.pitch_max, told.yaw_min, told.yaw_max];
        assert_eq!(degrees(limits), expected, "{generation:?}: 283");

        world.send(places.ground, GCS, &request_message(MANAGER, 280));
        run(&mut world, places, SECOND);
        let told: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&world.take(places.ground));
        let told = told.last().expect("280");
        let limits = [told.roll_min, told.roll_max, told.pitch_min, told.pitch_max, told.yaw_min, told.yaw_max];
        assert_eq!(degrees(limits), expected, "{generation:?}: 280");
    }
}

/// A single parameter by its name, and what the gimbal does not take.
#[test]
fn a_parameter_by_its_name() {
    let (mut world, places) = controlled(Generation::V1);
    let set = |name: &str, value| Operation::SetParameter { name: name.to_owned(), value };
    let before = seen(&world).details.parameters["GYRO_LPF"];
    assert_eq!(operate(&mut world, places, set("GYRO_LPF", 6.0)), Some(Ok(())));
    assert_eq!(seen(&world).details.parameters["GYRO_LPF"], 6.0);
    let told = world.snapshot().events[0].clone();
    let text = format!("http asked for parameter GYRO_LPF = 6 (it was {before})");
    assert_eq!((told.what.as_str(), told.reason.as_deref(), told.text), ("operated", Some("set_parameter"), text));
    assert_eq!(
        operate(&mut world, places, set("MAV_TS_ENCNT", 5.0)),
        failed(OperationError::NoEffect("MAV_TS_ENCNT is 1".to_owned()))
    );
    assert_eq!(operate(&mut world, places, set("NO_SUCH_NAME", 5.0)), failed(OperationError::NoAnswer));
    assert_eq!(operate(&mut world, places, Operation::SetRadioType(RadioType::Herelink)), Some(Ok(())));
    assert_eq!(seen(&world).details.radio_type.as_deref(), Some("herelink"));
}

/// What a ground station sets passes through, and is known here: the daemon's own parameters do not stand in its way. It reads
/// what it likes, too.
#[test]
fn what_a_ground_station_sets_is_known() {
    use crate::support::world::heartbeat;
    use gimbald::wire::dialect::{CharArray, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};
    let (mut world, places) = running(Generation::V1);
    world.send(places.ground, GCS, &heartbeat(6, 8));
    let set = PARAM_SET_DATA {
        param_value: 9.0,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from("GYRO_LPF"),
        param_type: 4,
    };
    world.send(places.ground, GCS, &MavMessage::PARAM_SET(set));
    run(&mut world, places, SECOND);
    assert_eq!(seen(&world).details.parameters["GYRO_LPF"], 9.0);
    assert_eq!(sets(&mut world, places), []);
    let echoes: Vec<PARAM_VALUE_DATA> = crate::support::script::of(&world.take(places.ground));
    assert_eq!(echoes.iter().filter(|echo| echo.param_value == 9.0).count(), 1);
    let read = PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from("GYRO_LPF"),
    };
    world.send(places.ground, GCS, &MavMessage::PARAM_REQUEST_READ(read));
    run(&mut world, places, SECOND);
    let values: Vec<PARAM_VALUE_DATA> = crate::support::script::of(&world.take(places.ground));
    let values: Vec<_> = values.iter().map(|told| (told.param_id.to_str(), told.param_value)).collect();
    assert_eq!(values, [(Ok("GYRO_LPF"), 9.0)]);
}

/// Gimbal statement 7: "A lost ACK leads to re-sends with confirmation 1 and 2 and success if the third is acknowledged." 8:
/// "An ACK with target 0/0 is accepted; one with target 2/191 is ignored." 9: "ACK DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
/// and FAILED give four distinguishable driver errors." 10: "IN_PROGRESS keeps the request open and a following ACCEPTED
/// completes it."
#[test]
#[rustfmt::skip]
fn statements_7_to_10_answers_of_the_gimbal() {
    let after_the_third = Duration::from_millis(1_100);
    let at_once = Duration::from_millis(50);
    for (after,           target,   results,        expected,                                       sent) in [
        (after_the_third, (1, 191), &[0][..],       Some(Ok(())),                                   3),
        (at_once,         (0, 0),   &[0],           Some(Ok(())),                                   1),
        (at_once,         (2, 191), &[0],           failed(OperationError::NoAnswer),               3),
        (at_once,         (1, 191), &[2],           failed(OperationError::Denied),                 1),
        (at_once,         (1, 191), &[1],           failed(OperationError::Rejected),               1),
        (at_once,         (1, 191), &[3],           failed(OperationError::UnsupportedByDevice),    1),
        (at_once,         (1, 191), &[4],           failed(OperationError::Failed),                 1),
        (at_once,         (1, 191), &[5, 0],        Some(Ok(())),                                   1),
        (at_once,         (1, 191), &[5],           failed(OperationError::NoAnswer),               1),
    ] {
        let (mut world, places) = controlled(Generation::V1);
        world.remove(places.gimbal);
        let asked = Asked::Operation(Operation::RequestInformation);
        let id = world.ask_by_name("camera", &asked);
        run(&mut world, places, after);
        for result in results {
            let (target_system, target_component) = target;
            let ack = COMMAND_ACK_DATA {
                command: command::REQUEST_MESSAGE,
                result: *result,
                progress: 0,
                result_param2: 0,
                target_system,
                target_component,
            };
            world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack));
            run(&mut world, places, at_once);
        }
        for _ in 0..16 {
            // It beats, so it is not lost meanwhile.
            world.send(places.gimbal, GIMBAL, &crate::support::world::heartbeat(26, 8));
            run(&mut world, places, Duration::from_millis(500));
        }
        let answer = world.answers.iter().find(|(answered, _)| *answered == id).map(|(_, answer)| answer.clone());
        assert_eq!(answer, expected, "{target:?} {results:?}");
        let commands = told(&mut world, places, command::REQUEST_MESSAGE);
        let confirmations: Vec<u8> = commands.iter().map(|command| command.confirmation).collect();
        assert_eq!(confirmations, (0..sent).collect::<Vec<u8>>(), "{target:?} {results:?}");
    }
}

/// `get_gimbal_status`, `get_gimbal_timestamps`, `get_gimbal_version` and the rest of what the SDK reads.
#[test]
fn what_it_tells_is_shown() {
    for (generation, version) in [(Generation::V1, "7.7.3"), (Generation::V2, "7.8.9")] {
        let (world, _) = running(generation);
        let details = seen(&world).details;
        assert_eq!(details.version.as_deref(), Some(version));
        assert_eq!(details.operation.as_deref(), Some("on, follow"));
        assert_eq!((details.motors_on, details.mode.as_deref()), (Some(true), Some("follow")));
        assert_eq!((details.battery_v, details.load_percent), (Some(14.8), Some(42.0)));
        assert_eq!((details.not_aligned, details.faults), (vec![], vec![]));
        assert_eq!(details.radio_type.as_deref(), Some("sync"));
        let ages = &details.message_ages_ms;
        assert!(ages["HEARTBEAT"] <= 1_100 && ages["SYS_STATUS"] <= 1_100 && ages["MOUNT_STATUS"] <= 300, "{ages:?}");
        let attitude = match generation {
            Generation::V1 => "MOUNT_ORIENTATION",
            Generation::V2 => "GIMBAL_DEVICE_ATTITUDE_STATUS",
        };
        assert!(ages[attitude] <= 150, "{ages:?}");
    }
}

/// Nothing of it is done for a gimbal that is not there.
#[test]
fn a_gimbal_that_is_gone_does_nothing() {
    let (mut world, places) = controlled(Generation::V1);
    world.remove(places.gimbal);
    run(&mut world, places, 6 * SECOND);
    assert_eq!(seen(&world).state, "lost");
    assert_eq!(operate(&mut world, places, Operation::RefreshParameters), failed(OperationError::NotThere));
}

/// A demand that comes while a mode is being changed goes first.
#[test]
fn a_demand_ends_what_is_being_changed() {
    let (mut world, places) = controlled(Generation::V2);
    world.remove(places.gimbal);
    let asked = Asked::Operation(Operation::SetYawMode(YawMode::Lock));
    let changing = world.ask_by_name("camera", &asked);
    point(&mut world, -20.0, 0.0);
    let text = "another demand took its place".to_owned();
    assert_eq!(
        world.answers.iter().find(|(id, _)| *id == changing).map(|(_, answer)| answer.clone()),
        failed(OperationError::NoEffect(text))
    );
}

/// Everything asked has one answer. In v2 modes are taken one at a time: who asks for another one meanwhile is told so, and
/// neither loses the first nor takes its place; those that wait until it has stopped are no exception.
#[test]
fn modes_are_taken_one_at_a_time() {
    let rate = gimbald::geometry::AngularRate::from_degrees_per_second;
    let turn = Asked::Turn { roll: None, pitch: rate(0.0), yaw: rate(15.0), yaw_frame: YawFrame::Vehicle };
    for (turns, second) in [(false, Operation::Motors(Motors::On)), (true, Operation::Mapping)] {
        let (mut world, places) = controlled(Generation::V2);
        if turns {
            world.ask_by_name("camera", &turn);
            run(&mut world, places, SECOND);
        }
        let lock = Asked::Operation(Operation::SetYawMode(YawMode::Lock));
        world.answers.clear();
        let ids = [lock, Asked::Operation(second.clone())].map(|asked| world.ask_by_name("camera", &asked));
        run(&mut world, places, 8 * SECOND);

        let busy = Err(NotDone::Operation(OperationError::Busy));
        let mut answers = world.answers.clone();
        answers.sort_by_key(|(id, _)| id.0);
        assert_eq!(answers, [(ids[0], Ok(())), (ids[1], busy)], "{second:?}");
        assert_eq!(seen(&world).details.mode.as_deref(), Some("lock"), "{second:?}");
    }
}

/// In v2 a reset is a direction that is said three times: the next one takes its place, and each has its answer.
#[test]
fn a_reset_takes_the_place_of_the_one_before() {
    let (mut world, places) = controlled(Generation::V2);
    world.answers.clear();
    let ids = [ResetMode::PitchDownUp, ResetMode::PitchAndYaw]
        .map(|mode| world.ask_by_name("camera", &Asked::Operation(Operation::Reset(mode))));
    run(&mut world, places, 4 * SECOND);

    assert_eq!(world.answers, ids.map(|id| (id, Ok(()))));
    assert_looks(&world, 0.0, 0.0);
}

/// A yaw from the nose only.
fn turn_to(world: &mut World, yaw: f64) {
    let yaw = AxisDemand { angle: Some(Angle::from_degrees(yaw)), rate: None };
    let (roll, pitch) = (AxisDemand::default(), AxisDemand::default());
    let asked = Asked::Point { roll, pitch, yaw, yaw_frame: YawFrame::Vehicle };
    let id = world.ask_by_name("camera", &asked);
    assert_eq!(world.answers.last(), Some(&(id, Ok(()))));
}

/// "Some clients stream zero rates while nobody touches the stick": that ends nothing that the gimbal does by a function of its
/// own, neither while it is asked for nor while it is on its way.
#[test]
fn a_stick_at_rest_undoes_no_function_of_its_own() {
    for generation in [Generation::V1, Generation::V2] {
        for (reset, expected) in [(ResetMode::PitchAndYaw, (0.0, 0.0)), (ResetMode::Yaw, (-40.0, 0.0))] {
            let (mut world, places) = running(generation);
            point(&mut world, -40.0, 60.0);
            run(&mut world, places, 6 * SECOND);
            let asked = Asked::Operation(Operation::Reset(reset));
            let id = world.ask_by_name("camera", &asked);
            let zeros = set_pitchyaw(NAN, NAN, 0.0, 0.0, 44);
            let beat = (SECOND, places.ground, GCS, ground_heartbeat());
            world.run_with(8 * SECOND, &[beat, (SECOND / 10, places.ground, GCS, zeros)]);
            assert!(world.answers.contains(&(id, Ok(()))), "{generation:?} {reset:?} {:?}", world.answers);
            assert_looks(&world, expected.0, expected.1);
        }
    }
}
